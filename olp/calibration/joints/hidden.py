"""Mistakes in what was read that a fit of readings does not exclude, though these fit well as they are.

Unknowns can take up a mistake: the other sign of an R-test is that of all errors, but for what errors do to
each other. One linear step from the fit shows which mistakes are worth a fit of their own.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from olp.calibration.estimator.normal import Normal
from olp.calibration.joints.adjustment import JointFit, adjusted, block_of, frame_of, left_of, starts_of
from olp.calibration.joints.deciding import UNLIKELY, log_odds
from olp.calibration.joints.mistakes import Mended, closer, mistakes
from olp.calibration.joints.readings import Reading
from olp.core.arrays import Array
from olp.core.errors import CannotCompute, ConfigError
from olp.core.values import dataclass

#: What one step makes of readings that are put right is known to this factor of chi-square.
_ROUGHLY = 2.0
#: Log odds from which on a mistake is not excluded: the readings speak against it by less than 100 to 1.
_OPEN = UNLIKELY - math.log(100.0)
#: Steps within which readings put right settle.
_QUICK = 7


@dataclass(frozen=True, slots=True, eq=False)
class Hidden:
    """A mistake that readings do not exclude: in words, the log of its odds, and the fit of the readings put
    right. `harm_mm` is by how much tips at these postures are elsewhere then, at most, in the best frame."""

    words: str
    odds: float
    fit: JointFit
    harm_mm: float


def hidden(fit: JointFit) -> list[Hidden]:
    """The mistakes in what was read that the readings which a fit has used do not exclude."""
    readings, found = [source.start.reading for source in fit.sources], []
    for words, mended, _ in _near(fit, readings, tuple(mistakes(fit.model.structure, readings))):
        try:
            other = adjusted(fit.model, starts_of(fit.model, mended), _QUICK)
        except (CannotCompute, ConfigError):
            continue
        odds = log_odds(fit.score, other.score, other.chi_square / other.freedom) + closer(readings, mended)
        if odds > _OPEN:
            found.append(Hidden(words, odds, other, _harm(fit, other, readings)))
    return found


def _harm(fit: JointFit, other: JointFit, readings: Sequence[Reading]) -> float:
    most = 0.0
    for reading in readings:
        places = [
            one.model.machine(one.theta, reading.payload).actual(reading.values).at(np.array(reading.tool_mm))
            for one in (fit, other)
        ]
        frame, _ = frame_of(places[0])
        rest, _ = left_of((places[1] - places[0])[:, :, None], frame)
        most = max(most, float(np.linalg.norm(rest[:, :, 0], axis=1).max()))
    return most


def _near(fit: JointFit, readings: Sequence[Reading], offers: Sequence[Mended]) -> Iterator[Mended]:
    """Those of some mistakes in what was read at the same postures that may explain the readings of a fit as
    well as these explain themselves. The rest is not worth a fit."""
    twists = [fit.model.twists(fit.theta, one.values, one.payload) for one in readings]
    as_read = [_normal(fit, one, own) for one, own in zip(readings, twists, strict=True)]
    most = _ROUGHLY * _least(fit, as_read)
    for offer in offers:
        pairs = list(zip(readings, offer[1], strict=True))
        if any(one.values is not other.values or one.payload != other.payload for one, other in pairs):
            continue
        try:
            changed = [
                own if other is one else _normal(fit, other, twist)
                for (one, other), own, twist in zip(pairs, as_read, twists, strict=True)
            ]
        except (CannotCompute, ConfigError, np.linalg.LinAlgError):
            continue
        if _least(fit, changed) < most:
            yield offer


def _normal(fit: JointFit, reading: Reading, twists: Array) -> Normal:
    """All readings of an instrument about the unknowns of a fit. Raises ConfigError and CannotCompute."""
    (start,) = starts_of(fit.model, [reading])
    normal = Normal.of(len(fit.theta))
    normal.add(block_of(fit.model, fit.theta, start, np.zeros(len(start.prior)), twists))
    return normal


def _least(fit: JointFit, normals: Sequence[Normal]) -> float:
    """Chi-square of readings and unknowns together, after one step."""
    right = np.sum([one.g for one in normals], axis=0)
    precision = np.sum([one.H for one in normals], axis=0) + fit.model.precision
    square = sum(one.square for one in normals)
    return float(square - right @ np.linalg.solve(precision, right))
