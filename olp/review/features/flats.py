"""Flat areas: many feed moves of one level, side by side."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import ClassVar

import numpy as np

from olp.core.arrays import Array
from olp.review.features.alike import members
from olp.review.features.base import Deviations, Feature, FeatureKind, Figure
from olp.review.features.figures import counted, number, spread
from olp.review.features.fits import plane_residuals
from olp.review.features.ground import Ground

#: Fewest points of a plane.
_POINTS = 4


class Flat(FeatureKind):
    """Flat areas."""

    name = "flat"
    label = "flat area"
    figures: ClassVar[Mapping[str, Figure]] = {
        "position": Figure(
            "position", "mean of the deviations along the tool axis; plus is out of the material"
        ),
        "form": Figure(
            "flatness",
            "range of the deviations along the tool axis about the least-squares plane (ISO 12781-1, LSPL)",
        ),
    }
    container = True

    def find(self, ground: Ground) -> Iterable[Feature]:
        chains, area = ground.chains, ground.areas.area
        inside = np.flatnonzero(area >= 0)
        for some in members(area[inside]):
            own = inside[some]
            rows = chains.row[own]
            turn = ground.moves.turn(int(rows[0]))
            low, high = chains.box(own)
            size = high - low
            path = f"path {number(float(size[0]))} x {number(float(size[1]))} mm"
            level = ground.moves.level(int(rows[0]), turn[:, 2])
            detail = ", ".join(part for part in (level, path, counted(len(rows), "move")) if part)
            centre = turn @ ((low + high) / 2.0)
            yield Feature(self.name, rows, turn, self.label, detail, tuple(centre.tolist()))

    def measure(self, feature: Feature, deviations: Deviations) -> Mapping[str, float | None]:
        turn: Array = feature.shape
        away = deviations.delta_mm @ turn[:, 2]
        position = deviations.mean(away)
        if len(deviations) < _POINTS:
            return {"position": position, "form": None}
        first, second = deviations.nominal_mm @ turn[:, 0], deviations.nominal_mm @ turn[:, 1]
        return {
            "position": position,
            "form": spread(plane_residuals(first, second, away, deviations.weight)),
        }
