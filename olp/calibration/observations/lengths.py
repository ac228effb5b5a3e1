"""Lengths from stations of unknown position (sequential multilateration) as rows of the adjustment.

A tracking interferometer reads |tip - station| less a dead length; station and dead length are unknown. The
first guess is the linear solution of 2 Q.S + 2 L d + (d^2 - |S|^2) = |Q|^2 - L^2, then Gauss-Newton follows.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import field, replace
from typing import Any, ClassVar

import numpy as np

from olp.calibration.estimator.normal import Block, Chunk, residuals_of
from olp.calibration.estimator.parameters import Unknowns
from olp.calibration.observations.base import (
    OWN_SCALE,
    Advance,
    Alternative,
    Noise,
    Outlier,
    Scattered,
    ScatteredState,
    rms,
    slips_of,
    without,
)
from olp.core.arrays import Array, Index
from olp.core.errors import CannotCompute, ConfigError
from olp.core.units import UM_PER_MM
from olp.core.values import dataclass

#: Readings whose rows are built at once, to limit memory.
CHUNK = 4000
#: The Gauss-Newton iteration has converged where no station moves by more than this.
STILL_MM = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Lengths(Scattered):
    """Lengths that a tracking interferometer read from one station of unknown position and dead length.

    `axis_mm` (n, 3) are the commanded axis positions, `tool_mm` (n, 3) or (3,) the vectors from the gauge
    point to the reflector, `length_mm` (n,) the readings. `sigma_mm`, (n,) or one number, is their standard
    uncertainty, `sigma_scale` that of their common scale (mm/mm). Raises ConfigError.
    """

    read_columns: ClassVar[tuple[str, ...]] = ("axis_mm", "length_mm")

    axis_mm: Array
    tool_mm: Array
    length_mm: Array
    sigma_mm: Array
    sigma_scale: float = 0.0
    source: str = ""
    row: Index = field(default_factory=lambda: np.zeros(0, np.int64))

    def __post_init__(self) -> None:
        axis = np.atleast_2d(np.array(self.axis_mm, float))
        length = np.array(self.length_mm, float)
        columns = {
            "axis_mm": axis,
            "tool_mm": np.array(np.broadcast_to(self.tool_mm, axis.shape), float),
            "length_mm": length,
            "sigma_mm": np.array(np.broadcast_to(self.sigma_mm, length.shape), float),
            "row": np.array(self.row, np.int64) if len(self.row) else np.arange(1, len(axis) + 1),
        }
        if length.shape != (len(axis),) or axis.shape[1:] != (3,) or len(axis) < 5:
            raise ConfigError(
                f"{length.size} lengths; expected at least 5 from a station, each with three axis positions",
                file=self.source or None,
            )
        if not all(np.isfinite(column).all() for column in columns.values()):
            raise ConfigError("a length is not finite; leave the row out", file=self.source or None)
        if not np.all(columns["sigma_mm"] > 0.0):
            raise ConfigError(
                "the uncertainty of the lengths is not stated; expected sigma_um", file=self.source or None
            )
        for name, column in columns.items():
            column.flags.writeable = False
            object.__setattr__(self, name, column)

    def alternatives(self) -> Sequence[Alternative]:
        """A scale of its own, and swapped columns."""
        scaled = replace(self, sigma_scale=math.hypot(self.sigma_scale, OWN_SCALE))
        words = "it has a scale of its own (temperature, wavelength)"
        return [Alternative("scale", words, scaled, where_off=True), *self.swapped()]

    def start(self, noise: Noise | None = None) -> LengthsState:
        return LengthsState(self, first_station(self))


@dataclass(frozen=True, slots=True, eq=False)
class Station:
    """The estimated position of a station, in the machine's frame, and its dead length."""

    place_mm: Array
    dead_mm: float

    def moved(self, by: Array) -> Station:
        return Station(self.place_mm + by[:3], self.dead_mm + float(by[3]))


@dataclass(frozen=True, slots=True, eq=False)
class LengthsState(ScatteredState):
    """Lengths in an adjustment, and the estimate of their station."""

    noun = "lengths"
    tally = "lengths"
    observation: Lengths
    station: Station

    @property
    def section(self) -> str:
        return "stations"

    def block(self, parameters: Unknowns, theta: Array) -> Block:
        return lengths_block(self.observation, parameters, theta, self.station)

    def step(self, block: Block, theta: Array) -> Advance:
        values = residuals_of(block, theta)[0]
        return Advance(values, bool(np.abs(values[:3]).max() < STILL_MM))

    def slips(self, block: Block, theta: Array, settled: bool) -> Sequence[Outlier]:
        # before the stations have converged, a residual may come from them
        if not settled:
            return ()
        return slips_of(block, theta, self.observation.source, self.observation.row, "length")

    def moved(self, step: Advance, slips: Sequence[Outlier]) -> LengthsState:
        kept = without(self.observation, self.observation.row, slips)
        return LengthsState(kept, self.station.moved(step.values))

    def spread_over_rows(self, numbers: Index) -> Index:
        return numbers

    def row(self, residual: Array, chi_square: float) -> dict[str, Any]:
        return {
            "name": self.observation.source or "station",
            "lengths": len(residual),
            "place_mm": self.station.place_mm.tolist(),
            "residual_um": rms(residual) * UM_PER_MM,
            "chi_square_per_length": chi_square / len(residual),
        }


def first_station(lengths: Lengths) -> Station:
    """The closed-form guess, as if the machine had no errors. Raises CannotCompute where the points do
    not determine it."""
    tip = lengths.axis_mm + lengths.tool_mm
    centre = tip.mean(axis=0)
    q, length = (tip - centre) / 1000.0, lengths.length_mm / 1000.0
    table = np.column_stack([2.0 * q, 2.0 * length, np.ones(len(q))])
    right = (q**2).sum(axis=1) - length**2
    solution, _, rank, _ = np.linalg.lstsq(table, right, rcond=1e-9)
    if rank < 5:
        raise CannotCompute(
            f"the points of {lengths.source or 'a station'} lie in one plane or are too few; expected points "
            "all over the volume"
        )
    return Station(1000.0 * solution[:3] + centre, 1000.0 * float(solution[3]))


def lengths_block(lengths: Lengths, parameters: Unknowns, theta: Array, station: Station) -> Block:
    """The readings of one station, linearised where the machine's errors are `theta`. Its unknowns are the
    shift of the station and of its dead length."""
    size = parameters.size
    tip = lengths.axis_mm + lengths.tool_mm
    scaled = lengths.sigma_scale > 0.0
    precision = np.zeros(5 if scaled else 4)
    if scaled:
        precision[4] = 1.0 / lengths.sigma_scale**2

    def chunks() -> Iterator[Chunk]:
        for start in range(0, len(tip), CHUNK):
            part = slice(start, start + CHUNK)
            design = parameters.design(lengths.axis_mm[part], lengths.tool_mm[part])
            ray = tip[part] + design @ theta - station.place_mm
            distance = np.linalg.norm(ray, axis=1)
            along = ray / distance[:, None]
            rows = np.einsum("ni,nik->nk", along, design)
            read = lengths.length_mm[part]
            local = [-along, -np.ones((len(read), 1))]
            if scaled:
                local.append(read[:, None])
            y = read - (distance - station.dead_mm) + rows @ theta
            yield Chunk(rows, y, lengths.sigma_mm[part], np.concatenate(local, axis=1))

    return Block(np.arange(size), precision, chunks, lengths.source or "lengths")
