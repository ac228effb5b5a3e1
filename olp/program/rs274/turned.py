"""Moves in turned, mirrored and scaled frames: read along their words, then put where the axes go."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, distinct
from olp.core.errors import ProgramError
from olp.core.geometry import PLANES
from olp.core.toolpath import Kind
from olp.core.turns import Turn, turned
from olp.core.values import dataclass

#: how far the factors of a plane may differ, and axes lean, by rounding
_SAME = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class Turning:
    """A turn (3, 3) with its inverse."""

    matrix: Array
    inverse: Array

    @staticmethod
    def of(turn: Turn | None) -> Turning | None:
        """None where nothing turns."""
        if turn is None:
            return None
        inverse = np.linalg.inv(np.array(turn))
        inverse[np.abs(inverse) < _SAME] = 0.0
        return Turning(np.array(turn), inverse)

    def axes(self, words: Array) -> Array:
        """(n, 3) axis positions of positions along the words."""
        return turned(self.matrix, words)

    def words(self, axes: Array) -> Array:
        """(n, 3) positions along the words of axis positions; also of one offset (3,)."""
        return turned(self.inverse, np.atleast_2d(axes)).reshape(axes.shape)

    def arcs(
        self,
        kind: npt.NDArray[np.uint8],
        row: Index,
        centre: Array,
        sweep: Array,
        plane: Index,
        line: Index,
        *,
        tilted: bool = False,
    ) -> tuple[npt.NDArray[np.uint8], Array, Array]:
        """Kinds of all moves, and centres (m, 3) and sweeps of the arcs among them, moves `row` (m,), for the
        axes. In a `tilted` plane they stay those of the words. Raises ProgramError for arcs that leave their
        planes, or become ellipses."""
        if tilted:
            return kind, self.axes(centre), sweep
        mirrored = np.zeros(len(row), bool)
        for one in distinct(plane).tolist():
            mine = np.flatnonzero(plane == one)
            if not self.keeps_circles(one):
                raise ProgramError(
                    f"an arc in the plane G{17 + one} is turned out of that plane, or scaled to an ellipse; "
                    "write it as short lines",
                    line=int(line[mine[0]]),
                    code="OLP530",
                )
            mirrored[mine] = self.mirrors(one)
        kind = kind.copy()
        kind[row[mirrored]] = Kind.ARC_CW + Kind.ARC_CCW - kind[row[mirrored]]
        return kind, self.axes(centre), np.where(mirrored, -sweep, sweep)

    def keeps_axis(self, axis: int) -> bool:
        """Whether an axis moves by its own word alone, and as far as this says."""
        others = np.arange(3) != axis
        mixed = self.matrix[axis, others].any() or self.matrix[others, axis].any()
        return bool(self.matrix[axis, axis] == 1.0 and not mixed)

    def keeps_circles(self, plane: int) -> bool:
        """Whether circles of a plane stay circles in it."""
        first, second, third = PLANES[plane]
        if self.matrix[third, [first, second]].any() or self.matrix[[first, second], third].any():
            return False
        block = self._block(plane)
        product = block.T @ block
        return bool(np.abs(product - product[0, 0] * np.eye(2)).max() <= _SAME * product[0, 0])

    def mirrors(self, plane: int) -> bool:
        """Whether turns to the left in a plane become turns to the right."""
        return bool(np.linalg.det(self._block(plane)) < 0.0)

    def _block(self, plane: int) -> Array:
        pair = PLANES[plane][:2]
        return np.asarray(self.matrix[np.ix_(pair, pair)])


class Along:
    """The last position along the words of a tilted plane, which state the tip of the tool there. Positions
    of the axes do not tell it, nor, where one coordinate is not known, the others."""

    def __init__(self) -> None:
        self._turn: Turn | None = None
        self._axes: list[float] = []
        self._words: list[float] | None = None

    def drop(self) -> None:
        """Where the tip is is not known from here on."""
        self._words = None

    def put(self, turn: Turn | None, position: Sequence[float], words: Array) -> None:
        """Take over a position of the axes with that along the words."""
        self._turn, self._axes, self._words = turn, list(position), words.tolist()

    def of(self, turn: Turn | None, position: Sequence[float]) -> list[float]:
        """A position of the axes along the words: what was put, NaN where the axes have moved since."""
        if self._words is not None and turn == self._turn and _alike(self._axes, position):
            return list(self._words)
        return [np.nan] * 3


def _alike(one: Sequence[float], other: Sequence[float]) -> bool:
    return all(a == b or (a != a and b != b) for a, b in zip(one, other, strict=True))


def along_words(turning: Turning | None, position: Sequence[float]) -> list[float]:
    """A position of the axes along the words."""
    if turning is None:
        return list(position)
    values: list[float] = turning.words(np.array(position)).tolist()
    return values
