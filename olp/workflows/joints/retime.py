"""`retime` on machines with rotary joints: every axis inside its limits, the tip inside its feed."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from olp.compensation.joints.path import JointPath
from olp.core.arrays import Array, Index
from olp.core.errors import CannotCompute, UsageError
from olp.core.progress import Progress, silent
from olp.core.toolpath import BLEND_MM
from olp.core.values import dataclass
from olp.files.sources import Source
from olp.files.trajectory import Columns
from olp.kinematics.structure import Structure
from olp.program.feeds.words import Shared, check_feeds
from olp.program.origin import Origin
from olp.trajectory.from_joints import clock_of, limits_of, routes_of
from olp.trajectory.joint_gains import joint_gains
from olp.trajectory.joint_motion import Stretch, planned
from olp.trajectory.joint_usage import joint_usage, limit_names
from olp.trajectory.motion import Motion as PlannedMotion
from olp.trajectory.plan import Trajectory
from olp.trajectory.usage import LineUse, SlowStretches
from olp.trajectory.variants import feeds_report, written_feeds
from olp.workflows.doubt import accepted_of
from olp.workflows.flatten import UnrollOptions
from olp.workflows.joints.doubt import doubted
from olp.workflows.joints.loaded import JointRun
from olp.workflows.joints.retime_report import LONGEST, blend_row, summary
from olp.workflows.original import placed
from olp.workflows.retime import FACTORS, check_override
from olp.workflows.retime_files import StretchFiles, numbered, picture_of
from olp.workflows.retime_report import Legs, against
from olp.workflows.session import PathLike

#: Places of a piece of the motion between which its way is about straight.
_STEPS = 9


@dataclass(frozen=True, slots=True, kw_only=True)
class JointRetimeOptions(UnrollOptions):
    """The options of `retime` on such machines, with the day of the run and the codes of doubts to accept."""

    blend_mm: float | None = None
    study_blend: bool = False
    feed_override: float = 100.0
    gains: bool = False
    block_delete: bool = False
    date: datetime.date | None = None
    accept: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class JointRetiming(StretchFiles):
    """The motion of a program: `stretches` in the space of their routes, which `at` turns into axis values,
    with the lines of the text that the program was unrolled from; the report ("olp-joint-retime-1").
    `driven` has the lines of the text that was planned, and `path` its moves."""

    run: JointRun
    options: JointRetimeOptions
    path: JointPath
    driven: tuple[Stretch, ...]
    stretches: tuple[Stretch, ...]
    report: dict[str, Any]
    findings: tuple[()] = ()

    @property
    def structure(self) -> Structure:
        return self.run.machine.structure

    @property
    def duration_s(self) -> float:
        return float(sum(s.trajectory.duration_s for s in self.stretches))

    @property
    def trajectories(self) -> tuple[Trajectory, ...]:
        """The motion of each stretch in mm and deg of the axes."""
        return tuple(one.in_axes() for one in self.stretches)

    @property
    def columns(self) -> Columns:
        return Columns(tuple(self.structure.order), tuple(self.structure.units))

    @property
    def origin(self) -> Origin | None:
        """Where the lines come from; None where the program was not unrolled."""
        return self.path.program.origin

    @property
    def limits(self) -> tuple[str, ...]:
        """The limits of the motion, in the order of the columns of `lines`."""
        return limit_names(self.structure)

    @property
    def lines(self) -> LineUse:
        """Time, speed of the tip and limit of each line."""
        return LineUse.joined([joint_usage(one)[0] for one in self.stretches])

    @property
    def slow(self) -> tuple[SlowStretches, ...]:
        """Of each stretch, where the tip is slower than half the feed."""
        return tuple(joint_usage(one)[1] for one in self.stretches)

    def with_feeds(self, shared: Shared = "mean", progress: Progress | None = None) -> bytes:
        """As `olp.workflows.retime.Retiming.with_feeds`: the feeds are those of the tip. Raises UsageError
        for programs without F words, and with a feed override."""
        program = self.path.program
        if self.options.feed_override != 100.0:
            raise UsageError("planned feeds count at an override of 100 %; leave the feed override out")
        if program.words is None:
            raise UsageError(
                "the program states no feed in F words, so planned feeds cannot be written; the motion "
                "itself is a table (-o)"
            )
        use = LineUse.joined([joint_usage(one)[0] for one in self.driven])
        written, kept = written_feeds(program, use, shared, block_delete=self.options.block_delete)
        other = self.run.again(written.data, program.dialect, block_delete=self.options.block_delete)
        check_feeds(program, other.program, block_delete=self.options.block_delete)
        options = replace(self.options, gains=False, study_blend=False)
        seconds = motion_of(self.run, other, options, progress).duration_s
        self.report["write_feed"] = placed(feeds_report(written, kept, shared, seconds), self.origin)
        return bytes(written.data)

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
        self, path: PathLike, stretch: int | None = None, *, from_s: float = 0.0, to_s: float | None = None
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


def retime_joints(
    program: PathLike | bytes,
    machine: PathLike,
    job: PathLike | None = None,
    *,
    nominal: PathLike | bytes | None = None,
    blend_mm: float | None = None,
    study_blend: bool = False,
    feed_override: float = 100.0,
    gains: bool = False,
    block_delete: bool = False,
    flatten: bool = False,
    expand_cycles: bool = False,
    date: datetime.date | None = None,
    accept: Sequence[str] = (),
    progress: Progress | None = None,
) -> JointRetiming:
    """The fastest motion found along a program that keeps every axis inside its limits of velocity,
    acceleration and jerk, the tip inside its feed, and within the path tolerance.

    `nominal` is another program, such as the uncorrected one, to compare times with, line by line.
    `blend_mm` is the path tolerance where the program names none; it has priority over the machine file.
    `study_blend` adds times and deviations at a quarter to four times the path tolerances in use.
    `feed_override` is the override of feeds in percent; rapids keep their speed. `gains` adds the lines on
    which more path tolerance or more feed would save most. `block_delete` leaves `/` blocks out. `date` and
    `accept` are those of `correct_joints`.
    Raises as `correct_joints`, and ConfigError where the machine file leaves a limit out.
    """
    options = JointRetimeOptions(
        blend_mm=blend_mm, study_blend=study_blend, feed_override=feed_override, gains=gains,
        block_delete=block_delete, flatten=flatten, expand_cycles=expand_cycles, date=date,
        accept=tuple(accept),
    )  # fmt: skip
    run = JointRun.of(program, machine, job)
    other = None if nominal is None else run.sources.source(nominal)
    return retimed(run, options, progress, other)


def retimed(
    run: JointRun,
    options: JointRetimeOptions,
    progress: Progress | None = None,
    nominal: Source | None = None,
) -> JointRetiming:
    """As `retime_joints`, for a run that is loaded."""
    check_override(options.feed_override)
    limits_of(run.machine.structure)

    def read(source: Source) -> JointPath:
        with source.errors():
            return run.read(source, options, block_delete=options.block_delete)[1]

    path, other = read(run.program), None if nominal is None else read(nominal)
    with run.program.errors():
        doubts = doubted(run, path, options.accept, options.date, stamped=run.program.data)
    result = motion_of(run, path, options, progress)
    result.report["accepted"] = accepted_of(doubts)
    if other is not None and nominal is not None:
        plain = replace(options, gains=False, study_blend=False)
        there = motion_of(run, other, plain, progress)
        versus = against(nominal.short, *(_legs(one) for one in (there, result)))
        result.report["nominal"] = placed(versus, other.program.origin)
    return result


def _legs(result: JointRetiming) -> Legs:
    """The routes of a motion in mm and deg, and the use of its lines."""
    legs = [
        replace(one.route.route, point_mm=one.route.route.point_mm / one.route.scale, line=one.route.line)
        for one in result.driven
    ]
    use = LineUse.joined([joint_usage(one)[0] for one in result.driven])
    return Legs(tuple(legs), use, result.duration_s, result.path.program)


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
    program = path.program
    with program.errors():
        clock = clock_of(path, blend_mm, block_delete=options.block_delete)

    def again(tolerance: float, feed: float) -> tuple[Stretch, ...]:
        factor = feed * options.feed_override / 100.0
        routes = routes_of(path, clock, tolerance, factor)
        return tuple(planned(path.motion, route, limits, tell, optimise) for route in routes)

    def shown(motion: tuple[Stretch, ...]) -> tuple[Stretch, ...]:
        line_of = program.original_lines
        return tuple(replace(one, route=replace(one.route, line=line_of(one.route.line))) for one in motion)

    driven = again(1.0, 1.0)
    if not driven:
        raise CannotCompute(
            "no move of the program begins and ends at known positions of all axes, so nothing can be timed; "
            "command all axes first",
            file=run.program.name or None,
        )
    stretches = shown(driven)
    timed = np.unique(np.concatenate([one.route.line for one in stretches]))
    line = program.original_lines(path.line)
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
        "untimed": {"moves": int(moving.sum()), "lines": np.unique(line[moving])[:LONGEST].tolist()},
        **summary(structure, stretches, timed),
    }
    if options.study_blend:
        report["blend_study"] = [
            blend_row(factor, clock, driven if factor == 1.0 else again(factor, 1.0)) for factor in FACTORS
        ]
    if options.gains:

        def tolerances(lines: Index) -> Array:
            largest = np.zeros(len(lines))
            row = np.flatnonzero(np.isin(line, lines))
            np.maximum.at(largest, np.searchsorted(lines, line[row]), clock.blend_mm[row])
            return largest

        report["gains"] = joint_gains(
            stretches, timed, tolerances, lambda tolerance, feed: shown(again(tolerance, feed))
        )
    report = placed(report, program.origin)
    return JointRetiming(run, options, path, driven, stretches, report)


def _ways(motion: PlannedMotion) -> tuple[Array, Array]:
    """Times in order, and the length of the path up to each."""
    width, share = np.diff(motion.start_s), np.linspace(0.0, 1.0, _STEPS)
    piece = np.arange(len(motion)).repeat(_STEPS)
    after = (width[:, None] * share).ravel()
    step = np.linalg.norm(np.diff(motion.positions(piece, after), axis=0), axis=1)
    return motion.start_s[piece] + after, np.append(0.0, np.cumsum(step))
