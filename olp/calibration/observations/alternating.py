"""Runs that are all stated as taken in one direction, though every other one reads higher, as on the way
back."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from olp.calibration.observations.base import Observation, unit_of
from olp.calibration.observations.lines import Line
from olp.findings.catalogue import Finding

#: Fewer runs than this do not show whether they alternate.
_FEWEST = 5
#: Runs alternate where chance explains it with less than this probability.
_UNLIKELY = 5e-3
#: A smaller difference than so many standard deviations of a reading harms little.
_LARGE = 3.0


def alternating_findings(observations: Sequence[Observation]) -> Iterator[Finding]:
    """A finding for each line of one direction whose runs are as those of two."""
    for taken in observations:
        if isinstance(taken, Line) and (off := _alternation(taken)) is not None:
            unit, scale = unit_of(taken.component)
            side = "forward" if taken.direction[0] > 0 else "backward"
            yield Finding(
                "OLP815",
                f"{taken.source}: all runs are {side} ones, but every other one reads "
                f"{abs(off) * scale:.2g} {unit} {'more' if off > 0.0 else 'less'}",
            )


def _alternation(line: Line) -> float | None:
    """By how much the second, fourth and so on read more than the other runs, mm or rad, beside a steady
    drift. None where runs do not alternate, or have not all the same targets in one direction."""
    from scipy.stats import t

    runs = list(dict.fromkeys(line.run.tolist()))
    targets, place = np.unique(line.target_mm, return_inverse=True)
    if (
        len(runs) < _FEWEST
        or len(np.unique(line.direction)) > 1
        or len(line.value) != len(runs) * len(targets)
    ):
        return None
    means = np.array([line.value[line.run == run].mean() for run in runs])
    rest = line.value - (np.bincount(place, line.value) / np.bincount(place))[place]
    number = np.arange(len(runs), dtype=float)
    table = np.stack([np.ones(len(runs)), number, np.where(number % 2.0, 0.5, -0.5)], axis=1)
    coefficients = np.linalg.lstsq(table, means, rcond=None)[0]
    free = len(runs) - table.shape[1]
    square = float(np.sum((means - table @ coefficients) ** 2)) / free
    sigma = float(np.sqrt(square * np.linalg.inv(table.T @ table)[2, 2]))
    off = float(coefficients[2])
    # what runs share is no noise of single readings
    within = np.concatenate([rest[line.run == run] - rest[line.run == run].mean() for run in runs])
    if abs(off) < _LARGE * float(np.sqrt(np.mean(within**2))):
        return None
    return off if 2.0 * float(t.sf(abs(off) / max(sigma, 1e-300), free)) < _UNLIKELY else None
