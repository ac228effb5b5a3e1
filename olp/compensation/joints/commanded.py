"""The commands that bring the tool to places along moves of a machine with rotary joints, before backlash."""

from __future__ import annotations

import numpy as np

from olp.compensation.joints.path import JointPath
from olp.compensation.joints.posed import unreached
from olp.core.arrays import Array, Index, Mask
from olp.core.errors import NotInvertible, ProgramError
from olp.core.values import dataclass
from olp.kinematics.correction import CorrectedPoses, left_angles
from olp.kinematics.poses import Poses

#: Rows whose commands are found at a time, so that memory is small.
_BATCH = 1 << 15


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Rows at shares of moves with their commands, before backlash, on whose `side` they are."""

    move: Index
    share: Array
    axes: Array
    target: Poses
    side: Array
    left_rad: Array
    limited: Mask

    @staticmethod
    def join(parts: list[Rows]) -> Rows:
        rotation = np.concatenate([part.target.rotation for part in parts])
        position = np.concatenate([part.target.position for part in parts])
        names = ("move", "share", "axes", "side", "left_rad", "limited")
        columns = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
        return Rows(target=Poses(rotation, position), **columns)

    def only(self, rows: Index | Mask) -> Rows:
        return Rows(
            self.move[rows], self.share[rows], self.axes[rows],
            self.target.only(rows), self.side[rows],
            self.left_rad[rows], self.limited[rows],
        )  # fmt: skip


def solved(path: JointPath, move: Index, share: Array, side: Array) -> Rows:
    """The commands at shares of moves; `side` (r, axes) of the backlash there."""
    motion, parts = path.motion, []
    rotary = np.array([unit == "deg" for unit in motion.structure.units])
    for a in range(0, max(len(move), 1), _BATCH):
        some, at = move[a : a + _BATCH], share[a : a + _BATCH]
        tool, shift, own = path.tool[some], path.shift_mm[some], side[a : a + _BATCH]
        try:
            axes = motion.axes(path.at(some, at), tool, path.tip[some])
        except NotInvertible as error:
            raise unreached(int(path.line[some[error.rows[0]]])) from None
        nominal = motion.nominal(axes, tool)
        done = _commanded(path, some, axes, tool, shift)
        target = Poses(nominal.rotation, nominal.position + shift)
        pole = path.directions.keep(motion.structure, some, nominal.rotation[:, :, 2])
        held = np.flatnonzero(path.held[some] | pole)
        if held.size:
            stands = axes[held]
            # where no word of a rotary axis changes, its backlash stays
            play = np.where(path.stay[some[held], None] & rotary, 0.5 * motion.width * own[held], 0.0)
            solved = motion.linear(stands - play, tool[held], target.only(held))
            done.values[held], done.left_rad[held] = solved.values, solved.left_rad
            done.limited[held] = pole[held]
        left = left_angles(motion.structure, done.left_rad, target)
        parts.append(Rows(some, at, done.values, target, own, left, done.limited))
    return Rows.join(parts)


def led(path: JointPath, begin: Rows, end: Rows, owner: Index, part: Array) -> Array:
    """(p, axes) axis values, before backlash, at parts of stretches along which the control leads the
    machine: `owner` (p,) of those between `begin` and `end` (s,). Along a stretch the sides of the backlash
    are those of its end."""
    motion, move = path.motion, end.move[owner]
    lead = 0.5 * motion.width * end.side
    ends = [path.commanded(rows.move, rows.share, rows.axes + lead) for rows in (begin, end)]
    written = path.between(ends[0][owner], ends[1][owner], part, move)
    return np.asarray(motion.axes(written, path.tool[move], path.tip[move]) - lead[owner])


def _commanded(path: JointPath, move: Index, axes: Array, tool: Index, shift: Array) -> CorrectedPoses:
    try:
        done = path.motion.command(axes, tool, shift)
    except NotInvertible as error:
        if not error.rows:
            raise
        rows = np.array(error.rows)
        lines, first = np.unique(path.line[move[rows]], return_index=True)
        raise ProgramError.together(
            ProgramError(
                "no axis values bring the tool to where this move has it"
                f"{path.singular(axes[rows[row]])}; expected a target within reach, "
                "away from a singular posture",
                line=line,
                code="OLP566",
            )
            for line, row in zip(lines.tolist(), first.tolist(), strict=True)
        ) from None
    refuse_beyond(path, move, done.values, done.beyond)
    return done


def refuse_beyond(path: JointPath, move: Index, values: Array, beyond: Mask) -> None:
    """Raises ProgramError with the first line whose command (r, axes) is `beyond` (r, axes) the travel."""
    structure = path.motion.structure
    out = np.flatnonzero(beyond.any(axis=1))
    if out.size:
        row = int(out[np.argmin(path.line[move[out]])])
        column = int(np.argmax(beyond[row]))
        name = structure.order[column]
        low, high = structure.joints[name].travel
        raise ProgramError(
            f"the corrected command of {name} "
            f"is {values[row, column]:.6g} {structure.units[column]}, out "
            f"of its travel {low:g} to {high:g}; move the part, or state the travel in the machine file",
            line=int(path.line[move[row]]),
            code="OLP567",
        )
