"""Touches of a probe in the order of their program, as every dialect that writes them takes them."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array
from olp.core.machine import Vector
from olp.core.values import dataclass


@dataclass(frozen=True, slots=True, eq=False)
class Touches:
    """Touches (n,) of one set-up, all as axis positions in mm.

    Each begins at `start_mm` (n, 3), expects the surface at `contact_mm`, and gives up at `end_mm`. `normal`
    (n, 3) points out of the surface, towards the start. Above Z = `clear_mm` nothing is in the way, and from
    there each start is reached straight down. `tool_mm` runs from the gauge point to the centre of the tip,
    whose radius is `radius_mm`. `labels` are the names of the touches in a log.
    """

    labels: tuple[str, ...]
    start_mm: Array
    contact_mm: Array
    end_mm: Array
    normal: Array
    clear_mm: float
    tool_mm: Vector
    radius_mm: float
    feed_mm_min: float

    def moves(self) -> tuple[Array, Array]:
        """Axis positions (m, 3) of all moves, and the number of the touch (m,) that each carries out, -1 for
        moves between touches. The tip goes up only where the next touch begins somewhere else."""
        places: list[Array] = []
        number: list[int] = []

        def go(place: Array, touch: int = -1) -> None:
            places.append(place)
            number.append(touch)

        column: Array | None = None
        for k, start in enumerate(self.start_mm):
            above = np.array([start[0], start[1], self.clear_mm])
            if column is None or not np.array_equal(column[:2], start[:2]):
                if column is not None:
                    go(np.array([column[0], column[1], self.clear_mm]))
                go(above)
            go(start)
            go(self.end_mm[k], k)
            go(start)
            column = start
        if column is not None:
            go(np.array([column[0], column[1], self.clear_mm]))
        return np.array(places).reshape(-1, 3), np.array(number, np.int64)


__all__ = ["Touches"]
