"""Holes of canned cycles, and strokes along the tool axis at one place: drilled holes, or touches of a probe.

A stroke is programmed without a cycle: feed moves along the tool axis and back out of it before the next
move across. Pecks at one place are one stroke. A plunge that cuts on at its level, a ramp and a helix are
none. Feed moves from a rapid along one line and back are a stroke, too, as a probe touches a wall. The
program does not say whether a stroke drills, so that it is called a stroke.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import ClassVar

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.geometry import PLANES
from olp.core.values import dataclass
from olp.review.features.base import Deviations, Feature, FeatureKind, Figure
from olp.review.features.figures import number
from olp.review.features.ground import Ground
from olp.review.features.moves import SAME_MM, Does

#: A point this near the bottom is at the bottom, in mm.
_BOTTOM_MM = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class _Shape:
    """The bottom of the nominal axis and its direction out of the material, unit (3,), in the frame shown."""

    bottom: Array
    out: Array


class Hole(FeatureKind):
    """Holes and strokes."""

    name = "hole"
    label = "hole"
    figures: ClassVar[Mapping[str, Figure]] = {
        "position": Figure(
            "position",
            "largest distance of the tip from the nominal axis of the hole, along the strokes: half the "
            "diameter of the position zone (ISO 1101)",
        ),
        "depth": Figure("depth", "deviation along the axis at the bottom; plus is out of the material"),
    }

    def find(self, ground: Ground) -> Iterable[Feature]:
        yield from self._of_cycles(ground)
        yield from self._of_strokes(ground)
        yield from self._across(ground)

    def _of_cycles(self, ground: Ground) -> Iterator[Feature]:
        path = ground.moves.path
        for hole in ground.scene.nominal.holes:
            rows = ground.moves.feeds(np.arange(hole.first, hole.last))
            if not rows.size:
                continue
            axis = PLANES[hole.plane][2]
            bottom = int(rows[np.abs(path.end_mm[rows, axis] - hole.z_mm).argmin()])
            out = np.zeros(3)
            out[axis] = 1.0 if hole.r_mm >= hole.z_mm else -1.0
            depth = abs(hole.r_mm - hole.z_mm)
            yield self._feature(ground, rows, bottom, out, depth, self.label)

    def _of_strokes(self, ground: Ground) -> Iterator[Feature]:
        moves = ground.moves
        in_cycle = ground.scene.nominal.holes.inside(len(moves.path))
        down = (moves.does == Does.ALONG_TOOL) & ~in_cycle
        stays = moves.staying & ~in_cycle
        edges = np.flatnonzero(np.diff(stays.astype(np.int8), prepend=0, append=0))
        feeds = np.cumsum(down)
        for a, b in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
            # in and out again are two moves at least
            if b - a > 1 and feeds[b - 1] > (feeds[a - 1] if a else 0):
                stay = np.arange(a, b)
                # a change of the tool at one place ends a stroke
                for own in np.split(stay, np.flatnonzero(np.diff(moves.operation[stay])) + 1):
                    yield from self._stroke(ground, own)

    def _stroke(self, ground: Ground, stay: Index) -> Iterator[Feature]:
        """The hole of a stay at one place, where it is one: it comes out as far as its first feed began."""
        start, end = ground.moves.ends(stay)
        feed = (ground.moves.does[stay] == Does.ALONG_TOOL) & (end[:, 2] < start[:, 2])
        if not feed.any():
            return
        first = int(feed.argmax())
        lowest = int(end[:, 2].argmin())
        top = float(start[first, 2])
        if not feed[lowest] or end[lowest:, 2].max() < top - SAME_MM:
            return
        rows = ground.moves.feeds(stay[first:])
        rows = rows[ground.moves.does[rows] == Does.ALONG_TOOL]
        out = ground.moves.turn(int(stay[0]))[:, 2]
        bottom, depth = int(stay[lowest]), top - float(end[lowest, 2])
        yield self._feature(ground, rows, bottom, out, depth, "stroke")

    def _across(self, ground: Ground) -> Iterator[Feature]:
        """Strokes across the tool axis, as a probe touches a wall."""
        chains = ground.chains
        for chain in np.flatnonzero(ground.touches).tolist():
            own = np.arange(chains.first[chain], chains.first[chain + 1])
            away = chains.end[own] - chains.start[own[0]]
            size = np.sqrt((away**2).sum(axis=1))
            bottom = int(size.argmax())
            depth = float(size[bottom])
            out = ground.moves.turn(int(chains.row[own[0]])) @ (-away[bottom] / depth)
            yield self._feature(ground, chains.row[own], int(chains.row[own[bottom]]), out, depth, "stroke")

    def _feature(
        self, ground: Ground, rows: Index, bottom: int, out: Array, depth_mm: float, how: str
    ) -> Feature:
        moves = ground.moves
        place = moves.shown(np.array([bottom]), moves.path.end_mm[[bottom]])[0]
        tool = int(ground.scene.table.tool[bottom])
        radius = ground.scene.tool_radii_mm.get(tool, 0.0)
        level = moves.level(bottom, out)
        size = f"tool Ø {number(2.0 * radius)} mm, " if radius else ""
        detail = f"{size}{f'to {level}, ' if level else ''}stroke of {number(depth_mm)} mm"
        shape = _Shape(place, out)
        middle = tuple((place + 0.5 * depth_mm * out).tolist())
        return Feature(self.name, rows, shape, how, detail, middle, alike=f"{how}, {detail}")

    def measure(self, feature: Feature, deviations: Deviations) -> Mapping[str, float | None]:
        shape: _Shape = feature.shape
        along = deviations.delta_mm @ shape.out
        across = deviations.delta_mm - along[:, None] * shape.out
        position = float(np.sqrt((across**2).sum(axis=1)).max())
        height = (deviations.nominal_mm - shape.bottom) @ shape.out
        deep = np.flatnonzero(height <= _BOTTOM_MM)
        depth = float(along[deep[np.abs(along[deep]).argmax()]]) if deep.size else None
        return {"position": position, "depth": depth}
