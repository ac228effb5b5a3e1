"""Kernels over several waypoints, whose second derivatives bend at waypoints only.

A kernel that ends between waypoints has breaks of its own there. Along an even curve it does not cancel with
its neighbours then: the curvature is a saw with a tooth for each step, which the jerk bounds. So a kernel
that reaches over waypoints is sampled there. hat_j is 1 at waypoint j and 0 at its neighbours, l the arc
length:

    q'' of kernel k = du_k sum_j v_j hat_j,   v_j ~ (1 - |l_j - l_k| / w_k) (1 + beta (x_j - l_k)),

where x_j is the middle of the area of hat_j. The sum of areas is 1, and beta puts their middle at l_k: so the
path is on the polyline before the kernel and behind it. Along an even curve the sum of such kernels is even.
"""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.values import dataclass

#: a factor 1 + beta (x_j - l_k) is no less
_LEAST = 0.1
#: a kernel becomes so many times as wide at most
_WIDER = 2.0
#: waypoints under a kernel at least
_FEWEST = 3
#: waypoints under a kernel at most; a wider one has breaks of its own
_MOST = 1 << 9
#: waypoints under all kernels of a block
_BLOCK = 1 << 19
_TINY = 1e-300


@dataclass(frozen=True, slots=True, eq=False)
class Hats:
    """(n,) which kernels are `sampled`, between waypoints `begin` and `end` (n,). (m - 1, 4, axes) the sum
    of the sampled ones and of its first three derivatives at the start of each segment."""

    sampled: Mask
    begin: Index
    end: Index
    taylor: Array

    def at(self, x: Array, arc_mm: Array, segment: Index) -> Array:
        """(k, 4, axes) the same at places (k,) in segments (k,)."""
        f, f1, f2, f3 = self.taylor[segment].transpose(1, 0, 2)
        d = (x - arc_mm[segment])[:, None]
        return np.stack(
            (f + d * (f1 + d * (f2 / 2.0 + d * (f3 / 6.0))), f1 + d * (f2 + d * (f3 / 2.0)), f2 + d * f3, f3),
            axis=1,
        )


def hats(arc_mm: Array, place: Index, width: Array, bend: Array, rest: Mask) -> Hats:
    """The kernels at waypoints `place` (n,) of a polyline with waypoints at arc lengths (m,) that can be
    sampled. Kernel i changes the direction by `bend` (n, axes), and reaches no waypoint at `rest` (m,), such
    as the ends. The path is straight beside rests, so one that would end there is not sampled. Nor is one
    beside a long segment, over which it would become far wider."""
    middle = arc_mm[place]
    begin = np.searchsorted(arc_mm, middle - width, side="right") - 1
    end = np.searchsorted(arc_mm, middle + width, side="left")
    count = end - begin - 1
    reach = np.maximum(middle - arc_mm[begin], arc_mm[end] - middle)
    fits = (count >= _FEWEST) & (count <= _MOST) & (reach <= _WIDER * width)
    wide = np.flatnonzero(fits & ~rest[begin] & ~rest[end])
    sampled = np.zeros(len(place), bool)
    axes = bend.shape[1]
    sums = np.zeros((3, axes, len(arc_mm)))
    size = np.zeros(len(place), np.int64)
    size[wide] = 1 << np.ceil(np.log2(count[wide])).astype(np.int64)
    for columns in np.unique(size[wide]).tolist():
        own = wide[size[wide] == columns]
        for some in np.array_split(own, max(len(own) * columns // _BLOCK, 1)):
            good, at, values = _sampled(arc_mm, place[some], width[some], begin[some], end[some], columns)
            sampled[some] = good
            of = np.repeat(some[good], columns)
            for total, value in zip(sums, values, strict=True):
                for axis in range(axes):
                    total[axis] += np.bincount(at, value * bend[of, axis], len(arc_mm))
    taylor = np.empty((len(arc_mm) - 1, 4, axes))
    second, first, own_mm = sums
    taylor[:, 0], taylor[:, 1], taylor[:, 2] = own_mm.T[:-1], first.T[:-1], second.T[:-1]
    taylor[:, 3] = np.diff(second.T, axis=0) / np.diff(arc_mm)[:, None]
    return Hats(sampled, begin, end, taylor)


def _sampled(
    arc_mm: Array, place: Index, width: Array, begin: Index, end: Index, columns: int
) -> tuple[Mask, Index, tuple[Array, Array, Array]]:
    """Which kernels (n,) can be sampled. Of these the waypoints under each, `columns` a kernel in one row.
    And there the second derivative of each, its first, and itself, all for a bend of 1."""
    at = begin[:, None] + 1 + np.arange(columns)
    inside = at < end[:, None]
    at = np.where(inside, at, end[:, None] - 1)
    middle = arc_mm[place][:, None]
    off, before, behind = arc_mm[at] - middle, arc_mm[at - 1] - middle, arc_mm[at + 1] - middle
    tent = np.where(inside, 1.0 - np.abs(off) / width[:, None], 0.0)
    centre = (before + off + behind) / 3.0
    area = tent * (behind - before)
    moment = (area * centre).sum(axis=1)
    beta = -moment / np.maximum((area * centre * centre).sum(axis=1), _TINY)
    tilt = 1.0 + beta[:, None] * centre
    good = (tilt.min(axis=1, where=inside, initial=1.0) >= _LEAST) & (beta * width < 1.0 / _LEAST)
    at, off, inside, area = at[good], off[good], inside[good], area[good] * tilt[good]
    value = tent[good] * tilt[good] * (2.0 / area.sum(axis=1))[:, None]
    step = np.where(inside, off - before[good], 0.0)
    last = np.concatenate((np.zeros((len(value), 1)), value[:, :-1]), axis=1)
    first = np.cumsum(0.5 * step * (last + value), axis=1)
    of_first = np.concatenate((np.zeros((len(value), 1)), first[:, :-1]), axis=1)
    own = np.cumsum(step * (of_first + step * (last / 3.0 + value / 6.0)), axis=1)
    first -= off >= 0.0
    own -= np.maximum(off, 0.0)
    parts = tuple(np.where(inside, part, 0.0).ravel() for part in (value, first, own))
    return good, at.ravel(), parts  # type: ignore[return-value]
