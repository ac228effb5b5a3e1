"""From poses of the tool to axis values near given ones: Newton's method, so that the branch is kept.

The position is met; of what meets it the least residual of orientation is taken, and where that leaves a
choice, each step changes the axes least. What a chain can correct follows from its Jacobian: no structure
has its own rule.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.errors import NotInvertible
from olp.core.values import dataclass
from olp.kinematics.chain import Kinematics
from olp.kinematics.columns import BATCH
from olp.kinematics.poses import Poses, relative, turned
from olp.kinematics.regular import RegularSteps
from olp.kinematics.structure import REFERENCE_RADIUS_MM

#: deg; an exact correction of an axis by more is made smaller, where nothing else is said.
LARGEST_TURN_DEG = 1.0
#: Position of the tip is met within this, mm.
POSITION_MM = 1e-9
#: Axis values no longer change: mm, and rad times the reference radius.
_SETTLED_MM = 1e-8
#: After a step below this the slopes are taken as before: mm, and rad times the reference radius.
_SAME_SLOPES_MM = 0.5
#: Coordinates of a place.
_PLACE = 3
#: A step of so many rows costs less than one row that is solved with all safeguards.
_WORTH = 100
#: By so much less than the last step the next one is taken to shrink.
_MARGIN = 10.0
#: No division by less.
_TINY = 1e-300
#: So many steps with the same slopes suffice at a regular posture.
_FEW_STEPS = 6
#: At most so many steps; from a posture nearby three suffice.
_MOST_STEPS = 100
#: A step of a rotary axis is at most this long, so that the branch is kept, in rad.
_LONGEST_RAD = 0.2
#: A step of a linear axis is at most this long, mm.
_LONGEST_MM = 200.0
#: Below this a direction of the scaled Jacobian does not move the tool: rounding alone is below 1e-12.
_MOVES = 1e-7
#: Below this a direction is left out where the exact solution is not found: a tilt of 1 mrad then costs at
#: most 20 mrad of an axis.
_MOVES_WELL = 0.05
#: A turn that is left at a singular posture is said from this on, rad.
_LEFT_RAD = 1e-7
#: A posture beside another one is by so much from it, and up to twice as much, deg.
_BESIDE_DEG = 3.0
#: A command turns no axis by more than so many times the largest turn that the orientation may need: what the
#: position needs comes on top of that.
_FARTHEST = 2.0
#: Half the step of differences of the actual motion, rad; times the reference radius in mm.
_HALF_STEP = 1e-5

Forward = Callable[[Array], Poses]
Slopes = Callable[[Array], Array]


@dataclass(frozen=True, slots=True, eq=False)
class Solved:
    """(n, axes) axis values in mm and deg, the (n, 3) rotation vectors in rad from the tool to its target
    that they leave, and where an axis was `limited` (n,) near a singular posture."""

    values: Array
    left_rad: Array
    limited: Mask


@dataclass(frozen=True, slots=True, eq=False)
class _Task:
    """Rows to be solved: targets, and the axis values to start from. `free` (n, axes, axes) takes from scaled
    changes of the axes what may not change. `asked` (n, k, k) takes from turns of the tool what is not asked
    for. `scale` (axes,) turns axis values into mm: 1, or the reference radius per degree."""

    target: Poses
    near: Array
    free: Array
    asked: Array
    scale: Array
    radius_mm: float
    symmetric: bool
    moves: float = _MOVES

    def only(self, rows: Index | Mask) -> _Task:
        return replace(
            self,
            target=self.target.only(rows),
            near=self.near[rows],
            free=self.free[rows],
            asked=self.asked[rows],
        )


def inverse(
    machine: Kinematics,
    target: Poses,
    near: Array,
    *,
    reference_radius_mm: float = REFERENCE_RADIUS_MM,
    largest_turn_deg: float | None = None,
    nominal: bool = False,
) -> Solved:
    """Axis values at which the tool is at `target`, found from `near` (n, axes) in mm and deg.

    A turn counts as its arc at `reference_radius_mm`. Axes whose joint is not to be corrected stay. Where the
    orientation needs a motion of the axes that turns one of them by x, more than `largest_turn_deg` L, that
    motion is made smaller, to L^2 / x: at a singular posture to nothing. The position is met all the same,
    and the rest of the orientation is left. `nominal` asks for the machine without errors. Raises
    NotInvertible with all rows where no axis values meet the position, or where these turn an axis by more
    than 2 L.
    """
    structure = machine.structure
    near = np.asarray(near, float)
    rotary = np.array([joint.unit == "deg" for joint in structure.joints.values()])
    free = np.array([joint.correct for joint in structure.joints.values()])
    forward: Forward = machine.nominal if nominal else machine.actual
    turns = 2 if structure.symmetric_tool else 3
    task = _Task(
        target.rows(len(near)),
        near,
        np.broadcast_to(np.diag(free.astype(float)), (len(near), len(free), len(free))),
        np.broadcast_to(np.eye(turns), (len(near), turns, turns)),
        np.where(rotary, np.radians(1.0) * reference_radius_mm, 1.0),
        reference_radius_mm,
        structure.symmetric_tool,
    )
    slopes: Slopes = partial(_scaled_jacobian, machine, task.scale, reference_radius_mm)
    if not nominal and int(free.sum()) > (5 if structure.symmetric_tool else 6):
        # which of many solutions is reached depends on the slopes: those of the machine itself are taken
        slopes = partial(_differences, forward, task.scale, reference_radius_mm)
    values, left, met = _regular(task, free, forward, slopes, largest_turn_deg)
    limited, bad, hard = np.zeros(len(near), bool), np.zeros(len(near), bool), np.flatnonzero(~met)
    if hard.size:
        part = task.only(hard)
        if largest_turn_deg is not None:
            part, limited[hard] = _bounded(part, forward, slopes, rotary, largest_turn_deg)
        values[hard], met = _newton(part, forward, slopes)
        again = hard[~met]
        if again.size:
            well = replace(part.only(~met), moves=_MOVES_WELL)
            values[again], now = _newton(well, forward, slopes)
            limited[again] = True
            bad[again] = ~now
        left[hard] = relative(forward(values[hard]).rotation, task.target.rotation[hard])
    if largest_turn_deg is not None:
        turn = np.max(np.abs(np.where(rotary, values - near, 0.0)), axis=1, initial=0.0)
        bad |= turn > _FARTHEST * largest_turn_deg
    if bad.any():
        raise _none_near(machine, np.flatnonzero(bad))
    return Solved(values, left, limited)


def command(
    machine: Kinematics,
    values: Array,
    *,
    reference_radius_mm: float = REFERENCE_RADIUS_MM,
    largest_turn_deg: float | None = LARGEST_TURN_DEG,
) -> Solved:
    """The axis values that bring the actual tool to where the nominal one is at `values` (n, axes). Raises as
    `inverse`."""
    return inverse(
        machine,
        machine.nominal(np.asarray(values, float)),
        values,
        reference_radius_mm=reference_radius_mm,
        largest_turn_deg=largest_turn_deg,
    )


def _none_near(machine: Kinematics, rows: Index) -> NotInvertible:
    more = f" (and {len(rows) - 1} other rows)" if len(rows) > 1 else ""
    error = NotInvertible(
        f"row {rows[0]}{more}: no axis values of {machine.structure.name!r} near the given ones bring the "
        "tool to its target; expected a target within reach, and a posture away from a singular one"
    )
    error.rows = tuple(rows.tolist())
    return error


def _regular(
    task: _Task, free: Mask, forward: Forward, slopes: Slopes, largest_deg: float | None
) -> tuple[Array, Array, Mask]:
    """Axis values, the turns (n, 3) that they leave, and which rows are found so: those at regular postures
    whose first step turns no axis far. Of more axes than are needed none is."""
    values, left, met = task.near.copy(), np.zeros((len(task.near), 3)), np.zeros(len(task.near), bool)
    count, asked = int(free.sum()), 5 if task.symmetric else 6
    if count not in (_PLACE, asked):
        return values, left, met
    longest = _LONGEST_RAD if largest_deg is None else min(np.radians(largest_deg), _LONGEST_RAD)
    for a in range(0, len(values), BATCH):
        rows = np.arange(a, min(a + BATCH, len(values)))
        part, here = task.only(rows), values[rows]
        steps = RegularSteps.of(_asked_rows(part, slopes(here), count)[:, free])
        found, size = steps.regular, np.full(len(rows), np.inf)
        for number in range(_FEW_STEPS):
            pose = forward(here)
            miss = _miss(part, pose).T[:count]
            step = steps(miss)
            before, size = size, np.max(np.abs(step), axis=0)
            # with the same slopes each step shrinks by the same share
            shrinks = np.minimum(1.0, _MARGIN * size / np.maximum(before, _TINY)) if number else 1.0
            if number == 0:
                found = found & (np.linalg.norm(step, axis=0) < longest * task.radius_mm)
            here[:, free] += (np.where(found, step, 0.0) / task.scale[free, None]).T
            away = np.linalg.norm(miss[:3], axis=0)
            settled = (away * shrinks < POSITION_MM) & (size * shrinks < _SETTLED_MM)
            if _WORTH * np.count_nonzero(found & ~settled) <= len(rows):
                break
        met[rows] = found & settled
        values[rows] = np.where(met[rows, None], here, values[rows])
        left[rows] = relative(pose.rotation, part.target.rotation)
    return values, left, met


def _asked_rows(task: _Task, slopes: Array, count: int) -> Array:
    """(m, axes, n) how the tip moves by the axes and, with more than three of them, how the tool turns."""
    columns = slopes.transpose(1, 2, 0)
    if count == _PLACE:
        return np.asarray(columns[:_PLACE])
    if not task.symmetric:
        return np.asarray(columns)
    rotation = task.target.rotation
    across = [sum(rotation[:, k, i] * columns[_PLACE + k] for k in range(3)) for i in range(2)]
    return np.concatenate((columns[:_PLACE], np.stack(across)))


def _bounded(
    task: _Task, forward: Forward, slopes: Slopes, rotary: Mask, largest_deg: float
) -> tuple[_Task, Mask]:
    """The task without the motions of axes that would turn one of them by x, more than L, and without the
    turns of the tool that they are for. Such a motion is made beforehand, by L^2 / x. And the rows (n,) where
    there is one.

    Of a first step the orientation needs up to three motions that keep the tip. They are at right angles to
    each other, and near a singular posture one of them is long."""
    miss = _miss(task, forward(task.near))[..., None]
    shifts, turns = _parts_of(task, slopes(task.near))
    place = _pseudo_inverse(shifts, _MOVES) @ miss[:, :3]
    left, size, right = np.linalg.svd(_of_still_tips(shifts, turns), full_matrices=False)
    share = np.swapaxes(left, -1, -2) @ (miss[:, 3:] - turns @ place)
    long = np.where(size > task.moves, share[..., 0] / np.maximum(size, task.moves), 0.0)
    motions = long[..., None] * right
    turn = np.max(np.abs(np.where(rotary, motions / task.scale, 0.0)), axis=2)
    far = turn > largest_deg
    # at a singular posture itself that motion does not turn the tool at all, however long it is
    given = np.linalg.norm(np.where(size > task.moves, 0.0, share[..., 0]), axis=1)
    lost = np.count_nonzero(size > task.moves, axis=1) < _turns_elsewhere(task, forward, slopes, rotary)
    at_it = lost & (given > _LEFT_RAD * task.radius_mm)
    less = np.where(far, largest_deg / np.maximum(turn, largest_deg), 0.0) ** 2
    near = task.near + np.sum(less[..., None] * motions, axis=1) / task.scale
    held, given_up = np.where(far[..., None], right, 0.0), np.where(far[:, None, :], left, 0.0)
    free = task.free - np.swapaxes(held, -1, -2) @ held
    asked = task.asked - given_up @ np.swapaxes(given_up, -1, -2)
    return replace(task, near=near, free=free, asked=asked), np.asarray(far.any(axis=1) | at_it)


def _turns_elsewhere(task: _Task, forward: Forward, slopes: Slopes, rotary: Mask) -> int:
    """How many turns of the tool the axes make while the tip stays: at a posture beside the first one, where
    no chance makes it singular."""
    one = task.only(np.arange(1))
    beside = one.near + np.where(rotary, _BESIDE_DEG * (1.0 + np.arange(len(rotary)) / len(rotary)), 0.0)
    there = replace(one, target=forward(beside))
    size = np.linalg.svd(_of_still_tips(*_parts_of(there, slopes(beside))), compute_uv=False)
    return int(np.count_nonzero(size > task.moves))


def _newton(task: _Task, forward: Forward, slopes: Slopes) -> tuple[Array, Mask]:
    """Axis values, and which rows met their position."""
    values = task.near.copy()
    met = np.zeros(len(values), bool)
    longest = np.where(task.scale == 1.0, _LONGEST_MM, _LONGEST_RAD * task.radius_mm)
    open_rows = np.arange(len(values), dtype=np.int64)
    steps_of = np.zeros((len(values), values.shape[1], 5 if task.symmetric else 6))
    moved = np.ones(len(values), bool)
    for _ in range(_MOST_STEPS):
        if not len(open_rows):
            break
        part = task.only(open_rows)
        here = values[open_rows]
        again = open_rows[moved]
        if len(again):
            steps_of[again] = _steps_of(task.only(again), slopes(values[again]))
        miss = _miss(part, forward(here))
        step = (steps_of[open_rows] @ miss[..., None])[..., 0]
        distance = np.linalg.norm(miss[:, :3], axis=1)
        share = np.max(np.abs(step) / longest, axis=1)
        step /= np.maximum(1.0, share)[:, None]
        values[open_rows] = here + step / part.scale
        size = np.max(np.abs(step), axis=1)
        settled = (distance < POSITION_MM) & (size < _SETTLED_MM)
        met[open_rows[settled]] = True
        open_rows, moved = open_rows[~settled], size[~settled] > _SAME_SLOPES_MM
    return values, met


def _miss(task: _Task, pose: Poses) -> Array:
    """(n, 5 or 6) what is missing to the target: mm of the tip, and rad times the radius; of a symmetric tool
    across its axis, in its own frame."""
    turn = relative(task.target.rotation, pose.rotation) * task.radius_mm
    if task.symmetric:
        turn = turned(np.swapaxes(task.target.rotation, -1, -2), turn)[:, :2]
    return np.concatenate(
        (task.target.position - pose.position, (task.asked @ turn[..., None])[..., 0]), axis=1
    )


def _steps_of(task: _Task, slopes: Array) -> Array:
    """(n, axes, 5 or 6) the scaled change of the axes by what is missing: first the position, then of what
    moves it not the orientation, then the least change."""
    shifts, turns = _parts_of(task, slopes)
    back = _pseudo_inverse(shifts, _MOVES)
    rest = _pseudo_inverse(_of_still_tips(shifts, turns), task.moves)
    return np.concatenate((back - rest @ turns @ back, rest), axis=2)


def _parts_of(task: _Task, slopes: Array) -> tuple[Array, Array]:
    """(n, 3, axes) how the tip moves by what may move, and (n, 2 or 3, axes) how the tool turns."""
    slopes = slopes @ task.free
    shifts, turns = slopes[:, :3], slopes[:, 3:]
    if task.symmetric:
        turns = (np.swapaxes(task.target.rotation, -1, -2) @ turns)[:, :2]
    return shifts, task.asked @ turns


def _of_still_tips(shifts: Array, turns: Array) -> Array:
    """(n, 2 or 3, axes) how the tool turns by motions that keep the tip where it is."""
    return np.asarray(turns - turns @ _pseudo_inverse(shifts, _MOVES) @ shifts)


def _pseudo_inverse(matrices: Array, least: float) -> Array:
    """(n, k, m) pseudo-inverses of (n, m, k), without singular values below `least`."""
    left, size, right = np.linalg.svd(matrices, full_matrices=False)
    inverse_size = np.where(size > least, 1.0 / np.maximum(size, least), 0.0)
    return np.asarray(np.swapaxes(right, -1, -2) @ (inverse_size[..., None] * np.swapaxes(left, -1, -2)))


def _scaled_jacobian(machine: Kinematics, scale: Array, radius_mm: float, values: Array) -> Array:
    """(n, 6, axes) of the nominal machine: mm, and rad times the radius, per scaled mm of each axis."""
    slopes = machine.jacobian(values)
    slopes[:, 3:] *= radius_mm
    return np.asarray(slopes / np.where(scale == 1.0, 1.0, radius_mm))


def _differences(forward: Forward, scale: Array, radius_mm: float, values: Array) -> Array:
    """The same of any motion, by central differences."""
    slopes = np.zeros((len(values), 6, len(scale)))
    for column, unit in enumerate(scale):
        ahead, behind = values.copy(), values.copy()
        half = _HALF_STEP * radius_mm
        ahead[:, column] += half / unit
        behind[:, column] -= half / unit
        after, before = forward(ahead), forward(behind)
        turn = relative(after.rotation, before.rotation)
        slopes[:, :3, column] = (after.position - before.position) / (2.0 * half)
        slopes[:, 3:, column] = turn * radius_mm / (2.0 * half)
    return slopes
