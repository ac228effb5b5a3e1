"""Displacements along one known direction at every reading, as rows of the adjustment."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from typing import Any

import numpy as np

from olp.calibration.estimator.normal import Block, Chunk
from olp.calibration.estimator.parameters import Unknowns
from olp.calibration.observations.base import Noise, State, rms
from olp.core.arrays import Array
from olp.core.units import UM_PER_MM

#: Readings whose rows are built at once, to limit memory.
CHUNK = 2000
#: Singular values of the nuisances below this share of the largest count as zero.
_RANK = 1e-7


class AlongState(State):
    """Readings along one known direction within an adjustment."""

    __slots__ = ()
    noun = "diagonals and circles"
    noise: Noise

    @property
    def section(self) -> str:
        return "diagonals_and_circles"

    @property
    def label(self) -> str:
        return self.observation.source or "diagonals"

    @property
    @abstractmethod
    def name(self) -> str:
        """Its name in the report."""

    @abstractmethod
    def positions(self) -> Array:
        """(rows, 3) the axis position of each row."""

    @abstractmethod
    def block(self, parameters: Unknowns, theta: Array) -> Block: ...

    def row(self, residual: Array, chi_square: float) -> dict[str, Any]:
        return {
            "name": self.name,
            "file": self.observation.source,
            "readings": len(residual),
            "sigma_reading_um": self.noise.sigma * UM_PER_MM,
            "residual_um": rms(residual) * UM_PER_MM,
            "chi_square_per_reading": chi_square / len(residual),
        }


def along_block(
    position: Array, along: Array, tool_mm: tuple[float, float, float], value: Array, sigma: float,
    free: Array, believed: list[tuple[Array, float]], parameters: Unknowns, label: str,
) -> Block:  # fmt: skip
    """Rows `along` . error = value, with free nuisances and such with a prior standard deviation."""
    # in a part of a circle, or in one direction, nuisances may depend on each other: only their span counts
    basis, size, _ = np.linalg.svd(free, full_matrices=False)
    local = [basis[:, size > _RANK * size[0]] * np.sqrt(len(value))]
    local += [column[:, None] for column, _ in believed]
    table = np.concatenate(local, axis=1)
    precision = np.concatenate([np.zeros(local[0].shape[1]), [1.0 / s**2 for _, s in believed]])

    def chunks() -> Iterator[Chunk]:
        for start in range(0, len(value), CHUNK):
            part = slice(start, start + CHUNK)
            design = parameters.design(position[part], np.array(tool_mm))
            rows = np.einsum("ni,nik->nk", along[part], design)
            yield Chunk(rows, value[part], np.full(len(rows), sigma), table[part])

    return Block(np.arange(parameters.size), precision, chunks, label)
