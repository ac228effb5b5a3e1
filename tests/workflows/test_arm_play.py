"""Backlash of every joint of an arm: robot programs are judged by a reader and an arm of their own, which
follows the play from joints to joints."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cases.fast import some_of_a_campaign
from judge.arm import Arm, between
from judge.arm_files import ZEROS, arm_files
from judge.robot_moves import READERS
from workflows.test_robots_on_arms import DIGITS, FRAMES, LEVER, TOOL, WRITERS, stated, steps_of

import olp

#: urad by joint
PLAY = (20.0, 15.0, 12.0, 25.0, 18.0, 30.0)
#: Places along a straight move.
PARTS = np.linspace(0.0, 1.0, 9)[1:]


@pytest.mark.slow
@pytest.mark.parametrize("language", some_of_a_campaign(["rapid", "val3"], 2))
def test_the_tip_is_right_where_every_joint_has_play(language: str, tmp_path: Path) -> None:
    """At the ends of moves, from the text; a reader finds the joints, and each lags by half of its play."""
    machine, steps = stated(arm_files(tmp_path), language), steps_of(0, "JLLPLJLL")
    calibration = tmp_path / "calibration.toml"
    play = "".join(f"J{k + 1}_urad = {size}\n" for k, size in enumerate(PLAY))
    calibration.write_text(calibration.read_text("utf-8") + "[backlash]\n" + play, "utf-8")
    text = WRITERS[language](steps)
    result = olp.correct_joints(text, machine)
    assert result.report["verdict"]["ok"]
    assert olp.verify_joints(text, result.data, machine).report["verdict"]["ok"]
    arm, digit = Arm(machine, ZEROS), DIGITS[language][0]
    wanted, found = READERS[language](text, FRAMES), READERS[language](result.data, FRAMES)
    half, side = np.degrees(np.array(PLAY) * 0.5e-6), np.zeros(6)
    before, at, ends = None, 0, []
    for move in found:
        level = np.array([0, 0, 1.0, 0, 0, 0]) * (language == "tp")
        guess = before if before is not None else steps[0][1]
        if move.joints is not None:
            joints = move.joints - level * move.joints[1]
        else:
            turn = move.turn @ TOOL.T
            joints = arm.joints(turn, move.tip - turn @ LEVER, guess)
        for place in [joints] if before is None else _led(arm, before, joints, straight=move.straight):
            side = np.clip(side + (place - guess) / half, -1.0, 1.0)
            guess = place
        before = joints
        rotation, flange = arm.actual(joints - half * side)
        ends.append(flange + rotation @ LEVER)
    for number, want in enumerate(wanted):
        if want.joints is not None:
            rotation, flange = arm.pose(want.joints - level * want.joints[1])
            tip = flange + rotation @ LEVER
        else:
            tip = want.tip
        away = np.linalg.norm(np.array(ends[at:]) - tip, axis=1)
        at += int(np.argmax(away < 1e-3 + digit))
        assert away.min() < 1e-3 + digit, number


def _led(arm: Arm, start: np.ndarray, end: np.ndarray, *, straight: bool) -> list[np.ndarray]:
    if not straight:
        return [start + part * (end - start) for part in PARTS]
    (turn, place), (last, goal) = arm.pose(start), arm.pose(end)
    tips, joints, near = (place + turn @ LEVER, goal + last @ LEVER), [], start
    for part in PARTS:
        led = between(turn, last, part)
        near = arm.joints(led, tips[0] + part * (tips[1] - tips[0]) - led @ LEVER, near)
        joints.append(near)
    return joints
