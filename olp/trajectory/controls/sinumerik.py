"""Sinumerik 840D and 828D: smoothing by G641 to G645, compressors, CYCLE832, BRISK and SOFT.

G60 and G9 rest at the end of a block. G64 keeps to the path, and drives a corner so fast that no axis changes
its speed by more than the overload factor times what it gains in one cycle. G641 rounds within the distance
ADIS, G642, G643 and G645 within a tolerance: that of CTOL or CYCLE832, else the path tolerance. A compressor
fits a curve to the points within the tolerance. CYCLE832 with a tolerance switches on a compressor, G645 and
SOFT, and without one ends that.
Source: Siemens, SINUMERIK 840D sl, Basic Functions, B1 (continuous-path mode, exact stop, LookAhead) and B2
(acceleration); Programming Manual Job Planning (CYCLE832, compressors).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from olp.core.patterns import pattern
from olp.program.feeds.timing import PathControl
from olp.program.program import Program
from olp.trajectory.controls import corners
from olp.trajectory.controls.base import AxisSpeeds, Control, Parameter
from olp.trajectory.controls.moves import Moves
from olp.trajectory.controls.planner import Pieces
from olp.trajectory.controls.said import Said, number, spoken

_WANTED = pattern(
    rb"(?i)(?<![A-Z_$])(?:G0*(60|64[1-5]?|9|70|71|700|710)(?![0-9.A-Z_=])"
    rb"|(COMPOF|COMPON|COMPCURV|COMPCAD|COMPSURF|SOFT|BRISK|DRIVE|DYN[A-Z]+)(?![A-Z0-9_])"
    rb"|CYCLE832[ \t]*(?:\(([^)\r\n]*)\))?"
    rb"|(ADIS|ADISPOS|CTOL)[ \t]*=[ \t]*([^\s;]+)"
    rb"|((?:VELOLIM|ACCLIM|JERKLIM)A?)[ \t]*\[)"
)
_INCH_MM = 25.4
#: at the start: `way` 0 and `tolerance_mm` NaN are the path mode and the path tolerance of the machine file
_BEFORE = {
    "way": 0.0, "once": 0.0, "tolerance_mm": np.nan, "distance_mm": 0.0, "rapid_mm": 0.0, "fitted": 0.0,
    "soft": 1.0,
}  # fmt: skip


def said(program: Program) -> Said:
    """The words of path modes, tolerances, compressors and jerk."""
    changes: list[tuple[int, str, float]] = []
    beside: list[tuple[int, str]] = []
    unit = 1.0
    for line, found in spoken(program, _WANTED):
        code, name, _, address, value, share = found.groups()
        if code in (b"70", b"700", b"71", b"710"):
            unit = _INCH_MM if code.startswith(b"70") else 1.0
        elif code == b"9":
            changes += [(line, "once", 1.0), (line + 1, "once", 0.0)]
        elif code is not None:
            changes.append((line, "way", float(code)))
            beside += [(line, "G644")] if code == b"644" else []
        elif name is not None:
            _mode(name.decode().upper(), line, changes, beside)
        elif share is not None:
            beside.append((line, share.decode().upper()))
        elif address is not None:
            own = {b"ADIS": "distance_mm", b"ADISPOS": "rapid_mm", b"CTOL": "tolerance_mm"}[address.upper()]
            size = number(value)
            if size is None:
                beside.append((line, f"{address.decode().upper()}={value.decode('latin-1')}"))
            else:
                # a negative tolerance ends it
                changes.append((line, own, size * unit if size >= 0.0 else np.nan))
        else:
            _high_speed(found[3], line, unit, changes, beside)
    return Said(_BEFORE, tuple(sorted(changes, key=lambda row: row[0])), tuple(beside))


def _mode(name: str, line: int, changes: list[tuple[int, str, float]], beside: list[tuple[int, str]]) -> None:
    if name.startswith("COMP"):
        changes.append((line, "fitted", float(name != "COMPOF")))
    elif name in ("SOFT", "BRISK"):
        changes.append((line, "soft", float(name == "SOFT")))
    elif name != "DYNNORM":
        # the builder of the machine states the limits of each of them
        beside.append((line, name))


def _high_speed(
    given: bytes | None, line: int, unit: float, changes: list[tuple[int, str, float]],
    beside: list[tuple[int, str]],
) -> None:  # fmt: skip
    """CYCLE832 with its arguments."""
    first = (given or b"").split(b",")[0].strip()
    size = number(first) if first else 0.0
    if size is None:
        beside.append((line, f"CYCLE832({first.decode('latin-1')})"))
    on = size is None or size > 0.0
    changes += [
        (line, "tolerance_mm", size * unit if size else np.nan), (line, "fitted", float(on)),
        (line, "way", 645.0 if on else 64.0), *([(line, "soft", 1.0)] if on else []),
    ]  # fmt: skip


def pieces(part: Moves, limits: AxisSpeeds, values: Mapping[str, float]) -> Pieces:
    """Each move with the speed of the corner behind it."""
    has, cycle_s = part.said, values["cycle_ms"] * 1e-3
    # a joint belongs to the block before it
    way, fitted = has["way"][:-1], has["fitted"][:-1] > 0.0
    tolerance = np.where(np.isnan(has["tolerance_mm"][:-1]), part.blend_mm, has["tolerance_mm"][:-1])
    tolerance = np.minimum(tolerance, 1e3) * values["tolerance_used"]
    rapid = np.isinf(part.feed_mm_s[:-1])
    distance = np.where(rapid, has["rapid_mm"][:-1], has["distance_mm"][:-1])
    step = corners.stepped_mm_s(part, limits.acceleration * values["overload_factor"] * cycle_s)
    width = np.where(
        way == 641.0, np.minimum(distance, corners.half_mm(part)), corners.within(part, tolerance)
    )
    joint = np.where(way == 64.0, 0.0, corners.rounded_mm_s(part, limits, width))
    if fitted.any():
        joint = np.where(fitted, np.maximum(joint, corners.fitted_mm_s(part, limits, tolerance)), joint)
    joint = np.maximum(joint, step)
    stops = part.rest | (part.mode == PathControl.EXACT_STOP) & (way == 0.0)
    joint[stops | (way == 60.0) | (has["once"][:-1] > 0.0)] = 0.0
    a = part.least(limits.acceleration)
    jerk = np.where(has["soft"] > 0.0, part.least(limits.jerk), a / cycle_s)
    return Pieces(
        part.length_mm, corners.in_arcs(part, limits), a, np.arange(len(part)), np.zeros(len(part), bool),
        joint, np.zeros(len(joint)), np.minimum(jerk, a / cycle_s),
    )  # fmt: skip


CONTROL = Control(
    key="sinumerik",
    title="Sinumerik 840D",
    source="Siemens, SINUMERIK 840D sl: Basic Functions, B1 and B2; Programming Manual Job Planning",
    parameters={
        "tolerance_used": Parameter(1.0, "", "share of the tolerance that corners use"),
        "overload_factor": Parameter(1.2, "", "MD32310, for steps of the speed of an axis"),
        "cycle_ms": Parameter(4.0, "ms", "interpolation cycle"),
    },
    pieces=pieces,
    ahead=100,
    cycle_s=0.0,
    stop_cycles=0.0,
    corners="tolerance_used",
    said=said,
    bells=True,
)
