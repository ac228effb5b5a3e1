"""Which posture of an arm a position of INFORM names: six words of ///RCONF, in the order of the control.

Flip says how axis R is turned, not how B is bent: flip is within a quarter of a turn from zero. Then come the
lower arm, the rear side, and which of axes R, T and S are more than half a turn from zero.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from olp.core.arrays import Array, Mask

#: Words of a posture.
WORDS = 6
#: Axes whose turns are stated, by column, and the place of their word.
_TURNED = ((3, 3), (5, 4), (0, 5))
_R = 3
#: Branches that are nearer to their border than this, mm, are on both sides.
_BORDER = 0.01
#: deg beyond a border that are rounding of the text
_ROUNDING_DEG = 0.01


def words_of(value: bytes) -> tuple[float, ...]:
    """The words of a line ///RCONF; NaN where it is in another form."""
    parts = [part.strip() for part in value.split(b",")]
    if len(parts) < WORDS or any(part not in (b"0", b"1") for part in parts[:WORDS]):
        return (np.nan,) * WORDS
    return tuple(float(part) for part in parts[:WORDS])


def fitting(config: Array, axes: Array, branches: Array) -> tuple[Array, Mask]:
    """As `RobotDialect.fitting`. Behind the first axis what upper and lower say of the elbow is not known, so
    that both fit."""
    values, fits = axes.copy(), np.isfinite(axes[:, :, 0])
    for column, place in _TURNED:
        own = values[:, :, column]
        other = np.where(own > 0.0, own - 360.0, own + 360.0)
        values[:, :, column] = np.where(config[:, place, None] == 1.0, other, own)
    unstated = np.isnan(config[:, :1])
    # at a quarter of a turn both words fit, and where the wrist is straight
    r = 180.0 - (180.0 - values[:, :, _R]) % 360.0
    beside = np.isnan(r) | (np.abs(np.abs(r) - 90.0) < _ROUNDING_DEG)
    fits &= unstated | beside | (((r > -90.0) & (r <= 90.0)) == (config[:, :1] == 0.0))
    front = np.abs(branches[:, :, 0]) < _BORDER
    fits &= unstated | front | ((branches[:, :, 0] > 0.0) == (config[:, 2:3] == 0.0))
    upper = (np.abs(branches[:, :, 1]) < _BORDER) | (config[:, 2:3] == 1.0)
    fits &= unstated | upper | ((branches[:, :, 1] > 0.0) == (config[:, 1:2] == 0.0))
    return values, fits


def turned(
    config: Sequence[float], nominal: Sequence[float], corrected: Sequence[float]
) -> tuple[int, ...] | None:
    """The words of a corrected posture; None where they stay. One that did not say where its axis is stays,
    and so do those that a correction may not change."""
    if config[0] != config[0]:
        return None
    own = [int(word) for word in config]
    new = list(own)
    r, there = (180.0 - (180.0 - values[_R]) % 360.0 for values in (nominal, corrected))
    new[0] = _word(own[0], r, there, 90.0, _unflipped)
    for column, place in _TURNED:
        new[place] = _word(own[place], nominal[column], corrected[column], 180.0, _beyond)
    return None if new == own else tuple(new)


def _word(own: int, before: float, behind: float, border: float, says: Callable[[float], int]) -> int:
    """A word of an axis that goes from `before` to `behind`, deg. What is rounding in the text stays, where
    the axis stays."""
    told = says(before) == own or abs(abs(before) - border) < _ROUNDING_DEG
    stays = says(behind) == says(before) and abs(abs(behind) - border) < _ROUNDING_DEG
    return says(behind) if told and not stays else own


def _unflipped(degrees: float) -> int:
    """Whether an axis within half a turn is beyond a quarter."""
    return int(not -90.0 < degrees <= 90.0)


def _beyond(degrees: float) -> int:
    """Whether an axis is beyond half a turn."""
    return int(not -180.0 < degrees <= 180.0)
