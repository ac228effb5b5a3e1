"""Grbl 1.1: junction deviation, and 15 blocks to look ahead over.

The corner between two moves is driven as fast as a circle that touches both and passes the corner at the
junction deviation. Source: Grbl's wiki, "Configuring v1.1" ($11, $12, $110 to $122), and S. K. Jeon,
"Improving Grbl: Cornering Algorithm" (2011).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from olp.core.arrays import Array
from olp.program.feeds.timing import PathControl
from olp.trajectory.controls.base import AxisSpeeds, Control, Parameter
from olp.trajectory.controls.moves import Moves
from olp.trajectory.controls.planner import Pieces

#: of the cosine of the turn: nearer to 1 or -1 a corner is none, or a reversal
_STRAIGHT = 0.999999


def pieces(part: Moves, limits: AxisSpeeds, values: Mapping[str, float]) -> Pieces:
    """Each move as it is, with the speed of the junction between it and the next one."""
    velocity = np.minimum(part.feed_mm_s, part.least(limits.velocity))
    joint = junction_mm_s(part, limits, values["junction_deviation_mm"])
    joint[part.rest | (part.mode == PathControl.EXACT_STOP)] = 0.0
    return Pieces(
        part.length_mm, velocity, part.least(limits.acceleration), np.arange(len(part)),
        np.zeros(len(part), bool), joint, np.zeros(len(joint)),
    )  # fmt: skip


def junction_mm_s(part: Moves, limits: AxisSpeeds, deviation_mm: float) -> Array:
    """(m - 1,) the speed at each junction: inf where it is none, 0 at a reversal."""
    before, behind = part.leave[:-1], part.begin[1:]
    cosine = (before * behind).sum(axis=1)
    across = behind - before
    size = np.sqrt((across * across).sum(axis=1))
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.abs(across) / size[:, None]
        acceleration = (limits.acceleration / share).min(axis=1)
        # of half the angle between both moves
        sine = np.sqrt(np.maximum(0.5 * (1.0 + cosine), 0.0))
        speed = np.sqrt(acceleration * deviation_mm * sine / (1.0 - sine))
    return np.where(cosine > _STRAIGHT, np.inf, np.where(cosine < -_STRAIGHT, 0.0, speed))


CONTROL = Control(
    key="grbl",
    title="Grbl 1.1",
    source="Grbl wiki: Configuring v1.1; S. K. Jeon, Improving Grbl: Cornering Algorithm",
    parameters={
        "junction_deviation_mm": Parameter(0.01, "mm", "$11, junction deviation"),
        "arc_tolerance_mm": Parameter(0.002, "mm", "$12, arc tolerance"),
    },
    pieces=pieces,
    ahead=15,
    cycle_s=0.0,
    stop_cycles=0.0,
    chord_mm="arc_tolerance_mm",
    corners="junction_deviation_mm",
)
