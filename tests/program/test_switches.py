"""Comments that switch the correction off and on."""

from __future__ import annotations

from pathlib import Path

import pytest
from judge import machines

import olp

LINES = ("G21 G90 G54", "G0 X1. Y1. Z1.", "{off}", "G1 X2. F100", "Y2.", "{on}", "X3. Y3. Z2.", "M2", "")


@pytest.fixture(scope="module")
def shifted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.shift_machine(tmp_path_factory.mktemp("shift"))


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r\r\n"])
@pytest.mark.parametrize(
    ("off", "on"),
    [("(olp off)", "(olp on)"), ("; OLP OFF", ";olp on"), ("( Olp Off: probing)", "(oLP ON)")],
)
def test_a_section_stays_as_it_is(shifted: Path, end: str, off: str, on: str) -> None:
    source = end.join(LINES).format(off=off, on=on)
    lines = olp.correct(source.encode(), shifted).data.decode().split(end)
    before, after = lines.index(off), lines.index(on)
    assert lines[before + 1 : after] == ["G1 X2. F100", "Y2."]
    assert lines[before - 1] != "G0 X1. Y1. Z1."
    assert lines[after + 1] != "X3. Y3. Z2."


@pytest.mark.slow
def test_a_section_may_be_long(shifted: Path) -> None:
    """Over many of the chunks in which a text is read."""
    inner = "".join(f"X{i % 97}.5\n" for i in range(120_000))
    source = f"G21 G90 G54 G64 P0.01\nG0 X1 Y1 Z1\n(olp off)\nG1 F100\n{inner}(olp on)\nX3 Y3 Z2\nM2\n"
    written = olp.correct(source.encode(), shifted).data
    assert f"(olp off)\nG1 F100\n{inner}(olp on)\n".encode() in written
    assert b"\nX3 Y3 Z2\n" not in written


@pytest.mark.parametrize("comment", ["(now olp off)", "(olp offset 3)", "(MSG, olp off)"])
def test_other_comments_do_not_switch(shifted: Path, comment: str) -> None:
    source = "\n".join(LINES).format(off=comment, on="(x)")
    assert b"\nY2.\n" not in olp.correct(source.encode(), shifted).data
