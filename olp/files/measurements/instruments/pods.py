"""Directions from pods or theodolites: tables [[pods]]."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from olp.calibration.observations.pods import Pods
from olp.core.arrays import Index
from olp.core.errors import ConfigError
from olp.core.schema import Positive, Table, Text, Triple
from olp.core.schema_keys import Field
from olp.core.units import MM_PER_UM, RAD_PER_URAD, UM_PER_MM
from olp.files.measurements.instruments.base import Instrument, Plan, SeenFile, points_to_fill, tools_of
from olp.files.measurements.point_readings import AngleKeys, conventional, directions, read_point_readings
from olp.files.toml_text import toml_lines


class BaselineTable(Table):
    between: tuple[Annotated[int, Field(ge=1)], Annotated[int, Field(ge=1)]] = Field(
        description="the numbers of two pods, such as [1, 2]"
    )
    length_mm: Positive = Field(description="the distance between their centres, in mm")
    sigma_um: Positive = Field(description="its standard uncertainty, in um")


class PodsTable(AngleKeys):
    file: Text = Field(
        description="the path of a CSV file with columns X_mm, Y_mm, Z_mm (axis positions) and "
        "azimuth_1_deg, elevation_1_deg, azimuth_2_deg ..., relative to this file"
    )
    pods: Annotated[int, Field(ge=1)] = Field(default=2, description="the number of pods; 2 if left out")
    sigma_urad: Positive = Field(description="the standard uncertainty of an angle, in urad")
    baselines: list[BaselineTable] = Field(
        default=[],
        description="tables [[pods.baselines]]: known distances; without one the scale is not observable",
    )
    tool_mm: Triple | None = Field(
        default=None,
        description="the vector from the gauge point to the reflector, [X, Y, Z] in mm; or columns "
        "tool_X_mm, tool_Y_mm, tool_Z_mm of the file",
    )


class PodFiles(Instrument[PodsTable, Pods]):
    key = "pods"
    table = PodsTable
    marks = directions(1)
    asks = ("sigma_urad", "azimuth", "vertical", "tool_mm")
    words = "tables [[pods]]: directions from unknown positions"
    gives = Pods
    plans = True

    def proposed(self, seen: SeenFile) -> dict[str, object] | None:
        own = super().proposed(seen)
        return None if own is None else {"pods": sum(name.startswith("azimuth_") for name in seen.header)}

    def read(self, table: PodsTable, plan: Plan) -> Pods:
        readings = read_point_readings(plan.beside(table.file), directions(table.pods))
        angles = np.radians(readings.measured)
        wrong = [b.between for b in table.baselines if max(b.between) > table.pods or len(set(b.between)) < 2]
        if wrong:
            raise ConfigError(
                f"baselines between {list(wrong[0])}; expected two of the pods 1 to {table.pods}"
            )
        azimuth, elevation = conventional(table, angles[:, 0::2], angles[:, 1::2])
        return Pods(
            axis_mm=readings.axis_mm,
            tool_mm=tools_of(readings, table.tool_mm, plan.defaults),
            azimuth_rad=azimuth,
            elevation_rad=elevation,
            sigma=table.sigma_urad * RAD_PER_URAD,
            baselines=tuple(
                (b.between[0] - 1, b.between[1] - 1, b.length_mm, b.sigma_um * MM_PER_UM)
                for b in table.baselines
            ),
            source=readings.file,
        )

    def asked(self, taken: Pods, name: str) -> list[str]:
        sigma_urad = round(taken.sigma / RAD_PER_URAD, 4)
        i, j, length, sigma = taken.baselines[0]
        return [
            "[[pods]]",
            *toml_lines({"file": name, "pods": taken.count, "sigma_urad": sigma_urad}),
            "[[pods.baselines]]  # replace by the measured length; this one is planned",
            *toml_lines({"between": [i + 1, j + 1], "length_mm": round(length, 1),
                         "sigma_um": round(sigma * UM_PER_MM, 3)}),
        ]  # fmt: skip

    def empty(self, taken: Pods, rows: Index) -> bytes:
        return points_to_fill(taken, rows, directions(taken.count))
