"""Positions of two rotary axes at which the tool has a direction in the workpiece, in closed form."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from olp.core.arrays import Array, Mask
from olp.core.errors import ConfigError
from olp.kinematics.structure import Joint, Structure

#: Sines below this are zero: rad.
_PARALLEL = 1e-9
#: Least size of what the square of a component may be below zero by rounding.
_ROUNDED = 1e-12
#: deg of a whole turn
_WHOLE = 360.0
#: deg by which a position may be out of its travel by rounding.
_AT_END = 1e-9


def rotary_positions(structure: Structure, direction: Array) -> list[Mapping[str, float]]:
    """All positions in deg, within the travel, at which the nominal tool has a `direction` (3,) in the
    workpiece; of positions a whole turn apart the one nearest to zero. Of an axis that does not change the
    direction there the value is 0. Raises ConfigError where the machine has not two rotary axes."""
    rotary = pair_of(structure)
    found: list[Mapping[str, float]] = []
    both = branches(structure, direction[None])[:, 0]
    if np.array_equal(both[0], both[1]):
        both = both[:1]
    for values in both[np.isfinite(both).all(axis=1)].tolist():
        inside = [_within(joint, value) for joint, value in zip(rotary, values, strict=True)]
        if None not in inside:
            found.append({joint.name: value or 0.0 for joint, value in zip(rotary, inside, strict=True)})
    return found


def pair_of(structure: Structure) -> tuple[Joint, Joint]:
    """The two rotary joints, the outer one first. Raises ConfigError where there are not two."""
    rotary = [joint for name in structure.chain if (joint := structure.joints.get(name)) is not None]
    rotary = [joint for joint in rotary if joint.kind == "rotary"]
    if len(rotary) != 2 or structure.platforms:
        raise ConfigError(
            f"the control finds positions of two rotary axes, and the machine has {len(rotary)}; state the "
            "positions in the program"
        )
    return rotary[0], rotary[1]


def branches(structure: Structure, directions: Array) -> Array:
    """(2, n, 2) deg of the outer and the inner rotary axis at which the nominal tool has directions (n, 3),
    on both branches, each within half a turn of zero. They are NaN where there is no such position, and equal
    where both are one. An axis that does not change the direction there is at 0. Raises ConfigError where the
    machine has not two rotary axes."""
    outer, inner = (np.array(joint.direction) for joint in pair_of(structure))
    tool = structure.gauge.pose.rotation[:, 2]
    found = np.empty((2, len(directions), 2))
    for which, middle in enumerate(_middles(outer, inner, tool, directions)):
        found[which, :, 0] = _angles(outer, middle, directions)
        found[which, :, 1] = _angles(inner, np.broadcast_to(tool, middle.shape), middle)
    return found


def along_outer(structure: Structure, directions: Array) -> Array:
    """(n,) sines of the angles between directions (n, 3) and the outer rotary axis, about which the tool does
    not turn where they are along it."""
    outer = np.array(pair_of(structure)[0].direction)
    return np.asarray(np.linalg.norm(np.cross(directions, outer), axis=1))


def _middles(outer: Array, inner: Array, tool: Array, targets: Array) -> tuple[Array, Array]:
    """(n, 3) the directions of the tool when the inner axis alone has turned it, on both branches."""
    cosine, across = float(outer @ inner), np.cross(outer, inner)
    square = float(across @ across)
    if square < _PARALLEL:
        return np.full(targets.shape, np.nan), np.full(targets.shape, np.nan)
    a, b = targets @ outer, float(inner @ tool)
    first, second = (a - cosine * b) / square, (b - cosine * a) / square
    rest = 1.0 - first * first - second * second - 2.0 * first * second * cosine
    beside = np.sqrt(np.where(rest < -_ROUNDED, np.nan, np.maximum(rest, 0.0)) / square)
    beside[beside < _PARALLEL] = 0.0
    middle = first[:, None] * outer + second[:, None] * inner
    return middle + beside[:, None] * across, middle - beside[:, None] * across


def _angles(axis: Array, start: Array, end: Array) -> Array:
    """(n,) deg by which directions (n, 3) turn about an axis; 0 where one is along the axis."""
    start, end = (some - np.outer(some @ axis, axis) for some in (start, end))
    turned = np.degrees(np.arctan2(np.cross(start, end) @ axis, np.einsum("ij,ij->i", start, end)))
    return np.asarray(np.where(_short(start) | _short(end), 0.0, turned))


def _short(vectors: Array) -> Mask:
    return np.asarray(np.linalg.norm(vectors, axis=1) < _PARALLEL)


def _within(joint: Joint, value: float) -> float | None:
    """The same position within the travel, as near to zero as can be; None where there is none."""
    low, high = joint.travel
    turns = [value + _WHOLE * k for k in sorted(range(-3, 4), key=abs)]
    return next((turn for turn in turns if low - _AT_END <= turn <= high + _AT_END), None)
