"""The report of a correction of reported results, for people."""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Sequence

from olp.findings.catalogue import RULES
from olp.reports import shown
from olp.reports.document import Block, Document, Grid, Notice, Pairs, Paragraph, Section
from olp.reports.report import WIDTH, Report, findings_text, number, pairs, printable, sentences, table

#: Most rows of the table of largest errors.
_ROWS = 10
#: Head of that table.
_WORST = ("line", "point", "X", "Y", "Z", "size")


def to_text(report: Report) -> str:
    """Plain text of at most 100 columns."""
    sections = (
        list(pairs(_head(report))),
        _in_um("Error added to the points, in um", ("", "max", "rms"), _figures(report)),
        _in_um("By source, in um", ("", "max", "rms"), _sources(report)),
        _in_um("Largest, in um", _WORST, _worst(report), text_columns=2),
        list(findings_text(report["findings"])),
        list(sentences("Why", report["why"])),
        list(sentences("What it does not prove", report["does_not_prove"])),
    )
    return "\n\n".join("\n".join(line[:WIDTH] for line in lines) for lines in sections if lines) + "\n"


def _in_um(
    title: str, header: Sequence[str], rows: Sequence[Sequence[str]], text_columns: int = 1
) -> list[str]:
    return [shown.title(title), *table(header, rows, text_columns, "um")]


def to_document(report: Report, version: str, date: datetime.date | None) -> Document:
    """The same as a document."""
    notices: list[Block] = [
        Notice(f["severity"], f["code"], RULES[f["code"]].title, f["message"], RULES[f["code"]].remedy)
        for f in report["findings"]
    ]
    name = report["results"]["name"] or "results"
    return Document(
        "Correction of reported results", ", ".join(filter(None, (name, date.isoformat() if date else ""))),
        None,
        [
            Section("Results", [Pairs(_head(report))]),
            Section("Why", [Paragraph(text) for text in report["why"]]),
            Section("Error added to the points, in um", [Grid(("", "max", "rms"), _figures(report))]),
            Section("By source, in um", [Grid(("", "max", "rms"), _sources(report))]),
            Section("Largest, in um", [Grid(_WORST, _worst(report), text_columns=2)]),
            Section("Findings", notices or [Paragraph("None.")]),
            Section("What it does not prove", [Paragraph(text) for text in report["does_not_prove"]]),
        ],
        f"olp {version}",
    )  # fmt: skip


def _head(report: Report) -> list[tuple[str, str]]:
    results, machine, calibration = report["results"], report["machine"], report["calibration"]
    frames = ", ".join(printable(frame) for frame in results["frames"])
    return [
        ("Results", f"{printable(results['name']) or '<stdin>'}, {results['points']} points, "
         f"{results['dialect']}, in {frames}"),
        ("Machine", f"{printable(machine['name'])}, chain {machine['chain']}"),
        ("Calibration", f"{calibration['model']}, measured {calibration['measured']}"),
    ]  # fmt: skip


def _figures(report: Report) -> list[tuple[str, str, str]]:
    correction = report["correction"]
    rows = [("in space", number(correction["max_um"]), number(correction["rms_um"]))]
    rows += [(axis, number(most), "") for axis, most in zip("XYZ", correction["max_by_axis_um"], strict=True)]
    return [*rows, ("rounding error", number(correction["rounding_um"]), "")]


def _sources(report: Report) -> list[tuple[str, str, str]]:
    return [(s["name"], number(s["max_um"]), number(s["rms_um"])) for s in report["sources"]]


def _worst(report: Report) -> list[tuple[str, ...]]:
    return [tuple(_row(point)) for point in report["points"].largest(_ROWS)]


def _row(point: Report) -> Iterator[str]:
    yield str(point["line"])
    yield printable(point["name"])
    yield from (number(value) for value in (*point["added_um"], point["size_um"]))
