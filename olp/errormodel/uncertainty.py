"""The uncertainty of the numbers of a calibration: their covariance, as a factor of few columns.

The numbers are the values of component errors at positions, half differences of directions, the sine and the
cosine part of cyclic terms, squareness and backlash. Their covariance is factor @ factor.T plus the variance
`rest`. That is independent between components, and between positions of a curve that are farther apart than
one of its `CELLS`; nothing more is known of it. Terms: JCGM 100 (GUM).
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import replace

from olp.core.errors import ConfigError
from olp.core.machine import ZERO, Vector
from olp.core.values import dataclass
from olp.errormodel.calibration import Calibration
from olp.errormodel.entry import Entry
from olp.errormodel.sources.base import Sigmas, digits
from olp.errormodel.sources.curves import CELLS
from olp.errormodel.sources.registry import NUMBERS

#: What a report says of uncertainties from sigma columns.
SIGMA_COLUMNS = (
    f"sigma columns: components are taken as independent of each other, and so are the {CELLS} parts of a "
    "curve; a touch-off in another part cancels nothing"
)
#: 1/K; steel, and most glass scales are near it. For expansion that is not stated.
EXPANSION_PER_K = 11.5e-6
#: Days of a year.
YEAR = 365.25


@dataclass(frozen=True, slots=True, eq=False)
class Uncertainty:
    """The covariance of a calibration, and other stated uncertainties of the machine.

    `fingerprint` identifies the calibration, and `source` says in words where the covariance comes from.
    `dropped` is the largest share of a variance that the factor leaves to `rest`. `repeatability_mm` is the
    standard deviation of the random part of the axes. `growth_per_year` is the share by which standard
    uncertainties grow in a year, and `temperature_K` the standard uncertainty of the temperatures of scales
    and workpiece.
    """

    entries: tuple[Entry, ...]
    fingerprint: str
    source: str
    dropped: float = 0.0
    repeatability_mm: Vector = ZERO
    growth_per_year: float = 0.0
    temperature_K: float = 0.0

    def __post_init__(self) -> None:
        for entry in self.entries:
            if entry.kind not in NUMBERS or not NUMBERS[entry.kind].fits(entry):
                raise ConfigError(
                    f"covariance of {entry.kind} {entry.name}: expected finite numbers at ascending positions"
                )
        seen: set[tuple[str, str, float]] = set()
        for entry in self.entries:
            key = (entry.kind, entry.name, entry.period_mm)
            if key in seen:
                raise ConfigError(f"covariance of {entry.kind} {entry.name} is defined twice; expected once")
            if entry.factor.shape[1] != self.rank:
                raise ConfigError(
                    f"covariance of {entry.kind} {entry.name}: its factor has {entry.factor.shape[1]} "
                    f"columns; expected {self.rank}, as in the other entries"
                )
            seen.add(key)

    @property
    def rank(self) -> int:
        return int(self.entries[0].factor.shape[1]) if self.entries else 0

    def find(self, kind: str, name: str) -> Entry | None:
        return next((e for e in self.entries if e.kind == kind and e.name == name), None)

    def scaled(self, by: float) -> Uncertainty:
        """Standard uncertainties of all numbers times `by`."""
        return replace(self, entries=tuple(entry.scaled(by) for entry in self.entries))

    def growth(self, days: float | None) -> float:
        """The factor on standard uncertainties so many days after measuring."""
        return 1.0 if days is None else 1.0 + self.growth_per_year * max(days, 0.0) / YEAR

    def aged(self, days: float | None) -> Uncertainty:
        """So many days after measuring."""
        return self.scaled(self.growth(days))


def fingerprint(calibration: Calibration) -> str:
    """SHA-256 of the numbers of a calibration, to nine digits: comments, names of files and the last bits do
    not count."""
    digest = hashlib.sha256()
    for line in _lines(calibration):
        digest.update(line.encode() + b"\n")
    return digest.hexdigest()


def _lines(calibration: Calibration) -> Iterator[str]:
    yield f"{calibration.machine} {calibration.model} {calibration.measured}"
    yield f"{digits(calibration.datum_mm)} {digits(calibration.box_mm.ravel())}"
    for source, values in calibration.sources():
        yield from source.fingerprint(values, calibration.datum_mm)


def of_sigmas(calibration: Calibration, sigmas: Mapping[str, Sigmas]) -> Uncertainty | None:
    """From standard uncertainties alone, by the key of their source, such as {"curves": {"EXX": ...},
    "squareness": {"C0Y": ...}}: of components at the positions of their curve, of squareness and of backlash,
    mm or rad. None where there are none."""
    entries = [
        entry
        for source, values in calibration.sources()
        for entry in source.entries(values, sigmas.get(source.key, {}))
    ]
    if not entries:
        return None
    return Uncertainty(tuple(entries), fingerprint(calibration), SIGMA_COLUMNS)
