"""Platforms on legs: the pose at which every rod has its length, by Newton's method from a pose nearby."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.errors import CannotCompute
from olp.core.values import dataclass
from olp.kinematics.columns import Columns
from olp.kinematics.errors import LegErrors
from olp.kinematics.poses import Poses
from olp.kinematics.structure import Joint, Platform

#: At most so many steps of Newton's method; from a pose nearby four suffice.
_MOST_STEPS = 60
#: Rods this close to their length are in place, mm. Doubles of metres resolve 1e-12.
_IN_PLACE_MM = 1e-11
#: A step of the rotation is at most this long, so that the branch is kept. Radians.
_LONGEST_TURN_RAD = 0.2
#: A step of the position is at most this share of the longest leg.
_LONGEST_SHIFT = 0.25
#: A platform with a larger condition number stands in a singular pose.
_SINGULAR = 1e10


@dataclass(frozen=True, slots=True, eq=False)
class Rods:
    """The legs of one platform at each row: ends (n, legs, 3), and `length_mm` (n, legs)."""

    base_mm: Array
    platform_mm: Array
    length_mm: Array


def rods_of(
    platform: Platform,
    lengths: Mapping[str, Array],
    carriages: Mapping[str, Columns],
    errors: Callable[[int], LegErrors],
    count: int,
) -> Rods:
    """The legs at (n,) values of their `lengths` and motions of their `carriages`, by axis."""
    bases, ends, rods = [], [], []
    for number, leg in enumerate(platform.legs):
        wrong = errors(number)
        base = np.array(leg.base_mm) + wrong.base_mm
        if leg.carriage is not None:
            base = carriages[leg.carriage].rows(count).at(base)
        bases.append(np.broadcast_to(base, (count, 3)))
        ends.append(np.broadcast_to(np.array(leg.platform_mm) + wrong.platform_mm, (count, 3)))
        value = lengths[leg.axis] if leg.axis is not None else 0.0
        rods.append(np.broadcast_to(leg.length_mm + wrong.length_mm + value, (count,)))
    return Rods(np.stack(bases, axis=1), np.stack(ends, axis=1), np.stack(rods, axis=1))


def held(platform: Platform, rods: Rods, start: Poses | None) -> Poses:
    """The pose of the platform at each row, on the branch of `start`, or of `start_mm` without rotation.

    Raises CannotCompute where the legs do not close.
    """
    count = len(rods.length_mm)
    if start is None:
        start = Poses(np.eye(3), np.array(platform.start_mm))
    pose = Poses(*(np.array(part) for part in _parts(start.rows(count))))
    longest = _LONGEST_SHIFT * float(np.max(np.abs(rods.length_mm)))
    for _ in range(_MOST_STEPS):
        gap, slope = _gaps(platform, rods, pose)
        worst = np.max(np.abs(gap), axis=1)
        if np.all(worst < _IN_PLACE_MM * np.maximum(1.0, np.max(np.abs(rods.length_mm), axis=1) / 1e3)):
            return pose
        step = np.asarray(np.linalg.solve(_regular(platform, slope), -gap[..., None])[..., 0], float)
        largest = np.linalg.norm(step[:, :3], axis=1) / longest
        if platform.turns:
            largest = np.maximum(largest, np.linalg.norm(step[:, 3:], axis=1) / _LONGEST_TURN_RAD)
        step /= np.maximum(1.0, largest)[:, None]
        pose = _moved(platform, pose, step)
    row = int(np.argmax(worst))
    raise CannotCompute(
        f"platform {platform.name}: the legs do not close at row {row} by {worst[row]:.3g} mm; expected axis "
        "values within the workspace, or start_mm nearer to the platform"
    )


def _parts(pose: Poses) -> tuple[Array, Array]:
    return pose.rotation, pose.position


def _gaps(platform: Platform, rods: Rods, pose: Poses) -> tuple[Array, Array]:
    """(n, legs) by how much each rod is too long, and (n, legs, 3 or 6) its change by a step of the pose."""
    arm = (pose.rotation[:, None] @ rods.platform_mm[..., None])[..., 0]
    rod = arm + pose.position[:, None] - rods.base_mm
    size = np.linalg.norm(rod, axis=2)
    along = rod / size[..., None]
    slope = along if not platform.turns else np.concatenate((along, np.cross(arm, along)), axis=2)
    return size - rods.length_mm, slope


def _regular(platform: Platform, slope: Array) -> Array:
    """The slopes, where none is singular. Raises CannotCompute."""
    scaled = slope.copy()
    if platform.turns:
        scaled[..., 3:] /= max(1.0, float(np.max(np.abs(slope[..., 3:]))))
    rows = _doubtful(scaled)
    condition = np.linalg.cond(scaled[rows])
    if not np.all(condition < _SINGULAR):
        row = int(rows[np.argmax(np.where(np.isfinite(condition), condition, np.inf))])
        raise CannotCompute(
            f"platform {platform.name} is singular at row {row}: its legs do not hold it; expected a pose "
            "away from there"
        )
    return slope


def _doubtful(matrices: Array) -> Index:
    """The rows of matrices (n, k, k) that may be singular: Frobenius norms of a matrix and its inverse bound
    its condition number from above, and take less time than singular values."""
    try:
        inverse = np.linalg.inv(matrices)
    except np.linalg.LinAlgError:
        return np.arange(len(matrices))
    bound = np.linalg.norm(matrices, axis=(1, 2)) * np.linalg.norm(inverse, axis=(1, 2))
    return np.flatnonzero(~(bound < _SINGULAR))


def _moved(platform: Platform, pose: Poses, step: Array) -> Poses:
    position = pose.position + step[:, :3]
    if not platform.turns:
        return Poses(pose.rotation, position)
    angle = np.linalg.norm(step[:, 3:], axis=1)
    return Poses(_turns(step[:, 3:], angle) @ pose.rotation, position)


def _turns(vectors: Array, angle: Array) -> Array:
    """(n, 3, 3) rotations by vectors (n, 3) of these angles (n,)."""
    unit = vectors / np.where(angle == 0.0, 1.0, angle)[:, None]
    cross = np.zeros((len(unit), 3, 3))
    for (i, k), column, sign in _CROSS:
        cross[:, i, k] = sign * unit[:, column]
    sine, versine = np.sin(angle), 2.0 * np.square(np.sin(0.5 * angle))
    return np.asarray(np.eye(3) + sine[:, None, None] * cross + versine[:, None, None] * (cross @ cross))


#: The matrix of a cross product: place, coordinate of the vector, sign.
_CROSS: Sequence[tuple[tuple[int, int], int, float]] = (
    *(((0, 1), 2, -1.0), ((0, 2), 1, 1.0), ((1, 0), 2, 1.0)),
    *(((1, 2), 0, -1.0), ((2, 0), 1, -1.0), ((2, 1), 0, 1.0)),
)


def swings(
    platform: Platform, joints: Mapping[str, Joint], rods: Rods, motions: Mapping[str, Columns]
) -> dict[str, Array]:
    """By axis (n, 6) how the platform shifts (mm) and turns (rad) per mm or rad of it, at its pose in
    `motions`. Raises CannotCompute where the platform is singular."""
    pose = motions[platform.name].rows(len(rods.length_mm))
    _, slope = _gaps(platform, rods, pose)
    rates: dict[str, Array] = {}
    for number, leg in enumerate(platform.legs):
        along = slope[:, number, :3]
        if leg.axis is not None:
            name, rate = leg.axis, np.ones(len(along))
        else:
            name = leg.carriage or ""
            joint = joints[name]
            direction = np.array(joint.direction)
            arm = rods.base_mm[:, number] - np.array(joint.point_mm)
            velocity = np.cross(direction, arm) if joint.kind == "rotary" else direction
            rate = np.sum(along * velocity, axis=1)
        rates.setdefault(name, np.zeros(slope.shape[:2]))[:, number] = rate
    regular = _regular(platform, slope)
    steps: dict[str, Array] = {}
    for name, right in rates.items():
        step = np.linalg.solve(regular, right[..., None])[..., 0]
        steps[name] = np.asarray(step if platform.turns else np.pad(step, ((0, 0), (0, 3))), float)
    return steps
