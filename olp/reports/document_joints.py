"""The document of a correction on a machine with rotary joints: position and orientation."""

from __future__ import annotations

import datetime
from collections.abc import Iterator

from olp.reports.compare import change
from olp.reports.document import Block, Document, Grid, Pairs, Paragraph, Section
from olp.reports.document_parts import (
    calibration_blocks,
    documentation_blocks,
    footer_of,
    machine_rows,
    notice_blocks,
    subtitle_of,
)
from olp.reports.joints import WORST, axis_changes, uncertainty_rows, verdict_of
from olp.reports.report import CORRECTED, UNCORRECTED, Report, number, place, time_text


def correction(report: Report, version: str, date: datetime.date | None) -> Document:
    """The document of a report of `correct` ("olp-joints-1")."""
    sections = [
        Section("Result", list(_result(report))),
        Section("Machine and numerical controller", [Pairs(machine_rows(report))]),
        Section("Determination of the errors", calibration_blocks(report, date)),
        Section("Compensation applied", list(_applied(report))),
        Section("Validation", list(_validation(report))),
        Section("Uncertainty", list(_uncertainty(report))),
        Section("Findings and limits", [*_limits(report), *notice_blocks(report)]),
        Section("Documentation", list(documentation_blocks(report, version, date))),
    ]
    kept = [s for s in sections if any(not isinstance(b, Pairs) or b.rows for b in s.blocks)]
    name = report["program"]["name"] or "program"
    return Document(
        "Numerical compensation of a program", subtitle_of(name, report, date),
        (report["verdict"]["ok"], verdict_of(report)), kept, footer_of(version),
    )  # fmt: skip


def _result(report: Report) -> Iterator[Block]:
    before, after = report["deviation"]["before"], report["deviation"]["after"]
    rows = [
        [title, number(before[key]), number(after[key]), change(before[key], after[key])]
        for key, title in (
            ("position_max_um", "largest deviation of the tip, um"),
            ("position_rms_um", "rms deviation of the tip, um"),
            ("orientation_max_urad", "largest deviation of the orientation, urad"),
            ("orientation_rms_urad", "rms deviation of the orientation, urad"),
        )
    ]
    yield Grid(["", UNCORRECTED, CORRECTED, ""], rows)


def _applied(report: Report) -> Iterator[Block]:
    moves, written = report["moves"], report.get("written") or {}
    yield Pairs([
        ("Tolerance", f"{report['tolerance_um']:g} um and {report['tolerance_urad']:g} urad"),
        ("Moves", f"{moves['feed']} feed, {moves['rapid']} rapid, {moves['uncorrected']} left uncorrected"),
        ("Tool centre point control", f"{moves['with_tip_control']} moves"),
        ("Changes", ", ".join(f"{count} {key.replace('_', ' ')}" for key, count in written.items())),
        ("Time", time_text(report)),
    ])  # fmt: skip
    yield Grid(["axis", "largest change"], axis_changes(report))


def _validation(report: Report) -> Iterator[Block]:
    left = report["orientation"]
    yield Pairs([
        ("Orientation that no command corrects", f"{number(left['uncorrectable_urad'])} urad at most"),
        ("Near a singular posture", f"{left['near_singular']} commands"),
    ])  # fmt: skip
    if report["worst"]:
        yield Paragraph("Worst blocks, corrected and uncorrected:")
        rows = [[place(row), *(number(row[key]) for key in WORST)] for row in report["worst"]]
        yield Grid(["line", *WORST.values()], rows)


def _uncertainty(report: Report) -> Iterator[Block]:
    part = report.get("uncertainty")
    if not part:
        return
    yield Pairs(uncertainty_rows(report))
    yield Paragraph(f"Not included: {'; '.join(part['not_included'])}.")
    rows = [[str(row["line"]), number(row["band_um"]), number(row["band_urad"])] for row in part["lines"]]
    yield Grid(["line", "expanded um", "expanded urad"], rows)


def _limits(report: Report) -> Iterator[Block]:
    for title, key in (("Proved:", "proves"), ("Not proved:", "does_not_prove")):
        yield Paragraph(f"{title} {'; '.join(report[key])}.")
