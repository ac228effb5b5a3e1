"""The fewest chords that follow a nominal line, found greedily by bisection: each one as long as possible."""

from __future__ import annotations

from typing import Any

import numpy as np

from .model import JudgeModel


def longest_chords(
    begin_mm: Any,
    end_mm: Any,
    model: JudgeModel,
    tool_mm: Any,
    tolerance_mm: float,
    *,
    spacing_mm: float = 0.5,
) -> np.ndarray:
    """Fractions 0 < ... <= 1 of the ends of the chords on one straight target, axis positions in mm.

    The commands at the ends reach their target points exactly; between them the machine moves straight and
    the tip must stay within `tolerance_mm` of the target line.
    """
    begin, end = np.asarray(begin_mm, float), np.asarray(end_mm, float)
    length = float(np.linalg.norm(end - begin))
    along = (end - begin) / length

    def command(fraction: float) -> np.ndarray:
        return np.asarray(model.command_for((begin + fraction * (end - begin))[None], tool_mm)[0])

    def fits(first: np.ndarray, start: float, stop: float) -> bool:
        count = max(32, int(np.ceil((stop - start) * length / spacing_mm)))
        part = (np.arange(1, count) / count)[:, None]
        path = (1.0 - part) * first + part * command(stop)
        offset = path + model.error_mm(path, tool_mm) - begin
        return bool(np.linalg.norm(offset - np.outer(offset @ along, along), axis=1).max() <= tolerance_mm)

    ends, reached = [], 0.0
    while reached < 1.0:
        first, good, bad = command(reached), reached, 1.0
        if fits(first, reached, 1.0):
            good = 1.0
        else:
            while (bad - good) * length > max(1e-3 * (good - reached) * length, 1e-3):
                middle = 0.5 * (good + bad)
                good, bad = (middle, bad) if fits(first, reached, middle) else (good, middle)
            if good == reached:
                raise ValueError("no chord is within the tolerance")
        ends.append(good)
        reached = good
    return np.array(ends)


def chord_count(begin_mm: Any, end_mm: Any, model: JudgeModel, tool_mm: Any, tolerance_mm: float) -> int:
    """Number of chords of `longest_chords`."""
    return len(longest_chords(begin_mm, end_mm, model, tool_mm, tolerance_mm))
