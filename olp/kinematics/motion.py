"""The motion of one joint, nominal and with its errors.

On the tool side a rotary joint is E Y R and a linear one V E Y. On the workpiece side they are R Y E and
Y E V. R and V are the motion on the line as it really lies, E the error motions, Y the yield.
"""

from __future__ import annotations

import functools

import numpy as np

from olp.core.arrays import Array
from olp.core.machine import Vector
from olp.core.values import dataclass
from olp.kinematics.columns import (
    STILL,
    Columns,
    Entry,
    Triple,
    about,
    add,
    plus,
    scaled,
    shifted,
    tilted,
    triple,
    turn_about,
)
from olp.kinematics.errors import OWN, JointErrors
from olp.kinematics.structure import Joint

#: Directions of lines that are kept: those of the axes of some machines.
_LINES = 64


@dataclass(frozen=True, slots=True, eq=False)
class Yielded:
    """What one joint gives way at each row: `own` in mm or rad, `tilt_rad` and `shift_mm`."""

    own: Entry
    tilt_rad: Triple
    shift_mm: Triple


def nominal_motion(joint: Joint, value: Array) -> Columns:
    """The motion at axis values (n,) in mm or deg."""
    if joint.kind == "rotary":
        return about(triple(joint.point_mm), turn_about(joint.direction, np.radians(value)))
    return shifted(scaled(triple(joint.direction), value))


def actual_motion(
    joint: Joint,
    errors: JointErrors,
    value: Array,
    *,
    on_workpiece: bool,
    side: Array | None = None,
    yielded: Yielded | None = None,
) -> Columns:
    """The motion with its errors at axis values (n,). `side` (n,) is the side of the backlash, from -1 to 1:
    1 after a motion toward larger values."""
    own: Entry = 0.0
    turns = joint.kind == "rotary"
    bodies = []
    for curve in errors.curves:
        motions = _entries(curve.at(value))
        own = plus(own, motions[OWN] if turns else 0.0)
        bodies.append(_body(joint, curve.point_mm, motions, value, curve.follows, on_workpiece))
    if errors.harmonics:
        waves: list[Entry] = [0.0] * (OWN + 1)
        for wave in errors.harmonics:
            waves[wave.component] = plus(waves[wave.component], wave.at(value))
        own = plus(own, waves[OWN] if turns else 0.0)
        if any(not isinstance(wave, float) for wave in (waves[:OWN] if turns else waves)):
            first = errors.curves[0] if errors.curves else None
            point = errors.point_mm if first is None else first.point_mm
            follows = first is not None and first.follows
            bodies.append(_body(joint, point, waves, value, follows, on_workpiece))
    if side is not None and errors.backlash:
        own = plus(own, -0.5 * errors.backlash * side)
    stated = STILL
    for body in bodies[::-1] if on_workpiece else bodies:
        stated = stated @ body
    gives = STILL
    if yielded is not None:
        own = plus(own, yielded.own)
        turn = tilted(yielded.tilt_rad, reverse=on_workpiece)
        gives = about(triple(joint.point_mm), turn, yielded.shift_mm)
    line = _on_its_line(joint, errors, value, own)
    if turns:
        return line @ gives @ stated if on_workpiece else stated @ gives @ line
    return gives @ stated @ line if on_workpiece else line @ stated @ gives


def _entries(motions: Array) -> list[Entry]:
    """The columns of error motions (n, 7), 0 where all of one are."""
    columns = np.ascontiguousarray(motions.T)
    return [column if column.any() else 0.0 for column in columns]


def _body(
    joint: Joint, point_mm: Vector, motions: list[Entry], value: Array, follows: bool, on_workpiece: bool
) -> Columns:
    point, direction = triple(point_mm), triple(joint.direction)
    if follows:
        point = add(point, scaled(direction, value))
    moved: Triple = (motions[0], motions[1], motions[2])
    if joint.kind != "rotary":
        moved = add(moved, scaled(direction, motions[OWN]))
    return about(point, tilted((motions[3], motions[4], motions[5]), reverse=on_workpiece), moved)


@functools.lru_cache(maxsize=_LINES)
def _leaning(direction: Vector, tilt_rad: Vector) -> Vector:
    """The direction of a line that is tilted."""
    x, y, z = (float(entry) for entry in tilted(triple(tilt_rad)).turned(triple(direction)))
    return x, y, z


def _on_its_line(joint: Joint, errors: JointErrors, value: Array, own: Entry) -> Columns:
    """The motion along or about the line where it really is; at axis zero nothing moves but the own error."""
    if joint.kind == "rotary":
        angle = plus(plus(np.radians(value), float(errors.zero)), own)
        turn = turn_about(_leaning(joint.direction, errors.tilt_rad), angle)
        return about(add(triple(joint.point_mm), triple(errors.shift_mm)), turn)
    direction = triple(joint.direction)
    along = scaled(direction, plus(plus(value, float(errors.zero)), own))
    across = triple(np.cross(errors.tilt_rad, joint.direction))
    return shifted(add(along, scaled(across, value - errors.datum)))
