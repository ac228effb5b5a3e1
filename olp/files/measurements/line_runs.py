"""The runs and directions of readings, where a file implies them by the order of its rows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from olp.core.arrays import Array, Index
from olp.files.problems import config_error


def columns_as_runs(target: Array, directions: Sequence[int]) -> tuple[Index, Index, Index, Index]:
    """For a table with one column per run: row and column of each reading in the order of time, its run from
    1 and its direction. Each direction counts its own runs. A run against the order of the file has its rows
    reversed."""
    signs = np.array(directions, np.int64)
    run = np.array([int((signs[: k + 1] == signs[k]).sum()) for k in range(len(signs))])
    upward = 1 if target[0] <= target[-1] else -1
    straight = np.arange(len(target))
    rows = np.concatenate([straight if sign == upward else straight[::-1] for sign in signs])
    column = np.repeat(np.arange(len(signs)), len(target))
    return rows, column, run[column], signs[column]


def turns(target: Array) -> Array:
    """(n,) how often the sequence of targets has turned back before each row."""
    last, counts, count = 0.0, [0], 0
    for sign in np.sign(np.diff(target)).tolist():
        # A repeated target, as after an overrun at the end of a run, begins the return.
        if last and sign != last:
            count += 1
            last = 0.0
        elif sign:
            last = sign
        counts.append(count)
    return np.array(counts, float)


def trend(target: Array, run: Array, line: Index, file: str) -> Index:
    """(n,) +1 or -1: whether the targets of each run rise or fall. Raises ConfigError where they do
    neither."""
    direction = np.zeros(len(target), np.int64)
    for value in np.unique(run):
        rows = np.flatnonzero(run == value)
        steps = np.diff(target[rows])
        if not len(steps) or not ((steps > 0).all() or (steps < 0).all()):
            sentence = (
                "the targets of the run that begins here neither rise nor fall throughout; name a direction "
                'column, or another value of runs ("reversal", "blank-line")'
            )
            raise config_error([(int(line[rows[0]]), sentence)], file)
        direction[rows] = 1 if steps[0] > 0 else -1
    return direction


def counted(block: Array, direction: Index) -> Index:
    """(n,) runs from 1. A forward and a backward run together are one bidirectional run."""
    run = np.zeros(len(block), np.int64)
    count = {1: 0, -1: 0}
    for value in dict.fromkeys(block.tolist()):
        for sign in (1, -1):
            rows = (block == value) & (direction == sign)
            if rows.any():
                count[sign] += 1
                run[rows] = count[sign]
    return run
