"""The fit of a machine of any joints: recovery, stated uncertainty, what is left out, and mistakes told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from calibration.joints.simulated import SIGMA, TOOL, read, true_machine
from cases.fast import some_of_a_campaign
from cases.joint_campaigns import Campaign

from olp.calibration.joints import adjustment
from olp.calibration.joints.adjustment import JointFit, fit_joints, held_out
from olp.calibration.joints.candidates import Priors
from olp.calibration.joints.findings import fit_or_refuse, joint_findings
from olp.calibration.joints.readings import Points
from olp.calibration.joints.unknowns import model_of
from olp.core.arrays import Array
from olp.core.errors import CannotCompute, ConfigError
from olp.core.rigid_fit import fit_points
from olp.kinematics.errors import Mass, Payload

FAST = ("xyzac_trunnion", "scara")
SLOW = (
    "arm_6r_kr6",
    *("arm_7r_on_track", "gantry_nutating", "gantry_wrist", "hexapod", "linear_delta", "linuxcnc_puma560"),
    *("polar_rppr", "tripod", "xyzbc_head_table"),
)
CASES = [(name, "points") for name in FAST]
REST = [(name, kind) for name in FAST for kind in ("poses", "lengths")]
REST += [(name, kind) for name in SLOW for kind in ("points", "poses")]

#: One of each kind of joints and readings; the others take longer.
SOME = [(name, "lengths") for name in FAST]
SOME += [(name, "poses") for name in ("arm_6r_kr6", "gantry_nutating", "hexapod", "polar_rppr", "tripod")]


def whitened(fit: JointFit, theta: Array) -> Array:
    """(k,) independent combinations of the error of the unknowns, each over its stated sigma."""
    scale = fit.sigma
    factor = np.linalg.cholesky(fit.covariance / np.outer(scale, scale))
    return np.asarray(np.linalg.solve(factor, (fit.theta - theta) / scale))


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        *CASES,
        *(pytest.param(*case, marks=pytest.mark.slow) for case in REST if case in SOME),
        *(pytest.param(*case, marks=pytest.mark.campaign) for case in REST if case not in SOME),
    ],
)
def test_what_is_measured_is_found(name: str, kind: str) -> None:
    """Without noise the fit is what the machine is less the pull of the prior, which linear theory states:
    where the readings show an unknown s times better than its prior, the share 1 / (1 + s^2) of it is lost.
    The readings then keep s / (1 + s^2) of it, at most a half. With noise its residuals are the noise, also
    of readings that had no part."""
    model, theta, values = true_machine(name)
    pose = model.machine(theta).actual(values)
    exact = fit_joints(model, [read(kind, pose, values, noise=0.0)])
    pull = exact.covariance @ model.precision @ theta
    assert np.abs((exact.theta - (theta - pull)) / exact.sigma).max() < 0.05
    assert exact.chi_square < 0.25 * theta @ model.precision @ theta
    fit = fit_joints(model, [read(kind, pose, values)])
    assert 0.6 < fit.chi_square / fit.freedom < 1.4
    unseen = held_out(fit)
    assert unseen is not None
    before, after = (float(np.sqrt(np.mean(off**2))) for off in unseen)
    components = 1.0 if kind == "lengths" else 3.0
    assert after < 2.2 * SIGMA * np.sqrt(components)
    assert before > after or name in ("tripod", "hexapod")


def coverage(name: str, kind: str, runs: int, count: int = 60) -> tuple[float, float]:
    """The rms of the error of independent combinations of unknowns over what is stated, and the share of them
    within two sigma."""
    off = []
    for seed in range(runs):
        model, theta, values = true_machine(name, seed, count)
        fit = fit_joints(model, [read(kind, model.machine(theta).actual(values), values, seed)])
        # what is stated without the factor of a fit that is worse than its noise
        off.append(whitened(fit, theta) * np.sqrt(max(1.0, fit.chi_square / fit.freedom)))
    every = np.concatenate(off)
    return float(np.sqrt(np.mean(every**2))), float(np.mean(np.abs(every) < 2.0))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "kind", "runs"),
    some_of_a_campaign([
        ("gantry_wrist", "lengths", 15), ("xyzac_trunnion", "points", 15), ("tripod", "points", 25),
        ("arm_6r_kr6", "points", 12), ("polar_rppr", "lengths", 15),
    ], 5),
)  # fmt: skip
def test_the_fit_is_as_good_as_the_readings_allow(name: str, kind: str, runs: int) -> None:
    """The covariance of a linear Gaussian fit is the information limit: errors are within 1.15 of it. There
    are so many runs that 0.15 is three times the scatter of the ratio, 1 / sqrt(2 * runs * unknowns)."""
    ratio, covered = coverage(name, kind, runs)
    assert 0.85 < ratio < 1.15
    assert 0.92 <= covered <= 0.98


@pytest.mark.slow
@pytest.mark.parametrize(("structure", "instrument"), [("trunnion-ac", "R-test"), ("scara", "6D")])
def test_stated_uncertainty_is_the_information_limit(structure: str, instrument: str, tmp_path: Path) -> None:
    """Also of what the readings do not show: there all errors of a machine count, not those alone that are
    kept. Of the limit the judge knows the size of these errors, and the fit the noise."""
    score = Campaign(tmp_path / structure, structure, instrument, 0).score()
    assert 0.93 < score.stated_um / score.limit_um < 1.15
    # and on average the tip is off by the limit and by what parts the fit from the best one
    assert np.hypot(score.limit_um, score.beside_um) < 1.15 * score.limit_um


def test_a_few_campaigns_are_as_good_as_stated() -> None:
    ratio, covered = coverage("xyzac_trunnion", "points", 3, 40)
    assert 0.75 < ratio < 1.25
    assert covered > 0.85


@pytest.mark.slow
def test_uncertainty_in_the_best_frame_is_what_poses_are_off() -> None:
    model, theta, values = true_machine("arm_6r_kr6")
    true = model.machine(theta).actual(values).at(np.array(TOOL))
    fit = fit_joints(model, [read("points", model.machine(theta).actual(values), values)])
    found = fit.model.machine(fit.theta).actual(values).at(np.array(TOOL))
    off = fit_points(found, true)(found) - true
    stated = fit.sigma_in_best_frame(values, np.array(TOOL))[0]
    assert np.sqrt(np.mean(off**2)) == pytest.approx(np.sqrt(np.mean(stated**2)), rel=0.4)
    assert np.all(fit.sigma_at(values, np.array(TOOL))[0].mean(axis=0) > stated.mean(axis=0))


@pytest.mark.slow
def test_far_readings_are_left_out_with_their_lines() -> None:
    model, theta, values = true_machine("arm_6r_kr6")
    reading = read("points", model.machine(theta).actual(values), values)
    assert isinstance(reading, Points)
    wrong = reading.measured_mm.copy()
    wrong[7] += (0.5, 0.0, 0.0)
    fit = fit_joints(model, [replace(reading, measured_mm=wrong)])
    assert [(out.source, out.row) for out in fit.left_out] == [("points.csv", 9)]
    clean = fit_joints(model, [reading])
    assert np.abs((fit.theta - clean.theta) / clean.sigma).max() < 1.0
    (finding,) = joint_findings(fit, [reading])
    assert (finding.code, "lines 9" in finding.message) == ("OLP802", True)


def test_two_instruments_join_in_one_fit() -> None:
    model, theta, values = true_machine("xyzac_trunnion")
    pose = model.machine(theta).actual(values)
    alone = fit_joints(model, [read("points", pose, values, names=1)])
    both = fit_joints(model, [read("points", pose, values, names=1), read("poses", pose, values, 5)])
    assert (alone.determined, both.determined) == (11, 14)
    assert np.all(both.sigma < 1.01 * alone.sigma)
    (finding,) = joint_findings(alone, [read("points", pose, values, names=1)])
    assert finding.code == "OLP844"
    assert all(f"gauge.{letter}_urad" in finding.message for letter in "ABC")


@pytest.mark.slow
def test_yield_is_found_from_loaded_and_unloaded_poses() -> None:
    plain, _, values = true_machine("arm_6r_kr6", count=60)
    masses = (Mass("J2", 16.0, (250.0, 10.0, 400.0)), Mass("J3", 11.0, (560.0, -5.0, 430.0)))
    priors = Priors.of(plain.structure)
    model = model_of(plain.structure, values, priors, yielding=["J2", "J3"], masses=masses)
    theta = np.random.default_rng(4).normal(0.0, model.prior)
    theta[-2:] = 2e-6, 3e-6
    loads = (Payload(), Payload(6.0, (20.0, 0.0, 60.0)))
    readings = [
        replace(read("points", model.machine(theta, load).actual(values), values, seed), payload=load)
        for seed, load in enumerate(loads)
    ]
    fit = fit_joints(model, readings)
    assert fit.theta[-2:] == pytest.approx(theta[-2:], abs=4.0 * fit.sigma[-2:].max())
    assert fit.sigma[-2:].max() < 3e-7


def moved(reading: Points, how: str) -> Points:
    values = reading.values.copy()
    if how == "sign":
        values[:, 2] *= -1.0
    elif how == "radians":
        values[:, 3] = np.radians(values[:, 3])
    elif how == "posture":
        values = np.roll(values, 1, axis=0)
    elif how == "nests":
        return replace(reading, which=np.where(reading.which == 2, 0, np.where(reading.which == 0, 2, 1)))
    return replace(reading, values=values)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("how", "words"),
    some_of_a_campaign(
        [
            ("posture", "one posture"),
            ("sign", "axis J3 runs the other way"),
            ("radians", "axis J4 is in radians"),
            ("nests", "3 and 1 are swapped"),
        ],
        4,
    ),
)
def test_mistakes_are_told(how: str, words: str) -> None:
    model, theta, values = true_machine("arm_6r_kr6", count=40)
    reading = read("points", model.machine(theta).actual(values), values)
    assert isinstance(reading, Points)
    wrong = moved(reading, how)
    try:
        fit = fit_or_refuse(model, [wrong])
    except ConfigError as error:
        assert words in str(error)
        return
    told = [finding.message for finding in joint_findings(fit, [wrong]) if finding.code == "OLP810"]
    assert words in " ".join(told)


@pytest.mark.slow
def test_a_step_to_where_a_platform_does_not_close_is_halved(monkeypatch: pytest.MonkeyPatch) -> None:
    model, theta, values = true_machine("xyzac_trunnion", 0, 12)
    readings = [read("points", model.machine(theta).actual(values), values)]
    plain, calls = fit_joints(model, readings), list[int]()
    own = adjustment.block_of

    def sometimes(*words: Any) -> Any:
        calls.append(0)
        if len(calls) == 2:
            raise CannotCompute("the legs do not close")
        return own(*words)

    monkeypatch.setattr(adjustment, "block_of", sometimes)
    halved = fit_joints(model, readings)
    assert len(calls) > 3
    assert np.abs(halved.theta - plain.theta).max() < 0.01 * plain.sigma.max()


def test_what_readings_do_not_show_is_held_as_well_where_they_scatter() -> None:
    """Six times the noise that is stated: an unknown that they show is known six times worse; one that they
    do not show as well as before."""
    model, theta, values = true_machine("xyzac_trunnion", count=40)
    pose = model.machine(theta).actual(values)
    quiet, loud = (fit_joints(model, [read("points", pose, values, names=1, noise=k)]) for k in (1.0, 6.0))
    assert 5.0 < np.sqrt(loud.chi_square / loud.freedom) < 7.0
    share = quiet.sigma / model.prior
    shown, open_ = int(np.argmin(share)), int(np.argmax(share))
    assert 4.0 < loud.sigma[shown] / quiet.sigma[shown] < 8.0
    assert loud.sigma[open_] == pytest.approx(quiet.sigma[open_], rel=0.1)
