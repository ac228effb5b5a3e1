"""One re-timing run: from a program to a trajectory and the report of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from olp.exceptions import CannotCompute, OlpError
from olp.files import trajectory as files
from olp.loading import PathLike, profile_of, setup_of, source_of
from olp.machine import Setup
from olp.program.reader import Options, read
from olp.trajectory.from_program import axis_limits, routes
from olp.trajectory.plan import Trajectory, plan
from olp.trajectory.route import Route
from olp.trajectory.summary import summary

Progress = Callable[[str, float], None]

#: what a control's servo takes
CYCLE_S = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Retiming:
    """A trajectory for each stretch of the program between places that the control alone knows, the routes
    that they drive, and the report."""

    trajectories: tuple[Trajectory, ...]
    routes: tuple[Route, ...]
    report: dict[str, Any]

    @property
    def duration_s(self) -> float:
        return sum(t.duration_s for t in self.trajectories)

    @property
    def trajectory(self) -> Trajectory:
        """The one trajectory of a program that is known all through. Raises CannotCompute where there are
        more or none."""
        if len(self.trajectories) != 1:
            raise CannotCompute(
                f"the program has {len(self.trajectories)} stretches of known position; expected one: give "
                "start_mm in the job file, and take the moves that the control makes by itself out"
            )
        return self.trajectories[0]

    def to_csv(self, cycle_s: float = CYCLE_S) -> Iterator[bytes]:
        """The samples of every `cycle_s`, a block at a time. Raises CannotCompute as `trajectory` does."""
        return files.csv(self.trajectory, cycle_s)

    def to_npz(self, cycle_s: float = CYCLE_S) -> bytes:
        return files.npz(self.trajectory, cycle_s)

    def to_parquet(self, cycle_s: float = CYCLE_S) -> bytes:
        """The columns of the CSV. Raises ConfigError without pyarrow."""
        return files.parquet(self.trajectory, cycle_s)

    def to_ros(self, cycle_s: float = CYCLE_S) -> bytes:
        return files.ros(self.trajectory, cycle_s)

    def to_pvt(self, cycle_s: float = CYCLE_S) -> Iterator[bytes]:
        return files.pvt(self.trajectory, cycle_s)


def retime(
    program: PathLike | bytes,
    machine: PathLike | Setup,
    job: PathLike | None = None,
    *,
    blend_mm: float | None = None,
    contour: bool = False,
    progress: Progress | None = None,
) -> Retiming:
    """The fastest motion found along a program that keeps every axis inside its limits of velocity,
    acceleration and jerk, the feed, and the path tolerance of G64.

    `blend_mm` is the tolerance where the path mode names none. Raises InputError (ProgramError with its line,
    ConfigError) and CannotCompute.
    """
    data, name = source_of(program)
    setup = setup_of(machine, job)
    tell = progress or (lambda what, share: None)
    try:
        tell("read", 0.0)
        found = read(data, setup, profile_of(setup), Options(contour=contour))
        limits = axis_limits(setup.machine)
        legs = routes(found) if blend_mm is None else routes(found, blend_mm=blend_mm)
    except OlpError as error:
        raise (error.in_file(name) if name and error.line is not None else error) from None
    trajectories = []
    edges = np.cumsum([0, *(len(leg) for leg in legs)])
    for leg, (a, b) in zip(legs, pairwise(edges.tolist()), strict=True):
        span = (a / max(edges[-1], 1), b / max(edges[-1], 1))
        trajectories.append(plan(leg, limits, _within(tell, *span)))
    report = _report(Path(name).name if name else "", setup, tuple(trajectories), legs)
    return Retiming(tuple(trajectories), legs, report)


def _within(tell: Progress, first: float, last: float) -> Progress:
    """Progress of one stretch as that of the whole."""
    return lambda what, share: tell(what, first + share * (last - first))


def _report(
    name: str, setup: Setup, trajectories: tuple[Trajectory, ...], legs: tuple[Route, ...]
) -> dict[str, Any]:
    parts = [summary(t, [leg]) for t, leg in zip(trajectories, legs, strict=True)]
    deviation = [leg.deviation_mm for t in trajectories for leg in t.legs]
    limits = axis_limits(setup.machine)
    return {
        "schema": "olp-retime-1",
        "program": name,
        "machine": setup.machine.name,
        "duration_s": sum(t.duration_s for t in trajectories),
        "path_deviation_um": max(deviation, default=0.0) * 1e3,
        "waypoints": sum(len(leg) for leg in legs),
        "pieces": sum(len(t.motion) for t in trajectories),
        "limits": {
            "velocity_mm_s": limits.velocity.tolist(),
            "acceleration_mm_s2": limits.acceleration.tolist(),
            "jerk_mm_s3": limits.jerk.tolist(),
        },
        "stretches": parts,
    }
