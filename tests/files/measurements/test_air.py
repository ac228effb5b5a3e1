"""Raw readings of a laser, with the air and the material as columns state them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from olp.core.errors import ConfigError
from olp.files.measurements.air import refractive_index
from olp.files.measurements.reader import load_measurements

ASSUMED = "laser_assumes = { air_degC = 20.0, pressure_hPa = 1013.25, humidity_percent = 50.0 }\n"
ZERO = "laser_zero_mm = 0.0\n"
AIR = "air_degC,pressure_hPa,humidity_percent"
MATERIAL = "expansion_um_m_K = 11.5\nmaterial_reference_degC = 20.0\n"


def value_um(
    folder: Path, columns: str, cells: str, keys: str, sense: str = "actual-minus-commanded",
    component: str = "EXX",
) -> np.ndarray:  # fmt: skip
    """The values that are taken of a line of 1 m on which the laser read its targets, without an error."""
    rows = [f"{q},1,{1},0.0{',' if cells else ''}{cells}" for q in (0, 500, 1000)]
    header = "target_mm,run,direction,value_um" + (f",{columns}" if columns else "")
    (folder / "exx.csv").write_text("\n".join([header, *rows]) + "\n", "utf-8")
    (folder / "measurements.toml").write_text(
        'schema = "olp-measurements-1"\nmachine = "m"\nmeasured = 2026-05-14\ntemperature_degC = 20.0\n'
        f'[[lines]]\nfile = "exx.csv"\ncomponent = "{component}"\nsense = "{sense}"\nsigma_um = 0.5\n'
        f"line_mm = {{ Y = 0, Z = 0 }}\ntool_mm = [0, 0, 0]\n{keys}",
        "utf-8",
    )
    (line,) = load_measurements([folder]).lines
    return np.asarray(line.value * 1e3)


def test_the_index_of_air_is_as_tables_give_it() -> None:
    """271.4e-6 at 20 degC, 1013.25 hPa and 50 %; -0.95e-6 a kelvin, +0.27e-6 a hPa, -0.09e-6 for 10 %."""
    here = float(refractive_index(20.0, 1013.25, 50.0)) - 1.0  # type: ignore[arg-type]
    assert here == pytest.approx(271.4e-6, abs=0.1e-6)
    for change, wanted in (
        ((1.0, 0.0, 0.0), -0.95e-6),
        ((0.0, 1.0, 0.0), 0.27e-6),
        ((0.0, 0.0, 10.0), -0.09e-6),
    ):
        other = np.add((20.0, 1013.25, 50.0), change)
        assert float(refractive_index(*other)) - 1.0 - here == pytest.approx(wanted, abs=0.015e-6)


@pytest.mark.parametrize("sense", ["actual-minus-commanded", "commanded-minus-actual"])
def test_thin_air_makes_readings_too_short(sense: str, tmp_path: Path) -> None:
    """In thinner air a wavelength is longer than the laser takes it for, so the axis went farther."""
    value = value_um(tmp_path, AIR, "20.0,913.25,50.0", ASSUMED + ZERO, sense)
    assert value[0] == 0.0 and value[2] == pytest.approx(2.0 * value[1])
    assert value[2] == pytest.approx(26.8, abs=0.2)
    assert value_um(tmp_path, AIR, "20.0,1013.25,50.0", ASSUMED + ZERO, sense)[2] == pytest.approx(0.0)
    middle = value_um(tmp_path, AIR, "20.0,913.25,50.0", ASSUMED + "laser_zero_mm = 500\n", sense)
    assert middle[1] == 0.0 and middle[0] == pytest.approx(-middle[2])


def test_a_warm_screw_is_reduced_to_its_reference(tmp_path: Path) -> None:
    """A laser that reads no error on a screw 2 K too warm: cold, the axis is 23 um short on a metre."""
    value = value_um(tmp_path, "material_degC", "22.0", ZERO + MATERIAL)
    assert value == pytest.approx([0.0, -11.5, -23.0])


@pytest.mark.parametrize(
    ("columns", "cells", "keys", "words"),
    [
        (AIR, "20,1000,50", ZERO, "laser_assumes is missing"),
        (AIR, "20,1000,50", ASSUMED, "laser_zero_mm is missing"),
        (AIR, "20,1000,50", ASSUMED + ZERO + MATERIAL, "has no column that needs it"),
        ("", "", ASSUMED + ZERO, "has no column that needs it"),
        (AIR, "20,100000,50", ASSUMED + ZERO, "pressure_hPa = 100000; expected 500 to 1200"),
        (AIR, "293,1000,50", ASSUMED + ZERO, "air_degC = 293; expected -10 to 60"),
        ("material_degC", "20", ZERO, "expansion_um_m_K is missing"),
        ("air_degC", "20", ASSUMED + ZERO, "pressure_hPa"),
    ],
)
def test_an_environment_that_is_not_whole_is_refused(
    columns: str, cells: str, keys: str, words: str, tmp_path: Path
) -> None:
    with pytest.raises(ConfigError) as refused:
        value_um(tmp_path, columns, cells, keys)
    assert words in str(refused.value)


def test_only_positioning_is_compensated(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="are for positioning, and EYX is not"):
        value_um(tmp_path, AIR, "20,1000,50", ASSUMED + ZERO, component="EYX")
