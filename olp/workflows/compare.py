"""Comparison of measured paths and poses with nominal ones: from files to figures and findings."""

from __future__ import annotations

import datetime
import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any, Literal

import numpy as np

from olp.checks import state
from olp.comparison import figures, runs
from olp.comparison.nominal import Nominal, nominal_of
from olp.comparison.pairing import Order
from olp.comparison.path import Path
from olp.core.arrays import Array, Index
from olp.core.errors import InputError, OlpError, UsageError
from olp.core.machine import Setup
from olp.core.progress import Progress, silent
from olp.core.units import UM_PER_MM
from olp.files.point_profile import PointProfile
from olp.files.points import Points, layout_of, parse_points, read_points
from olp.files.write import read_bytes
from olp.findings.catalogue import Finding
from olp.program.program import Program
from olp.program.registry import Options, read
from olp.workflows import compare_parts as parts
from olp.workflows.compare_poses import part_frame as poses_frame
from olp.workflows.compare_poses import poses_report
from olp.workflows.session import Loaded, PathLike, load, setup_of


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """What a comparison found: the report ("olp-comparison-1") as a mapping and the findings.

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
        """A row a measured point: run, arc length, line, nominal place, deviations, and whether it counts."""
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
class _Source:
    """The nominal side: points, or a program with its machine."""

    name: str
    data: bytes
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
    tolerance_um: float | None = None,
    add_errors: bool = False,
    part_frame: str | None = None,
    contour: bool = False,
    date: datetime.date | None = None,
    progress: Progress | None = None,
) -> Comparison:
    """Hold measured runs against a nominal path, or measured points against nominal poses.

    `nominal` is a program, which needs `machine`, or a file of points. Each file of `measured` and of
    `before` is one run (cycle); with `poses` each row is a pose, paired by name or by row. `align` and
    `order` are as in `olp.comparison.runs.place`; points farther than `reach_mm` from their place are in no
    figure. With `add_errors` measured axis positions (a control's log) are moved to where the calibrated
    machine's tip would go. `part_frame` names the work offset that poses, measured in axis positions, are
    to give. Raises InputError, UsageError and CannotCompute.
    """
    tell = progress or silent
    options = {"align": align, "reach_mm": reach_mm, "tolerance_um": tolerance_um}
    tell("read", 0.0)
    if not measured:
        raise UsageError("no measured file is given; name at least one")
    sets = [[read_points(name, profile) for name in names] for names in (measured, before)]
    source = _source(nominal, machine, job, contour)
    layout = sets[0][0].profile
    if poses:
        if source.points is None:
            raise UsageError("poses come from a file of points; the nominal one is a program")
        report, found = poses_report(source.points, *sets, align=align, reach_mm=reach_mm)
        report = _head(source, sets, options) | report
        table = None if part_frame is None else poses_frame(source.points, sets[0], part_frame)
        return Comparison(_with(report, found), tuple(found), layout, part_frame=table)
    axes = _positions(sets) == "axes"
    if add_errors and not (axes and source.program):
        raise UsageError(
            "--add-errors moves axis positions of a control's log by the machine's errors; give a program as "
            'NOMINAL, -m, and a profile with positions = "axes"'
        )
    path, move = _nominal(source, axes)
    _same_frame(source, sets, axes)
    names = _names([p.file for files in sets for p in files])
    tell("pair", 0.2)
    points = [p.points_mm for files in sets for p in files]
    if add_errors:
        points = [_with_errors(source, path, move, p, order, reach_mm) for p in points]
    placed = runs.place(path, names, points, align, order, reach_mm)
    tell("figures", 0.8)
    found = runs.findings(path, placed)
    judged = placed.fitted and all(placed.right) and bool(placed.runs[0].counted.any())
    taken = _taken(source, path, move, placed, axes) if judged else None
    if taken is not None:
        found += runs.eaten_finding(*taken)
    count = len(measured)
    groups = {"after": placed.runs[:count], "before": placed.runs[count:]}
    right = {"after": placed.right[:count], "before": placed.right[count:]}
    report = _head(source, sets, options)
    report["frame"] = parts.frame(placed)
    if taken is not None:
        report["frame"] |= {"error_rms_um": taken[0], "left_by_fit_rms_um": taken[1], "error_is": taken[2]}
    report["path"] = {
        "length_mm": path.length_mm,
        "segments": len(path),
        "cutting_mm": float(np.diff(path.s_mm)[path.cutting].sum()),

        "compared_in": "axis positions" if axes else "the program's frame",
        "machine_errors_added": add_errors,
    }  # fmt: skip
    for name, members in groups.items():
        if members:
            report[name] = parts.group(path, members, right[name])
    if source.program is not None and all(right["after"]):
        worst = report["after"].get("worst") or []
        report["worst"] = [row | {"text": source.program.text(row["line"])} for row in worst]
    found += parts.verdict(report, tolerance_um)
    found += parts.cycles(groups)
    if source.loaded is not None:
        days = source.loaded.setup.machine.sanity.calibration_days
        found += state.calibration_findings(source.loaded.calibration, date, days)
    return Comparison(_with(report, found), tuple(found), layout, path, groups["after"], groups["before"])


def _with(report: dict[str, Any], found: Sequence[Finding]) -> dict[str, Any]:
    return report | {"findings": [f.as_dict() for f in found]}


def _source(
    nominal: PathLike | bytes, machine: PathLike | Setup | None, job: PathLike | None, contour: bool
) -> _Source:
    setup = None if machine is None and job is None else setup_of(machine, job)
    data = nominal if isinstance(nominal, bytes) else read_bytes(nominal)
    name = "" if isinstance(nominal, bytes) else str(nominal)
    if layout_of(data) is not None:
        loaded = None if setup is None else load(setup, None, "hold")
        return _Source(name, data, parse_points(data, name or "<stdin>"), None, loaded)
    if setup is None:
        raise UsageError(
            f"{name or 'the nominal path'} is no table of points, and a program needs its machine; "
            "name the machine file with -m, or a job with -j"
        )
    try:
        loaded = load(setup, None, "hold").reading(data, name)
        program = read(data, loaded.setup, loaded.dialect, Options(contour=contour))
    except OlpError as error:
        raise error.in_file(name or "<stdin>") from None
    return _Source(name, data, None, program, loaded)


def _positions(sets: Sequence[Sequence[Points]]) -> Literal["tip", "axes"]:
    kinds = {p.profile.positions for files in sets for p in files}
    if len(kinds) > 1:
        raise UsageError("some measured files hold axis positions and others the tip; compare them apart")
    return kinds.pop()


def _nominal(source: _Source, axes: bool) -> tuple[Path, Index | None]:
    if source.points is not None:
        return Path.through(source.points.points_mm, source.points.line), None
    assert source.program is not None and source.loaded is not None
    found: Nominal = nominal_of(source.program.toolpath, source.loaded.model, "axes" if axes else "tip")
    return found.path, found.move


def _same_frame(source: _Source, sets: Sequence[Sequence[Points]], axes: bool) -> None:
    """Frames that files state never mix. Raises InputError."""
    stated = {p.frame: p.file for files in sets for p in files if p.frame}
    if source.points is not None and source.points.frame:
        stated.setdefault(source.points.frame, source.points.file)
    if source.program is not None and len(source.program.toolpath) and not axes:
        path = source.program.toolpath
        stated.setdefault(path.frames[int(path.frame[0])].work_offset, source.name)
    if len(stated) > 1:
        (a, file_a), (b, file_b) = list(stated.items())[:2]
        raise InputError(
            f"states frame {a}, and {file_b} is in {b}; expected the same frame; state the points anew, or "
            "remove the statement and fit them with --align fit",
            file=file_a,
        )


def _names(files: Sequence[str]) -> list[str]:
    short = [FilePath(f).name for f in files]
    return [s if short.count(s) == 1 else f for s, f in zip(short, files, strict=True)]


def _with_errors(
    source: _Source, path: Path, move: Index | None, points: Array, order: Order | None, reach_mm: float
) -> Array:
    """Axis positions moved to where the tip of the calibrated machine would go, the tool's lever included."""
    assert source.program is not None and source.loaded is not None and move is not None
    tool = source.program.toolpath.tool_mm()
    model = source.loaded.model
    if tool.ndim == 2:
        first = runs.place(path, [""], [points], "none", order, reach_mm).runs[0]
        tool = tool[move[first.pairing.segment]]
    return np.asarray(points + model.error(points, tool), float)


def _taken(
    source: _Source, path: Path, move: Index | None, placed: runs.Placed, axes: bool
) -> tuple[float, float, str] | None:
    """What the fit takes of the error: rms in um across the path before and after it, and of which error;
    None where nothing is known of that."""
    run, rigid = placed.runs[0], placed.rigid[0]
    moved = float(np.abs(rigid.inverse()(run.points_mm) - run.points_mm).max())
    if moved < 1.0:  # stated in the nominal frame already, as far as anybody can tell
        return *runs.eaten(path, run, rigid), "as measured"
    if source.program is None or source.loaded is None or move is None:
        return None
    toolpath = source.program.toolpath
    tool = toolpath.tool_mm()
    which = move[run.pairing.segment]
    at = run.pairing.foot_mm
    if not axes:
        nominal = nominal_of(toolpath, source.loaded.model, "axes")
        share = (run.pairing.s_mm - path.s_mm[run.pairing.segment]) / np.diff(path.s_mm)[run.pairing.segment]
        if len(nominal.path) != len(path):
            return None
        begin = nominal.path.vertex_mm[run.pairing.segment]
        at = begin + share[:, None] * (nominal.path.vertex_mm[run.pairing.segment + 1] - begin)
    error = source.loaded.model.error(at, tool if tool.ndim == 1 else tool[which])
    whose = "that the calibration predicts for the uncorrected machine"
    return *runs.eaten_of_field(path, run, error), whose


def _head(source: _Source, sets: Sequence[Sequence[Points]], options: dict[str, Any]) -> dict[str, Any]:
    nominal = {
        "name": FilePath(source.name).name if source.name else "",
        "sha256": hashlib.sha256(source.data).hexdigest(),
        "kind": "program" if source.program else "points",
    }
    return parts.head(nominal, source.loaded, *sets) | options
