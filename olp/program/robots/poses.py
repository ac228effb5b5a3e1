"""Poses as robots state them: a position and a rotation, from quaternions or angles."""

from __future__ import annotations

from collections.abc import Sequence
from math import asin, atan2, cos, degrees, hypot, pi, radians, sin
from typing import Any

import numpy as np

from olp.core.arrays import Array
from olp.core.machine import ZERO, Vector
from olp.core.turns import Turn
from olp.core.values import dataclass

Quaternion = tuple[float, float, float, float]
#: The rotation that turns nothing, w first.
NO_TURN: Quaternion = (1.0, 0.0, 0.0, 0.0)
#: rad; rotations that are nearer to each other are the same
SAME_TURN = 2e-6
#: mm; positions that are nearer to each other are the same
SAME_PLACE_MM = 1e-6
#: A row of a matrix.
_Row = tuple[Any, Any, Any]
#: The rows of the rotation that turns nothing.
_UNTURNED: Turn = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
#: Two quaternions this near are led from one to the other along a straight line.
_NEAR = 1.0 - 1e-12
#: Below this cosine of the second of three angles the first and the third turn alike.
_UPRIGHT = 1e-9


@dataclass(frozen=True, slots=True)
class Pose:
    """A frame in another: its `origin_mm`, and its rotation as a quaternion, w first."""

    origin_mm: Vector = ZERO
    turn: Quaternion = NO_TURN

    def then(self, inner: Pose) -> Pose:
        """The pose of `inner`, which is stated in this frame, in the frame where this one is stated."""
        x, y, z = rotated(self.turn, inner.origin_mm)
        a, b, c = self.origin_mm
        return Pose((a + x, b + y, c + z), multiplied(self.turn, inner.turn))

    def same(self, other: Pose) -> bool:
        """Whether both are the same within what controls keep of their digits."""
        away = max(abs(a - b) for a, b in zip(self.origin_mm, other.origin_mm, strict=True))
        return away <= SAME_PLACE_MM and angle_between(self.turn, other.turn) <= SAME_TURN


def multiplied(a: Quaternion, b: Quaternion) -> Quaternion:
    """The rotation `b`, then `a`."""
    (p, q, r, s), (w, x, y, z) = a, b
    return (
        p * w - q * x - r * y - s * z,
        p * x + q * w + r * z - s * y,
        p * y - q * z + r * w + s * x,
        p * z + q * y - r * x + s * w,
    )


def inverted(a: Quaternion) -> Quaternion:
    w, x, y, z = a
    return (w, -x, -y, -z)


def rotated(a: Quaternion, vector: Sequence[float]) -> Vector:
    """A vector turned by a rotation."""
    if a[1:] == ZERO:
        x, y, z = vector
        return (x, y, z)
    first, second, third = vector
    _, x, y, z = multiplied(multiplied(a, (0.0, first, second, third)), inverted(a))
    return (x, y, z)


def normalised(a: Sequence[float]) -> Quaternion:
    size = sum(v * v for v in a) ** 0.5
    w, x, y, z = (v / size for v in a)
    return (w, x, y, z)


def angle_between(a: Quaternion, b: Quaternion) -> float:
    """rad between two rotations."""
    _, x, y, z = multiplied(inverted(a), b)
    return 2.0 * asin(min(1.0, (x * x + y * y + z * z) ** 0.5))


def between(a: Quaternion, b: Quaternion, share: float) -> Quaternion:
    """The rotation at a share of the even turn from `a` to `b`."""
    cosine = sum(p * q for p, q in zip(a, b, strict=True))
    if cosine < 0.0:
        b, cosine = (-b[0], -b[1], -b[2], -b[3]), -cosine
    first, second = 1.0 - share, share
    if cosine < _NEAR:
        angle = float(np.arccos(cosine))
        first, second = (float(np.sin(part * angle) / np.sin(angle)) for part in (first, second))
    return normalised([first * p + second * q for p, q in zip(a, b, strict=True)])


def turn_of(a: Quaternion) -> Turn | None:
    """The rows of a rotation; None where it turns nothing."""
    if a[1:] == ZERO:
        return None
    return _rows(*a)


def _rows(w: Any, x: Any, y: Any, z: Any) -> tuple[_Row, _Row, _Row]:
    """The rows of the matrix of a quaternion, whose components are numbers or columns."""
    return (
        (w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z),
    )


def of_zyx(angles_deg: Sequence[float]) -> Quaternion:
    """Rz(first) Ry(second) Rx(third), in degrees."""
    if not any(angles_deg):
        return NO_TURN
    first, second, third = angles_deg
    first, second, third = radians(first) / 2.0, radians(second) / 2.0, radians(third) / 2.0
    a, b, c, d = cos(first), sin(first), cos(second), sin(second)
    e, f = cos(third), sin(third)
    return (a * c * e + b * d * f, a * c * f - b * d * e, a * d * e + b * c * f, b * c * e - a * d * f)


def of_vector(vector: Sequence[float]) -> Quaternion:
    """The rotation about a vector by its length in rad."""
    x, y, z = vector
    angle = float(np.sqrt(x * x + y * y + z * z))
    if angle == 0.0:
        return NO_TURN
    size = float(np.sin(angle / 2.0)) / angle
    return (float(np.cos(angle / 2.0)), x * size, y * size, z * size)


def vector_of(a: Quaternion, near: Vector = ZERO) -> Vector:
    """The vector of a rotation that is next to another vector."""
    w, x, y, z = a if a[0] >= 0.0 else (-a[0], -a[1], -a[2], -a[3])
    sine = (x * x + y * y + z * z) ** 0.5
    if sine == 0.0:
        return ZERO if near == ZERO else _whole_turns(near)
    angle = 2.0 * atan2(sine, w)
    along = (x * near[0] + y * near[1] + z * near[2]) / sine
    size = (angle + 2.0 * pi * round((along - angle) / (2.0 * pi))) / sine
    return (x * size, y * size, z * size)


def _whole_turns(near: Vector) -> Vector:
    """The vector of no rotation that is next to another vector."""
    length = sum(v * v for v in near) ** 0.5
    size = 2.0 * pi * round(length / (2.0 * pi)) / length
    x, y, z = (v * size for v in near)
    return (x, y, z)


def zyx_of(a: Quaternion, first_deg: float = 0.0) -> Vector:
    """The angles in degrees whose Rz(first) Ry(second) Rx(third) is a rotation. Where the second is a right
    angle and only two of them are known together, the first is `first_deg`."""
    (xx, xy, xz), (yx, yy, yz), (zx, _, _) = turn_of(a) or _UNTURNED
    first = atan2(yx, xx) if hypot(xx, yx) > _UPRIGHT else radians(first_deg)
    cosine, sine = cos(first), sin(first)
    second = atan2(-zx, cosine * xx + sine * yx)
    # of the rotation that is left, whatever the first angle is
    third = atan2(sine * xz - cosine * yz, cosine * yy - sine * xy)
    return (degrees(first), degrees(second), degrees(third))


def products(a: Array, b: Array) -> Array:
    """(n, 4) the rotations `b` (n, 4), then `a` (n, 4)."""
    (p, q, r, s), (w, x, y, z) = a.T, b.T
    return np.stack(
        (
            p * w - q * x - r * y - s * z,
            p * x + q * w + r * z - s * y,
            p * y - q * z + r * w + s * x,
            p * z + q * y - r * x + s * w,
        ),
        axis=1,
    )


def of_vectors(vectors: Array) -> Array:
    """(n, 4) the rotations about vectors (n, 3) by their lengths in rad."""
    angle = np.linalg.norm(vectors, axis=1)
    size = 0.5 * np.sinc(angle / (2.0 * np.pi))
    return np.column_stack((np.cos(angle / 2.0), size[:, None] * vectors))


def matrices(turns: Array) -> Array:
    """(n, 3, 3) rotations (n, 4) as matrices."""
    w, x, y, z = turns.T
    return np.moveaxis(np.array(_rows(w, x, y, z)), -1, 0)


def matrix(a: Quaternion) -> Array:
    """(3, 3) the rotation as a matrix."""
    return np.array(turn_of(a) or _UNTURNED)
