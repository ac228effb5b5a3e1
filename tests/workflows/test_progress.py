"""A run tells how far it is: its shares rise through all steps, and the steps between them are small."""

from __future__ import annotations

import runpy
from itertools import chain, groupby, pairwise
from pathlib import Path

import pytest
from click.testing import CliRunner

import olp
from olp.cli import main
from olp.cli import progress as cli_progress
from olp.core.progress import part

PROGRAMS = Path(__file__).resolve().parents[2] / "programs"


def raster(lines: int) -> str:
    make = runpy.run_path(str(PROGRAMS / "generate.py"))
    return "\n".join(chain(make["START"], make["raster"](lines), make["END"])) + "\n"


def told(lines: int) -> list[tuple[str, float]]:
    """What a correction of a raster tells, on a machine with backlash."""
    text = raster(lines)
    marks: list[tuple[str, float]] = []
    machine = PROGRAMS / "gantry-plate" / "machine.toml"
    olp.correct(text.encode(), machine, progress=lambda what, share: marks.append((what, share)))
    return marks


def test_shares_rise_through_the_steps() -> None:
    marks = told(2000)
    shares = [share for _, share in marks]
    assert shares == sorted(shares) and shares[0] == 0.0 and 0.9 < shares[-1] <= 1.0
    assert [what for what, _ in groupby(what for what, _ in marks)] == [
        "read", "correct", "prove", "report",
    ]  # fmt: skip


@pytest.mark.slow
def test_long_programs_are_told_in_smaller_steps() -> None:
    few, many = told(60_000), told(240_000)
    for step in ("read", "correct", "prove"):
        count = [sum(what == step for what, _ in marks) for marks in (few, many)]
        assert count[1] > 2.5 * count[0] > 5, step
    shares = [0.0, *(share for _, share in many), 1.0]
    assert max(b - a for a, b in pairwise(shares)) < 0.11


def test_a_part_of_a_run_is_told_between_its_ends() -> None:
    marks: list[tuple[str, float]] = []
    tell = part(lambda what, share: marks.append((what, share)), 0.5, 0.7, "prove")
    tell("read", 0.0)
    tell("read", 0.5)
    assert marks == [("prove", 0.5), ("prove", pytest.approx(0.6))]


MACHINE = PROGRAMS / "gantry-plate" / "machine.toml"
RESULTS = "X_mm,Y_mm,Z_mm\n10,20,-5\n300,200,-20\n"
#: What the verbs that take a while tell on a terminal, in the order of their steps.
STEPS = {
    "correct": ["read", "correct", "prove", "report", "pack", "report"],
    "verify": ["read", "prove", "report"],
    "check": ["read", "correct", "prove", "report", "check"],
    "simulate": ["read", "simulate", "write"],
    "flatten": ["unroll"],
    "view": ["read", "correct", "prove", "report", "sample", "pack"],
    "results": ["read", "correct", "write"],
}


def words(verb: str, folder: Path) -> list[str]:
    """The words of a call, with the files that it reads and writes in a folder."""
    # without limits of motion, so that nothing is planned
    lines = [line for line in MACHINE.read_text().splitlines() if "_mm_s" not in line.split("=")[0]]
    text = "\n".join(lines).replace('"calibration.toml"', f'"{MACHINE.parent / "calibration.toml"}"')
    (folder / "machine.toml").write_text(text)
    out, machine = str(folder / "out"), ["-m", str(folder / "machine.toml")]
    nominal = [str(folder / "raster.ngc"), *machine]
    loop = folder / "loop.ngc"
    loop.write_text("G21 G90\n#1=0\no1 while [#1 LT 900]\n#1=[#1+1]\nG1 X[#1/9] F9\no1 endwhile\nM2\n")
    (folder / "r.csv").write_text(RESULTS)
    return {
        "correct": [*nominal, "-o", out, "--report", f"{out}.html", "--review", f"{out}.page.html"],
        "verify": [nominal[0], str(folder / "done.ngc"), *machine],
        "check": nominal,
        "simulate": [*nominal, "-o", out],
        "flatten": [str(loop), *machine, "-o", out],
        "view": [*nominal, "-o", out, "--no-time"],
        "results": [
            str(folder / "r.csv"), *machine, "--frame", "machine", "--tool", "1", "--tip-radius-mm", "1",
            "-o", out, "--outside-box", "hold",
        ],
    }[verb]  # fmt: skip


@pytest.mark.parametrize("verb", STEPS)
def test_a_verb_that_takes_a_while_tells_its_steps(
    verb: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The bar never stands: each step that grows with the program is told, with shares that rise in it."""
    marks: list[tuple[str, float]] = []

    class Bar:
        def __call__(self, what: str, share: float) -> None:
            marks.append((what, share))

        def close(self) -> None:
            pass

    (tmp_path / "raster.ngc").write_text(raster(30))
    olp.correct(tmp_path / "raster.ngc", MACHINE).write(tmp_path / "done.ngc")
    monkeypatch.setattr(cli_progress, "is_terminal", lambda stream: True)
    monkeypatch.setattr(cli_progress, "_Bar", Bar)
    done = CliRunner().invoke(main, [verb, *words(verb, tmp_path)])
    assert done.exit_code in (0, 1), done.output
    steps = [(what, [share for _, share in some]) for what, some in groupby(marks, lambda mark: mark[0])]
    missing = iter([what for what, _ in steps])
    assert all(step in missing for step in STEPS[verb]), [what for what, _ in steps]
    for what, shares in steps:
        assert all(0.0 <= share <= 1.0 for share in shares), what
        if what in ("prove", "unroll", "simulate", "write", "pack"):
            assert shares == sorted(shares), what
