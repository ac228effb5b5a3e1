"""Holes of canned cycles: where the axes are commanded for each.

A cycle moves straight along the tool axis. In the plane it is commanded where the middle of its feed stroke
is exact, along the tool axis where its bottom and its R level are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from olp.compensation.invert import invert
from olp.compensation.plan import Plan
from olp.core.arrays import Array
from olp.core.geometry import PLANES
from olp.core.toolpath import Flag
from olp.errormodel.base import ErrorModel
from olp.program.program import Hole, Program


@dataclass(frozen=True, slots=True, eq=False)
class HolePlan:
    """(h, 3) commands at the R level and at the bottom of each hole, in mm."""

    holes: tuple[Hole, ...]
    level_mm: Array
    bottom_mm: Array

    @staticmethod
    def of(program: Program, plan: Plan, model: ErrorModel) -> HolePlan:
        path, holes = program.toolpath, program.holes
        count = len(holes)
        level, bottom = np.zeros((count, 3)), np.zeros((count, 3))
        tools = path.tools_mm()
        tool, shift = np.zeros((count, tools.shape[1])), np.zeros((count, 3))
        for i, hole in enumerate(holes):
            first, second, third = PLANES[hole.plane]
            for point, depth in ((level, hole.r_mm), (bottom, hole.z_mm)):
                point[i, first], point[i, second], point[i, third] = *hole.place_mm, depth
            frame = int(path.frame[hole.first])
            tool[i], shift[i] = tools[frame], plan.shift_mm[frame]
        if not count:
            return HolePlan(holes, level, bottom)
        level_play, bottom_play = _play(program, plan)
        c_level = invert(model, level + shift, tool, level_play)
        c_bottom = invert(model, bottom + shift, tool, bottom_play)
        for i, hole in enumerate(holes):
            if path.flag[hole.first] & np.uint8(Flag.PASS):
                c_level[i], c_bottom[i] = level[i], bottom[i]
        return HolePlan(holes, c_level, c_bottom)


def _play(program: Program, plan: Plan) -> tuple[Array | None, Array | None]:
    """(h, 3) play of the axes when a hole's R level and its bottom are reached."""
    if plan.play is None:
        return None, None
    path = program.toolpath
    rows = np.zeros((2, len(program.holes)), np.int64)
    for i, hole in enumerate(program.holes):
        depth = path.end_mm[hole.first : hole.last, PLANES[hole.plane][2]]
        level = np.flatnonzero(depth == hole.r_mm)
        bottom = np.flatnonzero(depth == hole.z_mm)
        moves = hole.first + (level[:1] if level.size else bottom[:1]), hole.first + bottom[-1:]
        rows[:, i] = [int(np.searchsorted(plan.move, m[0])) if m.size else 0 for m in moves]
    return plan.play[rows[0]], plan.play[rows[1]]
