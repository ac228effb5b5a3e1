"""Which posture of an arm a robtarget names: quarters of axes 1, 4 and 6, and the number of the branch."""

from __future__ import annotations

from collections.abc import Sequence
from math import floor

import numpy as np

from olp.core.arrays import Array, Mask

#: Axes whose quarters are stated, by column.
_STATED = (0, 3, 5)
_QUARTER_DEG = 90.0
#: deg beyond the end of a quarter that are rounding of the text
_ROUNDING_DEG = 0.01
#: The bit of cfx that is set where a branch is not positive, by the column of `Arm.branches`.
_BITS = (4, 2, 1)
#: Branches that are nearer to their border than this, mm or deg, are on both sides.
_BORDER = 0.01


def fitting(config: Array, axes: Array, branches: Array) -> tuple[Array, Mask]:
    """As `RobotDialect.fitting`."""
    values, fits = axes.copy(), np.isfinite(axes[:, :, 0])
    for place, column in enumerate(_STATED):
        low = _QUARTER_DEG * config[:, place, None] - _ROUNDING_DEG
        turned = axes[:, :, column] + 360.0 * np.ceil((low - axes[:, :, column]) / 360.0)
        values[:, :, column] = turned
        high = low + _QUARTER_DEG + 2.0 * _ROUNDING_DEG
        fits &= np.isnan(turned) | (turned <= high)
    number = config[:, 3].astype(np.int64)
    for place, bit in enumerate(_BITS):
        behind = (number & bit != 0)[:, None]
        branch = branches[:, :, place]
        fits &= (np.abs(branch) < _BORDER) | ((branch < 0.0) == behind)
    return values, fits


def turns(config: Sequence[float], nominal: Sequence[float], corrected: Sequence[float]) -> list[int | None]:
    """As `RobotDialect.turns_of`. One that did not say where the axis is stays."""
    found: list[int | None] = []
    for place, column in enumerate(_STATED):
        own, now = float(config[place]), float(nominal[column]) / _QUARTER_DEG
        rounding = _ROUNDING_DEG / _QUARTER_DEG
        says = own - rounding <= now <= own + 1.0 + rounding
        there = float(corrected[column]) / _QUARTER_DEG
        new = floor(there)
        # what is rounding in the text stays, where the axis stays
        stays = new == floor(now) and own - rounding <= there <= own + 1.0 + rounding
        found.append(new if says and new != own and not stays else None)
    return found
