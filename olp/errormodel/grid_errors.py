"""Component errors of one axis over a grid, to first order: by load (times a mass) or by temperature.

E += w S and eps += w s at the axis positions of the grid, with w = m - m_cal of the payload in kg, or 1. The
angles act on `lever_arms`, as the angles of a curve that was measured on the same line. Products of these
angles with other errors are left out (60 urad times 0.1 mm are 6 nm).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from olp.core.arrays import Array, Mask
from olp.core.grid_interpolation import Grid
from olp.core.machine import Vector
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.errormodel.boxed import Boxed, as_points, as_tool, by_tool, payload_of
from olp.errormodel.grid_bound import GridBound
from olp.errormodel.gridded import ComponentTable
from olp.errormodel.lever_arms import CROSS, DIRECTIONS, LeverArms, lever_arms_of


@dataclass(frozen=True, slots=True, eq=False)
class GridBody:
    """Component errors of axis `axis` from one table; `column` leads from X, Y, Z, A, B, C to the column of
    `grid` or None. `mass_kg` is the payload at which the table's effect is zero, None where it does not
    depend on the payload."""

    axis: int
    axes: tuple[int, ...]
    grid: Grid
    bound: GridBound
    column: tuple[int | None, ...]
    lever_arms: LeverArms
    mass_kg: float | None
    tool_terms: bool

    @classmethod
    def of(
        cls,
        table: ComponentTable,
        chain: str,
        datum_mm: Vector,
        mass_kg: float | None,
        beside: Sequence[ComponentTable],
        *,
        tool_terms: bool,
    ) -> GridBody:
        """`beside` are all tables of this axis that were measured together, this one included: a translation
        holds the effect of the angles on its own line, whichever table holds the angles."""
        after = chain[chain.index(table.axis) + 1 :]
        carries = chain.index(table.axis) < chain.index("F")
        names = table.names
        grid = Grid.through(
            table.knots_mm, np.stack([table.columns[n] for n in names], axis=-1), table.interpolation
        )
        column = tuple(names.index(n) if (n := f"E{d}{table.axis}") in names else None for d in DIRECTIONS)
        lever_arms = lever_arms_of(tuple(beside), datum_mm, table.axis, after, carries, tool_terms)
        return cls(
            axis=AXES.index(table.axis),
            axes=tuple(AXES.index(a) for a in table.arguments),
            grid=grid,
            bound=GridBound.of(grid, table.arguments),
            column=column,
            lever_arms=lever_arms,
            mass_kg=mass_kg,
            tool_terms=tool_terms,
        )

    def weight(self, payload_kg: Array | float) -> Array | float:
        return 1.0 if self.mass_kg is None else payload_kg - self.mass_kg

    def parts(self, position: Array, tool: Array, payload_kg: Array | float) -> Iterator[tuple[str, Array]]:
        """(component, (n, 3) mm) of what each component does to the tip at finite positions (n, 3)."""
        weight = self.weight(payload_kg)
        if np.ndim(weight) == 0 and weight == 0.0:
            return
        value = self.grid(position[:, self.axes])
        value *= np.reshape(weight, (-1, 1))
        arms = [np.broadcast_to(tool[..., k], (len(position),)) for k in range(3)]
        coordinates = [np.ascontiguousarray(position[:, k]) for k in range(3)]
        for d, column in enumerate(self.column):
            if column is None:
                continue
            error = np.zeros((len(position), 3))
            if d < 3:
                error[:, d] = value[:, column]
            else:
                for rows, lever_arm in self.lever_arms:
                    arm = lever_arm.at(coordinates, list(arms))
                    for i, a, k, sign in CROSS:
                        if i in rows and a == d - 3:
                            error[:, i] += sign * value[:, column] * arm[k]
            yield f"E{DIRECTIONS[d]}{AXES[self.axis]}", error

    def rotation(self, position: Array, payload_kg: Array | float) -> Array:
        angles = np.zeros((len(position), 3))
        if any(c is not None for c in self.column[3:]):
            value = self.grid(position[:, self.axes])
            value *= np.reshape(self.weight(payload_kg), (-1, 1))
            for a, column in enumerate(self.column[3:]):
                if column is not None:
                    angles[:, a] = value[:, column]
        return angles

    def turns_with(self) -> Mask:
        """(3, 3): [a, j] whether angle a changes with axis j."""
        turns = np.zeros((3, 3), dtype=np.bool_)
        varies = self.grid.varies()
        for a, column in enumerate(self.column[3:]):
            if column is not None:
                turns[a, list(self.axes)] = varies[column]
        return turns

    def depends_on(self) -> Mask:
        depends = np.zeros((3, 3), dtype=np.bool_)
        varies, turns = self.grid.varies(), self.turns_with()
        for i, column in enumerate(self.column[:3]):
            if column is not None:
                depends[i, list(self.axes)] = varies[column]
        for rows, lever_arm in self.lever_arms:
            for i, a, k, _ in CROSS:
                column = self.column[3 + a]
                if i in rows and column is not None and np.any(self.grid.values[..., column]):
                    depends[i] |= turns[a]
                    depends[i, k] |= lever_arm.moves[k]
        return depends

    def chord_bound(self, delta: Array, tool: Array, payload_kg: Array | float, box_mm: Array) -> Array:
        """(n, 3) bound by row, for tool vectors (m, 3)."""
        departure, change = self.bound.departure(delta), self.bound.change(delta)
        bound = np.zeros((len(delta), 3))
        for i, column in enumerate(self.column[:3]):
            if column is not None:
                bound[:, i] += departure[:, column]
        for rows, lever_arm in self.lever_arms:
            reach = lever_arm.reach_mm(box_mm, tool)
            for i, a, k, _ in CROSS:
                column = self.column[3 + a]
                if i not in rows or column is None:
                    continue
                bound[:, i] += departure[:, column] * reach[k]
                if lever_arm.moves[k]:
                    bound[:, i] += 0.25 * change[:, column] * np.abs(delta[:, k])
        return np.asarray(bound * np.reshape(np.abs(self.weight(payload_kg)), (-1, 1)))


@dataclass(frozen=True, slots=True, eq=False)
class GridErrors(Boxed):
    """The sum of several bodies; `name` comes before the component in the name of a contribution."""

    name: str
    bodies: tuple[GridBody, ...]

    @classmethod
    def of(
        cls,
        name: str,
        tables: Sequence[ComponentTable],
        chain: str,
        datum_mm: Vector,
        box_mm: Array,
        *,
        hold: bool,
        mass_kg: float | None = None,
        tool_terms: bool = True,
        apart: Sequence[ComponentTable] = (),
    ) -> GridErrors:
        """`mass_kg` is the payload of the calibration, None where the tables do not depend on a payload.
        Those in `apart` are separate bodies, such as beams, with separate lever arms."""
        bodies = [
            GridBody.of(
                table, chain, datum_mm, mass_kg, [t for t in tables if t.axis == table.axis],
                tool_terms=tool_terms,
            )
            for table in tables
        ]  # fmt: skip
        bodies += [GridBody.of(t, chain, datum_mm, mass_kg, [t], tool_terms=tool_terms) for t in apart]
        return cls(box_mm, hold, name, tuple(bodies))

    def error(self, axis_mm: Array, tool_mm: Array, play: Array | None = None) -> Array:
        position, unknown, tool, payload = self._state(axis_mm, tool_mm)
        result = np.zeros(position.shape)
        for body in self.bodies:
            for _, value in body.parts(position, self._arms(body, tool), payload):
                result += value
        return self._hidden(result, unknown, self.depends_on)

    def rotation(self, axis_mm: Array, play: Array | None = None, payload_kg: Array | float = 0.0) -> Array:
        position, unknown, _, _ = self._state(axis_mm, np.zeros(3))
        result = np.zeros(position.shape)
        turns = np.zeros((3, 3), dtype=np.bool_)
        for body in self.bodies:
            result += body.rotation(position, payload_kg)
            turns |= body.turns_with()
        return self._hidden(result, unknown, turns)

    def contributions(
        self, axis_mm: Array, tool_mm: Array, play: Array | None = None
    ) -> Iterator[tuple[str, Array]]:
        position, unknown, tool, payload = self._state(axis_mm, tool_mm)
        for body in self.bodies:
            for name, value in body.parts(position, self._arms(body, tool), payload):
                if np.any(value != 0.0):
                    yield f"{self.name} {name}", self._hidden(value, unknown, self.depends_on)

    @property
    def depends_on(self) -> Mask:
        return np.asarray(np.any([body.depends_on() for body in self.bodies], axis=0))

    def backlash_at(self, axis_mm: Array) -> Array | None:
        return None

    def chord_bound(self, delta_mm: Array, tool_mm: Array) -> Array:
        delta = as_points(delta_mm, "delta_mm")
        tool, payload = as_tool(tool_mm, len(delta)), payload_of(tool_mm)
        total = np.zeros((len(delta), 3))
        for body in self.bodies:
            for rows, arm in by_tool(self._arms(body, tool)):
                load = payload[rows] if isinstance(payload, np.ndarray) else payload
                total[rows] += body.chord_bound(delta[rows], arm[None], load, self.box_mm)
        return np.asarray(np.sqrt(np.einsum("ij,ij->i", total, total)))

    @staticmethod
    def _arms(body: GridBody, tool: Array) -> Array:
        return tool if body.tool_terms else np.zeros(3)

    def _state(self, axis_mm: Array, tool_mm: Array) -> tuple[Array, Mask | None, Array, Array | float]:
        """Finite positions, where they are unknown, tool vectors and payload."""
        points = as_points(axis_mm)
        tool, payload = as_tool(tool_mm, len(points)), payload_of(tool_mm)
        unknown = np.isnan(points)
        if not unknown.any():
            return self.clamped(points), None, tool, payload
        return self.clamped(np.where(unknown, self.box_mm[:, 0], points)), unknown, tool, payload

    @staticmethod
    def _hidden(value: Array, unknown: Mask | None, depends: Mask) -> Array:
        if unknown is not None:
            value[unknown @ depends.T] = np.nan
        return value
