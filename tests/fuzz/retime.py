"""One seed of the fuzz: a random program on a machine of random limits, re-timed whole and judged."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from judge import machines, retime_programs
from judge.machines import Recipe
from judge.retiming import Verdict, judge

import olp

_ZERO = {axis + "_mm": 0.0 for axis in "XYZ"}
_RECIPE = Recipe(
    travel=((-3000.0, 3000.0),) * 3,
    work_offsets={
        "G54": {**_ZERO, "set_by": "true"},
        "G55": {"X_mm": 20.0, "Y_mm": -10.0, "Z_mm": 5.0, "set_by": "true"},
    },
)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What was planned of one program: waypoints, seconds of motion, and the verdict of each stretch."""

    waypoints: int
    duration_s: float
    verdicts: tuple[Verdict, ...]

    @property
    def wrong(self) -> tuple[str, ...]:
        return tuple(text for verdict in self.verdicts for text in verdict.wrong)


def setup(folder: Path) -> olp.Setup:
    """A machine without errors that starts at the axis positions 0."""
    path = machines.zero_machine(folder, _RECIPE)
    job = path.with_name("job.toml")
    start = "start_mm = { X = 0.0, Y = 0.0, Z = 0.0 }"
    job.write_text(f'schema = "olp-job-1"\nmachine = "machine.toml"\n{start}\n')
    return olp.load_setup(path, job)


def limited(base: olp.Setup, seed: int) -> olp.Setup:
    """The same machine with the limits of a seed."""
    limits = retime_programs.limits(seed)
    axes = {
        name: replace(
            base.machine.axes[name],
            velocity_mm_s=float(limits[0, i]),
            acceleration_mm_s2=float(limits[1, i]),
            jerk_mm_s3=float(limits[2, i]),
        )
        for i, name in enumerate("XYZ")
    }
    return replace(base, machine=replace(base.machine, axes=axes))


def outcome(seed: int, base: olp.Setup) -> Outcome:
    """Re-time and judge the program of a seed. Every program of it is legal, so no exception is expected."""
    return judged(retime_programs.program(seed), limited(base, seed))


def judged(program: bytes | Path, machine: olp.Setup) -> Outcome:
    retimed = olp.retime(program, machine, accept=("OLP440", "OLP465"))
    stretches = zip(retimed.trajectories, retimed.routes, strict=True)
    return Outcome(
        sum(len(route) for route in retimed.routes),
        retimed.duration_s,
        tuple(judge(planned.motion, route, planned.limits) for planned, route in stretches),
    )
