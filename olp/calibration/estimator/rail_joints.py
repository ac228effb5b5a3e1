"""Joints of rails: steps of curves that no line reads, each as wide as readings leave its place open."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from olp.calibration.estimator.basis import Step
from olp.calibration.estimator.between import Hidden
from olp.calibration.estimator.character import USUAL, class_of
from olp.core.values import dataclass

#: Standard deviation of a step of positioning, mm.
STEP = 0.01
#: Positions on a ramp where what it hides is taken.
_ON_RAMP = 9


@dataclass(frozen=True, slots=True)
class Joint:
    """A step of a curve, as a ramp over where it may be, and how high it seems to be, mm or rad."""

    step: Step
    jump: float

    def beside(self, one: Hidden) -> Hidden:
        """What a curve hides, and what it hides where the joint may be besides. The joint lies before q with
        probability u, so that variance is jump^2 u (1 - u)."""
        q = np.union1d(one.position_mm, np.linspace(self.step.low_mm, self.step.high_mm, _ON_RAMP))
        u = self.step.values(q)
        return Hidden(q, one.at(q) + self.jump**2 * u * (1.0 - u))


#: Joints by component.
Joints = Mapping[str, tuple[Joint, ...]]


def size_of(name: str) -> float:
    """The standard deviation of a step of a component that has one, mm or rad."""
    return STEP * USUAL[class_of(name)]
