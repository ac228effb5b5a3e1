"""A machine of any joints with all tools of a program: poses and commands of rows, each with its own tool."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from olp.core.arrays import Array, Index, Mask, distinct
from olp.core.errors import NotInvertible
from olp.core.machine import Vector
from olp.core.turns import Turn, turned
from olp.core.values import dataclass
from olp.kinematics.chain import Kinematics
from olp.kinematics.coordinates import Coordinates
from olp.kinematics.correction import (
    CorrectedPoses,
    beyond_travel,
    correct_poses,
    correctable_angles,
    meet_positions,
)
from olp.kinematics.errors import MachineErrors
from olp.kinematics.pose_axes import stated_mobility
from olp.kinematics.poses import Poses
from olp.kinematics.programmed import axes_of_tips, stated_targets, stated_tips, tips_of_axes
from olp.kinematics.structure import Structure

#: A tool vector, and how words are turned.
TurnedTool = tuple[Vector, Turn | None]
#: Some rows, or all.
Rows = Index | slice
#: Steps by which a direction of the tool is found.
_STEPS = 6
#: deg by which slopes of directions are found.
_HALF_DEG = 1e-3
#: Below this share of the largest slope a rotary axis does not turn the direction.
_FLAT = 1e-6
#: rad by which a direction may be missed.
_DIRECTED_RAD = 1e-8
#: A direction that is missed by less, rad, is met.
_MET_RAD = 1e-14


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A machine with its errors and the tool vectors of a program, one `machines` each, beside how words are
    turned with it (`Frame.turn`). Rows of axis values (n, axes) name their `tool` (n,) by its place there."""

    structure: Structure
    machines: tuple[Kinematics, ...]
    turns: tuple[Turn | None, ...]

    @staticmethod
    def of(structure: Structure, errors: MachineErrors, tools: Sequence[TurnedTool]) -> Motion:
        machines = {tool: Kinematics(structure, errors, tool) for tool, _ in tools}
        return Motion(structure, tuple(machines[tool] for tool, _ in tools), tuple(turn for _, turn in tools))

    @property
    def width(self) -> Array:
        """(axes,) backlash of each axis, mm or deg."""
        errors = self.machines[0].errors.joints
        widths = [errors[name].backlash if name in errors else 0.0 for name in self.structure.order]
        rotary = [unit == "deg" for unit in self.structure.units]
        return np.where(rotary, np.degrees(widths), widths)

    def nominal(self, axes: Array, tool: Index) -> Poses:
        """(n) poses of the nominal machine."""
        return self._poses(tool, lambda machine, rows: machine.nominal(axes[rows]))

    def actual(self, axes: Array, tool: Index, sides: Array | None = None) -> Poses:
        """(n) poses of the machine with its errors; `sides` as in `Kinematics.actual`."""
        return self._poses(
            tool, lambda machine, rows: machine.actual(axes[rows], None if sides is None else sides[rows])
        )

    def axes(self, programmed: Array, tool: Index, tip: Mask) -> Array:
        """(n, axes) axis values of programmed coordinates, which state the `tip` in some rows. Raises
        NotInvertible with rows whose poses are out of reach."""
        return self._by_tool(self._turned(programmed, tool, back=False), tool, tip, axes_of_tips)

    def targets(self, programmed: Array, tool: Index, tip: Mask) -> Poses:
        """(n) poses of the nominal machine at programmed coordinates, which state the `tip` in some rows:
        the linear axes do not turn the tool."""
        values = self._turned(programmed, tool, back=False)

        def pose(machine: Kinematics, rows: Rows) -> Poses:
            stated = tip[rows]
            if stated.all():
                return stated_targets(machine, values[rows])
            poses = machine.nominal(values[rows])
            if stated.any():
                poses.position[stated] = stated_tips(machine, values[rows][stated])
            return poses

        return self._poses(tool, pose)

    def programmed(self, axes: Array, tool: Index, tip: Mask) -> Array:
        """(n, axes) the other way round."""
        return self._turned(self._by_tool(axes, tool, tip, tips_of_axes), tool, back=True)

    def between(self, start: Array, end: Array, share: Array, tool: Index, vector: Mask) -> Array:
        """(n, axes) programmed coordinates at shares of moves. In `vector` rows the direction of the tool
        goes evenly along a great circle, else each coordinate goes evenly. Raises NotInvertible with a row
        whose directions are not reached."""
        place: Array = start + share[:, None] * (end - start)
        whole = share == 1.0
        place[whole] = end[whole]
        rotary = np.array([unit == "deg" for unit in self.structure.units])
        turning = (start[:, rotary] != end[:, rotary]).any(axis=1)
        rows = np.flatnonzero(vector & turning & ~whole & (share != 0.0))
        if rows.size:
            target = _great_circle(self._axis(start[rows]), self._axis(end[rows]), share[rows])
            place[rows] = self.directed(place[rows], target, np.flatnonzero(rotary), rows)
        return place

    def _axis(self, axes: Array) -> Array:
        """(n, 3) directions of the nominal tool, which depend on rotary axes alone."""
        return np.asarray(self.machines[0].nominal(axes).rotation[:, :, 2])

    def directed(self, place: Array, target: Array, rotary: Index, rows: Index) -> Array:
        """(r, axes) `place` with the rotary values, in the columns `rotary`, near its own whose tool has the
        directions `target` (r, 3). Raises NotInvertible with one of `rows` (r,) where none does."""
        for _ in range(_STEPS):
            miss = target - self._axis(place)
            if np.abs(miss).max(initial=0.0) < _MET_RAD:
                break
            slopes = np.empty((len(place), 3, len(rotary)))
            for number, column in enumerate(rotary.tolist()):
                ahead, behind = place.copy(), place.copy()
                ahead[:, column] += _HALF_DEG
                behind[:, column] -= _HALF_DEG
                slopes[:, :, number] = (self._axis(ahead) - self._axis(behind)) / (2.0 * _HALF_DEG)
            place[:, rotary] += (np.linalg.pinv(slopes, rcond=_FLAT) @ miss[..., None])[..., 0]
        away = np.linalg.norm(target - self._axis(place), axis=1)
        if (away > _DIRECTED_RAD).any():
            error = NotInvertible("no rotary axis values give the direction of the tool")
            error.rows = tuple(rows[away > _DIRECTED_RAD].tolist())
            raise error
        return place

    def _turned(self, values: Array, tool: Index, *, back: bool) -> Array:
        """Linear coordinates along the words turned into those along the axes, or back."""
        if not any(self.turns):
            return values
        columns, result = Coordinates.of_words(self.structure).linear, values.copy()
        for which in distinct(tool).tolist():
            turn = self.turns[which]
            if turn is not None:
                rows = np.flatnonzero(tool == which)
                matrix = np.array(turn).T if back else np.array(turn)
                result[np.ix_(rows, columns)] = turned(matrix, values[np.ix_(rows, columns)])
        return result

    def command(self, axes: Array, tool: Index, shift_mm: Array) -> CorrectedPoses:
        """Corrected axis values of nominal ones, whose targets are moved by (n, 3). Raises NotInvertible."""
        values, left, limited = axes.copy(), np.zeros((len(axes), 3)), np.zeros(len(axes), bool)
        for machine, rows in self._groups(tool):
            with _of_rows(rows):
                done = correct_poses(machine, axes[rows], shift_mm=shift_mm[rows])
            values[rows], left[rows], limited[rows] = done.values, done.left_rad, done.limited
        return CorrectedPoses(values, left, limited, beyond_travel(self.structure, values))

    def linear(self, axes: Array, tool: Index, target: Poses) -> CorrectedPoses:
        """Axis values whose linear axes alone bring the tip to its target. Raises NotInvertible."""
        values, left, limited = axes.copy(), np.zeros((len(axes), 3)), np.zeros(len(axes), bool)
        for machine, rows in self._groups(tool):
            with _of_rows(rows):
                solved = meet_positions(machine, target.only(rows), axes[rows])
            values[rows], left[rows] = solved.values, solved.left_rad
        return CorrectedPoses(values, left, limited, beyond_travel(self.structure, values))

    def correctable(self, axes: Array, tool: Index, actual: Poses, target: Poses) -> Array:
        """(n,) as `correctable_angles` of poses at axis values."""
        angles = np.empty(len(axes))
        for machine, rows in self._groups(tool):
            angles[rows] = correctable_angles(machine, axes[rows], actual.only(rows), target.only(rows))
        return angles

    def slopes(self, axes: Array, tool: Index) -> Array:
        """(n, 6, axes) as `Kinematics.jacobian`."""
        slopes = np.empty((len(axes), 6, axes.shape[1]))
        for machine, rows in self._groups(tool):
            slopes[rows] = machine.jacobian(axes[rows])
        return slopes

    def stated_mobility(self, axes: Array, tool: Index) -> Array:
        """(n,) as `stated_mobility`."""
        found = np.empty(len(axes))
        for machine, rows in self._groups(tool):
            found[rows] = stated_mobility(machine, axes[rows])
        return found

    def _groups(self, tool: Index) -> Iterator[tuple[Kinematics, Rows]]:
        """The machine with each tool, and its rows."""
        for which in distinct(tool).tolist():
            mine = tool == which
            yield self.machines[which], slice(None) if mine.all() else np.flatnonzero(mine)

    def _poses(self, tool: Index, pose: Callable[[Kinematics, Rows], Poses]) -> Poses:
        parts = [(rows, pose(machine, rows)) for machine, rows in self._groups(tool)]
        if len(parts) == 1:
            return parts[0][1]
        rotation, position = np.empty((3, 3, len(tool))), np.empty((3, len(tool)))
        for rows, part in parts:
            rotation[:, :, rows] = part.rotation.transpose(1, 2, 0)
            position[:, rows] = part.position.T
        return Poses(rotation.transpose(2, 0, 1), position.T)

    def _by_tool(
        self, values: Array, tool: Index, tip: Mask, change: Callable[[Kinematics, Array], Array]
    ) -> Array:
        if not tip.any():
            return values
        changed = values.copy()
        for machine, rows in self._groups(tool):
            mine = np.arange(len(tool))[rows][tip[rows]]
            changed[mine] = change(machine, values[mine])
        return changed


def _great_circle(start: Array, end: Array, share: Array) -> Array:
    """(n, 3) directions at shares of the way between two (n, 3)."""
    sine = np.linalg.norm(np.cross(start, end), axis=1)
    angle = np.arctan2(sine, np.sum(start * end, axis=1))
    whole = np.where(sine > 0.0, sine, 1.0)
    first = np.where(sine > 0.0, np.sin((1.0 - share) * angle) / whole, 1.0 - share)
    second = np.where(sine > 0.0, np.sin(share * angle) / whole, share)
    return np.asarray(first[:, None] * start + second[:, None] * end)


@contextlib.contextmanager
def _of_rows(rows: Rows) -> Iterator[None]:
    """Names rows of all rows in an error that names some of a part."""
    try:
        yield
    except NotInvertible as error:
        if not isinstance(rows, slice):
            error.rows = tuple(rows[list(error.rows)].tolist())
        raise
