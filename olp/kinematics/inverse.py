"""From poses of the tool to axis values near given ones: Newton's method, so that the branch is kept.

The position is met; of what meets it the least residual of orientation is taken, and where that leaves a
choice, each step changes the axes least. What a chain can correct follows from its Jacobian: no structure
has its own rule.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.errors import NotInvertible
from olp.core.values import dataclass
from olp.kinematics.chain import Kinematics
from olp.kinematics.poses import Poses, rotation_vector, turned

#: Position of the tip is met within this, mm.
POSITION_MM = 1e-9
#: Axis values no longer change: mm, and rad times the reference radius.
_SETTLED_MM = 1e-8
#: After a step below this the slopes are taken as before: mm, and rad times the reference radius.
_SAME_SLOPES_MM = 0.5
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
    """Rows to be solved: targets, the axis values to start from, and which axes may move (n, axes).
    `scale` (axes,) turns axis values into mm: 1, or the reference radius per degree."""

    target: Poses
    near: Array
    free: Mask
    scale: Array
    radius_mm: float
    symmetric: bool
    moves: float = _MOVES

    def only(self, rows: Index | Mask) -> _Task:
        target = Poses(self.target.rotation[rows], self.target.position[rows])
        return _Task(
            target, self.near[rows], self.free[rows], self.scale, self.radius_mm, self.symmetric, self.moves
        )


def inverse(
    machine: Kinematics,
    target: Poses,
    near: Array,
    *,
    reference_radius_mm: float = 500.0,
    largest_turn_deg: float | None = None,
    nominal: bool = False,
) -> Solved:
    """Axis values at which the tool is at `target`, found from `near` (n, axes) in mm and deg.

    A turn counts as its arc at `reference_radius_mm`. Axes whose joint is not to be corrected stay. Where a
    first step would turn a rotary axis by more than `largest_turn_deg` L, it turns by L^2 over that: at a
    singular posture not at all. Then the position is met by the other axes, and the rest of the orientation
    is left. `nominal` asks for the machine without errors. Raises NotInvertible with the row where no axis
    values meet the position.
    """
    structure = machine.structure
    near = np.asarray(near, float)
    rotary = np.array([joint.unit == "deg" for joint in structure.joints.values()])
    free = np.array([joint.correct for joint in structure.joints.values()])
    forward: Forward = machine.nominal if nominal else machine.actual
    task = _Task(
        target.rows(len(near)),
        near,
        np.broadcast_to(free, near.shape),
        np.where(rotary, np.radians(1.0) * reference_radius_mm, 1.0),
        reference_radius_mm,
        structure.symmetric_tool,
    )
    slopes: Slopes = partial(_scaled_jacobian, machine, task.scale, reference_radius_mm)
    if not nominal and int(free.sum()) > (5 if structure.symmetric_tool else 6):
        # which of many solutions is reached depends on the slopes: those of the machine itself are taken
        slopes = partial(_differences, forward, task.scale, reference_radius_mm)
    limited = np.zeros(len(near), bool)
    if largest_turn_deg is not None:
        task = _bounded(task, forward, slopes, rotary, largest_turn_deg)
        limited = np.any(task.free != free, axis=1)
    values, met = _newton(task, forward, slopes)
    if not np.all(met):
        part = task.only(~met)
        well = _Task(
            part.target, part.near, part.free, part.scale, part.radius_mm, part.symmetric, _MOVES_WELL
        )
        values[~met], now = _newton(well, forward, slopes)
        limited[~met] = True
        if not np.all(now):
            row = int(np.flatnonzero(~met)[np.argmin(now)])
            error = NotInvertible(
                f"row {row}: no axis values of {structure.name!r} near the given ones bring the tool to its "
                "target; expected a target within reach, and a posture away from a singular one"
            )
            error.row = row
            raise error
    reached = forward(values).rotation
    left = rotation_vector(reached @ np.swapaxes(task.target.rotation, -1, -2))
    return Solved(values, left, limited)


def command(
    machine: Kinematics,
    values: Array,
    *,
    reference_radius_mm: float = 500.0,
    largest_turn_deg: float | None = 1.0,
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


def _bounded(task: _Task, forward: Forward, slopes: Slopes, rotary: Mask, largest_deg: float) -> _Task:
    """The task with every axis that a first step would turn by x, more than L, standing at L^2 / x."""
    steps = _steps_of(task, slopes(task.near)) @ _miss(task, forward(task.near))[..., None]
    turn = np.where(rotary, steps[..., 0] / task.scale, 0.0)
    far = np.abs(turn) > largest_deg
    near = np.where(far, task.near + largest_deg**2 / np.where(far, turn, 1.0), task.near)
    return _Task(task.target, near, task.free & ~far, task.scale, task.radius_mm, task.symmetric, task.moves)


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
    turn = rotation_vector(task.target.rotation @ np.swapaxes(pose.rotation, -1, -2)) * task.radius_mm
    if task.symmetric:
        turn = turned(np.swapaxes(task.target.rotation, -1, -2), turn)[:, :2]
    return np.concatenate((task.target.position - pose.position, turn), axis=1)


def _steps_of(task: _Task, slopes: Array) -> Array:
    """(n, axes, 5 or 6) the scaled change of the axes by what is missing: first the position, then of what
    moves it not the orientation, then the least change."""
    slopes = np.where(task.free[:, None, :], slopes, 0.0)
    shifts, turns = slopes[:, :3], slopes[:, 3:]
    if task.symmetric:
        turns = (np.swapaxes(task.target.rotation, -1, -2) @ turns)[:, :2]
    back = _pseudo_inverse(shifts, _MOVES)
    rest = _pseudo_inverse(turns - turns @ back @ shifts, task.moves)
    return np.concatenate((back - rest @ turns @ back, rest), axis=2)


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
        turn = rotation_vector(after.rotation @ np.swapaxes(before.rotation, -1, -2))
        slopes[:, :3, column] = (after.position - before.position) / (2.0 * half)
        slopes[:, 3:, column] = turn * radius_mm / (2.0 * half)
    return slopes
