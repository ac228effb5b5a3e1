"""How far a function of one axis can depart from its chord over a move of length d: rigorous upper bounds.

With f'' as a measure (kinks are point masses) the departure is the integral of a tent kernel, at most
d/4 high and d^2/8 in area, against f''. Hence d^2/8 * max|f''|, d/4 * (variation of f' in any window of
length d), and the range of f bound it; the least of them holds. A product f * m with a linear lever arm m
departs by at most bound(f) * max|m| + |change of f| * |change of m| / 4.

Bounds are tabled over d on eight bins an octave; the bin is read off the bits of the number.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index
from olp.core.interpolation import Interpolant
from olp.core.values import dataclass
from olp.errormodel.sources.cyclic import Cyclic

#: A binary64 shifted by so many bits keeps its exponent and 3 bits of mantissa: eight bins an octave.
_SHIFT = 49
#: The number of the first bin, which begins at 2^-20 mm.
_FIRST = int(np.array([2.0**-20]).view(np.int64)[0]) >> _SHIFT
#: Bins from 2^-20 to 2^20 mm.
_COUNT = 40 * 8
_EDGES = np.array((np.arange(_COUNT + 1) + _FIRST) << _SHIFT, dtype=np.int64).view(np.float64)
#: The lower edge of each bin, in mm.
LOWER_MM = _EDGES[:-1]
#: The upper edge of each bin, in mm.
UPPER_MM = _EDGES[1:]
#: Windows start on this many points per piece of a curve.
_WINDOWS = 4


def bins(length_mm: Array) -> npt.NDArray[np.int64]:
    """(n,) bin of each length >= 0; to be gathered with mode="clip"."""
    return (length_mm.view(np.int64) >> _SHIFT) - _FIRST


@dataclass(frozen=True, slots=True, eq=False)
class Variation:
    """Bounds of one function f over its whole range, in units u of f.

    `peak` = max|f| (u); `slope` = max|f'|; `curvature` = max|f''| away from kinks.

    `smooth` (bins,) bounds the departure of the smooth part at the upper edge of a bin. `kinks` (bins,) times
    the length d bounds that of the kinks. `change` (bins,) times d bounds |f(q + d) - f(q)|.
    """

    peak: float
    slope: float
    curvature: float
    smooth: Array
    kinks: Array
    change: Array

    @property
    def varies(self) -> bool:
        return self.slope > 0.0

    @classmethod
    def total(cls, parts: Sequence[Variation]) -> Variation:
        return cls(
            sum(p.peak for p in parts),
            sum(p.slope for p in parts),
            sum(p.curvature for p in parts),
            sum((p.smooth for p in parts), np.zeros(_COUNT)),
            sum((p.kinks for p in parts), np.zeros(_COUNT)),
            sum((p.change for p in parts), np.zeros(_COUNT)),
        )

    @classmethod
    def of_cyclic(cls, term: Cyclic, most: float = 1.0, growth: float = 0.0) -> Variation:
        """Of the term times a factor that is linear in its position: at most `most`, with slope `growth`."""
        size, rate = abs(term.amplitude), 2.0 * math.pi / term.period_mm
        peak, slope = size * most, size * (rate * most + abs(growth))
        curvature = size * rate * (rate * most + 2.0 * abs(growth))
        smooth = np.minimum(curvature / 8.0 * UPPER_MM**2, 2.0 * peak)
        return cls(peak, slope, curvature, smooth, np.zeros(_COUNT), np.minimum(slope, 2.0 * peak / LOWER_MM))

    @classmethod
    def of_curve(cls, curve: Interpolant, cell_mm: float) -> list[Variation]:
        """Of each column of an interpolant that is resampled in cells of `cell_mm`, whose kinks count too."""
        zeros = np.zeros(_COUNT)
        span = np.ptp(curve.y, axis=0)[:, None]
        slope, curvature = curve.max_slope()[:, None], curve.max_curvature()[:, None]
        change = np.minimum(slope, span / LOWER_MM)
        peak = np.abs(curve.y).max(axis=0).tolist()
        if curve.kind == "linear":
            kinks = 0.25 * _kink_windows(curve)
            bent = [(0.0, zeros, kink) for kink in kinks]
        else:
            smooth = np.minimum(curvature / 8.0 * UPPER_MM**2, 0.25 * UPPER_MM * _smooth_windows(curve))
            smooth = np.minimum(smooth, span) + 0.25 * curvature * cell_mm**2
            bent = [(float(most), one, zeros) for most, one in zip(curvature[:, 0], smooth, strict=True)]
        return [
            cls(peak[k], float(slope[k, 0]), most, one, kink, change[k])
            for k, (most, one, kink) in enumerate(bent)
        ]


def distinct_bins(ends_mm: Array) -> slice:
    """The bins whose windows hold different numbers of the pieces between ascending `ends_mm`: what the
    first bin's holds all shorter windows hold, and what the last bin's holds all longer ones."""
    if len(ends_mm) < 2:
        return slice(0, 1)
    shortest, longest = float(np.diff(ends_mm).min()), float(ends_mm[-1] - ends_mm[0])
    # well below the shortest piece and above the whole, so that rounding cannot move an end
    first = max(int(np.searchsorted(UPPER_MM, 0.999 * shortest)) - 1, 0)
    last = min(int(np.searchsorted(UPPER_MM, 1.001 * longest)), _COUNT - 1)
    return slice(first, max(first, last) + 1)


def in_all_bins(values: Array, of: slice) -> Array:
    """(bins, ...) of the values (m, ...) of distinct bins."""
    return np.asarray(values[np.clip(np.arange(_COUNT), of.start, of.stop - 1) - of.start])


def _kink_windows(curve: Interpolant) -> Array:
    """(m, bins) largest sum of |jumps of slope| that a window of a bin's upper length can hold."""
    jumps = np.abs(np.diff(np.diff(curve.y, axis=0) / np.diff(curve.x)[:, None], axis=0))
    if not len(jumps):
        return np.zeros((curve.y.shape[1], _COUNT))
    kinks_mm, total = curve.x[1:-1], _sums(jumps)
    some = distinct_bins(kinks_mm)
    last = np.searchsorted(kinks_mm, kinks_mm[:, None] + UPPER_MM[some], side="right")
    return in_all_bins(_most(total, last), some).T


def _smooth_windows(curve: Interpolant) -> Array:
    """(m, bins) bound of the variation of f' in a window of a bin's upper length.

    f'' is linear in each piece, so the trapezoid of |f''| over a sub-piece is no less than its integral; a
    window is widened to whole sub-pieces.
    """
    start, end = curve.second_derivatives()
    share = (np.arange(_WINDOWS + 1) / _WINDOWS)[:, None]
    second = np.abs(start[:, None] + (end - start)[:, None] * share)
    width = np.diff(curve.x)[:, None] / _WINDOWS
    pieces = (0.5 * width[:, None] * (second[:, :-1] + second[:, 1:])).reshape(-1, curve.y.shape[1])
    position_mm = np.concatenate([(curve.x[:-1, None] + width * np.arange(_WINDOWS)).ravel(), curve.x[-1:]])
    some = distinct_bins(position_mm)
    ends = np.searchsorted(position_mm, position_mm[1:, None] + UPPER_MM[some], side="left")
    return in_all_bins(_most(_sums(pieces), np.minimum(ends, len(pieces))), some).T


def _sums(pieces: Array) -> Array:
    """(n + 1, m) sums of the pieces (n, m) before each, and of all."""
    return np.concatenate([np.zeros((1, pieces.shape[1])), np.cumsum(pieces, axis=0)])


def _most(total: Array, end: Index) -> Array:
    """(bins, m) the largest sum from piece i up to `end` (n, bins), of sums `total` (n + 1, m)."""
    return np.stack([(column[end] - column[:-1, None]).max(axis=0) for column in total.T], axis=-1)
