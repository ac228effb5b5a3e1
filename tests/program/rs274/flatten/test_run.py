"""The order in which a parametric program runs: flow, subprograms, and what ends it; worked by hand."""

from __future__ import annotations

import pytest
from cases.unrolling import fanuc, flatten, lcnc, refusal, refused

MISSING = "is not in the file, and no file for it was given; put one into the folder of the program, such as"

# --- IF, WHILE, DO, REPEAT of LinuxCNC ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("conditions", "branch"),
    [((1, 0, 0), 1), ((1, 1, 1), 1), ((0, 1, 0), 2), ((0, 1, 1), 2), ((0, 0, 1), 3), ((0, 0, 0), 4)],
)
def test_one_branch_of_an_if_runs(conditions: tuple[int, int, int], branch: int) -> None:
    a, b, c = conditions
    source = f"o1 if [{a}]\nX1\no1 elseif [{b}]\nX2\no1 elseif [{c}]\nX3\no1 else\nX4\no1 endif\nX9\nM2\n"
    assert lcnc(source) == f"X{branch}\nX9\nM2\n"


def test_an_if_without_else_may_run_nothing() -> None:
    assert lcnc("o1 if [0]\nX1\no1 endif\nX2\nM2\n") == "X2\nM2\n"
    assert lcnc("o1 if [0]\nX1\no1 elseif [0]\nX3\no1 endif\nX2\nM2\n") == "X2\nM2\n"
    assert lcnc("o1 if [-0.5]\nX1\no1 endif\nX2\nM2\n") == "X1\nX2\nM2\n"


@pytest.mark.parametrize(
    ("loop", "runs"),
    [
        ("o1 repeat [3]\n{}\no1 endrepeat\n", 3),
        ("o1 repeat [1]\n{}\no1 endrepeat\n", 1),
        ("o1 repeat [0]\n{}\no1 endrepeat\n", 0),
        ("o1 repeat [-2]\n{}\no1 endrepeat\n", 0),
        ("o1 repeat [1.6]\n{}\no1 endrepeat\n", 2),
        ("o1 repeat [1.4]\n{}\no1 endrepeat\n", 1),
        ("o1 while [#1 LT 2]\n#1=[#1+1]\n{}\no1 endwhile\n", 2),
        ("o1 while [#1 LT 0]\n{}\no1 endwhile\n", 0),
        ("o1 do\n#1=[#1+1]\n{}\no1 while [#1 LT 2]\n", 2),
        ("o1 do\n{}\no1 while [0]\n", 1),
        ("o1 repeat [2]\no2 repeat [3]\n{}\no2 endrepeat\no1 endrepeat\n", 6),
        # a loop with the label of one that ended
        ("o1 repeat [2]\n{0}\no1 endrepeat\no1 repeat [1]\n{0}\no1 endrepeat\n", 3),
        ("o1 do\n{}\no1 while [0]\no1 while [#1 LT 2]\n#1=[#1+1]\n{}\no1 endwhile\n".replace("{}", "{0}"), 3),
        # BREAK
        ("o1 repeat [5]\n{}\no1 break\nX8\no1 endrepeat\n", 1),
        ("o1 while [1]\n{}\no1 break\nX8\no1 endwhile\n", 1),
        ("o1 do\n{}\no1 break\nX8\no1 while [1]\n", 1),
        ("o2 repeat [2]\no1 repeat [5]\n{}\no1 break\no1 endrepeat\no2 endrepeat\n", 2),
        ("o2 repeat [2]\no1 do\n{}\no1 break\no1 while [1]\no2 endrepeat\n", 2),
        ("o2 repeat [2]\no1 while [1]\n{}\no1 break\no1 endwhile\no2 endrepeat\n", 2),
        # after a BREAK the label is free for another kind of loop
        ("o1 do\no1 break\no1 while [1]\no1 while [#1 LT 2]\n#1=[#1+1]\n{}\no1 endwhile\n", 2),
        ("o1 repeat [4]\no1 break\no1 endrepeat\no1 while [#1 LT 2]\n#1=[#1+1]\n{}\no1 continue\n"
         "o1 endwhile\n", 2),
        # CONTINUE
        ("o1 repeat [3]\n{}\no1 continue\nX8\no1 endrepeat\n", 3),
        ("o1 while [#1 LT 2]\n#1=[#1+1]\n{}\no1 continue\nX8\no1 endwhile\n", 2),
    ],
)  # fmt: skip
def test_how_often_a_loop_runs(loop: str, runs: int) -> None:
    assert lcnc(loop.format("X1") + "X9\nM2\n") == "X1\n" * runs + "X9\nM2\n"


@pytest.mark.parametrize(
    ("source", "line", "message"),
    [
        ("o3 else", 1, "ELSE without an IF with label 3"),
        ("o3 elseif [1]", 1, "ELSEIF without an IF with label 3"),
        # an IF that ended
        ("o3 if [1]\no3 endif\no3 else", 3, "ELSE without an IF with label 3"),
        ("o3 endrepeat", 1, "ENDREPEAT with label 3 has no open loop"),
        ("o3 endwhile", 1, "ENDWHILE with label 3 has no open loop"),
        ("o3 break", 1, "BREAK with label 3 has no open loop"),
        ("o3 continue", 1, "CONTINUE with label 3 has no open loop"),
        ("o3 repeat [1]\no3 endrepeat\no3 endrepeat", 3, "ENDREPEAT with label 3 has no open loop"),
        ("o3 repeat [0]\no3 endwhile", 1, "no ENDREPEAT with label 3 follows"),
        ("o3 while [0]\no3 endif", 1, "no ENDWHILE with label 3 follows"),
        ("o3 if [0]\no4 endif", 1, "no ELSE OR ELSEIF OR ENDIF with label 3 follows"),
        ("o3 sub\no4 endsub", 1, "no ENDSUB with label 3 follows"),
        ("o3 endsub", 1, "ENDSUB with label 3 outside of its SUB"),
        ("o3 return", 1, "RETURN with label 3 outside of its SUB"),
        ("o3 call\nM2\no3 sub\no4 endsub", 4, "ENDSUB with label 4 outside of its SUB"),
    ],
)
def test_flow_without_its_other_half(source: str, line: int, message: str) -> None:
    assert refused(source + "\n") == ("OLP542", message, line)


def test_flow_is_searched_within_its_subprogram() -> None:
    # the ENDIF of the subprogram between is another one
    source = "o1 if [0]\nX1\no9 sub\no1 endif\nX5\no9 endsub\nX2\no1 endif\nX3\nM2\n"
    assert lcnc(source) == "X3\nM2\n"
    # the ENDIF behind the end of the subprogram is another one
    inside = "o9 sub\no1 if [0]\nX1\no9 endsub\no1 endif\no9 call\n"
    assert refused(inside) == ("OLP542", "no ELSE OR ELSEIF OR ENDIF with label 1 follows", 2)
    # so is one behind the head of another program
    assert refused("O1\no1 if [0]\nO2\no1 endif\n") == (
        "OLP542", "no ELSE OR ELSEIF OR ENDIF with label 1 follows", 2
    )  # fmt: skip


def test_a_continue_in_a_do_loop_is_refused() -> None:
    assert refused("o1 do\no1 continue\no1 while [0]\n") == (
        "OLP544", "CONTINUE within DO ... WHILE ends the loop in LinuxCNC 2.9; use IF", 2
    )  # fmt: skip


def test_comments_of_flow_are_kept_where_it_runs() -> None:
    source = "o1 sub (a)\nX1\no1 endsub (b)\no2 if [1] (c) ; d\no1 call\no2 endif\n"
    source += "o3 if [0] (e)\nX2 (f)\no3 endif\nM2\n"
    assert lcnc(source) == "(c) ; d\nX1\n(b)\n(e)\nM2\n"


# --- subprograms --------------------------------------------------------------------------------------------


def test_a_recursion_may_have_fifty_levels() -> None:
    sub = "o1 sub\no2 if [#1 GT 1]\no1 call [#1-1]\no2 else\nX#1\no2 endif\no1 endsub\n"
    assert lcnc(f"{sub}o1 call [49]\nM2\n") == "X1\nM2\n"
    assert refused(f"{sub}o1 call [50]\n") == (
        "OLP543", "subprograms call one another more than 50 levels deep", 3
    )  # fmt: skip


def test_arguments_count_from_1_and_the_others_are_0() -> None:
    assert lcnc("o1 sub\nX#1 Y#2 Z#3 A#30\no1 endsub\n#1=9\n#3=8\no1 call [5] [6]\nX#1\nM2\n") == (
        "X5 Y6 Z0 A0\nX9\nM2\n"
    )


def test_a_return_ends_its_subprogram_with_any_label() -> None:
    sub = "o1 sub\nX1\no{} return [7]\nX2\no1 endsub [8]\no1 call\nX#<_value> Y#<_value_returned>\nM2\n"
    assert lcnc(sub.format(1)) == lcnc(sub.format(5)) == "X1\nX7 Y1\nM2\n"
    assert lcnc(sub.format(1).replace("o1 return [7]\n", "")) == "X1\nX2\nX8 Y1\nM2\n"


def test_a_subprogram_is_searched_near_its_call_then_in_the_program_then_in_its_file() -> None:
    files = {"7": b"o7 sub\no8 call\no9 call\no7 endsub\no8 sub\nX8\no8 endsub\n", "6": b"X1\n"}
    asked = []

    def beside(name: str) -> tuple[str, bytes] | None:
        asked.append(name)
        return (f"{name}.ngc", files[name]) if name in files else None

    source = "o8 sub\nX88\no8 endsub\no9 sub\nX9\no9 endsub\no7 call\no8 call\no7 call\nM2\n"
    assert lcnc(source, subprograms=beside) == "X8\nX9\nX88\nX8\nX9\nM2\n"
    assert asked == ["7"]
    lost = refusal("o7 call\n", subprograms=beside)
    assert (lost.file, lost.line, lost.code, lost.message) == (
        "7.ngc", 3, "OLP542", f"subprogram 9 {MISSING} 9.ngc"
    )  # fmt: skip
    assert refused("o6 call\n", subprograms=beside) == (
        "OLP542", "the file of subprogram 6 does not define it", 1
    )  # fmt: skip
    assert refused("o5 call\n") == (
        "OLP542", f"subprogram 5 {MISSING} 5.ngc", 1
    )  # fmt: skip


@pytest.mark.parametrize("call", ["M98 P7 L2", "G65 P7 L2"])
def test_a_file_without_a_program_number_is_the_program_of_its_name(call: str) -> None:
    def beside(name: str) -> tuple[str, bytes]:
        return f"{name}.nc", files[name]

    files = {"7": b"(a (b))\n#9=3.\nIF[#9LT0]GOTO5\nX#9\nN5 M99\nX4.\n", "8": b"O7\nX1.\nM99\n"}
    assert fanuc(f"O1\n{call}\nM30\n", subprograms=beside) == "O1\n" + 2 * "(a (b))\nX3.\n" + "M30\n"
    # another number in the file is that of another program
    assert refused("O1\nM98 P8\nM30\n", "fanuc", subprograms=beside)[1].endswith("8 does not define it")


PRINTED = [
    ("DPRNT[DATE*(A):*#3011*#5041[33]]", "DPRNT[DATE*(A):*#3011*#5041[33]]"),
    ("/2 N7 popen ; log", "/2 N7 popen ; log"),
    ("BPRNT[#100[3]]", "BPRNT[#100[3]]"),
    # what the program sets is not in plain blocks
    ("N8 DPRNT[(X)#101[53]]", "(N8 DPRNT[[X]#101[53]] is left out)"),
    ("DPRNT[#9[53]]", "(DPRNT[#9[53]] is left out)"),
    ("DPRNT[#[99+1][53]]", "(DPRNT[#[99+1][53]] is left out)"),
]


@pytest.mark.parametrize(("line", "expected"), PRINTED)
def test_what_is_printed_moves_nothing(line: str, expected: str) -> None:
    source = "O1\n#101=5.\n{}\nX#101\nIF[#101GT9]GOTO7\nPCLOS\nM30\n"
    assert fanuc(source.format(line)) == f"O1\n{expected}\nX5.\nPCLOS\nM30\n"


def test_a_line_that_prints_may_be_jumped_to() -> None:
    assert fanuc("O1\n#1=2\nGOTO7\nX1.\nN7 DPRNT[A]\nX#1\nM30\n") == "O1\nN7 DPRNT[A]\nX2.\nM30\n"


def test_the_origin_of_blocks_counts_through_the_files() -> None:
    def beside(name: str) -> tuple[str, bytes]:
        return f"folder/{name}.ngc", b"\no<%s> sub\n\nX1\no<%s> endsub\n" % (name.encode(), name.encode())

    text = flatten(b"X0\no7 call\no<a> call\nX2\nM2\n", profile="linuxcnc", subprograms=beside)
    assert text == b"X0\n\nX1\n\nX1\nX2\nM2\n"
    origin = text.origin
    assert origin.files == ("folder/7.ngc", "folder/a.ngc")
    assert (origin.first.tolist(), origin.lines) == ([5, 10], 5)
    assert origin.line.tolist() == [1, 8, 9, 13, 14, 4, 5]
    assert origin.texts[:3] == (b"X0\n", b"o7 call\n", b"o<a> call\n")
    assert origin.texts[6] == b"o<7> sub\n"


def test_a_computed_label_is_a_whole_number() -> None:
    assert lcnc("o12 sub\nX1\no12 endsub\n#1=10\no[#1+2] call\nM2\n") == "X1\nM2\n"
    assert lcnc("o12 sub\nX#1\no12 endsub\n#1=12\no#1 call [4]\nM2\n") == "X4\nM2\n"
    assert refused("o[1.5] call\n") == ("OLP540", "the label of CALL is 1.5; expected an integer", 1)


# --- M98, M99, M97, G65 -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("call", "runs"),
    [("M98 P2", 1), ("M98 P2 L3", 3), ("M98 P00032", 0), ("M98 P10002", 1), ("M98 P30002", 3),
     ("M98 P120002", 12),
     ("M98 P[2]", 1), ("M98 P#1 L#2", 2), ("G65 P2", 1), ("G65 P2 L3", 3), ("G65 P2 L0", 1), ("G65 P#1", 1)],
)  # fmt: skip
def test_how_often_a_subprogram_runs(call: str, runs: int) -> None:
    other = "O32\nM99\n" if runs == 0 else ""
    source = f"O1\n#1=2\n#2=2\n{call}\nX9.\nM30\nO2\nX1.\nM99\n{other}"
    assert fanuc(source) == "O1\n" + "X1.\n" * runs + "X9.\nM30\n"


def test_the_count_stands_in_p_only_without_l_and_only_on_some_controls() -> None:
    assert fanuc("O1\nM98 P20003 L1\nM30\nO20003\nX1.\nM99\n") == "O1\nX1.\nM30\n"
    assert lcnc("O1\nM98 P20003\nM2\nO20003\nX1\nM99\n") == "O1\nX1\nM2\n"
    assert fanuc("O1\nM98 P9999\nM30\nO9999\nX1.\nM99\n") == "O1\nX1.\nM30\n"
    # the block that M97 calls may have any number
    local = b"O1\nM97 P20003\nM30\nN20003 X1.\nM99\n"
    assert flatten(local, profile="haas") == b"O1\nN20003 X1.\nM30\n"


@pytest.mark.parametrize(
    ("call", "body"),
    [
        ("M98 P20 Q5", "N5 X3.\n"), ("M98 P20 Q5 L2", "N5 X3.\nX3.\n"), ("M98 P20 Q4", "N4 X2.\nN5 X3.\n"),
        # of this program itself
        ("M98 Q5", "N5 X7.\n"), ("M98 Q[#1] L2", "N5 X7.\nX7.\n"),
    ],
)  # fmt: skip
def test_a_subprogram_begins_at_the_block_that_q_names(call: str, body: str) -> None:
    text = f"O1\n#1=5\n{call}\nM30\nN5 X7.\nM99\nO20\nX1.\nN4 X2.\nN5 X3.\nM99\n"
    for profile in ("fanuc", "mazak"):
        assert flatten(text.encode(), profile=profile).decode() == f"O1\n{body}M30\n"
    for profile in ("haas", "siemens-iso", "mach4"):
        code, message, line = refused(text, profile)
        assert (code, line) == ("OLP516", 3)
        assert message == "what this control makes of Q in a subprogram call is not known; take Q out"
    # nor in another call of the same program
    assert refused("O1\nM97 P5 Q2\nM30\nN5 X7.\nM99\n", "fanuc")[0] == "OLP516"
    assert refused(text.replace("Q5", "Q8").replace("Q[", "Q[3+").replace("Q4", "Q8"), "fanuc")[0] == "OLP542"


@pytest.mark.parametrize(
    ("block", "code", "message"),
    [
        ("M98", "OLP516", "a subprogram call has no P word"),
        ("M98 L2", "OLP516", "a subprogram call has no P word"),
        ("M98 P2 L0", "OLP516", "a subprogram is called 0 times; expected one or more"),
        ("M98 P2 L-1", "OLP516", "a subprogram is called -1 times; expected one or more"),
        ("M98 P2.5", "OLP540", "the program number P is 2.5; expected an integer"),
        ("M98 P2 L1.5", "OLP540", "the repeat count L is 1.5; expected an integer"),
        ("M98 P3", "OLP542", f"subprogram 3 {MISSING} O0003.nc"),
        ("M97 P8", "OLP542", "GOTO 8: the program has no block N8"),
        ("G65", "OLP516", "G65 has no P word"),
        ("G65 P2.5", "OLP540", "the program number P is 2.5; expected an integer"),
        ("G65 P2 L1.5", "OLP540", "the repeat count L is 1.5; expected an integer"),
        ("G66", "OLP516", "G66 has no P word"),
        *(
            (
                block,
                "OLP518",
                f"{name} is not the first word and only code of its block, and what the control "
                "makes of the others is not known; give them a block of their own",
            )
            for name, block in (("G65", "G90 G65 P2"), ("G65", "X5. G65 P2"), ("G66", "N7 G66 P2 G91"))
        ),
        (
            "G66.1 P2",
            "OLP544",
            "G66.1 calls a macro with the words of every block, which is not unrolled; call it with G65",
        ),
    ],
)
def test_calls_that_are_refused(block: str, code: str, message: str) -> None:
    assert refused(f"O1\n{block}\nM30\nO2\nM99\n", "fanuc") == (code, message, 2)


def test_the_other_words_of_a_call_and_of_a_return_are_kept() -> None:
    source = "O1\nN5 G0 X1. M98 P2 L2 F3.\nM30\nO2\nX2. M99\n"
    assert fanuc(source) == "O1\nN5 G0 X1. F3.\nX2.\nX2.\nM30\n"
    assert fanuc("O1\nX1. M99\nX2.\n") == "O1\nX1. M99\n"
    assert fanuc("O1\nN7 G65 P2 A1. (c)\nM30\nO2\nX#1\nM99\n") == "O1\n(c)\nX1.\nM30\n"


def test_m98_shares_the_variables_of_its_caller_where_the_control_does() -> None:
    source = "O1\n#1=4\n#<a>=1\nM98 P2\nX#1\nM30\nO2\nX#1\n#1=5\nM99\n"
    assert fanuc(source.replace("#<a>=1\n", "")) == "O1\nX4.\nX5.\nM30\n"
    assert lcnc(source) == "O1\nX0\nX4\nM30\n"
    assert refused(source.replace("X#1\n#1=5", "X#<a>"))[0] == "OLP541"


def test_m99_returns_to_a_block_of_the_caller() -> None:
    # behind the call first, then from the start of the program
    source = "O1\nN5 X1.\n#1=#1+1\nIF[#1GT2]GOTO9\nM98 P2\nX8.\nN{} X2.\nN9 M30\nO2\nM99 P5\n"
    assert fanuc(source.format(5)) == "O1\nN5 X1.\nN5 X2.\nN9 M30\n"
    assert fanuc(source.format(6)) == "O1\nN5 X1.\nX1.\nX1.\nN9 M30\n"
    assert refused("O1\nM98 P2\nM30\nO2\nM99 P1.5\n", "fanuc") == (
        "OLP540", "the block number P is 1.5; expected an integer", 5
    )  # fmt: skip
    # P counts at the last return only
    assert fanuc("O1\nM98 P2 L3\nX8.\nN5 M30\nO2\nX1.\nM99 P5\n") == "O1\nX1.\nX1.\nX1.\nN5 M30\n"


def test_a_macro_may_be_called_more_than_once_with_its_own_variables() -> None:
    source = "O1\nG65 P2 A1. L2\nM30\nO2\nX#1\n#1=#1+1\nM99\n"
    assert flatten(source.encode(), profile="haas") == b"O1\nX1.\nX2.\nM30\n"
    # whether other controls set the argument again is not stated
    assert refused(source, "fanuc")[:2] == (
        "OLP541", "#1 was changed by the last call of this macro, and whether the next call has its argument "
        "again is not known; assign it in the macro first",
    )  # fmt: skip
    modal = source.replace("G65", "G66").replace("M30", "Y1.\nG67\nM30")
    assert refused(modal, "fanuc")[0] == "OLP541"
    assert flatten(modal.encode(), profile="haas") == b"O1\nY1.\nX1.\nX2.\nM30\n"
    assert fanuc(source.replace("#1=#1+1", "#2=9.")) == "O1\nX1.\nX1.\nM30\n"
    assert fanuc("O1\nG65 P2 A1. L2\nM30\nO2\n#2=#1\nX#2\n#2=5\nM99\n") == "O1\nX1.\nX1.\nM30\n"


@pytest.mark.parametrize(
    ("source", "code", "message", "line"),
    [
        ("o1 sub\nM72\no1 endsub\nM70\no1 call", "OLP532", "M72 without saved modes", 2),
        ("M73", "OLP544", "M73 restores modes at the end of a subprogram, and this is none", 1),
        ("M70 G91", "OLP518", "M70 to M73 beside other words", 1),
        ("M70\nG43 H1\nM72", "OLP544", "the tool length is to be restored", 3),
        ("M70\nM3 S100\nM72", "OLP544", "the spindle is to be restored", 3),
        ("M70\nG21\nM72", "OLP544", "the unit or the return of cycles is to be restored", 3),
        ("M72", "OLP532", "M72 without saved modes; M70 must come before", 1),
        ("M70\nM71\nM72", "OLP532", "M72 without saved modes; M70 must come before", 3),
        *((f"G{code} Q1", "OLP544", "G70 to G72 are cycles of a lathe", 1)
          for code in ("70", "71", "71.1", "71.2", "72", "72.1", "72.2")),
    ],
)  # fmt: skip
def test_codes_of_a_level_and_of_a_profile_are_refused(
    source: str, code: str, message: str, line: int
) -> None:
    error = refused(source + "\n")
    assert (error[0], error[2]) == (code, line)
    assert error[1].startswith(message)


def test_what_m72_restores_is_written() -> None:
    source = "G21 G64 P0.05\nG54\nM5\n(a) M70\nG61 G55\nM3 S9\nM72 (b)\nG0 X1\nM2\n"
    assert lcnc(source).splitlines()[3:] == [
        "(a)", "G61 G55", "M3 S9", "(b)", "G64 P0.05", "G54", "M5", "G0 X1", "M2"
    ]  # fmt: skip
    # nothing has changed
    assert lcnc("G21\no1 sub\nM73\nG0 X1\no1 endsub\no1 call\nM2\n").splitlines() == ["G21", "G0 X1", "M2"]
    # M73 alone restores at the end of a level
    text = "G21 G90\no1 sub\n{}\nG91\no1 endsub\no1 call\nG0 X1\nM2\n"
    assert lcnc(text.format("M70")).splitlines() == ["G21 G90", "G91", "G0 X1", "M2"]
    assert lcnc(text.format("M73")).splitlines() == ["G21 G90", "G91", "G90", "G0 X1", "M2"]


def test_they_are_plain_codes_on_other_controls() -> None:
    for block in ("M70", "M72", "M73", "G70 Q1", "G71 Q1", "G72 Q1"):
        assert fanuc(f"O1\n{block}\nM30\n") == f"O1\n{block}\nM30\n"
    assert lcnc("M71\nM2\n") == "M2\n"
    # on Mach3 they are units, and M70 is a macro of the builder
    source = b"G71 G91.1\n#1=5\nG0 X[#1*2]\nM70\nG70\nX#1\nM30\n"
    assert flatten(source, profile="mach3") == b"G71 G91.1\nG0 X10\nM70\nG70\nX5\nM30\n"


# --- Macro B ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("IF[1EQ1]GOTO5\nX1.\nN5 X2.\n", "N5 X2.\n"),
        ("IF[1EQ2]GOTO5\nX1.\nN5 X2.\n", "X1.\nN5 X2.\n"),
        ("IF[1EQ1]THEN#1=2#2=3\nX#1 Y#2\n", "X2. Y3.\n"),
        ("IF[1EQ2]THEN#1=2 (no)\nX#1 Y2.\n", "Y2.\n"),
        ("IF[1EQ1]THEN#1=2 (yes)\nX#1\n", "(yes)\nX2.\n"),
        ("WHILE[1EQ2]DO1\nX1.\nEND1\nX2.\n", "X2.\n"),
        ("#1=0\nWH[#1LT2]DO1\n#1=#1+1\nX[#1*CO[0]]\nEND1\n", "X1.\nX2.\n"),
        ("#1=0\nWHILE[#1LT2]DO01\n#1=#1+1\nX#1\nEND1\nX9.\n", "X1.\nX2.\nX9.\n"),
        ("#1=0\nDO2\n#1=#1+1\nX#1\nIF[#1GE2]GOTO7\nEND2\nN7 X9.\n", "X1.\nX2.\nN7 X9.\n"),
        ("#1=6\nGOTO[#1+1]\nX1.\nN7 X2.\n", "N7 X2.\n"),
        ("GOTO7.00005\nX1.\nN7 X2.\n", "N7 X2.\n"),
        ("#1=#1+1\nX#1\nN5 IF[#1EQ1]GOTO6\nX5.\nN6 X6.\n", "X1.\nN6 X6.\n"),
    ],
)
def test_flow_of_macro_b(source: str, expected: str) -> None:
    assert fanuc(f"O1\n{source}M30\n") == f"O1\n{expected}M30\n"


@pytest.mark.parametrize(
    ("source", "code", "message"),
    [
        ("IF[1EQ1]X5", "OLP510", "IF is followed by neither GOTO nor THEN"),
        ("WHILE[1EQ1]X5", "OLP542", "WHILE is not followed by DO"),
        ("DO#1", "OLP542", "DO and END take a plain number"),
        ("END1", "OLP542", "END with label 1 has no open loop"),
        ("WHILE[0]DO1", "OLP542", "no END with label 1 follows"),
        ("GOTO5", "OLP542", "GOTO 5: the program has no block N5"),
        ("GOTO5.5", "OLP540", "the block number of GOTO is 5.5; expected an integer"),
        (
            "WHILE[1EQ1]DO1X1",
            "OLP510",
            "DO is followed by 'x1', which is not understood; put it into a block of its own",
        ),
        (
            "GOTO#1X1",
            "OLP510",
            "GOTO is followed by 'x1', which is not understood; put it into a block of its own",
        ),
        (
            "IF[1EQ1]THEN#1=2X1",
            "OLP510",
            "THEN is followed by 'x1', which is not understood; put it into a block of its own",
        ),
    ],
)
def test_flow_of_macro_b_that_is_refused(source: str, code: str, message: str) -> None:
    assert refused(f"O1\n{source}\n", "fanuc") == (code, message, 2)


def test_a_goto_stays_in_its_program() -> None:
    source = "O1\nM98 P2\nGOTO5\nX1.\nN5 M30\nO2\nGOTO5\nX2.\nN5 X3.\nM99\nO3\nN5 X4.\n"
    assert fanuc(source) == "O1\nN5 X3.\nN5 M30\n"
    assert refused("O1\nGOTO5\nO2\nN5 X1.\n", "fanuc")[:2] == (
        "OLP542",
        "GOTO 5: the program has no block N5",
    )
    assert refused("O1\nN5 X1.\nM98 P2\nO2\nGOTO5\n", "fanuc")[0] == "OLP542"


def test_a_program_number_must_follow_an_end() -> None:
    assert fanuc("O1\nX1.\nO2\nX2.\nM30\n") == "O1\nX1.\n"
    assert fanuc("O1\nO2\nX2.\nM30\n") == "O1\n"
    assert fanuc("N5\nO1\nX1.\nM30\n") == "N5\nO1\nX1.\nM30\n"
    assert fanuc("X1.\nO1\nX2.\nM30\n") == "X1.\n"
    assert refused("O1\nM98 P2\nM30\nO2\nX1.\nO3\nM99\n", "fanuc") == (
        "OLP542", "subprogram 2 runs into the next program; M99 is missing", 6
    )  # fmt: skip
    assert refused("O1\nM98 P2\nM30\nO2\nX1.\n", "fanuc") == (
        "OLP542", "subprogram 2 has no end (ENDSUB or M99)", 5
    )  # fmt: skip


# --- the tape, and block delete -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("%\nX1\nM2\nX2\n %\nX3\n", "%\nX1\nM2\n %\n"),
        ("X1\nM2\n%\n", "X1\nM2\n"),
        ("%\nX1\n%\nX2\n%\n", "%\nX1\n%\n"),
        ("%\nX1\nM2\n", "%\nX1\nM2\n"),
        ("%\nX1\nM2\n%\n%\n", "%\nX1\nM2\n%\n"),
        ("X1\nM30\nX2\n", "X1\nM30\n"),
    ],
)
def test_what_ends_the_tape(source: str, expected: str) -> None:
    assert lcnc(source) == expected


def test_percent_signs_of_the_file_of_a_subprogram_are_left_out() -> None:
    def beside(name: str) -> tuple[str, bytes]:
        return f"{name}.ngc", b"%\no7 sub\n%\nX1\n%\no7 endsub\n%\n"

    assert lcnc("%\no7 call\nX2\nM2\n%\n", subprograms=beside) == "%\nX1\nX2\nM2\n%\n"


@pytest.mark.parametrize(
    "block", ["#1=2", "o1 if [1]", "M97 P1", "M98 P1", "M99", "G65 P1", "IF[1EQ1]GOTO5", "M30 M99"]
)
def test_a_block_of_flow_under_block_delete_needs_the_switch(block: str) -> None:
    profile = "linuxcnc" if block.startswith("o") else "fanuc"
    code, message, line = refused(f"O1\nX1.\n/{block}\n", profile, block_delete=None)
    assert (code, line) == ("OLP525", 3)
    assert message.startswith("this block under block delete changes a parameter or the flow")
    assert message.endswith("state block_delete in the job file, or remove the `/`")
    assert fanuc(f"O1\nX1.\n/{block}\nM30\n", block_delete=True) == "O1\nX1.\nM30\n"


def test_other_blocks_under_block_delete_keep_their_mark() -> None:
    source = "O1\n/X1. M[90+8-90]\n/2 Y1.\nM30\n"
    assert fanuc(source, block_delete=None) == "O1\n/X1. M8\n/2 Y1.\nM30\n"
    assert fanuc(source, block_delete=False) == "O1\n/X1. M8\n/2 Y1.\nM30\n"
    assert fanuc(source, block_delete=True) == "O1\nM30\n"


def test_the_work_is_bounded_by_the_bytes_of_blocks() -> None:
    text = "o1 repeat [99]\nX1\no1 endrepeat\nM2\n"
    # each visit counts 32 and the bytes of its line
    work = (32 + 15) + 99 * ((32 + 3) + (32 + 13)) + (32 + 3)
    assert lcnc(text, limit=work) == "X1\n" * 99 + "M2\n"
    ending = "bytes of blocks; correct an endless loop, or divide the program"
    assert refused(text, limit=work - 1) == ("OLP543", f"the run visits more than {work - 1} {ending}", 4)
    # a long program may do more: 80 for each of its bytes
    endless = "o1 while [1]\no1 endwhile\n"
    assert refused(endless, limit=1)[1] == f"the run visits more than {80 * len(endless)} {ending}"


@pytest.mark.parametrize(("profile", "x", "y"), [("linuxcnc", "#5420", "#5421"), ("fanuc", "#5001", "#5002")])
def test_a_position_behind_a_block_under_the_switch_is_not_known(profile: str, x: str, y: str) -> None:
    """The axis is where the block ends, or where it was: until a block without `/` states it."""
    moved = "G21 G90\nG0 X0. Y0. Z0.\n/G0 X5. Y0.\n"
    code, why, line = refused(f"{moved}G1 X[{x}+1.] F9\nM2\n", profile, block_delete=None)
    assert (code, line) == ("OLP524", 4)
    assert "position of X is needed" in why
    for text in (f"{moved}G1 Y[{y}+1.] F9\nM2\n", f"{moved}X7.\nG1 Y[{x}-6.] F9\nM2\n"):
        assert b"G1 Y1. F9" in flatten(text.encode(), profile=profile, block_delete=None).replace(
            b"Y1 ", b"Y1. "
        )
    run = flatten(f"{moved}G1 X[{x}+1.] F9\nM2\n".encode(), profile=profile, block_delete=False)
    assert b"G1 X6" in run
