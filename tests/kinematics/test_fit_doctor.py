"""`olp calibrate doctor` and `refine` of a machine of any joints: the covariance of a fit, readings with
values read back, what is put right in files, and refusals."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from calibration.joints.simulated import as_csv, campaign, known_machine, read
from kinematics.cases import golden
from kinematics.test_fit_files import MEASURED, POINTS, machine_in, run

import olp
from olp.calibration.joints.readings import Points
from olp.core.errors import ConfigError
from olp.files.kinematics.covariance import joint_covariance_bytes, load_joint_covariance
from olp.files.kinematics.plan import load_campaign
from olp.files.toml_text import read_toml

NAME = "xyzac_trunnion"


def trunnion(folder: Path) -> tuple[Path, Path, np.ndarray]:
    """The machine, its calibration with a covariance, which is returned as it was fitted, and `new.toml`, a
    plan of new readings with what the control showed."""
    model, _, true, values = known_machine(NAME)
    order = [f"{joint.name}_{joint.unit}" for joint in model.structure.joints.values()]
    back = values + 0.03 * np.sign(np.diff(values, axis=0, prepend=0.0))
    for name, seed in (("old", 1), ("new", 2)):
        points = read("points", model.machine(true).actual(values), values, seed)
        assert isinstance(points, Points)
        nests = ["nest", *(points.names[k] for k in points.which)]
        text = as_csv(order, values, MEASURED, points.measured_mm, nests)
        if name == "new":
            columns = [*(f"read_back_{axis}" for axis in order), *MEASURED]
            text = as_csv(order, values, columns, np.concatenate((back, points.measured_mm), axis=1), nests)
        campaign(folder, f"{name}.toml", NAME, {f"{name}.csv": text}, POINTS.replace("t.csv", f"{name}.csv"))
    machine = machine_in(folder, NAME)
    target = folder / "cal.toml"
    fitted = olp.fit_joint_calibration(folder / "old.toml", machine)
    fitted.write(target)
    return machine, target, fitted.fit.covariance


def doctor(folder: Path, *words: str | Path, plan: str = "new.toml") -> tuple[int, str]:
    return run(
        "calibrate", "doctor", folder / "cal.toml", folder / plan, "-m", folder / "machine.toml", *words
    )


@pytest.mark.slow
def test_the_covariance_reads_back_and_belongs_to_one_calibration(tmp_path: Path) -> None:
    machine, target, covariance = trunnion(tmp_path)
    values = read_toml(target.read_bytes(), str(target))[0]
    structure = golden(NAME)[0].machine.structure
    known = load_joint_covariance(target, values, structure)
    assert known is not None
    assert np.array_equal(known.covariance, covariance)
    archive = target.with_name("cal-covariance.npz")
    assert joint_covariance_bytes(known, values) == archive.read_bytes()
    values["location"]["A"]["Y_um"] += 1.0
    with pytest.raises(ConfigError, match="does not belong to cal"):
        load_joint_covariance(target, values, structure)
    other = golden("xyzbc_head_table")[0].machine.structure
    values["location"]["A"]["Y_um"] -= 1.0
    with pytest.raises(ConfigError, match="of another nominal machine"):
        load_joint_covariance(target, values, other)
    for wrong in (b"", b"PK", np.array(1.0).tobytes()):
        with pytest.raises(ConfigError, match="is not a covariance"):
            load_joint_covariance(target, values, structure, lambda _, wrong=wrong: wrong)
    # the calibration is used as one without the table is
    before = olp.load_kinematics(machine_in(tmp_path, NAME, "cal.toml")).actual(np.zeros((1, 5))).position
    text = target.read_text()
    target.write_text(re.sub(r"\[covariance\]\nfile = .*\nmisfit_um = .*\n", "", text))
    assert target.read_text() != text
    assert np.array_equal(olp.load_kinematics(machine).actual(np.zeros((1, 5))).position, before)


@pytest.mark.slow
def test_a_right_calibration_passes_and_both_columns_are_compared(tmp_path: Path) -> None:
    trunnion(tmp_path)
    code, said = doctor(tmp_path, "--json")
    report = json.loads(said[said.index("{") : said.rindex("}") + 1])
    assert (code, report["wrong"], report["log10_odds"]) == (0, [], None)
    assert report["reduced_chi_square"] < 1.5 < 10.0 < report["reduced_chi_square_read_back"]
    assert {row["sign"] for row in report["numbers"]} <= {"right", "undecided"}
    # values that were read back in the columns of the commanded ones, and the other way round
    text = (tmp_path / "new.csv").read_text()
    head, _, rest = text.partition("\n")
    exchanged = ",".join(
        name[10:] if name.startswith("read_back_") else f"read_back_{name}" if k < 5 else name
        for k, name in enumerate(head.split(","))
    )
    (tmp_path / "new.csv").write_text(f"{exchanged}\n{rest}")
    code, said = doctor(tmp_path)
    assert code == 1
    assert "commanded values and those read back are in each other's columns (odds" in " ".join(said.split())
    assert run("calibrate", "fit", tmp_path / "new.toml", "-m", tmp_path / "machine.toml")[0] == 1
    # all axes or none
    (tmp_path / "new.csv").write_text(text.replace("read_back_A_deg", "read_back_B_deg"))
    code, said = doctor(tmp_path)
    assert (code, "read_back_B_deg" in said) == (3, True)


@pytest.mark.slow
def test_a_wrong_number_is_put_right_in_a_new_file(tmp_path: Path) -> None:
    _, target, _ = trunnion(tmp_path)
    text = target.read_text()
    line = next(line for line in text.splitlines() if line.startswith("X_um"))
    flipped = line.replace("= -", "= ") if "= -" in line else line.replace("= ", "= -")
    target.write_text(text.replace(line, flipped, 1))
    new = tmp_path / "put-right.toml"
    code, said = doctor(tmp_path, "-o", new)
    assert code == 1
    assert "X_um: the other sign (odds" in said
    # a number that was edited by hand has the covariance of another one
    assert "not used: does not belong to cal.toml" in " ".join(said.split())
    assert line in new.read_text().splitlines()
    target.write_bytes(new.read_bytes())
    assert doctor(tmp_path)[0] == 0


def test_what_cannot_be_checked_is_refused(tmp_path: Path) -> None:
    _, target, _ = trunnion(tmp_path)
    assert doctor(tmp_path, "--sigma-um", "5")[0] == 2
    assert doctor(tmp_path, plan="absent.toml")[0] == 3
    assert doctor(tmp_path, "-o", target)[0] == 2
    text = target.read_text()
    target.write_text(text.replace("growth_per_year", "").replace("[covariance]", "[covariance]\ngrowth = 1"))
    code, said = doctor(tmp_path)
    assert (code, "growth" in said) == (3, True)
    campaign = load_campaign(tmp_path / "new.toml", golden(NAME)[0].machine.structure)
    assert campaign.readings[0].read_back is not None


@pytest.mark.slow
def test_a_calibration_is_refined_from_file_to_file(tmp_path: Path) -> None:
    """What was known fades with its age; the new calibration has a covariance and is checked with it."""
    machine, target, covariance = trunnion(tmp_path)
    text = (tmp_path / "new.toml").read_text()
    (tmp_path / "new.toml").write_text(text.replace("2026-11-20", "2027-11-20"))
    new = tmp_path / "later" / "refined.toml"
    new.parent.mkdir()
    words = ("calibrate", "refine", target, tmp_path / "new.toml", "-m", machine, "-o", new)
    code, said = run(*words, "--growth-per-year", "0.5", "--uncertainty-um", "20", "--json")
    assert code == 0, said
    report = json.loads(said[said.index("{") : said.rindex("}") + 1])
    assert report["growth_by_age"] == pytest.approx(1.5, abs=0.01)
    assert report["uncertainty_um"] < 20.0 and report["measure_again"] > "2027-11-20"
    assert all(row["sigma_after"] < 1.01 * row["sigma_before"] for row in report["changes"])
    before = np.sqrt(np.diag(covariance))[0] * 1e6
    assert report["changes"][0]["sigma_before"] == pytest.approx(1.5 * before, rel=0.01)
    written = new.read_text()
    assert "measured = 2027-11-20" in written and "growth_per_year = 0.5" in written
    structure = golden(NAME)[0].machine.structure
    known = load_joint_covariance(new, read_toml(new.read_bytes(), str(new))[0], structure)
    assert known is not None and np.all(np.diag(known.covariance) < 2.25 * np.diag(covariance) * 1.02)
    code, said = run("calibrate", "doctor", new, tmp_path / "new.toml", "-m", machine)
    assert code == 0, said
    # without a wanted uncertainty no day is stated
    plain = olp.refine_joint_calibration(target, tmp_path / "new.toml", machine)
    assert "measure_again" not in plain.report
    for change, words_of in (
        (("2027-11-20", "2026-11-01"), "before the calibration of 2026-11-20"),
        (("schema", 'elasticity = ["A"]\nschema'), "elasticity"),
    ):
        (tmp_path / "wrong.toml").write_text((tmp_path / "new.toml").read_text().replace(*change, 1))
        words = ("calibrate", "refine", target, tmp_path / "wrong.toml", "-m", machine, "-o", new, "--force")
        code, said = run(*words)
        assert (code, words_of in " ".join(said.split())) == (3, True), said
    target.write_text(re.sub(r"\[covariance\]\nfile = .*\nmisfit_um = .*\n", "", target.read_text()))
    code, said = run(*words[:3], tmp_path / "new.toml", *words[4:])
    assert (code, "states no covariance" in " ".join(said.split())) == (3, True)
