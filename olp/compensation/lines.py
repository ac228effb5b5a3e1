"""Subdivision of straight moves: the fewest chords whose actual path stays at the nominal line.

Between two corrected points the tip follows the line plus what the error departs from its own chord.
Only the part across the line counts: along it the tip is early or late, but on the path. Moves that the
model's bound clears are never sampled; the others are sampled finely, and cut greedily, each chord as
long as it can be.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from olp.compensation.invert import bent
from olp.errormodel import ErrorModel
from olp.errormodel.base import Array, Mask
from olp.errormodel.sampling import steps_needed
from olp.toolpath import Toolpath

Index = npt.NDArray[np.int64]
Cuts = tuple[Index, Array, Array]

#: between two samples the error bends by less than this share of the tolerance
_SAMPLE_SHARE = 0.04
#: chords may end at this many places between two samples, where the error is as good as straight
_FINE = 4
_BATCH = 1 << 15
_FEW, _ALL = 16, 1 << 30


def no_cuts() -> Cuts:
    return np.zeros(0, np.int64), np.zeros(0), np.zeros((0, 3))


def subdivide_lines(path: Toolpath, model: ErrorModel, target: Array, free: Mask, tolerance: float) -> Cuts:
    """Cuts (move, share, target) of the moves that are `free` to be split, so that no chord leaves its line
    by more than `tolerance` mm."""
    tools = path.tool_mm()
    found: list[tuple[Index, Array, Array]] = []
    block = 1 << 16
    for a in range(0, len(path), block):
        b = min(a + block, len(path))
        start = np.zeros((b - a, 3))
        start[1:] = target[a : b - 1]
        start[0] = target[a - 1] if a else np.array(path.start_mm)
        delta = target[a:b] - start
        bound = model.chord_bound(np.nan_to_num(delta), tools if tools.ndim == 1 else tools[a:b])
        long = np.flatnonzero(free[a:b] & (bound > tolerance) & np.isfinite(delta).all(axis=1))
        if long.size:
            found.append((a + long, start[long], delta[long]))
    if not found:
        return no_cuts()
    move, start, delta = (np.concatenate([f[i] for f in found]) for i in range(3))
    return _cut(model, move, start, delta, tools if tools.ndim == 1 else tools[move], tolerance)


def _cut(model: ErrorModel, move: Index, start: Array, delta: Array, tool: Array, tolerance: float) -> Cuts:
    count = steps_needed(model, delta, tool, _SAMPLE_SHARE * tolerance, at_least=8)
    parts: list[Cuts] = []
    at = 0
    totals = np.cumsum(count + 1)
    while at < len(move):
        stop = max(int(np.searchsorted(totals, (totals[at - 1] if at else 0) + _BATCH)), at + 1)
        pick = slice(at, stop)
        parts.append(
            _cut_batch(
                model, move[pick], start[pick], delta[pick], tool if tool.ndim == 1 else tool[pick],
                count[pick], tolerance,
            )
        )  # fmt: skip
        at = stop
    return (
        np.concatenate([p[0] for p in parts]),
        np.concatenate([p[1] for p in parts]),
        np.concatenate([p[2] for p in parts]),
    )


def _cut_batch(
    model: ErrorModel, move: Index, start: Array, delta: Array, tool: Array, count: Index, tolerance: float
) -> Cuts:
    first = np.concatenate(([0], np.cumsum(count + 1)[:-1]))
    owner = np.repeat(np.arange(len(move)), count + 1)
    share = (np.arange(len(owner)) - first[owner]) / count[owner]
    point = start[owner] + share[:, None] * delta[owner]
    tools = tool if tool.ndim == 1 else tool[owner]
    play = np.sign(delta)[owner] if model.lost_motion_mm(point[:1]) is not None else None
    error = point - bent(model, point, tools, play)
    length2 = np.maximum((delta * delta).sum(axis=1), 1e-30)
    along = (error * delta[owner]).sum(axis=1) / length2[owner]
    across = _finer(error - along[:, None] * delta[owner], first, count)
    count = count * _FINE
    first = np.concatenate(([0], np.cumsum(count + 1)[:-1]))
    cut_move, cut_share = [], []
    begin = np.zeros(len(move), np.int64)
    active = np.arange(len(move))
    stride = count.copy()
    while active.size:
        where = (first[active], begin[active], count[active], stride[active])
        reach = _longest(across, *where, tolerance, _FEW)
        # the search looks at few samples of a long chord; what it found is tested at all of them
        wrong = np.flatnonzero(~_fits(across, where[0] + where[1], reach - where[1], tolerance, _ALL))
        if wrong.size:
            reach[wrong] = _longest(
                across, where[0][wrong], where[1][wrong], where[2][wrong], where[3][wrong], tolerance, _ALL
            )
        stride[active] = np.maximum(reach - begin[active], 1)
        begin[active] = reach
        going = reach < count[active]
        active = active[going]
        cut_move.append(active)
        cut_share.append(begin[active])
    owner = np.concatenate(cut_move)
    node = np.concatenate(cut_share)
    share = node / count[owner]
    return move[owner], share, start[owner] + share[:, None] * delta[owner]


def _finer(across: Array, first: Index, count: Index) -> Array:
    """Samples with linear ones between them, move by move."""
    inner = np.ones(len(across), bool)
    inner[first + count] = False
    at = np.flatnonzero(inner)
    step = across[at + 1] - across[at]
    fine = np.arange(_FINE) / _FINE
    between = across[at][:, None, :] + fine[:, None] * step[:, None, :]
    out = np.zeros((len(at) * _FINE + len(first), 3))
    last = np.cumsum(count * _FINE + 1) - 1
    keep = np.ones(len(out), bool)
    keep[last] = False
    out[keep] = between.reshape(-1, 3)
    out[last] = across[first + count]
    return out


def _longest(
    across: Array, first: Index, begin: Index, last: Index, stride: Index, tolerance: float, most: int
) -> Index:
    """For each move the farthest sample that one chord from `begin` reaches: gallop, then bisect."""
    good = begin + 1
    bad = last + 1
    trial = np.minimum(begin + np.maximum(stride, 1), last)
    todo = np.arange(len(first))
    galloping = np.ones(len(first), bool)
    while todo.size:
        fits = _fits(across, first[todo] + begin[todo], trial[todo] - begin[todo], tolerance, most)
        yes, no = todo[fits], todo[~fits]
        good[yes] = np.maximum(good[yes], trial[yes])
        bad[no] = np.minimum(bad[no], trial[no])
        galloping[no] = False
        todo = todo[(bad[todo] - good[todo] > 1) & (good[todo] < last[todo])]
        jump = good[todo] + np.maximum(good[todo] - begin[todo], 1)
        middle = (good[todo] + np.minimum(bad[todo], last[todo] + 1)) // 2
        trial[todo] = np.where(
            galloping[todo], np.minimum(jump, last[todo]), np.maximum(middle, good[todo] + 1)
        )
        trial[todo] = np.minimum(trial[todo], np.minimum(bad[todo] - 1, last[todo]))
        ended = trial[todo] <= good[todo]
        todo = todo[~ended]
    return np.minimum(good, last)


def _fits(across: Array, start: Index, steps: Index, tolerance: float, most: int) -> Mask:
    """Whether the samples between start and start + steps, `most` of them at the most, stay within tolerance
    of their chord."""
    fits = np.ones(len(start), bool)
    wide = np.flatnonzero(steps > 1)
    limit = 1 << 21
    at = 0
    # between two samples of the model the error is taken as straight, so its own samples are enough
    looked = np.minimum(steps[wide] - 1, np.minimum(np.maximum(steps[wide] // _FINE, _FEW), most))
    totals = np.cumsum(looked)
    while at < len(wide):
        stop = max(int(np.searchsorted(totals, (totals[at - 1] if at else 0) + limit)), at + 1)
        rows = wide[at:stop]
        inner = looked[at:stop]
        offset = np.concatenate(([0], np.cumsum(inner)[:-1]))
        owner = np.repeat(np.arange(len(rows)), inner)
        k = (np.arange(len(owner)) - offset[owner] + 1) * steps[rows][owner] // (inner + 1)[owner]
        a, b = across[start[rows]], across[start[rows] + steps[rows]]
        u = (k / steps[rows][owner])[:, None]
        departure = across[start[rows][owner] + k] - (a[owner] + u * (b - a)[owner])
        size = np.sqrt((departure * departure).sum(axis=1))
        fits[rows] = np.maximum.reduceat(size, offset) <= tolerance
        at = stop
    return fits
