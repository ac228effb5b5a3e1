"""The tolerance of the part comes from the call, else from the job file, in every verb that judges by it."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

import olp
from olp.core.units import MM_PER_UM
from olp.reports.report import to_text

ROOT = Path(__file__).resolve().parents[2]
PLATE = ROOT / "programs" / "gantry-plate"
#: The tolerance of the job, in um.
OF_JOB_UM = 7.5
#: The line of the job that names the program.
NAMED = 'program = "plate.ngc"\n'
#: The line that states the tolerance.
STATED = f"part_tolerance_um = {OF_JOB_UM}\n"
#: That of a call, in um.
OF_CALL_UM = 200.0
#: A program of few waypoints, as most verbs are called twice.
SHORT = b"G21 G90 G17 G54\nT1 M6\nG0 Z50\nG0 X100 Y100\nG1 Z20 F600\nG1 X300\nG1 Y250\nM30\n"


@pytest.fixture
def job(tmp_path: Path) -> Path:
    """The job of the plate with a tolerance of its part."""
    shutil.copytree(PLATE, tmp_path / "plate")
    path = tmp_path / "plate" / "job.toml"
    text = path.read_text("utf-8")
    path.write_text(text.replace(NAMED, NAMED + STATED), "utf-8")
    return path


@pytest.fixture
def uncertain(job: Path) -> Path:
    """That job on a machine whose squareness is known to 20 urad."""
    calibration = job.with_name("calibration.toml")
    text = calibration.read_text("utf-8")
    calibration.write_text(text.replace("C0Y_urad = 31.0", "C0Y_urad = 31.0\nsigma_C0Y_urad = 20.0"), "utf-8")
    return job


def judged(verb: str, job: Path, part_tolerance_um: float | None = None) -> Mapping[str, Any]:
    """The report of a verb on a short program, its findings by code."""
    machine = job.with_name("machine.toml")
    program: tuple[bytes, ...] = (SHORT,)
    if verb == "verify":
        program = (SHORT, olp.correct(SHORT, machine, job).data)
    result = getattr(olp, verb)(*program, machine, job, part_tolerance_um=part_tolerance_um)
    return {**result.report, "codes": {finding.code for finding in result.findings}}


@pytest.mark.parametrize("verb", ("correct", "verify", "check"))
def test_the_tolerance_of_the_job_is_judged_unless_the_call_gives_one(uncertain: Path, verb: str) -> None:
    of_job, of_call = judged(verb, uncertain), judged(verb, uncertain, OF_CALL_UM)
    assert "OLP433" in of_job["codes"]
    assert "OLP433" not in of_call["codes"]
    if verb != "check":  # which reports findings alone
        first, second = (report["uncertainty"]["within"] for report in (of_job, of_call))
        assert (first["tolerance_um"], second["tolerance_um"]) == (OF_JOB_UM, OF_CALL_UM)
        assert first["after"]["program"] < 0.95


@pytest.mark.parametrize("verb", ("correct", "verify", "check"))
def test_without_a_part_tolerance_none_is_judged(uncertain: Path, verb: str) -> None:
    uncertain.write_text(uncertain.read_text("utf-8").replace(STATED, ""), "utf-8")
    report = judged(verb, uncertain)
    assert "OLP433" not in report["codes"]
    if verb != "check":
        uncertainty = report["uncertainty"]
        assert uncertainty["within"] is uncertainty["expected"]["probability_better"] is None
        assert uncertainty["band_um"]["max_um"] > 0.0
        assert "robab" not in to_text(report)


@pytest.mark.slow
def test_view_shows_the_tolerance_of_the_job_unless_the_call_gives_one(uncertain: Path) -> None:
    machine = uncertain.with_name("machine.toml")
    for given, shown_um in ((None, OF_JOB_UM), (OF_CALL_UM, OF_CALL_UM)):
        scene = olp.view(SHORT, machine, uncertain, part_tolerance_um=given, time=False).scene
        assert scene.uncertainty is not None
        assert scene.uncertainty.within_mm == pytest.approx(shown_um * MM_PER_UM)


@pytest.mark.slow
def test_compare_judges_by_the_job_where_the_call_gives_none(job: Path, tmp_path: Path) -> None:
    machine = job.with_name("machine.toml")
    measured = tmp_path / "measured.csv"
    measured.write_bytes(olp.simulate(job.with_name("plate.ngc"), machine, job).to_csv())
    of_job = olp.compare(job.with_name("plate.ngc"), [measured], machine, job)
    assert of_job.report["tolerance_um"] == OF_JOB_UM
    assert of_job.report["holds"] is False
    given = olp.compare(job.with_name("plate.ngc"), [measured], machine, job, part_tolerance_um=100.0)
    assert given.report["tolerance_um"] == 100.0
    assert given.report["holds"] is True
