"""The report of a correction on a machine with rotary joints, for people: position and orientation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from olp.reports.report import (
    CORRECTED,
    UNCORRECTED,
    findings_text,
    number,
    pairs,
    place,
    sentences,
    table,
    time_lines,
)

Report = Mapping[str, Any]

#: The columns of the worst blocks: their key, and their title.
WORST = {
    "position_um": "um",
    "orientation_urad": "urad",
    "uncorrected_um": "uncorrected um",
    "uncorrected_urad": "uncorrected urad",
}
#: The columns of a deviation: their key, and their title.
_COLUMNS = (
    ("position_max_um", "position max"),
    ("position_rms_um", "rms um"),
    ("orientation_max_urad", "orientation max"),
    ("orientation_rms_urad", "rms urad"),
)


def to_text(report: Report) -> str:
    """Plain text of at most 100 columns."""
    sections = (
        _heads(report),
        _verdict(report),
        *proof_lines(report),
        findings_text(report.get("findings") or ()),
        sentences("What this proves", report.get("proves") or ()),
        sentences("What it does not prove", report.get("does_not_prove") or ()),
    )
    return "\n\n".join("\n".join(lines) for lines in map(list, sections) if lines) + "\n"


def proof_lines(report: Report) -> tuple[Iterator[str], ...]:
    """The sections on the proof, in lines; the verdict is not among them."""
    return (
        _deviation(report),
        _uncertainty(report),
        time_lines(report),
        _corrections(report),
        _worst(report),
    )


def _heads(report: Report) -> Iterator[str]:
    program, machine = report["program"], report["machine"]
    calibration, moves = report.get("calibration") or {}, report["moves"]
    written = report.get("written") or {}
    until = calibration.get("valid_until")
    yield from pairs(
        [
            (
                "Program",
                f"{program['name'] or 'bytes'}, {program['lines']} lines, {program['moves']} moves, "
                f"{program['dialect']}",
            ),
            ("Machine", f"{machine['name']}, chain {machine['chain']}, control {machine['controller']}"),
            (
                "Calibration",
                f"measured {calibration['measured']}" + (f", valid until {until}" if until else "")
                if calibration
                else "none: the machine has no errors",
            ),
            (
                "Moves",
                f"{moves['feed']} feed, {moves['rapid']} rapid, {moves['with_tip_control']} with tool centre "
                f"point control, {moves['uncorrected']} uncorrected",
            ),
            (
                "Written",
                f"{written['changed_words']} words changed, {written['inserted_words']} inserted, "
                f"{written['inserted_blocks']} blocks inserted"
                if written
                else "",
            ),
        ]
    )


def _verdict(report: Report) -> Iterator[str]:
    yield from verdict_of(report).split("\n")


def verdict_of(report: Report) -> str:
    """What the proof says, in two lines; with a part tolerance one more on the part."""
    deviation = report["deviation"]
    within = "within" if deviation["holds"] else "NOT within"
    return (
        f"The corrected path is {within} {number(deviation['allowed_um'])} um and "
        f"{number(deviation['allowed_urad'])} urad of the nominal one\n"
        f"(tolerances {number(report['tolerance_um'])} um and {number(report['tolerance_urad'])} urad, and "
        "rounding to the last digit)." + (f"\n{report['part']['sentence']}" if "part" in report else "")
    )


def _deviation(report: Report) -> Iterator[str]:
    deviation = report["deviation"]
    rows: list[Sequence[str]] = [
        [title, *(number(deviation[key][name]) for name, _ in _COLUMNS)]
        for key, title in (("before", UNCORRECTED), ("after", CORRECTED))
    ]
    yield "Deviation of the tip in um, and of the tool in urad"
    yield from table(["path", *(title for _, title in _COLUMNS)], rows)
    left = report["orientation"]["uncorrectable_urad"]
    if left:
        yield f"Orientation that no command corrects: {number(left)} urad at most."


def _uncertainty(report: Report) -> Iterator[str]:
    if "uncertainty" in report:
        yield "Uncertainty of the poses, from the calibration"
        yield from pairs([(f"  {name}", value) for name, value in uncertainty_rows(report)])


def band_rows(part: Report) -> list[tuple[str, str]]:
    """The bands of tip and tool, in words."""
    tip, turn = part["band_um"], part["band_urad"]
    return [
        (
            "Tip",
            f"+-{number(tip['median_um'])} um median, {number(tip['max_um'])} um largest (expanded, "
            f"k = {part['coverage_factor']:g}, in the worst direction)",
        ),
        ("Tool", f"+-{number(turn['median_urad'])} urad median, {number(turn['max_urad'])} urad largest"),
    ]


def uncertainty_rows(report: Report) -> list[tuple[str, str]]:
    """What is not known of the poses, in words."""
    part = report["uncertainty"]
    expected = part["expected"]
    return [
        *band_rows(part),
        (
            "Deviation",
            f"expected {number(expected['before_rms_um'])} um rms uncorrected, "
            f"{number(expected['after_rms_um'])} um corrected",
        ),
        ("Frame", "beside one shift and turn of all poses, which the work offset takes up"),
        ("From", f"{part['source']}, at {part['waypoints']} waypoints"),
        ("Age", "" if part["growth_by_age"] == 1.0 else f"times {part['growth_by_age']:.3g}"),
        ("Misfit", f"{number(part['misfit_um'])} um in each coordinate" if part["misfit_um"] else ""),
    ]


def _corrections(report: Report) -> Iterator[str]:
    yield "Largest change of each axis"
    yield from table(["axis", "change"], axis_changes(report))


def axis_changes(report: Report) -> list[list[str]]:
    """By axis the largest change of its coordinates, with its unit."""
    words = (name.rpartition("_") for name in report["largest_correction"])
    return [
        [axis, f"{number(value)} {unit}"]
        for (axis, _, unit), value in zip(words, report["largest_correction"].values(), strict=True)
    ]


def _worst(report: Report) -> Iterator[str]:
    if not report["worst"]:
        return
    yield "Worst blocks, corrected and uncorrected"
    rows = [[place(row), *(number(row[key]) for key in WORST)] for row in report["worst"]]
    yield from table(["line", *WORST.values()], rows)
