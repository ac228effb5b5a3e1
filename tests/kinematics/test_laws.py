"""Laws of machines of any joints, and figures worked by hand."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from cases.fast import some_of_a_campaign
from kinematics.cases import golden, random_values

from olp.core.errors import CannotCompute, ConfigError, NotInvertible
from olp.core.interpolation import Interpolant
from olp.core.machine import CHAINS
from olp.core.units import AXES
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration
from olp.errormodel.sources.curves import Curve
from olp.files.kinematics.load import load_kinematics
from olp.kinematics.chain import Kinematics
from olp.kinematics.errors import JointErrors, MachineErrors, MotionCurve, Payload, Yield
from olp.kinematics.inverse import command, inverse
from olp.kinematics.measures import mobility, travel_left
from olp.kinematics.poses import axis_rotation, rotation_vector
from olp.kinematics.structure import Joint, Leg, Platform, Structure

ORIGIN = (0.0, 0.0, 0.0)
DIRECTIONS = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
UM, URAD = 1e-3, 1e-6


def joint(name: str, kind: str, direction: tuple[float, ...], point: tuple[float, ...] = ORIGIN) -> Joint:
    return Joint(name, kind, direction, point, (-1000.0, 1000.0))  # type: ignore[arg-type]


LINEAR = {name: joint(name, "linear", direction) for name, direction in DIRECTIONS.items()}
C = joint("C", "rotary", (0.0, 0.0, 1.0))
B = joint("B", "rotary", (0.0, 1.0, 0.0), (0.0, 0.0, 220.0))
HEAD = Structure("head", ("F", "X", "Y", "Z", "C"), {**LINEAR, "C": C})
TABLE = Structure("table", ("C", "F", "X", "Y", "Z"), {**LINEAR, "C": C})
WRIST = Structure("wrist", ("F", "X", "Y", "Z", "C", "B"), {**LINEAR, "C": C, "B": B})


def errors(**joints: JointErrors) -> MachineErrors:
    return MachineErrors(joints)


def curve(value: dict[int, float], *, low: float = -360.0, high: float = 360.0) -> MotionCurve:
    """The same error everywhere."""
    row = np.zeros(7)
    for column, one in value.items():
        row[column] = one
    return MotionCurve(Interpolant.through(np.array([low, high]), np.stack((row, row)), "linear"), ORIGIN)


def shift_at(structure: Structure, wrong: MachineErrors, **axes: float) -> np.ndarray:
    machine = Kinematics(structure, wrong)
    return machine.deviation(structure.axis_values(axes))[0][0]


@pytest.mark.parametrize("structure", [HEAD, TABLE])
def test_a_shifted_line_by_hand(structure: Structure) -> None:
    wrong = errors(C=JointErrors(ORIGIN, shift_mm=(10.0 * UM, 0.0, 0.0)))
    assert shift_at(structure, wrong) == pytest.approx([0, 0, 0], abs=1e-12)
    assert shift_at(structure, wrong, C=180.0) == pytest.approx([20.0 * UM, 0, 0], abs=1e-12)
    assert shift_at(structure, wrong, C=90.0) == pytest.approx([10.0 * UM, -10.0 * UM, 0], abs=1e-12)


def test_error_motions_turn_with_what_carries_them() -> None:
    wrong = errors(C=JointErrors(ORIGIN, curves=(curve({0: 5.0 * UM}),)))
    assert shift_at(HEAD, wrong, C=90.0) == pytest.approx([5.0 * UM, 0, 0], abs=1e-12)
    assert shift_at(TABLE, wrong, C=90.0) == pytest.approx([0, 5.0 * UM, 0], abs=1e-12)


def test_a_tilted_line_and_a_zero_by_hand() -> None:
    tilted = Kinematics(TABLE, errors(C=JointErrors(ORIGIN, tilt_rad=(10.0 * URAD, 0.0, 0.0))))
    shift, turn = tilted.deviation(TABLE.axis_values({"C": 180.0, "Z": 100.0}))
    assert shift[0] == pytest.approx([0, -2.0 * UM, 0], abs=1e-7)
    assert turn[0] == pytest.approx([20.0 * URAD, 0, 0], abs=1e-9)
    zero = errors(C=JointErrors(ORIGIN, zero=10.0 * URAD))
    assert shift_at(TABLE, zero, X=100.0) == pytest.approx([0, 1.0 * UM, 0], abs=1e-8)


def test_backlash_is_the_whole_play() -> None:
    machine = Kinematics(HEAD, errors(X=JointErrors(ORIGIN, backlash=8.0 * UM)))
    values = HEAD.axis_values({"X": 5.0})
    places = [machine.actual(values, np.full((1, 4), side)).position[0, 0] for side in (1.0, -1.0)]
    assert np.subtract(*places) == pytest.approx(-8.0 * UM)


def test_without_errors_nothing_is_changed() -> None:
    values = np.random.default_rng(1).uniform(-90.0, 90.0, (20, 5))
    machine = Kinematics(WRIST, errors(X=JointErrors(ORIGIN)), (0.0, 0.0, -50.0))
    shift, turn = machine.deviation(values)
    assert np.abs(shift).max() < 1e-12
    assert np.abs(turn).max() < 1e-14
    assert np.abs(command(machine, values).values - values).max() < 1e-9


def test_the_other_sense_of_an_axis_changes_nothing() -> None:
    wrong = JointErrors(B.point_mm, shift_mm=(0.01, 0.0, 0.02), tilt_rad=(1e-4, 0.0, 2e-4), zero=3e-4)
    other = replace(WRIST, joints={**WRIST.joints, "B": replace(B, direction=(0.0, -1.0, 0.0))})
    values = np.random.default_rng(2).uniform(-90.0, 90.0, (20, 5))
    here = Kinematics(WRIST, errors(B=wrong)).actual(values)
    there = Kinematics(other, errors(B=replace(wrong, zero=-3e-4))).actual(values * [1, 1, 1, 1, -1])
    assert np.abs(here.position - there.position).max() < 1e-11
    assert np.abs(here.rotation - there.rotation).max() < 1e-13


@pytest.mark.parametrize("reference", ["functional-point", "table"])
def test_three_linear_axes_are_the_error_model_of_today(tmp_path: Path, reference: str) -> None:
    """The same files as `olp.errormodel` reads, told as joints, on all chains."""
    rng = np.random.default_rng(3)
    knots, columns = np.array([-200.0, 50.0, 300.0]), {}
    box = "".join(f"{axis}_mm = [-200.0, 300.0], " for axis in AXES)
    stated = ""
    for axis in AXES:
        names = [f"E{d}{axis}" for d in "XYZABC"]
        columns[axis] = {name: rng.uniform(-3e-2 if name[1] in AXES else -5e-5, 3e-5, 3) for name in names}
        units = [f"{name}_{'um' if name[1] in AXES else 'urad'}" for name in names]
        lines = [",".join([f"{axis}_mm", *units])]
        for row, knot in enumerate(knots):
            scaled = [columns[axis][n][row] * (1e3 if n[1] in AXES else 1e6) for n in names]
            lines.append(",".join(map(repr, map(float, [knot, *scaled]))))
        (tmp_path / f"{axis}.csv").write_text("\n".join(lines) + "\n")
        stated += f'[[curves]]\nfile = "{axis}.csv"\ninterpolation = "linear"\ntool_mm = [5.0, -6.0, -70.0]\n'
        stated += f'reference = "{reference}"\nline_mm = {{ X = 20.0, Y = -30.0, Z = 40.0 }}\n'
    (tmp_path / "calibration.toml").write_text(
        'schema = "olp-calibration-1"\nmachine = "m"\nmeasured = 2026-11-01\ntemperature_degC = 20.0\n'
        'sign = "actual-minus-commanded"\nmodel = "rigid-body"\ndatum_mm = [11.0, 12.0, 13.0]\n'
        f"box = {{ {box.rstrip(', ')} }}\n{stated}[squareness]\n"
        "C0Y_urad = 30.0\nB0Z_urad = -40.0\nA0Z_urad = 50.0\n"
    )
    calibration = Calibration(
        machine="m",
        box_mm=np.array([[-200.0, 300.0]] * 3),
        datum_mm=(11.0, 12.0, 13.0),
        curves=tuple(
            Curve(
                axis, knots, columns[axis], line_mm=(20.0, -30.0, 40.0), tool_mm=(5.0, -6.0, -70.0),
                reference=reference, interpolation="linear",  # type: ignore[arg-type]
            )
            for axis in AXES
        ),
        squareness={"C0Y": 30e-6, "B0Z": -40e-6, "A0Z": 50e-6},
    )  # fmt: skip
    values, tool = rng.uniform(-190.0, 290.0, (20, 3)), (1.0, 2.0, -90.0)
    axes = "".join(
        f"[axes.{a}]\nkind = 'linear'\ntravel_mm = [-200, 300]\nleast_increment_mm = 1e-3\n" for a in AXES
    )
    for chain in sorted(CHAINS):
        (tmp_path / "machine.toml").write_text(
            f'schema = "olp-machine-1"\nname = "m"\nchain = "{chain}"\ncontroller = "linuxcnc"\n'
            f'calibration = "calibration.toml"\n{axes}[tools.1]\ngauge_to_tip_mm = [1.0, 2.0, -90.0]\n'
            "[job_defaults]\ntool = 1\n"
        )
        machine = load_kinematics(tmp_path / "machine.toml")
        shift, _ = machine.deviation(values)
        wanted = build(calibration, chain).error(values, np.array(tool))
        assert np.abs(shift - wanted).max() < 1e-10, chain


def test_the_jacobian_is_the_slope_of_the_pose() -> None:
    machine = Kinematics(WRIST, tool_mm=(3.0, -4.0, -150.0))
    values = np.random.default_rng(4).uniform(-80.0, 80.0, (6, 5))
    slopes = machine.jacobian(values)
    for column, unit in enumerate([1.0, 1.0, 1.0, np.pi / 180, np.pi / 180]):
        step = np.zeros(5)
        step[column] = 1e-4 / unit
        after, before = machine.nominal(values + step), machine.nominal(values - step)
        turn = rotation_vector(after.rotation @ np.swapaxes(before.rotation, 1, 2))
        change = np.concatenate((after.position - before.position, turn), axis=1) / 2e-4
        assert np.abs(change - slopes[:, :, column]).max() < 1e-5


def test_inverse_finds_the_posture_again_and_keeps_the_branch() -> None:
    machine = Kinematics(WRIST, tool_mm=(0.0, 0.0, -150.0))
    values = np.random.default_rng(5).uniform(20.0, 80.0, (50, 5))
    away = values + np.random.default_rng(6).uniform(-10.0, 10.0, (50, 5))
    solved = inverse(machine, machine.nominal(values), away, nominal=True)
    assert np.abs(solved.values - values).max() < 1e-8


def wrong_wrist(tilt_rad: float = 2e-4) -> Kinematics:
    tilted = JointErrors(ORIGIN, tilt_rad=(tilt_rad, 0.0, 0.0))
    return Kinematics(WRIST, errors(C=tilted, B=JointErrors(B.point_mm, zero=1e-4)), (0.0, 0.0, -150.0))


def test_a_correction_is_bounded_near_a_singular_posture() -> None:
    """At B = 0 the turn of C does not tilt the tool, so a tilt about X cannot be corrected."""
    machine = wrong_wrist()
    angles = np.array([-5.0, -0.5, -0.1, -0.01, -1e-4, 0.0, 1e-4, 0.01, 0.1, 0.5, 5.0])
    values = WRIST.axis_values({"B": angles, "C": 40.0})
    solved = command(machine, values)
    assert np.abs((solved.values - values)[:, 3:]).max() <= 1.0
    reached, target = machine.actual(solved.values), machine.nominal(values)
    assert np.abs(reached.position - target.position).max() < 1e-8
    assert solved.limited.tolist()[0] is False
    assert solved.limited[[4, 6]].all()


def test_the_bound_of_a_turn_is_met_from_both_sides() -> None:
    """From |x| = L on, the turn is L^2 / x, and goes to zero where B does."""
    machine, limit = wrong_wrist(), 0.5
    angles = np.array([3.0, 1.0, 0.4, 0.2, 0.1, 0.01, 1e-3, 1e-5])
    values = WRIST.axis_values({"B": angles, "C": 40.0})
    free = command(machine, values[:5], largest_turn_deg=1e3).values - values[:5]
    bound = command(machine, values, largest_turn_deg=limit)
    turn = (bound.values - values)[:, 3]
    assert bound.limited.tolist() == [False, False, False, True, True, True, True, True]
    assert turn[:3] == pytest.approx(free[:3, 3], abs=1e-9)
    assert turn[3:5] == pytest.approx(limit**2 / free[3:5, 3], rel=0.1)
    assert np.all(np.diff(np.abs(turn[3:])) < 0.0)
    assert abs(turn[-1]) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("name", some_of_a_campaign(["arm_6r_kr6", "linuxcnc_puma560", "arm_7r_on_track"], 3))
def test_no_arm_jumps_near_a_singular_posture(name: str) -> None:
    """A large turn that the orientation needs is made smaller; what the position needs is met, or refused."""
    machine = golden(name)[0].kinematics
    rotary = np.array([unit == "deg" for unit in machine.structure.units])
    limited, refused = 0, 0
    for row in random_values(golden(name)[0], 80, 3):
        try:
            done = command(machine, row[None])
        except NotInvertible:
            refused += 1
            continue
        limited += int(done.limited[0])
        assert np.abs((done.values - row)[:, rotary]).max() <= 2.0
        off = machine.actual(done.values).position - machine.nominal(row[None]).position
        assert np.abs(off).max() < 2e-9
    assert limited > 0
    assert refused < 8


def test_curves_of_one_axis_are_bodies_the_first_next_to_the_frame() -> None:
    both = JointErrors(ORIGIN, curves=(curve({5: 1e-3}), curve({0: 1.0})))
    assert shift_at(HEAD, errors(C=both))[:2] == pytest.approx([1.0, 1e-3], abs=1e-6)
    assert shift_at(TABLE, errors(C=both))[:2] == pytest.approx([1.0, 0.0], abs=1e-6)


def test_mobility_is_zero_at_a_singular_posture() -> None:
    machine = Kinematics(WRIST, tool_mm=(0.0, 0.0, -150.0))
    smallest = mobility(machine, WRIST.axis_values({"B": [0.0, 1.0, 40.0]})).smallest
    assert smallest[0] < 1e-12 < smallest[1] < smallest[2]
    assert travel_left(WRIST, WRIST.axis_values({"X": [1010.0, -999.0]}))[:, 0] == pytest.approx([-10.0, 1.0])


def tripod(reach: float = 500.0) -> Structure:
    bases = [(reach, 0.0, 0.0), (-reach, 0.0, 0.0), (0.0, reach, 0.0)]
    joints = {f"L{i}": Joint(f"L{i}", "length", DIRECTIONS["X"], ORIGIN, (0.0, 2000.0)) for i in (1, 2, 3)}
    legs = tuple(Leg(base, ORIGIN, 0.0, axis=name) for base, name in zip(bases, joints, strict=True))
    return Structure(
        "tripod", ("F", "P"), joints, {"P": Platform("P", legs, (0.0, 0.0, -400.0), turns=False)}
    )


def test_a_platform_stays_on_the_branch_of_its_start() -> None:
    structure = tripod()
    legs = np.full((1, 3), np.hypot(500.0, 300.0))
    assert Kinematics(structure).nominal(legs).position[0] == pytest.approx([0.0, 0.0, -300.0])
    above = replace(structure.platforms["P"], start_mm=(0.0, 0.0, 400.0))
    assert Kinematics(replace(structure, platforms={"P": above})).nominal(legs).position[0, 2] > 0.0


def test_legs_that_do_not_close_are_refused() -> None:
    with pytest.raises(CannotCompute, match="platform P"):
        Kinematics(tripod()).nominal(np.array([[600.0, 600.0, 600.0], [10.0, 10.0, 10.0]]))


def test_a_target_out_of_reach_is_refused() -> None:
    arm = {
        name: joint(name, "rotary", DIRECTIONS["Z"], (x, 0.0, 0.0))
        for name, x in (("J1", 0.0), ("J2", 100.0))
    }
    machine = Kinematics(
        Structure("arm", ("F", "J1", "J2"), arm, symmetric_tool=False), tool_mm=(200.0, 0.0, 0.0)
    )
    target = machine.nominal(np.array([[10.0, 20.0]]))
    far = replace(target, position=target.position * 3.0)
    with pytest.raises(NotInvertible, match="row 0"):
        inverse(machine, far, np.array([[10.0, 20.0]]), nominal=True)


def test_a_payload_bends_the_arm_down() -> None:
    arm = {"J1": joint("J1", "rotary", DIRECTIONS["Y"])}
    structure = Structure("arm", ("F", "J1"), arm)
    gives = MachineErrors(yields={"J1": Yield(own=1e-6)}, payload=Payload(10.0, (1000.0, 0.0, 0.0)))
    shift, turn = Kinematics(structure, gives, (1000.0, 0.0, 0.0)).deviation(np.zeros((1, 1)))
    # 10 kg at 1 m: 98.0665 Nm about +Y, 98.0665 urad
    assert turn[0] == pytest.approx([0.0, 98.0665e-6, 0.0], rel=1e-9)
    assert shift[0, 2] == pytest.approx(-98.0665e-3, rel=1e-6)


def test_parts_that_do_not_fit_are_refused_together() -> None:
    with pytest.raises(ConfigError, match="frame") as caught:
        Structure("m", ("X", "Q"), {"X": LINEAR["X"], "C": C})
    assert len(caught.value.problems) == 3
    with pytest.raises(ConfigError, match=re.escape("no axis W")):
        Kinematics(HEAD, errors(W=JointErrors(ORIGIN)))
    with pytest.raises(ConfigError, match="shape"):
        Kinematics(HEAD).nominal(np.zeros((2, 3)))


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-6, 1e-4, 0.3, 2.0, 3.1, 3.1415926, np.pi])
def test_rotation_vectors_of_all_angles(angle: float) -> None:
    for axis in permutations((0.36, 0.48, 0.8)):
        vector = rotation_vector(axis_rotation(np.array(axis), np.array([angle])))[0]
        assert np.abs(vector - angle * np.array(axis)).max() < 1e-9 or angle > 3.1415
        assert np.linalg.norm(vector) == pytest.approx(angle, abs=1e-12, rel=1e-12)
