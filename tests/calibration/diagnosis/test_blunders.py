"""A small version of the benchmark of planted blunders."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from cases import volumetric
from cases.blunders import (
    ALARMS,
    LOUD,
    MIXTURES,
    OTHER,
    Blunder,
    blunders,
    clean_fit,
    outcome,
    readings,
    size,
)
from cases.fast import left_to_a_campaign, some_of_a_campaign
from judge import families

from olp.calibration.diagnosis.agreement import compared
from olp.calibration.diagnosis.agreement_report import agreement_rows
from olp.calibration.estimator.adjustment import fit
from olp.calibration.observations.circles import Circles
from olp.calibration.observations.diagonals import Diagonal
from olp.workflows.calibrate_fit import fit_calibration

#: Kind of blunder, file, and what the lines are taken with.
PLANTED = (
    ("25.4", "circle-xy.csv", "circles"),
    ("another machine", "exx.csv", "points"),
    ("columns", "eax.csv", "points"),
    ("scale", "points.csv", "points"),
)
#: Those of a campaign: kinds that another test of this folder plants too, and sources that cost more.
MORE = (
    ("sign", "diagonal-0.csv", "circles"),
    ("direction", "diagonal-0.csv", "circles"),
    ("handedness", "points.csv", "points"),
    ("1000", "exx.csv", "points"),
    ("place", "exx.csv", "points"),
    ("lever", "points.csv", "points"),
    ("scale", "station-0.csv", "stations"),
    ("scale", "pods.csv", "pods"),
)


def planted(kind: str, source: str, mixture: str) -> Blunder:
    every = blunders(14, "smooth", mixture)
    return next(one for one in every if (one.kind, one.planted.source) == (kind, source))


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "source", "mixture"), left_to_a_campaign((*PLANTED, *MORE), MORE))
def test_no_loud_blunder_is_silent(kind: str, source: str, mixture: str) -> None:
    taken, clean = clean_fit(14, "smooth", mixture)
    assert not {finding.code for finding in clean.findings} & set(ALARMS)
    one = planted(kind, source, mixture)
    said = outcome(taken, clean, one)
    assert said.noncentrality >= LOUD
    assert said.alarms
    assert said.named or not one.words


#: Blunders that once passed in silence: seed, family and mixture of the machine, kind, file.
ONCE_SILENT = (
    (105, "smooth", "stations", "lever", "ezx.csv"),
    # what speaks for it is below a difference of six standard deviations
    (200, "smooth", "points", "4.848", "eay.csv"),
    (49, "tables", "stations", "1000", "ebx.csv"),
    # three lines of one component share the ripple at its targets
    (3107, "screws", "stations", "lever", "eyz.csv"),
)


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "family", "mixture", "kind", "source"), some_of_a_campaign(ONCE_SILENT, 2))
def test_what_once_was_silent_is_named(seed: int, family: str, mixture: str, kind: str, source: str) -> None:
    """A lever arm beside a misfit just below what speaks against the line, an angle that little checks, and
    values below all noise."""
    whole = readings(seed, family, mixture)
    one = next(
        one for one in blunders(seed, family, mixture) if (one.kind, one.planted.source) == (kind, source)
    )
    taken = [*whole.observations]
    taken[one.index] = one.planted
    assert whole.chain is not None
    found = compared(fit(dataclasses.replace(whole, observations=tuple(taken)), whole.chain))
    named = {wrong.label: wrong.named.words for wrong in found.wrong if wrong.named is not None}
    assert list(named) == [source]
    assert one.words in named[source]
    assert not found.unlike


@pytest.mark.slow
def test_what_is_not_named_is_told_beforehand() -> None:
    """The sign of an angle that little checks: the report states at least half of what it does."""
    whole = readings(84, "tables", "points")
    assert whole.chain is not None
    one = next(
        one
        for one in blunders(84, "tables", "points")
        if (one.kind, one.planted.source) == ("sign", "eby.csv")
    )
    taken = [*whole.observations]
    taken[one.index] = one.planted
    clean, bad = (
        fit(dataclasses.replace(whole, observations=tuple(some)), whole.chain)
        for some in (whole.observations, taken)
    )
    place, tool = np.random.default_rng(3).uniform(*bad.box_mm.T, (60, 3)), np.zeros(3)
    harm = 1e3 * np.linalg.norm(bad.error(place, tool) - clean.error(place, tool), axis=1).max()
    rows = {row["file"]: row for row in agreement_rows(compared(bad), bad, [])}
    assert "sign" in rows["eby.csv"]["not_excluded"]
    assert rows["eby.csv"]["hidden_harm_um"] > 0.5 * harm


@pytest.mark.slow
def test_what_only_tools_beside_an_axis_show_is_told() -> None:
    """An angle in the wrong unit, which acts on such tools alone. Only its size speaks against it."""
    taken, clean = clean_fit(70, "smooth", "pods")
    every = blunders(70, "smooth", "pods")
    one = next(one for one in every if (one.kind, one.planted.source) == ("4.848", "ecy.csv"))
    said = outcome(taken, clean, one)
    assert not said.alarms and said.redundancy < 0.1
    assert said.harm_um > 10.0
    assert said.told


@pytest.mark.slow
def test_a_blunder_that_changes_nothing_has_no_size() -> None:
    taken, clean = clean_fit(14, "smooth", "points")
    for index in (0, len(taken.observations) - 1):
        one = taken.observations[index]
        assert size(clean.fit, index, one, one).noncentrality < 1e-6


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


@pytest.mark.slow
def test_of_two_lines_that_explain_it_alike_both_are_named() -> None:
    """Lines against the two legs of one square: which of them ran the other way, nothing else tells."""
    whole = readings(3013, "dents", "pods")
    assert whole.chain is not None
    taken = [*whole.observations]
    one = next(
        one
        for one in blunders(3013, "dents", "pods")
        if (one.kind, one.planted.source) == ("direction", "ezx.csv")
    )
    taken[one.index] = one.planted
    found = compared(fit(dataclasses.replace(whole, observations=tuple(taken)), whole.chain))
    assert {wrong.label: wrong.rivals for wrong in found.wrong} == {
        "ezx.csv": ("exz.csv (EXZ)",),
        "exz.csv": ("ezx.csv (EZX)",),
    }


@pytest.mark.slow
def test_a_station_of_another_machine_is_not_taken_for_ripple() -> None:
    whole = readings(3048, "dents", "stations")
    assert whole.chain is not None
    taken = [
        other if one.source == "station-1.csv" else one
        for one, other in zip(
            whole.observations, readings(3048 + OTHER, "dents", "stations").observations, strict=True
        )
    ]
    found = compared(fit(dataclasses.replace(whole, observations=tuple(taken)), whole.chain))
    assert [one.label for one in found.unlike] == ["station-1.csv"]
    assert found.unlike[0].unlike_its_kind


#: Sound readings that once raised alarms: seed, family, and what reads the machine.
ONCE_ALARMED = (
    # a gear's wave at the targets of EYY, which points beside them do not see
    (20207, "screws", "lines5+points"),
    # a ball-bar in the middle of Z, and an EZZ that it would see as well if it were tiny
    (20148, "rails", "lines5+ballbars"),
    # kinks between targets, and stations that read far better than curves are known there
    (20044, "joints", "stations"),
    (20296, "joints", "artefacts"),
)


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "family", "mixture"), some_of_a_campaign(ONCE_ALARMED, 2))
def test_sound_readings_raise_no_alarm(seed: int, family: str, mixture: str) -> None:
    if mixture in MIXTURES:
        taken = readings(seed, family, mixture)
    else:
        taken = volumetric.readings(families.machine(seed, family), mixture, seed)
    assert not {finding.code for finding in fit_calibration(taken).findings} & set(ALARMS)
