"""Measured points on the nominal path: each to the place that it was measured at, in the order of the
path."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from olp.errormodel.base import Array, Mask
from olp.exceptions import InputError
from olp.files.measured import Measured
from olp.review.parts import Index

#: a measured point is taken as one of the path within this
GATE_MM = 1.0
_BLOCK = 512
#: places tried around where the way says that a block lies, as shares of its reach
_TRIES = np.linspace(-1.0, 1.0, 33)
_REFINED = 4
#: how far, at least and as a share of the way of a block, the way measured may differ from the nominal one
_REACH_MM, _REACH_SHARE = 2.0, 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Matched:
    """Of n measured points: (n, 3) `base_mm`, the nearest place of the path, `delta_mm` from there, and (n,)
    the `index` of the sample next to it."""

    label: str
    base_mm: Array
    delta_mm: Array
    index: Index


def match(measured: Measured, position_mm: Array, joined: Mask, shift_mm: Array) -> Matched:
    """Match points, moved by `shift_mm` into the frame of the path, to (n, 3) samples of it.

    The points have to follow the path in order; they may leave out parts of it. Raises InputError with the
    line of the first point that is nowhere near what is still ahead.
    """
    points = measured.position_mm + shift_mm
    path = _Path.of(position_mm, joined)
    step = np.diff(points, axis=0, prepend=points[:1])
    travelled = np.cumsum(np.sqrt((step * step).sum(axis=1)))
    place = np.empty(len(points))
    at, before = path.nearest(points[0], 0.0), 0.0
    a = 0
    while a < len(points):
        b = min(a + _BLOCK, len(points))
        ahead = travelled[a:b] - (travelled[a - 1] if a else before)
        found, away = path.near(points[a:b], at + ahead, _REACH_MM + _REACH_SHARE * ahead)
        found = np.maximum.accumulate(np.maximum(found, at))
        far = np.flatnonzero(away > GATE_MM)
        good = int(far[0]) if far.size else b - a
        place[a : a + good] = found[:good]
        if good:
            at = float(found[good - 1])
        a += good
        if far.size:
            # parts of the path were not measured: look for the point in all that is ahead
            there = path.nearest(points[a], at)
            if path.distance(points[a : a + 1], np.array([there]))[0] > GATE_MM:
                gap = float(path.distance(points[a : a + 1], np.array([there]))[0])
                raise InputError(
                    f"the point is {gap:.3g} mm from all of the path that is still ahead; expected points "
                    f"within {GATE_MM:g} mm of it and in its order, in frame {measured.frame}",
                    file=measured.file, line=int(measured.line[a]),
                )  # fmt: skip
            place[a], at = there, there
            a += 1
    base = path.at(place)
    return Matched(Path(measured.file).name, base, points - base, path.sample(place))


class _Path:
    """The samples by the way along them; across a gap the way does not grow, and nothing is between."""

    def __init__(self, point: Array, way: Array) -> None:
        self.point, self.way = point, way

    @staticmethod
    def of(position: Array, joined: Mask) -> _Path:
        step = np.diff(position, axis=0, prepend=position[:1])
        length = np.sqrt((step * step).sum(axis=1))
        length[~joined] = 0.0
        return _Path(position, np.cumsum(length))

    def _segment(self, way: Array) -> tuple[Index, Array]:
        """The sample that ends the segment at each way, and the share of the segment before it."""
        end = np.clip(np.searchsorted(self.way, way, "left"), 1, max(len(self.way) - 1, 1))
        end = np.minimum(end, len(self.way) - 1)
        begin = np.maximum(end - 1, 0)
        length = self.way[end] - self.way[begin]
        with np.errstate(invalid="ignore", divide="ignore"):
            share = np.where(length > 0.0, (way - self.way[begin]) / length, 1.0)
        return end, np.clip(share, 0.0, 1.0)

    def at(self, way: Array) -> Array:
        """(n, 3) places at ways (n,)."""
        end, share = self._segment(way)
        first = self.point[np.maximum(end - 1, 0)]
        return np.asarray(first + share[:, None] * (self.point[end] - first))

    def sample(self, way: Array) -> Index:
        end, share = self._segment(way)
        return np.asarray(np.where(share < 0.5, np.maximum(end - 1, 0), end))

    def distance(self, point: Array, way: Array) -> Array:
        away = point - self.at(way)
        return np.asarray(np.sqrt((away * away).sum(axis=1)))

    def nearest(self, point: Array, least: float) -> float:
        """The first way, no less than `least`, at which the path is as near to a point as anywhere."""
        first = max(int(np.searchsorted(self.way, least, "left")) - 1, 0)
        begin, end = self.point[first:-1], self.point[first + 1 :]
        if not len(begin):
            return float(self.way[-1])
        length = np.diff(self.way[first:])
        along = np.where((length > 0.0)[:, None], end - begin, 0.0)
        begin = np.where((length > 0.0)[:, None], begin, end)
        with np.errstate(invalid="ignore", divide="ignore"):
            share = np.einsum("ij,ij->i", point - begin, along) / np.einsum("ij,ij->i", along, along)
        share = np.clip(np.nan_to_num(share, nan=1.0), 0.0, 1.0)
        way = np.maximum(self.way[first:-1] + share * length, least)
        away = point - begin - share[:, None] * along
        square = np.einsum("ij,ij->i", away, away)
        # of equally near places the first, so that what follows is still ahead
        close = np.flatnonzero(square <= (np.sqrt(square.min()) + 0.1 * GATE_MM) ** 2)[:64]
        return float(way[close[self._best(square, close)]])

    @staticmethod
    def _best(square: Array, close: Index) -> int:
        """The least of the first run of neighbours."""
        run = close[: int(np.flatnonzero(np.diff(close, append=close[-1] + 2) > 1)[0]) + 1]
        return int(square[run].argmin())

    def near(self, points: Array, guess: Array, reach: Array) -> tuple[Array, Array]:
        """(n,) ways nearest to points within `reach` of a guess, and the distances there."""
        tries = np.clip(guess[:, None] + reach[:, None] * _TRIES, 0.0, self.way[-1])
        away = points[:, None, :] - self.at(tries.ravel()).reshape(*tries.shape, 3)
        best = np.einsum("ijk,ijk->ij", away, away).argmin(axis=1)
        rows = np.arange(len(points))
        low = tries[rows, np.maximum(best - 1, 0)]
        high = tries[rows, np.minimum(best + 1, len(_TRIES) - 1)]
        for _ in range(_REFINED):
            tries = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, 17)
            away = points[:, None, :] - self.at(tries.ravel()).reshape(*tries.shape, 3)
            square = np.einsum("ijk,ijk->ij", away, away)
            best = square.argmin(axis=1)
            low, high = tries[rows, np.maximum(best - 1, 0)], tries[rows, np.minimum(best + 1, 16)]
        way = tries[rows, best]
        # on a straight stretch the foot of the perpendicular is exact
        end, _ = self._segment(way)
        begin = np.maximum(end - 1, 0)
        along = self.point[end] - self.point[begin]
        length = self.way[end] - self.way[begin]
        with np.errstate(invalid="ignore", divide="ignore"):
            share = np.einsum("ij,ij->i", points - self.point[begin], along) / np.einsum(
                "ij,ij->i", along, along
            )
        exact = np.where(
            length > 0.0, self.way[begin] + np.clip(np.nan_to_num(share, nan=1.0), 0.0, 1.0) * length, way
        )
        way = np.where(self.distance(points, exact) <= self.distance(points, way), exact, way)
        return way, self.distance(points, way)
