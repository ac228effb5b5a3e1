"""Rigid motions while they are composed: each entry is a column of all rows, or one number for all of them.

Most entries of the motions of a machine are 0 or 1, and products leave these out. Columns are computed in
batches that fit a processor's cache.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from olp.core.arrays import Array
from olp.core.machine import Vector
from olp.core.values import dataclass
from olp.kinematics.poses import Poses

Entry = Array | float
Triple = tuple[Entry, Entry, Entry]

#: Rows that are composed at a time: columns of 64 kB.
BATCH = 1 << 13


def times(a: Entry, b: Entry) -> Entry:
    if isinstance(a, float):
        a, b = b, a
    if isinstance(b, float):
        if b == 0.0:
            return 0.0
        if b == 1.0:
            return a
    return a * b


def plus(a: Entry, b: Entry) -> Entry:
    if isinstance(a, float) and a == 0.0:
        return b
    if isinstance(b, float) and b == 0.0:
        return a
    return a + b


def minus(a: Entry, b: Entry) -> Entry:
    if isinstance(b, float) and b == 0.0:
        return a
    if isinstance(a, float) and a == 0.0:
        return times(b, -1.0)
    return a - b


def triple(values: Array | Sequence[float]) -> Triple:
    """Three numbers, or the columns of (n, 3)."""
    if isinstance(values, np.ndarray) and values.ndim == 2:
        return values[:, 0], values[:, 1], values[:, 2]
    x, y, z = (float(value) for value in values)
    return x, y, z


def add(a: Triple, b: Triple) -> Triple:
    return plus(a[0], b[0]), plus(a[1], b[1]), plus(a[2], b[2])


def subtract(a: Triple, b: Triple) -> Triple:
    return minus(a[0], b[0]), minus(a[1], b[1]), minus(a[2], b[2])


def scaled(a: Triple, by: Entry) -> Triple:
    return times(a[0], by), times(a[1], by), times(a[2], by)


def dot(a: Triple, b: Triple) -> Entry:
    return plus(plus(times(a[0], b[0]), times(a[1], b[1])), times(a[2], b[2]))


def cross(a: Triple, b: Triple) -> Triple:
    return (
        minus(times(a[1], b[2]), times(a[2], b[1])),
        minus(times(a[2], b[0]), times(a[0], b[2])),
        minus(times(a[0], b[1]), times(a[1], b[0])),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """Rigid motions p -> `turn` p + `shift`: the rows of the rotation, and mm."""

    turn: tuple[Triple, Triple, Triple]
    shift: Triple

    def __matmul__(self, other: Columns) -> Columns:
        """First `other`, then this."""
        if self is STILL or other is STILL:
            return other if self is STILL else self
        x, y, z = zip(*other.turn, strict=True)
        a, b, c = ((dot(row, x), dot(row, y), dot(row, z)) for row in self.turn)
        return Columns((a, b, c), self.at(other.shift))

    def turned(self, vector: Triple) -> Triple:
        a, b, c = self.turn
        return dot(a, vector), dot(b, vector), dot(c, vector)

    def at(self, point: Triple) -> Triple:
        """Where points come to lie."""
        return add(self.turned(point), self.shift)

    def turned_back(self, vector: Triple) -> Triple:
        x, y, z = zip(*self.turn, strict=True)
        return dot(x, vector), dot(y, vector), dot(z, vector)

    def inverse(self) -> Columns:
        x, y, z = zip(*self.turn, strict=True)
        return Columns((x, y, z), scaled(self.turned_back(self.shift), -1.0))

    def store(self, rotation: Array, position: Array) -> None:
        """Put all rows into (3, 3, n) and (3, n)."""
        for i in range(3):
            position[i] = self.shift[i]
            for k in range(3):
                rotation[i, k] = self.turn[i][k]

    def rows(self, count: int) -> Poses:
        """The same with a row for each of `count`."""
        rotation, position = np.empty((3, 3, count)), np.empty((3, count))
        self.store(rotation, position)
        return Poses(rotation.transpose(2, 0, 1), position.T)

    @staticmethod
    def of(pose: Poses) -> Columns:
        """Of poses with a row each, or of one for all rows."""
        a, b, c = (triple(pose.rotation[..., k, :]) for k in range(3))
        return Columns((a, b, c), triple(pose.position))


#: Nothing turns.
UPRIGHT = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
#: Nothing moves.
STILL = Columns(UPRIGHT, (0.0, 0.0, 0.0))


def shifted(vector: Triple) -> Columns:
    """The translation by a vector."""
    return Columns(UPRIGHT, vector)


def about(point: Triple, turn: Columns, offset: Triple = (0.0, 0.0, 0.0)) -> Columns:
    """Turns about a point, then a shift: Trans(point) Trans(offset) R Trans(-point)."""
    if turn is STILL:
        return shifted(offset)
    return Columns(turn.turn, add(subtract(point, turn.turned(point)), offset))


def turn_about(direction: Vector, angle_rad: Entry) -> Columns:
    """Rotations about a unit vector (Rodrigues)."""
    if isinstance(angle_rad, float) and angle_rad == 0.0:
        return STILL
    x, y, z = direction
    # 1 - cos, without cancelling at small angles
    sine, half = _sine(angle_rad), _sine(times(angle_rad, 0.5))
    versine = times(times(half, half), 2.0)
    across: Triple = (times(sine, x), times(sine, y), times(sine, z))
    xy, yz, zx = times(versine, x * y), times(versine, y * z), times(versine, z * x)
    first, second, third = (
        plus(1.0, times(versine, -(one * one + other * other))) for one, other in ((y, z), (z, x), (x, y))
    )
    return Columns(
        (
            (first, minus(xy, across[2]), plus(zx, across[1])),
            (plus(xy, across[2]), second, minus(yz, across[0])),
            (minus(zx, across[1]), plus(yz, across[0]), third),
        ),
        (0.0, 0.0, 0.0),
    )


def tilted(angles_rad: Triple, *, reverse: bool = False) -> Columns:
    """Rotations by A, B, C of fixed axes: Rz Ry Rx; `reverse` gives Rx Ry Rz."""
    x, y, z = (turn_about(UPRIGHT[k], angles_rad[k]) for k in range(3))
    return x @ y @ z if reverse else z @ y @ x


def _sine(angle: Entry) -> Entry:
    return float(np.sin(angle)) if isinstance(angle, float) else np.asarray(np.sin(angle))
