"""Subdivision of straight moves: the fewest chords whose actual path follows the nominal line.

Between two corrected points the tip follows the line plus the departure of the error from its own chord.
Only the part across the line counts: along it the tip is early or late, but on the path. Moves that the
model's bound clears are never sampled. The others are sampled finely and cut greedily: each chord is as
long as it can be.
"""

from __future__ import annotations

import numpy as np

from olp.compensation.invert import bent
from olp.core.arrays import Array, Index, Mask, all_in_row
from olp.core.toolpath import Toolpath
from olp.errormodel.base import ErrorModel
from olp.errormodel.sampling import clear_length_mm, longer, steps_needed

Cuts = tuple[Index, Array, Array]

#: between two samples the error bends by less than this share of the tolerance
_SAMPLE_SHARE = 0.04
#: chords may end at so many positions per sample; between samples the error is practically straight
_FINE = 4
#: the search ends within 1/32 of the length of the longest chord
_CLOSE = 32
#: samples at a time, so that memory is small
_BATCH = 1 << 18
#: samples of a chord that the search tests, at most
_FEW = 16
#: all samples of a chord
_ALL = 1 << 30


def no_cuts() -> Cuts:
    return np.zeros(0, np.int64), np.zeros(0), np.zeros((0, 3))


def subdivide_lines(
    path: Toolpath, model: ErrorModel, begin: Array, target: Array, free: Mask, tolerance: float
) -> Cuts:
    """Cuts (move, share, target) of the moves that are `free` to be split, so that no chord leaves its line
    by more than `tolerance` mm. `begin` (3,) is the target before the first move."""
    tools = path.tool_mm()
    clear = clear_length_mm(model, path.tools_mm(), tolerance)
    bending: list[tuple[Index, Array, Array]] = []
    block = 1 << 16
    for a in range(0, len(path), block):
        b = min(a + block, len(path))
        start = np.zeros((b - a, 3))
        start[1:] = target[a : b - 1]
        start[0] = target[a - 1] if a else begin
        delta = target[a:b] - start
        long = longer(delta, clear)
        long = long[free[a:b][long] & all_in_row(np.isfinite(delta[long]))]
        bound = model.chord_bound(delta[long], tools if tools.ndim == 1 else tools[a + long])
        long = long[bound > tolerance]
        if long.size:
            bending.append((a + long, start[long], delta[long]))
    if not bending:
        return no_cuts()
    move, start, delta = (np.concatenate([f[i] for f in bending]) for i in range(3))
    return _cut(model, move, start, delta, tools if tools.ndim == 1 else tools[move], tolerance)


def _cut(model: ErrorModel, move: Index, start: Array, delta: Array, tool: Array, tolerance: float) -> Cuts:
    count = steps_needed(model, delta, tool, _SAMPLE_SHARE * tolerance, at_least=8)
    parts: list[Cuts] = []
    begin = 0
    totals = np.cumsum(count + 1)
    while begin < len(move):
        stop = max(int(np.searchsorted(totals, (totals[begin - 1] if begin else 0) + _BATCH)), begin + 1)
        pick = slice(begin, stop)
        parts.append(
            _cut_batch(
                model, move[pick], start[pick], delta[pick], tool if tool.ndim == 1 else tool[pick],
                count[pick], tolerance,
            )
        )  # fmt: skip
        begin = stop
    return (
        np.concatenate([p[0] for p in parts]),
        np.concatenate([p[1] for p in parts]),
        np.concatenate([p[2] for p in parts]),
    )


def _cut_batch(
    model: ErrorModel, move: Index, start: Array, delta: Array, tool: Array, count: Index, tolerance: float
) -> Cuts:
    samples = count + 1
    first = np.cumsum(samples) - samples
    owner = np.repeat(np.arange(len(move)), samples)
    share = (np.arange(len(owner)) - np.repeat(first, samples)) / np.repeat(count, samples)
    # a number repeated takes a third of the time of one looked up
    point = np.empty((len(owner), 3))
    for axis in range(3):
        column = np.repeat(delta[:, axis], samples)
        column *= share
        column += np.repeat(start[:, axis], samples)
        point[:, axis] = column
    tools = tool if tool.ndim == 1 else tool[owner]
    play = None
    if model.backlash_at(point[:1]) is not None:
        play = np.sign(delta).take(owner, axis=0)
    departure = point - bent(model, point, tools, play)
    across = np.zeros((2, len(owner)))
    sides = _sides(delta)
    for axis in range(3):
        away = departure[:, axis].copy()
        for column, side in zip(across, sides, strict=True):
            column += away * np.repeat(side[:, axis], samples)
    last = count * _FINE
    cut_move, cut_place = [], []
    begin = np.zeros(len(move), np.int64)
    active = np.arange(len(move))
    stride = last.copy()
    while active.size:
        reach = _longest(across, first[active], begin[active], last[active], stride[active], tolerance, _FEW)
        # the search tests few samples of a long chord; its result is tested at all of them
        long = np.flatnonzero(reach - begin[active] > _FINE * _FEW)
        some = active[long]
        at_begin = _between(across, first[some], begin[some])
        wrong = long[~_fits(across, first[some], begin[some], at_begin, reach[long], tolerance, _ALL)]
        if wrong.size:
            again = active[wrong]
            reach[wrong] = _longest(
                across, first[again], begin[again], last[again], stride[again], tolerance, _ALL
            )
        stride[active] = np.maximum(reach - begin[active], 1)
        begin[active] = reach
        active = active[reach < last[active]]
        cut_move.append(active)
        cut_place.append(begin[active])
    owner = np.concatenate(cut_move)
    share = np.concatenate(cut_place) / last[owner]
    return move[owner], share, start[owner] + share[:, None] * delta[owner]


def _sides(delta: Array) -> tuple[Array, Array]:
    """Two directions (n, 3) across each of lines `delta` (n, 3), and across one another."""
    along = delta / np.sqrt((delta * delta).sum(axis=1))[:, None]
    least = np.zeros_like(along)
    least[np.arange(len(along)), np.abs(along).argmin(axis=1)] = 1.0
    one = np.cross(along, least)
    one /= np.sqrt((one * one).sum(axis=1))[:, None]
    return one, np.cross(along, one)


def _longest(
    across: Array, first: Index, begin: Index, last: Index, stride: Index, tolerance: float, most: int
) -> Index:
    """For each move the farthest position that one chord from `begin` reaches: gallop, then bisect, to 3 % of
    the chord."""
    good = begin + 1
    bad = last + 1
    at_begin = _between(across, first, begin)
    trial = np.minimum(begin + np.maximum(stride, 1), last)
    todo = np.arange(len(first))
    galloping = np.ones(len(first), bool)
    while todo.size:
        fits = _fits(across, first[todo], begin[todo], at_begin[:, todo], trial[todo], tolerance, most)
        yes, no = todo[fits], todo[~fits]
        good[yes] = trial[yes]
        bad[no] = trial[no]
        galloping[no] = False
        known, length = good[todo], good[todo] - begin[todo]
        todo = todo[(bad[todo] - known > 1 + length // _CLOSE) & (known < last[todo])]
        known, ahead = good[todo], np.minimum(bad[todo] - 1, last[todo])
        jump = known + (known - begin[todo])
        middle = np.maximum((known + ahead + 1) // 2, known + 1)
        trial[todo] = np.minimum(np.where(galloping[todo], jump, middle), ahead)
    return good


def _fits(
    across: Array, first: Index, begin: Index, at_begin: Array, end: Index, tolerance: float, most: int
) -> Mask:
    """Whether the samples between the positions `begin` and `end`, at most `most` of them, are within
    tolerance of their chord. `at_begin` (2, n) are the values where it begins."""
    fits = np.ones(len(begin), bool)
    low = begin // _FINE + 1
    inner = (end - 1) // _FINE + 1 - low
    wide = np.flatnonzero(inner > 0)
    if not wide.size:
        return fits
    if wide.size < len(begin):
        first, begin, end, low, inner = (column.take(wide) for column in (first, begin, end, low, inner))
        at_begin = at_begin.take(wide, axis=1)
    looked = np.minimum(inner, most)
    ends = np.cumsum(looked)
    total, offset = int(ends[-1]), ends - looked
    # the nth sample behind the first one: all of them, or from each of equal parts the one in its middle
    nth = np.arange(0.5, total)
    nth -= np.repeat(offset.astype(float), looked)
    if total < int(inner.sum()):
        nth *= np.repeat(inner / looked, looked)
    np.floor(nth, out=nth)
    sample = nth.astype(np.int64)
    sample += np.repeat(first + low, looked)
    # the chord at the first sample, and from each sample to the next
    per_sample = _FINE / (end - begin)
    ahead = (_FINE * low - begin) / (end - begin)
    square = np.zeros(total)
    rise = _between(across, first, end) - at_begin
    for values, rises, begins in zip(across, per_sample * rise, at_begin + ahead * rise, strict=True):
        departure = np.repeat(rises, looked)
        departure *= nth
        departure += np.repeat(begins, looked)
        departure -= values.take(sample)
        departure *= departure
        square += departure
    fits[wide] = np.maximum.reduceat(square, offset) <= tolerance * tolerance
    return fits


def _between(across: Array, first: Index, place: Index) -> Array:
    """(2, n) values at positions of moves whose samples begin at `first`, linear between two samples."""
    whole = place // _FINE
    part = place - _FINE * whole
    sample = first + whole
    value = across.take(sample, axis=1)
    return np.asarray(value + (across.take(sample + (part > 0), axis=1) - value) * (part / _FINE))
