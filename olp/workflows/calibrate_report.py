"""Report files of measured lines and of the calibration made from them: HTML, JSON or Markdown by ending."""

from __future__ import annotations

import datetime
from pathlib import Path as FilePath

from olp.calibration.iso230.evaluation import Evaluated, evaluate_all
from olp.core.errors import ConfigError
from olp.core.optional import takes_plots
from olp.core.version import __version__
from olp.reports import calibration as report_calibration
from olp.reports import evaluation as report_evaluation
from olp.reports import joint_fit as report_joint_fit
from olp.reports.calibration import FitSummary
from olp.reports.document import in_form
from olp.reports.report import to_json
from olp.workflows.calibrate_fit import FittedCalibration
from olp.workflows.calibrate_joints import FittedJoints


def evaluation(evaluated: Evaluated, name: str, date: datetime.date | None) -> bytes:
    """The report of an evaluation in the form that `name` ends in."""
    ending = FilePath(name).suffix.lower()
    if ending == ".json":
        return to_json(evaluated.as_dict())
    plots = report_evaluation.plots_of(evaluated) if takes_plots(name) else {}
    return in_form(report_evaluation.evaluation(evaluated, plots, __version__, date), name)


def joint_fit(fitted: FittedJoints, name: str, date: datetime.date | None) -> bytes:
    """The report of `olp calibrate fit` on a machine of any joints in the form that `name` ends in."""
    report = fitted.full_report()
    if FilePath(name).suffix.lower() == ".json":
        return to_json(report)
    plots: dict[str, bytes] = {}
    if takes_plots(name):
        from olp.reports.plots.joint_fit import held_out_plot, unknowns_plot

        rows = [
            (row["name"], row["value"], row["sigma"])
            for row in report["unknowns"]
            if row["name"].endswith(("_um", "_urad")) and not report_joint_fit.is_held(row)
        ]
        plots = {"unknowns": unknowns_plot(rows)} if rows else {}
        if fitted.unseen is not None:
            plots["held_out"] = held_out_plot(*fitted.unseen)
    return in_form(report_joint_fit.joint_fit(report, plots, __version__, date), name)


def fit(fitted: FittedCalibration, name: str, date: datetime.date | None) -> bytes:
    """The report of `olp calibrate fit` in the form that `name` ends in."""
    ending = FilePath(name).suffix.lower()
    report = fitted.full_report()
    if ending == ".json":
        return to_json(report)
    measurements = fitted.fit.measurements
    try:
        evaluated = evaluate_all(measurements)
    except ConfigError:
        # lines of single runs have no ISO 230-2 figures; the summary of the fit shows them
        evaluated = Evaluated(measurements, (), (), (), (), (), ())
    summary = FitSummary(fitted.fit, fitted.calibration, report, fitted.findings)
    plots: dict[str, bytes] = {}
    if takes_plots(name):
        plots = report_calibration.fit_plots(summary) | report_evaluation.plots_of(evaluated)
    return in_form(report_calibration.calibration(evaluated, summary, plots, __version__, date), name)
