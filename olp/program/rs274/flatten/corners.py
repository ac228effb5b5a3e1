"""Corners that ISO controls round (`,R`) or chamfer (`,C`) by themselves, written as blocks of their own.

`,R` is the radius of the circle that touches both moves, `,C` what a chamfer takes of each. This runs over
the unrolled blocks, as a corner depends on the block behind it. Both are G1 to G3 in the plane, one behind
the other (Fanuc Series 30i and 0i, operator's manuals, optional chamfering and corner R; Haas, operator's
manual of mills, corner rounding and chamfering).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from olp.core.errors import ProgramError
from olp.core.geometry import PLANES
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.program.contours.corners import Corner, Element, Point, chamfer, rounding, turn_at
from olp.program.rs274.codes import INCH, INVERSE_TIME, MIRROR, PLANE_OF, ROTATION, UNDONE_BY
from olp.program.rs274.flatten.lines import Line, Word, compile_line
from olp.program.rs274.flatten.state import ProgramState, tracked
from olp.program.rs274.profiles.base import Profile

_CORNERS = frozenset({",r", ",c"})
_ROUND = ",r"
_CENTRES = "ijk"
#: Codes beside which a move keeps its meaning: G0 to G3, planes, distances, feeds, exact stops.
_KEEPS = frozenset({0, 10, 20, 30, 90, 170, 180, 190, 610, 640, 900, 910, 940, 950, 960, 970})
_PLAIN = frozenset("ngxyzijkrfsmtdh") | _CORNERS
#: Codes of frames that keep all lengths: rotations, mirror images, and what ends them.
_TURNS = frozenset({ROTATION, MIRROR, UNDONE_BY[ROTATION], UNDONE_BY[MIRROR]})
_MOTIONS = frozenset({10, 20, 30})
_LEFT = 30
#: rad of a joint without a corner
_SMOOTH = 1e-6
#: rad up to where controls make no corner
_LEAST = math.radians(1.001)
#: Decimals of positions in mm.
_DECIMALS = 4
#: The same in inches.
_INCH_DECIMALS = 5

#: A block, its line end, and which of the blocks it was made from.
Placed = tuple[bytes, bytes, int]


@dataclass(frozen=True, slots=True)
class _Leg:
    """A block that moves in the plane: its place in the output, its element, plane (index into `PLANES`),
    motion code, and whether its words are distances. `size` is that of the corner behind it, None for none,
    `word` asks for it."""

    index: int
    element: Element
    plane: int
    motion: int
    incremental: bool
    word: str = ""
    size: float | None = None


def with_corners(
    blocks: Sequence[tuple[bytes, bytes]], profile: Profile, number: Callable[[float], str], *, switch: bool
) -> list[Placed]:
    """The blocks (text and line end) with their corners. `number` writes a length; with `switch` blocks under
    block delete may run or not. Raises ProgramError, with the index of the block as its line, for corners
    that are not certain."""
    corners = _Corners(profile, number, switch)
    for index, (raw, eol) in enumerate(blocks):
        try:
            corners.put(raw, eol, index)
        except ProgramError as error:
            # what does not go with a corner is said of the block that asks for it
            error.line = 1 + (index if corners.held is None else corners.written[corners.held.index][2])
            raise
    if corners.open:
        why = f"behind the corner of {corners.open} the program ends; give the move behind it"
        assert corners.held is not None
        raise ProgramError(why, code="OLP544", line=corners.written[corners.held.index][2] + 1)
    return corners.written


class _Corners:
    def __init__(self, profile: Profile, number: Callable[[float], str], switch: bool) -> None:
        self.written: list[Placed] = []
        self._profile, self._number, self._switch = profile, number, switch
        self._state = ProgramState(profile)
        #: the move before, where a corner may be
        self.held: _Leg | None = None

    @property
    def open(self) -> str:
        """The word of a corner whose second move has not come yet, empty for none."""
        return "" if self.held is None or self.held.size is None else self.held.word

    def put(self, raw: bytes, eol: bytes, index: int) -> None:
        """The next block."""
        line = compile_line(raw, index + 1, self._profile.language)
        words = {word.letter: word for word in line.words if word.letter != "n"}
        if not words and not line.opaque:
            self.written.append((raw, eol, index))
            return
        before, cycle = tuple(self._state.position), self._follow(line)
        corner = [word for word in line.words if word.letter in _CORNERS]
        if corner and cycle:
            unread = self._profile.text.unread
            if unread is None or not unread.search(raw):
                why = f"{_shown(corner[0])} beside a canned cycle is not understood; leave it out"
                raise ProgramError(why, code="OLP510")
            corner = []
        motion = self._moves(line, words)
        element = self._element(words, before, motion) if motion else None
        if element is None and self.open:
            raise _no_move(self.open, behind=True, unknown=bool(motion))
        if corner:
            raw = _changed(raw, line, {}, _CORNERS)
        self.written.append((raw, eol, index))
        leg = None
        if element is not None and motion is not None:
            plane = PLANE_OF[self._state.plane]
            leg = _Leg(len(self.written) - 1, element, plane, motion, not self._state.absolute)
            if self.held is not None and self.held.size is not None:
                leg = self._made(self.held, self.held.size, leg)
        self.held = None
        if corner:
            word, size = _shown(corner[-1]), _size(corner, self._profile)
            if leg is None:
                raise _no_move(word, behind=False, unknown=bool(motion))
            late = [w for w in line.words if w.letter == "m" and w.number in self._profile.late_m]
            if late:
                why = f"whether {_shown(late[0])} acts before or behind the corner of {word} is not certain"
                raise ProgramError(f"{why}; give it a block behind the next move", code="OLP544")
            leg = replace(leg, word=word, size=size)
        self.held = leg

    def _follow(self, line: Line) -> bool:
        """Follow a block; whether it makes a canned cycle."""
        state, start = self._state, tuple(self._state.position)
        if line.opaque:
            state.forget()
            return False
        language = self._profile.language
        words = [(word.letter, tracked(word, word.number, language)) for word in line.words]
        cycle = state.is_cycle(words)
        if cycle:
            try:
                state.cycle(words, 1.0)
            except ProgramError:
                # only the position is lost
                state.forget()
        else:
            state.apply(words)
        if state.codes(words) & _TURNS:
            # it turns and mirrors corners, too; positions are those of the program in it
            state.forget()
            state.odd_frame = False
        if line.deleted and self._switch:
            state.forget(axis for axis in range(3) if state.position[axis] != start[axis])
        return cycle

    def _moves(self, line: Line, words: Mapping[str, Word]) -> int | None:
        """The motion code of a block that moves in its plane and does nothing else."""
        state = self._state
        codes = {round(10 * word.number) for word in line.words if word.letter == "g"}
        odd = codes - _KEEPS or words.keys() - _PLAIN or (line.deleted and self._switch)
        a, b, _ = (AXES[axis].lower() for axis in PLANES[PLANE_OF[state.plane]])
        axes = words.keys() & {a, b, *_CENTRES}
        if odd or line.opaque or not axes or state.feed_mode == INVERSE_TIME or state.motion not in _MOTIONS:
            return None
        return state.motion

    def _element(self, words: Mapping[str, Word], before: tuple[float, ...], motion: int) -> Element | None:
        """What a block moves along; None where that is not known, or not in the plane alone."""
        a, b, third = PLANES[PLANE_OF[self._state.plane]]
        after = self._state.position
        begin, end = (before[a], before[b]), (after[a], after[b])
        across = AXES[third].lower() in words and before[third] != after[third]
        if across or any(math.isnan(v) for v in (*begin, *end)):
            return None
        if motion not in (20, _LEFT):
            return None if begin == end else Element(begin, end)
        language = self._profile.language
        radius, *centre = (
            tracked(words[k], words[k].number, language) if k in words else 0.0
            for k in ("r", _CENTRES[a], _CENTRES[b])
        )
        if radius is None or None in centre:
            return None
        if radius:
            return Element.by_radius(begin, end, radius, left=motion == _LEFT)
        at = tuple(o + (c or 0.0) for o, c in zip(begin, centre, strict=True))
        return None if at == begin else Element(begin, end, (at[0], at[1]), motion == _LEFT)

    def _made(self, held: _Leg, size: float, leg: _Leg) -> _Leg:
        """Put the corner between two legs; the second one, which begins behind it."""
        first, second = held.element, leg.element
        if held.plane != leg.plane:
            raise _no_move(held.word, behind=True, unknown=False)
        turn = abs(turn_at(first, second))
        if turn < _SMOOTH:
            return leg
        if turn < _LEAST:
            why = f"{held.word} is at a corner of less than a degree, where controls differ; leave it out"
            raise ProgramError(why, code="OLP544")
        make = rounding if held.word.startswith(",R") else chamfer
        corner = make(first, second, size, held.word)
        corner = replace(corner, begin=self._rounded(corner.begin), end=self._rounded(corner.end))
        raw, eol, source = self.written[held.index]
        ended = replace(held, element=replace(first, end=corner.begin))
        self.written[held.index] = (self._to(raw, ended), eol, source)
        inserted = self._block(held, corner, size)
        later, eol, mine = self.written[leg.index]
        leg = replace(leg, index=leg.index + 1, element=replace(second, begin=corner.end))
        self.written[leg.index - 1 :] = [
            (inserted, eol, source),
            (self._to(later, leg, code=True), eol, mine),
        ]
        return leg

    def _rounded(self, point: Point) -> Point:
        decimals = _INCH_DECIMALS if self._state.unit == INCH else _DECIMALS
        x, y = (round(v, decimals) for v in point)
        return x, y

    def _block(self, leg: _Leg, corner: Corner, size: float) -> bytes:
        """The block of a corner."""
        base = corner.begin if leg.incremental else (0.0, 0.0)
        words = ["G1" if corner.centre is None else f"G{3 if corner.left else 2}"]
        axes = (AXES[axis] for axis in PLANES[leg.plane])
        words += [f"{a}{self._number(v - o)}" for a, v, o in zip(axes, corner.end, base, strict=False)]
        if corner.centre is not None:
            words.append(f"R{self._number(size)}")
        return " ".join(words).encode()

    def _to(self, raw: bytes, leg: _Leg, *, code: bool = False) -> bytes:
        """A block that goes along a leg; with its motion `code` where it lacks that."""
        element, line = leg.element, compile_line(raw, 0, self._profile.language)
        base = element.begin if leg.incremental else (0.0, 0.0)
        own = {word.letter for word in line.words}
        numbers, gone = {}, set[str]()
        ends = zip(PLANES[leg.plane], element.begin, element.end, base, strict=False)
        for axis, begin, end, origin in ends:
            letter = AXES[axis].lower()
            if letter in own or begin != end:
                numbers[letter] = self._number(end - origin)
        if element.centre is not None:
            gone = {"r"}
            for axis, begin, at in zip(PLANES[leg.plane], element.begin, element.centre, strict=False):
                numbers[_CENTRES[axis]] = self._number(at - begin)
        return _changed(raw, line, numbers, gone, leg.motion // 10 if code else None)


def _changed(
    raw: bytes,
    line: Line,
    numbers: Mapping[str, str],
    gone: frozenset[str] | set[str],
    motion: int | None = None,
) -> bytes:
    """A block with other numbers, without some words, and with a motion code where it has none."""
    edits: list[tuple[int, int, bytes]] = []
    missing = dict(numbers)
    rest = [word for word in line.words if word.letter not in gone]
    for word in line.words:
        if word.letter in gone:
            start = len(raw[: word.start].rstrip(b" \t")) if word.start else 0
            edits.append((start, word.end, b""))
        elif word.letter in numbers:
            edits.append((word.value_start, word.end, missing.pop(word.letter).encode()))
    own = {round(10 * word.number) for word in rest if word.letter == "g"}
    if motion is not None and not own & _MOTIONS:
        place = next(word.start for word in rest if word.letter != "n")
        edits.append((place, place, b"G%d " % motion))
    if missing:
        end = max(word.end for word in rest)
        text = "".join(f" {letter.upper()}{number}" for letter, number in missing.items())
        edits.append((end, end, text.encode()))
    for start, end, new in sorted(edits, key=lambda edit: edit[:2], reverse=True):
        raw = raw[:start] + new + raw[end:]
    return raw


def _shown(word: Word) -> str:
    return f"{word.letter.upper()}{word.number:g}"


def _size(words: Sequence[Word], profile: Profile) -> float:
    """The size of a corner. Raises ProgramError for two of them, or one that is not certain."""
    size = tracked(words[-1], words[-1].number, profile.language)
    if len(words) > 1:
        raise ProgramError("a block has two corners, `,R` and `,C`; leave one of them out", code="OLP518")
    if words[0].letter not in profile.language.corners:
        why = f"how far {_shown(words[0])} goes on this control is not known; post the corner as a move"
        raise ProgramError(why, code="OLP544")
    if size is None:
        why = f"{_shown(words[-1])} has no decimal point, so what it counts is not certain; write the point"
        raise ProgramError(why, code="OLP515")
    if size <= 0.0:
        raise ProgramError(f"{_shown(words[-1])} is no size of a corner; expected one above 0", code="OLP516")
    return size


def _no_move(word: str, *, behind: bool, unknown: bool) -> ProgramError:
    where = "behind" if behind else "in the block of"
    if unknown:
        why = (
            f"the move {where} the corner of {word} is not in its plane alone, or begins where no block says"
        )
        return ProgramError(f"{why}; give X and Y before it, and Z in a block of its own", code="OLP524")
    return ProgramError(
        f"{where} the corner of {word} is no G1, G2 or G3 in its plane alone; a control joins two such moves "
        "only, one right behind the other: put all else before or behind them",
        code="OLP544",
    )
