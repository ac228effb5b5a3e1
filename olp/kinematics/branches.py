"""Serial machines whose control computes the axes from poses: which of several axis values it takes.

A family knows all axis values that reach a pose, in an order that keeps along a path. The posture of the
structure is one of them where it stands: its place in that order is the branch.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from olp.core.arrays import Array
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.kinematics.chain import Kinematics
from olp.kinematics.parallel_arm import arm_of
from olp.kinematics.planar import PlanarChain
from olp.kinematics.poses import Poses, shift, tilts
from olp.kinematics.postures import Arm, wrapped
from olp.kinematics.structure import Structure


class Family(Protocol):
    """Machines whose axis values are known for every pose. `turns` are the letters of words that turn the
    tool, `reference` (3, 3) its rotation where they are zero."""

    @property
    def turns(self) -> str: ...

    @property
    def reference(self) -> Array: ...

    def postures(self, machine: Kinematics, words: Array) -> Array:
        """(n, branches, axes) axis values for words (n, axes), NaN where there are none. Those of rotary axes
        are within half a turn of the posture of the structure, where words do not state whole turns."""


@dataclass(frozen=True, slots=True, eq=False)
class TurnedArm:
    """Six rotary axes: A, B and C are roll, pitch and yaw of the frame of the gauge."""

    structure: Structure
    arm: Arm
    turns: str = "ABC"

    @staticmethod
    def of(structure: Structure) -> TurnedArm | None:
        arm = arm_of(structure)
        return None if arm is None else TurnedArm(structure, arm)

    @property
    def reference(self) -> Array:
        return np.eye(len(AXES))

    def postures(self, machine: Kinematics, words: Array) -> Array:
        tool = shift(np.array(machine.tool_mm)).inverse()
        target = Poses(tilts(np.radians(words[:, len(AXES) :])), words[:, : len(AXES)])
        near = np.array(self.structure.posture)
        return np.asarray(near - wrapped(near - self.arm.postures(target @ tool)))


#: How a structure is found to be of a family; a further one is one further line.
_FAMILIES: tuple[Callable[[Structure], Family | None], ...] = (PlanarChain.of, TurnedArm.of)


def family_of(structure: Structure) -> Family | None:
    """The family of a serial structure, None where its axis values for a pose are not known."""
    return next((family for of in _FAMILIES if (family := of(structure)) is not None), None)


def branch_of(family: Family, machine: Kinematics, words: Array) -> int:
    """The number of the branch that the posture of the structure is in, of which `words` (1, axes) are the
    pose."""
    near = np.array(machine.structure.posture)
    rotary = np.array([unit == "deg" for unit in machine.structure.units])
    away = family.postures(machine, words)[0] - near
    away = np.abs(np.where(rotary, wrapped(away), away))
    return int(np.argmin(np.max(np.where(np.isnan(away), np.inf, away), axis=1)))
