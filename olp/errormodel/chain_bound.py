"""Upper bound of the departure from the chord for a rigid-body chain, in about 30 ns per point.

Per axis the bounds of its components are summed row by row with their largest lever arms, and the rows joined
to one length. First-order cross terms: change of an angle times change of its lever arm / 4. To cover all
second-order terms (angle times displacement, products of angles), lever arms, slopes and translations are
widened by a multiple of the sum of all angles. With A the sum of the largest angles of all axes:

    extra    4 A (1 + A): a translation counts (1 + extra) times
    widened  the largest displacement of all errors + extra * the sum of all lever arms: added to each lever
             arm, also along its own axis of rotation
    stretch  (extra + 2 * the sum of all slopes of displacements) times the change of all angles of the axis:
             added to the cross term of each axis
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from olp.core.arrays import Array
from olp.core.values import dataclass
from olp.errormodel.bodies import Body
from olp.errormodel.chord import Variation, bins

#: Moves at a time: the columns of one block fit in the second-level cache.
_BLOCK = 8192


@dataclass(frozen=True, slots=True, eq=False)
class AxisBound:
    """For a move that takes this axis by d, with h the cell of its table:
    min(curvature/8 (d^2 + 2 h min(d, h)), smooth[bin]) + d (kinks[bin] + sum_k change_k[bin] |delta_k|).
    """

    axis: int
    cell_mm: float
    curvature: float
    smooth: Array
    kinks: Array | None
    change: tuple[Array | None, ...]

    def at(self, length_mm: list[Array]) -> Array:
        d = length_mm[self.axis]
        index = bins(d)
        bound = np.minimum(d, self.cell_mm)
        bound *= 2.0 * self.cell_mm
        bound += d * d
        bound *= self.curvature / 8.0
        np.minimum(bound, self.smooth.take(index, mode="clip"), out=bound)
        rest = None if self.kinks is None else self.kinks.take(index, mode="clip")
        for k, change in enumerate(self.change):
            if change is not None:
                cross = change.take(index, mode="clip")
                cross *= length_mm[k]
                rest = cross if rest is None else rest + cross
        if rest is not None:
            rest *= d
            bound += rest
        return bound


def chord_bound(bounds: Sequence[AxisBound], delta_mm: Array) -> Array:
    """(n,) bound in mm for moves delta_mm (n, 3) anywhere in the box."""
    result = np.zeros(len(delta_mm))
    for start in range(0, len(delta_mm), _BLOCK):
        part = delta_mm[start : start + _BLOCK]
        lengths = [np.abs(part[:, k]) for k in range(3)]
        for bound in bounds:
            result[start : start + _BLOCK] += bound.at(lengths)
    return result


def axis_bounds(bodies: Sequence[Body], box_mm: Array, tool: Array, *, second_order: bool) -> list[AxisBound]:
    """The bound of each body for tool vectors between the rows of `tool` (m, 3)."""
    reach = {body.axis: _reach(body, box_mm, tool) for body in bodies}
    extra, lipschitz, displaced = 0.0, 0.0, 0.0
    if second_order:
        angles = sum(v.peak for b in bodies for v in b.components.variation[3:] if v is not None)
        extra = 4.0 * angles * (1.0 + angles)
        for body in bodies:
            values = body.components.variation
            lipschitz += sum(v.slope for v in values[:3] if v is not None) + sum(abs(s) for s in body.shear)
            displaced += sum(v.peak for v in values[:3] if v is not None) + abs(body.components.backlash_mm)
            displaced += sum(abs(s) for s in body.shear) * float(
                np.abs(box_mm[body.axis] - body.datum_mm).max()
            )
            displaced += sum(v.peak * float(reach[body.axis].sum()) for v in values[3:] if v is not None)
            lipschitz += sum(
                v.slope * float(reach[body.axis].sum()) + v.peak for v in values[3:] if v is not None
            )
    farthest = sum(float(r.max(axis=0).sum()) for r in reach.values())
    widened = displaced + extra * farthest
    limits = [_axis_bound(body, reach[body.axis], extra, widened, lipschitz) for body in bodies]
    return [bound for bound in limits if bound is not None]


def _axis_bound(body: Body, reach: Array, extra: float, widened: float, lipschitz: float) -> AxisBound | None:
    parts = body.components.variation
    if all(v is None or not v.varies for v in parts):
        return None
    rows = [_Row() for _ in range(3)]
    change: list[list[Array]] = [[] for _ in range(3)]
    for i, part in enumerate(parts[:3]):
        if part is not None:
            rows[i].add(part, 1.0 + extra)
    moves = {i: lever_arm.moves for members, lever_arm in body.lever_arms for i in members}
    for a, part in enumerate(parts[3:]):
        if part is None or not part.varies:
            continue
        for i in range(3):
            k = 3 - i - a
            rows[i].add(part, (reach[i, k] if i != a else 0.0) + widened)
            if i != a and moves[i][k]:
                change[k].append(part.change)
    # Second order: any angle meets any lever arm, and lever arms stretch with the error itself.
    angular = [part.change for part in parts[3:] if part is not None and part.varies]
    stretch = (extra + 2.0 * lipschitz) * sum(angular, np.zeros(1)) if extra > 0.0 else None
    crosses: list[Array | None] = []
    for k in range(3):
        terms = [np.sqrt(sum((c * c for c in change[k]), np.zeros(1)))] if change[k] else []
        terms += [stretch] if stretch is not None else []
        crosses.append(0.25 * sum(terms, np.zeros(1)) if terms else None)
    kinks = _joined([row.kinks for row in rows])
    return AxisBound(
        axis=body.axis,
        cell_mm=body.components.table.step,
        curvature=math.hypot(*(row.curvature for row in rows)),
        smooth=_joined([row.smooth for row in rows]),
        kinks=kinks if np.any(kinks) else None,
        change=tuple(crosses),
    )


class _Row:
    """Sum of bounds on one component of the error."""

    def __init__(self) -> None:
        self.curvature, self.smooth, self.kinks = 0.0, np.zeros(1), np.zeros(1)

    def add(self, part: Variation, weight: float) -> None:
        self.curvature += weight * part.curvature
        self.smooth = self.smooth + weight * part.smooth
        self.kinks = self.kinks + weight * part.kinks


def _joined(rows: list[Array]) -> Array:
    return np.asarray(np.sqrt(sum((row * row for row in rows), np.zeros(1))))


def _reach(body: Body, box_mm: Array, tool: Array) -> Array:
    """(3, 3) largest |coordinate k| of the lever arm of row i."""
    reach = np.zeros((3, 3))
    for members, lever_arm in body.lever_arms:
        reach[list(members)] = lever_arm.reach_mm(box_mm, tool)
    return reach
