"""The report of a calibration made from measurements, as a document with plots."""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from olp.calibration.estimator.fitted import Fit
from olp.calibration.iso230.conventions import angle_words
from olp.calibration.iso230.evaluation import Evaluated
from olp.calibration.observations.lines import LineState
from olp.core.arrays import Array
from olp.core.units import AXES, RAD_PER_URAD, UM_PER_MM
from olp.core.values import dataclass
from olp.errormodel.calibration import Calibration
from olp.findings.catalogue import Finding
from olp.reports.document import Block, Document, Grid, Pairs, Paragraph, Plot, Section
from olp.reports.evaluation import (
    footer,
    measurement,
    notices,
    place_in_order,
    sections,
    subtitle,
    vector_words,
)
from olp.reports.plots import calibration as plots_calibration
from olp.reports.plots.base import calibration_curves
from olp.reports.plots.calibration import Fitted
from olp.reports.report import number

#: Points of a drawn curve.
_DENSE = 200
#: Number of random points in the box for the figures over the box.
_POINTS = 400
#: Plots of a fit in their order.
_FIT_CAPTIONS = {
    "curves": "The curves of the calibration, each on its measuring line.",
    "fitted": "Readings with zero offset, slope, drift and reversal removed (blue approached in +, red in "
    "-), and the fitted curves with twice their standard uncertainty.",
    "residuals": "Residual of every reading.",
}


@dataclass(frozen=True, slots=True, eq=False)
class FitSummary:
    """The results of a fit, for its report: the adjustment, the calibration made from it, its summary as a
    mapping ("olp-fit-1") and its findings."""

    fit: Fit
    calibration: Calibration
    report: Mapping[str, Any]
    findings: Sequence[Finding]


def fitted_lines(fit: Fit) -> tuple[Fitted, ...]:
    """Each line of a fit with its curve. Readings are the curve plus their residuals, so that their zero,
    slope, drift and reversal are removed."""
    lines = []
    for result in fit.of(LineState):
        line = result.state.observation
        x = np.linspace(line.target_mm.min(), line.target_mm.max(), _DENSE)
        rows = fit.curve(line.component, x)
        sigma = np.sqrt(np.maximum(np.einsum("nk,kl,nl->n", rows, fit.covariance, rows, optimize=True), 0.0))
        reading = fit.curve(line.component, line.target_mm) @ fit.theta + result.residual
        lines.append(Fitted(line, x, np.asarray(rows @ fit.theta), sigma, np.asarray(reading)))
    return tuple(sorted(lines, key=lambda item: place_in_order(item.line)))


def fit_plots(summary: FitSummary) -> dict[str, bytes]:
    """The plots of a fit as SVG; those of lines where there are any."""
    curves = calibration_curves(summary.calibration)
    plots = {"curves": curves[curves.index(b"<svg") :]}
    results = sorted(summary.fit.of(LineState), key=lambda r: place_in_order(r.state.observation))
    if results:
        plots["fitted"] = plots_calibration.fitted(fitted_lines(summary.fit))
        plots["residuals"] = plots_calibration.residuals([(r.state.observation, r.residual) for r in results])
    return plots


def calibration(
    evaluated: Evaluated,
    summary: FitSummary,
    plots: Mapping[str, bytes],
    version: str,
    date: datetime.date | None,
) -> Document:
    """The document of a calibration: what was fitted, and the measured lines behind it. `plots` are those of
    `fit_plots` and `plots_of`."""
    report = summary.report
    codes = {f.code for f in summary.findings}
    findings = [*summary.findings, *(f for f in evaluated.findings if f.code not in codes)]
    reduced = report["chi_square_per_freedom"]
    box = ", ".join(f"{a} {low:g} to {high:g}" for a, (low, high) in report["box_mm"].items())
    backlash = ", ".join(f"{a} {number(v)}" for a, v in report["lost_motion_um"].items())
    rows = [
        ("Readings", f"{report['readings']}, {report['left_out']} left out"),
        (
            "Reduced chi-square",
            f"{number(reduced)}, {number(report['degrees_of_freedom'], 0)} degrees of freedom",
        ),
        ("Calibrated box", f"{box} mm"),
        ("Datum", ", ".join(f"{a} {v:g}" for a, v in zip(AXES, report["datum_mm"], strict=True)) + " mm"),
        ("Backlash", f"{backlash} um"),
        ("Over the box", _volume(summary.fit)),
    ]
    fitted: list[Block] = [
        Pairs(rows),
        *_component_tables(report),
        *(Plot(plots[name], caption) for name, caption in _FIT_CAPTIONS.items() if name in plots),
    ]
    return Document(
        "Calibration of a machine",
        subtitle(evaluated, date),
        None,
        [
            Section("Measurement", [Pairs(measurement(evaluated))]),
            Section("Errors found", fitted),
            Section("Findings and limits", [*_not_observed(report), *notices(findings)]),
            *sections(evaluated, plots),
        ],
        footer(version),
    )


def _volume(fit: Fit) -> str:
    """The error of the tool over the box, and its uncertainty: rms lengths at points of a Latin hypercube,
    with the tool vector that most lines were measured with."""
    random = np.random.default_rng(0)
    share = (np.argsort(random.random((3, _POINTS)), axis=1).T + random.random((_POINTS, 3))) / _POINTS
    position_mm = fit.box_mm[:, 0] + share * np.ptp(fit.box_mm, axis=1)
    tools = [line.tool_mm for line in fit.measurements.lines if line.quantity != "angle"]
    tool = np.array(max(set(tools), key=tools.count) if tools else (0.0, 0.0, 0.0))
    size = np.linalg.norm(fit.error(position_mm, tool), axis=1) * UM_PER_MM
    sigma = np.linalg.norm(fit.sigma(position_mm, tool), axis=1) * UM_PER_MM
    return (
        f"uncorrected error {number(_rms(size))} um rms, {number(float(size.max()))} um at most; standard "
        f"uncertainty {number(_rms(sigma))} um rms; with the tool vector {vector_words(tool.tolist())}"
    )


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean()))


def _component_tables(report: Mapping[str, Any]) -> Iterator[Block]:
    for key, unit in (("position_errors", "um"), ("angular_errors", "urad")):
        columns = [f"{name}_{unit}" for name in ("range", "sigma", "residual", "half_reversal")]
        yield Grid(
            [f"in {unit}", "", "range", "sigma", "residual", "half reversal"],
            [[r["name"], str(r["shape"]), *(number(r[c]) for c in columns)] for r in report[key]],
            text_columns=2,
        )
    rows = []
    for row in report["squareness"]:
        angle = angle_words(row["name"], row["value_urad"] * RAD_PER_URAD)
        figures = [row[f"{place}{key}_urad"] for place in ("", "mid_box_") for key in ("value", "sigma")]
        shown = [number(value * (1.0, 2.0)[k % 2]) for k, value in enumerate(figures)]
        rows.append([row["name"], f"{angle}; mid-box {row['in_the_middle']}", *shown])
    yield Grid(["squareness", "", "urad", "+-", "mid-box", "+-"], rows, text_columns=2)
    for name, title in (("sets_of_points", "points"), ("diagonals_and_circles", "diagonals and circles")):
        sets = report.get(name) or ()
        if not sets:
            continue
        keys = [key for key in sets[0] if key not in ("name", "file")]
        yield Grid(
            [title, *(key.replace("_", " ") for key in keys)],
            [[FilePath(row["name"]).name, *(number(row[key]) for key in keys)] for row in sets],
        )
    if report["cyclic"]:
        yield Grid(
            ["cyclic", "period mm", "amplitude"],
            [
                [r["name"], f"{r['period_mm']:g}", *(number(v) for k, v in r.items() if "amplitude" in k)]
                for r in report["cyclic"]
            ],
        )


def _not_observed(report: Mapping[str, Any]) -> Iterator[Block]:
    rows = [[row["name"], number(row["costs_um"])] for row in report["not_observed"]]
    if rows:
        yield Paragraph(
            "Not observed, assumed zero, and the error of that at the longest lever arm in the box."
        )
        yield Grid(["", "um"], rows)
