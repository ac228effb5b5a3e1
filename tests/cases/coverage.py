"""Coverage of 2 sigma on families of machines: errors and stated sigma of fits, in units of what is best."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from functools import cache

import numpy as np
from cases import volumetric
from cases.best_linear import Best
from cases.blunders import ALARMS
from cases.calibration import FRESH, measurements_of
from judge import families, simulated

from olp.calibration.estimator.adjustment import fit
from olp.calibration.estimator.curves import sigma_of
from olp.workflows.calibrate_fit import fit_calibration

#: Positions of a curve where it is judged.
POSITIONS = 40


@dataclasses.dataclass(frozen=True)
class Scores:
    """Errors and stated sigma (n,) in units of `best` (n,), which the best linear estimator reaches."""

    error: np.ndarray
    sigma: np.ndarray

    @property
    def coverage(self) -> float:
        return float(np.mean(np.abs(self.error) <= 2.0 * self.sigma))

    @property
    def rms(self) -> float:
        return float(np.sqrt(np.mean(self.error**2)))

    @property
    def square(self) -> float:
        """Mean square of errors in stated sigma: 1 where these are true, however errors go together."""
        return float(np.mean((self.error / self.sigma) ** 2))

    @property
    def stated(self) -> float:
        return float(np.sqrt(np.mean(self.sigma**2)))

    @property
    def mean(self) -> float:
        """Mean stated sigma."""
        return float(np.mean(self.sigma))

    @classmethod
    def of(cls, parts: Sequence[Scores]) -> Scores:
        return cls(*(np.concatenate([getattr(p, name) for p in parts]) for name in ("error", "sigma")))


def lines_of(family: str, count: int, seed: int, *, against_best: bool = True) -> Scores:
    """A machine measured by lines through the datum, judged curve by curve; else in units of usual curves."""
    machine = families.machine(seed, family)
    datum = (0.0, 0.0, 0.0)
    taken = simulated.all_lines(machine, seed, line_mm=datum, tool=datum, count=(count,) * 3)
    fitted = fit(measurements_of(taken), machine.chain)
    rng = np.random.default_rng(seed)
    parts = []
    for line in {line.component: line for line in taken}.values():
        name = line.component
        side = machine.box["XYZ".index(name[2])]
        q = rng.uniform(*side, POSITIONS)
        best = best_of(family, name, count) if against_best else families.SIZE[families.class_of(name)]
        off = fitted.curve(name, q) @ fitted.theta - machine.curves[name](q)
        parts.append(Scores(off / best, sigma_of(fitted, name, q) / best))
    return Scores.of(parts)


@cache
def best_of(family: str, name: str, count: int) -> float:
    """The rms error of the best linear estimator over an axis, from so many targets."""
    side = simulated.BOX["XYZ".index(name[2])]
    sigma = families.best_linear(family, name, np.linspace(*side, count), np.linspace(*side, 97))
    return float(np.sqrt(np.mean(sigma**2)))


@dataclasses.dataclass(frozen=True)
class Judged:
    """A machine judged at poses: errors and stated sigma in mm of the fit, then of the best linear estimator
    from the same readings; and what speaks against these, though nothing is wrong with them."""

    own: Scores
    best: Scores
    alarms: tuple[str, ...]

    def in_units(self, size: float) -> Judged:
        """The same in units of a size in mm."""
        parts = (Scores(one.error / size, one.sigma / size) for one in (self.own, self.best))
        return Judged(*parts, self.alarms)


def volume_of(family: str, mixture: str, seed: int) -> Judged:
    """A machine measured by a mixture (`volumetric.MIXTURES`)."""
    machine = families.machine(seed, family)
    calibrated = fit_calibration(volumetric.readings(machine, mixture, seed))
    fitted = calibrated.fit
    rng = np.random.default_rng(seed)
    position, tool = rng.uniform(*machine.box.T, (POSITIONS * 3, 3)), np.array(FRESH[1])
    true = machine.error(position, tool)
    own = fitted.error(position, tool), fitted.sigma(position, tool)
    best = Best(fitted, family).at(position, tool)
    alarms = tuple(sorted({one.code for one in calibrated.findings} & set(ALARMS)))
    return Judged(*(Scores((error - true).ravel(), sigma.ravel()) for error, sigma in (own, best)), alarms)
