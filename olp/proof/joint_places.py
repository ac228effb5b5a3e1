"""Places along a corrected program with the nominal poses that belong to them, on machines with rotary
joints: where the proof looks, and what a page shows."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from olp.compensation.joints.path import JointPath
from olp.compensation.joints.planning import JointPlan
from olp.compensation.joints.sampling import spread
from olp.core.arrays import Array, Index, Mask
from olp.core.values import dataclass
from olp.kinematics.poses import Poses, rotation_vector
from olp.proof.joint_sides import Sides

#: The arm in mm at which a turn counts as much as a shift, where a place on a move is found.
ARM_MM = 100.0
#: rad; where no command turns the tool nearer than this, a place on a move is where it was planned.
_TURNED_RAD = 1e-6
#: Steps by which a place on a move is found.
_STEPS = 3
#: Places at a time, so that memory is small.
BATCH = 1 << 15


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Places (r,) at `part` of the moves `rows` of a path, which are at `share` of the nominal moves `move`.
    `side` (r, axes) is that of the backlash, in the middle of what is possible, `unknown` (r, axes) half of
    the range of what is."""

    move: Index
    rows: Index
    part: Array
    share: Array
    side: Array
    unknown: Array

    def poses(self, path: JointPath) -> tuple[Array, Poses]:
        """(r, axes) commanded axis values there, and the poses of the machine with its errors."""
        return self._poses(path, path.at(self.rows, self.part))

    def targets(self, nominal: JointPath) -> Poses:
        """(r) the nominal poses, where the part lies."""
        return self._targets(nominal, nominal.at(self.move, self.share))

    def both(self, nominal: JointPath, path: JointPath) -> tuple[Array, Poses, Poses]:
        """What `poses` and `targets` are. On the nominal path itself its own places are found once."""
        place = along = path.at(self.rows, self.part)
        own = path is nominal and np.array_equal(self.rows, self.move)
        if not (own and np.array_equal(self.part, self.share)):
            along = nominal.at(self.move, self.share)
        return *self._poses(path, place), self._targets(nominal, along)

    def _poses(self, path: JointPath, place: Array) -> tuple[Array, Poses]:
        tool = path.tool[self.rows]
        axes = path.motion.axes(place, tool, path.tip[self.rows])
        return axes, path.motion.actual(axes, tool, self.side)

    def _targets(self, nominal: JointPath, place: Array) -> Poses:
        target = nominal.motion.targets(place, nominal.tool[self.move], nominal.tip[self.move])
        return Poses(target.rotation, target.position + nominal.shift_mm[self.move])


def visited(
    nominal: JointPath, path: JointPath, groups: Index, plan: JointPlan, at: Mask, between: Mask, finer: int
) -> Iterator[Places]:
    """The known ends of the moves of `path` that belong to nominal moves `at` (n,), and places along those
    `between` (n,), so many times `finer` than the plan has them."""
    owner = np.searchsorted(groups, np.arange(len(path)))
    owner = np.minimum(owner, max(len(nominal) - 1, 0))
    sides = Sides.of(path)
    known = np.isfinite(sides.end).all(axis=1) & np.isfinite(nominal.end[owner]).all(axis=1)
    begun = np.isfinite(sides.start).all(axis=1) & np.isfinite(nominal.start[owner]).all(axis=1)
    # the end of a move that does not cut is that of its last part: one goes past it before
    ends = np.flatnonzero(known & at[owner] & (between[owner] | (groups[owner] == np.arange(len(path)))))
    along = known & begun & between[owner]
    shares = _shares(nominal, path, (groups, owner), plan, sides, along)

    def places(rows: Index, part: Array) -> Places:
        share = shares[0][rows] + part * (shares[1] - shares[0])[rows]
        return Places(owner[rows], rows, part, share, *sides.at(rows, part))

    yield places(ends, np.ones(len(ends)))
    feeds = np.flatnonzero(along)
    samples = finer * path.samples(feeds, sides.start[feeds], sides.end[feeds]) + 1
    totals = np.cumsum(samples)
    a = 0
    while a < len(feeds):
        b = max(int(np.searchsorted(totals, (totals[a - 1] if a else 0) + BATCH)), a + 1)
        mine, step = spread(samples[a:b] + 1)
        rows, part = feeds[a:b][mine], step / samples[a:b][mine]
        inner = part < 1.0
        yield places(rows[inner], part[inner])
        yield places(*sides.taken_up(rows, part))
        a = b


def _shares(
    nominal: JointPath, path: JointPath, pairs: tuple[Index, Index], plan: JointPlan, sides: Sides,
    along: Mask,
) -> tuple[Array, Array]:  # fmt: skip
    """(m,) at which shares of its nominal move each move begins and ends. `pairs` are the last part of each
    nominal move, and the nominal move of each part. A part ends where the pose is nearest, as words are
    rounded along the path, too. In lists, and where the machine cannot turn the tool, the nearest pose is
    another one: there it ends as planned, where there are as many parts."""
    groups, owner = pairs
    end, number = np.ones(len(path)), np.arange(len(path))
    first = np.append(-1, groups[:-1]) + 1
    begins = np.searchsorted(plan.move, np.arange(len(nominal)))
    parts = np.append(begins[1:], len(plan.move)) - begins
    inner = along & (groups[owner] != number)
    row = np.flatnonzero(inner & (groups - first + 1 == parts)[owner])
    of = begins[owner[row]] + row - first[owner[row]]
    row, of = (rows[(path.listed is not None) | (plan.left_rad[of] > _TURNED_RAD)] for rows in (row, of))
    end[row] = plan.share[of]
    inner[row] = False
    row = np.flatnonzero(inner)
    if row.size:
        end[row] = _places(
            nominal, path, owner[row], row, sides.end[row], sides.at(row, np.ones(len(row)))[0]
        )
    begin = np.append(0.0, np.where(owner[1:] == owner[:-1], end[:-1], 0.0))[: len(path)]
    return begin, np.maximum(end, begin)


def _places(nominal: JointPath, path: JointPath, move: Index, rows: Index, axes: Array, play: Array) -> Array:
    """(r,) the shares of nominal moves whose pose is nearest to that of the machine at axis values."""
    motion = nominal.motion
    actual = path.motion.actual(axes, path.tool[rows], play)
    start, way = nominal.start[move], nominal.end[move] - nominal.start[move]
    along = np.einsum("ij,ij->i", path.end[rows] - start, way)
    share = along / np.maximum(np.einsum("ij,ij->i", way, way), 1e-30)
    arc = np.flatnonzero(nominal.curves.mask[move])
    if arc.size:
        share[arc] = nominal.curves.shares(move[arc], path.end[rows[arc]])
    tool, tip, shift = nominal.tool[move], nominal.tip[move], nominal.shift_mm[move]

    def pose(at: Array) -> Poses:
        place = motion.targets(nominal.at(move, at), tool, tip)
        return Poses(place.rotation, place.position + shift)

    half, symmetric = 1e-4, motion.structure.symmetric_tool
    for _ in range(_STEPS):
        ahead, behind = pose(share + half), pose(share - half)
        slope = _apart(ahead, behind, symmetric) / (2.0 * half)
        miss = _apart(actual, pose(share), symmetric)
        share = share + np.einsum("ij,ij->i", miss, slope) / np.maximum(
            np.einsum("ij,ij->i", slope, slope), 1e-30
        )
    return np.asarray(np.clip(share, 0.0, 1.0), float)


def _apart(one: Poses, other: Poses, symmetric: bool) -> Array:
    """(r, 6) from the other pose to one: mm, and turns as arcs in mm; of a symmetric tool those of its
    axis."""
    turn = rotation_vector(one.rotation @ np.swapaxes(other.rotation, -1, -2))
    if symmetric:
        axis = other.rotation[:, :, 2]
        turn = turn - np.sum(turn * axis, axis=1)[:, None] * axis
    return np.concatenate((one.position - other.position, ARM_MM * turn), axis=1)
