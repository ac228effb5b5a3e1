"""Places along the moves of a program on a machine with rotary joints, as densely as its errors bend."""

from __future__ import annotations

import numpy as np

from olp.compensation.joints.path import JointPath
from olp.compensation.joints.posed import unreached
from olp.compensation.joints.sampling import spread
from olp.core.arrays import Array, Index
from olp.core.errors import NotInvertible
from olp.core.values import dataclass
from olp.kinematics.poses import Poses
from olp.proof.joint_sides import Sides


@dataclass(frozen=True, slots=True, eq=False)
class Along:
    """Places (n,) at a `share` of moves: after the begin of each, up to its end. `axes` (n, axes) are the
    commanded axis values there, mm and deg."""

    path: JointPath
    move: Index
    share: Array
    axes: Array

    @staticmethod
    def of(path: JointPath, step_mm: float = np.inf) -> Along:
        """Those of all moves that end at a known position; of one that begins at an unknown one its end
        alone. The nominal tip goes `step_mm` at most from one to the next. Raises ProgramError with the line
        of a move that no axis values lead."""
        rows = np.flatnonzero(np.isfinite(path.end).all(axis=1))
        begun = np.asarray(np.isfinite(path.start[rows]).all(axis=1))
        count = np.ones(len(rows), np.int64)
        count[begun] = _counts(path, rows[begun], step_mm)
        owner, step = spread(count)
        move, share = rows[owner], (step + 1) / count[owner]
        place = path.end[move].copy()
        inner = np.flatnonzero(begun[owner])
        place[inner] = path.at(move[inner], share[inner])
        return Along(path, move, share, _axes(path, move, place))

    def begun(self) -> Along:
        """Those of moves that begin at a known position."""
        rows = np.flatnonzero(np.isfinite(self.path.start[self.move]).all(axis=1))
        return Along(self.path, self.move[rows], self.share[rows], self.axes[rows])

    def nominal(self) -> Poses:
        """(n) poses of the nominal machine, in the coordinates of the program."""
        return self.path.motion.nominal(self.axes, self.path.tool[self.move])

    def actual(self) -> Poses:
        """(n) poses of the machine with its errors and its backlash, in the coordinates of the part where its
        zero was set. Where the side of a backlash is unknown, it is in the middle of what is possible."""
        path, move = self.path, self.move
        begun = np.isfinite(path.start[move]).all(axis=1)
        sides, _ = Sides.of(path).at(move, np.where(begun, self.share, 1.0))
        actual = path.motion.actual(self.axes, path.tool[move], sides)
        return Poses(actual.rotation, actual.position - path.shift_mm[move])


def _axes(path: JointPath, move: Index, place: Array) -> Array:
    """(n, axes) axis values of programmed coordinates of moves."""
    try:
        return path.motion.axes(place, path.tool[move], path.tip[move])
    except NotInvertible as error:
        raise unreached(int(path.line[move[error.row or 0]])) from None


def _counts(path: JointPath, rows: Index, step_mm: float) -> Index:
    """(r,) places of moves that begin and end at known positions."""
    begin, end = (_axes(path, rows, place[rows]) for place in (path.start, path.end))
    tips = [path.motion.nominal(axes, path.tool[rows]).position for axes in (begin, end)]
    way = np.maximum(np.linalg.norm(tips[1] - tips[0], axis=1), path.curves.length_mm(rows))
    count = np.maximum(np.ceil(way / step_mm).astype(np.int64), 1)
    return np.asarray(np.maximum(count, path.samples(rows, begin, end)), np.int64)
