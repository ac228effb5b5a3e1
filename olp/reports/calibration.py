"""The report of measured lines and of a calibration made from them: for people as text, and as a document
with the plots of a metrologist."""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from olp.calibration.estimator.fitted import Fit
from olp.calibration.iso230.conventions import angle_words
from olp.calibration.iso230.evaluation import Evaluated
from olp.calibration.iso230.positioning import Evaluation, scale_of
from olp.calibration.observations.lines import Line, LineState
from olp.core.arrays import Array
from olp.core.units import AXES, RAD_PER_URAD, UM_PER_MM
from olp.errormodel.calibration import Calibration
from olp.findings.catalogue import RULES, Finding
from olp.reports.document import Block, Document, Grid, Notice, Pairs, Paragraph, Plot, Section
from olp.reports.plots import calibration as plots_calibration
from olp.reports.plots.base import Format, calibration_curves
from olp.reports.plots.calibration import Fitted, name_of_straightness, name_of_turn
from olp.reports.report import findings_text, number, pairs, printable, table

_FIGURES = ("A", "E", "R", "M", "B", "B_mean")
_ONE_SIDE = ("A_up", "E_up", "R_up", "A_down", "E_down", "R_down")
#: Over what the table of cyclic errors stands.
_CYCLIC = "Cyclic errors of at least three times their standard uncertainty"
_SURE = 3.0
_ORDER = {"positioning": 0, "straightness": 1, "angle": 2}
_DENSE = 200
#: places in the box where errors are stated
_PLACES = 400
#: What the figures say, for who reads them once a year.
_LEGEND = (
    "A accuracy, E systematic deviation, R repeatability, M mean systematic deviation, B reversal (largest, "
    "and mean with its sign: approached in + less approached in -). Five runs and more are asked for. "
    "Straightness counts from its reference line."
)


@dataclass(frozen=True, slots=True, eq=False)
class FitSummary:
    """What a fit found, for its report: the adjustment, the calibration made of it, its summary as a mapping
    ("olp-fit-1") and its findings."""

    fit: Fit
    calibration: Calibration
    report: Mapping[str, Any]
    findings: Sequence[Finding]


def fitted_lines(fit: Fit) -> tuple[Fitted, ...]:
    """Each line of a fit beside its curve. Readings are the curve plus what the fit left of them, so their
    zero, slope, drift and reversal are out."""
    out = []
    for result in fit.of(LineState):
        line = result.state.observation
        x = np.linspace(line.target_mm.min(), line.target_mm.max(), _DENSE)
        rows = fit.curve(line.component, x)
        sigma = np.sqrt(np.maximum(np.einsum("nk,kl,nl->n", rows, fit.covariance, rows, optimize=True), 0.0))
        reading = fit.curve(line.component, line.target_mm) @ fit.theta + result.residual
        out.append(Fitted(line, x, np.asarray(rows @ fit.theta), sigma, np.asarray(reading)))
    return tuple(sorted(out, key=lambda item: _place_in_order(item.line)))


def _place_in_order(line: Line) -> tuple[int, int, str]:
    return line.axis, _ORDER[line.quantity], line.component


#: Plots of a fit in their order.
_FIT_CAPTIONS = {
    "curves": "The curves of the calibration, each on its measuring line.",
    "fitted": "Readings, freed of zero, slope, drift and reversal (blue approached in +, red in -), and the "
    "fitted curves with twice their standard uncertainty.",
    "residuals": "What the fit leaves of every reading.",
}


# -- text ------------------------------------------------------------------------------------------------


def to_text(found: Evaluated) -> str:
    """Plain text of an evaluation."""
    m = found.measurements
    sections = (
        list(pairs([
            ("Machine", printable(m.machine)),
            ("Lines", f"{len(found.evaluations)} evaluated" + _plural(len(found.sweeps), "sweep")),
        ])),
        list(_table_text(found, bidirectional=True)),
        list(_table_text(found, bidirectional=False)),
        list(_cyclic_text(found)),
        list(_reversal_text(found)),
        list(_squareness_text(found)),
        list(findings_text([f.as_dict() for f in found.findings])),
    )  # fmt: skip
    return "\n\n".join("\n".join(lines) for lines in sections if lines) + "\n"


def _plural(count: int, noun: str) -> str:
    return f", {count} {noun}{'s' if count != 1 else ''}" if count else ""


def _sorted(evaluations: Sequence[Evaluation]) -> list[Evaluation]:
    return sorted(evaluations, key=lambda e: _place_in_order(e.line))


def _rows(found: Evaluated, keys: Sequence[str], *, both: bool) -> list[list[str]]:
    """Component, what it is, figures, unit."""
    rows = []
    for e in _sorted(found.evaluations):
        if (len(e.sides) == 2) != both:
            continue
        unit, scale = scale_of(e.line)
        figures = e.figures()
        label = _name(e.component)
        if len(found.of(e.component)) > 1 and e.line.source:
            label += f", {printable(FilePath(e.line.source).name)}"
        cells = [number(figures[k] * scale) if k in figures else "" for k in keys]
        rows.append([e.component, label, *cells, unit])
    return rows


def _name(component: str) -> str:
    if component[1] in "ABC":
        return name_of_turn(component)
    if component[1] == component[2]:
        return "positioning"
    return f"straightness {name_of_straightness(component)}"


def _table_text(found: Evaluated, *, bidirectional: bool) -> Iterator[str]:
    keys = _FIGURES if bidirectional else _ONE_SIDE
    rows = _rows(found, keys, both=bidirectional)
    if rows:
        yield "ISO 230-2" if bidirectional else "ISO 230-2, approached from one side"
        yield from table(["", "", *map(_head, keys), ""], rows, left=2)


def _head(key: str) -> str:
    base, _, rest = key.partition("_")
    return base + {"": "", "up": "+", "down": "-", "mean": " mean"}[rest]


def _cyclic_text(found: Evaluated) -> Iterator[str]:
    rows = _cyclic_rows(found)
    if any(s.harmonics for s in found.separations):
        yield _CYCLIC
        header = ["", "", "period mm", "amplitude", "+-", "phase rad"]
        yield from table(header, rows or [["none"] + [""] * 5], left=2)


def _cyclic_rows(found: Evaluated) -> list[list[str]]:
    """Those that noise alone would hardly show (1 %)."""
    rows = []
    for s in found.separations:
        unit, scale = scale_of(s.line)
        for h in s.harmonics:
            if h.amplitude < _SURE * h.sigma_amplitude:
                continue
            rows.append([
                s.line.component, unit, f"{h.period_mm:g}", number(h.amplitude * scale),
                number(2.0 * h.sigma_amplitude * scale), number(h.phase_rad),
            ])  # fmt: skip
    return rows


def _reversal_text(found: Evaluated) -> Iterator[str]:
    rows = _reversal_rows(found)
    if rows:
        yield "Reversal (B of all targets, drift taken out)"
        yield from table(["", "", "B", "+-", "along the axis"], rows, left=2)


def _reversal_rows(found: Evaluated) -> list[list[str]]:
    rows = []
    for r in sorted(found.reversals, key=lambda r: _place_in_order(r.line)):
        unit, scale = scale_of(r.line)
        rows.append([
            r.line.component, unit, number(r.mean * scale), number(2.0 * r.sigma * scale),
            "constant" if r.constant else f"{r.at.min() * scale:.2f} to {r.at.max() * scale:.2f}",
        ])  # fmt: skip
    return rows


def _squareness_text(found: Evaluated) -> Iterator[str]:
    rows = _squareness_rows(found)
    if rows:
        yield "Squareness of straightness pairs, as at their place"
        yield from table(["", "urad", "+-", "angle", "lines", "square"], rows)


def _squareness_rows(found: Evaluated) -> list[list[str]]:
    return [
        [
            p.reading.component, number(p.reading.value_rad / RAD_PER_URAD),
            number(2.0 * p.reading.sigma_rad / RAD_PER_URAD),
            angle_words(p.reading.component, p.reading.value_rad),
            f"{p.first.component}, {p.second.component}", printable(p.square.name),
        ]
        for p in found.pairs
    ]  # fmt: skip


# -- plots -----------------------------------------------------------------------------------------------


def plots_of(found: Evaluated, kind: Format = "svg") -> dict[str, bytes]:
    """Every plot of an evaluation by its name, in the order of a report."""
    out: dict[str, bytes] = {}
    for axis in AXES:
        own = [e for e in _sorted(found.evaluations) if e.component[2] == axis]
        for e in own:
            if e.line.quantity == "positioning":
                out[_free(f"positioning-{e.component}", out)] = plots_calibration.positioning(e, kind)
        for quantity, draw in (
            ("straightness", plots_calibration.straightness),
            ("angle", plots_calibration.angles),
        ):
            group = [e for e in own if e.line.quantity == quantity]
            if group:
                name = "straightness" if quantity == "straightness" else "angles"
                out[f"{name}-{axis}"] = draw(group, kind=kind)
    for pair in found.pairs:
        name = _free(f"squareness-{pair.reading.component}", out)
        out[name] = plots_calibration.squareness(pair, kind)
    for separation in found.separations:
        if separation.harmonics and separation.line.quantity == "positioning":
            out[_free(f"cyclic-{separation.line.component}", out)] = plots_calibration.cyclic(
                separation, kind
            )
    lost = [r for r in found.reversals if r.line.quantity == "positioning"]
    if lost:
        out["reversal"] = plots_calibration.reversals(lost, kind)
    return out


def _free(name: str, taken: Mapping[str, bytes]) -> str:
    """The name, numbered where a plot has it already."""
    k = 2
    free = name
    while free in taken:
        free, k = f"{name}-{k}", k + 1
    return free


# -- documents -------------------------------------------------------------------------------------------


def evaluation(
    found: Evaluated, plots: Mapping[str, bytes], version: str, date: datetime.date | None
) -> Document:
    """The document of measured lines."""
    return Document(
        "Geometric accuracy of a machine",
        _subtitle(found, date),
        None,
        [
            Section("Measurement", [Pairs(_measurement(found))]),
            *_evaluated(found, plots),
            Section("Findings", list(_notices(found.findings))),
        ],
        _footer(version),
    )


def calibration(
    found: Evaluated,
    summary: FitSummary,
    plots: Mapping[str, bytes],
    version: str,
    date: datetime.date | None,
) -> Document:
    """The document of a calibration: what was fitted, and the measured lines behind it. `plots` are those of
    `fit_plots` and `plots_of`."""
    report = summary.report
    said = {f.code for f in summary.findings}
    findings = [*summary.findings, *(f for f in found.findings if f.code not in said)]
    worth = report["chi_square_per_freedom"]
    box = ", ".join(f"{a} {low:g} to {high:g}" for a, (low, high) in report["box_mm"].items())
    lost = ", ".join(f"{a} {number(v)}" for a, v in report["lost_motion_um"].items())
    sigma = [
        ("Readings", f"{report['readings']}, {report['left_out']} left out"),
        ("Chi square", f"{number(worth)} a degree of freedom, of {number(report['degrees_of_freedom'], 0)}"),
        ("Calibrated box", f"{box} mm"),
        ("Datum", ", ".join(f"{a} {v:g}" for a, v in zip(AXES, report["datum_mm"], strict=True)) + " mm"),
        ("Lost motion", f"{lost} um"),
        ("Over the box", _volume(summary.fit)),
    ]
    fitted: list[Block] = [
        Pairs(sigma),
        *_component_tables(report),
        *(Plot(plots[name], caption) for name, caption in _FIT_CAPTIONS.items() if name in plots),
    ]
    return Document(
        "Calibration of a machine",
        _subtitle(found, date),
        None,
        [
            Section("Measurement", [Pairs(_measurement(found))]),
            Section("Errors found", fitted),
            Section("Findings and limits", [*_not_observed(report), *_notices(findings)]),
            *_evaluated(found, plots),
        ],
        _footer(version),
    )


def _volume(fit: Fit) -> str:
    """How far the tool is off over the box, and how well that is known: rms lengths at places of a Latin
    hypercube, with the tool vector that most lines were read with."""
    random = np.random.default_rng(0)
    share = (np.argsort(random.random((3, _PLACES)), axis=1).T + random.random((_PLACES, 3))) / _PLACES
    at = fit.box_mm[:, 0] + share * np.ptp(fit.box_mm, axis=1)
    tools = [line.tool_mm for line in fit.measurements.lines if line.quantity != "angle"]
    tool = np.array(max(set(tools), key=tools.count) if tools else (0.0, 0.0, 0.0))
    size = np.linalg.norm(fit.error(at, tool), axis=1) * UM_PER_MM
    known = np.linalg.norm(fit.sigma(at, tool), axis=1) * UM_PER_MM
    return (
        f"{number(_rms(size))} um rms as it is, {number(float(size.max()))} um at most; known within "
        f"{number(_rms(known))} um rms, with the tool vector {_vector(tool.tolist())}"
    )


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean()))


def fit_plots(summary: FitSummary) -> dict[str, bytes]:
    """The plots of a fit as SVG; those of lines where it had any."""
    curves = calibration_curves(summary.calibration)
    out = {"curves": curves[curves.index(b"<svg") :]}
    results = sorted(
        summary.fit.of(LineState), key=lambda r: _place_in_order(r.state.observation)
    )
    if results:
        out["fitted"] = plots_calibration.fitted(fitted_lines(summary.fit))
        out["residuals"] = plots_calibration.residuals([(r.state.observation, r.residual) for r in results])
    return out


def _subtitle(found: Evaluated, date: datetime.date | None) -> str:
    day = date or found.measurements.measured
    return ", ".join(v for v in (found.measurements.machine, day.isoformat() if day else "") if v)


def _footer(version: str) -> str:
    return (
        f"Written by olp {version}. error = actual minus commanded, tool relative to workpiece, "
        "right-handed, names of ISO 230-1. Uncertainties after +- are twice the standard uncertainty."
    )


def _measurement(found: Evaluated) -> list[tuple[str, str]]:
    m = found.measurements
    lengths = [line for line in m.lines if line.quantity != "angle"]
    places = sorted({_place(line) for line in lengths})
    tool_vectors = sorted({_vector(line.tool_mm) for line in lengths})
    periods = ", ".join(
        f"{axis} {', '.join(f'{p:g}' for p in own)} mm"
        for axis, own in zip(AXES, m.periods_mm, strict=True)
        if own
    )
    return [
        ("Machine", m.machine),
        ("Measured", m.measured.isoformat() if m.measured else ""),
        ("Temperature of the scales", f"{m.temperature_degC:g} degC"),
        ("Lines", f"{len(m.lines)}, {sum(len(line.value) for line in m.lines)} readings"),
        ("Lines stood at", "; ".join(places[:6]) + ("; ..." if len(places) > 6 else "")),
        ("Tool vectors", "; ".join(tool_vectors[:6]) + ("; ..." if len(tool_vectors) > 6 else "")),
        ("Periods looked for", periods),
        ("Corrected by the control then", ", ".join(sorted(m.active_during_measurement))),
        ("Instruments", ", ".join(sorted({line.instrument for line in m.lines if line.instrument}))),
    ]


def _place(line: Line) -> str:
    """The moving axis, and where the others stood."""
    others = " ".join(
        f"{a}{v:g}" for k, (a, v) in enumerate(zip(AXES, line.line_mm, strict=True)) if k != line.axis
    )
    return f"{AXES[line.axis]} at {others}"


def _vector(values: Sequence[float]) -> str:
    return " ".join(f"{axis}{v:g}" for axis, v in zip(AXES, values, strict=True))


def _evaluated(found: Evaluated, plots: Mapping[str, bytes]) -> Iterator[Section]:
    if not found.evaluations:
        return
    blocks: list[Block] = [Paragraph(_LEGEND)]
    for keys, both in ((_FIGURES, True), (_ONE_SIDE, False)):
        rows = _rows(found, keys, both=both)
        if rows:
            blocks.append(Grid(["", "", *map(_head, keys), ""], rows, left=2))
    yield Section("Accuracy and repeatability (ISO 230-2)", blocks)
    for axis in AXES:
        drawn: list[Block] = [
            Plot(plots[name], _caption(name))
            for name in plots
            if name.startswith(("positioning", "straightness", "angles")) and _axis_of(name) == axis
        ]
        if drawn:
            yield Section(f"Axis {axis}", drawn, 2)
    blocks = []
    if found.pairs:
        blocks.append(Grid(["", "urad", "+-", "angle", "lines", "square"], _squareness_rows(found)))
        blocks += [Plot(plots[n], _caption(n)) for n in plots if n.startswith("squareness")]
        yield Section("Squareness", blocks)
    parts: list[Block] = []
    rows = _cyclic_rows(found)
    if any(s.harmonics for s in found.separations):
        parts.append(Paragraph(f"{_CYCLIC}."))
    if rows:
        parts.append(Grid(["cyclic error", "", "period mm", "amplitude", "+-", "phase rad"], rows, left=2))
        parts += [Plot(plots[n], _caption(n)) for n in plots if n.startswith("cyclic")]
    if rows := _reversal_rows(found):
        parts.append(Grid(["reversal", "", "B", "+-", "along the axis"], rows, left=2))
        parts += [Plot(plots[n], _caption(n)) for n in plots if n == "reversal"]
    if parts:
        yield Section("Cyclic errors and reversal", parts)


def _axis_of(name: str) -> str:
    return name.split("-")[1][-1]


def _caption(name: str) -> str:
    kind = name.split("-")[0]
    return {
        "positioning": "Positioning: means and twice the standard deviation of both directions, readings as "
        "triangles, less the mean of the first target; A, E and M as spans.",
        "straightness": "Straightness of both directions about one reference line.",
        "angles": "Angular errors of both directions, less the mean of the first target.",
        "squareness": "Both lines of the pair as read against the legs of the square, and their slopes.",
        "cyclic": "Non-cyclic and cyclic part of the mean of both directions.",
        "reversal": "Reversal at each target with twice its standard uncertainty, drift taken out.",
    }[kind]


def _component_tables(report: Mapping[str, Any]) -> Iterator[Block]:
    for key, unit in (("position_errors", "um"), ("angular_errors", "urad")):
        columns = [f"{name}_{unit}" for name in ("range", "sigma", "residual", "half_reversal")]
        yield Grid(
            [f"in {unit}", "", "range", "sigma", "residual", "half reversal"],
            [[r["name"], str(r["shape"]), *(number(r[c]) for c in columns)] for r in report[key]],
            left=2,
        )
    rows = []
    for row in report["squareness"]:
        angle = angle_words(row["name"], row["value_urad"] * RAD_PER_URAD)
        rows.append([row["name"], angle, number(row["value_urad"]), number(2.0 * row["sigma_urad"])])
    yield Grid(["squareness", "", "urad", "+-"], rows, left=2)
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
            "Not observed, taken as zero, and what that may cost at the longest lever in the box."
        )
        yield Grid(["", "um"], rows)


def _notices(findings: Sequence[Finding]) -> Iterator[Block]:
    for finding in findings:
        rule = RULES[finding.code]
        yield Notice(rule.severity.name.lower(), rule.code, rule.title, finding.message, rule.remedy)
    if not findings:
        yield Paragraph("None.")
