"""What is in force on each line, by hand: modal codes, the spindle, units of bare numbers, block delete, and
where a program ends."""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from cases.blocks import moves, program, refusal, setup_of
from cases.rs274_texts import BLOCKS, START

from olp.core.errors import OlpError
from olp.core.machine import Setup
from olp.core.toolpath import Kind
from olp.program.program import Program
from olp.program.rs274 import reader
from olp.program.rs274.lexer import chunks

ALL = ("linuxcnc", "fanuc", "haas", "grbl")
HEAD = "G21 G90 G17 G54\nG0 X1. Y2. Z3.\n"
PERCENT = (
    "`%` is in the middle of the program, or not alone in its line; expected it as the first "
    "line and the last one, or not at all"
)
Vector = tuple[float, float, float]


@pytest.fixture(scope="module")
def setups(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Setup]:
    return {control: setup_of(tmp_path_factory.mktemp(control), control) for control in ALL}


def last(read: Program) -> Vector:
    x, y, z = read.toolpath.end_mm[-1].tolist()
    return x, y, z


#: Control and text: its lines up to the end, and those of its moves.
ENDS: dict[tuple[str, str], tuple[int, list[int]]] = {
    ("linuxcnc", "G0 X1\nM2\nX2"): (2, [1]),
    ("linuxcnc", "G0 X1 M30\nX2"): (1, [1]),
    ("linuxcnc", "G0 X1\nX2\n"): (2, [1, 2]),
    ("linuxcnc", "G0 X1\nM2\nM30\nX2"): (2, [1]),
    ("linuxcnc", "%\nG0 X1\n%\nX2"): (2, [2]),
    ("linuxcnc", "\n%\nG0 X1\n%\nX2\n%\n# odd"): (3, [3]),
    ("linuxcnc", "%\nG0 X1\nM2\n%\nX2"): (3, [2]),
    ("fanuc", "%\nO1\nG0 X1.\n%\nX2."): (3, [3]),
    ("fanuc", "(head)\n%\nG0 X1.\n% tail\nX2."): (3, [3]),
    ("fanuc", "% text\nG0 X1.\n"): (2, [2]),
    ("fanuc", "G0 X1.\n%\nX2."): (1, [1]),
    ("grbl", "G0 X1\n%\nX2"): (1, [1]),
    ("fanuc", "%\nG0 X1.\nM30\n%\n"): (3, [2]),
    ("fanuc", "G0 X1.\nM20.\nM300\n"): (3, [1, 2, 3]),
}


@pytest.mark.parametrize(("control", "text"), ENDS)
def test_a_program_ends_with_its_code_or_its_second_mark(
    control: str, text: str, setups: dict[str, Setup]
) -> None:
    end, lines = ENDS[control, text]
    read = program(text, setups[control], control)
    assert read.end_line == end
    assert read.toolpath.line.tolist() == lines


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("G0 X1\n%\nX2\n", {"line": 2, "why": PERCENT, "code": "OLP505"}),
        ("(a)\n%\nG0 X1\n%\n", {"line": 2, "why": PERCENT, "code": "OLP505"}),
        ("%\nG0 X1\n% a\nX2\n", {"line": 3, "why": PERCENT, "code": "OLP505"}),
        (
            "\n%\nG0 X1\n",
            {
                "line": 2,
                "why": "the program begins with `%` and has no end; give M2, M30 or a second `%`",
                "code": "OLP532",
            },
        ),
        (
            "% a\nG0 X1\n%\n",
            {
                "line": 1,
                "why": "`%` is not alone in its line; put what is behind it into the next one",
                "code": "OLP505",
            },
        ),
        (
            "\xff\xfeG\x000\x00",
            {
                "line": 1,
                "why": "the text is UTF-16; expected one byte per character; save it as plain text",
                "code": "OLP502",
            },
        ),
    ],
)
def test_marks_and_texts_that_linuxcnc_does_not_take(
    text: str, said: dict[str, object], setups: dict[str, Setup]
) -> None:
    assert refusal(text, setups["linuxcnc"]) == said


def test_a_byte_order_mark_is_a_blank(setups: dict[str, Setup]) -> None:
    text = "\xef\xbb\xbfG0 X1\nY2\n"
    read = program(text, setups["linuxcnc"])
    assert read.data == text.encode("latin-1")
    assert [row[-1] for row in moves(read)] == ["X1", "Y2"]
    assert refusal("\xfe\xff\x00G", setups["linuxcnc"])["code"] == "OLP502"


def test_block_delete_leaves_its_lines_out(setups: dict[str, Setup]) -> None:
    text = HEAD + "/G1 X5 F60\n/X = 3\nY4\n/M2\n/T1 M6\nX7\nM2\n/M30\n"
    read = program(text, setups["linuxcnc"], block_delete=True)
    assert [(row[0], row[1], row[3]) for row in moves(read)] == [
        (2, "RAPID", (101, 202, 303)),
        (5, "RAPID", (101, 204, 303)),
        (8, "RAPID", (107, 204, 303)),
    ]
    assert read.end_line == 9
    assert refusal(HEAD + "/M2\n", setups["linuxcnc"])["code"] == "OLP525"


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("/G1 X5 F60\nG1 Y7", None),
        ("/G1 X5 F60\n/G1 X6\nG0 Y7", None),
        ("/G1 X5 F60\n/G1 X6\nY7", 3),
        ("/G1 X5 F60\nF60\nG0 Y7", 3),
        ("G1 X4 F60\n/G0 X5", 4),
        ("G1 X4 F60\n/G1 X5\nX6", None),
        ("/G0 X5\nX6", None),
        ("/G17 G90 G91.1 G94\nX6", None),
        ("G91\n/G91 X5\nX6", None),
        ("/G91\nG90", 3),
        ("/X5\n/M8\nX6", None),
        ("/G4 P1\nX6", None),
        ("/G53 G0 X5\nX6", None),
        ("/G28 X5\nX6", None),
        ("/M3 S5\nX6", None),
    ],
)
def test_a_block_under_block_delete_changes_no_code_that_holds(
    text: str, line: int | None, setups: dict[str, Setup]
) -> None:
    if line is None:
        program(f"{HEAD}{text}\nM2\n", setups["linuxcnc"])
    else:
        said = refusal(f"{HEAD}{text}\nM2\n", setups["linuxcnc"])
        assert (said["line"], said["code"]) == (line, "OLP525")


#: Codes of the spindle before a hole, and whether LinuxCNC makes G84, G74 and G86 then.
SPINDLE = {
    "": "", "M3": "84 86", "M4": "74 86", "M5": "", "M3\nM5": "", "M4\nM3": "84 86", "M3\nM19": "",
    "M3.0": "84 86", "M03": "84 86", "M4.": "74 86", "M3\nM8": "84 86", "M3\nS5": "84 86",
    "M3\nT1 M6\nG0 X1 Y1 Z1": "", "T1 M6 M3\nG0 X1 Y1 Z1": "84 86", "M4 T1 M6\nG0 X1 Y1 Z1": "74 86",
}  # fmt: skip


@pytest.mark.parametrize("text", SPINDLE)
@pytest.mark.parametrize("code", ["84", "74", "86", "81"])
def test_the_spindle_turns_as_it_was_told_last(text: str, code: str, setups: dict[str, Setup]) -> None:
    whole = f"{HEAD}{text}\nG{code} X1 R2 Z1 {'P1' if code == '86' else ''}\nM2\n"
    if code in SPINDLE[text].split() or code == "81":
        program(whole, setups["linuxcnc"])
    else:
        said = refusal(whole, setups["linuxcnc"])
        assert (said["line"], said["code"]) == (text.count("\n") + 4, "OLP518")


#: Control and blocks behind `HEAD`: where the last of them ends, in G54 at 100, 200, 300.
MODAL: dict[tuple[str, str], Vector] = {
    # cycles are a group of their own on ISO controls: G80 alone brings back the last plain motion
    ("fanuc", "G1 Y2. F60.\nG81 X2. R2. Z1.\nG80\nX5."): (105, 202, 303),
    ("fanuc", "G80\nX5."): (105, 202, 303),
    ("fanuc", "G81 X2. R2. Z1.\nG80 X5."): (105, 202, 303),
    ("fanuc", "G81 X2. R2. Z1. G80\nX5."): (105, 202, 303),
    ("linuxcnc", "G81 X2 R2 Z1\nG80 G1 X5 F60"): (105, 202, 302),
    ("linuxcnc", "G1 G80 X5 F60\nY3"): (105, 203, 303),
    ("linuxcnc", "G80\nG1 X5 F60"): (105, 202, 303),
    ("linuxcnc", "G91 X1\nG90 Y5"): (102, 205, 303),
    ("linuxcnc", "G91\nX1 Y1\nX1 Y1"): (103, 204, 303),
    # the axis words of these are no motion
    ("linuxcnc", "G10 L2 P3 X5"): (101, 202, 303),
    ("linuxcnc", "G43.1 X5"): (101, 202, 303),
    ("linuxcnc", "G92 X5"): (101, 202, 303),
    ("linuxcnc", "G52 X5"): (101, 202, 303),
    ("linuxcnc", "G4 P1 X5"): (105, 202, 303),
    ("fanuc", "G4 X5."): (101, 202, 303),
    ("linuxcnc", "G92.1 X5"): (105, 202, 303),
    ("linuxcnc", "G61 X5"): (105, 202, 303),
    ("linuxcnc", "G40 X5"): (105, 202, 303),
    # numbers without a point count increments: 0.001 mm, 0.0001 inch
    ("fanuc", "X5000 Y5. Z0"): (105, 205, 300),
    ("fanuc", "X-5000 A5"): (95, 202, 303),
    ("fanuc", "G20\nX50000"): (100 + 5 * 25.4, 202, 303),
    ("fanuc", "X7000\nG20\nX50000\nG21 Y6000"): (100 + 5 * 25.4, 206, 303),
    ("haas", "G20\nG1 X1000 F9.\nG21\nX2000\nG20 Y5000\nG21 Z1000"): (102, 200 + 0.5 * 25.4, 301),
    ("fanuc", "G20\nG0 X0 Y0\nG2 X10000 I5000 F9.\nG21"): (125.4, 200, 303),
    ("fanuc", "G2 X3000 I1000 F60."): (103, 202, 303),
    ("fanuc", "G2 X3. R1000 F60."): (103, 202, 303),
    ("fanuc", "G18 G3 X2000 Z4000 K1000 F60."): (102, 202, 304),
    ("fanuc", "G99 G81 X5000 R2000 Z1000"): (105, 202, 302),
    ("fanuc", "G99 G83 X5000 R2000 Z1000 Q500"): (105, 202, 302),
    ("fanuc", "G91 G99 G81 X5000 R-1000 Z-1000 K3"): (116, 202, 302),
    ("fanuc", "G91 G99 G81 X5000 R-1000 Z-1000 L2"): (111, 202, 302),
    ("linuxcnc", "X5000"): (5100, 202, 303),
    ("grbl", "X5000"): (5100, 202, 303),
    ("fanuc", "G53 X7000"): (7, 202, 303),
    ("fanuc", "G52 X7000\nX1000"): (108, 202, 303),
    ("fanuc", "G28 X7000\nX1."): (101, 202, 303),
}  # fmt: skip


@pytest.mark.parametrize(("control", "text"), MODAL)
def test_a_block_is_read_in_the_codes_in_force(control: str, text: str, setups: dict[str, Setup]) -> None:
    read = program(f"{HEAD}{text}\nM2\n", setups[control], control)
    assert last(read) == pytest.approx(MODAL[control, text], abs=1e-9)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("X0 Y1.", None),
        ("X0\nY5", 4),
        ("R0 F100 S1000 P5 T1", None),
        ("G91 G81 X5. R-1. Z-1. K3", None),
        ("G91 G81 X5. R-1 Z-1. K3", 3),
        ("A5 B5\nX1.", None),
        ("X1.\nM30\nX5", None),
        ("G2 X3. I1000 F60.\nX5. R1000", 3),
        ("\n\nG83 X1. R2. Z1. Q1", 5),
    ],
)
def test_numbers_that_count_increments_are_remarked_once(
    text: str, line: int | None, setups: dict[str, Setup]
) -> None:
    read = program(f"{HEAD}{text}\nM2\n", setups["fanuc"], "fanuc")
    assert [remark for remark in read.remarks if remark[0] == "increments"] == (
        [] if line is None else [("increments", line, "")]
    )
    assert not read.calculator
    assert program(f"{HEAD}X5\n", setups["grbl"], "grbl").remarks == ()


def test_a_program_without_a_unit_is_remarked_where_it_first_moves(setups: dict[str, Setup]) -> None:
    assert program("G90\n\nG0 X1\nX2\n", setups["linuxcnc"]).remarks == (("unit", 3, "mm"),)
    assert program("G0 X1\nG21\nX2\n", setups["linuxcnc"]).remarks == (("unit", 1, "mm"),)
    assert program("G20\nG0 X1\n", setups["linuxcnc"]).remarks == ()


def test_a_control_moves_before_any_code_where_it_begins_in_rapids(setups: dict[str, Setup]) -> None:
    assert program("X1 Y2\n", setups["grbl"], "grbl").toolpath.kind.tolist() == [Kind.RAPID]
    assert refusal("X1\n", setups["linuxcnc"])["code"] == "OLP517"


@pytest.mark.parametrize(("code", "kind"), [("G0", Kind.RAPID), ("G1", Kind.LINE)])
def test_the_machine_file_states_the_motion_code_at_the_start(
    setups: dict[str, Setup], code: Literal["G0", "G1"], kind: Kind
) -> None:
    """Behind G80, too, on controls whose cycles are apart. A control that begins in a code keeps it."""

    def kinds(control: str, text: str) -> list[int]:
        setup = setups[control]
        stated = replace(setup, machine=replace(setup.machine, default_motion=code))
        return program(text, stated, control).toolpath.kind.tolist()

    assert kinds("fanuc", "F60 X1. Y2. Z3.\nG3 X3. R2.\n") == [kind, Kind.ARC_CCW]
    assert kinds("haas", "F60\nG80\nX1. Y2.\n") == [kind]
    assert kinds("grbl", "F60\nX1 Y2\n") == [Kind.RAPID]


def outcome(text: str, setup: Setup, control: str) -> object:
    """All that is read, None where it is refused."""
    try:
        read = program(text, setup, control)
    except OlpError:
        return None
    arcs = read.toolpath.arcs
    columns = [moves(read), list(read.holes), read.captures, read.path_modes, read.end_line]
    columns += [arcs.move.tolist(), arcs.centre_mm.tolist(), arcs.sweep_rad.tolist(), arcs.plane.tolist()]
    columns += [read.arc_slots.word.tolist(), read.toolpath.frame.tolist(), read.toolpath.frames]
    columns += [
        read.line_start.tolist(),
        read.line_end[:].tolist(),
        np.nan_to_num(read.toolpath.start_mm).tolist(),
    ]
    return columns


@pytest.mark.slow
@pytest.mark.parametrize("control", ["linuxcnc", "fanuc"])
def test_what_is_read_does_not_depend_on_the_chunks(
    control: str, setups: dict[str, Setup], monkeypatch: pytest.MonkeyPatch
) -> None:
    """In chunks of one line, and of two to four lines; a `/` block has to be restated in its own chunk."""
    for blocks in BLOCKS:
        text = START + blocks
        if "/" in text or "%" in text:
            continue
        monkeypatch.setattr(reader, "chunks", chunks)
        whole = outcome(text, setups[control], control)
        for size in (1, 30):
            monkeypatch.setattr(reader, "chunks", functools.partial(chunks, size=size))
            assert outcome(text, setups[control], control) == whole
