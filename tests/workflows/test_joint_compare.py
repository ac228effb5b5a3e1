"""Measured poses and paths against those of machines with rotary joints."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from scipy.spatial.transform import Rotation

import olp
from olp.cli import main
from olp.files.kinematics.load import load_joint_setup

FOLDER = Path(__file__).resolve().parents[2] / "programs"
ARM = FOLDER / "arm-payload"
HEAD = "X_mm,Y_mm,Z_mm,A_deg,B_deg,C_deg"


def run(*words: object) -> Result:
    return CliRunner().invoke(main, ["compare", *map(str, words)])


def test_cycles_of_an_arm_by_position_and_orientation(tmp_path: Path) -> None:
    """ISO 9283 worked from the forward model, scipy's angles and the definitions."""
    setup = load_joint_setup(ARM / "machine.toml", ARM / "job.toml", 1)
    rows = np.loadtxt(ARM / "deburr.csv", delimiter=",", skiprows=1)[::24]
    names = [f"P{k}" for k in range(len(rows))]
    nominal = tmp_path / "nominal.csv"
    text = [",".join([name, *map(str, row)]) for name, row in zip(names, rows.tolist(), strict=True)]
    nominal.write_text("name,J1_deg,J2_deg,J3_deg,J4_deg,J5_deg,J6_deg\n" + "\n".join(text) + "\n")
    actual, wanted = setup.kinematics.actual(rows), setup.kinematics.nominal(rows)
    rng, files, turns, places = np.random.default_rng(1), [], [], []
    for cycle in range(3):
        place = actual.position + rng.normal(0.0, 0.01, (len(rows), 3))
        angles = Rotation.from_matrix(actual.rotation).as_euler("xyz", degrees=True)
        angles += rng.normal(0.0, 2e-3, (len(rows), 3))
        turned = Rotation.from_euler("xyz", angles, degrees=True)
        turns.append((turned * Rotation.from_matrix(wanted.rotation).inv()).as_rotvec())
        places.append(place)
        # by name, in another order
        text = [
            ",".join([name, *map(repr, row)])
            for name, row in zip(names, np.hstack((place, angles)).tolist(), strict=True)
        ]
        files.append(tmp_path / f"{cycle}.csv")
        files[-1].write_text(f"name,{HEAD}\n" + "\n".join(text[::-1]) + "\n")
    done = run(nominal, *files, "--poses", "-j", ARM / "job.toml", "--json")
    assert done.exit_code == 0, done.output
    report = json.loads(done.stdout)["after"]
    mean, spread = np.mean(turns, axis=0) * 1e6, 3e6 * np.std(turns, axis=0, ddof=1)
    assert [pose["name"] for pose in report["poses"]] == names
    assert [pose["AP_turn_urad"] for pose in report["poses"]] == pytest.approx(mean, rel=1e-6)
    assert [pose["RP_turn_urad"] for pose in report["poses"]] == pytest.approx(spread, rel=1e-6)
    assert report["iso_9283"]["AP_turn_urad"] == pytest.approx(np.abs(mean).max(axis=0), rel=1e-6)
    far = np.linalg.norm(np.mean(places, axis=0) - wanted.position, axis=1) * 1e3
    assert [pose["AP_um"] for pose in report["poses"]] == pytest.approx(far, rel=1e-6)
    shown = run(nominal, *files, "--poses", "-j", ARM / "job.toml").stdout
    assert "Orientation, measured, about X, Y, Z in urad" in shown


@pytest.mark.parametrize("fit", ["none", "fit"])
def test_a_frame_turns_the_orientation_too(fit: str, tmp_path: Path) -> None:
    """Poses of a table without a machine, measured in a frame that is turned."""
    rng = np.random.default_rng(2)
    places, turned = rng.normal(0.0, 200.0, (5, 3)), Rotation.random(5, random_state=3)
    frame = Rotation.from_euler("z", 30.0, degrees=True)
    nominal, measured = tmp_path / "n.csv", tmp_path / "m.csv"
    for file, where, tool in (
        (nominal, places, turned),
        (measured, frame.apply(places) + 10.0, frame * turned),
    ):
        rows = np.hstack((where, tool.as_euler("xyz", degrees=True)))
        np.savetxt(file, rows, delimiter=",", header=HEAD, comments="", fmt="%.12f")
    done = run(nominal, measured, "--poses", "--align", fit, "--reach-mm", 1000, "--json")
    largest = json.loads(done.stdout)["after"]["iso_9283"]["AP_turn_urad"]
    assert largest == pytest.approx(
        [0.0] * 3 if fit == "fit" else [0.0, 0.0, np.radians(30.0) * 1e6], abs=1e-3
    )


def test_turns_stated_as_vectors_count_from_the_nominal_orientation(tmp_path: Path) -> None:
    nominal, measured = tmp_path / "n.csv", tmp_path / "m.csv"
    nominal.write_text(f"{HEAD}\n0,0,0,10,20,30\n9,0,0,10,20,30\n")
    head = "X_mm,Y_mm,Z_mm,RX_urad,RY_urad,RZ_urad"
    measured.write_text(f"{head}\n0,0,0,1,-2,3\n9,0,0,1,-2,7\n")
    report = json.loads(run(nominal, measured, "--poses", "--json").stdout)["after"]
    assert report["iso_9283"]["AP_turn_urad"] == pytest.approx([1.0, 2.0, 7.0], abs=1e-6)
    assert report["iso_9283"]["RP_turn_urad"] == [None] * 3
    measured.write_text(f"{head},A_deg,B_deg,C_deg\n0,0,0,1,-2,3,0,0,0\n")
    both = run(nominal, measured, "--poses")
    assert both.exit_code == 3
    assert "by A_deg, B_deg, C_deg and by RX_urad" in both.output
    bare = tmp_path / "bare.csv"
    bare.write_text("X_mm,Y_mm,Z_mm\n0,0,0\n9,0,0\n")
    measured.write_text(f"{head}\n0,0,0,1,-2,3\n9,0,0,1,-2,7\n")
    some = run(nominal, measured, bare, "--poses")
    assert some.exit_code == 3
    assert "in all of them or in none" in some.output


def test_the_turn_about_a_tool_that_turns_freely_is_in_no_figure(tmp_path: Path) -> None:
    machine = FOLDER / "trunnion-mill" / "machine.toml"
    nominal, measured = tmp_path / "n.csv", tmp_path / "m.csv"
    nominal.write_text("X_mm,Y_mm,Z_mm,A_deg,C_deg\n1,2,3,0,0\n5,2,3,0,90\n")
    tips = load_joint_setup(machine, None, 1).kinematics.nominal(
        np.array([[1.0, 2, 3, 0, 0], [5, 2, 3, 0, 90]])
    )
    rows = [",".join([*map(str, place), "30", "0", "500"]) for place in tips.position.tolist()]
    measured.write_text("X_mm,Y_mm,Z_mm,RX_urad,RY_urad,RZ_urad\n" + "\n".join(rows) + "\n")
    report = json.loads(run(nominal, measured, "--poses", "-m", machine, "--json").stdout)["after"]
    assert report["iso_9283"]["AP_turn_urad"] == pytest.approx([30.0, 0.0, 0.0], abs=1e-6)
    assert report["iso_9283"]["AP_um"] == pytest.approx(0.0, abs=1e-6)


def test_a_zero_that_is_touched_moves_what_is_simulated(tmp_path: Path) -> None:
    """The part lies off by the error where it was touched, and is measured from there."""
    shutil.copytree(FOLDER / "trunnion-mill", tmp_path / "mill")
    machine, program, corrected = (tmp_path / "mill" / name for name in ("machine.toml", "p.nc", "p5.nc"))
    machine.write_text(machine.read_text().replace('set_by = "true"', "X_mm = 150.0\nY_mm = 90.0"))
    program.write_text("G21 G90 G54 G94\nG0 X-60 Y0 Z50 A0 C0\nG1 Z20 A0 C0 F900\nX-30 A-20 C40\nM30\n")
    done = olp.correct_joints(program, machine)
    done.write(corrected)
    simulated = tmp_path / "run.csv"
    simulated.write_bytes(olp.simulate_joints(corrected, machine).to_csv())
    assert done.proof.before.distance_mm[-1] > 0.005
    found = olp.compare_joints(program, [simulated], machine, align="none")
    assert found.report["after"]["across_um"]["max"] < 2.0


def test_the_path_of_the_tip_and_its_frames(tmp_path: Path) -> None:
    machine, program = FOLDER / "trunnion-mill" / "machine.toml", tmp_path / "part.nc"
    program.write_text("G21 G90 G54\nG0 X0 Y0 Z50 A0 C0\nG1 X20 F100\nY20\nM30\n")
    rows = [(x, 0.0, 50.0) for x in range(21)] + [(20.0, y, 50.0) for y in range(1, 21)]
    measured = tmp_path / "m.csv"
    # the work offset lies 140 mm lower, the tip 120 mm below the gauge
    for frame, z in (("G54", -120.0), ("workpiece", -260.0)):
        text = "".join(f"{x},{y + 0.003},{up + z}\n" for x, y, up in rows)
        measured.write_text(f"# frame={frame}\nX_mm,Y_mm,Z_mm\n{text}")
        report = json.loads(run(program, measured, "-m", machine, "--json").stdout)
        assert report["after"]["across_um"]["max"] == pytest.approx(3.0, abs=1e-6)
        assert report["path"]["compared_in"] == "workpiece coordinates"
    measured.write_text("# frame=G59\nX_mm,Y_mm,Z_mm\n0,0,0\n")
    refused = run(program, measured, "-m", machine)
    assert refused.exit_code == 3
    assert "G59" in refused.output
    refused = run(program, measured, "-m", machine, "--add-errors")
    assert "is not for machines with rotary joints" in refused.output
