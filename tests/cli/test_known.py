"""Programs corrected by numbers of the call, without files."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from olp.cli import main

PART = "G21 G90\nG0 X0 Y0\nG0 Z5\nG1 Z-1 F300\nG1 X300 F1200\nG1 Y300\nG1 X0\nG1 Y0\nG0 Z5\nM30\n"


@pytest.fixture
def part(tmp_path: Path) -> str:
    (tmp_path / "part.nc").write_text(PART)
    return str(tmp_path / "part.nc")


def run(*words: str) -> tuple[int, str]:
    done = CliRunner().invoke(main, words)
    return done.exit_code, done.output


def test_one_command_and_no_file(part: str) -> None:
    code, says = run("correct", part, "--skew", "XY=1.414mm/m")
    assert code == 0
    assert "Y leans toward +X by 1.414 mm per m (C0Y = -1414 urad)" in says
    text = Path(part).with_name("part.corrected.nc").read_text()
    assert "G1 Y300 X299.576\nG1 X-0.424\nG1 Y0 X0.000\n" in text


@pytest.mark.parametrize(
    "words",
    [
        ("check", "--date", "today"), ("check", "--nominal"), ("verify",), ("simulate", "-o"), ("view", "-o"),
    ],
)  # fmt: skip
def test_other_verbs_take_the_same_numbers(words: tuple[str, ...], part: str, tmp_path: Path) -> None:
    numbers = ("--skew", "XY=1.414mm/m", "--scale", "Y=0.1%", "--backlash", "X=0.02mm")
    second = str(tmp_path / "second.nc")
    assert run("correct", part, *numbers, "-o", second)[0] == 0
    verb, *options = words
    beside = {"--nominal": [second, "--nominal", part], "-o": [part, "-o", str(tmp_path / "out.html")]}
    files = beside.get(options[0] if options else "", [part, *options] if options else [part, second])
    if verb == "simulate":
        files[-1] = str(tmp_path / "out.csv")
    code, says = run(verb, *files, *numbers)
    assert code == 0, says


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        (("--skew", "XY=1.4"), 2, "expected such as 1.4mm/m, 0.4mm/600mm or 300urad"),
        (("--skew", "XY=1mm/m", "-m", "machine.toml"), 2, "leave out -m and -j"),
        (("--skew", "XY=50mm/m"), 3, "OLP446"),
        (("--backlash", "Q=1mm"), 2, "a name out of X, Y, Z"),
        (("--skew", "XY=1mm/m", "--dialect", "heidenhein"), 2, "no dialect"),
    ],
)
def test_what_is_wrong_is_said(words: tuple[str, ...], code: int, says: str, part: str) -> None:
    assert run("correct", part, *words)[0] == code
    assert says in run("correct", part, *words)[1]


def test_a_code_that_the_assumed_control_has_not_says_how_to_name_another(tmp_path: Path) -> None:
    program = tmp_path / "drill.nc"
    program.write_text("G21 G90 G94\nG0 X0 Y10 Z5\nG98 G81 X10 Y10 Z-3 R2 F100\nG80\nM30\n")
    code, says = run("correct", str(program), "--skew", "XY=1mm/m")
    assert code == 3
    assert says.count("grbl is taken: name yours with --dialect") == 1
    code, says = run("correct", str(program), "--skew", "XY=1mm/m", "--dialect", "grbl")
    assert code == 3
    assert "name yours" not in says
    assert run("correct", str(program), "--skew", "XY=1mm/m", "--dialect", "linuxcnc")[0] == 0
