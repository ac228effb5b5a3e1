"""Holes of canned cycles: where the axes are commanded for each.

A cycle moves straight along the tool axis. In the plane it is commanded where the middle of its feed stroke
is exact, along the tool axis where its bottom and its R level are.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from olp.compensation.invert import invert
from olp.compensation.plan import Plan
from olp.core.arrays import Array
from olp.core.geometry import PLANES
from olp.core.toolpath import Flag, Toolpath
from olp.core.turns import Turns
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.program.holes import Holes
from olp.program.program import Program

#: (3, 3) axes of each plane: first, second, third.
_AXES = np.array(PLANES)


@dataclass(frozen=True, slots=True, eq=False)
class HolePlan:
    """(h, 3) commands at the R level and at the bottom of each hole, in mm: axis positions as they are made,
    then positions along the words."""

    holes: Holes
    level_mm: Array
    bottom_mm: Array

    @staticmethod
    def of(program: Program, plan: Plan, model: ErrorModel) -> HolePlan:
        path, holes = program.toolpath, program.holes
        count = len(holes)
        level, bottom = np.zeros((count, 3)), np.zeros((count, 3))
        if not count:
            return HolePlan(holes, level, bottom)
        axes, row = _AXES[holes.plane], np.arange(count)
        for point, depth in ((level, holes.r_mm), (bottom, holes.z_mm)):
            point[row[:, None], axes] = np.column_stack((holes.place_mm, depth))
        frame = path.frame[holes.first]
        tool, shift = path.tools_mm()[frame], plan.shift_mm[frame]
        level_play, bottom_play = _play(program, plan)
        c_level = invert(model, level + shift, tool, level_play)
        c_bottom = invert(model, bottom + shift, tool, bottom_play)
        left = (path.flag[holes.first] & np.uint8(Flag.PASS)) != 0
        c_level[left], c_bottom[left] = level[left], bottom[left]
        return HolePlan(holes, c_level, c_bottom)

    def along_words(self, path: Toolpath, turns: Turns | None) -> HolePlan:
        """The same along the words of each hole."""
        if turns is None or not len(self.holes):
            return self
        which = turns.of_frame[path.frame[self.holes.first]]
        return replace(
            self, level_mm=turns.words(self.level_mm, which), bottom_mm=turns.words(self.bottom_mm, which)
        )


def _play(program: Program, plan: Plan) -> tuple[Array | None, Array | None]:
    """(h, 3) play of the axes when a hole's R level and its bottom are reached."""
    if plan.play is None:
        return None, None
    holes = program.holes
    move, hole = holes.moves()
    depth = program.toolpath.end_mm[move, _AXES[holes.plane[hole], 2]]
    level, _ = holes.ends(depth == holes.r_mm[hole])
    bottom, last_bottom = holes.ends(depth == holes.z_mm[hole])
    # a hole without its R level, or without its bottom, takes what is there
    reached = (np.where(level >= 0, level, bottom), last_bottom)
    level_row, bottom_row = (np.where(m >= 0, np.searchsorted(plan.move, m), 0) for m in reached)
    return plan.play[level_row], plan.play[bottom_row]
