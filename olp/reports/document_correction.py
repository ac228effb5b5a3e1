"""The document of a correction, under the headings of ISO/TR 16907 on validation and documentation of
numerical compensation."""

from __future__ import annotations

import datetime
from collections.abc import Iterator

from olp.reports.compare import change
from olp.reports.document import Block, Document, Grid, Pairs, Paragraph, Plot, Section
from olp.reports.document_parts import (
    MOST_SOURCES,
    Plots,
    calibration_blocks,
    documentation_blocks,
    footer_of,
    machine_rows,
    notice_blocks,
    path_plot_blocks,
    subtitle_of,
    test_sections,
)
from olp.reports.report import CORRECTED, UNCORRECTED, Report, number, percent, place, time_text

#: Titles of the parts of the budget.
_PART = {
    "model_and_chords": "model and chords",
    "inversion": "inversion of the model",
    "rounding": "rounding to the last digit",
    "increment": "least increment of the control",
    "random_2_sigma": "random: repeatability, two standard deviations",
}


def correction(report: Report, plots: Plots, version: str, date: datetime.date | None) -> Document:
    """The document of a report of `correct` ("olp-report-1")."""
    program = report["program"]
    name = program.get("name") or "program"
    verdict = report["verdict"]
    sections = [
        Section("Result", list(_correction_result(report))),
        Section("Machine tool and numerical controller", [Pairs(machine_rows(report))]),
        Section("Determination of the errors", calibration_blocks(report, date)),
        Section("Compensation applied", list(_applied(report))),
        Section("Validation", list(_validation(report, plots))),
        *test_sections(report, plots),
        *_uncertainty(report, plots),
        Section("Findings and limits", list(_limits(report))),
        Section("Documentation", list(documentation_blocks(report, version, date))),
    ]
    return Document(
        "Numerical compensation of a program", subtitle_of(name, report, date),
        (verdict["ok"], " ".join(verdict["sentences"])), sections, footer_of(version),
    )  # fmt: skip


def _correction_result(report: Report) -> Iterator[Block]:
    before, after = report["deviation"]["before"], report["deviation"]["after"]
    rows = []
    for title, where in (("at waypoints", "waypoints"), ("between waypoints", "between")):
        for key, words in (("max_um", "largest"), ("rms_um", "rms")):
            a, b = before[where][key], after[where][key]
            rows.append([f"{words} deviation {title}", number(a), number(b), change(a, b)])
    yield Grid(["in um", UNCORRECTED, CORRECTED, ""], rows)


def _applied(report: Report) -> Iterator[Block]:
    moves, digits = report.get("moves") or {}, report.get("digits") or {}
    words = (("corrected", "corrected"), ("approximated", "approximated"), ("passed", "left uncorrected"))
    changes = (
        ("split", "moves split"), ("inserted_blocks", "blocks inserted"), ("changed_words", "words changed"),
        ("inserted_words", "words inserted"),
    )  # fmt: skip
    yield Pairs([
        ("Tolerance", f"{report['tolerance_um']:g} um for model and chords"),
        ("Largest correction", f"{number(report.get('largest_correction_um'))} um"),
        ("Moves", f"{moves.get('total', 0)}: {', '.join(f'{moves[k]} {w}' for k, w in words if k in moves)}"),
        ("Changes", ", ".join(f"{moves[k]} {w}" for k, w in changes if k in moves)),
        ("Time", time_text(report)),
        ("Written with", ", ".join(f"{count} decimals in {unit}" for unit, count in digits.items())),
    ])  # fmt: skip
    sources = report.get("sources") or ()
    if sources:
        yield Paragraph("Errors of the uncompensated machine on this program, by source, largest first:")
        cells = [[s["name"], number(s["max_um"]), number(s["rms_um"])] for s in sources[:MOST_SOURCES]]
        half = (len(cells) + 1) // 2
        beside = [*cells[half:], ["", "", ""]]
        header = ["source", "largest, um", "rms, um"]
        yield Grid(header * 2, [a + b for a, b in zip(cells[:half], beside, strict=False)], aside=3)


def _validation(report: Report, plots: Plots) -> Iterator[Block]:
    yield Paragraph(
        "The written program was read back from its bytes and run through the model of the machine's errors. "
        "Deviations are those of the tool tip from the nominal path, at waypoints and between them."
    )
    budget = report.get("budget_um") or {}
    yield Grid(
        ["residual, largest in um", ""],
        [[_PART.get(key, key.replace("_", " ")), number(value)] for key, value in budget.items()],
    )
    angle = report.get("orientation") or {}
    yield Paragraph(
        "Orientation of the tool, which three linear axes cannot correct: "
        f"{number(angle.get('max_urad'), 1)} urad at most, {number(angle.get('rms_urad'), 1)} rms."
    )
    yield from path_plot_blocks(plots)
    worst = report.get("worst") or ()
    if worst:
        yield Paragraph("Blocks with the largest residual deviation, in um:")
        yield Grid(
            ["line", UNCORRECTED, CORRECTED, "block"],
            [[place(w), number(w["before_um"]), number(w["after_um"]), w["text"]] for w in worst],
            code=3,
        )


def _within(within: Report | None) -> list[list[str]]:
    if not within:
        return []
    before, after = within["before"], within["after"]
    return [
        [f"whole program within {within['tolerance_um']:g} um", percent(before["program"]),
         percent(after["program"])],
        ["waypoint with the least probability", percent(before["least"]), percent(after["least"])],
    ]  # fmt: skip


def _uncertainty(report: Report, plots: Plots) -> Iterator[Section]:
    """Uncertainty in the form of the GUM: expanded uncertainties with their coverage factor."""
    part = report.get("uncertainty")
    if not part:
        return
    band, within, expected = part["band_um"], part["within"], part["expected"]
    axes = ", ".join(f"{axis} {number(value)}" for axis, value in band["by_axis_max_um"].items())
    repeat = ", ".join(number(value) for value in part["repeatability_um"])
    blocks: list[Block] = [
        Paragraph(
            "Expanded uncertainty of the position of the tip, from the covariance of the calibration "
            f"propagated to {part['waypoints']} waypoints (JCGM 100, coverage factor "
            f"k = {part['coverage_factor']:g}, about 95 % for normal errors)."
        ),
        Pairs([
            ("Band", f"median {number(band['median_um'])} um, largest {number(band['max_um'])} um in the "
             "worst direction"),
            ("Largest by axis, um", axes),
            ("From", part["source"]),
            ("Zero setting", part["zero_setting"]),
            ("Scatter of the axes, um", repeat if any(part["repeatability_um"]) else "not stated"),
            ("Growth by age", f"times {part['growth_by_age']:.3g}"),
            ("Temperatures", f"known to {part['temperature_K']:g} K" if part["temperature_K"] else
             "their uncertainty is not stated"),
            ("Not included", "; ".join(part["not_included"])),
        ]),
        Grid(
            ["", UNCORRECTED, CORRECTED],
            [
                ["rms deviation expected, um", number(expected["before_rms_um"]),
                 number(expected["after_rms_um"])],
                *_within(within),
            ],
        ),
    ]  # fmt: skip
    if within:
        blocks.append(Paragraph(
            f"The corrected program is better with a probability of "
            f"{percent(expected['probability_better'])}. Probabilities of the whole program and of lines are "
            f"from {within['draws']} draws of the calibration (seed {within['seed']})."
        ))  # fmt: skip
    if "bands" in plots:
        blocks.append(Plot(
            plots["bands"], "Expected distance from the nominal point with its band"
            + (", and the probability of being within the tolerance." if within else "."),
        ))  # fmt: skip
    if part["lines"]:
        blocks.append(Paragraph("Lines with the least probability of being within the tolerance:"))
        blocks.append(Grid(
            [
                "line", "uncorrected, um", "band, um", "within, uncorrected", "within, corrected",
                "corrected is nearer",
            ],
            [
                [place(row), number(row["before_um"]), number(row["band_um"]),
                 percent(row["within_before"]), percent(row["within_after"]), percent(row["nearer"])]
                for row in part["lines"]
            ],
        ))  # fmt: skip
    doubtful = [row for row in part["components"] if not row["sure"]]
    if doubtful:
        cells = []
        for row in doubtful:
            unit = "urad" if "value_urad" in row else "um"
            cells.append([
                row["name"], unit, number(row[f"value_{unit}"]),
                number(row[f"expanded_uncertainty_{unit}"]), percent(row["probability_helps"]),
            ])  # fmt: skip
        blocks.append(Paragraph("Components within their own uncertainty (rms over the axis):"))
        blocks.append(Grid(["component", "unit", "value", "2 sigma", "correcting helps"], cells, 2))
    yield Section("Uncertainty", blocks)


def _limits(report: Report) -> Iterator[Block]:
    yield from notice_blocks(report)
    for title, key in (("This proves", "proves"), ("It does not prove", "does_not_prove")):
        if report.get(key):
            yield Paragraph(f"{title}: {'; '.join(report[key])}.")
