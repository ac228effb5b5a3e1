"""Sections that documents of a correction and of a comparison share."""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Mapping

from olp.findings.catalogue import RULES
from olp.reports.document import Block, Grid, Notice, Pairs, Paragraph, Plot, Section
from olp.reports.report import CORRECTED, UNCORRECTED, Report, by_severity, number, places

Plots = Mapping[str, bytes]
#: Most rows of the table of error sources.
MOST_SOURCES = 24
#: Most rows of a table of poses.
MOST_POSES = 60


def subtitle_of(name: str, report: Report, date: datetime.date | None) -> str:
    """The subject of a document, and its day."""
    machine = (report.get("machine") or {}).get("name", "")
    return ", ".join(v for v in (name, machine, date.isoformat() if date else "") if v)


def footer_of(version: str) -> str:
    """The last line of a document."""
    return (
        f"Written by olp {version}. Deviations are distances of the tool tip from the nominal path, unless "
        "stated otherwise; error = actual minus commanded."
    )


def machine_rows(report: Report) -> list[tuple[str, str]]:
    """Machine and control."""
    machine = report.get("machine") or {}
    if not machine:
        return []
    return [
        ("Machine", str(machine.get("name", ""))),
        ("Axes, workpiece to tool", str(machine.get("chain", ""))),
        ("Numerical controller", str(machine.get("controller", ""))),
        ("Scope", f"{_scope(machine)}, quasi-static errors; without forces and dynamics"),
    ]


def _scope(machine: Mapping[str, object]) -> str:
    """The axes of a machine: chains of any joints are written with blanks."""
    any_joints = " " in str(machine.get("chain", ""))
    return "joints of any kind, position and orientation" if any_joints else "three linear axes"


def calibration_blocks(report: Report, date: datetime.date | None) -> list[Block]:
    """The determination of the errors."""
    calibration = report.get("calibration") or {}
    if not calibration:
        return [Pairs([])]
    measured, until = calibration.get("measured"), calibration.get("valid_until")
    age = "not stated: no date was given"
    if date is not None and isinstance(measured, datetime.date):
        days = (date - measured).days
        age = f"{days} days on {date.isoformat()}"
        if isinstance(until, datetime.date):
            remaining = (until - date).days
            age += f", {remaining} days valid" if remaining >= 0 else f", expired {-remaining} days ago"
    temperature = calibration.get("temperature_degC")
    return [Pairs([
        ("Measured", date_text(measured)), ("Valid until", date_text(until)), ("Age", age),
        ("Model", str(calibration.get("model", "rigid bodies"))),
        ("Temperature", "" if temperature is None else f"{temperature:g} degC"),
        ("SHA-256", str(calibration.get("sha256", ""))),
    ])]  # fmt: skip


def date_text(value: object) -> str:
    """A day, or "not stated"."""
    return value.isoformat() if isinstance(value, datetime.date) else str(value or "not stated")


def path_plot_blocks(plots: Plots) -> Iterator[Block]:
    """The plots along the path that there are."""
    captions = {
        "picture": "The path in plan view; each place has the colour of its largest distance from the "
        "nominal path.",
        "along": "Distance from the nominal path along it; rapids and gaps are left out.",
        "histogram": "Distances of points of the path from the nominal one.",
        "components": "Deviation normal (level, to the left of travel) and binormal (up) along the path.",
    }
    yield from (Plot(plots[name], text) for name, text in captions.items() if name in plots)


def test_sections(report: Report, plots: Plots) -> Iterator[Section]:
    """Predicted acceptance tests: circles and diagonals that can be measured."""
    tests = report.get("test_paths")
    if not tests:
        return
    blocks: list[Block] = [Paragraph(
        "Predicted ball-bar results in the middle of the calibrated volume, uncorrected and corrected: "
        "circular deviation G in both directions and hysteresis H (ISO 230-4). A result far from them means "
        "that the calibration no longer describes the machine, or that dynamics add to it."
    )]  # fmt: skip
    if "circles" in plots:
        blocks.append(Plot(plots["circles"], "Predicted circles, counter-clockwise, deviations magnified."))
    rows = []
    for circle in tests["circles"]:
        a, b = circle["before"], circle["after"]
        cells = [number(side[key]) for key in ("G_ccw_um", "G_cw_um", "H_um") for side in (a, b)]
        rows.append([f"{circle['plane']}, radius {circle['radius_mm']:g} mm", *cells])
    header = ["in um", *(f"{k} {w}" for k in ("G ccw", "G cw", "H") for w in (UNCORRECTED, CORRECTED))]
    blocks.append(Grid(header, rows))
    yield Section("Predicted circular tests, ISO 230-4", blocks, 2)
    diagonals = tests["diagonals"]
    blocks = [Paragraph(
        "Predicted laser results along the body diagonals of the calibrated volume: systematic deviation of "
        "positioning E and reversal B of each diagonal (ISO 230-6)."
    )]  # fmt: skip
    if "diagonals" in plots:
        blocks.append(
            Plot(plots["diagonals"], "Predicted deviation of positioning along the body diagonals.")
        )
    rows = [
        [
            f"{row['name']}, {row['length_mm']:.0f} mm",
            *(number(row[side][key]) for key in ("E_um", "B_um") for side in ("before", "after")),
        ]
        for row in diagonals["rows"]
    ]
    worst = [number(diagonals[side][key]) for key in ("E_um", "B_um") for side in ("before", "after")]
    header = ["in um", *(f"{k} {w}" for k in "EB" for w in (UNCORRECTED, CORRECTED))]
    blocks.append(Grid(header, [*rows, ["largest", *worst]]))
    yield Section("Predicted body diagonals, ISO 230-6", blocks, 2)


def notice_blocks(report: Report) -> Iterator[Block]:
    """Findings, the worst first."""
    findings = by_severity(report.get("findings") or ())
    for f in findings:
        rule = RULES[f["code"]]
        lines = places(f)[:8] if f["lines"] else []
        place = f" Lines {', '.join(lines)}{' and more' if f['count'] > len(lines) else ''}." if lines else ""
        message = f"{f['message'][:1].upper()}{f['message'][1:]}.{place}"
        yield Notice(f["severity"], f["code"], rule.title, message, rule.remedy)
    if not findings:
        yield Paragraph("None.")


def documentation_blocks(report: Report, version: str, date: datetime.date | None) -> Iterator[Block]:
    """Digests and versions of the inputs of the document."""
    rows = [("Software", f"olp {version}"), ("Date", date_text(date))]
    for key, title in (
        ("program", "Nominal program"),
        ("nominal", "Nominal path"),
        ("corrected", "Corrected program"),
    ):
        part = report.get(key)
        if part:
            words = (part.get("name"), f"{part['lines']} lines" if "lines" in part else "")
            rows.append((title, ", ".join(str(v) for v in words if v)))
            rows.append(("SHA-256", part["sha256"]))
    for key, title in (("measured_before", "Measured, uncorrected"), ("measured", "Measured")):
        for part in report.get(key) or ():
            rows.append((title, f"{part['name']}, {part['points']} points"))
            rows.append(("SHA-256", part["sha256"]))
    rows.append(("Conventions", "mm, s, rad, degC; names of errors after ISO 230-1"))
    yield Pairs(rows)
