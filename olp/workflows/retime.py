"""`retime`: from a program to a trajectory and the report of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from olp.checks.state import travel_findings
from olp.core.errors import CannotCompute, UsageError
from olp.core.machine import Setup
from olp.core.progress import Progress, silent
from olp.files import trajectory as files
from olp.files.sources import Source
from olp.files.write import write_files
from olp.findings.catalogue import Finding
from olp.program.feeds.timing import BLEND_MM
from olp.program.feeds.words import Shared
from olp.program.registry import Options, read
from olp.program.rs274.state import PathMode
from olp.reports.plots.base import Format as Picture
from olp.trajectory.from_program import axis_limits
from olp.trajectory.inertia import Inertial, compliance_of
from olp.trajectory.plan import Trajectory
from olp.trajectory.route import Route
from olp.trajectory.summary import MOST, compare, summary
from olp.trajectory.usage import LineUse, SlowPlaces
from olp.trajectory.variants import Case, Plan, blend_study, planned, with_feeds, within_inertial
from olp.workflows.flatten import unrolled
from olp.workflows.session import PathLike, Session

Format = Literal["csv", "npz", "parquet", "ros", "pvt"]
_SUFFIX: Mapping[str, Format] = {".csv": "csv", ".npz": "npz", ".parquet": "parquet", ".json": "ros"}

PICTURES: Mapping[str, Picture] = {".svg": "svg", ".png": "png"}

#: what a control's servo takes
CYCLE_S = 1e-3
#: of the tolerances that the program uses, those that `blend_study` tries
FACTORS = (0.25, 0.5, 1.0, 2.0, 4.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class RetimeOptions:
    """What `retime` takes beside its programs; see there."""

    blend_mm: float | None = None
    study_blend: bool = False
    max_inertial_um: float | None = None
    contour: bool = False
    block_delete: bool = False
    flatten: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Retiming:
    """A trajectory for each stretch of the program between places that the control alone knows, as `plan`;
    the report ("olp-retime-1"), and the findings: axes commanded beyond their travel."""

    plan: Plan
    report: dict[str, Any]
    findings: tuple[Finding, ...] = ()

    @property
    def trajectories(self) -> tuple[Trajectory, ...]:
        return self.plan.trajectories

    @property
    def routes(self) -> tuple[Route, ...]:
        """What the trajectories drive."""
        return self.plan.case.legs

    @property
    def lines(self) -> LineUse:
        """What each line takes, achieves, and is held back by."""
        return self.plan.lines

    @property
    def slow(self) -> tuple[SlowPlaces, ...]:
        """Of each stretch the places where the speed is below half the feed."""
        return self.plan.slow

    @property
    def duration_s(self) -> float:
        """Without what the control does between stretches."""
        return self.plan.duration_s

    @property
    def trajectory(self) -> Trajectory:
        """The one trajectory of a program that is known all through. Raises CannotCompute where there are
        several."""
        return self._stretch(None)

    def _stretch(self, number: int | None) -> Trajectory:
        count = len(self.trajectories)
        if number is None and count != 1:
            raise CannotCompute(
                f"the program has {count} stretches, between which the control moves by itself (tool "
                "changes, G28 and kin, probing), so there is no one trajectory; take them one by one"
            )
        if number is not None and not 1 <= number <= count:
            raise UsageError(f"there is no stretch {number}; the program has {count}, counted from 1")
        return self.trajectories[(number or 1) - 1]

    def parts(
        self, kind: Format = "csv", cycle_s: float = CYCLE_S, stretch: int | None = None
    ) -> Iterator[bytes]:
        """The samples of every `cycle_s` as a file of a format, part by part; of one stretch, counted from
        1, where there are several.

        Raises CannotCompute as `trajectory` does, UsageError for a stretch or a cycle that cannot be, and
        ConfigError for Parquet without pyarrow.
        """
        trajectory = self._stretch(stretch)
        files.check_cycle(trajectory, cycle_s)
        return _WRITERS[kind](trajectory, cycle_s)

    def files(
        self, path: PathLike, kind: Format | None = None, cycle_s: float = CYCLE_S,
        stretch: int | None = None, progress: Progress | None = None,
    ) -> dict[Path, Iterator[bytes]]:  # fmt: skip
        """What `write` writes, by path: one file, or `name-1.csv`, `name-2.csv` ... of several stretches."""
        target = Path(path)
        chosen = kind or _SUFFIX.get(target.suffix.lower(), "csv")
        if stretch is not None or len(self.trajectories) == 1:
            return {target: self._counted(chosen, cycle_s, stretch, progress)}
        self._any()
        return {
            numbered(target, number): self._counted(chosen, cycle_s, number, progress)
            for number in range(1, len(self.trajectories) + 1)
        }

    def _counted(
        self, kind: Format, cycle_s: float, stretch: int | None, progress: Progress | None
    ) -> Iterator[bytes]:
        parts = self.parts(kind, cycle_s, stretch)
        whole = max(self._stretch(stretch).duration_s / cycle_s / files.ROWS, 1.0)
        for done, part in enumerate(parts):
            yield part
            if progress is not None:
                progress("write", min(done / whole, 1.0))

    def with_feeds(self, shared: Shared = "mean", progress: Progress | None = None) -> bytes:
        """The text of the program with the mean planned feed of each block in its F words, never above the
        programmed one; `report["write_feed"]` tells what changed and what the text takes then.

        An F word that holds for several blocks takes the feed that takes as long in all, or with "least" the
        least planned feed of them. Raises ProgramError for a feed that cannot be written in the style of
        its word.
        """
        data, self.report["write_feed"] = with_feeds(self.plan, shared, progress or silent)
        return data

    def plots(
        self, path: PathLike, stretch: int | None = None, *, from_s: float = 0.0, to_s: float | None = None
    ) -> dict[Path, bytes]:
        """Pictures of speed, velocity, acceleration and jerk over time beside their limits, by path: one
        file (.svg or .png), or one a stretch. Raises UsageError for another suffix, and for a span of time
        with nothing in it."""
        from olp.reports.plots.time import motion_plot

        target = Path(path)
        kind = PICTURES.get(target.suffix.lower())
        if kind is None:
            raise UsageError(f"the plot {str(path)!r} ends in no known format; expected .svg or .png")
        self._any()
        count = len(self.trajectories)
        numbers = [stretch] if stretch is not None else list(range(1, count + 1))
        out = {}
        for number in numbers:
            found = self._stretch(number)
            route = self.routes[number - 1]
            name = f"{self.report['program'] or 'program'} on {self.report['machine']}"
            lines = f"lines {int(route.line.min())} to {int(route.line.max())}"
            where = numbered(target, number) if len(numbers) > 1 else target
            out[where] = motion_plot(found, route, f"{name}, {lines}", kind, from_s=from_s, to_s=to_s)
        return out

    def _any(self) -> None:
        if not self.trajectories:
            raise CannotCompute("the program moves nothing, so there is no trajectory")

    def write(
        self, path: PathLike, kind: Format | None = None, cycle_s: float = CYCLE_S,
        stretch: int | None = None, *, force: bool = False,
    ) -> list[Path]:  # fmt: skip
        """Write the samples; the format is that of the suffix (.csv, .npz, .parquet, .json for ROS) unless
        given. All files or none. Raises as `parts` and `olp.files.write.write_files` do."""
        found = self.files(path, kind, cycle_s, stretch)
        write_files(found, force=force)
        return list(found)


_WRITERS: Mapping[Format, Callable[[Trajectory, float], Iterator[bytes]]] = {
    "csv": files.csv, "npz": files.npz, "parquet": files.parquet, "ros": files.ros, "pvt": files.pvt,
}  # fmt: skip


def numbered(target: Path, number: int) -> Path:
    """The file of a stretch, counted from 1, where there are several."""
    return target.with_name(f"{target.stem}-{number}{target.suffix}")


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
    contour: bool = False,
    block_delete: bool = False,
    flatten: bool = False,
    progress: Progress | None = None,
) -> Retiming:
    """The fastest motion found along a program that keeps every axis inside its limits of velocity,
    acceleration and jerk, the feed, and the path tolerance.

    `nominal` is another program, the one before its correction, to compare times with, line by line.
    `proof` is the report of the program's correction ("olp-report-1"), whose budget then stands beside this
    one. `blend_mm` is the path tolerance where the program names none; it wins over the machine file, and the
    path mode at the start is then to blend. `study_blend` adds times and deviations at a quarter to four
    times the tolerances in use. `max_inertial_um` bounds the deviation that accelerations make on the
    machine's compliance. `block_delete` leaves `/` blocks out, `flatten` unrolls loops, subprograms and
    expressions first: lines then count in the unrolled text. Axes commanded beyond their travel are findings
    (OLP402), and planned all the same. Raises InputError (ProgramError with its line,
    ConfigError), UsageError and CannotCompute.
    """
    session = Session.start(machine, job)
    options = RetimeOptions(
        blend_mm=blend_mm, study_blend=study_blend, max_inertial_um=max_inertial_um, contour=contour,
        block_delete=block_delete, flatten=flatten,
    )  # fmt: skip
    other = None if nominal is None else session.sources.source(nominal)
    source = session.sources.source(program)
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
    setup, most_um = session.setup, options.max_inertial_um
    proved = None if proof is None else _proved(proof, setup)
    tell = progress or silent
    tell("read", 0.0)
    case = _case(session, program, options)
    other = None if nominal is None else _case(session, nominal, options)
    compliance = compliance_of(setup.machine)
    limits = axis_limits(setup.machine)
    if most_um is None:
        found = planned(case, limits, tell)
    else:
        found = within_inertial(case, limits, compliance, most_um * 1e-3, tell)
    report = _report(case, found, compliance, most_um)
    if other is not None:
        report["nominal"] = _against(found, planned(other, found.limits, tell, "nominal"), other)
    if proved is not None:
        moving = sum(report["budget_um"].values())
        report["proof"] = proved | {"at_most_um": proved["path_max_um"] + moving}
    if options.study_blend:
        report["blend_study"] = blend_study(case, found, FACTORS, tell)
    # the motion keeps to the box of its way-points, so commands within travel are motion within travel
    findings = tuple(travel_findings(case.program.toolpath, setup.machine))
    report["findings"] = [f.as_dict() for f in findings]
    return Retiming(found, report, findings)


def _case(session: Session, program: Source, options: RetimeOptions) -> Case:
    """A program as it is to be planned. Raises ProgramError with its file and line; CannotCompute where
    nothing of it can be timed."""
    blend_mm, stated = options.blend_mm, session.setup.machine.blend_mm
    reading = Options(block_delete=options.block_delete, contour=options.contour)
    program.load()
    with program.errors():
        setup, dialect = session.reading(program)
        text = unrolled(session.sources, program, setup, dialect) if options.flatten else program.data
        found = read(text, setup, dialect, reading)
        if setup.machine.path_mode == "exact-stop" and blend_mm is None:
            # a mode of line 0 holds from the start
            found = replace(found, path_modes=(PathMode(0, "G61.1"), *found.path_modes))
        case = Case(
            program.short, setup, found,
            next(v for v in (blend_mm, stated, BLEND_MM) if v is not None),
            "the call" if blend_mm is not None else "the machine file" if stated else "the default",
            options.block_delete, options.contour, (),
        ).driven()  # fmt: skip
    if not case.legs and case.untimed()["moves"]:
        raise CannotCompute(
            "no move of the program begins and ends at known positions of all axes, so nothing can be "
            "timed; give start_mm in the job file, or command X, Y and Z first",
            file=program.name or None,
        )
    return case


def _against(found: Plan, before: Plan, other: Case) -> dict[str, Any]:
    """The times of the nominal program, in all and by line."""
    rows = compare((before.case.legs, before.lines), (found.case.legs, found.lines))
    return {
        "program": other.name,
        "duration_s": before.duration_s,
        "lines_correspond": rows is not None,
        "differences": []
        if rows is None
        else [row for row in rows[:MOST] if row["nominal_s"] != row["corrected_s"]],
    }


def _proved(proof: Mapping[str, Any], setup: Setup) -> dict[str, Any]:
    """What the proof of a correction leaves, in um. Raises UsageError for what is no such report, or is of
    another machine."""
    try:
        if proof["schema"] != "olp-report-1":
            raise KeyError(proof["schema"])
        machine, left = str(proof["machine"]["name"]), float(proof["deviation"]["path_max_um"])
        budget = {str(key): float(value) for key, value in proof["budget_um"].items()}
        program = str(proof["program"]["name"])
        if not all(map(math.isfinite, (left, *budget.values()))):
            raise ValueError(left)
    except (KeyError, TypeError, ValueError, AttributeError):
        raise UsageError(
            'the proof is no report of a correction; expected one of schema "olp-report-1", as olp correct '
            "and olp verify write"
        ) from None
    if machine != setup.machine.name:
        raise UsageError(f"the proof is for machine {machine!r}, and this one is {setup.machine.name!r}")
    return {"program": program, "budget_um": budget, "path_max_um": left}


def _report(case: Case, found: Plan, compliance: Any, max_inertial_um: float | None) -> dict[str, Any]:
    limits = found.limits
    report: dict[str, Any] = {
        "schema": "olp-retime-1",
        "program": case.name,
        "machine": case.setup.machine.name,
        "waypoints": sum(map(len, case.legs)),
        "pieces": sum(len(t.motion) for t in found.trajectories),
        "path": case.tolerances(),
        "budget_um": {"blending": found.blending_mm * 1e3, "chords_of_arcs": case.chords_mm() * 1e3},
        "untimed": case.untimed(),
        "limits": {
            "velocity_mm_s": limits.velocity.tolist(),
            "acceleration_mm_s2": limits.acceleration.tolist(),
            "jerk_mm_s3": limits.jerk.tolist(),
        },
        "stretches": [
            {"first_line": int(leg.line.min()), "last_line": int(leg.line.max()), "duration_s": t.duration_s}
            for leg, t in zip(case.legs, found.trajectories, strict=True)
        ],
    } | summary(found.trajectories, found.lines, found.slow)
    if compliance.any():
        parts = [Inertial.of(t.motion, compliance) for t in found.trajectories]
        most = max(parts, key=lambda p: p.most_mm, default=None)
        whole = max(found.duration_s, 1e-300)
        square = sum(p.rms_mm**2 * t.duration_s for p, t in zip(parts, found.trajectories, strict=True))
        report["budget_um"]["inertial"] = most.most_mm * 1e3 if most else 0.0
        report["inertial"] = {
            "max_um": most.most_mm * 1e3 if most else 0.0,
            "rms_um": (square / whole) ** 0.5 * 1e3,
            "across_path_max_um": max((p.across_mm for p in parts), default=0.0) * 1e3,
            "line": most.line if most else None,
            "allowed_um": max_inertial_um,
        }
    return report
