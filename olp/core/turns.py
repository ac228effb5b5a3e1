"""How the words of a program lie to the axes of the machine: turned, mirrored or scaled frames.

In such a frame a position in the directions of the words, counted from the machine's zero, is turned into an
axis position. Where nothing turns both are the same.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.geometry import PLANES, Plane
from olp.core.machine import Vector
from olp.core.values import dataclass

#: (3, 3) axes of each plane: first, second, third.
_AXES = np.array(PLANES)
#: The rows of a matrix.
Turn = tuple[Vector, Vector, Vector]


def turned(matrix: Array, points: Array) -> Array:
    """(n, 3) points turned by a matrix (3, 3), or each by its own (n, 3, 3). A coordinate that is not known,
    NaN, makes only those unknown that it enters."""
    with np.errstate(invalid="ignore"):
        parts = matrix * points[:, None, :]
    return np.asarray(np.where(matrix == 0.0, 0.0, parts).sum(axis=-1), float)


def rows_of(matrix: Array) -> Turn:
    """A matrix (3, 3) as the rows that a frame holds."""
    a, b, c = ((float(x), float(y), float(z)) for x, y, z in matrix)
    return (a, b, c)


def about_z(angle_deg: float) -> Array:
    """(3, 3) the rotation about Z, counter-clockwise; right angles are exact."""
    quarter = angle_deg / 90.0
    if quarter == round(quarter):
        cos, sin = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[round(quarter) % 4]
    else:
        angle = np.radians(angle_deg)
        cos, sin = float(np.cos(angle)), float(np.sin(angle))
    return np.array(((cos, -sin, 0.0), (sin, cos, 0.0), (0.0, 0.0, 1.0)))


@dataclass(frozen=True, slots=True, eq=False)
class Turns:
    """The matrices of frames, and their inverses: (k, 3, 3), the first of which turns nothing. `of_frame`
    (f,) is the matrix of each frame."""

    matrix: Array
    inverse: Array
    of_frame: Index

    @staticmethod
    def of(turns: Sequence[Turn | None]) -> Turns | None:
        """Those of frames; None where nothing turns."""
        if all(turn is None for turn in turns):
            return None
        known: dict[Turn | None, int] = {None: 0}
        of_frame = [known.setdefault(turn, len(known)) for turn in turns]
        matrix = np.array([np.eye(3) if turn is None else turn for turn in known])
        inverse = np.linalg.inv(matrix)
        inverse[np.abs(inverse) < 1e-15] = 0.0
        return Turns(matrix, inverse, np.array(of_frame, np.int64))

    def axes(self, words: Array, which: Index | int) -> Array:
        """(n, 3) axis positions of positions along the words, by the matrix `which` of all or of each."""
        return turned(self.matrix[which], words)

    def words(self, axes: Array, which: Index | int) -> Array:
        """(n, 3) positions along the words of axis positions."""
        return turned(self.inverse[which], axes)

    def mixes(self, which: Index) -> Mask:
        """(n, 3, 3) whether a word (second) moves an axis (first)."""
        return np.asarray(self.matrix[which] != 0.0)

    def mirrors(self, which: Index, plane: Plane) -> Mask:
        """(n,) whether turns to the left in planes become turns to the right."""
        return np.asarray(self._areas(which, plane) < 0.0)

    def sizes(self, which: Index, plane: Plane) -> Array:
        """(n,) how much longer lengths in planes become, where circles stay circles."""
        return np.asarray(np.sqrt(np.abs(self._areas(which, plane))), float)

    def _areas(self, which: Index, plane: Plane) -> Array:
        first, second = _AXES[plane, 0], _AXES[plane, 1]
        m, n = self.matrix[which], np.arange(len(plane))
        mixed = m[n, first, second] * m[n, second, first]
        return np.asarray(m[n, first, first] * m[n, second, second] - mixed, float)
