"""Which posture of an arm a pose in a `movej` of URScript names: that near joints (`get_inverse_kin`)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from olp.core.arrays import Array, Mask

#: Postures so much farther than the nearest one, deg and as a factor, are as near: how the control measures
#: is not stated.
_AS_NEAR_DEG = 1.0
_AS_NEAR = 2.0


def fitting(config: Array, axes: Array, branches: Array) -> tuple[Array, Mask]:
    """As `RobotDialect.fitting`. `config` are the six joints in degrees."""
    fits = np.isfinite(axes[:, :, 0])
    if config.shape[1] == 0:
        return axes, fits
    stated = np.asarray(np.isfinite(config).all(axis=1))[:, None]
    near = np.nan_to_num(config)[:, None, :]
    turned = axes + 360.0 * np.rint((near - axes) / 360.0)
    away = np.where(fits, np.abs(turned - near).max(axis=2), np.inf)
    limit = _AS_NEAR * away.min(axis=1, keepdims=True) + _AS_NEAR_DEG
    return np.where(stated[:, :, None], turned, axes), fits & (~stated | (away <= limit))


def turns(config: Sequence[float], nominal: Sequence[float], corrected: Sequence[float]) -> list[int | None]:
    """As `RobotDialect.turns_of`: no number says it."""
    return []
