"""Poses of URScript that a movej reaches near given joints, as programs of the pendant have them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from judge.arm import Arm
from judge.arm_files import MACHINE, ZEROS, arm_files
from scipy.spatial.transform import Rotation

import olp
from olp.core.errors import ProgramError

Q = np.array([20.0, 10.0, 20.0, 30.0, 40.0, 50.0])
FLIPPED = np.array([20.0, 10.0, 20.0, -150.0, -40.0, -130.0])
POSE = re.compile(r"=p\[([^\]]*)\]")
TEXT = """def made():
  set_tcp(p[0,0,0,0,0,0])
  global P1_p=p[{}]
  global P1_q=[{}]
  while (True):
    $ 2 "Robot Program"
    $ 4 "P1" "breakAfter"
    movej(get_inverse_kin(P1_p, qnear={}), a=1.4, v=1.05)
  end
end
"""


def pose(joints: np.ndarray) -> np.ndarray:
    rotation, place = Arm(MACHINE).pose(joints)
    return np.append(place / 1000.0, Rotation.from_matrix(rotation).as_rotvec())


def numbers(values: np.ndarray) -> str:
    return ",".join(f"{value:.9f}" for value in values)


@pytest.mark.parametrize("near", [Q, FLIPPED])
def test_the_posture_is_the_one_near_the_stated_joints(near: np.ndarray, tmp_path: Path) -> None:
    """Joints with wrong zeros stand elsewhere by these, so the pose that is written is that of the joints
    less them. Both wrists want another one."""
    text = TEXT.format(numbers(pose(Q)), numbers(np.radians(near + 0.01)), "P1_q")
    done = olp.correct_joints(text.encode(), arm_files(tmp_path))
    match = POSE.search(done.data.decode())
    assert match is not None
    written = np.array([float(value) for value in match[1].split(",")])
    want = pose(near - np.degrees(np.array(ZEROS) * 1e-6))
    turn = Rotation.from_rotvec(written[3:]).inv() * Rotation.from_rotvec(want[3:])
    assert np.abs(written[:3] - want[:3]).max() < 2e-6
    assert turn.magnitude() < 2e-6
    assert np.abs(want[:3] - pose(Q)[:3]).max() > 1e-4, "the errors are seen"


def test_joints_that_are_not_stated_name_no_posture(tmp_path: Path) -> None:
    text = TEXT.format(numbers(pose(Q)), numbers(np.radians(Q)), "get_target_joint_positions()")
    with pytest.raises(ProgramError, match="is computed"):
        olp.correct_joints(text.encode(), arm_files(tmp_path))


@pytest.mark.slow
def test_a_pose_from_where_the_run_has_the_arm_is_left(tmp_path: Path) -> None:
    """Its posture is that of the arm before it. So is the one behind it; a pose that corrected moves share
    with it stays, and they go to a clone. Where no posture is known at all, all is refused."""
    near, far = (f"[{numbers(np.radians(q))}]" for q in (Q, Q + 5.0))
    begin = f"  P=p[{numbers(pose(Q + 2.0))}]\n  movej({near})\n  movel(P)\n"
    branch = f"  if get_digital_in(1):\n    movej({far})\n  end\n"
    left = f"  movel(P)\n  movel(p[{numbers(pose(Q + 3.0))}])\n"
    text = f"def made():\n  set_tcp(p[0,0,0,0,0,0])\n{begin}{branch}{left}  movej({far})\n  movel(P)\nend\n"
    machine = arm_files(tmp_path)
    result = olp.correct_joints(text.encode(), machine)
    assert result.report["verdict"]["ok"]
    assert result.report["moves"]["uncorrected"] == 2
    assert any("left as written: where this move begins" in str(one) for one in result.report["findings"])
    done = result.data.decode()
    assert begin.split("\n")[0] in done
    assert left in done
    assert done.count("movel(P_olp") == 2
    assert olp.verify_joints(text.encode(), result.data, machine).report["verdict"]["ok"]
    alone = f"def made():\n  set_tcp(p[0,0,0,0,0,0])\n{begin[: begin.index('movej')]}movel(P)\n{left}end\n"
    with pytest.raises(ProgramError, match="does not state its configuration"):
        olp.correct_joints(alone.encode(), machine)
