"""`simulate` on machines with rotary joints: the poses of the tool that the uncompensated machine takes."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from typing import Any

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.units import RAD_PER_URAD
from olp.core.values import dataclass
from olp.kinematics.pose_axes import led_in_order
from olp.kinematics.poses import rotation_vector
from olp.program.origin import Files, Origin
from olp.workflows.doubt import accepted_of
from olp.workflows.flatten import UnrollOptions
from olp.workflows.joints.along import Along
from olp.workflows.joints.doubt import doubted
from olp.workflows.joints.loaded import JointRun
from olp.workflows.session import PathLike
from olp.workflows.shown import Shown


@dataclass(frozen=True, slots=True, eq=False)
class JointSimulation(Shown):
    """(n, 3) positions of the tip in mm, in coordinates of the part where its zero was set. (n, 3) turns of
    the tool against the nominal one, rad, (n, axes) nominal axis values, and the line of each. Lines count
    through the files of an unrolled program (`origin`). The report is "olp-simulation-1"."""

    points_mm: Array
    turns_rad: Array
    axes: Array
    line: Index
    columns: tuple[str, ...]
    report: dict[str, Any]
    findings: tuple[()] = ()
    origin: Origin | None = None

    def to_csv(self) -> bytes:
        """`X_mm,Y_mm,Z_mm,RX_urad,RY_urad,RZ_urad`, the commanded axis values, and the line; `file` too where
        lines are of several."""
        files = Files(self.origin)
        head = ["X_mm", "Y_mm", "Z_mm", "RX_urad", "RY_urad", "RZ_urad"]
        head += [f"axis_{column}" for column in self.columns]
        values = np.hstack((self.points_mm, self.turns_rad / RAD_PER_URAD, self.axes))
        rows = ["# frame=workpiece", ",".join((*head, f"line{files.head}"))]
        rows += [
            ",".join((*(f"{value:.6f}" for value in row), files.cells(line)))
            for row, line in zip(values.tolist(), self.line.tolist(), strict=True)
        ]
        return ("\n".join(rows) + "\n").encode()


@dataclass(frozen=True, slots=True, kw_only=True)
class JointSimulateOptions(UnrollOptions):
    """The options of `simulate` on such machines: the day of the run, and the codes of doubts to accept."""

    date: datetime.date | None = None
    accept: tuple[str, ...] = ()


def simulate_joints(
    program: PathLike | bytes,
    machine: PathLike,
    job: PathLike | None = None,
    *,
    step_mm: float = 1.0,
    date: datetime.date | None = None,
    accept: Sequence[str] = (),
) -> JointSimulation:
    """The poses that a machine with its errors takes along a program. Raises as `correct_joints`."""
    options = JointSimulateOptions(date=date, accept=tuple(accept))
    return simulated(JointRun.of(program, machine, job), options, step_mm)


def simulated(run: JointRun, options: JointSimulateOptions, step_mm: float) -> JointSimulation:
    """As `simulate_joints`, for a run that is loaded."""
    with run.program.errors():
        _, path = run.read(run.program, options)
        doubts = doubted(run, path, options.accept, options.date, stamped=run.program.data)
    along = Along.of(path, step_mm).begun()
    nominal, actual = along.nominal(), along.actual()
    turns = rotation_vector(actual.rotation @ np.swapaxes(nominal.rotation, -1, -2))
    structure, move = path.motion.structure, along.move
    names = tuple(f"{name}_{unit}" for name, unit in zip(structure.order, structure.units, strict=True))
    report = {"schema": "olp-simulation-1", "frame": "workpiece", "points": len(move), **run.heads()}
    report |= {"accepted": accepted_of(doubts), "findings": [one.as_dict() for one in doubts]}
    axes = led_in_order(structure, along.axes)
    line = path.program.in_original().toolpath.line[move].astype(np.int64)
    return JointSimulation(actual.position, turns, axes, line, names, report, origin=path.program.origin)
