"""A LinuxCNC configuration becomes a machine file that loads, in mm, with notes on what it does not state."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from olp.core.errors import InputError
from olp.core.machine import Axis, Machine, Tool, WorkOffset
from olp.files.config import load_machine
from olp.files.machine_settings.registry import read_settings
from olp.files.starter import machine_toml, starter_machine

INI = """# a mill with two motors at Y
[EMC]
MACHINE = Big Mill
[KINS]
KINEMATICS = trivkins coordinates=XYYZ
[TRAJ]
COORDINATES = X Y Y Z
LINEAR_UNITS = inch
MAX_LINEAR_VELOCITY = 3.0
[RS274NGC]
PARAMETER_FILE = mill.var
[EMCIO]
TOOL_TABLE = mill.tbl
[AXIS_X]
MIN_LIMIT = -10.0
MAX_LIMIT = 10
MAX_VELOCITY = 2
MAX_ACCELERATION = 20.0
[AXIS_Y]
MIN_LIMIT = 0
MAX_LIMIT = 8.0
MAX_VELOCITY = 5
MAX_ACCELERATION = 20.0
[AXIS_Z]
#INCLUDE z.inc
[JOINT_0]
MIN_LIMIT = -9.5
MAX_LIMIT = 10.5
MAX_VELOCITY = 2.5
COMP_FILE = x.comp
BACKLASH = 0.001
[JOINT_1]
MAX_VELOCITY = 4
[JOINT_2]
BACKLASH = 0.002
MAX_ACCELERATION = 15.0
[JOINT_3]
BACKLASH = 0.000
"""
TOOLS = """T1 P1 Z+2.5 D0.25 ; quarter inch
T2 P2 X.1 Z-3.0 D-0.5 Q2
; nothing
T1 P3 Z2.0
"""
VARIABLES = """5211\t1.0
5210\t1.0
5220\t2.0
5221\t1.000000
5222\t-2.0
5223\t3e-1
5230\t15.0
5241\t0.5
5381\t4.0
5390\t-30.0
"""


@dataclass(frozen=True)
class Imported:
    """The machine that a configuration describes, and the notes on it."""

    machine: Machine
    notes: tuple[str, ...]


def from_linuxcnc(ini: Path, chain: str = "FXYZ") -> Imported:
    read = read_settings(ini)
    travel = {axis: stated.travel_mm for axis, stated in read.axes.items() if stated.travel_mm}
    machine = starter_machine(read.name, chain, travel, read.controller, settings=read)
    # init names a calibration
    return Imported(replace(machine, calibration=None), read.notes)


def write_set(folder: Path, ini: str = INI) -> Path:
    (folder / "mill.ini").write_text(ini)
    (folder / "z.inc").write_text(
        "MIN_LIMIT = -5\nMAX_LIMIT = 0\nMAX_VELOCITY = 1\nMAX_ACCELERATION = 10\nMAX_JERK = 100\n"
    )
    (folder / "mill.tbl").write_text(TOOLS)
    (folder / "mill.var").write_text(VARIABLES)
    return folder / "mill.ini"


def test_limits_are_the_tightest_of_axis_joints_and_trajectory_in_mm(tmp_path: Path) -> None:
    machine = from_linuxcnc(write_set(tmp_path)).machine
    assert (machine.name, machine.controller, machine.chain) == ("Big Mill", "linuxcnc", "FXYZ")
    x, y, z = (machine.axes[axis] for axis in "XYZ")
    assert x.travel_mm == pytest.approx((-9.5 * 25.4, 254.0))
    assert (x.velocity_mm_s, x.acceleration_mm_s2) == pytest.approx((50.8, 508.0))
    assert x.jerk_mm_s3 is None
    assert y.travel_mm == pytest.approx((0.0, 203.2))
    assert (y.velocity_mm_s, y.acceleration_mm_s2) == pytest.approx((76.2, 381.0))
    assert z.travel_mm == pytest.approx((-127.0, 0.0))
    assert (z.velocity_mm_s, z.jerk_mm_s3) == pytest.approx((25.4, 2540.0))


def test_tool_table_and_offsets_come_in_mm(tmp_path: Path) -> None:
    machine = from_linuxcnc(write_set(tmp_path)).machine
    assert machine.tools[1].length_mm == pytest.approx((0.0, 0.0, 50.8)), "the last row of a tool counts"
    assert machine.tools[2].length_mm == pytest.approx((2.54, 0.0, -76.2))
    # a negative diameter offsets to the other side, and the cutter has its size all the same
    assert machine.tools[2].radius_mm == pytest.approx(6.35)
    assert machine.tools[2].wear_mm == pytest.approx(-12.7)
    assert machine.tools[2].tool_vector_mm is None
    assert list(machine.work_offsets) == ["G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"]
    assert machine.work_offsets["G54"].offset_mm == pytest.approx((25.4, -50.8, 7.62))
    assert machine.work_offsets["G54"].rotation_deg == (0.0, 0.0, 15.0)
    assert machine.work_offsets["G55"].offset_mm == pytest.approx((12.7, 0.0, 0.0))
    assert machine.work_offsets["G59.3"].offset_mm == pytest.approx((101.6, 0.0, 0.0))
    assert machine.work_offsets["G59.3"].rotation_deg == (0.0, 0.0, -30.0)
    assert machine.default_work_offset == "G55"


def test_compensation_of_the_control_is_listed_or_noted(tmp_path: Path) -> None:
    imported = from_linuxcnc(write_set(tmp_path), chain="YFXZ")
    assert imported.machine.compensated_by_controller == {"EXX"}
    notes = " ".join(imported.notes)
    assert imported.machine.chain == "YFXZ"
    assert "[JOINT_0] COMP_FILE = x.comp corrects EXX" in notes
    assert "[JOINT_2] BACKLASH = 0.0508 mm" in notes
    assert "JOINT_3" not in notes, "a backlash of zero is none"
    assert "[JOINT_0] BACKLASH" not in notes, "a table replaces the constant backlash"
    assert "G92 offset is active" in notes
    assert "Tools 2 have a negative Z" in notes
    assert "Tool 1 is defined twice" in notes
    assert "states no jerk of X, Y:" in notes


def test_the_written_file_loads_as_the_imported_machine(tmp_path: Path) -> None:
    imported = from_linuxcnc(write_set(tmp_path))
    text = machine_toml(imported.machine, imported.notes)
    (tmp_path / "machine.toml").write_text(text)
    assert replace(load_machine(tmp_path / "machine.toml"), file=None) == imported.machine
    for note in imported.notes:
        assert note in " ".join(line.removeprefix("# ") for line in text.splitlines())


def test_a_small_metric_configuration_of_the_old_kind_gets_defaults(tmp_path: Path) -> None:
    limits = "MIN_LIMIT = 0\nMAX_LIMIT = 100\nMAX_VELOCITY = 20\nMAX_ACCELERATION = 200\n"
    text = "[TRAJ]\nLINEAR_UNITS = 1.0\n" + "".join(f"[AXIS_{n}]\n{limits}" for n in range(3))
    (tmp_path / "old.ini").write_text(text)
    imported = from_linuxcnc(tmp_path / "old.ini")
    axis = Axis((0.0, 100.0), 0.0001, 20.0, 200.0)
    assert imported.machine.axes == {"X": axis, "Y": axis, "Z": axis}
    assert imported.machine.name == "old"
    assert list(imported.machine.tools) == [1], "one tool is put there"
    assert imported.machine.work_offsets == {"G54": WorkOffset("G54", offset_mm=(50.0, 50.0, 50.0))}
    assert "TOOL_TABLE is not given" in " ".join(imported.notes)


def test_the_first_of_repeated_keys_counts(tmp_path: Path) -> None:
    ini = write_set(tmp_path, INI.replace("MACHINE = Big Mill", "MACHINE = Big Mill\nMACHINE = Other"))
    assert from_linuxcnc(ini).machine.name == "Big Mill"


def test_kinematics_between_axes_and_joints_leave_the_joints_out(tmp_path: Path) -> None:
    ini = write_set(tmp_path, INI.replace("trivkins coordinates=XYYZ", "5axiskins"))
    imported = from_linuxcnc(ini)
    assert imported.machine.compensated_by_controller == frozenset()
    assert imported.machine.axes["X"].travel_mm == pytest.approx((-254.0, 254.0))
    assert "KINEMATICS = 5axiskins: check" in " ".join(imported.notes)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("LINEAR_UNITS = inch", "", "LINEAR_UNITS is missing; expected mm or inch"),
        ("= inch", "= cubit", 'LINEAR_UNITS is "cubit"; expected mm or inch'),
        ("COORDINATES = X Y Y Z", "COORDINATES = X Z", "lacks Y; expected a machine with the linear axes"),
        ("MAX_LIMIT = 8.0", "MAX_LIMIT = -8.0", r"axis Y has no travel; expected .* \[AXIS_Y\]"),
        ("MAX_VELOCITY = 2\n", "MAX_VELOCITY = fast\n", r'\[AXIS_X\] MAX_VELOCITY = "fast" is not a number'),
        ("#INCLUDE z.inc", "#INCLUDE y.inc", r"y\.inc: no such file"),
        ("trivkins coordinates=XYYZ", "scarakins", "is no machine of three linear axes; .* --structure"),
    ],
)
def test_a_configuration_without_what_is_needed_is_refused(
    old: str, new: str, message: str, tmp_path: Path
) -> None:
    assert old in INI
    with pytest.raises(InputError, match=message) as caught:
        from_linuxcnc(write_set(tmp_path, INI.replace(old, new, 1)))
    assert caught.value.exit_code == 3


def test_a_configuration_is_recognised_whose_units_stand_in_an_included_file(tmp_path: Path) -> None:
    whole = from_linuxcnc(write_set(tmp_path, INI)).machine
    begin, end = INI.index("[TRAJ]"), INI.index("[RS274NGC]")
    (tmp_path / "trajectory.inc").write_text(INI[begin:end], "utf-8")
    path = write_set(tmp_path, f"#INCLUDE trajectory.inc\n{INI[:begin]}{INI[end:]}")
    assert from_linuxcnc(path).machine == whole


def test_a_configuration_of_nothing_but_includes_is_recognised(tmp_path: Path) -> None:
    whole = from_linuxcnc(write_set(tmp_path, INI)).machine
    (tmp_path / "all.inc").write_text(INI, "utf-8")
    assert from_linuxcnc(write_set(tmp_path, "[NOTES]\nsize = 7\n#INCLUDE all.inc\n")).machine == whole


def test_inches_leave_no_digits_of_their_conversion(tmp_path: Path) -> None:
    ini = write_set(tmp_path, INI.replace("MAX_LIMIT = 8.0", "MAX_LIMIT = 14.0"))
    text = machine_toml(from_linuxcnc(ini).machine)
    assert "355.6]" in text
    assert not re.search(r"\.\d{7}", text)


SAMPLES = [
    folder
    for folder in (
        Path("/usr/share/doc/linuxcnc/examples/sample-configs/sim/axis"),
        Path("/usr/share/linuxcnc/examples/sample-configs/sim/axis"),
        Path("/etc/linuxcnc/sample-configs/sim/axis"),
    )
    if (folder / "axis_mm.ini").is_file()
]


@pytest.mark.skipif(not SAMPLES, reason="needs the sample configurations of LinuxCNC")
@pytest.mark.parametrize("name", ["axis_mm.ini", "axis.ini", "gantry/gantry_mm.ini", "axis_9axis.ini"])
def test_real_sample_configurations_import_and_load(name: str, tmp_path: Path) -> None:
    if not (SAMPLES[0] / name).is_file():
        pytest.skip(f"this version of LinuxCNC has no {name}")
    imported = from_linuxcnc(SAMPLES[0] / name)
    (tmp_path / "machine.toml").write_text(machine_toml(imported.machine, imported.notes), encoding="utf-8")
    assert replace(load_machine(tmp_path / "machine.toml"), file=None) == imported.machine


@pytest.mark.skipif(not SAMPLES, reason="needs the sample configurations of LinuxCNC")
def test_a_real_sample_has_its_limits_and_tools() -> None:
    machine = from_linuxcnc(SAMPLES[0] / "axis_mm.ini").machine
    assert machine.axes["Z"] == Axis((-50.8, 101.6), 0.0001, 30.48, 508.0)
    assert machine.tools[1] == Tool(1, (0.0, 0.0, 0.511), 1.5)
