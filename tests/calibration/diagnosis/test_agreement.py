"""Each source against all others: planted mistakes are found and named, and nothing is found without one."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from cases.calibration import case, cloud, measurements_of, rays, residual_of, two_pods
from cases.fast import some_of_a_campaign
from judge import simulated
from judge.simulated import OFFSETS

from olp.calibration.diagnosis.agreement import Compared, _given, compared
from olp.calibration.diagnosis.agreement_report import agreement_findings, agreement_rows
from olp.calibration.diagnosis.mistakes import Agreement, Tried
from olp.calibration.estimator.adjustment import fit
from olp.calibration.observations.artefact import Artefact
from olp.calibration.observations.lines import Line
from olp.calibration.observations.measurements import Measurements
from olp.core.errors import CannotCompute, ConfigError
from olp.errormodel.quality import Fitted
from olp.workflows.calibrate_fit import fit_calibration

#: machine whose readings tell it, file, factor on its values, part of the words that name the mistake
PLANTED = (
    (103, "exx.csv", 1 / 25.4, "thousandths of an inch, taken as 0.001 mm"),
    (107, "ezz.csv", -1.0, "sign"),
    (109, "eyx.csv", 0.5, "half of what"),
    (103, "exz.csv", 2.0, "twice what"),
    (109, "ebx.csv", -1.0, "sign"),
    (107, "ecx.csv", 4.8481368, "urad, taken as arcsec"),
)
#: Machines without a mistake, and what their lines are measured with.
SOUND = (
    ("rough", 205, ""), ("rough", 206, "p"), ("smooth", 209, ""), ("smooth", 209, "p"), ("rough", 208, "p"),
    ("smooth", 209, "r"), ("rough", 207, "r"), ("rough", 206, ""), ("rough", 207, ""), ("rough", 208, ""),
)  # fmt: skip


def measured(
    seed: int, family: str, kinds: str, change: Callable[[Line], Line] | None = None
) -> Measurements:
    """A machine's lines, with 150 points of a tracker (p) or four stations (r), and some lines changed."""
    machine, taken = case(seed, family)
    observations = [line if change is None else change(line) for line in taken.lines]
    if "p" in kinds:
        observations.append(cloud(machine, seed, 150, 4.0))
    if "r" in kinds:
        observations += rays(machine, seed, 4, 60)
    return dataclasses.replace(taken, observations=tuple(observations))


def found(seed: int, family: str, kinds: str, change: Callable[[Line], Line] | None = None) -> Compared:
    machine, _ = case(seed, family)
    return compared(fit(measured(seed, family, kinds, change), machine.chain))


def times(file: str, factor: float) -> Callable[[Line], Line]:
    return lambda line: dataclasses.replace(line, value=factor * line.value) if line.source == file else line


def test_a_line_that_nothing_checks_may_be_of_another_machine() -> None:
    """What the report states of it is then what the line says; and it is never named."""
    machine = simulated.machine(11, "smooth")
    taken = simulated.take(machine, np.random.default_rng(2), "EXX", targets=np.linspace(0.0, 3000.0, 13))
    fitted = fit(measurements_of([taken]), machine.chain, travel_mm=machine.box.tolist())
    outcome = compared(fitted)
    (one,) = outcome.sources
    assert "machine" in kinds(one) and not outcome.wrong
    alone = dataclasses.replace(one, tried=tuple(tried for tried in one.tried if tried.kind == "machine"))
    (row,) = agreement_rows(Compared((alone,), (), ()), fitted, [(0.0, 0.0, -120.0)])
    q = np.linspace(0.0, 3000.0, 300)
    most = 1e3 * np.abs(fitted.curve("EXX", q) @ fitted.theta).max()
    assert row["hidden_harm_um"] == pytest.approx(most, rel=0.05)


def test_of_two_that_contradict_each_other_both_are_named() -> None:
    """A line of EAX stated as EBX, beside that of EBX: nothing tells which of both is which."""
    machine, rng = simulated.machine(11, "smooth"), np.random.default_rng(2)
    q = np.linspace(0.0, 3000.0, 13)
    both = [simulated.take(machine, rng, name, targets=q) for name in ("EAX", "EBX")]
    taken = measurements_of([dataclasses.replace(one, component="EBX") for one in both])
    lines = tuple(dataclasses.replace(line, source=f"{k}.csv") for k, line in enumerate(taken.lines))
    taken = dataclasses.replace(taken, observations=lines)
    fitted = fit(taken, machine.chain, travel_mm=machine.box.tolist())
    findings = list(agreement_findings(compared(fitted), fitted, []))
    # what is told as wrong is not listed as possible, too
    assert [one.code for one in findings] == ["OLP811"] * 2
    messages = [one.message for one in findings]
    for name, other in ("01", "10"):
        (own,) = (words for words in messages if words.startswith(f"{name}.csv"))
        assert f"or {other}.csv (EBX) is wrong instead" in own


def test_swapped_tool_vectors_of_pods_are_named_or_weighed() -> None:
    """No pose fits swapped tool vectors that differ; a single one is as if the pods stood elsewhere."""
    machine, _ = case(3, "smooth")
    pods = two_pods(machine, 3, 12)
    swapped = dataclasses.replace(pods, tool_mm=pods.tool_mm[:, [2, 1, 0]])
    with pytest.raises(CannotCompute, match="fits if X and Z of its tool vectors are swapped"):
        swapped.start()
    assert {one.kind for one in swapped.alternatives()} == {"scale"}
    single = dataclasses.replace(pods, tool_mm=pods.tool_mm[0])
    assert {one.kind for one in single.alternatives()} == {"scale", "columns", "tool"}


def kinds(one: Agreement) -> set[str]:
    """What is not excluded of a source."""
    return {tried.kind for tried in one.open}


def test_harm_is_looked_for_between_few_positions_and_is_that_of_a_machine() -> None:
    """A curve that differs only between the ends and the quarters of its axis, and one of a metre."""
    machine, _ = case(3, "smooth")
    taken = Measurements("m", (cloud(machine, 3, 30, 8.0),), chain=machine.chain)
    fitted = fit(taken, machine.chain)
    low, high = fitted.box_mm[0].tolist()
    q = np.linspace(low, high, 81)
    wave = 0.02 * np.sin(4.0 * np.pi * (q - low) / (high - low)) ** 2
    rows = fitted.curve("EXX", q)
    change = np.linalg.lstsq(rows, wave, rcond=1e-9)[0]
    most = 1e3 * float(np.abs(rows @ change).max())
    small = Tried("place", "it was read at another place", 0.0, 0.0, change=change)
    metre = dataclasses.replace(small, kind="columns", change=1e5 * change)
    one = Agreement("points.csv", "", Fitted("points.csv", 8.0, 8.0), (small, metre), 0.0)
    (row,) = agreement_rows(Compared((one,), (), ()), fitted, [(0.0, 0.0, -120.0)])
    assert row["not_excluded"] == "place"
    assert 0.8 * most < row["hidden_harm_um"] < 1.5 * most


@pytest.mark.slow
@pytest.mark.parametrize(("family", "seed", "kinds"), some_of_a_campaign(SOUND, 5))
def test_without_a_mistake_nothing_is_found(family: str, seed: int, kinds: str) -> None:
    outcome = found(seed, family, kinds)
    assert not outcome.wrong and not outcome.unlike


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "file", "factor", "words"), some_of_a_campaign(PLANTED, len(PLANTED)))
def test_a_planted_mistake_is_named(seed: int, file: str, factor: float, words: str) -> None:
    outcome = found(seed, "rough", "p", times(file, factor))
    assert [one.label for one in outcome.wrong] == [file]
    assert outcome.wrong[0].named is not None and words in outcome.wrong[0].named.words
    assert not outcome.unlike


@pytest.mark.parametrize("factor", [0.3, 4.8481368, 25.4])
@pytest.mark.parametrize("told", [0.0, 1e4])
def test_curves_of_another_size_are_as_if_all_was_adjusted_again(factor: float, told: float) -> None:
    """Where others tell nearly nothing of a curve, its covariance is its prior: a cluster of ones."""
    rng = np.random.default_rng(4)
    part, columns = np.arange(3, 9), np.arange(2, 14)
    root = rng.normal(size=(16, 16))
    prior = np.eye(16)
    prior[np.ix_(part, part)] = 1e4 * root[:6] @ root[:6].T
    heard, right = told * root[:, :4] @ root[:, :4].T, rng.normal(size=16)
    larger = prior.copy()
    larger[np.ix_(part, part)] /= factor**2
    place, own = np.searchsorted(columns, part), prior[np.ix_(part, part)]
    scaled, more = _given(prior + heard, right, columns).scaled(place, own, factor)
    again = _given(larger + heard, right, columns)
    assert np.allclose(scaled.root @ scaled.root.T, again.root @ again.root.T, rtol=1e-6, atol=1e-9)
    assert np.allclose(scaled.mean, again.mean, rtol=1e-6, atol=1e-9)

    def evidence(precision: np.ndarray) -> float:
        total = precision + heard
        logdet = np.linalg.slogdet(precision)[1] - np.linalg.slogdet(total)[1]
        return 0.5 * float(logdet + right @ np.linalg.solve(total, right))

    assert more == pytest.approx(evidence(larger) - evidence(prior), abs=1e-4)


@pytest.mark.slow
def test_two_mistakes_are_named() -> None:
    change = times("ezz.csv", -1.0)
    outcome = found(103, "rough", "p", lambda line: times("exz.csv", 2.0)(change(line)))
    named = {one.label: one.named.words for one in outcome.wrong if one.named is not None}
    assert set(named) == {"ezz.csv", "exz.csv"} and len(outcome.wrong) == 2
    assert "sign" in named["ezz.csv"] and "twice what" in named["exz.csv"]
    assert not outcome.unlike


@pytest.mark.slow
def test_a_line_of_another_machine_contradicts_without_a_cause() -> None:
    _, other = case(305, "rough", case(103, "rough")[0].chain)
    lines = {line.source: line for line in other.lines}
    outcome = found(103, "rough", "p", lambda line: lines[line.source] if line.source == "exx.csv" else line)
    assert [one.label for one in outcome.unlike] == ["exx.csv"]
    assert not outcome.wrong


@pytest.mark.slow
def test_what_nothing_else_measures_is_said_to_be_unchecked() -> None:
    """With lines alone nothing tells the sign of a scale, and points do."""
    outcome = found(106, "smooth", "")
    possible = {one.label: kinds(one) for one in outcome.sources}
    assert {"sign", "unit"} <= set(possible["exx.csv"])
    machine, _ = case(106, "smooth")
    fitted = fit(measured(106, "smooth", ""), machine.chain)
    (finding,) = agreement_findings(outcome, fitted, [(0.0, 0.0, -200.0)])
    assert finding.code == "OLP812" and "exx.csv (EXX)" in finding.message
    with_points = {one.label: kinds(one) for one in found(106, "smooth", "p").sources}
    assert "sign" not in with_points["exx.csv"]
    # an angle cannot be another one, where points tell; lever arms that are off by little never show
    assert "columns" not in with_points["eax.csv"]
    assert "place" in with_points["eyx.csv"]
    rows = {row["file"]: row for row in agreement_rows(outcome, fitted, [])}
    assert "sign" in rows["exx.csv"]["not_excluded"]
    # a wrong sign is twice what the line says
    low, high = fitted.box_mm[0].tolist()
    q = np.linspace(low, high, 5)
    most = 2000.0 * np.abs(fitted.curve("EXX", q) @ fitted.theta).max()
    assert rows["exx.csv"]["hidden_harm_um"] > 0.99 * most


def plate(machine: simulated.Machine, wrong: str) -> Artefact:
    """Twelve balls 0.12 mm off a grid of 390 x 310 mm, touched in four poses with one tool."""
    rng = np.random.default_rng(1)
    balls = np.array([(x, y, 0.0) for x in (0.0, 130.0, 260.0, 390.0) for y in (0.0, 150.0, 310.0)])
    longer = 1.0 + 9e-5 * (wrong == "certificate")
    low, size = machine.box[:, 0], np.ptp(machine.box, axis=1)
    tool = np.array((0.0, 0.0, -120.0))
    stops = []
    lying = (0, (0.2, 0.2, 0.3)), (1, (0.7, 0.3, 0.5)), (2, (0.7, 0.8, 0.7)), (0, (0.4, 0.5, 0.2))
    for quarter, share in lying:
        c, s = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0))[quarter]
        wanted = longer * balls @ np.array(((c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0))) + low + size * share
        stop = wanted
        for _ in range(6):
            stop = wanted - machine.error(stop, np.broadcast_to(tool, stop.shape))
        stops.append(stop + rng.normal(0.0, 1e-3, stop.shape))
    axis_mm = np.concatenate(stops)
    ball = np.tile(np.arange(len(balls)), len(stops))
    return Artefact(
        axis_mm[:, [1, 0, 2]] if wrong == "columns" else axis_mm, tool,
        len(balls) - 1 - ball if wrong == "numbers" else ball, np.repeat(np.arange(4), len(balls)), balls,
        np.full(len(balls), 5e-4), 1e-3, "plate.csv",
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wrong", "words"),
    some_of_a_campaign(
        [
            ("numbers", "counted from the other end"),
            ("certificate", "certificate is that of another artefact"),
            ("columns", "X and Y of its axis positions are swapped"),
            ("", ""),
        ],
        4,
    ),
)
def test_a_mistake_of_an_artefact_is_named(wrong: str, words: str) -> None:
    machine, taken = case(106, "smooth")
    whole = dataclasses.replace(taken, observations=(*taken.lines, plate(machine, wrong)))
    outcome = compared(fit(whole, machine.chain))
    named = [(one.label, one.named.words) for one in outcome.wrong if one.named is not None]
    assert not outcome.unlike
    assert len(named) == (wrong != "")
    assert all(label == "plate.csv" and words in said for label, said in named)


def test_a_cause_that_is_not_sought_is_listed_and_never_named() -> None:
    """As where another place explains a source a little better that agrees with all others."""
    sought = Tried("place", "it was read at another place", 40.0, 40.0)
    only_listed = dataclasses.replace(sought, sought=False)
    for tried, named in ((sought, sought), (only_listed, None)):
        one = Agreement("eyx.csv", "EYX", Fitted("eyx.csv", 8.0, 8.0), (tried,), 0.0)
        assert one.named is named
        assert kinds(one) == {"place"}


def test_a_cause_that_the_others_do_not_confirm_is_stated_and_not_named() -> None:
    """As a wrong unit of an angle that little checks: leaving it out is as good."""
    misfit = Fitted("eax.csv", 60.0, 8.0)
    unit = Tried("unit", "its values are mm/m, taken as um/m", 67.5, -1.9)
    for tried, likely in (
        (unit, unit.words),
        # it explains too little of what is contradicted, or too little at all
        (dataclasses.replace(unit, log_odds=60.0), ""),
        (dataclasses.replace(unit, sought=False), ""),
    ):
        one = Agreement("eax.csv", "EAX", misfit, (tried,), 69.4)
        assert one.named is None and one.contradicts
        assert one.likely == likely


def test_what_explains_a_wrong_source_best_is_named_even_if_it_is_not_sought() -> None:
    """Half of its values explains a line read elsewhere in part; that it was read elsewhere, in full. What is
    less than 100 times as probable as the other is told with it."""
    place = Tried("place", "it was read at another place", 24.0, 20.0, sought=False)
    half = Tried("factor 2", "its values are twice what they should be", 16.5, 15.6)
    one = Agreement("exy.csv", "EXY", Fitted("exy.csv", 30.0, 10.0), (place, half), 0.9)
    assert one.named is place
    assert one.causes == place.words
    near = dataclasses.replace(place, log_odds=13.0)
    assert dataclasses.replace(one, tried=(half, near)).causes == f"{half.words}, or {place.words}"
    # alone it would not be named: its odds are too small, and the others hardly confirm it
    sign = Tried("sign", "the sign of its values is reversed", 13.0, 1.4)
    assert dataclasses.replace(one, tried=(half, sign)).causes == f"{half.words}, or {sign.words}"
    unconfirmed = dataclasses.replace(place, support=0.0)
    assert dataclasses.replace(one, tried=(unconfirmed, half)).named is half


@pytest.mark.slow
def test_a_left_handed_frame_is_no_machine() -> None:
    machine, taken = case(106, "smooth")
    points = cloud(machine, 106, 40, 8.0)
    mirrored = dataclasses.replace(points, measured_mm=points.measured_mm * np.array((1.0, -1.0, 1.0)))
    whole = dataclasses.replace(taken, observations=(*taken.lines, mirrored), chain=machine.chain)
    with pytest.raises(ConfigError, match=r"not those of one machine.*points\.csv.*left-handed"):
        fit_calibration(whole)


@pytest.mark.slow
@pytest.mark.parametrize("seed", some_of_a_campaign((211, 215, 204, 205), 4))
def test_lines_and_readings_with_several_tools_agree(seed: int) -> None:
    """Lines off the datum turn the frame of the curves against tool vectors: tools show that turn."""
    machine, _ = case(seed, "smooth")
    fitted = fit(measured(seed, "smooth", "r"), machine.chain)
    assert fitted.chi_square / fitted.freedom < 1.2
    assert not fitted.outliers
    for tool in OFFSETS:
        assert residual_of(machine, fitted, tool).after < 2.0
