"""Measured runs against a nominal path: placed, paired and judged, in one way for `compare` and the page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from olp.comparison import runs
from olp.comparison.figures import Run
from olp.comparison.frames import Frames
from olp.comparison.nominal import nominal_of
from olp.comparison.pairing import Order
from olp.comparison.path import Path
from olp.core.arrays import Array, Index
from olp.core.units import UM_PER_MM
from olp.core.values import dataclass
from olp.files.points import Points
from olp.findings.catalogue import Finding
from olp.program.program import Program
from olp.proof import judgement
from olp.proof.measured import Measured
from olp.workflows import compare_report as parts
from olp.workflows.session import Loaded


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """The nominal path, and the rows of the table: its moves, or the segments of a file of points. `move` is
    the row of each segment of the path, `stop_move` that of each stop; (n,) `line`, `tool` and `operation`
    are those of the rows. `program` and `loaded` are None for a file of points."""

    path: Path
    move: Index
    stop_move: Index
    line: Index
    tool: Index
    operation: Index
    program: Program | None = None
    loaded: Loaded | None = None

    @staticmethod
    def of_program(program: Program, loaded: Loaded, *, axes: bool = False) -> Ground:
        """The path of the tip in the first work frame, or with `axes` that of axis positions. Raises
        CannotCompute where no path is known."""
        nominal = nominal_of(
            program.toolpath, loaded.model, "axes" if axes else "tip", points=program.dialect.points
        )
        tool, operation = judgement.groups_of(program.toolpath)
        line = program.toolpath.line.astype(np.int64)
        return Ground(nominal.path, nominal.move, nominal.stop_move, line, tool, operation, program, loaded)

    @staticmethod
    def of_points(points: Points) -> Ground:
        """The path through the points of a file. Raises CannotCompute for fewer than two of them."""
        path = Path.through(points.points_mm, points.line)
        rows, none = np.arange(len(path)), np.zeros(0, np.int64)
        return Ground(path, rows, none, path.line, np.full(len(path), -1), np.zeros(len(path), np.int64))

    def row(self, run: Run) -> Index:
        """(m,) the row of the table that each point of a run belongs to."""
        row = self.move[run.pairing.segment]
        row[run.stop >= 0] = self.stop_move[run.stop[run.stop >= 0]]
        return row


@dataclass(frozen=True, slots=True, kw_only=True)
class How:
    """How runs are placed and judged; `align` and `order` are as in `olp.comparison.runs.place`, and points
    farther than `reach_mm` from the path are in no figure."""

    align: runs.Align = "auto"
    order: Order | None = None
    reach_mm: float = 1.0
    part_tolerance_um: float | None = None
    axes: bool = False
    add_errors: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """Runs on the path, by group: "after", and "before" where there are some. `figures` are those of each
    group, `layers` its layer of the table; `verdict` is that on "after". `absorbed` is the error that is
    absorbed by the fit, as in `_absorbed`."""

    placed: runs.Placed
    groups: Mapping[str, tuple[Run, ...]]
    layers: Mapping[str, Measured]
    figures: Mapping[str, dict[str, Any]]
    absorbed: tuple[float, float, str] | None
    verdict: dict[str, Any]
    findings: tuple[Finding, ...] = field(default=())


def judged(ground: Ground, measured: Sequence[Points], how: How, before: Sequence[Points] = ()) -> Judged:
    """Runs of points, a file each, placed on the path together and judged. Raises CannotCompute, and
    ConfigError for a frame that the machine does not have."""
    files = [*measured, *before]
    names = names_of([p.file for p in files])
    placed = runs.place(ground.path, names, _stated(ground, files, how), how.align, how.order, how.reach_mm)
    findings = runs.findings(ground.path, placed)
    absorbed = None
    if placed.fitted and all(placed.right) and placed.runs[0].counted.any():
        absorbed = _absorbed(ground, placed, how)
    if absorbed is not None:
        findings += runs.absorbed_finding(*absorbed)
    count = len(measured)
    groups = {"after": placed.runs[:count]} | ({"before": placed.runs[count:]} if before else {})
    right = {"after": placed.right[:count], "before": placed.right[count:]}
    layers, figures = {}, {}
    for name, members in groups.items():
        layers[name] = _layer(ground, members, all(right[name]), how.part_tolerance_um)
        figures[name] = parts.group(ground.path, members, right[name], layers[name])
    verdict, more = parts.verdict(layers["after"])
    findings += more + parts.cycles(groups)
    return Judged(placed, groups, layers, figures, absorbed, verdict, tuple(findings))


def names_of(files: Sequence[str]) -> list[str]:
    """The names of files without their folders, where that tells them apart."""
    short = [FilePath(f).name for f in files]
    return [s if short.count(s) == 1 else f for s, f in zip(short, files, strict=True)]


def _layer(ground: Ground, members: Sequence[Run], right: bool, tolerance_um: float | None) -> Measured:
    """The layer of the table of some runs; without any point where a pairing is wrong."""
    by_run = []
    for run in members:
        counted = run.counted & right
        size_um = run.size_mm[counted] * UM_PER_MM
        by_run.append(Measured.largest_of(len(ground.line), ground.row(run)[counted], size_um))
    names = tuple(run.name for run in members)
    return Measured(names, ground.line, ground.tool, ground.operation, tuple(by_run), tolerance_um)


def _stated(ground: Ground, files: Sequence[Points], how: How) -> list[Array]:
    """The points of files in the nominal frame, as far as the files state where they are."""
    points = [p.points_mm for p in files]
    if ground.program is None or ground.loaded is None or not len(ground.program.toolpath):
        return points
    if how.add_errors:
        return [_with_errors(ground, p, how) for p in points]
    if how.axes:
        return points
    frames = Frames.of(ground.program.toolpath, ground.loaded.model, ground.loaded.setup)
    return [frames.into_first(p.points_mm, p.frame, p.file) for p in files]


def _with_errors(ground: Ground, points: Array, how: How) -> Array:
    """Axis positions plus the error of the calibrated machine, with the tool vector: tip positions."""
    assert ground.program is not None and ground.loaded is not None
    tool = ground.program.toolpath.tool_mm()
    if tool.ndim == 2:
        first = runs.place(ground.path, [""], [points], "none", how.order, how.reach_mm).runs[0]
        tool = tool[ground.move[first.pairing.segment]]
    return np.asarray(points + ground.loaded.model.error(points, tool), float)


def _absorbed(ground: Ground, placed: runs.Placed, how: How) -> tuple[float, float, str] | None:
    """The error that is absorbed by the fit: rms in um across the path before and after the fit, and which
    error; None where that is not known."""
    path, run, rigid = ground.path, placed.runs[0], placed.rigid[0]
    moved = float(np.abs(rigid.inverse()(run.points_mm) - run.points_mm).max())
    if moved < 1.0:  # probably stated in the nominal frame already
        return *runs.absorbed(path, run, rigid), "as measured"
    if ground.program is None or ground.loaded is None:
        return None
    toolpath = ground.program.toolpath
    tool = toolpath.tool_mm()
    which = ground.move[run.pairing.segment]
    position_mm = run.pairing.foot_mm
    if not how.axes:
        nominal = nominal_of(toolpath, ground.loaded.model, "axes")
        share = (run.pairing.s_mm - path.s_mm[run.pairing.segment]) / np.diff(path.s_mm)[run.pairing.segment]
        if len(nominal.path) != len(path):
            return None
        begin = nominal.path.vertex_mm[run.pairing.segment]
        position_mm = begin + share[:, None] * (nominal.path.vertex_mm[run.pairing.segment + 1] - begin)
    error = ground.loaded.model.error(position_mm, tool if tool.ndim == 1 else tool[which])
    whose = "that the calibration predicts for the uncompensated machine"
    return *runs.absorbed_of_field(path, run, error), whose
