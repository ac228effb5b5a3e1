"""What words of a program state on a machine: values of its axes, or the pose of its tool.

Where a platform on legs carries the tool, a control computes the axes: X, Y and Z are the tip in machine
coordinates. Where the platform turns, A, B and C turn the tool from where the gauge holds it, by Rz Ry Rx of
fixed axes in degrees.
"""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.errors import NotInvertible
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.kinematics.chain import Kinematics
from olp.kinematics.poses import Poses, shift, tilts
from olp.kinematics.structure import FRAME, Joint, Leg, Structure

#: The step of words, mm or deg, where no axis states one.
_UNSTATED = 1e-6
#: The letters that turn the tool.
TURNS = "ABC"
#: deg; a turn beyond these is stated by another triple of A, B and C, or nearly so.
FARTHEST_DEG = (179.0, 89.0, 179.0)
#: A platform within this of its pose is there: mm, and the entries of its rotation.
_CLOSED = 1e-7
#: An axis value beyond its travel by less than this is on its end: mm or deg.
_AT_END = 1e-9


@dataclass(frozen=True, slots=True)
class Coordinates:
    """The coordinates of a program: their `names`, `units` and `steps`, which are least increments, by
    column. `poses` says that they state poses."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    steps: tuple[float, ...]
    poses: bool = False

    @staticmethod
    def of_axes(structure: Structure) -> Coordinates:
        """Values of the axes."""
        steps = tuple(joint.least_increment for joint in structure.joints.values())
        return Coordinates(structure.order, structure.units, steps)

    @staticmethod
    def of_words(structure: Structure) -> Coordinates:
        """What words state: poses where a platform carries the tool, else values of the axes."""
        if not states_poses(structure):
            return Coordinates.of_axes(structure)
        turns = len(structure.order) - len(AXES)
        lengths = [joint.least_increment for joint in structure.joints.values() if joint.unit == "mm"]
        finest = min((step for step in lengths if step > 0.0), default=_UNSTATED)
        units = ("mm",) * len(AXES) + ("deg",) * turns
        steps = (finest,) * len(AXES) + (_UNSTATED,) * turns
        return Coordinates((*AXES, *TURNS[:turns]), units, steps, poses=True)

    @property
    def rotary(self) -> Mask:
        """(axes,) the columns in degrees."""
        return np.array([unit == "deg" for unit in self.units])

    @property
    def linear(self) -> Index:
        """(3,) the columns of X, Y and Z."""
        return np.array([self.names.index(name) for name in AXES])


def states_poses(structure: Structure) -> bool:
    """Whether words of a program state poses: on one platform alone, with three axes or six in its legs."""
    alone = len(structure.platforms) == 1 and structure.chain == (FRAME, *structure.platforms)
    return alone and len(structure.order) in (len(AXES), len(AXES) + len(TURNS))


def stated_poses(structure: Structure, values: Array) -> Poses:
    """(n) poses of the tool that coordinates (n, axes) state, in machine coordinates."""
    gauge = structure.gauge.pose.rotation
    if values.shape[1] == len(AXES):
        return Poses(np.broadcast_to(gauge, (len(values), 3, 3)), values)
    return Poses(tilts(np.radians(values[:, len(AXES) :])) @ gauge, values[:, : len(AXES)])


def poses_of_axes(machine: Kinematics, values: Array) -> Array:
    """(n, axes) coordinates that state the poses of the nominal machine at axis values (n, axes), NaN where
    these are unknown."""
    stated, known = np.full(values.shape, np.nan), np.isfinite(values).all(axis=1)
    pose = machine.nominal(values[known])
    stated[known, : len(AXES)] = pose.position
    if values.shape[1] == len(AXES):
        return stated
    turn = pose.rotation @ machine.structure.gauge.pose.rotation.T
    a = np.arctan2(turn[:, 2, 1], turn[:, 2, 2])
    b = np.arctan2(-turn[:, 2, 0], np.hypot(turn[:, 2, 1], turn[:, 2, 2]))
    c = np.arctan2(turn[:, 1, 0], turn[:, 0, 0])
    stated[known, len(AXES) :] = np.degrees(np.stack((a, b, c), axis=1))
    return stated


def axes_of_poses(machine: Kinematics, values: Array) -> Array:
    """(n, axes) axis values of the nominal machine at coordinates (n, axes) that state poses, NaN where these
    are unknown. Raises NotInvertible with the rows of poses that no legs reach."""
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
