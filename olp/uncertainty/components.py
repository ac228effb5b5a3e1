"""Which components of a calibration are known well enough that correcting them most probably helps.

A component is corrected by its calibrated values v, and its true ones are v + d with d unknown. Correction
reduces the mean square of its error by mean(v^2 + 2 v d): a normal variable, so the probability of a gain is
known. The expected gain is always positive; leaving a component out gives up a small expected gain and
avoids a possible loss.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from olp.core.arrays import Array
from olp.core.values import dataclass
from olp.errormodel.calibration import Calibration
from olp.errormodel.entry import Entry
from olp.errormodel.sensitivity import value_rows
from olp.errormodel.uncertainty import Uncertainty
from olp.uncertainty.probability import normal
from olp.uncertainty.spread import PROBABLE_GAIN


@dataclass(frozen=True, slots=True)
class Component:
    """A component error or squareness: root mean squares over the curve of its `value` and of its standard
    uncertainty `sigma` (mm or rad), and the probability that correcting it helps."""

    name: str
    value: float
    sigma: float
    helps: float

    @property
    def probable(self) -> bool:
        return self.helps >= PROBABLE_GAIN


def components(calibration: Calibration, uncertainty: Uncertainty) -> list[Component]:
    """All components that the calibration corrects and whose uncertainty is known, the most certain last."""
    result: list[Component] = []
    for curve in calibration.curves:
        weight = np.gradient(curve.position_mm)
        for name in curve.names:
            parts = [(uncertainty.find("mean", name), curve.mean(name))]
            half = curve.half_difference(name)
            if half is not None:
                parts.append((uncertainty.find("half", name), half))
            result += _component(name, [(e, curve.position_mm, v, weight) for e, v in parts], calibration)
    for name, value in calibration.squareness.items():
        entry = uncertainty.find("squareness", name)
        result += _component(name, [(entry, np.zeros(1), np.array([value]), np.ones(1))], calibration)
    return sorted(result, key=lambda component: component.helps)


def improbable(calibration: Calibration, uncertainty: Uncertainty) -> frozenset[str]:
    """Components whose correction helps with less than PROBABLE_GAIN."""
    return frozenset(c.name for c in components(calibration, uncertainty) if not c.probable)


def _component(
    name: str, parts: list[tuple[Entry | None, Array, Array, Array]], calibration: Calibration
) -> Iterator[Component]:
    mean = variance = 0.0
    common: Array = np.zeros(0)
    own = 0.0
    known = False
    terms = [term for term in calibration.cyclic if term.component == name]
    for entry, q, value, weight in parts:
        share = weight / weight.sum()
        mean += float(share @ value**2)
        if entry is None:
            continue
        known = True
        rows = value_rows(entry, q)
        rank = entry.factor.shape[1]
        variance += float(share @ (rows**2).sum(axis=1))
        along = (share * value) @ rows
        common = along[:rank] + (common if len(common) else 0.0)
        own += float(along[rank:] @ along[rank:])
    # a cyclic term is corrected with its component
    mean += sum(0.5 * term.amplitude**2 for term in terms)
    spread = 2.0 * float(np.sqrt(common @ common + own))
    if known and mean > 0.0:
        helps = 1.0 if spread == 0.0 else float(normal(mean / spread))
        yield Component(name, float(np.sqrt(mean)), float(np.sqrt(variance)), helps)
