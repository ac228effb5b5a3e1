"""The report of a comparison for people: measured runs, frame, ISO 9283 figures, worst lines."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from olp.reports import shown
from olp.reports.joints import band_rows
from olp.reports.report import (
    MEASURED_BOTH,
    Report,
    findings_text,
    measured_sides,
    number,
    pairs,
    place,
    printable,
    shortened,
    table,
    wrapped,
)

#: Titles of figures across the path of a group of runs, with their keys in the report.
ACROSS = (
    ("largest distance from the path", ("across_um", "max")),
    ("95 % of points within", ("across_um", "q95")),
    ("rms distance", ("across_um", "rms")),
    ("mean distance", ("across_um", "mean")),
)
#: Titles of figures of ISO 9283, with their keys in the report.
ISO = (
    ("path accuracy AT", ("iso_9283", "AT_um")),
    ("path repeatability RT", ("iso_9283", "RT_um")),
    ("pose accuracy AP", ("iso_9283", "AP_um")),
    ("pose repeatability RP", ("iso_9283", "RP_um")),
)
#: Heads of figures of orientations.
TURN_FIGURES = ("AP X", "AP Y", "AP Z", "RP X", "RP Y", "RP Z")
#: Most rows of a table of poses.
_MAX_ROWS = 20


def to_text(report: Report) -> str:
    """Plain text of at most 100 columns."""
    sections = (
        _heads(report),
        _frame(report),
        _verdict(report),
        _uncertainty(report),
        _before_after(report),
        _runs(report),
        _poses(report),
        _worst(report),
        findings_text(report.get("findings") or ()),
    )
    return "\n\n".join("\n".join(lines) for lines in map(list, sections) if lines) + "\n"


def figure(group: Report | None, keys: tuple[str, str]) -> Any:
    """A figure of a group of runs, None where it has none."""
    return ((group or {}).get(keys[0]) or {}).get(keys[1])


def change(before: Any, after: Any) -> str:
    """The change of a figure, such as "12.3 x smaller"; empty where it is not defined."""
    if not isinstance(before, float) or not isinstance(after, float) or not before > 0 or not after > 0:
        return ""
    return f"{before / after:.1f} x smaller" if before >= after else f"{after / before:.1f} x larger"


def absorbed_by_fit(frame: Report) -> str:
    """The part of an error that is absorbed by the best fit, where that is known."""
    if "error_rms_um" not in frame:
        return ""
    before, after = number(frame["error_rms_um"]), number(frame["left_by_fit_rms_um"])
    return f"of {before} um rms {frame['error_is']}, {after} um remain after such a fit"


def table_rows(report: Report) -> list[tuple[str, Any, Any]]:
    """Title, figure of the runs without correction (None where there are none) and of the others in um."""
    rows = [
        (title, figure(report.get("before"), keys), figure(report.get("after"), keys))
        for title, keys in (*ACROSS, *ISO)
    ]
    return [row for row in rows if any(isinstance(v, float) and math.isfinite(v) for v in row[1:])]


def _heads(report: Report) -> Iterator[str]:
    sides = measured_sides(report)
    nominal, machine, path = (report.get(key) or {} for key in ("nominal", "machine", "path"))

    def files(rows: Any) -> str:
        return ", ".join(f"{printable(row['name'])} ({row['points']} points)" for row in rows or ())

    length = f", {path['cutting_mm'] / 1e3:.3f} m cutting, {path['compared_in']}" if path else ""
    yield from pairs([
        ("Nominal", f"{printable(nominal.get('name', ''))}{length}"),
        (sides["after"].capitalize(), files(report.get("measured"))),
        (MEASURED_BOTH["before"].capitalize(), files(report.get("measured_before"))),
        ("Machine", ", ".join(str(v) for v in machine.values())),
    ])  # fmt: skip


def _frame(report: Report) -> Iterator[str]:
    frame = report.get("frame") or {}
    if not frame.get("fitted"):
        return
    x, y, z = frame["shift_mm"]
    a, b, c = frame["angles_deg"]
    yield "Best-fit frame, measured to nominal"
    yield shown.prose(f"  shift {x:.4f}, {y:.4f}, {z:.4f} mm; turn A, B, C in deg {a:.6f}, {b:.6f}, {c:.6f}")
    if absorbed := absorbed_by_fit(frame):
        yield from wrapped([absorbed], "  ", "  ")


def _verdict(report: Report) -> Iterator[str]:
    yield from wrapped((report.get("verdict") or {}).get("sentences") or ())


def _uncertainty(report: Report) -> Iterator[str]:
    if "uncertainty" in report:
        yield shown.title("Uncertainty of the calibration there, beside one shift and turn of all poses")
        yield from pairs([(f"  {name}", value) for name, value in uncertainty_rows(report)])


def uncertainty_rows(report: Report) -> list[tuple[str, str]]:
    """How well the calibration knows the poses that are compared, in words."""
    part = report["uncertainty"]
    share = part.get("measured_within")
    within = "" if share is None else f"{100.0 * share:.0f} % of the measured points that count"
    return [*band_rows(part), ("Within it", within), ("From", part["source"])]


def _before_after(report: Report) -> Iterator[str]:
    rows = table_rows(report)
    if not rows:
        return
    if report.get("before"):
        yield shown.title("Uncorrected and corrected, in um")
        cells = [[title, number(a), number(b), change(a, b)] for title, a, b in rows]
        yield from table(["", *MEASURED_BOTH.values(), ""], cells, unit="um")
    else:
        yield shown.title("Measured, in um")
        yield from table(["", ""], [[title, number(b)] for title, _, b in rows], unit="um")


def _runs(report: Report) -> Iterator[str]:
    sides = measured_sides(report)
    rows = [
        [
            printable(row["name"]), sides[name], str(row.get("counted", row["points"])),
            *(number((row.get("across_um") or {}).get(key)) for key in ("max", "rms")),
            *(number((row.get(f"{side}_um") or {}).get("mean")) for side in ("normal", "binormal")),
            *(number((row.get(f"{side}_um") or {}).get("rms")) for side in ("normal", "binormal")),
        ]
        for name in sides
        for row in (report.get(name) or {}).get("runs") or ()
    ]  # fmt: skip
    if rows:
        yield shown.title(
            "Runs, in um; normal is level and to the left of travel, binormal points up from it"
        )
        header = ["", "", "points", "max", "rms", "normal", "binormal", "n rms", "b rms"]
        yield from table(header, rows, text_columns=2, unit="um")


def _poses(report: Report) -> Iterator[str]:
    for name, side in measured_sides(report).items():
        poses = (report.get(name) or {}).get("poses") or ()
        if not poses:
            continue
        yield shown.title(f"Poses, {side}, in um")
        rows = [
            [printable(str(p["name"])), number(p["AP_um"]), number(p["RP_um"]), *map(number, p["bias_um"])]
            for p in poses[:_MAX_ROWS]
        ]
        yield from table(["", "AP", "RP", "X", "Y", "Z"], rows, unit="um")
        if len(poses) > _MAX_ROWS:
            yield f"  and {len(poses) - _MAX_ROWS} more"
        if "AP_turn_urad" in poses[0]:
            yield ""
            yield shown.title(f"Orientation, {side}, about X, Y, Z in urad")
            largest = ("largest", (report.get(name) or {})["iso_9283"])
            each = [largest, *((str(p["name"]), p) for p in poses[:_MAX_ROWS])]
            rows = [
                [printable(title), *map(number, (*p["AP_turn_urad"], *p["RP_turn_urad"]))]
                for title, p in each
            ]
            yield from table(["", *TURN_FIGURES], rows, unit="urad")


def _worst(report: Report) -> Iterator[str]:
    worst = (report.get("after") or {}).get("worst") or ()
    if not worst:
        return
    texts = {place(row): printable(row["text"]) for row in report.get("worst") or ()}
    yield shown.title("Lines with the largest deviation, in um")
    rows = [
        [place(row), number(row["max_um"]), shortened(texts.get(place(row), ""), 60)] for row in worst[:5]
    ]
    cells = [[a, b, ""] for a, b, _ in rows]
    for line in table(["line", "max", ""], cells, text_columns=0, unit="um"):
        yield f"{line}  {rows.pop(0)[2]}".rstrip() if line.split()[0] != "line" else line
