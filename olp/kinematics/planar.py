"""Machines that move the tip in a plane by two axes and along its normal by a third, and may turn the tool by
one more: SCARA and polar machines, whatever carries what.

The first two are turns, or a turn and a slide: circles and lines meet in two points, which are two branches.
"""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array
from olp.core.machine import Vector
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.kinematics.poses import axis_rotation, shift, turned
from olp.kinematics.postures import angle_about, two_turns, wrapped
from olp.kinematics.structure import FRAME, Joint, Structure

#: Sine of the angle between directions that count as parallel.
_PARALLEL = 1e-9
#: The letters of turns about X, Y and Z.
_LETTERS = "ABC"


@dataclass(frozen=True, slots=True, eq=False)
class PlanarChain:
    """Axes of a plane with a unit `normal` (3,): the `pair` that moves the tip in it, `along` it one slide,
    and behind the pair the `wrist`, None where nothing turns the tool. `turns` is the letter of its turn."""

    structure: Structure
    normal: Array
    pair: tuple[Joint, Joint]
    along: Joint
    wrist: Joint | None
    turns: str
    branches: int = 2

    @staticmethod
    def of(structure: Structure) -> PlanarChain | None:
        """The plane of a machine, None where it has none."""
        names = [name for name in structure.chain if name != FRAME]
        if structure.platforms or len(names) != len(structure.order):
            return None
        joints = [structure.joints[name] for name in names]
        turning = [joint for joint in joints if joint.kind == "rotary"]
        if not turning:
            return None
        normal = np.array(turning[0].direction)
        tilt = [float(np.linalg.norm(np.cross(normal, joint.direction))) for joint in joints]
        along = [joint for joint, size in zip(joints, tilt, strict=True) if size < _PARALLEL]
        along = [joint for joint in along if joint.kind == "linear"]
        plane = [joint for joint in joints if joint not in along]
        level = all(
            abs(normal @ np.array(joint.direction)) < _PARALLEL for joint in plane if joint.kind == "linear"
        )
        parallel = all(
            size < _PARALLEL for joint, size in zip(joints, tilt, strict=True) if joint.kind == "rotary"
        )
        if len(along) != 1 or len(plane) not in (2, 3) or not (level and parallel):
            return None
        first, second, *wrist = plane
        letter = _LETTERS[int(np.argmax(np.abs(normal)))] if wrist else ""
        turns_tool = not wrist or (wrist[0].kind == "rotary" and np.abs(normal).max() > 1.0 - _PARALLEL)
        if "rotary" not in (first.kind, second.kind) or not turns_tool:
            return None
        return PlanarChain(structure, normal, (first, second), along[0], wrist[0] if wrist else None, letter)

    @property
    def reference(self) -> Array:
        """(3, 3) the rotation of the tool where its turn is stated as zero."""
        return self.structure.gauge.pose.rotation

    def axes(self, words: Array, tool_mm: Vector, branch: int) -> Array:
        """(n, axes) axis values in a branch that bring the tip to words (n, axes), which are X, Y, Z and the
        turn; NaN where there are none. Axes of the pair are within half a turn of the posture of the
        structure. The wrist counts from there: the words state its whole turns."""
        structure, normal = self.structure, self.normal
        tip = (structure.gauge.pose @ shift(np.array(tool_mm))).position
        place, end = words[:, : len(AXES)], tip
        values = np.full((len(words), len(structure.order)), np.nan)
        own = np.array(self.along.direction) @ normal
        values[:, structure.order.index(self.along.name)] = ((place - tip) @ normal) / own
        turn = np.zeros(len(words))
        if self.wrist is not None:
            axis = np.eye(len(AXES))[_LETTERS.index(self.turns)]
            turn, end = words[:, len(AXES)] * (axis @ normal), np.array(self.wrist.point_mm)
            place = place - turned(axis_rotation(normal, np.radians(turn)), tip - end)
        with np.errstate(invalid="ignore"):
            both = self._pair(place, end)[branch]
        for joint, value in zip(self.pair, both, strict=True):
            column = structure.order.index(joint.name)
            values[:, column] = found = self._own(joint, column, value)
            if joint.kind == "rotary":
                turn = turn - found * (np.array(joint.direction) @ normal)
        if self.wrist is not None:
            sign = np.array(self.wrist.direction) @ normal
            values[:, structure.order.index(self.wrist.name)] = turn / sign
        return values

    def _own(self, joint: Joint, column: int, value: Array) -> Array:
        """(n,) the value of an axis of the pair from an angle about the normal in rad, or a way in mm."""
        if joint.kind == "linear":
            return value
        assert self.structure.posture is not None
        degrees = np.degrees(value) / (np.array(joint.direction) @ self.normal)
        near = self.structure.posture[column]
        return np.asarray(near - wrapped(near - degrees))

    def _pair(self, place: Array, end: Array) -> list[tuple[Array, Array]]:
        """(n,) what both axes of the pair do so that the point `end` (3,) comes to places (n, 3): the two
        branches, each in rad or mm."""
        normal, (first, second) = self.normal, self.pair
        if first.kind == second.kind:
            middle = np.array(second.point_mm)
            lower, upper = middle - np.array(first.point_mm), end - middle
            return two_turns(normal, lower, upper, place - np.array(first.point_mm))
        turn, slide = (first, second) if first.kind == "rotary" else (second, first)
        way = np.array(slide.direction)
        arm, reach = (self._level(point - np.array(turn.point_mm)) for point in (end, place))
        # the arm that turns is as long as what it has to reach: |arm + s way| = |reach|, or |reach - s way|
        moved, other = (arm, reach) if turn is first else (reach, arm)
        sign = 1.0 if turn is first else -1.0
        middle_mm, size = moved @ way, np.sum(moved * moved, axis=-1) - np.sum(other * other, axis=-1)
        half = np.sqrt(middle_mm**2 - size)
        found = []
        for side in (half, -half):
            slid = side - middle_mm
            ends = moved + slid[:, None] * way
            pair = (ends, other) if turn is first else (other, ends)
            angle = angle_about(normal, *np.broadcast_arrays(*pair))
            found.append((angle, slid) if turn is first else (sign * slid, angle))
        return found

    def _level(self, vectors: Array) -> Array:
        """Vectors (..., 3) without their parts along the normal."""
        return np.asarray(vectors - (vectors @ self.normal)[..., None] * self.normal)
