"""Where a program ends: M2 and M30 however their number is written."""

from __future__ import annotations

from pathlib import Path

import pytest
from cases.acceptance import TRUE_ZERO, machine

import olp


@pytest.mark.parametrize("end", ["M2", "M30", "M2.0", "M30.", "M02", "m030.00", "M 2 .0"])
def test_what_is_behind_the_end_is_not_read(end: str, tmp_path: Path) -> None:
    path = machine(tmp_path, tables=TRUE_ZERO)
    program = f"G21 G90 G54\nG0 X1 Y2 Z3\n{end}\nthis is (not a program\n".encode()
    assert olp.correct(program, path).data == program


@pytest.mark.parametrize("code", ["M20", "M300", "M3.0", "M2.5"])
def test_other_codes_end_nothing(code: str, tmp_path: Path) -> None:
    path = machine(tmp_path, tables=TRUE_ZERO)
    with pytest.raises(olp.ProgramError):
        olp.correct(f"G21 G90 G54\nG0 X1 Y2 Z3\n{code}\nG2 X\n".encode(), path)
