"""Which posture of an arm a point of VAL 3 names: shoulder, elbow and wrist."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Mask

#: Branches that are nearer to their border than this, mm or deg, are on both sides.
_BORDER = 0.01


def fitting(config: Array, axes: Array, branches: Array) -> tuple[Array, Mask]:
    """As `RobotDialect.fitting`: lefty has the wrist before the first axis. The elbow is positive where the
    third axis is, and the wrist where the fifth is, as the control counts them."""
    fits = np.isfinite(axes[:, :, 0])
    own = (branches[:, :, 0], axes[:, :, 2], axes[:, :, 4])
    for k, value in enumerate(own):
        stated = config[:, k, None]
        fits &= (np.abs(value) < _BORDER) | (value * stated > 0.0) | np.isnan(stated)
    return axes, fits
