"""The turns of all arcs of a program together are bounded."""

from __future__ import annotations

import pytest

from olp.core.errors import ProgramError
from olp.core.machine import Axis, Machine, Setup, WorkOffset
from olp.program.registry import named, read

AXES = {axis: Axis((-1000.0, 1000.0), 0.001, 100.0, 1000.0, 1e5) for axis in "XYZ"}
SETUP = Setup(Machine("m", "FXYZ", "linuxcnc", AXES, work_offsets={"G54": WorkOffset("G54", set_by="true")}))
HEAD = "G21 G90 G54 G17 F100\nG0 X0 Y0 Z0\n"


def refusal(text: str) -> tuple[int | None, str, str] | None:
    try:
        read((HEAD + text).encode(), SETUP, named("linuxcnc"))
    except ProgramError as error:
        return error.line, error.code, error.message
    return None


def expected(line: int, limit: int) -> tuple[int, str, str]:
    message = f"the arcs up to here make more than {limit} further turns; divide the program"
    return line, "OLP543", message


ROUND = "{} X0 Y0 I5 P{}\n"


@pytest.mark.parametrize("code", ["G2", "G3"])
def test_ten_thousand_further_turns_are_read(code: str) -> None:
    # the first turn of an arc does not count
    most = ROUND.format(code, 10_000)
    assert refusal(most + ROUND.format(code, 2)) is None
    assert refusal(most + ROUND.format(code, 3)) == expected(4, 10_000)
    assert refusal(most + ROUND.format(code, 1) + ROUND.format(code, 3) + ROUND.format(code, 9)) == expected(
        5, 10_000
    )


def test_less_than_a_turn_takes_nothing_off() -> None:
    text = "G2 X10 Y0 I5\nG2 X0 Y0 I-5\n" * 3 + ROUND.format("G2", 10_000)
    assert refusal(text + ROUND.format("G2", 2)) is None
    assert refusal(text + ROUND.format("G2", 3)) == expected(10, 10_000)


def test_a_long_program_may_make_a_quarter_of_a_turn_for_each_byte() -> None:
    text = ("(" + "x" * 97 + ")\n") * 500 + ROUND.format("G2", 10_000) + ROUND
    limit = (len(HEAD) + len(text.format("G2", 1000))) // 4
    assert 12_000 < limit < 15_000
    assert refusal(text.format("G2", limit - 9_999 + 1)) is None
    assert refusal(text.format("G2", limit - 9_999 + 2)) == expected(504, limit)
