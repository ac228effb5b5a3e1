"""A fit of wrong readings says what is wrong, also where the readings settle only together."""

from __future__ import annotations

from pathlib import Path
from typing import NoReturn

import pytest
from cases.joint_blunders import blunders
from cases.joint_campaigns import Campaign

import olp
from olp.calibration.joints.adjustment import JointFit
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
