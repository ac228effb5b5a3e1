"""A run of corners and curves, divided where a rest costs less than one method for all of it.

Along a smooth path the speed has valleys at its corners. Between two valleys the overlapping solver may take
less time than the smooth path does. Neighbouring parts that the same solver drives faster stay together; the
others are parted by a rest. What each part then takes is planned, not estimated.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from olp.core.arrays import Array, Index
from olp.trajectory.merge import merged
from olp.trajectory.motion import Motion
from olp.trajectory.overlap import least_s
from olp.trajectory.route import Route
from olp.trajectory.same import groups_of_same
from olp.trajectory.solvers import Run

#: a valley is as slow as this share of the speed on both sides
_VALLEY = 0.6
#: a corner is near a rest within this times its tolerance
_NEAR = 4.0
#: cosine of the change of direction above which a corner is not sharp
_SHARP = 0.85
#: share of the time that dividing has to promise, as it takes as long as planning the whole
_GAIN = 0.005
#: waypoints of a run at most, for a short move at its end to matter
_FEW = 4096


def parts(run: Run, smooth: Motion, duration_s: float) -> list[tuple[int, int, bool]]:
    """First and last waypoint of the parts of a run, and whether the overlapping solver is faster there.
    `smooth` is the motion along the smooth path, `duration_s` the best time of the whole. Empty where
    dividing promises nothing."""
    waypoint, speed, peak = _speeds(smooth)
    valleys = waypoint[_valleys(speed, peak)]
    edges = np.concatenate(([0], valleys, [len(run.route) - 1]))
    if len(edges) < 3:
        return []
    spent = np.bincount(smooth.line, np.diff(smooth.start_s), len(run.route) - 1)
    straight = least_s(run.route, run.limits)
    gain = np.add.reduceat(spent, edges[:-1]) - np.add.reduceat(straight, edges[:-1])
    faster = gain > 0.0
    promised = float(spent.sum() - gain[faster].sum())
    if not faster.any() or faster.all() or promised > (1.0 - _GAIN) * duration_s:
        return []
    begin = np.concatenate(([0], 1 + np.flatnonzero(np.diff(faster))))
    cuts = np.append(edges[begin], edges[-1]).tolist()
    return [(a, b, bool(faster[k])) for (a, b), k in zip(pairwise(cuts), begin.tolist(), strict=True)]


def ends(run: Run) -> list[tuple[int, int, bool]]:
    """As `parts`: the short moves at both ends of a run that go to a sharp corner, and what is between them.
    A smooth path is straight at a rest, and gains no speed before that corner is behind it."""
    route = merged(run.route) or run.route
    last = len(route) - 1
    group = groups_of_same(route.point_mm)
    own = np.flatnonzero(np.diff(group, append=-1))
    if not 4 <= len(own) <= _FEW:
        return []
    cuts = [0]
    for corner, rest, ahead in ((own[1], own[0], own[2]), (own[-2], own[-1], own[-3])):
        come, go = (
            route.point_mm[corner] - route.point_mm[rest],
            route.point_mm[ahead] - route.point_mm[corner],
        )
        near = np.sqrt(come @ come) <= _NEAR * route.tolerance_mm[corner]
        if near and come @ go < _SHARP * np.sqrt((come @ come) * (go @ go)):
            cuts.append(int(corner))
    cuts.append(last)
    if len(cuts) == 2:
        return []
    return [(a, b, (a == 0 and own[1] == b) or (b == last and own[-2] == a)) for a, b in pairwise(cuts)]


def part_of(run: Run, first: int, last: int) -> Run:
    """The run from waypoint `first` to `last`, at rest at both."""
    route = run.route
    tolerance = route.tolerance_mm[first : last + 1].copy()
    tolerance[0] = tolerance[-1] = 0.0
    inner = Route(
        route.point_mm[first : last + 1], route.feed_mm_s[first:last], np.arange(last - first), tolerance,
        np.zeros(last - first + 1),
    )  # fmt: skip
    return Run(inner, run.limits)


def _speeds(motion: Motion) -> tuple[Index, Array, Array]:
    """Waypoints (m,) between segments that have pieces, the speed there, and the top speed (m + 1,) of these
    segments."""
    piece = np.arange(len(motion))
    width = np.diff(motion.start_s)
    states = [motion.of(piece, share * width)[1] for share in (0.0, 0.5)]
    begin, middle = (np.sqrt((state * state).sum(axis=1)) for state in states)
    first = np.flatnonzero(np.diff(motion.line, prepend=-1))
    return motion.line[first[1:]], begin[first[1:]], np.maximum.reduceat(np.maximum(begin, middle), first)


def _valleys(speed: Array, peak: Array) -> Index:
    """Indices of the lowest speeds between top speeds that are higher by 1 / `_VALLEY` on both sides."""
    found: list[int] = []
    top, lowest, place = float(peak[0]), np.inf, -1
    for k, (here, ahead) in enumerate(zip(speed.tolist(), peak[1:].tolist(), strict=True)):
        if here < lowest and here < _VALLEY * top:
            lowest, place = here, k
        if place >= 0 and lowest < _VALLEY * ahead:
            found.append(place)
            top, lowest, place = ahead, np.inf, -1
        top = max(top, ahead)
    return np.array(found, np.int64)
