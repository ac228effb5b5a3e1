"""Which words may stand in one block: modal groups, words that need a code, and codes that need words.

A control refuses a block that breaks these rules, or takes the words in a way that is not known. So such a
block is refused here, many lines at a time.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field
from functools import cache

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Index, Mask, distinct, is_in
from olp.core.errors import ProgramError
from olp.core.values import dataclass
from olp.program.rs274.codes import (
    AXIS_VALUES,
    COMMON_CYCLES,
    COMPENSATION_OFF,
    CUTTER_COMPENSATION,
    DWELL,
    GROUPS,
    HOMES,
    LENGTHS,
    MACHINE,
    PATH_MODES,
    PROBES,
    SHIFTS,
    THREAD,
    UNITS,
    WORK_OFFSETS,
    WRITE_OFFSET,
)
from olp.program.rs274.lexer import WordChunk

#: A line of the chunk from 0, why it is refused, the code of that, and the letter of a word that goes alone.
Refusal = tuple[int, str, str, str]
Bits = npt.NDArray[np.int32]
Codes = npt.NDArray[np.int16]

#: M codes are keyed by this plus ten times their number.
M = 10_000
_ARCS = frozenset({20, 30})


@cache
def _bits(letters: str) -> int:
    return sum(1 << (ord(letter) - 65) for letter in letters)


_BIT = np.zeros(256, np.int32)
_BIT[65:91] = 1 << np.arange(26)
_AXES = _bits("XYZABCUVW")
_CENTRE = _bits("IJK")
#: Centre words of arcs by plane code.
_IN_PLANE = {170: _bits("IJ"), 180: _bits("IK"), 190: _bits("JK")}
#: Words of their ends.
_ENDS = {170: _bits("XY"), 180: _bits("XZ"), 190: _bits("YZ")}
#: All words that arcs take beside their ends.
_OF_ARCS = _CENTRE | _bits("R")
_MOTION = frozenset({0, 10, THREAD, *_ARCS, *COMMON_CYCLES, *PROBES})


def _table(codes: Iterable[int]) -> Mask:
    """(2 M,) whether a key is one of these codes."""
    table = np.zeros(2 * M, bool)
    table[list(codes)] = True
    return table


_MOTIONS = _table(_MOTION)
#: Codes that leave the words beside them to the motion: of M those of spindle, coolant and stops.
_MODES = _table({
    0, 10, *_ARCS, 90, 170, 180, 190, 900, 910, 930, 940, 950, 430, 440, 490, *UNITS, COMPENSATION_OFF,
    *CUTTER_COMPENSATION, *(M + 10 * number for number in (0, 1, 3, 4, 5, 7, 8, 9)),
})  # fmt: skip
#: Codes that take the axis words of their block for something else.
_STATING = _table(AXIS_VALUES | HOMES)


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockRules:
    """The rules of one control.

    - `users`: the codes that use a letter; beside no such code it is refused. Letters that are not here are
      free. Ten times the number of a G code, `M` plus ten times that of an M code.
    - `straight`, `round`: letters that a straight move and an arc may not have, unless the block has another
      code than those of modes. `in_plane`: then an arc has no centre along the axis across its plane, but 0.
    - `groups`: codes of which a block may have one.
    - `needs`: codes that need one of these letters.
    - `excludes`: codes that take one of two kinds of letters. `positive`: letters without a negative number.
    - `several`: letters of which a block may have several. `whole`: letters with integers. `alone`: a letter
      that is first in a block of its own. `number_first`: N is the first word of its line. `one_use_of_axes`:
      no motion code may be beside a code that uses the axis words for something else.
    """

    users: Mapping[str, frozenset[int]] = field(default_factory=dict)
    straight: str = ""
    round: str = ""
    in_plane: bool = False
    groups: tuple[frozenset[int], ...] = ()
    needs: Mapping[int, str] = field(default_factory=dict)
    excludes: Mapping[int, tuple[str, str]] = field(default_factory=dict)
    positive: str = ""
    several: str = "GM"
    whole: str = ""
    alone: str = ""
    number_first: bool = False
    one_use_of_axes: bool = False

    def tables(self) -> _Tables:
        """The rules by code."""
        allowed = np.zeros(2 * M, np.int32)
        for letter, codes in self.users.items():
            allowed[sorted(codes)] |= _bits(letter)
        group = np.full(2 * M, -1, np.int8)
        for number, codes in enumerate(self.groups):
            group[sorted(codes)] = number
        needed = np.zeros(2 * M, np.int32)
        for code, letters in self.needs.items():
            needed[code] = _bits(letters)
        positive = np.zeros(256, bool)
        positive[list(self.positive.encode())] = True
        return _Tables(self, allowed, group, needed, positive, sum(_bits(letter) for letter in self.users))


@dataclass(frozen=True, slots=True, eq=False)
class _Tables:
    """`allowed` (2 M,) are the letters that a code uses, as bits; `group` is that of a code, or -1. `needed`
    (2 M,) are the letters of which a code needs one, 0 for none. `bound` are those that need a user."""

    rules: BlockRules
    allowed: Bits
    group: npt.NDArray[np.int8]
    needed: Bits
    _positive: Mask
    bound: int

    def check(
        self, chunk: WordChunk, active: Mask, codes: tuple[Index, Index], motion: Codes, plane: Codes
    ) -> None:
        """Refuse all blocks of a chunk that break a rule, at once. `active` (lines,) are lines that count,
        `codes` the lines and keys of their G and M codes, `motion` and `plane` the codes in force by line."""
        present = _present(chunk)
        errors: dict[int, ProgramError] = {}
        for rule in (
            self._twice(chunk, active, present),
            self._groups(codes),
            self._lacking(codes, present),
            self._unused(active, codes, present, motion, plane),
            self._beside_moves(active, codes, present, motion),
            self._across(chunk, active, codes, motion, plane),
            self._negative(chunk, active),
            self._numbers(chunk, active),
            self._alone(chunk, active, present),
            self._broken(chunk, active),
        ):
            for line, why, code, word in rule:
                number = chunk.first_line + line + 1
                errors.setdefault(line, ProgramError(why, line=number, code=code, word=word))
        if errors:
            raise ProgramError.together(errors.values())

    def _twice(self, chunk: WordChunk, active: Mask, present: Bits) -> Iterator[Refusal]:
        words = np.diff(chunk.first_word)
        # mostly no line has more words than letters
        for line in np.flatnonzero(active & (np.bitwise_count(present) != words)).tolist():
            mine = chunk.letter[chunk.first_word[line] : chunk.first_word[line + 1]]
            letters = [letter for letter in map(chr, mine.tolist()) if letter not in self.rules.several]
            letter = next((x for x in letters if letters.count(x) > 1), "")
            if letter:
                yield line, f"the word {letter} is twice in this block; expected it once", "OLP515", ""

    def _groups(self, codes: tuple[Index, Index]) -> Iterator[Refusal]:
        line, key = codes
        group = self.group[key]
        some = np.flatnonzero(group >= 0)
        place = line[some] * 64 + group[some]
        order = np.argsort(place, kind="stable")
        place, some = place[order], some[order]
        for twice in distinct(place[1:][place[1:] == place[:-1]]).tolist():
            mine = some[slice(*np.searchsorted(place, (twice, twice + 1)))]
            names = " and ".join(_name(k) for k in key[mine].tolist())
            yield (
                twice // 64,
                f"{names} of one modal group are in this block; expected one of them",
                "OLP515",
                "",
            )

    def _unused(
        self, active: Mask, codes: tuple[Index, Index], present: Bits, motion: Codes, plane: Codes
    ) -> Iterator[Refusal]:
        if not self.bound:
            return
        probes = is_in(motion, PROBES)
        # most lines have neither a word that needs a user, nor one of an arc
        some = np.flatnonzero(active & (((present & (self.bound | _OF_ARCS)) != 0) | probes))
        if not some.size:
            return
        line, key = codes
        allowed = np.zeros(len(present), np.int32)
        np.bitwise_or.at(allowed, line, self.allowed[key])
        stating, moving = (_lines_of(table, codes, len(present))[some] for table in (_STATING, _MOTIONS))
        allowed, present, probes = allowed[some], present[some], probes[some]
        motion, plane = motion[some], plane[some]
        arcs = is_in(motion, _ARCS)
        moves = ((present & _AXES) != 0) | (arcs & ((present & _CENTRE) != 0))
        moves &= ~stating
        allowed[moves] |= self.allowed[np.maximum(motion[moves], 0)]
        # a code of this block moves without words, too
        moves |= moving
        outside = np.zeros(len(some), np.int32)
        radius = (present & _bits("R")) != 0
        for code, letters in _IN_PLANE.items():
            outside[plane == code] = _CENTRE & ~letters
            # through one point lead all circles of a radius
            outside[radius & (plane == code) & ((present & _ENDS[code]) == 0)] |= _bits("R")
        # a radius and a centre are two ways to say one thing
        outside[radius] |= _CENTRE
        outside[~(moves & arcs)] = 0
        # a probe needs a path of X, Y or Z
        outside[moves & probes & ((present & _bits("XYZ")) == 0)] = _AXES
        spare = (present & self.bound & ~allowed) | (present & outside)
        for row in np.flatnonzero(spare).tolist():
            letter = chr(64 + int(spare[row] & -spare[row]).bit_length())
            why = f"no code of this block uses its word {letter}; remove it, or give the code that does"
            yield int(some[row]), why, "OLP519", letter

    def _beside_moves(
        self, active: Mask, codes: tuple[Index, Index], present: Bits, motion: Codes
    ) -> Iterator[Refusal]:
        straight, around = _bits(self.rules.straight), _bits(self.rules.round)
        some = active & ((present & (straight | around)) != 0) & ((present & (_AXES | _CENTRE)) != 0)
        if not some.any():
            return
        line, key = codes
        some[line[~_MODES[key]]] = False
        arcs = is_in(motion, sorted(_ARCS))
        spare = np.where(arcs, around, np.where(is_in(motion, (0, 10)), straight, 0)) & present
        for where in np.flatnonzero(some & (spare != 0)).tolist():
            letter, kind = chr(64 + int(spare[where] & -spare[where]).bit_length()), "n arc"
            if not arcs[where]:
                kind = " straight move"
            why = f"what the control makes of {letter} in a{kind} is not known; take it out"
            yield where, why, "OLP519", letter

    def _across(
        self, chunk: WordChunk, active: Mask, codes: tuple[Index, Index], motion: Codes, plane: Codes
    ) -> Iterator[Refusal]:
        if not self.rules.in_plane:
            return
        line, key = codes
        some = active & is_in(motion, sorted(_ARCS))
        some[line[~_MODES[key]]] = False
        words = np.flatnonzero(is_in(chunk.letter, list(b"IJK")) & (chunk.mantissa != 0))
        words = words[some[chunk.line[words]]]
        for code, letters in _IN_PLANE.items():
            mine = words[plane[chunk.line[words]] == code]
            for word in mine[(_BIT[chunk.letter[mine]] & letters) == 0].tolist():
                letter = chr(int(chunk.letter[word]))
                why = (
                    f"{letter} is across the plane of this arc, and what the control makes of it is not known"
                )
                yield int(chunk.line[word]), f"{why}; take it out", "OLP519", letter

    def _lacking(self, codes: tuple[Index, Index], present: Bits) -> Iterator[Refusal]:
        line, key = codes
        has, needed = present[line], self.needed[key]
        lacking = np.flatnonzero((needed != 0) & ((has & needed) == 0))
        codes_of = set(key[lacking].tolist())
        for code, letters in self.rules.needs.items():
            if code not in codes_of:
                continue
            what = f"one of {', '.join(letters)}" if len(letters) > 1 else letters
            for where in line[lacking[key[lacking] == code]].tolist():
                yield where, f"{_name(code)} needs {what} in its block", "OLP516", ""
        for code, (one, other) in self.rules.excludes.items():
            both = line[(key == code) & ((has & _bits(one)) != 0) & ((has & _bits(other)) != 0)]
            for where in both.tolist():
                why = f"{_name(code)} takes {one}, or words of axes; expected one of the two"
                yield where, why, "OLP518", ""
        if self.rules.one_use_of_axes:
            stating, moving = (_lines_of(table, codes, len(present)) for table in (_STATING, _MOTIONS))
            for where in np.flatnonzero(stating & moving).tolist():
                why = "two G codes of this block use its axis words; give each its own block"
                yield where, why, "OLP518", ""

    def _negative(self, chunk: WordChunk, active: Mask) -> Iterator[Refusal]:
        words = np.flatnonzero((chunk.mantissa < 0) & self._positive[chunk.letter])
        for word in words[active[chunk.line[words]]].tolist():
            letter = chr(int(chunk.letter[word]))
            why = f"the word {letter} is negative; expected zero or more"
            yield int(chunk.line[word]), why, "OLP516", letter

    def _numbers(self, chunk: WordChunk, active: Mask) -> Iterator[Refusal]:
        if not self.rules.number_first:
            return
        words = np.flatnonzero(chunk.letter == ord("N"))
        words = words[active[chunk.line[words]]]
        late = (chunk.first_word[chunk.line[words]] != words) | _behind_comment(chunk, words)
        for where in chunk.line[words[late]].tolist():
            why = "N is not the first word of this block; put the block number in front"
            yield where, why, "OLP505", "N"

    def _alone(self, chunk: WordChunk, active: Mask, present: Bits) -> Iterator[Refusal]:
        letter = self.rules.alone
        if not letter:
            return
        words = np.flatnonzero(chunk.letter == ord(letter))
        words = words[active[chunk.line[words]]]
        line = chunk.line[words]
        with_others = (present[line] != _bits(letter)) | _behind_comment(chunk, words)
        for where in line[with_others].tolist():
            why = f"{letter} is a program number; expected it first, in a block of its own"
            yield where, why, "OLP505", letter

    def _broken(self, chunk: WordChunk, active: Mask) -> Iterator[Refusal]:
        whole = is_in(chunk.letter, list(self.rules.whole.encode()))
        words = np.flatnonzero(whole & (chunk.decimals > 0))
        words = words[active[chunk.line[words]]]
        words = words[chunk.mantissa[words] % 10 ** chunk.decimals[words].astype(np.int64) != 0]
        for word in words.tolist():
            letter = chr(int(chunk.letter[word]))
            why = f"the word {letter} has a fraction; expected an integer"
            yield int(chunk.line[word]), why, "OLP516", letter


def _lines_of(table: Mask, codes: tuple[Index, Index], lines: int) -> Mask:
    """(lines,) whether a line has a code of a `table`, of the lines and keys of codes."""
    line, key = codes
    found = np.zeros(lines, bool)
    found[line[table[key]]] = True
    return found


def _behind_comment(chunk: WordChunk, words: Index) -> Mask:
    """(m,) whether a comment opens before these words of their lines."""
    opens = np.searchsorted(chunk.comments, chunk.line_start[chunk.line[words]])
    return np.asarray(opens < np.searchsorted(chunk.comments, chunk.start[words]), bool)


def _present(chunk: WordChunk) -> Bits:
    """(lines,) the letters of each line, as bits."""
    out = np.zeros(len(chunk.line_start), np.int32)
    first = chunk.first_word
    some = np.flatnonzero(first[1:] > first[:-1])
    if some.size:
        out[some] = np.bitwise_or.reduceat(_BIT[chunk.letter], first[some])
    return out


def _name(key: int) -> str:
    return f"G{key / 10:g}" if key < M else f"M{(key - M) / 10:g}"


def _m(*numbers: int) -> frozenset[int]:
    return frozenset(M + 10 * number for number in numbers)


_OWN_M = _m(*range(100, 200))
_SYNCHRONOUS = _m(62, 63, 64, 65)
_OUTPUTS = _m(66, 67, 68)

#: What any control takes one of in a block: motion, and the modal codes that the reader follows.
_GROUPS = (frozenset({*_MOTION, 331, 760, 870, 880}), *map(frozenset, GROUPS.values()))

#: LinuxCNC 2.9, found by asking its interpreter code by code and letter by letter.
NGC_RULES = BlockRules(
    users={
        "D": CUTTER_COMPENSATION | {960},
        "E": _OUTPUTS,
        "H": frozenset({430, 432, 760}),
        "I": frozenset({*_ARCS, 50, 51, 52, 760, 870}),
        "J": frozenset({*_ARCS, 50, 51, 52, 760, 870}),
        "K": frozenset({*_ARCS, THREAD, 331, 760, 870}),
        "L": frozenset({*(COMMON_CYCLES - {740}), WRITE_OFFSET, 760}) | _m(66, 98),
        "P": frozenset({*_ARCS, DWELL, WRITE_OFFSET, 640, 50, 51, 52, 760, 820, 840, 860, 880, 890, 740})
        | _SYNCHRONOUS | _m(50, 51, 52, 53, 66, 19, 98) | _OWN_M,
        "Q": frozenset({50, WRITE_OFFSET, 640, 730, 760, 830}) | _m(19, 61) | _OUTPUTS | _OWN_M,
        "R": frozenset({*_ARCS, *COMMON_CYCLES, WRITE_OFFSET, 760}) | _m(19),
    },
    groups=(
        *_GROUPS,
        frozenset({DWELL, WRITE_OFFSET, *HOMES, MACHINE, *SHIFTS, 281, 301}),
        frozenset(UNITS),
        frozenset({COMPENSATION_OFF, *CUTTER_COMPENSATION}),
        LENGTHS,
        WORK_OFFSETS,
        PATH_MODES,
        frozenset({960, 970}),
        frozenset({70, 80}),
        _m(0, 1, 2, 30, 60),
        _m(6, 61),
        _m(3, 4, 5, 19),
        _m(7, 8, 9),
        _m(48, 49),
        _m(50, 51, 52, 53),
        _m(*range(62, 69)),
        _OWN_M,
    ),
    needs={
        **dict.fromkeys((520, 920), "XYZABCUVW"),
        **dict.fromkeys(sorted(COMMON_CYCLES | PROBES), "XYZABCUVW"),
        **dict.fromkeys(sorted(_ARCS), "IJKR"),
        DWELL: "P",
        THREAD: "K",
        432: "HXYZ",
        MACHINE: "XYZABCUVW",
        960: "S",
        **dict.fromkeys(sorted(_SYNCHRONOUS), "P"),
        **dict.fromkeys(sorted(_m(66)), "PE"),
        **dict.fromkeys(sorted(_m(67, 68)), "E"),
    },
    excludes={432: ("H", "XYZ")},
    positive="NFSTLH",
    whole="LO",
    alone="O",
    number_first=True,
    one_use_of_axes=True,
)  # fmt: skip
#: Controls whose rules are not known so well: what is ambiguous on any control.
OTHER_RULES = BlockRules(groups=_GROUPS)
#: ISO controls: a vector at the end of a contour, a corner that is rounded without a comma, spirals, turns.
ISO_RULES = BlockRules(groups=_GROUPS, straight="IJKLR", round="LPQ", in_plane=True)
