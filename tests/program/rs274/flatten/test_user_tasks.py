"""Parametric programs of Okuma (user tasks), worked by hand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from cases.acceptance import TRUE_ZERO, machine

import olp
from olp.core.errors import ProgramError
from olp.program.registry import named
from olp.program.rs274.profiles.base import Profile


def okuma() -> Profile:
    """The control where X100 is 100 mm."""
    dialect = named("okuma")
    assert isinstance(dialect, Profile)
    return replace(dialect, language=replace(dialect.language, increments_open=False))


def unrolled(text: str, **options: object) -> str:
    dialect = okuma()
    assert dialect.unroller is not None
    result: bytes = dialect.unroller(text.encode(), dialect, **options)
    return result.decode()


def refused(text: str, **options: object) -> tuple[str, str, int | None]:
    with pytest.raises(ProgramError) as caught:
        unrolled(text, **options)
    return caught.value.code, caught.value.message, caught.value.line


def test_variables_words_and_jumps_to_names() -> None:
    text = (
        "$PART.MIN%\nOPART (REAL)\nVC20=4 (COUNT)\nN1 G15 H=VC20-3 G90\nLA=0\n"
        "NLOOP G0 X=LA*10 Y=-VC20/8 F=50+LA\nLA=LA+1\nIF[LA LT 3] NLOOP\nIF [LA EQ 3] GOTO N90\nX9.\nN90 M2\n"
    )
    assert unrolled(text) == (
        "$PART.MIN%\nOPART (REAL)\n(COUNT)\nN1 G15 H1 G90\n"
        "G0 X0. Y-0.5 F50.\nG0 X10. Y-0.5 F51.\nG0 X20. Y-0.5 F52.\nN90 M2\n"
    )


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("2+3*4", "14."), ("[2+3]*4", "20."), ("-[1 - 3]", "2."), ("7/2", "3.5"), ("10-4-3", "3."),
        ("SIN[30]", "0.5"), ("COS[60]+TAN[45]", "1.5"), ("ATAN[1]", "45."), ("ATAN2[1,-1]", "135."),
        ("SQRT[16]", "4."), ("ABS[-3]", "3."), ("MOD[17,12]", "5."), ("FIX[2.7]", "2."), ("FUP[2.1]", "3."),
        ("ROUND[2.5]", "3."), ("VC[VC1+1]", "8."),
    ],
)  # fmt: skip
def test_expressions(expression: str, value: str) -> None:
    assert unrolled(f"VC1=4\nVC5=8\nG1 X={expression} Y1.\nM2\n") == f"G1 X{value} Y1.\nM2\n"


def test_calls_have_arguments_and_repeats() -> None:
    text = (
        "OMAIN\nCALL OROW PX=10 PY=5*2\nCALL OROW PX=1\nCALL O0100 Q2\nM2\n"
        "OROW\nIF[PY NE EMPTY] NOK\nPY=7\nNOK G0 X=PX Y=PY\nRTS\nO100\nG91 G1 X-5. F9\nRTS\n"
    )
    assert unrolled(text) == (
        "OMAIN\nG0 X10. Y10.\nG0 X1. Y7.\nG91 G1 X-5. F9\nG91 G1 X-5. F9\nM2\n"
    )  # fmt: skip


def test_a_common_variable_is_that_of_all_programs_or_of_the_job() -> None:
    text = "OA\nCALL OB\nG0 X=VC1 Y=VC2\nM2\nOB\nVC1=VC2+1\nRTS\n"
    assert unrolled(text, parameters={"VC2": 5.0}) == "OA\nG0 X6. Y5.\nM2\n"
    code, why, line = refused(text)
    assert (code, line) == ("OLP541", 6)
    assert "VC2 is not set before in the program" in why
    assert '[parameters] "VC2"' in why


@pytest.mark.parametrize(
    ("text", "line", "code", "why"),
    [
        ("OA\nLA=1\nCALL OB\nM2\nOB\nLA=2\nRTS\n", 6, "OLP541", "local variable on both sides of a CALL"),
        ("OA\nLA=1\nCALL OB\nM2\nOB\nG0 X=LA\nRTS\n", 6, "OLP541", "local variable on both sides of a CALL"),
        ("OA\nLA=1\nCALL OB LA=2\nG0 X=LA\nM2\nOB\nRTS\n", 4, "OLP541", "local variable on both sides"),
        ("OA\nCALL OB Q2 PX=1\nM2\nOB\nRTS\n", 5, "OLP541", "keep their values in the next repeat"),
        ("OA\nG0 X=VZOFX[1]\nM2\n", 2, "OLP541", "VZOFX belongs to the control"),
        ("OA\nVZOFX[1]=5\nM2\n", 2, "OLP541", "VZOFX belongs to the control"),
        ("OA\nMODIN OB\nX1.\nMODOUT\nM2\nOB\nRTS\n", 2, "OLP544", "after each move"),
        ("OA\nGOTO NB\nNB X1.\nNB X2.\nM2\n", 2, "OLP542", "2 blocks NB; expected one"),
        ("OA\nGOTO N5\nM2\nOB\nN5 X1.\nRTS\n", 2, "OLP542", "no block N5; expected one"),
        ("OA\nX1.\nRTS\n", 3, "OLP542", "outside of a subprogram"),
        ("OA\nCALL OB Q0\nM2\nOB\nRTS\n", 2, "OLP516", "Q0; expected 1 or more"),
        ("OA\nCALL OC\nM2\n", 2, "OLP542", "subprogram c is not in the file"),
        ("OA\nIF[VC1 GT 1 OR VC1 LT 0] N5\nN5 M2\n", 2, "OLP540", "expected ']'"),
        ("OA\nG0 X=FIX[-1.5]\nM2\n", 2, "OLP540", "below zero is not known"),
        ("OA\nVC1=1 VC2=2\nM2\n", 2, "OLP510", "expected the end of the line"),
        ("OA\nNX GOTO NX\nM2\n", 2, "OLP543", "endless loop"),
    ],
)  # fmt: skip
def test_what_manuals_leave_open_is_refused(text: str, line: int, code: str, why: str) -> None:
    found, message, at = refused(text, limit=10_000)
    assert (found, at) == (code, line)
    assert why in message


def test_calls_of_other_controls_are_none() -> None:
    text = "OA\nM98 P1\nM2\nO1\nX1.\nM99\n"
    assert unrolled(text) == "OA\nM98 P1\nM2\n"
    assert not okuma().unrolls_m(980)


def test_a_line_that_is_not_reached_may_hold_anything() -> None:
    assert unrolled("OA\nGOTO NB\nVUACM[1]='NO DATA'\nVDOUT[992]=1001\nNB G0 X1.\nM2\n") == "OA\nG0 X1.\nM2\n"


def test_a_program_is_corrected_where_the_unit_of_its_numbers_is_stated(tmp_path: Path) -> None:
    """A drill pattern by calls is that of the same holes written out; the file of a subprogram is found."""
    start, end = "G15 H1 G90 G0 X0. Y0. Z50.\nG71 Z20.\n", "G80\nM2\n"
    calls = f"{start}VC1=0\nNA CALL OHOLE PX=VC1*15\nVC1=VC1+1\nIF[VC1 LE 2] NA\n{end}"
    hole = "G81 X{} Y5. Z-5. R2. F100. M53\n"
    (tmp_path / "OHOLE.SSB").write_text("OHOLE\n" + hole.format("=PX") + "RTS\n")
    (tmp_path / "p.min").write_text(calls)
    plain = start + "".join(hole.format(f"{x}.") for x in (0, 15, 30)) + end
    tables = TRUE_ZERO.replace("G54", '"G15 H1"')
    squareness = "[squareness]\nC0Y_urad = 400.0\n"
    setup = {"controller": "okuma", "tables": tables}
    machine_ = machine(tmp_path / "m", squareness, keys='decimal_point = "calculator"', **setup)
    got = olp.correct(tmp_path / "p.min", machine_, flatten=True)
    assert got.data == olp.correct(plain.encode(), machine_).data
    other = machine(tmp_path / "n", squareness, **setup)
    with pytest.raises(ProgramError, match=r'X= counts millimetres .* state decimal_point = "calculator"'):
        olp.correct(tmp_path / "p.min", other, flatten=True)
