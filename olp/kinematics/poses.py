"""Rigid motions in columns: rotations (n, 3, 3) and positions (n, 3) in mm, or one of each for all rows."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index, Mask, read_only
from olp.core.values import dataclass

#: Below this angle the sine over the angle is taken from its series, whose rest is then below 1e-17. Radians.
_SMALL_RAD = 1e-5
#: A sum of the diagonal below this is near half a turn, where the skew part does not show the axis.
_NEAR_HALF_TURN = -0.99

#: No rotation. Motions that only shift hold this very array, so that nothing is multiplied by it.
_UPRIGHT = read_only(np.eye(3))


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """Rigid motions p -> `rotation` @ p + `position`; (n, 3, 3) or (3, 3), and (n, 3) or (3,) in mm."""

    rotation: Array
    position: Array

    def __matmul__(self, other: Poses) -> Poses:
        """First `other`, then this."""
        if self.rotation is _UPRIGHT:
            return Poses(other.rotation, self.at(other.position))
        if other.rotation is _UPRIGHT:
            return Poses(self.rotation, self.at(other.position))
        return Poses(self.rotation @ other.rotation, self.at(other.position))

    def at(self, point_mm: Array) -> Array:
        """(n, 3) where points (n, 3) or (3,) come to lie."""
        return turned(self.rotation, point_mm) + self.position

    def inverse(self) -> Poses:
        if self.rotation is _UPRIGHT:
            return Poses(_UPRIGHT, 0.0 - self.position)
        back = np.swapaxes(self.rotation, -1, -2)
        return Poses(back, 0.0 - turned(back, self.position))

    def rows(self, count: int) -> Poses:
        """The same with a row for each of `count`."""
        rotation = np.broadcast_to(self.rotation, (count, 3, 3))
        return Poses(rotation, np.broadcast_to(self.position, (count, 3)))

    def only(self, rows: Index | Mask | slice) -> Poses:
        """Some of (n) motions."""
        return Poses(self.rotation[rows], self.position[rows])


#: Nothing moves.
STILL = Poses(_UPRIGHT, np.zeros(3))


def turned(rotation: Array, vectors: Array) -> Array:
    """(n, 3) vectors (n, 3) or (3,) after rotations (n, 3, 3) or (3, 3)."""
    if rotation is _UPRIGHT:
        return vectors
    if rotation.ndim == 2:
        return np.asarray(vectors @ rotation.T)
    x, y, z = np.moveaxis(vectors, -1, 0)
    result = np.empty((3, len(rotation)))
    for i in range(3):
        np.multiply(rotation[:, i, 0], x, out=result[i])
        result[i] += rotation[:, i, 1] * y
        result[i] += rotation[:, i, 2] * z
    return result.T


def shift(vector_mm: Array) -> Poses:
    """The translation by (n, 3) or (3,) in mm."""
    return Poses(_UPRIGHT, vector_mm)


def axis_rotation(direction: Array, angle_rad: Array) -> Array:
    """(n, 3, 3) rotations by angles (n,) about a unit vector (Rodrigues)."""
    x, y, z = direction
    cross = np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))
    # 1 - cos, without cancelling at small angles
    shares = np.stack((np.sin(angle_rad), 2.0 * np.square(np.sin(0.5 * angle_rad))), axis=-1)
    turned_by = shares @ np.stack((cross.ravel(), (cross @ cross).ravel()))
    return np.asarray(np.eye(3) + turned_by.reshape(*turned_by.shape[:-1], 3, 3))


def tilts(angles_rad: Array, *, reverse: bool = False) -> Array:
    """(n, 3, 3) rotations by A, B, C (n, 3) of fixed axes: Rz Ry Rx; `reverse` gives Rx Ry Rz."""
    x, y, z = (axis_rotation(np.eye(3)[k], angles_rad[..., k]) for k in range(3))
    return np.asarray(x @ y @ z if reverse else z @ y @ x)


def relative(rotation: Array, other: Array) -> Array:
    """(n, 3) rotation vectors from the `other` rotations (n, 3, 3) to the first ones, in rad."""
    turn = np.empty((3, 3, len(rotation)))
    for i in range(3):
        for k in range(3):
            np.multiply(rotation[:, i, 0], other[:, k, 0], out=turn[i, k])
            turn[i, k] += rotation[:, i, 1] * other[:, k, 1]
            turn[i, k] += rotation[:, i, 2] * other[:, k, 2]
    return rotation_vector(turn.transpose(2, 0, 1))


def rotations(vectors_rad: Array) -> Array:
    """(n, 3, 3) rotations by the length of vectors (n, 3), in rad, about them."""
    cross = np.zeros((len(vectors_rad), 3, 3))
    cross[:, (2, 0, 1), (1, 2, 0)] = vectors_rad
    cross -= np.swapaxes(cross, 1, 2)
    angle = np.linalg.norm(vectors_rad, axis=1)[:, None, None]
    # sin(a) / a and (1 - cos(a)) / a^2, also at zero
    first, second = np.sinc(angle / np.pi), 0.5 * np.square(np.sinc(0.5 * angle / np.pi))
    return np.asarray(np.eye(3) + first * cross + second * (cross @ cross))


def rotation_vector(rotation: Array) -> Array:
    """(n, 3) angle times unit axis of rotations (n, 3, 3), in rad; the angle is from 0 to pi."""
    skew = np.empty((3, *rotation.shape[:-2]))
    for row, (i, k) in enumerate(((2, 1), (0, 2), (1, 0))):
        skew[row] = 0.5 * (rotation[..., i, k] - rotation[..., k, i])
    skew = np.moveaxis(skew, 0, -1)
    sine = np.linalg.norm(skew, axis=-1)
    trace = np.trace(rotation, axis1=-2, axis2=-1)
    angle = np.arctan2(sine, 0.5 * (trace - 1.0))
    small = sine < _SMALL_RAD
    factor = np.where(small, 1.0 + np.square(sine) / 6.0, angle / np.where(small, 1.0, sine))
    vector = skew * factor[..., None]
    half = trace < _NEAR_HALF_TURN
    if np.any(half):
        vector[half] = _near_half_turn(rotation[half], skew[half], angle[half])
    return np.asarray(vector)


def _near_half_turn(rotation: Array, skew: Array, angle: Array) -> Array:
    """Rotation vectors near half a turn: the axis is the longest column of R + R^T - (trace - 1) I."""
    trace = np.trace(rotation, axis1=-2, axis2=-1)
    outer = rotation + np.swapaxes(rotation, -1, -2) - (trace - 1.0)[:, None, None] * np.eye(3)
    longest = np.argmax(np.linalg.norm(outer, axis=-2), axis=-1)
    axis = outer[np.arange(len(outer)), :, longest]
    axis /= np.linalg.norm(axis, axis=-1)[:, None]
    axis *= np.where(np.sum(axis * skew, axis=-1) < 0.0, -1.0, 1.0)[:, None]
    return np.asarray(axis * angle[:, None])
