"""The report of `retime` on machines with rotary joints ("olp-joint-retime-1")."""

from __future__ import annotations

from typing import Any

import numpy as np

from olp.core.arrays import Index
from olp.kinematics.structure import Structure
from olp.program.feeds.timing import PathControl, Timing
from olp.trajectory.joint_motion import NO_TUBES, Stretch

#: Lines of the table of those that take longest.
LONGEST = 10
_WORDS = ("velocity", "acceleration", "jerk")


def _names(structure: Structure) -> list[str]:
    return [f"{name} {word}" for name in structure.order for word in _WORDS]


def blend_row(factor: float, clock: Timing, stretches: tuple[Stretch, ...]) -> dict[str, Any]:
    """Time and deviation at the path tolerances in use times a factor. The deviation is a bound: what the
    axes are off, each in mm of the way that it moves the tip."""
    off_mm = [
        leg.deviation_mm * one.route.widest for one in stretches for leg in one.trajectory.legs
    ]  # fmt: skip
    used = np.unique(clock.blend_mm[clock.control == PathControl.BLEND])
    return {
        "factor": factor,
        "tolerance_um": (used[used > 0.0] * factor * 1e3).tolist(),
        "duration_s": sum(one.trajectory.duration_s for one in stretches),
        "deviation_um": max(off_mm, default=0.0) * 1e3,
    }


def summary(structure: Structure, stretches: tuple[Stretch, ...], lines: Index) -> dict[str, Any]:
    """How long, where, and what slows it down; `lines` are those of the motion, which rise."""
    names = [*_names(structure), "feed"]
    seconds, by_limit = np.zeros(len(lines)), np.zeros((len(lines), len(names)))
    solvers: dict[str, float] = {}
    largest = dict.fromkeys(_WORDS, 0.0)
    dwell = feed = 0.0
    for one in stretches:
        pieces = one.trajectory.motion
        width = np.diff(pieces.start_s)
        row = np.searchsorted(lines, one.route.line[pieces.line])
        np.add.at(seconds, row, width)
        np.add.at(by_limit, (row, one.limit), width)
        dwell += float(one.route.route.dwell_s.sum())
        feed = max(feed, float(one.ratio.max(initial=0.0)))
        for leg in one.trajectory.legs:
            solvers[leg.solver] = solvers.get(leg.solver, 0.0) + leg.duration_s
        for word in _WORDS:
            largest[word] = max(largest[word], float(getattr(one.trajectory.audit, word).max()))
    longest = np.argsort(-seconds, kind="stable")[:LONGEST]
    total = float(seconds.sum())
    turning = sum(one.turning() for one in stretches)
    return {
        "duration_s": total,
        "dwell_s": dwell,
        "solvers_s": solvers,
        "in_tubes": {"faster": 0, "not_faster": {NO_TUBES: turning} if turning else {}},
        "largest_share_of_limit": largest | {"feed": feed},
        "nearest_limit": {
            name: float(share)
            for name, share in zip(names, (by_limit.sum(axis=0) / max(total, 1e-300)).tolist(), strict=True)
            if share > 0.0
        },
        "stretches": [
            {
                "first_line": int(one.route.line.min()),
                "last_line": int(one.route.line.max()),
                "duration_s": one.trajectory.duration_s,
            }
            for one in stretches
        ],
        "longest_lines": [
            {"line": int(lines[k]), "seconds": float(seconds[k]), "limit": names[int(by_limit[k].argmax())]}
            for k in longest.tolist()
        ],
    }
