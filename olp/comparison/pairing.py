"""The position on the nominal path of each measured point."""

from __future__ import annotations

from typing import Literal

import numpy as np

from olp.comparison.order import banded, whole
from olp.comparison.path import Path
from olp.core.arrays import Array, Index, Mask
from olp.core.values import dataclass

Order = Literal["forward", "backward", "free"]

#: nodes of the coarsest level
COARSE = 3072
#: factor by which each next level is finer, at most
_FINER = 8
#: nodes of the finest level at most
_MOST = 2_000_000
#: half the width of a band, in nodes of the level before
_HALF = 4
#: weight of time, besides that of the distance travelled, in the measure by which points are thinned
_TIME = 0.1
#: means of points, at most, from which the distance travelled is computed, to suppress noise
_MEANS = 8192
#: points per block
_BLOCK = 1 << 17
#: nodes of the finest level from a point to its place, and the share of points beyond that which is doubted
_NODES = 2.0
_SHARE = 1e-3
#: share of the size of a path beyond which a point is not on it
FAR = 0.05
#: nearest nodes that are compared where points come in no order
_NEIGHBOURS = 24
#: segments by which a foot may move along the path from its node
_STEPS = 256


@dataclass(frozen=True, slots=True, eq=False)
class Pairing:
    """Per measured point (m,): `segment` of the path, `foot_mm` (m, 3) on it, `distance_mm`, arc length
    `s_mm`. `beyond` marks points before the start or behind the end of the path. `doubtful` marks those that
    a pass in another direction fits equally well."""

    segment: Index
    foot_mm: Array
    distance_mm: Array
    s_mm: Array
    beyond: Mask
    doubtful: Mask


def pair(path: Path, points_mm: Array, order: Order) -> Pairing:
    """Pair measured points (m, 3) with positions on the path.

    "forward": points in the order of the path; "backward": in the opposite one; "free": in none, each takes
    the nearest position. Only an order distinguishes passes that repeat or cross.
    """
    if order == "free":
        return _free(path, points_mm)
    if order == "backward":
        turned = pair(path, points_mm[::-1], "forward")
        return Pairing(
            turned.segment[::-1], turned.foot_mm[::-1], turned.distance_mm[::-1], turned.s_mm[::-1],
            turned.beyond[::-1], turned.doubtful[::-1],
        )  # fmt: skip
    s, step = _in_order(path, points_mm)
    return _project(path, points_mm, s, step)


def thinned(points_mm: Array, count: int) -> tuple[Array, Array]:
    """At most `count` means of neighbouring points (L, 3), even along the distance travelled, and the mean
    index of each (L,)."""
    m = len(points_mm)
    if m <= count:
        return points_mm, np.arange(m, dtype=float)
    edges = np.linspace(0, m, min(m, _MEANS) + 1).astype(np.int64)
    means = _means(points_mm, edges)
    arc_mm = np.append(0.0, np.cumsum(np.sqrt((np.diff(means, axis=0) ** 2).sum(axis=1))))
    middle = 0.5 * (edges[:-1] + edges[1:] - 1)
    measure = np.interp(np.arange(m), middle, arc_mm / max(arc_mm[-1], 1e-12) + _TIME * middle / m)
    cuts = np.searchsorted(measure, np.linspace(measure[0], measure[-1], count + 1)[1:-1])
    # a mean of points on both sides of a gap would be on neither
    cuts = np.unique(np.concatenate(([0], cuts, leaps(points_mm, count) + 1, [m])))
    return _means(points_mm, cuts), np.asarray(0.5 * (cuts[:-1] + cuts[1:] - 1), float)


def leaps(points_mm: Array, count: int) -> Index:
    """Indices of points farther from the next one than twice 1 / `count` of the whole distance."""
    step = np.sqrt((np.diff(points_mm, axis=0) ** 2).sum(axis=1))
    return np.flatnonzero(step > 2.0 * step.sum() / count)


def _between(query: Array, index: Array, s: Array, gaps: Index) -> Array:
    """Arc lengths at indices `query`, interpolated between `index`; constant up to gaps, with jumps there."""
    if len(gaps):
        before = np.clip(np.searchsorted(index, gaps, side="right") - 1, 0, len(s) - 1)
        after = np.clip(before + 1, 0, len(s) - 1)
        index = np.concatenate((index, gaps, gaps + 1))
        s = np.concatenate((s, s[before], s[after]))
        order = np.argsort(index, kind="stable")
        index, s = index[order], s[order]
    return np.interp(query, index, s)


def _means(points: Array, edges: Index) -> Array:
    return np.asarray(np.add.reduceat(points, edges[:-1], axis=0) / np.diff(edges)[:, None], float)


def coarse(
    path: Path, points_mm: Array, count: int = COARSE, far: float = np.inf
) -> tuple[Array, Array, Array, float]:
    """Thinned points (L, 3), the index and the arc length of each (L,), and the cost of their match. `far` is
    the share of the size of the path beyond which a point is not on it."""
    few, index = thinned(points_mm, count)
    s = np.linspace(0.0, path.length_mm, count)
    near, cost = whole(few, path.at(s)[0], far * float(np.linalg.norm(np.ptp(path.vertex_mm, axis=0))))
    return few, index, s[near], cost


def _in_order(path: Path, points: Array) -> tuple[Array, float]:
    """Arc length (m,) of the node of each point, and the distance between nodes.

    Where passes lie closer than nodes of the coarsest level, as on a raster, the match there may be off by
    some passes. The distance travelled tells them apart; it is tried where points are far from their nodes.
    """
    few, index, s, _ = coarse(path, points, far=FAR)
    matched, step = _refined(path, points, index, s)
    away_mm = _away(path, points, matched)
    if (away_mm > _NODES * step).mean() > _SHARE:
        travelled_mm = np.append(0.0, np.cumsum(np.sqrt((np.diff(few, axis=0) ** 2).sum(axis=1))))
        share = travelled_mm / max(travelled_mm[-1], 1e-12)
        other, _ = _refined(path, points, index, share * path.length_mm)
        if _away(path, points, other).mean() < away_mm.mean():
            matched = other
    return matched, step


def _away(path: Path, points: Array, s: Array) -> Array:
    """Distances of points (m, 3) from the places at arc lengths `s` (m,)."""
    return np.asarray(np.linalg.norm(path.at(s)[0] - points, axis=1), float)


def _refined(path: Path, points: Array, index: Array, s: Array) -> tuple[Array, float]:
    """As `_in_order`, level by level from arc lengths `s` (L,) at the points of numbers `index` (L,)."""
    m = len(points)
    finest = int(np.clip(max(len(path), m), COARSE, min(max(4 * m, COARSE), _MOST)))
    count = COARSE
    gaps = leaps(points, COARSE) if m > COARSE else np.zeros(0, np.int64)
    while count < finest or len(s) < m:
        finer = min(_FINER, max(finest / count, 1.0))
        count = max(int(count * finer), count)
        last = count >= finest
        few, few_index = (points, np.arange(m, dtype=float)) if last else thinned(points, count)
        nodes_s = np.linspace(0.0, path.length_mm, count)
        middle = np.rint(_between(few_index, index, s, gaps) / path.length_mm * (count - 1)).astype(np.int64)
        near = banded(few, path.at(nodes_s)[0], middle, int(2 * _HALF * finer) + 16)
        index, s = few_index, nodes_s[near]
        if last:
            break
    return _between(np.arange(m, dtype=float), index, s, gaps), path.length_mm / (count - 1)


def _project(path: Path, points: Array, s: Array, step: float) -> Pairing:
    """The nearest position on the path within 1.5 nodes of arc length `s`."""
    m = len(points)
    segment, foot = np.empty(m, np.int64), np.empty((m, 3))
    square, share = np.full(m, np.inf), np.empty(m)
    for a in range(0, m, _BLOCK):
        b = min(a + _BLOCK, m)
        low = np.clip(np.searchsorted(path.s_mm, s[a:b] - 1.5 * step, side="right") - 1, 0, len(path) - 1)
        high = np.clip(np.searchsorted(path.s_mm, s[a:b] + 1.5 * step) - 1, low, len(path) - 1)
        for more in range(int((high - low).max(initial=0)) + 1):
            rows = np.flatnonzero(low + more <= high)
            _nearer(path, points, low[rows] + more, rows + a, segment, foot, square, share)
        for side in (1, -1):
            _walk(path, points, np.arange(a, b), side, segment, foot, square, share)
    distance = np.sqrt(square)
    s_mm = path.s_mm[segment] + share * (path.s_mm[segment + 1] - path.s_mm[segment])
    return Pairing(segment, foot, distance, s_mm, _beyond(path, segment, share, distance), np.zeros(m, bool))


def beside(path: Path, points: Array, segment: Index) -> Pairing:
    """Pair points (m, 3) with the nearest position about segments (m,) of the path that they are known to
    belong to."""
    m = len(points)
    nearest, foot = np.empty(m, np.int64), np.empty((m, 3))
    square, share = np.full(m, np.inf), np.empty(m)
    rows = np.arange(m)
    _nearer(path, points, segment, rows, nearest, foot, square, share)
    for side in (1, -1):
        _walk(path, points, rows, side, nearest, foot, square, share)
    s_mm = path.s_mm[nearest] + share * (path.s_mm[nearest + 1] - path.s_mm[nearest])
    nothing = np.zeros(m, bool)
    return Pairing(nearest, foot, np.sqrt(square), s_mm, nothing, nothing)


def _nearer(
    path: Path, points: Array, candidate: Index, rows: Index, segment: Index, foot: Array, square: Array,
    share: Array,
) -> None:  # fmt: skip
    """Take a candidate segment for each of `rows` where it is nearer than the best so far."""
    start = path.vertex_mm[candidate]
    along = path.vertex_mm[candidate + 1] - start
    part = np.einsum("ij,ij->i", points[rows] - start, along) / np.einsum("ij,ij->i", along, along)
    part = np.clip(part, 0.0, 1.0)
    place = start + part[:, None] * along
    away = points[rows] - place
    size = np.einsum("ij,ij->i", away, away)
    better = size < square[rows]
    which = rows[better]
    segment[which], foot[which] = candidate[better], place[better]
    square[which], share[which] = size[better], part[better]


def _walk(
    path: Path,
    points: Array,
    rows: Index,
    side: int,
    segment: Index,
    foot: Array,
    square: Array,
    share: Array,
) -> None:
    """Go on along the path while it comes nearer: by noise the order may be off by some nodes."""
    for _ in range(_STEPS):
        rows = rows[share[rows] == (1.0 if side > 0 else 0.0)]
        rows = rows[(segment[rows] + side >= 0) & (segment[rows] + side < len(path))]
        if not len(rows):
            return
        before = square[rows]
        _nearer(path, points, segment[rows] + side, rows, segment, foot, square, share)
        rows = rows[square[rows] < before]


def _beyond(path: Path, segment: Index, share: Array, distance: Array) -> Mask:
    """Points farther from an end of the path than is usual across it."""
    end = ((segment == 0) & (share == 0.0)) | ((segment == len(path) - 1) & (share == 1.0))
    usual = float(np.median(distance[~end])) if (~end).any() else 0.0
    return np.asarray(end & (distance > 3.0 * usual + 1e-9), bool)


def _free(path: Path, points: Array) -> Pairing:
    """The nearest position on the whole path, and whether another pass is equally near."""
    from scipy.spatial import cKDTree

    m = len(points)
    count = int(np.clip(4 * max(m, len(path)), COARSE, _MOST))
    nodes_s = np.linspace(0.0, path.length_mm, count)
    step = path.length_mm / (count - 1)
    distance, near = map(np.asarray, cKDTree(path.at(nodes_s)[0]).query(points, k=_NEIGHBOURS))
    pairing = _project(path, points, nodes_s[near[:, 0]], step)
    other = np.abs(near - near[:, :1]) > _NEIGHBOURS
    other &= distance < distance[:, :1] + 2.0 * pairing.distance_mm[:, None] + step
    along = path.axes(pairing.segment)[0]
    turned = np.zeros(m, bool)
    for column in range(1, _NEIGHBOURS):
        rows = np.flatnonzero(other[:, column])
        there = path.axes(path.at(nodes_s[near[rows, column]])[1])[0]
        turned[rows] |= np.einsum("ij,ij->i", there, along[rows]) < 0.999
    return Pairing(
        pairing.segment, pairing.foot_mm, pairing.distance_mm, pairing.s_mm, pairing.beyond, turned
    )
