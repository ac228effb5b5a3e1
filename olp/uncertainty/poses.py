"""How well the poses of a tool are known, from the covariance of a calibration of any joints.

One shift and one turn of all poses are left out: a work offset takes them up, and readings in the frame of an
instrument do not show them. To first order, with normal errors.
"""

from __future__ import annotations

import numpy as np

from olp.calibration.joints.adjustment import frame_of, left_of, tables_of
from olp.calibration.joints.unknowns import Model
from olp.core.arrays import Array
from olp.core.values import dataclass
from olp.kinematics.errors import Payload
from olp.uncertainty.spread import COVERAGE


@dataclass(frozen=True, slots=True, eq=False)
class PoseSpread:
    """(n, 3, 3) covariances in workpiece coordinates: of tips in mm2, and of turns of the tool in rad2; of a
    tool that is the same all round without its turn about itself."""

    tip: Array
    turn: Array

    @property
    def turn_band_rad(self) -> Array:
        """(n,) expanded uncertainty of the turn in the direction where it is largest."""
        return np.asarray(COVERAGE * np.sqrt(np.maximum(np.linalg.eigvalsh(self.turn)[:, 2], 0.0)))


def pose_spread(model: Model, axes: Array, tool_mm: Array, payload: Payload) -> PoseSpread:
    """The spread of poses at axis values (n, axes) with tools (n, 3) mm from the gauge, beside the shift and
    turn that fit all of them. `known` of the model is the covariance of its unknowns. Raises CannotCompute
    where a platform does not close."""
    none, count = np.zeros(len(model.unknowns)), len(model.unknowns)
    tip, turn = np.zeros((len(axes), 3, count)), np.zeros((len(axes), 3, count))
    place = np.zeros((len(axes), 3))
    tools, which = np.unique(tool_mm, axis=0, return_inverse=True)
    for number, tool in enumerate(tools):
        rows = np.flatnonzero(which.ravel() == number)
        tip[rows], turn[rows], place[rows] = tables_of(model, none, axes[rows], tool, payload)
    frame, size = frame_of(place)
    rest, share = left_of(tip, frame)
    turn -= share[3:] / size
    if model.structure.symmetric_tool:
        along = model.machine(none, payload).actual(axes).rotation[:, :, 2]
        turn -= along[:, :, None] * np.einsum("ni,nik->nk", along, turn)[:, None, :]
    return PoseSpread(*(_covariances(table @ model.root) for table in (rest, turn)))


def _covariances(table: Array) -> Array:
    """(n, 3, 3) of tables (n, 3, k) of independent numbers of size 1."""
    return np.asarray(table @ np.swapaxes(table, 1, 2))
