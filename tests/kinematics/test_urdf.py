"""Robots from URDF: the same poses as a walk over the elements of the file, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from kinematics.cases import golden

import olp
from olp.cli import main
from olp.kinematics.poses import axis_rotation

#: Joints of a KUKA KR 6 R900: name, origin in m, axis. As in kr6r900sixx_macro.xacro of ROS-Industrial.
KR6 = [
    ("J1", "0 0 0.4", "0 0 -1"),
    ("J2", "0.025 0 0", "0 1 0"),
    ("J3", "0.455 0 0", "0 1 0"),
    ("J4", "0 0 0.035", "-1 0 0"),
    ("J5", "0.42 0 0", "0 1 0"),
    ("J6", "0.08 0 0", "-1 0 0"),
]


def robot(joints: list[str], links: int) -> str:
    named = "".join(f'<link name="l{number}"/>' for number in range(links))
    return f'<?xml version="1.0"?><robot name="r">{named}{"".join(joints)}</robot>'


def moving(
    number: int, name: str, xyz: str, axis: str, *, rpy: str = "0 0 0", kind: str = "revolute", more: str = ""
) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="l{number}"/><child link="l{number + 1}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>'
        f'<limit lower="-2" upper="2.5" velocity="3"/>{more}</joint>'
    )


def kr6() -> str:
    joints = [moving(row, *words) for row, words in enumerate(KR6)]
    flange = '<joint name="flange" type="fixed"><parent link="l6"/><child link="l7"/>'
    # files that xacro wrote name it in comments and as a namespace
    joints.insert(0, "<!-- xacro: made from kr6.urdf.xacro -->")
    return robot([*joints, f'{flange}<origin rpy="0 1.5707963267948966 0"/></joint>'], 8)


def made(tmp_path: Path, text: str, *words: str) -> tuple[int, str]:
    (tmp_path / "robot.urdf").write_text(text)
    folder = str(tmp_path / "arm")
    result = CliRunner().invoke(main, ["init", folder, "--urdf", str(tmp_path / "robot.urdf"), *words])
    return result.exit_code, result.output


def test_the_kr6_of_urdf_is_that_of_the_golden_case(tmp_path: Path) -> None:
    code, text = made(tmp_path, kr6())
    assert (code, text.count("note: ")) == (0, 3)
    ours = olp.load_kinematics(tmp_path / "arm" / "machine.toml")
    assert ours.structure.chain == ("F", "J1", "J2", "J3", "J4", "J5", "J6")
    assert ours.structure.joints["J3"].point_mm == pytest.approx((480.0, 0.0, 400.0))
    assert ours.structure.joints["J1"].travel == pytest.approx((np.degrees(-2.0), np.degrees(2.5)))
    wanted = golden("arm_6r_kr6")[0].kinematics
    values = np.random.default_rng(0).uniform(-100.0, 100.0, (20, 6))
    at, there = ours.nominal(values), wanted.nominal(values)
    reach = there.position - there.rotation @ np.array(wanted.tool_mm)
    assert np.abs(at.position - reach).max() < 1e-9
    assert np.abs(at.rotation - there.rotation).max() < 1e-11


def test_turned_origins_and_slides(tmp_path: Path) -> None:
    """Poses as a walk over the file gives them, one element after the other."""
    rows = [("a", "0.1 0.2 0.3", "0 0 1", (0.3, -0.4, 0.5), "revolute"),
            ("b", "0.5 0 0.1", "0 0.6 0.8", (1.0, 0.2, -2.0), "prismatic"),
            ("c", "0 0.3 0", "1 0 0", (-0.7, 0.1, 0.2), "continuous")]  # fmt: skip
    joints = [
        moving(n, name, xyz, axis, rpy=" ".join(map(str, rpy)), kind=kind)
        for n, (name, xyz, axis, rpy, kind) in enumerate(rows)
    ]
    assert made(tmp_path, robot(joints, 4))[0] == 0
    machine = olp.load_kinematics(tmp_path / "arm" / "machine.toml")
    rotation, place = np.eye(3), np.zeros(3)
    for (_, xyz, axis, rpy, kind), value in zip(rows, (30.0, 120.0, -70.0), strict=True):
        place = place + rotation @ (1e3 * np.array(xyz.split(), float))
        for k in (2, 1, 0):
            rotation = rotation @ axis_rotation(np.eye(3)[k], np.array([rpy[k]]))[0]
        along = np.array(axis.split(), float)
        if kind == "prismatic":
            place = place + rotation @ along * value
        else:
            rotation = rotation @ axis_rotation(along, np.radians([value]))[0]
    pose = machine.nominal(np.array([[30.0, 120.0, -70.0]]))
    assert pose.position[0] == pytest.approx(place, abs=1e-8)
    assert np.abs(pose.rotation[0] - rotation).max() < 1e-10


BRANCH = '<joint name="b" type="fixed"><parent link="l1"/><child link="l3"/></joint>'
REFUSED = [
    ("<robot", "not XML"),
    ("<machine/>", "expected <robot>"),
    ('<!DOCTYPE robot [<!ENTITY a "b">]><robot/>', "entities"),
    ('<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:a/></robot>', "xacro"),
    (robot([moving(0, "j", "0 0 0", "0 0 0")], 2), "without direction"),
    (robot([moving(0, "j", "0 0", "0 0 1")], 2), "expected three numbers"),
    (robot([moving(0, "j", "0 0 0", "0 0 1", kind="floating")], 2), "floating"),
    (robot([moving(0, "j", "0 0 0", "0 0 1", more='<mimic joint="k"/>')], 2), "mimic"),
    (robot([moving(0, "F", "0 0 0", "0 0 1")], 2), "another"),
    (robot([moving(0, "j", "0 0 0", "0 0 1"), moving(1, "k", "0 0 0", "0 0 1"), BRANCH], 4), "--tip"),
    (robot([], 1), "no joint that moves"),
    (robot([], 2), "ends in 2 links (l0, l1)"),
    (robot([moving(0, "j", "0 0 0", "0 0 1"), BRANCH, BRANCH.replace('"b"', '"c"')], 4),
     "the joints b and c hold the same link l3"),
    (robot([moving(0, "j", "0 0 0", "0 0 1"), *(BRANCH.replace("l3", f"l{k}") for k in range(2, 22))], 22),
     "l13 and 8 more"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "words"), REFUSED)
def test_what_is_refused(tmp_path: Path, text: str, words: str) -> None:
    code, said = made(tmp_path, text)
    assert code == 3
    assert words in said
    assert not (tmp_path / "arm").exists()


def test_a_frame_that_stands_still_is_no_tool(tmp_path: Path) -> None:
    """Industrial arms have the frames base and tool0: the first is fixed to the root."""
    base = '<joint name="b" type="fixed"><parent link="l0"/><child link="l2"/></joint>'
    code, said = made(tmp_path, robot([base, moving(0, "j", "0 0 0.1", "0 0 1")], 3))
    assert code == 0 and "The tool sits on the link l1: name another one with --tip" in said
    machine = olp.load_kinematics(tmp_path / "arm" / "machine.toml")
    assert (machine.structure.order, machine.structure.gauge.point_mm) == (("j",), (0.0, 0.0, 100.0))


def test_a_tip_selects_the_chain(tmp_path: Path) -> None:
    text = robot([moving(0, "j", "0 0 0", "0 0 1"), moving(1, "k", "0 0 0", "0 0 1"), BRANCH], 4)
    assert made(tmp_path, text, "--tip", "l3")[0] == 0
    assert olp.load_kinematics(tmp_path / "arm" / "machine.toml").structure.order == ("j",)
    assert made(tmp_path, text, "--tip", "hand", "--force")[0] == 3
    assert made(tmp_path, text, "--chain", "FXYZ")[0] == 2
