"""Parameters while a program is unrolled: which are local, which are common, which only the control knows."""

from __future__ import annotations

import pytest
from cases.unrolling import fanuc, flatten, lcnc, refused

from olp.core.errors import ProgramError
from olp.core.machine import Axis, Machine
from olp.program.registry import named

_BY_CONTROL = "and no plain block has the effect of setting it"
_WAY_ON = 'give it in the job file: [parameters] "{}" = ...'
_KEPT = "is kept by the control (probe result, offset, tool or position) and not known off line"
_NOT_SET = "is not set before in the program and not known off line; assign it there, or"


def test_parameters_up_to_30_are_local_to_a_subprogram() -> None:
    source = "#{0}=7\no1 sub\nX#{0}\n#{0}=8\no1 endsub\no1 call\nX#{0}\nM2\n"
    local = {index: lcnc(source.format(index)) for index in (1, 29, 30, 31, 32, 5060)}
    assert local == {
        **dict.fromkeys((1, 29, 30), "X0\nX7\nM2\n"),
        **dict.fromkeys((31, 32, 5060), "X7\nX8\nM2\n"),
    }


@pytest.mark.parametrize(
    ("source", "code", "message"),
    [
        ("X#0", "OLP540", "#0 is out of range; parameters are #1 to #5602"),
        ("X#5603", "OLP540", "#5603 is out of range; parameters are #1 to #5602"),
        *((f"X#{n}", "OLP541", f"#{n} {_KEPT}; {_WAY_ON.format(f'#{n}')}")
          for n in (5061, 5419, 5423, 5599, 5602)),
        *((f"#{n}=1", "OLP544", f"#{n} belongs to the control, {_BY_CONTROL}") for n in (0, 5061, 5420,
          5600)),
        ("#<_x>=1", "OLP544", "#<_x> belongs to the control and cannot be set"),
        ("X#<a>", "OLP541", f"#<a> {_NOT_SET} {_WAY_ON.format('#<a>')}"),
        ("#<a>=1\nX#<_a>", "OLP541", f"#<_a> {_NOT_SET} {_WAY_ON.format('#<_a>')}"),
        ("X[EXISTS[#<_ini[AXIS]NAME>]]", "OLP541",
         "#<_ini[axis]name> belongs to the control and is not known off line"),
        ("X[EXISTS[#<_hal[pin]>]]", "OLP541",
         "#<_hal[pin]> belongs to the control and is not known off line"),
        ("X#<_metric>", "OLP541", "#<_metric> is used before the program sets it"),
        ("X#<_imperial>", "OLP541", "#<_imperial> is used before the program sets it"),
        ("S5\nX#<_feed>", "OLP541", "#<_feed> is used before the program sets it"),
        ("F5\nX#<_rpm>", "OLP541", "#<_rpm> is used before the program sets it"),
    ],
)  # fmt: skip
def test_parameters_that_are_not_known(source: str, code: str, message: str) -> None:
    assert refused(source + "\n") == (code, message, source.count("\n") + 1)


def test_positions_by_number_and_by_name() -> None:
    start = "G21 G90 G0 X1 Y2 Z3\n"
    assert lcnc(f"{start}X#5420 Y#5421 Z#5422\nM2\n") == f"{start}X1 Y2 Z3\nM2\n"
    assert lcnc(f"{start}A#<_x> B#<_y> C#<_z>\nM2\n") == f"{start}A1 B2 C3\nM2\n"


@pytest.mark.parametrize(
    ("before", "name", "value"),
    [
        ("G21", "_metric", 1), ("G20", "_metric", 0), ("G21", "_imperial", 0), ("G20", "_imperial", 1),
        ("G90", "_absolute", 1), ("G91", "_absolute", 0), ("G90", "_incremental", 0),
        ("G91", "_incremental", 1), ("", "_absolute", 1), ("", "_plane", 170), ("G18", "_plane", 180),
        ("F250", "_feed", 250), ("S900", "_rpm", 900), ("F1 S2", "_feed", 1), ("F1 S2", "_rpm", 2),
        ("", "_value", 0), ("", "_value_returned", 0), ("G1", "_motion_mode", 10),
        ("G94", "_units_per_minute", 1), ("G95", "_units_per_minute", 0), ("G93", "_inverse_time", 1),
        ("G95", "_units_per_rev", 1), ("M3", "_spindle_on", 1), ("M4", "_spindle_cw", 0),
        ("M5", "_spindle_on", 0),
    ],
)  # fmt: skip
def test_predefined_names(before: str, name: str, value: int) -> None:
    assert lcnc(f"{before}\nA#<{name}>\nA[EXISTS[#<{name}>]]\nM2\n") == f"{before}\nA{value}\nA1\nM2\n"


def test_names_with_an_underscore_are_global() -> None:
    source = "#<a>=1 #<_b>=2\nX[EXISTS[#<a>]] Y[EXISTS[#<_b>]] Z[EXISTS[#<_a>]] A[EXISTS[#<b>]]\n"
    within = "X[EXISTS[#<a>]] Y#<_b>\n"
    assert lcnc(f"{source}o1 sub\n{within}#<a>=5\no1 endsub\no1 call\nX#<a>\nM2\n") == (
        "X1 Y1 Z0 A0\nX0 Y2\nX1\nM2\n"
    )


def test_parameters_that_were_never_set_are_0() -> None:
    assert lcnc("X#1 Y#30 Z#31 A#5060\nM2\n") == "X0 Y0 Z0 A0\nM2\n"


def test_the_switch_of_debug_comments_may_be_set() -> None:
    assert lcnc("#5599=0\nX1\nM2\n") == "X1\nM2\n"


def test_a_returned_value_is_0_again_after_a_call_without_one() -> None:
    source = "o1 sub\no1 endsub [3]\no2 sub\no2 endsub\n"
    value = "X#<_value> Y#<_value_returned>\n"
    assert lcnc(f"{source}o1 call\n{value}o2 call\n{value}M2\n") == "X3 Y1\nX0 Y0\nM2\n"


def test_values_that_the_job_gives_hold_until_the_program_sets_them() -> None:
    given = {"#5063": -1.5, "#3": 4.0, "#31": 5.0, "#<depth>": 6.0, "#<_hal[a.b-c]>": 7.0}
    source = "X#5063 Y#3 Z#31 A#<depth> B#<_hal[a.b-c]>\n"
    inside = "o1 sub\nX#3 Y#31 Z[EXISTS[#<depth>]]\no1 endsub\n"
    assert lcnc(f"{inside}{source}#3=1 #31=2 #<depth>=3\n{source}o1 call\nM2\n", parameters=given) == (
        "X-1.5 Y4 Z5 A6 B7\nX-1.5 Y1 Z2 A3 B7\nX0 Y2 Z0\nM2\n"
    )
    assert fanuc("O1\nG1 X#5 Y#500 Z#2001\nM30\n", parameters={"#5": 1, "#500": 2, "#02001": 3}) == (
        "O1\nG1 X1. Y2. Z3.\nM30\n"
    )


# --- Macro B ----------------------------------------------------------------------------------------------


def test_variables_of_macro_b_are_local_up_to_33() -> None:
    # a block of nothing but a vacant word is no block
    for index in (1, 33):
        assert fanuc(f"O1\n#{index}=7\nG65 P2\nX#{index}\nM30\nO2\nX#{index}\nM99\n") == "O1\nX7.\nM30\n"
    for index in (100, 999):
        assert fanuc(f"O1\n#{index}=7\nG65 P2\nM30\nO2\nX#{index}\nM99\n") == "O1\nX7.\nM30\n"


@pytest.mark.parametrize(
    ("block", "code", "message"),
    [
        *((f"X#{n}", "OLP541", f"#{n} {_NOT_SET} {_WAY_ON.format(f'#{n}')}")
          for n in (34, 99, 100, 5000, 5004, 5040, 5044)),
        *((f"#{n}=1", "OLP544", f"#{n} belongs to the control, {_BY_CONTROL}")
          for n in (0, 34, 99, 1000, 2999, 3001, 3002, 3005)),
        ("#3000=1", "OLP544", "the program stops here with its own alarm (#3000)"),
    ],
)  # fmt: skip
def test_variables_of_macro_b_that_are_not_known(block: str, code: str, message: str) -> None:
    assert refused(f"O1\n{block}\n", "fanuc") == (code, message, 2)


@pytest.mark.parametrize(("one", "other"), [(100, 10100), (199, 10199), (650, 10650), (999, 10999)])
def test_common_variables_of_haas_have_a_second_number(one: int, other: int) -> None:
    for first, second in ((one, other), (other, one), (other, other)):
        text = flatten(f"O1\n#{first}=7.\nX#{second}\nM30\n".encode(), profile="haas")
        assert text == b"O1\nX7.\nM30\n"
        text = flatten(f"O1\nX#{second}\nM30\n".encode(), profile="haas", parameters={f"#{first}": 8.0})
        assert text == b"O1\nX8.\nM30\n"
    assert refused(f"O1\n#{other}=7.\n", "fanuc")[:2] == (
        "OLP544", f"#{other} belongs to the control, {_BY_CONTROL}",
    )  # fmt: skip


def test_further_common_variables_of_haas() -> None:
    for index in (10000, 10299, 10750):
        text = f"O1\n#{index}=7.\nX#{index}\nM30\n"
        assert flatten(text.encode(), profile="haas") == b"O1\nX7.\nM30\n"
    # that of three digits is another, which the control uses itself
    assert refused("O1\n#10750=7.\nX#750\n", "haas")[0] == "OLP541"
    assert refused("O1\n#11000=7.\n", "haas")[0] == "OLP544"


COUNTERS = [
    "#500=#500+1", "N7 # 501 = [#500 + #3001] / 2. (TIME) ; a", "#502=FIX[#501]MOD 3", "#503=#501 OR 4",
]  # fmt: skip


@pytest.mark.parametrize("block", COUNTERS)
def test_a_block_that_counts_for_the_control_alone_is_kept(block: str) -> None:
    source = f"O1\n#1=2.\nX#1\n{block}\nX5.\nM30\n"
    assert fanuc(source) == f"O1\nX2.\n{block}\nX5.\nM30\n"
    counted = block.split("=")[0].split("#")[1].strip()
    code, message, line = refused(source.replace("X5.", f"X#{counted}"), "fanuc")
    assert (code, line) == ("OLP541", 5)
    assert "is not set before in the program" in message
    # the program gives it a value again
    again = source.replace("X5.", f"#{counted}=5.\nX#{counted}")
    assert fanuc(again) == f"O1\nX2.\n{block}\nX5.\nM30\n"


def test_a_counter_that_the_program_or_the_job_knows_is_counted() -> None:
    assert fanuc("O1\n#500=3\n#500=#500+1\nX#500\nM30\n") == "O1\nX4.\nM30\n"
    count = "O1\n#500=#500+1\nX#500\nM30\n"
    assert fanuc(count, parameters={"#500": 6}) == "O1\nX7.\nM30\n"
    # what is counted from what is not known is not what the job says of it
    assert refused("O1\n#500=#500+#501\nX#500\nM30\n", "fanuc", parameters={"#500": 6}) == (
        "OLP541", f"#501 {_NOT_SET} {_WAY_ON.format('#501')}", 3,
    )  # fmt: skip
    assert flatten(b"O1\n#10002= #3020 - #10000\nM30\n", profile="haas") == (
        b"O1\n#10002= #3020 - #10000\nM30\n"
    )


@pytest.mark.parametrize(
    "block", ["#1=#500", "#500=#1+#501", "#5221=#500", "#3000=#500", "#500=#501 X5.", "/#500=#500+1"]
)
def test_other_blocks_with_values_of_the_control_are_refused(block: str) -> None:
    assert refused(f"O1\n#1=2.\n{block}\nX5.\nM30\n", "fanuc")[2] == 3


def test_variables_of_macro_b_that_change_no_path() -> None:
    assert fanuc("O1\n#3003=1\n#3004=7\nX1.\nM30\n") == "O1\nX1.\nM30\n"


@pytest.mark.parametrize("base", [5001, 5041])
def test_positions_of_macro_b(base: int) -> None:
    start = "O1\nG21 G90 G0 X1. Y2. Z3.\n"
    words = f"A#{base} B#{base + 1} C#{base + 2}\n"
    assert fanuc(f"{start}{words}M30\n") == f"{start}A1. B2. C3.\nM30\n"


@pytest.mark.parametrize(
    ("before", "index", "value"),
    [
        ("G0 X1.\nX2.", 4001, 0), ("G3 X1. Y0 R1.", 4001, 3), ("G19", 4002, 19), ("G90\nG91", 4003, 91),
        ("G93 G1 X1. F2.", 4005, 93), ("G20", 4006, 20), ("G41 D4", 4007, 41), ("G43 H3", 4008, 43),
        ("G43 H3\nG49", 4008, 49), ("G1 X0", 4009, 80), ("G99 G83 Z-1. R1. Q1. F9.\nX5.", 4009, 83),
        ("G81 Z-1. R1. F9.\nG80", 4009, 80), ("G99 G81 Z-1. R1. F9.", 4010, 99), ("G41 D4", 4107, 4),
        ("G21 F250.", 4109, 250), ("G43 H3", 4111, 3), ("S900 M3", 4119, 900), ("T7", 4120, 7),
        # those of the block itself count from the next one on
        ("G91", 4003, 91),
    ],
)  # fmt: skip
def test_modal_variables_are_what_the_program_has_stated(before: str, index: int, value: float) -> None:
    text = fanuc(f"O1\n{before}\nG65 P2\nM30\nO2\n#1=#{index}\nG90\nG4 P#1\nM99\n")
    assert text == f"O1\n{before}\nG90\nG4 P{value}\nM30\n"


def test_a_macro_restores_the_modes_of_its_caller() -> None:
    macro = "O2\n#30=#4003\nG91\nX1.\nG#30\nM99\n"
    for code in ("G90", "G91"):
        assert fanuc(f"O1\n{code}\nG65 P2\nM30\n{macro}") == f"O1\n{code}\nG91\nX1.\n{code}\nM30\n"


@pytest.mark.parametrize(
    ("before", "index", "what"),
    [
        ("X1.", 4001, "the G code of group 1"), ("G0 X1.", 4003, "the G code of group 3"),
        ("/G91", 4003, "the G code of group 3"), ("G90\n/G91", 4003, "the G code of group 3"),
        # what is the motion behind cycles, and the feed behind a change of its unit, differs
        ("G0 X1.\nG81 Z-1. R1. F9.", 4001, "the G code of group 1"),
        ("G0 X1.\nG81 Z-1. R1. F9.\nG80", 4001, "the G code of group 1"),
        ("G21 F9.\nG20", 4109, "the F word"), ("G94 F9.\nG95", 4109, "the F word"),
        ("/G1 X1.", 4009, "the G code of group 9"), ("/S9", 4119, "the S word"),
    ],
)  # fmt: skip
def test_modal_variables_that_the_program_has_not_stated(before: str, index: int, what: str) -> None:
    line = 2 + len(before.splitlines())
    message = f"#{index} is {what} in force, which the program has not stated before; state it there, or "
    assert refused(f"O1\n{before}\n#1=#{index}\n", "fanuc") == (
        "OLP541", message + _WAY_ON.format(f"#{index}"), line
    )  # fmt: skip
    assert fanuc(f"O1\n{before}\nG4 P#{index}\nM30\n", parameters={f"#{index}": 9}).endswith("P9\nM30\n")


def test_other_modal_variables_are_not_known() -> None:
    # further groups differ from control to control, and Mach4 has a list of its own
    assert refused("O1\nG54\n#1=#4014\n", "fanuc")[1].startswith("#4014 is not set before")
    assert refused("O1\nG90\n#1=#4003\n", "mach4")[1].startswith("#4003 is not set before")


def test_the_present_position_under_a_tool_length_is_a_setting() -> None:
    start = "O1\nG90 G0 X1. Z3.\nG43 H1 Z5.\n"
    assert refused(f"{start}#1=#5043\n", "fanuc")[1].startswith("whether #5043 counts the tool length")
    assert fanuc(f"{start}X#5041 Z#5003\nG49 Z1.\nZ#5043\nM30\n").endswith("X1. Z5.\nG49 Z1.\nZ1.\nM30\n")


def test_a_vacant_variable_stays_vacant_when_it_is_copied() -> None:
    # a word with it is left out; in arithmetic it is 0
    assert fanuc("O1\n#100=#5\nG1 X#100 Y#0 Z1.\nX[#100+1]\n#100=[#100+0]\nX#100\nM30\n") == (
        "O1\nG1 Z1.\nX1.\nX0.\nM30\n"
    )


def test_each_argument_of_a_macro_has_its_variable() -> None:
    letters = "ABCDEFHIJKMQRSTUVWXYZ"
    numbers = (1, 2, 3, 7, 8, 9, 11, 4, 5, 6, 13, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26)
    call = "".join(f"{letter}{n}." for n, letter in enumerate(letters, 50))
    read = "".join(f"G1 X#{number}\n" for number in numbers)
    expected = "".join(f"G1 X{n}.\n" for n in range(50, 50 + len(letters)))
    assert fanuc(f"O1\nG65 P2 {call}\nM30\nO2\n{read}M99\n") == f"O1\n{expected}M30\n"


@pytest.mark.parametrize(
    ("call", "values"),
    [
        # sets of I, J, K: a letter that does not come behind the last one begins the next set
        ("I1. J2. K3.", {4: 1, 5: 2, 6: 3}),
        ("I1. J2. K3. I4. J5. K6. I7.", {4: 1, 5: 2, 6: 3, 7: 4, 8: 5, 9: 6, 10: 7}),
        ("I1. I2. I3.", {4: 1, 7: 2, 10: 3}),
        ("K1. I2. K3.", {6: 1, 7: 2, 9: 3}),
        ("J1. A5. J2.", {5: 1, 1: 5, 8: 2}),
        ("J1. J2. I3.", {5: 1, 8: 2, 10: 3}),
        # F counts units per minute
        ("F800", {9: 800}),
        # no point is needed by zero, by an expression, and by counts
        ("A0 B[1+1] D3 H4 M5 S6 T7", {1: 0, 2: 2, 7: 3, 11: 4, 13: 5, 19: 6, 20: 7}),
        ("A1. A2.", {1: 2}),
        # N and L are no arguments
        ("L1 A5.", {1: 5}),
    ],
)
def test_arguments_of_a_macro(call: str, values: dict[int, float]) -> None:
    read = "".join(f"G1 X#{number}\n" for number in sorted(values))
    expected = "".join(f"G1 X{values[number]}.\n" for number in sorted(values))
    assert fanuc(f"O1\nG65 P2 {call}\nM30\nO2\n{read}M99\n") == f"O1\n{expected}M30\n"


@pytest.mark.parametrize(
    ("word", "message"),
    [
        *((f"{letter}5", f"the argument {letter} has no decimal point, so the control scales it by its least "
           'increment; write the point, or state decimal_point = "calculator" in the machine file where the '
           "control is set so") for letter in "ABCIJKEQRUVWXYZ"),
        ("@5.", "G65 has the argument @, which is not an argument of a macro"),
        (",R5.", "G65 has the argument ,R, which is not an argument of a macro"),
    ],
)  # fmt: skip
def test_arguments_of_a_macro_that_are_refused(word: str, message: str) -> None:
    assert refused(f"O1\nG65 P2 {word}\nM30\nO2\nM99\n", "fanuc") == ("OLP516", message, 2)


def test_an_argument_counts_a_feed_per_revolution_by_an_increment_that_is_not_known() -> None:
    program = "O1\nG95\nG65 P2 F5\nM30\nO2\nM99\n"
    assert refused(program, "fanuc")[1].startswith("the argument F has no decimal point")


@pytest.mark.parametrize("call", ["A1 E41 R-2 F3", "A1. E41. R-2. F3."])
def test_a_control_whose_numbers_are_whole_units_passes_them_to_macros(call: str) -> None:
    """As it does where they have a point."""
    machine = Machine(
        name="m", chain="FXYZ", controller="fanuc", decimal_point="calculator",
        axes={a: Axis(travel_mm=(-100.0, 100.0), least_increment_mm=0.001) for a in "XYZ"},
    )  # fmt: skip
    control = named("fanuc").set_as(machine)

    def unrolled(text: str) -> str:
        assert control.unroller is not None
        return control.unroller(text.encode(), control).decode()

    read = unrolled(f"O1\nG95\nG65 P2 {call}\nM30\nO2\nG1 X#1 Y#8 Z#18 F#9\nM99\n")
    assert read == "O1\nG95\nG1 X1. Y41. Z-2. F3.\nM30\n"
    assert unrolled("O1\nG81 Z-1 R2 F9\nM30\n").startswith("O1\n")
    with pytest.raises(ProgramError, match="ROUND inside a word rounds to the least increment"):
        unrolled("O1\n#1=1\nG1 X[ROUND[#1]]\nM30\n")
