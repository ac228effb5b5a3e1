"""Directions from pods or theodolites: tables [[pods]]."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from olp.calibration.observations.pods import Pods
from olp.core.arrays import Array, Index, Mask
from olp.core.errors import ConfigError
from olp.core.schema import Positive, Table, Text, Triple
from olp.core.schema_keys import Field
from olp.core.units import MM_PER_UM, RAD_PER_URAD, UM_PER_MM
from olp.files.measurements.instruments.base import Instrument, Plan, SeenFile, points_to_fill, tools_of
from olp.files.measurements.point_readings import (
    AngleKeys,
    conventional,
    directions,
    in_second_face,
    read_point_readings,
)
from olp.files.problems import Problem, config_error
from olp.files.toml_text import toml_lines

#: Problems with faces that are listed, at most.
_MOST = 8


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
    sigma_urad: Positive = Field(description="the standard uncertainty of an angle in one face, in urad")
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
        tool = np.broadcast_to(tools_of(readings, table.tool_mm, plan.defaults), readings.axis_mm.shape)
        sigma = table.sigma_urad * RAD_PER_URAD
        second = in_second_face(table, angles[:, 1::2])
        rows = np.arange(len(tool))
        if (second.any(axis=0) & ~second.all(axis=0)).any():
            rows, other = _pairs(np.hstack([readings.axis_mm, tool]), second, readings.row, readings.file)
            turn = np.remainder(azimuth[other] - azimuth[rows] + np.pi, 2.0 * np.pi) - np.pi
            azimuth = azimuth[rows] + 0.5 * turn
            elevation = 0.5 * (elevation[rows] + elevation[other])
            sigma /= np.sqrt(2.0)
        return Pods(
            axis_mm=readings.axis_mm[rows],
            tool_mm=tool[rows],
            azimuth_rad=azimuth,
            elevation_rad=elevation,
            sigma=float(sigma),
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


def _pairs(place: Array, second: Mask, line: Index, file: str) -> tuple[Index, Index]:
    """Rows in the first face and those of the same points in the second one: only their means are free of the
    errors of the circles. Raises ConfigError where a point has one face only, or the faces of pods differ."""
    mixed = np.flatnonzero(second.any(axis=1) & ~second.all(axis=1))
    words = "its pods were read in different faces; expected one face in each row"
    problems: list[Problem] = [(int(line[k]), words) for k in mixed]
    first: list[int] = []
    other: list[int] = []
    points = np.unique(place, axis=0, return_inverse=True)[1].reshape(-1)
    for point in np.unique(points):
        one, two = (np.flatnonzero((points == point) & (second[:, 0] == face)) for face in (False, True))
        if len(one) != len(two):
            words = "the point lacks a reading in the other face; expected both faces at every point, or one"
            problems.append((int(line[np.r_[one, two][0]]), words))
        first += one[: len(two)].tolist()
        other += two[: len(one)].tolist()
    if problems:
        raise config_error(problems[:_MOST], file)
    return np.array(first), np.array(other)
