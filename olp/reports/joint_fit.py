"""The document of a calibration of a machine of any joints: before and after, at poses that had no part in
the fit, with what is known of each axis."""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Mapping
from typing import Any

from olp.reports.document import Block, Document, Grid, Pairs, Paragraph, Plot, Section
from olp.reports.document_parts import footer_of, notice_blocks
from olp.reports.report import Report, number

#: An unknown whose uncertainty is more than this share of what is usual is held by that alone.
_HELD = 0.9
_FIGURES = (("mean_um", "mean distance, um"), ("rms_um", "rms distance, um"), ("largest_um", "largest, um"))


def joint_fit(
    report: Report, plots: Mapping[str, bytes], version: str, date: datetime.date | None
) -> Document:
    """The document of a report ("olp-joint-fit-1"); `plots` by name, as `olp.reports.plots.joint_fit` draws
    them."""
    sections = [
        Section("Result", list(_result(report, plots))),
        Section("Readings", list(_readings(report))),
        Section("Where the axes lie", list(_unknowns(report, plots))),
        Section("Findings and limits", [*_limits(), *notice_blocks(report)]),
    ]
    stated = f", {date.isoformat()}" if date is not None else ""
    return Document(
        "Calibration of a machine from poses", f"{report['machine']}{stated}", None,
        sections, footer_of(version),
    )  # fmt: skip


def sentence_of(report: Report) -> str:
    """The result in a sentence."""
    unseen = _by_name(report)
    expected = number(report["uncertainty_in_best_frame"]["tip_with_misfit_um"])
    if not unseen:
        why = report.get("held_out_unknown")
        none = f"No readings are held out: {why}" if why else "Too few readings to hold some out"
        return f"{none}. A tip is expected to be off by {expected} um (rms)"
    before, after = unseen["before"], unseen["after"]
    return (
        f"At {after['rows']} readings that had no part in the fit the tip was off by "
        f"{number(before['mean_um'])} um before and {number(after['mean_um'])} um after (mean), "
        f"{number(before['largest_um'])} and {number(after['largest_um'])} um at most. "
        f"A tip is expected to be off by {expected} um (rms)"
    )


def _by_name(report: Report) -> dict[str, Any]:
    return {row["name"]: row for row in report.get("held_out") or ()}


def _result(report: Report, plots: Mapping[str, bytes]) -> Iterator[Block]:
    unseen = _by_name(report)
    yield Paragraph(f"{sentence_of(report)}.")
    if unseen:
        yield Paragraph("A fifth of the readings was held out, fitted without, and compared:")
        rows = [
            [title, number(unseen["before"][key]), number(unseen["after"][key])] for key, title in _FIGURES
        ]
        yield Grid(["at held-out readings", "before", "after"], rows)
        if "held_out" in plots:
            yield Plot(plots["held_out"], "Distances at the held-out readings, before and after.")
    known = report["uncertainty_in_best_frame"]
    yield Paragraph("Standard uncertainty of a pose at the postures of the readings, in the best frame:")
    yield Grid(["", "um, urad"], [
        ["tip, mean, um", number(known["tip_mean_um"])],
        ["tip, largest, um", number(known["tip_largest_um"])],
        ["tip with what no unknown explains, rms, um", number(known["tip_with_misfit_um"])],
        ["turn of the tool, largest, urad", number(known["turn_largest_urad"])],
    ])  # fmt: skip


def is_held(row: Mapping[str, Any]) -> bool:
    """Whether the readings say nothing of an unknown: it is held by what is usual."""
    return bool(row["sigma"] > _HELD * row["prior"])


def _readings(report: Report) -> Iterator[Block]:
    keys = ("sigma_um", "mean_um", "rms_um", "largest_um")
    rows = [
        [row["name"], row["file"], str(row["rows"]), *(number(row[key]) for key in keys)]
        for row in report["readings"]
    ]
    yield Grid(["kind", "file", "rows", "sigma um", "mean um", "rms um", "largest um"], rows, text_columns=2)
    yield Pairs([
        ("Reduced chi square", number(report["reduced_chi_square"])),
        ("Degrees of freedom", number(report["degrees_of_freedom"])),
    ])  # fmt: skip


def _unknowns(report: Report, plots: Mapping[str, bytes]) -> Iterator[Block]:
    rows = []
    for row in report["unknowns"]:
        held = is_held(row)
        figures = [number(row[key]) for key in ("value", "sigma", "prior")]
        rows.append([row["name"], *figures, "held by what is usual" if held else ""])
    yield Paragraph(
        f"The readings determine {report['unknowns_determined']} of {report['unknowns_kept']} unknowns. "
        "Values are actual minus nominal, with their standard uncertainty and what is usual for a machine."
    )
    yield Grid(["unknown", "value", "sigma", "usual", ""], rows)
    if "unknowns" in plots:
        yield Plot(
            plots["unknowns"],
            "Unknowns that the readings determine, with their expanded uncertainty (k = 2).",
        )
    yield Pairs([("Not needed beside these", report["not_needed"])])


def _limits() -> Iterator[Block]:
    yield Paragraph(
        "Proved: what the readings say of this machine, on the day and in the range of axes of the readings. "
        "Not proved: postures outside that range, other loads, and the machine at another temperature."
    )
