"""G68 and G51 without a centre: the unroller states the position of the program, as the control takes it."""

from __future__ import annotations

from pathlib import Path

import pytest
from cases.unrolling import flatten, refused
from judge import machines
from judge.machines import Recipe

import olp

HEAD = "O1\nG21 G17 G90 G54\nG0 X7. Y-3.5 Z9.\n"
TURNED = "G1 X20. Y4. Z-1. F300.\nX30.\n{}\nG0 X0. Y0. Z9.\nM30\n"


@pytest.mark.parametrize(
    ("control", "block", "stated", "end"),
    [
        ("fanuc", "G68 R30.", "G68 X7. Y-3.5 R30.", "G69"),
        ("haas", "N5 G90 G68 R-12.5 (TURN)", "N5 G90 G68 X7. Y-3.5 R-12.5 (TURN)", "G69"),
        ("haas", "G51 P2.", "G51 X7. Y-3.5 Z9. P2.", "G50"),
        ("fanuc", "G51 I1000 J2000 K1000", "G51 X7. Y-3.5 Z9. I1000 J2000 K1000", "G50"),
        ("fanuc", "G68 X1. Y2. R30.", "G68 X1. Y2. R30.", "G69"),
    ],
)
def test_the_corrected_program_is_that_of_the_stated_centre(
    tmp_path: Path, control: str, block: str, stated: str, end: str
) -> None:
    """A correction moves the position before, and so would turn the rest about another point."""
    path = machines.random_machine(tmp_path, 3, Recipe(controller=control, off_datum=True))
    path.write_text(path.read_text().replace("compensated_by", "scaling_unit = 0.001\ncompensated_by", 1))
    rest = TURNED.format(end)
    without, explicit = (f"{HEAD}{text}\n{rest}".encode() for text in (block, stated))
    assert flatten(without, profile=control) == explicit
    assert olp.correct(without, path, flatten=True).data == olp.correct(explicit, path).data
    if block != stated:
        # the block is written out unasked
        done = olp.correct(without, path)
        assert done.data == olp.correct(explicit, path).data
        assert [f.lines for f in done.findings if f.code == "OLP110"] == [(4,)]


def test_a_loop_with_such_a_block_is_not_kept(tmp_path: Path) -> None:
    path = machines.random_machine(tmp_path, 3, Recipe(controller="fanuc", off_datum=True))
    text = f"{HEAD}M98 P2 L2\nM30\nO2\nG68 R30.\nG1 X20. Y4. Z-1. F300.\nG69\nG0 X7. Y-3.5 Z9.\nM99\n"
    for asked in (True, False):
        done = olp.correct(text.encode(), path, flatten=asked)
        assert done.data.partition(b"M30")[0].count(b"G68 X7. Y-3.5 R30.") == 2


def test_a_position_that_is_not_known_and_increments() -> None:
    code, message, line = refused("G21 G90\nG0 X5.\nG68 R30.\n", "fanuc")
    assert (code, line) == ("OLP524", 3)
    assert "the position of Y is needed here" in message
    # which the reader refuses, as a parameter decides there
    text = b"G21 G90\nG0 X5. Y1.\nG91 G68 R30.\n"
    assert flatten(text, profile="fanuc") == text
