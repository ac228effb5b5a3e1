"""What is released of a batch, and what a new calibration changes about it, as text and as a document."""

from __future__ import annotations

import datetime
import textwrap
from collections.abc import Iterator
from pathlib import Path

from olp.core.version import __version__
from olp.reports.batch import MAX_ROWS, codes
from olp.reports.document import Document, Grid, Pairs, Paragraph, Section
from olp.reports.document import in_form as document_in_form
from olp.reports.report import WIDTH, Report, number, printable, table, to_json

_HEAD = ("program", "release", "at release", "now", "tolerance", "beyond by", "verdict", "findings")
_ABOUT = (
    "Largest deviation in um of the released program, as it is: by the calibration of its release, and by "
    "the new one. The tolerance is that of the part where one is stated, else the numerical one."
)


def released(report: Report) -> str:
    """What was released, in lines of text."""
    return "\n".join(_released(report)) + "\n"


def changed(report: Report) -> str:
    """What a new calibration changes, in lines of text, the worst programs first."""
    return "\n".join(_changed(report)) + "\n"


def in_form(report: Report, name: str) -> bytes:
    """Either report as HTML, JSON or Markdown, by the ending of the file's name."""
    if Path(name).suffix.lower() == ".json":
        return to_json(report)
    made = _release_document(report) if "released" in report else _change_document(report)
    return document_in_form(made, name)


def _released(report: Report) -> Iterator[str]:
    for row in report["left_out"]:
        yield f"{printable(row['program'])}: left out; {row['why']}"
    yield from textwrap.wrap(_release_sentence(report), WIDTH)


def _release_sentence(report: Report) -> str:
    name, count, left = report["release"], len(report["released"]), len(report["left_out"])
    if not count:
        hint = f"{left} cannot be; --keep-going releases the others" if left else "there is no program"
        return f"Nothing is released as {name}: {hint}."
    more = f", {left} left out" if left else ""
    programs = f"{count} program{'' if count == 1 else 's'}{more}"
    return f"Released as {name}: {programs}; kept in {report['archive']}."


def _changed(report: Report) -> Iterator[str]:
    rows = report["programs"]
    if rows:
        yield from textwrap.wrap(_ABOUT, WIDTH)
        yield from table(_HEAD, (_cells(row) for row in rows[:MAX_ROWS]), 2)
        if len(rows) > MAX_ROWS:
            yield f"  and {len(rows) - MAX_ROWS} better ones; --report and --json list all"
    for row in rows:
        if "message" in row:
            yield from (f"  {printable(line)}" for line in row["message"].split("\n"))
    yield ""
    yield from textwrap.wrap(_change_sentence(report), WIDTH)


def _change_sentence(report: Report) -> str:
    total, outside, others = len(report["programs"]), report["outside"], len(report["other_machines"])
    machine = report["calibration"]["machine"]
    text = f"{outside} of {total} released programs of {machine} are outside tolerance with this calibration."
    if not total:
        text = f"Nothing is judged: no released program is for {machine}; give another calibration."
    return text + (f" Not judged, as they are for other machines: {others}." if others else "")


def _cells(row: Report) -> list[str]:
    return [
        printable(row["program"]),
        printable(row["release"]),
        number(row["released_um"]),
        number(row["largest_um"]),
        number(row["tolerance_um"]),
        number(row["beyond_um"]) if row["outside"] else "-",
        "refused" if "message" in row else "OUTSIDE" if row["outside"] else "inside",
        codes(row["findings"]),
    ]


def _day(report: Report) -> str:
    date = report["date"]
    return date.isoformat() if isinstance(date, datetime.date) else ""


def _footer() -> str:
    return f"Written by olp {__version__}. Deviations are those of the tool tip from the nominal path in um."


def _release_document(report: Report) -> Document:
    done = [[name] for name in report["released"]]
    left = [[row["program"], row["why"]] for row in report["left_out"]]
    sections = [Section("Result", [Pairs([("Archive", report["archive"] or "none")])])]
    sections += [Section("Released", [Grid(["program"], done)])] if done else []
    sections += [Section("Left out", [Grid(["program", "why"], left, 2)])] if left else []
    subtitle = ", ".join(text for text in (report["release"], _day(report)) if text)
    verdict = (report["exit_code"] == 0, _release_sentence(report))
    return Document("Release of corrected programs", subtitle, verdict, sections, _footer())


def _change_document(report: Report) -> Document:
    calibration = report["calibration"]
    facts = [("Machine", calibration["machine"]), ("Calibration", calibration["file"]),
             ("SHA-256", calibration["sha256"])]  # fmt: skip
    sections = [Section("New calibration", [Pairs(facts)])]
    if report["programs"]:
        grid = Grid(_HEAD, [_cells(row) for row in report["programs"]], 2)
        sections.append(Section("Released programs", [Paragraph(_ABOUT), grid]))
    failed = [row for row in report["programs"] if "message" in row]
    if failed:
        blocks = [Paragraph(f"{row['program']}: {row['message']}") for row in failed]
        sections.append(Section("Not judged, and why", blocks))
    if report["other_machines"]:
        others = [[name] for name in report["other_machines"]]
        sections.append(Section("For other machines", [Grid(["program"], others)]))
    subtitle = ", ".join(text for text in (report["output"], _day(report)) if text)
    verdict = (report["exit_code"] == 0, _change_sentence(report))
    return Document("What a new calibration changes", subtitle, verdict, sections, _footer())
