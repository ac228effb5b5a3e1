"""The motion along the routes of a machine with rotary joints: planned, and what it uses of its limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from olp.compensation.joints.motion import Motion
from olp.core.arrays import Array, Index
from olp.core.progress import Progress
from olp.core.values import dataclass
from olp.trajectory.contest import stops_of
from olp.trajectory.from_joints import JointRoute
from olp.trajectory.plan import Trajectory, plan, with_stops
from olp.trajectory.route import AxisLimits

#: Rounds in which feeds are lowered where the tip is faster than its feed.
_ROUNDS = 5
#: Where the tip is faster than its feed by more than this share of it, feeds are lowered; where by less, the
#: motion between two rests is slowed down.
_FASTER = 1e-3
#: Samples of a piece of the motion at which the tip is looked at, as shares of its time.
_SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)
#: Why no run is searched for a faster motion in a tube.
NO_TUBES = "a tube bounds axes, and here feed and tolerance are those of the tip"
#: Pieces that are looked at together.
_BLOCK = 1 << 14


@dataclass(frozen=True, slots=True, eq=False)
class Stretch:
    """A motion between rests at unknown positions. By piece (p,): `ratio` is the speed of the tip to its feed
    at most. `limit` is the limit that it is nearest to: three of each axis, -1 is the feed."""

    motion: Motion
    route: JointRoute
    trajectory: Trajectory
    ratio: Array
    limit: Index

    def in_axes(self) -> Trajectory:
        """The same in mm and deg of the axes, with the lines of the program."""
        found, scale = self.trajectory, self.route.scale
        pieces, limits = found.motion, found.limits
        motion = replace(pieces, path=pieces.path / scale, line=self.route.line[pieces.line])
        bounds = AxisLimits(limits.velocity / scale, limits.acceleration / scale, limits.jerk / scale)
        return replace(found, motion=motion, limits=bounds)

    def turning(self) -> int:
        """How many runs between rests have a waypoint, where a tube might make them faster."""
        return int((np.diff(stops_of(with_stops(self.route.route))) > 1).sum())

    def tip_speed(self, position: Array, velocity: Array, segment: Index) -> Array:
        """(n,) mm/s of the tip in the workpiece at (n, axes) positions and velocities in the space of the
        route, on segments (n,)."""
        return _tip_speed(self.motion, self.route, position, velocity, segment)


def planned(
    motion: Motion, route: JointRoute, limits: AxisLimits, tell: Progress, optimise: bool | None = None
) -> Stretch:
    """The motion of a route, again with lower feeds where the tip would be faster than its own, and at last
    slower. `limits` are those of the axes in mm and deg, `optimise` is that of `plan`."""
    scaled = AxisLimits(
        limits.velocity * route.scale, limits.acceleration * route.scale, limits.jerk * route.scale
    )
    for left in reversed(range(_ROUNDS)):
        # the bound of the tip holds for paths along the route, and rounds with lower feeds for one path
        found = plan(route.route, scaled, tell, optimise=optimise, tubes=False)
        ratio, limit = _used(motion, route, found, scaled)
        factor = np.ones(len(route.line))
        np.maximum.at(factor, found.motion.line, ratio)
        if left == 0 or not (factor > 1.0 + _FASTER).any():
            return _eased(Stretch(motion, route, found, ratio, limit))
        route = route.slower(factor)
    raise AssertionError("the last round returns")


def _eased(stretch: Stretch) -> Stretch:
    """The same with each leg as much slower as the tip is faster than its feed: nothing is faster then."""
    found = stretch.trajectory
    pieces, moves = found.motion, (found.motion.time[:, 1:] != 0.0).any(axis=1)
    factor, legs = np.ones(len(pieces)), []
    width = np.diff(pieces.start_s)
    for leg in found.legs:
        some = slice(*np.searchsorted(pieces.line, (leg.first, leg.last)).tolist())
        most = float(stretch.ratio[some].max(initial=1.0))
        factor[some] = np.where(moves[some], most, 1.0)
        more = float((factor[some] - 1.0) @ width[some])
        legs.append(replace(leg, duration_s=leg.duration_s + more, factor=leg.factor * most))
    if not (factor > 1.0).any():
        return stretch
    start = np.concatenate((pieces.start_s[:1], pieces.start_s[0] + np.cumsum(width * factor)))
    time = pieces.time * factor[:, None] ** -np.arange(float(pieces.time.shape[1]))
    slower = replace(pieces, start_s=start, time=time)
    trajectory = replace(found, motion=slower, legs=tuple(legs))
    return replace(stretch, trajectory=trajectory, ratio=stretch.ratio / factor)


def _used(motion: Motion, route: JointRoute, found: Trajectory, limits: AxisLimits) -> tuple[Array, Index]:
    """`ratio` and `limit` of a stretch. The limits of an axis are velocity, acceleration and jerk."""
    pieces = found.motion
    count, seconds = len(pieces), np.diff(pieces.start_s)
    ratio, most = np.zeros(count), np.zeros((count, 3 * len(limits.velocity)))
    bounds = (limits.velocity, limits.acceleration, limits.jerk)
    for a in range(0, count, _BLOCK):
        piece = np.arange(a, min(a + _BLOCK, count))
        segment, speeds = pieces.line[piece], np.empty((len(_SHARES), len(piece)))
        for sample, share in enumerate(_SHARES):
            position, *rates = pieces.of(piece, share * seconds[piece])
            for k, (rate, bound) in enumerate(zip(rates, bounds, strict=True)):
                most[piece, k::3] = np.maximum(most[piece, k::3], np.abs(rate) / bound)
            speeds[sample] = _tip_speed(motion, route, position, rates[0], segment)
        ratio[piece] = _highest(speeds) / route.feed_mm_s[segment]
    nearest = most.argmax(axis=1)
    return ratio, np.where(ratio >= most.max(axis=1), -1, nearest)


def _highest(samples: Array) -> Array:
    """(n,) the largest values of curves by (k, n) samples, between them by parabolas through three."""
    left, middle, right = samples[:-2], samples[1:-1], samples[2:]
    slope, bend = (right - left) / 2.0, right - 2.0 * middle + left
    with np.errstate(divide="ignore", invalid="ignore"):
        inside = (bend < 0.0) & (np.abs(slope) < -bend)
        top = np.where(inside, middle - slope * slope / (2.0 * bend), 0.0)
    return np.asarray(np.maximum(samples.max(axis=0), top.max(axis=0)), float)


def _tip_speed(
    motion: Motion, route: JointRoute, position: Array, velocity: Array, segment: Index
) -> Array:  # fmt: skip
    slopes = motion.slopes(position / route.scale, route.tool[segment])[:, :3]
    rotary = np.array([unit == "deg" for unit in motion.structure.units])
    rate = velocity / route.scale
    tip = np.einsum("nij,nj->ni", slopes, np.where(rotary, np.radians(rate), rate))
    return np.asarray(np.linalg.norm(tip, axis=1))


def seconds_by_line(stretches: tuple[Stretch, ...], lines: Index) -> Array:
    """(m,) seconds that the motion takes on lines (m,), which rise."""
    seconds = np.zeros(len(lines))
    for one in stretches:
        pieces = one.trajectory.motion
        row = np.searchsorted(lines, one.route.line[pieces.line])
        np.add.at(seconds, row, np.diff(pieces.start_s))
    return seconds
