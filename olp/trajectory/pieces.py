"""Blocks of pieces of a motion as columns, so that operations on all pieces run along memory."""

from __future__ import annotations

from collections.abc import Iterator
from math import comb

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.values import dataclass
from olp.trajectory.motion import Motion, derivatives

#: pieces per block, so that its columns fit into the cache
_BLOCK = 1 << 12


@dataclass(frozen=True, slots=True, eq=False)
class Pieces:
    """n pieces: `seconds` (n,), `time` (d + 1, n) and `path` (4, 3, n), the coefficients of a Motion."""

    seconds: Array
    time: Array
    path: Array

    def take(self, which: Index) -> Pieces:
        """Some of them."""
        return Pieces(self.seconds[which], self.time[:, which], self.path[:, :, which])

    def straight(self) -> Mask:
        """(n,) whether the path is a line."""
        return np.asarray(~self.path[2:].any(axis=(0, 1)))

    def parameters(self, u: Array) -> tuple[Array, Array, Array, Array]:
        """(n,) the path's parameter and its three derivatives by time, `u` (n,) s after the start."""
        return derivatives(self.time.T, u)

    def reach(self) -> tuple[Array, Array]:
        """(n,) bounds of the parameter: a polynomial stays within its control points."""
        controls = bernstein(self.time, self.seconds)
        return controls.min(axis=0), controls.max(axis=0)

    def positions(self, s: Array) -> Array:
        """(3, n) where the axes are at parameters `s` (n,)."""
        p0, p1, p2, p3 = self.path
        result: Array = p0 + s * (p1 + s * (p2 + s * p3))
        return result

    def slopes(self, s: Array) -> Array:
        """(3, n) first derivatives by the parameter there."""
        _, p1, p2, p3 = self.path
        result: Array = p1 + s * (2.0 * p2 + 3.0 * s * p3)
        return result

    def bends(self, s: Array) -> Array:
        """(3, n) second derivatives by the parameter there."""
        result: Array = 2.0 * self.path[2] + 6.0 * s * self.path[3]
        return result


def blocks(motion: Motion) -> Iterator[tuple[slice, Pieces]]:
    """All pieces of a motion, in order."""
    for first in range(0, len(motion), _BLOCK):
        part = slice(first, min(first + _BLOCK, len(motion)))
        path = motion.path[motion.shape[part]].transpose(1, 2, 0)
        yield (
            part,
            Pieces(
                np.diff(motion.start_s[first : part.stop + 1]),
                np.ascontiguousarray(motion.time[part].T),
                np.ascontiguousarray(path),
            ),
        )


def dot(a: Array, b: Array) -> Array:
    """(n,) scalar products of (axes, n) and (axes, n)."""
    result: Array = a[0] * b[0]
    for one, other in zip(a[1:], b[1:], strict=True):
        result = result + one * other
    return result


def bernstein(coefficient: Array, width: Array) -> Array:
    """(d + 1, n) control points on [0, width] of polynomials `coefficient` (d + 1, n)."""
    degree = len(coefficient) - 1
    scaled = np.empty_like(coefficient)
    power = np.ones_like(width)
    for j, row in enumerate(coefficient):
        scaled[j] = row * power / comb(degree, j)
        power = power * width
    controls = np.empty_like(coefficient)
    for i in range(degree + 1):
        controls[i] = sum(comb(i, j) * scaled[j] for j in range(i + 1))
    return controls
