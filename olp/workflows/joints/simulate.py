"""`simulate` on machines with rotary joints: the poses of the tool that the uncompensated machine takes."""

from __future__ import annotations

from typing import Any

import numpy as np

from olp.compensation.joints.sampling import spread
from olp.core.arrays import Array, Index
from olp.core.units import RAD_PER_URAD
from olp.core.values import dataclass
from olp.kinematics.pose_axes import led_in_order
from olp.kinematics.poses import rotation_vector
from olp.workflows.flatten import UnrollOptions
from olp.workflows.joints.loaded import JointRun
from olp.workflows.session import PathLike
from olp.workflows.shown import Shown


@dataclass(frozen=True, slots=True, eq=False)
class JointSimulation(Shown):
    """(n, 3) positions of the tip in workpiece coordinates, mm, (n, 3) turns of the tool against the nominal
    one, rad, (n, axes) nominal axis values, and the line of each. The report is "olp-simulation-1"."""

    points_mm: Array
    turns_rad: Array
    axes: Array
    line: Index
    columns: tuple[str, ...]
    report: dict[str, Any]
    findings: tuple[()] = ()

    def to_csv(self) -> bytes:
        """`X_mm,Y_mm,Z_mm,RX_urad,RY_urad,RZ_urad`, the commanded axis values, and the line."""
        head = ["X_mm", "Y_mm", "Z_mm", "RX_urad", "RY_urad", "RZ_urad"]
        head += [f"axis_{column}" for column in self.columns]
        values = np.hstack((self.points_mm, self.turns_rad / RAD_PER_URAD, self.axes))
        rows = ["# frame=workpiece", ",".join((*head, "line"))]
        rows += [
            ",".join((*(f"{value:.6f}" for value in row), str(line)))
            for row, line in zip(values.tolist(), self.line.tolist(), strict=True)
        ]
        return ("\n".join(rows) + "\n").encode()


def simulate_joints(
    program: PathLike | bytes, machine: PathLike, job: PathLike | None = None, *, step_mm: float = 1.0
) -> JointSimulation:
    """The poses that a machine with its errors takes along a program. Raises as `correct_joints`."""
    return simulated(JointRun.of(program, machine, job), UnrollOptions(), step_mm)


def simulated(run: JointRun, options: UnrollOptions, step_mm: float) -> JointSimulation:
    """As `simulate_joints`, for a run that is loaded."""
    with run.program.errors():
        _, path = run.read(run.program, options)
    motion = path.motion
    rows = np.flatnonzero(np.isfinite(path.end).all(axis=1) & np.isfinite(path.start).all(axis=1))
    tool, tip = path.tool[rows], path.tip[rows]
    ends = [motion.axes(place[rows], tool, tip) for place in (path.start, path.end)]
    way = np.linalg.norm(
        motion.nominal(ends[1], tool).position - motion.nominal(ends[0], tool).position, axis=1
    )
    way = np.maximum(way, path.curves.length_mm(rows))
    count = np.maximum(np.ceil(way / step_mm).astype(np.int64), 1)
    count = np.maximum(count, path.samples(rows, *ends))
    owner, step = spread(count)
    move = rows[owner]
    axes = motion.axes(path.at(move, (step + 1) / count[owner]), path.tool[move], path.tip[move])
    nominal, actual = motion.nominal(axes, path.tool[move]), motion.actual(axes, path.tool[move])
    turns = rotation_vector(actual.rotation @ np.swapaxes(nominal.rotation, -1, -2))
    structure = motion.structure
    names = tuple(f"{name}_{unit}" for name, unit in zip(structure.order, structure.units, strict=True))
    report = {"schema": "olp-simulation-1", "frame": "workpiece", "points": len(move), **run.heads()}
    axes = led_in_order(structure, axes)
    return JointSimulation(actual.position, turns, axes, path.line[move].astype(np.int64), names, report)
