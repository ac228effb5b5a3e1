"""Answers about a trajectory as plain data: how long, where, why so slow, and which axis is at its limit."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index
from olp.trajectory.plan import Trajectory
from olp.trajectory.route import Route
from olp.trajectory.solvers import EXACT_STOP, OVERLAP, TUBE
from olp.trajectory.usage import LIMITS, LineUse, SlowStretches

#: lines and slow stretches that a report lists
MOST = 10
#: mm; a step between lines differs by less than this between nominal and corrected program
_NEAR_MM = 0.1
#: plus this share of the step
_NEAR_SHARE = 1e-3
#: waypoints that are compared at once
_RUN = 512


def summary(
    trajectories: Sequence[Trajectory], use: LineUse, slow: Sequence[SlowStretches]
) -> dict[str, Any]:
    """The answers on trajectories driven one after the other, their lines and their slow stretches."""
    whole = max(sum(t.duration_s for t in trajectories), 1e-300)
    solvers: dict[str, float] = {}
    for leg in (leg for t in trajectories for leg in t.legs):
        solvers[leg.solver] = solvers.get(leg.solver, 0.0) + leg.duration_s
    at_limit = use.at_limit_s.sum(axis=0) / whole
    most = {
        name: max((float(getattr(t.audit, name).max()) for t in trajectories), default=0.0)
        for name in ("velocity", "acceleration", "jerk")
    }
    feed_s, lost = float(use.feed_seconds.sum()), use.lost_s()
    nominal = feed_s - float(lost.sum())
    longest = np.argsort(-use.seconds, kind="stable")[:MOST]
    slowest = np.argsort(-lost, kind="stable")[:MOST]
    return {
        "duration_s": sum(t.duration_s for t in trajectories),
        "dwell_s": float(use.dwell_s.sum()),
        "solvers_s": solvers,
        "ruckig_share": (solvers.get(OVERLAP, 0.0) + solvers.get(EXACT_STOP, 0.0)) / whole,
        "in_tubes": _in_tubes(trajectories),
        "slowed_by_at_most": max((leg.factor for t in trajectories for leg in t.legs), default=1.0),
        "largest_share_of_limit": most | {"feed": float(use.most[:, -1].max(initial=0.0))},
        "at_limit": dict(zip(LIMITS, at_limit.tolist(), strict=True)),
        "feed_moves": {
            "seconds": feed_s,
            "seconds_at_programmed_feed": nominal,
            "achieved": nominal / feed_s if feed_s > 0.0 else 1.0,
        },
        "below_half_feed": _slow(slow),
        "longest_lines": _lines(use, lost, longest),
        "slowest_lines": _lines(use, lost, slowest[use.feed_length_mm[slowest] > 0.0]),
    }


def _in_tubes(trajectories: Sequence[Trajectory]) -> dict[str, Any]:
    """How many runs a search in a tube made faster, and why others not, with their number."""
    legs = [leg for t in trajectories for leg in t.legs]
    causes = Counter(leg.not_faster for leg in legs if leg.not_faster)
    return {"faster": sum(leg.solver == TUBE for leg in legs), "not_faster": dict(causes.most_common())}


def _lines(use: LineUse, lost_s: Array, which: Index) -> list[dict[str, Any]]:
    columns = (use.line, use.seconds, lost_s, use.feed_mm_s, use.achieved_mm_s(), use.limit())
    return [
        {
            "line": line,
            "seconds": seconds,
            "lost_s": lost,
            "feed_mm_s": feed if np.isfinite(feed) else None,
            "achieved_mm_s": achieved,
            "limit": LIMITS[limit],
        }
        for line, seconds, lost, feed, achieved, limit in zip(
            *(column[which].tolist() for column in columns), strict=True
        )
    ]


def _slow(parts: Sequence[SlowStretches]) -> dict[str, Any]:
    worst = []
    for number, slow in enumerate(parts, 1):
        worst += [
            {
                "stretch": number,
                "t_s": float(slow.start_s[i]),
                "line": int(slow.line[i]),
                "position_mm": slow.position_mm[i].tolist(),
                "seconds": float(slow.seconds[i]),
                "lost_s": float(slow.lost_s[i]),
                "slowest_mm_s": float(slow.slowest_mm_s[i]),
                "feed_mm_s": float(slow.feed_mm_s[i]),
                "limit": LIMITS[int(slow.limit[i])],
            }
            for i in np.argsort(-slow.lost_s, kind="stable")[:MOST].tolist()
        ]
    worst.sort(key=lambda row: -float(row["lost_s"]))
    return {
        "places": sum(map(len, parts)),
        "seconds": float(sum(slow.seconds.sum() for slow in parts)),
        "lost_s": float(sum(slow.lost_s.sum() for slow in parts)),
        "worst": worst[:MOST],
    }


def compare(
    nominal: tuple[Sequence[Route], LineUse], corrected: tuple[Sequence[Route], LineUse]
) -> list[dict[str, Any]] | None:
    """Per line of the nominal program its time, and that of the corresponding lines of the corrected one, the
    largest difference first; None where the lines do not correspond."""
    nominal_use, corrected_use = nominal[1], corrected[1]
    if len(nominal[0]) != len(corrected[0]):
        return None
    rows: list[tuple[int, float, float]] = []
    for here, there in zip(nominal[0], corrected[0], strict=True):
        (line, end), (other, other_end) = _ends(here), _ends(there)
        pair = partners(end, other_end)
        if pair is None:
            return None
        pair = pair[1:] - 1
        spent = np.zeros(len(other))
        known = np.isin(other, corrected_use.line)
        which = np.searchsorted(corrected_use.line, other[known])
        spent[known] = (corrected_use.seconds + corrected_use.dwell_s)[which]
        total = np.diff(np.concatenate(([0.0], np.cumsum(spent)))[np.concatenate(([0], pair + 1))])
        own = np.zeros(len(line))
        known = np.isin(line, nominal_use.line)
        which = np.searchsorted(nominal_use.line, line[known])
        own[known] = (nominal_use.seconds + nominal_use.dwell_s)[which]
        rows += zip(line.tolist(), own.tolist(), total.tolist(), strict=True)
    rows.sort(key=lambda row: -abs(row[2] - row[1]))
    return [{"line": n, "nominal_s": a, "corrected_s": b} for n, a, b in rows]


def _ends(route: Route) -> tuple[Index, Array]:
    """(m,) lines of a route in order, and (m + 1, 4) the start of the route and the end of each line. The
    last column is the distance along the route, as a full circle ends where it begins."""
    last = np.flatnonzero(np.diff(route.line, append=-1))
    step = np.sqrt((np.diff(route.point_mm, axis=0) ** 2).sum(axis=1))
    along = np.concatenate(([0.0], np.cumsum(step)))
    return route.line[last], np.column_stack((route.point_mm, along))[np.concatenate(([0], last + 1))]


def partners(nominal_mm: Array, corrected_mm: Array) -> Index | None:
    """(n,) the waypoint of the corrected path for each waypoint of the nominal one, in order; others were
    inserted between. None where one is missing.

    A correction shifts neighbouring waypoints by nearly the same, so steps are compared, not positions.
    """
    count, spare = len(nominal_mm), len(corrected_mm) - len(nominal_mm)
    if spare < 0:
        return None
    partner = np.zeros(count, np.int64)
    i = j = 0
    offset = np.zeros(nominal_mm.shape[1]) if not count else corrected_mm[0] - nominal_mm[0]
    while i < count:
        span = min(_RUN, count - i, len(corrected_mm) - j)
        away = corrected_mm[j : j + span] - nominal_mm[i : i + span]
        near = _near(np.diff(away, axis=0, prepend=offset[None]), _steps(nominal_mm, i, span))
        run = span if near.all() else int(near.argmin())
        if run:
            partner[i : i + run] = np.arange(j, j + run)
            offset = away[run - 1]
            i, j = i + run, j + run
        if run == span and span:
            continue
        ahead = corrected_mm[j : j + spare + 1] - nominal_mm[i] - offset
        matches = np.flatnonzero(_near(ahead, _steps(nominal_mm, i, 1)))
        if not len(matches):
            return None
        spare -= int(matches[0])
        j += int(matches[0])
        partner[i], offset = j, corrected_mm[j] - nominal_mm[i]
        i, j = i + 1, j + 1
    return partner


def _near(change: Array, step: Array) -> npt.NDArray[np.bool_]:
    return np.asarray(np.abs(change).max(axis=1) <= _NEAR_MM + _NEAR_SHARE * step)


def _steps(point: Array, first: int, count: int) -> Array:
    begin = point[np.maximum(np.arange(first, first + count) - 1, 0)]
    return np.asarray(np.sqrt(((point[first : first + count] - begin) ** 2).sum(axis=1)))
