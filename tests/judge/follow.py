"""Whether a motion follows a polyline: passes every waypoint in order, near enough, and never turns back.

The waypoints are sought by brute force over all chords of the sampled motion. A waypoint can be passed on a
chord if two conditions hold. A chord on which the waypoint before can be passed comes no later, and all
positions between are near the segment that joins the two. That is the free space in which the Frechet
distance of two curves is decided (H. Alt, M. Godau, 1995). So a spike that is left out, a loop, and a step
back are detected.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from judge.polynomials import Pieces

#: mm, below which positions are one
NEAR_MM = 2e-9
#: share of a tolerance that counts as rounding
ROUNDING = 1e-6
#: share of a tolerance that chords may take
CHORD = 5e-3
#: mm, of segments that a planner may take as one with the next
SHORT_MM = 1e-3
#: mm, so near a segment that a position is on it
ON_MM = 1e-9
#: mm, farther from a segment a position is beside it
BESIDE_MM = 1e-7


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Samples of a motion in order: `piece`, `u` after its start (m,), `position_mm` (m, 3); `bulge` (m - 1,)
    how far the motion leaves the chord between two."""

    piece: np.ndarray
    u: np.ndarray
    position_mm: np.ndarray
    bulge: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """The segments `first` to `last` (m,) on which each sample can be. By the most lenient of them: its
    distance as a share of what is allowed (`used`), its feed in mm/s (`feed`), and its velocity along it
    (`forward`), (m,). `lines_ok` (m,): its line is that of one of them, or of the next, which begins where a
    corner is cut."""

    first: np.ndarray
    last: np.ndarray
    used: np.ndarray
    feed: np.ndarray
    forward: np.ndarray
    lines_ok: np.ndarray


def places(pieces: Pieces, tolerance_mm: float) -> Places:
    """Samples of all pieces, their ends included, so dense that chords are near."""
    count = np.where(pieces.bent, 8, 4)
    share = np.linspace(0.0, 1.0, 9)
    rows = np.flatnonzero(pieces.bent)
    if len(rows):
        coarse = pieces.at(np.repeat(rows, 9), (pieces.lasts_s[rows, None] * share).ravel()).reshape(-1, 9, 3)
        sag = np.sqrt((np.diff(coarse, 2, axis=1) ** 2).sum(axis=2)).max(axis=1) / 8
        count[rows] = np.clip(np.ceil(8 * np.sqrt(sag / (CHORD * tolerance_mm))), 8, 96)
    piece = np.repeat(np.arange(len(pieces)), count)
    step = np.arange(len(piece)) - np.repeat(np.cumsum(count) - count, count)
    u = step / count[piece] * pieces.lasts_s[piece]
    piece, u = np.append(piece, len(pieces) - 1), np.append(u, pieces.lasts_s[-1])
    position_mm = pieces.at(piece, u)
    middle = pieces.at(piece[:-1], u[:-1] + pieces.lasts_s[piece[:-1]] / count[piece[:-1]] / 2)
    off = middle - (position_mm[1:] + position_mm[:-1]) / 2
    bulge = np.where(pieces.bent[piece[:-1]], 4 / 3 * np.sqrt((off * off).sum(axis=1)), 0.0)
    return Places(piece, u, position_mm, bulge)


def _apart(point: np.ndarray, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """(m,) distances of points from segments; any of them may be one for all."""
    chord = end - begin
    square = np.maximum((chord * chord).sum(axis=-1), 1e-300)
    share = np.clip(((point - begin) * chord).sum(axis=-1) / square, 0.0, 1.0)
    off = point - begin - share[..., None] * chord
    return np.asarray(np.sqrt((off * off).sum(axis=-1)))


def allowed(tolerance_mm: np.ndarray) -> np.ndarray:
    """(n - 1,) how far the path may be from each segment: the larger tolerance of its ends, where both are
    rests none."""
    return np.maximum(tolerance_mm[:-1], tolerance_mm[1:])


def passages(point: np.ndarray, tolerance_mm: np.ndarray, path: Places) -> tuple[np.ndarray, np.ndarray]:
    """(n,) the first and the last chord on which each waypoint can be passed. AssertionError where there is
    none."""
    chords = len(path.bulge)
    wide = allowed(tolerance_mm) * (1 + ROUNDING) + NEAR_MM
    near = tolerance_mm * (1 + ROUNDING) + NEAR_MM
    first, last = np.zeros(len(point), np.int64), np.zeros(len(point), np.int64)
    before = np.zeros(1, np.int64)
    begin = np.sqrt(((path.position_mm[0] - point[0]) ** 2).sum())
    assert begin <= near[0], "the motion does not begin at its route"
    for k in range(1, len(point)):
        lo, size = int(before[0]), max(2 * int(before[-1] - before[0]) + 2, 32)
        while True:
            hi = min(lo + size, chords)
            inside = _apart(path.position_mm[lo + 1 : hi], point[k - 1], point[k]) <= wide[k - 1]
            if hi == chords or (hi > before[-1] + 1 and not inside[int(before[-1]) - lo :].all()):
                break
            size *= 4
        chord = np.arange(lo, hi)
        # the last sample outside the segment's reach, and the last chord of the waypoint before
        barred = np.concatenate(([lo], np.where(inside, lo, chord[1:])))
        came = np.full(hi - lo, -1)
        came[before - lo] = before
        reached = np.maximum.accumulate(came) >= np.maximum.accumulate(barred)
        ends = path.position_mm[lo:hi], path.position_mm[lo + 1 : hi + 1]
        passed = _apart(point[k], *ends) <= near[k] + path.bulge[lo:hi]
        before = chord[reached & passed]
        assert len(before), f"waypoint {k} at {point[k].tolist()} is not passed"
        first[k], last[k] = before[0], before[-1]
    assert last[-1] == chords - 1, "the motion does not end at its route"
    return first, np.minimum.accumulate(last[::-1])[::-1]


def follow(route, pieces: Pieces, path: Places) -> Followed:
    """Match samples to the segments of a route. AssertionError where the motion does not follow it."""
    point, tolerance = np.asarray(route.point_mm), _tolerances(route)
    begin, end = passages(point, tolerance, path)
    count = len(path.position_mm)
    chord = np.minimum(np.arange(count), count - 2)
    # a sample is the end of one chord and the start of the next
    low = np.clip(np.searchsorted(end[1:], np.maximum(chord - 1, 0), side="left"), 0, len(point) - 2)
    high = np.clip(np.searchsorted(begin, chord, side="right") - 1, low, len(point) - 2)
    velocity = pieces.at(path.piece, path.u, 1)
    line = pieces.line[path.piece]
    bound = allowed(tolerance)
    step = np.diff(point, axis=0)
    length = np.sqrt((step * step).sum(axis=1))
    unit = step / np.maximum(length, 1e-300)[:, None]
    used, away = np.full(count, np.inf), np.full(count, np.inf)
    for rows, k in _pairs(low, high):
        d = _apart(path.position_mm[rows], point[k], point[k + 1])
        away[rows] = np.minimum(away[rows], d)
        used[rows] = np.minimum(used[rows], (d - NEAR_MM) / np.maximum(bound[k], 1e-12))
    feed, forward = np.zeros(count), np.full(count, -np.inf)
    # rounding spreads a corner over its neighbours; a straight segment has one direction
    beside = np.where(pieces.bent[path.piece], 2, 0)
    for rows, k in _pairs(np.maximum(low - beside, 0), np.minimum(high + beside, len(step) - 1)):
        forward[rows] = np.maximum(forward[rows], (velocity[rows] * unit[k]).sum(axis=1))
    for rows, k in _pairs(low, high):
        d = _apart(path.position_mm[rows], point[k], point[k + 1])
        free = d <= bound[k] * (1 + ROUNDING) + NEAR_MM
        # on the polyline itself there is no doubt about the segment
        on = away[rows] <= ON_MM
        mine = free & (~on | (d <= away[rows] + BESIDE_MM))
        feed[rows] = np.maximum(feed[rows], np.where(mine, route.feed_mm_s[k], 0.0))
    long = np.append(np.flatnonzero(length > SHORT_MM), len(length) - 1)
    later = np.maximum(long[np.minimum(np.searchsorted(long, high, side="right"), len(long) - 1)], high)
    lines_ok = (route.line[low] <= line) & (line <= route.line[later])
    return Followed(low, high, np.maximum(used, 0.0), feed, forward, lines_ok)


def _tolerances(route) -> np.ndarray:
    tolerance = np.array(route.tolerance_mm, float)
    tolerance[[0, -1]] = 0.0
    tolerance[np.asarray(route.dwell_s) > 0.0] = 0.0
    return tolerance


def _pairs(low: np.ndarray, high: np.ndarray):
    """Samples and one segment of each, until every one of its segments has come."""
    for step in range(int((high - low).max()) + 1):
        rows = np.flatnonzero(low + step <= high)
        yield rows, low[rows] + step
