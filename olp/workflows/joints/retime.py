"""`retime` on machines with rotary joints: every axis inside its limits, the tip inside its feed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from olp.compensation.joints.path import JointPath
from olp.core.arrays import Array, Index
from olp.core.errors import CannotCompute, UsageError
from olp.core.progress import Progress, silent
from olp.core.toolpath import BLEND_MM
from olp.core.values import dataclass
from olp.files.write import write_bytes
from olp.kinematics.structure import Structure
from olp.trajectory.from_joints import clock_of, limits_of, routes_of
from olp.trajectory.joint_gains import joint_gains
from olp.trajectory.joint_motion import Stretch, planned
from olp.trajectory.motion import Motion as PlannedMotion
from olp.workflows.flatten import UnrollOptions
from olp.workflows.joints.loaded import JointRun
from olp.workflows.joints.retime_report import LONGEST, summary
from olp.workflows.retime import check_override, numbered, picture_of
from olp.workflows.session import PathLike
from olp.workflows.shown import Shown

#: Places of a piece of the motion between which its way is about straight.
_STEPS = 9
#: Rows of a file at a time.
_ROWS = 1 << 14


@dataclass(frozen=True, slots=True, kw_only=True)
class JointRetimeOptions(UnrollOptions):
    """The options of `retime` on such machines."""

    blend_mm: float | None = None
    feed_override: float = 100.0
    gains: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class JointRetiming(Shown):
    """The motion of a program: `trajectories` in the space of their routes, which `at` turns into axis
    values; the report ("olp-joint-retime-1")."""

    structure: Structure
    stretches: tuple[Stretch, ...]
    report: dict[str, Any]
    findings: tuple[()] = ()

    @property
    def duration_s(self) -> float:
        return float(sum(s.trajectory.duration_s for s in self.stretches))

    def seconds(self, move: Index, share: Array) -> Array:
        """(n,) s at which the motion is about at shares of moves, NaN where none is planned."""
        result, begin = np.full(len(move), np.nan), 0.0
        for one in self.stretches:
            route, pieces = one.route, one.trajectory.motion
            end = np.zeros(len(route.line) + 1)
            np.maximum.at(end, pieces.line + 1, pieces.start_s[1:])
            end = np.maximum.accumulate(end)
            key = np.append(float(route.move[0]), route.move + route.share)
            rows = np.flatnonzero((move >= route.move[0]) & (move <= route.move[-1]))
            time, way = _ways(pieces)
            place = np.interp(move[rows] + share[rows], key, np.interp(end, time, way))
            result[rows] = begin + np.interp(place, way, time)
            begin += one.trajectory.duration_s
        return result

    def at(self, stretch: int, time_s: Array) -> tuple[Array, Array, Array, Array, Index]:
        """Axis values in mm and deg, their velocities, accelerations and jerks, (n, axes) each, and lines
        (n,), at times (n,) s of a stretch, counted from 0."""
        one = self.stretches[stretch]
        position, velocity, acceleration, jerk, segment = one.trajectory.at(time_s)
        scale = one.route.scale
        return position / scale, velocity / scale, acceleration / scale, jerk / scale, one.route.line[segment]

    def to_text(self) -> str:
        """The report as `olp retime` prints it."""
        from olp.reports.joint_retime import to_text

        return to_text(self.report)

    def plots(
        self, path: PathLike, *, stretch: int | None = None, from_s: float = 0.0, to_s: float | None = None
    ) -> dict[Path, bytes]:
        """Pictures of the tip's speed and of what each axis uses of its limits over time, by path: one file
        (.svg or .png), or one per stretch. Raises UsageError for another suffix, an impossible stretch, and
        an empty span of time."""
        from olp.reports.plots.joint_time import joint_motion_plot

        target, count = Path(path), len(self.stretches)
        kind = picture_of(target)
        if stretch is not None and not 1 <= stretch <= count:
            raise UsageError(f"there is no stretch {stretch}; the program has {count}, counted from 1")
        numbers = [stretch] if stretch is not None else list(range(1, count + 1))
        pictures = {}
        for number in numbers:
            one, lines = self.stretches[number - 1], self.report["stretches"][number - 1]
            where = numbered(target, number) if len(numbers) > 1 else target
            title = (
                f"{self.report['program'] or 'program'} on {self.structure.name}, "
                f"lines {lines['first_line']} to {lines['last_line']}"
            )
            pictures[where] = joint_motion_plot(one, title, kind, from_s=from_s, to_s=to_s)
        return pictures

    def to_csv(self, cycle_s: float = 1e-3) -> Iterator[bytes]:
        """Axis values, velocities and accelerations at the cycles of the control, and the line. Stretches
        follow one another."""
        units = [
            f"{name}_{unit}" for name, unit in zip(self.structure.order, self.structure.units, strict=True)
        ]
        head = ["t_s", *units, *(f"V{u}_s" for u in units), *(f"A{u}_s2" for u in units), "line"]
        yield (",".join(head) + "\n").encode()
        begin = 0.0
        for number, one in enumerate(self.stretches):
            times = one.trajectory.sample_times(cycle_s)
            for a in range(0, len(times), _ROWS):
                some = times[a : a + _ROWS]
                position, velocity, acceleration, _, line = self.at(number, some)
                table = np.column_stack((begin + some, position, velocity, acceleration)) + 0.0
                rows = zip(table.tolist(), line.tolist(), strict=True)
                yield "".join(f"{','.join(f'{v:.9g}' for v in row)},{n}\n" for row, n in rows).encode()
            begin += one.trajectory.duration_s

    def write(self, path: PathLike, cycle_s: float = 1e-3, *, force: bool = False) -> Path:
        """Write the samples as CSV, whole or not at all."""
        write_bytes(path, self.to_csv(cycle_s), force=force)
        return Path(path)


def retime_joints(
    program: PathLike | bytes,
    machine: PathLike,
    job: PathLike | None = None,
    *,
    blend_mm: float | None = None,
    feed_override: float = 100.0,
    gains: bool = False,
    flatten: bool = False,
    expand_cycles: bool = False,
    progress: Progress | None = None,
) -> JointRetiming:
    """The fastest motion found along a program that keeps every axis inside its limits of velocity,
    acceleration and jerk, the tip inside its feed, and within the path tolerance.

    `blend_mm` is the path tolerance where the program names none; it has priority over the machine file.
    `feed_override` is the override of feeds in percent; rapids keep their speed. `gains` adds the lines on
    which more path tolerance or more feed would save most.
    Raises as `correct_joints`, and ConfigError where the machine file leaves a limit out.
    """
    options = JointRetimeOptions(
        blend_mm=blend_mm, feed_override=feed_override, gains=gains, flatten=flatten,
        expand_cycles=expand_cycles,
    )  # fmt: skip
    return retimed(JointRun.of(program, machine, job), options, progress)


def retimed(run: JointRun, options: JointRetimeOptions, progress: Progress | None = None) -> JointRetiming:
    """As `retime_joints`, for a run that is loaded."""
    check_override(options.feed_override)
    limits_of(run.machine.structure)
    with run.program.errors():
        _, path = run.read(run.program, options)
    return motion_of(run, path, options, progress)


def motion_of(
    run: JointRun, path: JointPath, options: JointRetimeOptions, progress: Progress | None = None, *,
    optimise: bool | None = None,
) -> JointRetiming:  # fmt: skip
    """As `retime_joints`, for a path that was read. `optimise` is that of `plan`."""
    tell = progress or silent
    structure, control = run.machine.structure, run.machine.control
    limits = limits_of(structure)
    stated = (options.blend_mm, None if control is None else control.blend_mm, BLEND_MM)
    blend_mm = next(value for value in stated if value is not None)
    with path.program.errors():
        clock = clock_of(path, blend_mm)

    def again(tolerance: float, feed: float) -> tuple[Stretch, ...]:
        factor = feed * options.feed_override / 100.0
        routes = routes_of(path, clock, tolerance, factor)
        return tuple(planned(path.motion, route, limits, tell, optimise) for route in routes)

    stretches = again(1.0, 1.0)
    if not stretches:
        raise CannotCompute(
            "no move of the program begins and ends at known positions of all axes, so nothing can be timed; "
            "command all axes first",
            file=run.program.name or None,
        )
    timed = np.unique(np.concatenate([one.route.line for one in stretches]))
    # the first row of a list is where the motion begins
    moving = np.isfinite(path.end).all(axis=1) & ~np.isfinite(path.start).all(axis=1)
    moving &= path.listed is None
    report = {
        "schema": "olp-joint-retime-1",
        "program": Path(run.program.name).name if run.program.name else "",
        **run.heads(),
        "blend_mm": blend_mm,
        "feed_override": options.feed_override / 100.0,
        "waypoints": int(sum(len(one.route.route) for one in stretches)),
        "untimed": {"moves": int(moving.sum()), "lines": np.unique(path.line[moving])[:LONGEST].tolist()},
        **summary(structure, stretches, timed),
    }
    if options.gains:

        def tolerances(lines: Index) -> Array:
            largest = np.zeros(len(lines))
            row = np.flatnonzero(np.isin(path.line, lines))
            np.maximum.at(largest, np.searchsorted(lines, path.line[row]), clock.blend_mm[row])
            return largest

        report["gains"] = joint_gains(stretches, timed, tolerances, again)
    return JointRetiming(structure, stretches, report)


def _ways(motion: PlannedMotion) -> tuple[Array, Array]:
    """Times in order, and the length of the path up to each."""
    width, share = np.diff(motion.start_s), np.linspace(0.0, 1.0, _STEPS)
    piece = np.arange(len(motion)).repeat(_STEPS)
    after = (width[:, None] * share).ravel()
    step = np.linalg.norm(np.diff(motion.positions(piece, after), axis=0), axis=1)
    return motion.start_s[piece] + after, np.append(0.0, np.cumsum(step))
