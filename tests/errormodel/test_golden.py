"""The golden cases of the contract: six machines from an independent model, and cases worked by hand."""

from __future__ import annotations

import csv
import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from olp.core.machine import Vector
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve, Cyclic, Thermal
from olp.errormodel.reversal import play_states

GOLDEN = Path(__file__).parents[1] / "golden"
CASES = sorted(path.parent.name for path in GOLDEN.glob("*/expected.json"))
BOX = np.array([[0.0, 1000.0], [0.0, 1000.0], [0.0, 1000.0]])
ZERO_TOOL = np.zeros(3)


def read_curve(folder: Path, entry: dict[str, object], datum: Vector) -> Curve:
    with (folder / str(entry["file"])).open() as file:
        rows = list(csv.DictReader(file))
    first, *names = rows[0]
    scale = {"um": 1e-3, "urad": 1e-6}
    columns = {
        name.split("_")[0]: np.array([float(r[name]) for r in rows]) * scale[name.split("_")[1]]
        for name in names
    }
    line = entry.get("line_mm", {})
    assert isinstance(line, dict)
    return Curve(
        axis=first[0],
        position_mm=np.array([float(r[first]) for r in rows]),
        columns=columns,
        line_mm=tuple(line.get(a, d) for a, d in zip("XYZ", datum, strict=True)),
        tool_mm=tuple(entry.get("tool_mm", (0.0, 0.0, 0.0))),
        reference=entry.get("reference", "functional-point"),
        interpolation=entry["interpolation"],
    )


def read(folder: Path) -> tuple[Calibration, str]:
    data = tomllib.loads((folder / "calibration.toml").read_text())
    chain = tomllib.loads((folder / "machine.toml").read_text())["chain"]
    datum = tuple(data["datum_mm"])
    calibration = Calibration(
        machine=data["machine"],
        box_mm=np.array(data["box_mm"]),
        model=data["model"],
        datum_mm=datum,
        curves=tuple(read_curve(folder, entry, datum) for entry in data["curves"]),
        squareness={name[:3]: value * 1e-6 for name, value in data["squareness"].items()},
        cyclic=tuple(
            Cyclic(c["component"], c["period_mm"], c["amplitude_um"] * 1e-3, c["phase_rad"])
            for c in data.get("cyclic", [])
        ),
    )
    return calibration, chain


@pytest.mark.parametrize("case", CASES)
def test_agrees_with_the_independent_model(case: str) -> None:
    calibration, chain = read(GOLDEN / case)
    expected = json.loads((GOLDEN / case / "expected.json").read_text())
    points = expected["points"]
    axis = np.array([p["axis_mm"] for p in points])
    tool = np.array([p["tool_mm"] for p in points])
    error_um = build(calibration, chain).error(axis, tool) * 1e3
    np.testing.assert_allclose(
        error_um, [p["error_um"] for p in points], atol=expected["tolerance_um"], rtol=0
    )


def test_all_golden_folders_are_found() -> None:
    assert len(CASES) == 6


@pytest.mark.parametrize("tool", [(0.0, 0.0, 0.0), (0.0, 0.0, -300.0)])
def test_squareness_counts_from_the_datum_and_does_not_turn_the_tool(tool: Vector) -> None:
    calibration = Calibration("m", BOX, datum_mm=(0.0, 1000.0, 0.0), squareness={"C0Y": 20e-6})
    error = build(calibration, "FXYZ").error(np.array([[0.0, 1000.0, 0.0], [0.0, 0.0, 0.0]]), np.array(tool))
    np.testing.assert_allclose(error * 1e3, [[0.0, 0.0, 0.0], [20.0, 0.0, 0.0]], atol=1e-12)


@pytest.mark.parametrize(("reference", "dx"), [("table", -4.3), ("functional-point", -1.3)])
def test_yaw_of_a_moving_table_by_where_the_reflector_stood(reference: str, dx: float) -> None:
    """A constant ECY of 10 urad on YFXZ, P = (400, 300, 200), t = (0, 130, -243.5)."""
    yaw = Curve("Y", [0.0, 1000.0], {"ECY": [10e-6, 10e-6]}, reference=reference)
    model = build(Calibration("m", BOX, curves=(yaw,)), "YFXZ")
    error = model.error(np.array([[400.0, 300.0, 200.0]]), np.array([0.0, 130.0, -243.5]))
    np.testing.assert_allclose(error * 1e3, [[dx, 4.0, 0.0]], atol=1e-4)


def test_backlash_follows_the_play() -> None:
    """b = 6 um, commands 0, 10, 10.002, 9.999, 9.9, 9.9005, 12 from unknown."""
    commands = np.zeros((7, 3))
    commands[:, 0] = [0.0, 10.0, 10.002, 9.999, 9.9, 9.9005, 12.0]
    model = build(Calibration("m", BOX, backlash_mm=(6e-3, 0.0, 0.0)), "FXYZ")
    lost = model.backlash_at(commands)
    play = play_states(commands, lost)
    error_um = model.error(commands, ZERO_TOOL, play)[:, 0] * 1e3
    np.testing.assert_allclose(error_um, [0.0, -3.0, -3.0, 0.0, 3.0, 2.5, -3.0], atol=1e-9)


def test_scale_and_workpiece_expansion() -> None:
    """30 ppm measured at 22 degC, scale 11.5 and workpiece 12 um/(m K), both at 25 degC: +4.5 um at 1 m."""
    scale = Curve("X", [0.0, 1000.0], {"EXX": [0.0, 0.030]}, interpolation="linear")
    thermal = Thermal(
        scale_per_K=(11.5e-6, 0.0, 0.0),
        workpiece_per_K=12e-6,
        calibrated_at_degC=22.0,
        scale_degC=(25.0, 22.0, 22.0),
        workpiece_degC=25.0,
    )
    model = build(Calibration("m", BOX, curves=(scale,), thermal=thermal, temperature_degC=22.0), "FXYZ")
    error = model.error(np.array([[1000.0, 0.0, 0.0]]), ZERO_TOOL)
    np.testing.assert_allclose(error * 1e3, [[4.5, 0.0, 0.0]], atol=1e-9)


def test_scales_grow_from_where_they_are_fixed_and_parts_from_where_they_are_clamped() -> None:
    """Scales 10 um/(m K) and 2 K warmer, fixed at 400; a part of 12 um/(m K) and 5 K, clamped at -100."""
    thermal = Thermal(
        scale_per_K=(10e-6, 0.0, 0.0), fixed_at_mm=(400.0, 0.0, 0.0), scale_degC=(22.0, 20.0, 20.0),
        workpiece_per_K=12e-6, clamped_at_mm=(-100.0, 0.0, 50.0), workpiece_degC=25.0,
    )  # fmt: skip
    error = build(Calibration("m", BOX, thermal=thermal), "FXYZ").error(
        np.array([[400.0, 0.0, 50.0], [-100.0, 0.0, -50.0], [900.0, 100.0, 50.0]]), ZERO_TOOL
    )
    np.testing.assert_allclose(
        error * 1e3, [[-30.0, 0.0, 0.0], [-10.0, 0.0, 6.0], [10.0 - 60.0, -6.0, 0.0]], atol=1e-9
    )


def test_a_warm_part_grows_from_places_of_the_part_and_scales_from_axis_positions() -> None:
    """The tip of tools of 120 and 20 mm at one place: the part of 23 um/(m K) and 10 K has one error there;
    the scale of Z, of 8 um/(m K) and 2 K, has 16 um/m more of the longer tool."""
    part = Thermal(workpiece_per_K=23e-6, clamped_at_mm=(0.0, 0.0, 40.0), workpiece_degC=30.0)
    scale = Thermal(scale_per_K=(0.0, 0.0, 8e-6), scale_degC=(20.0, 20.0, 22.0))
    place = np.array([100.0, 50.0, -60.0])
    tools = np.array([[0.0, 0.0, -120.0], [3.0, -2.0, -20.0]])
    grown = build(Calibration("m", BOX, thermal=part), "FXYZ").error(place - tools, tools)
    np.testing.assert_allclose(grown * 1e3, [[-23.0, -11.5, 23.0]] * 2, atol=1e-9)
    grown = build(Calibration("m", BOX, thermal=scale), "FXYZ").error(place - tools, tools)
    np.testing.assert_allclose(grown[0] - grown[1], [0.0, 0.0, 1.6e-3], atol=1e-15)
