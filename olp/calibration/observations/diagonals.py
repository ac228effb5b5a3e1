"""Readings of a laser along face and body diagonals as rows of the adjustment.

The laser has an unknown zero, drift and scale, and the backlash of the diagonal as a whole is free.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from olp.calibration.estimator.normal import Block
from olp.calibration.estimator.parameters import Unknowns
from olp.calibration.iso230.positioning import Statistics, statistics, targets_of
from olp.calibration.observations.base import (
    Alternative,
    Noise,
    Observation,
    correlation_factor,
    scatter_words,
)
from olp.calibration.observations.lines import REVERSED, UNITS, Line, drift_ramps, noise_of
from olp.calibration.observations.radial import AlongState, along_block
from olp.core.arrays import Array, Index
from olp.core.errors import ConfigError
from olp.core.machine import ZERO, Vector
from olp.core.units import UM_PER_MM
from olp.core.values import dataclass


@dataclass(frozen=True, slots=True, eq=False)
class Diagonal(Observation):
    """Readings along the straight line between two axis positions, rows in the order of time.

    `distance_mm` (n,) from the start, `value` (n,) actual minus commanded along the line in mm, `run` and
    `direction` as in a `Line` (+1: approached from the start). `sigma` is the standard uncertainty of one
    reading in mm, `sigma_scale` that of the laser's scale. Raises ConfigError.
    """

    read_columns: ClassVar[tuple[str, ...]] = ("distance_mm", "value")

    start_mm: Vector
    end_mm: Vector
    distance_mm: Array
    value: Array
    run: Index
    direction: Index
    tool_mm: Vector = ZERO
    sigma: float = 0.0
    sigma_scale: float = 0.0
    source: str = ""

    def __post_init__(self) -> None:
        length = self.length_mm
        if not np.isfinite(length) or length <= 0.0:
            raise ConfigError(
                "diagonal: start_mm and end_mm are equal; expected two positions", file=self.source
            )
        if np.count_nonzero(np.abs(self.unit) > 1e-9) < 2:
            raise ConfigError(
                f"diagonal: only {self.name.strip('0')} moves; expected a diagonal in two or three axes",
                file=self.source,
            )
        n = len(self.distance_mm)
        if n < 2 or any(len(c) != n for c in (self.value, self.run, self.direction)):
            raise ConfigError(f"diagonal: {n} readings; expected at least 2", file=self.source)
        if self.distance_mm.min() < -1.0 or self.distance_mm.max() > length + 1.0:
            raise ConfigError(
                f"diagonal: targets from {self.distance_mm.min():g} to {self.distance_mm.max():g} mm, but "
                f"start and end are {length:g} mm apart; expected distances from the start",
                file=self.source,
            )

    @property
    def length_mm(self) -> float:
        return float(np.linalg.norm(np.subtract(self.end_mm, self.start_mm)))

    @property
    def unit(self) -> Array:
        """(3,) direction from start to end."""
        return np.asarray(np.subtract(self.end_mm, self.start_mm) / self.length_mm)

    @property
    def name(self) -> str:
        """As ISO 230-6 names diagonals: P or N for each axis as it goes up in the last axis that moves; 0
        for an axis that does not move."""
        u = self.unit
        moving = np.flatnonzero(np.abs(u) > 1e-9)
        u = u * np.sign(u[moving[-1]])
        return "".join("0" if abs(v) <= 1e-9 else "P" if v > 0 else "N" for v in u)

    def evaluate(self) -> Statistics:
        """E, B, R ... along the diagonal, as ISO 230-6 takes them from ISO 230-2. Raises ConfigError."""
        return statistics(self.distance_mm, self.value, self.direction, f"diagonal {self.name}", self.source)

    def elongation(self) -> tuple[float, float]:
        """Slope of the deviation along the diagonal by least squares (mm/mm), and its standard uncertainty.
        That follows from the scatter of the readings (or `sigma`), or from the deviations of the target means
        from the line: the larger one counts. Curves of the axes make neighbouring deviations alike, so they
        count as fewer (`correlation_factor`)."""
        x = self.distance_mm - self.distance_mm.mean()
        spread = float(x @ x)
        if spread == 0.0:
            raise ConfigError(f"diagonal {self.name}: one target; expected at least 2", file=self.source)
        slope = float(x @ self.value) / spread
        rest = self.value - self.value.mean() - slope * x
        noise = float(np.sqrt(rest @ rest / max(len(x) - 2, 1)))
        target, place = targets_of(self.distance_mm)
        means = np.bincount(place, rest) / np.bincount(place)
        bow = float(np.sqrt(means @ means / (len(target) - 2))) if len(target) > 2 else 0.0
        bow *= correlation_factor(float(means[:-1] @ means[1:]), float(means @ means))
        apart = float(np.sqrt(((target - target.mean()) ** 2).sum()))
        return slope, max(max(noise, self.sigma) / np.sqrt(spread), bow / apart)

    def reach(self, axis: int) -> Array:
        return np.asarray(diagonal_positions(self)[:, axis])

    def alternatives(self) -> Sequence[Alternative]:
        """Sign, unit, and the other end as the start."""
        found = [
            Alternative(
                kind, words, replace(self, value=factor * self.value, sigma=abs(factor) * self.sigma), factor
            )
            for kind, factor, words in (REVERSED, *UNITS[0])
        ]
        turned = replace(self, distance_mm=self.length_mm - self.distance_mm, direction=-self.direction)
        return [*found, Alternative("order", "its targets run the other way", turned)]

    def start(self, noise: Noise | None = None) -> DiagonalState:
        return DiagonalState(self, noise_of_diagonal(self))


@dataclass(frozen=True, slots=True, eq=False)
class DiagonalState(AlongState):
    """A diagonal in an adjustment, with the noise of its readings. One row per reading."""

    apart = True
    observation: Diagonal
    noise: Noise

    @property
    def name(self) -> str:
        return f"diagonal {self.observation.name}"

    @property
    def count(self) -> int:
        return len(self.observation.value)

    def positions(self) -> Array:
        return diagonal_positions(self.observation)

    def block(self, parameters: Unknowns, theta: Array) -> Block:
        return diagonal_block(self.observation, parameters, self.noise)

    def scatter(self) -> str | None:
        taken = self.observation
        return scatter_words(taken.source or "diagonal", self.noise, taken.sigma, "um", UM_PER_MM)


def diagonal_positions(diagonal: Diagonal) -> Array:
    """(n, 3) commanded axis positions."""
    return np.asarray(np.array(diagonal.start_mm) + diagonal.distance_mm[:, None] * diagonal.unit)


def noise_of_diagonal(diagonal: Diagonal) -> Noise:
    """From repeated runs and what is stated, as of a line. Raises ConfigError where both are missing."""
    if diagonal.sigma <= 0.0 and len(np.unique(diagonal.run)) < 2:
        raise ConfigError(
            f"diagonal {diagonal.name} has no repeated readings and states no sigma; expected at least two "
            "runs or sigma_um",
            file=diagonal.source,
        )
    as_line = Line(
        "EXX", diagonal.distance_mm, diagonal.value, diagonal.run, diagonal.direction, diagonal.start_mm,
        sigma=diagonal.sigma, source=diagonal.source,
    )  # fmt: skip
    return noise_of(as_line)


def diagonal_block(diagonal: Diagonal, parameters: Unknowns, noise: Noise) -> Block:
    """The readings along one diagonal, one row each. Raises ConfigError."""
    n = len(diagonal.value)
    free = [np.ones(n), diagonal.direction.astype(float)]
    believed: list[tuple[Array, float]] = []
    if diagonal.sigma_scale > 0.0:
        believed.append((diagonal.distance_mm, diagonal.sigma_scale))
    if noise.drift > 0.0:
        as_line = Line(
            "EXX", diagonal.distance_mm, diagonal.value, diagonal.run, diagonal.direction, diagonal.start_mm,
            sigma=noise.sigma,
        )  # fmt: skip
        believed += [(ramp, noise.drift) for ramp in drift_ramps(as_line).T]
    along = np.tile(diagonal.unit, (n, 1))
    return along_block(
        diagonal_positions(diagonal), along, diagonal.tool_mm, diagonal.value, noise.sigma,
        np.stack(free, axis=1), believed, parameters, diagonal.source or f"diagonal {diagonal.name}",
    )  # fmt: skip
