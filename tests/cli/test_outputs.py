"""No verb writes over what it reads, writes two results into one file, or loses one that goes to `-`."""

from __future__ import annotations

from pathlib import Path

import pytest
from cases.acceptance import TRUE_ZERO, machine
from cases.gate import block
from cli.test_cli import run

START = "start_mm = { X = 0.0, Y = 0.0, Z = 0.0 }\n"
MESH = '[[meshes]]\nfile = "clamp.stl"\nrole = "fixture"\nframe = "G54"\n'
PROGRAM = "G21 G90 G54 G64 P0.02\nG1 X40 F3000\nY40\nX0\n"
POINTS = "X_mm,Y_mm,Z_mm\n" + "".join(f"{k},{k * k / 50},0\n" for k in range(0, 100, 2))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A machine, a job with a mesh, a program, and files of points."""
    machine(tmp_path, tables=TRUE_ZERO, job=START + MESH)
    (tmp_path / "clamp.stl").write_bytes(block((400.0, 0.0, 0.0), (410.0, 10.0, 10.0)))
    (tmp_path / "part.ngc").write_text(PROGRAM)
    (tmp_path / "points.csv").write_text(POINTS)
    return tmp_path


@pytest.mark.parametrize("words", [
    ["correct", "part.ngc", "-o"],
    ["correct", "part.ngc", "-o", "out.ngc", "--report"],
    ["check", "part.ngc", "-o"],
    ["check", "part.ngc", "--clearances"],
    ["simulate", "part.ngc", "-o"],
    ["retime", "part.ngc", "-o"],
    ["retime", "part.ngc", "--lines"],
    ["view", "part.ngc", "--no-time", "-o"],
    ["compare", "points.csv", "points.csv", "-o"],
    ["compare", "points.csv", "points.csv", "--save-profile"],
])  # fmt: skip
def test_a_mesh_of_the_job_is_never_overwritten(
    folder: Path, words: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    name = "clamp.json" if words[-1] == "--report" else "clamp.stl"
    (folder / "clamp.stl").rename(folder / name)
    (folder / "job.toml").write_text((folder / "job.toml").read_text().replace("clamp.stl", name))
    before = (folder / name).read_bytes()
    result = run(*words, name, "-j", "job.toml", "--force")
    assert (result.exit_code, (folder / name).read_bytes()) == (2, before), result.stderr
    assert "is an input of this call and is never overwritten" in result.stderr


def test_a_mesh_is_no_plot_of_a_calibration(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    (folder / "clamp.svg").write_bytes((folder / "clamp.stl").read_bytes())
    (folder / "job.toml").write_text((folder / "job.toml").read_text().replace("clamp.stl", "clamp.svg"))
    result = run("inspect", "-j", "job.toml", "--plot", "clamp.svg", "--force")
    assert (result.exit_code, (folder / "clamp.svg").read_bytes()[:5]) == (2, b"solid"), result.stderr


@pytest.mark.parametrize("words", [
    ["check", "part.ngc", "-o", "out.csv", "--clearances", "out.csv"],
    ["compare", "points.csv", "points.csv", "-o", "out.csv", "--save-profile", "./out.csv"],
    ["retime", "part.ngc", "--slow", "out.csv", "--lines", "./out.csv"],
])  # fmt: skip
def test_two_results_are_two_files(folder: Path, words: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    result = run(*words, "-j", "job.toml", "--force")
    assert result.exit_code == 2
    assert "is named as output twice; name two files" in result.stderr
    assert not (folder / "out.csv").exists()


@pytest.mark.parametrize(("verb", "option"), [
    ("compare", "--output"), ("compare", "--part-frame"), ("compare", "--save-profile"),
    ("retime", "--lines"), ("retime", "--slow"), ("retime", "--report"), ("retime", "--plot"),
])  # fmt: skip
def test_what_goes_to_a_file_only_is_not_lost_on_stdout(
    folder: Path, verb: str, option: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    files = ["points.csv", "points.csv"] if verb == "compare" else ["part.ngc"]
    result = run(verb, *files, "-j", "job.toml", option, "-")
    assert (result.exit_code, result.stdout) == (2, "")
    assert f"{option} writes a file and cannot be -; name a file" in result.stderr
    assert not (folder / "-").exists()


def test_stdout_takes_no_second_stretch_and_nothing_is_written_then(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    (folder / "part.ngc").write_text("G1 X40 F3000\nG28\nG0 X0 Y0 Z9\nG1 X5 F600\n")
    result = run("retime", "part.ngc", "-j", "job.toml", "-o", "-", "--lines", "lines.csv")
    assert (result.exit_code, result.stdout) == (2, "")
    assert "2 stretches, and stdout takes one" in result.stderr
    assert not (folder / "lines.csv").exists()


@pytest.mark.parametrize("words", [["check"], ["view", "--no-time"], ["retime"]])
def test_only_what_came_from_stdin_is_called_so(
    folder: Path, words: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    bad = b"G1 X40 F3000\nG1 X\n"
    streamed = run(words[0], "-", *words[1:], "-j", "job.toml", *(["-o", "-"]), stdin=bad)
    assert (streamed.exit_code, "<stdin>:2: " in streamed.stderr) == (3, True), streamed.stderr
    (folder / "bad.ngc").write_bytes(bad)
    named = run(words[0], "bad.ngc", *words[1:], "-j", "job.toml", "-o", "out.csv")
    assert (named.exit_code, "bad.ngc:2: " in named.stderr) == (3, True), named.stderr


@pytest.mark.parametrize(("verb", "target"), [
    ("check", "olp.workflows.check.examined"), ("view", "olp.review.job.run"),
    ("retime", "olp.workflows.retime.run"),
])  # fmt: skip
def test_an_error_of_no_file_stays_of_no_file(
    folder: Path, verb: str, target: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from olp.core.errors import ProgramError

    def fails(*_: object, **__: object) -> None:
        raise ProgramError("is wrong", line=7)

    monkeypatch.chdir(folder)
    monkeypatch.setattr(target, fails)
    result = run(verb, "part.ngc", "-j", "job.toml")
    assert (result.exit_code, "<stdin>" in result.stderr) == (3, False), result.stderr


def test_what_cannot_be_corrected_is_of_the_nominal_program(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    # where the axes are is not known, and their errors depend on it
    text = '[[curves]]\nfile = "y.csv"\n'
    machine(folder, text, {"y.csv": "Y_mm,EXY_um\n-1000,0\n2000,30\n"}, tables=TRUE_ZERO)
    for name in ("n.ngc", "c.ngc"):
        (folder / name).write_text("G21 G90 G54\nG1 X40 F600\n")
    result = run("check", "c.ngc", "--nominal", "n.ngc", "-m", "machine.toml")
    assert (result.exit_code, "n.ngc:2: " in result.stderr) == (3, True), result.stderr
