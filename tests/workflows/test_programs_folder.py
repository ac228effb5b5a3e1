"""Every job that the project ships: corrected and judged, or refused with the line it names."""

from __future__ import annotations

import re
import shutil
import tomllib
from pathlib import Path
from typing import Any

import pytest
from cases.acceptance import ROUNDING, TOLERANCE_UM, judged
from cases.fast import some_fast
from cases.joint_jobs import JOINT_JOBS
from judge.model import JudgeModel

import olp
from olp.core.errors import OlpError, ProgramError
from olp.files.config import load_job

FOLDER = Path(__file__).resolve().parents[2] / "programs"
JOBS = {
    "gantry-plate/plate.ngc": "job.toml",
    "bridge-cmm/housing.ngc": "job.toml",
    "table-router/front.ngc": "job.toml",
    "table-router/drill.ngc": "job-drill.toml",
    "table-router/outline.ngc": "job-outline.toml",
    "haas-mill/bracket.nc": "job.toml",
    "haas-mill/manifold.nc": "job-manifold.toml",
    **{f"nasty/{path.name}": "job.toml" for path in sorted((FOLDER / "nasty").glob("*.ngc"))},
}
#: refused, with the words in the refused line
REFUSED = {"nasty/block-delete-depends.ngc": "/"}
#: judged by LinuxCNC: its own dialect, and texts of other controls that it reads
JUDGED = [
    name
    for name in JOBS
    if name not in REFUSED and name.split("/")[0] in ("gantry-plate", "bridge-cmm", "nasty")
]


def run(name: str, **options: Any) -> tuple[bytes, olp.Correction]:
    path = FOLDER / name
    return path.read_bytes(), olp.correct(
        path, path.with_name("machine.toml"), path.with_name(JOBS[name]), **options
    )


def test_every_program_has_its_job() -> None:
    suffixes = {".ngc", ".nc"}
    shipped = {str(path.relative_to(FOLDER)) for path in FOLDER.glob("*/*") if path.suffix in suffixes}
    shipped -= {f"{name}/{program}" for name, program in JOINT_JOBS.items()}
    assert shipped == set(JOBS)
    for name, job in JOBS.items():
        text = tomllib.loads((FOLDER / name).with_name(job).read_text())
        assert ((FOLDER / name).with_name(text["program"])).is_file()


@pytest.mark.parametrize("name", some_fast([name for name in JOBS if name not in REFUSED], 3))
def test_the_job_is_corrected(name: str) -> None:
    nominal, result = run(name)
    deviation = result.report["deviation"]
    assert deviation["holds"], result.report["worst"]
    assert not [f for f in result.findings if f.severity.name == "ERROR"]
    moves = result.report["moves"]
    assert moves["corrected"] + moves["approximated"] + moves["passed"] == moves["total"]
    assert result.data != nominal
    path = FOLDER / name
    proof = olp.verify(nominal, result.data, path.with_name("machine.toml"), path.with_name(JOBS[name]))
    assert proof.report["deviation"]["holds"]


@pytest.mark.parametrize("name", REFUSED)
def test_the_job_is_refused_with_its_line(name: str) -> None:
    with pytest.raises(ProgramError) as caught:
        run(name)
    line = caught.value.line
    assert line is not None
    assert (FOLDER / name).read_text().splitlines()[line - 1].startswith(REFUSED[name])


@pytest.mark.parametrize("name", JOBS)
@pytest.mark.slow
def test_comments_and_unchanged_lines_survive(name: str) -> None:
    try:
        nominal, result = run(name)
    except OlpError:
        assert name in REFUSED
        return
    comments = re.findall(rb"\([^)\n]*\)", nominal)
    kept = [c for c in re.findall(rb"\([^)\n]*\)", result.data) if b"olp-corrected" not in c]
    assert kept == comments


@pytest.mark.parametrize("job", ["job.toml", "job-manifold.toml"])
def test_cycles_of_a_haas_written_out_are_exact(job: str) -> None:
    stated = load_job(FOLDER / "haas-mill" / job)
    assert stated.program is not None
    assert stated.machine is not None
    result = olp.correct(
        stated.program, stated.machine, FOLDER / "haas-mill" / job, expand_cycles=True, peck_clearance_mm=0.5
    )
    assert result.report["moves"]["approximated"] == 0
    assert not [f for f in result.findings if f.severity == "error"]


@pytest.mark.oracle
@pytest.mark.parametrize("name", JUDGED)
def test_the_judge_agrees(name: str, tmp_path: Path) -> None:
    """Without temperatures, which the judge does not model."""
    shutil.copytree((FOLDER / name).parent, tmp_path / "job")
    machine = tmp_path / "job" / "machine.toml"
    calibration = machine.with_name("calibration.toml")
    calibration.write_text(re.sub(r"(?ms)^\[thermal\].*?(?=^\[|\Z)", "", calibration.read_text()))
    nominal = (FOLDER / name).read_bytes()
    result = olp.correct(nominal, machine, expand_cycles=True)
    passed = tuple(line for f in result.findings if f.code in ("OLP102", "OLP306") for line in f.lines)
    # G10 L20 names the place where the tip is in another frame: the part stays where G54 has it
    same = {"G55": JudgeModel(machine).zero_shift("G54")} if b"\nG10 L20" in nominal else None
    verdict = judged(nominal, result.data, machine.parent, skip_lines=passed, shift_by_frame=same)
    digit_um = 0.1 if (FOLDER / name).parent.name == "bridge-cmm" else 1.0
    assert verdict.after.judged > 0
    assert verdict.max_um <= TOLERANCE_UM + ROUNDING * digit_um + 0.02, verdict.worst_line
    assert verdict.vertex_max_um <= TOLERANCE_UM + ROUNDING * digit_um + 0.02
