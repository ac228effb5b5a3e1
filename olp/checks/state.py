"""Checks of where a program goes, and of what the files say: limits, calibration, tool, temperature."""

from __future__ import annotations

import datetime

import numpy as np

from olp.checks.base import finding, lines_of
from olp.core.arrays import Array
from olp.core.machine import Job, Machine, Sanity, Setup
from olp.core.toolpath import Flag, Toolpath
from olp.errormodel.calibration import Calibration
from olp.findings.catalogue import Finding
from olp.proof.proof import ROUNDING_SHARE

#: what rounding may make of a place on a limit
_ON_LIMIT_MM = 1e-6
_UNTOUCHED = np.uint8(Flag.PASS | Flag.CONTROL | Flag.MACHINE)


def travel_findings(path: Toolpath, machine: Machine) -> list[Finding]:
    """Commands beyond the travel of an axis, arcs on their way included."""
    low, high = path.reach_mm()
    out = []
    for i, name in enumerate("XYZ"):
        least, most = machine.axes[name].travel_mm
        beyond = (low[:, i] < least - _ON_LIMIT_MM) | (high[:, i] > most + _ON_LIMIT_MM)
        if beyond.any():
            what = f"{name} is commanded beyond its travel of {least:g} to {most:g} mm"
            out.append(finding("OLP402", what, lines_of(path, beyond)))
    return out


def box_findings(path: Toolpath, box_mm: Array, code: str) -> list[Finding]:
    """Commands outside the calibrated box (3, 2), arcs on their way included; OLP405, or OLP403 where the
    error at its face was asked for."""
    low, high = path.reach_mm()
    out = (low < box_mm[:, 0] - _ON_LIMIT_MM) | (high > box_mm[:, 1] + _ON_LIMIT_MM)
    moves = out.any(axis=1) & ((path.flag & _UNTOUCHED) == 0)
    if not moves.any():
        return []
    axes = " and ".join("XYZ"[i] for i in np.flatnonzero(out[moves].any(axis=0)))
    what = f"{int(moves.sum())} commands lie outside the calibrated box in {axes}"
    return [finding(code, what, lines_of(path, moves))]


def calibration_findings(calibration: Calibration, date: datetime.date | None, days: int) -> list[Finding]:
    """Is the calibration still valid on the day given? Without an end of its own it is for `days`."""
    if date is None:
        return []
    until, why = calibration.valid_until, ""
    if until is None and calibration.measured is not None:
        until = calibration.measured + datetime.timedelta(days=days)
        why = f" ({days} days after it was measured)"
    if until is None or date <= until:
        return []
    what = f"the calibration was valid until {until.isoformat()}{why}, the job is of {date.isoformat()}"
    return [finding("OLP401", what)]


def tool_findings(path: Toolpath, calibration: Calibration, sanity: Sanity) -> list[Finding]:
    """Tools whose tip is elsewhere, seen from the gauge point, than that of all tools measured with."""
    known = np.array([curve.tool_mm for curve in calibration.curves]).reshape(-1, 3)
    out: list[Finding] = []
    if not len(known) or not len(path):
        return out
    seen: set[tuple[int | None, tuple[float, float, float]]] = set()
    for number in np.unique(path.frame).tolist():
        frame = path.frames[number]
        away = float(np.abs(known - np.array(frame.tool_mm)).max(axis=1).min())
        key = (frame.tool, frame.tool_mm)
        if away <= sanity.tool_within_mm or key in seen:
            continue
        seen.add(key)
        lines = lines_of(path, path.frame == number)
        name = "no tool" if frame.tool is None else f"tool {frame.tool}"
        what = f"the tip of {name} is {away:g} mm from where it was with any tool measured with"
        out.append(finding("OLP406", f"{what}; {sanity.tool_within_mm:g} mm are allowed", lines[:1]))
    return out


def temperature_findings(job: Job, calibration: Calibration, sanity: Sanity) -> list[Finding]:
    """Temperatures of the job that are far from that of the calibration."""
    at = calibration.temperature_degC
    far = {k: v for k, v in job.temperatures_degC.items() if abs(v - at) > sanity.temperature_within_K}
    if not far:
        return []
    stated = ", ".join(f"{name} {value:g} degC" for name, value in sorted(far.items()))
    what = f"{stated}, and the calibration was made at {at:g} degC"
    return [finding("OLP407", f"{what}; {sanity.temperature_within_K:g} K are allowed")]


def sanity_findings(path: Toolpath, correction_mm: Array, sanity: Sanity) -> list[Finding]:
    """Way-points that were moved by more than is sane: `correction_mm` (n, 3), by move of `path`."""
    size = np.sqrt(np.einsum("ij,ij->i", correction_mm, correction_mm))
    size[(path.flag & np.uint8(Flag.CONTROL | Flag.MACHINE)) != 0] = 0.0
    wild = size > sanity.largest_correction_mm
    if not wild.any():
        return []
    what = (
        f"{int(wild.sum())} way-points are moved by up to {np.nanmax(size) * 1e3:.0f} um; "
        f"{sanity.largest_correction_mm * 1e3:g} um are taken for sane"
    )
    return [finding("OLP409", what, lines_of(path, wild))]


def digit_findings(digit_mm: float, tolerance_mm: float) -> list[Finding]:
    """Does rounding to the last digit alone use up the tolerance?"""
    rounding = ROUNDING_SHARE * digit_mm
    if rounding <= tolerance_mm:
        return []
    what = f"rounding to {digit_mm:g} mm leaves up to {rounding * 1e3:.3g} um, the tolerance is "
    return [finding("OLP411", f"{what}{tolerance_mm * 1e3:g} um")]


def orientation_findings(
    path: Toolpath, largest_rad: float, setup: Setup, tolerance_mm: float
) -> list[Finding]:
    """Does the tool lean so far that the rim of its face is off by more than the tolerance?"""
    tools = {frame.tool for frame in path.frames if frame.tool is not None}
    radius = max((t.radius_mm for n in tools if (t := setup.tool(n)) is not None), default=0.0)
    off = largest_rad * radius
    if off <= tolerance_mm:
        return []
    what = (
        f"the tool leans by up to {largest_rad * 1e6:.3g} urad, which is {off * 1e3:.3g} um at a radius of "
    )
    return [finding("OLP106", f"{what}{radius:g} mm")]
