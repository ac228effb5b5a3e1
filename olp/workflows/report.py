"""Report files of a correction and of a comparison: HTML, JSON or Markdown by the ending of their name."""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Mapping
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np

from olp.comparison.figures import Run
from olp.comparison.nominal import Nominal, counting, nominal_of
from olp.comparison.pairing import beside
from olp.comparison.path import Path
from olp.core.arrays import Index, Mask
from olp.core.errors import CannotCompute
from olp.core.optional import takes_plots
from olp.core.progress import Progress, part, silent
from olp.core.toolpath import Toolpath, carried
from olp.core.version import __version__
from olp.errormodel.base import ErrorModel
from olp.files.sources import Source
from olp.program.registry import Options, read
from olp.proof.acceptance_tests import predicted
from olp.reports.document import in_form
from olp.reports.report import SIDES, measured_sides, to_json
from olp.workflows.compare import Comparison
from olp.workflows.correct import Correction, CorrectOptions
from olp.workflows.results import ResultCorrection
from olp.workflows.session import Session
from olp.workflows.simulate import tips

if TYPE_CHECKING:
    from olp.reports.plots.thinned import Thinned

#: Points of a predicted path at equal steps, at most.
_POINTS = 120_000
#: Least distance between them, in mm.
_STEP_MM = 0.5


def comparison(result: Comparison, session: Session | None, name: str, date: datetime.date | None) -> bytes:
    """The report of a comparison in the form that `name` ends in."""
    from olp.reports import document_comparison as report_document
    from olp.reports.plots import path as plots_path
    from olp.reports.plots.thinned import thinned

    report = dict(result.report)
    if session is not None:
        report["test_paths"] = _tests(session)
    if FilePath(name).suffix.lower() == ".json":
        return to_json(report)
    plots: dict[str, bytes] = {}
    runs = {"before": result.before, "after": result.runs}
    if takes_plots(name) and result.path is not None and any(r.counted.any() for r in result.runs):
        tolerance = report.get("tolerance_um")
        sides = measured_sides(runs)
        plots = _path_plots(result.path, thinned(result.path, runs), tolerance, sides) | {
            "components": plots_path.components(result.path, runs, sides)
        }
    return in_form(
        report_document.comparison(report, plots | _test_plots(report, name), __version__, date), name
    )


def results(result: ResultCorrection, name: str, date: datetime.date | None) -> bytes:
    """The report of a correction of results in the form that `name` ends in."""
    from olp.reports import results as report_results

    if FilePath(name).suffix.lower() == ".json":
        return to_json(result.report)
    return in_form(report_results.to_document(result.report, __version__, date), name)


def correction(
    result: Correction, nominal: Source, session: Session, options: CorrectOptions, name: str,
    *, plots: bool = True, progress: Progress | None = None,
) -> bytes:  # fmt: skip
    """The report of a correction in the form that `name` ends in; `nominal` is the program that was
    corrected, unrolled where the call asks for it. Only a page has `plots`."""
    tell = progress or silent
    from olp.reports import document_correction as report_document

    tests = session.once("test_paths", lambda: _tests(session))
    report = dict(result.report) | {"test_paths": tests}
    if FilePath(name).suffix.lower() == ".json":
        return to_json(report)
    drawn: dict[str, bytes] = {}
    if plots and takes_plots(name):
        drawn = _predicted_plots(result, nominal, session, options, part(tell, 0.0, 0.8))
        tell("report", 0.8)
        drawn |= _test_plots(report, name)
        if result.confidence is not None and len(result.confidence):
            from olp.reports.plots import path as plots_path

            drawn = drawn | {"bands": plots_path.bands(result.confidence)}
    return in_form(report_document.correction(report, drawn, __version__, options.date), name)


def _tests(session: Session) -> dict[str, Any]:
    loaded, setup = session.loaded("hold"), session.setup
    digit = max(setup.machine.least_increment_mm)
    tool = carried(session.tool_vector(None), setup.job.payload_kg)
    return predicted(loaded.model, np.array(tool, float), digit)


def _test_plots(report: Mapping[str, Any], name: str) -> dict[str, bytes]:
    from olp.reports.plots import path as plots_path

    tests = report.get("test_paths")
    if not tests or not takes_plots(name):
        return {}
    return {
        "circles": plots_path.circles(tests["circles"]),
        "diagonals": plots_path.diagonals(tests["diagonals"]["rows"]),
    }


def _path_plots(
    path: Path, groups: Mapping[str, Thinned], tolerance: float | None, sides: Mapping[str, str],
    tell: Progress = silent,
) -> dict[str, bytes]:  # fmt: skip
    from olp.reports.plots import path as plots_path

    tell("report", 0.0)
    picture = plots_path.picture(path, groups, sides)
    tell("report", 0.6)
    along = plots_path.along(path, groups, tolerance, sides)
    tell("report", 0.8)
    return {
        "picture": picture,
        "along": along,
        "histogram": plots_path.histogram(groups, tolerance, sides),
    }


def _predicted_plots(
    result: Correction, nominal: Source, session: Session, options: CorrectOptions, tell: Progress
) -> dict[str, bytes]:
    """Plots of where the tip would go, with the nominal and with the corrected program."""
    from olp.reports.plots.thinned import Canvas, Thinned

    loaded = session.loaded("hold").reading(nominal)
    tell("report", 0.0)
    reading = Options(tell=part(tell, 0.0, 0.1, "report"))
    program = read(nominal.data, loaded.setup, loaded.dialect, reading, words=False)
    try:
        way = nominal_of(
            program.toolpath, loaded.model, "tip", points=program.dialect.points,
            tell=part(tell, 0.1, 0.3, "report"),
        )  # fmt: skip
    except CannotCompute:
        return {}
    reading = Options(tell=part(tell, 0.3, 0.4, "report"))
    corrected = read(result.plain, loaded.setup, loaded.dialect, reading, words=False)
    # points farther away are no part of the path, such as those of a tool change
    reach_mm = 10.0 * float(result.report["deviation"]["before"]["between"]["max_um"]) * 1e-3 + 0.1
    along, at_end = counting(program.toolpath, points=program.dialect.points)
    counts, canvas, groups = along | at_end, Canvas(way.path), {}
    for side, path, last, told in (
        ("before", program.toolpath, None, part(tell, 0.4, 0.5)),
        ("after", corrected.toolpath, result.groups, part(tell, 0.5, 0.6)),
    ):
        groups[side] = Thinned(way.path, canvas)
        for run in _runs(way, counts, path, last, loaded.model, reach_mm, told):
            groups[side].add(run)
    if not all(group.points for group in groups.values()):
        return {}
    tolerance = float(result.report["verdict"]["numerical"]["allowed_um"])
    return _path_plots(way.path, groups, tolerance, SIDES, part(tell, 0.6, 1.0))


def _runs(
    nominal: Nominal, counts: Mask, path: Toolpath, last: Index | None, model: ErrorModel, reach_mm: float,
    tell: Progress,
) -> Iterator[Run]:  # fmt: skip
    """Where the tip goes along a path, part by part, set beside the nominal one, on nominal moves that count
    (n,). `last` (n,) is the last move of the path that belongs to each of them, None where each is its own.
    """
    way = nominal.path
    step_mm = max(_STEP_MM, way.length_mm / _POINTS)
    for points, move in tips(path, model, step_mm):
        of = move if last is None else np.minimum(np.searchsorted(last, move), len(last) - 1)
        rows = np.flatnonzero(counts[of] & np.isfinite(points).all(axis=1))
        points, of = points[rows], of[rows]
        # of several chords of an arc the one that is as far along as the point
        first, behind = (np.searchsorted(nominal.move, of, side) for side in ("left", "right"))
        begin = np.maximum.accumulate(np.where(np.diff(of, prepend=-1) != 0, np.arange(len(of)), 0))
        share = (np.arange(len(of)) - begin + 1) / np.bincount(of)[of]
        segment = first + np.ceil(share * (behind - first)).astype(np.int64) - 1
        segment = np.clip(segment, 0, len(way) - 1)
        yield Run.of("", way, points, beside(way, points, segment), reach_mm, "free")
        tell("report", float(move[-1]) / len(path))
