"""A measured deviation map: the error of the tip over a grid of axis positions.

A map knows nothing of orientation, so nothing of tools other than the one it was measured with.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from olp.core.arrays import Array, Mask
from olp.core.grid_interpolation import Grid
from olp.core.units import AXES
from olp.errormodel.boxed import Boxed, as_points
from olp.errormodel.grid_bound import GridBound
from olp.errormodel.gridded import DeviationMap


@dataclass(frozen=True, slots=True, eq=False)
class MapErrors(Boxed):
    """Error by axis position, interpolated in the map; `name` is what its contribution is called."""

    name: str
    grid: Grid
    bound: GridBound

    @classmethod
    def of(cls, described: DeviationMap, box_mm: Array, hold: bool) -> MapErrors:
        grid = Grid.through(described.knots_mm, described.values, described.interpolation)
        return cls(box_mm, hold, described.name, grid, GridBound.of(grid, tuple(AXES)))

    def error(self, axis_mm: Array, tool_mm: Array, play: Array | None = None) -> Array:
        points = as_points(axis_mm)
        unknown = np.isnan(points)
        if not unknown.any():
            return self.grid(self.clamped(points))
        value = self.grid(self.clamped(np.where(unknown, self.box_mm[:, 0], points)))
        value[unknown @ self.depends_on.T] = np.nan
        return value

    def rotation(self, axis_mm: Array, play: Array | None = None, payload_kg: Array | float = 0.0) -> Array:
        return np.zeros(as_points(axis_mm).shape)

    def contributions(
        self, axis_mm: Array, tool_mm: Array, play: Array | None = None
    ) -> Iterator[tuple[str, Array]]:
        value = self.error(axis_mm, tool_mm)
        if np.any(value != 0.0):
            yield self.name, value

    @property
    def depends_on(self) -> Mask:
        return self.grid.varies()

    def lost_motion_mm(self, axis_mm: Array) -> Array | None:
        return None

    def chord_bound(self, delta_mm: Array, tool_mm: Array) -> Array:
        bound = self.bound.departure(as_points(delta_mm, "delta_mm"))
        return np.asarray(np.sqrt(np.einsum("ij,ij->i", bound, bound)))
