"""Parts of a calibration that are tables over a rectilinear grid of axis positions, as values.

Base units: mm, rad, kg, degC. error = actual - commanded, tool relative to workpiece.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.grid_interpolation import KINDS
from olp.core.grid_interpolation import Kind as Interpolation
from olp.core.machine import COMPONENTS, ZERO, Vector
from olp.core.units import AXES

#: A table may miss a face of the box by rounding of its file, no more.
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
                f"{low:g} to "
                f"{high:g} mm; measure the rest or make box_mm smaller"
            )
    return problems


@dataclass(frozen=True, slots=True, eq=False)
class DeviationMap:
    """Deviations of the tip (nx, ny, nz, 3) in mm over axis positions `knots_mm` (three arrays), measured
    with the tool vector `tool_mm`.

    A "residual" map adds to the curves; a "total" one is all that was measured and stands in for them. An
    axis in `holds_along` may have one level: the map is taken to be the same all along it. `sigma`, of the
    shape of the values, are standard uncertainties in mm; of a residual map beside those of the curves.
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
                    f"{self.name} has one level along {axis}, so it tells nothing of how the error changes "
                    f'there; expected two levels or more, or holds_along = ["{axis}"] where the error is '
                    f"known "
                    "to be the same all along it"
                )
            elif len(knots) > 1 and axis in self.holds_along:
                problems.append(
                    f"{self.name} has {len(knots)} levels along {axis}, and holds_along names it; expected "
                    "one level, or the axis left out there"
                )
        return problems


@dataclass(frozen=True, slots=True, eq=False)
class ComponentTable:
    """Component errors of one axis over a grid of one to three axis positions: load per kg, or temperature.

    `arguments` names the axes of the grid, `knots_mm` their levels, `columns` the values by ISO 230-1 name,
    all of one shape. `line_mm` and `tool_mm` as of a `Curve`: where the other axes stood and the tool vector
    then. Raises ConfigError.
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
