"""The report of a run for people (`to_text`) and for programs (`to_json`).

A report is a mapping in the form "olp-report-1" whose keys end in their units. Absent values are left out.
"""

from __future__ import annotations

import datetime
import json
import math
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from olp.findings.catalogue import RULES
from olp.reports import shown

#: Columns of a text report.
#: A cell that begins with one of these is a formula to a spreadsheet.
_FORMULA = frozenset("=+-@")
WIDTH = 100
#: Lines of the program that a finding lists by number.
MAX_LINES = 8
#: Most rows of the table of error sources.
MAX_SOURCES = 24
#: Most rows of the table of worst blocks.
MAX_WORST = 10
#: The predicted path of the tip with the nominal program.
UNCORRECTED = "uncorrected"
#: The predicted path of the tip with the corrected program.
CORRECTED = "corrected"
#: What the keys of reports mean, in words.
SIDES = {"before": UNCORRECTED, "after": CORRECTED}
#: What they mean in a comparison of runs without correction with runs of the corrected program.
MEASURED_BOTH = {name: f"measured, {side}" for name, side in SIDES.items()}
#: What the only key means in a comparison of one set of runs; its program may be uncorrected too.
MEASURED_ALONE = {"after": "measured"}

Report = Mapping[str, Any]


def measured_sides(groups: Mapping[str, Any]) -> Mapping[str, str]:
    """The meaning of the keys of measured runs, by the groups of runs "before" and "after" that there are."""
    return MEASURED_BOTH if groups.get("before") else MEASURED_ALONE


def to_json(report: Report) -> bytes:
    """UTF-8 JSON with sorted keys; numbers that are not finite become null, dates ISO 8601."""
    return (json.dumps(plain(report), indent=2, sort_keys=True, allow_nan=False) + "\n").encode()


def to_text(report: Report) -> str:
    """Plain text of at most 100 columns; its own words and tables are ASCII."""
    sections = (
        _heads(report),
        _verdict(report),
        _deviation(report),
        _budget(report),
        _moves(report),
        time_lines(report),
        _sources(report),
        _worst(report),
        uncertainty_text(report),
        findings_text(report.get("findings") or ()),
        sentences("What this proves", report.get("proves") or ()),
        sentences("What it does not prove", report.get("does_not_prove") or ()),
    )
    return "\n\n".join("\n".join(lines) for lines in map(list, sections) if lines) + "\n"


def table(
    header: Sequence[str], rows: Iterable[Sequence[str]], text_columns: int = 1, unit: str | None = None
) -> Iterator[str]:
    """Lines of a table; the first `text_columns` columns are aligned to the left, the others to the right.
    `unit` is that of its numbers, where the title states it and no head does."""
    heads, inner = shown.cells(header, rows, unit, text_columns)
    body = [heads, *inner]
    widths = [max(len(row[column]) for row in body) for column in range(len(header))]
    for row in body:
        cells = (
            cell.ljust(width) if column < text_columns else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        yield ("  " + "  ".join(cells)).rstrip()


def pairs(values: Iterable[tuple[str, str]], unit: str | None = None) -> Iterator[str]:
    """Lines of `name  value`, aligned and wrapped; empty values are left out. `unit` is that of numbers whose
    name states none."""
    kept = [
        (shown.title(name), shown.value(value, shown.unit_in(name) or unit))
        for name, value in values
        if value
    ]
    width = max((len(name) for name, _ in kept), default=0) + 2
    for name, value in kept:
        yield from textwrap.wrap(
            value, WIDTH, initial_indent=name.ljust(width), subsequent_indent=" " * width
        ) or [name]


def number(value: object, digits: int = 2) -> str:
    """A number for a table: fixed point, a dash where there is none; a nonzero number is never shown as 0."""
    if not isinstance(value, int | float) or not math.isfinite(value):
        return "-"
    text = f"{value + 0.0:.{digits}f}"
    if value and not float(text):
        return f"{'>-' if value < 0 else '<'}{10.0**-digits:.{digits}f}"
    return text


def printable(text: str) -> str:
    """Text of a program in one line, without control characters."""
    return "".join(c if c.isprintable() else " " for c in text)


def cell(text: str) -> str:
    """Text for a cell of a table, in one line, that no spreadsheet takes for a formula."""
    text = printable(text)
    return "'" + text if text.lstrip()[:1] in _FORMULA else text


def shortened(text: str, width: int) -> str:
    return text if len(text) <= width else text[: width - 2] + ".."


def plain(value: Any) -> Any:
    """A value with types of JSON only; arrays and their scalars have `tolist`."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, list | tuple | set | frozenset):
        items = sorted(value, key=str) if isinstance(value, set | frozenset) else value
        return [plain(item) for item in items]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, datetime.date):
        return value.isoformat()
    return value


def _part(report: Report, *keys: str) -> Report:
    """A nested mapping, empty where it is absent."""
    for key in keys:
        report = report.get(key) or {}
    return report


def time_text(report: Report) -> str:
    """How long both programs take, or why that is not known; empty where that was not asked."""
    time = report.get("time")
    if not time:
        return ""
    if "unknown" in time:
        return f"not known: {printable(time['unknown'])}"
    nominal, corrected = float(time["nominal_s"]), float(time["corrected_s"])
    share = f"{100.0 * float(time['share']):+.3f} %"
    way = "planned" if time["optimised"] else "planned without optimised speeds, as the program is long"
    return f"{way}: nominal program {nominal:.3f} s, corrected program {corrected:.3f} s ({share})"


def time_lines(report: Report) -> Iterator[str]:
    """How long both programs take, in lines; none where that was not asked."""
    text = time_text(report)
    if text:
        yield from textwrap.wrap(f"Time, {text}", WIDTH, subsequent_indent="  ")


def _heads(report: Report) -> Iterator[str]:
    program, machine = _part(report, "program"), _part(report, "machine")
    calibration, digits = _part(report, "calibration"), _part(report, "digits")
    yield from pairs(
        [
            (
                "Program",
                _joined(
                    program.get("name"),
                    _counted(program.get("lines"), "line"),
                    _counted(program.get("moves"), "move"),
                    program.get("dialect"),
                ),
            ),
            (
                "Machine",
                _joined(
                    machine.get("name"),
                    _prefixed("chain", machine.get("chain")),
                    _prefixed("control", machine.get("controller")),
                ),
            ),
            (
                "Calibration",
                _joined(
                    calibration.get("model"),
                    _prefixed("measured", calibration.get("measured")),
                    _prefixed("valid until", calibration.get("valid_until")),
                    _degrees(calibration.get("temperature_degC")),
                ),
            ),
            ("Written with", _joined(*(f"{count} decimals in {unit}" for unit, count in digits.items()))),
        ]
    )


def _joined(*values: object) -> str:
    return ", ".join(printable(str(value)) for value in values if value not in (None, ""))


def _counted(value: object, noun: str) -> str:
    return "" if value is None else f"{value} {noun}{'' if value == 1 else 's'}"


def _prefixed(word: str, value: object) -> str:
    return "" if value is None else f"{word} {value}"


def _degrees(value: object) -> str:
    return f"at {value:g} degC" if isinstance(value, int | float) else ""


def _verdict(report: Report) -> Iterator[str]:
    yield from wrapped(_part(report, "verdict").get("sentences") or ())


def wrapped(sentences: Iterable[str], first: str = "", further: str = "") -> Iterator[str]:
    """Lines of sentences, behind `first` in their first line and `further` in the others."""
    for sentence in sentences:
        yield from textwrap.wrap(
            shown.prose(sentence), WIDTH, initial_indent=first, subsequent_indent=further
        )


def _deviation(report: Report) -> Iterator[str]:
    deviation = _part(report, "deviation")
    sides = [side for side in ("before", "after") if deviation.get(side)]
    places = [("at waypoints", "waypoints"), ("between waypoints", "between")]
    rows = [
        [title]
        + [number(_part(deviation, side, key).get(name)) for side in sides for name in ("max_um", "rms_um")]
        for title, key in places
        if any(_part(deviation, side, key) for side in sides)
    ]
    if rows:
        yield shown.title("Deviation from the nominal path in um")
        header = ["", *(f"{SIDES[side]} {name}" for side in sides for name in ("max", "rms"))]
        yield from table(header, rows, unit="um")


def _budget(report: Report) -> Iterator[str]:
    budget = _part(report, "budget_um")
    titles = {
        "model_and_chords": "model and chords, under the tolerance",
        "rounding": "rounding to the last digit",
        "increment": "least increment of the control",
        "random_2_sigma": "random: repeatability, two standard deviations",
        "inversion": "inversion of the model",
        "lost_motion_unknown": "backlash of unknown side",
    }
    # keys of a later version are shown as they are
    others = (key for key in sorted(budget) if key not in titles and not isinstance(budget[key], Mapping))
    names = (name for name in (*titles, *others) if name in budget)
    rows = [[titles.get(name, name.replace("_", " ")), number(budget[name])] for name in names]
    if rows:
        yield shown.title("Residual after correction, largest in um")
        yield from table(["", "max"], rows, unit="um")
    angle = _part(report, "orientation")
    if angle:
        yield (
            "  Orientation of the tool, which three linear axes cannot correct: "
            f"{number(angle.get('max_urad'), 1)} urad max, {number(angle.get('rms_urad'), 1)} rms"
        )


def _moves(report: Report) -> Iterator[str]:
    moves = _part(report, "moves")
    if not moves:
        return
    of = ", ".join(
        f"{moves[key]} {title}"
        for key, title in (
            ("corrected", "corrected"),
            ("approximated", "approximated"),
            ("passed", "left uncorrected"),
        )
        if key in moves
    )
    changes = ", ".join(
        f"{moves[key]} {title}"
        for key, title in (
            ("split", "moves split"),
            ("inserted_blocks", "blocks inserted"),
            ("changed_words", "words changed"),
            ("inserted_words", "words inserted"),
        )
        if key in moves
    )
    total = f"{moves['total']} in all: " if "total" in moves else ""
    yield from pairs([("Moves", total + of), ("Changes", changes)])


def _sources(report: Report) -> Iterator[str]:
    sources = report.get("sources") or ()
    if not sources:
        return
    yield shown.title("Uncorrected error by source in um, largest first")
    rows = (
        [source.get("name", ""), number(source.get("max_um")), number(source.get("rms_um"))]
        for source in sources[:MAX_SOURCES]
    )
    yield from table(["", "max", "rms"], rows, unit="um")
    if len(sources) > MAX_SOURCES:
        yield f"  and {len(sources) - MAX_SOURCES} smaller ones"


def _worst(report: Report) -> Iterator[str]:
    blocks = report.get("worst") or ()
    if not blocks:
        return
    yield shown.title("Worst blocks in um")
    rows = (
        [place(block), number(block.get("before_um")), number(block.get("after_um"))]
        for block in blocks[:MAX_WORST]
    )
    lines = list(table(["line", UNCORRECTED, CORRECTED], rows, text_columns=0, unit="um"))
    room = WIDTH - max(map(len, lines)) - 2
    yield lines[0] + "  text"
    for line, block in zip(lines[1:], blocks, strict=False):
        yield f"{line}  {shortened(printable(str(block.get('text', ''))), room)}".rstrip()


def percent(value: object) -> str:
    """A probability for a table: 100 % and 0 % only where they are exact."""
    if not isinstance(value, int | float) or not math.isfinite(value):
        return "-"
    text = f"{100.0 * value:.1f}"
    return (
        f"{'>99.9' if text == '100.0' and value < 1.0 else '<0.1' if text == '0.0' and value > 0 else text} %"
    )


def uncertainty_text(report: Report) -> Iterator[str]:
    """Uncertainty of the corrected path, where the calibration states uncertainties."""
    part = _part(report, "uncertainty")
    if not part:
        return
    band, expected = part["band_um"], part["expected"]
    better = expected["probability_better"]
    yield f"Uncertainty of the tip at {part['waypoints']} waypoints, from the calibration"
    yield from pairs(
        [
            (
                "  Band",
                f"+-{number(band['median_um'])} um median, {number(band['max_um'])} um largest "
                f"(expanded, k = {part['coverage_factor']:g}, in the worst direction)",
            ),
            (
                "  Deviation",
                f"expected {number(expected['before_rms_um'])} um rms uncorrected, "
                f"{number(expected['after_rms_um'])} um corrected"
                + ("" if better is None else f"; better with probability {percent(better)}"),
            ),
            *_within(part["within"]),
            ("  From", str(part["source"])),
            ("  Zero", str(part["zero_setting"])),
            ("  Age", "" if part["growth_by_age"] == 1.0 else f"times {part['growth_by_age']:.3g}"),
        ]
    )


def _within(within: Report | None) -> list[tuple[str, str]]:
    if not within:
        return []
    before, after = within["before"], within["after"]
    words = (
        f"all of the program with probability {percent(before['program'])} uncorrected, "
        f"{percent(after['program'])} corrected; the worst waypoint "
        f"{percent(before['least'])} uncorrected, {percent(after['least'])} corrected"
    )
    return [(f"  Within {within['tolerance_um']:g} um", words)]


def findings_text(findings: Sequence[Report]) -> Iterator[str]:
    """Lines on findings in the form of `Finding.as_dict`, the most severe first."""
    if not findings:
        return
    yield f"Findings ({len(findings)}), explained by olp explain CODE"
    for finding in by_severity(findings):
        code = str(finding.get("code", ""))
        title = RULES[code].title if code in RULES else ""
        yield f"  {code}  {finding.get('severity', '')}: {title}{_place(finding)}"
        message = printable(str(finding.get("message", "")))
        yield from textwrap.wrap(message, WIDTH, initial_indent=" " * 10, subsequent_indent=" " * 10)


def by_severity(findings: Iterable[Report]) -> list[Report]:
    """Findings in the form of `Finding.as_dict`, the most severe first."""
    order = {"error": 0, "warning": 1, "info": 2}
    return sorted(findings, key=lambda f: order.get(str(f.get("severity")), 3))


def place(row: Report, key: str = "line") -> str:
    """The line of a row, with its file where that is not the program's."""
    file = row.get(f"{key.removesuffix('line')}file")
    return f"{row[key]} of {printable(str(file))}" if file else str(row.get(key, ""))


def places(row: Report, key: str = "lines") -> list[str]:
    """The lines that a finding or another row lists, as `place` gives them."""
    lines = list(row.get(key) or ())
    if not lines and row.get("line") is not None:
        return [place(row)]
    files = row.get(f"{key.removesuffix('lines')}files") or [""] * len(lines)
    return [place({"line": line, "file": file}) for line, file in zip(lines, files, strict=True)]


def _place(finding: Report) -> str:
    lines = places(finding)
    count = finding.get("count", 1)
    shown = ", ".join(lines[:MAX_LINES])
    more = ", ..." if len(lines) > MAX_LINES or count > len(lines) > 0 else ""
    place = f", line{'s' if len(lines) > 1 else ''} {shown}{more}" if lines else ""
    return place + (f" ({count} in all)" if count > 1 else "")


def sentences(title: str, sentences: Sequence[str]) -> Iterator[str]:
    if sentences:
        yield title
        yield from wrapped(sentences, "  - ", "    ")
