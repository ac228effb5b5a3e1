"""The proof of a correction on a machine with rotary joints: position and orientation, at and between
waypoints.

The corrected text is read again. Each of its moves is put on the nominal move that it belongs to, and the
machine with its errors is run along it.
"""

from __future__ import annotations

import numpy as np

from olp.compensation.joints.path import JointPath
from olp.compensation.joints.planning import JointLimits, JointPlan
from olp.compensation.joints.sampling import Resolution, spread
from olp.core.arrays import Array, Index, Mask
from olp.core.errors import ProgramError
from olp.core.values import dataclass
from olp.errormodel.reversal import play_after, play_states
from olp.kinematics.correction import deviations
from olp.kinematics.poses import Poses, rotation_vector

#: The share of the rounding of three linear words that comes together at most: half a digit each.
_HALF_DIGITS = 0.5 * np.sqrt(3.0)
#: The same of two rotary words.
_HALF_TURNS = 0.5 * np.sqrt(2.0)
#: A move ends where its command is expected within so many digits.
_NEAR_DIGITS = 4.0
#: A waypoint is another one beyond this, mm or deg.
_FAR = 1.0
#: Share of waypoints that may be far off before the programs count as different jobs.
_MOST_FAR = 0.5
#: The arm in mm at which a turn counts as much as a shift, where a place on a move is found.
_ARM_MM = 100.0
#: Steps by which a place on a move is found.
_STEPS = 3
#: Samples of a corrected stretch are so many times those of the plan, and one: so none falls on one of the
#: plan.
_FINER = 2
#: Rows of a Jacobian: mm of the tip, and rad of the tool.
_PLACE_AND_TURN = (slice(0, 3), slice(3, 6))
#: Places at a time, so that memory is small.
_BATCH = 1 << 15


@dataclass(frozen=True, slots=True, eq=False)
class Deviation:
    """By nominal move (n,): the largest distance of the tip in mm and angle of the tool in rad, NaN where
    none is known. Their squares are summed over `samples` (n,) places."""

    distance_mm: Array
    angle_rad: Array
    square_mm2: Array
    square_rad2: Array
    samples: Index


@dataclass(frozen=True, slots=True, eq=False)
class JointProof:
    """The proof of two programs. `groups` (n,) is the last corrected move of each nominal one. `left_rad`
    (n,) are angles that no command corrects. `judged` (n,) are the feed moves. `allowed_mm`, `allowed_rad`:
    the tolerances with what rounding to the last digit explains. `over` (n,) are moves beyond these."""

    groups: Index
    before: Deviation
    after: Deviation
    left_rad: Array
    judged: Mask
    allowed_mm: float
    allowed_rad: float
    over: Mask

    @property
    def holds(self) -> bool:
        return not bool(self.over.any())


def prove_joints(
    nominal: JointPath, corrected: JointPath, plan: JointPlan, limits: JointLimits, *, digit_mm: float,
    digit_deg: float,
) -> JointProof:  # fmt: skip
    """The proof of `corrected`, with the plan of the nominal program; digits are the coarsest last ones.
    Raises ProgramError where it is no correction of the nominal program."""
    groups = match(nominal, corrected, plan, digit_mm, digit_deg)
    after = _deviation(nominal, corrected, groups, plan)
    before = _deviation(nominal, nominal, np.arange(len(nominal)), plan)
    left = _left(plan, len(nominal))
    rounded_mm, rounded_rad = _rounding(nominal, plan, digit_mm, digit_deg)
    allowed_mm = limits.tolerance_mm + rounded_mm
    allowed_rad = limits.tolerance_rad + rounded_rad
    judged = nominal.judged & np.isfinite(after.distance_mm)
    over = judged & ((after.distance_mm > allowed_mm) | (after.angle_rad - left > allowed_rad))
    return JointProof(groups, before, after, left, judged, allowed_mm, allowed_rad, over)


def _left(plan: JointPlan, count: int) -> Array:
    """(n,) the largest angle that no command corrects, at the begin of a move, along it and at its end."""
    left, ends = np.zeros(count), np.zeros(count)
    np.maximum.at(left, plan.move, plan.left_rad)
    ends[plan.move] = plan.left_rad
    return np.asarray(np.maximum(left, np.append(0.0, ends[:-1])[:count]))


def _rounding(path: JointPath, plan: JointPlan, digit_mm: float, digit_deg: float) -> tuple[float, float]:
    """mm and rad by which the tip and the tool are off at most because words have a last digit. In G-code the
    linear words take up what the rounding of rotary ones does to the tip, and a tip that is rounded along the
    path is beside another direction; in lists nothing does."""
    if path.listed is None:
        rounded_mm = _HALF_DIGITS * digit_mm
        beside = rounded_mm / (2.0 * _ARM_MM)
        return rounded_mm, _HALF_TURNS * float(np.radians(digit_deg)) + beside
    rotary = np.array([unit == "deg" for unit in path.motion.structure.units])
    half = 0.5 * 10.0 ** -path.places.astype(float)
    half[rotary] = np.radians(half[rotary])
    rows, most = np.flatnonzero(np.isfinite(plan.axes).all(axis=1)), np.zeros(2)
    for a in range(0, len(rows), _BATCH):
        some = rows[a : a + _BATCH]
        slopes = path.motion.slopes(plan.axes[some], path.tool[plan.move[some]])
        sizes = np.stack([np.linalg.norm(slopes[:, part], axis=1) @ half for part in _PLACE_AND_TURN])
        most = np.maximum(most, sizes.max(axis=1))
    return float(most[0]), float(most[1])


def match(
    nominal: JointPath, corrected: JointPath, plan: JointPlan, digit_mm: float, digit_deg: float
) -> Index:
    """(n,) the corrected move with which each nominal one ends. Raises ProgramError where the programs do not
    belong together."""
    count, other = len(nominal), len(corrected)
    if other < count:
        raise ProgramError(
            f"the corrected program has {other} moves, fewer than the {count} of the nominal "
            "one, so it is not "
            "a correction of it; give the two programs of one job",
            code="OLP562",
        )
    last = np.flatnonzero(np.append(plan.move[1:] != plan.move[:-1], True)[: len(plan.move)])
    expected = np.where(np.isnan(plan.command[last]), nominal.end, plan.command[last])
    rotary = np.array([unit == "deg" for unit in nominal.motion.structure.units])
    near = _NEAR_DIGITS * np.where(rotary, digit_deg, digit_mm)
    near = nominal.directions.widened(nominal.motion, near, expected)
    groups = np.arange(count)
    if other > count:
        groups = _stretched(expected, corrected.end, near, nominal.feed & ~nominal.holes.whole)
    away = np.nanmax(
        np.append(np.abs(corrected.end[groups] - expected), np.zeros((count, 1)), axis=1), axis=1
    )
    far = away > _FAR
    if far.sum() > _MOST_FAR * count:
        raise ProgramError(
            f"{int(far.sum())} of {count} moves end elsewhere than those of the "
            "nominal program, the first at "
            f"its line {int(nominal.line[np.argmax(far)])}; it is not a correction of "
            "this program for this machine",
            code="OLP562",
        )
    return groups


def _stretched(expected: Array, end: Array, near: Array, feed: Mask) -> Index:
    """The ends of nominal moves among more moves of the corrected program: each feed move ends with the next
    one that is where it is expected."""
    spare, groups, j = len(end) - len(expected), [], 0
    expected, end = np.nan_to_num(expected), np.nan_to_num(end)
    for i, split in enumerate(feed.tolist()):
        if split and spare:
            away = (np.abs(end[j : j + spare + 1] - expected[i]) / near[i]).max(axis=1)
            found = int(np.argmax(away <= 1.0)) if (away <= 1.0).any() else 0
            spare -= found
            j += found
        groups.append(j)
        j += 1
    groups[-1] = len(end) - 1
    return np.array(groups)


def _deviation(nominal: JointPath, path: JointPath, groups: Index, plan: JointPlan) -> Deviation:
    """The deviation of the machine that runs `path` from the nominal poses, by nominal move."""
    motion, count = path.motion, len(nominal)
    owner = np.searchsorted(groups, np.arange(len(path)))
    owner = np.minimum(owner, max(count - 1, 0))
    known = np.isfinite(path.end).all(axis=1) & np.isfinite(nominal.end[owner]).all(axis=1)
    begun = np.isfinite(path.start).all(axis=1) & np.isfinite(nominal.start[owner]).all(axis=1)
    ends = np.flatnonzero(known & ~nominal.kept[owner])
    axes = np.full(path.end.shape, np.nan)
    axes[known] = motion.axes(path.end[known], path.tool[known], path.tip[known])
    start = np.full(path.end.shape, np.nan)
    start[begun] = motion.axes(path.start[begun], path.tool[begun], path.tip[begun])
    play = _plays(axes, motion.width)
    before = np.vstack((np.zeros((1, len(motion.width))), play[:-1])) if len(play) else play
    shares = _shares(nominal, path, (groups, owner), plan, axes, play, known & begun & nominal.feed[owner])
    result = _Sums(count)
    result.add(nominal, path, owner[ends], ends, np.ones(len(ends)), shares[1][ends], play[ends])
    feeds = np.flatnonzero(known & begun & nominal.feed[owner])
    finer = 1 if path is nominal else _FINER
    samples = finer * Resolution.of(motion).samples(start[feeds], axes[feeds]) + 1
    totals = np.cumsum(samples)
    a = 0
    while a < len(feeds):
        b = max(int(np.searchsorted(totals, (totals[a - 1] if a else 0) + _BATCH)), a + 1)
        mine, step = spread(samples[a:b])
        rows = feeds[a:b][mine]
        part = step / samples[a:b][mine]
        share = shares[0][rows] + part * (shares[1] - shares[0])[rows]
        side = before[rows]
        if motion.width.any():
            here = motion.axes(path.at(rows, part), path.tool[rows], path.tip[rows])
            side = play_after(side, here - start[rows], np.broadcast_to(motion.width, here.shape))
        result.add(nominal, path, owner[rows], rows, part, share, side)
        a = b
    return result.done()


def _plays(axes: Array, width: Array) -> Array:
    """(m, axes) the side of the backlash of each axis behind each move."""
    play = np.zeros(axes.shape)
    if width.any():
        for first in range(0, axes.shape[1], 3):
            columns = np.full((len(axes), 3), 0.0)
            part = axes[:, first : first + 3]
            columns[:, : part.shape[1]] = part
            widths = np.zeros(3)
            widths[: part.shape[1]] = width[first : first + 3]
            play[:, first : first + 3] = play_states(columns, widths)[:, : part.shape[1]]
        play[:, width == 0.0] = 0.0
    return play


def _shares(
    nominal: JointPath, path: JointPath, pairs: tuple[Index, Index], plan: JointPlan, axes: Array,
    play: Array, feed: Mask,
) -> tuple[Array, Array]:  # fmt: skip
    """(m,) at which shares of its nominal move each move begins and ends. `pairs` are the last part of each
    nominal move, and the nominal move of each part. A part ends where the pose is nearest, as words are
    rounded along the path, too. In lists it ends as planned, where there are as many parts: the nearest
    pose is another one where the machine cannot turn the tool."""
    groups, owner = pairs
    end, number = np.ones(len(path)), np.arange(len(path))
    first = np.append(-1, groups[:-1]) + 1
    begins = np.searchsorted(plan.move, np.arange(len(nominal)))
    parts = np.append(begins[1:], len(plan.move)) - begins
    planned = (groups - first + 1 == parts)[owner] & (path.listed is not None)
    inner = feed & (groups[owner] != number)
    row = np.flatnonzero(inner & planned)
    end[row] = plan.share[begins[owner[row]] + row - first[owner[row]]]
    row = np.flatnonzero(inner & ~planned)
    if row.size:
        end[row] = _places(nominal, path, owner[row], row, axes[row], play[row])
    begin = np.append(0.0, np.where(owner[1:] == owner[:-1], end[:-1], 0.0))[: len(path)]
    return begin, np.maximum(end, begin)


def _places(nominal: JointPath, path: JointPath, move: Index, rows: Index, axes: Array, play: Array) -> Array:
    """(r,) the shares of nominal moves whose pose is nearest to that of the machine at axis values."""
    motion = nominal.motion
    actual = path.motion.actual(axes, path.tool[rows], play)
    start, way = nominal.start[move], nominal.end[move] - nominal.start[move]
    along = np.einsum("ij,ij->i", path.end[rows] - start, way)
    share = along / np.maximum(np.einsum("ij,ij->i", way, way), 1e-30)
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
    return np.concatenate((one.position - other.position, _ARM_MM * turn), axis=1)


class _Sums:
    """Deviations while they are collected."""

    def __init__(self, count: int) -> None:
        self.largest = np.full((count, 2), -np.inf)
        self.square = np.zeros((count, 2))
        self.samples = np.zeros(count, np.int64)

    def add(
        self, nominal: JointPath, path: JointPath, move: Index, rows: Index, part: Array, share: Array,
        side: Array,
    ) -> None:  # fmt: skip
        """Places on moves: at `part` of `rows` of the path, at `share` of nominal moves."""
        if not len(rows):
            return
        motion, tool = path.motion, path.tool[rows]
        place = path.at(rows, part)
        actual = motion.actual(motion.axes(place, tool, path.tip[rows]), tool, side)
        place = place if path is nominal else nominal.at(move, share)
        target = nominal.motion.targets(place, nominal.tool[move], nominal.tip[move])
        target = Poses(target.rotation, target.position + nominal.shift_mm[move])
        both = np.stack(deviations(motion.structure, actual, target), axis=1)
        np.maximum.at(self.largest, move, both)
        np.add.at(self.square, move, both * both)
        np.add.at(self.samples, move, 1)

    def done(self) -> Deviation:
        known = self.samples > 0
        largest = np.where(known[:, None], self.largest, np.nan)
        return Deviation(largest[:, 0], largest[:, 1], self.square[:, 0], self.square[:, 1], self.samples)
