"""All the reasons at once: each refused statement, none that only a repair made, in bounded work."""

from __future__ import annotations

from typing import Any

import pytest
from cases.fast import some_fast

from olp.core.errors import ProgramError, Reason, Refused
from olp.core.machine import Axis, Machine, Setup, WorkOffset
from olp.program import survey
from olp.program.dialect import Options
from olp.program.origin import Unrolled
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


@pytest.mark.parametrize(("line", "controls"), [
    (b"#500=#500+1", ("fanuc", "haas", "mazak")), (b"N7 #199 = FIX[#501] MOD 2 (A) ; a", ("fanuc", "haas")),
    (b"#10002= #3020 - #10000", ("haas",)),
])  # fmt: skip
def test_a_counter_moves_nothing(line: bytes, controls: tuple[str, ...]) -> None:
    text = HEAD + line + b"\nG1 X1. F60.\n"
    for control in controls:
        read(text, SETUP, named(control))
    for control in {"linuxcnc", "grbl", "mach3", "fanuc"} - set(controls):
        assert stated(text, control) == [(3, "OLP511", None)]
    # other variables are those of a macro, or move what the control measures from
    for other in (b"#1", b"#33", b"#2001", b"#5221", b"#3000"):
        assert stated(HEAD + other + b"=#500\n", "fanuc") == [(3, "OLP511", None)]
    # its words are none of the block
    assert stated(HEAD + b"#500=#501MOD2\nG41 G1 X5. F60.\n", "fanuc")[0][1] == "OLP513"


@pytest.mark.parametrize("line", [b"POPEN", b"/N5 DPRNT[X*(A)*#5041[33]] ;a", b"pclos", b"BPRNT [ #1[3] ]"])
def test_what_a_macro_prints_moves_nothing(line: bytes) -> None:
    text = HEAD + line + b"\nX5.\n"
    assert stated(text, "haas") == []
    assert stated(text, "linuxcnc")[0][0] == 3


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
    text = b"G21 G90 G54 F100\nG2 X5. Y0. I2.5\nG2 X10. Y0. I2.5\n"
    assert stated(text) == [(2, "OLP524", None)]
    # a position that is lost later is another one
    assert stated(text + b"G28 Z0\nG2 X20. Y0. I5.\n") == [(2, "OLP524", None), (5, "OLP524", None)]


def test_all_readings_have_the_options() -> None:
    text = HEAD + b"/G68 R1\nG51\nG55 X1.\n"
    for block_delete, lines in ((True, [4, 5]), (False, [3, 4, 5])):
        with pytest.raises(Refused) as caught:
            survey.read_all(text, SETUP, named("linuxcnc"), Options(block_delete=block_delete))
        assert [reason.line for reason in caught.value.reasons] == lines


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


def test_a_text_word_is_no_statement_that_a_table_refuses() -> None:
    text = b"PARTNO A\nUNITS/MM\nPOINT/1\nCATPROCESS A=POINT/1\nPPRINT POINT/1\nGOTO/1,2,3\n"
    assert stated(text, "apt") == [(3, "OLP512", None)]


def test_a_hint_to_unroll_is_given_where_that_helps() -> None:
    helps, not_set = reasons(HEAD + b"#1=5\nG1 X#1\n"), reasons(HEAD + b"G1 X#5061\n")
    assert all(r.message.endswith("with --flatten") for r in helps)
    assert "--flatten does not unroll it: line 3: #5061 is kept by the control" in not_set[0].message
    # another refusal does not spoil the hint
    mixed = reasons(HEAD + b"(a (b) c)\n#1=5\nG1 X#1\n")
    assert mixed[1].message.endswith("with --flatten")


def test_a_hint_to_unroll_is_not_given_for_what_an_unrolled_program_still_has() -> None:
    (saved,) = reasons(HEAD + b"M70\n")
    assert saved.message == "M70 saves modal codes; unroll the program with --flatten"
    (repeated,) = reasons(HEAD + b"M99\n", "fanuc")
    assert repeated.message == (
        "M99 repeats the program; --flatten does not unroll it; "
        "write M30 in its place where it ends a main program"
    )
    (called,) = reasons(HEAD + b"M98 P1\nM2\nO1\nG1 X1.\nM99\n", "fanuc")[:1]
    assert called.message.endswith("unroll the program with --flatten")
    (macro,) = reasons(HEAD + b"G65 P1 X5.\nM2\nO1\nG1 X#24\nM99\n", "fanuc")[:1]
    assert macro.message == "G65 calls a macro; unroll the program with --flatten"
    (absent,) = reasons(HEAD + b"G65 P1 X5.\n", "fanuc")
    assert absent.message.endswith(
        "line 3: subprogram 1 is not in the file, and no file for it was given; put one into the folder of "
        "the program, such as O0001.nc"
    )


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


def test_a_reason_shows_its_statement() -> None:
    long = b"G68 R1 (" + b"x" * 80 + b")"
    shown = [r.statement for r in reasons(HEAD + b"  G68 R3 (a\tb\xff\xc3\xa9)  \n" + long + b"\nG51\n")]
    assert shown == ["G68 R3 (a?b\N{REPLACEMENT CHARACTER}é)", "G68 R1 (" + "x" * 52, "G51"]


@pytest.mark.parametrize(
    ("blocks", "expected"),
    [
        # each word of a block that is refused, in any form
        (b"g0068 G51 X1. R2\n", [(3, "OLP512", None), (3, "OLP512", None)]),
        # only the word goes: X5 is the end of the block
        (b"G1 X5. R3\nG2 X15. Y0. I5.\n", [(3, "OLP519", None)]),
        (b"G1 X5. R - .5\nG2 X15. Y0. I5.\n", [(3, "OLP519", None)]),
        (b"G1 X5. r3\nG2 X15. Y0. I5.\n", [(3, "OLP519", None)]),
        # what may follow names the last statement that was taken out before it
        (b"G68 R1\nG1 X1,5\nX2.\nG51\nG2 X9. Y9. I1.\n",
         [(3, "OLP512", None), (4, "OLP510", None), (6, "OLP512", None), (7, "OLP530", 6)]),
        # a comment states nothing
        (b"(a (b)\nG2 X5. Y5. I1.\n", [(3, "OLP514", None), (4, "OLP530", None)]),
        # offsets, tools and styli are refused once
        (b"G55 X1.\nG56 X2.\nG55 X3.\nT99 M6\nT99 M6\nT98 M6\n",
         [(3, "OLP520", None), (4, "OLP520", None), (6, "OLP521", None), (8, "OLP521", None)]),
        # an arc that is no arc when it is straight
        (b"G2 X5. Y5. I1. J1.\nG3 X5. Y5. R1.\nG03 X9. Y5. R.1\nG1 X5. Y5.\n",
         [(3, "OLP530", None), (4, "OLP530", None), (5, "OLP530", None)]),
    ],
)  # fmt: skip
def test_what_is_refused_after_a_repair(blocks: bytes, expected: list[tuple[int, str, int | None]]) -> None:
    assert stated(HEAD + blocks) == expected


def test_a_single_reason_is_the_refusal_itself() -> None:
    with pytest.raises(ProgramError) as caught:
        survey.read_all(HEAD + b"G68 R3\n", SETUP, named("linuxcnc"))
    assert not isinstance(caught.value, Refused)
    assert (caught.value.line, caught.value.code, caught.value.word) == (3, "OLP512", "G68")


def test_another_language_is_said_instead() -> None:
    for text in (HEAD + b"CYCLE81(1)\n", HEAD + b"#1=5\nCOMPON\n"):
        with pytest.raises(ProgramError, match="this is Sinumerik") as caught:
            survey.read_all(text, SETUP, named("linuxcnc"))
        assert caught.value.code == "OLP501"
    # not in a text whose dialect is certain
    assert stated(b"PARTNO A\nUNITS/MM\nSOFT\nGOTO/1,2,3\n", "apt") == [(3, "OLP512", None)]
    with pytest.raises(ProgramError, match="this is a PDF document"):
        survey.read_all(b"%PDF-1.7\n" + HEAD, SETUP, named("apt"))


# -- programs that are unrolled first ------------------------------------------------------------------------


class Unrolling:
    """Unrolls a program with files beside it, and keeps the limits that were given."""

    def __init__(self, data: bytes, dialect: str, files: dict[str, bytes], **options: Any) -> None:
        self.data, self.dialect, self.files, self.options = data, named(dialect), files, options
        self.limits: list[int | None] = []

    def __call__(self, change: survey.Change, limit: int | None) -> Unrolled:
        self.limits.append(limit)
        given = {} if limit is None else {"limit": limit}

        def beside(name: str) -> tuple[str, bytes] | None:
            file = f"{name}.ngc"
            return (file, change(file, self.files[name])) if name in self.files else None

        assert self.dialect.unroller is not None
        text = change(None, self.data)
        return self.dialect.unroller(text, self.dialect, subprograms=beside, **self.options, **given)


def unrolled(
    text: bytes, files: dict[str, bytes] | None = None, dialect: str = "linuxcnc", **options: Any
) -> tuple[list[tuple[object, ...]], list[int | None]]:
    """File, line, code, what it follows, and statement of each reason; and the limits of all unrollings."""
    unroll = Unrolling(text, dialect, files or {}, **options)
    expands = bool(options.get("expand_cycles"))
    try:
        survey.read_all(text, SETUP, named(dialect), unroll=unroll, expands=expands)
    except Refused as error:
        rows: list[tuple[object, ...]] = [
            (r.file, r.line, r.code, (r.follows_file, r.follows) if r.follows else None, r.statement)
            for r in error.reasons
        ]
        return [*rows, *[("more",)] * (not error.complete)], unroll.limits
    except ProgramError as error:
        return [(error.file, error.line, error.code, None, error.message)], unroll.limits
    return [], unroll.limits


def test_a_program_that_is_unrolled_is_mended_in_its_own_lines() -> None:
    text = HEAD + b"#1=5\nG1 X#1 R3\nG68 R1\no7 call\nM2\n"
    files = {"7": b"o7 sub\nG1 X5 R3\nG55 X#1\no7 endsub\n"}
    rows, limits = unrolled(text, files)
    assert rows == [
        (None, 4, "OLP519", None, "G1 X#1 R3"), (None, 5, "OLP512", None, "G68 R1"),
        ("7.ngc", 2, "OLP519", (None, 5), "G1 X5 R3"), ("7.ngc", 3, "OLP520", None, "G55 X#1"),
    ]  # fmt: skip
    assert limits[0] is None
    assert set(limits[1:]) == {survey.UNROLLED}
    assert unrolled(HEAD + b"#1=5\nG1 X#1\nM2\n") == ([], [None])


def test_the_file_of_a_subprogram_is_mended_where_it_is_refused_first() -> None:
    files = {"7": b"o7 sub\nG1 X#5061\nG1 X[5] R3\no7 endsub\n"}
    rows, _ = unrolled(HEAD + b"o7 call\nG68 R1\nM2\n", files)
    assert [(row[:3], row[4]) for row in rows] == [
        ((None, 4, "OLP512"), "G68 R1"), (("7.ngc", 2, "OLP541"), "G1 X#5061"),
        (("7.ngc", 3, "OLP519"), "G1 X[5] R3")
    ]  # fmt: skip


def test_what_needs_no_unrolling_is_refused_as_without() -> None:
    rows, limits = unrolled(HEAD + b"G1 X5. R3\nG68 R1\nM2\n")
    assert [row[:3] for row in rows] == [(None, 3, "OLP519"), (None, 4, "OLP512")]
    assert limits == [None]
    rows, limits = unrolled(HEAD + b"G1 X5. R3\nG99 G81 X1 Z-1 R1\nM2\n", expand_cycles=True)
    assert [row[:3] for row in rows] == [(None, 3, "OLP519")]
    assert limits == [None, survey.UNROLLED]


def test_what_needs_no_unrolling_has_as_many_readings_as_without(monkeypatch: pytest.MonkeyPatch) -> None:
    text = tools(9)
    monkeypatch.setattr(survey, "BYTES", 5 * len(text))
    rows, limits = unrolled(text)
    assert (len(rows), rows[-1], limits) == (6, ("more",), [None])


def test_a_refusal_in_a_file_that_is_reached_late_is_the_only_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(survey, "UNROLLED", 1)
    text = HEAD + b"o1 repeat [999]\no1 endrepeat\no7 call\nM2\n"
    rows, limits = unrolled(text, {"7": b"o7 sub\nG1 X#5061\no7 endsub\n"})
    assert (rows, limits) == ([("7.ngc", 2, "OLP541", None, ""), ("more",)], [None, 1])


def test_an_endless_loop_is_the_only_reason() -> None:
    text = HEAD + b"G68 R1\no1 while [1]\no1 endwhile\nM2\n"
    unroll = Unrolling(text, "linuxcnc", {})

    def short(change: survey.Change, limit: int | None) -> Unrolled:
        return unroll(change, 1)

    with pytest.raises(ProgramError) as caught:
        survey.read_all(text, SETUP, named("linuxcnc"), unroll=short)
    assert (caught.value.code, caught.value.line) == (survey.TOO_LONG, 4)
    assert not isinstance(caught.value, Refused)
    assert unroll.limits == [1]


def test_what_unrolling_leaves_is_not_hinted_at_again() -> None:
    rows, _ = unrolled(HEAD + b"G1 X[2]\nM99\n")
    assert rows == [
        (
            None,
            4,
            "OLP511",
            None,
            "M99 repeats the program; --flatten does not unroll it; write M30 in its "
            "place where it ends a main program",
        )
    ]


def test_an_unrolled_text_has_no_statements_of_its_own() -> None:
    text = Unrolling(HEAD + b"#1=5\nG1 X#1 R3\nG68 R1\nM2\n", "linuxcnc", {})(survey.as_it_is, None)
    with pytest.raises(ProgramError) as caught:
        survey.read_all(text, SETUP, named("linuxcnc"))
    assert not isinstance(caught.value, Refused)
    # in the lines of the original
    assert caught.value.line == 5


def test_hints_are_judged_with_the_files_of_subprograms() -> None:
    text = HEAD + b"G1 X[1]\no7 call\nM2\n"

    def hints(subprograms: survey.Subprograms | None) -> list[str]:
        with pytest.raises(Refused) as caught:
            survey.read_all(text, SETUP, named("linuxcnc"), subprograms=subprograms)
        return [reason.message.partition("; ")[2] for reason in caught.value.reasons]

    assert all("with --flatten" in hint for hint in hints(lambda name: ("7.ngc", b"o7 sub\nX1\no7 endsub\n")))
    lost = (
        "--flatten does not unroll it: line 4: subprogram 7 is not in the file, and no file for it was "
        "given; put one into the folder of the program, such as 7.ngc"
    )
    assert hints(None) == hints(lambda name: None) == [lost] * 2
    broken = "--flatten does not unroll it: line 2 of 7.ngc: division by zero in an expression"
    assert hints(lambda name: ("7.ngc", b"o7 sub\nX[1/0]\no7 endsub\n")) == [broken] * 2


def test_a_hint_is_judged_without_the_other_refusals_and_in_the_same_lines() -> None:
    # a first line that is refused, and a last line without an end
    text = b"(a (b)\nG21 G90 G54 G17 F100\nG1 X#5061"
    assert "--flatten does not unroll it: line 3: #5061" in reasons(text)[1].message


def test_a_hint_is_kept_where_it_takes_too_long_to_try(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(survey, "UNROLLED", 1)
    text = HEAD + b"o1 while [1]\no1 endwhile\n"
    with pytest.raises(Refused) as caught:
        survey.read_all(text, SETUP, named("linuxcnc"))
    assert all(reason.message.endswith("with --flatten") for reason in caught.value.reasons)


# -- the limits of the work ----------------------------------------------------------------------------------


def tools(count: int) -> bytes:
    """A program with a reason for each of several readings."""
    return HEAD + b"".join(b"T%d M6\n" % tool for tool in range(900, 900 + count))


def reasons_of(text: bytes) -> tuple[int, bool]:
    with pytest.raises(Refused) as caught:
        survey.read_all(text, SETUP, named("linuxcnc"))
    return len(caught.value.reasons), caught.value.complete


def test_there_are_so_many_readings_at_most(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(survey, "READINGS", 4)
    assert reasons_of(tools(4)) == (4, True)
    assert reasons_of(tools(5)) == (4, False)


@pytest.mark.parametrize(("most", "readings"), [(0, 3), (3, 3), (4, 4), (5, 5)])
def test_a_long_text_is_read_less_often(most: int, readings: int, monkeypatch: pytest.MonkeyPatch) -> None:
    text = tools(9)
    monkeypatch.setattr(survey, "BYTES", most * len(text))
    assert reasons_of(text) == (readings, False)
    # a reading more than that is not begun
    monkeypatch.setattr(survey, "BYTES", (most + 1) * len(text) - 1)
    assert reasons_of(text) == (max(readings, 3), False)


def test_an_unrolling_counts_as_some_bytes(monkeypatch: pytest.MonkeyPatch) -> None:
    text = HEAD + b"".join(b"T[%d] M6\n" % tool for tool in range(900, 909))
    monkeypatch.setattr(survey, "BYTES", len(text) + 4 * survey.REFUSED_BYTES)
    rows, limits = unrolled(text)
    # each of them, and the reading without unrolling
    assert (len(rows), rows[-1], len(limits)) == (5, ("more",), 5)
