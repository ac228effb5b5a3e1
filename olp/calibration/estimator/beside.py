"""Readings beside the targets of lines: they also see what the cells of a curve hide there.

A tip at a position that no line read has an error that the unknowns do not hold: a wave of a screw, a dent.
Its variance is known (`between.Hidden`). It is no mistake of the reading, so it counts as its noise. Readings
at one position see the same of it: repeating them does not average it, and they differ by their noise alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from olp.calibration.estimator.between import Hidden
from olp.calibration.estimator.normal import Block, Chunk, Index
from olp.calibration.estimator.parameters import CROSS, Parameters, Unknowns
from olp.calibration.observations.base import ScatteredState, State
from olp.calibration.observations.radial import AlongState
from olp.core.arrays import Array
from olp.core.units import AXES
from olp.core.values import dataclass

#: Readings whose rows are nearer than this share of the largest are equal.
_SAME = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class _Beside:
    """Unknowns, and beside them one for each curve: what its cells hide at the position, in standard
    deviations."""

    unknowns: Unknowns
    parameters: Parameters
    hidden: Mapping[str, Hidden]

    @property
    def size(self) -> int:
        return self.unknowns.size + len(self.hidden)

    def design(self, position: Array, tool: Array, /) -> Array:
        table = np.zeros((len(position), 3, len(self.hidden)))
        for column, (name, hidden) in enumerate(self.hidden.items()):
            axis = AXES.index(name[2])
            sigma = np.sqrt(hidden.at(position[:, axis]))
            if name[1] in AXES:
                table[:, AXES.index(name[1]), column] = sigma
            for row, angle, lever, sign in CROSS:
                if "ABC"[angle] == name[1]:
                    arm = self.parameters.lever_arm(row, axis, lever, position, tool)
                    table[:, row, column] = sign * sigma * arm
        return np.concatenate([self.unknowns.design(position, tool), table], axis=2)


def _groups(rows: Array) -> Index:
    """(n,) the group of each of rows (n, k), which are equal: the same position, tool and direction."""
    # two projections tell rows apart, whatever they hold
    first, second = (rows @ np.random.default_rng(9).normal(size=(rows.shape[1], 2))).T
    order = np.lexsort((second, first))
    new = np.zeros(len(rows), bool)
    for key in (first, second):
        new[1:] |= np.abs(np.diff(key[order])) > _SAME * np.abs(key).max(initial=0.0)
    group = np.empty(len(rows), np.intp)
    group[order] = np.cumsum(new)
    return group


def block_of(
    state: State, theta: Array, parameters: Parameters, hidden: Mapping[str, Hidden],
    unknowns: Unknowns | None = None,
) -> Block:  # fmt: skip
    """The readings of a state as functionals of `unknowns` (the parameters, if left out) at theta, with the
    noise of what curves hide at their positions. Raises ConfigError or CannotCompute where they cannot be
    used."""
    if not isinstance(state, ScatteredState | AlongState):
        return state.block(parameters, theta)
    whole, size = _whole(state, theta, parameters, hidden, unknowns or parameters)

    def chunks() -> Iterator[Chunk]:
        for chunk in whole.chunks():
            own, beside = chunk.rows[:, :size], np.sqrt((chunk.rows[:, size:] ** 2).sum(axis=1))
            yield replace(chunk, rows=own, beside=beside, group=_groups(own))

    return Block(np.arange(size), whole.precision, chunks, whole.label)


def shares_of(
    state: ScatteredState | AlongState, theta: Array, parameters: Parameters, hidden: Mapping[str, Hidden]
) -> tuple[Block, Array]:
    """The readings of a state without that noise, in their groups, and (n, curves) the variance that each
    curve adds."""
    whole, size = _whole(state, theta, parameters, hidden, parameters)
    chunks = list(whole.chunks())
    plain = [replace(c, rows=c.rows[:, :size], group=_groups(c.rows[:, :size])) for c in chunks]
    shares = np.concatenate([chunk.rows[:, size:] for chunk in chunks]) ** 2
    return Block(np.arange(size), whole.precision, lambda: plain, whole.label), shares


def gains_of(state: ScatteredState | AlongState, theta: Array, parameters: Parameters) -> Array:
    """(n, curves) by how much the readings of a state change with each curve where they were taken."""
    unit = dict.fromkeys(parameters.spaces, Hidden(np.zeros(1), np.ones(1)))
    whole, size = _whole(state, theta, parameters, unit, parameters)
    return np.concatenate([chunk.rows[:, size:] for chunk in whole.chunks()])


def _whole(
    state: ScatteredState | AlongState, theta: Array, parameters: Parameters, hidden: Mapping[str, Hidden],
    unknowns: Unknowns,
) -> tuple[Block, int]:  # fmt: skip
    """The readings with a column for each curve, and how many unknowns are before these."""
    beside = np.concatenate([theta, np.zeros(len(hidden))])
    return state.block(_Beside(unknowns, parameters, hidden), beside), unknowns.size
