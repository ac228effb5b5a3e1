"""Which posture of an arm a position of a TP program names: three letters, and turns of axes 1, 4, 6."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np

from olp.core.arrays import Array, Mask
from olp.core.patterns import pattern
from olp.program.robots.targets import Span

_CONFIG = pattern(rb"\s*([NF])\s*([UD])\s*([TB])\s*,\s*([-+]?\d+)\s*,\s*([-+]?\d+)\s*,\s*([-+]?\d+)\s*")
#: Axes whose turns are stated, by column.
_TURNED = (0, 3, 5)
#: Letters that stand for a branch above zero, and the branch (column of `Arm.branches`).
_LETTERS = ((b"N", 3), (b"U", 1), (b"T", 0))
#: Branches that are nearer to their border than this, mm or deg, are on both sides.
_BORDER = 0.01
#: Configurations whose words are kept: a program has few.
_KEPT = 256
#: deg beyond half a turn that are rounding of the text
_ROUNDING_DEG = 0.01


@functools.lru_cache(maxsize=_KEPT)
def words_of(text: bytes) -> tuple[tuple[float, ...], tuple[Span, ...]]:
    """The words of a configuration, 1 for N, U and T, and the bytes of its turns. NaN where it is in another
    form."""
    match = _CONFIG.fullmatch(text)
    if match is None:
        return (np.nan,) * 6, ()
    letters = [float(match[k + 1].upper() == letter) for k, (letter, _) in enumerate(_LETTERS)]
    return (*letters, *(float(match[k]) for k in (4, 5, 6))), tuple(match.span(k) for k in (4, 5, 6))


def fitting(config: Array, axes: Array, branches: Array) -> tuple[Array, Mask]:
    """As `RobotDialect.fitting`. Behind the first axis what U and D say of the elbow is not known, so that
    both fit."""
    values, fits = axes.copy(), np.isfinite(axes[:, :, 0])
    unstated = np.isnan(config[:, :1])
    for place, (_, column) in enumerate(_LETTERS):
        branch = branches[:, :, column]
        fits &= (
            unstated
            | (np.abs(branch) < _BORDER)
            | ((branch > 0.0) == (config[:, place, None] == 1.0))
            | ((column == 1) & (config[:, 2:3] == 0.0))
        )
    for place, column in enumerate(_TURNED):
        values[:, :, column] += 360.0 * np.nan_to_num(config[:, 3 + place, None])
    return values, fits


def turns(config: Sequence[float], nominal: Sequence[float], corrected: Sequence[float]) -> list[int | None]:
    """As `RobotDialect.turns_of`. One that did not say where the axis is stays."""
    found: list[int | None] = []
    for place, column in enumerate(_TURNED):
        own = int(config[3 + place])
        says = abs(nominal[column] - 360.0 * own) <= 180.0 + _ROUNDING_DEG
        new = round(corrected[column] / 360.0)
        # what is rounding in the text stays, where the axis stays
        stays = new == round(nominal[column] / 360.0)
        stays &= abs(corrected[column] - 360.0 * own) <= 180.0 + _ROUNDING_DEG
        found.append(new if says and new != own and not stays else None)
    return found
