"""A machine as bodies joined by joints, from workpiece to tool. Everything is stated in machine coordinates
with all axes at zero: lengths in mm, directions of the tool relative to the workpiece."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import field
from typing import Literal

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.geometry import rotation_matrix
from olp.core.machine import ZERO, Vector
from olp.core.values import dataclass
from olp.kinematics.poses import Poses

Kind = Literal["linear", "rotary", "length"]
#: The unit of an axis value by the kind of its joint.
UNITS: Mapping[str, str] = {"linear": "mm", "rotary": "deg", "length": "mm"}
#: mm; a turn of an axis or the tool counts as its arc at this radius, where nothing else is said.
REFERENCE_RADIUS_MM = 500.0
#: The name of the frame in a chain.
FRAME = "F"


@dataclass(frozen=True, slots=True)
class Joint:
    """A straight line in space and what moves along or about it. `length` is that of a leg of a platform,
    which has no line of its own. `direction` is a unit vector. `travel` is in mm or deg. Where `correct` is
    False a correction keeps the axis as the program states it. `most` are the largest velocity, acceleration
    and jerk, None where the machine file states none."""

    name: str
    kind: Kind
    direction: Vector
    point_mm: Vector
    travel: tuple[float, float]
    least_increment: float = 0.0
    correct: bool = True
    most: tuple[float | None, float | None, float | None] = (None, None, None)

    @property
    def unit(self) -> str:
        """ "mm" or "deg"."""
        return UNITS[self.kind]


@dataclass(frozen=True, slots=True)
class Leg:
    """A rod from `base_mm` to `platform_mm`, of `length_mm` plus the value of `axis` where it has one. The
    base stands still, or rides on the joint `carriage`."""

    base_mm: Vector
    platform_mm: Vector
    length_mm: float
    axis: str | None = None
    carriage: str | None = None


@dataclass(frozen=True, slots=True)
class Platform:
    """A body that legs hold. Where `turns` is False it only shifts, and three legs hold it. `start_mm` is a
    shift from which the branch of the first pose is found."""

    name: str
    legs: tuple[Leg, ...]
    start_mm: Vector
    turns: bool = True


@dataclass(frozen=True, slots=True)
class Gauge:
    """The frame that holds the tool, with all axes at zero: Rz Ry Rx of A, B, C in degrees."""

    point_mm: Vector = ZERO
    angles_deg: Vector = ZERO

    @property
    def pose(self) -> Poses:
        return Poses(rotation_matrix(self.angles_deg), np.array(self.point_mm))


@dataclass(frozen=True, slots=True)
class Structure:
    """A machine of any joints. `chain` names joints and platforms from workpiece to tool, with `F` for the
    frame; `joints` are all axes, also those of legs and carriages, in the order of columns of axis values.
    Where words of programs state poses of serial axes, `posture` are axis values in the branch they mean.
    The control leads `endless` rotary axes on over whole turns; else they are within half a turn of it.

    Raises ConfigError where the parts do not fit each other.
    """

    name: str
    chain: tuple[str, ...]
    joints: Mapping[str, Joint]
    platforms: Mapping[str, Platform] = field(default_factory=dict)
    gauge: Gauge = Gauge()
    gravity: Vector = (0.0, 0.0, -1.0)
    symmetric_tool: bool = True
    posture: tuple[float, ...] | None = None
    endless: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        problems = structure_problems(self.chain, self.joints, self.platforms)
        if problems:
            raise ConfigError("; ".join(problems), problems=tuple(problems))

    @property
    def order(self) -> tuple[str, ...]:
        """The names of the axes in the order of columns."""
        return tuple(self.joints)

    @property
    def workpiece_side(self) -> frozenset[str]:
        """The parts of the chain that carry the workpiece."""
        return frozenset(self.chain[: self.chain.index(FRAME)])

    @property
    def units(self) -> tuple[str, ...]:
        """ "mm" or "deg" of each axis."""
        return tuple(joint.unit for joint in self.joints.values())

    def axis_values(self, values: Mapping[str, float | Array]) -> Array:
        """(n, axes) columns of axis values by name, mm and deg; an axis that is left out is at 0. Raises
        ConfigError for a name that is no axis."""
        unknown = sorted(values.keys() - self.joints.keys())
        if unknown:
            raise ConfigError(
                f"{', '.join(unknown)}: no such axis of machine {self.name!r}; expected "
                f"{', '.join(self.order)}"
            )
        columns = [np.asarray(values.get(name, 0.0), float) for name in self.order]
        return np.stack(np.broadcast_arrays(*(np.atleast_1d(column) for column in columns)), axis=1)


def structure_problems(
    chain: tuple[str, ...], joints: Mapping[str, Joint], platforms: Mapping[str, Platform]
) -> list[str]:
    """What does not fit in a chain, its joints and its platforms, as sentences."""
    problems = []
    if chain.count(FRAME) != 1:
        problems.append(f'chain names the frame "F" {chain.count(FRAME)} times; expected it once')
    problems += [f"chain names {name} twice" for name in dict.fromkeys(chain) if chain.count(name) > 1]
    known = {FRAME, *joints, *platforms}
    unknown = [name for name in dict.fromkeys(chain) if name not in known]
    if unknown:
        problems.append(
            f"chain names {', '.join(unknown)}; expected names of tables [axes.NAME] or [platforms.NAME]"
        )
    legs = [(platform, leg) for platform in platforms.values() for leg in platform.legs]
    used = {name for _, leg in legs for name in (leg.axis, leg.carriage) if name is not None}
    problems += [
        f"axes.{name} is in neither the chain nor a leg; expected it in one of them"
        for name in joints
        if name not in chain and name not in used
    ]
    problems += [f"platforms.{name} is not in the chain" for name in platforms if name not in chain]
    problems += [_joint_problem(joint) for joint in joints.values() if _joint_problem(joint)]
    for platform in platforms.values():
        problems += _platform_problems(platform, joints)
        if FRAME in chain and platform.name in chain[: chain.index(FRAME)]:
            problems.append(f"platforms.{platform.name} carries the workpiece; expected it behind F")
    for name, joint in joints.items():
        if joint.kind == "length" and name in chain:
            problems.append(f"axes.{name} is the length of a leg; expected it out of the chain")
        elif name in chain and name in used:
            problems.append(f"axes.{name} is in the chain and in a leg; expected it in one of them")
    return problems


def _joint_problem(joint: Joint) -> str:
    size = math.hypot(*joint.direction)
    if joint.kind != "length" and abs(size - 1.0) > 1e-9:
        return f"axes.{joint.name}.direction has the length {size:g}; expected a unit vector"
    return ""


def _platform_problems(platform: Platform, joints: Mapping[str, Joint]) -> list[str]:
    label = f"platforms.{platform.name}"
    count = 6 if platform.turns else 3
    problems = []
    if len(platform.legs) != count:
        problems.append(
            f"{label} has {len(platform.legs)} legs; expected {count}, "
            + ("which hold position and orientation" if platform.turns else "because it does not turn")
        )
    for number, leg in enumerate(platform.legs, 1):
        named = [name for name in (leg.axis, leg.carriage) if name is not None]
        if len(named) != 1:
            problems.append(f"{label}: leg {number} names {len(named)} axes; expected axis or carriage")
        for name, kinds in ((leg.axis, ("length",)), (leg.carriage, ("linear", "rotary"))):
            if name is not None and (name not in joints or joints[name].kind not in kinds):
                problems.append(
                    f"{label}: leg {number} names {name}; expected a table [axes.{name}] with "
                    f"kind {' or '.join(kinds)}"
                )
    return problems
