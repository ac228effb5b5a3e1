"""`olp view` and `olp correct --review`: where files come from, what goes where, refusals, light imports."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest
from cli.test_cli import HEAVY, PROGRAMS, imported_by, run
from judge.unpacker import Page

import olp


@pytest.fixture
def job(tmp_path: Path) -> Path:
    """A copy of the nasty machine with a program, in a folder of its own."""
    folder = tmp_path / "job"
    shutil.copytree(PROGRAMS / "nasty", folder)
    (folder / "job.toml").write_text(
        'schema = "olp-job-1"\nprogram = "modal.ngc"\nmachine = "machine.toml"\n'
    )
    return folder


def test_the_page_stands_beside_the_program(job: Path) -> None:
    result = run("view", "-j", job / "job.toml", "--no-time")
    assert result.exit_code == 0, result.stderr
    page = job / "modal.review.html"
    assert result.stderr.startswith(f"wrote {page}: ")
    assert result.stdout == ""
    assert (
        page.read_bytes()
        == olp.view(job / "modal.ngc", olp.load_setup(None, job / "job.toml"), time=False).html()
    )


def test_the_page_goes_where_it_is_sent(job: Path) -> None:
    target = job / "out.html"
    quiet = run("view", job / "modal.ngc", "-m", job / "machine.toml", "-o", target, "--no-time", "-q")
    assert quiet.stderr == ""
    stdin = (job / "modal.ngc").read_bytes()
    result = run("view", "-", "-m", job / "machine.toml", "--no-time", stdin=stdin)
    page, other = Page(result.stdout_bytes), Page(target.read_bytes())
    assert page.manifest["program"] == "program"
    assert page.array("text_nominal") == other.array("text_nominal")


def test_nothing_is_overwritten(job: Path) -> None:
    target = job / "out.html"
    target.write_text("mine")
    words = ("view", "-j", job / "job.toml", "-o", target, "--no-time")
    result = run(*words)
    assert (result.exit_code, target.read_text()) == (2, "mine")
    assert "--force" in result.stderr
    assert run(*words, "--force").exit_code == 0
    for name in ("modal.ngc", "machine.toml", "calibration.toml", "x.csv"):
        before = (job / name).read_bytes()
        result = run("view", "-j", job / "job.toml", "-o", job / name, "--no-time", "--force")
        assert (result.exit_code, (job / name).read_bytes()) == (2, before)
    assert run("view", "-j", job / "job.toml", "-o", job / "none" / "out.html", "--no-time").exit_code == 2


@pytest.mark.slow
def test_a_corrected_program_and_measurements_are_shown(job: Path) -> None:
    corrected, measured = job / "good.ngc", job / "raw.csv"
    assert run("correct", "-j", job / "job.toml", "-o", corrected, "-q").exit_code == 0
    assert run("simulate", "-j", job / "job.toml", "-o", measured).exit_code == 0
    target = job / "out.html"
    words = (
        "view",
        "-j",
        job / "job.toml",
        "--corrected",
        corrected,
        "--measured",
        measured,
        "-o",
        target,
        "--no-time",
    )
    assert run(*words).exit_code == 0
    page = Page(target.read_bytes())
    assert page.manifest["corrected"] == "good.ngc"
    assert page.layer("measured")["label"] == "measured"
    for name in (corrected, measured):
        before = name.read_bytes()
        assert run(*words[:-3], "-o", name, "--no-time", "--force").exit_code == 2
        assert name.read_bytes() == before


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--live", "-o", "x.html"), "--live serves files: leave out -o"),
        (("--port", "8000"), "--port is for --live"),
        (("--corrected", "-"), "stdin can be PROGRAM only"),
        (("--measured", "-"), "stdin can be PROGRAM only"),
        (("--step-mm", "0"), "--step-mm"),
    ],
)
def test_calls_that_are_wrong(words: tuple[str, ...], message: str, job: Path) -> None:
    result = run("view", "-j", job / "job.toml", *words)
    assert result.exit_code == 2
    assert message in result.stderr


def test_refusals_name_file_and_line(job: Path) -> None:
    bad = job / "bad.ngc"
    bad.write_text("G21 G90 G54\nG0 X0 Y0 Z20\nG1 X#1 F600\nM2\n")
    for words, stdin in (((bad,), None), (("-",), bad.read_bytes())):
        result = run("view", *words, "-m", job / "machine.toml", stdin=stdin)
        assert result.exit_code == 3
        assert f"olp: error: {bad if stdin is None else '<stdin>'}:3: " in result.stderr
    bad.write_text("G21 G90 G54\nG0 X0 Y0 Z20\nG1 X10\nM2\n")
    result = run("view", bad, "-m", job / "machine.toml")
    assert result.exit_code == 3
    assert "no feed" in result.stderr or "feed" in result.stderr
    measured = job / "raw.csv"
    measured.write_text("# frame=G54\nX_mm,Y_mm,Z_mm\n1,2\n")
    result = run("view", "-j", job / "job.toml", "--measured", measured, "--no-time")
    assert (result.exit_code, f"{measured}:3: " in result.stderr) == (3, True)
    assert not list(job.glob("*.html"))


@pytest.mark.slow
def test_correct_writes_the_page_of_what_it_wrote(job: Path) -> None:
    target, page = job / "good.ngc", job / "review.html"
    done = run("correct", "-j", job / "job.toml", "-o", target, "--review", page, "-q")
    assert done.exit_code == 0, done.stderr
    shown = Page(page.read_bytes())
    assert shown.manifest["corrected"] == "good.ngc"
    assert shown.manifest["time_source"] == "retimed"
    assert shown.array("text_corrected") == target.read_text().rstrip("\n").split("\n")
    setup = olp.load_setup(None, job / "job.toml")
    result = olp.correct(job / "modal.ngc", setup)
    expected = olp.view(job / "modal.ngc", setup, correction=result, corrected_name=str(target))
    assert page.read_bytes() == expected.html()


def test_correct_with_loops_shows_the_unrolled_text(job: Path) -> None:
    part, page = job / "loop.ngc", job / "review.html"
    part.write_text(
        "G21 G90 G54 G64 P0.001 Q0\nG43 H1\nG0 X0 Y0 Z5\n#1 = 0\no1 while [#1 lt 3]\n"
        "  G1 X[10 + #1 * 20] Y40 F600\n  #1 = [#1 + 1]\no1 endwhile\nM2\n"
    )
    words = (
        "correct",
        part,
        "-m",
        job / "machine.toml",
        "-o",
        job / "out.ngc",
        "--review",
        page,
        "-q",
        "--flatten",
    )
    result = run(*words)
    assert result.exit_code == 0, result.stderr
    assert sum("Y40" in line for line in Page(page.read_bytes()).array("text_nominal")) == 3


def test_correct_writes_all_files_or_none(job: Path) -> None:
    target, page = job / "good.ngc", job / "review.html"
    page.write_text("mine")
    assert run("correct", "-j", job / "job.toml", "-o", target, "--review", page, "-q").exit_code == 2
    assert (target.exists(), page.read_text()) == (False, "mine")
    result = run("correct", "-j", job / "job.toml", "-o", target, "--review", target, "-q")
    assert (result.exit_code, target.exists()) == (2, False)
    assert "named as output twice" in result.stderr
    assert run("correct", "-j", job / "job.toml", "-o", target, "--review", "-", "-q").exit_code == 2


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="paths of the other kind")
def test_imports_stay_light(job: Path) -> None:
    assert imported_by("view", "--help") & HEAVY == set()
    target = str(job / "out.html")
    loaded = imported_by("view", "-j", str(job / "job.toml"), "-o", target, "--no-time")
    assert loaded & {"meshcat", "trimesh", "matplotlib", "rich"} == set()
