"""Axes as cubic splines of time whose knots are free: where they are, their rates, and how both depend on the
coefficients and on the lengths of the cells.

Of m cells of h_j seconds and m + 3 coefficients c_j the

    velocity      D1_j = 3 (c_j+1 - c_j) / (h_j-2 + h_j-1 + h_j)    has these control points,
    acceleration  D2_j = 2 (D1_j+1 - D1_j) / (h_j-1 + h_j)          is linear between these values at knots,
    jerk          D3_j = (D2_j+1 - D2_j) / h_j                      is that of cell j.

Beyond both ends cells have no length: the motion begins and ends at rest. Node k has the coefficient c_k and
the length h_k-1. All that belongs to cell or knot j depends on the five nodes from j - 1 on. A slope has one
row per node and, in the last column, that of the length.
Source: de Boor, A Practical Guide to Splines, 1978.
"""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.values import dataclass
from olp.trajectory.motion import Motion

#: nodes on which a cell depends
NODES = 5


@dataclass(frozen=True, slots=True, eq=False)
class TimeSpline:
    """`coefficient` (m + 3, axes) in mm, and the lengths `cell_s` (m,) of its cells."""

    coefficient: Array
    cell_s: Array

    @staticmethod
    def through(motion: Motion, knot_s: Array) -> TimeSpline:
        """That of a motion from rest to rest, which is exact where its axes are cubics between the knots."""
        lasts = np.diff(knot_s)
        about = np.concatenate((knot_s[:1], knot_s, knot_s[-1:]))
        position, velocity, acceleration, _ = motion.at(about)
        before = np.concatenate(([0.0, 0.0], lasts, [0.0]))[:, None]
        behind = np.concatenate(([0.0], lasts, [0.0, 0.0]))[:, None]
        # the blossom of the cubic around each knot at the knots before, at and behind it
        coefficient = position + velocity * (behind - before) / 3.0 - acceleration * before * behind / 6.0
        coefficient[:3], coefficient[-3:] = position[0], position[-1]
        return TimeSpline(coefficient, lasts)

    def __len__(self) -> int:
        return len(self.cell_s)

    @property
    def duration_s(self) -> float:
        return float(self.cell_s.sum())

    def moved(self, coefficient: Array, cell_s: Array) -> TimeSpline:
        return TimeSpline(self.coefficient + coefficient, self.cell_s + cell_s)

    def slowed(self, factor: float) -> TimeSpline:
        return TimeSpline(self.coefficient, self.cell_s * factor)

    def lengths(self) -> Array:
        """(m + 4,) those of the cells, with two of none beyond each end."""
        none = np.zeros(2)
        return np.concatenate((none, self.cell_s, none))

    def rates(self) -> Rates:
        h = self.lengths()
        three, two = h[:-2] + h[1:-1] + h[2:], h[1:-2] + h[2:-1]
        d1 = 3.0 * np.diff(self.coefficient, axis=0) / three[:, None]
        d2 = 2.0 * np.diff(d1, axis=0) / two[:, None]
        return Rates(three, two, self.cell_s, d1, d2, np.diff(d2, axis=0) / self.cell_s[:, None])

    def controls(self) -> tuple[Place, Place]:
        """The two inner control points of each cell's cubic; its ends are between those of neighbours."""
        h = self.lengths()
        three = h[1:-3] + h[2:-2] + h[3:-1]
        first, last = self.coefficient[1:-2], self.coefficient[2:-1]
        before = h[1:-3]
        return (Place(first, last, before / three, three, 1), Place(first, last, (before + h[2:-2]) / three,
                                                                    three, 2))  # fmt: skip

    def at_knots(self, knot: Index) -> tuple[Array, Array, Array]:
        """Of inner knots (k,): where they are (k, axes), and how that depends on their three coefficients
        (k, 3), and on the four cells around them (k, 4, axes)."""
        h, c = self.lengths(), self.coefficient
        first, second = h[knot] + h[knot + 1] + h[knot + 2], h[knot + 1] + h[knot + 2] + h[knot + 3]
        both = h[knot + 1] + h[knot + 2]
        a, b, w = (h[knot] + h[knot + 1]) / first, h[knot + 1] / second, h[knot + 1] / both
        step, next_step = c[knot + 1] - c[knot], c[knot + 2] - c[knot + 1]
        left, right = c[knot] + a[:, None] * step, c[knot + 1] + b[:, None] * next_step
        by_c = np.stack(((1.0 - w) * (1.0 - a), (1.0 - w) * a + w * (1.0 - b), w * b), axis=1)
        by_h = np.zeros((len(knot), 4, c.shape[1]))
        for i in range(3):
            by_h[:, i] += ((1.0 - w) * ((i < 2) - a) / first)[:, None] * step
            by_h[:, i + 1] += (w * ((i < 1) - b) / second)[:, None] * next_step
        by_h[:, 1] += ((1.0 - w) / both)[:, None] * (right - left)
        by_h[:, 2] -= (w / both)[:, None] * (right - left)
        return left + w[:, None] * (right - left), by_c, by_h

    def motion(self, line: Index) -> Motion:
        """The motion with the line (m,) of each cell."""
        rates, h = self.rates(), self.lengths()
        knot = np.arange(1, len(self))
        position, velocity = self.coefficient[:-3].copy(), np.zeros_like(self.coefficient[:-3])
        position[1:] = self.at_knots(knot)[0]
        share = (h[knot + 1] / (h[knot + 1] + h[knot + 2]))[:, None]
        velocity[1:] = rates.d1[knot] + share * (rates.d1[knot + 1] - rates.d1[knot])
        path = np.stack((position, velocity, rates.d2[:-1] / 2.0, rates.d3 / 6.0), axis=1)
        time = np.zeros((len(self), 4))
        time[:, 1] = 1.0
        return Motion(np.concatenate(([0.0], np.cumsum(self.cell_s))), time, path, np.arange(len(self)), line)


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """Of each cell a point between the coefficients `first` and `last` (m, axes), by a `share` (m,) of the
    way: the lengths of the first `count` of three cells over that of `three` (m,)."""

    first: Array
    last: Array
    share: Array
    three: Array
    count: int

    def point(self) -> Array:
        return np.asarray(self.first + self.share[:, None] * (self.last - self.first))

    def slope(self) -> Array:
        """(m, axes, 5, axes + 1) by the five nodes from that of the cell's number on."""
        axes = self.first.shape[1]
        slope = np.zeros((len(self.first), axes, NODES, axes + 1))
        for i in range(axes):
            slope[:, i, 1, i], slope[:, i, 2, i] = 1.0 - self.share, self.share
        for cell in range(3):
            of = ((cell < self.count) - self.share) / self.three
            slope[:, :, cell, axes] = of[:, None] * (self.last - self.first)
        return slope


@dataclass(frozen=True, slots=True, eq=False)
class Rates:
    """The lengths `three` (m + 2,) and `two` (m + 1,) of cells together and those of `one` (m,); over them
    `d1` (m + 2, axes), `d2` (m + 1, axes) and `d3` (m, axes)."""

    three: Array
    two: Array
    one: Array
    d1: Array
    d2: Array
    d3: Array

    def slopes(self) -> tuple[Array, Array, Array]:
        """Of d1, d2 and d3 (.., axes, 5, axes + 1): row j by the nodes from j - 1 on."""
        axes = self.d1.shape[1]
        by_c1 = np.stack((-3.0 / self.three, 3.0 / self.three), axis=1)
        by_h1 = np.repeat(-(self.d1 / self.three[:, None])[:, None], 3, axis=1)
        by_c2, by_h2 = _difference(by_c1, by_h1, 2.0 / self.two)
        by_h2[:, 1:3] -= (self.d2 / self.two[:, None])[:, None]
        by_c3, by_h3 = _difference(by_c2, by_h2, 1.0 / self.one)
        by_h3[:, 2] -= self.d3 / self.one[:, None]
        found = []
        for by_c, by_h in ((by_c1, by_h1), (by_c2, by_h2), (by_c3, by_h3)):
            slope = np.zeros((len(by_c), axes, NODES, axes + 1))
            for i in range(axes):
                slope[:, i, 1 : 1 + by_c.shape[1], i] = by_c
            slope[:, :, : by_h.shape[1], axes] = by_h.transpose(0, 2, 1)
            found.append(slope)
        return found[0], found[1], found[2]


def _difference(by_c: Array, by_h: Array, factor: Array) -> tuple[Array, Array]:
    """How differences of neighbours, times a factor, depend on one coefficient and one length more."""
    more_c = np.zeros((len(by_c) - 1, by_c.shape[1] + 1))
    more_c[:, 1:] += by_c[1:]
    more_c[:, :-1] -= by_c[:-1]
    more_h = np.zeros((len(by_h) - 1, by_h.shape[1] + 1, by_h.shape[2]))
    more_h[:, 1:] += by_h[1:]
    more_h[:, :-1] -= by_h[:-1]
    return more_c * factor[:, None], more_h * factor[:, None, None]
