"""The least time of a spline of time inside bounds that its nodes share with few others.

A primal-dual interior method. Every step of it stays strictly within all bounds. Lengths of cells make the
bounds other than convex: a ridge on their change holds them back. It grows at the cells whose bounds cut a
step, and nowhere else.
Source: Boyd and Vandenberghe, Convex Optimization, 11.7; Levenberg-Marquardt for the ridge.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from scipy.linalg import LinAlgError, solveh_banded

from olp.core.arrays import Array, Index
from olp.core.values import dataclass
from olp.trajectory.timespline import NODES, TimeSpline

#: first barrier, all of it over the time
_FIRST = 0.05
#: least barrier
_LEAST = 3e-4
#: (length, factor): the factor by which the barrier falls after a step longer than that
_FALL = ((0.8, 0.5), (0.4, 0.7), (0.2, 0.9), (-1.0, 0.97))
#: share of the distance to the boundary that a step may take
_NEAR = 0.95
#: share of its slack that a step leaves to each row
_LEAVE = 0.02
#: factor by which a step is cut
_BACK = 0.6
#: how often a step is cut at most
_TRIES = 12
#: ridge on changes of lengths, relative, at first
_RIDGE = 1e-2
#: the least and the largest ridge
_RIDGES = (1e-6, 1e3)
#: factor of the ridge after a short step
_STIFFER = 4.0
#: factor of the ridge after a long step
_SOFTER = 0.3
#: a step is short below this
_SHORT = 0.3
#: a step is long above this
_LONG = 0.7
#: addition to the diagonal, relative
_ROUNDING = 1e-9
#: addition where the diagonal is 0
_NOTHING = 1e-12
#: multipliers are at most so much above or below those of the barrier
_APART = 1e3
#: steps at most
_STEPS = 160
#: steps of no length at most
_STUCK = 4
#: change of the time, relative, below which the search ends ...
_DONE = 2e-4
#: ... over so many steps ...
_OVER = 8
#: ... where the barrier is below this
_BARRIER = 2e-3
#: a step is at most so many times as long as the one before ...
_LONGER = 2.0
#: ... and that counts as no shorter than this
_SHORTEST = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """Bounds: `value` (r, k) is at most 1, and with both `sides` at least -1.

    `slope` (r, k, 5, axes + 1) is its change by the five nodes from `base` (r,) on, which is -1 or more.
    Each base is one more than that before, unless they are `scattered`. `curve` (r, c, 5, axes + 1) are rows
    whose squares are half its curvature. Both are empty where only values are asked for."""

    base: Index
    value: Array
    sides: bool
    slope: Array
    curve: Array | None = None
    scattered: bool = False

    def slack(self) -> Array:
        """(1 or 2, r, k) what is left below 1, and above -1."""
        above = 1.0 - self.value
        return np.stack((above, 1.0 + self.value)) if self.sides else above[None]

    def signs(self) -> Array:
        return np.array([1.0, -1.0] if self.sides else [1.0])[:, None, None]

    def change(self, step: Array) -> Array:
        """(1 or 2, r, k) by which a `step` of the padded nodes changes the slack."""
        near = step[self.base[:, None] + 1 + np.arange(NODES)]
        return np.asarray(-self.signs() * np.einsum("rkqb,rqb->rk", self.slope, near))


#: all bounds of a spline, with or without slopes
Bounds = Callable[[TimeSpline, bool], list[Group]]


def least_time(
    spline: TimeSpline, bounds: Bounds, size_mm: float, good: Callable[[TimeSpline], bool]
) -> TimeSpline:
    """The spline of least time, from one strictly within the bounds. The first three and the last three
    coefficients are kept; others move by about `size_mm`. It is the last one on the way there that is `good`,
    or the first one."""
    way = [spline]
    groups = bounds(spline, True)
    slacks = [group.slack() for group in groups]
    whole = spline.duration_s
    count = sum(group.value.size * (1 + group.sides) for group in groups)
    mu = _FIRST / count
    duals = [mu / slack for slack in slacks]
    ridge, stuck = np.full(len(spline), _RIDGE), 0
    longest, times = 1.0, [whole]
    for _ in range(_STEPS):
        try:
            step = _newton(spline, groups, duals, slacks, mu, whole, size_mm, ridge)
        except LinAlgError:
            break
        changes = [group.change(step) for group in groups]
        there, length, most = _toward(spline, groups, slacks, changes, bounds, step, longest)
        longest = _LONGER * max(length, _SHORTEST)
        factor = np.where(most < _SHORT, _STIFFER, np.where(most > _LONG, _SOFTER, 1.0))
        ridge = np.clip(ridge * factor, *_RIDGES)
        if not length:
            stuck += 1
            if stuck == _STUCK:
                break
            continue
        spline = there
        way.append(spline)
        dual_length = _advance(duals, slacks, changes, mu)
        groups = bounds(spline, True)
        slacks = [group.slack() for group in groups]
        for dual, slack in zip(duals, slacks, strict=True):
            central = mu / slack
            np.clip(dual, central / _APART, central * _APART, out=dual)
        mu *= next(fall for least, fall in _FALL if min(length, dual_length) > least)
        mu = max(mu, _LEAST / count)
        times.append(spline.duration_s)
        if mu * count < _BARRIER and times[-1] > (1.0 - _DONE) * times[max(len(times) - 1 - _OVER, 0)]:
            break
    # mostly the very last one is
    return next((one for one in reversed(way[1:]) if good(one)), way[0])


def _newton(
    spline: TimeSpline, groups: list[Group], duals: list[Array], slacks: list[Array], mu: float, whole: float,
    size_mm: float, ridge: Array,
) -> Array:  # fmt: skip
    """Newton's step of the nodes, padded by one before and two behind (m + 6, axes + 1)."""
    m, axes = len(spline), spline.coefficient.shape[1]
    wide = axes + 1
    gradient = np.zeros((m + 6, wide))
    gradient[2 : m + 2, axes] = 1.0 / whole
    blocks = np.zeros((m + 2, NODES * wide, NODES * wide))
    for base, rows, weight, pull in _stacked(groups, duals, slacks, mu):
        block = rows.transpose(0, 2, 1) @ (weight[:, :, None] * rows)
        pulled = (pull[:, None, :] @ rows).reshape(-1, NODES, wide)
        if isinstance(base, slice):
            blocks[base] += block
            for k in range(NODES):
                gradient[base.start + k : base.stop + k] += pulled[:, k]
        else:
            np.add.at(blocks, base, block)
            for k in range(NODES):
                np.add.at(gradient, base + k, pulled[:, k])
    scale = np.full((m + 6, wide), size_mm)
    scale[2 : m + 2, axes] = spline.cell_s
    free = np.zeros((m + 6, wide), bool)
    free[4 : m + 1, :axes] = True
    free[2 : m + 2, axes] = True
    stiff = np.zeros((m + 6, wide))
    stiff[2 : m + 2, axes] = ridge
    step = _solved(blocks, gradient.ravel(), scale.ravel(), free.ravel(), stiff.ravel(), wide)
    return step.reshape(m + 6, wide)


def _stacked(
    groups: list[Group], duals: list[Array], slacks: list[Array], mu: float
) -> Iterator[tuple[slice | Index, Array, Array, Array]]:
    """Of groups the padded nodes from which their rows are (r,), rows (r, k, 5 (axes + 1)), weights (r, k)
    and how they pull (r, k). Those that are not scattered come as one: a few large products take less than
    many small ones."""
    in_order: list[tuple[int, Array, Array, Array]] = []
    for group, dual, slack in zip(groups, duals, slacks, strict=True):
        if not len(group.base):
            continue
        weight, pull = (dual / slack).sum(axis=0), (mu * group.signs() / slack).sum(axis=0)
        rows = group.slope
        if group.curve is not None:
            curved = dual[0].repeat(group.curve.shape[1], axis=1)
            weight = np.concatenate((weight, curved), axis=1)
            pull = np.concatenate((pull, np.zeros_like(curved)), axis=1)
            rows = np.concatenate((rows, group.curve), axis=1)
        rows = rows.reshape(*weight.shape, -1)
        if group.scattered:
            yield group.base + 1, rows, weight, pull
        else:
            in_order.append((int(group.base[0]) + 1, rows, weight, pull))
    begin = min(base for base, *_ in in_order)
    end = max(base + len(rows) for base, rows, *_ in in_order)
    count, columns = end - begin, sum(rows.shape[1] for _, rows, *_ in in_order)
    rows = np.zeros((count, columns, in_order[0][1].shape[2]))
    weight, pull = np.zeros((count, columns)), np.zeros((count, columns))
    first = 0
    for base, *parts in in_order:
        own = slice(base - begin, base - begin + len(parts[0])), slice(first, first + parts[0].shape[1])
        for to, part in zip((rows, weight, pull), parts, strict=True):
            to[own] = part
        first = own[1].stop
    yield slice(begin, end), rows, weight, pull


def _solved(blocks: Array, gradient: Array, scale: Array, free: Array, stiff: Array, wide: int) -> Array:
    """The step of the free unknowns from blocks of the matrix that begin at each node, in scaled unknowns."""
    size, width = len(gradient), NODES * wide
    band = np.zeros((width, size))
    reach = len(blocks) * wide
    for p in range(width):
        for q in range(p, width):
            band[width - 1 - (q - p), q : q + reach : wide] += blocks[:, p, q]
    used = np.where(free, scale, 0.0)
    for k in range(width):
        band[width - 1 - k, k:] *= used[k:] * used[: size - k]
        band[width - 1 - k, :k] = 0.0
    diagonal = band[-1]
    diagonal += np.where(free, _ROUNDING * diagonal + _NOTHING + stiff, 1.0)
    return np.asarray(-used * solveh_banded(band, used * gradient, overwrite_ab=True, check_finite=False))


def _toward(
    spline: TimeSpline,
    groups: list[Group],
    slacks: list[Array],
    changes: list[Array],
    bounds: Bounds,
    step: Array,
    longest: float,
) -> tuple[TimeSpline, float, Array]:
    """The spline after a part of a step that leaves each row some of its slack, and that part; 0: none. And
    (m,) the part of the step that the bounds of each cell bear."""
    m, axes = len(spline), spline.coefficient.shape[1]
    # of each node, as the step
    most = np.ones(m + 6)
    for group, change, slack in zip(groups, changes, slacks, strict=True):
        fall = (-change / slack).max(axis=(0, 2), initial=0.0)
        some = np.flatnonzero(fall > _NEAR)
        _lower(most, group.base[some], _NEAR / fall[some])
    length = min(float(most.min()), longest)
    for _ in range(_TRIES):
        part = length * step
        there = spline.moved(part[1 : m + 4, :axes], part[2 : m + 2, axes])
        if (there.cell_s <= 0.0).any():
            none = np.flatnonzero(there.cell_s <= 0.0)
            _lower(most, none, np.full(len(none), _BACK * length))
        else:
            good = True
            for group, slack in zip(bounds(there, False), slacks, strict=True):
                short = np.flatnonzero((group.slack() <= _LEAVE * slack).any(axis=(0, 2)))
                good &= not len(short)
                _lower(most, group.base[short], np.full(len(short), _BACK * length))
            if good:
                return there, length, most[2 : m + 2]
        length *= _BACK
    return spline, 0.0, most[2 : m + 2]


def _lower(most: Array, base: Index, part: Array) -> None:
    """Lower what the nodes of rows bear to the `part` of each row."""
    for k in range(NODES if len(base) else 0):
        np.minimum.at(most, base + 1 + k, part)


def _advance(duals: list[Array], slacks: list[Array], changes: list[Array], mu: float) -> float:
    """Step along Newton's direction of the multipliers while all stay positive; the length of the step."""
    moves = [
        (mu - dual * change) / slack - dual
        for dual, slack, change in zip(duals, slacks, changes, strict=True)
    ]
    fall = max(float((-move / dual).max(initial=0.0)) for move, dual in zip(moves, duals, strict=True))
    length = min(1.0, _NEAR / fall) if fall > 0.0 else 1.0
    for dual, move in zip(duals, moves, strict=True):
        dual += length * move
    return length
