"""Inserted blocks: the later parts of subdivided moves, and words of the old block that change with them.

Each part is a new line behind the block, or in front of it to take up backlash before an arc.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from olp.compensation.rows import Rows
from olp.compensation.writer import Writer
from olp.core.arrays import Array, Index, Mask, any_in_row, distinct, is_in
from olp.core.errors import ProgramError
from olp.core.toolpath import Flag, Kind
from olp.program.program import Program
from olp.program.rs274.codes import (
    ABSOLUTE,
    FURTHER_OFFSETS,
    INCREMENTAL,
    LENGTHS,
    SHIFTS,
    UNITS,
    WORK_OFFSETS,
)
from olp.program.text.edits import BARE, EditList, Edits

#: Codes that a block must not set together with an arc that a step comes before.
_CHANGES = WORK_OFFSETS | FURTHER_OFFSETS | LENGTHS | SHIFTS | {*UNITS, ABSOLUTE, INCREMENTAL}
#: G9: an exact stop at the end of its block.
_STOP = 9
#: Least share of the time of a block that a part gets.
_LEAST_SHARE = 1e-6


def block_edits(writer: Writer, rows: Rows, tails: Index) -> list[Edits]:
    """New blocks for the later parts of subdivided moves; plain words, modal codes hold."""
    line_no = writer.path.line[rows.move[tails]]
    arc = rows.arc[tails]
    straight = ~arc | rows.take_up[tails]
    before = rows.before[tails]
    place = np.where(
        before, writer.program.line_start[line_no - 1], writer.program.line_end[line_no - 1]
    ).astype(np.int64)
    rapid = writer.path.kind[rows.move[tails]] == Kind.RAPID
    lead = _leads(writer, line_no, arc & straight, before, rapid)
    write = rows.write[tails]
    first_axis = np.where(any_in_row(write), write.argmax(axis=1), -1)
    columns: list[Edits] = []
    for axis in range(3):
        chosen = np.flatnonzero(write[:, axis] & straight)
        letter = b"XYZ"[axis : axis + 1]
        begins = first_axis[chosen] == axis
        prefix = np.full(len(chosen), writer.prefixes(b" " + letter), np.int32)
        starts = {
            int(p): writer.prefixes(writer.prefixes.table[int(p)] + letter)
            for p in distinct(lead[chosen[begins]])
        }
        prefix[begins] = [starts[int(p)] for p in lead[chosen[begins]]]
        row = tails[chosen]
        columns.append(
            Edits(
                place[chosen], place[chosen], rows.mantissa[row, axis], rows.decimals[row, axis], prefix,
                (row * 8 + 16 + axis).astype(np.int32),
            )
        )  # fmt: skip
    empty = (first_axis < 0) & straight
    # a part whose rounded end is where it began needs no block
    np.subtract.at(writer.parts, rows.move[tails[empty]], 1)
    edits = EditList(writer.prefixes)
    for i in np.flatnonzero(before & ~empty).tolist():
        start, tail, line = int(place[i]), int(tails[i]), int(line_no[i])
        _check_take_up(writer, rows, tail)
        suffix = _feed_of(writer, line) + writer.program.eol(line)
        edits.add(start, start, BARE, 0, suffix, rows.serial(tail) + 5)
        if rows.head[tail + 1]:
            _arc_word(writer, rows, tail + 1, edits)
    writer.tally.inserted_blocks += int((~empty).sum())
    _inverse_time(writer, rows, tails, edits)
    split = writer.path.line[rows.move[tails[~before]]].astype(np.int64)
    end_word_edits(writer.program, distinct(split), edits)
    return [*columns, edits.done()]


def _leads(writer: Writer, line_no: npt.NDArray[np.int32], turning: Mask, before: Mask, rapid: Mask) -> Index:
    """Prefix of the first word of each inserted block: line end, `/` and the code of the move, where that in
    force is another one or none holds from line to line."""
    commands = writer.program.rs274.commands is not None
    prefixes = writer.prefixes
    starts, which = writer.style.block_starts(line_no)
    table = np.zeros((len(starts), 4), np.int64)
    for i, start in enumerate(starts):
        deleted = b"/" if start.endswith(b"/") else b""
        leads = (start, start + b"G1 ", deleted + b"G1 ", start + b"G0 ")
        table[i] = [prefixes(lead) for lead in leads]
    plain = np.where(rapid, 3, 1) if commands else np.where(turning, 1, 0)
    return np.asarray(table[which, np.where(before, 2, plain)], np.int64)


def _check_take_up(writer: Writer, rows: Rows, row: int) -> None:
    if rows.flag[row] & np.uint8(Flag.INVERSE_TIME):
        raise ProgramError(
            "before this arc in G93 a step has to take up backlash, and G93 gives no time for it; program "
            "the arc in G94",
            line=int(writer.path.line[rows.move[row]]),
            code="OLP561",
        )
    line = int(writer.path.line[rows.move[row]])
    words = writer.words
    for i in words.of_line(line):
        code = int(words.mantissa[i]) * 10 // 10 ** int(words.decimals[i])
        if words.letter[i] == ord("G") and code in _CHANGES:
            raise ProgramError(
                f"before this arc a step has to take up backlash, and its block sets G{code / 10:g} too; put "
                "that code into a block of its own before it",
                line=line,
                code="OLP561",
            )


def _feed_of(writer: Writer, line: int) -> bytes:
    """The F word of a block, for the block that is put before it."""
    index = writer.style.word(line, "F")
    if index is None:
        return b""
    return b" " + writer.program.data[int(writer.words.start[index]) : int(writer.words.end[index])]


def _arc_word(writer: Writer, rows: Rows, row: int, edits: EditList) -> None:
    """G2 or G3 for an arc block that relied on the modal code which the block before it changed."""
    move = int(rows.move[row])
    line = int(writer.path.line[move])
    arc = np.searchsorted(writer.path.arcs.move, [move])
    code = 2 if writer.clockwise(np.array([move]), writer.path.arcs.plane[arc])[0] else 3
    index = writer.words.of_line(line)
    if any(
        writer.words.letter[i] == 71 and writer.words.mantissa[i] == code and not writer.words.decimals[i]
        for i in index
    ):
        return
    slot = writer.program.slot[move]
    first = [int(writer.words.start[s]) for s in slot if s >= 0]
    start = min(first or [int(writer.words.start[i]) for i in index if writer.words.letter[i] != ord("N")])
    edits.add(start, start, BARE, 0, b"G%d " % code, rows.serial(row - 1) + 6)


def _inverse_time(writer: Writer, rows: Rows, tails: Index, edits: EditList) -> None:
    """In G93 every part of a block gets its share of the time: F grows by what its path shrinks."""
    timed = np.flatnonzero((rows.flag[tails] & np.uint8(Flag.INVERSE_TIME)) != 0)
    for move in distinct(rows.move[tails[timed]]).tolist():
        part = np.flatnonzero(rows.move == move)
        line = int(writer.path.line[move])
        index = writer.style.word(line, "F")
        if index is None:
            raise ProgramError(
                "this block in G93 has no F word; expected one in every block", line=line, code="OLP561"
            )
        value = float(writer.words.mantissa[index]) / 10.0 ** int(writer.words.decimals[index])
        reach = writer.plan.reach[rows.first + part]
        share = np.diff(reach, prepend=0.0)
        # what only takes up backlash takes time as its length does
        share = np.maximum(np.where(share > 0.0, share, _lengths(writer, rows, part)), _LEAST_SHARE)
        decimals = max(int(writer.words.decimals[index]), 4)
        feeds = np.rint(value / share * 10**decimals).astype(np.int64)
        place = int(writer.program.line_end[line - 1])
        kept = [i for i, r in enumerate(part.tolist()) if rows.head[r] or rows.write[r].any()]
        for i in kept:
            row = int(part[i])
            if rows.head[row]:
                start, end = int(writer.words.number[index]), int(writer.words.end[index])
                prefix, order = b"", 0
            else:
                start = end = place
                prefix, order = b" F", rows.serial(row) + 5
            edits.add(start, end, int(feeds[i]), decimals, prefix, order)


def _lengths(writer: Writer, rows: Rows, part: Index) -> Array:
    """(m,) the lengths of parts of one move, as shares of all of them."""
    command = writer.plan.command_mm[rows.first + part]
    before = rows.first + int(part[0]) - 1
    start = writer.plan.command_mm[before] if before >= 0 else np.array(writer.path.start_mm)
    length = np.nan_to_num(np.linalg.norm(np.diff(np.vstack((start, command)), axis=0), axis=1))
    arcs, move = writer.path.arcs, int(rows.move[part[0]])
    arc, turned = int(np.searchsorted(arcs.move, move)), 0.0
    if arc < len(arcs) and arcs.move[arc] == move:
        radius = np.sqrt(np.nansum((command[0] - arcs.centre_mm[arc]) ** 2))
        turned = float(radius * abs(arcs.sweep_rad[arc]))
    return np.asarray(length / max(float(length.sum()), turned, _LEAST_SHARE))


def end_word_edits(program: Program, lines: Index, edits: EditList) -> None:
    """M words that act after the motion of their block, and G9, which stops at its end, go from the first
    part to the last, on lines whose moves are split."""
    words = program.words
    assert words is not None
    if not lines.size:
        return
    first, last = int(words.first_word[lines[0] - 1]), int(words.first_word[lines[-1]])
    part = slice(first, last)
    letter, code = words.letter[part], words.mantissa[part]
    late = is_in(code, list(program.rs274.late_m))
    ending = (letter == ord("M")) & late | (letter == ord("G")) & (code == _STOP)
    index = first + np.flatnonzero(ending & (words.decimals[part] == 0))
    # of the same type: another would be that of a copy of the whole column
    line = np.searchsorted(words.first_word, index.astype(words.first_word.dtype), "right")
    for i, number in zip(index.tolist(), line.tolist(), strict=True):
        if lines[min(np.searchsorted(lines, number), len(lines) - 1)] != number:
            continue
        place = int(program.line_end[number - 1])
        start, end = int(words.start[i]), int(words.end[i])
        edits.add(start, end, BARE, 0)
        # behind all other words, in their order
        order = 2**30 + i - int(words.first_word[number - 1])
        edits.add(place, place, BARE, 0, b" " + program.data[start:end], order)
