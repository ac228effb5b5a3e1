"""Sinumerik text in words of the RS-274 family: the same bytes where a line is words, other words of the same
length where it is not, and actions beside it.

Lines of plain words, most of those that CAM systems write, are found in columns and are left as they are.
"""

from __future__ import annotations

import re
import string
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Index, Mask, distinct
from olp.core.errors import ProgramError
from olp.program.rs274.translation import Drilling, Translation
from olp.program.sinumerik.blocks import Block, block_of, without_comment
from olp.program.sinumerik.refusals import parametric
from olp.program.sinumerik.words import Words

Bytes = npt.NDArray[np.uint8]

_VARIABLE = rb"[A-Z_][A-Z0-9_]*[ \t]*(?:=[ \t]*[-+]?(?:\d+\.?\d*|\.\d+)[ \t]*)?"
#: variables, without values or with numbers
_DECLARED = re.compile(
    rb"[ \t]*(?:N\d+)?[ \t]*DEF[ \t]+(INT|REAL|BOOL|CHAR|STRING[ \t]*\[\d+\])[ \t]+"
    rb"(" + _VARIABLE + rb"(?:,[ \t]*" + _VARIABLE + rb")*)\s*", re.IGNORECASE,
)  # fmt: skip
#: Letters of words that mean the same in both languages.
_PLAIN = b"NGXYZFIJKMSTABCUVW"
_LETTER = np.isin(np.arange(256), list(string.ascii_letters.encode()))
#: 1 for letters, in a table of all bytes.
_LETTERS = _LETTER.tobytes()
#: The same for bytes that make a line more than words.
_OTHERS = bytes(byte not in b"0123456789+-. \t\r\n;/" + _PLAIN + _PLAIN.lower() for byte in range(256))
#: Letters of words that take their number with `=` too.
_WITH_SIGN = np.zeros(256, bool)
_WITH_SIGN[list(b"XYZIJKFSTABCUVWxyzijkfstabcuvw")] = True
_NAME = _LETTER.copy()
_NAME[list(b"0123456789_$[]")] = True
#: The same table for bytes of numbers.
_NUMBERS = bytes(byte in b"0123456789." for byte in range(256))
_BLANK = np.zeros(256, bool)
_BLANK[list(b" \t")] = True
#: What may be behind a word.
_BEHIND = _LETTER.copy()
_BEHIND[list(b";\r\n")] = True
#: blanks behind a number that are passed over, at most; more make the line one of pieces
_BLANKS = 30
#: G and M codes of a plain line, by their number.
_SAME_G = np.isin(np.arange(100), [0, 1, 2, 3, 9, 17, 18, 19, 40, *range(53, 58), 90, 91, 93, 94, 95, 96, 97])
_SAME_M = ~np.isin(np.arange(100), [6, 17, 70, 97, 98, 99])


def translate(data: bytes, *, tips: bool = False) -> Translation:
    """A whole text. Lines that cannot be read are `refused` in the result; nothing is raised. `tips`: words
    may state the tip of the tool, on a machine with rotary axes."""
    text = np.frombuffer(data, np.uint8)
    starts, ends = _line_spans(text)
    signs, radius = _numbers(text)
    lines = _special(text, starts, signs, radius)
    if not lines.size and not signs.size:
        return Translation(data)
    out = bytearray(data)
    canonical = np.frombuffer(out, np.uint8)
    canonical[signs] = 32
    canonical[radius - 1] = 32
    canonical[radius - 2] = ord("R")
    del canonical
    words = Words(tips=tips)
    for line in lines.tolist():
        start = int(starts[line])
        code = without_comment(data[start : int(ends[line])])
        if not code.strip() or code.lstrip().startswith(b"%"):
            continue
        number = line + 1
        block: Block | None = None
        declared = _DECLARED.fullmatch(code)
        if declared is not None:
            words.constants.declare(declared[1], declared[2])
            out[start : start + len(code)] = b" " * len(code)
            continue
        try:
            block = block_of(code)
        except ProgramError as error:
            words.refuse(parametric(code) or error, number)
        canon = words.line(code, block, start, number)
        out[start : start + len(code)] = canon
    refused, actions = words.refused, words.actions
    return Translation(
        text=bytes(out),
        refused=refused,
        actions=actions,
        drillings=_by_line(words, len(starts)),
        counted=words.counted,
        central=np.array(words.central, np.int64),
        closings=np.array(words.closings, np.int64),
    )


def _by_line(words: Words, lines: int) -> dict[int, Drilling]:
    """The cycle that each line calls behind its motion, or by itself."""
    table: dict[int, Drilling] = {}
    changes = [*words.modal, (lines + 1, None)]
    for (line, drilling), (stop, _) in pairwise(changes):
        if drilling is not None:
            table |= dict.fromkeys(range(line + 1, stop), drilling)
    return table | words.calls


def _line_spans(text: Bytes) -> tuple[Index, Index]:
    newline = np.flatnonzero(text == 10)
    ends = newline if newline.size and newline[-1] == len(text) - 1 else np.append(newline, len(text))
    return np.concatenate(([0], ends[:-1] + 1)), ends


def _numbers(text: Bytes) -> tuple[Index, Index]:
    """The `=` between a letter and a number, as in X=5, and those of them that are in CR=5."""
    signs = np.flatnonzero(text == ord("="))
    signs = signs[(signs >= 1) & (signs < len(text) - 1)]
    if not signs.size:
        return signs, signs
    last, second, third = (text[signs - k] for k in (1, 2, 3))
    # an index below zero is one from the end
    second[signs < 2], third[signs < 3] = ord("\n"), ord("\n")
    alone = _WITH_SIGN[last] & ~_NAME[second]
    radius = ((last | 32) == ord("r")) & ((second | 32) == ord("c")) & ~_NAME[third]
    kept = alone | radius
    signs, radius = signs[kept], radius[kept]
    number = _marked(text, _NUMBERS)
    ahead = text[signs + 1]
    first = signs + 1 + ((ahead == ord("-")) | (ahead == ord("+")))
    some = (first < len(text)) & number[np.minimum(first, len(text) - 1)]
    signs, radius, first = signs[some], radius[some], first[some]
    # the last bytes of numbers
    stop = np.append(np.flatnonzero(number[:-1] > number[1:]), len(text) - 1)
    after = stop[np.searchsorted(stop, first)] + 1
    # an expression goes on behind blanks too
    for _ in range(_BLANKS):
        blank = np.flatnonzero((after < len(text)) & _BLANK[text[np.minimum(after, len(text) - 1)]])
        if not blank.size:
            break
        after[blank] += 1
    good = (after >= len(text)) | _BEHIND[text[np.minimum(after, len(text) - 1)]]
    return signs[good], signs[good & radius]


def _marked(text: Bytes, table: bytes) -> Mask:
    """(bytes,) the entry of each byte in a table of zeros and ones."""
    return np.frombuffer(text.tobytes().translate(table), np.bool_)


def _special(text: Bytes, starts: Index, signs: Index, radius: Index) -> Index:
    """The lines, from 0, that are more than plain words before their comment, and words with `signs` before
    their numbers."""
    letter = _marked(text, _LETTERS)
    special = _marked(text, _OTHERS).copy()
    special[signs] = False
    pairs = letter[:-1] & letter[1:]
    pairs[radius - 2] = False
    special[radius - 1] = False
    special[:-1] |= pairs
    at = np.flatnonzero(special)
    at = np.concatenate((at, _codes(text, ord("g"), _SAME_G, 9), _codes(text, ord("m"), _SAME_M, 99)))
    if not at.size:
        return at
    lines = np.searchsorted(starts, at, "right") - 1
    comments = np.flatnonzero(text == 59)
    if comments.size:
        owner = np.searchsorted(starts, comments, "right") - 1
        first = np.full(len(starts), len(text), np.int64)
        first[owner[::-1]] = comments[::-1]
        lines = lines[at < first[lines]]
    return distinct(lines)


def _codes(text: Bytes, letter: int, same: Mask, longest: int) -> Index:
    """Where words of a letter are that mean something else here, or more than `longest` says by digits."""
    at = np.flatnonzero((text | 32) == letter)
    if not at.size:
        return at
    last = len(text) - 1
    a, b, c = (text[np.minimum(at + k, last)].astype(np.int64) - 48 for k in (1, 2, 3))
    one, two, three = ((d >= 0) & (d <= 9) for d in (a, b, c))
    number = np.where(two, a * 10 + b, a)
    good = one & same[np.clip(number, 0, 99)] & (b != -2) & ~(two & (c == -2))
    good &= ~(two & three) if letter == ord("g") else ~(two & three) | (a > 0)
    return np.asarray(at[~good])
