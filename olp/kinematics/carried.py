"""An arm with what carries it: it stands, or a linear joint between the frame and its six axes moves it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from olp.core.arrays import Array
from olp.core.values import dataclass
from olp.kinematics.parallel_arm import arm_of
from olp.kinematics.poses import Poses
from olp.kinematics.postures import AXES, Arm
from olp.kinematics.structure import FRAME, Joint, Structure


@dataclass(frozen=True, slots=True, eq=False)
class Carried:
    """The `arm`, whose six values are among those of the machine. Where a linear joint carries it, `track` is
    that joint and `column` the place of its value; else -1. Poses of the arm count from the carriage."""

    arm: Arm
    track: Joint | None = None
    column: int = -1

    def own(self, axes: Array) -> Array:
        """(..., 6) the values of the arm among those of the machine (..., axes)."""
        return axes if self.track is None else np.delete(axes, self.column, axis=-1)

    def joined(self, own: Array, along_mm: Array | float) -> Array:
        """(n, axes) values of the machine: those of the arm (n, 6), and where the carriage is, (n,) mm."""
        return own if self.track is None else np.insert(own, self.column, along_mm, axis=-1)

    def along(self, axes: Array) -> Array:
        """(n,) where the carriage is, mm, at axis values (n, axes); 0 where the arm stands."""
        return np.zeros(len(axes)) if self.track is None else axes[:, self.column]

    def held(self, poses: Poses, axes: Array) -> Poses:
        """(n) nominal poses in the machine as they count from the carriage at axis values (n, axes)."""
        if self.track is None:
            return poses
        direction = np.array(self.track.direction)
        away = self.along(axes)[:, None] * direction
        return Poses(poses.rotation, poses.position - away)

    def kept(self, structure: Structure) -> Structure:
        """The machine, whose corrections leave the carriage where programs have it."""
        if self.track is None:
            return structure
        track = replace(self.track, correct=False)
        return replace(structure, joints={**structure.joints, track.name: track})


def carried_arm(structure: Structure) -> Carried | None:
    """The arm of a machine whose postures are known, on its track where it has one; None where it is none."""
    frame, *names = structure.chain
    first = structure.joints.get(names[0]) if frame == FRAME and len(names) == AXES + 1 else None
    if first is None or first.kind != "linear":
        arm = arm_of(structure)
        return None if arm is None else Carried(arm)
    joints = {name: joint for name, joint in structure.joints.items() if name != first.name}
    arm = arm_of(replace(structure, chain=(FRAME, *names[1:]), joints=joints))
    return None if arm is None else Carried(arm, first, structure.order.index(first.name))
