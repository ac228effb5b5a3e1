"""Straight walls: collinear feed lines of a level, the same line at several levels being one wall."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import ClassVar

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.values import dataclass
from olp.review.features.alike import alike, joined, members
from olp.review.features.base import Deviations, Feature, FeatureKind, Figure
from olp.review.features.chains import Chains
from olp.review.features.figures import counted, number, spread
from olp.review.features.fits import line_residuals
from olp.review.features.ground import Ground

#: Lines of one wall differ by less than this in direction, in rad.
_PARALLEL = 2e-4
#: Lines that meet at a smaller angle, in rad, may be chords of a curve, ...
_SMOOTH = np.radians(30.0)
#: ... so many of them in a row ...
_CHORDS = 4
#: ... of which none is this many times as long as those beside it.
_LONG = 5.0
#: Digits by which the direction of a line between rounded points may be off, over its length.
_DIGITS = 1.5
#: A direction along an axis, in rad: no second digit of a degree tells it apart.
_ALIGNED = np.radians(0.005)
#: A wall is at least so many times as long as equal positions may be apart: else its direction is not known.
_LEAST = 50.0
#: Directions are counted from this angle in rad, which no drawing has.
_FROM = -0.3217


@dataclass(frozen=True, slots=True, eq=False)
class _Lines:
    """The k lines of chains, collinear ones joined: (k,) `first` and `last` of the moves of the chains,
    (k, 2) `start` and `end`, (k, 2) `along`, unit, and (k,) `length_mm`."""

    first: Index
    last: Index
    start: Array
    end: Array
    along: Array
    length_mm: Array

    @staticmethod
    def between(chains: Chains, first: Index, last: Index) -> _Lines:
        start, end = chains.start[first, :2], chains.end[last, :2]
        step = end - start
        length = np.hypot(step[:, 0], step[:, 1])
        return _Lines(first, last, start, end, step / np.maximum(length, 1e-12)[:, None], length)

    def take(self, which: Mask) -> _Lines:
        return _Lines(
            self.first[which], self.last[which], self.start[which], self.end[which], self.along[which],
            self.length_mm[which],
        )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class _Shape:
    """A point of the wall, and unit vectors along and normal to it (3,), in the frame shown."""

    middle: Array
    along: Array
    normal: Array


class Wall(FeatureKind):
    """Straight walls."""

    name = "wall"
    label = "wall"
    figures: ClassVar[Mapping[str, Figure]] = {
        "position": Figure(
            "position", "mean of the deviations along the normal of the wall; plus is in the direction named"
        ),
        "form": Figure(
            "straightness",
            "range of the deviations along the normal about the least-squares line (ISO 12780-1, LSLI)",
        ),
        "angle": Figure(
            "slope", "how much the deviation along the normal changes from end to end, of the same line"
        ),
    }

    def find(self, ground: Ground) -> Iterable[Feature]:
        chains = ground.chains
        usable = ground.outer & ~ground.chords & chains.straight & ~ground.touches[chains.chain]
        lines = _lines(ground, usable)
        if not len(lines.first):
            return
        row = chains.row[lines.first]
        direction = np.mod(np.arctan2(lines.along[:, 1], lines.along[:, 0]) - _FROM, np.pi) + _FROM
        parallel = alike(
            (ground.moves.operation[row], ground.moves.turn_of(row), direction), (0, 0, _PARALLEL)
        )
        mean = np.bincount(parallel, direction * lines.length_mm) / np.bincount(parallel, lines.length_mm)
        along = np.stack((np.cos(mean), np.sin(mean)), axis=1)[parallel]
        normal = np.stack((-along[:, 1], along[:, 0]), axis=1)
        offset = ((lines.start + lines.end) / 2.0 * normal).sum(axis=1)
        line = alike((parallel, offset), (0, ground.moves.near_mm))
        ends = np.stack([(side * along).sum(axis=1) for side in (lines.start, lines.end)])
        low, high = ends.min(axis=0), ends.max(axis=0)
        for group in members(joined(low, high, line, ground.moves.near_mm)):
            yield self._feature(ground, lines, group, along[group[0]])

    def _feature(self, ground: Ground, lines: _Lines, group: Index, along: Array) -> Feature:
        chains = ground.chains
        own = np.concatenate([np.arange(lines.first[k], lines.last[k] + 1) for k in group.tolist()])
        rows = chains.row[own]
        turn = ground.moves.turn(int(rows[0]))
        normal = np.array((-along[1], along[0]))
        normal *= np.sign(normal[np.argmax(np.abs(normal))])
        points = np.concatenate((chains.start[own], chains.end[own]))
        across = (points[:, :2] @ normal).mean()
        ends = points[:, :2] @ along
        heights = points[:, 2]
        flat = along * (ends.min() + ends.max()) / 2.0 + normal * across
        centre = turn @ np.array((*flat, (heights.min() + heights.max()) / 2.0))
        levels = len(np.unique(alike((heights,), (ground.moves.near_mm,))))
        detail = [f"{number(float(np.ptp(ends)))} mm along {_direction(along)}"]
        detail.append(f"normal {_direction(normal, sign=True)}")
        detail.append(counted(levels, "level"))
        shape = _Shape(centre, turn[:, :2] @ along, turn[:, :2] @ normal)
        return Feature(self.name, np.sort(rows), shape, self.label, ", ".join(detail), tuple(centre.tolist()))

    def measure(self, feature: Feature, deviations: Deviations) -> Mapping[str, float | None]:
        shape: _Shape = feature.shape
        away = deviations.delta_mm @ shape.normal
        along = (deviations.nominal_mm - shape.middle) @ shape.along
        result: dict[str, float | None] = {"position": deviations.mean(away), "form": None, "angle": None}
        if len(np.unique(np.round(along, 6))) > 2:
            residuals = line_residuals(along, away, deviations.weight)
            fitted = away - residuals
            first, last = int(along.argmin()), int(along.argmax())
            result |= {"form": spread(residuals), "angle": float(fitted[last] - fitted[first])}
        return result


def _direction(vector: Array, *, sign: bool = False) -> str:
    """A direction across the tool axis in words."""
    for axis, name in enumerate("XY"):
        if np.abs(vector[1 - axis]) < _ALIGNED:
            return f"{'+' if vector[axis] > 0.0 else '-'}{name}" if sign else name
    return f"{np.degrees(np.arctan2(vector[1], vector[0])):.2f}°"


def _lines(ground: Ground, usable: Mask) -> _Lines:
    """The straight lines of chains, collinear moves joined, without the chords of curves."""
    chains, near_mm, digit_mm = ground.chains, ground.moves.near_mm, ground.moves.digit_mm
    every = np.arange(len(chains.row))
    single = _Lines.between(chains, every, every)
    joint = chains.linked()[:-1] & usable[:-1] & usable[1:]
    cross, dot = _turns(single)
    noise = _DIGITS * digit_mm / np.maximum(single.length_mm, 1e-9)
    joint &= (dot > 0.0) & (np.abs(cross) <= noise[:-1] + noise[1:])
    new = np.concatenate(([True], ~joint))
    first = np.flatnonzero(new)
    last = np.append(first[1:], len(every)) - 1
    if not len(every):
        return single
    lines = _Lines.between(chains, first, last)
    # a bent run of short moves is no line: a vertex of it is off
    owner = np.cumsum(new) - 1
    away = chains.end[:, :2] - lines.start[owner]
    off = np.abs(away[:, 0] * lines.along[owner, 1] - away[:, 1] * lines.along[owner, 0])
    farthest = np.zeros(len(first))
    np.maximum.at(farthest, owner, off)
    good = usable[first] & (farthest <= near_mm) & (lines.length_mm >= _LEAST * near_mm)
    return lines.take(good & ~_curves(ground, lines))


def _turns(lines: _Lines) -> tuple[Array, Array]:
    """(k - 1,) sine and cosine of the angle between each line and the next."""
    a, b = lines.along[:-1], lines.along[1:]
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1)


def _curves(ground: Ground, lines: _Lines) -> Mask:
    """(k,) lines that are chords of a curve; other chords of it may be those of a circle, or short arcs."""
    chains = ground.chains
    pieces = chains.straight | ~np.isin(chains.row, ground.circular.row)
    cross, dot = _turns(lines)
    straight = pieces[lines.first]
    same = (chains.chain[lines.last[:-1]] == chains.chain[lines.first[1:]]) & straight[:-1] & straight[1:]
    smooth = same & (np.arctan2(np.abs(cross), dot) <= _SMOOTH)
    run = np.cumsum(np.concatenate(([True], ~smooth))) - 1
    many = np.bincount(run)[run] >= _CHORDS
    beside = np.zeros(len(lines.first))
    beside[:-1] = np.where(smooth, lines.length_mm[1:], 0.0)
    beside[1:] = np.maximum(beside[1:], np.where(smooth, lines.length_mm[:-1], 0.0))
    return np.asarray(many & (lines.length_mm < _LONG * beside))
