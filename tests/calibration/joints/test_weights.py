"""Joints that give way under weights that nobody knows: found from postures, judged by an arm of springs."""

from __future__ import annotations

import datetime
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from calibration.joints.simulated import NESTS, SHIFT, SIGMA, TOOL, TURN, as_csv, campaign, true_machine
from judge.springs import at_rest
from kinematics.cases import GOLDEN, golden, need_golden, random_values

from olp.calibration.joints.adjustment import JointFit, Source, fit_joints, starts_of
from olp.calibration.joints.candidates import Priors
from olp.calibration.joints.findings import joint_findings
from olp.calibration.joints.mistakes import mistakes
from olp.calibration.joints.payloads import refuse_other_payloads, unstated_payloads
from olp.calibration.joints.readings import Points
from olp.calibration.joints.unknowns import model_of
from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.files.kinematics.calibration import load_joint_calibration
from olp.files.kinematics.plan import load_campaign
from olp.files.kinematics.writer import fitted_values, joint_calibration_text
from olp.kinematics.chain import Kinematics
from olp.kinematics.errors import Gravity, MachineErrors, Mass, Payload, Yield
from olp.kinematics.structure import Structure
from olp.kinematics.weight import sums_of_angles

#: rad per Nm of the joints J2 and J3, and what the arm weighs: the judge alone knows it.
COMPLIANCE = {1: 2e-6, 2: 4e-6}
OWN = [(1, 16.0, (250.0, 10.0, 400.0)), (2, 11.0, (560.0, -5.0, 430.0))]
LOAD = Payload(6.0, (20.0, 0.0, 60.0))


def arm() -> Structure:
    return golden("arm_6r_kr6")[0].machine.structure


def sagged(structure: Structure, values: Array, payload: Payload) -> Array:
    """(n, 6) degrees at which the joints of the judge's arm really are."""
    joints = list(structure.joints.values())
    place = structure.gauge.pose.at(np.array(payload.centre_mm)).tolist()
    weights = [*OWN, (5, payload.kg, place)]
    lines = (np.array([getattr(joint, key) for joint in joints]) for key in ("direction", "point_mm"))
    return values + np.degrees(at_rest(*lines, np.radians(values), COMPLIANCE, weights))


def readings(structure: Structure, values: Array, payload: Payload, noise: float) -> Points:
    count, random = len(values), np.random.default_rng(len(values))
    pose = Kinematics(structure).nominal(sagged(structure, values, payload))
    which = np.arange(count) % 3
    at = pose.at(np.array(TOOL) + NESTS[which]) @ TURN.T + SHIFT
    return Points(
        f"{payload.kg:g} kg.csv", values, np.arange(count) + 2, TOOL, SIGMA, ("1", "2", "3"), which,
        payload=payload, measured_mm=at + noise * SIGMA * random.normal(size=(count, 3)), nests_mm=NESTS,
    )  # fmt: skip


def fitted(values: Array, loads: tuple[Payload, ...], noise: float = 0.0) -> JointFit:
    structure = arm()
    parts = np.array_split(values, len(loads))
    model = model_of(
        structure, values, Priors.of(structure), yielding=["J2", "J3"], sagging=["J2", "J3"],
    )  # fmt: skip
    return fit_joints(
        model, [readings(structure, part, load, noise) for part, load in zip(parts, loads, strict=True)]
    )


@pytest.mark.slow
def test_an_arm_of_springs_is_found_and_predicted_under_another_payload() -> None:
    structure, values = arm(), random_values(golden("arm_6r_kr6")[0], 140, 5)
    fit = fitted(values[:100], (Payload(), LOAD))
    names = [unknown.name for unknown in fit.model.unknowns]
    found = dict(zip(names, fit.theta.tolist(), strict=True))
    assert found["J2.own_urad_Nm"] == pytest.approx(COMPLIANCE[1], rel=0.01)
    assert found["J3.own_urad_Nm"] == pytest.approx(COMPLIANCE[2], rel=0.01)
    # J3 carries 11 kg whose centre is (80, 30) mm from it along X and Z: a turn about +Y lets it down
    turn = COMPLIANCE[2] * 11.0 * 9.80665e-3
    assert found["J3.cos_urad(J2+J3)"] == pytest.approx(turn * 80.0, rel=0.02)
    assert found["J3.sin_urad(J2+J3)"] == pytest.approx(turn * 30.0, rel=0.02)
    assert {"J2.sin_urad(J2)", "J2.cos_urad(J2)", "J2.sin_urad(J2+J3)", "J2.cos_urad(J2+J3)"} <= {*names}
    heavy = Payload(9.0, (-40.0, 30.0, 150.0))
    really = Kinematics(structure).nominal(sagged(structure, values[100:], heavy)).position
    ours = fit.model.machine(fit.theta, heavy).actual(values[100:]).position
    rigid = Kinematics(structure).nominal(values[100:]).position
    assert np.abs(rigid - really).max() > 0.3
    assert np.abs(ours - really).max() < 0.005


@pytest.mark.slow
def test_with_noise_the_stated_uncertainty_covers_and_what_is_open_is_named() -> None:
    values = random_values(golden("arm_6r_kr6")[0], 100, 5)
    fit = fitted(values, (Payload(), LOAD), noise=1.0)
    assert 0.7 < fit.chi_square / fit.freedom < 1.3
    for name, true in (("J2", COMPLIANCE[1]), ("J3", COMPLIANCE[2])):
        place = [unknown.name for unknown in fit.model.unknowns].index(f"{name}.own_urad_Nm")
        assert abs(fit.theta[place] - true) < 4.0 * fit.sigma[place] < true
    # with no payload no reading says how much a joint yields to one
    bare = fitted(values, (Payload(),), noise=1.0)
    named = [finding.message for finding in joint_findings(bare, ()) if finding.code == "OLP844"]
    assert len(named) == 1
    assert "J2.own_urad_Nm" in named[0]
    assert "J3.own_urad_Nm" in named[0]


@pytest.mark.slow
def test_a_payload_that_the_plan_forgets_is_told_with_odds() -> None:
    structure, values = arm(), random_values(golden("arm_6r_kr6")[0], 40, 5)
    model = model_of(structure, values, Priors.of(structure), yielding=["J2", "J3"])
    stated = replace(model, base=MachineErrors(gravity=(Gravity("J2", ("J2",), 1e-4, 2e-4),)))
    pose = stated.machine(np.append(np.zeros(len(model.unknowns) - 2), (2e-6, 4e-6)), LOAD).actual(values)
    at = pose.at(np.array(TOOL)) @ TURN.T + SHIFT
    at = at + SIGMA * np.random.default_rng(2).normal(size=at.shape)
    right = replace(readings(structure, values, LOAD, 0.0), measured_mm=at, which=np.zeros(40, int))
    order = np.arange(40) % 2 == 1
    parts = [replace(right, **{k: getattr(right, k)[rows] for k in ("values", "row", "which", "measured_mm")})
             for rows in (order, ~order)]  # fmt: skip
    forgotten = replace(parts[1], source="other.csv", payload=Payload())
    wrong = [parts[0], forgotten]
    told = [one for one in joint_findings(fit_joints(stated, wrong), wrong) if one.code == "OLP810"]
    assert len(told) == 1
    words = "other.csv: the payload of 6 kg.csv was on in these readings (odds 10^"
    assert told[0].message.startswith(words)
    assert not [one for one in joint_findings(fit_joints(stated, parts), parts) if one.code == "OLP810"]
    # stated nowhere it is told all the same, and how heavy it was where the yields are known
    base = replace(stated.base, yields={"J2": Yield(own=2e-6), "J3": Yield(own=4e-6)})
    pinned = replace(stated, base=base, unknowns=(), known=None)
    for model, words in ((pinned, "a payload of about 6"), (stated, "a payload was on")):
        found = [said for said, _, _ in unstated_payloads(model, [forgotten])]
        assert len(found) == 1
        assert found[0].startswith(f"other.csv: {words}")


def test_payloads_may_be_those_of_other_readings_or_none() -> None:
    values = np.zeros((4, 6))
    same = {"values": values, "row": np.arange(4), "tool_mm": TOOL, "sigma": SIGMA, "names": ("1",)}
    two = [Points("a.csv", **same, which=np.zeros(4, int), payload=load) for load in (LOAD, Payload(2.0))]
    said = {words: [one.payload for one in mended] for words, mended, _ in mistakes(arm(), two)}
    assert said["a.csv: the payload of 6 kg was not on in these readings"] == [Payload(), Payload(2.0)]
    assert said["a.csv: the payload of 2 kg was not on in these readings"] == [LOAD, Payload()]
    assert not any(
        "payload" in words for words, _, _ in mistakes(arm(), [replace(two[0], payload=Payload())])
    )


def test_gravity_of_known_masses_is_their_elasticity() -> None:
    """Weights in the plane of an arm turn its joints by sines and cosines of summed angles: stated masses do
    what these state. A joint that turns the other way counts with the other sign."""
    structure = arm()
    backward = replace(structure.joints["J3"], direction=(0.0, -1.0, 0.0))
    values = random_values(golden("arm_6r_kr6")[0], 30, 1)
    for one in (structure, replace(structure, joints={**structure.joints, "J3": backward})):
        third = one.joints["J3"].direction[1]
        masses = (Mass("J2", 16.0, (250.0, 0.0, 420.0)), Mass("J3", 11.0, (560.0, 0.0, 430.0)))
        known = MachineErrors(yields={"J2": Yield(own=2e-6), "J3": Yield(own=4e-6)}, masses=masses)
        pull = 9.80665e-3
        # arms from J2 at (25, 400), J3 at (480, 400): 225, 20; 455, 0; 80, 30 mm
        terms = (
            Gravity("J2", ("J2",), 2e-6 * pull * 16.0 * 20.0, 2e-6 * pull * (16.0 * 225.0 + 11.0 * 455.0)),
            Gravity("J2", ("J2", "J3"), 2e-6 * pull * 11.0 * 30.0, 2e-6 * pull * 11.0 * 80.0),
            Gravity("J3", ("J2", "J3"), 4e-6 * pull * 11.0 * 30.0 , third * 4e-6 * pull * 11.0 * 80.0),
        )  # fmt: skip
        ours, theirs = (
            Kinematics(one, errors).deviation(values) for errors in (MachineErrors(gravity=terms), known)
        )
        assert np.abs(theirs[0]).max() > 0.05
        np.testing.assert_allclose(ours[0], theirs[0], atol=1e-9)
        np.testing.assert_allclose(ours[1], theirs[1], atol=1e-12)


def test_only_sums_of_angles_that_say_how_a_weight_lies_are_taken() -> None:
    structure = arm()
    assert sums_of_angles(structure, "J2") == (("J2",), ("J2", "J3"))
    assert sums_of_angles(structure, "J3") == (("J2", "J3"),)
    for name, words in (("J1", "about the vertical"), ("J5", "no sum of angles"), ("J9", "no rotary axis")):
        with pytest.raises(ConfigError, match=words):
            sums_of_angles(structure, name)
    # on a wall the first joint tilts the others
    with pytest.raises(ConfigError, match="as J1 turn"):
        sums_of_angles(replace(structure, gravity=(1.0, 0.0, 0.0)), "J2")
    table = golden("xyzac_trunnion")[0].machine.structure
    assert sums_of_angles(table, "A") == (("A",),)
    with pytest.raises(ConfigError, match="as A turn"):
        sums_of_angles(replace(table, gravity=(0.0, 1.0, 0.0)), "C")
    twice = MachineErrors(yields={"J2": Yield(own=1e-6)}, masses=(Mass("J3", 1.0, (0.0, 0.0, 0.0)),))
    for term, words in (
        (Gravity("J2", ("J2", "J4")), "expected axes that stay parallel to J2"),
        (Gravity("J2", ()), "of no axis"),
        (Gravity("J9", ("J2",)), "no rotary axis"),
        (Gravity("J2", ("J2",)), "count twice"),
    ):
        with pytest.raises(ConfigError, match=words):
            Kinematics(structure, replace(twice, gravity=(term,)))


def test_gravity_is_read_back_from_files_and_refused_where_it_is_wrong(tmp_path: Path) -> None:
    model, _, values = true_machine("arm_6r_kr6", count=20)
    structure, day = model.structure, datetime.date(2026, 11, 20)
    model = model_of(structure, values, Priors.of(structure), sagging=["J2", "J3"])
    theta = np.random.default_rng(1).normal(0.0, model.prior)
    fit = JointFit(model, theta, np.diag(model.prior**2), (), (), 1.0, 1.0, len(theta))
    box = {f"{name}_deg": (-10.0, 10.0) for name in structure.joints}
    text = joint_calibration_text(fitted_values(fit, box, day, None, 20.0)).decode()
    file = tmp_path / "calibration.toml"
    file.write_text(text)
    theirs = Kinematics(structure, load_joint_calibration(file, structure).errors).actual(values)
    assert np.abs(theirs.position - model.machine(theta).actual(values).position).max() < 2e-6
    for old, new, words in (
        ('component = "EJ2J2"', 'component = "EXJ2"', "expected the own turn of a rotary"),
        ('angles = ["J2"]', 'angles = ["J2", "J2"]', "each once: J2, J3"),
    ):
        assert old in text
        file.write_text(text.replace(old, new, 1))
        with pytest.raises(ConfigError, match=words) as caught:
            load_joint_calibration(file, structure)
        line = next(k for k, row in enumerate(text.replace(old, new, 1).splitlines(), 1) if row == new)
        assert f":{line}:" in str(caught.value) or f"line {line}" in str(caught.value)


def test_a_plan_asks_for_gravity(tmp_path: Path) -> None:
    need_golden()
    structure = arm()
    order = [f"{name}_deg" for name in structure.order]
    values = random_values(golden("arm_6r_kr6")[0], 8)
    rows = {"p.csv": as_csv(order, values, [f"measured_{axis}_mm" for axis in "XYZ"], values[:, :3])}
    head = 'gravity = ["J2", "J3"]\n[prior]\ngravity_urad = 400.0\n'
    tail = '[[points]]\nfile = "p.csv"\nsigma_um = 20.0\ntool_mm = [0.0, 0.0, 0.0]\n'
    plan = campaign(tmp_path, "plan.toml", structure.name, rows, head + tail)
    asked = load_campaign(plan, structure)
    assert (asked.sagging, asked.priors.gravity_rad) == (("J2", "J3"), pytest.approx(4e-4))
    weight = '[[masses]]\non = "J3"\nkg = 5.0\ncentre_mm = [500.0, 0.0, 430.0]\n'
    for wrong, words in (
        (head.replace('"J3"]', '"J5"]'), "gravity of J5: .*no sum of angles"),
        ('elasticity = ["J2"]\n' + head + weight, "on J3: the same twice"),
    ):
        plan.write_text(plan.read_text().replace(head, wrong))
        with pytest.raises(ConfigError, match=words):
            load_campaign(plan, structure)
        plan.write_text(plan.read_text().replace(wrong, head))
    assert GOLDEN.is_dir()


def test_a_payload_without_elasticity_is_stated_once_and_kept(tmp_path: Path) -> None:
    """What nothing weighs is part of the errors: all readings had it, and the calibration says so."""
    model, _, values = true_machine("arm_6r_kr6", count=20)
    structure = model.structure
    none, some = (readings(structure, values, payload, 1.0) for payload in (Payload(), LOAD))
    refuse_other_payloads(model, [some, some], "plan.toml")
    refuse_other_payloads(model, [some], "plan.toml", LOAD)
    with pytest.raises(ConfigError, match=r"6 kg.csv states a payload of 6 kg .*other readings.*elasticity"):
        refuse_other_payloads(model, [none, some], "plan.toml")
    with pytest.raises(ConfigError, match=r"6 kg.csv .*the calibration one of 0 kg"):
        refuse_other_payloads(model, [some], "plan.toml", Payload())
    yielding = model_of(structure, values, Priors.of(structure), yielding=["J2"])
    refuse_other_payloads(yielding, [none, some], "plan.toml")
    box = {f"{name}_deg": (-10.0, 10.0) for name in structure.joints}
    zero, covariance = np.zeros(len(model.unknowns)), np.diag(model.prior**2)
    for reading, kept in ((some, LOAD), (none, Payload())):
        (start,) = starts_of(model, [reading])
        source = Source(start, np.zeros((20, 3)), np.zeros(6))
        fit = JointFit(model, zero, covariance, (source,), (), 1.0, 1.0, len(zero))
        text = joint_calibration_text(fitted_values(fit, box, datetime.date(2026, 11, 20), None, 20.0))
        (tmp_path / "c.toml").write_bytes(text)
        assert load_joint_calibration(tmp_path / "c.toml", structure).payload == kept
