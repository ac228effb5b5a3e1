"""Words that belong to a whole move, as that of an extruder: where a move is split, each part gets its share.

The total is that of the program to the last digit: the parts of a distance add up to it, and a position is
reached at the end of the last part.
"""

from __future__ import annotations

import numpy as np

from olp.compensation.digits import INT10
from olp.compensation.rows import Rows
from olp.compensation.writer import Writer
from olp.core.arrays import any_in_row
from olp.program.text.edits import Edits

#: Digits of shares, at least: those of slicers.
_LEAST_DECIMALS = 5
#: Order of the word in an inserted block, behind ends and centres.
_BEHIND = 6
#: The same in a block in front, before its feed and its line end.
_BEFORE_END = 4


def shared_edits(writer: Writer, rows: Rows) -> list[Edits]:
    """The shares of the words of moves that are split in these rows."""
    shared, words = writer.program.shared, writer.words
    if not len(shared.word):
        return []
    several = np.zeros(len(rows.move), bool)
    several[1:] = rows.move[1:] == rows.move[:-1]
    several[:-1] |= several[1:]
    line = writer.path.line[rows.move].astype(np.int64)
    word = shared.word[line - 1]
    # from an unknown position no share of one can be written
    known = (word >= 0) & ~np.isnan(shared.before[line - 1])
    row = np.flatnonzero(several & known & (rows.head | rows.arc | any_in_row(rows.write)))
    if not len(row):
        return []
    word, line, move = word[row], line[row], rows.move[row]
    last = np.append(move[1:] != move[:-1], True)
    reach = np.where(last, 1.0, writer.plan.reach[rows.first + row])
    decimals = np.maximum(words.decimals[word].astype(np.int64), _LEAST_DECIMALS)
    whole = words.mantissa[word] * INT10[decimals - words.decimals[word]]
    before = shared.before[line - 1] * INT10[decimals]
    value = np.where(last, whole, np.rint(before + reach * (whole - before))).astype(np.int64)
    first = np.append(True, last[:-1])
    reached = np.where(first, np.rint(before).astype(np.int64), np.append(0, value[:-1]))
    mantissa = np.where(shared.distance[line - 1], value - reached, value)
    head = rows.head[row]
    tail = ~head
    ahead, number = rows.before[row[tail]], line[tail] - 1
    place = np.where(ahead, writer.program.line_start[number], writer.program.line_end[number])
    order = (row[tail] * 8 + 16 + np.where(ahead, _BEFORE_END, _BEHIND)).astype(np.int32)
    letter = np.frombuffer(writer.program.data, np.uint8)[words.start[word]]
    prefix = np.array([writer.prefixes(b" " + bytes([each])) for each in letter[tail].tolist()], np.int32)
    own = word[head]
    return [
        Edits.of(words.number[own], words.end[own], mantissa[head], decimals[head]),
        Edits.of(place, place, mantissa[tail], decimals[tail], prefix, order),
    ]
