"""`retime`: from a program to a trajectory and the report of it."""

from __future__ import annotations

import datetime
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from olp.checks.state import travel_findings
from olp.checks.timed import control_findings, time_findings
from olp.core.errors import CannotCompute, UsageError
from olp.core.machine import Setup
from olp.core.progress import Progress, silent
from olp.core.toolpath import BLEND_MM
from olp.core.values import dataclass
from olp.files.point_profile import load_profile
from olp.files.points import Points, read_points
from olp.files.sources import Source
from olp.findings.catalogue import Finding
from olp.program.feeds.words import Shared
from olp.program.origin import Origin
from olp.program.registry import Options
from olp.program.rs274.state import PathMode
from olp.trajectory.controls.base import Control
from olp.trajectory.controls.registry import control_named
from olp.trajectory.from_program import axis_limits
from olp.trajectory.gains import gains
from olp.trajectory.inertia import compliance_of
from olp.trajectory.plan import Trajectory
from olp.trajectory.plan import plan as plan_route
from olp.trajectory.route import Route
from olp.trajectory.usage import LIMITS, LineUse, SlowStretches
from olp.trajectory.variants import Case, Plan, blend_study, planned, with_feeds, within_inertial
from olp.workflows import refusals
from olp.workflows.doubt import accepted_of, doubted_motion
from olp.workflows.flatten import UnrollOptions
from olp.workflows.original import placed, placed_findings
from olp.workflows.retime_control import control_time
from olp.workflows.retime_files import StretchFiles, numbered, picture_of
from olp.workflows.retime_report import Legs, against, proved, report_of
from olp.workflows.session import PathLike, Session

#: Largest override of feeds in percent: that of common switches.
MOST_OVERRIDE = 200.0
#: Multiples of the path tolerances of the program that `blend_study` tries.
FACTORS = (0.25, 0.5, 1.0, 2.0, 4.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class RetimeOptions(UnrollOptions):
    """The options of `retime`."""

    blend_mm: float | None = None
    study_blend: bool = False
    max_inertial_um: float | None = None
    feed_override: float = 100.0
    gains: bool = False
    controller: str | None = None
    settings: Mapping[str, float] | None = None
    log: PathLike | None = None
    log_profile: str | None = None
    block_delete: bool = False
    date: datetime.date | None = None
    accept: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Retiming(StretchFiles):
    """A trajectory for each stretch of the program between moves of the control itself, as `plan`; the report
    ("olp-retime-1"), and the findings: doubts about the inputs, and axes
    commanded beyond their travel. `by_original` is the plan with the lines of the text that the program was
    unrolled from, which count through its files."""

    plan: Plan
    report: dict[str, Any]
    findings: tuple[Finding, ...]
    by_original: Plan

    def to_text(self) -> str:
        """The report as `olp retime` prints it."""
        from olp.reports.retime import to_text

        return to_text(self.report)

    @property
    def trajectories(self) -> tuple[Trajectory, ...]:
        return self.by_original.trajectories

    @property
    def origin(self) -> Origin | None:
        """Where the lines come from; None where the program was not unrolled."""
        return self.plan.case.program.origin

    @property
    def routes(self) -> tuple[Route, ...]:
        """The paths of the trajectories."""
        return self.by_original.case.legs

    @property
    def lines(self) -> LineUse:
        """Time, speed and limit of each line."""
        return self.by_original.lines

    @property
    def limits(self) -> tuple[str, ...]:
        """The limits of the motion, in the order of the columns of `lines`."""
        return LIMITS

    @property
    def slow(self) -> tuple[SlowStretches, ...]:
        """Of each stretch, where the speed is below half the feed."""
        return self.by_original.slow

    @property
    def duration_s(self) -> float:
        """The time of all stretches, without the control's own moves between them."""
        return self.plan.duration_s

    @property
    def trajectory(self) -> Trajectory:
        """The one trajectory of a program without moves of the control itself. Raises CannotCompute where
        there are several."""
        return self.stretch(None)

    def with_feeds(self, shared: Shared = "mean", progress: Progress | None = None) -> bytes:
        """The text of the program with the mean planned feed of each block in its F words, never above the
        programmed one; `report["write_feed"]` states the changes and the time of the new text.

        An F word for several blocks gets the feed with the same total time, or with "least" the least planned
        feed of them. Raises ProgramError for a feed that cannot be written in the style of its word.
        """
        if self.plan.case.override != 1.0:
            raise UsageError("planned feeds count at an override of 100 %; leave the feed override out")
        data, report = with_feeds(self.plan, shared, progress or silent)
        self.report["write_feed"] = placed(report, self.origin)
        return data

    def plots(
        self, path: PathLike, stretch: int | None = None, *, from_s: float = 0.0, to_s: float | None = None
    ) -> dict[Path, bytes]:
        """Pictures of speed, velocity, acceleration and jerk over time beside their limits, by path: one
        file (.svg or .png), or one per stretch. Raises UsageError for another suffix, and for an empty span
        of time."""
        from olp.reports.plots.time import motion_plot

        target = Path(path)
        kind = picture_of(target)
        self.any_stretch()
        count = len(self.trajectories)
        numbers = [stretch] if stretch is not None else list(range(1, count + 1))
        pictures = {}
        for number in numbers:
            trajectory = self.stretch(number)
            route = self.routes[number - 1]
            name = f"{self.report['program'] or 'program'} on {self.report['machine']}"
            place = str if self.origin is None else self.origin.place
            lines = f"lines {place(int(route.line.min()))} to {place(int(route.line.max()))}"
            where = numbered(target, number) if len(numbers) > 1 else target
            title = f"{name}, {lines}"
            pictures[where] = motion_plot(trajectory, route, title, kind, from_s=from_s, to_s=to_s)
        return pictures


def check_override(percent: float) -> None:
    """Raises UsageError for an override of feeds that no control has."""
    if not 0.0 < percent <= MOST_OVERRIDE:
        raise UsageError(
            f"the feed override is {percent:g} %; expected more than 0, and at most {MOST_OVERRIDE:g}"
        )


def retime(
    program: PathLike | bytes,
    machine: PathLike | Setup,
    job: PathLike | None = None,
    *,
    nominal: PathLike | bytes | None = None,
    proof: Mapping[str, Any] | None = None,
    blend_mm: float | None = None,
    study_blend: bool = False,
    max_inertial_um: float | None = None,
    feed_override: float = 100.0,
    gains: bool = False,
    controller: str | None = None,
    settings: Mapping[str, float] | None = None,
    log: PathLike | None = None,
    log_profile: str | None = None,
    block_delete: bool = False,
    flatten: bool = False,
    expand_cycles: bool = False,
    peck_clearance_mm: float | None = None,
    date: datetime.date | None = None,
    accept: Sequence[str] = (),
    progress: Progress | None = None,
) -> Retiming:
    """The fastest motion found along a program that keeps every axis inside its limits of velocity,
    acceleration and jerk, the feed, and the path tolerance.

    `nominal` is another program, such as the uncorrected one, to compare times with, line by line. `proof`
    is the report of the program's correction ("olp-report-1"), whose budget is then shown beside this one.
    `blend_mm` is the path tolerance where the program names none; it has priority over the machine file, and
    the path mode at the start is then to blend. `study_blend` adds times and deviations at a quarter to four
    times the path tolerances in use. `max_inertial_um` limits the deviation by accelerations and the
    machine's compliance. `feed_override` is the override of feeds in percent; rapids keep their speed.
    `gains` adds the lines on which more path tolerance or more feed would save most.
    `controller` adds the time that a control of that kind takes, by what is published of its planner, with
    `settings` of it by name. `log` is the log of a run of this program on it, from which limits and corners
    are learned; `log_profile` is its layout, as in `compare`.
    `block_delete` leaves `/` blocks out. `flatten`, `expand_cycles` and
    `peck_clearance_mm` are those of `correct`. Axes commanded beyond their travel are findings (OLP402), and
    planned all the same. `date` and `accept` are those of `correct`, for doubts about
    the inputs. Raises InputError (ProgramError with its line, ConfigError, Doubtful), UsageError and
    CannotCompute.
    """
    session = Session.start(machine, job)
    options = RetimeOptions(
        blend_mm=blend_mm, study_blend=study_blend, max_inertial_um=max_inertial_um,
        feed_override=feed_override, gains=gains, controller=controller, settings=settings, log=log,
        log_profile=log_profile, block_delete=block_delete, flatten=flatten,
        expand_cycles=expand_cycles, peck_clearance_mm=peck_clearance_mm, date=date, accept=tuple(accept),
    )  # fmt: skip
    other = None if nominal is None else session.sources.source(nominal)
    source = session.sources.source(program, nominal)
    return run(session, source, options, nominal=other, proof=proof, progress=progress)


def run(
    session: Session,
    program: Source,
    options: RetimeOptions,
    *,
    nominal: Source | None = None,
    proof: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
) -> Retiming:
    """As `retime`, in a session."""
    check_override(options.feed_override)
    setup, most_um = session.setup, options.max_inertial_um
    control, log = _control(session, options)
    stated = None if proof is None else proved(proof, setup)
    tell = progress or silent
    tell("read", 0.0)
    case = case_of(session, program, options)
    doubts = doubted_motion(case.program, session.of(case.setup), options.accept, options.date, program.name)
    other = None if nominal is None else case_of(session, nominal, options)
    compliance = compliance_of(setup.machine)
    limits = axis_limits(setup.machine)
    with program.errors():
        if most_um is None:
            plan = planned(case, limits, tell)
        else:
            plan = within_inertial(case, limits, compliance, most_um * 1e-3, tell)
    shown, origin = plan.in_original(), case.program.origin
    report = placed(report_of(shown.case, shown, compliance, most_um), origin)
    if origin is not None and origin.files:
        report["files"] = list(origin.counted())
    if other is not None:
        there = planned(other, plan.limits, tell, "nominal")
        versus = against(other.name, *(_compared(one) for one in (there, plan)))
        report["nominal"] = placed(versus, other.program.origin)
    if stated is not None:
        moving = sum(report["budget_um"].values())
        report["proof"] = stated | {"at_most_um": stated["path_max_um"] + moving}
    if options.study_blend:
        report["blend_study"] = blend_study(case, plan, FACTORS, tell)
    left_out: list[Finding] = []
    if control is not None:
        bare = options.blend_mm is None and setup.machine.blend_mm is None
        own = control_time(control, case, limits, options.settings or {}, log, bare=bare)
        left_out = control_findings(control.title, own["beside"])
        report["controller"] = placed(own, origin)
    if options.gains:
        report |= placed({"gains": gains(case, plan, tell)}, origin)
    # the motion is inside the box of its waypoints, so commands within travel are motion within travel
    path = case.program.in_original().toolpath
    untimed = time_findings(path, case.control())
    findings = placed_findings((*doubts, *travel_findings(path, setup.machine), *untimed, *left_out), origin)
    report["accepted"] = accepted_of(findings)
    report["findings"] = [f.as_dict() for f in findings]
    return Retiming(plan, report, findings, shown)


def _compared(plan: Plan) -> Legs:
    return Legs(plan.case.legs, plan.lines, plan.duration_s, plan.case.program)


def durations(
    session: Session, programs: Sequence[Source], options: RetimeOptions, most: int, tell: Progress
) -> tuple[list[float], bool]:
    """Seconds of programs, and whether speeds along dense curves were optimised: they are not where one of
    them has more than `most` waypoints, so that all are planned alike. Raises as `retime`, but for doubts."""
    limits = axis_limits(session.setup.machine)
    cases = [case_of(session, program, options) for program in programs]
    short = max(sum(map(len, case.legs)) for case in cases) <= most
    if short:
        return [planned(case, limits, tell).duration_s for case in cases], True
    seconds = []
    while cases:
        # the plan of a long program is large: no two are in memory at once
        legs = cases.pop(0).legs
        seconds.append(sum(plan_route(leg, limits, tell, optimise=False).duration_s for leg in legs))
    return seconds, False


def _control(session: Session, options: RetimeOptions) -> tuple[Control | None, Points | None]:
    """The profile of the control and the log of a run. Raises UsageError for what needs a control without
    one, and InputError for a log that cannot be read."""
    if options.controller is None:
        if options.log is not None or options.settings:
            raise UsageError("a log and settings are those of a control; name it with --controller")
        return None, None
    control = control_named(options.controller)
    control.values(options.settings or {})
    if options.log is None:
        return control, None
    layout = None if options.log_profile is None else load_profile(options.log_profile, session.sources.read)
    return control, read_points(options.log, layout, session.sources.read)


def case_of(session: Session, program: Source, options: RetimeOptions) -> Case:
    """A program ready for planning. Raises ProgramError with its file and line; CannotCompute where no move
    can be timed."""
    blend_mm, stated = options.blend_mm, session.setup.machine.blend_mm
    reading = Options(block_delete=options.block_delete)
    program.load()
    with program.errors():
        setup, dialect = session.reading(program)
        program, parsed = refusals.read(
            session.sources, program, setup, dialect, reading, options, block_delete=options.block_delete
        )
        if setup.machine.path_mode == "exact-stop" and blend_mm is None:
            # a mode of line 0 holds from the start
            parsed = replace(parsed, path_modes=(PathMode(0, "G61.1"), *parsed.path_modes))
        with parsed.errors():
            case = Case(
                program.short, setup, parsed,
                next(v for v in (blend_mm, stated, BLEND_MM) if v is not None),
                "the call" if blend_mm is not None else "the machine file" if stated else "the default",
                options.block_delete, (), options.feed_override / 100.0,
            ).driven()  # fmt: skip
    if not case.legs and case.untimed()["moves"]:
        raise CannotCompute(
            "no move of the program begins and ends at known positions of all axes, so nothing can be timed; "
            "give start_mm in the job file, or command X, Y and Z first",
            file=program.name or None,
        )
    return case
