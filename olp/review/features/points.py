"""Measuring points of a probe, those without another move between them being one set."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import ClassVar

import numpy as np

from olp.review.features.base import Deviations, Feature, FeatureKind, Figure
from olp.review.features.figures import counted
from olp.review.features.ground import Ground
from olp.review.features.moves import Does


class Points(FeatureKind):
    """Sets of measuring points."""

    name = "points"
    label = "measuring points"
    figures: ClassVar[Mapping[str, Figure]] = {
        "position": Figure("position", "largest distance of the tip from a nominal point")
    }

    def find(self, ground: Ground) -> Iterable[Feature]:
        probe = ground.moves.does == Does.PROBE
        edges = np.flatnonzero(np.diff(probe.astype(np.int8), prepend=0, append=0))
        operation = ground.moves.operation
        for a, b in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
            rows = np.arange(a, b)
            for own in np.split(rows, np.flatnonzero(np.diff(operation[rows])) + 1):
                detail = counted(len(own), "point")
                yield Feature(self.name, own, None, self.label, detail, ground.centre(own))

    def measure(self, feature: Feature, deviations: Deviations) -> Mapping[str, float | None]:
        return {"position": float(np.sqrt((deviations.delta_mm**2).sum(axis=1)).max())}
