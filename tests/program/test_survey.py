"""All the reasons at once: each refused statement, none that only a repair made, in bounded work."""

from __future__ import annotations

from typing import Any

import pytest
from cases.fast import some_fast

from olp.core.errors import ProgramError, Reason, Refused
from olp.core.machine import Axis, Machine, Setup, WorkOffset
from olp.program import survey
from olp.program.program import Program
from olp.program.registry import named, read

AXES = {axis: Axis((-1000.0, 1000.0), 0.001, 100.0, 1000.0, 1e5) for axis in "XYZ"}
SETUP = Setup(Machine("m", "FXYZ", "linuxcnc", AXES, work_offsets={"G54": WorkOffset("G54", set_by="true")}))
HEAD = b"G21 G90 G54 G17 F100\nG0 X0. Y0. Z0.\n"


def reasons(text: bytes, dialect: str = "linuxcnc") -> tuple[Reason, ...]:
    """All that is refused in a text, also where it is one statement."""
    try:
        survey.read_all(text, SETUP, named(dialect))
    except Refused as error:
        assert error.complete
        return error.reasons
    except ProgramError as error:
        return (Reason(error.line, error.code, error.message, ""),)
    return ()


def stated(text: bytes, dialect: str = "linuxcnc") -> list[tuple[int | None, str, int | None]]:
    return [(r.line, r.code, r.follows) for r in reasons(text, dialect)]


def test_a_program_that_is_read_is_read() -> None:
    assert survey.read_all(HEAD, SETUP, named("linuxcnc")).toolpath.line.tolist() == [2]


def test_every_kind_is_listed_with_its_line() -> None:
    text = HEAD + (
        b"(a (b) c)\nG68 R30\nG1 X1,5\n#1=5\nM98 P1\nT77 M6\nG41 D1\nG0 G1 X1.\nX1. X2.\nG58 X3.\nG10 L1 P1\n"
    )
    assert stated(text) == [
        (3, "OLP514", None), (4, "OLP512", None), (5, "OLP510", None), (6, "OLP511", None),
        (7, "OLP511", None), (8, "OLP521", None), (9, "OLP513", None), (10, "OLP515", None),
        (11, "OLP515", None), (12, "OLP520", None), (13, "OLP526", None),
    ]  # fmt: skip


def test_one_missing_offset_is_one_reason() -> None:
    assert stated(HEAD + b"G55 X1.\nX2.\nX3.\nG54 X4.\nG55 X5.\n") == [(3, "OLP520", None)]


def test_one_unknown_start_is_one_reason() -> None:
    assert stated(b"G21 G90 G54 F100\nG2 X5. Y0. I2.5\nG2 X10. Y0. I2.5\n")[0] == (2, "OLP524", None)


def test_an_arc_that_is_refused_leaves_its_end_to_the_next() -> None:
    text = HEAD + b"G2 X20. Y0. I4. J0.\nG2 X40. Y0. I10. J0.\nG2 X50. Y0. I4. J0.\nG2 X60. Y0. R5.\n"
    assert stated(text) == [(3, "OLP530", None), (5, "OLP530", None)]


def test_what_only_a_repair_made_is_marked() -> None:
    # without line 3 the arc begins at X0
    text = HEAD + b"G1 X10,0\nG2 X20. Y0. I5. J0.\n"
    assert stated(text) == [(3, "OLP510", None), (4, "OLP530", 3)]
    # without the arc there is one reason
    assert stated(HEAD + b"G1 X10,0\nG1 X20. Y0.\n") == [(3, "OLP510", None)]


def test_the_rest_of_a_block_is_read() -> None:
    # X10 of the refused block is where the arc begins
    assert stated(HEAD + b"G68 X10. Y0. R3.\nG2 X20. Y0. I5. J0.\n") == [(3, "OLP512", None)]


def test_a_statement_of_several_lines_goes_whole() -> None:
    text = b"PARTNO A\nUNITS/MM\nGOTO/1,2,3\nFOO/1,$\n2,$\n3\nGOTO/4,5,6\nBAR/1\n"
    assert stated(text, "apt") == [(4, "OLP512", None), (8, "OLP512", None)]


def test_what_a_table_refuses_is_refused_behind_text_words_too() -> None:
    assert stated(b"PARTNO A\nUNITS/MM\nCATPROCESS A\nGOTO/1,2,3\n", "apt") == [(3, "OLP512", None)]


def test_a_hint_to_unroll_is_given_where_that_helps() -> None:
    helps, not_set = reasons(HEAD + b"#1=5\nG1 X#1\n"), reasons(HEAD + b"G1 X#5061\n")
    assert all(r.message.endswith("with --flatten") for r in helps)
    assert "--flatten does not unroll it: line 3: #5061 is kept by the control" in not_set[0].message
    # another refusal does not spoil the hint
    mixed = reasons(HEAD + b"(a (b) c)\n#1=5\nG1 X#1\n")
    assert mixed[1].message.endswith("with --flatten")


def test_a_hint_to_unroll_is_not_given_for_what_an_unrolled_program_still_has() -> None:
    (saved,) = reasons(HEAD + b"M70\n")
    assert saved.message == "M70 saves modal codes; --flatten does not unroll it; write plain blocks"
    (called,) = reasons(HEAD + b"M98 P1\nM2\nO1\nG1 X1.\nM99\n", "fanuc")[:1]
    assert called.message.endswith("unroll the program with --flatten")
    (macro,) = reasons(HEAD + b"G65 P1 X5.\nM2\nO1\nG1 X#24\nM99\n", "fanuc")[:1]
    assert macro.message == "G65 calls a macro; unroll the program with --flatten"
    (absent,) = reasons(HEAD + b"G65 P1 X5.\n", "fanuc")
    assert absent.message.endswith("line 3: subprogram 1 is not in the file, and no file for it was given")


def test_blocks_that_break_a_rule_of_the_control_are_found_in_one_reading(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    done = []

    def counted(data: bytes, *args: Any, **options: Any) -> Program:
        done.append(len(data))
        return read(data, *args, **options)

    monkeypatch.setattr(survey, "read", counted)
    # a word without a use, a word twice, two motions, a code without its word, N behind, a comment
    blocks = b"G1 X1. R5.\nG1 X1. X2.\nG0 G1 X3.\nG4\nX5. N9\n" * 20
    codes = ("OLP519", "OLP515", "OLP515", "OLP516", "OLP505") * 20
    assert stated(HEAD + blocks) == [(line, code, None) for line, code in enumerate(codes, 3)]
    # the program, and once more without them
    assert len(done) <= 3
    assert stated(HEAD + b"(a\n(b (c)\n%5\nG1 X1.\x05\n") == [
        (3, "OLP514", None), (4, "OLP514", None), (5, "OLP505", None), (6, "OLP502", None),
    ]  # fmt: skip


def test_the_message_lists_twenty_and_counts_the_others() -> None:
    with pytest.raises(Refused) as caught:
        survey.read_all(HEAD + b"G68 R3\n" * 33, SETUP, named("linuxcnc"))
    lines = str(caught.value.in_file("a.nc")).split("\n")
    assert len(lines) == 21
    assert lines[0].startswith("a.nc:3: G68 (rotation)")
    assert lines[-1] == "a.nc: 13 more statements are refused; olp inspect lists them"


ENDLESS = {
    "linuxcnc": (b"G1 X1,5\n", b"G68 R1\n", b"M98 P1\n", b"X1. X2.\n", b"/G91\nX1.\n/G90\n", b"G0 M6 T1.5\n"),
    "apt": (b"FOO/1\n", b"GOTO/1,A,3\n", b"GOTO/1,2,$\n"),
    "dmis": (b"FOO/1\n", b"PTMEAS/CART,1,2,3,0,0,1\n"),
}


@pytest.mark.parametrize(
    ("dialect", "line"), some_fast([(name, line) for name, lines in ENDLESS.items() for line in lines], 3)
)
def test_the_work_is_bounded(monkeypatch: pytest.MonkeyPatch, dialect: str, line: bytes) -> None:
    size = 30_000
    text = line * (size // len(line))
    done = []

    def counted(data: bytes, *args: Any, **options: Any) -> Program:
        done.append(len(data))
        return read(data, *args, **options)

    monkeypatch.setattr(survey, "read", counted)
    with pytest.raises(ProgramError):
        survey.read_all(text, SETUP, named(dialect))
    assert sum(done) <= 1.2 * survey.BYTES + 2 * size


def test_a_survey_that_ends_early_says_so() -> None:
    # each tool is found at its own reading
    text = HEAD + b"".join(b"T%d M6\n" % tool for tool in range(900, 1000))
    with pytest.raises(Refused) as caught:
        survey.read_all(text, SETUP, named("linuxcnc"))
    assert not caught.value.complete
    assert len(caught.value.reasons) >= Refused.LISTED
    assert "at least" in str(caught.value)
