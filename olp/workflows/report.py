"""Report files of a correction and of a comparison: HTML, JSON or Markdown by the ending of their name."""

from __future__ import annotations

import datetime
from collections.abc import Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from olp.comparison.figures import Run
from olp.comparison.nominal import nominal_of
from olp.comparison.pairing import pair
from olp.comparison.path import Path
from olp.core.errors import CannotCompute
from olp.core.toolpath import carried
from olp.core.version import __version__
from olp.files.sources import Source
from olp.program.registry import Options, read
from olp.proof.acceptance_tests import predicted
from olp.reports.document import in_form
from olp.reports.report import SIDES, measured_sides, to_json
from olp.workflows.compare import Comparison
from olp.workflows.correct import Correction, CorrectOptions
from olp.workflows.results import ResultCorrection
from olp.workflows.session import Session
from olp.workflows.simulate import SimulateOptions, simulated

#: Most points of a predicted path in a picture.
_POINTS = 120_000
#: Least distance between them, in mm.
_STEP_MM = 0.5


def comparison(result: Comparison, session: Session | None, name: str, date: datetime.date | None) -> bytes:
    """The report of a comparison in the form that `name` ends in."""
    from olp.reports import document_comparison as report_document
    from olp.reports.plots import path as plots_path

    report = dict(result.report)
    if session is not None:
        report["test_paths"] = _tests(session)
    if FilePath(name).suffix.lower() == ".json":
        return to_json(report)
    plots: dict[str, bytes] = {}
    runs = {"before": result.before, "after": result.runs}
    if (
        FilePath(name).suffix.lower() == ".html"
        and result.path is not None
        and any(r.counted.any() for r in result.runs)
    ):
        tolerance = report.get("tolerance_um")
        sides = measured_sides(runs)
        plots = _path_plots(result.path, runs, tolerance, sides) | {
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
    result: Correction, nominal: Source, session: Session, options: CorrectOptions, name: str
) -> bytes:
    """The report of a correction in the form that `name` ends in; `nominal` is the program that was
    corrected, unrolled where the call asks for it."""
    from olp.reports import document_correction as report_document

    report = dict(result.report) | {"test_paths": _tests(session)}
    if FilePath(name).suffix.lower() == ".json":
        return to_json(report)
    plots: dict[str, bytes] = {}
    if FilePath(name).suffix.lower() == ".html":
        plots = _predicted_plots(result, nominal, session, options)
        if result.confidence is not None and len(result.confidence):
            from olp.reports.plots import path as plots_path

            plots = plots | {"bands": plots_path.bands(result.confidence)}
    return in_form(
        report_document.correction(report, plots | _test_plots(report, name), __version__, options.date), name
    )


def _tests(session: Session) -> dict[str, Any]:
    loaded, setup = session.loaded("hold"), session.setup
    digit = max(setup.machine.least_increment_mm)
    tool = carried(session.tool_vector(None), setup.job.payload_kg)
    return predicted(loaded.model, np.array(tool, float), digit)


def _test_plots(report: Mapping[str, Any], name: str) -> dict[str, bytes]:
    from olp.reports.plots import path as plots_path

    tests = report.get("test_paths")
    if not tests or FilePath(name).suffix.lower() != ".html":
        return {}
    return {
        "circles": plots_path.circles(tests["circles"]),
        "diagonals": plots_path.diagonals(tests["diagonals"]["rows"]),
    }


def _path_plots(
    path: Path, runs: Mapping[str, Sequence[Run]], tolerance: float | None, sides: Mapping[str, str]
) -> dict[str, bytes]:
    from olp.reports.plots import path as plots_path

    return {
        "picture": plots_path.picture(path, runs, sides),
        "along": plots_path.along(path, runs, tolerance, sides),
        "histogram": plots_path.histogram(runs, tolerance, sides),
    }


def _predicted_plots(
    result: Correction, nominal: Source, session: Session, options: CorrectOptions
) -> dict[str, bytes]:
    """Plots of where the tip would go, with the nominal and with the corrected program."""
    loaded = session.loaded("hold").reading(nominal)
    program = read(nominal.data, loaded.setup, loaded.dialect, Options(contour=options.contour), words=False)
    try:
        path = nominal_of(program.toolpath, loaded.model, "tip", points=program.dialect.points).path
    except CannotCompute:
        return {}
    step = max(_STEP_MM, path.length_mm / _POINTS)
    runs: dict[str, Sequence[Run]] = {}
    simulating = SimulateOptions(
        step_mm=step, contour=options.contour, date=options.date, accept=options.accept
    )
    corrected = session.sources.source(result.data)
    for side, text in (("before", session.sources.source(nominal.data)), ("after", corrected)):
        points = simulated(session.sources, text, loaded, simulating).points_mm
        # points farther away are no part of the path, such as those of a tool change
        reach = 10.0 * float(result.report["deviation"]["before"]["between"]["max_um"]) * 1e-3 + 0.1
        runs[side] = (Run.of(side, path, points, pair(path, points, "forward"), reach),)
    if not all(run.counted.any() for group in runs.values() for run in group):
        return {}
    return _path_plots(path, runs, float(result.report["verdict"]["numerical"]["allowed_um"]), SIDES)
