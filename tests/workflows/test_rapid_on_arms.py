"""RAPID on an arm of six joints: corrected in position and orientation, as a judge of its own says."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from judge import rapid
from judge.arm import Arm, between, quaternion, turned_by
from judge.arm_files import MACHINE, ZEROS, arm_files

import olp
from olp.core.errors import ProgramError

#: The tool at the flange, and the work object.
LEVER, TOOL = np.array([10.0, -5.0, 160.0]), [0.996194698, 0, 0.087155743, 0]
ORIGIN, TURN = np.array([705.0, -94.0, 507.0]), [0.965925826, 0, 0, 0.258819045]
HEAD = f"""MODULE Made
PERS tooldata spindle:=[TRUE,[{LEVER.tolist()},{TOOL}],[1,[0,0,1],[1,0,0,0],0,0,0]];
PERS wobjdata part:=[FALSE,TRUE,"",[{ORIGIN.tolist()},{TURN}],[[0,0,0],[1,0,0,0]]];
"""
WORDS = ",v100,z10,spindle\\WObj:=part;"


def target(joints: np.ndarray, digits: int = 3) -> str:
    """A robtarget that brings the arm to joints."""
    rotation, place = Arm(MACHINE).pose(joints)
    frame, tip = rapid.matrix(TURN), place + rotation @ LEVER
    x, y, z = (frame.T @ (tip - ORIGIN)).round(digits).tolist()
    turn = quaternion(frame.T @ rotation @ rapid.matrix(TOOL)).round(7).tolist()
    quarters = [int(np.floor(joints[k] / 90)) for k in (0, 3, 5)]
    rest = [*quarters, int(joints[4] < 0)]
    return f"[[{x},{y},{z}],{turn},{rest},[9E9,9E9,9E9,9E9,9E9,9E9]]"


def made(seed: int, count: int = 5) -> tuple[bytes, list[np.ndarray]]:
    """A program of straight moves and others, and joints near those of its moves."""
    rng = np.random.default_rng(seed)
    middle = np.array([0, 20, 30, 0, rng.choice([50, -50]), 0]) + rng.uniform(-1, 1, 6) * [
        *(60, 15, 15, 60, 20, 100)
    ]
    joints = [middle + rng.uniform(-1, 1, 6) * 3 for _ in range(count)]
    lines = [f"CONST robtarget p{k}:={target(q)};" for k, q in enumerate(joints)]
    lines.append("PROC main()")
    near = []
    for k, q in enumerate(joints):
        where = target(q) if k == 2 else f"p{k}"
        lines.append(f"  Move{'L' if k else 'J'} {where}{WORDS}")
        near.append(q)
        if k in (1, 3):
            moved = f"Offs(p{k},3,4,-5)" if k == 1 else f"RelTool(p{k},2,-3,-15)"
            lines.append(f"  MoveL {moved}{WORDS}")
            near.append(q)
    text = HEAD + "\n".join([*lines, "ENDPROC", "ENDMODULE", ""])
    return text.encode(), near


def flange_of(move: rapid.RobotMove) -> tuple[np.ndarray, np.ndarray]:
    return move.turn @ rapid.matrix(TOOL).T, move.tip - move.lever


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_tip_and_tool_are_where_the_program_says(seed: int, tmp_path: Path) -> None:
    """At the ends of moves and along straight ones, from both texts by a reader and an arm of their own."""
    machine, (text, near) = arm_files(tmp_path), made(seed)
    result = olp.correct_joints(text, machine)
    report = result.report["deviation"]
    assert report["holds"]
    assert report["before"]["position_max_um"] > 300
    assert olp.verify_joints(text, result.data, machine).report["verdict"]["ok"]
    assert result.report["moves"] | {"feed": 6, "rapid": 1} == result.report["moves"]
    arm, wanted, found = Arm(machine, ZEROS), rapid.moves(text), rapid.moves(result.data)
    digit, turn_digit = 1e-4, 4e-9
    place, joints, first = 0, near[0], True
    for number, (want, guess) in enumerate(zip(wanted, near, strict=True)):
        last, guess = False, guess
        begun = None if number == 0 else wanted[number - 1]
        while not last:
            move = found[place]
            rotation, here = arm.actual(arm.joints(*flange_of(move), guess))
            tip, turn = here + rotation @ LEVER, rotation @ rapid.matrix(TOOL)
            last = np.linalg.norm(tip - want.tip) < 1e-3 + digit
            if last:
                assert np.linalg.norm(turned_by(turn, want.turn)) < 2e-6 + turn_digit
            if want.straight and begun is not None and not first:
                before = found[place - 1]
                for share in (0.25, 0.5, 0.75):
                    led = between(before.turn, move.turn, share) @ rapid.matrix(TOOL).T
                    tip = before.tip + share * (move.tip - before.tip)
                    rotation, here = arm.actual(arm.joints(led, tip - led @ LEVER, joints))
                    tip, way = here + rotation @ LEVER, want.tip - begun.tip
                    part = (tip - begun.tip) @ way / (way @ way)
                    assert np.linalg.norm(begun.tip + part * way - tip) < 1e-3 + digit
                    aim = between(begun.turn, want.turn, min(max(part, 0.0), 1.0))
                    miss = np.linalg.norm(turned_by(rotation @ rapid.matrix(TOOL), aim))
                    assert miss < 1e-5 + 1e-3 / np.linalg.norm(way)
            joints, first, place = guess, False, place + 1
    assert place == len(found)


@pytest.mark.slow
def test_a_model_without_errors_changes_no_byte(tmp_path: Path) -> None:
    machine, (text, _) = arm_files(tmp_path, (0.0,) * 6), made(7)
    assert olp.correct_joints(text, machine).data == text


def text_of(*moves: str) -> bytes:
    return (HEAD + "\n".join(["PROC main()", *moves, "ENDPROC", "ENDMODULE", ""])).encode()


JOINTS = np.array([20.0, 10.0, 20.0, 30.0, 40.0, 50.0])


def test_quarters_follow_the_corrected_joints(tmp_path: Path) -> None:
    """The fourth axis turns back across zero: its quarter is another one, and no other word changes."""
    joints = np.array([20.0, 10.0, 20.0, 0.01, 40.0, 50.0])
    text = text_of(f"  MoveJ {target(joints)}{WORDS}")
    assert b"[0, 0, 0, 0]" in text
    data = olp.correct_joints(text, arm_files(tmp_path)).data
    assert b"[0, -1, 0, 0]" in data
    assert re.sub(rb"\[[-\d., ]*\]", b"", data.partition(b"\n")[2]).count(b"MoveJ") == 1


def test_targets_that_moves_share_are_cloned(tmp_path: Path) -> None:
    head = f"CONST robtarget p:={target(JOINTS)};\n"
    text = text_of(f"  MoveJ p{WORDS}", f"  MoveJ RelTool(p,0,0,-40){WORDS}", f"  MoveJ p{WORDS}")
    text = text.replace(b"PROC main", head.encode() + b"PROC main")
    data = olp.correct_joints(text, arm_files(tmp_path)).data
    assert b"RelTool(p_olp1,0,0,-40)" in data
    assert data.count(b"MoveJ p,") == 2


@pytest.mark.parametrize(
    ("change", "line", "told"),
    [
        (lambda text: text.replace(b"[0, 0, 0, 0]", b"[0, 1, 0, 0]"), 5, "configuration names"),
        (lambda text: text.replace(b"[0, 0, 0, 0]", b"[0, 0, 0, 4]"), 5, "configuration names"),
        (lambda text: text.replace(b"[0, 0, 0, 0]", b"[-4, 0, 0, 0]"), 5, "configuration names"),
        (lambda text: text.replace(b"[9E9,9E9", b"[-250.5,9E9"), 5, "external axis"),
        (lambda text: text.replace(b"PERS tooldata spindle", b"PERS tooldata other"), 5, "spindle"),
        (lambda text: re.sub(rb"MoveJ \[\[[-\d.]+", b"MoveJ [[9000", text), 5, "no posture of this arm"),
    ],
)
def test_refused_with_its_line(change: object, line: int, told: str, tmp_path: Path) -> None:
    text = text_of(f"  MoveJ {target(JOINTS)}{WORDS}")
    with pytest.raises(ProgramError, match=told) as caught:
        olp.correct_joints(change(text), arm_files(tmp_path))  # type: ignore[operator]
    assert caught.value.line == line


def test_without_monitoring_the_posture_is_the_one_near_the_start(tmp_path: Path) -> None:
    """Only the first target is refused where the start is not known: the others follow from it."""
    moves = [f"  MoveJ {target(JOINTS + k)}{WORDS}".replace("[0, 0, 0, 0]", "[0, 1, 0, 7]") for k in (0, 1)]
    text, machine, job = text_of("  ConfJ \\Off;", *moves), arm_files(tmp_path), tmp_path / "job.toml"
    with pytest.raises(ProgramError, match="state start_deg") as caught:
        olp.correct_joints(text, machine)
    assert (caught.value.line, caught.value.others) == (6, ())
    start = ", ".join(f"J{k + 1} = {value}" for k, value in enumerate((JOINTS + 5).tolist()))
    job.write_text(f'schema = "olp-job-1"\nstart_deg = {{ {start} }}\n', "utf-8")
    result = olp.correct_joints(text, machine, job)
    assert result.report["verdict"]["ok"]
    # the posture nearest to this one has J3 at 174.9 deg, beyond its travel, and is not taken
    near = "J1 = -155, J2 = -15, J3 = 158, J4 = -150, J5 = 48, J6 = 56"
    job.write_text(f'schema = "olp-job-1"\nstart_deg = {{ {near} }}\n', "utf-8")
    assert olp.correct_joints(text, machine, job).report["verdict"]["ok"]
    # a configuration that says nothing of the posture is kept
    assert result.data.count(b"[0, 1, 0, 7]") == 2


def test_a_straight_wrist_is_refused(tmp_path: Path) -> None:
    joints = np.array([20.0, 10.0, 20.0, 30.0, 0.0, 50.0])
    with pytest.raises(ProgramError, match="the wrist is straight"):
        olp.correct_joints(text_of(f"  MoveJ {target(joints, 9)}{WORDS}"), arm_files(tmp_path))


def test_the_tool_has_to_be_a_frame(tmp_path: Path) -> None:
    """A vector of the job file has no directions, which an orientation needs."""
    text = text_of(f"  MoveJ {target(JOINTS)}{WORDS}").replace(b"PERS tooldata spindle", b"PERS tooldata o")
    (tmp_path / "job.toml").write_text(
        'schema = "olp-job-1"\n[tools.5]\nname = "spindle"\ngauge_to_tip_mm = [0.0, 0.0, 160.0]\n', "utf-8"
    )
    with pytest.raises(ProgramError, match="a frame with its own directions"):
        olp.correct_joints(text, arm_files(tmp_path), tmp_path / "job.toml")
