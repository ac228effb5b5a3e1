"""Random machines of every structure, with all sources of errors, judged by a computation of their own. The
whole campaign is `tests/benchmarks/bench_structures.py`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cases.any_judged import LIST, judged
from cases.any_machines import KINDS, write_machine
from cases.any_programs import waypoints
from cases.fast import left_to_a_campaign
from judge.whole_machine import WholeMachine

from olp.files.kinematics.load import load_joint_setup


@pytest.mark.parametrize("kind", KINDS)
def test_the_pose_is_that_of_another_computation(kind: str, tmp_path: Path) -> None:
    made, payload = write_machine(tmp_path, kind, 1)
    model = load_joint_setup(tmp_path / "machine.toml", tmp_path / "job.toml").kinematics
    judge, values = (
        WholeMachine(tmp_path / "machine.toml", payload),
        waypoints(made, np.random.default_rng(2), 4),
    )
    for actual in (False, True):
        found, wanted = (model.actual if actual else model.nominal)(values), judge.pose(values, actual)
        assert np.abs(found.position - wanted[:, :3, 3]).max() < 1e-9
        assert np.abs(found.rotation - wanted[:, :3, :3]).max() < 1e-11


#: By structure a seed and a form of the program.
CASES = [
    ("table/head", 3, "G43.4"), ("nutating head", 4, LIST), ("arm 6 with offsets", 2, LIST),
    ("rotary delta", 4, LIST), ("hexapod", 2, LIST),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "seed", "form"), CASES)
def test_a_program_is_within_tolerance_between_its_waypoints_too(kind: str, seed: int, form: str) -> None:
    told = judged(kind, form, seed, play=False)
    assert told.what == "right", told.words


def test_what_four_axes_can_turn_is_within_tolerance_beside_what_they_cannot() -> None:
    """A SCARA cannot tilt its tool; the turn about the vertical is met all the same, between waypoints, too:
    53 urad of tilt hid 5 urad of it."""
    told = judged("scara", LIST, 5, play=False)
    assert told.what == "right" and told.cost < 0.8, told.words


#: Programs near singular postures, and what comes of them: a stretched SCARA does not reach farther.
SINGULAR = [
    ("table/table", 2, LIST, "said"), ("head/head", 2, "G43.4", "said"), ("arm 6", 0, LIST, "said"),
    ("scara", 1, LIST, "refused"),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "seed", "form", "what"), left_to_a_campaign(SINGULAR, SINGULAR[:2]))
def test_near_singular_postures_the_tip_is_met_and_what_is_left_is_said(
    kind: str, seed: int, form: str, what: str
) -> None:
    told = judged(kind, form, seed, play=False, singular=True)
    assert told.what == what, told.words
