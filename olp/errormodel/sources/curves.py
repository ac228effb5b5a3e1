"""Curves: component errors of one axis along one measuring line.

Their model is the exact product of the bodies (`olp.errormodel.chain`, `components`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import field
from itertools import product
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.interpolation import Column
from olp.core.machine import COMPONENTS, ZERO, Vector
from olp.core.schema import Position, Table, Text, Triple
from olp.core.schema_keys import Field
from olp.core.units import AXES, RAD_PER_URAD, UM_PER_MM, in_unit_text
from olp.core.values import dataclass
from olp.errormodel.entry import AxisState, Entry, Numbers, Slot, alone, component_acts
from olp.errormodel.gridded import frozen, refuse
from olp.errormodel.sources.base import (
    ErrorSource,
    Example,
    Frame,
    Reading,
    Schema,
    Sigmas,
    Writing,
    digits,
    files_of_tables,
    floats,
    line_at,
    line_key,
)

Reference = Literal["functional-point", "table"]
Interpolation = Literal["linear", "pchip"]
#: Where only standard uncertainties are known, so many equal parts of a curve are taken as independent of
#: each other. This is cautious, as then a touch-off elsewhere cancels nothing of it.
CELLS = 16


#: mm; no machine is as long, and powers of such lengths are still numbers.
_FARTHEST_MM = 1e9


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """Component errors of one axis along one measuring line.

    `position_mm` (n,) strictly increasing; either `columns` (mean of both directions) or `forward` and
    `backward` with the same names, each (n,) in mm or rad. `line_mm` holds the positions of the other
    axes (the entry of the own axis is ignored), None means the datum; `tool_mm` is the tool vector then.
    A value is what was measured at the functional point on that line; with `reference` "table" the
    reflector was fixed on a moving table. Raises ConfigError.
    """

    axis: str
    position_mm: Array
    columns: Mapping[str, Array] = field(default_factory=dict)
    forward: Mapping[str, Array] = field(default_factory=dict)
    backward: Mapping[str, Array] = field(default_factory=dict)
    line_mm: Vector | None = None
    tool_mm: Vector = ZERO
    reference: Reference = "functional-point"
    interpolation: Interpolation = "pchip"

    def __post_init__(self) -> None:
        if self.axis not in AXES or len(self.axis) != 1:
            raise ConfigError(f"curve of axis '{self.axis}'; expected X, Y or Z")
        object.__setattr__(self, "position_mm", frozen(self.position_mm))
        for name in ("columns", "forward", "backward"):
            columns = {key: frozen(value) for key, value in getattr(self, name).items()}
            object.__setattr__(self, name, MappingProxyType(columns))
        refuse(self._problems())

    def _problems(self) -> list[str]:
        label, x = f"curve of axis {self.axis}", self.position_mm
        problems = []
        if x.ndim != 1 or len(x) < 2:
            return [f"{label}: {x.size} positions; expected at least 2"]
        if not np.all(np.isfinite(x)) or np.any(np.diff(x) <= 0.0):
            problems.append(
                f"{label}: positions do not strictly increase; sort them and average repeated ones"
            )
        elif np.abs(x).max() > _FARTHEST_MM:
            problems.append(f"{label}: a position is beyond {_FARTHEST_MM:g} mm; check the numbers")
        if bool(self.columns) == bool(self.forward) or set(self.forward) != set(self.backward):
            problems.append(f"{label}: expected columns of the mean, or the same columns in both directions")
        for name, values in (*self.columns.items(), *self.forward.items(), *self.backward.items()):
            if name not in COMPONENTS or name[2] != self.axis:
                expected = ", ".join(f"E{d}{self.axis}" for d in "XYZABC")
                problems.append(f"{label}: column '{name}'; expected one of {expected}")
            elif values.shape != x.shape or not np.all(np.isfinite(values)):
                problems.append(
                    f"{label}: column {name} is not a finite number at each of {len(x)} positions"
                )
        if self.interpolation not in ("linear", "pchip"):
            problems.append(f"{label}: interpolation '{self.interpolation}'; expected linear or pchip")
        if self.reference not in ("functional-point", "table"):
            problems.append(f"{label}: reference '{self.reference}'; expected functional-point or table")
        for key, vector in (("line_mm", self.line_mm), ("tool_mm", self.tool_mm)):
            if vector is not None and (len(vector) != 3 or not np.all(np.isfinite(vector))):
                problems.append(f"{label}: {key} = {vector}; expected three finite lengths")
        return problems

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.columns) or tuple(self.forward)

    @property
    def arguments(self) -> tuple[str, ...]:
        return (self.axis,)

    def mean(self, name: str) -> Array:
        """(n,) mean of both directions."""
        return self.columns[name] if self.columns else 0.5 * (self.forward[name] + self.backward[name])

    def half_difference(self, name: str) -> Array | None:
        """(n,) half of forward minus backward; None for a curve of the mean."""
        return None if self.columns else 0.5 * (self.forward[name] - self.backward[name])


class CurveTable(Table):
    file: Text = Field(description="the path of a CSV file with columns such as X_mm, EXX_um, EBX_urad")
    line_mm: Position = Field(
        default_factory=Position,
        description="positions of the other axes while measuring, such as { Y = 0.0, Z = 0.0 } in mm; the "
        "datum if left out",
    )
    tool_mm: Triple = Field(
        default=(0.0, 0.0, 0.0), description="the tool vector while measuring, [X, Y, Z] in mm"
    )
    reference: Literal["functional-point", "table"] = Field(
        default="functional-point",
        description='"functional-point" (measured at the tip on its line) or "table" (the reflector was '
        "fixed on a moving table)",
    )
    interpolation: Literal["linear", "pchip"] = Field(default="pchip", description='"linear" or "pchip"')


class Mean(Numbers):
    """Values of a component error at positions; between them straight lines."""

    kind = "mean"
    names = COMPONENTS

    def count(self, entry: Entry) -> int:
        x = entry.position_mm
        good = len(x) >= 2 and np.isfinite(x).all() and not np.any(np.diff(x) <= 0.0)
        return len(x) if good else 0

    def acts(self, entry: Entry, state: AxisState) -> Iterator[tuple[int, Column]]:
        yield from component_acts(entry.name, 1.0, state)

    def weights(self, entry: Entry, q: Array) -> Iterator[Slot]:
        x = entry.position_mm
        i = np.clip(np.searchsorted(x, q, side="right") - 1, 0, len(x) - 2).astype(np.int32)
        share = (np.clip(q, x[0], x[-1]) - x[i]) / (x[i + 1] - x[i])
        yield i, 1.0 - share
        yield i + 1, share

    def parts(self, entry: Entry) -> int:
        return _cells(entry) + 1

    def part_weights(self, entry: Entry, q: Array) -> Iterator[Slot]:
        """As stated at every position, wherever in a cell it lies."""
        x, cells = entry.position_mm, _cells(entry)
        sigma = np.interp(q, x, entry.rest)
        cells_passed = np.clip((q - x[0]) / (x[-1] - x[0]), 0.0, 1.0) * cells
        cell = np.minimum(cells_passed.astype(np.int32), cells - 1)
        share = cells_passed - cell
        size = sigma / np.sqrt(share**2 + (1.0 - share) ** 2)
        yield cell, size * (1.0 - share)
        yield cell + 1, size * share


class Half(Mean):
    """Half differences of both directions: they act with the play."""

    kind = "half"

    def acts(self, entry: Entry, state: AxisState) -> Iterator[tuple[int, Column]]:
        if state.play is not None:
            yield from component_acts(entry.name, state.play, state)


def _cells(entry: Entry) -> int:
    return min(CELLS, len(entry.position_mm) - 1)


class Curves(ErrorSource[list[CurveTable], tuple[Curve, ...]]):
    """Tables [[curves]], each with a CSV file."""

    key = "curves"
    field = "curves"
    numbers = (Mean(), Half())
    schema: Schema = (list[CurveTable], Field(default=[], description="tables [[curves]]"))

    def example(self, by: float) -> Example:
        x = "X_mm,EXX_um,EYX_um,ECX_urad,sigma_EXX_um,sigma_EYX_um,sigma_ECX_urad\n"
        for q, *row in ((0.0, 3.0, 1.0, 20.0), (200.0, 8.0, 2.0, 45.0), (400.0, 5.0, 6.0, 30.0)):
            x += ",".join(repr(value) for value in (q, *(by * v for v in row), *(0.1 * by * v for v in row)))
            x += "\n"
        y = "Y_mm,direction,EYY_um,EAY_urad,sigma_EYY_um,sigma_EAY_urad\n"
        for d, q in product((1, -1), (0.0, 300.0)):
            y += f"{q},{d},{by * (2.0 + d)},{by * 10.0},{by * 0.2},{by * 1.0}\n"
        straight = 'interpolation = "linear"\n'
        tables = f'[[curves]]\nfile = "calibration-x.csv"\nline_mm = {{ Y = 50.0, Z = -20.0 }}\n{straight}'
        tables += f'[[curves]]\nfile = "calibration-y.csv"\nreference = "table"\n{straight}'
        return Example(tables, {"calibration-x.csv": x, "calibration-y.csv": y})

    def named(self, values: Mapping[str, Any]) -> list[str]:
        return files_of_tables(values, self.key)

    def read(self, stated: list[CurveTable], reading: Reading) -> tuple[Curve, ...]:
        def one(table: CurveTable) -> Curve:
            columns = reading.curve(table.file)
            return Curve(
                axis=columns.axis,
                position_mm=columns.position_mm,
                columns={} if columns.forward is not None else columns.columns,
                forward=columns.forward or {},
                backward=columns.backward or {},
                line_mm=line_at(table.line_mm, reading.datum_mm),
                tool_mm=table.tool_mm,
                reference=table.reference,
                interpolation=table.interpolation,
            )

        return reading.each(self.key, stated, one)

    def write(self, values: tuple[Curve, ...], writing: Writing) -> None:
        for curve in values:
            sigma = {name: s for name in curve.names if (s := writing.sigma(name)) is not None}
            writing.table(
                "[[curves]]",
                {
                    "file": writing.csv(curve.axis.lower(), _csv(curve, sigma)),
                    "line_mm": line_key(curve.line_mm, curve.axis),
                    "tool_mm": floats(curve.tool_mm),
                    "reference": None if curve.reference == "functional-point" else curve.reference,
                    "interpolation": curve.interpolation,
                },
            )

    def sigmas(self, stated: list[CurveTable], reading: Reading) -> Sigmas:
        sigmas: dict[str, Array | float] = {}
        for table in stated:
            # most files have none, and need not be parsed twice
            if b"sigma_" in reading.content(table.file):
                sigma = reading.curve(table.file).sigma
                sigmas |= {name: values for name, values in sigma.items() if values.any()}
        return sigmas

    def entries(self, values: tuple[Curve, ...], sigmas: Sigmas) -> list[Entry]:
        return [
            alone("mean", name, sigmas[name], curve.position_mm)
            for curve in values
            for name in curve.names
            if name in sigmas
        ]

    def fingerprint(self, values: tuple[Curve, ...], datum_mm: Vector) -> Iterator[str]:
        for curve in values:
            line = datum_mm if curve.line_mm is None else curve.line_mm
            others = [position for position, axis in zip(line, AXES, strict=True) if axis != curve.axis]
            read = f"{curve.reference} {curve.interpolation}"
            yield f"{curve.axis} {read} {digits(others)} {digits(curve.tool_mm)}"
            yield digits(curve.position_mm)
            for part in (curve.columns, curve.forward, curve.backward):
                for name in sorted(part):
                    yield f"{name} {digits(part[name])}"

    def inspect(self, values: tuple[Curve, ...], frame: Frame) -> dict[str, Any]:
        """The size of each of the 18 component errors."""
        return {
            title: [_size(values, name, unit, scale) for name in COMPONENTS if name[1] in directions]
            for title, directions, unit, scale in (
                ("position_errors", "XYZ", "um", UM_PER_MM),
                ("angular_errors", "ABC", "urad", 1.0 / RAD_PER_URAD),
            )
        }


def _size(curves: tuple[Curve, ...], name: str, unit: str, scale: float) -> dict[str, Any]:
    """Largest absolute value and range, from the points: interpolation does not leave their range."""
    values = [
        value for curve in curves if name in curve.names for value in (curve.mean(name) * scale).tolist()
    ] or [0.0]
    return {"name": name, f"max_{unit}": max(map(abs, values)), f"range_{unit}": max(values) - min(values)}


def _csv(curve: Curve, sigma: Mapping[str, Array]) -> str:
    for component, values in sigma.items():
        if np.shape(values) != curve.position_mm.shape or not np.all(np.asarray(values) >= 0.0):
            raise ConfigError(
                f"sigma of {component} has shape {np.shape(values)}; expected a number of 0 or above at each "
                f"of {len(curve.position_mm)} positions"
            )
    units = {name: ("um", -3) if name[1] in AXES else ("urad", -6) for name in curve.names}
    both = bool(curve.forward)
    header = [f"{curve.axis}_mm", *(["direction"] if both else [])]
    header += [f"{name}_{unit}" for name, (unit, _) in units.items()]
    header += [f"sigma_{name}_{units[name][0]}" for name in sigma]
    positions = [in_unit_text(position, 0) for position in curve.position_mm.tolist()]
    rows = [",".join(header)]
    for direction, columns in (("+1", curve.forward), ("-1", curve.backward), ("", curve.columns)):
        if columns:
            cells = [positions, *([[direction] * len(positions)] if both else [])]
            cells += [_column(columns[name], power) for name, (_, power) in units.items()]
            cells += [_column(values, units[name][1]) for name, values in sigma.items()]
            rows += [",".join(row) for row in zip(*cells, strict=True)]
    return "\n".join(rows) + "\n"


def _column(values: Array, power: int) -> list[str]:
    return [in_unit_text(value, power) for value in np.asarray(values, float).tolist()]
