"""Canned cycles where controls differ in what a block of a series has to say."""

from __future__ import annotations

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine
from cases.unrolling import fanuc

from olp.core.errors import ProgramError
from olp.files.config import load_setup
from olp.program.program import Program
from olp.program.registry import DIALECTS, read

START = "O1\nG21 G90 G17 G54\nG0 X0. Y0. Z20.\n"


@pytest.fixture(scope="module")
def reading(tmp_path_factory: pytest.TempPathFactory):  # type: ignore[no-untyped-def]
    setup = load_setup(machine(tmp_path_factory.mktemp("m"), tables=TRUE_ZERO))

    def read_(body: str, control: str = "fanuc", start: str = START) -> Program:
        return read(f"{start}{body}M30\n".encode(), setup, DIALECTS[control])

    return read_


def path(program: Program) -> list[list[float]]:
    return program.toolpath.end_mm.tolist()


@pytest.mark.parametrize("zero", ["K0", "L0"])
def test_zero_repeats_store_what_the_next_blocks_use(zero: str, reading) -> None:  # type: ignore[no-untyped-def]
    stored = reading(f"G99 G81 Z-5. R2. F100. {zero}\nX10. Y5.\nX20.\nG80\n")
    stated = reading("G99 G81 X10. Y5. Z-5. R2. F100.\nX20.\nG80\n")
    assert path(stored) == path(stated)
    np.testing.assert_array_equal(stored.holes.place_mm, [[10, 5], [20, 5]])


def test_zero_repeats_at_a_place_are_refused(reading) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ProgramError, match="whether it goes to its place") as caught:
        reading("G99 G81 X1. Z-5. R2. F100. K0\nG80\n")
    assert (caught.value.code, caught.value.line) == ("OLP531", 4)


@pytest.mark.parametrize("code", ["G82", "G86", "G89"])
def test_a_cycle_of_fanuc_needs_no_dwell(code: str, reading) -> None:  # type: ignore[no-untyped-def]
    with_none = reading(f"G99 {code} X1. Z-5. R2. F100.\nG80\n")
    assert path(with_none) == path(reading(f"G99 {code} X1. Z-5. R2. P0 F100.\nG80\n"))
    with pytest.raises(ProgramError, match="needs a dwell P"):
        reading(f"M3 S9\nG99 {code} X1. Z-5. R2. F100.\nG80\n", "linuxcnc", START.replace("O1\n", ""))


def test_a_first_peck_of_haas_counts_where_there_is_no_q(reading) -> None:  # type: ignore[no-untyped-def]
    varying = reading("G99 G83 X1. Z-5. R2. I3. J.5 K1. F100.\nG80\n", "haas")
    assert path(varying) == path(reading("G99 G83 X1. Z-5. R2. Q3. F100.\nG80\n", "haas"))
    assert len(varying.holes.line) == 1
    with pytest.raises(ProgramError, match="needs a peck Q"):
        reading("G99 G83 X1. Z-5. R2. I3. F100.\nG80\n")


def test_a_colon_begins_the_number_of_a_program(reading) -> None:  # type: ignore[no-untyped-def]
    start = START.replace("O1", ":0001 (PART)")
    assert path(reading("X5.\n", start=start)) == path(reading("X5.\n"))
    text = fanuc(":1\nG21 G90\nM98 P2\nM98 P2\nM30\n:2\nG91 G1 X5. F9.\nG90\nM99\n")
    assert text == ":1\nG21 G90\nG91 G1 X5. F9.\nG90\nG91 G1 X5. F9.\nG90\nM30\n"
