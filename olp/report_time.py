"""The report of a re-timing for people."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from olp.report import Report, table


def to_text(report: Report) -> str:
    """Plain text of at most 100 columns."""
    sections = (_head(report), _use(report), _slow(report), _longest(report))
    return "\n\n".join("\n".join(lines) for lines in map(list, sections) if lines) + "\n"


def _head(report: Report) -> Iterator[str]:
    seconds = float(report["duration_s"])
    yield f"Program   {report['program'] or '<stdin>'}, {report['waypoints']} way-points"
    yield f"Machine   {report['machine']}"
    yield f"Time      {_clock(seconds)}"
    nominal = report.get("nominal")
    if nominal:
        other = float(nominal["duration_s"])
        change = 100.0 * (seconds - other) / other if other else 0.0
        yield f"          {_clock(other)} for {nominal['program']}, so {change:+.2f} %"
    yield f"Path      at most {report['path_deviation_um']:.2f} um from the program's own"
    solvers: dict[str, float] = {}
    for stretch in report["stretches"]:
        for name, time in stretch["solvers_s"].items():
            solvers[name] = solvers.get(name, 0.0) + time
    yield "Planned   " + "; ".join(f"{name} {time:.2f} s" for name, time in solvers.items())
    if len(report["stretches"]) > 1:
        count = len(report["stretches"])
        yield f"          in {count} stretches, between moves that the control makes by itself"


def _use(report: Report) -> Iterator[str]:
    share: dict[str, float] = {}
    for stretch in report["stretches"]:
        for name, part in stretch["at_limit"].items():
            share[name] = share.get(name, 0.0) + part * stretch["duration_s"]
    whole = max(float(report["duration_s"]), 1e-12)
    rows = [
        (
            axis,
            *(
                f"{100.0 * share[f'{axis} {name}'] / whole:.1f}"
                for name in ("velocity", "acceleration", "jerk")
            ),
        )
        for axis in "XYZ"
        if share
    ]
    if rows:
        yield "Time at a limit of the axis, %"
        yield from table(("", "velocity", "acceleration", "jerk"), rows)


def _slow(report: Report) -> Iterator[str]:
    lines = sum(s["below_half_feed"]["lines"] for s in report["stretches"])
    if not lines:
        return
    seconds = sum(s["below_half_feed"]["seconds"] for s in report["stretches"])
    yield f"{lines} lines run below half of their feed, for {seconds:.2f} s in all"
    worst: list[dict[str, Any]] = [w for s in report["stretches"] for w in s["below_half_feed"]["worst"]]
    worst.sort(key=lambda w: -w["seconds"])
    rows = [(str(w["line"]), f"{w['seconds']:.3f}", f"{100.0 * w['achieved']:.0f}") for w in worst[:8]]
    yield from table(("line", "seconds", "% of feed"), rows)


def _longest(report: Report) -> Iterator[str]:
    longest: list[dict[str, Any]] = [w for s in report["stretches"] for w in s["longest"]]
    longest.sort(key=lambda w: -w["seconds"])
    if longest:
        yield "Lines that take longest"
        yield from table(("line", "seconds"), [(str(w["line"]), f"{w['seconds']:.3f}") for w in longest[:8]])


def _clock(seconds: float) -> str:
    minutes, rest = divmod(seconds, 60.0)
    hours, minutes = divmod(int(minutes), 60)
    return f"{seconds:.2f} s" + (f" ({hours}:{minutes:02d}:{rest:04.1f})" if seconds >= 60.0 else "")
