"""Postures along straight moves of an arm: each is the nearest to the one before."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from judge.arm import Arm
from judge.arm_files import MACHINE

from olp.compensation.joints.arm_postures import Settled, Wanted, nearest
from olp.core.arrays import Array
from olp.files.kinematics.load import load_joint_machine
from olp.kinematics.parallel_arm import arm_of
from olp.kinematics.poses import Poses
from olp.program.robots.inform import postures as inform
from olp.program.robots.krl import postures as krl
from olp.program.robots.ls import postures as ls
from olp.program.robots.rapid import postures as rapid


def nowhere(target: int, axes: Array) -> Poses:
    """No move here begins where only the axes are known."""
    raise AssertionError(target, axes)


def test_a_series_of_straight_moves_goes_on_near_by() -> None:
    """Also where the wrist is nearly straight, so that two postures are near each other."""
    judge, arm = Arm(MACHINE), arm_of(load_joint_machine(MACHINE).structure)
    assert arm is not None
    rng = np.random.default_rng(6)
    for middle in rng.uniform(-1, 1, (12, 6)) * [60, 20, 20, 60, 8, 60] + [0, 10, 30, 0, 0, 0]:
        joints = middle + np.cumsum(rng.uniform(-6, 6, (10, 6)), axis=0)
        poses = [judge.pose(own) for own in joints]
        flange = Poses(np.array([r for r, _ in poses]), np.array([p for _, p in poses]))
        postures, count = arm.postures(flange), len(joints)
        yes, no = np.ones(count, bool), np.zeros(count, bool)
        wanted = Wanted(
            flange, np.full((count, 6), np.nan), postures, np.isfinite(postures[:, :, 0]), yes, no, no, no,
            np.zeros(count, np.int64), np.full((count, 6), np.nan), no, np.arange(1, count + 1),
        )  # fmt: skip
        found = Settled(arm, wanted, postures, np.array([[-400.0] * 6, [400.0] * 6]), nowhere).axes(middle)
        last = middle
        for k in range(count):
            last = nearest(last[None], postures[k][None])[0]
            assert np.abs(found[k] - last).max() < 1e-9


def test_a_target_without_words_is_reached_near_by_where_other_postures_are_none() -> None:
    """Far out the arm does not get there from behind."""
    judge, arm = Arm(MACHINE), arm_of(load_joint_machine(MACHINE).structure)
    assert arm is not None
    goal = np.array([10.0, 75.0, -80.0, 20.0, 40.0, 30.0])
    rotation, place = judge.pose(goal)
    flange = Poses(rotation[None], place[None])
    postures, yes, no = arm.postures(flange), np.ones(1, bool), np.zeros(1, bool)
    there = np.isfinite(postures[:, :, 0])
    assert 0 < there.sum() < 8
    wanted = Wanted(
        flange, np.full((1, 6), np.nan), postures, there, no, no, yes, no, np.zeros(1, np.int64),
        np.full((1, 6), np.nan), no, np.ones(1, np.int64),
    )  # fmt: skip
    found = Settled(arm, wanted, postures, np.array([[-400.0] * 6, [400.0] * 6]), nowhere).axes(goal + 1.0)
    assert np.abs(found[0] - goal).max() < 1e-7


NO = [None, None, None]


@pytest.mark.parametrize(
    ("words", "before", "behind", "changed"),
    [
        # beyond the border by rounding: the word stays with the axis, and not where that goes on
        (lambda a, b: rapid.turns((0, 0, 0, 0), a, b), -0.001, -0.001, NO),
        (lambda a, b: rapid.turns((0, 0, 0, 0), a, b), -0.001, -0.1, [None, None, -1]),
        (lambda a, b: rapid.turns((0, 0, 0, 0), a, b), 0.001, -0.001, [None, None, -1]),
        (lambda a, b: krl.turns((2, 0), a, b), -0.001, -0.001, [None]),
        (lambda a, b: krl.turns((2, 0), a, b), -0.001, -0.1, [32]),
        (lambda a, b: krl.turns((2, 32), a, b), -0.001, 0.001, [0]),
        (lambda a, b: ls.turns((1, 1, 1, 0, 0, 0), a, b), 180.001, 180.001, NO),
        (lambda a, b: ls.turns((1, 1, 1, 0, 0, 0), a, b), 180.001, 180.1, [None, None, 1]),
        (lambda a, b: ls.turns((1, 1, 1, 0, 0, 0), a, b), 179.999, 180.001, [None, None, 1]),
        (lambda a, b: inform.turned((0, 0, 0, 0, 0, 0), a, b), 180.001, 180.001, None),
        (lambda a, b: inform.turned((0, 0, 0, 0, 0, 0), a, b), 180.001, 180.1, (0, 0, 0, 0, 0, 1)),
        (lambda a, b: inform.turned((0, 0, 0, 0, 0, 0), a, b), 179.999, 180.001, (0, 0, 0, 0, 0, 1)),
    ],
)
def test_words_that_are_right_within_rounding_stay_with_the_axis(
    words: Callable[[list[float], list[float]], Any], before: float, behind: float, changed: Any
) -> None:
    """An error of zero changes no byte of them."""
    found = words(*([10.0, 20.0, 30.0, 40.0, 50.0, last] for last in (before, behind)))
    if isinstance(changed, tuple):
        assert found is not None
        assert sum(found) == 1
    else:
        assert found == changed
