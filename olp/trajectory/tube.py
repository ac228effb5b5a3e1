"""Path and speed together: the fastest motion inside the tolerance tube, from one that others have planned.

The axes are cubic splines of time with free knots. Each cell has its segment of the route. Both inner
control points of its cubic are within the path tolerance of that segment. Where a cell has another segment
than the one before, the motion is as near to the waypoint between them. So the whole motion is inside the
tube, and passes the waypoints in order. Limits hold for control points of the velocity, for accelerations at
knots and the jerks of cells, which is everywhere. `olp.trajectory.descent` finds the least time.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.errors import CannotCompute
from olp.core.values import dataclass
from olp.trajectory.cells import halved, knots
from olp.trajectory.descent import Group, least_time
from olp.trajectory.forecast import straight
from olp.trajectory.motion import Motion
from olp.trajectory.route import AxisLimits, Route
from olp.trajectory.timespline import NODES, TimeSpline

#: share of the time of a straight move that a motion takes longer, where a faster one is sought
_GAIN = 3e-3
#: share of the tolerance within which the search begins
_BEGIN = 0.998
#: share of the tolerance by which the search begins beyond a waypoint where the feed changes
_ACROSS = 0.04
#: share of the tolerance that may be used
_USED = 1.0 - 1e-6
#: share of it beyond which a control point is pulled inside
_OUTSIDE = 0.999
#: turns of pulling control points inside
_PULLS = 30
#: factor by which the search begins slower than the limits allow
_SLOWED = 1.1
#: factor by which a spline may have to be slower than its motion before its cells are halved
_ROUGH = 1.1
#: a cell may become so much shorter ...
_SHORTEST = 0.1
#: ... and longer
_LONGEST = 5.0
#: share of the speed by which the motion may turn back along its segment, as rounding
_BACK = 1e-9
_TINY = 1e-300


def in_tube(route: Route, limits: AxisLimits, motion: Motion) -> Motion:
    """A faster motion of a run than `motion`, whose lines are segments of the route, as those of the result.

    Raises CannotCompute where none is found.
    """
    least_s = straight(route, limits, np.array([0, len(route) - 1]))[1][0]
    if motion.duration_s <= (1.0 + _GAIN) * least_s:
        raise CannotCompute("there is hardly any time to gain")
    moves = np.flatnonzero(np.ptp(route.point_mm, axis=0) > 0.0)
    own = Route(route.point_mm[:, moves], route.feed_mm_s, route.line, route.tolerance_mm, route.dwell_s)
    some = AxisLimits(*(limit[moves] for limit in (limits.velocity, limits.acceleration, limits.jerk)))
    flat = Motion(motion.start_s, motion.time, motion.path[:, :, moves], motion.shape, motion.line)
    spline, tube, segment = _start(own, some, flat)
    tube = tube.from_here(spline)
    found = least_time(spline, tube.bounds, float(own.tolerance_mm[1:-1].min()), tube.forward)
    if found.duration_s >= motion.duration_s:
        raise CannotCompute("no faster motion is found inside the tube")
    planned = found.motion(segment)
    path = np.zeros((len(planned.path), 4, route.point_mm.shape[1]))
    path[:, 0] = route.point_mm[0]
    path[:, :, moves] = planned.path
    return Motion(planned.start_s, planned.time, path, planned.shape, planned.line)


def _start(route: Route, limits: AxisLimits, motion: Motion) -> tuple[TimeSpline, _Tube, Index]:
    """The spline from which the search begins, its tube, and the segments of its cells. A motion that cannot
    be pulled inside with new cells keeps its own. Raises CannotCompute."""
    spline, tube, segment = _spline(route, limits, motion)
    try:
        spline = tube.inside(spline)
        return spline.slowed(_SLOWED * tube.excess(spline)), tube, segment
    except CannotCompute:
        own = _itself(route, limits, motion)
        if own is None:
            raise
        return own


def _itself(route: Route, limits: AxisLimits, motion: Motion) -> tuple[TimeSpline, _Tube, Index] | None:
    """The same with the cells of the motion itself; None where that is not inside. One that was searched in
    a tube is: it may be as near to the bounds as no pull leaves it."""
    if not motion.cubic or (np.diff(motion.start_s) <= 0.0).any():
        return None
    tube, spline = _Tube.of(route, limits, motion.line), TimeSpline.through(motion, motion.start_s)
    spline = spline.slowed(_SLOWED * tube.excess(spline))
    bounds = tube.from_here(spline).bounds(spline, False)
    inside = all((group.slack() > 0.0).all() for group in bounds)
    return (spline, tube, motion.line) if inside else None


def _spline(route: Route, limits: AxisLimits, motion: Motion) -> tuple[TimeSpline, _Tube, Index]:
    """The spline of a motion, its tube, and the segments of its cells. Cells are halved where the spline is
    not near enough to the motion. Raises CannotCompute."""
    knot_s, segment = knots(route, limits, motion)
    while True:
        tube, spline = _Tube.of(route, limits, segment), TimeSpline.through(motion, knot_s)
        finer = halved(route, limits, knot_s, segment, tube.rough(spline))
        if finer is None:
            return spline, tube, segment
        knot_s, segment = finer


@dataclass(frozen=True, slots=True, eq=False)
class _Tube:
    """What bounds a spline whose cells have segments from `begin` (m, axes) along `unit` (m, axes) for
    `length` (m,), within `wide` (m,) mm. It passes inner knots `knot` (w,) within `ball` (w,) mm of the
    waypoints `centre` (w, axes), and on that `side` (w, axes) of them, over mm, where the faster of two
    segments is. `feed` (m - 2,) is that of d1[2:m], `cell_s` (m,) are the first lengths."""

    limits: AxisLimits
    begin: Array
    unit: Array
    length: Array
    wide: Array
    knot: Index
    centre: Array
    ball: Array
    side: Array
    feed: Array
    cell_s: Array

    @staticmethod
    def of(route: Route, limits: AxisLimits, segment: Index) -> _Tube:
        begin = route.point_mm[segment]
        delta = route.point_mm[segment + 1] - begin
        length = np.sqrt((delta * delta).sum(axis=1))
        tolerance = route.tolerance_mm
        change = 1 + np.flatnonzero(np.diff(segment))
        skipped = np.diff(segment)[change - 1]
        knot = np.repeat(change, skipped)
        waypoint = segment[knot] - (np.repeat(np.cumsum(skipped), skipped) - np.arange(len(knot)) - 1)
        feed = route.feed_mm_s[segment]
        # d1[j + 1] is in the middle of cell j, and is a part of both its neighbours
        least = np.minimum(np.minimum(feed[:-2], feed[1:-1]), feed[2:])
        return _Tube(
            limits, begin, delta / np.maximum(length, _TINY)[:, None], length,
            np.maximum(tolerance[segment], tolerance[segment + 1]), knot, route.point_mm[waypoint],
            tolerance[waypoint], _sides(route, waypoint), least, np.ones(len(segment)),
        )  # fmt: skip

    def from_here(self, spline: TimeSpline) -> _Tube:
        """The same for lengths of cells near those of a spline."""
        return replace(self, cell_s=spline.cell_s)

    def bounds(self, spline: TimeSpline, slopes: bool) -> list[Group]:
        """All bounds."""
        m, axes = len(spline), spline.coefficient.shape[1]
        rates = spline.rates()
        none = np.zeros((0, axes, NODES, axes + 1))
        by1, by2, by3 = rates.slopes() if slopes else (none, none, none)
        first = np.arange(-1, m)
        groups = []
        for own, value, slope, most in (
            (slice(0, m), rates.d3, by3, self.limits.jerk),
            (slice(1, m), rates.d2, by2, self.limits.acceleration),
            (slice(2, m), rates.d1, by1, self.limits.velocity),
        ):
            groups.append(Group(first[own], value[own] / most, True, slope[own] / most[:, None, None]))
        groups.append(_round(first[2:m], rates.d1[2:m], self.feed, by1[2:m]))
        for place in spline.controls():
            off, across = self._off(place.point())
            slope = across @ place.slope().reshape(m, axes, -1) if slopes else none
            groups.append(_round(np.arange(m), off, _USED * self.wide, slope.reshape(-1, *none.shape[1:])))
        place_mm, by_c, by_h = spline.at_knots(self.knot)
        slope = np.zeros((len(self.knot) if slopes else 0, *none.shape[1:]))
        if slopes:
            for i in range(axes):
                slope[:, i, 1:4, i] = by_c
            slope[:, :, :4, axes] = by_h.transpose(0, 2, 1)
        off = place_mm - self.centre
        groups.append(replace(_round(self.knot - 1, off, _USED * self.ball, slope), scattered=True))
        some = np.flatnonzero(self.side.any(axis=1))
        beyond = 1.0 - (off[some] * self.side[some]).sum(axis=1)
        along = none[:, :1]
        if slopes:
            along = -np.einsum("ri,riqb->rqb", self.side[some], slope[some])[:, None]
        groups.append(Group(self.knot[some] - 1, beyond[:, None], False, along, scattered=True))
        middle, half = 0.5 * (_LONGEST + _SHORTEST), 0.5 * (_LONGEST - _SHORTEST)
        slope = np.zeros((m if slopes else 0, 1, NODES, axes + 1))
        if slopes:
            slope[:, 0, 1, axes] = 1.0 / self.cell_s / half
        share = (spline.cell_s / self.cell_s - middle) / half
        return [*groups, Group(np.arange(m), share[:, None], True, slope)]

    def _off(self, point: Array) -> tuple[Array, Array]:
        """(m, axes) from the nearest places of their segments to points (m, axes), and the matrices
        (m, axes, axes) of its change."""
        gone = point - self.begin
        along = (gone * self.unit).sum(axis=1)
        beside = (along > 0.0) & (along < self.length)
        off = gone - np.clip(along, 0.0, self.length)[:, None] * self.unit
        own = np.where(beside[:, None], self.unit, 0.0)
        return off, np.eye(point.shape[1]) - own[:, :, None] * own[:, None, :]

    def inside(self, spline: TimeSpline) -> TimeSpline:
        """The spline with coefficients pulled until all is in the tube. Raises CannotCompute."""
        c = spline.coefficient.copy()
        cell = np.arange(len(spline))
        for _ in range(_PULLS):
            here = TimeSpline(c, spline.cell_s)
            move, count = np.zeros_like(c), np.zeros(len(c))
            rows = [(cell + 1, self._off(place.point())[0], self.wide, 2) for place in here.controls()]
            rows.append((self.knot, here.at_knots(self.knot)[0] - self.centre, self.ball, 3))
            for node, off, wide, nodes in rows:
                far = np.sqrt((off * off).sum(axis=1))
                out = np.flatnonzero(far > _OUTSIDE * wide)
                back = off[out] * (1.0 - _BEGIN * wide[out] / far[out])[:, None]
                for k in range(nodes):
                    np.add.at(move, node[out] + k, back)
                    np.add.at(count, node[out] + k, 1.0)
            # across the waypoints where the feed changes, if not yet
            size = np.maximum((self.side * self.side).sum(axis=1), _TINY)
            short = _ACROSS - (rows[-1][1] * self.side).sum(axis=1)
            out = np.flatnonzero(self.side.any(axis=1) & (short > 0.5 * _ACROSS))
            across = -(short[out] / size[out])[:, None] * self.side[out]
            for k in range(3):
                np.add.at(move, self.knot[out] + k, across)
                np.add.at(count, self.knot[out] + k, 1.0)
            if not count.any():
                return here
            c[3:-3] -= (move / np.maximum(count, 1.0)[:, None])[3:-3]
        raise CannotCompute("the motion is not inside the tube")

    def rough(self, spline: TimeSpline) -> Mask:
        """(m,) the cells in which a spline through a motion leaves the tube, or exceeds limits by far."""
        knot, *cells = self._excesses(spline)
        rough: Mask = np.any([cell > _ROUGH for cell in cells], axis=0)
        rough |= np.maximum(knot[:-1], knot[1:]) > _ROUGH
        for place in spline.controls():
            off = self._off(place.point())[0]
            rough |= np.sqrt((off * off).sum(axis=1)) > self.wide
        off = spline.at_knots(self.knot)[0] - self.centre
        far = self.knot[np.sqrt((off * off).sum(axis=1)) > self.ball]
        rough[far - 1] = rough[far] = True
        return rough

    def excess(self, spline: TimeSpline) -> float:
        """The factor by which a spline has to be slower to keep all limits."""
        return max(float(some.max(initial=0.0)) for some in self._excesses(spline))

    def _excesses(self, spline: TimeSpline) -> tuple[Array, Array, Array, Array]:
        """The same of each knot (m + 1,) for its acceleration, and of each cell (m,) for its velocity, feed
        and jerk."""
        rates, limits = spline.rates(), self.limits
        velocity = rates.d1[1:-1]
        speed = np.sqrt((velocity * velocity).sum(axis=1))
        return (
            np.sqrt((np.abs(rates.d2) / limits.acceleration).max(axis=1)),
            (np.abs(velocity) / limits.velocity).max(axis=1),
            speed / np.concatenate((self.feed[:1], self.feed, self.feed[-1:])),
            np.cbrt((np.abs(rates.d3) / limits.jerk).max(axis=1)),
        )

    def forward(self, spline: TimeSpline) -> bool:
        """Whether the motion nowhere turns back: one after the other, its velocities lead along the segment
        of their cell, or one beside it, and never along one before that again."""
        rates, h, m = spline.rates(), spline.lengths(), len(spline)
        knot = np.arange(m + 1)
        both = h[knot + 1] + h[knot + 2]
        share = (h[knot + 1] / both)[:, None]
        at_knot = rates.d1[knot] + share * (rates.d1[knot + 1] - rates.d1[knot])
        controls = np.stack((at_knot[:-1], rates.d1[1:-1], at_knot[1:]), axis=1)
        back = _BACK * max(float(np.abs(rates.d1).max()), _TINY)
        change = np.flatnonzero((np.diff(self.begin, axis=0) != 0.0).any(axis=1))
        of = np.concatenate(([0], change + 1))
        own = np.searchsorted(of, np.arange(m), side="right") - 1
        # along the segments before, of and behind each cell
        beside = self.unit[of[np.clip(own[:, None] + np.arange(-1, 2), 0, len(of) - 1)]]
        along = np.einsum("jkx,jsx->jks", controls, beside) >= -back
        now = 0
        for segment, some in zip(own.tolist(), along.tolist(), strict=True):
            for ways in some:
                now = max(now, segment - 1)
                while now <= segment + 1 and not ways[now - segment + 1]:
                    now += 1
                if now > segment + 1:
                    return False
        return True


def _round(base: Index, value: Array, most: Array, slope: Array) -> Group:
    """Bounds of the length of vectors `value` (r, axes), which change by `slope`."""
    over = 1.0 / most
    share = value * over[:, None]
    rows = slope * over[: len(slope), None, None, None]
    along = 2.0 * np.einsum("ri,riqb->rqb", share[: len(slope)], rows)
    return Group(base, (share * share).sum(axis=1)[:, None], False, along[:, None], np.sqrt(2.0) * rows)


def _sides(route: Route, waypoint: Index) -> Array:
    """(w, axes) the direction of the path at waypoints, over the tolerance, where the segment behind has more
    feed. Against that direction where it has less, 0 where both have the same."""
    point = route.point_mm
    delta = np.diff(point, axis=0)
    unit = delta / np.maximum(np.sqrt((delta * delta).sum(axis=1)), _TINY)[:, None]
    both = unit[waypoint - 1] + unit[waypoint]
    both /= np.maximum(np.sqrt((both * both).sum(axis=1)), _TINY)[:, None]
    before, behind = route.feed_mm_s[waypoint - 1], route.feed_mm_s[waypoint]
    sign = (behind > before).astype(float) - (behind < before)
    return np.asarray(both * (sign / route.tolerance_mm[waypoint])[:, None])
