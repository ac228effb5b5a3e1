"""Motion blocks of Heidenhain conversational text in columns.

The lexer of word-address text reads them, once what is no word is blanked in a copy of the text: block
numbers, the names of blocks, comments, and whole statements. What says more than a letter becomes a letter
that the language does not use, at its own place: `IX` the letter D, `DR+` the word K+1, `FMAX` the word F-1,
`R0` the word G0. Where a program has such a letter itself, its line is odd.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask
from olp.core.progress import Progress
from olp.core.values import dataclass
from olp.program.heidenhain.statements import OPERANDS
from olp.program.rs274.block_text import BlockText
from olp.program.rs274.lexer import CHUNK, WordChunk, lex

Bytes = npt.NDArray[np.uint8]

_TEXT = BlockText()
_POW10 = 10.0 ** np.arange(19)


class Block(IntEnum):
    """What a line is."""

    EMPTY = 0  #: no statement: blank, or a comment
    LINE = 1  #: L, and blocks of bare words
    ARC = 2  #: C
    RADIUS = 3  #: CR
    POLAR = 4  #: CP
    POLE = 5  #: CC
    STATEMENT = 6  #: any other
    MORE = 7  #: goes on with the statement of the line before
    DIRECTED = 8  #: LN, a straight move with the direction of the tool


#: the letters that stand for words of several: incremental X, Y, Z, and an incremental rotary axis
_STEP_OF = {ord("X"): ord("D"), ord("Y"): ord("E"), ord("Z"): ord("H")}
OTHER_STEP = ord("T")
#: The letter of a turn of the coordinates.
TURN = ord("K")
#: the letter of a side of the contour; its number is 0 for R0, 1 for RL, 2 for RR
SIDE = ord("G")
#: The letter of an incremental angle.
STEP_ANGLE = ord("P")
#: The letter of an angle.
ANGLE = ord("O")
#: The letters of a direction of the tool: TX, TY, TZ.
DIRECTION = b"IJL"
#: The letter of a component of the normal of a surface: NX, NY, NZ.
NORMAL = ord("N")
#: The letter of a feed that is a parameter.
PARAMETER_FEED = ord("Q")
_LONGEST_NAME = 2


def _table(letters: bytes) -> Mask:
    table = np.zeros(256, bool)
    table[list(letters)] = True
    return table


_LETTER = _table(b"ABCDEFGHIJKLMNOPQRSTUVWXYZ")
_NUMERIC = _table(b"+-.0123456789")
_VALUE = _table(b"+-.0123456789Q")
_AXIS = _table(b"XYZABCUVW")
#: Bytes by which a line begins behind its number: 1 in a table of all.
_SOLID = bytes(byte > 32 and byte not in b"0123456789" for byte in range(256))
#: The same of the letters that stand for something else here, and of brackets.
_TAKEN = bytes(byte in b"DEHTKPOQG()" for byte in range(256))
#: The same of the letters in each word of several.
_SPELLED = bytes(byte in b"RDPIMUFTN" for byte in range(256))
#: FAUTO: the feed of the TOOL CALL
_AUTOMATIC = re.compile(rb"F([ \t]?)AUTO\Z")
#: The number of a side by its second letter, 255 for none.
_SIDES = np.full(256, 255, np.uint8)
_SIDES[list(b"0LR")] = list(b"012")
_STEPS = np.full(256, OTHER_STEP, np.uint8)
for _axis, _letter in _STEP_OF.items():
    _STEPS[_axis] = _letter
_PLAIN = np.arange(256, dtype=np.uint8)
for _axis, _letter in _STEP_OF.items():
    _PLAIN[_letter] = _axis
_IS_STEP = _table(bytes(_STEP_OF.values()))
_IS_VECTOR = _table(bytes((*DIRECTION, NORMAL)))


@dataclass(frozen=True, slots=True, eq=False)
class Blocks:
    """Lines of a text: the words of their motion blocks, (lines,) `block`, what each is, and (words,) `value`
    and whether it is a `step` (IX, IY, IZ). Its letters are X, Y, Z for these too."""

    words: WordChunk
    letter: Bytes
    block: npt.NDArray[np.uint8]
    value: Array
    step: Mask

    def number(self, line: int) -> int:
        """The line of the text, from 1."""
        return self.words.first_line + line + 1


def blocks(data: bytes, tell: Progress, size: int = CHUNK, *, directed: bool = False) -> Iterator[Blocks]:
    """A whole text, chunk by chunk, each ending at the end of a statement. LN is a motion block where the
    tool may be `directed`."""
    text = np.frombuffer(data, np.uint8)
    start = line = 0
    while start < len(data):
        cut = len(data)
        if start + size < len(data):
            cut = _statement_end(data, start + size)
        chunk = read(text[start:cut], start, line, directed=directed)
        line += len(chunk.block)
        start = cut
        yield chunk
        tell("read", cut / len(data))


def _statement_end(data: bytes, position: int) -> int:
    """Behind the line of a byte, and behind those in which its statement goes on."""
    begin = position
    while True:
        newline = data.find(b"\n", begin)
        if newline < 0:
            return len(data)
        line = data.rfind(b"\n", 0, newline) + 1
        if not data[line:newline].rstrip().endswith(b"~"):
            return newline + 1
        begin = newline + 1


def read(text: Bytes, offset: int = 0, first_line: int = 0, *, directed: bool = False) -> Blocks:
    """Whole lines; `offset` and `first_line` are where they begin in the text, `directed` as in `blocks`."""
    work = np.frombuffer(bytearray(text.tobytes().upper() + b"\n\n\n\n"), np.uint8)
    newline = np.flatnonzero(text == 10)
    ends = newline if newline.size and newline[-1] == len(text) - 1 else np.append(newline, len(text))
    starts = np.concatenate(([0], ends[:-1] + 1))
    goes_on = _continued(work, starts, ends)
    _blank(work, *_comments(work, starts, ends))
    _without_operands(work)
    block, content = _named(work, starts, ends, directed)
    block[1:][goes_on[:-1]] = Block.MORE
    motion = ((block >= Block.LINE) & (block <= Block.POLE)) | (block == Block.DIRECTED)
    _blank(work, starts, np.where(motion, content, ends))
    body = work[: len(text)]
    strange = _found(body, _TAKEN)
    at, towards = _found(body, _SPELLED), block == Block.DIRECTED
    known = _spelled(work, at)
    if towards.any():
        _vectors(work, at[towards[np.searchsorted(ends, at)]], known)
    strange = strange[~known[strange]]
    words = lex(body, _TEXT, offset, first_line, strange=strange)
    letter = _PLAIN[words.letter]
    step = _IS_STEP[words.letter]
    if step.any():
        # a word of a step begins with its I
        words.start[step] -= 1
    if towards.any():
        words.start[_IS_VECTOR[letter]] -= 1
    value = np.asarray(words.mantissa / _POW10[words.decimals], float)
    return Blocks(words, letter, block, value, step)


def _found(work: Bytes, table: bytes) -> Index:
    """Where bytes are that have a 1 in a table."""
    return np.flatnonzero(np.frombuffer(work.tobytes().translate(table), np.bool_))


def _continued(work: Bytes, starts: Index, ends: Index) -> Mask:
    """(lines,) whether the statement of a line goes on in the next one: the line ends with `~`."""
    if not (work == ord("~")).any():
        return np.zeros(len(starts), bool)
    solid = np.flatnonzero(work > 32)
    last = solid[np.maximum(np.searchsorted(solid, ends) - 1, 0)]
    return np.asarray((last >= starts) & (last < ends) & (work[last] == ord("~")))


def _comments(work: Bytes, starts: Index, ends: Index) -> tuple[Index, Index]:
    """Where comments begin and end."""
    marks = np.flatnonzero(work == ord(";"))
    line = np.searchsorted(ends, marks)
    first = np.ones(len(marks), bool)
    first[1:] = line[1:] != line[:-1]
    return marks[first], ends[line[first]]


def _without_operands(work: Bytes) -> None:
    """Blank the words that belong to an M function: M118 Z5 is no move, M103 F20 no feed."""
    text = work.tobytes()
    if b"M1" in text and any(name in text for name in (b"M101", b"M103", b"M118", b"M120")):
        for match in OPERANDS.finditer(text):
            work[match.start(2) : match.end(2)] = 32


def _blank(work: Bytes, begin: Index, end: Index) -> None:
    """Blank stretches that do not overlap."""
    length = end - begin
    shift = begin - (np.cumsum(length) - length)
    work[np.arange(int(length.sum())) + np.repeat(shift, length)] = 32


def _named(work: Bytes, starts: Index, ends: Index, directed: bool) -> tuple[npt.NDArray[np.uint8], Index]:
    """(lines,) what each line is, and where its words begin, behind its number and its name."""
    solid = np.append(_found(work, _SOLID), len(work) - 1)
    head = solid[np.searchsorted(solid, starts)]
    some = head < ends
    head = np.minimum(head, len(work) - 4)
    a, b, c = (work[head + k] for k in range(3))
    block = np.where(some, np.uint8(Block.STATEMENT), np.uint8(Block.EMPTY))
    block[some & (a == ord("*"))] = Block.EMPTY
    bare = (_AXIS[a] & _VALUE[b]) | ((a == ord("I")) & _AXIS[b]) | ((a == ord("M")) & _NUMERIC[b])
    bare |= (a == ord("F")) & (_VALUE[b] | (b <= 32) | ((b == ord("M")) & (c == ord("A"))))
    length = np.zeros(len(starts), np.int64)
    for name, kind in ((b"L", Block.LINE), (b"C", Block.ARC)):
        mine = some & (a == name[0]) & (b <= 32)
        block[mine], length[mine] = kind, 1
    names = [(b"CR", Block.RADIUS), (b"CP", Block.POLAR), (b"CC", Block.POLE)]
    for name, kind in [*names, (b"LN", Block.DIRECTED)] if directed else names:
        mine = some & (a == name[0]) & (b == name[1]) & ~_LETTER[c]
        block[mine], length[mine] = kind, _LONGEST_NAME
    block[some & bare] = Block.LINE
    return block, head + length


def _spelled(work: Bytes, at: Index) -> Mask:
    """Put one letter for each word of several, whose letters are `at` some bytes; returns which bytes were
    understood."""
    known = np.zeros(len(work), bool)

    def now(letter: str, following: str = "") -> Index:
        here: Index = at[work[at] == ord(letter)]
        for k, other in enumerate(following):
            here = here[work[here + (k + 1)] == ord(other)]
        return here

    side = now("R")
    side = side[(_SIDES[work[side + 1]] < 255) & ~_NUMERIC[work[side + 2]]]
    side = side[~_LETTER[work[np.maximum(side - 1, 0)]] | (side == 0)]
    work[side], work[side + 1] = SIDE, _SIDES[work[side + 1]]
    turn = now("D", "R")
    turn = turn[(work[turn + 2] == ord("+")) | (work[turn + 2] == ord("-"))]
    known[turn] = True
    work[turn], work[turn + 1], work[turn + 2] = TURN, work[turn + 2], ord("1")
    for i in now("P", "A").tolist():
        stepped = i > 0 and work[i - 1] == ord("I")
        work[i - stepped : i + 2] = 32
        known[i] = True
        work[i + 1] = STEP_ANGLE if stepped else ANGLE
    step = now("I")
    step = step[_AXIS[work[step + 1]]]
    work[step + 1] = _STEPS[work[step + 1]]
    work[step] = 32
    _rapid(work, now("M", "AX"))
    for i in now("U", "TO").tolist():
        match = _AUTOMATIC.search(work[max(i - 4, 0) : i + 3].tobytes())
        if match is not None:
            # a feed that only the control knows
            work[i - 1 - len(match[1]) - 1 : i + 3] = 32
            work[i + 1 : i + 3] = list(b"Q0")
            known[i + 1 : i + 3] = True
    near = now("F", "Q")
    far = now("F")
    far = far[(work[far + 1] <= 32) & (work[far + 2] == PARAMETER_FEED)]
    work[near] = work[far] = 32
    known[near + 1] = known[far + 2] = True
    return known


def _vectors(work: Bytes, at: Index, known: Mask) -> None:
    """Put one letter for TX and such, whose letters are `at` some bytes, and note the bytes as `known`."""
    for name, letters in ((ord("T"), DIRECTION), (ord("N"), bytes((NORMAL,) * 3))):
        begin = at[work[at] == name]
        for axis, letter in zip(b"XYZ", letters, strict=True):
            own = begin[work[begin + 1] == axis]
            work[own], work[own + 1], known[own] = 32, letter, True


def _rapid(work: Bytes, at: Index) -> None:
    """Put F-1 for FMAX, whose MAX is `at` some bytes."""
    before = work[np.maximum(at - 1, 0)]
    joined = before == ord("F")
    spaced = (before <= 32) & (work[np.maximum(at - 2, 0)] == ord("F"))
    near, far = at[joined], at[spaced]
    work[near], work[near + 1], work[near + 2] = list(b"-01")
    work[far - 2], work[far - 1] = 32, ord("F")
    work[far], work[far + 1], work[far + 2] = list(b"-01")


__all__ = [
    "ANGLE",
    "DIRECTION",
    "NORMAL",
    "OTHER_STEP",
    "PARAMETER_FEED",
    "SIDE",
    "STEP_ANGLE",
    "TURN",
    "Block",
    "Blocks",
    "blocks",
    "read",
]
