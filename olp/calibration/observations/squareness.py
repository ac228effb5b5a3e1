"""Values of squareness, from any instrument, as rows of the adjustment."""

from __future__ import annotations

import numpy as np

from olp.calibration.estimator.normal import Block, Chunk
from olp.calibration.estimator.parameters import SHEAR, Parameters, gathered
from olp.calibration.observations.base import Noise, Observation, State
from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.machine import SQUARENESS, ZERO, Vector
from olp.core.values import dataclass

#: No value is more accurate than this: 10 nrad.
LEAST_RAD = 1e-8


@dataclass(frozen=True, slots=True)
class SquarenessReading(Observation):
    """The squareness of two axes from any instrument, in the sign convention of this package.

    `component` is C0Y, B0Z or A0Z; `value_rad` is the lean of the mean line of the later axis against that
    of the earlier one. It holds at the axis positions `line_mm` with tool vector `tool_mm`, over the lengths
    `span_mm` (low, high) of the earlier and of the later axis. `sigma_rad` is its standard uncertainty.
    """

    component: str
    value_rad: float
    line_mm: Vector
    span_mm: tuple[tuple[float, float], tuple[float, float]]
    tool_mm: Vector = ZERO
    sigma_rad: float = 0.0
    source: str = ""

    def __post_init__(self) -> None:
        if self.component not in SQUARENESS:
            raise ConfigError(
                f"squareness {self.component}: expected one of {', '.join(SQUARENESS)}", file=self.source
            )
        if not np.isfinite(self.value_rad):
            raise ConfigError(f"squareness {self.component} is not finite", file=self.source)

    def reach(self, axis: int) -> Array:
        return np.zeros(0)

    def start(self, noise: Noise | None = None) -> SquarenessState:
        return SquarenessState(self)


@dataclass(frozen=True, slots=True, eq=False)
class SquarenessState(State):
    """A value of squareness in an adjustment: one row, no unknowns of its own."""

    observation: SquarenessReading

    @property
    def count(self) -> int:
        return 1

    def block(self, parameters: Parameters, theta: Array) -> Block:
        return squareness_block(self.observation, parameters)


def squareness_block(reading: SquarenessReading, parameters: Parameters) -> Block:
    """A value of squareness: minus or plus the sum of the mean slopes of both lines."""
    earlier, later, sign = SHEAR[reading.component]
    parts = []
    for moving, along, span in ((earlier, later, reading.span_mm[0]), (later, earlier, reading.span_mm[1])):
        q = np.linspace(*span, 101)
        weight = (q - q.mean()) / float(((q - q.mean()) ** 2).sum())
        position = np.tile(np.array(reading.line_mm), (len(q), 1))
        position[:, moving] = q
        for axis in range(3):
            for part, values in parameters.displacement(along, axis, position, np.array(reading.tool_mm)):
                parts.append((part, sign * (weight @ values)[None, :]))
    parts.append((parameters.slices[reading.component], np.ones((1, 1))))
    rows, columns = gathered(parts, 1)
    sigma = max(reading.sigma_rad, LEAST_RAD)
    chunk = Chunk(rows, np.array([reading.value_rad]), np.array([sigma]), np.zeros((1, 0)))
    return Block.of(chunk, columns, np.zeros(0), reading.source or reading.component)
