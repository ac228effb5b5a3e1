"""Tables over a rectilinear grid of axis positions: component errors as values, and what is checked of every
table.

Base units: mm, rad, kg, degC. error = actual - commanded, tool relative to workpiece.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from itertools import product
from types import MappingProxyType
from typing import Literal

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.grid_interpolation import KINDS
from olp.core.grid_interpolation import Kind as Interpolation
from olp.core.machine import COMPONENTS, ZERO, Vector
from olp.core.units import AXES, in_unit_text
from olp.core.values import dataclass

#: mm; a table may miss a face of the box by the rounding of its file, no more.
COVER_MM = 1e-6


def frozen(values: object) -> Array:
    array = np.array(values, dtype=np.float64)
    array.flags.writeable = False
    return array


def refuse(problems: list[str]) -> None:
    if problems:
        raise ConfigError(problems[0], problems=tuple(problems))


def knot_problems(label: str, arguments: Sequence[str], knots: Sequence[Array]) -> list[str]:
    return [
        f"{label}: positions along {axis} do not strictly increase; expected finite ascending levels"
        for axis, x in zip(arguments, knots, strict=True)
        if x.ndim != 1 or not len(x) or not np.all(np.isfinite(x)) or np.any(np.diff(x) <= 0.0)
    ]


def cover_problems(
    label: str, arguments: Sequence[str], knots: Sequence[Array], box_mm: Array, constant: Sequence[str] = ()
) -> list[str]:
    """Where a table does not reach the faces of the box; an argument in `constant` may have one level."""
    problems = []
    for axis, x in zip(arguments, knots, strict=True):
        low, high = box_mm[AXES.index(axis)]
        if len(x) == 1 and axis in constant:
            continue
        if x[0] > low + COVER_MM or x[-1] < high - COVER_MM:
            problems.append(
                f"{label} runs from {x[0]:g} to {x[-1]:g} mm along {axis}; expected all of the box, "
                f"{low:g} to {high:g} mm; measure the rest or make box_mm smaller"
            )
    return problems


def grid_rows(arguments: Sequence[str], knots: Sequence[Array], columns: Mapping[str, Sequence[str]]) -> str:
    """The text of a CSV file over a grid: the levels, then columns of cells, one row per node."""
    rows = [",".join([*(f"{a}_mm" for a in arguments), *columns])]
    levels = [[in_unit_text(v, 0) for v in k.tolist()] for k in knots]
    for number, place in enumerate(product(*levels)):
        rows.append(",".join([*place, *(column[number] for column in columns.values())]))
    return "\n".join(rows) + "\n"


@dataclass(frozen=True, slots=True, eq=False)
class ComponentTable:
    """Component errors of one axis over a grid of one to three axis positions: load per kg, or temperature.

    `arguments` names the axes of the grid, `knots_mm` their levels, `columns` the values by ISO 230-1 name,
    all of one shape. `line_mm` gives the positions of the axes that are no argument, `tool_mm` the tool
    vector then: a value holds as it is at its own node. Raises ConfigError.
    """

    axis: str
    arguments: tuple[str, ...]
    knots_mm: tuple[Array, ...]
    columns: Mapping[str, Array] = field(default_factory=dict)
    line_mm: Vector | None = None
    tool_mm: Vector = ZERO
    reference: Literal["functional-point", "table"] = "functional-point"
    interpolation: Interpolation = "cubic"
    name: str = "compliance"

    def __post_init__(self) -> None:
        object.__setattr__(self, "knots_mm", tuple(frozen(k) for k in self.knots_mm))
        columns = {key: frozen(value) for key, value in self.columns.items()}
        object.__setattr__(self, "columns", MappingProxyType(columns))
        refuse(self._problems())

    def _problems(self) -> list[str]:
        label = self.name
        problems = []
        distinct = len(set(self.arguments)) == len(self.arguments)
        if not self.arguments or not distinct or not set(self.arguments) <= set(AXES):
            return [f"{label}: arguments {self.arguments}; expected one to three of X, Y, Z, each once"]
        problems += knot_problems(label, self.arguments, self.knots_mm)
        for axis, knots in zip(self.arguments, self.knots_mm, strict=True):
            if len(knots) < 2:
                problems.append(f"{label}: {len(knots)} levels along {axis}; expected at least 2")
        shape = tuple(len(k) for k in self.knots_mm)
        if not self.columns:
            problems.append(f"{label}: no columns; expected components such as EZX")
        for name, values in self.columns.items():
            if name not in COMPONENTS or name[2] != self.axis:
                expected = ", ".join(f"E{d}{self.axis}" for d in "XYZABC")
                problems.append(f"{label}: column '{name}'; expected one of {expected}")
            elif values.shape != shape or not np.all(np.isfinite(values)):
                problems.append(f"{label}: column {name} is not a finite number at each of {shape} nodes")
        if self.interpolation not in KINDS:
            problems.append(f"{label}: interpolation '{self.interpolation}'; expected linear or cubic")
        if self.reference not in ("functional-point", "table"):
            problems.append(f"{label}: reference '{self.reference}'; expected functional-point or table")
        return problems

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.columns)
