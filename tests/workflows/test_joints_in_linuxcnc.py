"""LinuxCNC itself runs corrected programs of a machine with rotary axes: its joints, through the judge's
model of the machine, lead the tool along the nominal path."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cases.lockstep import CALIBRATION, MACHINE, off_path
from judge import controller
from judge.controller import Kinematics
from judge.five_axis import Judge

import olp

pytestmark = [pytest.mark.oracle, pytest.mark.slow]

#: The tolerances of the correction, which splits its moves; a tip that is off along the path, where a turn
#: counts at an arm of 100 mm, is beside another direction.
TIP_UM, TOOL_URAD = 1.0, 2.0
BESIDE_URAD = 1e3 * TIP_UM / 200.0
MOVES = "G1 X30 Y10 A-40 C20\nX-20 Y30 Z-15 A-70 C90\nC130 Z5\nX0 Y0 A-35 C40\n"


def test_the_tool_follows_the_nominal_path(tmp_path: Path) -> None:
    controller.require()
    machine = tmp_path / "machine.toml"
    machine.write_text(MACHINE)
    (tmp_path / "calibration.toml").write_text(CALIBRATION)
    program = f"G21 G90 G61 G17 F1500 G54\nT1 M6 G43 H1\nG0 X0 Y0 Z0 A-30 C10\n{MOVES}M2\n".encode()
    corrected = olp.correct_joints(program, machine, tolerance_um=TIP_UM, tolerance_urad=TOOL_URAD)
    assert corrected.report["verdict"]["ok"]
    pins = ("joint.3.pos-cmd", "joint.4.pos-cmd")
    kinematics = Kinematics(
        "trivkins", tmp_path, "", pins, 500.0, "XYZAC", "coordinates=XYZAC kinstype=both", built_in=True
    )
    judge, far = Judge(machine), []
    for name, text in (("nominal", program), ("corrected", corrected.data)):
        run = controller.run(text, machine, tmp_path / name, kinematics=kinematics)
        joints = np.hstack([run.axis, run.pins])[run.cutting]
        assert len(joints) > 4000
        far.append(off_path(judge, program, joints, tips=False).max(axis=0) * [1e3, 1e6])
    assert far[0][0] > 20.0 and far[0][1] > 50.0
    assert far[1][0] <= TIP_UM and far[1][1] <= TOOL_URAD + BESIDE_URAD
