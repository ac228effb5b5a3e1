"""Jobs of INFORM on an arm of six joints: pulses, the words of ///RCONF, and base axes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from judge import inform
from judge.arm_files import arm_files
from judge.robot_moves import PULSES_PER_DEG
from workflows.test_robots_on_arms import JOINTS, angles, jbi, local, stated

import olp
from olp.core.errors import ConfigError, ProgramError

ZERO_ROUNDING = 1e-9


def pose(joints: np.ndarray) -> str:
    (x, y, z), (c, b, a) = local(joints, 3)[0], angles(local(joints)[1])
    return f"{x:.3f},{y:.3f},{z:.3f},{a:.4f},{b:.4f},{c:.4f}"


def job(positions: list[str], moves: list[str]) -> bytes:
    head = ["/JOB", "//NAME T", "//POS", f"///NPOS {len(positions)},0,0,0,0,0", "///USER 3", "///TOOL 2"]
    head += ["///POSTYPE USER", "///RECTAN", "///RCONF 0,0,0,0,0,0,7,0"]
    return "\r\n".join([*head, *positions, "//INST", "NOP", *moves, "END", ""]).encode()


@pytest.fixture
def machine(tmp_path: Path) -> Path:
    return stated(arm_files(tmp_path), "inform")


def test_words_of_a_posture_follow_the_corrected_joints(machine: Path) -> None:
    """R turns back across half a turn, and across a quarter: lines around the positions say so, and those
    behind them have the words that they had."""
    across, quarter = JOINTS.copy(), JOINTS.copy()
    across[3], quarter[3] = 180.01, 90.02
    positions = [
        f"C00000={pose(JOINTS)}", f"///RCONF 1,0,0,1,0,0,7,0\r\nC00001={pose(across)}",
        f"C00002={pose(across)}", f"///RCONF 1,0,0,0,0,0,7,0\r\nC00003={pose(quarter)}",
        "///RCONF 0,0,0,0,0,0,7,0\r\nC00004=" + pose(JOINTS + 1.0),
    ]  # fmt: skip
    text = job(positions, [f"MOVJ C0000{k} VJ=5.00" for k in (2, 1, 0, 3, 4)])
    result = olp.correct_joints(text, machine)
    assert result.report["verdict"]["ok"]
    lines = [line.split("=")[0] for line in result.data.decode().splitlines()[8:-8]]
    lines = lines[: lines.index("C00004") + 1]
    one, zero, half = "///RCONF 1,0,0,1,0,0,7,0", "///RCONF 0,0,0,0,0,0,7,0", "///RCONF 1,0,0,0,0,0,7,0"
    assert lines == [
        zero, "C00000", one, half, "C00001", one, half, "C00002", one, half, zero, "C00003", half, zero,
        "C00004",
    ]  # fmt: skip
    # what is written is read as the posture that is meant
    assert olp.verify_joints(text, result.data, machine).report["verdict"]["ok"]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("0,0,0,0,0,0", ""),
        # R at -150 and B at -40 deg
        ("1,0,0,0,0,0", ""),
        ("0,1,0,0,0,0", "configuration names"),
        ("0,0,1,0,0,0", "configuration names"),
        ("0,0,0,1,0,0", "configuration names"),
        ("0,0", "does not state its configuration"),
    ],
)
def test_posture_refused_with_its_line(words: str, told: str, machine: Path) -> None:
    text = job([f"///RCONF {words}\r\nC00000={pose(JOINTS)}"], ["MOVJ C00000 VJ=5.00"])
    if not told:
        assert olp.correct_joints(text, machine).report["verdict"]["ok"]
        return
    with pytest.raises(ProgramError, match=told) as caught:
        olp.correct_joints(text, machine)
    assert caught.value.line == 14


@pytest.mark.parametrize("r_deg", [-185.0, 185.0])
def test_an_axis_beyond_half_a_turn_turns_back_to_there(r_deg: float, machine: Path) -> None:
    """The word says that it is beyond, the pose on which side: pulses next to it are the proof."""
    joints = JOINTS.copy()
    joints[3] = r_deg
    pulses = ",".join(f"{v * PULSES_PER_DEG:.0f}" for v in joints + 0.5)
    taught = [
        f"///RCONF 1,0,0,1,0,0\r\nC00000={pose(joints)}",
        f"///POSTYPE PULSE\r\n///PULSE\r\nC00001={pulses}",
    ]
    result = olp.correct_joints(job(taught, ["MOVJ C00000 VJ=5.00", "MOVL C00001 V=5.0"]), machine)
    assert result.report["verdict"]["ok"]


def test_pulses_need_the_key_of_all_axes(machine: Path) -> None:
    text, own = jbi([("J", JOINTS), ("L", JOINTS + 1.0)]), machine.read_text("utf-8")
    key = "pulses_per_deg = 100000.0\n"
    machine.write_text(own.replace(key, ""), "utf-8")
    with pytest.raises(ProgramError, match="give pulses_per_deg in each") as caught:
        olp.correct_joints(text, machine)
    assert b"MOVJ" in text.splitlines()[caught.value.line - 1]
    machine.write_text(own.replace(key, "", 1), "utf-8")
    with pytest.raises(ConfigError, match="J1 state no pulses_per_deg, and others do"):
        olp.correct_joints(text, machine)


def test_pulses_stay_pulses_and_whole(machine: Path) -> None:
    """Coarse ones, too: what their rounding does to the tip is stated, and no more is allowed."""
    own = machine.read_text("utf-8").replace("100000.0", "1000.0")
    machine.write_text(own, "utf-8")
    rows = [JOINTS, JOINTS + np.array([12, 3, -4, 5, 3, -6]), JOINTS + 2.0]
    positions = ["///POSTYPE PULSE\r\n///PULSE\r\nC00000=" + ",".join(f"{v * 1000:.0f}" for v in rows[0])]
    positions += [f"C0000{k}=" + ",".join(f"{v * 1000:.0f}" for v in rows[k]) for k in (1, 2)]
    moves = ["MOVJ C00000 VJ=5.00", "MOVL C00001 V=50.0", "MOVL C00002 V=50.0 PL=0"]
    result = olp.correct_joints(job(positions, moves), machine)
    written = inform.moves(result.data)
    assert all(move.in_pulses and (move.numbers == move.numbers.round()).all() for move in written)
    assert all(line.count(b".") == 0 for line in result.data.splitlines() if line.startswith(b"C"))
    assert len(written) > 4
    deviation = result.report["deviation"]
    assert deviation["holds"]
    assert inform.counts(result.data)[0] == inform.counts(result.data)[1]
    assert 5.0 < deviation["allowed_um"] < 50.0


def test_a_straight_move_to_another_posture_is_refused(machine: Path) -> None:
    other = JOINTS * [1, 1, 1, 1, -1, 1]
    text = jbi([("J", JOINTS), ("P", JOINTS), ("L", other)])
    with pytest.raises(ProgramError, match="other side of a singular posture") as caught:
        olp.correct_joints(text, machine)
    assert text.splitlines()[caught.value.line - 1].startswith(b"MOVL")


def test_a_positioner_moves_beside_the_robot(machine: Path) -> None:
    """It carries the arm nowhere, and while it turns a move is not split."""
    far = JOINTS + np.array([20, 5, -5, 5, -4, 6])
    stations = "///POSTYPE PULSE\r\n///PULSE\r\nEC00000=5000,-70\r\nEC00001={}"
    moves = [
        f"MOV{word} C0000{k} V{speed}  +MOVJ EC0000{k}"
        for k, (word, speed) in enumerate([("J", "J=5.00"), ("L", "=9.0")])
    ]
    taught = [f"C00000={pose(JOINTS)}", f"C00001={pose(far)}"]
    parts = [
        olp.correct_joints(job([*taught, stations.format(value)], moves), machine).data.count(b"MOVL")
        for value in ("5000,-70", "6000,-70")
    ]
    assert parts[0] > parts[1] == 1


def test_base_axes_carry_the_arm_along_its_track(machine: Path) -> None:
    """Positions in base coordinates count from where the base began, those of the robot from the arm."""
    machine.write_text(
        machine.read_text("utf-8").replace("[kinematics]\n", "[kinematics]\ntrack = [0.0, 1.0, 0.0]\n")
    )
    x, y, *rest = pose(JOINTS).split(",")
    moved = ",".join([x, f"{float(y) + 800.0:.3f}", *rest])

    def text(kind: str, own: str, along: str) -> bytes:
        return job([f"///POSTYPE {kind}\r\nC00000={own}\r\nBC00000={along}"], ["MOVJ C00000 BC00000 VJ=5.00"])

    still = inform.moves(olp.correct_joints(text("BASE", pose(JOINTS), "0.000"), machine).data)[0]
    base = inform.moves(olp.correct_joints(text("BASE", moved, "800.000"), machine).data)[0]
    robot = inform.moves(olp.correct_joints(text("ROBOT", pose(JOINTS), "800.000"), machine).data)[0]
    assert np.abs(base.numbers - still.numbers - [0, 800, 0, 0, 0, 0]).max() < 2e-3
    assert np.abs(robot.numbers - still.numbers).max() < ZERO_ROUNDING
    # without its own value the arm may be anywhere on its track, which positions of the robot do not need
    from_arm, from_base = (
        text(kind, pose(JOINTS), "0.000").replace(b" BC00000 ", b" ") for kind in ("ROBOT", "BASE")
    )
    robot = inform.moves(olp.correct_joints(from_arm, machine).data)[0]
    assert np.abs(robot.numbers - still.numbers).max() < ZERO_ROUNDING
    with pytest.raises(ProgramError, match="does not state its first external axis"):
        olp.correct_joints(from_base, machine)
    with pytest.raises(ProgramError, match="counts from the user frame"):
        olp.correct_joints(text("USER", pose(JOINTS), "800.000"), machine)
    in_pulses = text("BASE", pose(JOINTS), "0.000").replace(
        b"BC00000=", b"///POSTYPE PULSE\r\n///PULSE\r\nBC00000=90"
    )
    with pytest.raises(ProgramError, match="the base axis of this move is in pulses"):
        olp.correct_joints(in_pulses, machine)
    joints = (
        f"///POSTYPE PULSE\r\n///PULSE\r\nC00000={','.join(str(int(v * PULSES_PER_DEG)) for v in JOINTS)}"
    )
    taught = job([f"{joints}\r\nBC00000=878036"], ["MOVJ C00000 BC00000 VJ=5.00"])
    assert b"BC00000=878036" in olp.correct_joints(taught, machine).data
