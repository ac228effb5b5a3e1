"""Readings that are no readings: far outside the spread of their repetitions, or of all that fits."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from olp.calibration.estimator.normal import Block, Solved, residuals_of
from olp.calibration.observations.lengths import Lengths
from olp.calibration.observations.lines import Line, Noise, group_of, noise_of
from olp.calibration.observations.points import Points
from olp.core.arrays import Array

#: A reading whose residual is so many standard deviations is left out, at most this share of a line.
OUTLIER, SHARE = 6.0, 0.05
#: What stands for the component of a point and of a length.
POINT, LENGTH = "point", "length"
T = TypeVar("T", Points, Lengths)


@dataclass(frozen=True, slots=True)
class Outlier:
    """A reading left out: its file, the line there, and how many standard deviations it is off."""

    source: str
    row: int
    component: str
    value: float
    deviations: float


def screened(lines: Sequence[Line]) -> tuple[list[Line], list[Noise], list[Outlier]]:
    """Lines without the readings that their own repetitions speak against."""
    kept, noises, outliers = [], [], []
    for line in lines:
        noise = noise_of(line)
        use = np.ones(len(line.value), bool)
        for _ in range(max(1, int(SHARE * len(use)))):
            some = _part(line, use)
            noise = noise_of(some)
            rest = _about_group(some)
            worst = int(np.argmax(np.abs(rest)))
            if abs(rest[worst]) <= OUTLIER * noise.sigma:
                break
            k = int(np.flatnonzero(use)[worst])
            use[k] = False
            outliers.append(
                Outlier(
                    line.source, int(line.row[k]), line.component, float(line.value[k]),
                    float(abs(rest[worst]) / noise.sigma),
                )
            )  # fmt: skip
        kept.append(_part(line, use))
        noises.append(noise)
    return kept, noises, outliers


def slips_of(block: Block, cloud: Points | Lengths, solved: Solved) -> list[Outlier]:
    """Points or lengths whose residual is no noise, the worst ones first."""
    _, residual, sigma = residuals_of(block, solved.theta)
    rest = residual.reshape(len(cloud.row), -1)
    off = np.abs(residual / sigma).reshape(rest.shape).max(axis=1)
    kind = POINT if isinstance(cloud, Points) else LENGTH
    worst = np.argsort(-off)[: max(1, int(SHARE * len(off)))]
    return [
        Outlier(cloud.source, int(cloud.row[k]), kind, float(np.linalg.norm(rest[k])), float(off[k]))
        for k in worst.tolist()
        if off[k] > OUTLIER and off[k] > 0.3 * off.max()
    ]


def without(cloud: T, slips: Sequence[Outlier]) -> T:
    use = ~np.isin(cloud.row, [slip.row for slip in slips])
    names = {"axis_mm", "tool_mm", "measured_mm", "covariance_mm2", "length_mm", "sigma_mm", "row"}
    columns = {f.name: getattr(cloud, f.name) for f in dataclasses.fields(cloud) if f.name in names}
    kept = {name: column[use] for name, column in columns.items() if column is not None}
    return dataclasses.replace(cloud, **kept)


def _part(line: Line, use: np.ndarray) -> Line:
    if use.all():
        return line
    columns = ("target_mm", "value", "run", "direction", "row")
    return dataclasses.replace(line, **{name: getattr(line, name)[use] for name in columns})


def _about_group(line: Line) -> Array:
    """(n,) deviation from the others of the same target and direction, freed of the level of its run; zero
    where fewer than three were read."""
    group = group_of(line)
    rest = line.value.copy()
    for _ in range(3):
        for labels in (group, line.run - line.run.min()):
            rest -= _medians(rest, labels)[labels]
    counts = np.bincount(group)[group]
    return np.where(counts >= 3, rest, 0.0)


def _medians(values: Array, labels: np.ndarray) -> Array:
    """Median of the values of each label from 0."""
    ordered = values[np.lexsort((values, labels))]
    counts = np.bincount(labels)
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    last = len(ordered) - 1
    below, above = starts + np.maximum(counts - 1, 0) // 2, starts + counts // 2
    middle = 0.5 * (ordered[np.minimum(below, last)] + ordered[np.minimum(above, last)])
    return np.asarray(np.where(counts > 0, middle, 0.0))
