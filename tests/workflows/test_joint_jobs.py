"""The jobs that ship for machines with rotary joints: corrected, proved, and judged by an own forward."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from cases.joint_jobs import JOINT_JOBS
from cli.test_cli import run
from judge.five_axis import Judge

import olp
from olp.workflows.batch_pool import Here
from olp.workflows.batch_release import release, what_if
from olp.workflows.correct import CorrectOptions

FOLDER = Path(__file__).resolve().parents[2] / "programs"
#: By job the largest deviation without correction, from and to, in um and urad.
FAR = {
    "trunnion-mill": ((20.0, 60.0), (50.0, 100.0)),
    "gantry-wrist": ((50.0, 90.0), (80.0, 130.0)),
    "arm-payload": ((400.0, 700.0), (700.0, 1100.0)),
    "hexapod": ((100.0, 150.0), (400.0, 600.0)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", JOINT_JOBS)
def test_the_job_is_corrected_and_proved(name: str) -> None:
    far, turned = FAR[name]
    path, job = FOLDER / name / JOINT_JOBS[name], FOLDER / name / "job.toml"
    result = olp.correct_joints(path, path.with_name("machine.toml"), job)
    before = result.report["deviation"]["before"]
    assert result.report["verdict"]["ok"]
    assert far[0] < before["position_max_um"] < far[1]
    assert turned[0] < before["orientation_max_urad"] < turned[1]
    proof = olp.verify_joints(path, result.data, path.with_name("machine.toml"), job)
    assert proof.report["deviation"]["after"] == result.report["deviation"]["after"]


@pytest.mark.slow
def test_the_judge_agrees(tmp_path: Path) -> None:
    """On the first rings of the trunnion mill, without the measured curve, which the judge does not model."""
    shutil.copytree(FOLDER / "trunnion-mill", tmp_path / "job")
    calibration = tmp_path / "job" / "calibration.toml"
    text = calibration.read_text("utf-8")
    calibration.write_text(re.sub(r"(?ms)^\[\[curves\].*?(?=^\[)", "", text), "utf-8")
    program = (FOLDER / "trunnion-mill" / "dome.nc").read_bytes().partition(b"(RING AT 34")[0] + b"M30\n"
    result = olp.correct_joints(program, tmp_path / "job" / "machine.toml")
    far, turned = Judge(tmp_path / "job" / "machine.toml").judged(program, result.data)
    stated = result.report["deviation"]["after"]
    assert far == pytest.approx(1e-3 * stated["position_max_um"], abs=0.15e-3)
    # each pairs a place with its own nearest pose, in which 0.15 um count as much as 1.5 urad
    assert turned == pytest.approx(1e-6 * stated["orientation_max_urad"], abs=1.5e-6)


@pytest.mark.slow
def test_a_batch_takes_machines_of_all_kinds(tmp_path: Path) -> None:
    """The bytes are those of a call for each; a changed curve of errors makes its program again, no other."""
    shutil.copytree(FOLDER / "trunnion-mill", tmp_path / "mill")
    shutil.copytree(FOLDER / "arm-payload", tmp_path / "arm")
    plant = tmp_path / "out"
    done = olp.batch([tmp_path / "mill", tmp_path / "arm"], output=plant, workers=1)
    assert done.exit_code == 0 and done.report["counts"] == {"written": 2}
    (mill,) = (row for row in done.report["programs"] if row["program"].endswith("dome.nc"))
    machine, job = tmp_path / "mill" / "machine.toml", tmp_path / "mill" / "job.toml"
    alone = olp.correct_joints(tmp_path / "mill" / "dome.nc", machine, job)
    assert (plant / mill["program"]).read_bytes() == alone.data
    assert mill["corrected_um"] == alone.report["deviation"]["after"]["position_max_um"]
    with (tmp_path / "mill" / "c.csv").open("a") as curve:
        curve.write("# again\n")
    again = olp.batch([tmp_path / "mill", tmp_path / "arm"], output=plant, workers=1)
    assert {row["program"]: row["state"] for row in again.report["programs"]} == {
        row["program"]: "written" if row is mill else "unchanged" for row in done.report["programs"]
    }
    paged = run("batch", str(tmp_path / "arm"), "-o", str(tmp_path / "c"), "--pages", "--workers", "1")
    assert paged.exit_code == 0, paged.stderr
    assert b"deburr.csv" in (tmp_path / "c" / "deburr.csv.review.html").read_bytes()
    options = CorrectOptions(only_sure_components=True)
    other = olp.batch([tmp_path / "arm"], output=tmp_path / "b", options=options, workers=1)
    assert other.exit_code == 2 and "--only-sure-components" in other.report["programs"][0]["message"]


@pytest.mark.slow
@pytest.mark.parametrize("squareness_urad", [16.0, 96.0])
def test_a_new_calibration_says_of_a_release_what_verify_says(tmp_path: Path, squareness_urad: float) -> None:
    """The file of the release itself finds it good, and a machine that is 80 urad less square does not."""
    folder, plant = tmp_path / "mill", tmp_path / "out"
    shutil.copytree(FOLDER / "trunnion-mill", folder)
    olp.batch([folder], output=plant, workers=1)
    release(plant, "may")
    stated = (folder / "calibration.toml").read_text("utf-8")
    new = folder / "new.toml"
    new.write_text(stated.replace("C0Y_urad = 16.0", f"C0Y_urad = {squareness_urad}"), "utf-8")
    report = what_if(plant, new, lambda _: Here())
    (row,) = report["programs"]
    shutil.copy(new, folder / "calibration.toml")
    text = (plant / "dome.nc").read_bytes()
    alone = olp.verify_joints(folder / "dome.nc", text, folder / "machine.toml", folder / "job.toml")
    deviation = alone.report["deviation"]
    assert row["largest_um"] == deviation["after"]["position_max_um"]
    assert row["tolerance_um"] == deviation["allowed_um"]
    assert row["outside"] is not deviation["holds"]
    assert row["outside"] is (squareness_urad > 16.0)
    assert report["exit_code"] == int(row["outside"])


def test_a_payload_that_nothing_weighs_is_named(tmp_path: Path) -> None:
    """Where no [elasticity] says what a payload bends, one that was not on while measuring is a finding."""
    shutil.copytree(FOLDER / "arm-payload", tmp_path / "job")
    job, calibration = tmp_path / "job" / "job.toml", tmp_path / "job" / "calibration.toml"
    (tmp_path / "job" / "deburr.csv").write_text(
        "\n".join((FOLDER / "arm-payload" / "deburr.csv").read_text().splitlines()[:4]) + "\n"
    )
    text = calibration.read_text("utf-8")
    bare = text.partition("[elasticity.J2]")[0]
    sagging = bare + '[[gravity]]\ncomponent = "EJ2J2"\nangles = ["J2"]\nsin_urad = 300.0\n'

    def named(stated: str) -> list[str]:
        calibration.write_text(stated, "utf-8")
        done = olp.correct_joints(tmp_path / "job" / "deburr.csv", tmp_path / "job" / "machine.toml", job)
        return [one.message for one in done.findings if one.code == "OLP422"]

    def held(kg: float, centre: str) -> str:
        return sagging.replace("box =", f"payload_kg = {kg}\npayload_centre_mm = {centre}\nbox =", 1)

    assert named(text) == []
    (message,) = named(sagging)
    assert "of the job is 6.5 kg, that of the calibration none" in message
    assert named(held(6.5, "[15.0, 0.0, 90.0]")) == []
    assert "centre at" in named(held(6.5, "[15.0, 0.0, 140.0]"))[0]
    job.write_text(job.read_text().replace("payload_kg = 6.5\n", "").replace("payload_centre_mm", "# "))
    assert "of the job is none, that of the calibration 4 kg" in named(held(4.0, "[0.0, 0.0, 0.0]"))[0]
    assert named(sagging) == []
    with pytest.raises(olp.ConfigError, match="payload_kg stands beside"):
        named(text.replace("box =", "payload_kg = 2.0\nbox =", 1))
