"""First machine files: of each structure, from Denavit-Hartenberg rows, and from HAL files of LinuxCNC."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from judge import kinematics as judge
from kinematics.cases import golden, random_values

import olp
from olp.cli import main
from olp.files.kinematics.hal import MODULES
from olp.files.kinematics.load import load_joint_setup
from olp.files.kinematics.structures import STRUCTURES
from olp.kinematics.chain import Kinematics
from olp.kinematics.inverse import inverse

#: Denavit-Hartenberg rows of the PUMA 560 of the golden case.
PUMA = "a_mm,alpha_deg,d_mm,theta0_deg\n0,0,0,0\n0,-90,0,0\n300,0,70,0\n50,-90,400,0\n0,90,0,0\n0,-90,60,0\n"
#: mm, and deg of its angles: as near as LinuxCNC's modules are.
AGREES = 1e-6


def run(*words: str | Path) -> tuple[int, str]:
    result = CliRunner().invoke(main, [str(word) for word in words])
    return result.exit_code, result.output


@pytest.mark.parametrize("name", STRUCTURES)
def test_each_structure_becomes_a_machine_that_moves(name: str, tmp_path: Path) -> None:
    code, said = run("init", tmp_path / "m", "--structure", name)
    assert (code, "those of an example" in said) == (0, True)
    setup = load_joint_setup(tmp_path / "m" / "machine.toml")
    values = random_values(setup, 5)
    pose = setup.kinematics.nominal(values)
    again = inverse(setup.kinematics, pose, values + 0.01, nominal=True).values
    assert np.abs(setup.kinematics.nominal(again).position - pose.position).max() < 1e-8
    assert np.ptp(pose.position, axis=0).max() > 1.0
    code, text = run("inspect", tmp_path / "m" / "machine.toml")
    assert code == 0
    assert all(f"  {axis}  " in text for axis in setup.machine.structure.order)


#: Structures with the dimensions of a golden case: its axes have the same lines.
SAME = [
    ("trunnion-ac", "xyzac_trunnion"), ("head-table", "xyzbc_head_table"), ("gantry-wrist", "gantry_wrist"),
    ("nutating-head", "gantry_nutating"), ("polar", "polar_rppr"), ("scara", "scara"),
    ("arm-6", "arm_6r_kr6"), ("arm-7-track", "arm_7r_on_track"),
    ("linear-delta", "linear_delta"), ("tripod", "tripod"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "case"), SAME)
def test_structures_are_those_of_the_golden_cases(name: str, case: str, tmp_path: Path) -> None:
    theirs = golden(case)[0].machine.structure
    assert run("init", tmp_path, "--structure", name)[0] == 0
    ours = load_joint_setup(tmp_path / "machine.toml").machine.structure
    assert (ours.chain, set(ours.order)) == (theirs.chain, set(theirs.order))
    values = random_values(golden(case)[0], 6)
    columns = [theirs.order.index(axis) for axis in ours.order]
    turned = Kinematics(ours).nominal(values[:, columns]).rotation
    unlike = np.abs(turned - Kinematics(theirs).nominal(values).rotation).max()
    assert unlike < 1e-9 or name == "head-table"  # the table of the golden case turns the other way


def test_rows_of_denavit_and_hartenberg_are_the_arm(tmp_path: Path) -> None:
    (tmp_path / "puma.csv").write_text(PUMA)
    assert run("init", tmp_path / "m", "--mdh", tmp_path / "puma.csv")[0] == 0
    machine = olp.load_kinematics(tmp_path / "m" / "machine.toml")
    values = np.radians([[10.0, -20.0, 30.0, 40.0, -50.0, 60.0]])
    pose = np.eye(4)
    for line, theta in zip(PUMA.splitlines()[1:], values[0], strict=True):
        a, alpha, d, _ = (float(cell) for cell in line.split(","))
        ca, sa = np.cos(np.radians(alpha)), np.sin(np.radians(alpha))
        ct, st = np.cos(theta), np.sin(theta)
        # Craig's matrix from a frame to the next one
        row = [[ct, -st, 0, a], [st * ca, ct * ca, -sa, -sa * d], [st * sa, ct * sa, ca, ca * d]]
        pose = pose @ np.array([*row, [0, 0, 0, 1]])
    ours = machine.nominal(np.degrees(values))
    assert np.abs(ours.position[0] - pose[:3, 3]).max() < 1e-9
    assert np.abs(ours.rotation[0] - pose[:3, :3]).max() < 1e-11


def test_theta_at_zero_turns_what_follows(tmp_path: Path) -> None:
    ends = "a_mm,alpha_deg,d_mm,theta0_deg,min_deg,max_deg\n0,0,100,90,-10,20\n300,0,0,0,-5,5\n"
    (tmp_path / "arm.csv").write_text(ends)
    assert run("init", tmp_path / "m", "--mdh", tmp_path / "arm.csv")[0] == 0
    structure = load_joint_setup(tmp_path / "m" / "machine.toml").machine.structure
    assert structure.joints["J2"].point_mm == pytest.approx((0.0, 300.0, 100.0))
    assert structure.joints["J1"].travel == (-10.0, 20.0)


TABLES = {"x-rot-point": 3.0, "y-rot-point": 4.0, "z-rot-point": -150.0, "z-offset": 5.0}
#: Pins of each module.
HAL = {
    "xyzac-trt-kins": {**TABLES, "y-offset": 7.0},
    "xyzbc-trt-kins": {**TABLES, "x-offset": 7.0},
    "5axiskins": {"pivot-length": 250.0},
    "pumakins": {"A2": 300.0, "A3": 50.0, "D3": 70.0, "D4": 400.0, "D6": 60.0},
    "genserkins": {
        **{f"A-{n}": a for n, a in enumerate((0.0, 0.0, 300.0, 50.0, 0.0, 0.0))},
        **{f"ALPHA-{n}": a for n, a in enumerate((0.0, -np.pi / 2, 0.1, -np.pi / 2, np.pi / 2, -np.pi / 2))},
        **{f"D-{n}": a for n, a in enumerate((0.0, 0.0, 70.0, 400.0, 0.0, 60.0))},
    },
    "scarakins": {"D1": 490.0, "D2": 340.0, "D3": 5.0, "D4": 250.0, "D5": 7.0, "D6": 50.0},
    "tripodkins": {"Bx": 900.0, "Cx": 430.0, "Cy": 780.0},
    "lineardeltakins": {"R": 250.0, "L": 520.0},
    "rotarydeltakins": {
        "platformradius": 200.0, "thighlength": 300.0, "shinlength": 500.0, "footradius": 80.0,
    },
}  # fmt: skip
#: Where each module is asked: the middle of the axis values and half their range.
ASKED = {"tripodkins": (950.0, 150.0), "lineardeltakins": (500.0, 100.0), "rotarydeltakins": (0.0, 40.0)}


def hal_of(module: str, pins: dict[str, float]) -> str:
    lines = [f"setp {module}.{pin} {value!r}  # a comment" for pin, value in pins.items()]
    return "\n".join(["loadrt motmod", f"loadrt {module}", "setp other.pin 3", *lines])


@pytest.mark.oracle
@pytest.mark.parametrize("module", HAL)
def test_hal_files_become_the_machine_of_linuxcnc(module: str, tmp_path: Path) -> None:
    pins = {pin: float(value) for pin, value in HAL[module].items()}
    (tmp_path / "m.hal").write_text(hal_of(module, pins))
    code, said = run("init", tmp_path / "m", "--trafo", tmp_path / "m.hal")
    assert code == 0, said
    machine = olp.load_kinematics(tmp_path / "m" / "machine.toml")
    middle, half = ASKED.get(module, (0.0, 80.0))
    values = np.random.default_rng(0).uniform(
        middle - half, middle + half, (20, len(machine.structure.order))
    )
    theirs = judge.forward(module, pins, values)
    assert np.abs(machine.nominal(values).position - theirs[:, :3]).max() < AGREES


@pytest.mark.oracle
def test_a_hexapod_of_hal_is_that_of_linuxcnc(tmp_path: Path) -> None:
    legs = golden("hexapod")[0].machine.structure.platforms["P"].legs
    pins: dict[str, float] = {"screw-lead": 0.0}
    for number, leg in enumerate(legs):
        for k, part in enumerate("xyz"):
            pins[f"base.{number}.{part}"] = leg.base_mm[k]
            pins[f"platform.{number}.{part}"] = leg.platform_mm[k]
    (tmp_path / "m.hal").write_text(hal_of("genhexkins", pins))
    assert run("init", tmp_path / "m", "--trafo", tmp_path / "m.hal")[0] == 0
    machine = olp.load_kinematics(tmp_path / "m" / "machine.toml")
    poses = np.array([[10.0, -20.0, 700.0, 1.0, -2.0, 3.0], [0.0, 30.0, 720.0, -3.0, 2.0, 1.0]])
    lengths = judge.inverse("genhexkins", pins, poses, 6)
    assert np.abs(machine.nominal(lengths).position - poses[:, :3]).max() < AGREES


REFUSED = [
    ("m.hal", "loadrt motmod\n", "loads none of them"),
    ("m.hal", "loadrt pumakins\nloadrt scarakins\n", "loads 2 of them (pumakins, scarakins)"),
    ("m.hal", "loadrt 5axiskins\n", "sets no 5axiskins.pivot-length"),
    ("m.hal", "setp 5axiskins.pivot-length [KINS]PIVOT\n", "expected a number"),
    ("m.hal", "loadrt genhexkins\nsetp genhexkins.screw-lead 2\n", "screw-lead"),
    ("m.hal", "loadrt xyzac-trt-kins\nsetp xyzac-trt-kins.conventional-directions 1\n", "which is not read"),
    ("m.hal", "loadrt xyzac-trt-kins\nnet :y  table.y => xyzac-trt-kins.y-offset\n", "follows the signal :y"),
    ("m.hal", "[KINS]\nKINEMATICS = pumakins\n[TRAJ]\nLINEAR_UNITS = inch\n", "LINEAR_UNITS = inch"),
    ("m.hal", "[KINS]\nKINEMATICS = pumakins\n[HAL]\nHALFILE = more.tcl\n", "runs more.tcl"),
    ("m.hal", "[KINS]\nKINEMATICS = pumakins\n[HAL]\nHALFILE = more.hal\n", "no such file"),
    (
        "m.hal",
        "[KINS]\nKINEMATICS = 5axiskins\n[HAL]\nHALCMD = setp 5axiskins.pivot-length [A]P\n",
        "does not state",
    ),
    ("m.csv", "a_mm,alpha_deg,d_mm\n0,0,0\n", "the column theta0_deg is missing"),
    ("m.csv", "a_mm,alpha_deg,d_mm,theta0_deg\n0,x,0,0\n", 'alpha_deg = "x"'),
    ("m.csv", "a_mm,alpha_deg,d_mm,theta0_deg\n", "holds no joints"),
    ("m.csv", "a_mm,alpha_deg,d_mm,theta0_deg,min_deg,max_deg\n0,0,0,0,5,-5\n", "is not below max_deg"),
]


@pytest.mark.parametrize(("file", "text", "words"), REFUSED)
def test_what_is_refused(file: str, text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / file).write_text(text)
    option = "--trafo" if file.endswith("hal") else "--mdh"
    code, said = run("init", tmp_path / "m", option, tmp_path / file)
    assert code == 3
    assert words in said
    assert not (tmp_path / "m").exists()


def test_an_ini_file_becomes_the_machine_of_its_hal_files(tmp_path: Path) -> None:
    """The same numbers by setp in one HAL file, and as configurations of LinuxCNC have them: by signals, by
    names of the INI file, and in another file."""
    (tmp_path / "one.hal").write_text(
        "loadrt xyzac-trt-kins\nsetp xyzac-trt-kins.y-offset 20\nsetp xyzac-trt-kins.z-offset 10\n"
        "setp xyzac-trt-kins.x-rot-point -3.5\n"
    )
    (tmp_path / "more.hal").write_text(
        "# geometry\nsetp xyzac-trt-kins.x-rot-point [TABLE]X_ROT  # beside\nsets :z 10\n"
    )
    (tmp_path / "mill.ini").write_text(
        "[KINS]\n  KINEMATICS = xyzac-trt-kins sparm=identityfirst\n JOINTS = 5\n[TABLE]\nX_ROT = -3.5 ; mm\n"
        "[HAL]\nHALFILE = LIB:basic_sim.tcl\n#HALFILE = none.hal\nHALFILE = more.hal\n"
        "HALCMD = net :y xyzac-trt-kins.y-offset gui.y\nHALCMD = net :z gui.z => xyzac-trt-kins.z-offset\n"
        "HALCMD = net :tool motion.tooloffset.z xyzac-trt-kins.tool-offset\nHALCMD = sets :y 20\n"
        "[TRAJ]\nLINEAR_UNITS = mm\n"
    )
    made = []
    for file in ("one.hal", "mill.ini"):
        code, said = run("init", tmp_path / "mill", "--trafo", tmp_path / file, "--force")
        assert code == 0, said
        made.append((tmp_path / "mill" / "machine.toml").read_text())
    assert made[0] == made[1] and "point_mm = [-3.5, 20.0, 10.0]" in made[0]


def test_one_description_is_wanted(tmp_path: Path) -> None:
    assert "did you mean hexapod" in run("init", tmp_path / "m", "--structure", "hexapode")[1]
    code, said = run("init", tmp_path / "m", "--structure", "scara", "--mdh", "a.csv")
    assert (code, "expected one of them" in said) == (2, True)
    assert run("init", tmp_path / "m", "--structure", "scara", "--travel", "X", "0", "9")[0] == 2
    assert run("init", tmp_path / "m", "--structure", "scara", "--tip", "l3")[0] == 2


def test_every_module_is_judged() -> None:
    assert {*HAL, "genhexkins"} == MODULES.keys()
