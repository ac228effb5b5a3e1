"""LinuxCNC itself with the generated component of a machine with rotary axes, or of an arm, runs programs
that were not corrected: its joints, through the judge's model of the machine, lead the tool along the
programmed path."""

from __future__ import annotations

import os
import shutil
import subprocess
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from cases.lockstep import CALIBRATION, MACHINE, off_path
from judge import controller
from judge.controller import Kinematics, Run
from judge.five_axis import Judge
from scipy.spatial.transform import Rotation

import olp
from olp.files.write import write_files

pytestmark = [pytest.mark.oracle, pytest.mark.slow]

#: of the judge, wherever it cuts: the tip, and the axis of the tool
PATH_UM, PATH_URAD = 0.2, 1.0
NAME = "fivekins"
#: away from C's singular posture, at A 0
PROGRAMS = {
    "axis words": ("", "G1 X30 Y10 A-40 C20\nG1 X-20 Y30 Z-15 A-70 C90\nG1 C130 Z5\nG1 A-35 C40 X0 Y0\n"),
    "tip": ("tip=1", "G1 X20 Y10 A-40 C20\nG1 X-10 Y25 Z12 A-55 C80\nG1 C110\nG1 A-35 C40 X0 Y0 Z3\n"),
}


#: By joint of an arm: the direction of its axis, and a point on it.
ARM = {
    "J1": ([0.0, 0.0, -1.0], [0.0, 0.0, 0.0]),
    "J2": ([0.0, 1.0, 0.0], [25.0, 0.0, 400.0]),
    "J3": ([0.0, 1.0, 0.0], [480.0, 0.0, 400.0]),
    "J4": ([-1.0, 0.0, 0.0], [480.0, 0.0, 435.0]),
    "J5": ([0.0, 1.0, 0.0], [900.0, 0.0, 435.0]),
    "J6": ([-1.0, 0.0, 0.0], [980.0, 0.0, 435.0]),
}
#: Where its tip is from the base at zero, and where it begins.
TOOL_MM, HOME_DEG = (1000.0, 0.0, 435.0), (10.0, -70.0, 80.0, 20.0, 40.0, -15.0)


def arm(folder: Path) -> Path:
    """The files of an arm with errors of its links, zeros and drives."""
    text = 'schema = "olp-machine-1"\nname = "arm"\nchain = "F J1 J2 J3 J4 J5 J6"\ncontroller = "linuxcnc"\n'
    text += 'calibration = "calibration.toml"\ncompensated_by_controller = []\n'
    for name, (direction, point) in ARM.items():
        text += f'[axes.{name}]\nkind = "rotary"\ndirection = {direction}\npoint_mm = {point}\n'
        text += "travel_deg = [-180.0, 180.0]\nleast_increment_deg = 0.000001\n"
    machine = folder / "machine.toml"
    machine.write_text(text + f"[tools.1]\ngauge_to_tip_mm = {list(TOOL_MM)}\n")
    box = "box = { " + ", ".join(f"{name}_deg = [-180, 180]" for name in ARM) + " }\n"
    head = CALIBRATION.partition("box =")[0].replace("five", "arm")
    errors = (
        "[location.J2]\nzero_urad = 300.0\nX_um = 50.0\n[location.J3]\nzero_urad = -200.0\nA_urad = 100.0\n"
    )
    errors += "[location.J5]\nzero_urad = 250.0\nZ_um = 30.0\n"
    wave = '[[cyclic]]\ncomponent = "EBJ2"\nperiod_deg = 9.0\namplitude_urad = 60.0\nphase_rad = 0.7\n'
    (folder / "calibration.toml").write_text(head + box + errors + wave)
    return machine


def test_an_arm_follows_poses(tmp_path: Path) -> None:
    machine = arm(tmp_path)
    built(machine, "armkins")
    judge = Judge(machine)
    tip, turn = judge.poses(np.array([HOME_DEG]), False)
    begin = np.append(tip[0], Rotation.from_matrix(turn[0]).as_euler("xyz", degrees=True))
    steps = ((0, 0, 0, 0, 0, 0), (30, 10, 0, 5, 0, 3), (-20, 40, -15, 0, 8, -3), (0, 0, 0, 0, 0, 0))
    places = [begin + np.array(step) for step in steps]
    moves = [" ".join(f"{a}{v:.6f}" for a, v in zip("XYZABC", place, strict=True)) for place in places]
    program = "G21 G90 G61 G17 F1500\nG0 " + "\nG1 ".join(moves) + "\nM2\n"
    hal = lines_of_hal(tmp_path, "armkins")
    hal += "".join(f"setp armkins.tool-more-{a} {v}\n" for a, v in zip("xyz", TOOL_MM, strict=True))
    pins = tuple(f"joint.{j}.pos-cmd" for j in (3, 4, 5))
    component = Kinematics("armkins", tmp_path, hal, pins, 500.0, "XYZABC", home=HOME_DEG)
    run = controller.run(program.encode(), machine, tmp_path / "run", kinematics=component)
    joints = np.hstack([run.axis, run.pins])[run.cutting]
    assert len(joints) > 4000
    away = off_poses(judge, np.round(places, 6), joints[::5])
    assert away[:, 0].max() * 1e3 <= PATH_UM
    assert away[:, 1].max() * 1e6 <= PATH_URAD
    # without errors of the machine, the joints are off by what the component adds
    shown = off_poses(judge, np.round(places, 6), joints[::5], actual=False).min(axis=0)
    assert shown[0] * 1e3 > 10.0 and shown[1] * 1e6 > 50.0


def off_poses(judge: Judge, places: np.ndarray, joints: np.ndarray, *, actual: bool = True) -> np.ndarray:
    """(n, 2) mm and rad of the tool from the nearest pose of a move, where its tip is beside."""
    tip, turn = judge.poses(joints, actual)
    found = np.full((len(tip), 2), np.inf)
    for begin, end in pairwise(places):
        way = end - begin
        share = np.clip((tip - begin[:3]) @ way[:3] / (way[:3] @ way[:3]), 0.0, 1.0)
        pose = begin + share[:, None] * way
        wanted = Rotation.from_euler("xyz", pose[:, 3:], degrees=True)
        angle = (Rotation.from_matrix(turn) * wanted.inv()).magnitude()
        one = np.stack([np.linalg.norm(tip - pose[:, :3], axis=1), angle], axis=1)
        nearer = np.hypot(one[:, 0], 100.0 * one[:, 1]) < np.hypot(found[:, 0], 100.0 * found[:, 1])
        found[nearer] = one[nearer]
    return found


def built(machine: Path, name: str) -> None:
    """The component of a machine, beside its file."""
    controller.require()
    if shutil.which("halcompile") is None:
        missing = "needs halcompile: apt-get install linuxcnc-uspace-dev"
        pytest.fail(missing) if os.environ.get("OLP_REQUIRE_ORACLE") == "1" else pytest.skip(missing)
    exported = olp.export_table(machine, "linuxcnc-kins", machine.parent / f"{name}.comp", self_test=True)
    write_files(exported.files)
    compiled = subprocess.run(
        ["halcompile", "--compile", f"{name}.comp"], cwd=machine.parent, capture_output=True, text=True,
        check=True,
    )  # fmt: skip
    assert "warning" not in compiled.stderr


def lines_of_hal(folder: Path, name: str) -> str:
    lines = (folder / f"{name}.hal").read_text().splitlines()
    return "".join(f"{line}\n" for line in lines if line[0] != "#")


def test_the_tool_follows_the_program(tmp_path: Path) -> None:
    machine = tmp_path / "machine.toml"
    machine.write_text(MACHINE)
    (tmp_path / "calibration.toml").write_text(CALIBRATION)
    built(machine, NAME)
    judge = Judge(machine)
    for name, (options, moves) in PROGRAMS.items():
        program = f"G21 G90 G61 G17 F1500 G54\nT1 M6 G43 H1\nG0 X0 Y0 Z0 A-30 C10\n{moves}M2\n"
        run = executed(program, tmp_path / name.replace(" ", "-"), options)
        joints = np.hstack([run.axis, run.pins])[run.cutting]
        away = off_path(judge, program.encode(), joints, bool(options))
        assert len(joints) > 4000
        assert away[:, 0].max() * 1e3 <= PATH_UM, name
        assert away[:, 1].max() * 1e6 <= PATH_URAD, name
        # the joints alone, without errors of the machine, are off by what the component adds
        shown = np.abs(off_path(judge, program.encode(), joints, bool(options), actual=False)).max(axis=0)
        assert shown[0] * 1e3 > 10.0 and shown[1] * 1e6 > 50.0


def executed(program: str, folder: Path, options: str) -> Run:
    hal = lines_of_hal(folder.parent, NAME)
    pins = ("joint.3.pos-cmd", "joint.4.pos-cmd")
    component = Kinematics(NAME, folder.parent, hal, pins, 500.0, "XYZAC", options)
    return controller.run(program.encode(), folder.parent / "machine.toml", folder, kinematics=component)
