"""An arm whose second, third and fourth axis are parallel: its postures, and URScript on it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from judge.arm import Arm, about, quaternion, turned_by
from judge.arm_files import MACHINE

import olp
from olp.core.errors import ProgramError
from olp.files.kinematics.load import load_joint_machine
from olp.kinematics.parallel_arm import ParallelArm, arm_of
from olp.kinematics.poses import Poses

#: Direction and point of each axis, as a light robot has them stretched out.
LINES = (
    ((0, 0, 1), (0, 0, 0)), ((0, -1, 0), (0, 0, 127.3)), ((0, -1, 0), (-612, 0, 127.3)),
    ((0, -1, 0), (-1184.3, 0, 127.3)), ((0, 0, -1), (-1184.3, -163.9, 127.3)),
    ((0, -1, 0), (-1184.3, -163.9, 11.6)),
)  # fmt: skip
JOINTS = np.array([20.0, -80.0, 70.0, -70.0, -75.0, 30.0])


def machine_file(folder: Path) -> Path:
    text = (
        'schema = "olp-machine-1"\nname = "light"\nchain = "F J1 J2 J3 J4 J5 J6"\ncontroller = "linuxcnc"\n'
    )
    text += 'calibration = "calibration.toml"\ncompensated_by_controller = []\n'
    for k, (direction, point) in enumerate(LINES):
        text += f'[axes.J{k + 1}]\nkind = "rotary"\ndirection = {[float(v) for v in direction]}\n'
        text += f"point_mm = {[float(v) for v in point]}\ntravel_deg = [-360.0, 360.0]\n"
        text += "least_increment_deg = 0.0001\n"
    text += "[gauge]\npoint_mm = [-1184.3, -256.1, 11.6]\nA_deg = 90.0\n"
    (folder / "machine.toml").write_text(text, "utf-8")
    box = ", ".join(f"J{k}_deg = [-400, 400]" for k in range(1, 7))
    head = f'schema = "olp-calibration-1"\nmachine = "light"\nmeasured = 2026-03-01\nbox = {{ {box} }}\n'
    head += 'temperature_degC = 20.0\nsign = "actual-minus-commanded"\nmodel = "rigid-body"\n'
    zeros = "".join(f"[location.J{k}]\nzero_urad = {150.0 + 40 * k}\n" for k in range(1, 7))
    (folder / "calibration.toml").write_text(head + zeros, "utf-8")
    return folder / "machine.toml"


def test_each_posture_brings_the_flange_there_and_one_is_the_own(tmp_path: Path) -> None:
    machine = machine_file(tmp_path)
    judge, arm = Arm(machine), arm_of(load_joint_machine(machine).structure)
    assert isinstance(arm, ParallelArm)
    joints = np.random.default_rng(1).uniform(-170, 170, (20, 6))
    poses = [judge.pose(own) for own in joints]
    found = arm.postures(Poses(np.array([r for r, _ in poses]), np.array([p for _, p in poses])))
    signs = arm.branches(found) > 0.0
    for k, own in enumerate(joints):
        there = found[k][np.isfinite(found[k, :, 0])]
        assert len(there) in (2, 4, 6, 8)
        assert np.abs((there - own + 180) % 360 - 180).max(axis=1).min() < 1e-7
        for posture in there:
            rotation, place = judge.pose(posture)
            assert np.abs(place - poses[k][1]).max() < 1e-8
            assert np.abs(rotation - poses[k][0]).max() < 1e-10
        kinds = {tuple(sign) for sign in signs[k][np.isfinite(found[k, :, 0])].tolist()}
        assert len(kinds) == len(there)


@pytest.mark.parametrize("light", [True, False])
def test_the_posture_next_to_axis_values_is_that_of_these(light: bool, tmp_path: Path) -> None:
    """With their turns, from values that are some degrees off."""
    machine, rng = machine_file(tmp_path) if light else MACHINE, np.random.default_rng(2)
    judge, arm = Arm(machine), arm_of(load_joint_machine(machine).structure)
    joints = rng.uniform(-300, 300, (40, 6))
    bent = np.abs(np.sin(np.radians(joints[:, [2, 4]]))).min(axis=1) > 0.4
    poses = [judge.pose(own) for own in joints]
    flange = Poses(np.array([r for r, _ in poses]), np.array([p for _, p in poses]))
    assert arm is not None
    found = arm.near(flange, joints + rng.uniform(-2, 2, joints.shape))
    off = np.abs(found - joints).max(axis=1)
    assert (off[bent] < 1e-6).sum() > 0.9 * bent.sum() > 5
    for own, (rotation, place) in zip(found, poses, strict=True):
        assert np.abs(judge.pose(own)[1] - place).max() < 1e-8
        assert np.abs(judge.pose(own)[0] - rotation).max() < 1e-10


def ur_pose(judge: Arm, joints: np.ndarray) -> str:
    rotation, place = judge.pose(joints)
    w, *axis = quaternion(rotation)
    vector = 2 * np.arctan2(np.linalg.norm(axis), w) * np.array(axis) / np.linalg.norm(axis)
    return f"p[{','.join(f'{v:.9f}' for v in [*place / 1000, *vector])}]"


def test_urscript_on_such_an_arm(tmp_path: Path) -> None:
    machine = machine_file(tmp_path)
    judge = Arm(machine)
    begin = ",".join(f"{v:.7f}" for v in np.radians(JOINTS))
    goal = JOINTS + np.array([3.0, -2, 4, 1, 3, -5])
    lines = ["def made():", "  set_tcp(p[0,0,0.1,0,0,0])", f"  movej([{begin}])"]
    flange = judge.pose(goal)[0] @ [0, 0, 100.0]
    pose = ur_pose(judge, goal)
    x, y, z, *rest = pose[2:-1].split(",")
    moved = [f"{float(v) + d / 1000:.9f}" for v, d in zip((x, y, z), flange, strict=True)]
    target = f"p[{','.join([*moved, *rest])}]"
    text = "\n".join([*lines, f"  movel({target}, a=1, v=0.1)", "end", ""]).encode()
    result = olp.correct_joints(text, machine)
    assert result.report["verdict"]["ok"]
    words = result.data.splitlines()[-2].split(b"p[")[1].split(b"]")[0].split(b",")
    numbers = np.array([float(word) for word in words])
    size = np.linalg.norm(numbers[3:])
    turn = about(numbers[3:] / size, np.degrees(size))
    found = judge.joints(turn, 1000 * numbers[:3] - turn @ [0, 0, 100.0], goal)
    zeros = np.degrees([150e-6 + 40e-6 * k for k in range(1, 7)])
    rotation, place = judge.pose(found + zeros)
    want_turn, want = judge.pose(goal)
    assert np.linalg.norm(place + rotation @ [0, 0, 100.0] - want - flange) < 1e-3
    assert np.linalg.norm(turned_by(rotation, want_turn)) < 2e-6
    with pytest.raises(ProgramError, match="does not state its configuration"):
        olp.correct_joints(text.replace(f"  movej([{begin}])\n".encode(), b""), machine)
