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
from olp.uncertainty.probability import within
from olp.uncertainty.spread import COVERAGE, DRAWS, FEWEST_DRAWS, SEED, WORK

#: Tips that are drawn at a time, so that memory is small.
_BLOCK = 512


@dataclass(frozen=True, slots=True, eq=False)
class PoseSpread:
    """(n, 3, 3) covariances in workpiece coordinates: of tips in mm2, and of turns of the tool in rad2; of a
    tool that is the same all round without its turn about itself. `shifts` (n, 3, k) are mm of tips by
    independent unknowns of size 1, which all poses share."""

    tip: Array
    turn: Array
    shifts: Array

    @property
    def turn_band_rad(self) -> Array:
        """(n,) expanded uncertainty of the turn in the direction where it is largest."""
        return np.asarray(COVERAGE * np.sqrt(np.maximum(np.linalg.eigvalsh(self.turn)[:, 2], 0.0)))


def pose_spread(model: Model, axes: Array, tool_mm: Array, payload: Payload, misfit_mm: float) -> PoseSpread:
    """The spread of poses at axis values (n, axes) with tools (n, 3) mm from the gauge, beside the shift and
    turn that fit all of them. `known` of the model is the covariance of its unknowns. `misfit_mm` is the
    standard deviation of each coordinate of tips beyond them. Raises CannotCompute where a platform does not
    close."""
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
    beyond = np.broadcast_to(misfit_mm * np.eye(3), (len(axes), 3, 3))
    shifts = np.concatenate((rest @ model.root, beyond), axis=2)
    return PoseSpread(_covariances(shifts), _covariances(turn @ model.root), shifts)


@dataclass(frozen=True, slots=True, eq=False)
class PoseChances:
    """Probabilities that tips are within a distance of where they should be: (n,) of `each`, and of
    the whole `program` by so many `draws` of the calibration."""

    each: Array
    program: float
    draws: int

    def report(self) -> dict[str, float]:
        return {"program": self.program, "least": float(self.each.min()), "mean": float(self.each.mean())}


def chances_of(spread: PoseSpread, off_mm: Array, limit_mm: float) -> PoseChances:
    """The probabilities of tips that are `off_mm` (n, 3) by the calibration."""
    draws = int(np.clip(WORK / max(len(off_mm), 1), FEWEST_DRAWS, DRAWS))
    drawn = np.random.default_rng(SEED).normal(size=(spread.shifts.shape[2], draws))
    inside = np.ones(draws, bool)
    for a in range(0, len(off_mm), _BLOCK):
        part = slice(a, a + _BLOCK)
        off = off_mm[part, :, None] + spread.shifts[part] @ drawn
        inside &= ((off * off).sum(axis=1) <= limit_mm**2).all(axis=0)
    return PoseChances(within(spread.tip, off_mm, limit_mm), float(inside.mean()), draws)


def _covariances(table: Array) -> Array:
    """(n, 3, 3) of tables (n, 3, k) of independent numbers of size 1."""
    return np.asarray(table @ np.swapaxes(table, 1, 2))
