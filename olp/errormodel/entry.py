"""Numbers of a calibration with their uncertainty: rows of one covariance. Terms: JCGM 100 (GUM)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.machine import COMPONENTS, SQUARENESS
from olp.core.units import AXES

Kind = Literal["mean", "half", "wave", "squareness", "backlash"]
KINDS: tuple[Kind, ...] = ("mean", "half", "wave", "squareness", "backlash")
#: A curve of which only standard uncertainties are known is independent from one of so many equal parts of it
#: to the next: the cautious side, as then nothing of it cancels in a touch-off elsewhere.
CELLS = 16


@dataclass(frozen=True, slots=True, eq=False)
class Entry:
    """Numbers of one kind: of component `name` at `position_mm` (n,) for "mean" and "half"; (sine, cosine) of
    `period_mm` for "wave"; one number of a squareness, or of the lost motion of an axis.

    `factor` (n, rank) and `rest` (n,), a standard uncertainty, in mm or rad. Raises ConfigError.
    """

    kind: Kind
    name: str
    factor: Array
    rest: Array
    position_mm: Array = field(default_factory=lambda: np.zeros(0))
    period_mm: float = 0.0

    def __post_init__(self) -> None:
        curve = self.kind in ("mean", "half")
        names = {"squareness": SQUARENESS, "backlash": tuple(AXES)}.get(self.kind, COMPONENTS)
        count = len(self.position_mm) if curve else 2 if self.kind == "wave" else 1
        x = self.position_mm
        good = self.kind in KINDS and self.name in names and self.factor.ndim == 2
        good = good and self.factor.shape[0] == count and self.rest.shape == (count,)
        good = good and bool(np.isfinite(self.factor).all() and np.isfinite(self.rest).all())
        good = good and bool((self.rest >= 0.0).all()) and (self.kind != "wave" or self.period_mm > 0.0)
        if not good or (curve and (count < 2 or not np.isfinite(x).all() or np.any(np.diff(x) <= 0.0))):
            raise ConfigError(
                f"covariance of {self.kind} {self.name}: expected finite numbers at ascending positions"
            )

    @property
    def sigma(self) -> Array:
        """(n,) standard uncertainties, mm or rad."""
        return np.asarray(np.sqrt((np.asarray(self.factor, float) ** 2).sum(axis=1) + self.rest**2))

    @property
    def cells(self) -> int:
        """Into how many independent parts the rest falls."""
        return min(CELLS, max(len(self.position_mm) - 1, 0))

    def scaled(self, by: float) -> Entry:
        return replace(self, factor=self.factor * by, rest=self.rest * by)


def alone(kind: Kind, name: str, sigma: Array | float, position_mm: Array | None = None) -> Entry:
    """Numbers of which nothing but their standard uncertainty (n,) or one, in mm or rad, is known."""
    rest = np.atleast_1d(np.asarray(sigma, float))
    at = np.zeros(0) if position_mm is None else position_mm
    return Entry(kind, name, np.zeros((len(rest), 0)), rest, at)
