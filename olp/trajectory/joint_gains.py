"""Which lines of a program of a machine with rotary joints would gain most, as `gains` says."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from olp.core.arrays import Array, Index
from olp.trajectory.gains import FEED, TOLERANCE, worth
from olp.trajectory.joint_motion import Stretch, seconds_by_line

#: The motion with path tolerances and feeds times these factors.
Planned = Callable[[float, float], tuple[Stretch, ...]]


def joint_gains(
    base: tuple[Stretch, ...], lines: Index, blend_mm: Callable[[Index], Array], again: Planned
) -> list[dict[str, Any]]:
    """The lines that gain most, first from tolerance, then from feed. `lines` are those of the motion,
    `blend_mm` says their path tolerances, and `again` plans with others."""
    now = seconds_by_line(base, lines)
    gained = [now - seconds_by_line(again(*factors), lines) for factors in ((TOLERANCE, 1.0), (1.0, FEED))]
    feed = np.full(len(lines), -np.inf)
    for one in base:
        np.maximum.at(feed, np.searchsorted(lines, one.route.line), one.route.feed_mm_s * 60.0)
    tolerance_um = blend_mm(lines) * 1e3
    return [
        *worth(lines, gained[0], "tolerance", tolerance_um, TOLERANCE * tolerance_um),
        *worth(lines, gained[1], "feed", feed, FEED * feed),
    ]
