"""Axis values of poses that words state, as a control computes them: those of legs that hold a platform, or
those in one branch of serial axes."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ConfigError, NotInvertible
from olp.core.machine import Vector
from olp.core.units import AXES
from olp.kinematics.branches import REMEMBERED, Family, family_of
from olp.kinematics.chain import Kinematics
from olp.kinematics.coordinates import TURNS, poses_of_axes, stated_poses, stated_turns, states_poses
from olp.kinematics.errors import TURN_DEG
from olp.kinematics.poses import shift
from olp.kinematics.postures import wrapped
from olp.kinematics.structure import REFERENCE_RADIUS_MM, Joint, Leg, Structure

#: Below this `stated_mobility` a posture is singular: 1 deg of an elbow, 1.5 mm of a radius.
SINGULAR = 0.003
#: A platform within this of its pose is there: mm, and the entries of its rotation.
_CLOSED = 1e-7
#: An axis value beyond its travel by less than this is on its end: mm or deg.
_AT_END = 1e-9


def posed(
    structure: Structure, poses: bool, posture: Mapping[str, float] | None, endless: Sequence[str] = ()
) -> Structure:
    """A structure whose words state `poses`, with the posture of serial axes that names the branch, and those
    that the control leads on over whole turns. Raises ConfigError where words do not state poses, where the
    posture is not stated or singular, and for `endless` axes that are not rotary."""
    serial = family_of(structure) is not None
    if not serial or not poses:
        if poses and not states_poses(structure):
            raise _wrong(
                'kinematics.program_words = "pose" is read where one platform carries the tool, and on '
                "SCARA, polar and six-axis arms without further axes; the chain is "
                f"{' '.join(structure.chain)}. Leave it out with posture and endless, and correct lists of "
                "axis values"
            )
        if posture is not None or endless:
            name = "endless" if posture is None else "posture"
            raise _wrong(
                f'kinematics.{name} is read with program_words = "pose", on serial axes; leave it out'
            )
        return structure
    names = structure.order
    if posture is None or set(posture) != set(names):
        lacking = ", ".join(f"{name} = 0.0" for name in names)
        raise _wrong(
            f"kinematics.posture names {', '.join(posture or ()) or 'nothing'}; expected the value of every "
            f"axis in the branch that the control takes, such as posture = {{ {lacking} }}"
        )
    rotary = [name for name, joint in structure.joints.items() if joint.kind == "rotary"]
    if not set(endless) <= set(rotary):
        raise _wrong(f"kinematics.endless names {', '.join(endless)}; expected some of {', '.join(rotary)}")
    posture_of = tuple(posture[name] for name in names)
    made = replace(structure, posture=posture_of, endless=frozenset(endless))
    values = np.array([made.posture], float)
    machine = Kinematics(made)
    if stated_mobility(machine, values)[0] < SINGULAR:
        raise _wrong(
            "kinematics.posture is singular, where branches meet; expected one in the middle of the work"
        )
    return made


def led_on(structure: Structure, values: Array, near: Array) -> Array:
    """(n, axes) axis values with the whole turns of endless axes that bring them next to `near` (n, axes)."""
    columns = [structure.order.index(name) for name in structure.endless]
    if not columns:
        return values
    led = values.copy()
    led[:, columns] = near[:, columns] - wrapped(near[:, columns] - values[:, columns])
    return led


def led_in_order(structure: Structure, values: Array) -> Array:
    """(n, axes) axis values one behind the other, with the whole turns that endless axes have gone on by."""
    columns = [structure.order.index(name) for name in structure.endless]
    led = values.copy()
    led[:, columns] = np.unwrap(values[:, columns], period=TURN_DEG, axis=0)
    return led


def _wrong(what: str) -> ConfigError:
    return ConfigError(what, problems=(what,))


def axes_of_poses(machine: Kinematics, values: Array) -> Array:
    """(n, axes) axis values of the nominal machine at coordinates (n, axes) that state poses, NaN where these
    are unknown. Raises NotInvertible with the rows of poses that are out of reach."""
    return (_of_legs if machine.structure.platforms else _of_branch)(machine, values)


def stated_mobility(machine: Kinematics, values: Array) -> Array:
    """(n,) the least motion of what words state by a motion of the axes of 1 mm, at axis values (n, axes). It
    is 0 where two branches meet. Turns count as arcs at the reference radius."""
    turns, structure = stated_turns(machine.structure), machine.structure
    assert turns is not None
    rows = [*range(len(AXES)), *(len(AXES) + TURNS.index(letter) for letter in turns)]
    slopes = machine.jacobian(values)
    slopes[:, len(AXES) :] *= REFERENCE_RADIUS_MM
    rotary = [unit == "deg" for unit in structure.units]
    slopes = slopes[:, rows] / np.where(rotary, REFERENCE_RADIUS_MM, 1.0)
    return np.asarray(np.linalg.svd(slopes, compute_uv=False)[:, -1])


def _of_branch(machine: Kinematics, values: Array) -> Array:
    """The axis values in the branch of the posture."""
    family = family_of(machine.structure)
    assert family is not None
    found = family.axes(values, machine.tool_mm, _branch(family, machine.tool_mm))
    known = np.isfinite(values).all(axis=1)
    lost = known & np.isnan(found).any(axis=1)
    found[~known] = np.nan
    if lost.any():
        error = NotInvertible(
            f"row {int(np.argmax(lost))}: no axis values in the branch of kinematics.posture reach the pose"
        )
        error.rows = tuple(np.flatnonzero(lost).tolist())
        raise error
    return found


@functools.lru_cache(REMEMBERED)
def _branch(family: Family, tool_mm: Vector) -> int:
    """The branch in which the posture reaches its own pose."""
    machine = Kinematics(family.structure, tool_mm=tool_mm)
    near = np.array([family.structure.posture], float)
    words = poses_of_axes(machine, near)
    rotary = np.array([unit == "deg" for unit in family.structure.units])
    found = [family.axes(words, tool_mm, branch)[0] for branch in range(family.branches)]
    away = np.where(rotary, wrapped(np.array(found) - near), np.array(found) - near)
    return int(np.argmin(np.nan_to_num(np.abs(away), nan=np.inf).max(axis=1)))


def _of_legs(machine: Kinematics, values: Array) -> Array:
    """The axis values of the legs of a platform."""
    structure = machine.structure
    (platform,) = structure.platforms.values()
    pose, found = stated_poses(structure, values), np.full(values.shape, np.nan)
    held = pose @ (structure.gauge.pose @ shift(np.array(machine.tool_mm))).inverse()
    for leg in platform.legs:
        name = leg.axis or leg.carriage
        assert name is not None
        column = structure.order.index(name)
        # a second rod of a carriage is parallel to the first
        if np.isnan(found[:, column]).all():
            own = np.array(leg.platform_mm)
            start = np.array(platform.start_mm) + own
            found[:, column] = _leg_values(structure.joints[name], leg, held.at(own), start)
    known = np.isfinite(values).all(axis=1)
    found[~known] = np.nan
    lost = np.isnan(found).any(axis=1) & known
    rows = np.flatnonzero(known & ~lost)
    closed = machine.nominal(found[rows])
    away = np.abs(closed.position - pose.position[rows]).max(axis=1, initial=0.0)
    turned = np.abs(closed.rotation - pose.rotation[rows]).max(axis=(1, 2), initial=0.0)
    lost[rows[np.maximum(away, turned) > _CLOSED]] = True
    if lost.any():
        error = NotInvertible(
            f"row {int(np.argmax(lost))}: the legs of platform {platform.name} do not reach the pose"
        )
        error.rows = tuple(np.flatnonzero(lost).tolist())
        raise error
    return found


def _leg_values(joint: Joint, leg: Leg, end: Array, start: Array) -> Array:
    """(n,) values of the axis of a leg whose rod ends at points (n, 3), NaN where there is none. Of two
    within the travel it is the one on the side of axis zero, where the rod ends near `start` (3,)."""
    base = np.array(leg.base_mm)
    if leg.carriage is None:
        return np.asarray(np.linalg.norm(end - base, axis=1) - leg.length_mm)
    both, at_zero = _both_values(joint, leg, end), _both_values(joint, leg, start[None])[0]
    low, high = joint.travel
    # beyond the travel it is the nearer one, so that it can be told
    beyond = np.maximum(np.maximum(low - both, both - high), _AT_END)
    beyond = np.where(np.isnan(beyond), np.inf, beyond)
    side = int(np.argmin(np.where(np.isnan(at_zero), np.inf, np.abs(at_zero))))
    chosen = np.where(beyond[:, 0] == beyond[:, 1], side, np.argmin(beyond, axis=1))
    return np.asarray(both[np.arange(len(both)), chosen])


def _both_values(joint: Joint, leg: Leg, end: Array) -> Array:
    """(n, 2) values of a carriage at which its rod has its length, NaN where there are none."""
    base, direction = np.array(leg.base_mm), np.array(joint.direction)
    with np.errstate(invalid="ignore"):
        if joint.kind == "linear":
            along = (end - base) @ direction
            off = np.linalg.norm(end - base - along[:, None] * direction, axis=1)
            half = np.sqrt(leg.length_mm**2 - off**2)
            return np.stack((along - half, along + half), axis=1)
        # the base goes round: A cos q + B sin q = K
        arm, far = base - np.array(joint.point_mm), end - np.array(joint.point_mm)
        axial = (arm @ direction) * direction
        first, second = far @ (arm - axial), far @ np.cross(direction, arm)
        size = 0.5 * (arm @ arm + (far * far).sum(axis=1) - leg.length_mm**2) - far @ axial
        along = np.arctan2(second, first)
        half = np.arccos(size / np.hypot(first, second))
    both = np.degrees(np.stack((along - half, along + half), axis=1))
    return np.asarray((both + 180.0) % 360.0 - 180.0)
