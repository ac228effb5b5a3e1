"""Ends of blocks along contours under cutter compensation where the tool goes straight on.

The program does not state these points: the control makes them from the directions of the blocks, and the
last digit turns a short block. There a tip that is early or late is on its path. So only what is across the
path counts, of the two directions that meet there the one with more.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index
from olp.core.geometry import PLANES
from olp.core.toolpath import Kind, Toolpath
from olp.core.values import dataclass

#: rad; controls take a smaller turn for no corner
_SMOOTH = 0.05
#: share of an arc's radius, and of its length, in which it is straight enough
_STRAIGHT = 0.1
Single = npt.NDArray[np.float32]
#: (3, 3) axes of each plane: first, second, third.
_AXES = np.array(PLANES)


@dataclass(frozen=True, slots=True, eq=False)
class SmoothJoints:
    """(j,) `move` ends at the joint, and the next one begins there. (j, 3) unit vectors `before` and `behind`
    it along the path; (j,) `back` and `ahead` mm of the path are as straight as these."""

    move: Index
    before: Array
    behind: Array
    back: Array
    ahead: Array

    @staticmethod
    def of(path: Toolpath) -> SmoothJoints | None:
        """Those of a nominal path, None where it has none."""
        if not path.offset_by_radius():
            return None
        on = (path.compensated_radius_mm() > 0) & (path.kind != Kind.RAPID)
        number = path.contour_number()
        move = np.flatnonzero(on[:-1] & on[1:] & (number[:-1] == number[1:]))
        if not move.size:
            return None
        (before, back), (behind, ahead) = _course(path, move, ends=True), _course(path, move + 1, ends=False)
        smooth = (before * behind).sum(axis=1) >= np.cos(_SMOOTH)
        if not smooth.any():
            return None
        return SmoothJoints(move[smooth], before[smooth], behind[smooth], back[smooth], ahead[smooth])

    def across(self, move: Index, away: Array) -> tuple[Index, Array]:
        """Of points that are `away` (m, 3) from the ends of moves (m,): the rows (r,) of those near joints,
        and (r, 3) what of it is across the path."""
        place = np.minimum(np.searchsorted(self.move, move), len(self.move) - 1)
        rows = np.flatnonzero(self.move[place] == move)
        joint, off = place[rows], away[rows]
        back, ahead = ((off * course[joint]).sum(axis=1) for course in (self.before, self.behind))
        one, other = (
            off - along[:, None] * course[joint]
            for along, course in ((back, self.before), (ahead, self.behind))
        )
        near = (-back <= self.back[joint]) & (ahead <= self.ahead[joint])
        more = np.square(one).sum(axis=1) >= np.square(other).sum(axis=1)
        return rows[near], np.where(more[:, None], one, other)[near]

    def put_across(self, distance: Array | Single, move: Index, away: Array) -> None:
        """Replace distances (m,) of points that are `away` (m, 3) from the ends of moves (m,), where these
        are joints and the points are near them, by what is across the path."""
        rows, off = self.across(move, away)
        distance[rows] = np.fmin(distance[rows], np.sqrt(np.square(off).sum(axis=1)))


def _course(path: Toolpath, move: Index, *, ends: bool) -> tuple[Array, Array]:
    """(m, 3) unit vectors along moves at their ends or begins, NaN of those that do not move, and the mm of
    them that are as straight."""
    end = path.end_mm[move]
    start = np.where((move > 0)[:, None], path.end_mm[np.maximum(move - 1, 0)], np.array(path.start_mm))
    # an axis that is not known does not move
    course = np.nan_to_num(end - start)
    straight = np.sqrt(np.square(course).sum(axis=1))
    arcs = path.arcs
    place = np.minimum(np.searchsorted(arcs.move, move), max(len(arcs) - 1, 0))
    mine = np.flatnonzero(arcs.move[place] == move) if len(arcs) else np.zeros(0, np.int64)
    if mine.size:
        of, rows = place[mine], np.arange(len(mine))
        axes, sweep = _AXES[arcs.plane[of]].T, arcs.sweep_rad[of]
        arm = (end if ends else start)[mine] - arcs.centre_mm[of]
        turned = np.zeros((len(mine), 3))
        turned[rows, axes[0]] = -np.sign(sweep) * arm[rows, axes[1]]
        turned[rows, axes[1]] = np.sign(sweep) * arm[rows, axes[0]]
        radius = np.sqrt(np.square(turned).sum(axis=1))
        turned[rows, axes[2]] = course[mine][rows, axes[2]] / np.abs(sweep)
        course[mine] = turned
        straight[mine] = _STRAIGHT * radius * np.minimum(np.abs(sweep), 1.0)
    with np.errstate(invalid="ignore"):
        return course / np.sqrt(np.square(course).sum(axis=1))[:, None], straight
