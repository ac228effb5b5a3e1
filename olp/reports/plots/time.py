"""Plots of a trajectory over time: speed and feed, and each axis' velocity, acceleration and jerk beside its
limits, as SVG or PNG bytes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.units import AXES
from olp.reports.plots.base import Format
from olp.reports.plots.motion import end_of, motion_picture
from olp.trajectory.plan import Trajectory
from olp.trajectory.route import Route
from olp.trajectory.usage import feeds_of_pieces

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Colours of X, Y and Z.
_COLOURS = ("tab:blue", "tab:orange", "tab:green")
#: Names and units of the plots.
_QUANTITIES = (("velocity", "mm/s"), ("acceleration", "mm/s2"), ("jerk", "mm/s3"))
#: Columns of the picture; of longer motions each column shows the range between its extremes.
_COLUMNS = 1500
#: Sampled instants of a piece.
_INSTANTS = 5
#: Pieces that are sampled at once, to bound memory.
_BLOCK = 1 << 13
#: Most pieces that are drawn as lines.
_FEW = 1000


def motion_plot(
    trajectory: Trajectory, route: Route, title: str, kind: Format = "svg", *,
    from_s: float = 0.0, to_s: float | None = None,
) -> bytes:  # fmt: skip
    """The motion from `from_s` to `to_s`. Raises UsageError for an empty span.

    The same trajectory gives the same bytes.
    """
    end = end_of(trajectory.duration_s, from_s, to_s)
    motion, limits = trajectory.motion, trajectory.limits
    first, last = (int(motion.piece_at(np.array([t]))[0]) for t in (from_s, end))
    pieces = np.arange(first, last + 1)
    feed = feeds_of_pieces(motion, route)[pieces]

    def draw(plots: Sequence[Axes]) -> None:
        bands = _lines if len(pieces) <= _FEW else _bands
        drawn = bands(trajectory, pieces, from_s, end)
        time, speed = drawn[0], drawn[1]
        _draw(plots[0], time, speed[0], "0.2", "speed")
        edges = np.clip(motion.start_s[first : last + 2], from_s, end)
        shown = np.where(np.isfinite(feed), feed, np.nan)
        plots[0].stairs(shown, edges, baseline=None, color="tab:red", linewidth=0.8, label="feed")
        plots[0].set_ylabel("speed in mm/s")
        plots[0].set_ylim(bottom=0.0)
        bounds = (limits.velocity, limits.acceleration, limits.jerk)
        for plot, (name, unit), states, bound in zip(plots[1:], _QUANTITIES, drawn[2:], bounds, strict=True):
            for axis, colour, state, most in zip(AXES, _COLOURS, states, bound.tolist(), strict=True):
                _draw(plot, time, state, colour, axis)
                for limit in (most, -most):
                    plot.axhline(limit, color=colour, linewidth=0.7, linestyle=(0, (4, 3)))
            plot.set_ylabel(f"{name} in {unit}")
        plots[1].plot([], [], color="0.4", linewidth=0.7, linestyle=(0, (4, 3)), label="limit of the axis")

    return motion_picture(title, (from_s, end), kind, draw, names=4)


def _draw(plot: Axes, time: Array, state: Array, colour: str, label: str) -> None:
    """A line (2 equal rows), or the band between least and most."""
    low, high = state
    if low is high or (low == high).all():
        plot.plot(time, low, color=colour, linewidth=0.9, label=label)
    else:
        plot.fill_between(time, low, high, color=colour, linewidth=0.4, alpha=0.6, label=label)


def _states(trajectory: Trajectory, pieces: Index, from_s: float, to_s: float) -> tuple[Array, Array]:
    """(n,) times and (n, 10) speed, velocities, accelerations and jerks at instants of the pieces."""
    motion = trajectory.motion
    begin = np.maximum(motion.start_s[pieces], from_s)
    width = np.minimum(motion.start_s[pieces + 1], to_s) - begin
    time = begin[:, None] + width[:, None] * np.linspace(0.0, 1.0, _INSTANTS)
    u = time - motion.start_s[pieces, None]
    _, velocity, acceleration, jerk = motion.of(np.repeat(pieces, _INSTANTS), u.ravel())
    speed = np.sqrt((velocity * velocity).sum(axis=1))
    return time.ravel(), np.column_stack((speed, velocity, acceleration, jerk))


def _lines(
    trajectory: Trajectory, pieces: Index, from_s: float, to_s: float
) -> tuple[Array, Array, Array, Array, Array]:
    time, states = _states(trajectory, pieces, from_s, to_s)
    return _split(time, states.T, states.T)


def _bands(
    trajectory: Trajectory, pieces: Index, from_s: float, to_s: float
) -> tuple[Array, Array, Array, Array, Array]:
    """Least and most in each column of the picture."""
    low, high = np.full((_COLUMNS, 10), np.inf), np.full((_COLUMNS, 10), -np.inf)
    scale = _COLUMNS / (to_s - from_s)
    for a in range(0, len(pieces), _BLOCK):
        time, states = _states(trajectory, pieces[a : a + _BLOCK], from_s, to_s)
        column = np.clip(((time - from_s) * scale).astype(np.int64), 0, _COLUMNS - 1)
        np.minimum.at(low, column, states)
        np.maximum.at(high, column, states)
    middle: Array = from_s + (np.arange(_COLUMNS, dtype=float) + 0.5) / scale
    # columns inside a long piece have no sampled instant
    empty = np.flatnonzero(~np.isfinite(low[:, 0]))
    _, velocity, acceleration, jerk = trajectory.motion.at(middle[empty])
    speed = np.sqrt((velocity * velocity).sum(axis=1))
    low[empty] = high[empty] = np.column_stack((speed, velocity, acceleration, jerk))
    return _split(middle, low.T, high.T)


def _split(time: Array, low: Array, high: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Times, then speed (1, 2, n), velocities, accelerations and jerks (3, 2, n), least and most of each."""
    pair = np.stack((low, high), axis=1)
    return time, pair[:1], pair[1:4], pair[4:7], pair[7:]
