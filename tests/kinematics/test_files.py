"""Files of machines of any joints: what they mean, what is refused, and what `olp inspect` shows."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import olp
from olp.cli import main
from olp.files.kinematics.load import is_of_joints, load_joint_setup

MACHINE = """schema = "olp-machine-1"
name = "t"
chain = "C F X Y Z B"
controller = "linuxcnc"
calibration = "calibration.toml"
[axes.X]
travel_mm = [-300, 300]
least_increment_mm = 0.001
[axes.Y]
travel_mm = [-300, 300]
least_increment_mm = 0.001
[axes.Z]
travel_mm = [-300, 300]
least_increment_mm = 0.001
[axes.B]
kind = "rotary"
direction = [0, 1, 0]
point_mm = [0, 0, 220]
travel_deg = [-110, 110]
least_increment_deg = 0.001
[axes.C]
kind = "rotary"
direction = [0, 0, -2]
point_mm = [100, 0, -300]
travel_deg = [-360, 360]
least_increment_deg = 0.001
[tools.1]
gauge_to_tip_mm = [0, 0, -160]
[tools.2]
Z_mm = -5.0
[job_defaults]
tool = 1
"""
CALIBRATION = """schema = "olp-calibration-1"
machine = "t"
measured = 2026-11-01
temperature_degC = 20.0
sign = "actual-minus-commanded"
model = "rigid-body"
datum_mm = [0, 0, 0]
[box]
X_mm = [-300, 300]
Y_mm = [-300, 300]
Z_mm = [-300, 300]
B_deg = [-110, 110]
C_deg = [-360, 360]
"""
CURVE = '[[curves]]\nfile = "c.csv"\n'


def written(folder: Path, machine: str = MACHINE, calibration: str = CALIBRATION, csv: str = "") -> Path:
    (folder / "machine.toml").write_text(machine)
    (folder / "calibration.toml").write_text(calibration)
    if csv:
        (folder / "c.csv").write_text(csv)
    return folder / "machine.toml"


def test_a_direction_becomes_a_unit_vector_and_the_tool_is_symmetric(tmp_path: Path) -> None:
    structure = load_joint_setup(written(tmp_path)).machine.structure
    assert structure.joints["C"].direction == (0.0, 0.0, -1.0)
    assert structure.joints["X"].direction == (1.0, 0.0, 0.0)
    assert structure.symmetric_tool
    assert structure.workpiece_side == {"C"}


def test_a_periodic_curve_goes_round(tmp_path: Path) -> None:
    curve = "C_deg,EXC_um,ECC_urad\n-180,1,2\n0,5,-3\n180,1,2\n"
    path = written(tmp_path, calibration=f"{CALIBRATION}{CURVE}periodic = true\n", csv=curve)
    machine = olp.load_kinematics(path)
    shifts, turns = machine.deviation(machine.structure.axis_values({"C": [10.0, 370.0, -350.0]}))
    assert np.ptp(shifts, axis=0) == pytest.approx(0.0, abs=1e-12)
    assert np.ptp(turns, axis=0) == pytest.approx(0.0, abs=1e-12)
    assert abs(turns[0, 2]) > 1e-6


WRONG_MACHINES = [
    ("direction = [0, 1, 0]\n", "", "has a table B that states no direction"),
    ("point_mm = [0, 0, 220]\n", "", "point_mm"),
    ("direction = [0, 1, 0]", "direction = [0, 0, 0]", "no direction"),
    ("travel_deg = [-110, 110]", "travel_mm = [-110, 110]", "expected travel_deg"),
    ('"C F X Y Z B"', '"C F X Y Z"', "axes.B is in neither the chain nor a leg"),
    ('"C F X Y Z B"', '"C X Y Z B"', 'names the frame "F" 0 times'),
    ('kind = "rotary"\ndirection = [0, 1, 0]', "direction = [0, 1, 0]", "states no kind"),
    ("tool = 1", "tool = 7", "not defined"),
    ('controller = "linuxcnc"', 'controller = "linuxcnc"\ncompensated_by_controller = ["EXX"]', r"\[\]"),
    ("least_increment_mm = 0.001", "least_increment_mm = 0.001\ncoupled = { B = 1.0 }", "coupled"),
]


@pytest.mark.parametrize(("old", "new", "words"), WRONG_MACHINES)
def test_a_wrong_machine_file_is_refused(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert old in MACHINE
    with pytest.raises(olp.ConfigError, match=words):
        olp.load_kinematics(written(tmp_path, MACHINE.replace(old, new, 1)))


WRONG_CALIBRATIONS = [
    ("[location.C]\nZ_um = 1.0\n", "along or about the axis itself"),
    ("[location.C]\nzero_um = 1.0\n", "expected zero_urad"),
    ("[location.X]\nY_um = 1.0\n", "shifts the line of a linear axis"),
    ("[location.W]\nY_um = 1.0\n", "no axis"),
    ("[location.Y]\nC_urad = 1.0\n[squareness]\nC0Y_urad = 1.0\n", "are one"),
    ('[[cyclic]]\ncomponent = "ECC"\nperiod_mm = 2.0\namplitude_urad = 1.0\n', "expected period_deg"),
    ('[[cyclic]]\ncomponent = "EWC"\nperiod_deg = 2.0\namplitude_urad = 1.0\n', "cyclic"),
    ("[backlash]\nC_um = 2.0\n", "expected one of X_um"),
    ("[elasticity.C]\nown_um_kN = 1.0\n", "expected own_urad_Nm"),
    ('[[masses]]\non = "W"\nkg = 1.0\ncentre_mm = [0, 0, 0]\n', "no axis"),
    ('[[legs]]\nplatform = "P"\nleg = 1\n', "does not have"),
    ("[thermal]\nX_scale_um_m_K = 11.5\n", "does not support it"),
    (CURVE, "c.csv"),
]


@pytest.mark.parametrize("names", ["", '"ECC"'])
def test_a_calibration_says_that_the_control_corrected_nothing(tmp_path: Path, names: str) -> None:
    line = f"active_during_measurement = [{names}]\n"
    folder = written(tmp_path, calibration=CALIBRATION.replace("[box]", line + "[box]"))
    if not names:
        olp.load_kinematics(folder)
        return
    with pytest.raises(olp.ConfigError, match=r"active_during_measurement names .* expected \[\]"):
        olp.load_kinematics(folder)


@pytest.mark.parametrize(("more", "words"), WRONG_CALIBRATIONS)
def test_a_wrong_calibration_is_refused(tmp_path: Path, more: str, words: str) -> None:
    with pytest.raises(olp.ConfigError, match=words):
        olp.load_kinematics(written(tmp_path, calibration=CALIBRATION + more))


WRONG_CURVES = [
    ("C_mm,EXC_um\n0,1\n1,2\n", "expected one of X_mm"),
    ("C_deg,EXB_um\n0,1\n1,2\n", "expected E, a direction"),
    ("C_deg,EXC_urad\n0,1\n1,2\n", "EXC_um"),
    ("C_deg,EXC_um\n1,1\n0,2\n", "ascending"),
    ("C_deg,EXC_um\n1,1\n", "at least 2"),
    ("C_deg\n1\n2\n", "no error column"),
    ("C_deg,ECC_urad,ECC_urad\n1,1,1\n2,1,1\n", "repeats"),
    ("B_deg,EBB_urad,EBB_um\n1,1,1\n2,1,1\n", "EBB_urad"),
]


@pytest.mark.parametrize(("text", "words"), WRONG_CURVES)
def test_a_wrong_curve_is_refused(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(olp.ConfigError, match=words):
        olp.load_kinematics(written(tmp_path, calibration=CALIBRATION + CURVE, csv=text))


def test_the_own_turn_against_a_direction_of_the_machine_is_refused(tmp_path: Path) -> None:
    """C turns about -Z here; of an axis with another name the sense would be a guess."""
    machine = MACHINE.replace("[axes.C]", "[axes.D]").replace('"C F', '"D F')
    calibration = CALIBRATION.replace("C_deg", "D_deg") + CURVE
    with pytest.raises(olp.ConfigError, match="expected EDD"):
        olp.load_kinematics(written(tmp_path, machine, calibration, "D_deg,ECD_urad\n0,1\n9,2\n"))


def test_three_linear_axes_are_no_machine_of_joints(tmp_path: Path) -> None:
    plain = MACHINE[: MACHINE.index("[axes.B]")].replace("C F X Y Z B", "FXYZ")
    assert not is_of_joints(written(tmp_path, plain))
    with pytest.raises(olp.ConfigError, match="three linear axes"):
        olp.load_kinematics(tmp_path / "machine.toml")
    assert olp.load_setup(tmp_path / "machine.toml").machine.chain == "FXYZ"


def test_programs_for_such_a_machine_are_refused(tmp_path: Path) -> None:
    with pytest.raises(olp.ProgramError, match="three linear axes") as caught:
        olp.correct(b"G1 X1\n", written(tmp_path))
    assert (caught.value.code, caught.value.line, caught.value.exit_code) == ("OLP563", 3, 3)


def test_the_payload_of_a_job_counts(tmp_path: Path) -> None:
    gives = "[elasticity.B]\nown_urad_Nm = 2.0\n"
    path = written(tmp_path, calibration=CALIBRATION + gives)
    job = tmp_path / "job.toml"
    job.write_text('schema = "olp-job-1"\npayload_kg = 3.0\npayload_centre_mm = [100.0, 0.0, -80.0]\n')
    machine = olp.load_kinematics(path, job)
    values = machine.structure.axis_values({})
    assert machine.deviation(values)[1][0] == pytest.approx([0, 2e-6 * 3.0 * 9.80665 * 0.1, 0], rel=1e-6)
    assert not np.any(olp.load_kinematics(path).deviation(values)[1])
    with pytest.raises(olp.ConfigError, match="touch-off"):
        olp.load_kinematics(path, tool=2)
    with pytest.raises(olp.ConfigError, match="tool 9"):
        olp.load_kinematics(path, tool=9)


def shown(*words: str) -> str:
    result = CliRunner().invoke(main, ["inspect", *words])
    assert result.exit_code == 0, result.output
    return result.output


def test_inspect_says_what_each_axis_does(tmp_path: Path) -> None:
    text = shown(str(written(tmp_path)))
    assert "turns about -Z" in text
    values = json.loads(shown(str(tmp_path / "machine.toml"), "--json"))
    assert values["axes"]["C"]["carries"] == "workpiece"
    assert values["axes"]["B"]["tool"] == "turns about +Y"
    assert values["machine"]["chain"] == "C F X Y Z B"


def test_inspect_shows_pose_and_error(tmp_path: Path) -> None:
    path = written(tmp_path, calibration=CALIBRATION + "[location.B]\nX_um = 10.0\n")
    values = json.loads(shown(str(path), "--axes", "B=90", "--axes", "X=400", "--json"))
    assert values["position_mm"] == pytest.approx([20.0, 0.0, 220.0])
    assert values["error_um"] == pytest.approx([10.0, 0.0, 10.0])
    assert values["beyond_travel"] == ["X"]


@pytest.mark.parametrize(
    "words", [("--axes", "B"), ("--axes", "W=1"), ("--at", "1", "2", "3"), ("--tool", "1")]
)
def test_inspect_refuses_what_does_not_fit(tmp_path: Path, words: tuple[str, ...]) -> None:
    result = CliRunner().invoke(main, ["inspect", str(written(tmp_path)), *words])
    assert result.exit_code == 2, result.output
