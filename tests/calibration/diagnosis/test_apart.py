"""Targets that are far apart are told with what they cost; enough of them are not."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from cases.calibration import measurements_of
from judge import simulated

from olp.calibration.diagnosis.apart import targets_apart
from olp.calibration.estimator.adjustment import fit
from olp.calibration.observations.lines import noise_of
from olp.core.errors import ConfigError


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


@pytest.mark.parametrize(("runs", "words"), [(1, "no repeated"), (2, "too few repeated")])
def test_a_line_whose_runs_show_no_noise_says_which_it_lacks(runs: int, words: str) -> None:
    machine = simulated.machine(11, "smooth")
    line = simulated.take(machine, np.random.default_rng(2), "EXX", targets=np.array([0.0, 3000.0]), runs=2)
    (taken,) = measurements_of([line]).lines
    use = (taken.run <= runs) & (taken.direction > 0)
    columns = {name: getattr(taken, name)[use] for name in ("target_mm", "value", "run", "direction", "row")}
    with pytest.raises(ConfigError, match=words):
        noise_of(dataclasses.replace(taken, **columns))
