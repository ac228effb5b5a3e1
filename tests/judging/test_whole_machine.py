"""The judge of machines of any joints gives the poses of the golden cases, which two other implementations
agree on."""

from __future__ import annotations

import json
import tomllib

import numpy as np
import pytest
from judge.whole_machine import WholeMachine
from kinematics.cases import GOLDEN, STRUCTURES, need_golden


@pytest.mark.parametrize("name", STRUCTURES)
def test_the_judge_gives_the_golden_poses(name: str) -> None:
    need_golden()
    job = GOLDEN / name / "job.toml"
    stated = tomllib.loads(job.read_text("utf-8")) if job.exists() else {}
    payload = (stated.get("payload_kg", 0.0), stated.get("payload_centre_mm", (0.0, 0.0, 0.0)))
    judge = WholeMachine(GOLDEN / name / "machine.toml", payload)
    rows = json.loads((GOLDEN / f"{name}.json").read_text("utf-8"))["forward"]
    values = np.array([[row["axes"][axis] for axis in judge.order] for row in rows])
    for what in ("nominal", "actual"):
        found = judge.pose(values, what == "actual")
        place = np.array([row[f"{what}_position_mm"] for row in rows])
        turn = np.array([row[f"{what}_rotation"] for row in rows])
        assert np.abs(found[:, :3, 3] - place).max() < 2e-9
        assert np.abs(found[:, :3, :3] - turn).max() < 2e-12
