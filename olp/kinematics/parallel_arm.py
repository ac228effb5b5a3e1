"""Postures of an arm whose second, third and fourth axis are parallel, as those of light robots are."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array
from olp.kinematics.poses import Poses, turned
from olp.kinematics.postures import (
    AXES,
    POSTURES,
    Arm,
    Choose,
    Pick,
    angle_about,
    both,
    meeting,
    met,
    rotary_lines,
    wrapped,
)
from olp.kinematics.structure import Structure

#: mm; axes that pass each other nearer than this meet
_MEET_MM = 1e-6
#: Sine of the angle between directions that count as parallel.
_PARALLEL = 1e-9
#: Sine of the angle between the last axis and the three parallel ones below which they turn the tool alike.
_STRAIGHT = 1e-5
#: What makes a share of the wrist's bend comparable with mm and deg.
_SHARE = 100.0


class ParallelArm(Arm):
    """Six rotary axes of which the second to the fourth are parallel; the last two meet in `wrist`."""

    @staticmethod
    def of(structure: Structure) -> Arm | None:
        lines = rotary_lines(structure)
        if lines is None:
            return None
        direction, point, columns = lines
        parallel = np.linalg.norm(np.cross(direction[1], direction[[2, 3]]), axis=1) < _PARALLEL
        bent = np.linalg.norm(np.cross(direction[[0, 3, 4]], direction[[1, 4, 5]]), axis=1) > _PARALLEL
        if not parallel.all() or not bent.all():
            return None
        wrist, away = meeting(direction[4:], point[4:])
        if away > _MEET_MM:
            return None
        return ParallelArm(direction, point, columns, wrist, structure.gauge.pose)

    def postures(self, flange: Poses) -> Array:
        """As those of other arms. Where the last axis is parallel to the three there is none."""
        motion = flange @ self.flange.inverse()
        centre = motion.at(self.wrist)
        result, number = np.full((len(centre), POSTURES, AXES), np.nan), 0
        with np.errstate(invalid="ignore", divide="ignore"):
            for first in self._first(centre):
                rest = self._behind(motion, first)
                for fifth, sixth in self._wrist_pair(rest.rotation):
                    for middle in self._middle(rest, fifth, sixth):
                        result[:, number] = np.stack((first, *middle, fifth, sixth), axis=1)
                        number += 1
        result[np.isnan(result).any(axis=2)] = np.nan
        values = np.empty(result.shape)
        values[:, :, self.columns] = wrapped(np.degrees(result))
        return values

    def _chosen(self, flange: Poses, choose: Choose) -> Array:
        """As that of other arms."""
        motion = flange @ self.flange.inverse()
        values = np.empty((len(motion.position), AXES))
        with np.errstate(invalid="ignore", divide="ignore"):
            first = choose(self._first(motion.at(self.wrist)), 0)
            rest = self._behind(motion, first)
            ((fifth, sixth),) = self._wrist_pair(rest.rotation, lambda of: [choose(of, 4)])
            (middle,) = self._middle(rest, fifth, sixth, lambda of: [choose(of, 2)])
        values[:, self.columns] = np.degrees(np.stack((first, *middle, fifth, sixth), axis=1))
        return values

    def _behind(self, motion: Poses, first: Array) -> Poses:
        """What the axes behind the first do of a motion."""
        held = self._turn(0, -first)
        return Poses(held @ motion.rotation, self.point[0] + turned(held, motion.position - self.point[0]))

    def branches(self, axes: Array) -> Array:
        """(..., 4) what tells postures apart: mm, mm and twice a share of the bend. They are positive where
        the wrist is before the first axis, before the lower arm, and where the last axis turns from the three
        toward the fifth."""
        shape, side = axes.shape[:-1], self.direction[1]
        values = np.radians(axes.reshape(-1, AXES)[:, self.columns])
        ahead = np.cross(side, self.direction[0])
        place, lower = self.wrist - self.point[3], self.point[2] - self.point[1]
        upper = self.point[3] - self.point[2]
        second, third = self._turn(1, values[:, 1]), self._turn(2, values[:, 2])
        lower = turned(second, np.broadcast_to(lower, (len(values), 3)))
        upper = turned(second @ third, np.broadcast_to(upper, (len(values), 3)))
        hand = turned(second @ third @ self._turn(3, values[:, 3]), np.broadcast_to(place, (len(values), 3)))
        size = float(np.linalg.norm(self.point[2] - self.point[1]))
        before = np.cross(lower, upper) @ side / size
        last = turned(self._turn(4, values[:, 4]), np.broadcast_to(self.direction[5], (len(values), 3)))
        bend = _SHARE * (np.cross(self.direction[4], last) @ side)
        reach = (self.point[1] - self.point[0] + lower + upper + hand) @ ahead
        return np.stack((reach, before, bend, bend), axis=1).reshape(*shape, 4)

    def _wrist_pair(self, rest: Array, pick: Pick = both) -> list[tuple[Array, Array]]:
        """(n,) angles of the last two axes, for those of the fifth that are picked. The rotation behind the
        first is `rest` (n, 3, 3)."""
        side, fifth, sixth = self.direction[[1, 4, 5]]
        inner = fifth * (fifth @ sixth)
        want = turned(rest, np.broadcast_to(sixth, (len(rest), 3))) @ side - side @ inner
        across = np.swapaxes(rest, -1, -2) @ side
        found = []
        for angle in pick(met(side @ (sixth - inner), side @ np.cross(fifth, sixth), want)):
            along = self._turn(4, -angle) @ side
            straight = np.linalg.norm(np.cross(along, sixth), axis=1) < _STRAIGHT
            found.append((angle, np.where(straight, np.nan, angle_about(sixth, across, along))))
        return found

    def _middle(
        self, rest: Poses, fifth: Array, sixth: Array, pick: Pick = both
    ) -> list[tuple[Array, Array, Array]]:
        """(n,) angles of the three parallel axes, for those of the third that are picked."""
        side, back = self.direction[1], [self._turn(4, -fifth), self._turn(5, -sixth)]
        beside = np.cross(side, np.eye(3)[int(np.argmin(np.abs(side)))])
        whole = angle_about(
            side, beside, turned(rest.rotation @ back[1] @ back[0], np.broadcast_to(beside, (len(fifth), 3)))
        )
        place = self.point[3]
        for turn, point in zip(back, self.point[4:], strict=True):
            place = point + turned(turn, np.broadcast_to(place - point, (len(fifth), 3)))
        place = rest.position + turned(rest.rotation, place)
        found = []
        for second, third in self._lower_arm(place, self.point[3], pick):
            about = third * float(self.direction[2] @ side)
            found.append((second, third, (whole - second - about) * float(self.direction[3] @ side)))
        return found


def arm_of(structure: Structure) -> Arm | None:
    """The arm of a machine, None where it is no arm whose postures are known."""
    return Arm.of(structure) or ParallelArm.of(structure)
