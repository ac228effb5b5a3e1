"""What a motion really asks of the axes: its largest velocity, acceleration, jerk and feed against limits.

Where the axes are cubics of time (a straight path, or a path driven at constant rate) the extremes are
those of quadratics and lines, in closed form. Elsewhere the polynomials are of degree nine and more. There
the extremes of the path's derivatives, times those of the parameter's, bound the axes. Where that bound is
above a limit, branch and bound finds the largest values.
"""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Mask
from olp.core.errors import UsageError
from olp.core.values import dataclass
from olp.trajectory.extremes import largest as extreme
from olp.trajectory.extremes import nodes
from olp.trajectory.motion import Motion
from olp.trajectory.pieces import Pieces, bernstein, blocks, dot
from olp.trajectory.route import AxisLimits

#: points per piece at which the speed along the path is evaluated, ends included
_SPEED_POINTS = 5
#: a bound above a limit by this share of it is rounding
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Ratios:
    """Largest ratios to the limits: `velocity`, `acceleration`, `jerk` (axes,) per axis, and `feed` along the
    path (0 without feeds). A value up to 1 may be a bound that the motion does not reach."""

    velocity: Array
    acceleration: Array
    jerk: Array
    feed: float

    def slowed(self, factor: float) -> Ratios:
        """The ratios of the same motion in `factor` times the time."""
        return Ratios(
            self.velocity / factor, self.acceleration / factor**2, self.jerk / factor**3, self.feed / factor
        )

    def with_those(self, other: Ratios) -> Ratios:
        """The ratios of two motions, one after the other."""
        return Ratios(
            np.maximum(self.velocity, other.velocity),
            np.maximum(self.acceleration, other.acceleration),
            np.maximum(self.jerk, other.jerk),
            max(self.feed, other.feed),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Audit(Ratios):
    """Ratios, and the largest jumps where pieces join: `position_jump_mm`, `velocity_jump_mm_s`,
    `acceleration_jump_mm_s2`. Times are floats: at t seconds a position jump of the speed times t / 2^53 is
    rounding. The ends of the motion are not joins."""

    position_jump_mm: float
    velocity_jump_mm_s: float
    acceleration_jump_mm_s2: float


def audit(motion: Motion, limits: AxisLimits, feed_mm_s_by_piece: Array | None = None) -> Audit:
    """Ratios of the motion to the axis limits, and to the feed of each piece (k,) (inf: none), and its jumps.

    Raises UsageError if the feeds are not one for each piece.
    """
    return with_jumps(motion, ratios(motion, limits, feed_mm_s_by_piece))


def ratios(motion: Motion, limits: AxisLimits, feed_mm_s_by_piece: Array | None = None) -> Ratios:
    """The ratios without the jumps. Raises as `audit`."""
    if feed_mm_s_by_piece is not None and feed_mm_s_by_piece.shape != (len(motion),):
        raise UsageError(f"feeds have shape {feed_mm_s_by_piece.shape}; expected ({len(motion)},)")
    most = np.stack((limits.velocity, limits.acceleration, limits.jerk))
    largest, feed = np.zeros((3, motion.axes)), 0.0
    for part, pieces in blocks(motion):
        given = None if feed_mm_s_by_piece is None else feed_mm_s_by_piece[part]
        largest, feed = _of(pieces, most, given, (largest, feed))
    velocity, acceleration, jerk = largest
    return Ratios(velocity, acceleration, jerk, feed)


def slowing(result: Ratios) -> float:
    """The factor, 1 or more, by which the motion has to take longer to keep every limit."""
    return max(
        1.0,
        float(result.velocity.max()),
        result.feed,
        float(np.sqrt(result.acceleration.max())),
        float(np.cbrt(result.jerk.max())),
    )


def with_jumps(motion: Motion, known: Ratios) -> Audit:
    """The audit of a motion whose ratios are known."""
    jumps = np.zeros(3)
    last: list[Array] = []
    for _, pieces in blocks(motion):
        begin = _states(pieces, pieces.time[0], pieces.time[1], 2.0 * pieces.time[2])
        end = _states(pieces, *pieces.parameters(pieces.seconds)[:3])
        for i, (a, b) in enumerate(zip(begin, end, strict=True)):
            jumps[i] = max(jumps[i], np.abs(a[:, 1:] - b[:, :-1]).max(initial=0.0))
            if last:
                jumps[i] = max(jumps[i], np.abs(a[:, 0] - last[i]).max())
        last = [e[:, -1] for e in end]
    position, velocity, acceleration = jumps.tolist()
    return Audit(known.velocity, known.acceleration, known.jerk, known.feed, position, velocity, acceleration)


def _states(pieces: Pieces, s: Array, s1: Array, s2: Array) -> tuple[Array, Array, Array]:
    """(3, n) position, velocity and acceleration where the parameter and its derivatives are (n,)."""
    slope = pieces.slopes(s)
    return pieces.positions(s), slope * s1, pieces.bends(s) * (s1 * s1) + slope * s2


def _of(pieces: Pieces, most: Array, feed: Array | None, before: tuple[Array, float]) -> tuple[Array, float]:
    """(3, axes) largest ratios to `most`, and of the speed to the feed; never below those `before`."""
    value, speed, exact, even = _bounds(pieces)
    ratio = value / most[:, :, None]
    share = np.zeros_like(speed) if feed is None else speed / feed
    closely = ~exact & ~((ratio <= 1.0 + _ROUNDING).all(axis=(0, 1)) & (share <= 1.0 + _ROUNDING))
    rows = np.flatnonzero(~closely)
    largest = np.maximum(before[0], ratio[:, :, rows].max(axis=2, initial=0.0))
    fastest = max(before[1], float(share[~closely & (even | ~exact)].max(initial=0.0)))
    rows = np.flatnonzero(closely)
    if rows.size:
        largest, fastest = _exactly(
            pieces.take(rows), most, None if feed is None else feed[rows], largest, fastest
        )
    # a bound below a value reached elsewhere needs no exact value
    rows = np.flatnonzero(exact & ~even & (share > fastest))
    if feed is not None and rows.size:
        fastest = max(fastest, float((_fastest(pieces.take(rows)) / feed[rows]).max()))
    return largest, fastest


def _exactly(
    pieces: Pieces, most: Array, feed: Array | None, largest: Array, fastest: float
) -> tuple[Array, float]:
    """The same of pieces of any degree, by branch and bound; below 1 values are bounds."""
    degree = 3 * (len(pieces.time) - 1) - 1
    third = 6.0 * pieces.path[3]
    values = np.empty((degree + 1, 3, *pieces.path.shape[1:]))
    for row, share in zip(values, nodes(degree), strict=True):
        s, s1, s2, s3 = pieces.parameters(share * pieces.seconds)
        slope, bend = pieces.slopes(s), pieces.bends(s)
        row[0] = slope * s1
        row[1] = bend * (s1 * s1) + slope * s2
        row[2] = third * s1**3 + bend * (3.0 * s1 * s2) + slope * s3
    if feed is not None:
        fastest = max(fastest, extreme(values[:, 0] / feed, max(fastest, 1.0)))
    values /= most[:, :, None]
    extremes = np.array([
        [extreme(values[:, i, axis, None], max(1.0, largest[i, axis])) for axis in range(len(third))]
        for i in range(3)
    ])  # fmt: skip
    return np.maximum(largest, extremes), fastest


def _bounds(pieces: Pieces) -> tuple[Array, Array, Mask, Mask]:
    """(3, axes, n) bounds of velocity, acceleration and jerk, and (n,) of the speed along the path.

    The masks (n,) mark where the axes' bounds are exact, and where the speed's is."""
    rate, cubic = _rates(pieces)
    low, high = pieces.reach()
    first, last = pieces.slopes(low), pieces.slopes(high)
    bend, bend_last = pieces.bends(low), pieces.bends(high)
    third = 6.0 * pieces.path[3]
    with np.errstate(all="ignore"):
        # the slope is a parabola: it is largest at an end, or where its own slope is zero
        turn = -bend / third
        turn = np.where((turn > 0.0) & (turn < high - low), turn, 0.0)
    inside = first + turn * (bend + 0.5 * turn * third)
    m1 = np.maximum(np.maximum(np.abs(first), np.abs(last)), np.abs(inside))
    m2 = np.maximum(np.abs(bend), np.abs(bend_last))
    m3 = np.abs(third)
    value = np.empty((3, *m1.shape))
    value[0] = m1 * rate[0]
    value[1] = m2 * (rate[0] * rate[0]) + m1 * rate[1]
    value[2] = (m3 * rate[0] ** 2 + 3.0 * m2 * rate[1]) * rate[0] + m1 * rate[2]
    middle = first + (0.5 * (high - low)) * bend
    far = np.maximum(np.maximum(_square(first), _square(last)), _square(middle))
    straight = pieces.straight()
    steady: Mask = np.logical_not(np.any(pieces.time[2:], axis=0))
    even: Mask = straight & cubic
    return value, np.sqrt(far) * rate[0], np.logical_or(even, steady), even


def _rates(pieces: Pieces) -> tuple[Array, Mask]:
    """(3, n) largest absolute derivatives of the parameter, and where they are exact (cubics); elsewhere
    they are bounds."""
    u = pieces.seconds
    _, b, c, d = pieces.time[:4]
    cubic: Mask = np.asarray(~pieces.time[4:].any(axis=0))
    with np.errstate(all="ignore"):
        turn = -c / (3.0 * d)
        turn = np.where((turn > 0.0) & (turn < u), turn, 0.0)
    rate = np.empty((3, len(u)))
    end = b + u * (2.0 * c + 3.0 * u * d)
    inside = b + turn * (2.0 * c + 3.0 * turn * d)
    rate[0] = np.maximum(np.maximum(np.abs(b), np.abs(end)), np.abs(inside))
    rate[1] = np.maximum(np.abs(2.0 * c), np.abs(2.0 * c + 6.0 * u * d))
    rate[2] = np.abs(6.0 * d)
    rows = np.flatnonzero(~cubic)
    if rows.size:
        derived = pieces.time[:, rows]
        for order in range(3):
            derived = derived[1:] * np.arange(1.0, len(derived))[:, None]
            rate[order, rows] = np.abs(bernstein(derived, u[rows])).max(axis=0)
    return rate, cubic


def _square(vector: Array) -> Array:
    """(n,) squared norms of (3, n)."""
    return dot(vector, vector)


def _fastest(pieces: Pieces) -> Array:
    """(n,) largest speed along the path of pieces driven at constant rate."""
    rate, seconds = np.abs(pieces.time[1]), pieces.seconds
    start, step = pieces.time[0], pieces.time[1]
    third = 6.0 * pieces.path[3]
    best, time_s = np.full(len(seconds), -1.0), np.zeros(len(seconds))
    for share in np.linspace(0.0, 1.0, _SPEED_POINTS):
        value = _square(pieces.slopes(start + share * seconds * step))
        time_s = np.where(value > best, share * seconds, time_s)
        best = np.maximum(value, best)
    # from the best of these points to the maximum, where slope and bend are at right angles, by Newton
    for _ in range(4):
        s = start + time_s * step
        slope, bend = pieces.slopes(s), pieces.bends(s)
        climb, curve = dot(slope, bend), _square(bend) + dot(slope, third)
        with np.errstate(all="ignore"):
            trial = np.where(curve < 0.0, time_s - climb / (curve * step), time_s)
        trial = np.clip(np.nan_to_num(trial), 0.0, seconds)
        value = _square(pieces.slopes(start + trial * step))
        time_s = np.where(value > best, trial, time_s)
        best = np.maximum(value, best)
    return np.asarray(np.sqrt(best) * rate)
