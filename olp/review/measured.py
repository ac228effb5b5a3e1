"""Measured points on the nominal path: each to the place where it was taken, in the order of the path."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from olp.errormodel.base import Array
from olp.exceptions import InputError
from olp.files.measured import Measured
from olp.review.parts import Ends, Index
from olp.review.samples import Samples

#: a measured point is taken as one of the path within this
GATE_MM = 1.0
_BLOCK = 128
#: places tried around where the way says that a point lies, as shares of its reach
_TRIES = np.linspace(-1.0, 1.0, 49)
_FINER = np.linspace(-1.0, 1.0, 17)
_REFINED = 3
#: how far, at least and as a share of the way of a block, the way measured may differ from the nominal one
_REACH_MM, _REACH_SHARE = 2.0, 0.1
#: a millimetre of that difference weighs as much as this distance from the path: passes of one place are told
#: apart by the way
_LATE = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Matched:
    """Of n measured points: (n, 3) `base_mm`, the nearest place of the path, `delta_mm` from there, and (n,)
    the `index` of the sample next to it."""

    label: str
    base_mm: Array
    delta_mm: Array
    index: Index


def match(measured: Measured, samples: Samples, ends: Ends, position_mm: Array, shift_mm: Array) -> Matched:
    """Match points, moved by `shift_mm` into the frame of the path, to the path whose samples are at
    `position_mm` (n, 3); `ends` are its moves.

    The points have to follow the path in order; they may leave out parts of it. Raises InputError with the
    line of the first point that is nowhere near what is still ahead.
    """
    points = measured.position_mm + shift_mm
    path = _Path.of(position_mm, samples)
    step = np.diff(points, axis=0, prepend=points[:1])
    travelled = np.cumsum(np.sqrt((step * step).sum(axis=1)))
    place = np.empty(len(points))
    at = path.nearest(points[0], 0.0)
    a = 0
    while a < len(points):
        b = min(a + _BLOCK, len(points))
        ahead = travelled[a:b] - travelled[max(a - 1, 0)]
        found, away = path.near(points[a:b], at + ahead, _REACH_MM + _REACH_SHARE * ahead)
        far = np.flatnonzero(away > GATE_MM)
        good = int(far[0]) if far.size else b - a
        place[a : a + good] = np.maximum.accumulate(np.maximum(found[:good], at))
        at = float(place[a + good - 1]) if good else at
        a += good
        if far.size:
            # parts of the path were not measured: look for the point in all that is ahead
            at = path.nearest(points[a], at)
            gap = float(path.distance(points[a : a + 1], np.array([at]))[0])
            if gap > GATE_MM:
                raise InputError(
                    f"the point is {gap:.3g} mm from all of the path that is still ahead; expected points "
                    f"within {GATE_MM:g} mm of it and in its order, in frame {measured.frame}",
                    file=measured.file, line=int(measured.line[a]),
                )  # fmt: skip
            place[a] = at
            a += 1
    base = path.exact(place, points, samples, ends)
    return Matched(Path(measured.file).name, base, points - base, path.sample(place))


@dataclass(frozen=True, slots=True, eq=False)
class _Path:
    """Samples (n, 3) by the way along them; across a gap the way does not grow, and nothing is between."""

    point: Array
    way: Array

    @staticmethod
    def of(position: Array, samples: Samples) -> _Path:
        step = np.diff(position, axis=0, prepend=position[:1])
        length = np.sqrt((step * step).sum(axis=1))
        length[~samples.joined] = 0.0
        return _Path(position, np.cumsum(length))

    def segment(self, way: Array) -> tuple[Index, Array]:
        """The sample that ends the segment at each way, and the share of the segment before it."""
        end = np.minimum(np.maximum(np.searchsorted(self.way, way, "left"), 1), len(self.way) - 1)
        begin = np.maximum(end - 1, 0)
        length = self.way[end] - self.way[begin]
        with np.errstate(invalid="ignore", divide="ignore"):
            share = np.where(length > 0.0, (way - self.way[begin]) / length, 1.0)
        return end, np.clip(share, 0.0, 1.0)

    def at(self, way: Array) -> Array:
        """(n, 3) places at ways (n,)."""
        end, share = self.segment(way)
        first = self.point[np.maximum(end - 1, 0)]
        return np.asarray(first + share[:, None] * (self.point[end] - first))

    def sample(self, way: Array) -> Index:
        """(n,) samples next to ways."""
        end, share = self.segment(way)
        return np.asarray(np.where(share < 0.5, np.maximum(end - 1, 0), end))

    def distance(self, point: Array, way: Array) -> Array:
        away = point - self.at(way)
        return np.asarray(np.sqrt((away * away).sum(axis=1)))

    def exact(self, way: Array, points: Array, samples: Samples, ends: Ends) -> Array:
        """(n, 3) places of the path itself, of which the samples of an arc are chords, beside points."""
        chord = self.at(way)
        end, share = self.segment(way)
        rows = np.flatnonzero(ends.arc[samples.move[end]] >= 0)
        end, move = end[rows], samples.move[end[rows]]
        before = np.where(samples.move[end - 1] == move, samples.share[end - 1], 0.0)
        share = before + share[rows] * (samples.share[end] - before)
        shown = self.point[end] - samples.axis_mm[end]
        for _ in range(2):
            base = ends.at(move, share) + shown
            ahead = np.einsum("ij,ij->i", points[rows] - base, ends.directions(move, share))
            share = np.clip(share + ahead / np.maximum(ends.length[move], 1e-9), 0.0, 1.0)
        chord[rows] = ends.at(move, share) + shown
        return chord

    def nearest(self, point: Array, least: float) -> float:
        """The first way, no less than `least`, at which the path is about as near to a point as anywhere."""
        first = max(int(np.searchsorted(self.way, least, "left")) - 1, 0)
        begin, end = self.point[first:-1], self.point[first + 1 :]
        if not len(begin):
            return float(self.way[-1])
        length = np.diff(self.way[first:])
        along = np.where((length > 0.0)[:, None], end - begin, 0.0)
        begin = np.where((length > 0.0)[:, None], begin, end)
        with np.errstate(invalid="ignore", divide="ignore"):
            share = np.einsum("ij,ij->i", point - begin, along) / np.einsum("ij,ij->i", along, along)
        way = self.way[first:-1] + np.clip(np.nan_to_num(share, nan=1.0), 0.0, 1.0) * length
        way = np.maximum(way, least)
        away = self.distance(np.broadcast_to(point, (len(way), 3)), way)
        close = np.flatnonzero(away <= away.min() + 0.1 * GATE_MM)
        # of several passes the first, so that what follows is still ahead
        run = close[: int(np.flatnonzero(np.diff(close, append=close[-1] + 2) > 1)[0]) + 1]
        return float(way[run[away[run].argmin()]])

    def near(self, points: Array, guess: Array, reach: Array) -> tuple[Array, Array]:
        """(n,) ways nearest to points within `reach` of a guess, and the distances there."""
        rows = np.arange(len(points))
        square = self._squares(points, guess[:, None] + reach[:, None] * _TRIES)
        best = (square + (_LATE * reach[:, None] * _TRIES) ** 2).argmin(axis=1)
        step = reach * (_TRIES[1] - _TRIES[0])
        way = guess + reach * _TRIES[best]
        for _ in range(_REFINED):
            tries = way[:, None] + step[:, None] * _FINER
            way = tries[rows, self._squares(points, tries).argmin(axis=1)]
            step = step * (_FINER[1] - _FINER[0])
        way = np.clip(way, 0.0, self.way[-1])
        # on a straight stretch the foot of the perpendicular is exact
        end, _ = self.segment(way)
        begin = np.maximum(end - 1, 0)
        along = self.point[end] - self.point[begin]
        length = self.way[end] - self.way[begin]
        with np.errstate(invalid="ignore", divide="ignore"):
            share = np.einsum("ij,ij->i", points - self.point[begin], along)
            share = np.clip(np.nan_to_num(share / np.einsum("ij,ij->i", along, along), nan=1.0), 0.0, 1.0)
        foot = np.where(length > 0.0, self.way[begin] + share * length, way)
        way = np.where(self.distance(points, foot) <= self.distance(points, way), foot, way)
        return way, self.distance(points, way)

    def _squares(self, points: Array, tries: Array) -> Array:
        """(n, k) squared distances of points (n, 3) from the path at ways (n, k)."""
        there = self.at(np.clip(tries, 0.0, self.way[-1]).ravel()).reshape(*tries.shape, 3)
        away = points[:, None, :] - there
        return np.asarray(np.einsum("ijk,ijk->ij", away, away))
