"""Contours of one level: connected feed moves, the same contour at several levels being one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import ClassVar

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.geometry import segment_distance
from olp.core.values import dataclass
from olp.review.features.alike import alike, members
from olp.review.features.base import Deviations, Feature, FeatureKind, Figure
from olp.review.features.chains import Chains
from olp.review.features.figures import counted, number, unit
from olp.review.features.ground import Ground

#: Nodes and weights of Gauss over 0..1: exact for moments of lines, and far below a digit for arcs.
_GAUSS = np.polynomial.legendre.leggauss(6)

#: Least part of the normals of a contour, by their squares, in a direction in which its shift is known.
_KNOWN = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class _Shape:
    """`turn` (3, 3) has the directions across and along the tool axis as columns. Of each move, by `row`
    (rising): (m, 3) `along`, its direction at its start, (m, 3) `centre`, and (m,) whether it is `curved`.
    All are in the frame shown."""

    turn: Array
    row: Index
    along: Array
    centre: Array
    curved: Array


class Contour(FeatureKind):
    """Contours of at least two moves."""

    name = "contour"
    label = "contour"
    figures: ClassVar[Mapping[str, Figure]] = {
        "position": Figure(
            "position",
            "size of the shift in the plane that fits the deviations normal to the contour best "
            "(least squares)",
        ),
        "form": Figure(
            "profile",
            "largest deviation normal to the contour in its plane, with nothing removed: half of the width "
            "of the profile zone (ISO 1101)",
        ),
    }
    container = True

    def find(self, ground: Ground) -> Iterable[Feature]:
        chains = ground.chains
        several = ~ground.areas.inner & ~ground.touches & (np.diff(chains.first) > 1)
        some = np.flatnonzero(several)
        if not some.size:
            return
        for group in members(_same(ground, chains, some)):
            yield self._feature(ground, chains, some[group])

    def _feature(self, ground: Ground, chains: Chains, which: Index) -> Feature:
        own = np.concatenate([np.arange(chains.first[k], chains.first[k + 1]) for k in which.tolist()])
        row = chains.row[own]
        turn = ground.moves.turn(int(row[0]))
        low, high = chains.box(own)
        size = high - low
        levels = 1 + int(alike((chains.end[own, 2],), (ground.moves.near_mm,)).max())
        detail = [f"path {number(float(size[0]))} x {number(float(size[1]))} mm"]
        detail.append("closed" if _closed(chains, int(which[0]), ground.moves.near_mm) else "open")
        level = ground.moves.level(int(row[0]), turn[:, 2]) or "1 level"
        detail.append(level if levels == 1 else counted(levels, "level"))
        step = chains.end[own] - chains.start[own]
        centre = np.concatenate((chains.centre[own], chains.start[own, 2:]), axis=1)
        shape = _Shape(turn, row, unit(step) @ turn.T, centre @ turn.T, chains.sweep[own] != 0.0)
        place = turn @ ((low + high) / 2.0)
        return Feature(self.name, row, shape, self.label, ", ".join(detail), tuple(place.tolist()))

    def measure(self, feature: Feature, deviations: Deviations) -> Mapping[str, float | None]:
        shape: _Shape = feature.shape
        level = deviations.delta_mm @ shape.turn[:, :2]
        which = np.searchsorted(shape.row, deviations.move)
        arm = (deviations.nominal_mm - shape.centre[which]) @ shape.turn[:, :2]
        along = shape.along[which] @ shape.turn[:, :2]
        normal = np.where(shape.curved[which, None], unit(arm), np.stack((-along[:, 1], along[:, 0]), axis=1))
        away = (level * normal).sum(axis=1)
        return {
            "position": _shift_mm(normal, away, deviations.weight),
            "form": float(np.abs(away).max()),
        }


def _shift_mm(normal: Array, away: Array, weight: Array) -> float:
    """The size of the shift (2,) whose parts along unit normals (k, 2) are nearest to the deviations `away`
    (k,) along them. What a measured path is off along itself is not known, so that only these count. In a
    direction in which hardly a normal points the shift is not known, and taken as 0."""
    share, axes = np.linalg.eigh((normal * weight[:, None]).T @ normal / weight.sum())
    part = axes.T @ ((normal * weight[:, None]).T @ away / weight.sum())
    return float(np.linalg.norm(np.where(share > _KNOWN, part / np.maximum(share, _KNOWN), 0.0)))


def _closed(chains: Chains, chain: int, near_mm: float) -> bool:
    """Whether a chain comes back to a place where it was, and was most of its length between: it may overlap,
    and begin and end beside the contour."""
    own = np.arange(chains.first[chain], chains.first[chain + 1])
    vertices = np.concatenate((chains.start[own[:1], :2], chains.end[own, :2]))
    done = np.concatenate(([0.0], np.cumsum(chains.length_mm[own])))
    place = alike((vertices[:, 0], vertices[:, 1]), (near_mm, near_mm))
    first = np.full(len(place), np.inf)
    np.minimum.at(first, place, done)
    if (done - first[place]).max() > done[-1] / 2.0:
        return True
    if len(own) < 3 or chains.sweep[own[0]] != 0.0:
        return False
    # it may end on the line with which it began
    start, end = chains.start[own[:1], :2], chains.end[own[:1], :2]
    return bool(segment_distance(vertices[-1:], start, end)[0] <= near_mm)


def _same(ground: Ground, chains: Chains, some: Index) -> Index:
    """(k,) which of the chains `some` are the same contour: wherever they begin, whichever way they go, and
    however their lines are split. Length, middle and second moments of the path tell them apart."""
    every = np.arange(len(chains.row))
    sums = []
    total = chains.sums(chains.length_mm)
    for node, weight in zip(_GAUSS[0] / 2.0 + 0.5, _GAUSS[1] / 2.0, strict=True):
        x, y = chains.points(every, np.full(len(every), node)).T
        part = weight * chains.length_mm
        sums.append([chains.sums(part * value) for value in (x, y, x * x, y * y, x * y)])
    x, y, xx, yy, xy = np.sum(sums, axis=0)[:, some] / total[some]
    xx, yy, xy = xx - x * x, yy - y * y, xy - x * y
    size = np.sqrt(np.maximum(xx + yy, 0.0))
    row = chains.row[chains.first[some]]
    near = ground.moves.near_mm
    # second moments in mm, so that one distance holds for all
    scale = np.maximum(size, near)
    moments = (x, y, size, xx / scale, xy / scale, total[some])
    whole = (ground.moves.operation[row], ground.moves.turn_of(row), chains.closed[some].astype(np.int64))
    return alike((*whole, *moments), (0, 0, 0, *[near] * 5, 10.0 * near))
