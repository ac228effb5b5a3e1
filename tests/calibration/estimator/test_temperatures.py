"""Lines that were read over a shift beside sensors: geometry and its change per K from one adjustment."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from olp.calibration.observations.lines import Line, noise_of
from olp.calibration.observations.measurements import Measurements
from olp.core.errors import ConfigError
from olp.errormodel.build import build
from olp.files.measurements.reader import load_measurements
from olp.workflows.calibrate_fit import FittedCalibration, fit_calibration

#: Axis positions of the box; the tool that the lines were read with.
LOW, HIGH, TOOL = 0.0, 1000.0, (0.0, 0.0, -120.0)
#: What 1 K of the beam does, by component: offset, growth over 1 m, bow; um or urad.
PLANTED = {"EXX": (4.0, 11.0, -2.0), "EBX": (1.0, 6.0, 3.0)}
#: Temperatures of the passes over the shift, from and to.
PASSES = ((20.0, 20.5), (22.0, 22.4), (24.4, 24.0))


def geometry(component: str, q: np.ndarray) -> np.ndarray:
    """Smooth curves, zero at 0, in mm or rad."""
    u = q / HIGH
    return 1e-3 * (8.0 * u + 5.0 * (np.sin(4.0 * u))) if component == "EXX" else 1e-5 * np.sin(3.0 * u)


def of_kelvin(component: str, q: np.ndarray, rise: np.ndarray) -> np.ndarray:
    offset, growth, bow = PLANTED[component]
    u = (q - 0.5 * (LOW + HIGH)) / 500.0
    unit = 1e-3 if component == "EXX" else 1e-6
    return unit * rise * (offset + growth * 0.5 * u + bow * (1.0 - u**2))


def line(component: str, span: tuple[float, float], seed: int) -> Line:
    """Two runs of 13 targets, while the beam warms: EXX on the line through the datum."""
    rng = np.random.default_rng([seed, len(component), int(10 * span[0])])
    one = np.linspace(LOW, HIGH, 13)
    q = np.tile(np.concatenate([one, one[::-1]]), 2)
    side = np.tile(np.repeat((1, -1), 13), 2)
    beam = np.linspace(*span, len(q)) + 0.05 * np.sin(np.arange(len(q)))
    sigma = 5e-4 if component == "EXX" else 5e-7
    value = geometry(component, q) + of_kelvin(component, q, beam - 22.0) + rng.normal(0.0, sigma, len(q))
    return Line(
        component, q, value + 0.02, np.repeat((1, 2), 26), side, (0.0, 400.0, -200.0), TOOL, sigma=sigma,
        source=f"{component.lower()}-{span[0]:g}.csv", sensors_degC={"beam": beam},
    )  # fmt: skip


def taken(seed: int = 1) -> Measurements:
    lines = [line(name, span, seed) for name in PLANTED for span in PASSES]
    others = [
        dataclasses.replace(
            line("EXX", (22.0, 22.1), seed + k), component=name, source=f"{name.lower()}.csv", sensors_degC={}
        )
        for k, name in enumerate(("EYY", "EZZ"))
    ]
    return Measurements("gantry", (*lines, *others), chain="FXYZ")


@cache
def fitted() -> FittedCalibration:
    return fit_calibration(taken())


def rows() -> Mapping[str, dict[str, float]]:
    report = fitted().report
    return {row["name"]: row for kind in ("lengths", "angles") for row in report[f"per_kelvin_of_{kind}"]}


@pytest.mark.slow
def test_what_a_kelvin_does_is_found_within_its_uncertainty() -> None:
    for name, wanted in PLANTED.items():
        row = rows()[f"{name} by beam"]
        unit = "um" if name == "EXX" else "urad"
        for kind, value, most in zip(("growth_{}_m_K", "bow_{}_K"), wanted[1:], (0.5, 0.4), strict=True):
            key = kind.format(unit)
            assert abs(row[key] - value) < 3.0 * row[f"sigma_{key}"] < 3.0 * most, (name, key, row)


@pytest.mark.slow
def test_the_curves_hold_at_the_mean_temperature_and_the_structure_leads_to_others() -> None:
    calibration = fitted().calibration
    structure = calibration.structure
    assert structure is not None
    (sensor,) = structure.sensors
    assert sensor.reference_degC == pytest.approx(22.2, abs=0.11)
    assert sensor.range_degC[0] < 20.05 and sensor.range_degC[1] > 24.35
    q = np.linspace(LOW, HIGH, 21)
    position = np.stack([q, np.full(21, 400.0), np.full(21, -200.0)], axis=1)
    for degC in (20.0, 24.4):
        model = build(dataclasses.replace(calibration, structure=structure.at({"beam": degC})), "FXYZ")
        found = model.error(position, np.array(TOOL))[:, 0]
        true = geometry("EXX", q) + of_kelvin("EXX", q, np.full(21, degC - 22.0))
        off = (found - found.mean()) - (true - true.mean())
        assert np.abs(off).max() < 1.5e-3, degC


@pytest.mark.slow
def test_without_the_sensors_the_same_lines_contradict_each_other() -> None:
    """What sensors explain is drift and noise without them: the curve is then far less certain."""
    bare = [dataclasses.replace(one, sensors_degC={}) for one in taken().lines]
    without = fit_calibration(dataclasses.replace(taken(), observations=tuple(bare)))
    sigma = [one.report["position_errors"][0]["sigma_um"] for one in (without, fitted())]
    assert without.calibration.structure is None
    assert "sensors" not in without.report
    assert sigma[1] < 0.5 * sigma[0]


def test_what_temperatures_do_is_neither_noise_nor_an_outlier() -> None:
    warm = line("EXX", (20.0, 24.0), 3)
    assert warm.screened().noise is not None and not warm.screened().outliers
    assert noise_of(warm).sigma < 7e-4
    assert noise_of(dataclasses.replace(warm, sensors_degC={}, sigma=0.0)).sigma > 1.5e-3


def test_a_reading_that_slipped_beside_sensors_is_left_out() -> None:
    warm = line("EXX", (20.0, 24.0), 3)
    runs = dataclasses.replace(
        warm, target_mm=np.tile(warm.target_mm, 2), value=np.tile(warm.value, 2),
        direction=np.tile(warm.direction, 2), run=np.repeat((1, 2, 3, 4), 26), row=np.arange(104),
        sensors_degC={"beam": np.tile(warm.sensors_degC["beam"], 2)},
    )  # fmt: skip
    value = runs.value.copy()
    value[40] += 0.03
    left = dataclasses.replace(runs, value=value).screened()
    assert [slip.row for slip in left.outliers] == [40]
    assert isinstance(left.observation, Line) and len(left.observation.sensors_degC["beam"]) == 103


def test_sensors_that_tell_nothing_or_differ_are_refused() -> None:
    one = line("EXX", (20.0, 20.05), 1)
    still = dataclasses.replace(one, sensors_degC={"beam": np.full(52, 20.0)})
    with pytest.raises(ConfigError, match="sensor beam changes by 0 K over all lines"):
        fit_calibration(dataclasses.replace(taken(), observations=(still, *taken().observations[-2:])))
    other = dataclasses.replace(one, source="b.csv", sensors_degC={"bed": np.linspace(20.0, 22.0, 52)})
    with pytest.raises(ConfigError, match=r"it has the sensors bed, and exx-20\.csv has beam"):
        fit_calibration(dataclasses.replace(taken(), observations=(*taken().observations, other)))
    with pytest.raises(ConfigError, match="sensor beam has no temperature at each reading"):
        dataclasses.replace(one, sensors_degC={"beam": np.zeros(3)})


def described(component: str, places: str, sensors: str, cells: str) -> str:
    unit = "urad" if component[1] in "ABC" else "um"
    keys = {
        "component": f'"{component}"', "sense": '"actual-minus-commanded"', "machine": '"gantry"',
        "measured": "2026-05-14", "temperature_degC": "20.0", "line_mm": places,
        "tool_mm": "[0.0, 0.0, -120.0]", f"sigma_{unit}": "0.5",
    }  # fmt: skip
    text = "".join(f"# {key} = {value}\n" for key, value in keys.items())
    return f"{text}target_mm,run,direction,value_{unit}{sensors}\n0,1,1,0.0{cells}\n100,1,1,1.0{cells}\n"


def test_columns_of_sensors_are_read_and_judged(tmp_path: Path) -> None:
    file = tmp_path / "line.csv"
    both = "{ X = 0.0, Y = 400.0, Z = -200.0 }"
    file.write_text(described("EXX", both, ",beam_degC,bed_degC", ",21.5,20.25"))
    (one,) = load_measurements([file]).lines
    assert {name: own.tolist() for name, own in one.sensors_degC.items()} == {
        "beam": [21.5, 21.5], "bed": [20.25, 20.25],
    }  # fmt: skip
    for component, sensors, cells, words in (
        ("EXX", ",beam_degC", ",294.6", "beam_degC = 294.6; expected -50 to 150"),
        ("EXX", ",beam_degC", ",", "beam_degC is empty; leave the row out"),
        ("EXX", ",beam_degF", ",70", "beam_degF"),
        ("EBX", ",beam_degC", ",21", "line_mm.Z is missing; expected the position, because axes at rest"),
    ):
        places = both if component == "EXX" else "{ Y = 400.0 }"
        file.write_text(described(component, places, sensors, cells))
        with pytest.raises(ConfigError, match=words):
            load_measurements([file])
