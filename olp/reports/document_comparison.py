"""The document of a comparison, under the headings of ISO/TR 16907."""

from __future__ import annotations

import datetime
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from olp.reports.compare import TURN_FIGURES, absorbed_by_fit, change, table_rows, uncertainty_rows
from olp.reports.document import Block, Document, Grid, Pairs, Paragraph, Section
from olp.reports.document_parts import (
    MOST_POSES,
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
from olp.reports.report import MEASURED_BOTH, Report, measured_sides, number, place


def comparison(report: Report, plots: Plots, version: str, date: datetime.date | None) -> Document:
    """The document of a report of `compare` ("olp-comparison-1")."""
    verdict: tuple[bool | None, str] | None = None
    wrong = any(f["code"] == "OLP601" for f in report["findings"])
    if wrong:
        verdict = (False, "Measured and nominal path do not match: no figures are given.")
    elif report.get("verdict"):
        verdict = (report["verdict"]["ok"], " ".join(report["verdict"]["sentences"]))
    sections = [
        Section("Result", list(_comparison_result(report))),
        Section("Machine tool and numerical controller", [Pairs(machine_rows(report))]),
        Section("Determination of the errors", calibration_blocks(report, date)),
        Section("Measurement", list(_measurement(report))),
        Section("Validation by measurement", list(_measured(report, plots))),
        *test_sections(report, plots),
        Section("Uncertainty", list(_uncertainty(report))),
        Section("Findings and limits", list(notice_blocks(report))),
        Section("Documentation", list(documentation_blocks(report, version, date))),
    ]
    kept = [s for s in sections if any(not isinstance(b, Pairs) or b.rows for b in s.blocks)]
    name = report["nominal"].get("name") or "nominal path"
    return Document(
        "Measured path against nominal path",
        subtitle_of(name, report, date),
        verdict,
        kept,
        footer_of(version),
    )


def _uncertainty(report: Report) -> Iterator[Block]:
    if "uncertainty" in report:
        yield Paragraph("How well the calibration knows these poses, beside one shift and turn of all:")
        yield Pairs(uncertainty_rows(report))
        yield Paragraph(f"Not included: {'; '.join(report['uncertainty']['not_included'])}.")


def _comparison_result(report: Report) -> Iterator[Block]:
    rows = table_rows(report)
    if not rows:
        yield Paragraph("No figures.")
    elif report.get("before"):
        cells = [[title, number(a), number(b), change(a, b)] for title, a, b in rows]
        yield Grid(["in um", *MEASURED_BOTH.values(), ""], cells)
    else:
        yield Grid(["in um", "measured"], [[title, number(b)] for title, _, b in rows])


def _measurement(report: Report) -> Iterator[Block]:
    path, frame = report.get("path") or {}, report.get("frame") or {}
    how = "as stated in the files"
    if frame.get("fitted"):
        x, y, z = frame["shift_mm"]
        a, b, c = frame["angles_deg"]
        how = f"best fit: shift {x:.4f}, {y:.4f}, {z:.4f} mm; turn A {a:.6f}, B {b:.6f}, C {c:.6f} deg"
    added = path.get("machine_errors_added")
    compared = ""
    if path:
        compared = f"{path['cutting_mm'] / 1e3:.3f} m of cutting moves, in {path['compared_in']}"
    yield Pairs([
        ("Compared", compared),
        ("Frame", how),
        ("Absorbed by the fit", absorbed_by_fit(frame)),
        ("Order of points", ", ".join(dict.fromkeys(frame.get("order") or ()))),
        ("Points in no figure", f"farther than {report['reach_mm']:g} mm from the path"),
        ("Machine's errors", "added to the axis positions of the log, from the calibration" if added else ""),
    ])  # fmt: skip


def _iso(figures: Report) -> Iterator[str]:
    """The figures of ISO 9283 that there are, with their line or pose."""
    for name in ("AT", "RT", "AP", "RP"):
        value = figures.get(f"{name}_um")
        if isinstance(value, float) and math.isfinite(value):
            line, pose = figures.get(f"{name}_line"), figures.get(f"{name}_pose")
            at_pose = f" at {pose}" if pose else ""
            yield f"{name} {number(value)} um" + (
                f" at line {place(figures, f'{name}_line')}" if line else at_pose
            )


def _measured(report: Report, plots: Plots) -> Iterator[Block]:
    sides = measured_sides(report)
    rows = [
        [
            row["name"], sides[name], str(row.get("counted", row["points"])),
            *(number((row.get("across_um") or {}).get(key)) for key in ("max", "rms")),
            *(number((row.get("normal_um") or {}).get(key)) for key in ("mean", "rms")),
            *(number((row.get("binormal_um") or {}).get(key)) for key in ("mean", "rms")),
        ]
        for name in sides
        for row in (report.get(name) or {}).get("runs") or ()
    ]  # fmt: skip
    if rows:
        yield Grid(
            ["run, in um", "", "points", "largest", "rms", "normal mean", "rms", "binormal mean", "rms"],
            rows,
            2,
        )
    for name, side in sides.items():
        iso = (report.get(name) or {}).get("iso_9283") or {}
        if iso:
            cycles = f"{iso['cycles']} cycle{'s' if iso['cycles'] > 1 else ''}"
            yield Paragraph(f"ISO 9283, {side}, {cycles}: {'; '.join(_iso(iso))}.")
    yield from path_plot_blocks(plots)
    worst = report.get("worst") or (report.get("after") or {}).get("worst") or ()
    if worst:
        yield Paragraph(f"Lines with the largest deviation, {sides['after']}, in um:")
        yield Grid(["line", "largest", "block"], [
            [place(w), number(w["max_um"]), w.get("text", "")] for w in worst
        ], code=2)  # fmt: skip
    for name, side in sides.items():
        poses: Sequence[Mapping[str, Any]] = (report.get(name) or {}).get("poses") or ()
        if poses:
            yield Paragraph(f"Poses, {side}, in um:")
            yield Grid(["pose", "AP", "RP", "X", "Y", "Z"], [
                [str(p["name"]), number(p["AP_um"]), number(p["RP_um"]), *map(number, p["bias_um"])]
                for p in poses[:MOST_POSES]
            ])  # fmt: skip
        if poses and "AP_turn_urad" in poses[0]:
            yield Paragraph(f"Orientation, {side}, about X, Y and Z, in urad:")
            yield Grid(["pose", *TURN_FIGURES], [
                [str(p["name"]), *map(number, (*p["AP_turn_urad"], *p["RP_turn_urad"]))]
                for p in poses[:MOST_POSES]
            ])  # fmt: skip
