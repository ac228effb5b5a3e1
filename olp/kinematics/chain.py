"""Where the tool is: a machine of any joints from axis values to poses of the tip, nominal and actual."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.machine import ZERO, Vector
from olp.core.values import dataclass
from olp.kinematics.columns import (
    BATCH,
    STILL,
    Columns,
    Triple,
    about,
    add,
    cross,
    dot,
    shifted,
    subtract,
    tilted,
    triple,
)
from olp.kinematics.errors import JointErrors, LegErrors, MachineErrors, Yield
from olp.kinematics.motion import actual_motion, nominal_motion
from olp.kinematics.platforms import held, rods_of, swings
from olp.kinematics.poses import Poses, relative
from olp.kinematics.structure import FRAME, Platform, Structure
from olp.kinematics.weight import gravity_problems, yields_of

#: Axis values (n,) by name.
Values = Mapping[str, Array]


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
        return self._poses(self._nominal, self._checked(values))

    def actual(self, values: Array, sides: Array | None = None) -> Poses:
        """(n) poses of the tool with all errors. `sides` (n, axes) from -1 to 1 are the sides of the
        backlash: 1 after a motion toward larger values; None: in the middle of it. Raises CannotCompute."""
        values = self._checked(values)
        sides = np.zeros((1, 1)) if sides is None else sides
        return self._poses(self._actual, values, np.broadcast_to(sides, values.shape))

    def deviation(self, values: Array, sides: Array | None = None) -> tuple[Array, Array]:
        """(n, 3) mm at the tip and (n, 3) rad as rotation vectors, actual minus nominal, in workpiece
        coordinates. Raises CannotCompute."""
        nominal, actual = self.nominal(values), self.actual(values, sides)
        return actual.position - nominal.position, relative(actual.rotation, nominal.rotation)

    def jacobian(self, values: Array) -> Array:
        """(n, 6, axes) nominal: mm of the tip and rad of the tool per mm or rad of each axis, in workpiece
        coordinates. Raises CannotCompute."""
        return self.nominal_and_slopes(values, range(len(self.structure.order)))[1]

    def nominal_and_slopes(self, values: Array, axes: Sequence[int]) -> tuple[Poses, Array]:
        """(n) poses without errors and the Jacobian of some axes by column, as (n, 6, k)."""
        values = self._checked(values)
        places = {self.structure.order[axis]: place for place, axis in enumerate(axes)}
        slopes = np.zeros((6, len(places), len(values)))
        rotation, position = np.empty((3, 3, len(values))), np.empty((3, len(values)))
        for a, some in self._batches(values):
            b = a + some.shape[1]
            tool = self._slopes(some, places, slopes[:, :, a:b])
            tool.store(rotation[:, :, a:b], position[:, a:b])
        return Poses(rotation.transpose(2, 0, 1), position.T), slopes.transpose(2, 0, 1)

    def _slopes(self, columns: Array, places: Mapping[str, int], slopes: Array) -> Columns:
        """The pose of the tool at axis values (axes, n). Its Jacobian is put into its `places` of (6, axes,
        n)."""
        values = self._named(columns)
        motions, count = self._nominal_motions(values, columns.shape[1]), columns.shape[1]
        tool = self._tool(motions)
        tip, pose = tool.shift, STILL
        for name in self.structure.chain:
            if name in self.structure.platforms:
                platform = self.structure.platforms[name]
                local = pose.inverse().at(tip)
                for axis, (velocity, turn) in self._swings(platform, values, motions, local, count).items():
                    if axis in places:
                        _put(slopes[:, places[axis]], pose.turned(velocity), pose.turned(turn))
            elif name in places:
                joint, place = self.structure.joints[name], slopes[:, places[name]]
                direction = pose.turned(triple(joint.direction))
                if joint.kind == "rotary":
                    arm = subtract(tip, pose.at(triple(joint.point_mm)))
                    _put(place, cross(direction, arm), direction)
                else:
                    _put(place, direction, ZERO)
            if name != FRAME:
                pose = pose @ motions[name]
        return tool

    def _checked(self, values: Array) -> Array:
        values = np.asarray(values, float)
        if values.ndim != 2 or values.shape[1] != len(self.structure.order):
            raise ConfigError(
                f"axis values have the shape {values.shape}; expected a column for each of "
                f"{', '.join(self.structure.order)}"
            )
        return values

    def _batches(self, values: Array) -> Iterator[tuple[int, Array]]:
        """The first row of each batch, and its (axes, rows) values. Platforms are solved in one."""
        size = max(len(values), 1) if self.structure.platforms else BATCH
        for a in range(0, len(values), size):
            yield a, np.ascontiguousarray(values[a : a + size].T)

    def _poses(self, compose: Callable[..., Columns], values: Array, *more: Array) -> Poses:
        rotation, position = np.empty((3, 3, len(values))), np.empty((3, len(values)))
        for a, some in self._batches(values):
            b = a + some.shape[1]
            columns = compose(some, *(np.ascontiguousarray(part[a:b].T) for part in more))
            columns.store(rotation[:, :, a:b], position[:, a:b])
        return Poses(rotation.transpose(2, 0, 1), position.T)

    def _named(self, columns: Array) -> Values:
        return dict(zip(self.structure.order, columns, strict=True))

    def _nominal(self, columns: Array) -> Columns:
        return self._tool(self._nominal_motions(self._named(columns), columns.shape[1]))

    def _nominal_motions(self, values: Values, count: int) -> dict[str, Columns]:
        """The motion of each joint and platform by name."""
        structure = self.structure
        motions = {
            name: nominal_motion(joint, values[name])
            for name, joint in structure.joints.items()
            if joint.kind != "length"
        }
        for platform in structure.platforms.values():
            rods = rods_of(platform, self._lengths(values, None), motions, lambda _: LegErrors(), count)
            motions[platform.name] = Columns.of(held(platform, rods, None))
        return motions

    def _lengths(self, values: Values, sides: Values | None) -> dict[str, Array]:
        """(n,) values of the axes that are lengths of legs; with their errors where `sides` is given."""
        lengths = {}
        for name, joint in self.structure.joints.items():
            if joint.kind == "length":
                lengths[name] = values[name]
                errors = self.errors.joints.get(name)
                if sides is not None and errors is not None:
                    motion = actual_motion(joint, errors, values[name], on_workpiece=False, side=sides[name])
                    lengths[name] = np.asarray(dot(motion.shift, triple(joint.direction)))
        return lengths

    def _actual(self, columns: Array, side_columns: Array) -> Columns:
        structure, errors, count = self.structure, self.errors, columns.shape[1]
        values, sides = self._named(columns), self._named(side_columns)
        nominal = self._nominal_motions(values, count) if structure.platforms or errors.yields else {}
        yields = yields_of(structure, errors, values, nominal)
        motions = {}
        for name, joint in structure.joints.items():
            if joint.kind != "length":
                motions[name] = actual_motion(
                    joint,
                    errors.joints.get(name) or JointErrors(joint.point_mm),
                    values[name],
                    on_workpiece=name in structure.workpiece_side,
                    side=sides[name],
                    yielded=yields.get(name),
                )
        for name, platform in structure.platforms.items():
            legs = [errors.legs.get((name, leg)) or LegErrors() for leg in range(len(platform.legs))]
            rods = rods_of(platform, self._lengths(values, sides), motions, legs.__getitem__, count)
            motions[name] = Columns.of(held(platform, rods, nominal[name].rows(count)))
        wrong = about(
            triple(structure.gauge.point_mm),
            tilted(triple(errors.gauge_tilt_rad)),
            triple(errors.gauge_shift_mm),
        )
        return self._tool(motions, wrong)

    def _tool(self, motions: Mapping[str, Columns], gauge: Columns = STILL) -> Columns:
        """The pose of the tool from the motions of all parts and the error of the gauge frame."""
        pose = STILL
        for name in self.structure.chain:
            if name != FRAME:
                pose = pose @ motions[name]
        return pose @ (gauge @ Columns.of(self.structure.gauge.pose) @ shifted(triple(self.tool_mm)))

    def _swings(
        self, platform: Platform, values: Values, motions: Mapping[str, Columns], tip: Triple, count: int
    ) -> dict[str, tuple[Triple, Triple]]:
        """By each axis of a platform mm of the tip and rad of the platform per unit of it,
        in the coordinates in front of the platform."""
        rods = rods_of(platform, self._lengths(values, None), motions, lambda _: LegErrors(), count)
        arm = subtract(tip, motions[platform.name].shift)
        rates = {}
        for axis, step in swings(platform, self.structure.joints, rods, motions).items():
            turn = triple(step[:, 3:])
            rates[axis] = add(triple(step[:, :3]), cross(turn, arm)), turn
        return rates


def _put(slopes: Array, velocity: Triple, turn: Triple) -> None:
    """Put one axis into (6, n)."""
    for row, entry in enumerate((*velocity, *turn)):
        slopes[row] = entry


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
    problems += [sentence for _, sentence in gravity_problems(structure, errors)]
    off_chain = sorted(errors.yields.keys() & structure.joints.keys() - set(structure.chain))
    problems += [f"elasticity of {name}, which is out of the chain, is not modelled" for name in off_chain]
    return problems
