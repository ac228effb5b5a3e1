"""Which posture of an arm a position of KRL names: status (S) the branch, turn (T) the signs of the axes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from olp.core.arrays import Array, Mask

#: Bits of the status and the branches (columns of `Arm.branches`) of which they are the sign: set behind the
#: first axis, before the lower arm, and with the fifth axis below zero.
_BITS = ((1, 0, -1.0), (2, 1, 1.0), (4, 2, -1.0))
#: Branches that are nearer to their border than this, mm or deg, are on both sides.
_BORDER = 0.01
#: deg beyond zero that are rounding of the text
_ROUNDING_DEG = 0.01
_AXES = 6


def fitting(config: Array, axes: Array, branches: Array) -> tuple[Array, Mask]:
    """As `RobotDialect.fitting`."""
    stated = np.isfinite(config)
    status, turn = np.where(stated, config, 0.0).astype(np.int64).T
    fits = np.isfinite(axes[:, :, 0])
    for bit, column, sign in _BITS:
        own, is_set = sign * branches[:, :, column], (status & bit != 0)[:, None]
        fits &= (np.abs(own) < _BORDER) | ((own > 0.0) == is_set) | ~stated[:, :1]
    below = ((turn[:, None] >> np.arange(_AXES)) & 1 != 0)[:, None, :]
    turned = axes - 360.0 * (below & (axes > _ROUNDING_DEG)) + 360.0 * (~below & (axes < -_ROUNDING_DEG))
    return np.where(stated[:, 1, None, None], turned, axes), fits


def turns(config: Sequence[float], nominal: Sequence[float], corrected: Sequence[float]) -> list[int | None]:
    """As `RobotDialect.turns_of`. One that did not say where the axes are stays."""
    own = int(config[1])
    says = all((-value if own >> k & 1 else value) > -_ROUNDING_DEG for k, value in enumerate(nominal))
    new = own & ~((1 << _AXES) - 1)
    for k, (before, value) in enumerate(zip(nominal, corrected, strict=True)):
        # what is rounding in the text stays, where the axis stays
        stays = (value < 0.0) == (before < 0.0) and abs(value) < _ROUNDING_DEG
        new |= own & 1 << k if stays else (value < 0.0) << k
    return [new if says and new != own else None]
