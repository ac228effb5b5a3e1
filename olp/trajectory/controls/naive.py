"""LinuxCNC's naive CAM detector: feed moves in a row that are nearly one line become one move.

A move joins those before it while all waypoints between are within the tolerance of the line from the first
to the last. That tolerance is Q of G64, or P where there is no Q. Arcs, rapids, another feed, other path
modes and rests end a row.
Source: LinuxCNC's manual, G64, and its published interpreter (src/emc/task/emccanon.cc).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.program.feeds.timing import PathControl
from olp.program.program import Program
from olp.trajectory.controls.moves import Moves
from olp.trajectory.controls.said import Said

#: waypoints that one move may take the place of, besides its end
_MOST = 100
_MERGE = "merge_mm"


def said(program: Program) -> Said:
    """The tolerance of each line within which moves are merged, 0 where none are."""
    return Said({_MERGE: 0.0}, tuple((mode.line, _MERGE, mode.merge_mm) for mode in program.path_modes), ())


def merged(part: Moves) -> tuple[Moves, Index]:
    """The moves that the control drives, and the last of those in `part` that each stands for."""
    tolerance = part.said[_MERGE]
    straight = np.isinf(part.radius_mm) & np.isfinite(part.feed_mm_s) & (tolerance > 0.0)
    joins = straight[:-1] & straight[1:] & ~part.rest & (part.mode == PathControl.BLEND)
    joins &= (part.feed_mm_s[:-1] == part.feed_mm_s[1:]) & (tolerance[:-1] == tolerance[1:])
    if not joins.any():
        return part, np.arange(len(part))
    place = np.concatenate((np.zeros((1, 3)), np.cumsum(part.begin * part.length_mm[:, None], axis=0)))
    last = _ends(joins, place, tolerance)
    first = np.concatenate(([0], last[:-1] + 1))
    several = (first < last)[:, None]
    way = place[last + 1] - place[first]
    length = np.sqrt((way * way).sum(axis=1))
    unit = way / np.where(several[:, 0], length, 1.0)[:, None]
    joint = last[:-1]
    return replace(
        part, length_mm=np.where(several[:, 0], length, part.length_mm[last]),
        begin=np.where(several, unit, part.begin[last]), leave=np.where(several, unit, part.leave[last]),
        most=np.where(several, np.abs(unit), part.most[last]), radius_mm=part.radius_mm[last],
        feed_mm_s=part.feed_mm_s[last], line=part.line[last], inward=part.inward[last],
        normal=part.normal[last], sweep_rad=part.sweep_rad[last], own_mode=part.own_mode[last],
        mode=part.mode[joint], blend_mm=part.blend_mm[joint], rest=part.rest[joint],
        said={name: column[last] for name, column in part.said.items()},
    ), last  # fmt: skip


def _ends(joins: Mask, place: Array, tolerance: Array) -> Index:
    """The last move of each row; `place` (m + 1, 3) are the waypoints."""
    ends, begin = [], 0
    for k, joined in enumerate(joins.tolist()):
        if not joined or not _one(place[begin : k + 3], float(tolerance[k])):
            ends.append(k)
            begin = k + 1
    return np.array([*ends, len(joins)])


def _one(point: Array, most: float) -> bool:
    """Whether inner points (n + 2, 3) are that near to the line from the first to the last."""
    way, inner = point[-1] - point[0], point[1:-1] - point[0]
    square = float(way @ way)
    if len(inner) > _MOST or square == 0.0:
        return False
    off = inner - np.clip(inner @ way / square, 0.0, 1.0)[:, None] * way
    return bool(((off * off).sum(axis=1) <= most * most).all())
