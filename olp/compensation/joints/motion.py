"""A machine of any joints with all tools of a program: poses and commands of rows, each with its own tool."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator

import numpy as np

from olp.core.arrays import Array, Index, Mask, distinct
from olp.core.errors import NotInvertible
from olp.core.machine import Vector
from olp.core.values import dataclass
from olp.kinematics.chain import Kinematics
from olp.kinematics.correction import CorrectedPoses, beyond_travel, correct_poses, meet_positions
from olp.kinematics.errors import MachineErrors
from olp.kinematics.poses import Poses
from olp.kinematics.programmed import axes_of_tips, tips_of_axes
from olp.kinematics.structure import Structure


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A machine with its errors and the tool vectors of a program, one `machines` each. Rows of axis values
    (n, axes) name their `tool` (n,) by its place there."""

    structure: Structure
    machines: tuple[Kinematics, ...]

    @staticmethod
    def of(structure: Structure, errors: MachineErrors, tools: tuple[Vector, ...]) -> Motion:
        return Motion(structure, tuple(Kinematics(structure, errors, tool) for tool in tools))

    @property
    def width(self) -> Array:
        """(axes,) backlash of each axis, mm or deg."""
        errors = self.machines[0].errors.joints
        widths = [errors[name].backlash if name in errors else 0.0 for name in self.structure.order]
        rotary = [unit == "deg" for unit in self.structure.units]
        return np.where(rotary, np.degrees(widths), widths)

    def nominal(self, axes: Array, tool: Index) -> Poses:
        """(n) poses of the nominal machine."""
        return self._poses(axes, tool, lambda machine, rows: machine.nominal(axes[rows]))

    def actual(self, axes: Array, tool: Index, sides: Array | None = None) -> Poses:
        """(n) poses of the machine with its errors; `sides` as in `Kinematics.actual`."""
        return self._poses(
            axes,
            tool,
            lambda machine, rows: machine.actual(axes[rows], None if sides is None else sides[rows]),
        )

    def axes(self, programmed: Array, tool: Index, tip: Mask) -> Array:
        """(n, axes) axis values of programmed coordinates, which state the `tip` in some rows."""
        return self._by_tool(programmed, tool, tip, axes_of_tips)

    def programmed(self, axes: Array, tool: Index, tip: Mask) -> Array:
        """(n, axes) the other way round."""
        return self._by_tool(axes, tool, tip, tips_of_axes)

    def command(self, axes: Array, tool: Index, shift_mm: Array) -> CorrectedPoses:
        """Corrected axis values of nominal ones, whose targets are moved by (n, 3). Raises NotInvertible."""
        values, left, limited = axes.copy(), np.zeros((len(axes), 3)), np.zeros(len(axes), bool)
        for which in distinct(tool).tolist():
            rows = np.flatnonzero(tool == which)
            with _of_rows(rows):
                done = correct_poses(self.machines[which], axes[rows], shift_mm=shift_mm[rows])
            values[rows], left[rows], limited[rows] = done.values, done.left_rad, done.limited
        return CorrectedPoses(values, left, limited, beyond_travel(self.structure, values))

    def linear(self, axes: Array, tool: Index, target: Poses) -> Array:
        """(n, axes) axis values whose linear axes bring the tip to its target. Raises NotInvertible."""
        values = axes.copy()
        for which in distinct(tool).tolist():
            rows = np.flatnonzero(tool == which)
            part = Poses(target.rotation[rows], target.position[rows])
            with _of_rows(rows):
                values[rows] = meet_positions(self.machines[which], part, axes[rows])
        return values

    def slopes(self, axes: Array, tool: Index) -> Array:
        """(n, 6, axes) as `Kinematics.jacobian`."""
        slopes = np.empty((len(axes), 6, axes.shape[1]))
        for which in distinct(tool).tolist():
            rows = np.flatnonzero(tool == which)
            slopes[rows] = self.machines[which].jacobian(axes[rows])
        return slopes

    def _poses(self, axes: Array, tool: Index, pose: Callable[[Kinematics, Index], Poses]) -> Poses:
        rotation, position = np.empty((len(axes), 3, 3)), np.empty((len(axes), 3))
        for which in distinct(tool).tolist():
            rows = np.flatnonzero(tool == which)
            part = pose(self.machines[which], rows)
            rotation[rows], position[rows] = part.rotation, part.position
        return Poses(rotation, position)

    def _by_tool(
        self, values: Array, tool: Index, tip: Mask, change: Callable[[Kinematics, Array], Array]
    ) -> Array:
        changed = values.copy()
        for which in distinct(tool[tip]).tolist():
            rows = np.flatnonzero(tip & (tool == which))
            changed[rows] = change(self.machines[which], values[rows])
        return changed


@contextlib.contextmanager
def _of_rows(rows: Index) -> Iterator[None]:
    """Names the row of all rows in an error that names one of some."""
    try:
        yield
    except NotInvertible as error:
        if error.row is not None:
            error.row = int(rows[error.row])
        raise
