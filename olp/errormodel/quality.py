"""How well the adjustment that made a calibration fits its readings."""

from __future__ import annotations

import math

from olp.core.values import dataclass

#: Standard deviations of noise above which a misfit is real: about 3 in 10 million by chance.
_BEYOND = 5.0
#: Reduced chi-square above which a misfit is gross: residuals of twice the stated noise. Below it the
#: covariance of the calibration, which grows by this factor, still holds.
_GROSS = 4.0
#: Degrees of freedom below which chi-square says nothing.
_LEAST_FREEDOM = 1.0


@dataclass(frozen=True, slots=True)
class Fitted:
    """The sum of squares of standardised residuals of a source, with its degrees of freedom: the readings
    less what the unknowns used up."""

    source: str
    chi_square: float
    freedom: float

    @property
    def reduced(self) -> float:
        return self.chi_square / max(self.freedom, _LEAST_FREEDOM)

    @property
    def deviations(self) -> float:
        """By how many standard deviations chi-square is above what noise gives: by its cube root, which is
        nearly normal (E. B. Wilson and M. M. Hilferty, 1931)."""
        part = 2.0 / (9.0 * max(self.freedom, _LEAST_FREEDOM))
        return float((self.reduced ** (1.0 / 3.0) - (1.0 - part)) / math.sqrt(part))

    @property
    def failed(self) -> bool:
        """Whether chance does not explain the misfit, and the stated noise is wrong by more than twice."""
        return self.deviations > _BEYOND and self.reduced > _GROSS


@dataclass(frozen=True, slots=True)
class Quality:
    """`total` of an adjustment, and its sources: files of readings, or instruments without a file."""

    total: Fitted
    sources: tuple[Fitted, ...] = ()

    def failed(self) -> tuple[Fitted, ...]:
        """What does not fit, the worst first."""
        all_of_it = sorted((self.total, *self.sources), key=lambda fitted: -fitted.reduced)
        return tuple(fitted for fitted in all_of_it if fitted.failed)
