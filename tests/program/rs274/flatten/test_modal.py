"""G66: a macro after each block that moves, until G67."""

from __future__ import annotations

import pytest
from cases.unrolling import fanuc, lcnc, refused

HEAD = "O1\nG90 G0 X0. Y0. Z9.\n"
MACRO = "O2\nG1 Z#26 F#9\nG0 Z9.\nM99\n"
PASS = "G1 Z-3. F20.\nG0 Z9.\n"


def unrolled(body: str, macro: str = MACRO) -> str:
    return fanuc(f"{HEAD}{body}M30\n{macro}").removeprefix(HEAD).removesuffix("M30\n")


def test_each_block_that_moves_calls_the_macro() -> None:
    body = "G66 P2 Z-3. F20.\nX1.\nM8\nF30.\nG91 Y1.\nG90\nG4 P1\nG67\nX5.\n"
    assert unrolled(body) == f"X1.\n{PASS}M8\nF30.\nG91 Y1.\n{PASS}G90\nG4 P1\nX5.\n"


def test_a_count_calls_it_so_often_and_its_own_moves_call_nothing() -> None:
    assert unrolled("G66 P2 L2 Z-3. F20.\nG2 I5.\nG67\n") == f"G2 I5.\n{PASS}{PASS}"


def test_moves_of_subprograms_call_it_too() -> None:
    macro = MACRO + "O3\nX1.\nX2.\nM99\n"
    assert unrolled("G66 P2 Z-3. F20.\nM98 P3\nG67\n", macro) == f"X1.\n{PASS}X2.\n{PASS}"


def test_g67_without_g66_is_kept() -> None:
    assert unrolled("G40 G67\nX1.\n") == "G40 G67\nX1.\n"


def test_words_beside_g67_are_kept() -> None:
    assert unrolled("G66 P2 Z-3. F20.\nG67 M9\nX1.\n") == "M9\nX1.\n"


def test_a_local_variable_that_the_macro_sets_first_may_change() -> None:
    macro = "O2\n#1=0\nWHILE [#1 LT 2] DO1\nG1 Z-#1 F#9\n#1=[#1+1]\nEND1\nM99\n"
    passes = "G1 Z0. F20.\nG1 Z-1. F20.\n"
    assert unrolled("G66 P2 F20.\nX1.\nX2.\nG67\n", macro) == f"X1.\n{passes}X2.\n{passes}"


NOT_KNOWN = "whether a canned cycle, G28, G30 or G53 calls the macro of G66 is not known"


@pytest.mark.parametrize(
    ("body", "code", "line", "message"),
    [
        ("G66 P2 Z-3. F2.\nX1.\nG66 P2 Z-3. F2.\n", "OLP544", 5, "a second G66 before the G67"),
        ("G66 P2 Z-3. F2.\nG28 X1.\n", "OLP544", 4, NOT_KNOWN),
        ("G66 P2 Z-3. F2.\nG53 X1.\n", "OLP544", 4, NOT_KNOWN),
        ("G66 P2 Z-3. F2.\nG81 X1. Z-2. R1. F9.\n", "OLP544", 4, NOT_KNOWN),
        ("G66 P2 Z-3. F2.\nG67 X1.\n", "OLP544", 4, "under G66 this block moves, and calls or returns"),
        ("G66 P2 Z-3. F2.\nX1. M98 P2\n", "OLP544", 4, "under G66 this block moves, and calls or returns"),
        ("G66 P7\n", "OLP542", 3, "subprogram 7 is not in the file"),
        ("G66 P2 Z5\n", "OLP516", 3, "the argument Z has no decimal point"),
    ],
)
def test_what_is_not_known_is_refused(body: str, code: str, line: int, message: str) -> None:
    told = refused(f"{HEAD}{body}M30\n{MACRO}", "fanuc")
    assert (told[0], told[2]) == (code, line)
    assert told[1].startswith(message)


@pytest.mark.parametrize("word", ["G66 P2", "G67"])
def test_a_macro_of_g66_has_no_g66(word: str) -> None:
    told = refused(f"{HEAD}G66 P2 F2.\nX1.\nM30\nO2\n{word}\nM99\n", "fanuc")
    assert told[0::2] == ("OLP544", 7)


def test_a_local_variable_that_may_have_its_argument_again_is_refused() -> None:
    macro = "O2\nG1 Z-#1 F9.\n#1=[#1+1]\nM99\n"
    told = refused(f"{HEAD}G66 P2 A1.\nX1.\nX2.\nG67\nM30\n{macro}", "fanuc")
    assert told[0::2] == ("OLP541", 9)
    assert told[1].startswith("#1 was changed by the last call of this macro")


def test_linuxcnc_runs_no_file_of_subprograms_alone() -> None:
    library = "o<slot> sub\nG0 X#1\no<slot> endsub\n"
    assert refused(library) == (
        "OLP542",
        "nothing moves here: the file defines subprogram <slot> and calls none; give the program that calls "
        "it, which may be one line such as `o<slot> call` in a file beside this one",
        1,
    )
    assert "2 subprograms, the first is <slot>, and" in refused(library + "o5 sub\no5 endsub\n")[1]
    assert lcnc(library + "o<slot> call [2]\nM2\n") == "G0 X2\nM2\n"
    # what moves nothing and defines nothing is a program
    assert lcnc("#1=5\nM3 S#1\nM2\n") == "M3 S5\nM2\n"


def test_l0_of_m98_calls_nothing_in_linuxcnc() -> None:
    assert lcnc("M98 P1 L0\nX1\nM98 P1 L[2]\nM2\nO1\nX5\nM99\n") == "X1\nX5\nX5\nM2\n"
