"""Distance between a cone frustum swept along a straight segment and a triangle, for many pairs at once.

Both are convex, and so is the set of all differences of their points. The algorithm of Gilbert, Johnson and
Keerthi searches its point nearest to the origin, with support points of the true round shape. Each step gives
an upper bound, the point so far, and a lower one, the plane through its support point. The search ends where
they meet.
Source: IEEE Journal of Robotics and Automation 4, 1988, 193-203.
"""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.values import dataclass

#: mm; bounds this close have met
MET_MM = 1e-5
#: mm; smaller distances count as contact: less than the arithmetic resolves over a metre
TOUCH_MM = 1e-7
#: steps of the search at most
_STEPS = 64
#: pairs per batch
_BATCH = 1 << 13
#: a simplex is flat below this share of the volume (or area) that its edges could span
_FLAT = 1e-13
#: pairs of edges of a simplex
_PAIRS = ((0, 1), (0, 2), (1, 2))


@dataclass(frozen=True, slots=True, eq=False)
class Swept:
    """n frusta about axes parallel to Z, swept along straight segments: tip at `start`, moved by `travel`,
    (n, 3) each; (n, 2) `level` of lower and upper end above the tip, (n, 2) `radius` there. All mm."""

    start: Array
    travel: Array
    level: Array
    radius: Array

    def __len__(self) -> int:
        return len(self.start)

    def take(self, rows: Index) -> Swept:
        return Swept(self.start[rows], self.travel[rows], self.level[rows], self.radius[rows])

    def bounds(self) -> tuple[Array, Array]:
        """(n, 3) lowest and highest corner of the box that each axis sweeps, without the radius."""
        low = np.minimum(self.start, self.start + self.travel)
        high = np.maximum(self.start, self.start + self.travel)
        low[:, 2] += self.level[:, 0]
        high[:, 2] += self.level[:, 1]
        return low, high

    def support(self, direction: Array) -> Array:
        """(n, 3) the point farthest along a direction (n, 3), less `start`."""
        flat = np.sqrt(direction[:, 0] ** 2 + direction[:, 1] ** 2)
        reach = self.level * direction[:, 2:] + self.radius * flat[:, None]
        upper = reach[:, 1] > reach[:, 0]
        wide = np.where(upper, self.radius[:, 1], self.radius[:, 0])
        wide = wide / np.where(flat > 0, flat, np.inf)
        ahead = np.einsum("ij,ij->i", self.travel, direction) > 0
        point = np.where(ahead[:, None], self.travel, 0.0)
        point[:, 0] += wide * direction[:, 0]
        point[:, 1] += wide * direction[:, 1]
        point[:, 2] += np.where(upper, self.level[:, 1], self.level[:, 0])
        return point

    def gap(self, triangle: Array, direction: Array) -> Array:
        """(n,) by how much a plane across a direction (n, 3) of length 1 separates each from its triangle
        (n, 3, 3): no more than the distance."""
        near = np.einsum("ijk,ik->ij", triangle - self.start[:, None], direction).min(axis=1)
        return np.asarray(near - np.einsum("ij,ij->i", self.support(direction), direction), float)


@dataclass(frozen=True, slots=True, eq=False)
class Nearest:
    """(n,) `distance_mm`, 0 in contact; (n, 3) `point_mm` of the triangle; (n, 3) `away` of length 1 from the
    swept part to the triangle, 0 in contact.

    A distance of at least the given bound is inf; `away` is then normal to a plane that separates them by
    about that bound."""

    distance_mm: Array
    point_mm: Array
    away: Array


def nearest(swept: Swept, triangle: Array, bound_mm: Array | None = None) -> Nearest:
    """Distances of n swept parts, each from its triangle (n, 3, 3), exact to `MET_MM`; inf from `bound_mm`
    (n,) on."""
    count = len(swept)
    result = Nearest(np.full(count, np.inf), np.zeros((count, 3)), np.zeros((count, 3)))
    bound = np.full(count, np.inf) if bound_mm is None else bound_mm
    for a in range(0, count, _BATCH):
        rows = np.arange(a, min(a + _BATCH, count))
        _batch(swept.take(rows), triangle[rows], bound[rows], rows, result)
    return result


def _batch(swept: Swept, triangle: Array, bound: Array, rows: Index, result: Nearest) -> None:
    """Search one batch; `rows` are the indices of its pairs in the result. Pairs leave it when done."""
    local = triangle - swept.start[:, None]
    point = local.mean(axis=1) - 0.5 * swept.travel
    point[:, 2] -= 0.5 * swept.level.sum(axis=1)
    corners = np.zeros((len(rows), 4, 3))
    source = np.zeros((len(rows), 4, 3))
    weight = np.zeros((len(rows), 4))
    size = np.full(len(rows), np.inf)
    low = np.zeros(len(rows))
    witness = local[:, 0]
    for step in range(_STEPS):
        pick = np.einsum("ijk,ik->ij", local, point).argmin(axis=1)
        near = local[np.arange(len(local)), pick]
        new = near - swept.support(point)
        if step:
            low = np.maximum(low, np.einsum("ij,ij->i", point, new) / size)
            met = (size - low <= MET_MM) | (low >= bound)
            if met.any():
                _done(met, low, bound, size, point, witness, swept.start, rows, result)
                go = ~met
                if not go.any():
                    return
                swept, local, bound, rows = swept.take(np.flatnonzero(go)), local[go], bound[go], rows[go]
                corners, source, weight, size, low = corners[go], source[go], weight[go], size[go], low[go]
                point, new, near, witness = point[go], new[go], near[go], witness[go]
        order = np.argsort(-weight, axis=1, kind="stable")[:, :3]
        row = np.arange(len(rows))[:, None]
        kept = weight[row, order] > 0
        corners = np.concatenate(
            (new[:, None], np.where(kept[..., None], corners[row, order], new[:, None])), axis=1
        )
        source = np.concatenate(
            (near[:, None], np.where(kept[..., None], source[row, order], near[:, None])), axis=1
        )
        weight = _weights(corners)
        last, point = point, np.einsum("ij,ijk->ik", weight, corners)
        before, size = size, np.sqrt(np.einsum("ij,ij->i", point, point))
        low = np.where(size <= TOUCH_MM, size, low)
        size = np.maximum(size, TOUCH_MM)
        stuck = np.flatnonzero(size > before)
        if stuck.size:
            # corners too close for the arithmetic: continue from the best point as the only corner
            point[stuck], size[stuck] = last[stuck], before[stuck]
            corners[stuck, 0], source[stuck, 0] = last[stuck], witness[stuck]
            weight[stuck] = (1.0, 0.0, 0.0, 0.0)
        witness = np.einsum("ij,ijk->ik", weight, source)
    _done(np.ones(len(rows), bool), low, bound, size, point, witness, swept.start, rows, result)


def _done(
    met: Mask, low: Array, bound: Array, size: Array, point: Array, witness: Array, start: Array, rows: Index,
    result: Nearest,
) -> None:  # fmt: skip
    """Write the pairs that are done; distances beyond their bound remain infinite."""
    ours = met & ((low < bound) | (size <= TOUCH_MM))
    result.away[rows[met]] = point[met] / size[met, None]
    to = rows[ours]
    touching = size[ours] <= TOUCH_MM
    result.distance_mm[to] = np.where(touching, 0.0, size[ours])
    result.point_mm[to] = witness[ours] + start[ours]
    result.away[to[touching]] = 0.0


def _weights(corners: Array) -> Array:
    """(n, 4) weights of the point nearest to the origin in simplices (n, 4, 3) whose first corner is the
    newest.

    That corner always has weight, so only its own faces are compared: 3 edges, 3 triangles, the whole.
    Corners may coincide."""
    first = corners[:, 0]
    edge = corners[:, 1:] - first[:, None]
    gram = np.einsum("nik,njk->nij", edge, edge)
    goal = -np.einsum("nik,nk->ni", edge, first)
    base = np.einsum("ij,ij->i", first, first)
    share = np.zeros((len(corners), 3))
    best = base.copy()
    with np.errstate(invalid="ignore", divide="ignore"):
        for i in range(3):
            square = gram[:, i, i]
            t = np.clip(np.where(square > 0, goal[:, i] / square, 0.0), 0.0, 1.0)
            norm = base - 2 * t * goal[:, i] + t * t * square
            _take(norm < best, norm, best, share, {i: t})
        for i, j in _PAIRS:
            u, v, flat = _in_plane(gram, goal, i, j)
            norm = base - u * goal[:, i] - v * goal[:, j]
            inside = ~flat & (u > 0) & (v > 0) & (u + v < 1)
            _take(inside & (norm < best), norm, best, share, {i: u, j: v})
        _whole(edge, first, gram, best, share)
        _refine(edge, first, gram, share)
    return np.concatenate((1.0 - share.sum(axis=1, keepdims=True), share), axis=1)


def _in_plane(gram: Array, goal: Array, i: int, j: int) -> tuple[Array, Array, Mask]:
    """(n,) shares of edges i and j whose sum is nearest to a goal, and where the two hardly span a plane."""
    g, h, k = gram[:, i, i], gram[:, j, j], gram[:, i, j]
    det = g * h - k * k
    u, v = goal[:, i] * h - goal[:, j] * k, goal[:, j] * g - goal[:, i] * k
    return u / det, v / det, np.asarray(~(det > _FLAT * g * h), bool)


def _refine(edge: Array, first: Array, gram: Array, share: Array) -> None:
    """One step more towards the nearest point of the face that was chosen. Corners may be far from it beside
    its distance: then the rounding of the shares would turn the direction to it."""
    point = first + np.einsum("ni,nik->nk", share, edge)
    goal = -np.einsum("nik,nk->ni", edge, point)
    used = share > 0
    count = used.sum(axis=1)
    more = np.zeros_like(share)
    for i in range(3):
        alone = (count == 1) & used[:, i]
        more[alone, i] = (goal[:, i] / gram[:, i, i])[alone]
    for i, j in _PAIRS:
        both = (count == 2) & used[:, i] & used[:, j]
        u, v, _ = _in_plane(gram[both], goal[both], i, j)
        more[both, i], more[both, j] = u, v
    moved = share + more
    inside = (moved >= 0).all(axis=1) & (moved.sum(axis=1) <= 1)
    share[inside] = moved[inside]


def _take(better: Mask, norm: Array, best: Array, share: Array, parts: dict[int, Array]) -> None:
    best[better] = norm[better]
    share[better] = 0.0
    for column, values in parts.items():
        share[better, column] = values[better]


def _whole(edge: Array, first: Array, gram: Array, best: Array, share: Array) -> None:
    """The origin inside the tetrahedron: contact."""
    normal = np.cross(edge[:, 1], edge[:, 2])
    volume = np.einsum("ij,ij->i", edge[:, 0], normal)
    size = gram[:, 0, 0] * gram[:, 1, 1] * gram[:, 2, 2]
    solid = volume * volume > _FLAT * size
    if not solid.any():
        return
    u = -np.einsum("ij,ij->i", first, normal) / volume
    v = -np.einsum("ij,ij->i", first, np.cross(edge[:, 2], edge[:, 0])) / volume
    w = -np.einsum("ij,ij->i", first, np.cross(edge[:, 0], edge[:, 1])) / volume
    inside = solid & (u >= 0) & (v >= 0) & (w >= 0) & (u + v + w <= 1)
    _take(inside, np.zeros(len(best)), best, share, {0: u, 1: v, 2: w})
