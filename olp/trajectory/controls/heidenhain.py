"""Heidenhain TNC: contours within the tolerance of cycle 32, with limits of jerk.

The control rounds corners and fits dense points within the tolerance T of cycle 32, else within that of the
machine, which is the path tolerance here. HSC-MODE chooses filters that the builder of the machine sets.
Source: HEIDENHAIN, TNC user's manuals, Cycle Programming: TOLERANCE (cycle 32, ISO G62).
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

#: M functions that change feeds or corners, and are not in the time
_M = rb"90|103|109|110|112|124"
_WANTED = pattern(
    rb"(?i)CYCL[ \t]+DEF[ \t]+32\.([12])([^;\r\n]*)|CYCL[ \t]+DEF[ \t]+(239|332)(?!\d)"
    rb"|BEGIN[ \t]+PGM[ \t][^;\r\n]*[ \t](INCH|MM)|(?<![A-Z0-9_])M(" + _M + rb")(?![\d.])"
)
_TOLERANCE = pattern(rb"(?i)[ \t]*T[ \t]*([^\s]+)")
_MODE = pattern(rb"(?i)HSC-MODE[ \t]*:?[ \t]*([^\s]+)")
_INCH_MM = 25.4


def said(program: Program) -> Said:
    """The tolerances of cycle 32, and the words that only the builder of the machine knows."""
    changes: list[tuple[int, str, float]] = []
    beside: list[tuple[int, str]] = []
    unit = 1.0
    for line, found in spoken(program, _WANTED):
        row, text, cycle, length, code = found.groups()
        if length is not None:
            unit = _INCH_MM if length.upper() == b"INCH" else 1.0
        elif cycle is not None:
            beside.append((line, f"CYCL DEF {cycle.decode()}"))
        elif code is not None:
            beside.append((line, f"M{code.decode()}"))
        elif row == b"1":
            stated = _TOLERANCE.match(text)
            size = None if stated is None else number(stated[1])
            if stated is not None and size is None:
                beside.append((line, f"cycle 32 with T{stated[1].decode('latin-1')}"))
            changes.append((line, "tolerance_mm", np.nan if not size else size * unit))
        else:
            mode = _MODE.search(text)
            if mode is not None and mode[1] != b"0":
                beside.append((line, f"HSC-MODE:{mode[1].decode('latin-1')}"))
    return Said({"tolerance_mm": np.nan}, tuple(changes), tuple(beside))


def pieces(part: Moves, limits: AxisSpeeds, values: Mapping[str, float]) -> Pieces:
    """Each move with the speed of the corner behind it."""
    stated = part.said["tolerance_mm"][:-1]
    tolerance = np.where(np.isnan(stated), part.blend_mm, stated)
    joint = corners.fitted_mm_s(part, limits, np.minimum(tolerance, 1e3) * values["tolerance_used"])
    joint[part.rest | (part.mode == PathControl.EXACT_STOP)] = 0.0
    return Pieces(
        part.length_mm, corners.in_arcs(part, limits), part.least(limits.acceleration), np.arange(len(part)),
        np.zeros(len(part), bool), joint, np.zeros(len(joint)), part.least(limits.jerk),
    )  # fmt: skip


CONTROL = Control(
    key="heidenhain",
    title="Heidenhain TNC",
    source="HEIDENHAIN, TNC user's manuals: Cycle Programming, TOLERANCE (cycle 32)",
    parameters={"tolerance_used": Parameter(1.0, "", "share of the tolerance that corners use")},
    pieces=pieces,
    ahead=1024,
    cycle_s=0.0,
    stop_cycles=0.0,
    corners="tolerance_used",
    said=said,
    bells=True,
)
