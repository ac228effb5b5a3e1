"""The proof of a correction on a machine with rotary joints: position and orientation, at and between
waypoints.

The corrected text is read again. Each of its moves is put on the nominal move that it belongs to, and the
machine with its errors is run along it.
"""

from __future__ import annotations

import numpy as np

from olp.compensation.joints.arm_path import ArmPath
from olp.compensation.joints.path import JointPath
from olp.compensation.joints.planning import LITTLE_LEFT, JointLimits, JointPlan
from olp.core.arrays import Array, Index, Mask
from olp.core.errors import ProgramError
from olp.core.values import dataclass
from olp.kinematics.correction import deviations
from olp.proof.joint_places import ARM_MM, BATCH, Places, visited

#: The share of the rounding of three linear words that comes together at most: half a digit each.
_HALF_DIGITS = 0.5 * np.sqrt(3.0)
#: The same of two rotary words.
_HALF_TURNS = 0.5 * np.sqrt(2.0)
#: The rounding of one rotary word at most, in digits.
_HALF_TURN = 0.5
#: A move ends where its command is expected within so many digits.
_NEAR_DIGITS = 4.0
#: Moves more than planned among which the end of one is looked for at first.
_NEAR_BY = 64
#: A waypoint is another one beyond this, mm or deg.
_FAR = 1.0
#: Share of waypoints that may be far off before the programs count as different jobs.
_MOST_FAR = 0.5
#: Samples of a corrected stretch are so many times those of the plan, and one: so none falls on one of the
#: plan.
_FINER = 2
#: Rows of a Jacobian: mm of the tip, and rad of the tool.
_PLACE_AND_TURN = (slice(0, 3), slice(3, 6))


@dataclass(frozen=True, slots=True, eq=False)
class Deviation:
    """By nominal move (n,): the largest distance of the tip in mm and angle of the tool in rad, NaN where
    none is known. `correctable_rad` (n,) are the parts of such angles that the axes could take back, where
    others remain. `unknown_mm` and `unknown_rad` (n,) are parts of all three, by which a deviation may be
    larger because the side of the backlash is not known yet. Squares are summed over `samples` (n,)
    places."""

    distance_mm: Array
    angle_rad: Array
    unknown_mm: Array
    unknown_rad: Array
    correctable_rad: Array
    square_mm2: Array
    square_rad2: Array
    samples: Index


@dataclass(frozen=True, slots=True, eq=False)
class JointProof:
    """The proof of two programs. `groups` (n,) is the last corrected move of each nominal one. `left_rad`
    (n,) are angles that no command corrects, `over_rad` what is beyond them. `judged` (n,) are the feed
    moves. `allowed_mm`, `allowed_rad`: the tolerances with what rounding to the last digit explains. `over`
    (n,) are moves beyond these."""

    groups: Index
    before: Deviation
    after: Deviation
    left_rad: Array
    over_rad: Array
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
    left = _left(plan, len(nominal))
    partly = _partly(nominal, plan, left > LITTLE_LEFT * limits.tolerance_rad)
    after = _deviation(nominal, corrected, groups, plan, partly)
    before = _deviation(nominal, nominal, np.arange(len(nominal)), plan, np.zeros(len(nominal), bool))
    rounded_mm, rounded_rad = _rounding(nominal, plan, digit_mm, digit_deg)
    allowed_mm = limits.tolerance_mm + rounded_mm
    allowed_rad = limits.tolerance_rad + rounded_rad
    judged = nominal.judged & np.isfinite(after.distance_mm)
    over_rad = np.fmax(after.angle_rad - left, after.correctable_rad)
    over = judged & ((after.distance_mm > allowed_mm) | (over_rad > allowed_rad))
    return JointProof(groups, before, after, left, over_rad, judged, allowed_mm, allowed_rad, over)


def _left(plan: JointPlan, count: int) -> Array:
    """(n,) the largest angle that no command corrects, at the begin of a move, along it and at its end."""
    left, ends = np.zeros(count), np.zeros(count)
    np.maximum.at(left, plan.move, plan.left_rad)
    ends[plan.move] = plan.left_rad
    return np.asarray(np.maximum(left, np.append(0.0, ends[:-1])[:count]))


def _partly(path: JointPath, plan: JointPlan, left: Mask) -> Mask:
    """(n,) moves of which a part of the orientation is corrected, and another is `left` (n,)."""
    bounded = np.zeros(len(path), bool)
    bounded[plan.move[plan.limited]] = True
    bounded[1:] |= bounded[:-1]
    return np.asarray(left & ~bounded & ~path.held & path.judged, bool)


def _rounding(path: JointPath, plan: JointPlan, digit_mm: float, digit_deg: float) -> tuple[float, float]:
    """mm and rad by which the tip and the tool are off at most because words have a last digit. In G-code the
    linear words take up what the rounding of rotary ones does to the tip, and a tip that is rounded along the
    path is beside another direction. In lists nothing does, nor where robots count steps of motors."""
    if path.listed is None:
        rounded_mm = _HALF_DIGITS * digit_mm
        beside = rounded_mm / (2.0 * ARM_MM)
        rounded_rad = _HALF_TURNS * float(np.radians(digit_deg)) + beside
        if not isinstance(path, ArmPath) or not path.half_deg.any():
            return rounded_mm, rounded_rad
        steps_mm, steps_rad = largest_steps(path, plan, path.half_deg[plan.move])
        return max(rounded_mm, steps_mm), max(rounded_rad, steps_rad)
    return largest_steps(path, plan, np.tile(0.5 * 10.0 ** -path.places.astype(float), (len(plan.move), 1)))


def largest_steps(path: JointPath, plan: JointPlan, half: Array) -> tuple[float, float]:
    """mm and rad by which the tip and the tool are off at most where axes are off by `half` (r, axes) mm or
    deg at the rows of a plan."""
    rows, most = np.flatnonzero(np.isfinite(plan.axes).all(axis=1)), np.zeros(2)
    for a in range(0, len(rows), BATCH):
        some = rows[a : a + BATCH]
        sizes = _moved(path, plan.axes[some], path.tool[plan.move[some]], half[some])
        most = np.maximum(most, np.max(sizes, axis=1))
    return float(most[0]), float(most[1])


def _moved(path: JointPath, axes: Array, tool: Index, half: Array) -> tuple[Array, Array]:
    """(r,) mm and (r,) rad by which the tip and the tool are off at most where axes are off by `half`
    (r, axes) mm or deg."""
    rotary = np.array([unit == "deg" for unit in path.motion.structure.units])
    size = np.where(rotary, np.radians(half), half)
    slopes = path.motion.slopes(axes, tool)
    place, turn = ((np.linalg.norm(slopes[:, part], axis=1) * size).sum(axis=1) for part in _PLACE_AND_TURN)
    return place, turn


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
    rotary = nominal.coordinates.rotary
    near = _NEAR_DIGITS * np.where(rotary, digit_deg, digit_mm)
    near = nominal.directions.widened(nominal.motion, near, expected)
    groups = np.arange(count)
    if isinstance(nominal, ArmPath) and other == len(plan.move):
        # each row of the plan has a statement
        groups = last
    elif other > count:
        parts = np.bincount(plan.move, minlength=count)
        feed = nominal.feed & ~nominal.holes.whole
        # one that does not cut is gone past at most
        parts = np.where(feed | (parts > 1), parts, 0)
        if nominal.listed is None and not isinstance(nominal, ArmPath):
            near[:, ~rotary] += _taken_up(nominal, plan, last, digit_deg)[:, None]
        groups = _stretched(expected, corrected.end, near, parts, nominal.curves.mask | ~feed)
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


def _taken_up(path: JointPath, plan: JointPlan, rows: Index, digit_deg: float) -> Array:
    """(r,) mm at rows of a plan by which linear words take up what the rounding of rotary ones does to the
    tip. Their own digits may be finer, as in inches."""
    found, known = np.zeros(len(rows)), np.isfinite(plan.axes[rows]).all(axis=1)
    some = rows[known]
    rotary = np.array([unit == "deg" for unit in path.motion.structure.units])
    half = np.broadcast_to(np.where(rotary, _HALF_TURN * digit_deg, 0.0), (len(some), len(rotary)))
    found[known] = _moved(path, plan.axes[some], path.tool[plan.move[some]], half)[0]
    return found


def _stretched(expected: Array, end: Array, near: Array, parts: Index, twice: Mask) -> Index:
    """The ends of nominal moves among more moves of the corrected program: each that has `parts` (n,) as
    planned ends with the next one that is where it is expected. One that may pass there `twice` (n,), as an
    arc does, ends with the one that comes nearest to its number of parts."""
    count, spare, shift = len(expected), len(end) - len(expected), 0
    expected, end, groups = np.nan_to_num(expected), np.nan_to_num(end), np.arange(count)
    wanted = np.where(twice, np.maximum(parts - 1, 0), 0)
    i, run = 0, _NEAR_BY
    while i < count and shift < spare:
        # mostly a move ends with the very next one
        mine = slice(i, i + run)
        there = _there(end[i + shift : i + shift + run][: count - i], expected[mine], near[mine])
        at_once = np.append((parts[mine] == 0) | ((wanted[mine] == 0) & there), False)
        passed = int(np.argmin(at_once))
        groups[i : i + passed] += shift
        i, run = i + passed, _NEAR_BY + 2 * passed
        if passed < len(there):
            j, left, found = i + shift, spare - shift, np.zeros(0, np.int64)
            for reach in (min(2 * int(parts[i]) + _NEAR_BY, left), left):
                if not found.size:
                    found = np.flatnonzero(_there(end[j : j + reach + 1], expected[i], near[i]))
            shift += int(found[np.argmin(np.abs(found - wanted[i]))]) if found.size else 0
            groups[i] = i + shift
            i += 1
    groups[i:] += shift
    groups[-1] = len(end) - 1
    return groups


def _there(end: Array, expected: Array, near: Array) -> Mask:
    """(r,) which moves end where it is expected."""
    return np.asarray((np.abs(end - expected) / near).max(axis=1) <= 1.0)


def _deviation(
    nominal: JointPath, path: JointPath, groups: Index, plan: JointPlan, partly: Mask
) -> Deviation:
    """The deviation of the machine that runs `path` from the nominal poses, by nominal move. Of moves
    `partly` (n,) the orientation is corrected in part."""
    result = _Sums(partly)
    finer = 1 if path is nominal else _FINER
    for places in visited(nominal, path, groups, plan, ~nominal.kept, nominal.feed, finer):
        result.add(nominal, path, places)
    return result.done()


class _Sums:
    """Deviations while they are collected."""

    def __init__(self, partly: Mask) -> None:
        count = len(partly)
        self.partly, self.correctable = partly, np.zeros(count)
        self.largest = np.full((count, 2), -np.inf)
        self.unknown, self.square = np.zeros((count, 2)), np.zeros((count, 2))
        self.samples = np.zeros(count, np.int64)

    def add(self, nominal: JointPath, path: JointPath, places: Places) -> None:
        if not len(places.rows):
            return
        axes, actual, target = places.both(nominal, path)
        unknown = _unknown(path, places, axes)
        both = np.stack(deviations(path.motion.structure, actual, target), axis=1) + unknown
        np.maximum.at(self.unknown, places.move, unknown)
        rows = np.flatnonzero(self.partly[places.move])
        if rows.size:
            tool, poses = path.tool[places.rows[rows]], (actual.only(rows), target.only(rows))
            angle = path.motion.correctable(axes[rows], tool, *poses) + unknown[rows, 1]
            np.maximum.at(self.correctable, places.move[rows], angle)
        np.maximum.at(self.largest, places.move, both)
        np.add.at(self.square, places.move, both * both)
        np.add.at(self.samples, places.move, 1)

    def done(self) -> Deviation:
        known = self.samples > 0
        largest = np.where(known[:, None], self.largest, np.nan)
        return Deviation(
            largest[:, 0], largest[:, 1], self.unknown[:, 0], self.unknown[:, 1], self.correctable,
            self.square[:, 0], self.square[:, 1], self.samples,
        )  # fmt: skip


def _unknown(path: JointPath, places: Places, axes: Array) -> Array:
    """(r, 2) mm and rad by which the tip and the tool may be off at most, at axis values (r, axes), because
    the side of the backlash is not known."""
    most, rows = np.zeros((len(axes), 2)), np.flatnonzero(places.unknown.any(axis=1))
    if rows.size:
        half = 0.5 * np.abs(path.motion.width) * places.unknown[rows]
        most[rows] = np.stack(_moved(path, axes[rows], path.tool[places.rows[rows]], half), axis=1)
    return most
