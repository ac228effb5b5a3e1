"""Lines of commands, as printers read them: what moves, what stays, and after what no position is known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cases.blocks import moves, program, refusal, setup_of

from olp.core.machine import Setup
from olp.core.toolpath import Flag, Kind
from olp.program.registry import DIALECTS, dialect_of

PRINTERS = ("marlin", "klipper")
HEAD = "G21\nG90\nG0 X1 Y2 Z3\n"


@pytest.fixture(scope="module")
def setups(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Setup]:
    return {c: setup_of(tmp_path_factory.mktemp(c), c) for c in PRINTERS}


def ends(text: str, setup: Setup, control: str) -> list[tuple[object, ...]]:
    """Kinds and ends in program coordinates of the moves behind the head."""
    rows = moves(program(HEAD + text, setup, control))[1:]
    zero = (100.0, 200.0, 300.0)
    return [
        (kind, *(None if v is None else round(v - o, 6) for v, o in zip(end, zero, strict=True)))
        for _, kind, _, end, _ in rows  # type: ignore[misc]
    ]


@pytest.mark.parametrize("control", PRINTERS)
@pytest.mark.parametrize(
    "line",
    ["M117 Layer 1 of 20", "M117 G1 X500", "M117 X500 Y3", "M106 S255", "M204 P800 T1500", "M73 P10 R5",
     "M104 T0 S200", "M862.3 P \"MK3S\"", "M486 APart one", "M203 X500 Y500 Z10 E60", "; G1 X500",
     "M115 U3.13.3", "G92 E0", "G10", "G11", "G4 P500", "N7 M117 X9", "M118 E1 (done)", ""],
)  # fmt: skip
def test_lines_that_move_nothing(line: str, control: str, setups: dict[str, Setup]) -> None:
    text = f"{line}\nG1 Y5 F600\n"
    assert ends(text, setups[control], control)[-1] == ("LINE", 1.0, 5.0, 3.0)
    assert len(ends(text, setups[control], control)) == 1


@pytest.mark.parametrize("control", PRINTERS)
@pytest.mark.parametrize("line", ["G28", "G28 X Y", "G28 Z0", "G29", "M600", "M84 X Y E", "M999", "G30"])
def test_lines_after_which_no_position_is_known(line: str, control: str, setups: dict[str, Setup]) -> None:
    assert ends(f"{line}\nG0 Y5\n", setups[control], control)[-1] == ("RAPID", None, 5.0, None)


@pytest.mark.parametrize("control", PRINTERS)
def test_brackets_are_comments_where_the_machine_file_says_so(control: str, setups: dict[str, Setup]) -> None:
    """An option of Marlin's firmware, which Klipper does not have; the plain text is the judge."""
    setup = setups[control]
    stated = replace(setup, machine=replace(setup.machine, bracket_comments=True))
    plain = "G21 ; (x\nG1 Y5 F600\nG28 X\nG0 X4 Y2\nG1 Z2 F60\n"
    text = (
        "(a ; G1 X99)\nG21 (all in mm)\nG1 (to) Y5 F600(Penetrate)\nG28 X (home\n"
        "G0 X4 Y2 ; (x\nG1 Z2 F60 (end\n"
    )
    if control == "marlin":
        assert ends(text, stated, control) == ends(plain, setup, control)
        assert refusal(f"{HEAD}(a (b) c)\n", stated, control)["line"] == 4
        assert "bracket_comments = true" in str(refusal(HEAD + text, setup, control)["why"])
    else:
        why = str(refusal(HEAD + text, stated, control)["why"])
        assert "brackets, which are no comment" in why
        assert "bracket_comments" not in why


def test_names_of_klipper(setups: dict[str, Setup]) -> None:
    setup = setups["klipper"]
    zeros = "SET_GCODE_OFFSET Z_ADJUST=0 MOVE=1", "set_gcode_offset X=0.0 Z=-.0"
    for still in zeros:
        assert ends(f"{still}\nG0 Y5\n", setup, "klipper")[-1] == ("RAPID", 1.0, 5.0, 3.0)
    for still in ("SET_VELOCITY_LIMIT ACCEL=500", "EXCLUDE_OBJECT_START NAME=a_1", 'RESPOND MSG="G1 X9"'):
        assert ends(f"{still}\nG0 Y5\n", setup, "klipper")[-1] == ("RAPID", 1.0, 5.0, 3.0)
    read = program(HEAD + "BED_MESH_CALIBRATE\nLIGHTS A=1\nG0 Y5\n", setup, "klipper")
    assert [name for name, _, _ in read.remarks] == ["macro"]
    assert read.remarks[0][1] == 4
    assert "BED_MESH_CALIBRATE is a macro of the machine" in read.remarks[0][2]
    stated = replace(setup, machine=replace(setup.machine, still_macros=frozenset({"LIGHTS"})))
    assert ends("lights a=1\nG0 Y5\n", stated, "klipper")[-1] == ("RAPID", 1.0, 5.0, 3.0)
    shifts = "SET_GCODE_OFFSET Z=0.1", "SET_GCODE_OFFSET X=0 Z_ADJUST=.05", "SET_GCODE_OFFSET Z={z}"
    for name in (*shifts, "SKEW_PROFILE LOAD=a", "RESTORE_GCODE_STATE NAME=a"):
        assert refusal(HEAD + name, setup, "klipper")["code"] == "OLP512"
    assert refusal(HEAD + "LIGHTS A=1", setups["marlin"], "marlin")["code"] == "OLP510"


@pytest.mark.parametrize("control", PRINTERS)
@pytest.mark.parametrize(
    ("line", "code", "says"),
    [
        ("X5 Y6", "OLP517", "no code holds from line to line"),
        ("G1 X5 (a) Y7", "OLP514", "brackets, which are no comment"),
        ("(a note)", "OLP514", "write the comment behind `;`"),
        ("N3 G1 X5*71", "OLP505", "has a checksum"),
        ("G1 X", "OLP510", "is not understood"),
        ("/G1 X5", "OLP505", "not block delete"),
        ("G2 X5 Y5 I1 J1 P2", "OLP519", "P of an arc"),
        ("G20", "OLP512", "post millimetres"),
        ("G5 X1 Y1 I1 J1 P1 Q1", "OLP512", "spline"),
        ("G54", "OLP512", "work offsets"),
        ("M206 X5", "OLP512", "moves the zero"),
        ("M92 X80", "OLP512", "steps per millimetre"),
        ("M852 I0.1", "OLP512", "squareness"),
        ("G92", "OLP516", "G92 needs one of X, Y, Z, E"),
        ("T1.5", "OLP516", "not a number of a table"),
        ("T9", "OLP521", "tool 9, which is not defined"),
    ],
)
def test_what_is_refused(line: str, code: str, says: str, control: str, setups: dict[str, Setup]) -> None:
    said = refusal(f"{HEAD}{line}\n", setups[control], control)
    assert (said["line"], said["code"]) == (4, code)
    assert says in str(said["why"])


def test_arcs_of_both_firmwares(setups: dict[str, Setup]) -> None:
    assert ends("G2 X5 Y6 R9\n", setups["marlin"], "marlin")[-1][1:] == (5.0, 6.0, 3.0)
    assert "R of an arc" in str(refusal(HEAD + "G2 X5 Y6 R9\n", setups["klipper"], "klipper")["why"])
    # its G18 turns the other way
    assert refusal(HEAD + "G18\n", setups["klipper"], "klipper")["code"] == "OLP512"


def test_a_shift_and_a_home(setups: dict[str, Setup]) -> None:
    for control in PRINTERS:
        said = refusal(HEAD + "G92 X0\nG28\n", setups[control], control)
        assert (said["line"], said["code"]) == (5, "OLP518")


def test_the_nozzle_of_a_tool_word(setups: dict[str, Setup]) -> None:
    """A command T changes the nozzle: its offset holds at once, and it may have moved."""
    rows = ends("T2\nG0 X1 Y2 Z3\n", setups["marlin"], "marlin")
    assert rows[-1] == ("RAPID", 2.0, 4.0, 63.0)
    assert ends("T2\nG0 Y5\n", setups["marlin"], "marlin")[-1] == ("RAPID", None, 7.0, None)
    assert ends("T2\nG0 X1 Y2 Z3\nT2\nG0 Y5\n", setups["marlin"], "marlin")[-1] == (
        "RAPID", 2.0, 7.0, 63.0,
    )  # fmt: skip
    # with a time the motors stay on, on Marlin alone
    assert ends("M84 S0\nG0 Y5\n", setups["marlin"], "marlin")[-1] == ("RAPID", 1.0, 5.0, 3.0)
    assert ends("M84 S0\nG0 Y5\n", setups["klipper"], "klipper")[-1] == ("RAPID", None, 5.0, None)


#: Text behind the head, and whether its last move feeds: G90 gives the extruder back on Klipper alone.
FEEDS = {
    "M82\nG92 E5\nG1 X9 E6\n": (True, True),
    "M82\nG92 E5\nG1 X9 E4\n": (False, False),
    "M83\nG1 X9 E-1\n": (False, False),
    "M83\nG1 X9 E.1\n": (True, True),
    "M83\nG1 X8 E1\nG1 X9\n": (False, False),
    "M82\nG1 X8 E9\nM83\nG1 X8 E1\nM82\nG1 X9 E9.5\n": (False, False),
    "M83\nG90\nG1 X7 E5\nG1 X9 E1\n": (False, True),
    "M82\nG1 E9\nG91\nG1 X9 E1\n": (True, True),
    "G91\nM82\nG1 X7 E9\nG1 X9 E1\n": (False, True),
    "M82\nG1 E9\nT0\nG0 X1 Y2 Z3\nG1 X9 E1\n": (True, True),
}


@pytest.mark.parametrize("text", FEEDS)
@pytest.mark.parametrize("control", PRINTERS)
def test_a_move_that_feeds_nothing_is_a_travel(text: str, control: str, setups: dict[str, Setup]) -> None:
    kind = ends(text, setups[control], control)[-1][0]
    assert kind == ("LINE" if FEEDS[text][PRINTERS.index(control)] else "RAPID")


def test_without_an_extruder_g1_cuts(setups: dict[str, Setup]) -> None:
    path = program(HEAD + "G1 X9 F600\nG0 X1\nG3 X3 I1 J0\n", setups["marlin"], "marlin").toolpath
    assert [Kind(k) for k in path.kind[1:].tolist()] == [Kind.LINE, Kind.RAPID, Kind.ARC_CCW]
    assert not (path.flag & np.uint8(Flag.WHOLE)).any()


@pytest.mark.parametrize(
    ("text", "control", "chosen"),
    [
        (b";FLAVOR:Marlin\n", "klipper", "klipper"),
        (b";FLAVOR:Marlin\n", "marlin", "marlin"),
        (b"; generated by PrusaSlicer 2.7 on x\n", "klipper", "klipper"),
        (b"G1 X1\n; gcode_flavor = klipper\n", "marlin", "klipper"),
        (b"G1 X1\n", "grbl", "grbl"),
    ],
)
def test_signs_of_slicers(text: bytes, control: str, chosen: str) -> None:
    assert dialect_of(None, DIALECTS[control], text, "a.gcode").name == chosen


def test_a_sliced_text_on_another_control_is_asked(tmp_path: Path) -> None:
    from olp.core.errors import ProgramError

    with pytest.raises(ProgramError, match="may be klipper or marlin; name its dialect"):
        dialect_of(None, DIALECTS["grbl"], b";FLAVOR:Marlin\nG1 X1\n", "a.gcode")
