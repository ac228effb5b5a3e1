"""Backlash of every axis of machines with rotary joints: corrected programs are judged by a computation of
their own, and proofs state what the play does."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from cases.any_judged import LIST, case_of, judged
from cases.joint_machines import machine_file

import olp

#: By structure a seed and a form of the program.
CASES = [
    ("arm 6 with offsets", 1, LIST), ("scara", 0, LIST), ("polar", 0, LIST), ("hexapod", 0, LIST),
    ("table/head", 1, "G43.4"), ("table/head", 3, "APT"), ("nutating head", 2, "M128"),
    ("head/head", 0, "axis words, linuxcnc"), ("nutating table", 4, "axis words, fanuc"),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "seed", "form"), CASES)
def test_a_program_is_within_tolerance_where_every_axis_has_play(kind: str, seed: int, form: str) -> None:
    told = judged(kind, form, seed, play=True)
    assert told.what == "right" and told.cost < 0.8, told.words


@pytest.mark.slow
def test_digits_that_are_coarse_beside_a_backlash_are_named_with_those_that_do(tmp_path: Path) -> None:
    """0.001 deg are 17.5 urad: a step by one digit goes beyond a backlash of 4.1 urad."""
    words = ("table/head", "axis words, fanuc", 4)
    coarse = case_of(tmp_path, *words, play=True, digit=1e-3).corrected()
    told = next(one.message for one in coarse.findings if one.code == "OLP101")
    assert "C (digits of 0.001 deg, 17.5 urad; backlash 4.1 urad) and B" in told
    assert "state least_increment_deg = 0.0001 if" in told
    assert case_of(tmp_path, *words, play=True, digit=1e-4).corrected().report["verdict"]["ok"]
    machine, job = tmp_path / "machine.toml", tmp_path / "job.toml"
    other = olp.verify_joints(coarse.nominal, coarse.nominal, machine, job)
    assert "last digit" not in next(one.message for one in other.findings if one.code == "OLP101")


HEAD = "X_mm,Y_mm,Z_mm,B_deg,C_deg"
PLAY = "[backlash]\nX_um = 20.0\n"


def listed(*x_mm: float) -> bytes:
    return "\n".join([HEAD, *(f"{x:.3f},0.000,0.000,0.000,0.000" for x in x_mm), ""]).encode()


def test_the_proof_looks_where_backlash_is_taken_up(tmp_path: Path) -> None:
    """The drive goes from one side of its play to the other along a whole move: 20 um into it the load is off
    by these 20 um, and at its end it is right."""
    machine = machine_file(tmp_path, "C F X Y Z B", errors=False, calibration=PLAY)
    nominal, other = listed(-10.0, 0.0, 20.0, 0.0), listed(-9.99, 0.01, 20.01, -0.01)
    worst = olp.verify_joints(nominal, other, machine).report["worst"]
    by_line = {row["line"]: row["position_um"] for row in worst}
    assert by_line[4] < 0.1 and by_line[5] == pytest.approx(20.0, abs=0.1)


def test_a_side_that_is_not_known_is_said(tmp_path: Path) -> None:
    """Half of the backlash may be missing until the axis has moved by it; nothing is where a row before goes
    past the first one by it."""
    machine = machine_file(tmp_path, "C F X Y Z B", errors=False, calibration=PLAY)
    nominal = listed(0.0, 10.0, 5.0)
    said = olp.verify_joints(nominal, listed(0.01, 10.01, 4.99), machine)
    finding = next(one for one in said.findings if one.code == "OLP103")
    assert finding.lines == (2, 3) and "10.0 um" in finding.message
    result = olp.correct_joints(nominal, machine)
    assert result.report["verdict"]["ok"]
    assert "OLP103" not in [one.code for one in result.findings]
    x_mm = [float(line.split(b",")[0]) for line in result.data.splitlines()[-5:]]
    # past the first row and back to it, and a step before the one that turns round
    assert x_mm[0] < -0.01 and x_mm[1:] == pytest.approx([0.01, 10.01, 9.99, 4.99])


def test_no_drive_leaves_its_travel_for_its_backlash(tmp_path: Path) -> None:
    """At an end of the travel an axis comes from the other side, and no drive leads beyond it."""
    machine = machine_file(tmp_path, "C F X Y Z B", errors=False, calibration=PLAY)
    result = olp.correct_joints(listed(-899.99, -890.0, -899.98), machine)
    assert result.report["verdict"]["ok"]
    x_mm = [float(line.split(b",")[0]) for line in result.data.splitlines()[2:]]
    assert min(x_mm) >= -900.0
    with pytest.raises(olp.InputError, match=r"X is -900\.005 mm, out of its travel"):
        olp.correct_joints(listed(-890.0, -880.0, -899.995), machine)


def test_an_axis_that_the_program_leaves_turns_round_for_its_correction_alone(tmp_path: Path) -> None:
    """Y rises and falls by 10 um: Z stands, and its correction falls and rises."""
    curve = tmp_path / "y.csv"
    curve.write_text("Y_mm,EZY_um\n-300,0\n0,0\n100,10\n200,0\n300,0\n")
    calibration = '[backlash]\nZ_um = 12.0\n[[curves]]\nfile = "y.csv"\ninterpolation = "linear"\n'
    machine = machine_file(tmp_path, "C F X Y Z B", errors=False, calibration=calibration)
    text = b"G90 G54\nG0 X0 Y0 Z-5 B0 C0\nG0 Z0\nG1 Y200 F500\nM30\n"
    result = olp.correct_joints(text, machine)
    assert result.report["verdict"]["ok"]
    assert result.report["deviation"]["before"]["position_max_um"] > 5.0
    z_mm = [float(word) for word in re.findall(rb"Z(-?[\d.]+)", result.data)]
    assert z_mm == pytest.approx([-5.0, 0.006, -0.006, -0.011, -0.016, -0.004, 0.001, 0.006])


def test_a_simulation_takes_the_backlash_up(tmp_path: Path) -> None:
    """Its load follows 20 um behind the drive after each turn: half of that off to either side."""
    machine = machine_file(tmp_path, "C F X Y Z B", errors=False, calibration=PLAY)
    done = olp.simulate_joints(listed(-10.0, 0.0, 10.0, 0.0), machine, step_mm=5.0)
    off_um = 1e3 * (done.points_mm[:, 0] - done.axes[:, 0])
    assert off_um == pytest.approx([-10.0] * 4 + [10.0] * 2, abs=1e-6)
