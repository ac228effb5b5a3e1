"""Holes that blocks call on machines with rotary joints: which moves are theirs, and what is written there.

Rotary axes stand while a hole is made. The block that goes to it is right in the middle of its stroke, and
the levels of its cycle are those that its bottom needs.
"""

from __future__ import annotations

import numpy as np

from olp.compensation.hole_levels import CalledLevels, Surfaces
from olp.compensation.tally import Tally
from olp.core.arrays import Array, Index, Mask
from olp.core.errors import ProgramError
from olp.core.toolpath import Flag, Kind
from olp.core.values import dataclass
from olp.program.holes import Small
from olp.program.program import Program
from olp.program.text.edits import EditList


@dataclass(frozen=True, slots=True, eq=False)
class Drilled:
    """(k,) holes as moves: `call` goes to the hole, its strokes are `first`..`last`, `bottom` ends at its
    bottom. (n,) `strokes` are the moves of all holes, `whole` these and those to the holes: each is one
    block."""

    call: Index
    first: Index
    bottom: Index
    last: Index
    strokes: Mask
    whole: Mask

    @staticmethod
    def of(program: Program) -> Drilled:
        """The holes of a program. Raises ProgramError for cycles that are not corrected in blocks that call
        them."""
        path = program.toolpath
        count, order = len(path), np.arange(len(path))
        cycle = (path.flag & np.uint8(Flag.CYCLE)) != 0
        moves = program.called.strokes
        if program.statements is not None:
            moves = program.statements.strokes
            _refuse_heights(program)
        first, bottom = moves[:, 0] + 1, moves[:, 1]
        other = np.where(cycle, count, order)
        after = np.append(np.minimum.accumulate(other[::-1])[::-1], count)[bottom + 1]
        last = np.minimum(after, np.append(first[1:], count)[: len(first)]) - 1
        before = np.maximum.accumulate(np.where(cycle, -1, order))
        missed = cycle.copy()
        for a, b in zip(first.tolist(), last.tolist(), strict=True):
            missed[a : b + 1] = False
        if missed.any():
            raise ProgramError(
                "on a machine with rotary joints this is not corrected: a canned cycle; program its holes as "
                "moves, or where the dialect has it give --expand-cycles, which writes it out",
                line=int(path.line[missed].min()),
                code="OLP565",
            )
        call = before[moves[:, 0]]
        whole = cycle.copy()
        whole[call[call >= 0]] = True
        return Drilled(call, first, bottom, last, cycle, whole)

    @staticmethod
    def none(count: int) -> Drilled:
        empty, nothing = np.zeros(0, np.int64), np.zeros(count, bool)
        return Drilled(empty, empty, empty, empty, nothing, nothing)

    def __len__(self) -> int:
        return len(self.first)


def _refuse_heights(program: Program) -> None:
    """Raise ProgramError for cycles that count from the height of the tool."""
    statements = program.statements
    assert statements is not None
    if statements.definitions is None:
        return
    wrong = np.flatnonzero(np.isnan(statements.definitions.surface))
    if wrong.size:
        raise ProgramError(
            "on a machine with rotary joints a cycle that counts from the present height is not corrected; "
            "define CYCL DEF 200 or another one with Q203 for it",
            line=int(program.toolpath.line[statements.strokes[wrong[0], 1]]),
            code="OLP565",
        )


def middled(holes: Drilled, command: Array, nominal: Array, row_of: Index, frame: Small) -> Array:
    """Linear commands (r, 3) of rows, where those of moves to holes have X and Y as the middles of the
    strokes need them. `nominal` (n, 3) and `frame` (n,) are those of moves, `row_of` (n,) their last rows."""
    done, away = command.copy(), command[row_of] - nominal
    call, some = np.unique(holes.call, return_index=True)
    some = some[(call >= 0) & (frame[call] == frame[holes.bottom[some]])]
    call = holes.call[some]
    middle = (away[holes.first[some]] + away[holes.bottom[some]]) / 2
    done[row_of[call], :2] = nominal[call, :2] + middle[:, :2]
    return done


def lifted(
    program: Program, holes: Drilled, away: Array, unit: Array, decimals: Index, made: EditList, tally: Tally
) -> Array:  # fmt: skip
    """(n,) how much higher than the program says the strokes are as written, mm; writes the levels of
    their cycles. `away` (n,) is how much higher they have to be, `unit` (n,) and `decimals` (n,) those of Z.
    """
    lift, path = np.zeros(len(away)), program.toolpath
    surfaces, levels = Surfaces(), CalledLevels()
    columns = (holes.first.tolist(), holes.bottom.tolist(), holes.last.tolist())
    for k, (first, bottom, last) in enumerate(zip(*columns, strict=True)):
        line, places = int(path.line[bottom]), int(decimals[bottom])
        if program.statements is not None:
            wanted = float(away[bottom] / unit[bottom])
            down = back = surfaces.lift(program, k, line, wanted, places, made, tally)
        else:
            down, back = (
                round(float(away[move] / unit[move]) * 10**places) / 10**places for move in (bottom, last)
            )
            if path.kind[last] == Kind.LINE:
                back = down
            levels.lift(program, k, line, (back, down), places, made, tally)
        lift[first : last + 1] = down * unit[bottom]
        rapid = bottom + 1 + np.flatnonzero(path.kind[bottom + 1 : last + 1] == Kind.RAPID)
        lift[rapid] = back * unit[bottom]
    return lift
