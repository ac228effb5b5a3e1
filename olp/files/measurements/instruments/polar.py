"""Distances and two angles from one station, read as points: tables [[polar]]."""

from __future__ import annotations

import numpy as np

from olp.calibration.observations.points import Points, polar_points
from olp.core.schema import NotNegative, Positive, Text, Triple
from olp.core.schema_keys import Field
from olp.core.units import MM_PER_UM, RAD_PER_URAD
from olp.files.measurements.instruments.base import PER_UNIT, Instrument, Plan, tools_of
from olp.files.measurements.point_readings import POLAR, AngleKeys, conventional, read_point_readings
from olp.files.problems import config_error


class PolarTable(AngleKeys):
    file: Text = Field(
        description="the path of a CSV file with columns X_mm, Y_mm, Z_mm (axis positions) and distance_mm, "
        "azimuth_deg, elevation_deg, relative to this file"
    )
    sigma_distance_um: Positive = Field(description="the standard uncertainty of a distance, in um")
    sigma_um_m: NotNegative = Field(
        default=0.0, description="the growth of that uncertainty with distance, in um/m"
    )
    sigma_angle_urad: Positive = Field(description="the standard uncertainty of an angle, in urad")
    sigma_scale_um_m: NotNegative = Field(
        default=0.0, description="the standard uncertainty of the scale of all distances, in um/m"
    )
    tool_mm: Triple | None = Field(
        default=None,
        description="the vector from the gauge point to the reflector, [X, Y, Z] in mm; or columns "
        "tool_X_mm, tool_Y_mm, tool_Z_mm of the file",
    )


class PolarFiles(Instrument[PolarTable, Points]):
    key = "polar"
    table = PolarTable
    marks = POLAR
    asks = ("sigma_distance_um", "sigma_angle_urad", "azimuth", "vertical", "tool_mm")
    words = "tables [[polar]]: distances and two angles from one unknown position"
    gives = Points

    def read(self, table: PolarTable, plan: Plan) -> Points:
        readings = read_point_readings(plan.beside(table.file), POLAR)
        distance = readings.measured[:, 0]
        short = np.flatnonzero(distance <= 0.0)
        if len(short):
            raise config_error(
                [
                    (int(readings.row[k]), f"distance_mm = {distance[k]:g}; expected a distance above 0")
                    for k in short
                ],
                readings.file,
            )
        angles = np.radians(readings.measured[:, 1:])
        azimuth, elevation = conventional(table, angles[:, 0], angles[:, 1])
        return polar_points(
            readings.axis_mm,
            tools_of(readings, table.tool_mm, plan.defaults),
            distance,
            azimuth,
            elevation,
            sigma_mm=table.sigma_distance_um * MM_PER_UM + table.sigma_um_m * PER_UNIT * distance,
            sigma_rad=table.sigma_angle_urad * RAD_PER_URAD,
            sigma_scale=table.sigma_scale_um_m * PER_UNIT,
            source=readings.file,
            row=readings.row,
        )
