"""A run tells how far it is: its shares rise through all steps, and the steps between them are small."""

from __future__ import annotations

import runpy
from itertools import chain, groupby, pairwise
from pathlib import Path

import pytest

import olp
from olp.core.progress import part

PROGRAMS = Path(__file__).resolve().parents[2] / "programs"


def told(lines: int) -> list[tuple[str, float]]:
    """What a correction of a raster tells, on a machine with backlash."""
    make = runpy.run_path(str(PROGRAMS / "generate.py"))
    text = "\n".join(chain(make["START"], make["raster"](lines), make["END"])) + "\n"
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
