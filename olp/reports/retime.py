"""The report of a re-timing for people."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from typing import Any

from olp.reports import shown
from olp.reports.report import (
    WIDTH,
    Report,
    findings_text,
    number,
    pairs,
    place,
    places,
    printable,
    shortened,
    table,
    wrapped,
)

#: Most rows of a table.
_ROWS = 8
#: Most characters of the name of another program.
_NAME = 50


def to_text(report: Report) -> str:
    """Plain text of at most 100 columns."""
    sections = (
        _head(report), _control(report), _controller(report), against_text(report), gains_text(report),
        study_text(report), _budget(report), _use(report), _slow(report), _lines(report),
        feeds_text(report), _notes(report),
        findings_text(report["findings"]),
    )  # fmt: skip
    return "\n\n".join("\n".join(lines) for lines in map(list, sections) if lines) + "\n"


def tubes_text(found: Report) -> str:
    """Why searches for a faster motion found none; nothing where all did."""
    vain = found["not_faster"]
    causes = ", ".join(f"{cause} ({count})" for cause, count in vain.items())
    runs = found["faster"] + sum(vain.values())
    return f"{sum(vain.values())} of {runs} runs are no faster: {causes}" if vain else ""


def _head(report: Report) -> Iterator[str]:
    solvers = "; ".join(f"{name} {seconds:.2f} s" for name, seconds in report["solvers_s"].items())
    feed, dwell = report["feed_moves"], float(report["dwell_s"])
    share = report["largest_share_of_limit"]
    kept = ", ".join(f"{name} {_percent(part, 2)}" for name, part in share.items())
    stretches, override = report["stretches"], report["feed_override"]
    yield from pairs(
        [
            ("Program", f"{printable(report['program']) or '<stdin>'}, {report['waypoints']} waypoints"),
            ("Machine", report["machine"]),
            ("Override", "" if override == 1.0 else f"{_percent(override, 0)} of the programmed feed"),
            ("Time", clock(float(report["duration_s"])) + (f", {dwell:.2f} s of it dwells" if dwell else "")),
            (
                "Feed moves",
                f"{feed['seconds']:.2f} s; {feed['seconds_at_programmed_feed']:.2f} s at the programmed "
                f"feed: {_percent(feed['achieved'], 1)} achieved"
                if feed["seconds"]
                else "",
            ),
            ("Limits", f"used at most: {kept}"),
            ("Planned by", f"{solvers}; {_percent(report['ruckig_share'], 1)} of the motion by Ruckig"),
            ("In tubes", tubes_text(report["in_tubes"])),
            (
                "Stretches",
                f"{len(stretches)}, between moves that the control makes by itself"
                if len(stretches) > 1
                else "",
            ),
        ]
    )
    if len(stretches) > 1:
        rows = [
            (str(n), f"{place(s, 'first_line')}-{place(s, 'last_line')}", f"{s['duration_s']:.2f}")
            for n, s in enumerate(stretches, 1)
        ]
        yield from _cut(table(("stretch", "lines", "seconds"), rows), len(rows))


def _control(report: Report) -> Iterator[str]:
    rows = [
        (row["what"], str(row["count"]), "not stated" if row["seconds"] is None else f"{row['seconds']:.2f}")
        for row in report["control"]
    ]
    if rows:
        yield "Asked of the control, seconds in all by [times] of the machine file"
        yield from table(("", "count", "seconds"), rows)


def _controller(report: Report) -> Iterator[str]:
    own = report.get("controller")
    if not own:
        return
    yield f"On {own['title']}: {clock(float(own['duration_s']))}, estimated by what is published of it"
    rows = [
        (f"{one['text']} ({one['name']})", f"{one['value']:.4g} {one['unit']}") for one in own["settings"]
    ]
    yield from table(("setting", ""), rows)
    log = own.get("log")
    if not log:
        return
    yield f"Learned from {printable(log['file'])}: {log['duration_s']:.3f} s of motion there"
    limits = zip("XYZ", log["velocity_mm_s"], log["acceleration_mm_s2"], strict=True)
    held = [
        (axis, f"{v:.1f}", f"{a:.0f}", "not shown" if j is None else f"{j:.0f}")
        for (axis, v, a), j in zip(limits, log["jerk_mm_s3"], strict=True)
        if axis in log["axes"]
    ]
    yield from table(("axis", "velocity mm/s", "acceleration mm/s2", "jerk mm/s3"), held)


def gains_text(report: Report) -> Iterator[str]:
    """What would gain most, in lines; none where that was not asked."""
    if "gains" not in report:
        return
    yield "What would gain most"
    for row in report["gains"]:
        unit = "um" if row["change"] == "tolerance" else "mm/min"
        yield (
            f"  line {place(row)}: {row['seconds']:.3f} s for a {row['change']} of {row['then']:.4g} "
            f"instead of {row['now']:.4g} {unit}"
        )
    if not report["gains"]:
        yield "  No line gains from four times the path tolerance, or from a quarter more feed."


def against_text(report: Report) -> Iterator[str]:
    nominal = report.get("nominal")
    if not nominal:
        return
    here, other = float(report["duration_s"]), float(nominal["duration_s"])
    change = f" ({100.0 * (here - other) / other:+.3f} %)" if other else ""
    name = shortened(printable(nominal["program"]), _NAME) or "<stdin>"
    yield f"Against {name}: {other:.3f} s there, {here:.3f} s here{change}"
    if not nominal["lines_correspond"]:
        yield "  The lines of the two programs do not correspond, so they are not compared one by one."
        return
    rows = [
        (
            place(row), f"{row['nominal_s']:.4f}", f"{row['corrected_s']:.4f}",
            f"{row['corrected_s'] - row['nominal_s']:+.4f}",
        )
        for row in nominal["differences"][:_ROWS]
    ]  # fmt: skip
    if rows:
        yield "Largest differences, by line there, in s"
        yield from table(("line", "there", "here", "change"), rows)


def study_text(report: Report) -> Iterator[str]:
    study = report.get("blend_study")
    if not study:
        return
    yield "Time and deviation by path tolerance; tolerances of the program are scaled as well"
    rows = [
        (
            f"x {row['factor']:g}", ", ".join(f"{v:g}" for v in row["tolerance_um"][:4]) or "-",
            f"{row['duration_s']:.3f}", f"{row['deviation_um']:.2f}",
        )
        for row in study
    ]  # fmt: skip
    yield from table(("", "tolerance um", "seconds", "off the path um"), rows)


def _budget(report: Report) -> Iterator[str]:
    budget = report["budget_um"]
    titles = {
        "blending": "blending: rounded corners, merged blocks",
        "chords_of_arcs": "chords in place of arcs, at most",
        "inertial": "inertial: the machine deflects under acceleration",
    }
    proof = report.get("proof")
    yield shown.title("Deviation from the programmed path, largest in um")
    rows = [(titles.get(k, k), number(v)) for k, v in budget.items() if v]
    if proof:
        axes = f"axis errors, by the proof of {shortened(printable(proof['program']), _NAME)}"
        rows.insert(0, (axes, number(proof["path_max_um"])))
        rows.append(("sum of all, at most", number(proof["at_most_um"])))
    yield from table(("", "max"), rows, unit="um")
    path = report["path"]
    stated = ", ".join(f"{v:g}" for v in path["stated_um"][:6])
    parts = [f"{stated} um from the program" if stated else ""]
    if path["default_um"] is not None:
        parts.append(f"{path['default_um']:g} um from {path['default_from']} where it names none")
    if path["exact_stop_at_start"]:
        parts.append("exact stop from the start, by the machine file")
    tolerances = "; ".join(filter(None, parts)) or "none: the program asks for the exact path everywhere"
    text = f"Path tolerance: {tolerances}"
    yield from wrapped([text], "  ", "    ")
    inertial = report.get("inertial")
    if inertial:
        allowed = inertial["allowed_um"]
        held = ", ".join(f"{v:.0f}" for v in report["limits"]["acceleration_mm_s2"])
        bound = (
            ""
            if allowed is None
            else f"; {allowed:g} um are allowed, so accelerations of X, Y, Z are limited to {held} mm/s2"
        )
        text = (
            f"Inertial deviation: {inertial['max_um']:.2f} um max in line {place(inertial)}, "
            f"{inertial['rms_um']:.2f} um rms, "
            f"{inertial['across_path_max_um']:.2f} um max across the path{bound}"
        )
        yield from wrapped([text], "  ", "    ")


def _use(report: Report) -> Iterator[str]:
    share = report["at_limit"]
    quantities = ("velocity", "acceleration", "jerk")
    rows = [(axis, *(f"{100.0 * share[f'{axis} {name}']:.1f}" for name in quantities)) for axis in "XYZ"]
    yield f"Time at a limit, %: at the programmed feed {100.0 * share['feed']:.1f}"
    yield from table(("axis", *quantities), rows)


def _slow(report: Report) -> Iterator[str]:
    slow = report["below_half_feed"]
    if not slow["places"]:
        return
    stretches = _count(slow["places"], "slow stretch", "slow stretches")
    yield (
        f"{stretches} below half of the feed, {slow['seconds']:.2f} s in all, "
        f"{slow['lost_s']:.2f} s lost there"
    )
    rows = [
        (
            place(w), *(f"{round(v, 3) + 0.0:.3f}" for v in w["position_mm"]),
            f"{60.0 * w['feed_mm_s']:.0f}", f"{60.0 * w['slowest_mm_s']:.0f}", f"{w['lost_s']:.3f}",
            w["limit"],
        )
        for w in slow["worst"][:_ROWS]
    ]  # fmt: skip
    yield from _cut(
        table(
            ("line", "axis X mm", "Y mm", "Z mm", "feed mm/min", "slowest mm/min", "lost s", "limit"), rows
        ),
        slow["places"],
    )


def _lines(report: Report) -> Iterator[str]:
    rows = []
    for row in report["longest_lines"][:_ROWS]:
        feed = row["feed_mm_s"]
        rows.append(
            (
                place(row), f"{row['seconds']:.3f}", "rapid" if feed is None else f"{60.0 * feed:.0f}",
                f"{60.0 * row['achieved_mm_s']:.0f}", row["limit"],
            )
        )  # fmt: skip
    if rows:
        yield "Lines that take longest"
        yield from table(("line", "seconds", "feed mm/min", "achieved mm/min", "limit"), rows)


def feeds_text(report: Report) -> Iterator[str]:
    written = report.get("write_feed")
    if not written:
        return
    yield from textwrap.wrap(
        f"Feeds written: {written['changed']} of {written['words']} F words changed. The program takes "
        f"{clock(written['duration_s'])} with them.",
        WIDTH,
    )
    if written["shared"]:
        took = (
            "took the least planned feed of them"
            if written["rule"] == "least"
            else "took the mean feed (same total time)"
        )
        lines = _count(written["slower_lines"], "line was", "lines were")
        yield from textwrap.wrap(
            f"{_count(written['shared'], 'F word holds', 'F words hold')} for several blocks and {took}; "
            f"{lines} planned slower than the new feed.",
            WIDTH, initial_indent="  ", subsequent_indent="  ",
        )  # fmt: skip
    if written["kept_lines"]:
        kept = ", ".join(places(written, "kept_lines")[:_ROWS])
        yield from textwrap.wrap(
            f"Kept as written, because their moves are not timed: lines {kept}",
            WIDTH, initial_indent="  ", subsequent_indent="  ",
        )  # fmt: skip


def _notes(report: Report) -> Iterator[str]:
    untimed = report["untimed"]
    if untimed["moves"]:
        lines = ", ".join(places(untimed))
        more = ", ..." if untimed["moves"] > len(untimed["lines"]) else ""
        yield from textwrap.wrap(
            f"Not timed: {_count(untimed['moves'], 'move', 'moves')} from or to unknown positions "
            f"(lines {lines}{more}): at the start without start_mm, and where the control moves by itself.",
            WIDTH,
        )


def _cut(lines: Iterator[str], count: int) -> Iterator[str]:
    """The head of a table, its first rows, and the number of the others."""
    for k, line in enumerate(lines):
        if k <= _ROWS:
            yield line
    if count > _ROWS:
        yield f"  and {count - _ROWS} more"


def clock(seconds: float) -> str:
    """Seconds, and hours, minutes and seconds where that helps."""
    whole = round(seconds, 1)
    minutes, rest = divmod(whole, 60.0)
    hours, minutes = divmod(int(minutes), 60)
    return f"{seconds:.2f} s" + (f" ({hours}:{minutes:02d}:{rest:04.1f})" if whole >= 60.0 else "")


def _count(amount: int, one: str, several: str) -> str:
    return f"{amount} {one if amount == 1 else several}"


def _percent(share: Any, digits: int) -> str:
    return f"{100.0 * float(share):.{digits}f} %"
