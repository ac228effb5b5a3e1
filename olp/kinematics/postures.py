"""The postures of an arm with a wrist of three axes through one point: all that bring the flange to a pose.

The wrist's centre is reached by three axes, of which the second and the third are parallel; two circles meet
in two points each time. Nothing here knows a language or a file.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.values import dataclass
from olp.kinematics.poses import Poses, axis_rotation, turned
from olp.kinematics.structure import FRAME, Structure

#: Axes of an arm.
AXES = 6
#: Postures that bring the flange to one pose, turns left out.
POSTURES = 8
#: Axes of a straight wrist that turn the tool alike.
_SHARING = (3, 5)
#: mm; axes of the wrist that pass each other nearer than this meet
_MEET_MM = 1e-6
#: Sine of the angle between directions that count as parallel.
_PARALLEL = 1e-9
#: Cosines this much above 1 are an arm that is stretched out, and rounding.
_STRETCHED = 1e-9
#: Sine of the angle of the wrist below which how two of its axes share a turn is not known.
_STRAIGHT = 1e-5
#: mm from the first axis within which its angle is not known.
_ABOVE_MM = 1e-3


#: Takes one of two choices of angles (n,) of an axis, by its number.
Choose = Callable[[Sequence[Array], int], Array]
#: The choices of angles (n,) with which to go on.
Pick = Callable[[Sequence[Array]], Sequence[Array]]


def both(choices: Sequence[Array]) -> Sequence[Array]:
    """All choices."""
    return choices


@dataclass(frozen=True, slots=True, eq=False)
class Arm:
    """Six rotary axes in the order of the chain: `direction` and `point` (6, 3) of each with all at zero, and
    the `columns` (6,) of their values. Also the centre of the wrist, and the flange at zero."""

    direction: Array
    point: Array
    columns: Index
    wrist: Array
    flange: Poses

    @staticmethod
    def of(structure: Structure) -> Arm | None:
        """The arm of a machine, None where it is no such arm."""
        lines = rotary_lines(structure)
        if lines is None:
            return None
        direction, point, columns = lines
        wrist, away = meeting(direction[3:], point[3:])
        parallel = np.linalg.norm(np.cross(direction[1], direction[2])) < _PARALLEL
        bent = np.linalg.norm(np.cross(direction[[0, 3, 4]], direction[[1, 4, 5]]), axis=1) > _PARALLEL
        if away > _MEET_MM or not parallel or not bent.all():
            return None
        return Arm(direction, point, columns, wrist, structure.gauge.pose)

    def postures(self, flange: Poses) -> Array:
        """(n, 8, 6) axis values in degrees within half a turn, in the order of columns, that bring the flange
        to poses (n). NaN where there is none, and where the wrist is above the first axis; where it is
        straight, of the fourth and the sixth axis alone, which share a turn."""
        back = self.flange.inverse()
        motion = flange @ back
        centre = motion.at(self.wrist)
        result = np.full((len(centre), POSTURES, AXES), np.nan)
        number = 0
        with np.errstate(invalid="ignore", divide="ignore"):
            for first in self._first(centre):
                for second, third in self._shoulder_and_elbow(centre, first):
                    held = self._turn(0, first) @ self._turn(1, second) @ self._turn(2, third)
                    rest = np.swapaxes(held, -1, -2) @ motion.rotation
                    for wrist in self._wrist(rest):
                        result[:, number] = np.stack((first, second, third, *wrist), axis=1)
                        number += 1
        result[np.isnan(np.delete(result, _SHARING, axis=2)).any(axis=2)] = np.nan
        values = np.empty(result.shape)
        values[:, :, self.columns] = wrapped(np.degrees(result))
        return values

    def near(self, flange: Poses, axes: Array) -> Array:
        """(n, 6) a posture that brings the flange to poses (n), NaN where there is none. It is chosen axis by
        axis next to axis values (n, 6), with the turns of these. Away from singular postures it is the
        nearest one."""
        own = np.radians(axes[:, self.columns])

        def choose(choices: Sequence[Array], axis: int) -> Array:
            return nearer(choices, own[:, axis])

        return np.asarray(axes - wrapped(axes - self._chosen(flange, choose)))

    def branch(self, flange: Poses, number: int) -> Array:
        """(n, 6) one of the `postures`, by its number among them; NaN where not all axes are known."""
        left = iter((number // 4, number // 2 % 2, number % 2))

        def choose(choices: Sequence[Array], axis: int) -> Array:
            return choices[next(left)]

        return wrapped(self._chosen(flange, choose))

    def _chosen(self, flange: Poses, choose: Choose) -> Array:
        """(n, 6) axis values in degrees that bring the flange to poses (n), with one of two choices each of
        the first, third and fifth axis."""
        motion = flange @ self.flange.inverse()
        centre, values = motion.at(self.wrist), np.empty((len(motion.position), AXES))
        with np.errstate(invalid="ignore", divide="ignore"):
            first = choose(self._first(centre), 0)
            ((second, third),) = self._shoulder_and_elbow(centre, first, lambda of: [choose(of, 2)])
            held = self._turn(0, first) @ self._turn(1, second) @ self._turn(2, third)
            rest = np.swapaxes(held, -1, -2) @ motion.rotation
            (wrist,) = self._wrist(rest, lambda of: [choose(of, 4)])
        values[:, self.columns] = np.degrees(np.stack((first, second, third, *wrist), axis=1))
        return values

    def branches(self, axes: Array) -> Array:
        """(..., 4) what tells postures apart: mm, mm and twice deg of the bend. They are positive where the
        centre of the wrist is before the first axis, before the lower arm, where the fifth axis is positive,
        and where it turns as a positive second axis does."""
        shape = axes.shape[:-1]
        values = np.radians(axes.reshape(-1, AXES)[:, self.columns])
        up = self.direction[0]
        ahead = self.wrist - self.point[0]
        ahead = ahead - up * (ahead @ up)
        ahead = ahead / max(float(np.linalg.norm(ahead)), _STRAIGHT)
        second, third = self._turn(1, values[:, 1]), self._turn(2, values[:, 2])
        lower = turned(second, self.point[2] - self.point[1])
        upper = turned(second, turned(third, self.wrist - self.point[2]))
        place = self.point[1] + lower + upper - self.point[0]
        size = max(float(np.linalg.norm(self.point[2] - self.point[1])), _STRAIGHT)
        before = np.cross(lower, upper) @ np.cross(up, ahead) / size
        bend = np.degrees(values[:, 4])
        alike = np.where(self.direction[4] @ self.direction[1] < 0.0, -1.0, 1.0)
        return np.stack((place @ ahead, before, bend, alike * bend), axis=1).reshape(*shape, 4)

    def from_second(self, axes: Array) -> Array:
        """(n, 6) axis values, of ones whose third counts from the horizontal and not from the second."""
        return self._third(axes, -1.0)

    def from_level(self, axes: Array) -> Array:
        """(n, 6) the other way round."""
        return self._third(axes, 1.0)

    def _third(self, axes: Array, sign: float) -> Array:
        values, second, third = axes.copy(), self.columns[1], self.columns[2]
        alike = 1.0 if self.direction[1] @ self.direction[2] > 0.0 else -1.0
        values[:, third] += sign * alike * axes[:, second]
        return values

    def _turn(self, axis: int, angle_rad: Array) -> Array:
        return axis_rotation(self.direction[axis], angle_rad)

    def _first(self, centre: Array) -> list[Array]:
        """(n,) angles of the first axis."""
        up, side = self.direction[0], self.direction[1]
        away = centre - self.point[0]
        along = (away @ up)[:, None] * up
        across = away - along
        want = side @ (self.wrist - self.point[0]) - along @ side
        found = met(across @ side, -(np.cross(up, away) @ side), want)
        near = np.linalg.norm(across, axis=1) < _ABOVE_MM
        return [np.where(near, np.nan, angle) for angle in found]

    def _shoulder_and_elbow(
        self, centre: Array, first: Array, pick: Pick = both
    ) -> list[tuple[Array, Array]]:
        """(n,) angles of the second and the third axis, for those of the third that are picked."""
        place = self.point[0] + turned(self._turn(0, -first), centre - self.point[0])
        return self._lower_arm(place, self.wrist, pick)

    def _lower_arm(self, place: Array, end: Array, pick: Pick = both) -> list[tuple[Array, Array]]:
        """(n,) angles of the second and the third axis that bring the point `end` to places (n, 3), for those
        of the third that are picked."""
        side = self.direction[1]
        lower, upper = self.point[2] - self.point[1], end - self.point[2]
        # the third axis may run against the second
        sense = float(self.direction[2] @ side)

        def bends(choices: Sequence[Array]) -> Sequence[Array]:
            return [angle * sense for angle in pick([angle * sense for angle in choices])]

        pairs = two_turns(side, lower, upper, place - self.point[1], bends)
        return [(second, third * sense) for second, third in pairs]

    def _wrist(self, rest: Array, pick: Pick = both) -> list[tuple[Array, Array, Array]]:
        """(n,) angles of the last three axes, whose rotation is `rest` (n, 3, 3), for those of the fifth that
        are picked."""
        fourth, fifth, sixth = self.direction[3:]
        along = turned(rest, sixth)
        inner = fifth * (fifth @ sixth)
        want = along @ fourth - fourth @ inner
        found = []
        for angle in pick(met(fourth @ (sixth - inner), fourth @ np.cross(fifth, sixth), want)):
            bent = self._turn(4, angle)
            start = turned(bent, sixth)
            straight = np.linalg.norm(np.cross(start, fourth), axis=1) < _STRAIGHT
            turn = np.where(straight, np.nan, angle_about(fourth, start, along))
            left = np.swapaxes(self._turn(3, turn) @ bent, -1, -2) @ rest
            beside = np.cross(sixth, np.eye(3)[int(np.argmin(np.abs(sixth)))])
            last = angle_about(sixth, beside, turned(left, beside))
            found.append((turn, angle, last))
        return found


def two_turns(
    axis: Array, lower: Array, upper: Array, reach: Array, pick: Pick = both
) -> list[tuple[Array, Array]]:
    """(n,) both pairs of angles about `axis` (3,) by which two links (3,), one behind the other, end at
    vectors `reach` (n, 3) across the axis. NaN where there are none. With `pick` those whose second is picked
    are given alone."""
    lower, upper, reach = (v - (v @ axis)[..., None] * axis for v in (lower, upper, reach))
    want = (np.sum(reach * reach, axis=1) - lower @ lower - upper @ upper) / 2.0
    pairs = []
    for angle in pick(met(lower @ upper, lower @ np.cross(axis, upper), want)):
        tip = lower + turned(axis_rotation(axis, angle), upper)
        pairs.append((angle_about(axis, tip, reach), angle))
    return pairs


def rotary_lines(structure: Structure) -> tuple[Array, Array, Index] | None:
    """(6, 3) directions and points of six rotary axes behind the frame, and the columns of their values; None
    where a machine has others."""
    names = [name for name in structure.chain if name != FRAME]
    known = all(name in structure.joints and structure.joints[name].kind == "rotary" for name in names)
    if len(names) != AXES or not known or structure.chain[0] != FRAME:
        return None
    joints = [structure.joints[name] for name in names]
    direction = np.array([joint.direction for joint in joints])
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    point = np.array([joint.point_mm for joint in joints], float)
    return direction, point, np.array([structure.order.index(name) for name in names])


def meeting(direction: Array, point: Array) -> tuple[Array, float]:
    """(3,) the point that is nearest to lines (k, 3), and its largest distance from one of them."""
    across = np.eye(3) - direction[:, :, None] * direction[:, None, :]
    place = np.linalg.lstsq(across.sum(axis=0), np.einsum("kij,kj->i", across, point), rcond=None)[0]
    return place, float(np.linalg.norm(turned(across, place - point), axis=1).max())


def nearer(choices: Sequence[Array], near: Array) -> Array:
    """(n,) of two choices of angles (n,) row by row the one that is next to another angle."""
    first, second = choices
    far = [np.abs(np.remainder(own - near + np.pi, 2.0 * np.pi) - np.pi) for own in choices]
    return np.where((far[1] < far[0]) | np.isnan(far[0]), second, first)


def met(cosine: Array | float, sine: Array | float, want: Array) -> list[Array]:
    """(n,) both angles t with cosine * cos t + sine * sin t = want, NaN where there is none."""
    size, middle = np.hypot(cosine, sine), np.arctan2(sine, cosine)
    share = want / size
    share = np.where(np.abs(share) > 1.0 + _STRETCHED, np.nan, np.clip(share, -1.0, 1.0))
    return [np.asarray(middle + sign * np.arccos(share)) for sign in (1.0, -1.0)]


def angle_about(axis: Array, start: Array, end: Array) -> Array:
    """(n,) angles about an axis that turn one vector toward another."""
    start = start - (start @ axis)[..., None] * axis
    end = end - (end @ axis)[..., None] * axis
    x, y, z = axis
    across = start @ np.array(((0.0, z, -y), (-z, 0.0, x), (y, -x, 0.0)))
    sine, cosine = (np.einsum("...k,...k->...", one, end) for one in (across, start))
    return np.asarray(np.arctan2(sine, cosine))


def wrapped(degrees: Array) -> Array:
    """Angles within half a turn."""
    return np.asarray(180.0 - (180.0 - degrees) % 360.0)
