"""Checks of the program's positions and of the files: limits, calibration, tool, temperature."""

from __future__ import annotations

import datetime

import numpy as np

from olp.checks.base import finding, first_lines, lines_of
from olp.core.arrays import Array, Index, Mask, any_in_row
from olp.core.machine import Job, Machine, Sanity, Setup
from olp.core.toolpath import Flag, Toolpath
from olp.errormodel.calibration import Calibration
from olp.findings.catalogue import Finding
from olp.program.text.columns import spans
from olp.proof.proof import ROUNDING_SHARE

#: mm; how far rounding may put a position beyond a limit
_ON_LIMIT_MM = 1e-6
#: times tool_within_mm, from the gauge point: a calibration that states no tool holds there, and every tool
#: is farther than that from it
_AT_GAUGE_POINT = 2.0
#: moves that are looked at together
_BLOCK = 1 << 14
#: moves that are not corrected
_UNTOUCHED = np.uint8(Flag.PASS | Flag.CONTROL | Flag.MACHINE)


def travel_findings(path: Toolpath, machine: Machine) -> list[Finding]:
    """Commands beyond the travel of an axis, arcs between their ends included."""
    travel_mm = np.array([machine.axes[name].travel_mm for name in "XYZ"])
    moves, outside = _outside(path, travel_mm)
    findings = []
    for i, name in enumerate("XYZ"):
        least, most = travel_mm[i].tolist()
        beyond = moves[outside[:, i]]
        if beyond.size:
            what = f"{name} is commanded beyond its travel of {least:g} to {most:g} mm"
            findings.append(finding("OLP402", what, lines_of(path, beyond)))
    return findings


def box_findings(path: Toolpath, box_mm: Array, code: str) -> list[Finding]:
    """Commands outside the calibrated box (3, 2), arcs between their ends included. `code` is OLP405, or
    OLP403 with --outside-box hold."""
    moves, outside = _outside(path, box_mm)
    own = (path.flag[moves] & _UNTOUCHED) == 0
    moves, outside = moves[own], outside[own]
    if not moves.size:
        return []
    axes = " and ".join("XYZ"[i] for i in np.flatnonzero(outside.any(axis=0)))
    what = f"{len(moves)} commands lie outside the calibrated box in {axes}"
    return [finding(code, what, lines_of(path, moves))]


def _outside(path: Toolpath, box_mm: Array) -> tuple[Index, Mask]:
    """(m,) the moves that leave a box (3, 2), arcs between their ends too, and (m, 3) along which axes."""
    moves, outside = [np.zeros(0, np.int64)], [np.zeros((0, 3), bool)]
    for some in spans(len(path), _BLOCK):
        low, high = path.part(some.start, some.stop).reach_mm()
        beyond = (low < box_mm[:, 0] - _ON_LIMIT_MM) | (high > box_mm[:, 1] + _ON_LIMIT_MM)
        rows = np.flatnonzero(any_in_row(beyond))
        moves.append(some.start + rows)
        outside.append(beyond[rows])
    return np.concatenate(moves), np.concatenate(outside)


def calibration_findings(calibration: Calibration, date: datetime.date | None, days: int) -> list[Finding]:
    """Is the calibration still valid on the given day? One without `valid_until` is old after `days`."""
    until, measured = calibration.valid_until, calibration.measured
    if until is not None:
        if date is None or date <= until:
            return []
        what = f"the calibration was valid until {until}; the date of the job is {date}"
        return [finding("OLP401", what)]
    what = "calibration: it states no valid_until"
    if date is None or measured is None or (date - measured).days <= days:
        return [finding("OLP462", f"{what}, so when it expires is not known")]
    age = f"was measured on {measured}, {(date - measured).days} days before {date}"
    return [finding("OLP463", f"{what} and {age}; expected at most {days} days")]


def tool_findings(path: Toolpath, calibration: Calibration, sanity: Sanity) -> list[Finding]:
    """Tools whose tool vector differs from those of all tools of the calibration."""
    known = np.array([curve.tool_mm for curve in calibration.curves]).reshape(-1, 3)
    findings: list[Finding] = []
    if not len(known) or not len(path):
        return findings
    allowed = np.where(known.any(axis=1), 1.0, _AT_GAUGE_POINT) * sanity.tool_within_mm
    seen: set[tuple[int | None, tuple[float, float, float]]] = set()
    for number, line in first_lines(path).items():
        frame = path.frames[number]
        distance = np.abs(known - np.array(frame.tool_mm)).max(axis=1)
        key = (frame.tool, frame.tool_mm)
        if bool((distance <= allowed).any()) or key in seen:
            continue
        away = float(distance.min())
        seen.add(key)
        name = "no tool" if frame.tool is None else f"tool {frame.tool}"
        what = f"the tip of {name} is {away:g} mm from that of every tool of the calibration"
        text = f"{what}; expected at most {float(allowed[distance.argmin()]):g} mm"
        findings.append(finding("OLP406", text, [line]))
    return findings


def temperature_findings(job: Job, calibration: Calibration, sanity: Sanity) -> list[Finding]:
    """Temperatures of the job that are far from that of the calibration."""
    reference = calibration.temperature_degC
    far = {k: v for k, v in job.temperatures_degC.items() if abs(v - reference) > sanity.temperature_within_K}
    if not far:
        return []
    stated = ", ".join(f"{name} {value:g} degC" for name, value in sorted(far.items()))
    what = f"{stated}, and the calibration was made at {reference:g} degC"
    return [finding("OLP407", f"{what}; {sanity.temperature_within_K:g} K are allowed")]


def digit_findings(digit_mm: float, tolerance_mm: float) -> list[Finding]:
    """Does rounding to the last digit alone exceed the numerical tolerance?"""
    rounding = ROUNDING_SHARE * digit_mm
    if rounding <= tolerance_mm:
        return []
    what = f"rounding to {digit_mm:g} mm leaves up to {rounding * 1e3:.3g} um; the numerical tolerance is "
    return [finding("OLP411", f"{what}{tolerance_mm * 1e3:g} um")]


def orientation_findings(
    path: Toolpath, largest_rad: float, setup: Setup, tolerance_mm: float
) -> list[Finding]:
    """Does the tool lean so far that the rim of its face is off by more than the tolerance?"""
    tools = {frame.tool for frame in path.frames if frame.tool is not None}
    radius = max((t.radius_mm or 0.0 for n in tools if (t := setup.tool(n)) is not None), default=0.0)
    off = largest_rad * radius
    if off <= tolerance_mm:
        return []
    what = (
        f"the tool leans by up to {largest_rad * 1e6:.3g} urad, which is {off * 1e3:.3g} um at a radius of "
    )
    return [finding("OLP106", f"{what}{radius:g} mm")]
