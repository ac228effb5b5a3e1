"""A smooth field over a box as a Gaussian process: Matern 5/2 with a length of its own along each axis.

The process has reduced rank: products of sines that vanish outside the box, whose coefficients are
independent with the variance that the spectral density of the kernel gives (A. Solin and S. Sarkka, Hilbert
space methods for reduced-rank Gaussian process regression, 2020). So it is linear in few unknowns, as curves
are, and its covariance between any two positions follows directly.
"""

from __future__ import annotations

import math
from itertools import product

import numpy as np

from olp.core.arrays import Array
from olp.core.values import dataclass

#: Where the sines vanish, in half lengths of the box: well outside, as they hold the process to zero there.
REACH = 2.0
#: Sines along an axis, per cube root of the number of points.
A_ROOT = 1.1
#: Sines along an axis, at least.
FEWEST = 5
#: Sines along an axis, at most.
MOST = 8
#: Shortest length of the kernel, as a share of the box: the shortest sine resolves it.
SHORTEST = 0.25
#: Longest length of the kernel, as a share of the box.
LONGEST = 1.0
#: 8 pi^(3/2) Gamma(4) / Gamma(5/2) * 5^(5/2), of the spectral density in three dimensions
_DENSITY = 8.0 * math.pi**1.5 * 6.0 / (0.75 * math.sqrt(math.pi)) * 5.0**2.5


@dataclass(frozen=True, slots=True, eq=False)
class Modes:
    """Sines over a box (3, 2) in mm: `orders` (m, 3) half waves along each axis."""

    centre_mm: Array
    reach_mm: Array
    orders: Array

    @classmethod
    def over(cls, box_mm: Array, points: int) -> Modes:
        """As many as this number of points supports, the slow ones first."""
        box = np.asarray(box_mm, float)
        most = int(np.clip(round(A_ROOT * points ** (1.0 / 3.0)), FEWEST, MOST))
        cube = np.array(list(product(range(1, most + 1), repeat=3)), float)
        slow = ((cube - 0.5) ** 2).sum(axis=1) <= most**2
        return cls(box.mean(axis=1), 0.5 * REACH * np.ptp(box, axis=1), cube[slow])

    @property
    def size(self) -> int:
        return len(self.orders)

    def values(self, position: Array) -> Array:
        """(n, m) the sines at positions (n, 3)."""
        values = np.ones((len(position), self.size))
        for k in range(3):
            share = (position[:, k] - self.centre_mm[k] + self.reach_mm[k]) / (2.0 * self.reach_mm[k])
            sines = np.sin(np.pi * np.outer(share, np.arange(1, int(self.orders.max()) + 1)))
            values *= sines[:, self.orders[:, k].astype(int) - 1]
        return np.asarray(values / math.sqrt(float(np.prod(self.reach_mm))))

    def log_variance(self, log_size: float, log_lengths: Array) -> tuple[Array, Array]:
        """(m,) log variance of each coefficient for a standard deviation and lengths in mm (as logarithms),
        and (m, 3) its derivative by the latter; that by the former is 2."""
        omega = np.pi * self.orders / (2.0 * self.reach_mm)
        scaled = (omega * np.exp(log_lengths)) ** 2
        below = 5.0 + scaled.sum(axis=1)
        value = math.log(_DENSITY) + 2.0 * log_size + float(np.sum(log_lengths)) - 4.0 * np.log(below)
        return value, 1.0 - 8.0 * scaled / below[:, None]


def matern(distance: Array) -> Array:
    """The correlation at distances in lengths of the kernel."""
    r = math.sqrt(5.0) * distance
    return np.asarray((1.0 + r + r**2 / 3.0) * np.exp(-r))
