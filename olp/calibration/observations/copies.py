"""Readings that are there twice: copies of a file, of a run or of rows. Independent readings differ by noise,
so a copy is no second reading, and counting it as one states too small an uncertainty."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from olp.calibration.observations.base import Observation, Scattered
from olp.calibration.observations.lines import Line
from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.findings.catalogue import Finding

#: Fewer readings than this may agree to the last digit by chance.
_FEWEST = 5
#: Numbers of two files agree where they differ by less than this share: the rounding of other units.
_ALIKE = 1e-9


def refuse_copies(observations: Sequence[Observation]) -> Iterator[ConfigError]:
    """An error for each source that has all its readings from an earlier one, also with the other sign."""
    for first, second in combinations(observations, 2):
        one, other = (np.abs(_numbers(taken)) for taken in (first, second))
        if (
            type(first) is type(second)
            and one.shape == other.shape
            and len(one) >= _FEWEST
            and len(np.unique(one[:, -1])) >= _FEWEST
            and np.allclose(one, other, rtol=_ALIKE, atol=0.0)
        ):
            yield ConfigError(
                f"holds the same readings as {first.source}, number by number; expected each reading once, "
                "because a copy counts as a confirmation. Remove one of them",
                file=second.source or None,
            )


def repeated_findings(observations: Sequence[Observation]) -> Iterator[Finding]:
    """A finding for each source in which runs or rows are there twice."""
    for taken in observations:
        words = None
        if isinstance(taken, Line):
            words = _repeated_run(taken)
        elif isinstance(taken, Scattered):
            table = np.hstack([np.asarray(taken.tool_mm).reshape(len(taken.axis_mm), -1), _numbers(taken)])
            count = len(table) - len(np.unique(table, axis=0))
            words = f"{count} of {len(table)} rows repeat others" if count >= _FEWEST else None
        if words is not None:
            yield Finding("OLP814", f"{taken.source}: {words}")


def _repeated_run(line: Line) -> str | None:
    """The words on the first run that is another one again."""
    runs = {}
    for run, side in dict.fromkeys(zip(line.run.tolist(), line.direction.tolist(), strict=True)):
        rows = (line.run == run) & (line.direction == side)
        order = np.argsort(line.target_mm[rows])
        runs[run, side] = np.stack([line.target_mm[rows][order], line.value[rows][order]])
    for (first, one), (second, other) in combinations(runs.items(), 2):
        same = one.shape == other.shape and bool((one == other).all())
        if same and first[1] == second[1] and len(np.unique(one[1])) >= _FEWEST:
            return f"run {second[0]} ({second[1]:+d}) repeats run {first[0]}"
    return None


def _numbers(taken: Observation) -> Array:
    """(n, k) what was read at each place of an observation, the reading in the last column."""
    columns = [np.asarray(getattr(taken, name)) for name in taken.read_columns]
    if not columns:
        return np.zeros((0, 1))
    return np.hstack([column.reshape(len(column), -1) for column in columns])
