"""How a motion of joints uses its limits, by line and where it is slow: lengths, speeds and feeds are those
of the tip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.values import dataclass
from olp.kinematics.structure import Structure
from olp.trajectory.joint_motion import Stretch
from olp.trajectory.usage import LineUse, SlowStretches, usage

#: Parts of a straight way of the axes by which the way of the tip is measured; an even number.
_PARTS = 4


def limit_names(structure: Structure) -> tuple[str, ...]:
    """The limits of a motion, in the order of the columns of `LineUse`."""
    words = ("velocity", "acceleration", "jerk")
    return (*(f"{name} {word}" for word in words for name in structure.order), "feed")


def joint_usage(stretch: Stretch) -> tuple[LineUse, SlowStretches]:
    """As `olp.trajectory.usage.usage`, with the lines of the program."""
    line = stretch.route.line
    use, slow = usage(stretch.trajectory, stretch.route.route, _Tip.of(stretch))
    return use.numbered(line[use.line]), replace(slow, line=line[slow.line])


def _along(points: Sequence[Array]) -> Array:
    """(m,) the lengths of polylines of points (m, 3)."""
    return np.asarray(sum(np.linalg.norm(b - a, axis=1) for a, b in pairwise(points)), float)


@dataclass(frozen=True, slots=True, eq=False)
class _Tip:
    """The tip of a stretch, as `olp.trajectory.usage.Tip`."""

    stretch: Stretch
    way_mm: Array
    feed_mm_s: Array

    @staticmethod
    def of(stretch: Stretch) -> _Tip:
        route, nominal = stretch.route, stretch.motion.nominal
        axes = route.route.point_mm / route.scale
        first, step = axes[:-1], np.diff(axes, axis=0)
        tips = [nominal(first + step * (part / _PARTS), route.tool).position for part in range(_PARTS + 1)]
        fine, coarse = _along(tips), _along(tips[::2])
        # what half as many chords lack more falls with its square
        return _Tip(stretch, fine + (fine - coarse) / 3.0, route.feed_mm_s)

    def seen(self, position: Array, velocity: Array, segment: Index) -> tuple[Array, Array]:
        route = self.stretch.route
        place = self.stretch.motion.nominal(position / route.scale, route.tool[segment]).position
        return place, self.stretch.tip_speed(position, velocity, segment)
