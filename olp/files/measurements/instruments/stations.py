"""Lengths of a tracking interferometer from stations: tables [[stations]]."""

from __future__ import annotations

import numpy as np

from olp.calibration.observations.lengths import Lengths
from olp.core.arrays import Index
from olp.core.schema import NotNegative, Positive, Table, Text, Triple
from olp.core.schema_keys import Field
from olp.core.units import MM_PER_UM, UM_PER_MM
from olp.files.measurements.instruments.base import PER_UNIT, UM_M, Instrument, Plan, points_to_fill, tools_of
from olp.files.measurements.point_readings import LENGTH, read_point_readings
from olp.files.toml_text import toml_lines


class StationTable(Table):
    file: Text = Field(
        description="the path of a CSV file with columns X_mm, Y_mm, Z_mm (axis positions) and length_mm, "
        "relative to this file"
    )
    sigma_um: Positive = Field(description="the standard uncertainty of a length, in um")
    sigma_um_m: NotNegative = Field(
        default=0.0, description="the growth of that uncertainty with length, in um/m"
    )
    tool_mm: Triple | None = Field(
        default=None,
        description="the vector from the gauge point to the reflector, [X, Y, Z] in mm; or columns "
        "tool_X_mm, tool_Y_mm, tool_Z_mm of the file",
    )
    sigma_scale_um_m: NotNegative = Field(
        default=0.0, description="the standard uncertainty of the scale of all lengths, in um/m"
    )


class StationFiles(Instrument[StationTable, Lengths]):
    key = "stations"
    table = StationTable
    marks = LENGTH
    asks = ("sigma_um", "tool_mm")
    words = "tables [[stations]]: lengths from unknown positions (multilateration)"
    gives = Lengths
    plans = True

    def read(self, table: StationTable, plan: Plan) -> Lengths:
        readings = read_point_readings(plan.beside(table.file), LENGTH)
        length = readings.measured[:, 0]
        return Lengths(
            axis_mm=readings.axis_mm,
            tool_mm=tools_of(readings, table.tool_mm, plan.defaults),
            length_mm=length,
            sigma_mm=table.sigma_um * MM_PER_UM + table.sigma_um_m * PER_UNIT * np.abs(length),
            sigma_scale=table.sigma_scale_um_m * PER_UNIT,
            source=readings.file,
            row=readings.row,
        )

    def asked(self, taken: Lengths, name: str) -> list[str]:
        far = float(np.polyfit(taken.length_mm, taken.sigma_mm, 1)[0])
        least = float(np.mean(taken.sigma_mm - far * taken.length_mm))
        values = {"file": name, "sigma_um": round(least * UM_PER_MM, 4), "sigma_um_m": round(far * UM_M, 4)}
        return ["[[stations]]", *toml_lines(values)]

    def empty(self, taken: Lengths, rows: Index) -> bytes:
        return points_to_fill(taken, rows, LENGTH)
