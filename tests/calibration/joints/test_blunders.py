"""A fit of wrong readings says what is wrong, also where the readings settle only together."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

import pytest
from cases.joint_blunders import blunders, outcome
from cases.joint_campaigns import Campaign

import olp
from olp.calibration.joints.adjustment import JointFit, LeftOut
from olp.calibration.joints.findings import without_worst
from olp.calibration.joints.readings import Reading
from olp.calibration.joints.unknowns import Model
from olp.core.errors import CannotCompute
from olp.reports.joint_fit import sentence_of
from olp.workflows import calibrate_joints


@pytest.mark.slow
def test_readings_that_settle_only_together_are_judged_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Read-back values stand for commanded ones, and without a fifth of the readings nothing settles: that
    was a refusal without a cause."""
    campaign = Campaign(tmp_path / "scara", "scara", "ball-bar", 0)
    (exchanged,) = (one for one in blunders(campaign) if one.kind == "read back")
    campaign.runs = list(exchanged.runs)

    def settles_nowhere(fit: JointFit) -> NoReturn:
        raise CannotCompute("these readings do not settle")

    monkeypatch.setattr(calibrate_joints, "held_out", settles_nowhere)
    fitted = olp.fit_joint_calibration(campaign.written(), campaign.folder / "machine.toml")
    (cause,) = (one.message for one in fitted.findings if one.code == "OLP810")
    assert "commanded values and those read back are in each other's columns" in cause
    assert fitted.unseen is None and "held_out" not in fitted.report
    assert sentence_of(fitted.report).startswith("No readings are held out: without the fifth")


@pytest.mark.slow
def test_a_mistake_that_no_reading_excludes_is_told_with_its_harm(tmp_path: Path) -> None:
    """The other sign of an R-test is that of all errors, and the readings fit as well: that was silent."""
    campaign = Campaign(tmp_path / "trunnion-ac", "trunnion-ac", "R-test", 0)
    (other,) = (one for one in blunders(campaign) if one.kind == "ball against tip")
    said = outcome(campaign, other)
    assert said.size > 20.0 and not said.alarms
    assert said.told


@pytest.mark.campaign
def test_one_wrong_value_of_a_leaning_ball_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It keeps even the nominal machine from settling, and was a refusal without a cause."""
    campaign = Campaign(tmp_path / "trunnion-ac", "trunnion-ac", "R-test", 0)
    (wrong,) = (one for one in blunders(campaign) if one.kind == "one value")
    campaign.runs, found = list(wrong.runs), list[LeftOut]()

    def without_it(model: Model, readings: Sequence[Reading]) -> JointFit:
        fit = without_worst(model, readings, 25.0)
        assert fit is not None
        found.extend(fit.left_out)
        return fit

    monkeypatch.setattr(calibrate_joints, "fit_or_refuse", without_it)
    olp.fit_joint_calibration(campaign.written(), campaign.folder / "machine.toml")
    assert [f" {one.row}" for one in found] == [wrong.words[1]]
