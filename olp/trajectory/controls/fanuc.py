"""Fanuc: AI contour control by G05.1 Q1, G08 P1 or G05 P10000, and cutting mode without it.

AI contour control accelerates before it interpolates, and keeps to the path. At a corner no axis changes its
speed by more than its permissible difference. In arcs, and where short blocks make a curve, no axis exceeds
its acceleration. Without it, each axis accelerates behind the interpolation: corners are rounded by that, and
are driven at the programmed feed. G61 and G09 rest at the end of a block.
Source: FANUC, AI contour control function, Specifications (A-63512EN), 2.3 and 2.4; operator's manuals.
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
from olp.trajectory.controls.said import Said, spoken

_WANTED = pattern(rb"(?i)(?<![A-Z#\[])G0*(5\.1|5|8|62|63)(?![\d.])(?=([^\r\n(;]*))")
_SWITCH = {
    b"5.1": pattern(rb"(?i)Q[ \t]*(\d+)"),
    b"5": pattern(rb"(?i)P[ \t]*(\d+)"),
    b"8": pattern(rb"(?i)P[ \t]*(\d+)"),
}
_LEVEL = pattern(rb"(?i)R[ \t]*(\d+)")


def said(program: Program) -> Said:
    """Where AI contour control is on, and the words that only the builder of the machine knows."""
    changes: list[tuple[int, str, float]] = []
    beside: list[tuple[int, str]] = []
    for line, found in spoken(program, _WANTED):
        if found[1] not in _SWITCH:
            beside.append((line, f"G{found[1].decode()}"))
            continue
        switch, level = _SWITCH[found[1]].search(found[2]), _LEVEL.search(found[2])
        if switch is not None:
            changes.append((line, "on", float(int(switch[1]) > 0)))
            beside += [] if level is None else [(line, f"R{level[1].decode()}")]
    return Said({"on": 0.0}, tuple(changes), tuple(beside))


def pieces(part: Moves, limits: AxisSpeeds, values: Mapping[str, float]) -> Pieces:
    """Each move with the speed of the corner behind it."""
    on = part.said["on"] > 0.0
    step = np.full(3, values["corner_step_mm_min"] / 60.0)
    # blocks that make a curve: the turn between them, over half of both
    width = 0.5 * (part.length_mm[:-1] + part.length_mm[1:])
    with np.errstate(divide="ignore"):
        turn = np.maximum(np.abs(corners.turns(part)), 1e-12)
        curve = np.sqrt((limits.acceleration * width[:, None] / turn).min(axis=1))
    joint = np.where(on[:-1] & on[1:], np.minimum(corners.stepped_mm_s(part, step), curve), np.inf)
    joint[part.rest | (part.mode == PathControl.EXACT_STOP)] = 0.0
    speed = np.where(
        on, corners.in_arcs(part, limits), np.minimum(part.feed_mm_s, part.least(limits.velocity))
    )
    return Pieces(
        part.length_mm, speed, part.least(limits.acceleration), np.arange(len(part)),
        np.zeros(len(part), bool), joint, np.zeros(len(joint)), part.least(limits.jerk),
    )  # fmt: skip


CONTROL = Control(
    key="fanuc",
    title="Fanuc with AI contour control",
    source="FANUC, AI contour control function, Specifications: automatic corner deceleration, look-ahead",
    parameters={
        "corner_step_mm_min": Parameter(
            500.0, "mm/min", "No. 1783, permissible difference of feedrate at corners"
        )
    },
    pieces=pieces,
    ahead=40,
    cycle_s=0.0,
    stop_cycles=0.0,
    corners="corner_step_mm_min",
    said=said,
    bells=True,
)
