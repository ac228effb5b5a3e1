"""Pieces of a path in the plane of X and Y: lines and arcs, their directions, corners between them."""

from __future__ import annotations

import math

import numpy as np

from olp.core.values import dataclass
from olp.program.contours.meeting import Carriers, meeting

#: by which an end may be off a piece, as a share of its size
_OFF = 1e-9
_FULL = 2 * math.pi
#: rad; a smaller change of direction is no corner
_SMOOTH_RAD = 1e-6

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Piece:
    """A line, or an arc where `sweep` is not 0, about `centre`."""

    start: Point
    end: Point
    centre: Point = (math.nan, math.nan)
    sweep: float = 0.0

    @property
    def size(self) -> float:
        """The radius of an arc, the length of a line."""
        return math.dist(self.start, self.centre if self.sweep else self.end)

    def heading(self, *, last: bool) -> float | None:
        """rad; the direction at the end or at the beginning; None where the piece has no length."""
        if not self.sweep:
            d = (self.end[0] - self.start[0], self.end[1] - self.start[1])
            return None if math.hypot(*d) < _OFF else math.atan2(d[1], d[0])
        point = self.end if last else self.start
        arm = math.atan2(point[1] - self.centre[1], point[0] - self.centre[0])
        return arm + math.copysign(math.pi / 2, self.sweep)

    def across(self, off: float, *, last: bool) -> Point:
        """The point that is `off` to the left of the end or of the start."""
        heading = self.heading(last=last)
        assert heading is not None
        x, y = self.end if last else self.start
        return x - off * math.sin(heading), y + off * math.cos(heading)

    def share(self, point: Point) -> float:
        """Where a point on the carrier is: 0 at the start, 1 at the end."""
        if not self.sweep:
            d = (self.end[0] - self.start[0], self.end[1] - self.start[1])
            along = (point[0] - self.start[0]) * d[0] + (point[1] - self.start[1]) * d[1]
            return along / (d[0] ** 2 + d[1] ** 2)
        turn = (_arm(point, self.centre) - _arm(self.start, self.centre)) * math.copysign(1.0, self.sweep)
        return _wrapped(turn, _FULL) / abs(self.sweep)

    def part(self, start: Point, end: Point) -> Piece:
        """The piece between two points on it."""
        if not self.sweep:
            return Piece(start, end)
        return Piece(start, end, self.centre, self.sweep * (self.share(end) - self.share(start)))

    def carrier(self, off: float, *, last: bool = False) -> Carriers:
        """What lies beside the piece, to the left of it by `off`. That of an arc goes through its start, with
        `last` through its end, which digits may put on another circle."""
        heading = self.heading(last=True)
        assert heading is not None
        along = np.array([[math.cos(heading), math.sin(heading)]])
        point = np.array([self.end]) + off * np.array([[-math.sin(heading), math.cos(heading)]])
        size = 0.0
        if self.sweep:
            size = math.dist(self.end if last else self.start, self.centre)
            size -= math.copysign(off, self.sweep * off)
        return Carriers(
            np.array([self.sweep != 0.0]), point, along, np.array([self.centre]), np.array([max(size, 0.0)])
        )

    def foot(self, point: Point) -> Point:
        """The point of the carrier that is nearest to a point."""
        if self.sweep:
            arm = _arm(point, self.centre)
            return self.centre[0] + self.size * math.cos(arm), self.centre[1] + self.size * math.sin(arm)
        share = self.share(point)
        return (
            self.start[0] + share * (self.end[0] - self.start[0]),
            self.start[1] + share * (self.end[1] - self.start[1]),
        )


def _arm(point: Point, centre: Point) -> float:
    return math.atan2(point[1] - centre[1], point[0] - centre[0])


def _wrapped(angle: float, limit: float) -> float:
    turn = angle % limit
    return turn if turn < limit - 1e-9 else 0.0


def tangent_arc(start: Point, heading: float, end: Point) -> Piece:
    """The arc that begins in a direction and ends in a point; a line where that is straight ahead."""
    d = (end[0] - start[0], end[1] - start[1])
    off = (math.atan2(d[1], d[0]) - heading + math.pi) % _FULL - math.pi
    if abs(off) < _SMOOTH_RAD:
        return Piece(start, end)
    radius = math.hypot(*d) / (2 * math.sin(off))
    centre = (start[0] - radius * math.sin(heading), start[1] + radius * math.cos(heading))
    return Piece(start, end, centre, 2 * off)


def turn_between(a: Piece, b: Piece) -> float:
    """rad; how far the direction turns to the left from one piece to the next; NaN where one has none."""
    first, second = a.heading(last=True), b.heading(last=False)
    if first is None or second is None:
        return math.nan
    return (second - first + math.pi) % _FULL - math.pi


def rounded(a: Piece, b: Piece, radius: float) -> tuple[Piece, Piece | None, Piece] | None:
    """Two pieces with a rounding between them; without one where they go on smoothly; None where it does not
    fit."""
    turn = turn_between(a, b)
    if not abs(turn) > _SMOOTH_RAD:
        return a, None, b
    off = math.copysign(radius, turn)
    found = meeting(a.carrier(off), b.carrier(off), np.array([a.end]))[0]
    if np.isnan(found).any():
        return None
    centre = (float(found[0]), float(found[1]))
    begin, end = a.foot(centre), b.foot(centre)
    if not (-_OFF <= a.share(begin) <= 1 + _OFF and -_OFF <= b.share(end) <= 1 + _OFF):
        return None
    sweep = _arm(end, centre) - _arm(begin, centre)
    sweep = math.copysign((sweep * math.copysign(1.0, turn)) % _FULL, turn)
    return a.part(a.start, begin), Piece(begin, end, centre, sweep), b.part(end, b.end)


def chamfered(a: Piece, b: Piece, length: float) -> tuple[Piece, Piece | None, Piece] | None:
    """Two lines with a chamfer that takes `length` from both; None where it does not fit."""
    if a.sweep or b.sweep or a.size < length or b.size < length:
        return None
    begin = _along(a.end, a.start, length)
    end = _along(b.start, b.end, length)
    return Piece(a.start, begin), Piece(begin, end), Piece(end, b.end)


def _along(origin: Point, toward: Point, length: float) -> Point:
    share = length / math.dist(origin, toward)
    return origin[0] + share * (toward[0] - origin[0]), origin[1] + share * (toward[1] - origin[1])
