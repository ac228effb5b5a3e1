"""Angles as theodolites write them: both faces, degrees with minutes and seconds, tabs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from olp.calibration.observations.pods import Pods
from olp.core.errors import ConfigError
from olp.files.measurements.instruments.base import Plan
from olp.files.measurements.instruments.pods import PodFiles, PodsTable
from olp.files.measurements.line_keys import LineKeys
from olp.files.measurements.point_readings import parse_point_readings

RNG = np.random.default_rng(5)
COUNT = 7
AXIS = RNG.uniform(0.0, 900.0, (COUNT, 3))
AZIMUTH = RNG.uniform(-3.1, 3.1, (COUNT, 2))
ELEVATION = RNG.uniform(-0.9, 0.9, (COUNT, 2))
#: errors of the circles, which the mean of both faces does not have, in rad
COLLIMATION, INDEX = 40e-6, 70e-6
HEADER = "X_mm,Y_mm,Z_mm,azimuth_1_deg,elevation_1_deg,azimuth_2_deg,elevation_2_deg"


def row(point: int, faces: tuple[int, int]) -> str:
    cells = [f"{q:.4f}" for q in AXIS[point]]
    for pod, face in enumerate(faces):
        hz, v = -AZIMUTH[point, pod], 0.5 * np.pi - ELEVATION[point, pod]
        if face == 2:
            hz, v = hz + np.pi - COLLIMATION, 2.0 * np.pi - v
        else:
            hz += COLLIMATION
        cells += [f"{np.degrees(hz) % 360.0:.9f}", f"{np.degrees(v + INDEX):.9f}"]
    return ",".join(cells)


def read(folder: Path, rows: list[str]) -> Pods:
    (folder / "theo.csv").write_text("\n".join([HEADER, *rows]) + "\n")
    table = PodsTable(
        file="theo.csv", sigma_urad=4.0, azimuth="clockwise", vertical="zenith", tool_mm=(0.0, 0.0, -100.0)
    )
    return PodFiles().read(table, Plan(folder / "measurements.toml", LineKeys()))


def apart(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.abs(np.remainder(one - other + np.pi, 2.0 * np.pi) - np.pi).max())


def test_the_mean_of_both_faces_is_free_of_the_errors_of_the_circles(tmp_path: Path) -> None:
    rows = [row(k, (face, face)) for face in (1, 2) for k in range(COUNT)]
    pods = read(tmp_path, rows)
    order = [int(np.abs(AXIS - q).sum(axis=1).argmin()) for q in pods.axis_mm]
    assert sorted(order) == list(range(COUNT))
    assert apart(pods.azimuth_rad, AZIMUTH[order]) < 1e-9
    assert apart(pods.elevation_rad, ELEVATION[order]) < 1e-9
    assert pods.sigma == pytest.approx(4e-6 / np.sqrt(2.0))


def test_one_face_alone_is_as_read(tmp_path: Path) -> None:
    pods = read(tmp_path, [row(k, (2, 2)) for k in range(COUNT)])
    assert apart(pods.azimuth_rad, AZIMUTH + COLLIMATION) < 1e-9
    assert apart(pods.elevation_rad, ELEVATION + INDEX) < 1e-9
    assert pods.sigma == pytest.approx(4e-6)


@pytest.mark.parametrize(
    ("more", "words"),
    [([(0, (2, 2))], "line 3: the point lacks"), ([(0, (1, 2))], "line 9: its pods were read in different")],
)
def test_faces_that_do_not_pair_are_refused(
    tmp_path: Path, more: list[tuple[int, tuple[int, int]]], words: str
) -> None:
    rows = [row(k, (1, 1)) for k in range(COUNT)] + [row(*one) for one in more]
    with pytest.raises(ConfigError) as caught:
        read(tmp_path, rows)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("cell", "degrees"),
    [
        ("95 20 24.9", 95.340250), ("95°20'24.9\"", 95.340250), ("95-20-24.9", 95.340250),
        ("-0 30 00", -0.5), ("95 60 00", None), ("95.2024", None), ("95 20", None),
    ],
)  # fmt: skip
def test_degrees_minutes_and_seconds(cell: str, degrees: float | None) -> None:
    text = f"X_mm\tY_mm\tZ_mm\tazimuth_1_dms\televation_1_dms\n1\t2\t3\t{cell}\t10 00 00\n"
    names = ("azimuth_1_deg", "elevation_1_deg")
    if degrees is None:
        with pytest.raises(ConfigError, match="expected a number in degrees, minutes and seconds"):
            parse_point_readings(text.encode(), "theo.csv", names)
    else:
        readings = parse_point_readings(text.encode(), "theo.csv", names)
        assert readings.measured[0].tolist() == pytest.approx([degrees, 10.0])
