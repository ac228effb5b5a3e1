"""Positions of two rotary axes at which the tool has a direction in the workpiece, in closed form."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from olp.core.arrays import Array
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
    rotary = [joint for name in structure.chain if (joint := structure.joints.get(name)) is not None]
    rotary = [joint for joint in rotary if joint.kind == "rotary"]
    if len(rotary) != 2 or structure.platforms:
        raise ConfigError(
            f"the control finds positions of two rotary axes, and the machine has {len(rotary)}; state the "
            "positions in the program"
        )
    outer, inner = rotary
    tool = structure.gauge.pose.rotation[:, 2]
    found: list[Mapping[str, float]] = []
    for middle in _middles(np.array(outer.direction), np.array(inner.direction), tool, direction):
        values = (
            _angle(np.array(outer.direction), middle, direction),
            _angle(np.array(inner.direction), tool, middle),
        )
        inside = [_within(joint, value) for joint, value in zip(rotary, values, strict=True)]
        if None not in inside:
            found.append({joint.name: value or 0.0 for joint, value in zip(rotary, inside, strict=True)})
    return found


def _middles(outer: Array, inner: Array, tool: Array, target: Array) -> list[Array]:
    """The directions of the tool when the inner axis alone has turned it."""
    cosine, across = float(outer @ inner), np.cross(outer, inner)
    square = float(across @ across)
    if square < _PARALLEL:
        return []
    a, b = float(outer @ target), float(inner @ tool)
    first, second = (a - cosine * b) / square, (b - cosine * a) / square
    rest = 1.0 - first * first - second * second - 2.0 * first * second * cosine
    if rest < -_ROUNDED:
        return []
    beside = np.sqrt(max(rest, 0.0) / square)
    middle = first * outer + second * inner
    if beside < _PARALLEL:
        return [middle]
    return [middle + beside * across, middle - beside * across]


def _angle(axis: Array, start: Array, end: Array) -> float:
    """deg by which a direction turns about an axis; 0 where it is along the axis."""
    start, end = start - axis * (axis @ start), end - axis * (axis @ end)
    if np.linalg.norm(start) < _PARALLEL or np.linalg.norm(end) < _PARALLEL:
        return 0.0
    return float(np.degrees(np.arctan2(axis @ np.cross(start, end), start @ end)))


def _within(joint: Joint, value: float) -> float | None:
    """The same position within the travel, as near to zero as can be; None where there is none."""
    low, high = joint.travel
    turns = [value + _WHOLE * k for k in sorted(range(-3, 4), key=abs)]
    return next((turn for turn in turns if low - _AT_END <= turn <= high + _AT_END), None)
