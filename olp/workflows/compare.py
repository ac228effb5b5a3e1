"""`compare`: measured paths and poses against nominal ones, from files to figures and findings."""

from __future__ import annotations

import datetime
import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path as FilePath
from typing import Any, Literal

import numpy as np

from olp.checks.state import calibration_findings
from olp.comparison import figures, runs
from olp.comparison.nominal import Nominal, nominal_of
from olp.comparison.pairing import Order
from olp.comparison.path import Path
from olp.core.arrays import Array, Index
from olp.core.errors import InputError, UsageError
from olp.core.machine import Setup
from olp.core.progress import Progress, silent
from olp.core.units import UM_PER_MM
from olp.files.point_profile import PointProfile
from olp.files.points import Points, layout_of, parse_points, read_points
from olp.files.sources import Source, Sources
from olp.findings.catalogue import Finding
from olp.program.program import Program
from olp.program.registry import Options, read
from olp.workflows import compare_report as parts
from olp.workflows.compare_poses import part_frame as poses_frame
from olp.workflows.compare_poses import poses_report
from olp.workflows.doubt import acceptable, with_accepted
from olp.workflows.session import Loaded, PathLike, Session


@dataclass(frozen=True, slots=True, kw_only=True)
class CompareOptions:
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
    contour: bool = False
    date: datetime.date | None = None
    accept: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """The result of a comparison: the report ("olp-comparison-1") as a mapping and the findings.

    `path` is the nominal path, `runs` and `before` are the measured runs on it, in the nominal frame; all of
    them are None and empty for poses. `part_frame` is a table for the job file, of poses, where asked for.
    """

    report: dict[str, Any]
    findings: tuple[Finding, ...]
    profile: PointProfile
    path: Path | None = None
    runs: tuple[figures.Run, ...] = ()
    before: tuple[figures.Run, ...] = ()
    part_frame: str | None = None

    def to_csv(self) -> Iterator[bytes]:
        """One row per measured point: run, arc length, line, nominal point, deviations, whether it counts."""
        yield b"run,s_mm,line,X_mm,Y_mm,Z_mm,along_um,normal_um,binormal_um,counted\n"
        for run in (*self.before, *self.runs):
            assert self.path is not None
            name = _quoted(run.name)
            d, foot = run.deviation, run.pairing.foot_mm
            columns = (
                run.pairing.s_mm, self.path.line[run.pairing.segment], *foot.T,
                *(v * UM_PER_MM for v in (d.along, d.normal, d.binormal)), run.counted.astype(int),
            )  # fmt: skip
            for a in range(0, len(foot), 1 << 14):
                rows = zip(*(c[a : a + (1 << 14)].tolist() for c in columns), strict=True)
                yield "".join(
                    f"{name},{s:.6f},{line},{x:.6f},{y:.6f},{z:.6f},{t:.4f},{n:.4f},{b:.4f},{good}\n"
                    for s, line, x, y, z, t, n, b, good in rows
                ).encode()


def _quoted(cell: str) -> str:
    """A cell of a CSV file (RFC 4180)."""
    return '"' + cell.replace('"', '""') + '"' if any(c in cell for c in ',"\r\n') else cell


@dataclass(frozen=True, slots=True, eq=False)
class _Side:
    """The nominal side: points, or a program with its machine."""

    source: Source
    points: Points | None
    program: Program | None
    loaded: Loaded | None


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
    contour: bool = False,
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
    measured in axis positions. Raises InputError, UsageError and CannotCompute.
    """
    sources = Sources()
    session = None if machine is None and job is None else Session.start(machine, job, sources=sources)
    options = CompareOptions(
        before=tuple(before), poses=poses, profile=profile, align=align, order=order, reach_mm=reach_mm,
        part_tolerance_um=part_tolerance_um, add_errors=add_errors, part_frame=part_frame,
        contour=contour, date=date, accept=tuple(accept),
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
        [read_points(name, options.profile, sources.read_last) for name in names]
        for names in (measured, options.before)
    ]
    side = _nominal_side(nominal, session, options.contour)
    if side.loaded is not None:
        part_um = side.loaded.part_tolerance_um(options.part_tolerance_um)
        options = replace(options, part_tolerance_um=part_um)
    return _poses(side, sets, options) if options.poses else _paths(side, sets, options, tell)


def _poses(side: _Side, sets: Sequence[Sequence[Points]], options: CompareOptions) -> Comparison:
    if side.points is None:
        raise UsageError("poses need a file of points as NOMINAL, and it is a program")
    report, findings = poses_report(side.points, *sets, align=options.align, reach_mm=options.reach_mm)
    report = _head(side, sets, options) | report
    name = options.part_frame
    table = None if name is None else poses_frame(side.points, sets[0], name)
    return Comparison(_with(report, findings), tuple(findings), sets[0][0].profile, part_frame=table)


def _paths(
    side: _Side, sets: Sequence[Sequence[Points]], options: CompareOptions, tell: Progress
) -> Comparison:
    axes = _positions(sets) == "axes"
    if options.add_errors and not (axes and side.program):
        raise UsageError(
            "--add-errors is for axis positions of a control's log; give a program as NOMINAL, -m, and a "
            'profile with positions = "axes"'
        )
    path, move = _nominal(side, axes)
    _same_frame(side, sets, axes)
    names = _names([p.file for files in sets for p in files])
    tell("pair", 0.2)
    points = [p.points_mm for files in sets for p in files]
    if options.add_errors:
        points = [_with_errors(side, path, move, p, options.order, options.reach_mm) for p in points]
    placed = runs.place(path, names, points, options.align, options.order, options.reach_mm)
    tell("figures", 0.8)
    findings = runs.findings(path, placed)
    judged = placed.fitted and all(placed.right) and bool(placed.runs[0].counted.any())
    absorbed = _absorbed(side, path, move, placed, axes) if judged else None
    if absorbed is not None:
        findings += runs.absorbed_finding(*absorbed)
    report = _head(side, sets, options) | _placed_report(path, placed, absorbed, axes, options)
    count = len(sets[0])
    groups = {"after": placed.runs[:count], "before": placed.runs[count:]}
    right = {"after": placed.right[:count], "before": placed.right[count:]}
    for name, members in groups.items():
        if members:
            report[name] = parts.group(path, members, right[name])
    if side.program is not None and all(right["after"]):
        worst = report["after"].get("worst") or []
        report["worst"] = [row | {"text": side.program.text(row["line"])} for row in worst]
    findings += parts.verdict(report, options.part_tolerance_um)
    findings += parts.cycles(groups)
    if side.loaded is not None:
        days = side.loaded.setup.machine.sanity.calibration_days
        doubts = calibration_findings(side.loaded.calibration, options.date, days)
        findings += with_accepted(doubts, acceptable(options.accept), refuse=False)
    after, before = groups["after"], groups["before"]
    return Comparison(_with(report, findings), tuple(findings), sets[0][0].profile, path, after, before)


def _placed_report(
    path: Path, placed: runs.Placed, absorbed: tuple[float, float, str] | None, axes: bool,
    options: CompareOptions,
) -> dict[str, Any]:  # fmt: skip
    frame = parts.frame(placed)
    if absorbed is not None:
        frame |= {"error_rms_um": absorbed[0], "left_by_fit_rms_um": absorbed[1], "error_is": absorbed[2]}
    return {
        "frame": frame,
        "path": {
            "length_mm": path.length_mm,
            "segments": len(path),
            "cutting_mm": float(np.diff(path.s_mm)[path.cutting].sum()),
            "compared_in": "axis positions" if axes else "the program's frame",
            "machine_errors_added": options.add_errors,
        },
    }


def _with(report: dict[str, Any], findings: Sequence[Finding]) -> dict[str, Any]:
    return report | {"findings": [f.as_dict() for f in findings]}


def _nominal_side(nominal: Source, session: Session | None, contour: bool) -> _Side:
    nominal.load()
    name, data = nominal.name, nominal.data
    if layout_of(data) is not None:
        loaded = None if session is None else session.loaded("hold")
        return _Side(nominal, parse_points(data, name or "<stdin>"), None, loaded)
    if session is None:
        raise UsageError(
            f"{name or 'the nominal path'} is not a table of points, and a program needs its machine; "
            "name the machine file with -m, or a job with -j"
        )
    with nominal.errors("<stdin>"):
        loaded = session.loaded("hold").reading(nominal)
        program = read(data, loaded.setup, loaded.dialect, Options(contour=contour))
    return _Side(nominal, None, program, loaded)


def _positions(sets: Sequence[Sequence[Points]]) -> Literal["tip", "axes"]:
    kinds = {p.profile.positions for files in sets for p in files}
    if len(kinds) > 1:
        raise UsageError(
            "some measured files hold axis positions, others tip positions; compare them separately"
        )
    return kinds.pop()


def _nominal(side: _Side, axes: bool) -> tuple[Path, Index | None]:
    if side.points is not None:
        return Path.through(side.points.points_mm, side.points.line), None
    assert side.program is not None and side.loaded is not None
    nominal: Nominal = nominal_of(side.program.toolpath, side.loaded.model, "axes" if axes else "tip")
    return nominal.path, nominal.move


def _same_frame(side: _Side, sets: Sequence[Sequence[Points]], axes: bool) -> None:
    """Raise InputError where files state different frames."""
    stated = {p.frame: p.file for files in sets for p in files if p.frame}
    if side.points is not None and side.points.frame:
        stated.setdefault(side.points.frame, side.points.file)
    if side.program is not None and len(side.program.toolpath) and not axes:
        path = side.program.toolpath
        stated.setdefault(path.frames[int(path.frame[0])].work_offset, side.source.name)
    if len(stated) > 1:
        (a, file_a), (b, file_b) = list(stated.items())[:2]
        raise InputError(
            f"states frame {a}, and {file_b} is in {b}; expected the same frame; convert the points, or "
            "remove the statement and fit them with --align fit",
            file=file_a,
        )


def _names(files: Sequence[str]) -> list[str]:
    short = [FilePath(f).name for f in files]
    return [s if short.count(s) == 1 else f for s, f in zip(short, files, strict=True)]


def _with_errors(
    side: _Side, path: Path, move: Index | None, points: Array, order: Order | None, reach_mm: float
) -> Array:
    """Axis positions plus the error of the calibrated machine, with the tool vector: tip positions."""
    assert side.program is not None and side.loaded is not None and move is not None
    tool = side.program.toolpath.tool_mm()
    model = side.loaded.model
    if tool.ndim == 2:
        first = runs.place(path, [""], [points], "none", order, reach_mm).runs[0]
        tool = tool[move[first.pairing.segment]]
    return np.asarray(points + model.error(points, tool), float)


def _absorbed(
    side: _Side, path: Path, move: Index | None, placed: runs.Placed, axes: bool
) -> tuple[float, float, str] | None:
    """The error that is absorbed by the fit: rms in um across the path before and after the fit, and which
    error; None where that is not known."""
    run, rigid = placed.runs[0], placed.rigid[0]
    moved = float(np.abs(rigid.inverse()(run.points_mm) - run.points_mm).max())
    if moved < 1.0:  # probably stated in the nominal frame already
        return *runs.absorbed(path, run, rigid), "as measured"
    if side.program is None or side.loaded is None or move is None:
        return None
    toolpath = side.program.toolpath
    tool = toolpath.tool_mm()
    which = move[run.pairing.segment]
    position_mm = run.pairing.foot_mm
    if not axes:
        nominal = nominal_of(toolpath, side.loaded.model, "axes")
        share = (run.pairing.s_mm - path.s_mm[run.pairing.segment]) / np.diff(path.s_mm)[run.pairing.segment]
        if len(nominal.path) != len(path):
            return None
        begin = nominal.path.vertex_mm[run.pairing.segment]
        position_mm = begin + share[:, None] * (nominal.path.vertex_mm[run.pairing.segment + 1] - begin)
    error = side.loaded.model.error(position_mm, tool if tool.ndim == 1 else tool[which])
    whose = "that the calibration predicts for the uncompensated machine"
    return *runs.absorbed_of_field(path, run, error), whose


def _head(side: _Side, sets: Sequence[Sequence[Points]], options: CompareOptions) -> dict[str, Any]:
    nominal = {
        "name": side.source.short,
        "sha256": hashlib.sha256(side.source.data).hexdigest(),
        "kind": "program" if side.program else "points",
    }
    stated = {"align": options.align, "reach_mm": options.reach_mm, "tolerance_um": options.part_tolerance_um}
    return parts.head(nominal, side.loaded, *sets) | stated
