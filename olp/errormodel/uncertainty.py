"""How well the numbers of a calibration are known: their covariance, as a factor of few columns.

The numbers are the values of component errors at positions, half differences of directions, the sine and the
cosine part of cyclic terms, squareness and lost motion. Their covariance is factor @ factor.T, and beside it
the variance `rest`, of which only so much is known that it is independent between components, and between
places of a curve that are farther apart than one of its `CELLS`. Terms: JCGM 100 (GUM).
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.machine import COMPONENTS, SQUARENESS, ZERO, Vector
from olp.core.units import AXES
from olp.errormodel.calibration import Calibration

Kind = Literal["mean", "half", "wave", "squareness", "backlash"]
KINDS: tuple[Kind, ...] = ("mean", "half", "wave", "squareness", "backlash")
#: A curve of which only standard uncertainties are known is independent from one of so many equal parts of it
#: to the next: the cautious side, as then nothing of it cancels in a touch-off elsewhere.
CELLS = 16
#: What a report says of uncertainties from sigma columns.
SIGMA_COLUMNS = (
    "sigma columns: components are taken as independent of each other, and each curve as independent "
    f"from one {CELLS}th of it to the next, so nothing of it cancels in a touch-off elsewhere"
)
#: Steel (and most glass scales are near it), for expansion that nobody has stated, per K.
EXPANSION_PER_K = 11.5e-6
#: Days of a year.
YEAR = 365.25


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


@dataclass(frozen=True, slots=True, eq=False)
class Uncertainty:
    """The covariance of a calibration, and what else is stated of how well the machine is known.

    `fingerprint` says of which calibration, `source` in words where it comes from, `dropped` what share of a
    variance the factor leaves to `rest` at the most. `repeatability_mm` is the standard deviation of the
    axes' own scatter, `growth_per_year` the share by which standard uncertainties grow in a year, and
    `temperature_K` the standard uncertainty of the temperatures of scales and workpiece.
    """

    entries: tuple[Entry, ...]
    fingerprint: str
    source: str
    dropped: float = 0.0
    repeatability_mm: Vector = ZERO
    growth_per_year: float = 0.0
    temperature_K: float = 0.0

    def __post_init__(self) -> None:
        seen: set[tuple[str, str, float]] = set()
        for entry in self.entries:
            key = (entry.kind, entry.name, entry.period_mm)
            if key in seen:
                raise ConfigError(f"covariance of {entry.kind} {entry.name} is there twice; expected once")
            if entry.factor.shape[1] != self.rank:
                raise ConfigError(f"covariance of {entry.kind} {entry.name}: its factor has another width")
            seen.add(key)

    @property
    def rank(self) -> int:
        return int(self.entries[0].factor.shape[1]) if self.entries else 0

    def find(self, kind: Kind, name: str) -> Entry | None:
        return next((e for e in self.entries if e.kind == kind and e.name == name), None)

    def scaled(self, by: float) -> Uncertainty:
        """Standard uncertainties of all numbers times `by`."""
        return replace(self, entries=tuple(entry.scaled(by) for entry in self.entries))

    def growth(self, days: float | None) -> float:
        """The factor on standard uncertainties so many days after measuring."""
        return 1.0 if days is None else 1.0 + self.growth_per_year * max(days, 0.0) / YEAR


def fingerprint(calibration: Calibration) -> str:
    """SHA-256 of the numbers of a calibration, to nine digits: comments, names of files and the last bits do
    not count."""
    digest = hashlib.sha256()
    for line in _lines(calibration):
        digest.update(line.encode() + b"\n")
    return digest.hexdigest()


def _lines(calibration: Calibration) -> Iterator[str]:
    def text(values: object) -> str:
        return " ".join(f"{value + 0.0:.9e}" for value in np.atleast_1d(np.asarray(values, float)).tolist())

    yield f"{calibration.machine} {calibration.model} {calibration.measured}"
    yield f"{text(calibration.datum_mm)} {text(calibration.box_mm.ravel())}"
    for curve in calibration.curves:
        line = calibration.datum_mm if curve.line_mm is None else curve.line_mm
        others = [at for at, axis in zip(line, AXES, strict=True) if axis != curve.axis]
        yield f"{curve.axis} {curve.reference} {curve.interpolation} {text(others)} {text(curve.tool_mm)}"
        yield text(curve.position_mm)
        for part in (curve.columns, curve.forward, curve.backward):
            for name in sorted(part):
                yield f"{name} {text(part[name])}"
    yield " ".join(f"{name} {text(calibration.squareness.get(name, 0.0))}" for name in SQUARENESS)
    yield text(calibration.backlash_mm)
    for term in calibration.cyclic:
        yield f"{term.component} {text([term.period_mm, term.amplitude, term.phase_rad])}"


def of_sigmas(
    calibration: Calibration,
    curves: Mapping[str, Array],
    squareness: Mapping[str, float] | None = None,
    backlash_mm: Mapping[str, float] | None = None,
) -> Uncertainty | None:
    """From standard uncertainties alone: of components by name at the positions of their curve, of squareness
    and of lost motion. None where there are none."""
    entries = []
    for curve in calibration.curves:
        for name in curve.names:
            if name in curves:
                n = len(curve.position_mm)
                sigma = np.asarray(curves[name], float)
                entries.append(Entry("mean", name, np.zeros((n, 0)), sigma, curve.position_mm))
    none = np.zeros((1, 0))
    entries += [Entry("squareness", k, none, np.array([v])) for k, v in (squareness or {}).items()]
    entries += [Entry("backlash", k, none, np.array([v])) for k, v in (backlash_mm or {}).items()]
    if not entries:
        return None
    return Uncertainty(tuple(entries), fingerprint(calibration), SIGMA_COLUMNS)
