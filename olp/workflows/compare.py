"""`compare`: measured paths and poses against nominal ones, from files to figures and findings."""

from __future__ import annotations

import datetime
import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any, Literal, TypeVar

import numpy as np
import numpy.typing as npt

from olp.checks.state import calibration_findings
from olp.comparison import figures, runs
from olp.comparison.pairing import Order
from olp.comparison.path import Path
from olp.core.arrays import Array, Index, Mask, read_only
from olp.core.errors import InputError, UsageError
from olp.core.machine import Setup
from olp.core.progress import Progress, silent
from olp.core.spool import whole
from olp.core.units import UM_PER_MM
from olp.core.values import dataclass
from olp.files.point_profile import PointProfile
from olp.files.points import Points, layout_of, parse_points, read_points
from olp.files.sources import Source, Sources
from olp.files.write import write_bytes
from olp.findings.catalogue import Finding
from olp.program.origin import Files, Origin, original_of, quoted
from olp.program.program import Program
from olp.program.registry import Options
from olp.reports.report import cell
from olp.workflows import compare_report as parts
from olp.workflows import refusals
from olp.workflows.compare_poses import part_frame as poses_frame
from olp.workflows.compare_poses import poses_report
from olp.workflows.compare_runs import Ground, How, Judged, judged
from olp.workflows.doubt import acceptable, with_accepted
from olp.workflows.flatten import UnrollOptions
from olp.workflows.original import placed, placed_findings
from olp.workflows.session import Loaded, PathLike, Session
from olp.workflows.shown import Shown

S = TypeVar("S", bound=np.generic)


@dataclass(frozen=True, slots=True, kw_only=True)
class CompareOptions(UnrollOptions):
    """The options of `compare`."""

    before: tuple[PathLike, ...] = ()
    poses: bool = False
    profile: PointProfile | None = None
    align: runs.Align = "auto"
    order: Order | None = None
    reach_mm: float = 1.0
    part_tolerance_um: float | None = None
    add_errors: bool = False
    part_frame: str | None = None
    date: datetime.date | None = None
    accept: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Comparison(Shown):
    """The result of a comparison: the report ("olp-comparison-1") as a mapping and the findings.

    `path` is the nominal path, `runs` and `before` are the measured runs on it, in the nominal frame; all of
    them are None and empty for poses. `part_frame` is a table for the job file, of poses, where asked for.
    `inputs` are the files that were read, which `write` never overwrites.

    Arrays hold one row per measured point of `runs`, one run after the other; `run` (n,) says which.
    """

    report: dict[str, Any]
    findings: tuple[Finding, ...]
    profile: PointProfile
    path: Path | None = None
    runs: tuple[figures.Run, ...] = ()
    before: tuple[figures.Run, ...] = ()
    part_frame: str | None = None
    origin: Origin | None = None
    inputs: tuple[str, ...] = ()

    @property
    def run(self) -> Index:
        """(n,) the index in `runs` of the run of each point."""
        return read_only(np.repeat(np.arange(len(self.runs)), [len(r.points_mm) for r in self.runs]))

    @property
    def line(self) -> Index:
        """(n,) the line of the nominal program or file that each point belongs to."""
        path = self.path
        return _joined([] if path is None else [r.line(path) for r in self.runs], np.zeros(0, np.int64))

    @property
    def counted(self) -> Mask:
        """(n,) whether the point counts in the figures."""
        return _joined([r.counted for r in self.runs], np.zeros(0, bool))

    @property
    def measured_mm(self) -> Array:
        """(n, 3) the measured points, in the nominal frame."""
        return _joined([r.points_mm for r in self.runs], np.zeros((0, 3)))

    @property
    def nominal_mm(self) -> Array:
        """(n, 3) the points of the nominal path that belong to them."""
        return _joined([r.nominal_mm for r in self.runs], np.zeros((0, 3)))

    @property
    def deviation_um(self) -> Array:
        """(n,) the distance from the nominal path that is judged, in um."""
        return _joined([r.size_mm * UM_PER_MM for r in self.runs], np.zeros(0))

    @property
    def along_um(self) -> Array:
        """(n,) the deviation along the path, in um."""
        return _joined([r.deviation.along * UM_PER_MM for r in self.runs], np.zeros(0))

    @property
    def normal_um(self) -> Array:
        """(n,) the deviation that is level and to the left of travel, in um."""
        return _joined([r.deviation.normal * UM_PER_MM for r in self.runs], np.zeros(0))

    @property
    def binormal_um(self) -> Array:
        """(n,) the deviation upward from the path, in um."""
        return _joined([r.deviation.binormal * UM_PER_MM for r in self.runs], np.zeros(0))

    def to_text(self) -> str:
        """The report as `olp compare` prints it."""
        from olp.reports.compare import to_text

        return to_text(self.report)

    def write(self, path: PathLike, *, force: bool = False) -> FilePath:
        """Write `to_csv` as `Correction.write` does. Raises UsageError for poses, which have none."""
        if self.path is None:
            raise UsageError("poses have no deviations along a path; write the report (to_text, report)")
        write_bytes(path, self.to_csv(), force=force, inputs=self.inputs)
        return FilePath(path)

    def to_csv(self) -> Iterator[bytes]:
        """One row per measured point: run, arc length, line, nominal point, deviations from there, whether it
        counts, and the distance from there, which is what counts; `file` after the line where there are
        several."""
        files = Files(self.origin)
        head = f"run,s_mm,line{files.head},X_mm,Y_mm,Z_mm,along_um,normal_um,binormal_um,counted,size_um\n"
        yield head.encode()
        for run in (*self.before, *self.runs):
            assert self.path is not None
            name = quoted(cell(run.name))
            d, foot = run.deviation, run.nominal_mm
            columns = (
                run.pairing.s_mm, run.line(self.path), *foot.T,
                *(v * UM_PER_MM for v in (d.along, d.normal, d.binormal)), run.counted.astype(int),
                run.size_mm * UM_PER_MM,
            )  # fmt: skip
            for a in range(0, len(foot), 1 << 14):
                rows = zip(*(c[a : a + (1 << 14)].tolist() for c in columns), strict=True)
                yield "".join(
                    f"{name},{s:.6f},{files.cells(line)},{x:.6f},{y:.6f},{z:.6f},{t:.4f},{n:.4f},{b:.4f},{good},{size:.4f}\n"
                    for s, line, x, y, z, t, n, b, good, size in rows
                ).encode()


def _joined(parts: Iterable[npt.NDArray[S]], none: npt.NDArray[S]) -> npt.NDArray[S]:
    """The rows of all parts; `none` where there are no parts."""
    return read_only(np.concatenate([none, *parts]))


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """The nominal side: points, or a program with its machine. On a machine with rotary joints `ground` is
    the path, `joints` are the parts of the report on the machine, and the tool may be `symmetric`."""

    source: Source
    points: Points | None
    program: Program | None
    loaded: Loaded | None
    ground: Ground | None = None
    joints: Mapping[str, Any] | None = None
    symmetric: bool = False


def compare(
    nominal: PathLike | bytes,
    measured: Sequence[PathLike],
    machine: PathLike | Setup | None = None,
    job: PathLike | None = None,
    *,
    before: Sequence[PathLike] = (),
    poses: bool = False,
    profile: PointProfile | None = None,
    align: runs.Align = "auto",
    order: Order | None = None,
    reach_mm: float = 1.0,
    part_tolerance_um: float | None = None,
    add_errors: bool = False,
    part_frame: str | None = None,
    flatten: bool = False,
    expand_cycles: bool = False,
    peck_clearance_mm: float | None = None,
    date: datetime.date | None = None,
    accept: Sequence[str] = (),
    progress: Progress | None = None,
) -> Comparison:
    """Compare measured runs with a nominal path, or measured points with nominal poses.

    `nominal` is a program, which needs `machine`, or a file of points. Each file of `measured` and of
    `before` is one run (cycle); with `poses` each row is a pose, paired by name or by row. `align` and
    `order` are as in `olp.comparison.runs.place`; points farther than `reach_mm` from the path are in no
    figure. With `add_errors` the errors of the calibrated machine are added to measured axis positions (a
    control's log), which gives tip positions. `part_frame` names the work offset to compute from poses
    measured in axis positions. `flatten` and the options after it are those of `correct`. Raises
    InputError, UsageError and CannotCompute.
    """
    sources = Sources()
    session = None if machine is None and job is None else Session.start(machine, job, sources=sources)
    options = CompareOptions(
        before=tuple(before), poses=poses, profile=profile, align=align, order=order, reach_mm=reach_mm,
        part_tolerance_um=part_tolerance_um, add_errors=add_errors, part_frame=part_frame,
        flatten=flatten, expand_cycles=expand_cycles, peck_clearance_mm=peck_clearance_mm,
        date=date, accept=tuple(accept),
    )  # fmt: skip
    return run(sources, session, sources.source(nominal), measured, options, progress)


def run(
    sources: Sources,
    session: Session | None,
    nominal: Source,
    measured: Sequence[PathLike],
    options: CompareOptions,
    progress: Progress | None = None,
) -> Comparison:
    """As `compare`, in a session, or without one where the nominal path is a file of points."""
    tell = progress or silent
    tell("read", 0.0)
    if not measured:
        raise UsageError("no measured file is given; name at least one")
    sets = [
        [read_points(name, options.profile, sources.read_last, oriented=options.poses) for name in names]
        for names in (measured, options.before)
    ]
    side = _nominal_side(nominal, session, options)
    if side.loaded is not None:
        part_um = side.loaded.part_tolerance_um(options.part_tolerance_um)
        options = replace(options, part_tolerance_um=part_um)
    return replace(
        compared(side, sets, options, tell), inputs=sources.files if session is None else session.inputs()
    )


def compared(
    side: Side, sets: Sequence[Sequence[Points]], options: CompareOptions, tell: Progress = silent
) -> Comparison:
    """As `compare`, of what was read: runs, and runs without correction."""
    return _poses(side, sets, options) if options.poses else _paths(side, sets, options, tell)


def _poses(side: Side, sets: Sequence[Sequence[Points]], options: CompareOptions) -> Comparison:
    if side.points is None:
        raise UsageError("poses need a file of points as NOMINAL, and it is a program")
    report, findings = poses_report(
        side.points, *sets, align=options.align, reach_mm=options.reach_mm, symmetric=side.symmetric
    )
    report = _head(side, sets, options) | report
    name = options.part_frame
    table = None if name is None else poses_frame(side.points, sets[0], name)
    return Comparison(_with(report, findings), tuple(findings), sets[0][0].profile, part_frame=table)


def _paths(
    side: Side, sets: Sequence[Sequence[Points]], options: CompareOptions, tell: Progress
) -> Comparison:
    axes = _positions(sets) == "axes"
    if options.add_errors and not (axes and side.program):
        raise UsageError(
            "--add-errors is for axis positions of a control's log; give a program as NOMINAL, -m, and a "
            'profile with positions = "axes"'
        )
    _same_frame(side, sets)
    ground = side.ground or _ground(side, axes)
    how = How(
        align=options.align, order=options.order, reach_mm=options.reach_mm, axes=axes,
        part_tolerance_um=options.part_tolerance_um, add_errors=options.add_errors,
    )  # fmt: skip
    tell("pair", 0.2)
    done = judged(ground, sets[0], how, sets[1])
    findings = [*done.findings]
    if side.loaded is not None:
        days = side.loaded.setup.machine.sanity.calibration_days
        doubts = calibration_findings(side.loaded.calibration, options.date, days)
        findings += with_accepted(doubts, acceptable(options.accept), refuse=False)
    report = _head(side, sets, options) | _judged_report(side, ground, done, axes, options)
    after, before = done.groups["after"], done.groups.get("before", ())
    origin = None if side.program is None else side.program.origin
    findings = list(placed_findings(findings, origin))
    return Comparison(
        _with(placed(report, origin), findings), tuple(findings), sets[0][0].profile, ground.path, after,
        before, origin=origin,
    )  # fmt: skip


def _judged_report(
    side: Side, ground: Ground, done: Judged, axes: bool, options: CompareOptions
) -> dict[str, Any]:
    path, frame = ground.path, parts.frame(done.placed)
    if done.absorbed is not None:
        error, rest, whose = done.absorbed
        frame |= {"error_rms_um": error, "left_by_fit_rms_um": rest, "error_is": whose}
    report: dict[str, Any] = {
        "frame": frame,
        "path": {
            "length_mm": path.length_mm,
            "segments": len(path),
            "cutting_mm": float(np.diff(path.s_mm)[path.cutting].sum()),
            "points": len(path.stops),
            "compared_in": _compared_in(side, axes),
            "machine_errors_added": options.add_errors,
        },
        **done.figures,
        "judgement": done.layers["after"].report(),
        "verdict": done.verdict,
    }
    if options.part_tolerance_um is not None:
        report["holds"] = done.verdict["ok"]
    worst = done.figures["after"].get("worst")
    if side.program is not None and worst is not None:
        report["worst"] = [row | {"text": side.program.text(row["line"])} for row in worst]
    return report


def _compared_in(side: Side, axes: bool) -> str:
    if side.joints is not None:
        return "workpiece coordinates"
    return "axis positions" if axes else "the program's frame"


def _with(report: dict[str, Any], findings: Sequence[Finding]) -> dict[str, Any]:
    return report | {"findings": [f.as_dict() for f in findings]}


def _nominal_side(nominal: Source, session: Session | None, options: CompareOptions) -> Side:
    """A table of points is a path, or poses; with a machine whose dialect has points, it is a program."""
    nominal.load()
    name, data = nominal.name, whole(nominal.data)
    points = layout_of(data) is not None
    if session is None and not points:
        raise UsageError(
            f"{name or 'the nominal path'} is not a table of points, and a program needs its machine; "
            "name the machine file with -m, or a job with -j"
        )
    with nominal.errors("<stdin>"):
        loaded = None if session is None else session.loaded("hold").reading(nominal)
    if loaded is None or (points and (options.poses or not loaded.dialect.points)):
        if options.asked:
            raise UsageError(
                "--flatten and --expand-cycles are for a program, and NOMINAL is a table of points"
            )
        points_of = parse_points(data, name or "<stdin>", oriented=options.poses)
        return Side(nominal, points_of, None, loaded)
    with nominal.errors("<stdin>"):
        sources = session.sources if session is not None else Sources()
        reading = Options()
        nominal, program = refusals.read(sources, nominal, loaded.setup, loaded.dialect, reading, options)
    return Side(nominal, None, program.in_original(), loaded)


def _positions(sets: Sequence[Sequence[Points]]) -> Literal["tip", "axes"]:
    kinds = {p.profile.positions for files in sets for p in files}
    if len(kinds) > 1:
        raise UsageError(
            "some measured files hold axis positions, others tip positions; compare them separately"
        )
    return kinds.pop()


def _ground(side: Side, axes: bool) -> Ground:
    if side.points is not None:
        return Ground.of_points(side.points)
    assert side.program is not None and side.loaded is not None
    return Ground.of_program(side.program, side.loaded, axes=axes)


def _same_frame(side: Side, sets: Sequence[Sequence[Points]]) -> None:
    """Raise InputError where files state different frames, and no machine says how they lie."""
    if side.points is None:
        return
    stated = {p.frame: p.file for files in sets for p in files if p.frame}
    if side.points.frame:
        stated.setdefault(side.points.frame, side.points.file)
    if len(stated) > 1:
        (a, file_a), (b, file_b) = list(stated.items())[:2]
        raise InputError(
            f"states frame {a}, and {file_b} is in {b}; expected the same frame; convert the points, or "
            "remove the statement and fit them with --align fit",
            file=file_a,
        )


def _head(side: Side, sets: Sequence[Sequence[Points]], options: CompareOptions) -> dict[str, Any]:
    nominal = {
        "name": side.source.short,
        "sha256": hashlib.sha256(original_of(side.source.data)).hexdigest(),
        "kind": "program" if side.program else "points",
    }
    stated = {"align": options.align, "reach_mm": options.reach_mm, "tolerance_um": options.part_tolerance_um}
    heads = side.joints if side.loaded is None else side.loaded.heads()
    return parts.head(nominal, heads or {}, *sets) | stated
