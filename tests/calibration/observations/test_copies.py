"""Readings that are there twice are no second readings, and what is evidently wrong with points is named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cases import volumetric
from cases.calibration import cloud, line_of
from judge import simulated

from olp.calibration.observations.base import Observation
from olp.calibration.observations.copies import refuse_copies, repeated_findings
from olp.calibration.observations.lines import Line
from olp.calibration.observations.points import Points

MACHINE = simulated.machine(3, "smooth")


def a_line(seed: int, decimals: int = 3) -> Line:
    targets = np.linspace(0.0, 3000.0, 7)
    line = line_of(simulated.take(MACHINE, np.random.default_rng(seed), "EXX", targets=targets, runs=3))
    return replace(line, value=np.round(line.value * 1e3, decimals) / 1e3)


POINTS = cloud(MACHINE, 7, 30, 5.0)
LINE = a_line(1)
COPY = replace(LINE, source="copy.csv")


def rows(points: Points, order: np.ndarray) -> Points:
    columns = {name: getattr(points, name)[order] for name in ("axis_mm", "tool_mm", "measured_mm", "row")}
    return replace(points, **columns)


@pytest.mark.parametrize(
    ("second", "refused"),
    [
        (COPY, True),
        (replace(COPY, value=-LINE.value), True),
        (replace(COPY, value=LINE.value + 1e-7), False),
        (a_line(2), False),
        (POINTS, False),
    ],
)
def test_a_copied_source_is_refused(second: Observation, refused: bool) -> None:
    found = list(refuse_copies([LINE, second]))
    assert bool(found) == refused
    assert not refused or "the same readings as" in str(found[0])


def test_lines_of_zeros_are_no_copies() -> None:
    nothing = replace(LINE, value=0.0 * LINE.value)
    assert not list(refuse_copies([nothing, nothing])) and not list(repeated_findings([nothing]))


def test_a_copied_run_and_copied_points_are_told() -> None:
    second = (LINE.run == 2) & (LINE.direction == 1)
    first = (LINE.run == 1) & (LINE.direction == 1)
    value = LINE.value.copy()
    value[second] = value[first]
    copied = replace(LINE, value=value)
    twice = rows(POINTS, np.r_[0:30, 0:6])
    told = list(repeated_findings([copied, twice]))
    assert [finding.code for finding in told] == ["OLP814", "OLP814"]
    assert "run 2 (+1) repeats run 1" in told[0].message and "6 of 36 rows" in told[1].message
    assert not list(repeated_findings([LINE, POINTS]))


@pytest.mark.parametrize("mixture", [name for name, (_, more) in volumetric.MIXTURES.items() if more])
def test_readings_of_every_instrument_are_no_copies_and_copies_of_them_are(mixture: str) -> None:
    """Readings of plates had no columns to compare, which ended with a traceback."""
    taken = volumetric.readings(MACHINE, mixture, 3).observations
    assert not list(refuse_copies(taken)) and not list(repeated_findings(taken))
    assert len(list(refuse_copies([*taken, taken[-1]]))) == 1


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (np.array([1.0, -1.0, 1.0]), "left-handed"),
        (np.array(1 / 25.4), "measured positions are in inches"),
        (np.array(1e-3), "measured positions are in m"),
        (np.array(25.4), "axis positions are in inches"),
        (np.array(1.0), ""),
    ],
)
def test_what_is_evidently_wrong_with_points_is_named(factor: np.ndarray, words: str) -> None:
    named = replace(POINTS, measured_mm=POINTS.measured_mm * factor).evident_mistake()
    assert words in named and bool(words) == bool(named)
