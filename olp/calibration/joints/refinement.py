"""A calibration of any joints refined by new readings: it changes within its covariance, and that shrinks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from olp.calibration.joints.adjustment import JointFit, adjusted
from olp.calibration.joints.findings import fit_or_refuse
from olp.calibration.joints.readings import Reading, Start
from olp.calibration.joints.unknowns import Model
from olp.core.arrays import Array
from olp.core.errors import CannotCompute
from olp.core.values import dataclass

#: Years ahead that are looked at most.
MOST_YEARS = 100.0


@dataclass(frozen=True, slots=True, eq=False)
class Refined:
    """A refinement. `fit` holds the changes of the unknowns and their covariance after it. `before` is what
    readings show with the calibration as it was, with frames and centres of instruments found. `agreement` is
    the reduced chi-square of the readings and the changes together: about 1 where the covariance was right.
    """

    fit: JointFit
    before: JointFit
    agreement: float

    @property
    def deviations(self) -> Array:
        """(k,) changes by the standard deviations before."""
        assert self.fit.model.known is not None
        return np.asarray(self.fit.theta / np.sqrt(np.diag(self.fit.model.known)))


def refine_joints(model: Model, readings: Sequence[Reading]) -> Refined:
    """Change a calibration, the base of a model with a known covariance, by new readings. The covariance
    after it is larger by what the readings contradict the old one. Raises ConfigError, also where they are
    not those of this machine, with the one mistake that explains it, and CannotCompute."""
    fit = fit_or_refuse(model, readings)
    starts = [source.start for source in fit.sources]
    before = adjusted(replace(model, unknowns=(), known=None), starts)
    spare = spare_of(starts)
    agreement = (fit.chi_square + float(fit.theta @ model.precision @ fit.theta)) / spare
    scatter = max(1.0, agreement) / max(1.0, fit.chi_square / fit.freedom)
    return Refined(replace(fit, covariance=fit.covariance * scatter), before, agreement)


def spare_of(starts: Sequence[Start]) -> int:
    """How many numbers were read beyond those that the instruments need for themselves. Raises CannotCompute
    where none."""
    count = sum(start.measured.size for start in starts)
    own = sum(int(np.sum(np.isinf(start.prior))) for start in starts)
    if count <= own:
        raise CannotCompute(
            f"{count} numbers were read, and the instruments have {own} unknowns of their own; read more"
        )
    return count - own


def years_until(tip_mm: float, wanted_mm: float, growth_per_year: float) -> float | None:
    """Years until what is not known of the tip has grown above what is wanted, None for never."""
    if tip_mm >= wanted_mm:
        return 0.0
    if growth_per_year == 0.0:
        return None
    return min((wanted_mm / tip_mm - 1.0) / growth_per_year, MOST_YEARS)
