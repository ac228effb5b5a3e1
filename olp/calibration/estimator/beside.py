"""Readings beside the targets of lines: they also see what the cells of a curve hide there.

A tip at a position that no line read has an error that the unknowns do not hold: a wave of a screw, a dent.
Its variance is known (`between.Hidden`). It is no mistake of the reading, so it counts as its noise.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from olp.calibration.estimator.normal import Block, Chunk
from olp.calibration.estimator.parameters import CROSS, Parameters, Unknowns
from olp.calibration.estimator.smoothing import Shape
from olp.calibration.observations.base import ScatteredState, State
from olp.calibration.observations.radial import AlongState
from olp.core.arrays import Array
from olp.core.units import AXES
from olp.core.values import dataclass


@dataclass(frozen=True, slots=True, eq=False)
class _Beside:
    """Unknowns, and beside them one for each curve with lines: what its cells hide at the position, in
    standard deviations."""

    unknowns: Unknowns
    parameters: Parameters
    shapes: Mapping[str, Shape]

    @property
    def size(self) -> int:
        return self.unknowns.size + len(self.shapes)

    def design(self, position: Array, tool: Array, /) -> Array:
        table = np.zeros((len(position), 3, len(self.shapes)))
        for column, (name, shape) in enumerate(self.shapes.items()):
            axis = AXES.index(name[2])
            sigma = np.sqrt(shape.hidden.at(position[:, axis]))
            if name[1] in AXES:
                table[:, AXES.index(name[1]), column] = sigma
            for row, angle, lever, sign in CROSS:
                if "ABC"[angle] == name[1]:
                    arm = self.parameters.lever_arm(row, axis, lever, position, tool)
                    table[:, row, column] = sign * sigma * arm
        return np.concatenate([self.unknowns.design(position, tool), table], axis=2)


def block_of(
    state: State, theta: Array, parameters: Parameters, shapes: Mapping[str, Shape],
    unknowns: Unknowns | None = None,
) -> Block:  # fmt: skip
    """The readings of a state as functionals of `unknowns` (the parameters, if left out) at theta, with the
    noise of what curves with lines hide at their positions. Raises ConfigError or CannotCompute where they
    cannot be used."""
    if not isinstance(state, ScatteredState | AlongState):
        return state.block(parameters, theta)
    unknowns = unknowns or parameters
    size = unknowns.size
    theta = np.concatenate([theta, np.zeros(len(shapes))])
    whole = state.block(_Beside(unknowns, parameters, shapes), theta)

    def chunks() -> Iterator[Chunk]:
        for chunk in whole.chunks():
            beside = np.sqrt((chunk.rows[:, size:] ** 2).sum(axis=1))
            yield Chunk(chunk.rows[:, :size], chunk.y, np.hypot(chunk.sigma, beside), chunk.local)

    return Block(np.arange(size), whole.precision, chunks, whole.label)
