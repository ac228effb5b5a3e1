"""Short texts that would make work without end are refused in one sentence that states the bound."""

from __future__ import annotations

import sys
from pathlib import Path
from types import FrameType
from typing import Any

import pytest
from cases.acceptance import TRUE_ZERO, machine
from cases.event_lines import KINDS, program
from cases.fast import some_fast

import olp
from olp.core import budget
from olp.core.budget import Budget
from olp.core.errors import ProgramError
from olp.program.registry import named
from olp.program.rs274.flatten import unroll
from olp.program.rs274.profiles.base import Profile

HEAD = "G21 G90 G54 G17\nG0 X1 Y2 Z3\nF100 S100 M3\n"
SERIES = "G91 G81 X0.001 Z-1 R1 "


def profile(name: str = "grbl") -> Profile:
    found = named(name)
    assert isinstance(found, Profile)
    return found


def test_a_budget_is_spent_once_and_grows_with_the_input() -> None:
    budget = Budget.of(100, least=10, per_byte=0.5, message="more than {limit}")
    budget.spend(50)
    with pytest.raises(ProgramError, match="more than 50"):
        budget.spend(1)
    assert Budget.of(100, least=60, per_byte=0.5, message="").limit == 60


@pytest.mark.parametrize(
    ("text", "line", "expected"),
    [
        ("G2 X2 R99999999999\n", 4, r"radius of an arc is 1e\+11 mm; expected at most 1e\+07 mm"),
        ("G2 X2 I99999999\n", 4, r"radius of an arc is 1e\+08 mm"),
        ("G2 X1 I5 Z9 P9999999\n", 4, "number of turns; expected at most 10000"),
        ("G2 I5 Z9 P6000\nG2 I5 Z3 P6000\n", 5, "make more than 10000 further turns; divide the program"),
        (SERIES + "L99999999\n", 4, "makes 99999999 holes; expected at most 20000"),
        (SERIES + "L12000\nX0.001 L12000\n", 5, "have more than 250000 strokes"),
        ("G83 X1 Z-100 R1 Q0.0012\n", 4, "have more than 250000 strokes"),
    ],
)
def test_the_reader_states_the_bound_with_the_line(
    text: str, line: int, expected: str, tmp_path: Path
) -> None:
    path = machine(tmp_path, tables=TRUE_ZERO)
    with pytest.raises(ProgramError, match=expected) as caught:
        olp.inspect((HEAD + text + "M2\n").encode(), path)
    assert caught.value.line == line


@pytest.mark.parametrize("text", ["G2 X2 R9999999\n", "G2 X1 I5 Z2 P3000\n", SERIES + "L9000\n"])
def test_what_is_large_and_within_the_bounds_is_read(text: str, tmp_path: Path) -> None:
    path = machine(tmp_path, tables=TRUE_ZERO)
    assert olp.inspect((HEAD + text + "M2\n").encode(), path)


NESTED = "".join(f"o{k} repeat [10]\n" for k in range(12)) + "G1 X1\n"
NESTED += "".join(f"o{k} endrepeat\n" for k in reversed(range(12)))


@pytest.mark.parametrize(
    ("dialect", "text"),
    [
        ("linuxcnc", "o1 while [1]\nG1 X1\nG1 X2\no1 endwhile\n"),
        ("linuxcnc", NESTED),
        ("grbl", "o1 repeat [99999]\n(" + "c" * 90_000 + ")\no1 endrepeat\n"),
        ("grbl", "o1 repeat [99999]\nG1 X[" + "+".join(["1"] * 9000) + "]\no1 endrepeat\n"),
        ("fanuc", "O1\nM98 P2 L99999999\nM30\nO2\nG91\nG1 X0.001\nM99\n"),
        ("fanuc", "O1\nN1 G0 X1.\nGOTO 1\nM30\n"),
    ],
)
def test_unrolling_is_bounded_by_the_bytes_of_visited_blocks(
    dialect: str, text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(budget, "RUN_PER_BYTE", 0)
    with pytest.raises(ProgramError, match="visits more than 200000 bytes of blocks; correct") as caught:
        unroll.flatten(text.encode(), profile(dialect), limit=200_000)
    assert caught.value.line is not None


@pytest.mark.slow
@pytest.mark.parametrize("expand", some_fast([False, True], 2))
def test_strokes_of_unrolled_cycles_are_bounded(expand: bool) -> None:
    text = HEAD + "o1 repeat [99]\nG91 G81 X0.001 Z-1 R1 L19999\no1 endrepeat\nM2\n"
    with pytest.raises(ProgramError, match="have more than 250000 strokes") as caught:
        unroll.flatten(text.encode(), profile("linuxcnc"), expand_cycles=expand)
    assert caught.value.line == 5


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ("**".join(["9"] * 9000), "has no finite real value"),
        ("[" * 500 + "1" + "]" * 500, "nested deeper than 60"),
        ("-" * 9000 + "1", "nested deeper than 60"),
        ("#" * 9000 + "1", "nested deeper than 60"),
        ("1" + "0" * 9000 + "*10", "is too large"),
    ],
)
def test_expressions_are_bounded_in_depth_and_value(value: str, expected: str) -> None:
    with pytest.raises(ProgramError, match=expected) as caught:
        unroll.flatten(f"G21\nG0 X[{value}]\n".encode(), profile())
    assert caught.value.line == 2


@pytest.mark.slow
def test_a_long_sum_is_no_deep_one() -> None:
    text = f"G0 X[{'+'.join(['1'] * 9000)}]\n"
    assert unroll.flatten(text.encode(), profile()) == b"G0 X9000\n"


def test_a_long_label_is_refused() -> None:
    with pytest.raises(ProgramError, match="a label has 9000 characters; expected at most 250"):
        unroll.flatten(("o" + "1" * 9000 + " sub\n").encode(), profile())


@pytest.mark.slow
def test_twenty_thousand_o_words_are_found_by_their_labels(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each search begins where it is, and looks at few statements."""
    count = 5000
    text = "".join(f"o{k} sub\nG0 X{k}\no{k} endsub\n" for k in range(1, count + 1))
    text += "".join(f"o{k} call\n" for k in range(1, count + 1)) + "M2\n"
    assert unroll.flatten(text.encode(), profile()).count(b"\n") == count + 1


def test_goto_takes_the_next_block_of_a_number_then_the_first() -> None:
    text = "O1\nN1 #1=0\nN5 #1=#1+1\nIF[#1EQ2]GOTO 5\nIF[#1LT3]GOTO 5\nG0 X#1\nN5 M30\n"
    assert b"X3" in unroll.flatten(text.replace("N5 M30", "N6 M30").encode(), profile("fanuc"))
    assert b"X" not in unroll.flatten(text.encode(), profile("fanuc"))


# -- work by the length of the text ----------------------------------------------------------------------

#: lines that are repeated, and what they are about
REPEATED = {
    "deleted blocks": "/M3\n/M5\n",
    "plain moves": "G1 X1\nX2\n",
    "distance modes": "G91 X1\nG90 X2\n",
    "whole circles": "G2 I9\n",
    "arcs with a radius": "G3 X2 R5\nG3 X1 R5\n",
    "canned cycles": "G81 X1 Z-1 R1\nX2\n",
    "holes of a series": "G81 X1 Z-1 R1\n" + "X2\nY3\n" * 4,
    "pecks": "G83 X1 Z-1 R1 Q0.4\n" + "X2 Q0.3\nY3\n" * 4,
    "holes in G91": "G91 G81 X1 Z-1 R1 L2\n" + "X-2 L2\n" * 4 + "G90\nG0 X1 Z3\n",
    "arcs with a centre": "G2 X2 I.5\nG2 X1 I-.5\n",
    "cycles that end": "G81 X1 Z-1 R1\nG80\nG0 Z9\n",
    "offsets": "G92 X3\nG0 X4\nG92.1\n",
    "tools": "T1 M6\nG0 X1 Y1 Z1\n",
    "dwells": "G4 P1\nX1\n",
    "machine positions": "G53 G0 X300\nG0 X2\n",
    "comments": "(a)\nX1\n",
}


#: a machine for them, and for those of `event_lines`
TABLES = TRUE_ZERO + '[work_offsets.G55]\nset_by = "true"\nX_mm = 2.0\n'
TABLES += "[tools.1]\nZ_mm = 100.0\n[tools.2]\nZ_mm = 90.0\n"


def work(text: str, place: Path) -> int:
    """How many steps of Python a correction of the text takes, and how many functions of C it calls."""
    count = 0

    def stepped(frame: FrameType, event: str, _: object) -> Any:
        nonlocal count
        frame.f_trace_lines, frame.f_trace_opcodes = False, True
        count += event == "opcode"
        return stepped

    def called(frame: FrameType, event: str, _: object) -> None:
        nonlocal count
        count += event == "c_call"

    before = sys.gettrace()
    sys.settrace(stepped)
    sys.setprofile(called)
    try:
        olp.correct(text.encode(), place)
    finally:
        sys.setprofile(None)
        sys.settrace(before)
    return count


def check_growth(texts: list[str], place: Path) -> None:
    """Each text has as many more lines than the one before: the second growth costs no more than the
    first, but for one more block of points. All are within one band, and what is made once in a process,
    such as the constructor of a class of which there are a few values, is made before."""
    for _ in range(7):
        olp.correct(texts[0].encode(), place)
    one, two, three = (work(text, place) for text in texts)
    assert three - two < 1.05 * (two - one) + 10_000


@pytest.mark.slow
@pytest.mark.parametrize("name", REPEATED)
def test_work_grows_with_the_text_and_no_faster(name: str, tmp_path: Path) -> None:
    texts = [HEAD + REPEATED[name] * count + "M2\n" for count in (40, 80, 120)]
    check_growth(texts, machine(tmp_path, tables=TABLES))


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_work_grows_with_lines_of_a_kind_and_no_faster(kind: str, tmp_path: Path) -> None:
    place = machine(tmp_path, "[squareness]\nC0Y_urad = 20.0\n", tables=TABLES)
    check_growth([program(kind, lines) for lines in (300, 600, 900)], place)


def calls(text: str, place: Path) -> int:
    """How many functions a correction of the text calls, those of C too."""
    count = 0

    def counted(frame: FrameType, event: str, _: object) -> None:
        nonlocal count
        count += event in ("call", "c_call")

    sys.setprofile(counted)
    try:
        olp.correct((HEAD + text + "M2\n").encode(), place)
    finally:
        sys.setprofile(None)
    return count


#: a head, and lines of which many are carried out at once
AT_ONCE = {
    "drilled": ("G81 X1 Z-1 R1\n", "X{k}\nY{k}\n"),
    "with a depth each": ("G83 X1 Z-1 R1 Q1.4\n", "X{k} Z-2.{k}\nG98 Y{k} R3\n"),
    "with dwells": ("G82 X1 Z-1 R1 P0.5\n", "X{k} Y{k}\nG99 Y{k} P1\n"),
    "arcs with a centre": ("G1 X1\n", "G2 X2 I0.5 J0.{k}\nG2 X1 I-0.5 J-0.{k}\n"),
    "arcs with a radius": ("G1 X1\n", "G3 X2 R5.{k}\nG2 X1 R-5.{k}\n"),
    "helices": ("G1 X1\n", "G2 X2 Z{k} I0.5\nG2 X1 Z3 I-0.5\n"),
}
#: kinds of lines of which every second or so is an event, and how many functions a line may call
EVENTS = {"switches": 6, "dwells": 16, "shifts": 110, "mixed": 40, "series": 400}
LEANING = '[[curves]]\nfile = "{}.csv"\ninterpolation = "linear"\n'
CURVES = {
    f"{a}.csv": f"{a.upper()}_mm,EXX_um\n-1000,-9\n2000,20\n".replace("EXX", f"E{a.upper()}{a.upper()}")
    for a in "xyz"
}


@pytest.mark.slow
@pytest.mark.parametrize("name", AT_ONCE)
def test_holes_and_arcs_are_carried_out_many_at_once(name: str, tmp_path: Path) -> None:
    """With errors that change their words. What is done for each hole or arc alone calls ten functions and
    more; blocks of points of the error model and bands are few."""
    place = machine(tmp_path, "".join(LEANING.format(a) for a in "xyz"), CURVES, tables=TRUE_ZERO)
    head, lines = AT_ONCE[name]
    few, some, many = (
        head + "".join(lines.format(k=10 + k % 80) for k in range(count)) for count in (9, 300, 900)
    )
    calls(few, place)
    assert calls(many, place) - calls(some, place) < 3 * (many.count("\n") - some.count("\n"))


@pytest.mark.slow
@pytest.mark.parametrize("kind", EVENTS)
def test_an_event_costs_a_few_calls(kind: str, tmp_path: Path) -> None:
    """Both readings together. A move that is put into arrays alone calls some seventy functions."""
    place = machine(tmp_path, "[squareness]\nC0Y_urad = 20.0\n", tables=TABLES)
    few, some, many = (program(kind, lines) for lines in (40, 400, 1200))
    calls(few, place)
    assert calls(many, place) - calls(some, place) < EVENTS[kind] * (many.count("\n") - some.count("\n"))
