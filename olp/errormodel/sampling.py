"""How finely a move has to be sampled so that nothing of the error is missed."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from olp.errormodel.base import Array, ErrorModel

MOST_STEPS = 1 << 18


def steps_needed(
    model: ErrorModel,
    delta_mm: Array,
    tool_mm: Array,
    bend_mm: float,
    *,
    at_least: int = 1,
    at_most: int = MOST_STEPS,
) -> npt.NDArray[np.int64]:
    """(n,) equal steps of each straight move by `delta_mm` (n, 3) such that the error bends by less than
    `bend_mm` within one; `at_least` times a power of two."""
    count = np.full(len(delta_mm), at_least, np.int64)
    todo = np.arange(len(delta_mm))
    while todo.size:
        tool = tool_mm if tool_mm.ndim == 1 else tool_mm[todo]
        some = delta_mm if len(todo) == len(delta_mm) and at_least == 1 and count[0] == 1 else None
        bound = model.chord_bound(delta_mm[todo] / count[todo, None] if some is None else some, tool)
        bends = np.flatnonzero((bound > bend_mm) & (count[todo] < at_most))
        todo = todo[bends]
        # a bend goes with the square of the length, or slower: so many halvings are needed at the least
        halvings = np.maximum(np.ceil(0.5 * np.log2(bound[bends] / bend_mm)), 1).astype(np.int64)
        count[todo] = np.minimum(count[todo] << halvings, at_most)
    return count
