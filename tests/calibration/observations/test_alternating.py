"""Runs on the way back that are all stated as forward ones show in their alternation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cases.calibration import line_of
from judge import simulated

from olp.calibration.observations.alternating import alternating_findings
from olp.calibration.observations.lines import Line

MACHINE = simulated.machine(3, "smooth")


def a_line(component: str, seed: int, runs: int) -> Line:
    """Runs there and back, each with a number of its own."""
    targets = np.linspace(0.0, 3000.0, 9)
    line = line_of(
        simulated.take(MACHINE, np.random.default_rng(seed), component, targets=targets, runs=runs)
    )
    return replace(line, run=2 * line.run + (line.direction < 0))


def one_way(line: Line) -> Line:
    return replace(line, direction=np.ones_like(line.direction))


def test_backward_runs_that_are_stated_as_forward_are_told() -> None:
    (told,) = alternating_findings([one_way(a_line("EXX", 1, 3))])
    assert told.code == "OLP815"
    backlash = -2e3 * float(MACHINE.half["EXX"])
    words = told.message.split("every other one reads ")[1].split()
    assert float(words[0]) == pytest.approx(backlash, abs=0.5) and words[1:] == ["um", "more"]


def test_stated_directions_and_runs_without_backlash_are_not() -> None:
    assert not list(alternating_findings([a_line("EXX", 1, 3)]))
    assert not list(alternating_findings([one_way(a_line("EXX", 1, 2))])), "four runs do not show it"
    for seed in range(40):
        line = one_way(a_line("EYX", seed, 4))
        drift = 5e-3 * np.argsort(np.argsort(line.run)) / len(line.run)
        assert not list(alternating_findings([line, replace(line, value=line.value + drift)]))


def test_an_alternation_as_small_as_noise_is_not_told() -> None:
    line = one_way(a_line("EYX", 1, 5))
    back = a_line("EYX", 1, 5).direction < 0
    value = np.random.default_rng(2).normal(0.0, 1e-3, len(back))
    assert not list(alternating_findings([replace(line, value=value + 1.5e-3 * back)]))
    assert list(alternating_findings([replace(line, value=value + 6e-3 * back)]))
