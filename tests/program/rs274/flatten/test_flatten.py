"""Unrolling of programs: hand-worked expectations, copying of plain bytes, refusals with their lines."""

from __future__ import annotations

import math
import re

import pytest
from cases.unrolling import fanuc, flatten, lcnc, refusal
from hypothesis import given
from hypothesis import strategies as st

from olp.core.errors import ProgramError, UsageError
from olp.program.rs274.flatten.language import MACRO_B, NGC
from olp.program.rs274.flatten.written import number_text


@pytest.mark.parametrize(
    ("profile", "eol"),
    [
        ("grbl", "\r"),
        *((p, e) for p in ("linuxcnc", "grbl", "fanuc", "haas") for e in ("\n", "\r\n", "\r\r\n")),
    ],
)
def test_plain_program_is_copied_byte_for_byte(profile: str, eol: str) -> None:
    lines = ["%", "N10 g0 X 1 2.5 (Gr\xf6\xdfe) Y-.3", "", "  ;  semi", "/G1X1.F100.", "X2. ,D3", "M30", "%"]
    data = eol.join(lines).encode("latin-1")
    assert flatten(data, profile=profile) == data
    assert flatten(data + eol.encode(), profile=profile) == data + eol.encode()


def is_plain(data: bytes) -> bool:
    """Whether text has no variables, codes or marks of flow, and no comment inside a comment, which is
    refused."""
    nested = re.search(rb"\([^)]*\(", data)
    return not set(data) & set(b"#[oO%/mMgG") and b"\x85" not in data and nested is None


@given(st.binary(max_size=60).filter(is_plain))
def test_text_without_variables_is_never_changed(data: bytes) -> None:
    assert flatten(data, profile="grbl") == data


def test_values_on_a_line_are_read_before_any_is_set() -> None:
    assert lcnc("#1=3\nG0 X#1 #1=5 Y[#1+1]\nX#1\nM2\n") == "G0 X3 Y4\nX5\nM2\n"


def test_number_words_and_comments() -> None:
    source = "#1=2 (two)\nN5 G1 X [#1 * 3 (in)] (after) ; end\nM2\n"
    assert lcnc(source) == "(two)\nN5 G1 X 6(in) (after) ; end\nM2\n"


def test_block_numbers_stay_on_the_first_visit() -> None:
    assert lcnc("o1 repeat [2]\nN5 X1\nN6 X[1/3]\no1 endrepeat\nM2\n") == (
        "N5 X1\nN6 X0.3333333333\nX1\nX0.3333333333\nM2\n"
    )


def test_subprogram_has_its_own_locals_and_returns_a_value() -> None:
    source = """o100 sub
#2=7 #31=8 #<own>=1 #<_all>=2
o100 endsub [#1 * 2]
#2=1
o100 call [21]
X#<_value> Y#2 Z#31 A#<_all>
M2
"""
    assert lcnc(source) == "X42 Y1 Z8 A2\nM2\n"


def test_flow_of_linuxcnc() -> None:
    source = """#1=0
o1 while [#1 LT 9]
#1=[#1+1]
o2 if [#1 EQ 2]
o1 continue
o2 elseif [#1 EQ 5]
o1 break
o2 else
X#1
o2 endif
o1 endwhile
o3 do
X-#1
#1=[#1-2]
o3 while [#1 GT 0]
M2
"""
    assert lcnc(source) == "X1\nX3\nX4\nX-5\nX-3\nX-1\nM2\n"


def test_external_subprogram_and_computed_label() -> None:
    files = {"101": b"o101 sub\nX#1\no101 endsub\n", "deep": b"o<deep> sub\nX#5063\no<deep> endsub\n"}

    def beside(wanted: str) -> tuple[str, bytes]:
        return f"{wanted}.ngc", files[wanted]

    assert lcnc("o[100+1] call [4]\nM2\n", subprograms=beside) == "X4\nM2\n"
    error = refusal("X1\no<deep> call\nM2\n", subprograms=beside)
    assert (error.file, error.line) == ("deep.ngc", 2)


def test_fanuc_calls_inside_linuxcnc() -> None:
    source = "O1 (head)\nX1\nM98 P200 L2\nM2\nO200\n#1=3\nG0 X#1\nM99\n"
    assert lcnc(source) == "O1 (head)\nX1\nG0 X3\nG0 X3\nM2\n"


def test_position_parameters_follow_the_program() -> None:
    source = "G21 G90 G0 X1 Y2\nG91 X1\nG90 Z[#5420 + #<_y>]\nG92 X10\nY#5420\nM2\n"
    assert lcnc(source) == "G21 G90 G0 X1 Y2\nG91 X1\nG90 Z4\nG92 X10\nY10\nM2\n"
    assert lcnc("G20 G0 X1\nG21\nY#5420\nM2\n") == "G20 G0 X1\nG21\nY25.4\nM2\n"


@pytest.mark.parametrize(
    "lost", ["G28", "G54", "G10 L2 P1 X1", "G43 H1", "M6", "G38.2 X5", "G53 G0 X1", "M101", "G41 D1 X9"]
)
def test_position_is_not_known_after(lost: str) -> None:
    error = refusal(f"G0 X1 Y2 Z3\n{lost}\nY[#5420]\n")
    assert error.line == 3
    assert "position of X" in str(error)


def test_block_delete_switch() -> None:
    source = "#1=1\n/#1=2\n/X#1\nY#1\nM2\n"
    assert lcnc(source) == "/X2\nY2\nM2\n"
    assert lcnc(source, block_delete=True) == "Y1\nM2\n"


@pytest.mark.parametrize(
    ("source", "line", "message"),
    [
        ("X1\nX#5061\n", 2, "#5061"),
        ("X1\nX#5221\n", 2, "#5221"),
        ("#5221=1\n", 1, "#5221"),
        ("X#5602000\n", 1, "out of range"),
        ("X#<none>\n", 1, "#<none>"),
        ("#<_x>=1\n", 1, "#<_x>"),
        ("o1 while [1]\n#1=1\no1 endwhile\n", 1, "blocks"),
        ("o1 sub\no1 call\no1 endsub\no1 call\n", 2, "levels deep"),
        ("o1 if [0]\nX1\n", 1, "label 1"),
        ("o1 endwhile\n", 1, "no open loop"),
        ("o9 call\n", 1, "subprogram 9"),
        ("o1 do\no1 continue\no1 while [0]\n", 2, "CONTINUE"),
        ("X[1+]\n", 1, "expected a number"),
        ("#1\n", 1, "without '='"),
        ("o1 blah\n", 1, "keyword"),
        ("o1 sub\nM72\no1 endsub\no1 call\n", 2, "M70"),
        ("G71 Q100 D1\n", 1, "G70"),
    ],
)
def test_refusals_name_the_line(source: str, line: int, message: str) -> None:
    error = refusal(source, limit=500)
    assert (error.file, error.line) == ("p.ngc", line)
    assert message in str(error)


def test_unknown_profile() -> None:
    with pytest.raises(UsageError, match="sinumeric"):
        flatten(b"", profile="sinumeric")


# --- Macro B ----------------------------------------------------------------------------------------------


def test_macro_b_loop_goto_and_macro_call() -> None:
    source = """%
O1000(MAIN)
N10 G90 G0 X0 Y0 (go)
#1=100
#2=3
WHILE[#2GT1]DO1
N20 G1 X[#1*#2] Y#5 Z-#2 F#1
#2=#2-1
END1
IF[#1EQ100]GOTO50
X999.
N50 G65 P2000 A1.5 I2. J3. I4. T5
M98 P2000
IF[#9 EQ #0]THEN #9=7
X#9
M30
O2000(SUB)
X#1 Y#4 Z#7
N7 G0 S#20
M99
%
"""
    assert fanuc(source) == (
        "%\nO1000(MAIN)\nN10 G90 G0 X0 Y0 (go)\nN20 G1 X300. Z-3. F100.\nG1 X200. Z-2. F100.\n"
        "X1.5 Y2. Z4.\nN7 G0 S5\nX100.\nG0\nX7.\nM30\n%\n"
    )


def test_macro_b_goto_searches_from_here_and_then_from_the_start() -> None:
    source = "O1\n#100=0\nN1 X1.\n#100=#100+1\nIF[#100LT2]GOTO1\nGOTO3\nN2 X9.\nN3 M30\n"
    assert fanuc(source) == "O1\nN1 X1.\nX1.\nN3 M30\n"


def test_subprogram_call_with_the_count_in_p_and_return_to_a_block() -> None:
    source = "O1\nM98 P20002\nX8.\nN5 X2.\nM30\nO2\nX3.\nM99 P5\n"
    assert fanuc(source) == "O1\nX3.\nX3.\nN5 X2.\nM30\n"


def test_haas_local_subprogram() -> None:
    source = b"O1\nM97 P100 L2\nM30\nN100 X1.\nM99\n"
    assert flatten(source, profile="haas") == b"O1\nN100 X1.\nX1.\nM30\n"


@pytest.mark.parametrize(
    ("source", "line", "message"),
    [
        ("O1\nX#500\n", 2, "#500"),
        ("O1\nX#5021\n", 2, "#5021"),
        ("O1\n#3000=1(STOP)\n", 2, "alarm"),
        ("O1\n#5201=1.\n", 2, "#5201"),
        ("O1\nG66.1 P1\n", 2, "G66.1"),
        ("O1\nG65 P2 X5\nM30\nO2\nM99\n", 2, "decimal point"),
        ("O1\nN1 GOTO1\n", 2, "blocks"),
        ("O1\nGOTO7\n", 2, "N7"),
        ("O1\nM98 P2\nM30\nO2\nX1.\n", 5, "no end"),
        ("O1\nX[ROUND[1.5]]\n", 2, "least increment"),
        ("O1\n#1=1.5\nG0 T#1\n", 3, "is 1.5; expected an integer"),
    ],
)
def test_macro_b_refusals(source: str, line: int, message: str) -> None:
    error = refusal(source, "fanuc", limit=500)
    assert error.line == line
    assert message in str(error)


def test_cycles_of_a_fanuc_are_written_out() -> None:
    source = "O1\nG90 G0 X1. Y1. Z5.\nG98 G81 Z-1. R1. F100. (hole)\nG99 X2.\nG80\nM30\n"
    blocks = fanuc(source, expand_cycles=True).split("\n")
    assert [line.split() for line in blocks] == [
        ["O1"], ["G90", "G0", "X1.", "Y1.", "Z5."], ["G98", "F100.", "(hole)"],
        ["G0", "Z1."], ["G1", "Z-1."], ["G0", "Z5."],
        ["G99"], ["G0", "X2."], ["G0", "Z1."], ["G1", "Z-1."], ["G0", "Z1."], ["G80"], ["M30"], [],
    ]  # fmt: skip


def test_a_frame_or_length_that_begins_in_a_block_leaves_its_own_words_known() -> None:
    hole = "G98 G81 Z-1. R1. F100.\n"
    source = f"O1\nG90 G0 G54 X1. Y1.\nG43 H4 Z5.\n{hole}G80 G0 Z9.\n{hole}G80\nM30\n"
    blocks = fanuc(source, expand_cycles=True).split("\n")
    strokes = [line.split()[1] for line in blocks if line.startswith(("G0 Z", "G1"))]
    assert strokes == ["Z1.", "Z-1.", "Z5.", "Z1.", "Z-1.", "Z9."]
    lost = refusal("O1\nG90 G0 X1. Y1. Z5.\nG43 H4\nG98 G81 Z-1. R1. F100.\n", "fanuc", expand_cycles=True)
    assert lost.line == 4
    assert "position of Z" in str(lost)


@pytest.mark.parametrize(
    ("block", "message"),
    [
        ("G81 Z-1 R1. F1.", "decimal point"),
        ("G83 Z-1. R1. Q1. F1.", "peck_clearance"),
        ("G84 Z-1. R1. F1.", "synchronised"),
        ("G76 Z-1. R1. Q.5 F1.", "at an angle"),
        ("G87 Z1. R-1. Q.5 F1.", "at an angle"),
        ("G81 Z-1. F1.", "no R word"),
        ("G81 A5. Z-1. R1. F1.", "moves A"),
        ("G88 Z-1. R1. F1.\nX#5001", "position of X"),
    ],
)
def test_cycles_that_cannot_be_written_out(block: str, message: str) -> None:
    error = refusal(f"O1\nG90 G0 X1. Y1. Z5.\n{block}\n", "fanuc", expand_cycles=True)
    assert message in str(error)


def test_cycles_of_linuxcnc_stop_exactly_and_give_the_path_mode_back() -> None:
    source = "G21 G64 P.01\nG90 G0 X1 Y1 Z5 M3\nG91 G99 G84 X1 Z-1 R-4 F1 P.5\nM2\n"
    assert lcnc(source, expand_cycles=True).splitlines()[2:] == [
        "G91 G99 F1", "G61", "G90", "G0 X2", "G0 Z1", "G1 Z0", "M5", "M4", "G4 P0.5", "G1 Z1", "M5", "M3",
        "G91", "G64 P0.01", "M2",
    ]  # fmt: skip


@given(st.floats(-1e6, 1e6).filter(lambda x: abs(x) > 1e-3 or x == 0))
def test_number_text_keeps_ten_digits(value: float) -> None:
    text = number_text(value, "x", NGC)
    assert float(text) == pytest.approx(value, rel=1e-9, abs=1e-12)
    assert "e" not in text
    assert text == number_text(float(text), "x", NGC)
    assert float(number_text(value, "x", NGC, exact=True)) == value
    assert "." in number_text(value, "x", MACRO_B)
    assert float(number_text(value, "x", MACRO_B)) == pytest.approx(value, abs=0.5001e-4)


@pytest.mark.parametrize(
    ("value", "letter", "expected"),
    [
        (0.1 + 0.2, "x", "0.3"), (1 / 3, "x", "0.3333333333"), (-2 / 3, "x", "-0.6666666667"),
        (10 / 3, "x", "3.333333333"), (123456.789012345, "x", "123456.789"),
        (12345678901.6, "x", "12345678902"),
        (1e9 / 3, "x", "333333333.3"), (1e10 / 3, "x", "3333333333"), (1e-5 / 3, "x", "0.000003333333"),
        (1e-13, "x", "0"), (-1e-13, "x", "0"), (0.0, "x", "0"), (-0.0, "x", "0"), (100.0, "x", "100"),
        (1e3, "f", "1000"), (2.5, "p", "2.5"), (5.1, "g", "5.1"), (1.0, "m", "1"),
    ],
)  # fmt: skip
def test_numbers_of_linuxcnc(value: float, letter: str, expected: str) -> None:
    assert number_text(value, letter, NGC) == expected


@pytest.mark.parametrize(
    ("value", "letter", "expected"),
    [
        (1 / 3, "x", "0.3333"), (100.0, "x", "100."), (2.5, "y", "2.5"), (0.00005, "x", "0.0001"),
        (0.00004, "x", "0."), (-0.00004, "x", "0."), (0.0, "x", "0."), (-0.0, "z", "0."), (-3.0, "r", "-3."),
        (123456.78, "f", "123456.78"), (81.0, "g", "81"), (54.1, "g", "54.1"),
        *((7.00004, letter, "7") for letter in "mnpltdhos"), (-7.0, "p", "-7"), (7.0, "k", "7."),
        (7.0, "f", "7."),
    ],
)  # fmt: skip
def test_numbers_of_macro_b(value: float, letter: str, expected: str) -> None:
    assert number_text(value, letter, MACRO_B) == expected
    assert number_text(value, letter, MACRO_B, exact=True) == expected


def test_exact_numbers_have_all_digits() -> None:
    assert number_text(1 / 3, "x", NGC, exact=True) == "0.3333333333333333"
    assert number_text(1e-7 / 3, "x", NGC, exact=True) == "0.000000033333333333333334"
    assert number_text(100.0, "x", NGC, exact=True) == "100"


@pytest.mark.parametrize(
    ("value", "letter", "message"),
    [
        (math.inf, "x", "the value of X is not finite"), (math.nan, "f", "the value of F is not finite"),
        (1.5, "p", "the value of P is 1.5; expected an integer"),
        (math.inf, "t", "the value of T is inf; expected an integer"),
    ],
)  # fmt: skip
def test_numbers_that_cannot_be_written(value: float, letter: str, message: str) -> None:
    with pytest.raises(ProgramError, match=f"^{message}$") as caught:
        number_text(value, letter, MACRO_B)
    assert caught.value.code == "OLP540"


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        # the end of the last line, and of lines without one
        ("G0 X[1]\r\nM2", "G0 X1\r\nM2"), ("G0 X[1]\r\nM2\r\n", "G0 X1\r\nM2\r\n"), ("X[1]", "X1"), ("", ""),
        ("#1=2", ""), ("#1=2\n", ""), ("X[1]\n#1=2", "X1\n"), ("X[1]\n\n", "X1\n\n"),
        ("X1\r\nM98 P2\r\nM2\r\nO2\r\nX2\r\nX3 M99", "X1\r\nX2\r\nX3\r\nM2\r\n"),
        # blanks beside what is taken out
        ("#1=2 X#1  Y3\n", "X0  Y3\n"), ("X1  #1=2  Y3\n", "X1  Y3\n"), ("X1 #1=2\n", "X1\n"),
        ("\tX[2]  \n", "\tX2  \n"),
        ("X1 #1=2 \n", "X1 \n"), ("X1 #1=[2 (in)] (out)\n", "X1 (in)(out)\n"), ("#1=2 ; end\n", "; end\n"),
        ("#1=2 (a)\n", "(a)\n"), ("N5 #1=2\n", ""), ("N5 #1=2 (a)\n", "N5 (a)\n"), ("/#1=2 X1\n", "/X1\n"),
        # two values in one word stay together
        ("G1X[1+1]Y-[3]\n", "G1X2Y-3\n"), ("g1 x#1\n", "g1 x0\n"), ("X [ 1 ] Y 2\n", "X 1 Y 2\n"),
        ("G[80+1-80] X[2]\n", "G1 X2\n"), ("N[5] X1\n", "N5 X1\n"),
    ],
)  # fmt: skip
def test_blocks_are_written_with_what_is_around_their_values(source: str, expected: str) -> None:
    assert lcnc(source) == expected


def test_a_last_block_without_an_end_takes_that_of_the_program() -> None:
    def beside(name: str) -> tuple[str, bytes]:
        return "7.ngc", b"o7 sub\r\nM2"

    assert lcnc("X1\no7 call\n", subprograms=beside) == "X1\nM2\n"
    assert lcnc("X1\no7 call", subprograms=beside) == "X1\nM2"
    assert lcnc("o7 call\n", subprograms=beside) == "M2\n"


def test_values_of_a_block_are_those_before_it() -> None:
    # X moves in the same block
    assert lcnc("G0 X5\nG0 X[#5420+1] Y#5420\nX#5420 #1=#5420\nY#1\nM2\n") == "G0 X5\nG0 X6 Y5\nX6\nY6\nM2\n"


def test_block_numbers_of_each_file_are_seen_once() -> None:
    def beside(name: str) -> tuple[str, bytes]:
        return "7.ngc", b"o7 sub\nN5 X7\no7 endsub\n"

    source = "o1 repeat [2]\nN5 X1\no7 call\no1 endrepeat\nM2\n"
    assert lcnc(source, subprograms=beside) == "N5 X1\nN5 X7\nX1\nX7\nM2\n"
    assert lcnc("o1 repeat [2]\nN5\no1 endrepeat\nM2\n") == "N5\nM2\n"


@pytest.mark.parametrize("code", ["M2", "M30", "m[2]", "M 3 0"])
def test_the_end_of_the_program(code: str) -> None:
    assert lcnc(f"X1\nG0 X2 {code}\nX3\n").splitlines()[:1] == ["X1"]
    assert len(lcnc(f"X1\nG0 X2 {code}\nX3\n").splitlines()) == 2
    assert len(lcnc("X1\nM3 G2 X2 I1\nX3\n").splitlines()) == 3


def test_the_end_within_a_subprogram_ends_the_program() -> None:
    assert lcnc("o1 sub\nX1\nM2\no1 endsub\no1 call\nX3\n") == "X1\nM2\n"
