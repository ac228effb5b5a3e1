"""Targets that are far apart are told with what they cost; enough of them are not."""

from __future__ import annotations

import numpy as np
import pytest
from cases.calibration import measurements_of
from judge import simulated

from olp.calibration.diagnosis.apart import targets_apart
from olp.calibration.estimator.adjustment import fit


@pytest.mark.parametrize(("count", "told"), [(7, True), (61, False)])
def test_few_targets_are_told_with_what_they_cost(count: int, told: bool) -> None:
    machine = simulated.machine(11, "smooth")
    q = np.linspace(0.0, 3000.0, count)
    rng = np.random.default_rng(2)
    line = simulated.take(machine, rng, "EXX", targets=q, runs=2)
    fitted = fit(measurements_of([line]), machine.chain, travel_mm=machine.box.tolist())
    findings = list(targets_apart(fitted))
    assert [one.code for one in findings] == (["OLP813"] if told else [])
    assert not told or "between 7 targets up to 500 mm apart" in findings[0].message
