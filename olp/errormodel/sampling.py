"""How finely a move has to be sampled so that nothing of the error is missed."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, distinct_rows
from olp.errormodel.base import ErrorModel

#: Steps of one move, at most.
MOST_STEPS = 1 << 18
#: mm; lengths that are tried for a move that needs no sample.
_LENGTHS = 2.0 ** np.arange(-12.0, 14.0, 0.25)


def clear_length_mm(model: ErrorModel, tools_mm: Array, bend_mm: float) -> float:
    """A length up to which the error bends by no more than `bend_mm` over a move, along each axis at once and
    with any of the tools (k, 3); 0 where there is none."""
    tools = distinct_rows(tools_mm)
    length = np.repeat(_LENGTHS, len(tools))
    bound = model.chord_bound(length[:, None] * np.ones(3), np.tile(tools, (len(_LENGTHS), 1)))
    short = np.flatnonzero(bound.reshape(-1, len(tools)).max(axis=1) > bend_mm)
    clear = int(short[0]) if short.size else len(_LENGTHS)
    return float(_LENGTHS[clear - 1]) if clear else 0.0


def longer(delta_mm: Array, length_mm: float) -> npt.NDArray[np.int64]:
    """Moves by `delta_mm` (n, 3) that are longer than that along an axis; unknown ones are not."""
    size = np.abs(delta_mm)
    return np.flatnonzero((size[:, 0] > length_mm) | (size[:, 1] > length_mm) | (size[:, 2] > length_mm))


def steps_needed(
    model: ErrorModel,
    delta_mm: Array,
    tool_mm: Array,
    bend_mm: float,
    *,
    at_least: int | Index = 1,
    at_most: int = MOST_STEPS,
) -> npt.NDArray[np.int64]:
    """(n,) equal steps of each straight move by `delta_mm` (n, 3) such that the error bends by less than
    `bend_mm` within one; `at_least`, which may be (n,), times a power of two."""
    count = np.full(len(delta_mm), at_least, np.int64)
    todo = np.arange(len(delta_mm))
    while todo.size:
        tool = tool_mm if tool_mm.ndim == 1 else tool_mm[todo]
        bound = model.chord_bound(delta_mm[todo] / count[todo, None], tool)
        bends = np.flatnonzero((bound > bend_mm) & (count[todo] < at_most))
        todo = todo[bends]
        # a bend goes with the square of the length, or slower: so many halvings (one or more) are needed
        halvings = np.ceil(0.5 * np.log2(bound[bends] / bend_mm)).astype(np.int64)
        count[todo] = np.minimum(count[todo] << halvings, at_most)
    return count
