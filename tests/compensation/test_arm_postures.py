"""Postures along straight moves of an arm: each is the nearest to the one before."""

from __future__ import annotations

import numpy as np
from judge.arm import Arm
from judge.arm_files import MACHINE

from olp.compensation.joints.arm_postures import Settled, Wanted, nearest
from olp.files.kinematics.load import load_joint_machine
from olp.kinematics.parallel_arm import arm_of
from olp.kinematics.poses import Poses


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
            np.zeros(count, np.int64), np.arange(1, count + 1),
        )  # fmt: skip
        found = Settled(arm, wanted, postures, np.array([[-400.0] * 6, [400.0] * 6])).axes(middle)
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
        np.ones(1, np.int64),
    )  # fmt: skip
    found = Settled(arm, wanted, postures, np.array([[-400.0] * 6, [400.0] * 6])).axes(goal + 1.0)
    assert np.abs(found[0] - goal).max() < 1e-7
