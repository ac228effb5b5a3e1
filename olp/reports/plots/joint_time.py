"""Plots of the motion of a machine with rotary joints over time, as SVG or PNG bytes: the speed of the tip
and its feed, and what each axis uses of its limits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from olp.core.arrays import Array, Index
from olp.reports.plots.base import Format
from olp.reports.plots.motion import end_of, motion_picture
from olp.trajectory.joint_motion import Stretch

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Columns of the picture; each shows the range between the extremes of its instants.
_COLUMNS = 1500
#: Looked at instants of a piece.
_INSTANTS = 5
#: Pieces that are looked at together, to bound memory.
_BLOCK = 1 << 12
_QUANTITIES = ("velocity", "acceleration", "jerk")


def joint_motion_plot(
    stretch: Stretch, title: str, kind: Format = "svg", *, from_s: float = 0.0, to_s: float | None = None
) -> bytes:
    """The motion from `from_s` to `to_s`. Raises UsageError for an empty span.

    The same stretch gives the same bytes.
    """
    end = end_of(stretch.trajectory.duration_s, from_s, to_s)
    names = stretch.motion.structure.order
    time, low, high, feed = _ranges(stretch, from_s, end)

    def draw(plots: Sequence[Axes]) -> None:
        _draw(plots[0], time, low[:, 0], high[:, 0], "0.2", "tip")
        if np.isfinite(feed).any():
            plots[0].plot(time, feed, color="tab:red", linewidth=0.8, label="feed")
        plots[0].set_ylabel("speed of the tip in mm/s")
        plots[0].set_ylim(bottom=0.0)
        for k, (plot, quantity) in enumerate(zip(plots[1:], _QUANTITIES, strict=True)):
            for axis, name in enumerate(names):
                column = 1 + k * len(names) + axis
                _draw(plot, time, low[:, column], high[:, column], f"C{axis % 10}", name)
            for limit in (100.0, -100.0):
                plot.axhline(limit, color="0.4", linewidth=0.7, linestyle=(0, (4, 3)))
            plot.set_ylabel(f"{quantity}, % of limit")

    return motion_picture(title, (from_s, end), kind, draw, names=8)


def _draw(plot: Axes, time: Array, low: Array, high: Array, colour: str, label: str) -> None:
    plot.fill_between(time, low, high, color=colour, linewidth=0.8, alpha=0.7, label=label)


def _ranges(stretch: Stretch, from_s: float, to_s: float) -> tuple[Array, Array, Array, Array]:
    """Times (c,) of the columns, least and most (c, 1 + 3 axes) of the tip's speed and of the shares of
    limits in percent, and the feed (c,), NaN where there is none."""
    motion, names = stretch.trajectory.motion, stretch.motion.structure.order
    first, last = (int(motion.piece_at(np.array([t]))[0]) for t in (from_s, to_s))
    scale = _COLUMNS / (to_s - from_s)
    middle: Array = from_s + (np.arange(_COLUMNS, dtype=float) + 0.5) / scale
    low, high = (np.full((_COLUMNS, 1 + 3 * len(names)), fill) for fill in (np.inf, -np.inf))
    pieces = np.arange(first, last + 1)
    for a in range(0, len(pieces), _BLOCK):
        some = pieces[a : a + _BLOCK]
        begin = np.maximum(motion.start_s[some], from_s)
        width = np.minimum(motion.start_s[some + 1], to_s) - begin
        time = (begin[:, None] + width[:, None] * np.linspace(0.0, 1.0, _INSTANTS)).ravel()
        states = _states(stretch, np.repeat(some, _INSTANTS), time)
        column = np.clip(((time - from_s) * scale).astype(np.int64), 0, _COLUMNS - 1)
        np.minimum.at(low, column, states)
        np.maximum.at(high, column, states)
    piece = motion.piece_at(middle)
    states = _states(stretch, piece, middle)
    feed = stretch.route.feed_mm_s[motion.line[piece]]
    shown: Array = np.where(np.isfinite(feed), feed, np.nan)
    return middle, np.minimum(low, states), np.maximum(high, states), shown


def _states(stretch: Stretch, piece: Index, time: Array) -> Array:
    """(n, 1 + 3 axes) the speed of the tip, and percent of the limits of velocity, acceleration and jerk."""
    motion, limits = stretch.trajectory.motion, stretch.trajectory.limits
    position, velocity, acceleration, jerk = motion.of(piece, time - motion.start_s[piece])
    bounds = (limits.velocity, limits.acceleration, limits.jerk)
    used = [100.0 * rate / most for rate, most in zip((velocity, acceleration, jerk), bounds, strict=True)]
    return np.column_stack((stretch.tip_speed(position, velocity, motion.line[piece]), *used))
