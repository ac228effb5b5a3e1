"""Compliance: component errors of an axis per kg of payload beyond that of the calibration, over a grid.

Their model (`olp.errormodel.grid_errors`) evaluates those of beams as well: both are the load.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import Any, Literal

import numpy as np

from olp.core.schema import Position, Table, Text, Triple
from olp.core.schema_keys import Field
from olp.core.units import AXES, RAD_PER_URAD, UM_PER_MM, in_unit_text
from olp.errormodel.base import ErrorModel
from olp.errormodel.gridded import ComponentTable, grid_rows
from olp.errormodel.sources.base import (
    ErrorSource,
    Example,
    Frame,
    Reading,
    Schema,
    Writing,
    files_of_tables,
    floats,
    line_at,
    line_key,
)


class OnLine(Table):
    """The positions of the axes that are no argument, and the tool vector."""

    line_mm: Position = Field(
        default_factory=Position,
        description="positions of the axes that are no argument of the table, such as { Y = 0.0, Z = 0.0 } "
        "in mm; the datum if left out",
    )
    tool_mm: Triple = Field(default=(0.0, 0.0, 0.0), description="the tool vector then, [X, Y, Z] in mm")


class ComplianceTable(OnLine):
    file: Text = Field(
        description="the path of a CSV file with columns such as X_mm, EZX_um_kg, EBX_urad_kg; up to three "
        "columns of axis positions"
    )
    reference: Literal["functional-point", "table"] = Field(
        default="functional-point",
        description='"functional-point" (measured at the tip on its line) or "table" (the reflector was '
        "fixed on a moving table)",
    )
    interpolation: Literal["linear", "cubic"] = Field(default="cubic", description='"linear" or "cubic"')


class Compliance(ErrorSource[list[ComplianceTable], tuple[ComponentTable, ...]]):
    """Tables [[compliance]], each with a CSV file."""

    key = "compliance"
    field = "compliance"
    schema: Schema = (
        list[ComplianceTable],
        Field(default=[], description="tables [[compliance]], errors per kg of payload"),
    )
    covered = False

    def example(self, by: float) -> Example:
        text = "Y_mm,Z_mm,EZY_um_kg,EAY_urad_kg\n"
        for number, (y, z) in enumerate(product((0.0, 100.0, 300.0), (-200.0, 0.0))):
            text += f"{y},{z},{-by * (0.5 + 0.1 * number)},{by * (1.0 + number)}\n"
        table = '[[compliance]]\nfile = "calibration-load.csv"\nline_mm = { X = 200.0 }\n'
        return Example(table, {"calibration-load.csv": text})

    def named(self, values: Mapping[str, Any]) -> list[str]:
        return files_of_tables(values, self.key)

    def read(self, stated: list[ComplianceTable], reading: Reading) -> tuple[ComponentTable, ...]:
        def one(table: ComplianceTable) -> ComponentTable:
            grid = reading.components(table.file)
            return ComponentTable(
                axis=next(iter(grid.columns))[2],
                arguments=grid.arguments,
                knots_mm=grid.knots_mm,
                columns=grid.columns,
                line_mm=line_at(table.line_mm, reading.datum_mm),
                tool_mm=table.tool_mm,
                reference=table.reference,
                interpolation=table.interpolation,
                name=f"compliance {table.file}",
            )

        return reading.each(self.key, stated, one)

    def write(self, values: tuple[ComponentTable, ...], writing: Writing) -> None:
        for table in values:
            writing.table(
                "[[compliance]]",
                {
                    "file": writing.csv("load", _csv(table)),
                    "line_mm": line_key(table.line_mm, table.axis if table.axis in table.arguments else ""),
                    "tool_mm": floats(table.tool_mm),
                    "reference": None if table.reference == "functional-point" else table.reference,
                    "interpolation": table.interpolation,
                },
            )

    def models(self, values: tuple[ComponentTable, ...], frame: Frame) -> list[ErrorModel]:
        if not values and not frame.loads:
            return []
        from olp.errormodel.grid_errors import GridErrors

        return [
            GridErrors.of(
                "load", values, frame.chain, frame.datum_mm, frame.box_mm, hold=frame.hold,
                apart=frame.loads, mass_kg=frame.payload_kg, tool_terms=frame.tool_terms,
            )
        ]  # fmt: skip

    def inspect(self, values: tuple[ComponentTable, ...], frame: Frame) -> dict[str, Any]:
        if not values and not frame.loads:
            return {}
        return {
            "load": [
                {
                    "name": f"{table.name}: {name}",
                    "by_position_of": " and ".join(table.arguments),
                    "max_um_kg" if name[1] in "XYZ" else "max_urad_kg": float(np.abs(column).max())
                    * (UM_PER_MM if name[1] in "XYZ" else 1.0 / RAD_PER_URAD),
                }
                for table in (*values, *frame.loads)
                for name, column in table.columns.items()
            ],
            "load_measured_with": {"payload_kg": frame.payload_kg},
        }


def _csv(table: ComponentTable) -> str:
    """Positions, then columns per kg: those of lengths first."""
    columns = {}
    for unit, power in (("um", -3), ("urad", -6)):
        for name, values in table.columns.items():
            if (name[1] in AXES) == (unit == "um"):
                columns[f"{name}_{unit}_kg"] = [in_unit_text(v, power) for v in values.ravel().tolist()]
    return grid_rows(table.arguments, table.knots_mm, columns)
