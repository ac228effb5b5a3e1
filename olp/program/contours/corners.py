"""Corners that a control rounds or chamfers by itself, in the plane of the contour: where they begin and end.

A rounding is the circle that touches both elements beside the corner. A chamfer is the straight line between
the points that are equally far from the corner on both.
"""

from __future__ import annotations

import math

import numpy as np

from olp.core.errors import ProgramError
from olp.core.values import dataclass
from olp.program.contours.meeting import Carriers, meeting

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Element:
    """A line, or a circle where `centre` is given; `left` circles turn to the left. Points are along the
    first and second axis of the plane, in units of the program."""

    begin: Point
    end: Point
    centre: Point | None = None
    left: bool = False

    @staticmethod
    def by_radius(begin: Point, end: Point, radius: float, *, left: bool) -> Element | None:
        """A circle by its radius, negative for more than half a turn; None where there is none."""
        half = math.dist(begin, end) / 2
        if half == 0.0 or abs(radius) < half * (1 - 1e-6):
            return None
        high = math.sqrt(max(radius * radius - half * half, 0.0)) * (1 if left == (radius > 0) else -1)
        d = ((end[0] - begin[0]) / (2 * half), (end[1] - begin[1]) / (2 * half))
        middle = ((begin[0] + end[0]) / 2, (begin[1] + end[1]) / 2)
        return Element(begin, end, (middle[0] - d[1] * high, middle[1] + d[0] * high), left)

    def direction(self, point: Point) -> Point:
        """The direction of travel at a point of the element, of length 1."""
        if self.centre is None:
            d = (self.end[0] - self.begin[0], self.end[1] - self.begin[1])
        else:
            r = (point[0] - self.centre[0], point[1] - self.centre[1])
            d = (-r[1], r[0]) if self.left else (r[1], -r[0])
        size = math.hypot(*d)
        return d[0] / size, d[1] / size

    @property
    def radius(self) -> float:
        assert self.centre is not None
        return math.dist(self.begin, self.centre)

    def share(self, point: Point) -> float:
        """How far along the element a point of its line or circle is: 0 at the begin, 1 at the end."""
        if self.centre is None:
            d = (self.end[0] - self.begin[0], self.end[1] - self.begin[1])
            p = (point[0] - self.begin[0], point[1] - self.begin[1])
            return (p[0] * d[0] + p[1] * d[1]) / (d[0] ** 2 + d[1] ** 2)
        whole = self._turn(self.end) or 2 * math.pi
        turn = self._turn(point)
        # just before the begin is not nearly a whole turn behind it
        return (turn if turn < math.pi + whole / 2 else turn - 2 * math.pi) / whole

    def _turn(self, point: Point) -> float:
        assert self.centre is not None
        c = self.centre
        first = math.atan2(self.begin[1] - c[1], self.begin[0] - c[0])
        turn = math.atan2(point[1] - c[1], point[0] - c[0]) - first
        return (turn if self.left else -turn) % (2 * math.pi)


@dataclass(frozen=True, slots=True)
class Corner:
    """What a control puts in the place of a corner: from where to where, about which centre (None: straight),
    and whether it turns to the `left`."""

    begin: Point
    end: Point
    centre: Point | None
    left: bool


def turn_at(first: Element, second: Element) -> float:
    """rad by which the path turns to the left where two elements meet."""
    a, b = first.direction(first.end), second.direction(second.begin)
    return math.atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1])


def rounding(first: Element, second: Element, size: float, name: str) -> Corner:
    """The circle of a radius `size` between two elements. Raises ProgramError, without a line, where it does
    not fit; `name` is the word that asks for it."""
    left = turn_at(first, second) > 0
    one, other = (_beside(element, size, name, left=left) for element in (first, second))
    point = meeting(one, other, np.array([first.end]))[0]
    if np.isnan(point).any():
        raise _does_not_fit(name)
    centre = (float(point[0]), float(point[1]))
    return _fitting(first, second, Corner(_foot(first, centre), _foot(second, centre), centre, left), name)


def chamfer(first: Element, second: Element, size: float, name: str, *, across: bool = False) -> Corner:
    """The chamfer between two lines. `across`: the size is its length, else what it takes of each. Raises
    ProgramError, without a line, where it does not fit."""
    if first.centre is not None or second.centre is not None:
        raise ProgramError("a chamfer beside an arc is not written out; post it as G1", code="OLP544")
    turn = turn_at(first, second)
    leg = size / (2 * math.cos(turn / 2)) if across else size
    a, b, corner = first.direction(first.end), second.direction(second.begin), first.end
    begin = (corner[0] - a[0] * leg, corner[1] - a[1] * leg)
    end = (corner[0] + b[0] * leg, corner[1] + b[1] * leg)
    return _fitting(first, second, Corner(begin, end, None, turn > 0), name)


def _fitting(first: Element, second: Element, corner: Corner, name: str) -> Corner:
    if not (first.share(corner.begin) > 0.0 and second.share(corner.end) < 1.0):
        raise _does_not_fit(name)
    return corner


def _does_not_fit(name: str) -> ProgramError:
    why = f"{name} does not fit into the blocks beside its corner; post the corner as moves"
    return ProgramError(why, code="OLP544")


def _beside(element: Element, size: float, name: str, *, left: bool) -> Carriers:
    """What lies beside an element, by the radius of a rounding."""
    d = element.direction(element.end)
    side = 1.0 if left else -1.0
    point = (element.end[0] - d[1] * size * side, element.end[1] + d[0] * size * side)
    if element.centre is None:
        return Carriers(np.array([False]), np.array([point]), np.array([d]), np.zeros((1, 2)), np.zeros(1))
    inner = element.left == left
    radius = element.radius + (-size if inner else size)
    if radius <= 0:
        raise _does_not_fit(name)
    return Carriers(
        np.array([True]), np.array([point]), np.array([d]), np.array([element.centre]), np.array([radius])
    )


def _foot(element: Element, point: Point) -> Point:
    """The point of the line or circle of an element that is nearest to another."""
    if element.centre is None:
        share = element.share(point)
        (x, y), (u, v) = element.begin, element.end
        return x + share * (u - x), y + share * (v - y)
    c, scale = element.centre, element.radius / math.dist(point, element.centre)
    return c[0] + (point[0] - c[0]) * scale, c[1] + (point[1] - c[1]) * scale
