"""All that a planned motion is held to, found by nothing of the project but its arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from judge.follow import NEAR_MM, Followed, Places, follow, places
from judge.polynomials import Pieces

#: share by which a limit may be exceeded
EXCESS = 1e-6
#: s, between samples of a control
CYCLE_S = 1e-3
#: cycles between differences
WINDOWS = (1, 7, 50)
#: samples taken at 1 kHz of a whole motion
_MOST = 20_000
#: mm, where pieces join
JOIN_MM = 1e-9
#: shares of the limits of velocity and acceleration, where pieces join
JOIN_SHARE = 1e-8
#: at rest, as shares of the limits
REST_SHARE = 1e-7
_ULP = 2.0**-52


@dataclass(frozen=True, slots=True)
class Verdict:
    """The largest ratios to the limits of velocity, acceleration, jerk and feed, by the polynomials and by
    differences of positions; the largest share of the path tolerance used; and what is wrong."""

    velocity: float
    acceleration: float
    jerk: float
    feed: float
    differences: float
    tolerance: float
    wrong: tuple[str, ...]


def judge(motion, route, limits) -> Verdict:
    """Everything about the motion of a route with at least one way."""
    pieces = Pieces.of(motion)
    wrong: list[str] = []
    bounds = (np.asarray(limits.velocity), np.asarray(limits.acceleration), np.asarray(limits.jerk))
    if not (np.isfinite(pieces.axis).all() and np.isfinite(pieces.start_s).all()):
        return Verdict(*[np.inf] * 6, ("not finite",))
    if (pieces.lasts_s < 0.0).any():
        wrong.append("time runs backwards")
    ratios = [float(pieces.largest(order, bound).max()) for order, bound in enumerate(bounds, start=1)]
    for name, ratio in zip(("velocity", "acceleration", "jerk"), ratios, strict=True):
        if ratio > 1 + EXCESS:
            wrong.append(f"{name} is {ratio:.9f} of its limit")
    wrong += _joins(pieces, bounds)
    differences = _differences(pieces, bounds)
    if differences > 1 + EXCESS:
        wrong.append(f"differences of positions are {differences:.9f} of a limit")
    inner = np.asarray(route.tolerance_mm)[1:-1]
    path = places(pieces, float(inner[inner > 0].min(initial=1.0)))
    try:
        followed = follow(route, pieces, path)
    except AssertionError as error:
        return Verdict(*ratios, np.nan, differences, np.nan, (*wrong, str(error)))
    feed = _feed(pieces, path, followed)
    if feed > 1 + EXCESS:
        wrong.append(f"feed is {feed:.9f} of its limit")
    used = float(followed.used.max())
    if used > 1 + EXCESS:
        wrong.append(f"the path leaves the polyline by {used:.9f} of the tolerance")
    speed = np.sqrt((pieces.at(path.piece, path.u, 1) ** 2).sum(axis=1))
    back = float((-followed.forward).max(initial=0.0)) / max(float(speed.max()), 1e-300)
    if back > 1e-8:
        wrong.append(f"it runs back at {back:.3g} of its speed")
    if not followed.lines_ok.all():
        wrong.append(f"a line of the program is reported elsewhere than near it, piece "
                     f"{int(path.piece[np.flatnonzero(~followed.lines_ok)[0]])}")  # fmt: skip
    wrong += _rests(pieces, route, bounds)
    return Verdict(*ratios, feed, differences, used, tuple(wrong))


def _joins(pieces: Pieces, bounds: tuple[np.ndarray, ...]) -> list[str]:
    """Jumps between pieces, and motion before the first or after the last. A joint's time is a float, so at
    t seconds it is missed by t / 2^53, and by that times a rate every state."""
    all_ = np.arange(len(pieces))
    begin = [pieces.at(all_, np.zeros(len(pieces)), order) for order in range(4)]
    end = [pieces.at(all_, pieces.lasts_s, order) for order in range(4)]
    time = np.append(pieces.start_s, pieces.start_s[-1] + pieces.lasts_s[-1])
    allowances = (np.full(3, JOIN_MM), JOIN_SHARE * bounds[0], JOIN_SHARE * bounds[1])
    wrong = []
    for order, (name, allowance) in enumerate(
        zip(("position", "velocity", "acceleration"), allowances, strict=True)
    ):
        jump = np.abs(begin[order][1:] - end[order][:-1])
        rate = np.maximum(np.abs(end[order + 1][:-1]), np.abs(begin[order + 1][1:]))
        off = (
            jump
            - allowance
            - 2 * _ULP * (rate * time[1:-1, None] + (np.abs(begin[0][1:]) if order == 0 else 0.0))
        )
        if len(off) and off.max() > 0:
            k = int(off.max(axis=1).argmax())
            wrong.append(f"{name} jumps by {jump[k].max():.3g} at {time[k + 1]:.9g} s, joint {k}")
        if order:
            for state, rate, when in ((begin, begin[order + 1][0], 0.0), (end, end[order + 1][-1], time[-1])):
                slip = 2 * _ULP * when * np.abs(rate)
                still = float(
                    ((np.abs(state[order][0 if when == 0.0 else -1]) - slip) / bounds[order - 1]).max()
                )
                if still > REST_SHARE:
                    wrong.append(f"{name} at an end is {still:.3g} of its limit")
    return wrong


def _differences(pieces: Pieces, bounds: tuple[np.ndarray, ...]) -> float:
    """Largest ratio of differences of positions to what a limit allows, their rounding left out."""
    total = float(pieces.start_s[-1] + pieces.lasts_s[-1])
    most = 0.0
    for first, last in _stretches(pieces, int(total / CYCLE_S)):
        time = np.minimum(np.arange(first, last + 1) * CYCLE_S, total)
        position = pieces.position(time)
        blur = _ULP * (2 * np.abs(position).max() + (time[-1] + CYCLE_S) * bounds[0])
        for window in WINDOWS:
            change = position
            for order, bound in enumerate(bounds, start=1):
                change = change[window:] - change[:-window]
                if len(change):
                    off = (np.abs(change).max(axis=0) - 2.0**order * blur) / (
                        bound * (window * CYCLE_S) ** order
                    )
                    most = max(most, float(off.max()))
    return most


def _stretches(pieces: Pieces, ticks: int) -> list[tuple[int, int]]:
    """The ticks of the control that are looked at: all of a short motion, else its ends and some joints."""
    if ticks <= _MOST:
        return [(0, ticks)]
    joints = (pieces.start_s / CYCLE_S).astype(np.int64)
    joints = joints[np.linspace(0, len(joints) - 1, min(len(joints), 40)).astype(int)]
    joints = np.clip(joints, 150, ticks - 150)
    return [(0, 2000), (ticks - 2000, ticks), *((int(k) - 150, int(k) + 150) for k in joints)]


def _feed(pieces: Pieces, path: Places, followed: Followed) -> float:
    """Largest ratio of speed to feed: at every sample, and between them by the piece's own bound."""
    speed = np.sqrt((pieces.at(path.piece, path.u, 1) ** 2).sum(axis=1))
    most = float((speed / followed.feed).max())
    # a sample on a joint stands for the piece that it ends as well
    feed = np.zeros(len(pieces))
    np.maximum.at(feed, path.piece, followed.feed)
    np.maximum.at(feed, np.maximum(path.piece[1:] - 1, 0), followed.feed[1:])
    rows = np.isfinite(feed)
    return max(most, float(pieces.fastest(np.where(rows, feed, 1e300)).max()))


def _rests(pieces: Pieces, route, bounds: tuple[np.ndarray, ...]) -> list[str]:
    """Rests in order where the route has stops, and the dwells, all of them and no others."""
    point, dwell = np.asarray(route.point_mm), np.asarray(route.dwell_s)
    apart = np.sqrt((np.diff(point, axis=0) ** 2).sum(axis=1)) > NEAR_MM
    group = np.concatenate(([0], np.cumsum(apart)))
    wait = np.bincount(group, dwell)
    stop = np.bincount(group, (np.asarray(route.tolerance_mm) == 0) | (dwell > 0)) > 0
    stop[[0, -1]] = True
    where = point[np.concatenate(([True], apart))]
    wrong = []
    piece = np.arange(len(pieces))
    begin = pieces.at(piece, np.zeros(len(pieces)))
    still = np.ones(len(pieces), bool)
    for order, bound in enumerate(bounds[:2], start=1):
        still &= (np.abs(pieces.at(piece, np.zeros(len(pieces)), order)) <= REST_SHARE * bound).all(axis=1)
    rest_mm = np.vstack((begin[still], pieces.at(piece[-1:], pieces.lasts_s[-1:])))
    k = 0
    for number in np.flatnonzero(stop).tolist():
        near = NEAR_MM + 4 * _ULP * np.abs(where[number]).max()
        off = np.abs(rest_mm[k:] - where[number]).max(axis=1) <= near
        if not off.any():
            wrong.append(f"no rest at {where[number].tolist()}")
            break
        k += int(off.argmax())
    resting = ~pieces.axis[:, 1:].any(axis=(1, 2)) & (pieces.lasts_s > 0)
    runs: list[tuple[np.ndarray, float]] = []
    for number in np.flatnonzero(resting).tolist():
        if runs and number and resting[number - 1]:
            runs[-1] = (runs[-1][0], runs[-1][1] + float(pieces.lasts_s[number]))
        else:
            runs.append((begin[number], float(pieces.lasts_s[number])))
    wanted = [(where[g], float(wait[g])) for g in np.flatnonzero(wait > 0).tolist()]
    slip = 8 * _ULP * float(pieces.start_s[-1]) + 1e-12
    same = len(runs) == len(wanted) and all(
        np.abs(a - b).max() <= NEAR_MM and t - slip <= s <= t * (1 + EXCESS) + slip
        for (a, s), (b, t) in zip(runs, wanted, strict=True)
    )
    if not same:
        wrong.append(f"it waits {[s for _, s in runs]} s, the route {[t for _, t in wanted]} s")
    return wrong
