"""Programmed coordinates that state the tip, and the axis values that they stand for.

In axis words the numbers are axis values. With tool centre point control the linear ones state the tip in the
workpiece, as the axis values that would bring a tool without length there with all rotary axes at zero. Where
the control computes all axes, they state the pose of the tool (`olp.kinematics.coordinates`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.machine import ZERO
from olp.core.units import AXES
from olp.kinematics.chain import Kinematics
from olp.kinematics.columns import cross, dot, triple
from olp.kinematics.coordinates import poses_of_axes, stated_poses, stated_turns, states_poses
from olp.kinematics.pose_axes import axes_of_poses
from olp.kinematics.poses import Poses
from olp.kinematics.structure import Structure

#: Below this share of a unit volume three linear axes do not reach every point of space.
_FLAT = 1e-6


def linear_columns(structure: Structure) -> list[int]:
    """The columns of the three linear axes, in their order. Raises ConfigError where there are others."""
    joints = list(structure.joints.values())
    columns = [column for column, joint in enumerate(joints) if joint.kind == "linear"]
    on_chain = not structure.platforms and len(columns) == 3
    directions = np.array([joints[column].direction for column in columns]).reshape(-1, 3)
    if not on_chain or not abs(np.linalg.det(directions)) > _FLAT:
        raise ConfigError(
            f"machine {structure.name!r} has {len(columns)} linear axes in the chain "
            f"{' '.join(structure.chain)}; programs are read for three of them that span space, with rotary "
            "axes"
        )
    return columns


def axes_of_tips(machine: Kinematics, values: Array) -> Array:
    """(n, axes) axis values of the nominal machine at programmed tips (n, axes): rotary columns as they are,
    linear ones such that the tip is there. Raises NotInvertible with rows whose poses are out of reach."""
    if states_poses(machine.structure):
        return axes_of_poses(machine, values)
    columns = linear_columns(machine.structure)
    still = values.copy()
    still[:, columns] = 0.0
    pose, slopes = machine.nominal_and_slopes(still, columns)
    away = stated_tips(machine, values) - pose.position
    first, second, third = (triple(slopes[:, :3, k]) for k in range(3))
    normals = cross(second, third), cross(third, first), cross(first, second)
    volume = dot(first, normals[0])
    for column, normal in zip(columns, normals, strict=True):
        still[:, column] = dot(triple(away), normal) / volume
    return still


def stated_tips(machine: Kinematics, values: Array) -> Array:
    """(n, 3) tips in workpiece coordinates of programmed coordinates (n, axes), which state the tip."""
    if states_poses(machine.structure):
        return values[:, : len(AXES)]
    origin, slopes = _workpiece(machine)
    return np.asarray(origin + values[:, linear_columns(machine.structure)] @ slopes.T)


def stated_targets(machine: Kinematics, values: Array) -> Poses:
    """(n) poses of the nominal tool at programmed coordinates (n, axes), which state the tip. Raises
    NotInvertible with rows whose poses are out of reach."""
    structure = machine.structure
    if states_poses(structure):
        if stated_turns(structure) or structure.platforms:
            return stated_poses(structure, values)
        # the axes that bring the tip there turn the tool besides
        return Poses(machine.nominal(axes_of_poses(machine, values)).rotation, stated_tips(machine, values))
    return Poses(machine.nominal(values).rotation, stated_tips(machine, values))


def tips_of_axes(machine: Kinematics, values: Array) -> Array:
    """(n, axes) the other way round from axis values (n, axes)."""
    if states_poses(machine.structure):
        return poses_of_axes(machine, values)
    columns = linear_columns(machine.structure)
    origin, slopes = _workpiece(machine)
    tips = values.copy()
    away = machine.nominal(values).position - origin
    tips[:, columns] = np.linalg.solve(slopes, away.T).T
    return tips


def _workpiece(machine: Kinematics) -> tuple[Array, Array]:
    """Where a tool without length is with all axes at zero, (3,), and how the linear axes move it, (3, 3)."""
    bare = replace(machine, tool_mm=ZERO)
    zero = np.zeros((1, len(machine.structure.order)))
    slopes = bare.jacobian(zero)[0, :3, linear_columns(machine.structure)].T
    return bare.nominal(zero).position[0], np.asarray(slopes)
