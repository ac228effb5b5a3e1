"""The tolerance of the part comes from the call, else from the job file, in every verb that judges by it."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import olp

ROOT = Path(__file__).resolve().parents[2]
PLATE = ROOT / "programs" / "gantry-plate"


@pytest.fixture
def job(tmp_path: Path) -> Path:
    """The job of the plate with a tolerance of its part."""
    shutil.copytree(PLATE, tmp_path / "plate")
    path = tmp_path / "plate" / "job.toml"
    text = path.read_text("utf-8")
    path.write_text(
        text.replace('program = "plate.ngc"', 'program = "plate.ngc"\npart_tolerance_um = 7.5'), "utf-8"
    )
    return path


def test_compare_judges_by_the_job_where_the_call_gives_none(job: Path, tmp_path: Path) -> None:
    machine = job.with_name("machine.toml")
    measured = tmp_path / "measured.csv"
    measured.write_bytes(olp.simulate(job.with_name("plate.ngc"), machine, job).to_csv())
    of_job = olp.compare(job.with_name("plate.ngc"), [measured], machine, job)
    assert of_job.report["tolerance_um"] == 7.5
    assert of_job.report["holds"] is False
    given = olp.compare(job.with_name("plate.ngc"), [measured], machine, job, part_tolerance_um=100.0)
    assert given.report["tolerance_um"] == 100.0
    assert given.report["holds"] is True
