"""Where the tool is: a machine of any joints from axis values to poses of the tip, nominal and actual."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.machine import ZERO, Vector
from olp.core.values import dataclass
from olp.kinematics.errors import JointErrors, LegErrors, MachineErrors, Yield
from olp.kinematics.motion import actual_motion, nominal_motion
from olp.kinematics.platforms import held, rods_of, swings
from olp.kinematics.poses import STILL, Poses, about, rotation_vector, shift, tilts, turned
from olp.kinematics.structure import FRAME, Platform, Structure
from olp.kinematics.weight import yields_of


@dataclass(frozen=True, slots=True, eq=False)
class Kinematics:
    """A machine with a tool and its errors. `tool_mm` runs from the gauge point to the tip, in the gauge
    frame. Poses are those of the tool in workpiece coordinates, which are the machine's at axis zero.

    Axis values are (n, axes) in mm and deg, in the order of `structure.order`. Raises ConfigError where an
    error belongs to no part of the machine.
    """

    structure: Structure
    errors: MachineErrors = MachineErrors()
    tool_mm: Vector = ZERO

    def __post_init__(self) -> None:
        problems = _unknown_parts(self.structure, self.errors)
        if problems:
            raise ConfigError("; ".join(problems), problems=tuple(problems))

    def nominal(self, values: Array) -> Poses:
        """(n) poses of the tool without errors. Raises CannotCompute where a platform does not close."""
        return self._tool(self._nominal_motions(self._checked(values)), len(values))

    def actual(self, values: Array, sides: Array | None = None) -> Poses:
        """(n) poses of the tool with all errors. `sides` (n, axes) from -1 to 1 are the sides of the
        backlash: 1 after a motion toward larger values; None: in the middle of it. Raises CannotCompute."""
        return self._actual(self._checked(values), sides)

    def deviation(self, values: Array, sides: Array | None = None) -> tuple[Array, Array]:
        """(n, 3) mm at the tip and (n, 3) rad as rotation vectors, actual minus nominal, in workpiece
        coordinates. Raises CannotCompute."""
        nominal, actual = self.nominal(values), self.actual(values, sides)
        turn = actual.rotation @ np.swapaxes(nominal.rotation, -1, -2)
        return actual.position - nominal.position, rotation_vector(turn)

    def jacobian(self, values: Array) -> Array:
        """(n, 6, axes) nominal: mm of the tip and rad of the tool per mm or rad of each axis, in workpiece
        coordinates. Raises CannotCompute."""
        values = self._checked(values)
        motions, count = self._nominal_motions(values), len(values)
        tip = self._tool(motions, count).position
        columns = np.zeros((count, 6, len(self.structure.order)))
        pose = STILL
        for name in self.structure.chain:
            if name in self.structure.platforms:
                platform = self.structure.platforms[name]
                local = turned(np.swapaxes(pose.rotation, -1, -2), tip - pose.position)
                for axis, (velocity, turn) in self._swings(platform, values, motions, local).items():
                    columns[:, :3, axis] = turned(pose.rotation, velocity)
                    columns[:, 3:, axis] = turned(pose.rotation, turn)
            elif name != FRAME:
                joint, axis = self.structure.joints[name], self.structure.order.index(name)
                direction = turned(pose.rotation, np.array(joint.direction))
                if joint.kind == "rotary":
                    point = pose.at(np.array(joint.point_mm))
                    columns[:, :3, axis] = np.cross(direction, tip - point)
                    columns[:, 3:, axis] = direction
                else:
                    columns[:, :3, axis] = direction
            if name != FRAME:
                pose = pose @ motions[name]
        return columns

    def _checked(self, values: Array) -> Array:
        values = np.asarray(values, float)
        if values.ndim != 2 or values.shape[1] != len(self.structure.order):
            raise ConfigError(
                f"axis values have the shape {values.shape}; expected a column for each of "
                f"{', '.join(self.structure.order)}"
            )
        return values

    def _column(self, values: Array, name: str) -> Array:
        return np.asarray(values[:, self.structure.order.index(name)])

    def _nominal_motions(self, values: Array) -> dict[str, Poses]:
        """The motion of each joint and platform by name."""
        structure = self.structure
        motions = {
            name: nominal_motion(joint, self._column(values, name))
            for name, joint in structure.joints.items()
            if joint.kind != "length"
        }
        for platform in structure.platforms.values():
            rods = rods_of(platform, self._lengths(values, None), motions, lambda _: LegErrors(), len(values))
            motions[platform.name] = held(platform, rods, None)
        return motions

    def _lengths(self, values: Array, sides: Array | None) -> dict[str, Array]:
        """(n,) values of the axes that are lengths of legs; with their errors where `sides` is given."""
        lengths = {}
        for name, joint in self.structure.joints.items():
            if joint.kind == "length":
                lengths[name] = self._column(values, name)
                errors = self.errors.joints.get(name)
                if sides is not None and errors is not None:
                    motion = actual_motion(
                        joint, errors, lengths[name], on_workpiece=False, side=self._column(sides, name)
                    )
                    lengths[name] = motion.position @ np.array(joint.direction)
        return lengths

    def _actual(self, values: Array, sides: Array | None) -> Poses:
        structure, errors = self.structure, self.errors
        sides = np.zeros_like(values) if sides is None else np.broadcast_to(sides, values.shape)
        nominal = self._nominal_motions(values) if structure.platforms or errors.yields else {}
        yields = yields_of(structure, errors, nominal, values)
        motions = {}
        for name, joint in structure.joints.items():
            if joint.kind != "length":
                motions[name] = actual_motion(
                    joint,
                    errors.joints.get(name) or JointErrors(joint.point_mm),
                    self._column(values, name),
                    on_workpiece=name in structure.workpiece_side,
                    side=self._column(sides, name),
                    yielded=yields.get(name),
                )
        for name, platform in structure.platforms.items():
            legs = [errors.legs.get((name, leg)) or LegErrors() for leg in range(len(platform.legs))]
            rods = rods_of(platform, self._lengths(values, sides), motions, legs.__getitem__, len(values))
            motions[name] = held(platform, rods, nominal[name])
        wrong = about(
            np.array(structure.gauge.point_mm),
            tilts(np.array(errors.gauge_tilt_rad)),
            np.array(errors.gauge_shift_mm),
        )
        return self._tool(motions, len(values), wrong)

    def _tool(self, motions: Mapping[str, Poses], count: int, gauge: Poses = STILL) -> Poses:
        """The pose of the tool from the motions of all parts and the error of the gauge frame."""
        pose = STILL
        for name in self.structure.chain:
            if name != FRAME:
                pose = pose @ motions[name]
        tool = pose @ gauge @ self.structure.gauge.pose @ shift(np.array(self.tool_mm))
        return tool.rows(count)

    def _swings(
        self, platform: Platform, values: Array, motions: Mapping[str, Poses], tip: Array
    ) -> dict[int, tuple[Array, Array]]:
        """By the column of each axis of a platform (n, 3) mm of the tip and (n, 3) rad of the platform per
        unit of the axis, in the coordinates in front of the platform."""
        rods = rods_of(platform, self._lengths(values, None), motions, lambda _: LegErrors(), len(values))
        steps = swings(platform, self.structure.joints, rods, motions)
        arm = tip - motions[platform.name].position
        return {
            self.structure.order.index(axis): (step[:, :3] + np.cross(step[:, 3:], arm), step[:, 3:])
            for axis, step in steps.items()
        }


def _unknown_parts(structure: Structure, errors: MachineErrors) -> list[str]:
    """Errors of parts that the machine does not have, or that have no meaning there, as sentences."""
    named = {"location or curves": errors.joints, "elasticity": errors.yields}
    named["masses"] = {mass.on: mass for mass in errors.masses}
    problems = [
        f"{what} of {name}: the machine has no axis {name}; expected one of {', '.join(structure.order)}"
        for what, names in named.items()
        for name in names
        if name not in structure.joints
    ]
    problems += [
        f"legs of platform {platform}, leg {leg + 1}: the machine has no such leg"
        for platform, leg in errors.legs
        if platform not in structure.platforms or leg >= len(structure.platforms[platform].legs)
    ]
    if structure.platforms and any(gives != Yield() for gives in errors.yields.values()):
        problems.append("elasticity of a machine with platforms is not modelled; leave [elasticity] out")
    off_chain = sorted(errors.yields.keys() & structure.joints.keys() - set(structure.chain))
    problems += [f"elasticity of {name}, which is out of the chain, is not modelled" for name in off_chain]
    return problems
