"""A small version of the benchmark of planted blunders."""

from __future__ import annotations

import numpy as np
import pytest
from cases.blunders import ALARMS, LOUD, Blunder, blunders, clean_fit, noncentrality, outcome, readings

from olp.calibration.observations.circles import Circles
from olp.calibration.observations.diagonals import Diagonal

#: Kind of blunder, file, and what the lines are taken with.
PLANTED = (
    ("sign", "diagonal-0.csv", "circles"),
    ("direction", "diagonal-0.csv", "circles"),
    ("25.4", "circle-xy.csv", "circles"),
    ("handedness", "points.csv", "points"),
    ("another machine", "exx.csv", "points"),
    ("1000", "exx.csv", "points"),
    ("columns", "eax.csv", "points"),
    ("place", "exx.csv", "points"),
    ("scale", "points.csv", "points"),
    ("lever", "points.csv", "points"),
    ("scale", "station-0.csv", "stations"),
)


def planted(kind: str, source: str, mixture: str) -> Blunder:
    every = blunders(14, "smooth", mixture)
    return next(one for one in every if (one.kind, one.planted.source) == (kind, source))


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "source", "mixture"), PLANTED)
def test_no_loud_blunder_is_silent(kind: str, source: str, mixture: str) -> None:
    taken, clean = clean_fit(14, "smooth", mixture)
    assert not {finding.code for finding in clean.findings} & set(ALARMS)
    one = planted(kind, source, mixture)
    said = outcome(taken, clean, one)
    assert said.noncentrality >= LOUD
    assert said.alarms
    assert said.named or not one.words


@pytest.mark.slow
def test_a_blunder_that_changes_nothing_has_no_size() -> None:
    taken, clean = clean_fit(14, "smooth", "points")
    for index in (0, len(taken.observations) - 1):
        one = taken.observations[index]
        assert noncentrality(clean.fit, index, one, one) < 1e-6


@pytest.mark.slow
def test_what_may_be_wrong_with_diagonals_and_circles_is_undone_by_itself() -> None:
    """Reversing a sign, counting from the other end and turning an angle twice gives the readings again."""
    kinds = {"sign": "value", "order": "direction"}
    for one in readings(14, "smooth", "circles").observations:
        if not isinstance(one, Diagonal | Circles):
            continue
        for alternative in one.alternatives():
            if alternative.kind not in kinds:
                continue
            again = next(a for a in alternative.observation.alternatives() if a.words == alternative.words)
            name = kinds[alternative.kind]
            assert np.array_equal(getattr(again.observation, name), getattr(one, name))
            assert not np.array_equal(getattr(alternative.observation, name), getattr(one, name))
