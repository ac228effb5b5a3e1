"""Arcs of robot programs: circles through three points, read as chords, and written as arcs again.

An arc goes from the point before it through its via point to its end. Both halves of it are parted evenly,
so that an arc which is written as several ones is read with the same chords. The tool turns evenly with the
angle from its orientation at the start to that at the end, by the shorter way.
"""

from __future__ import annotations

from math import atan2, ceil, log2, pi

import numpy as np

from olp.core.arrays import Array
from olp.core.values import dataclass
from olp.program.robots.poses import Quaternion, angle_between, between

#: rad of a chord at most. No usual angle is a power of two times this, so that digits never decide how many
#: chords an arc has.
_CHORD_RAD = 0.037
#: mm of a chord at most.
_CHORD_MM = 1.3
#: Three points whose triangle is this flat, as a share of its sides, lie on a line.
_FLAT = 1e-6
#: Chords of one arc at most.
_MOST = 1 << 16


@dataclass(frozen=True, slots=True, eq=False)
class Circle:
    """An arc: its `centre` (3,), the directions `first` and `second` (3,) from there to its start and across,
    as long as its radius, and the angles at its `via` point and its `end`, rad."""

    centre: Array
    first: Array
    second: Array
    via: float
    end: float

    @staticmethod
    def through(start: Array, via: Array, end: Array) -> Circle | None:
        """The arc from `start` through `via` to `end`, points (3,) in mm; None where they lie on a line."""
        a, b = via - start, end - start
        normal = np.cross(a, b)
        size = float(np.linalg.norm(normal))
        sides = max(float(np.linalg.norm(some)) for some in (a, b, b - a))
        if size <= _FLAT * sides * sides:
            return None
        away = np.cross((a @ a) * b - (b @ b) * a, normal) / (2.0 * size * size)
        first = -away
        second = np.cross(normal / size, first)
        turns = [atan2(float(p @ second), float(p @ first)) % (2.0 * pi) for p in (a - away, b - away)]
        return Circle(start + away, first, second, turns[0], turns[1])

    def at(self, angle: Array) -> Array:
        """(n, 3) points at angles (n,) from the start."""
        return np.asarray(
            self.centre + np.cos(angle)[:, None] * self.first + np.sin(angle)[:, None] * self.second
        )

    def chords(self) -> tuple[int, int]:
        """Into how many chords the parts before and behind the via point are read."""
        radius = float(np.linalg.norm(self.first))
        angles = self.via, self.end - self.via
        counts = [max(angle / _CHORD_RAD, angle * radius / _CHORD_MM) for angle in angles]
        first, second = (1 << max(0, ceil(log2(count))) for count in counts)
        return first, second

    def angles(self, first: int, second: int) -> Array:
        """(first + second,) the angles at the ends of chords."""
        before = self.via * np.arange(1, first + 1) / first
        behind = self.via + (self.end - self.via) * np.arange(1, second + 1) / second
        return np.append(before, behind)


@dataclass(frozen=True, slots=True, eq=False)
class Chords:
    """An arc as chords: points (n, 3) at their ends, the rotation at each, and how many end up to the via
    point."""

    points: Array
    turns: list[Quaternion]
    first: int

    @staticmethod
    def of(places: tuple[Array, Array, Array], turns: tuple[Quaternion, Quaternion]) -> Chords | None:
        """The arc through three `places` (3,), with the rotations at its start and its end; None where they
        lie on a line, or the arc is too long to be read."""
        circle = Circle.through(*places)
        if circle is None or sum(circle.chords()) > _MOST:
            return None
        first, second = circle.chords()
        angles = circle.angles(first, second)
        points = circle.at(angles)
        points[first - 1], points[-1] = places[1], places[2]
        return Chords(points, _evenly(turns, angles / circle.end), first)


def _evenly(turns: tuple[Quaternion, Quaternion], share: Array) -> list[Quaternion]:
    if turns[0] == turns[1]:
        return [turns[1]] * len(share)
    return [between(*turns, part) for part in share[:-1].tolist()] + [turns[1]]


@dataclass(frozen=True, slots=True, eq=False)
class Bent:
    """A corrected arc: `points` (n + 1, 3) and rotations `turns` at its start and behind each chord, the via
    point behind the chord `first`. Arcs keep to it within `off_mm` and `off_rad`; NaN leaves the rotation
    out."""

    points: Array
    turns: list[Quaternion]
    first: int
    off_mm: float
    off_rad: float

    def arcs(self) -> list[tuple[int, int]] | None:
        """The fewest arcs that keep to it: behind how many chords each has its via point and its end. None
        where no arcs do."""
        last = len(self.points) - 1
        if self._fits(0, self.first, last):
            return [(self.first, last)]
        halves = [self._parted(0, self.first), self._parted(self.first, last)]
        if halves[0] is None or halves[1] is None:
            return None
        return [*halves[0], *halves[1]]

    def _parted(self, begin: int, end: int) -> list[tuple[int, int]] | None:
        """The arcs of one half."""
        size = end - begin
        while size > 1:
            begins = range(begin, end, size)
            if all(self._fits(a, a + size // 2, a + size) for a in begins):
                return [(a + size // 2, a + size) for a in begins]
            size //= 2
        return None

    def _fits(self, begin: int, via: int, end: int) -> bool:
        """Whether one arc through three of the points keeps to those between."""
        points = self.points
        circle = Circle.through(points[begin], points[via], points[end])
        if circle is None:
            return False
        angles = circle.angles(via - begin, end - via)
        away = np.linalg.norm(circle.at(angles) - points[begin + 1 : end + 1], axis=1)
        if away.max() > self.off_mm:
            return False
        if np.isnan(self.off_rad):
            return True
        turns = _evenly((self.turns[begin], self.turns[end]), angles / circle.end)
        pairs = zip(turns, self.turns[begin + 1 : end + 1], strict=True)
        return max(angle_between(a, b) for a, b in pairs) <= self.off_rad
