"""Correction of poses: where the nominal tool would be, and the axis values that bring the actual one there.

No language and no file is known here: axis values come in columns and go out in columns.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from olp.core.arrays import Array, Mask
from olp.core.values import dataclass
from olp.kinematics.chain import Kinematics
from olp.kinematics.inverse import LARGEST_TURN_DEG, Solved, inverse
from olp.kinematics.poses import Poses, rotation_vector, turned
from olp.kinematics.structure import REFERENCE_RADIUS_MM, Structure

#: Below this share of the largest slope a motion of the axes does not move the tip.
_MOVES = 1e-7
#: Below this a motion of the axes turns the tool too little: a tilt of 1 mrad costs 20 mrad of an axis.
_MOVES_WELL = 0.05
#: A linear axis beyond its travel by less than this is on its end: mm or deg.
_AT_END = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class CorrectedPoses:
    """Corrected axis values (n, axes) in mm and deg. `left_rad` (n, 3) are rotation vectors from the tool to
    its target that remain, in workpiece coordinates; where a rotary axis was `limited` near a singular
    posture (n,) they hold what that costs. `beyond` (n, axes) are values out of their travel."""

    values: Array
    left_rad: Array
    limited: Mask
    beyond: Mask


def correct_poses(
    machine: Kinematics,
    values: Array,
    *,
    shift_mm: Array | None = None,
    largest_turn_deg: float = LARGEST_TURN_DEG,
) -> CorrectedPoses:
    """The axis values that bring the actual tool to where the nominal one is at `values` (n, axes).

    Position is met to 1e-9 mm, and of the orientation as much as the chain can correct: the tool axis on five
    axes, all of it on six. `shift_mm` (n, 3) moves the targets, in workpiece coordinates. Near a singular
    posture no rotary axis turns by more than `largest_turn_deg`; the branch is kept. Raises NotInvertible
    with all `rows` where no axis values meet the position.
    """
    values = np.asarray(values, float)
    target = machine.nominal(values)
    if shift_mm is not None:
        target = Poses(target.rotation, target.position + shift_mm)
    solved = inverse(machine, target, values, largest_turn_deg=largest_turn_deg)
    return CorrectedPoses(
        solved.values, solved.left_rad, solved.limited, beyond_travel(machine.structure, solved.values)
    )


def meet_positions(machine: Kinematics, target: Poses, values: Array) -> Solved:
    """The axis values whose linear axes bring the actual tip to `target` while the others stay as they are in
    `values` (n, axes). Raises NotInvertible with the rows."""
    structure = machine.structure
    joints = {
        name: joint if joint.kind == "linear" else replace(joint, correct=False)
        for name, joint in structure.joints.items()
    }
    held = replace(machine, structure=replace(structure, joints=joints))
    return inverse(held, target, values)


def left_angles(structure: Structure, left_rad: Array, target: Poses) -> Array:
    """(n,) the angles of turns that remain (n, 3), of a symmetric tool those of its axis."""
    if not structure.symmetric_tool:
        return np.asarray(np.linalg.norm(left_rad, axis=1))
    return np.asarray(np.linalg.norm(np.cross(left_rad, target.rotation[:, :, 2]), axis=1))


def correctable_angles(machine: Kinematics, values: Array, actual: Poses, target: Poses) -> Array:
    """(n,) the angles in rad of turns from `target` to `actual` that the axes could take back from `values`
    (n, axes) while the tip stays where it is. A turn that they reach by a motion many times as large does not
    count, nor does that of a symmetric tool about its axis."""
    structure = machine.structure
    free = [axis for axis, joint in enumerate(structure.joints.values()) if joint.correct]
    slopes = machine.nominal_and_slopes(values, free)[1]
    rotary = np.array([structure.joints[structure.order[axis]].unit == "deg" for axis in free])
    # mm of the tip and of arcs at the reference radius, by mm of axes and such arcs
    slopes = slopes / np.where(rotary, REFERENCE_RADIUS_MM, 1.0)
    slopes[:, 3:] *= REFERENCE_RADIUS_MM
    turn = rotation_vector(actual.rotation @ np.swapaxes(target.rotation, -1, -2))
    if structure.symmetric_tool:
        axis = target.rotation[:, :, 2]
        across = np.eye(3) - axis[:, :, None] * axis[:, None, :]
        slopes[:, 3:] = across @ slopes[:, 3:]
    place, turns = slopes[:, :3], slopes[:, 3:]
    still = np.eye(len(free)) - np.linalg.pinv(place, rcond=_MOVES) @ place
    sides, sizes, _ = np.linalg.svd(turns @ still, full_matrices=False)
    parts = np.einsum("nik,ni->nk", sides, turn) * (sizes > _MOVES_WELL)
    return np.asarray(np.linalg.norm(parts, axis=1))


def beyond_travel(structure: Structure, values: Array) -> Mask:
    """(n, axes) where values are out of their travel."""
    ends = np.array([joint.travel for joint in structure.joints.values()])
    return np.asarray((values < ends[:, 0] - _AT_END) | (values > ends[:, 1] + _AT_END))


def deviations(structure: Structure, actual: Poses, target: Poses) -> tuple[Array, Array]:
    """(n,) distances in mm and (n,) angles in rad between poses. Of a tool that is symmetric about its axis
    the angle is that of the axis."""
    distance = np.linalg.norm(actual.position - target.position, axis=1)
    if structure.symmetric_tool:
        axis = np.array((0.0, 0.0, 1.0))
        mine, theirs = turned(actual.rotation, axis), turned(target.rotation, axis)
        sine = np.linalg.norm(np.cross(mine, theirs), axis=1)
        return distance, np.arctan2(sine, np.sum(mine * theirs, axis=1))
    turn = rotation_vector(actual.rotation @ np.swapaxes(target.rotation, -1, -2))
    return distance, np.linalg.norm(turn, axis=1)
