"""Measured deviation maps: the error of the tip over a grid of axis positions.

A map does not hold the orientation. So it holds for no tool but the one with which it was measured.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import product
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from olp.core.arrays import Array, Mask
from olp.core.grid_interpolation import KINDS, Grid
from olp.core.grid_interpolation import Kind as Interpolation
from olp.core.machine import ZERO, Vector
from olp.core.schema import Table, Text, Triple
from olp.core.schema_keys import Field
from olp.core.units import AXES, UM_PER_MM, in_unit_text
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.errormodel.boxed import Boxed, as_points
from olp.errormodel.gridded import frozen, grid_rows, knot_problems, refuse
from olp.errormodel.sources.base import (
    ErrorSource,
    Example,
    Frame,
    Reading,
    Schema,
    Writing,
    files_of_tables,
    floats,
)

if TYPE_CHECKING:
    from olp.errormodel.grid_bound import GridBound


@dataclass(frozen=True, slots=True, eq=False)
class DeviationMap:
    """Deviations of the tip (nx, ny, nz, 3) in mm over axis positions `knots_mm` (three arrays), measured
    with the tool vector `tool_mm`.

    A "residual" map adds to the curves; a "total" one is all that was measured and replaces them. An axis in
    `holds_along` may have one level: the map is taken to be the same all along it. `sigma`, of the shape of
    the values, are standard uncertainties in mm; those of a residual map come beside those of the curves.
    Raises ConfigError.
    """

    knots_mm: tuple[Array, Array, Array]
    values: Array
    kind: Literal["residual", "total"] = "residual"
    tool_mm: Vector = ZERO
    interpolation: Interpolation = "linear"
    holds_along: tuple[str, ...] = ()
    name: str = "map"
    sigma: Array | None = None

    def __post_init__(self) -> None:
        x, y, z = (frozen(k) for k in self.knots_mm)
        object.__setattr__(self, "knots_mm", (x, y, z))
        object.__setattr__(self, "values", frozen(self.values))
        if self.sigma is not None:
            object.__setattr__(self, "sigma", frozen(self.sigma))
        refuse(self._problems())

    def _problems(self) -> list[str]:
        problems = knot_problems(self.name, AXES, self.knots_mm)
        shape = tuple(len(k) for k in self.knots_mm)
        if self.values.shape != (*shape, 3) or not np.all(np.isfinite(self.values)):
            problems.append(f"{self.name}: expected three finite deviations at each of {shape} nodes")
        sigma = np.zeros((*shape, 3)) if self.sigma is None else self.sigma
        if sigma.shape != (*shape, 3) or not np.all(np.isfinite(sigma)) or np.any(sigma < 0.0):
            problems.append(
                f"{self.name}: expected three uncertainties of 0 or above at each of {shape} nodes"
            )
        if self.kind not in ("residual", "total"):
            problems.append(f"{self.name}: kind '{self.kind}'; expected residual or total")
        if self.interpolation not in KINDS:
            problems.append(f"{self.name}: interpolation '{self.interpolation}'; expected linear or cubic")
        for axis, knots in zip(AXES, self.knots_mm, strict=True):
            if len(knots) == 1 and axis not in self.holds_along:
                problems.append(
                    f"{self.name} has one level along {axis}; expected two levels or more, or "
                    f'holds_along = ["{axis}"] if the error is known to be the same all along it'
                )
            elif len(knots) > 1 and axis in self.holds_along:
                problems.append(
                    f"{self.name} has {len(knots)} levels along {axis}, and holds_along names {axis}; "
                    "expected one level, or the axis left out of holds_along"
                )
        return problems


@dataclass(frozen=True, slots=True, eq=False)
class MapErrors(Boxed):
    """Error by axis position, interpolated in the map; `name` is what its contribution is called."""

    name: str
    grid: Grid
    bound: GridBound

    @classmethod
    def of(cls, described: DeviationMap, box_mm: Array, hold: bool) -> MapErrors:
        from olp.errormodel.grid_bound import GridBound

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

    def backlash_at(self, axis_mm: Array) -> Array | None:
        return None

    def chord_bound(self, delta_mm: Array, tool_mm: Array) -> Array:
        bound = self.bound.departure(as_points(delta_mm, "delta_mm"))
        return np.asarray(np.sqrt(np.einsum("ij,ij->i", bound, bound)))


class MapTable(Table):
    file: Text = Field(
        description="the path of a CSV file with the columns X_mm, Y_mm, Z_mm, DX_um, DY_um, DZ_um, one row "
        "per node; and sigma_DX_um, sigma_DY_um, sigma_DZ_um where uncertainties are stated"
    )
    kind: Literal["residual", "total"] = Field(
        description='"residual" (adds to the curves) or "total" (all that was measured; no curves, '
        "squareness or cyclic errors beside it)"
    )
    tool_mm: Triple = Field(
        default=(0.0, 0.0, 0.0), description="the tool vector while measuring, [X, Y, Z] in mm"
    )
    interpolation: Literal["linear", "cubic"] = Field(default="linear", description='"linear" or "cubic"')
    holds_along: list[Literal["X", "Y", "Z"]] = Field(
        default=[],
        description='the axes along which the map has one level and holds everywhere, such as ["Z"]',
    )


class Maps(ErrorSource[list[MapTable], tuple[DeviationMap, ...]]):
    """Tables [[maps]], each with a CSV file."""

    key = "maps"
    field = "maps"
    schema: Schema = (
        list[MapTable],
        Field(default=[], description="tables [[maps]], measured deviations of the tip"),
    )
    covered = False

    def example(self, by: float) -> Example:
        text = "X_mm,Y_mm,Z_mm,DX_um,DY_um,DZ_um\n"
        for number, (x, y, z) in enumerate(product((0.0, 150.0, 400.0), (0.0, 300.0), (-200.0, 0.0))):
            text += f"{x},{y},{z},{by * number},{by * (number % 5)},{by * (7.0 - number)}\n"
        table = '[[maps]]\nfile = "calibration-map.csv"\nkind = "residual"\ninterpolation = "cubic"\n'
        return Example(table, {"calibration-map.csv": text})

    def named(self, values: Mapping[str, Any]) -> list[str]:
        return files_of_tables(values, self.key)

    def read(self, stated: list[MapTable], reading: Reading) -> tuple[DeviationMap, ...]:
        def one(table: MapTable) -> DeviationMap:
            grid = reading.deviations(table.file)
            order = [grid.arguments.index(axis) for axis in AXES]

            def rows(prefix: str) -> Array:
                return np.stack([grid.columns[f"{prefix}D{a}"].transpose(order) for a in AXES], axis=-1)

            x, y, z = (grid.knots_mm[k] for k in order)
            return DeviationMap(
                knots_mm=(x, y, z),
                values=rows(""),
                kind=table.kind,
                tool_mm=table.tool_mm,
                interpolation=table.interpolation,
                holds_along=tuple(table.holds_along),
                name=f"map {table.file}",
                sigma=rows("sigma_") if "sigma_DX" in grid.columns else None,
            )

        return reading.each(self.key, stated, one)

    def write(self, values: tuple[DeviationMap, ...], writing: Writing) -> None:
        for described in values:
            columns = {f"D{axis}_um": described.values[..., i] for i, axis in enumerate(AXES)}
            if described.sigma is not None:
                columns |= {f"sigma_D{axis}_um": described.sigma[..., i] for i, axis in enumerate(AXES)}
            text = {
                name: [in_unit_text(v, -3) for v in column.ravel().tolist()]
                for name, column in columns.items()
            }
            writing.table(
                "[[maps]]",
                {
                    "file": writing.csv("map", grid_rows(AXES, described.knots_mm, text)),
                    "kind": described.kind,
                    "tool_mm": floats(described.tool_mm),
                    "interpolation": described.interpolation,
                    "holds_along": list(described.holds_along) or None,
                },
            )

    def models(self, values: tuple[DeviationMap, ...], frame: Frame) -> list[ErrorModel]:
        return [MapErrors.of(described, frame.box_mm, frame.hold) for described in values]

    def inspect(self, values: tuple[DeviationMap, ...], frame: Frame) -> dict[str, Any]:
        if not values:
            return {}
        return {
            "maps": [
                {
                    "name": m.name,
                    "kind": m.kind,
                    "interpolation": m.interpolation,
                    "nodes": " x ".join(str(len(k)) for k in m.knots_mm),
                    "tool_mm": list(m.tool_mm),
                    "max_um": float(np.sqrt((m.values**2).sum(axis=-1)).max()) * UM_PER_MM,
                }
                for m in values
            ]
        }
