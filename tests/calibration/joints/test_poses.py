"""Postures to measure: what is stated of them is what an adjustment of such readings finds, and they are
worth more than random ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from calibration.joints.simulated import SIGMA, TOOL, read, true_machine
from cli.test_cli import run

import olp
from olp.calibration.joints.adjustment import fit_joints
from olp.calibration.joints.poses import Postures
from olp.calibration.joints.random_postures import random_postures
from olp.core.errors import ConfigError
from olp.kinematics.chain import Kinematics
from olp.kinematics.errors import LegErrors, MachineErrors
from olp.workflows.calibrate_plan_joints import plan_poses

FOLDER = Path(__file__).resolve().parents[3] / "programs"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["arm_6r_kr6", "xyzac_trunnion"])
def test_what_is_stated_is_what_an_adjustment_finds(name: str) -> None:
    model, theta, values = true_machine(name, count=300)
    postures = Postures.of(model, values, TOOL, SIGMA)
    choice = postures.chosen(40, "A")
    chosen = choice.index
    assert len(set(chosen.tolist())) > 20
    stated, drawn = postures.tip_mm(chosen), postures.tip_mm(np.arange(40))
    assert stated < 0.95 * drawn < postures.tip_mm(chosen[:4])
    assert choice.rms_mm[-1] == pytest.approx(stated, rel=1e-6)
    # the same readings in the adjustment of `fit`; one nest
    found = []
    for rows in (chosen, np.arange(40)):
        pose = model.machine(theta).actual(values[rows])
        fit = fit_joints(model, [read("points", pose, values[rows], names=1)])
        spread = fit.sigma_in_best_frame(values, np.array(TOOL))[0] / np.sqrt(
            max(1.0, fit.chi_square / fit.freedom)
        )
        found.append(float(np.sqrt(np.mean(np.sum(spread**2, axis=1)))))
    assert found == pytest.approx([stated, drawn], rel=0.05)


@pytest.mark.slow
def test_each_criterion_is_best_by_its_own_measure() -> None:
    model, _, values = true_machine("xyzac_trunnion", count=200)
    postures = Postures.of(model, values, TOOL, SIGMA)

    def volume(rows: np.ndarray) -> float:
        """Of the unknowns beside the place of the tracker, whose prior is 1, as theirs is."""
        some = postures.candidates.only(rows)
        table = np.concatenate((some.rows, some.shared), axis=2).reshape(3 * len(rows), -1)
        covariance = np.linalg.inv(np.eye(table.shape[1]) + table.T @ table)
        return float(-np.linalg.slogdet(covariance[:-6, :-6])[1])

    by_mean, by_volume = (postures.chosen(30, criterion).index for criterion in ("A", "D"))
    assert volume(by_volume) > volume(by_mean)
    assert postures.tip_mm(by_mean) < postures.tip_mm(by_volume)


@pytest.mark.slow
def test_the_verb_writes_a_program_of_postures(tmp_path: Path) -> None:
    machine, out = FOLDER / "arm-payload" / "machine.toml", tmp_path / "poses.csv"
    words = ["calibrate", "plan", "-m", str(machine), "--next", "12", "--reflector", "0", "0", "150"]
    done = run(*words, "-o", str(out))
    assert done.exit_code == 0, done.stderr
    assert "tip after um" in done.stdout and "tip after random ones um" in done.stdout
    assert len(out.read_text().splitlines()) == 14
    assert run("inspect", str(out), "-m", str(machine)).exit_code == 0
    # of a list that the machine can take, rows of it alone
    again = tmp_path / "again.csv"
    done = run(*words[:-6], "--next", "5", "--among", str(out), "-o", str(again))
    assert done.exit_code == 0, done.stderr
    assert set(again.read_text().splitlines()[2:]) <= set(out.read_text().splitlines()[2:])
    assert run(*words[:4]).exit_code == 2
    plate = str(FOLDER / "gantry-plate" / "machine.toml")
    done = run("calibrate", "plan", "-m", plate, "--next", "5", "--among", str(out))
    assert done.exit_code == 2 and "--among is for machines with rotary joints" in done.stderr


@pytest.mark.parametrize(
    ("name", "most_mm"),
    [
        ("tripod", 1.0),
        ("linear-delta", 5.0),
        pytest.param("hexapod", 5.0, marks=pytest.mark.slow),
        pytest.param("rotary-delta", 100.0, marks=pytest.mark.campaign),
    ],
)
def test_random_postures_of_a_platform_are_poses_that_it_reaches(
    name: str, most_mm: float, tmp_path: Path
) -> None:
    """They fill the travel, and legs that are a little off hold the platform there."""
    assert run("init", str(tmp_path), "--structure", name).exit_code == 0
    machine = olp.load_kinematics(tmp_path / "machine.toml")
    values, structure = random_postures(machine.structure, 200, 5), machine.structure
    ends = np.array([joint.travel for joint in structure.joints.values()]).T
    assert len(values) > 150
    assert (values >= ends[0]).all() and (values <= ends[1]).all()
    assert (np.ptp(values, axis=0) > 0.4 * (ends[1] - ends[0])).all()
    (platform,) = structure.platforms.values()
    off = {(platform.name, k): LegErrors(length_mm=0.1 * (-1) ** k) for k in range(len(platform.legs))}
    there = Kinematics(structure, MachineErrors(legs=off)).actual(values).position
    assert np.linalg.norm(there - machine.nominal(values).position, axis=1).max() < most_mm


def test_a_platform_that_is_carried_asks_for_a_list_of_postures(tmp_path: Path) -> None:
    assert run("init", str(tmp_path), "--structure", "tripod").exit_code == 0
    text = (tmp_path / "machine.toml").read_text()
    text = text.replace('chain = "F P"', 'chain = "F X P"').replace('program_words = "pose"', "")
    (tmp_path / "machine.toml").write_text(
        text + "\n[axes.X]\ntravel_mm = [0.0, 9.0]\nleast_increment_mm = 0.001\n"
    )
    with pytest.raises(ConfigError, match="further axes carry the platform"):
        plan_poses(tmp_path / "machine.toml", 5)
