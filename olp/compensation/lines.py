"""Subdivision of straight moves: the fewest chords whose actual path follows the nominal line.

Between two corrected points the tip follows the line plus the departure of the error from its own chord.
Only the part across the line counts: along it the tip is early or late, but on the path. Moves that the
model's bound clears are never sampled. The others are sampled finely and cut greedily: each chord is as
long as it can be.
"""

from __future__ import annotations

import numpy as np

from olp.compensation.invert import BLOCK, lag
from olp.core.arrays import Array, Index, Mask, all_in_row, distinct
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
#: samples of a chord that the search tests, and that are tested together
_FEW = 16
#: (_FEW, 1) the middles of equal parts of a chord, in parts
_MIDDLES = (np.arange(_FEW) + 0.5)[:, None]
#: chords that are tested together, so that their samples fit in the second-level cache
_CHORDS = 1024


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
    for steps in distinct(count).tolist():
        alike = np.flatnonzero(count == steps)
        size = max(_BATCH // (steps + 1), 1)
        for a in range(0, len(alike), size):
            some = alike[a : a + size]
            own = tool if tool.ndim == 1 else tool[some]
            parts.append(_cut_alike(model, move[some], start[some], delta[some], own, steps, tolerance))
    return (
        np.concatenate([p[0] for p in parts]),
        np.concatenate([p[1] for p in parts]),
        np.concatenate([p[2] for p in parts]),
    )


def _cut_alike(
    model: ErrorModel, move: Index, start: Array, delta: Array, tool: Array, steps: int, tolerance: float
) -> Cuts:
    """The cuts of moves that are sampled at as many equal steps."""
    across = _across(model, start, delta, tool, steps)
    first = np.arange(len(move)) * (steps + 1)
    last = steps * _FINE
    cut_move, cut_place = [], []
    begin = np.zeros(len(move), np.int64)
    active = np.arange(len(move))
    stride = np.full(len(move), last)
    while active.size:
        reach = _longest(across, first[active], begin[active], last, stride[active], tolerance)
        # the search tests few samples of a long chord; its result is tested at all of them
        long = np.flatnonzero(reach - begin[active] > _FINE * _FEW)
        some = active[long]
        at_begin = _between(across, first[some], begin[some])
        wrong = long[~_fits(across, first[some], begin[some], at_begin, reach[long], tolerance, every=True)]
        if wrong.size:
            again = active[wrong]
            reach[wrong] = _longest(
                across, first[again], begin[again], last, stride[again], tolerance, every=True
            )
        stride[active] = np.maximum(reach - begin[active], 1)
        begin[active] = reach
        active = active[reach < last]
        cut_move.append(active)
        cut_place.append(begin[active])
    owner = np.concatenate(cut_move)
    share = np.concatenate(cut_place) / last
    return move[owner], share, start[owner] + share[:, None] * delta[owner]


def _across(model: ErrorModel, start: Array, delta: Array, tool: Array, steps: int) -> Array:
    """(2, n (steps + 1)) how far the commands bend from lines (n, 3), in two directions across each, at the
    samples of one line after the other."""
    samples = steps + 1
    share = np.arange(samples) / steps
    across = np.zeros((2, len(delta), samples))
    sides = _sides(delta)
    # so many lines that their samples stay in the cache
    size = max(BLOCK // samples, 1)
    for a in range(0, len(delta), size):
        some = slice(a, a + size)
        shape = len(delta[some]), samples
        path = np.empty((3, *shape))
        for column, begin, course in zip(path, start[some].T, delta[some].T, strict=True):
            np.multiply(course[:, None], share, out=column)
            column += begin[:, None]
        point = path.reshape(3, -1).T
        tools = tool if tool.ndim == 1 else np.repeat(tool[some], samples, axis=0)
        play = None
        if model.backlash_at(point[:1]) is not None:
            play = np.repeat(np.sign(delta[some]), samples, axis=0)
        departure = lag(model, point, tools, play)
        for axis in range(3):
            away = departure[:, axis].reshape(shape)
            for column, side in zip(across[:, some], sides, strict=True):
                column += away * side[some, axis, None]
    return across.reshape(2, -1)


def _sides(delta: Array) -> tuple[Array, Array]:
    """Two directions (n, 3) across each of lines `delta` (n, 3), and across one another."""
    along = delta / np.sqrt((delta * delta).sum(axis=1))[:, None]
    least = np.zeros_like(along)
    least[np.arange(len(along)), np.abs(along).argmin(axis=1)] = 1.0
    one = np.cross(along, least)
    one /= np.sqrt((one * one).sum(axis=1))[:, None]
    return one, np.cross(along, one)


def _longest(
    across: Array, first: Index, begin: Index, last: int, stride: Index, tolerance: float,
    *, every: bool = False,
) -> Index:  # fmt: skip
    """For each move the farthest position that one chord from `begin` reaches: gallop, then bisect, to 3 % of
    the chord."""
    good = begin + 1
    bad = np.full(len(first), last + 1)
    at_begin = _between(across, first, begin)
    trial = np.minimum(begin + np.maximum(stride, 1), last)
    todo = np.arange(len(first))
    galloping = np.ones(len(first), bool)
    while todo.size:
        fits = _fits(across, first[todo], begin[todo], at_begin[:, todo], trial[todo], tolerance, every=every)
        yes, no = todo[fits], todo[~fits]
        good[yes] = trial[yes]
        bad[no] = trial[no]
        galloping[no] = False
        known, length = good[todo], good[todo] - begin[todo]
        todo = todo[(bad[todo] - known > 1 + length // _CLOSE) & (known < last)]
        known, ahead = good[todo], np.minimum(bad[todo] - 1, last)
        jump = known + (known - begin[todo])
        middle = np.maximum((known + ahead + 1) // 2, known + 1)
        trial[todo] = np.minimum(np.where(galloping[todo], jump, middle), ahead)
    return good


def _fits(
    across: Array, first: Index, begin: Index, at_begin: Array, end: Index, tolerance: float, *, every: bool
) -> Mask:
    """Whether samples between the positions `begin` and `end` are within tolerance of their chord: `every`
    one, or _FEW of them. `at_begin` (2, n) are the values where it begins."""
    fits = np.ones(len(begin), bool)
    low = begin // _FINE + 1
    inner = (end - 1) // _FINE + 1 - low
    wide = np.flatnonzero(inner > 0)
    if not wide.size:
        return fits
    if wide.size < len(begin):
        first, begin, end, low, inner = (column.take(wide) for column in (first, begin, end, low, inner))
        at_begin = at_begin.take(wide, axis=1)
    # the chord at the first sample, and from each sample to the next
    per_sample = _FINE / (end - begin)
    ahead = (_FINE * low - begin) / (end - begin)
    rise = _between(across, first, end) - at_begin
    chord = np.vstack((at_begin + ahead * rise, per_sample * rise))
    sample, last, before, step = first + low, inner - 1.0, np.zeros(len(inner)), np.maximum(inner / _FEW, 1.0)
    if every:
        # those of a long chord in parts
        parts = -(-inner // _FEW)
        head = np.cumsum(parts) - parts
        of = np.repeat(np.arange(len(inner)), parts)
        sample, last, before = sample[of], last[of], _FEW * (np.arange(len(of)) - head[of])
        chord, step = chord.take(of, axis=1), np.ones(len(of))
    square = np.empty(len(sample))
    for a in range(0, len(sample), _CHORDS):
        some = slice(a, a + _CHORDS)
        # from each of equal parts the one in its middle; one that is looked at twice changes nothing
        nth = np.asarray(_MIDDLES * step[some], float)
        nth += before[some]
        np.floor(nth, out=nth)
        np.minimum(nth, last[some], out=nth)
        square[some] = _largest_square(across, sample[some], chord[:, some], nth)
    fits[wide] = (np.maximum.reduceat(square, head) if every else square) <= tolerance * tolerance
    return fits


def _largest_square(across: Array, sample: Index, chord: Array, nth: Array) -> Array:
    """(n,) the largest square of a distance from each chord among samples `nth` (k, n) behind `sample` (n,).
    `chord` (4, n): both values of the chord at that one, and how much they rise to the next."""
    number = nth.astype(np.int64)
    number += sample
    square = np.zeros(nth.shape)
    for values, begin, rise in zip(across, chord[:2], chord[2:], strict=True):
        departure = rise * nth
        departure += begin
        departure -= values.take(number)
        departure *= departure
        square += departure
    return np.asarray(square.max(axis=0))


def _between(across: Array, first: Index, place: Index) -> Array:
    """(2, n) values at positions of moves whose samples begin at `first`, linear between two samples."""
    whole = place // _FINE
    part = place - _FINE * whole
    sample = first + whole
    value = across.take(sample, axis=1)
    return np.asarray(value + (across.take(sample + (part > 0), axis=1) - value) * (part / _FINE))
