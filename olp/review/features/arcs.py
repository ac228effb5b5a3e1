"""Arcs and circles: moves about one centre with one radius in one plane, at one level or at several."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import ClassVar

import numpy as np

from olp.core.arrays import Array
from olp.core.values import dataclass
from olp.review.features.alike import alike, members
from olp.review.features.base import Deviations, Feature, FeatureKind, Figure
from olp.review.features.circles import Circular
from olp.review.features.figures import counted, number, spread
from olp.review.features.fits import circle
from olp.review.features.ground import Ground

#: Arcs are whole circles where less than this is missing, in rad.
_WHOLE = np.radians(0.5)
#: Least angle of an arc with a fitted circle, in rad. The centre of half a circle may be off by 2.8 times the
#: largest deviation, and that of a quarter by 9.7 times, which says little of the part.
_HALF = np.pi - np.radians(0.5)
#: Points over at least this share of the angle of an arc are enough for a circle.
_COVERED = 0.75
#: Fewest points of a circle.
_POINTS = 4


@dataclass(frozen=True, slots=True, eq=False)
class _Shape:
    """Centre, unit vectors (3,) of the plane, radius, and the angle that the arc covers in rad."""

    centre: Array
    first: Array
    second: Array
    radius_mm: float
    covered: float


class _Circles(FeatureKind):
    """What arcs and circles have in common."""

    whole: bool

    def find(self, ground: Ground) -> Iterable[Feature]:
        circular, near = ground.circular, ground.moves.near_mm
        normal = np.cross(circular.first, circular.second)
        across = circular.centre - (circular.centre * normal).sum(axis=1)[:, None] * normal
        operation = ground.moves.operation[circular.row]
        # a centre is as good as two rounded numbers
        centre = [2.0 * near] * 3
        group = alike(
            (operation, *normal.T, *across.T, circular.radius_mm), (0, 1e-6, 1e-6, 1e-6, *centre, 2.0 * near)
        )
        for rows in members(group):
            own = circular.take(rows)
            covered = _covered(own)
            if (covered > 2.0 * np.pi - _WHOLE) == self.whole:
                yield self._feature(ground, own, normal[rows[0]], covered)

    def _feature(self, ground: Ground, own: Circular, normal: Array, covered: float) -> Feature:
        radius = float(own.radius_mm.mean())
        low, high = (points @ normal for points in ground.moves.tips(own.row))
        heights = np.concatenate((low, high))
        centre = own.centre.mean(axis=0)
        centre += (0.5 * (heights.min() + heights.max()) - centre @ normal) * normal
        shape = _Shape(centre, own.first[0], own.second[0], radius, covered)
        detail = [f"R {number(radius)} mm"]
        detail.append("360°" if self.whole else f"{np.degrees(covered):.0f}°")
        axis = int(np.argmax(np.abs(normal)))
        if np.abs(normal[axis]) > 1.0 - 1e-9 and axis != 2:
            detail.append(f"in the plane {('YZ', 'ZX')[axis]}")
        level = high[~own.rise]
        if level.size:
            levels = len(np.unique(alike((level,), (ground.moves.near_mm,))))
            detail.append(counted(levels, "level"))
        if own.rise.any():
            turns = float(np.abs(own.sweep[own.rise]).sum() / (2 * np.pi))
            detail.append(
                f"helix of {number(round(turns, 2))} {'turn' if round(turns, 2) == 1.0 else 'turns'}"
            )
        return Feature(self.name, own.row, shape, self.label, ", ".join(detail), tuple(centre.tolist()))

    def measure(self, feature: Feature, deviations: Deviations) -> Mapping[str, float | None]:
        shape: _Shape = feature.shape
        nominal = deviations.nominal_mm - shape.centre
        angle = np.arctan2(nominal @ shape.second, nominal @ shape.first)
        # chords and rounded numbers are no deviation of the machine
        dx, dy = deviations.delta_mm @ shape.first, deviations.delta_mm @ shape.second
        x, y = shape.radius_mm * np.cos(angle) + dx, shape.radius_mm * np.sin(angle) + dy
        if shape.covered < _HALF:
            radial = dx * np.cos(angle) + dy * np.sin(angle)
            return {"position": deviations.mean(radial), "form": spread(radial)}
        if len(deviations) < _POINTS or _span(angle) < _COVERED * min(shape.covered, 1.5 * np.pi):
            return {"position": None, "size": None, "form": None}
        fitted = circle(x, y, deviations.weight, (0.0, 0.0, shape.radius_mm))
        return {
            "position": float(np.hypot(fitted.x_mm, fitted.y_mm)),
            "size": 2.0 * (fitted.radius_mm - shape.radius_mm),
            "form": spread(fitted.residuals),
        }


_CENTRE = "how far the centre of the least-squares circle is from the nominal centre"
_SIZE = "change of the diameter of the least-squares circle; plus is larger"
_ROUND = "range of the radial distances from the least-squares circle (ISO 12181-1, LSCI)"


class Circle(_Circles):
    """Whole circles."""

    name = "circle"
    label = "circle"
    whole = True
    figures: ClassVar[Mapping[str, Figure]] = {
        "position": Figure("position", _CENTRE),
        "size": Figure("diameter", _SIZE),
        "form": Figure("roundness", _ROUND),
    }


class Arc(_Circles):
    """Arcs."""

    name = "arc"
    label = "arc"
    whole = False
    figures: ClassVar[Mapping[str, Figure]] = {
        "position": Figure(
            "position",
            f"from 180° on, {_CENTRE}; of shorter arcs, mean of the radial deviations, plus is away from the "
            "centre",
        ),
        "size": Figure("diameter", f"from 180° on, {_SIZE}"),
        "form": Figure(
            "roundness", f"from 180° on, {_ROUND}; of shorter arcs, range of the radial deviations"
        ),
    }


def _covered(own: Circular) -> float:
    """The angle that moves cover together, in rad."""
    whole = 2.0 * np.pi
    if (np.abs(own.sweep) >= whole - _WHOLE).any():
        return float(whole)
    begin = np.mod(np.where(own.sweep > 0.0, own.begin, own.begin + own.sweep), whole)
    order = np.argsort(begin, kind="stable")
    begin, end = begin[order], begin[order] + np.abs(own.sweep[order])
    # what goes past the whole turn goes on from its beginning
    begin, end = np.concatenate((begin, begin + whole)), np.concatenate((end, end + whole))
    reach = np.maximum.accumulate(end)
    gaps = np.maximum(begin[1:] - reach[:-1], 0.0)
    return float(whole - gaps[len(order) - 1 :].sum())


def _span(angle: Array) -> float:
    """A whole turn less the widest gap between angles (k,)."""
    rising = np.sort(angle)
    gaps = np.diff(np.append(rising, rising[0] + 2.0 * np.pi))
    return float(2.0 * np.pi - gaps.max())
