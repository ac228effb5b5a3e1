"""The motion of one joint, nominal and with its errors.

On the tool side a rotary joint is E Y R and a linear one V E Y. On the workpiece side they are R Y E and
Y E V. R and V are the motion on the line as it really lies, E the error motions, Y the yield.
"""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array
from olp.core.values import dataclass
from olp.kinematics.errors import OWN, JointErrors
from olp.kinematics.poses import STILL, Poses, about, axis_rotation, shift, tilts
from olp.kinematics.structure import Joint


@dataclass(frozen=True, slots=True, eq=False)
class Yielded:
    """What one joint gives way at each row: `own` (n,) in mm or rad, `tilt_rad` and `shift_mm` (n, 3)."""

    own: Array
    tilt_rad: Array
    shift_mm: Array


def nominal_motion(joint: Joint, value: Array) -> Poses:
    """The motion at axis values (n,) in mm or deg."""
    direction = np.array(joint.direction)
    if joint.kind == "rotary":
        rotation = axis_rotation(direction, np.radians(value))
        return about(np.array(joint.point_mm), rotation, np.zeros(3))
    return shift(value[:, None] * direction)


def actual_motion(
    joint: Joint,
    errors: JointErrors,
    value: Array,
    *,
    on_workpiece: bool,
    side: Array | None = None,
    yielded: Yielded | None = None,
) -> Poses:
    """The motion with its errors at axis values (n,). `side` (n,) is the side of the backlash, from -1 to 1:
    1 after a motion toward larger values."""
    own, turns = np.zeros(len(value)), joint.kind == "rotary"
    bodies = []
    for curve in errors.curves:
        motions = curve.at(value)
        own = own + (motions[:, OWN] if turns else 0.0)
        bodies.append(_body(joint, curve.point_mm, motions, value, curve.follows, on_workpiece))
    if errors.harmonics:
        motions = np.zeros((len(value), OWN + 1))
        for wave in errors.harmonics:
            motions[:, wave.component] += wave.at(value)
        own = own + (motions[:, OWN] if turns else 0.0)
        if np.any(motions[:, : OWN if turns else OWN + 1]):
            first = errors.curves[0] if errors.curves else None
            point = errors.point_mm if first is None else first.point_mm
            follows = first is not None and first.follows
            bodies.append(_body(joint, point, motions, value, follows, on_workpiece))
    if side is not None and errors.backlash:
        own = own - 0.5 * errors.backlash * side
    stated = _composed(bodies[::-1] if on_workpiece else bodies)
    gives = STILL
    if yielded is not None:
        own = own + yielded.own
        gives = _yield_body(joint, yielded, value, on_workpiece)
    line = _on_its_line(joint, errors, value, own)
    if joint.kind == "rotary":
        return line @ gives @ stated if on_workpiece else stated @ gives @ line
    return gives @ stated @ line if on_workpiece else line @ stated @ gives


def _composed(bodies: list[Poses]) -> Poses:
    pose = STILL
    for body in bodies:
        pose = pose @ body
    return pose


def _body(
    joint: Joint, point_mm: tuple[float, ...], motions: Array, value: Array, follows: bool, on_workpiece: bool
) -> Poses:
    point = np.array(point_mm)
    if follows:
        point = point + value[:, None] * np.array(joint.direction)
    moved = motions[:, :3]
    if joint.kind != "rotary":
        moved = moved + motions[:, OWN, None] * np.array(joint.direction)
    return about(point, tilts(motions[:, 3:6], reverse=on_workpiece), moved)


def _yield_body(joint: Joint, yielded: Yielded, value: Array, on_workpiece: bool) -> Poses:
    rotation = tilts(yielded.tilt_rad, reverse=on_workpiece)
    return about(np.array(joint.point_mm), rotation, yielded.shift_mm)


def _on_its_line(joint: Joint, errors: JointErrors, value: Array, own: Array) -> Poses:
    """The motion along or about the line where it really is; at axis zero nothing moves but the own error."""
    direction = np.array(joint.direction)
    tilt = np.array(errors.tilt_rad)
    if joint.kind == "rotary":
        point = np.array(joint.point_mm)
        turn = axis_rotation(direction, np.radians(value) + errors.zero + own)
        line = about(point, tilts(tilt), np.array(errors.shift_mm))
        return line @ about(point, turn, np.zeros(3)) @ line.inverse()
    along = (value + errors.zero + own)[:, None] * direction
    across = (value - errors.datum)[:, None] * np.cross(tilt, direction)
    return shift(along + across)
