"""A fit of wrong readings says what is wrong, also where the readings settle only together."""

from __future__ import annotations

from pathlib import Path

import pytest
from cases.joint_blunders import blunders
from cases.joint_campaigns import Campaign

import olp
from olp.reports.joint_fit import sentence_of


@pytest.mark.slow
def test_readings_that_settle_only_together_are_judged_all_the_same(tmp_path: Path) -> None:
    """Read-back values stand for commanded ones: four fifths of these lengths do not settle, all of them do.
    That was a refusal without a cause."""
    campaign = Campaign(tmp_path / "scara", "scara", "ball-bar", 0)
    (exchanged,) = (one for one in blunders(campaign) if one.kind == "read back")
    campaign.runs = list(exchanged.runs)
    fitted = olp.fit_joint_calibration(campaign.written(), campaign.folder / "machine.toml")
    (cause,) = (one.message for one in fitted.findings if one.code == "OLP810")
    assert "commanded values and those read back are in each other's columns" in cause
    assert fitted.unseen is None and "held_out" not in fitted.report
    assert sentence_of(fitted.report).startswith("No readings are held out: without the fifth")
