"""Serial machines whose control computes the axes from poses: which of several axis values it takes.

A family knows all axis values that reach a pose, in an order that keeps along a path. The posture of the
structure is one of them where it stands: its place in that order is the branch.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Protocol

import numpy as np

from olp.core.arrays import Array
from olp.core.machine import Vector
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.kinematics.parallel_arm import arm_of
from olp.kinematics.planar import PlanarChain
from olp.kinematics.poses import Poses, shift, tilts
from olp.kinematics.postures import POSTURES, Arm, wrapped
from olp.kinematics.structure import Gauge, Joint, Structure

#: Machines and tools that are remembered.
REMEMBERED = 64


class Family(Protocol):
    """Machines whose axis values are known for every pose. `turns` are the letters of words that turn the
    tool, `reference` (3, 3) its rotation where they are zero, `branches` the number of postures of a pose."""

    def __hash__(self) -> int: ...

    @property
    def structure(self) -> Structure: ...

    @property
    def turns(self) -> str: ...

    @property
    def branches(self) -> int: ...

    @property
    def reference(self) -> Array: ...

    def axes(self, words: Array, tool_mm: Vector, branch: int) -> Array:
        """(n, axes) axis values in a branch for words (n, axes), NaN where there are none. Those of rotary
        axes are within half a turn of the posture of the structure, where words do not state whole turns."""


@dataclass(frozen=True, slots=True, eq=False)
class TurnedArm:
    """Six rotary axes: A, B and C are roll, pitch and yaw of the frame of the gauge."""

    structure: Structure
    arm: Arm
    turns: str = "ABC"
    branches: int = POSTURES

    @staticmethod
    def of(structure: Structure) -> TurnedArm | None:
        """The arm of a machine, None where it is no arm whose postures are known."""
        arm = arm_of(structure)
        return None if arm is None else TurnedArm(structure, arm)

    @property
    def reference(self) -> Array:
        """(3, 3) as `Family`."""
        return np.eye(len(AXES))

    def axes(self, words: Array, tool_mm: Vector, branch: int) -> Array:
        """(n, 6) as `Family`."""
        tool = shift(np.array(tool_mm)).inverse()
        target = Poses(tilts(np.radians(words[:, len(AXES) :])), words[:, : len(AXES)])
        near = np.array(self.structure.posture)
        return np.asarray(near - wrapped(near - self.arm.branch(target @ tool, branch)))


#: How a structure is found to be of a family; a further one is one further line.
_FAMILIES: tuple[Callable[[Structure], Family | None], ...] = (PlanarChain.of, TurnedArm.of)


def family_of(structure: Structure) -> Family | None:
    """The family of a structure, None where its axis values for a pose are not known."""
    if structure.platforms:
        return None
    joints = tuple(structure.joints.values())
    return _family(structure.chain, joints, structure.gauge, structure.posture)


@functools.lru_cache(REMEMBERED)
def _family(
    chain: tuple[str, ...], joints: tuple[Joint, ...], gauge: Gauge, posture: tuple[float, ...] | None
) -> Family | None:
    bare = Structure("", chain, {joint.name: joint for joint in joints}, gauge=gauge, posture=posture)
    return next((family for of in _FAMILIES if (family := of(bare)) is not None), None)
