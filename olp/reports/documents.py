"""Documents of a correction and of a comparison, under the headings of ISO/TR 16907 on validation and
documentation of numerical compensation."""

from __future__ import annotations

import datetime
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from olp.findings.catalogue import RULES
from olp.reports.compare import change, figure, table_rows, taken_by_fit
from olp.reports.document import Block, Document, Grid, Notice, Pairs, Paragraph, Plot, Section
from olp.reports.report import Report, by_severity, number, percent

Plots = Mapping[str, bytes]
_MOST_SOURCES, _MOST_POSES = 24, 60
_PART = {
    "model_and_chords": "model and chords",
    "inversion": "inversion of the model",
    "rounding": "rounding to the last digit",
    "increment": "least increment of the control",
    "random_2_sigma": "random: repeatability, two standard deviations",
}


def correction(report: Report, plots: Plots, version: str, date: datetime.date | None) -> Document:
    """The document of a report of `correct` ("olp-report-1")."""
    program, deviation = report["program"], report["deviation"]
    name = program.get("name") or "program"
    largest, allowed = deviation["path_max_um"], deviation["allowed_um"]
    sentence = (
        f"{'Within tolerance' if deviation['holds'] else 'Above tolerance'}: after correction the path is at "
        f"most {number(largest)} um from the nominal one; {number(allowed)} um are allowed "
        f"(tolerance {report['tolerance_um']:g} um, and rounding)."
    )
    sections = [
        Section("Result", list(_correction_result(report))),
        Section("Machine tool and numerical controller", [Pairs(_machine(report))]),
        Section("Determination of the errors", _calibration(report, date)),
        Section("Compensation applied", list(_applied(report))),
        Section("Validation", list(_validation(report, plots))),
        *_tests(report, plots),
        *_uncertainty(report, plots),
        Section("Findings and limits", list(_limits(report))),
        Section("Documentation", list(_documentation(report, version, date))),
    ]
    return Document(
        "Numerical compensation of a program", _subtitle(name, report, date), (deviation["holds"], sentence),
        sections, _footer(version),
    )  # fmt: skip


def comparison(report: Report, plots: Plots, version: str, date: datetime.date | None) -> Document:
    """The document of a report of `compare` ("olp-comparison-1")."""
    verdict = None
    wrong = any(f["code"] == "OLP601" for f in report["findings"])
    if wrong:
        verdict = (False, "Measured and nominal do not belong together: no figures are stated.")
    elif "holds" in report:
        size = figure(report["after"], ("across_um", "max"))
        words = "Within tolerance" if report["holds"] else "Above tolerance"
        sentence = (
            f"{words}: the measured path is at most {number(size)} um from the nominal one; "
            f"{report['tolerance_um']:g} um are allowed."
        )
        verdict = (report["holds"], sentence)
    sections = [
        Section("Result", list(_comparison_result(report))),
        Section("Machine tool and numerical controller", [Pairs(_machine(report))]),
        Section("Determination of the errors", _calibration(report, date)),
        Section("Measurement", list(_measurement(report))),
        Section("Validation by measurement", list(_measured(report, plots))),
        *_tests(report, plots),
        Section("Findings and limits", list(_notices(report))),
        Section("Documentation", list(_documentation(report, version, date))),
    ]
    kept = [s for s in sections if any(not isinstance(b, Pairs) or b.rows for b in s.blocks)]
    name = report["nominal"].get("name") or "nominal path"
    return Document(
        "Measured path against nominal path", _subtitle(name, report, date), verdict, kept, _footer(version)
    )


def _subtitle(name: str, report: Report, date: datetime.date | None) -> str:
    machine = (report.get("machine") or {}).get("name", "")
    return ", ".join(v for v in (name, machine, date.isoformat() if date else "") if v)


def _footer(version: str) -> str:
    return (
        f"Written by olp {version}. Deviations are distances of the tool tip from the nominal path, unless "
        "said otherwise; error = actual minus commanded."
    )


def _correction_result(report: Report) -> Iterator[Block]:
    before, after = report["deviation"]["before"], report["deviation"]["after"]
    rows = []
    for title, place in (("at way-points", "waypoints"), ("between way-points", "between")):
        for key, words in (("max_um", "largest"), ("rms_um", "rms")):
            a, b = before[place][key], after[place][key]
            rows.append([f"{words} deviation {title}", number(a), number(b), change(a, b)])
    yield Grid(["in um", "before", "after", ""], rows)


def _machine(report: Report) -> list[tuple[str, str]]:
    machine = report.get("machine") or {}
    if not machine:
        return []
    return [
        ("Machine", str(machine.get("name", ""))),
        ("Axes, workpiece to tool", str(machine.get("chain", ""))),
        ("Numerical controller", str(machine.get("controller", ""))),
        ("Scope", "three linear axes, quasi-static errors; forces and dynamics are no part of it"),
    ]


def _calibration(report: Report, date: datetime.date | None) -> list[Block]:
    calibration = report.get("calibration") or {}
    if not calibration:
        return [Pairs([])]
    measured, until = calibration.get("measured"), calibration.get("valid_until")
    age = "not stated: no date was given"
    if date is not None and isinstance(measured, datetime.date):
        days = (date - measured).days
        age = f"{days} days on {date.isoformat()}"
        if isinstance(until, datetime.date):
            left = (until - date).days
            age += f", {left} days valid" if left >= 0 else f", expired {-left} days ago"
    temperature = calibration.get("temperature_degC")
    return [Pairs([
        ("Measured", _date(measured)), ("Valid until", _date(until)), ("Age", age),
        ("Model", str(calibration.get("model", ""))),
        ("Temperature", "" if temperature is None else f"{temperature:g} degC"),
        ("SHA-256", str(calibration.get("sha256", ""))),
    ])]  # fmt: skip


def _date(value: object) -> str:
    return value.isoformat() if isinstance(value, datetime.date) else str(value or "not stated")


def _applied(report: Report) -> Iterator[Block]:
    moves, digits = report.get("moves") or {}, report.get("digits") or {}
    words = (("corrected", "corrected"), ("approximated", "approximated"), ("passed", "passed uncorrected"))
    changes = (
        ("split", "moves split"), ("inserted_blocks", "blocks inserted"), ("changed_words", "words changed"),
        ("inserted_words", "words inserted"),
    )  # fmt: skip
    yield Pairs([
        ("Tolerance", f"{report['tolerance_um']:g} um for model and chords"),
        ("Largest correction", f"{number(report.get('largest_correction_um'))} um"),
        ("Moves", f"{moves.get('total', 0)}: {', '.join(f'{moves[k]} {w}' for k, w in words if k in moves)}"),
        ("Changes", ", ".join(f"{moves[k]} {w}" for k, w in changes if k in moves)),
        ("Written with", ", ".join(f"{count} decimals in {unit}" for unit, count in digits.items())),
    ])  # fmt: skip
    sources = report.get("sources") or ()
    if sources:
        yield Paragraph("Errors of the uncorrected machine on this program, by source, largest first:")
        cells = [[s["name"], number(s["max_um"]), number(s["rms_um"])] for s in sources[:_MOST_SOURCES]]
        half = (len(cells) + 1) // 2
        beside = [*cells[half:], ["", "", ""]]
        header = ["source", "largest, um", "rms, um"]
        yield Grid(header * 2, [a + b for a, b in zip(cells[:half], beside, strict=False)], aside=3)


def _validation(report: Report, plots: Plots) -> Iterator[Block]:
    yield Paragraph(
        "The written program was read back from its bytes and run through the model of the machine's errors. "
        "Deviations are those of the tool tip from the nominal path, at way-points and between them."
    )
    budget = report.get("budget_um") or {}
    yield Grid(
        ["what is left, largest in um", ""],
        [[_PART.get(key, key.replace("_", " ")), number(value)] for key, value in budget.items()],
    )
    angle = report.get("orientation") or {}
    yield Paragraph(
        "Orientation of the tool, which three linear axes cannot correct: "
        f"{number(angle.get('max_urad'), 1)} urad at most, {number(angle.get('rms_urad'), 1)} rms."
    )
    yield from _path_plots(plots)
    worst = report.get("worst") or ()
    if worst:
        yield Paragraph("Blocks that stay farthest from the nominal path, in um:")
        yield Grid(
            ["line", "before", "after", "block"],
            [[str(w["line"]), number(w["before_um"]), number(w["after_um"]), w["text"]] for w in worst],
            code=3,
        )


def _uncertainty(report: Report, plots: Plots) -> Iterator[Section]:
    """How sure it is, in the form of the GUM: expanded uncertainties with their coverage factor."""
    part = report.get("uncertainty")
    if not part:
        return
    band, within, expected = part["band_um"], part["within"], part["expected"]
    axes = ", ".join(f"{axis} {number(value)}" for axis, value in band["by_axis_max_um"].items())
    repeat = ", ".join(number(value) for value in part["repeatability_um"])
    blocks: list[Block] = [
        Paragraph(
            "Expanded uncertainty of where the tip really is, from the covariance of the calibration "
            f"propagated to {part['waypoints']} way-points (JCGM 100, coverage factor "
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
            ["", "before", "after"],
            [
                ["rms deviation expected, um", number(expected["before_rms_um"]),
                 number(expected["after_rms_um"])],
                [f"whole program within {within['tolerance_um']:g} um", percent(within["before"]["program"]),
                 percent(within["after"]["program"])],
                ["least sure way-point", percent(within["before"]["least"]),
                 percent(within["after"]["least"])],
            ],
        ),
        Paragraph(
            f"The corrected program is better with a probability of "
            f"{percent(expected['probability_better'])}. Probabilities of the whole program and of lines are "
            f"from {within['draws']} draws of the calibration (seed {within['seed']})."
        ),
    ]  # fmt: skip
    if "bands" in plots:
        blocks.append(Plot(
            plots["bands"], "Expected distance from the nominal place with its band, and the probability of "
            "being within the tolerance.",
        ))  # fmt: skip
    if part["lines"]:
        blocks.append(Paragraph("Lines that are least sure to be within it:"))
        blocks.append(Grid(
            ["line", "before, um", "band, um", "within before", "within after", "nearer after"],
            [
                [str(row["line"]), number(row["before_um"]), number(row["band_um"]),
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


def _path_plots(plots: Plots) -> Iterator[Block]:
    captions = {
        "picture": "The path in plan view, coloured by its distance from the nominal one.",
        "along": "Distance from the nominal path along it; rapids and gaps are left out.",
        "histogram": "How far points of the path are from the nominal one.",
        "components": "Deviation normal (level, to the left of travel) and binormal (up) along the path.",
    }
    yield from (Plot(plots[name], text) for name, text in captions.items() if name in plots)


def _tests(report: Report, plots: Plots) -> Iterator[Section]:
    """Circle and diagonals that can be measured next day."""
    tests = report.get("test_paths")
    if not tests:
        return
    blocks: list[Block] = [Paragraph(
        "What a ball-bar should show in the middle of the calibrated volume, before and after "
        "correction: circular deviation G in both directions and hysteresis H (ISO 230-4). A result far "
        "from it says that the calibration no longer describes the machine, or that dynamics add to it."
    )]  # fmt: skip
    if "circles" in plots:
        blocks.append(Plot(plots["circles"], "Predicted circles, counter-clockwise, deviations magnified."))
    rows = []
    for circle in tests["circles"]:
        a, b = circle["before"], circle["after"]
        cells = [number(side[key]) for key in ("G_ccw_um", "G_cw_um", "H_um") for side in (a, b)]
        rows.append([f"{circle['plane']}, radius {circle['radius_mm']:g} mm", *cells])
    header = ["in um", *(f"{k} {w}" for k in ("G ccw", "G cw", "H") for w in ("before", "after"))]
    blocks.append(Grid(header, rows))
    yield Section("Predicted circular tests, ISO 230-4", blocks, 2)
    diagonals = tests["diagonals"]
    blocks = [Paragraph(
        "What a laser along the body diagonals of the calibrated volume should show: systematic deviation of "
        "positioning E and reversal B of each diagonal, as ISO 230-6 asks."
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
    blocks.append(Grid(["in um", "E before", "E after", "B before", "B after"], [*rows, ["largest", *worst]]))
    yield Section("Predicted body diagonals, ISO 230-6", blocks, 2)


def _notices(report: Report) -> Iterator[Block]:
    found = by_severity(report.get("findings") or ())
    for f in found:
        rule = RULES[f["code"]]
        lines = f["lines"][:8]
        place = (
            f" Lines {', '.join(map(str, lines))}{' and more' if f['count'] > len(lines) else ''}."
            if lines
            else ""
        )
        message = f"{f['message'][:1].upper()}{f['message'][1:]}.{place}"
        yield Notice(f["severity"], f["code"], rule.title, message, rule.remedy)
    if not found:
        yield Paragraph("None.")


def _limits(report: Report) -> Iterator[Block]:
    yield from _notices(report)
    for title, key in (("This proves", "proves"), ("It does not prove", "does_not_prove")):
        if report.get(key):
            yield Paragraph(f"{title}: {'; '.join(report[key])}.")


def _documentation(report: Report, version: str, date: datetime.date | None) -> Iterator[Block]:
    rows = [("Software", f"olp {version}"), ("Date", _date(date))]
    for key, title in (
        ("program", "Nominal program"),
        ("nominal", "Nominal path"),
        ("corrected", "Corrected program"),
    ):
        part = report.get(key)
        if part:
            said = (part.get("name"), f"{part['lines']} lines" if "lines" in part else "")
            rows.append((title, ", ".join(str(v) for v in said if v)))
            rows.append(("SHA-256", part["sha256"]))
    for key, title in (("measured_before", "Measured before"), ("measured", "Measured")):
        for part in report.get(key) or ():
            rows.append((title, f"{part['name']}, {part['points']} points"))
            rows.append(("SHA-256", part["sha256"]))
    rows.append(("Conventions", "mm, s, rad, degC; names of errors after ISO 230-1"))
    yield Pairs(rows)


def _comparison_result(report: Report) -> Iterator[Block]:
    rows = table_rows(report)
    if not rows:
        yield Paragraph("No figures.")
    elif report.get("before"):
        cells = [[title, number(a), number(b), change(a, b)] for title, a, b in rows]
        yield Grid(["in um", "before", "after", ""], cells)
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
        ("What the fit takes", taken_by_fit(frame)),
        ("Order of points", ", ".join(dict.fromkeys(frame.get("order") or ()))),
        ("Points in no figure", f"farther than {report['reach_mm']:g} mm from their place"),
        ("Machine's errors", "added to the axis positions of the log, from the calibration" if added else ""),
    ])  # fmt: skip


def _iso(figures: Report) -> Iterator[str]:
    """The figures of ISO 9283 that there are, with their places."""
    for name in ("AT", "RT", "AP", "RP"):
        value = figures.get(f"{name}_um")
        if isinstance(value, float) and math.isfinite(value):
            line, pose = figures.get(f"{name}_line"), figures.get(f"{name}_pose")
            place = f" at line {line}" if line else f" at {pose}" if pose else ""
            yield f"{name} {number(value)} um{place}"


def _measured(report: Report, plots: Plots) -> Iterator[Block]:
    sides = ("normal_um", "binormal_um")
    rows = [
        [
            row["name"], name, str(row.get("counted", row["points"])),
            *(number((row.get("across_um") or {}).get(key)) for key in ("max", "rms")),
            *(number((row.get(side) or {}).get(key)) for side in sides for key in ("mean", "rms")),
        ]
        for name in ("before", "after")
        for row in (report.get(name) or {}).get("runs") or ()
    ]  # fmt: skip
    if rows:
        yield Grid(
            ["run, in um", "", "points", "largest", "rms", "normal mean", "rms", "binormal mean", "rms"],
            rows,
            2,
        )
    for name in ("before", "after"):
        iso = (report.get(name) or {}).get("iso_9283") or {}
        if iso:
            cycles = f"{iso['cycles']} cycle{'s' if iso['cycles'] > 1 else ''}"
            yield Paragraph(f"ISO 9283, {name}, {cycles}: {'; '.join(_iso(iso))}.")
    yield from _path_plots(plots)
    worst = report.get("worst") or (report.get("after") or {}).get("worst") or ()
    if worst:
        yield Paragraph("Lines that are farthest off after correction, in um:")
        yield Grid(["line", "largest", "block"], [
            [str(w["line"]), number(w["max_um"]), w.get("text", "")] for w in worst
        ], code=2)  # fmt: skip
    for name in ("before", "after"):
        poses: Sequence[Mapping[str, Any]] = (report.get(name) or {}).get("poses") or ()
        if poses:
            yield Paragraph(f"Poses {name}, in um:")
            yield Grid(["pose", "AP", "RP", "X", "Y", "Z"], [
                [str(p["name"]), number(p["AP_um"]), number(p["RP_um"]), *map(number, p["bias_um"])]
                for p in poses[:_MOST_POSES]
            ])  # fmt: skip
