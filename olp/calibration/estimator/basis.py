"""The functions that make a curve: uniform cubic B-splines, steps between two targets, kinks at a target.

P-splines after P. H. C. Eilers and B. D. Marx (Statist. Sci. 11, 1996): many equally spaced knots, and a
prior on the coefficients in place of a choice of knots. The prior is a sum of processes: one whose curvature
wanders, one whose slope wanders, one whose value wanders, ripple, and swings, which hold nothing shorter than
some waves. All have the eigenvectors of the second differences, and spectra that fall with the sixth, fourth,
second and no power of the frequency; those of swings fall with the third, and end.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache

import numpy as np

from olp.core.arrays import Array
from olp.core.values import dataclass


@dataclass(frozen=True, slots=True)
class Step:
    """0 before `low_mm`, 1 from `high_mm` on, straight between: a joint somewhere between two targets."""

    low_mm: float
    high_mm: float

    def values(self, q: Array) -> Array:
        return np.asarray(np.clip((q - self.low_mm) / (self.high_mm - self.low_mm), 0.0, 1.0))


@dataclass(frozen=True, slots=True)
class Kink:
    """0 before `at_mm`, then a slope of 1 over `length_mm`."""

    at_mm: float
    length_mm: float

    def values(self, q: Array) -> Array:
        return np.asarray(np.maximum(q - self.at_mm, 0.0) / self.length_mm)


Feature = Step | Kink


@dataclass(frozen=True, slots=True)
class Wave:
    """Sine and cosine of one period."""

    period_mm: float

    def values(self, q: Array) -> Array:
        angle = 2.0 * np.pi * q / self.period_mm
        return np.stack([np.sin(angle), np.cos(angle)], axis=1)


@dataclass(frozen=True, slots=True)
class Scales:
    """Sizes of the processes that make a curve, mm or rad over the whole length of its axis. `bows` is of the
    curvature that wanders, `bends` of the slope, `steps` of the value, `ripple` of what has no neighbours.
    Swings are smooth, with up to some waves over the axis: `slow`, `middle` and `quick` ones."""

    bows: float
    bends: float
    steps: float
    ripple: float
    slow: float = 0.0
    middle: float = 0.0
    quick: float = 0.0

    @classmethod
    def of(cls, values: Iterable[float]) -> Scales:
        return cls(*(float(value) for value in values))

    @property
    def values(self) -> Array:
        """(7,) all of them."""
        return np.array((self.bows, self.bends, self.steps, self.ripple, self.slow, self.middle, self.quick))

    def times(self, smooth: float, rough: float) -> Scales:
        """The same with bows, bends and swings by one factor, steps and ripple by another."""
        return Scales.of(self.values * (smooth, smooth, rough, rough, smooth, smooth, smooth))


#: Powers of the frequency with which the variances of the processes fall, and the half waves over the axis
#: where they end.
SPECTRA = (
    (6.0, np.inf), (4.0, np.inf), (2.0, np.inf), (0.0, np.inf), (2.0, 2.5), (2.0, 4.0), (2.5, 5.5)
)  # fmt: skip
#: Power of the frequency in the exponent that ends swings. With a soft end (2) long swings beside ripple
#: explain what shorter swings alone do.
_END = 6.0
#: Swings are those of an axis so many times as long, of which the curve is the middle: its ends are no ends.
LONGER = 3
#: Row of ripple in a spectrum.
RIPPLE = 3
#: Least variance of an eigenvector against the largest: swings end, and a precision is finite.
_LEAST_SHARE = 1e-12
#: Eigenvalues of the second differences that are zero: those of a constant and of a straight line.
STRAIGHT = 2


@dataclass(frozen=True, slots=True)
class Spline:
    """Cubic B-splines over [low_mm, high_mm] with `cells` equal cells; end values outside."""

    low_mm: float
    high_mm: float
    cells: int

    @property
    def count(self) -> int:
        return self.cells + 3

    def values(self, q: Array) -> Array:
        """(n, count) values at q (n,)."""
        u = (np.clip(q, self.low_mm, self.high_mm) - self.low_mm) * (
            self.cells / (self.high_mm - self.low_mm)
        )
        cell = np.minimum(u.astype(np.intp), self.cells - 1)
        s = u - cell
        rest = 1.0 - s
        four = np.stack(
            [
                rest**3,
                3.0 * s**3 - 6.0 * s**2 + 4.0,
                3.0 * rest**3 - 6.0 * rest**2 + 4.0,
                s**3,
            ],
            axis=1,
        ) / 6.0  # fmt: skip
        table = np.zeros((len(q), self.count))
        rows = np.arange(len(q))
        for k in range(4):
            table[rows, cell + k] = four[:, k]
        return table

    def roughness(self) -> Array:
        """(count, count) sum of squares of second differences of the coefficients."""
        second = np.diff(np.eye(self.count), 2, axis=0)
        return np.asarray(second.T @ second)

    def processes(self) -> Array:
        """(7, count, count) covariances of the coefficients where one process has the size 1, without their
        straight lines."""
        return _processes(self.cells)

    def lines(self) -> Array:
        """(count, 2) orthonormal coefficients of a constant and of a straight line, mixed."""
        return _modes(self.cells)[1][:, :STRAIGHT]

    def bent(self) -> Array:
        """(count, count - 2) orthonormal coefficients of all else."""
        return _modes(self.cells)[1][:, STRAIGHT:]


@cache
def _modes(cells: int) -> tuple[Array, Array]:
    """(count,) eigenvalues of the second differences of so many cells, and (count, count) eigenvectors."""
    values, vectors = np.linalg.eigh(Spline(0.0, 1.0, cells).roughness())
    return np.asarray(values), np.asarray(vectors)


@cache
def _processes(cells: int) -> Array:
    parts = []
    for power, waves in SPECTRA:
        times = 1 if np.isinf(waves) else LONGER
        values, vectors = _modes(times * cells)
        frequency = (values[STRAIGHT:] * cells**4) ** 0.25
        # of a process of length 1: white noise has a variance that does not depend on the cells
        variance = frequency**-power * (cells if power else 1.0)
        variance *= np.exp(-((frequency / (np.pi * waves)) ** _END))
        first = (times - 1) // 2 * cells
        middle = vectors[first : first + cells + 3, STRAIGHT:]
        parts.append((middle * variance) @ middle.T)
    lines = _modes(cells)[1][:, :STRAIGHT]
    keep = np.eye(cells + 3) - lines @ lines.T
    return np.asarray(keep @ np.stack(parts) @ keep)


@dataclass(frozen=True, slots=True, eq=False)
class CurveSpace:
    """All functions that one curve may be: `spline` and `features`, restricted by the gauge.

    `gauge` (spline + features, size) spans the functions allowed: except for "free" the value at the datum is
    zero. For "straight" the least-squares slope over the spline's range is zero too, as it is squareness.
    """

    spline: Spline
    features: tuple[Feature, ...]
    gauge: Array

    @classmethod
    def of(cls, spline: Spline, features: tuple[Feature, ...], datum_mm: float, kind: str) -> CurveSpace:
        """`kind` is "straight", "zero" or "free"."""
        raw = cls(spline, features, np.zeros((0, 0)))
        size = spline.count + len(features)
        constraints = []
        if kind != "free":
            constraints.append(raw.raw_values(np.array([datum_mm]))[0])
        if kind == "straight":
            constraints.append(slope_weights(spline) @ raw.raw_values(slope_grid(spline)))
        if not constraints:
            return cls(spline, features, np.eye(size))
        _, _, right = np.linalg.svd(np.array(constraints))
        return cls(spline, features, np.ascontiguousarray(right[len(constraints) :].T))

    @property
    def size(self) -> int:
        return int(self.gauge.shape[1])

    def raw_values(self, q: Array) -> Array:
        columns = [self.spline.values(q), *(f.values(q)[:, None] for f in self.features)]
        return np.concatenate(columns, axis=1)

    def values(self, q: Array) -> Array:
        """(n, size) values at q (n,)."""
        return np.asarray(self.raw_values(q) @ self.gauge)

    def process(self, scales: Scales, amplitude: float, feature: float | None = None) -> Array:
        """(size, size) precision of the sum of the processes; `amplitude` is the standard deviation of the
        coefficients of straight lines, and of features unless theirs is `feature`."""
        lines, bent = self.spline.lines(), self.spline.bent()
        covariance = bent.T @ np.tensordot(scales.values**2, self.spline.processes(), 1) @ bent
        values, vectors = np.linalg.eigh(covariance)
        turned = bent @ vectors
        rough = (turned / np.maximum(values, _LEAST_SHARE * values[-1])) @ turned.T
        m = self.spline.count
        full = np.eye(m + len(self.features)) / (feature or amplitude) ** 2
        full[:m, :m] = rough + lines @ lines.T / amplitude**2
        return np.asarray(self.gauge.T @ full @ self.gauge)

    def prior(self, roughness: float, amplitude: float) -> Array:
        """(size, size) precision for a standard deviation `roughness` of second differences, and `amplitude`
        of every coefficient."""
        m = self.spline.count
        full = np.eye(m + len(self.features)) / amplitude**2
        full[:m, :m] += self.spline.roughness() / roughness**2
        return np.asarray(self.gauge.T @ full @ self.gauge)


#: Positions over which a least-squares slope is taken.
_SLOPE_POINTS = 401


def slope_grid(spline: Spline) -> Array:
    """Positions over which a least-squares slope is taken."""
    return np.linspace(spline.low_mm, spline.high_mm, _SLOPE_POINTS)


def slope_weights(spline: Spline) -> Array:
    """Weights that make the least-squares slope of values at `slope_grid`."""
    q = slope_grid(spline)
    centred = q - q.mean()
    return np.asarray(centred / (centred @ centred))
