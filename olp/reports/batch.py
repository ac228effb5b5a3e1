"""The summary of a batch for people: as text, and as a document whose rows lead to the files of a program.

It shows what the report ("olp-batch-1") states. "uncorrected" and "corrected" are the largest deviations in
um that the report of each program states.
"""

from __future__ import annotations

import datetime
import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

from olp.reports.document import Block, Document, Grid, Link, Pairs, Paragraph, Section
from olp.reports.report import CORRECTED, UNCORRECTED, WIDTH, Report, number, printable, shortened, table

#: Most rows of the table on a terminal.
MAX_ROWS = 60
#: Most codes in a cell.
_MOST_CODES = 3
#: Most files that are left out, of each reason, on a terminal.
_MOST_SKIPPED = 5
#: Letters of the name of a program in a table of text.
_NAME = 44

#: Gives the path of a file of the output folder from where the document is.
Place = Callable[[str], str]


def to_text(report: Report, *, news: bool = False) -> str:
    """Plain text of at most 100 columns; long names of programs may make it wider. With `news` only programs
    that this call has dealt with have a row, and files that are left out have none."""
    rows = [row for row in report["programs"] if not (news and row["state"] == "unchanged")]
    skipped = () if news else report["skipped"]
    parts = (_table(rows), _messages(rows), _skipped(skipped), _end(report))
    return "\n\n".join("\n".join(lines) for lines in map(list, parts) if lines) + "\n"


def to_document(report: Report, version: str, place: Place) -> Document:
    """The page of a plant, the worst programs first."""
    rows, others = report["programs"], report["others"]
    sections = [Section("Result", [Pairs(_result(report))])]
    if rows:
        sections.append(Section("Programs", [_grid(rows, place)]))
    failed = [row for row in rows if row.get("message")]
    if failed:
        blocks: list[Block] = [Paragraph(f"{row['program']}: {row['message']}") for row in failed]
        sections.append(Section("Not written, and why", blocks))
    if others:
        about = "Programs of this folder that were no part of the last call, as their reports state them."
        sections.append(Section("From earlier calls", [Paragraph(about), _grid(others, place)]))
    if report["skipped"]:
        cells = [[one["file"], one["why"]] for one in report["skipped"]]
        sections.append(Section("Left out", [Grid(["file", "why"], cells, 2)]))
    date = report["date"]
    day = date.isoformat() if isinstance(date, datetime.date) else ""
    subtitle = ", ".join(text for text in (report["output"], day) if text)
    verdict = (report["exit_code"] == 0, _whole(rows))
    return Document("Corrected programs of a plant", subtitle, verdict, sections, _footer(version))


def _whole(rows: Sequence[Report]) -> str:
    """How good the programs are, in one sentence."""
    total, bad = len(rows), sum(row["exit_code"] != 0 or row["state"] == "not done" for row in rows)
    if not rows:
        return "There is no program."
    if not bad:
        return f"No program of {total} has a finding that fails it."
    return f"{bad} of {total} programs are refused, not done, or have a finding that fails them."


def _sentence(report: Report) -> str:
    """What became of the programs in this call, and how good they are."""
    counts = ", ".join(f"{count} {state}" for state, count in report["counts"].items())
    return f"{counts[:1].upper()}{counts[1:]}. {_whole(report['programs'])}" if counts else _whole(())


def _footer(version: str) -> str:
    return (
        f"Written by olp {version}. Deviations are the largest distances of the tool tip from the nominal "
        "path in um, as the report of each program states them."
    )


def _result(report: Report) -> list[tuple[str, str]]:
    # what was written in the call is no part of it: where nothing has changed, the page is the same
    counts = report["counts"]
    failed = [
        (name.capitalize(), str(counts[name])) for name in ("refused", "failed", "not done") if name in counts
    ]
    return [
        ("Programs", str(len(report["programs"]))),
        *failed,
        ("Left out", str(len(report["skipped"]))),
        *([("Time", _whole_time(report))] if report["time"] else []),
        ("Exit code", f"{report['exit_code']} (findings count from {report['fail_on']} on)"),
        ("History", report["history"]),
    ]


def _cells(row: Report) -> list[str]:
    """The cells of `_HEAD`."""
    return [
        str(row.get("moves", "-")),
        number(row.get("uncorrected_um")),
        number(row.get("corrected_um")),
        verdict_word(row),
        codes(row.get("findings") or ()),
        str(row["exit_code"]) if row["state"] != "not done" else "-",
    ]


_TIME = "time, s"
_HEAD = ("moves", UNCORRECTED, CORRECTED, "verdict", "findings", "exit")


def _timed(rows: Sequence[Report]) -> bool:
    """Whether rows have a column of times."""
    return any("time" in row for row in rows)


def _seconds(row: Report, timed: bool) -> list[str]:
    """The cell that says how long the corrected program takes; none where rows have no such column."""
    time = row.get("time", {})
    return [f"{time['corrected_s']:.2f}" if "corrected_s" in time else "-"] if timed else []


def _whole_time(report: Report) -> str:
    """How long all programs take; empty where that was not asked."""
    time = report["time"]
    if not time:
        return ""
    way = "planned" if time["optimised"] else "planned, long ones without optimised speeds"
    share = f"{100.0 * float(time['share']):+.3f} %"
    unknown = f"; {time['unknown']} not known" if time["unknown"] else ""
    return (
        f"{time['corrected_s']:.2f} s for {time['programs']} corrected programs, {time['nominal_s']:.2f} s "
        f"for the nominal ones ({share}), {way}{unknown}"
    )


def verdict_word(row: Report) -> str:
    """The verdict of a program in a word or two."""
    if row.get("message") or "ok" not in row:
        return str(row["state"])
    words = {True: "good", False: "NOT GOOD", None: "open"}
    return words[row["ok"]]


def codes(findings: Sequence[Report]) -> str:
    """The codes of errors and warnings, the errors first, and how many more there are."""
    order = {"error": 0, "warning": 1}
    shown = sorted((f for f in findings if f["severity"] in order), key=lambda f: order[f["severity"]])
    names = [f["code"] for f in shown]
    more = f" +{len(names) - _MOST_CODES}" if len(names) > _MOST_CODES else ""
    return ", ".join(names[:_MOST_CODES]) + more


def _table(rows: Sequence[Report]) -> Iterator[str]:
    if not rows:
        return
    yield "Largest deviation from the nominal path in um, the worst programs first"
    shown = rows[:MAX_ROWS]
    timed = _timed(rows)
    cells = (
        [
            shortened(printable(row["program"]), _NAME),
            *_cells(row),
            *_seconds(row, timed),
            row["state"],
        ]
        for row in shown
    )
    yield from table(["program", *_HEAD, *[_TIME] * timed, "state"], cells)
    if len(rows) > MAX_ROWS:
        yield f"  and {len(rows) - MAX_ROWS} better ones; --report and --json list all"


def _messages(rows: Iterable[Report]) -> Iterator[str]:
    failed = [row for row in rows if row.get("message")]
    if not failed:
        return
    yield f"Not written ({len(failed)})"
    for row in failed[:MAX_ROWS]:
        for line in row["message"].split("\n"):
            yield from textwrap.wrap(
                printable(line),
                WIDTH,
                initial_indent="  ",
                subsequent_indent="      ",
                break_long_words=False,
            )
        if row.get("older_output"):
            yield f"      {row['program']} in the output folder is of an earlier call; do not run it"


def _skipped(skipped: Sequence[Report]) -> Iterator[str]:
    if not skipped:
        return
    yield f"Left out ({len(skipped)})"
    by_why: dict[str, list[str]] = {}
    for one in skipped:
        by_why.setdefault(one["why"], []).append(one["file"])
    for why, files in by_why.items():
        names = ", ".join(map(printable, files[:_MOST_SKIPPED]))
        more = f" and {len(files) - _MOST_SKIPPED} more" if len(files) > _MOST_SKIPPED else ""
        yield from textwrap.wrap(
            f"{names}{more}: {printable(why)}", WIDTH, initial_indent="  ", subsequent_indent="      ",
            break_long_words=False,
        )  # fmt: skip


def _end(report: Report) -> Iterator[str]:
    if report["index"] is None:
        yield "index.html in the output folder is not of olp batch, and is left; --force overwrites it"
    if report["time"]:
        yield from textwrap.wrap(f"Time: {_whole_time(report)}.", WIDTH, subsequent_indent="  ")
    yield from textwrap.wrap(_sentence(report), WIDTH)


def _grid(rows: Sequence[Report], place: Place) -> Grid:
    """One row per program, which leads to the corrected program, its report and its review page."""
    asked = [key for key in ("report", "page", "released") if any(row.get(key) for row in rows)]
    timed = _timed(rows)
    body: list[list[str | Link]] = []
    for row in rows:
        moves, before, after, verdict, found, code = _cells(row)
        written = row["state"] in ("written", "unchanged", "not in this call") and not row.get("message")
        name: str | Link = Link(row["program"], place(row["program"])) if written else row["program"]
        more = [row.get(key) or "" if key == "released" else _link(row, key, place) for key in asked]
        figures = [moves, before, after, *_seconds(row, timed), code]
        body.append([name, str(row.get("machine", "")), verdict, *more, found, *figures])
    figures = ["moves", UNCORRECTED, CORRECTED, *[_TIME] * timed, "exit"]
    header = ["program", "machine", "verdict", *asked, "findings", *figures]
    return Grid(header, body, 4 + len(asked))


def _link(row: Report, key: str, place: Place) -> str | Link:
    name: Any = row.get(key)
    return Link(key, place(name)) if name else ""
