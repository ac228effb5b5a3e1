"""Arcs on machines with rotary joints: where the tip is along them, and where an axis turns round.

Linear coordinates go along the arc as programmed, rotary ones evenly beside it. What is written in the place
of an arc that has to be corrected are straight parts, as short as the tolerance asks for.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask
from olp.core.errors import ProgramError
from olp.core.geometry import ArcShapes, arms
from olp.core.turns import turned
from olp.core.values import dataclass
from olp.program.heidenhain.columns import ANGLE, STEP_ANGLE, TURN
from olp.program.program import Program

#: rad of an arc from sample to sample.
_STEP = np.radians(5.0)
#: mm by which an arc may begin or end elsewhere than where it was read.
_NEAR_MM = 1e-6
#: rad of a whole turn.
_TURN = 2.0 * np.pi
#: Share of a turn that a part may go back, as one does that takes up backlash.
_BACK = 0.25
#: Letters of words that conversational blocks of arcs have alone, and of axes.
_OF_ARCS = (TURN, ord("R"), ANGLE, STEP_ANGLE)
_AXES = tuple(b"XYZ")
#: Motion codes of arcs.
_CODES = (2, 3)


@dataclass(frozen=True, slots=True, eq=False)
class Curves:
    """Arcs among n moves: `of` (n,) their place in `shapes`, -1 for other moves. `centre` (m, 3), and
    `columns` those of X, Y and Z in coordinates. `slot` (m, 5) are words of centres, radii and turns, `code`
    (m,) those of G2 and G3, -1 where an arc has none."""

    of: npt.NDArray[np.int64]
    shapes: ArcShapes
    centre: Array
    columns: Index
    slot: npt.NDArray[np.int32]
    code: npt.NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.slot)

    @property
    def mask(self) -> Mask:
        """(n,) which moves are arcs."""
        return np.asarray(self.of >= 0)

    @staticmethod
    def none(count: int) -> Curves:
        nothing = np.zeros((0, 3))
        shapes = ArcShapes.of(nothing, nothing, nothing, np.zeros(0, np.int8), np.zeros(0))
        empty = np.zeros((0, 5), np.int32)
        return Curves(np.full(count, -1), shapes, nothing, np.arange(3), empty, empty[:, 0])

    @staticmethod
    def of_program(program: Program, start: Array, end: Array, columns: list[int], kept: Mask) -> Curves:
        """The arcs that are not `kept` (n,), with `start` and `end` (n, axes) as programmed. Raises
        ProgramError for arcs that are not those of words, or begin elsewhere than where they were read."""
        path = program.toolpath
        some = np.flatnonzero(~kept[path.arcs.move])
        if not some.size:
            return Curves.none(len(path))
        move = path.arcs.move[some]
        ends = np.stack((path.starts_mm()[move], path.end_mm[move], path.arcs.centre_mm[some]))
        matrices = path.turns()
        if matrices is not None:
            inverse = matrices.inverse[matrices.of_frame[path.frame[move]]]
            ends = np.stack([turned(inverse, place) for place in ends])
        begin, finish = start[move][:, columns], end[move][:, columns]
        away = np.abs(np.stack((begin, finish)) - ends[:2]).max(axis=(0, 2))
        other = np.flatnonzero(away > _NEAR_MM)
        if other.size:
            raise ProgramError(
                "an arc begins where words change between positions of axes and of the tip; program a "
                "straight move before it",
                line=int(path.line[move[other[0]]]),
                code="OLP565",
            )
        of = np.full(len(path), -1)
        of[move] = np.arange(len(move))
        shapes = ArcShapes.of(begin, finish, ends[2], path.arcs.plane[some], path.arcs.sweep_rad[some])
        if program.arc_slots.poles is not None:
            slot, code = _own_words(program, move), np.full(len(move), -1, np.int32)
        else:
            slot = program.arc_slots.word[some]
            code = _codes(program, move, slot)
        return Curves(of, shapes, ends[2], np.array(columns), slot, code)

    def along(self, place: Array, move: Index, share: Array) -> Array:
        """(r, axes) `place` at shares of moves, where the linear coordinates of arcs follow these."""
        rows = np.flatnonzero((self.of[move] >= 0) & (share != 1.0)) if len(self) else np.zeros(0, np.int64)
        if rows.size:
            place = place.copy()
            place[np.ix_(rows, self.columns)] = self.shapes.at(self.of[move[rows]], share[rows])
        return place

    def samples(self, move: Index, share: Array | float) -> Index:
        """(r,) samples of stretches of moves that take these shares of them; 0 where they are no arcs."""
        of = self.of[move]
        if not len(self):
            return np.zeros(len(of), np.int64)
        sweep = np.where(of >= 0, np.abs(self.shapes.sweep)[of], 0.0)
        return np.asarray(np.ceil(sweep * share / _STEP), np.int64)

    def chords(self, move: Index, share: Array, off_mm: float) -> Index:
        """(r,) into how many chords stretches of moves are parted that leave these arcs by `off_mm` at most;
        0 where they are no arcs."""
        of = self.of[move]
        if not len(self):
            return np.zeros(len(of), np.int64)
        radius = np.maximum(self.shapes.radius + np.maximum(self.shapes.wider, 0.0), off_mm)
        step = 2.0 * np.arccos(1.0 - off_mm / radius)
        return np.where(of >= 0, np.ceil((np.abs(self.shapes.sweep) / step)[of] * share), 0).astype(np.int64)

    def length_mm(self, move: Index) -> Array:
        """(r,) lengths of moves in the planes of their arcs; 0 where they are no arcs."""
        of = self.of[move]
        if not len(self):
            return np.zeros(len(of))
        radius = self.shapes.radius + np.maximum(self.shapes.wider, 0.0)
        return np.where(of >= 0, (radius * np.abs(self.shapes.sweep))[of], 0.0)

    def shares(self, move: Index, place: Array) -> Array:
        """(r,) the shares at which places (r, axes) lie on their arcs `move` (r,), in the order in which the
        arcs are run."""
        of = self.of[move]
        along, across = arms(place[:, self.columns], self.centre[of], self.shapes.plane[of])
        sweep = self.shapes.sweep[of]
        gone = (np.arctan2(across, along) - self.shapes.angle[of]) * np.sign(sweep) / _TURN
        first = np.append(True, move[1:] != move[:-1])[: len(move)]
        before = np.where(first, 0.0, np.append(0.0, gone[:-1])[: len(gone)])
        steps = np.mod(gone - before + _BACK, 1.0) - _BACK
        total, begun = np.cumsum(steps), np.flatnonzero(first)
        total -= np.repeat((total - steps)[begun], np.diff(begun, append=len(of)))
        return np.asarray(_TURN * total / np.abs(sweep))

    def refuse_kept(self, program: Program) -> None:
        """Raise ProgramError for an arc that stays and goes by the G2 or G3 of a block before it."""
        arc = program.toolpath.arcs.move
        if program.arc_slots.poles is None:
            _codes(program, arc[self.of[arc] < 0], None)


def _own_words(program: Program, move: Index) -> npt.NDArray[np.int32]:
    """(m, 5) the words of conversational blocks of arcs that those of straight moves do not have, -1 for
    further ones: DR, a radius, an angle, and a distance beside it."""
    words, slot = program.words, np.full((len(move), 5), -1, np.int32)
    assert words is not None
    stated = program.slot[move]
    for row, number in enumerate(program.toolpath.line[move].tolist()):
        own = [
            i for i in words.of_line(number)
            if words.letter[i] in _OF_ARCS or (words.letter[i] in _AXES and i not in stated[row])
        ]  # fmt: skip
        slot[row, : len(own)] = own
    return slot


def _codes(program: Program, move: Index, slot: npt.NDArray[np.int32] | None) -> npt.NDArray[np.int32]:
    """(m,) the words G2 and G3 of the blocks of arcs, -1 where an arc goes by that of a block before it.
    Raises ProgramError for arcs that do not state what they have to: a centre or a radius, where there are
    slots, else their code."""
    words, line = program.words, program.toolpath.line[move]
    assert words is not None
    code = np.full(len(move), -1, np.int32)
    for row, number in enumerate(line.tolist()):
        motions = [
            i for i in words.of_line(number)
            if words.letter[i] == ord("G") and not words.decimals[i] and words.mantissa[i] <= max(_CODES)
        ]  # fmt: skip
        code[row] = motions[0] if motions else -1
        other = any(int(words.mantissa[i]) not in _CODES for i in motions)
        if other or len(motions) > 1 or (slot[row, :4].max() if slot is not None else code[row]) < 0:
            raise ProgramError(
                "on a machine with rotary joints this is not corrected: an arc whose block does not state "
                "G2 or G3 and a centre or a radius; post it so, or as straight moves",
                line=number,
                code="OLP565",
            )
    return code
