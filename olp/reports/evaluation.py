"""The report of measured lines, as text and as a document with plots."""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path as FilePath

from olp.calibration.iso230.conventions import angle_words
from olp.calibration.iso230.evaluation import Evaluated
from olp.calibration.iso230.positioning import Evaluation, scale_of
from olp.calibration.observations.lines import Line
from olp.core.units import AXES, RAD_PER_URAD
from olp.findings.catalogue import RULES, Finding
from olp.reports.document import Block, Document, Grid, Notice, Pairs, Paragraph, Plot, Section
from olp.reports.plots import calibration as plots_calibration
from olp.reports.plots.base import Format
from olp.reports.plots.calibration import name_of_straightness, name_of_turn
from olp.reports.report import findings_text, number, pairs, printable, table

#: Figures of lines approached from both sides.
_FIGURES = ("A", "E", "R", "M", "B", "B_mean", "U_A", "U_E")
#: Figures of lines approached from one side.
_ONE_SIDE = ("A_up", "E_up", "R_up", "A_down", "E_down", "R_down")
#: Title of the table of cyclic errors.
_CYCLIC = "Cyclic errors of at least three times their standard uncertainty"
#: Least amplitude of a listed cyclic error in standard uncertainties; noise alone exceeds it in 1 % of cases.
_SIGNIFICANT = 3.0
#: Order of quantities in tables and plots.
_ORDER = {"positioning": 0, "straightness": 1, "angle": 2}
#: The meaning of the figures.
_LEGEND = (
    "A accuracy, E systematic deviation, R repeatability, M mean systematic deviation, B reversal (largest, "
    "and mean with its sign: approached in + less approached in -). Five runs or more are required. "
    "Straightness is stated from its reference line."
)


def place_in_order(line: Line) -> tuple[int, int, str]:
    return line.axis, _ORDER[line.quantity], line.component


def to_text(evaluated: Evaluated) -> str:
    """Plain text of an evaluation."""
    m = evaluated.measurements
    sections = (
        list(pairs([
            ("Machine", printable(m.machine)),
            ("Lines", f"{len(evaluated.evaluations)} evaluated" + _plural(len(evaluated.sweeps), "sweep")),
        ])),
        list(_table_text(evaluated, bidirectional=True)),
        list(_table_text(evaluated, bidirectional=False)),
        list(_cyclic_text(evaluated)),
        list(_reversal_text(evaluated)),
        list(_squareness_text(evaluated)),
        list(findings_text([f.as_dict() for f in evaluated.findings])),
    )  # fmt: skip
    return "\n\n".join("\n".join(lines) for lines in sections if lines) + "\n"


def _plural(count: int, noun: str) -> str:
    return f", {count} {noun}{'s' if count != 1 else ''}" if count else ""


def _sorted(evaluations: Sequence[Evaluation]) -> list[Evaluation]:
    return sorted(evaluations, key=lambda e: place_in_order(e.line))


def _rows(evaluated: Evaluated, keys: Sequence[str], *, both: bool) -> list[list[str]]:
    """Component, its name, figures, unit."""
    rows = []
    for e in _sorted(evaluated.evaluations):
        if (len(e.sides) == 2) != both:
            continue
        unit, scale = scale_of(e.line)
        figures = e.figures() | e.uncertainties()
        label = _name(e.component)
        if len(evaluated.of(e.component)) > 1 and e.line.source:
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


def _table_text(evaluated: Evaluated, *, bidirectional: bool) -> Iterator[str]:
    keys = _FIGURES if bidirectional else _ONE_SIDE
    rows = _rows(evaluated, keys, both=bidirectional)
    if rows:
        yield "ISO 230-2" if bidirectional else "ISO 230-2, approached from one side"
        yield from table(["", "", *map(_head, keys), ""], rows, text_columns=2)


def _head(key: str) -> str:
    base, _, rest = key.partition("_")
    return base + {"": "", "up": "+", "down": "-", "mean": " mean", "A": "(A)", "E": "(E)"}[rest]


def _cyclic_text(evaluated: Evaluated) -> Iterator[str]:
    rows = _cyclic_rows(evaluated)
    if any(s.harmonics for s in evaluated.separations):
        yield _CYCLIC
        header = ["", "", "period mm", "amplitude", "+-", "phase rad"]
        yield from table(header, rows or [["none"] + [""] * 5], text_columns=2)


def _cyclic_rows(evaluated: Evaluated) -> list[list[str]]:
    """Cyclic errors above `_SIGNIFICANT` standard uncertainties."""
    rows = []
    for s in evaluated.separations:
        unit, scale = scale_of(s.line)
        for h in s.harmonics:
            if h.amplitude < _SIGNIFICANT * h.sigma_amplitude:
                continue
            rows.append([
                s.line.component, unit, f"{h.period_mm:g}", number(h.amplitude * scale),
                number(2.0 * h.sigma_amplitude * scale), number(h.phase_rad),
            ])  # fmt: skip
    return rows


def _reversal_text(evaluated: Evaluated) -> Iterator[str]:
    rows = _reversal_rows(evaluated)
    if rows:
        yield "Reversal (B of all targets, drift removed)"
        yield from table(["", "", "B", "+-", "along the axis"], rows, text_columns=2)


def _reversal_rows(evaluated: Evaluated) -> list[list[str]]:
    rows = []
    for r in sorted(evaluated.reversals, key=lambda r: place_in_order(r.line)):
        unit, scale = scale_of(r.line)
        rows.append([
            r.line.component, unit, number(r.mean * scale), number(2.0 * r.sigma * scale),
            "constant" if r.constant else f"{r.at.min() * scale:.2f} to {r.at.max() * scale:.2f}",
        ])  # fmt: skip
    return rows


def _squareness_text(evaluated: Evaluated) -> Iterator[str]:
    rows = _squareness_rows(evaluated)
    if rows:
        yield "Squareness of straightness pairs, at their position"
        yield from table(["", "urad", "+-", "angle", "lines", "square"], rows)


def _squareness_rows(evaluated: Evaluated) -> list[list[str]]:
    return [
        [
            p.reading.component, number(p.reading.value_rad / RAD_PER_URAD),
            number(2.0 * p.reading.sigma_rad / RAD_PER_URAD),
            angle_words(p.reading.component, p.reading.value_rad),
            f"{p.first.component}, {p.second.component}", printable(p.square.name),
        ]
        for p in evaluated.pairs
    ]  # fmt: skip


def plots_of(evaluated: Evaluated, kind: Format = "svg") -> dict[str, bytes]:
    """Every plot of an evaluation by its name, in the order of a report."""
    plots: dict[str, bytes] = {}
    for axis in AXES:
        own = [e for e in _sorted(evaluated.evaluations) if e.component[2] == axis]
        for e in own:
            if e.line.quantity == "positioning":
                plots[_free(f"positioning-{e.component}", plots)] = plots_calibration.positioning(e, kind)
        for quantity, draw in (
            ("straightness", plots_calibration.straightness),
            ("angle", plots_calibration.angles),
        ):
            group = [e for e in own if e.line.quantity == quantity]
            if group:
                name = "straightness" if quantity == "straightness" else "angles"
                plots[f"{name}-{axis}"] = draw(group, kind=kind)
    for pair in evaluated.pairs:
        name = _free(f"squareness-{pair.reading.component}", plots)
        plots[name] = plots_calibration.squareness(pair, kind)
    for separation in evaluated.separations:
        if separation.harmonics and separation.line.quantity == "positioning":
            plots[_free(f"cyclic-{separation.line.component}", plots)] = plots_calibration.cyclic(
                separation, kind
            )
    reversals = [r for r in evaluated.reversals if r.line.quantity == "positioning"]
    if reversals:
        plots["reversal"] = plots_calibration.reversals(reversals, kind)
    return plots


def _free(name: str, taken: Mapping[str, bytes]) -> str:
    """The name, numbered where a plot has it already."""
    k = 2
    free = name
    while free in taken:
        free, k = f"{name}-{k}", k + 1
    return free


def evaluation(
    evaluated: Evaluated, plots: Mapping[str, bytes], version: str, date: datetime.date | None
) -> Document:
    """The document of measured lines."""
    return Document(
        "Geometric accuracy of a machine",
        subtitle(evaluated, date),
        None,
        [
            Section("Measurement", [Pairs(measurement(evaluated))]),
            *sections(evaluated, plots),
            Section("Findings", list(notices(evaluated.findings))),
        ],
        footer(version),
    )


def subtitle(evaluated: Evaluated, date: datetime.date | None) -> str:
    day = date or evaluated.measurements.measured
    return ", ".join(v for v in (evaluated.measurements.machine, day.isoformat() if day else "") if v)


def footer(version: str) -> str:
    return (
        f"Written by olp {version}. error = actual minus commanded, tool relative to workpiece, "
        "right-handed, names of ISO 230-1. Uncertainties after +- are twice the standard uncertainty."
    )


def measurement(evaluated: Evaluated) -> list[tuple[str, str]]:
    m = evaluated.measurements
    lengths = [line for line in m.lines if line.quantity != "angle"]
    lines_mm = sorted({_place(line) for line in lengths})
    tool_vectors = sorted({vector_words(line.tool_mm) for line in lengths})
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
        ("Lines measured at", "; ".join(lines_mm[:6]) + ("; ..." if len(lines_mm) > 6 else "")),
        ("Tool vectors", "; ".join(tool_vectors[:6]) + ("; ..." if len(tool_vectors) > 6 else "")),
        ("Periods looked for", periods),
        ("Corrected by the control while measuring", ", ".join(sorted(m.active_during_measurement))),
        ("Instruments", ", ".join(sorted({line.instrument for line in m.lines if line.instrument}))),
    ]


def _place(line: Line) -> str:
    """The moving axis, and the position of the others."""
    others = " ".join(
        f"{a}{v:g}" for k, (a, v) in enumerate(zip(AXES, line.line_mm, strict=True)) if k != line.axis
    )
    return f"{AXES[line.axis]} at {others}"


def vector_words(values: Sequence[float]) -> str:
    return " ".join(f"{axis}{v:g}" for axis, v in zip(AXES, values, strict=True))


def sections(evaluated: Evaluated, plots: Mapping[str, bytes]) -> Iterator[Section]:
    if not evaluated.evaluations:
        return
    blocks: list[Block] = [Paragraph(_LEGEND)]
    for keys, both in ((_FIGURES, True), (_ONE_SIDE, False)):
        rows = _rows(evaluated, keys, both=both)
        if rows:
            blocks.append(Grid(["", "", *map(_head, keys), ""], rows, text_columns=2))
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
    if evaluated.pairs:
        blocks.append(Grid(["", "urad", "+-", "angle", "lines", "square"], _squareness_rows(evaluated)))
        blocks += [Plot(plots[n], _caption(n)) for n in plots if n.startswith("squareness")]
        yield Section("Squareness", blocks)
    parts: list[Block] = []
    rows = _cyclic_rows(evaluated)
    if any(s.harmonics for s in evaluated.separations):
        parts.append(Paragraph(f"{_CYCLIC}."))
    if rows:
        header = ["cyclic error", "", "period mm", "amplitude", "+-", "phase rad"]
        parts.append(Grid(header, rows, text_columns=2))
        parts += [Plot(plots[n], _caption(n)) for n in plots if n.startswith("cyclic")]
    if rows := _reversal_rows(evaluated):
        parts.append(Grid(["reversal", "", "B", "+-", "along the axis"], rows, text_columns=2))
        parts += [Plot(plots[n], _caption(n)) for n in plots if n == "reversal"]
    if parts:
        yield Section("Cyclic errors and reversal", parts)


def _axis_of(name: str) -> str:
    return name.split("-")[1][-1]


def _caption(name: str) -> str:
    kind = name.split("-")[0]
    return {
        "positioning": "Positioning: means and twice the standard deviation of both directions, readings as "
        "triangles, minus the mean of the first target; A, E and M as spans.",
        "straightness": "Straightness of both directions about one reference line.",
        "angles": "Angular errors of both directions, minus the mean of the first target.",
        "squareness": "Both lines of the pair as measured against the legs of the square, and their slopes.",
        "cyclic": "Non-cyclic and cyclic part of the mean of both directions.",
        "reversal": "Reversal at each target with twice its standard uncertainty, drift removed.",
    }[kind]


def notices(findings: Sequence[Finding]) -> Iterator[Block]:
    for finding in findings:
        rule = RULES[finding.code]
        yield Notice(rule.severity.name.lower(), rule.code, rule.title, finding.message, rule.remedy)
    if not findings:
        yield Paragraph("None.")
