"""A good set of files loads into the values that it states, and what we write loads as what it was."""

from __future__ import annotations

import datetime
import shutil
import tomllib
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from olp.core.errors import UsageError
from olp.core.machine import (
    CHAINS,
    COMPONENTS,
    SQUARENESS,
    Axis,
    ControlTimes,
    Job,
    Machine,
    Mesh,
    Setup,
    Tool,
    WorkOffset,
)
from olp.files.config import load_calibration, load_job, load_machine, load_setup
from olp.files.described import described
from olp.files.fields import CONTROLLERS, SHIPPED
from olp.files.starter import machine_toml, starter_machine, starter_set, write_starter
from olp.files.tables import parse_curves
from olp.files.toml_text import key_lines, read_toml, toml_value
from olp.program.registry import DIALECTS

GOOD = Path(__file__).parents[1] / "broken" / "good"
TRAVEL = {"X": (-5.0, 300.0), "Y": (0.0, 200.0), "Z": (-120.5, 0.0)}


def test_machine_file_fills_every_value() -> None:
    assert load_machine(GOOD / "machine.toml") == Machine(
        name="gantry-2",
        file=str(GOOD / "machine.toml"),
        chain="FXYZ",
        controller="linuxcnc",
        axes={
            "X": Axis((0.0, 2000.0), 0.001, 500.0, 2000.0, 20000.0),
            "Y": Axis((0.0, 1000.0), 0.001, 400.0, 1500.0, 15000.0),
            "Z": Axis((-600.0, 0.0), 0.0005, 200.0, 1000.0, 10000.0),
        },
        calibration=str(GOOD / "calibration.toml"),
        compensated_by_controller=frozenset({"EXX", "C0Y"}),
        work_offsets={
            "G54": WorkOffset("G54", (100.0, 0.0, -300.0), touched_at_mm=(100.0, 5.0, None), touch_tool=2),
            "G59.1": WorkOffset("G59.1", (0.0, 50.0, 0.0), (0.0, 0.0, 1.5), set_by="true"),
        },
        tools={
            1: Tool(1, (0.0, 0.0, 120.0), 5.0, gauge_to_tip_mm=(0.0, 0.0, -121.0)),
            2: Tool(2, (1.0, 0.0, 80.0), set_by="touch", touched_at_mm=(10.0, 20.0, -400.0)),
        },
        default_tool=1,
        default_work_offset="G54",
        length_active=True,
        blend_mm=0.005,
    )


def test_job_file_fills_every_value() -> None:
    assert load_job(GOOD / "job.toml") == Job(
        program=str(GOOD / "parts" / "part.nc"),
        machine=str(GOOD / "machine.toml"),
        start_mm=(0.0, None, -10.0),
        payload_kg=12.5,
        temperatures_degC={"X_scale": 21.4, "workpiece": 22.0},
        work_offsets={"G54": WorkOffset("G54", (101.0, 0.0, 0.0), touch_tool=7)},
        tools={7: Tool(7, (0.0, 0.0, 121.2))},
        meshes=(Mesh(str(GOOD / "fixture.stl"), "fixture", "G54"),),
    )


def test_setup_takes_the_machine_of_the_job_and_the_job_wins() -> None:
    setup = load_setup(job_path=GOOD / "job.toml")
    assert setup == Setup(load_machine(GOOD / "machine.toml"), load_job(GOOD / "job.toml"))
    offset, tool = setup.work_offset("G54"), setup.tool(1)
    assert offset is not None and offset.offset_mm == (101.0, 0.0, 0.0)
    assert tool is not None and tool.radius_mm == 5.0


def test_machine_on_the_command_line_wins_over_the_job(tmp_path: Path) -> None:
    other = (GOOD / "machine.toml").read_text().replace("gantry-2", "other")
    (tmp_path / "other.toml").write_text(other)
    assert load_setup(tmp_path / "other.toml", GOOD / "job.toml").machine.name == "other"


def test_setup_without_any_machine_is_a_wrong_call() -> None:
    with pytest.raises(UsageError, match="name the machine file with -m"):
        load_setup()


def test_calibration_file_fills_every_value_in_base_units() -> None:
    machine = load_machine(GOOD / "machine.toml")
    job = load_job(GOOD / "job.toml")
    calibration = load_calibration(GOOD / "calibration.toml", machine, job.temperatures_degC)
    assert calibration.machine == "gantry-2"
    assert calibration.model == "rigid-body"
    assert calibration.measured == datetime.date(2026, 5, 14)
    assert calibration.valid_until == datetime.date(2027, 5, 14)
    assert calibration.temperature_degC == 21.0
    assert calibration.active_during_measurement == {"EZZ"}
    assert calibration.datum_mm == (10.0, 0.0, -5.0)
    np.testing.assert_array_equal(calibration.box_mm, [[0, 2000], [0, 1000], [-600, 0]])
    assert calibration.squareness == pytest.approx({"C0Y": 20.1e-6, "B0Z": 0.0, "A0Z": 12e-6}, rel=1e-12)
    assert calibration.backlash_mm == pytest.approx((0.0, 0.004, 0.0), rel=1e-12)
    exx, eay = calibration.cyclic
    assert (exx.component, exx.period_mm, exx.phase_rad) == ("EXX", 10.0, 0.3)
    assert exx.amplitude == pytest.approx(1.5e-3, rel=1e-12)
    assert (eay.component, eay.period_mm, eay.phase_rad) == ("EAY", 5.0, 0.0)
    assert eay.amplitude == pytest.approx(2e-6, rel=1e-12)


def test_curves_keep_their_directions_lines_and_units() -> None:
    x, y = load_calibration(GOOD / "calibration.toml").curves
    assert (x.axis, x.interpolation, x.reference) == ("X", "linear", "functional-point")
    assert x.line_mm == (10.0, 400.0, -5.0), "axes that line_mm leaves out are at the datum"
    assert x.tool_mm == (0.0, 0.0, -60.0)
    np.testing.assert_array_equal(x.position_mm, [0.0, 1000.0, 2000.0])
    np.testing.assert_allclose(x.forward["EXX"], [0.0, 0.006, 0.010], rtol=1e-12)
    np.testing.assert_allclose(x.backward["EXX"], [0.002, 0.008, 0.014], rtol=1e-12)
    np.testing.assert_allclose(x.backward["EBX"], [1e-6, 2e-6, 3e-6], rtol=1e-12)
    assert (y.axis, y.interpolation, y.reference) == ("Y", "pchip", "table")
    np.testing.assert_allclose(y.columns["EYY"], [0.0, -0.002, 0.003], rtol=1e-12)


def test_thermal_takes_temperatures_of_the_job_and_defaults_to_no_difference() -> None:
    with_job = load_calibration(
        GOOD / "calibration.toml", temperatures_degC={"X_scale": 25.0, "workpiece": 26.0}
    )
    without = load_calibration(GOOD / "calibration.toml")
    assert with_job.thermal is not None and without.thermal is not None
    assert with_job.thermal.scale_per_K == pytest.approx((11.5e-6, 0.0, 0.0), rel=1e-12)
    assert with_job.thermal.workpiece_per_K == pytest.approx(12e-6, rel=1e-12)
    assert with_job.thermal.fixed_at_mm == (1.0, 2.0, 3.0)
    assert with_job.thermal.clamped_at_mm == (0.0, 4.0, 0.0)
    assert with_job.thermal.scale_degC == (25.0, 21.0, 21.0)
    assert with_job.thermal.workpiece_degC == 26.0
    assert without.thermal.scale_degC == (21.0, 21.0, 21.0), "a scale is at the calibration's temperature"
    assert without.thermal.workpiece_degC == 20.0


def test_table_without_direction_is_the_mean_and_sigma_is_kept() -> None:
    rows = ["# by laser", "X_mm, EXX_um ,sigma_EXX_um", "", "-1.5,2,0.5", "  # pause", "1e1,-3.5,0.25", ""]
    table = parse_curves(b"\xef\xbb\xbf" + "\r\n".join(rows).encode(), "x.csv")
    assert table.forward is None and table.backward is None
    np.testing.assert_array_equal(table.position_mm, [-1.5, 10.0])
    np.testing.assert_allclose(table.columns["EXX"], [0.002, -0.0035], rtol=1e-12)
    np.testing.assert_allclose(table.sigma["EXX"], [0.0005, 0.00025], rtol=1e-12)


def test_columns_of_a_table_with_directions_are_their_mean() -> None:
    table = parse_curves(b"X_mm,direction,EXX_um\n0,-1,4\n0,+1,2\n5,1,6\n5,-1,-2\n", "x.csv")
    np.testing.assert_array_equal(table.position_mm, [0.0, 5.0])
    np.testing.assert_allclose(table.columns["EXX"], [0.003, 0.002], rtol=1e-12)
    assert table.forward is not None
    np.testing.assert_allclose(table.forward["EXX"], [0.002, 0.006], rtol=1e-12)


@pytest.mark.parametrize(
    "cell", ["0.1", "-12.305", "+7", ".5", "5.", "1e-1", "2.5E3", "-0.0", "1234567.890123456789"]
)
def test_a_cell_is_the_double_of_its_digits_in_base_units(cell: str) -> None:
    table = parse_curves(
        f"X_mm,EXX_um,sigma_EXX_um,EBX_urad\n0,{cell},0.3,{cell}\n5,0,1e0,0\n".encode(), "x.csv"
    )
    written = Decimal(cell)
    assert table.columns["EXX"][0] == float(written.scaleb(-3))
    assert table.columns["EBX"][0] == float(written.scaleb(-6))
    assert table.sigma["EXX"].tolist() == [3e-4, 1e-3]


def test_a_text_is_parsed_once_and_each_reader_has_values_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    data, loads = b"a = [1, [2]]\n[b]\nc = 0.25 # once\n", tomllib.loads
    parsed: list[str] = []

    def counted(text: str) -> dict[str, Any]:
        parsed.append(text)
        return loads(text)

    monkeypatch.setattr(tomllib, "loads", counted)
    first: dict[str, Any] = read_toml(data, "a.toml")[0]
    first["b"].clear()
    first["a"][1].clear()
    assert read_toml(data, "b.toml")[0] == {"a": [1, [2]], "b": {"c": 0.25}}
    assert len(parsed) == 1


def test_toml_may_come_from_a_windows_editor(tmp_path: Path) -> None:
    shutil.copytree(GOOD, tmp_path, dirs_exist_ok=True)
    for path in (*tmp_path.glob("*.toml"), *tmp_path.glob("*.csv")):
        path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    assert load_setup(job_path=tmp_path / "job.toml").machine.name == "gantry-2"
    assert len(load_calibration(tmp_path / "calibration.toml").curves) == 2


def test_all_compensated_errors_stay_recognisable(tmp_path: Path) -> None:
    text = (GOOD / "machine.toml").read_text().replace('["EXX", "C0Y"]', '"all"')
    (tmp_path / "machine.toml").write_text(text)
    assert load_machine(tmp_path / "machine.toml").compensated_by_controller == {"all"}


def test_controllers_are_the_profiles_that_programs_are_read_with() -> None:
    assert set(CONTROLLERS) == set(DIALECTS)
    assert all(described(name) is not None for name in SHIPPED)


@pytest.mark.parametrize("chain", sorted(CHAINS))
def test_starter_set_loads_for_every_chain(chain: str, tmp_path: Path) -> None:
    machine = starter_machine("mill", chain, TRAVEL)
    paths = write_starter(tmp_path, machine)
    assert set(paths) == {path for path in tmp_path.rglob("*") if path.is_file()}
    setup = load_setup(job_path=tmp_path / "job.toml")
    assert setup.machine.chain == chain
    assert {name: axis.travel_mm for name, axis in setup.machine.axes.items()} == TRAVEL
    assert setup.machine.calibration is not None
    calibration = load_calibration(setup.machine.calibration, setup.machine)
    np.testing.assert_array_equal(calibration.box_mm, [TRAVEL[axis] for axis in "XYZ"])
    assert {name for curve in calibration.curves for name in curve.columns} == set(COMPONENTS)


@pytest.mark.parametrize(
    ("chain", "travel", "message"),
    [
        ("XYZ", TRAVEL, "not a chain"),
        ("FXYZ", TRAVEL | {"Y": (3.0, 3.0)}, "travel of Y"),
        ("FXYZ", {"X": (0.0, 1.0)}, "travel of Y"),
        ("FXYZ", TRAVEL | {"Z": (0.0, float("inf"))}, "travel of Z"),
    ],
)
def test_starter_machine_refuses_what_no_machine_is(
    chain: str, travel: dict[str, tuple[float, float]], message: str
) -> None:
    with pytest.raises(UsageError, match=message):
        starter_machine("mill", chain, travel)


def test_the_starter_offset_is_touched_off_at_the_middle_of_the_travel() -> None:
    machine = starter_machine("mill", "FXYZ", TRAVEL)
    middle = tuple(sum(TRAVEL[axis]) / 2 for axis in "XYZ")
    assert (machine.work_offsets["G54"].set_by, machine.work_offsets["G54"].offset_mm) == ("touch", middle)
    text = starter_set(machine)["machine.toml"]
    assert 'set_by = "touch"  # "true" if located by other means' in text
    assert "G54 is the middle of the travel" in text


def test_the_starter_calibration_says_what_happens_outside_the_box() -> None:
    text = starter_set(starter_machine("mill", "FXYZ", TRAVEL))["calibration.toml"]
    assert "is refused, or" in text
    assert "--outside-box hold" in text


def test_starter_machine_refuses_a_control_without_dialect() -> None:
    with pytest.raises(UsageError, match='"fadal" is not a dialect that olp knows; expected one of linuxcnc'):
        starter_machine("mill", "FXYZ", TRAVEL, "fadal")
    with pytest.raises(UsageError, match="did you mean grbl"):
        starter_machine("mill", "FXYZ", TRAVEL, "GRBL")


def test_untouched_starter_set_counts_as_expired() -> None:
    text = starter_set(starter_machine("mill", "FXYZ", TRAVEL))["calibration.toml"]
    values, _ = read_toml(text.encode(), "calibration.toml")
    assert values["valid_until"] == datetime.date(2000, 1, 1)


lengths = st.floats(-1e6, 1e6)
positive = st.floats(1e-9, 1e9)
vectors = st.tuples(lengths, lengths, lengths)
axes = st.builds(
    Axis,
    st.tuples(st.floats(-1e6, -1e-6), st.floats(0.0, 1e6)),
    *[positive] * 4,
    vectors,
)
touched_offsets = st.builds(
    WorkOffset,
    st.text(min_size=1).filter(lambda name: name[:1] not in "gG"),
    vectors,
    vectors,
    st.just("touch"),
    st.tuples(*[st.none() | lengths] * 3),
    st.none() | st.integers(0, 999),
)
tools = st.builds(
    Tool,
    number=st.integers(0, 9999),
    length_mm=vectors,
    radius_mm=st.none() | st.floats(0.0, 1e4),
    wear_mm=st.floats(-10.0, 10.0),
    gauge_to_tip_mm=st.none() | vectors,
)
touched_tools = st.builds(
    Tool, number=st.integers(0, 9999), length_mm=vectors, set_by=st.just("touch"), touched_at_mm=vectors
)
machines = st.builds(
    Machine,
    name=st.text(min_size=1),
    chain=st.sampled_from(sorted(CHAINS)),
    controller=st.sampled_from(CONTROLLERS),
    axes=st.fixed_dictionaries(dict.fromkeys("XYZ", axes)),
    compensated_by_controller=st.frozensets(st.sampled_from(COMPONENTS + SQUARENESS))
    | st.just(frozenset({"all"})),
    work_offsets=st.lists(touched_offsets, max_size=3).map(
        lambda offsets: {offset.name: offset for offset in offsets}
    ),
    tools=st.lists(tools | touched_tools, max_size=3).map(
        lambda drawn: {tool.number: tool for tool in drawn}
    ),
    default_tool=st.none() | st.integers(0, 99),
    default_work_offset=st.text(min_size=1),
    length_active=st.booleans(),
    path_mode=st.sampled_from(("blend", "exact-stop")),
    blend_mm=st.none() | positive,
    times=st.builds(
        ControlTimes,
        tool_change_s=st.none() | positive,
        spindle_start_s=st.none() | positive,
        m_codes_s=st.dictionaries(st.integers(7, 9999), positive, max_size=3),
    ),
)


@pytest.mark.slow
@given(machine=machines, note=st.text())
def test_a_written_machine_loads_as_it_was(
    machine: Machine, note: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.getbasetemp() / "written.toml"
    path.write_bytes(machine_toml(machine, [note]).encode())
    assert replace(load_machine(path), file=None) == machine


@given(text=st.text())
def test_any_text_survives_as_a_toml_value(text: str) -> None:
    assert read_toml(f"key = {toml_value(text)}\n".encode(), "t")[0] == {"key": text}


def test_key_lines_follow_tables_arrays_and_values_over_several_lines() -> None:
    text = '''a = 1
[t."x.y"] # note
b.c = [
  1, # [no]
]
d = """
e = 1
"""
f = "[z]"
[[r]]
g = { h = 1 }
[[r]]
[r.s]
g = 2
'''
    read_toml(text.encode(), "t")
    assert key_lines(text) == {
        ("a",): 1,
        ("t", "x.y"): 2,
        ("t", "x.y", "b"): 3,
        ("t", "x.y", "b", "c"): 3,
        ("t", "x.y", "d"): 6,
        ("t", "x.y", "f"): 9,
        ("r", 0): 10,
        ("r", 0, "g"): 11,
        ("r", 1): 12,
        ("r", 1, "s"): 13,
        ("r", 1, "s", "g"): 14,
    }


def test_golden_cases_of_the_contract_load(golden: Path) -> None:
    """Only those of three linear axes: `kinematics` holds chains that are not read yet."""
    for file in sorted(golden.glob("*/machine.toml")):
        setup = load_setup(file)
        assert setup.machine.calibration is not None
        assert len(load_calibration(setup.machine.calibration, setup.machine).curves) == 3


def test_a_compliance_of_one_number_is_the_lag_of_the_tool(tmp_path: Path) -> None:
    text = (Path(__file__).parents[1] / "broken" / "good" / "machine.toml").read_text()
    path = tmp_path / "machine.toml"
    one, three = ("[axes.X]\ncompliance_um_per_m_s2 = 2.5", "[axes.Y]\ncompliance_um_per_m_s2 = [0.5, -3, 1]")
    path.write_text(text.replace("[axes.X]", one).replace("[axes.Y]", three))
    stated = {name: axis.compliance_um_per_m_s2 for name, axis in load_machine(path).axes.items()}
    assert stated == {"X": (-2.5, 0.0, 0.0), "Y": (0.5, -3.0, 1.0), "Z": (0.0, 0.0, 0.0)}


def test_the_path_mode_of_a_machine(tmp_path: Path) -> None:
    text = (Path(__file__).parents[1] / "broken" / "good" / "machine.toml").read_text()
    path = tmp_path / "machine.toml"
    for old, new, want in (
        ("", "", ("blend", 0.005)),
        ('mode = "blend"', 'mode = "exact-stop"', ("exact-stop", 0.005)),
        ('[path]\nmode = "blend"\nblend_mm = 0.005', "", ("blend", None)),
    ):
        path.write_text(text.replace(old, new))
        assert (load_machine(path).path_mode, load_machine(path).blend_mm) == want
