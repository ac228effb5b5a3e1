"""What is known of the errors of a machine before the next readings: by the covariance of its calibration, or
by what such machines are like."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from olp.calibration.estimator.parameters import Unknowns, frame_columns
from olp.core.arrays import Array
from olp.core.machine import Vector
from olp.core.values import dataclass
from olp.errormodel.calibration import Calibration
from olp.errormodel.sensitivity import Sensitivity
from olp.errormodel.uncertainty import Uncertainty

#: Positions in the box where the uncertainty is computed, for each tool.
_POSITIONS = 150


@dataclass(frozen=True, slots=True, eq=False)
class Known:
    """Errors as functionals of independent unknowns of variance 1: `rows` of axis positions (n, 3) and tool
    vectors (n, 3) or (3,) are (n, 3, size), in mm."""

    size: int
    rows: Callable[[Array, Array], Array]

    def design(self, position: Array, tool: Array, /) -> Array:
        return self.rows(position, tool)

    @classmethod
    def of_calibration(
        cls, calibration: Calibration, chain: str, uncertainty: Uncertainty, skip: frozenset[str]
    ) -> Known:
        """Its covariance; `skip` are errors that the control corrects."""
        parts = Sensitivity.of(calibration, chain, uncertainty, skip=skip)

        def rows(position: Array, tool: Array) -> Array:
            return np.moveaxis(parts.rows(position, tool), 0, 1).astype(float)

        return cls(parts.columns, rows)

    @classmethod
    def of_prior(cls, unknowns: Unknowns, precision: Array) -> Known:
        """What is expected of unknowns with a precision (size, size) before any reading."""
        root = np.linalg.inv(np.linalg.cholesky(precision)).T
        return cls(unknowns.size, lambda position, tool: unknowns.design(position, tool) @ root)


def judged_rows(unknowns: Unknowns, box_mm: Array, tools: Sequence[Vector]) -> Array:
    """(tools, 3 n, size) the error at positions in the box (3, 2), less the best-fit frame of each tool."""
    rng = np.random.default_rng(1)
    position = rng.uniform(box_mm[:, 0], box_mm[:, 1], (_POSITIONS, 3))
    judged = np.zeros((len(tools), 3 * _POSITIONS, unknowns.size))
    for k, tool in enumerate(tools):
        vector = np.asarray(tool, float)
        rows = unknowns.design(position, vector).reshape(3 * _POSITIONS, -1)
        frame = frame_columns(position + vector - (position + vector).mean(axis=0)).reshape(
            3 * _POSITIONS, -1
        )
        basis, _ = np.linalg.qr(frame)
        judged[k] = rows - basis @ (basis.T @ rows)
    return judged


def lengths_of(judged: Array, covariance: Array) -> Array:
    """(tools, n) expected lengths of the error at the positions of `judged_rows`, mm."""
    square = np.einsum("tnk,tnk->tn", judged @ covariance, judged)
    return np.asarray(np.sqrt(square.reshape(len(judged), -1, 3).sum(axis=2)))
