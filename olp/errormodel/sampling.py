"""How finely a move has to be sampled so that nothing of the error is missed."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from olp.errormodel.base import Array, ErrorModel

MOST_STEPS = 1 << 18


def steps_needed(
    model: ErrorModel, delta_mm: Array, tool_mm: Array, bend_mm: float, *, at_least: int = 1, at_most: int = MOST_STEPS
) -> npt.NDArray[np.int64]:
    """(n,) equal steps of each straight move by `delta_mm` (n, 3) such that the error bends by less than `bend_mm`
    within one; `at_least` times a power of two."""
    count = np.full(len(delta_mm), at_least, np.int64)
    todo = np.arange(len(delta_mm))
    while todo.size:
        tool = tool_mm if tool_mm.ndim == 1 else tool_mm[todo]
        bends = model.chord_bound(delta_mm[todo] / count[todo, None], tool) > bend_mm
        todo = todo[bends & (count[todo] < at_most)]
        count[todo] *= 2
    return count
