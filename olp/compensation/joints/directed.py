"""Moves whose words state the direction of the tool in the workpiece: G43.5 with I, J and K, and A3, B3, C3
behind TRAORI. The control finds the rotary positions by itself: of two the one that is nearer.

Sources: Fanuc, Operator's Manual, tool center point control (type 2); Siemens, Programming Manual Job
Planning, orientation of the tool by vector components.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from olp.compensation.joints.motion import Motion
from olp.core.arrays import Array, Index, Mask, is_in
from olp.core.errors import ConfigError, ProgramError
from olp.core.toolpath import Flag, Kind
from olp.core.turns import turned
from olp.core.values import dataclass
from olp.kinematics.directions import along_outer, branches, pair_of
from olp.kinematics.structure import Joint, Structure
from olp.program.program import Program, Towards
from olp.program.rs274.motion import DIRECTION
from olp.program.rs274.profiles.base import Profile
from olp.program.rs274.rotary import RotaryWords

#: Sines below this are zero: the outer axis does not turn the tool there, and stays.
_ALONG = 1e-9
#: From there to this sine the position of the outer axis hangs on the last digits of words.
_NEAR = 1e-4
#: The other position is farther than this times the way to the nearer one,
_FARTHER = 1.5
#: and deg.
_FARTHER_DEG = 1.0
_WHOLE_DEG = 360.0
#: Fewest decimals of a component: half a last digit is 0.05 urad.
_DECIMALS = 7
#: deg by which a position may be out of its travel, or two apart, by rounding.
_AT_END = 1e-9
#: Sines below which directions keep the position of the outer axis: a correction of the tool by some urad
#: would turn it by degrees.
_POLE = 5e-3


@dataclass(frozen=True, slots=True, eq=False)
class Directions:
    """Per move (n,): `slot` (n, 3) the words of the components of a direction or -1, and `unit` (n, 3) the
    direction that they state, NaN where they state none. In moves that are `led` such words, of the move or
    of one before, state the direction of the tool. `decimals` are those of words that are written."""

    slot: npt.NDArray[np.int32]
    unit: Array
    led: Mask
    decimals: int

    @property
    def stated(self) -> Mask:
        return np.isfinite(self.unit[:, 0])

    @staticmethod
    def none(count: int) -> Directions:
        empty = np.full((count, 3), -1, np.int32)
        return Directions(empty, np.full((count, 3), np.nan), np.zeros(count, bool), _DECIMALS)

    @staticmethod
    def of(program: Program, rotary: RotaryWords) -> Directions:
        """The directions of a program that was read with its words. Raises ProgramError for words that state
        none, and beside those of rotary axes."""
        path, dialect = program.toolpath, program.dialect
        if program.towards is not None:
            return Directions._of_statements(program, program.towards, rotary)
        if not isinstance(dialect, Profile) or not dialect.directed or not len(path):
            return Directions.none(len(path))
        slot = _slots(program)
        stated = np.asarray((slot >= 0).any(axis=1), bool)
        allowed = np.array([frame.directed for frame in path.frames], bool)[path.frame]
        given = np.asarray((rotary.slot >= 0).any(axis=1), bool)
        names = ", ".join(_shown(dialect))
        always = bool(dialect.direction_codes)
        counting = given & ((path.flag & np.uint8(Flag.INCREMENTAL)) != 0) & stated.any()
        for wrong, why in (
            (
                stated & ~allowed,
                f"{names} state the direction of the tool, and no mode that reads them is on",
            ),
            (stated & given, f"{names} are beside words of rotary axes; program one of both"),
            (given & allowed & always, f"a rotary axis has a word where {names} state the direction"),
            (counting, "a distance of a rotary axis where others state directions; program its position"),
        ):
            if wrong.any():
                raise ProgramError(why, line=int(path.line[np.argmax(wrong)]), code="OLP565")
        led = _last(stated, given | ~allowed) | (allowed & always)
        return Directions(slot, _units(program, slot, stated), led & allowed, _decimals(program, slot))

    @staticmethod
    def _of_statements(program: Program, towards: Towards, rotary: RotaryWords) -> Directions:
        """Those of statements: of points, and of blocks with vectors."""
        size = np.linalg.norm(towards.stated, axis=1)
        led = np.asarray(np.isfinite(size), bool)
        both = led & (rotary.slot >= 0).any(axis=1)
        if both.any():
            raise ProgramError(
                "the direction of the tool is beside words of rotary axes; program one of both",
                line=int(program.toolpath.line[np.argmax(both)]),
                code="OLP565",
            )
        if towards.lasting:
            led = np.logical_or.accumulate(led)
        unit = towards.stated / size[:, None]
        return Directions(towards.slot, unit, led, _decimals(program, towards.slot))

    def refuse_other_axes(self, program: Program, structure: Structure) -> None:
        """Raise ProgramError where directions turn other than two rotary axes."""
        if not self.led.any():
            return
        try:
            pair_of(structure)
        except ConfigError as error:
            first = int(program.toolpath.line[np.argmax(self.led)])
            raise ProgramError(str(error), line=first, code="OLP565") from None

    def positions(
        self, program: Program, structure: Structure, letters: Sequence[str], rotary: RotaryWords,
        found_deg: Array, degrees: Array,
    ) -> Array:  # fmt: skip
        """(n, k) `found_deg`, the positions that the control finds by itself, with those of directions;
        `degrees` (1 + n, k) are what words of axes alone lead to, from the start on. Raises ProgramError
        where the program does not say which of two positions it takes."""
        rows = np.flatnonzero(self.stated)
        line, pair = program.toolpath.line, pair_of(structure)
        towards = self.turned(program, rows, self.unit[rows])
        both, free = branches(structure, towards), refuse_near(structure, towards, line[rows]).tolist()
        columns = [letters.index(joint.name) for joint in pair]
        lost = ((program.toolpath.flag & np.uint8(Flag.CONTROL)) != 0)[:, None] & np.isnan(degrees[1:])
        stated = ((rotary.slot >= 0) | np.isfinite(found_deg) | lost)[:, columns]
        # how often words and the control have set each axis before a move
        times = np.cumsum(stated, axis=0) - stated
        before, again = degrees[rows][:, columns], np.diff(times[rows], axis=0, prepend=-1) != 0
        known, first, second = before.tolist(), both[0].tolist(), both[1].tolist()
        done, found = [np.nan, np.nan], []
        for number, (outer_set, inner_set) in enumerate(again.tolist()):
            if outer_set or inner_set:
                done = [
                    known[number][0] if outer_set else done[0],
                    known[number][1] if inner_set else done[1],
                ]
            done = _nearest(
                (first[number], second[number]), done, pair, free[number], int(line[rows[number]])
            )
            found.append(done)
        places = found_deg.copy()
        places[np.ix_(rows, np.array(columns))] = found
        return places

    def keep(self, structure: Structure, moves: Index, towards: Array) -> Mask:
        """(r,) places on moves at which the rotary axes stay as programmed, as the tool, (r, 3) `towards` the
        workpiece, is nearly along the outer one."""
        led = self.led[moves]
        return led & (along_outer(structure, towards) < _POLE) if led.any() else led

    def widened(self, motion: Motion, near: Array, axes: Array) -> Array:
        """(n, axes) by how much axis values may be off because of digits: `near` (axes,) where words state
        them. Where directions lead to `axes` (n, axes), the outer one is off by more the nearer the tool is
        to it."""
        wide = np.broadcast_to(near, axes.shape).copy()
        rows = np.flatnonzero(self.led & np.isfinite(axes).all(axis=1))
        if rows.size:
            structure = motion.structure
            columns = [structure.order.index(joint.name) for joint in pair_of(structure)]
            tool = np.zeros(len(rows), np.int64)
            towards = motion.nominal(axes[rows], tool).rotation[:, :, 2]
            slopes = motion.slopes(axes[rows], tool)[:, 3:, columns]
            across = np.cross(slopes, towards[:, :, None], axis=1)
            least = _least(across[:, :, 0], across[:, :, 1])
            wide[np.ix_(rows, np.array(columns))] /= np.maximum(least, _POLE)[:, None]
            wide[rows[along_outer(structure, towards) < _POLE], columns[0]] = np.inf
        return wide

    def turned(self, program: Program, rows: Index, directions: Array, *, back: bool = False) -> Array:
        """(r, 3) directions along the words of moves in the workpiece, or back."""
        path = program.toolpath
        matrices = path.turns()
        if matrices is None:
            return directions
        # rotations alone are read here, whose inverse is the transpose
        which = matrices.of_frame[path.frame[rows]]
        return turned((matrices.inverse if back else matrices.matrix)[which], directions)


def _least(first: Array, second: Array) -> Array:
    """(n,) the smaller singular values of matrices of two columns (n, 3)."""
    a, b, c = ((u * v).sum(axis=1) for u, v in ((first, first), (first, second), (second, second)))
    square = 0.5 * (a + c) - np.hypot(0.5 * (a - c), b)
    return np.asarray(np.sqrt(np.maximum(square, 0.0)))


def refuse_near(structure: Structure, towards: Array, line: npt.NDArray[np.int32]) -> Mask:
    """(r,) where directions (r, 3) are along the outer axis, which stays there. Raises ProgramError where one
    nearly is."""
    sine = along_outer(structure, towards)
    near = np.flatnonzero((sine > _ALONG) & (sine < _NEAR))
    if near.size:
        name = pair_of(structure)[0].name
        raise ProgramError(
            f"this direction is nearly along the axis of {name}, and the position of {name} hangs on its "
            "last digits; program the direction along the axis",
            line=int(line[near[0]]),
            code="OLP566",
        )
    return np.asarray(sine <= _ALONG, bool)


def _decimals(program: Program, slot: npt.NDArray[np.int32]) -> int:
    """Those of the finest component, and at least as many as the tool needs."""
    words = program.words
    assert words is not None
    return max(_DECIMALS, int(words.decimals[slot[slot >= 0]].max(initial=0)))


def _shown(dialect: Profile) -> list[str]:
    return [word.decode().rstrip("=") for word in dialect.direction_words]


def _slots(program: Program) -> npt.NDArray[np.int32]:
    """(n, 3) the words of components in straight moves."""
    path, words = program.toolpath, program.words
    assert words is not None
    slot = np.full((len(path), 3), -1, np.int32)
    straight = is_in(path.kind, (Kind.RAPID, Kind.LINE))
    for column, letter in enumerate(DIRECTION):
        index = np.flatnonzero(words.letter == letter)
        line = np.searchsorted(words.first_word, index, "right")
        move = np.minimum(np.searchsorted(path.line, line), len(path) - 1)
        own = (path.line[move] == line) & straight[move]
        twice = np.flatnonzero(own[1:] & own[:-1] & (line[1:] == line[:-1]))
        if twice.size:
            raise ProgramError(
                f"the word {chr(letter)} is twice in this block; expected it once",
                line=int(line[twice[0]]),
                code="OLP515",
            )
        slot[move[own], column] = index[own]
    return slot


def _units(program: Program, slot: npt.NDArray[np.int32], stated: Mask) -> Array:
    """(n, 3) the directions that words state, NaN without. A component without a word is 0."""
    words, line = program.words, program.toolpath.line
    assert words is not None
    given = slot >= 0
    value = np.where(given, words.mantissa[slot] / 10.0 ** words.decimals[slot], 0.0)
    some = given & (value != 0.0)
    bare = some & ~words.pointed[slot]
    mixed = bare.any(axis=1) & (some & ~bare).any(axis=1)
    size = np.linalg.norm(value, axis=1)
    for wrong, why in (
        (mixed, "one component of the direction has a decimal point and one has none; write it in all"),
        (
            stated & (size == 0.0),
            "the direction of the tool has no length; expected a component other than 0",
        ),
    ):
        if wrong.any():
            raise ProgramError(why, line=int(line[np.argmax(wrong)]), code="OLP516")
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(stated[:, None], value / size[:, None], np.nan)


def _last(these: Mask, others: Mask) -> Mask:
    """(n,) whether the last of both that was true is one of `these`."""
    order = np.arange(len(these))
    first, second = (np.maximum.accumulate(np.where(some, order, -1)) for some in (these, others))
    return np.asarray(first > second, bool)


def _nearest(
    both: tuple[list[float], list[float]],
    before: list[float],
    pair: tuple[Joint, Joint],
    free: bool,
    line: int,
) -> list[float]:
    """The position to which the control turns the two axes from `before`; where the outer one is `free` it
    stays."""
    places: list[tuple[tuple[float, float, float], list[float]]] = []
    for values in both:
        outer = before[0] if free else _turn_of(pair[0], before[0], values[0])
        inner = _turn_of(pair[1], before[1], values[1])
        ways = abs(outer - before[0]), abs(inner - before[1])
        if outer == outer and inner == inner:
            # the longer way, that of the outer axis, and the sum of both: the control's own rule is not known
            places.append(((max(ways), ways[0], sum(ways)), [outer, inner]))
    places.sort()
    if not places:
        known = before[0] == before[0] and before[1] == before[1]
        why = (
            "no positions of the rotary axes within their travel give the tool this direction"
            if known
            else "the control turns to the nearest position with this direction, and where the rotary axes "
            "are before is not known; command them before, or state start_deg in the job file"
        )
        raise ProgramError(why, line=line, code="OLP566")
    (way, best), *others = places
    for next_way, other in others:
        same = abs(other[0] - best[0]) + abs(other[1] - best[1]) < _AT_END
        clear = next_way[0] > _FARTHER * way[0] + _FARTHER_DEG and next_way[2] > way[2]
        if not same and not (clear and next_way[1] >= way[1]):
            raise ProgramError(
                "two positions of the rotary axes give the tool this direction, and both are about as far, "
                "or each is the nearer one by another axis; program a direction between",
                line=line,
                code="OLP566",
            )
    return best


def _turn_of(joint: Joint, before: float, value: float) -> float:
    """A position a number of whole turns from `value`, within the travel, as near to `before` as can be; NaN
    where there is none."""
    if not value - before < np.inf:
        return np.nan
    low, high = joint.travel
    value += _WHOLE_DEG * round((before - value) / _WHOLE_DEG)
    if low - _AT_END <= value <= high + _AT_END:
        return value
    value += _WHOLE_DEG if value < low else -_WHOLE_DEG
    return value if low - _AT_END <= value <= high + _AT_END else np.nan
