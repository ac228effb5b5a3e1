"""Axis values of stated poses on serial machines: the way from axes to poses and back, in every branch."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from olp.core.errors import ConfigError, NotInvertible
from olp.kinematics.chain import Kinematics
from olp.kinematics.coordinates import Coordinates, poses_of_axes, turns_of
from olp.kinematics.pose_axes import SINGULAR, axes_of_poses, posed, stated_mobility
from olp.kinematics.programmed import stated_targets
from olp.kinematics.structure import Gauge, Joint, Structure

RNG = np.random.default_rng(3)
X, Y, Z = np.eye(3)
TOOL = (12.0, -7.0, -55.0)
Rows = list[tuple[str, np.ndarray, tuple[float, float, float]]]

PLANES: dict[str, Rows] = {
    "scara": [
        ("rotary", Z, (0, 0, 0)), ("rotary", -Z, (300, 0, 0)), ("linear", -Z, (0, 0, 0)),
        ("rotary", -Z, (500, 20, 0)),
    ],
    "scara on a column": [("linear", Z, (0, 0, 0)), ("rotary", Z, (0, 0, 0)), ("rotary", Z, (300, 0, 0))],
    "scara on a wall": [
        ("rotary", -Y, (0, 0, 0)), ("rotary", Y, (300, 0, 0)), ("rotary", Y, (500, 0, 9)),
        ("linear", Y, (0, 0, 0)),
    ],
    "polar": [("rotary", -Z, (5, 3, 0)), ("linear", X, (0, 0, 0)), ("linear", Z, (0, 0, 0))],
    "polar with a wrist": [
        ("rotary", Z, (5, 3, 0)), ("linear", Z, (0, 0, 0)), ("linear", X, (0, 0, 0)),
        ("rotary", Z, (200, 30, 0)),
    ],
    "arm on a slide": [("linear", Y, (0, 0, 0)), ("rotary", Z, (5, 3, 0)), ("linear", Z, (0, 0, 0))],
}  # fmt: skip
ARMS: dict[str, Rows] = {
    "arm": [
        ("rotary", Z, (0, 0, 400)), ("rotary", Y, (30, 0, 400)), ("rotary", Y, (30, 0, 800)),
        ("rotary", X, (400, 0, 850)), ("rotary", Y, (400, 0, 850)), ("rotary", X, (400, 0, 850)),
    ],
    "light arm": [
        ("rotary", Z, (0, 0, 90)), ("rotary", Y, (0, 130, 90)), ("rotary", Y, (425, 10, 90)),
        ("rotary", Y, (817, 120, 90)), ("rotary", -Z, (817, 120, 90)), ("rotary", Y, (817, 120, -5)),
    ],
}  # fmt: skip


def machine_of(rows: Rows, values: np.ndarray) -> Kinematics:
    names = [f"{'LR'[kind == 'rotary']}{k}" for k, (kind, _, _) in enumerate(rows)]
    joints = {
        name: Joint(name, kind, tuple(direction), point, (-1e4, 1e4))  # type: ignore[arg-type]
        for name, (kind, direction, point) in zip(names, rows, strict=True)
    }
    gauge = Gauge((480.0, 60.0, 30.0), (10.0, 20.0, 30.0))
    bare = Structure("m", ("F", *names), joints, gauge=gauge, symmetric_tool=False)
    return Kinematics(posed(bare, True, dict(zip(names, values.tolist(), strict=True))), tool_mm=TOOL)


@pytest.mark.parametrize("kind", [*PLANES, *ARMS])
def test_axes_come_back_in_the_branch_of_the_posture(kind: str) -> None:
    rows = (PLANES | ARMS)[kind]
    turning, seen = np.array([row[0] == "rotary" for row in rows]), set()
    most, bounded = np.where(turning, 170.0, 900.0), turning.copy()
    # of four axes the last one that turns is a wrist
    bounded[np.flatnonzero(turning)[-1]] = len(rows) != 4
    for _ in range(4):
        posture = RNG.uniform(-most, most)
        try:
            machine = machine_of(rows, posture)
        except ConfigError:
            continue
        near = posture + RNG.uniform(-0.05, 0.05, (9, len(rows)))
        # how many turns a wrist has made is stated by whole turns of words alone
        off = (axes_of_poses(machine, poses_of_axes(machine, near)) - near + 180.0) % 360.0 - 180.0
        assert np.abs(off).max() < 1e-7
        # of values far away some are in this branch, and those of the others have another one here
        values = RNG.uniform(-most, most, (40, len(rows)))
        words = poses_of_axes(machine, values)
        try:
            found = axes_of_poses(machine, words)
        except NotInvertible as error:
            words, values = (np.delete(part, list(error.rows), axis=0) for part in (words, values))
            found = axes_of_poses(machine, words)
        assert np.abs(found - posture)[:, bounded].max() <= 180.0
        again = poses_of_axes(machine, found)
        assert np.abs(Coordinates.of_words(machine.structure).beside(again, words) - words).max() < 1e-6
        away = np.abs(np.where(turning, (found - values + 180.0) % 360.0 - 180.0, found - values))
        seen |= set((away.max(axis=1) < 1e-5).tolist())
    assert seen == {True, False}


def test_a_posture_where_branches_meet_is_refused() -> None:
    machine = machine_of(PLANES["scara"], np.array([10.0, 40.0, 0.0, 0.0]))
    bare = replace(machine.structure, posture=None)
    axes = dict(zip(bare.order, (10.0, 6.0, 0.0, 0.0), strict=True))
    with pytest.raises(ConfigError, match="singular"):
        posed(bare, True, axes)
    assert stated_mobility(machine, np.array([[10.0, 6.0, 0.0, 0.0]]))[0] < SINGULAR
    assert stated_mobility(machine, np.array([[10.0, 8.0, 0.0, 0.0]]))[0] > SINGULAR


def test_words_of_a_wrist_state_whole_turns() -> None:
    machine = machine_of(PLANES["scara"], np.array([10.0, 40.0, 0.0, 0.0]))
    words = poses_of_axes(machine, np.array([[12.0, 50.0, 5.0, 7.0]]))
    turned = words + np.array([0.0, 0.0, 0.0, 720.0])
    assert axes_of_poses(machine, turned) == pytest.approx(np.array([[12.0, 50.0, 5.0, 7.0 - 720.0]]))


def test_the_letter_is_that_of_the_axis() -> None:
    bare = {
        kind: replace(machine_of(rows, 40.0 + 17.0 * np.arange(len(rows))).structure, posture=None)
        for kind, rows in (PLANES | ARMS).items()
    }
    letters = {kind: turns_of(structure) for kind, structure in bare.items()}
    assert letters == {
        "scara": "C", "scara on a column": "", "scara on a wall": "B", "polar": "", "polar with a wrist": "C",
        "arm on a slide": "", "arm": "ABC", "light arm": "ABC",
    }  # fmt: skip


@pytest.mark.parametrize("kind", [*PLANES, *ARMS])
def test_targets_are_where_the_axes_bring_the_tool(kind: str) -> None:
    rows = (PLANES | ARMS)[kind]
    posture = np.arange(40.0, 40.0 + 17.0 * len(rows), 17.0)
    machine = machine_of(rows, posture)
    values = posture + RNG.uniform(-3.0, 3.0, (5, len(rows)))
    stated, there = stated_targets(machine, poses_of_axes(machine, values)), machine.nominal(values)
    assert np.abs(stated.position - there.position).max() < 1e-9
    assert np.abs(stated.rotation - there.rotation).max() < 1e-9


def test_words_beside_others_state_the_same() -> None:
    rows = ARMS["arm"]
    words = Coordinates.of_words(machine_of(rows, np.array([0.0, 20.0, 30.0, 40.0, 50.0, 60.0])).structure)
    found = np.array([[0.0, 0.0, 0.0, 10.0, 60.0, -20.0], [0.0, 0.0, 0.0, -179.0, 2.0, 5.0]])
    near = np.array([[0.0, 0.0, 0.0, 190.0, 121.0, 159.0], [0.0, 0.0, 0.0, 180.0, 0.0, 360.0]])
    beside = words.beside(found, near)
    assert beside[:, 3:] == pytest.approx(np.array([[190.0, 120.0, 160.0], [181.0, 2.0, 365.0]]))
