"""The report of a re-timing on a machine with rotary joints, for people."""

from __future__ import annotations

from collections.abc import Iterator

from olp.reports.report import Report, pairs, place, sentences, table
from olp.reports.retime import against_text, clock, feeds_text, gains_text, study_text, tubes_text


def to_text(report: Report) -> str:
    """Plain text of at most 100 columns."""
    sections = (
        _head(report), against_text(report), gains_text(report), study_text(report), _limits(report),
        _lines(report), feeds_text(report), _notes(report),
    )  # fmt: skip

    return "\n\n".join("\n".join(lines) for lines in map(list, sections) if lines) + "\n"


def _head(report: Report) -> Iterator[str]:
    machine, dwell = report["machine"], float(report["dwell_s"])
    solvers = "; ".join(f"{name} {seconds:.2f} s" for name, seconds in report["solvers_s"].items())
    share = report["largest_share_of_limit"]
    kept = ", ".join(f"{name} {100.0 * part:.2f} %" for name, part in share.items())
    time = clock(float(report["duration_s"]))
    stretches, override = len(report["stretches"]), float(report["feed_override"])
    yield from pairs(
        [
            ("Program", f"{report['program'] or 'bytes'}, {report['waypoints']} waypoints"),
            ("Machine", f"{machine['name']}, chain {machine['chain']}"),
            ("Override", "" if override == 1.0 else f"{100.0 * override:.0f} % of the programmed feed"),
            ("Time", time + (f", {dwell:.2f} s of it dwells" if dwell else "")),
            ("Limits", f"used at most: {kept}"),
            ("Path", f"corners within {report['blend_mm']:g} mm where the program names no tolerance"),
            ("Planned by", solvers),
            ("In tubes", tubes_text(report["in_tubes"])),
            (
                "Stretches",
                f"{stretches}, between moves that the control makes by itself" if stretches > 1 else "",
            ),
        ]
    )


def _limits(report: Report) -> Iterator[str]:
    shares = sorted(report["nearest_limit"].items(), key=lambda item: -float(item[1]))
    yield "What the motion is nearest to"
    yield from table(["limit", "% of the time"], [[name, f"{100.0 * part:.1f}"] for name, part in shares[:8]])


def _lines(report: Report) -> Iterator[str]:
    yield "Longest lines"
    rows = [[place(row), f"{row['seconds']:.3f}", row["limit"]] for row in report["longest_lines"]]
    yield from table(["line", "seconds", "nearest limit"], rows)


def _notes(report: Report) -> Iterator[str]:
    untimed = report["untimed"]
    if untimed["moves"]:
        lines = ", ".join(map(str, untimed["lines"]))
        yield from sentences(
            "Not timed", [f"{untimed['moves']} moves from positions that are not known, at lines {lines}"]
        )
