"""Offsets, tools, lengths and path modes by hand: the frame of each move, and what is refused."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cases.blocks import OFFSETS, TOOLS, program, refusal, setup_of

from olp.core.machine import Setup
from olp.core.toolpath import CutterCompensation, Flag, Frame, LengthError
from olp.program.program import Program
from olp.program.rs274.state import Capture, PathMode

ALL = ("linuxcnc", "fanuc", "haas", "grbl")
HEAD = "G21 G90 G17 G54\nG0 X1. Y2. Z3.\n"
INCH = 25.4
Vector = tuple[float, float, float]


@pytest.fixture(scope="module")
def setups(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Setup]:
    return {control: setup_of(tmp_path_factory.mktemp(control), control) for control in ALL}


def last(read: Program) -> Vector:
    x, y, z = read.toolpath.end_mm[-1].tolist()
    return x, y, z


def frame(read: Program) -> Frame:
    """That of the last move."""
    return read.toolpath.frames[int(read.toolpath.frame[-1])]


#: Control and blocks behind `HEAD` (axes at 101, 202, 303): the axis position behind the last one.
PLACES: dict[tuple[str, str], Vector] = {
    # work offsets
    ("linuxcnc", "G55\nX1"): (11, 202, 303),
    ("linuxcnc", "G59.3\nX1 Z1"): (2, 202, 4),
    # turned offsets: words that are left out keep their coordinates in the program
    ("linuxcnc", "G56\nX1"): (101, 1, 303),
    ("linuxcnc", "G10 L2 P1 R90\nX1"): (101, 201, 303),
    ("linuxcnc", "G10 L2 P1 R-90\nG91\nX1 Y2"): (103, 201, 303),
    ("linuxcnc", "G10 L2 P1 R90 X10 Y20\nG92 X2 Y3\nX3"): (101, 203, 303),
    ("linuxcnc", "G10 L2 P1 R90\nG53 G0 X1"): (1, 202, 303),
    ("linuxcnc", "G10 L2 P1 R180\nG43 H2\nX1 Y2 Z3"): (100, 200, 363),
    ("fanuc", "G54.1 P7\nX1. Y1."): (8, 9, 303),
    ("haas", "G154 P2\nX1. Y1."): (5, 6, 303),
    ("haas", "G112\nX1. Y1."): (3, 5, 303),
    # lengths: tool 1 has Z 50, tool 2 has X 1, Y 2, Z 60
    ("linuxcnc", "G43 H2\nX1 Y2 Z3"): (102, 204, 363),
    ("linuxcnc", "G43 H2\nG43.2 H1\nX1 Y2 Z3"): (102, 204, 413),
    ("linuxcnc", "G43 H2\nG43.2 H2\nX1 Y2 Z3"): (103, 206, 423),
    ("linuxcnc", "G43 H2\nG43 H1\nX1 Y2 Z3"): (101, 202, 353),
    ("linuxcnc", "G43 H2\nG49\nX1 Y2 Z3"): (101, 202, 303),
    ("linuxcnc", "T2 M6\nG43\nX1 Y2 Z3"): (102, 204, 363),
    ("linuxcnc", "T2 M6\nG43 H0\nX1 Y2 Z3"): (102, 204, 363),
    ("linuxcnc", "T0 M6\nG43\nX1 Y2 Z3"): (101, 202, 303),
    ("linuxcnc", "M61 Q2\nG43\nX1 Y2 Z3"): (102, 204, 363),
    ("linuxcnc", "T1\nM6 G43 H2\nX1 Y2 Z3"): (102, 204, 363),
    ("linuxcnc", "G43.1 Y5 Z7\nX1 Y2 Z3"): (101, 207, 310),
    ("linuxcnc", "G43.1 Y5\nG43.1 X4 Z7\nX1 Y2 Z3"): (105, 207, 310),
    ("fanuc", "G43 H2\nX1. Y2. Z3."): (101, 202, 363),
    ("fanuc", "G44 H2\nX1. Y2. Z3."): (101, 202, 243),
    ("fanuc", "G43 H1\nG44 H2\nX1. Y2. Z3."): (101, 202, 243),
    ("fanuc", "G43 H0\nX1. Y2. Z3."): (101, 202, 303),
    # G10
    ("linuxcnc", "G10 L2 P1 X5 Z7\nX1 Y2 Z3"): (6, 202, 10),
    ("linuxcnc", "G10 L2 P0 X5\nX1 Y2 Z3"): (6, 202, 303),
    ("linuxcnc", "G55\nG10 L2 P0 X5\nX1 Y2 Z3"): (6, 22, 33),
    ("linuxcnc", "G10 L2 P2 X5\nX1 Y2 Z3"): (101, 202, 303),
    ("linuxcnc", "G10 L2 P2 X5\nG55 X1 Y2 Z3"): (6, 22, 33),
    ("linuxcnc", "G10 L2 P6 X5 Y6 Z7\nG59 X1 Y1 Z1"): (6, 7, 8),
    ("linuxcnc", "G10 L2 P7 X5 Y6 Z7\nG59.1 X1 Y1 Z1"): (6, 7, 8),
    ("linuxcnc", "G10 L2 P9 X5\nG59.3 X1 Y1 Z1"): (6, 3, 4),
    ("linuxcnc", "G91 G10 L2 P1 X5\nG90 X1 Y2 Z3"): (6, 202, 303),
    ("fanuc", "G91\nG10 L2 P1 X5.\nG90 X1. Y2. Z3."): (106, 202, 303),
    ("fanuc", "G10 L2 P1 X5.\nX1. Y2. Z3."): (6, 202, 303),
    ("fanuc", "G91\nG10 L2 P1 X5000\nG90 X1. Y2. Z3."): (106, 202, 303),
    ("linuxcnc", "G20\nG10 L2 P1 X5\nX1 Y2 Z3"): (6 * INCH, 200 + 2 * INCH, 300 + 3 * INCH),
    ("linuxcnc", "G10 L20 P1 X5 Z7\nX6 Y2 Z8"): (102, 202, 304),
    ("linuxcnc", "G10 L20 P0 X5\nX6 Y2 Z3"): (102, 202, 303),
    ("linuxcnc", "G10 L20 P2 X5\nG55 X6 Y2 Z3"): (102, 22, 33),
    ("linuxcnc", "G43 H2\nG92 Y7\nG10 L20 P1 X5 Y9\nX6 Y10 Z3"): (102, 203, 363),
    # shifts
    ("linuxcnc", "G92 X5 Z7\nX6 Y2 Z8"): (102, 202, 304),
    ("linuxcnc", "G92 X5\nG92 Y5\nX6 Y6 Z3"): (102, 203, 303),
    ("linuxcnc", "G92 X5\nG92.1\nX6 Y2 Z3"): (106, 202, 303),
    ("linuxcnc", "G92 X5\nG92.2\nX6 Y2 Z3"): (106, 202, 303),
    ("linuxcnc", "G92 X5\nG92.2\nG92.3\nX6 Y2 Z3"): (102, 202, 303),
    ("linuxcnc", "G92 X5\nG92.1\nG92.3\nX6 Y2 Z3"): (106, 202, 303),
    ("linuxcnc", "G52 X5\nX6 Y2 Z3"): (111, 202, 303),
    ("linuxcnc", "G52 X5 Y1\nG52 X2\nX6 Y2 Z3"): (108, 203, 303),
    ("linuxcnc", "G52 X5\nG92.2\nG92.3\nX6 Y2 Z3"): (111, 202, 303),
    ("linuxcnc", "G52 X5\nG92.1\nX6 Y2 Z3"): (106, 202, 303),
    ("fanuc", "G52 X5.\nG92 X5.\nX6. Y2. Z3."): (102, 202, 303),
    ("fanuc", "G52 X5.\nG52 X2. Z1.\nX6. Y2. Z3."): (108, 202, 304),
    ("fanuc", "G92 X5.\nG52 X2.\nX6. Y2. Z3."): (104, 202, 303),
    ("fanuc", "G52 X5.\nG55\nX6. Y2. Z3."): (21, 22, 33),
    ("linuxcnc", "G20\nG92 X1\nX2"): (101 + INCH, 202, 303),
    # units in the same block count for it
    ("linuxcnc", "G20 G43.1 Z1\nZ1"): (101, 202, 300 + 2 * INCH),
    ("linuxcnc", "G55 G43 H1\nZ1"): (101, 202, 81),
    ("linuxcnc", "G43 H1\nG55\nX1 Y1 Z1"): (11, 21, 81),
    # units, lengths and work offsets come before what else is in a block
    ("linuxcnc", "G92 X5 G55\nX6 Y2 Z3"): (102, 22, 33),
    ("linuxcnc", "G10 L20 P0 X5 G55\nX6 Y2 Z3"): (102, 22, 33),
    ("linuxcnc", "G92 X5 G43 H2\nX6 Y2 Z3"): (102, 204, 363),
    ("linuxcnc", "G92 X1 G20\nX2"): (101 + INCH, 202, 303),
    ("linuxcnc", "G10 L2 P0 X5 G55\nG54 X1 Y1 Z1"): (101, 201, 301),
    # a length in the other unit is converted by ISO controls
    ("fanuc", "G43 H1\nG20\nG55\nZ1."): (101, 202, 80 + INCH),
}  # fmt: skip


@pytest.mark.parametrize(("control", "text"), PLACES)
def test_offsets_and_lengths_add_up(control: str, text: str, setups: dict[str, Setup]) -> None:
    read = program(f"{HEAD}{text}\nM2\n", setups[control], control)
    assert last(read) == pytest.approx(PLACES[control, text], abs=1e-9)


#: Tools 3 and 2 were set where the axes were at 5, 6, 7 and at 9, 8, 7: of the tool that cuts, and against
#: that of the tool that touched the offset.
BOTH = (
    LengthError((0.0, 0.0, 1.0), ((5.0, 6.0, 7.0), (0.0, 0.0, -80.0))),
    LengthError((0.0, 0.0, -1.0), ((9.0, 8.0, 7.0), (-1.0, -2.0, -60.0))),
)
#: Blocks behind `HEAD` on LinuxCNC, and fields of the frame of the last move.
FRAMES: dict[str, dict[str, object]] = {
    "G55 X1": {"unit_mm": 1.0, "offset_mm": (10, 20, 30), "length_mm": (0, 0, 0), "tool": None,
               "tool_mm": (0, 0, 0), "work_offset": "G55", "touched": None, "lengths": (),
               "payload_kg": 0.0, "compensation": None},
    "G20 X1": {"unit_mm": INCH, "offset_mm": (100, 200, 300)},
    "G43 H2\nX1": {"offset_mm": (101, 202, 360), "length_mm": (1, 2, 60), "tool": None,
                   "tool_mm": (-1, -2, -60)},
    "G43 H2\nG49\nX1": {"length_mm": (0, 0, 0), "tool": None, "tool_mm": (0, 0, 0)},
    "T1 M6\nX1": {"length_mm": (0, 0, 0), "tool": 1, "tool_mm": (0, 0, -50)},
    "T1\nX1": {"tool": None, "tool_mm": (0, 0, 0)},
    "T1 M6\nG43 H2\nX1": {"length_mm": (1, 2, 60), "tool": 1, "tool_mm": (0, 0, -50)},
    "T0 M6\nX1": {"tool": 0, "tool_mm": (0, 0, 0)},
    "T2\nT1\nM6\nX1": {"tool": 1},
    "M61 Q2\nX1": {"tool": 2, "tool_mm": (-1, -2, -60)},
    "T1 M6\nM61 Q0\nX1": {"tool": 0, "tool_mm": (0, 0, 0)},
    # the tip of tool 2 touched G57
    "G57\nX1": {"touched": ((71, 82, 150), (-1, -2, -60))},
    "G57\nG43 H2\nX1": {"lengths": ()},
    "G57\nG43 H3\nX1": {"lengths": BOTH},
    "G43 H3\nX1": {"lengths": (replace(BOTH[0], constant_mm=0.002),)},
    "G43 H3\nG49\nX1": {"lengths": ()},
    "T1 M6\nG43 H3\nG43 H0\nX1": {"lengths": (), "length_mm": (0, 0, 50)},
    "G43.1 Z5\nX1": {"lengths": (), "length_mm": (0, 0, 5), "tool_mm": (0, 0, 0)},
    # an offset that is set from the present position has the touch of the offset in force
    "G57\nG10 L20 P2 X0\nG55 X1": {"touched": ((71, 82, 150), (-1, -2, -60)), "work_offset": "G55"},
    "G57\nG10 L20 P2 X0\nG55 G43 H3\nX1": {"lengths": BOTH},
    "G10 L20 P2 X0\nG55 X1": {"touched": None},
    "G57\nG10 L2 P2 X0\nG55 X1": {"touched": None},
    "G57\nG10 L2 P2 X0\nG55 G43 H3\nX1": {"lengths": (replace(BOTH[0], constant_mm=0.002),)},
    "G57\nG10 L20 P2 X0\nG55\nG10 L20 P3 X0 Y0 Z0\nG56 G43 H3\nX1": {
        "touched": ((71, 82, 150), (-1, -2, -60)), "lengths": BOTH,
    },
    "G10 L2 P8 X1 Y2 Z3\nG59.2 X1": {"touched": ((1, 2, 3), (0, 0, 0)), "work_offset": "G59.2"},
    "G57\n(olp payload 30 kg)\nX1": {"payload_kg": 30.0},
    "(olp payload 30 kg)\nX1\nX2 (olp payload 4)": {"payload_kg": 4.0},
}  # fmt: skip


@pytest.fixture(scope="module")
def with_setter(setups: dict[str, Setup]) -> Setup:
    """Tools 2 and 3 were set on one setter, whose lengths are 0.002 mm too long; no offset is rotated."""
    there = setups["linuxcnc"].machine
    tools = TOOLS | {
        2: replace(TOOLS[2], set_by="touch", touched_at_mm=(9.0, 8.0, 7.0)),
        3: replace(TOOLS[3], constant_mm=0.002),
    }
    plain = OFFSETS | {"G56": replace(OFFSETS["G56"], rotation_deg=(0.0, 0.0, 0.0))}
    return replace(setups["linuxcnc"], machine=replace(there, tools=tools, work_offsets=plain))


@pytest.mark.parametrize("text", FRAMES)
def test_a_frame_states_offset_length_tool_and_touch(text: str, with_setter: Setup) -> None:
    got = frame(program(f"{HEAD}{text}\nM2\n", with_setter))
    assert {name: getattr(got, name) for name in FRAMES[text]} == FRAMES[text]


def test_frames_that_are_alike_are_one(setups: dict[str, Setup]) -> None:
    text = f"{HEAD}G55 X1\nG54 X1\nG55 Y1\nG20 X1\nG21 X1\nM2\n"
    path = program(text, setups["linuxcnc"]).toolpath
    assert path.frame.tolist() == [0, 1, 0, 1, 2, 1]
    assert len(path.frames) == 3


#: Blocks behind `HEAD` on LinuxCNC, and the changes of path mode in them: line, name, path tolerance in mm,
#: and whether short moves are merged.
PATH_MODES: dict[str, tuple[PathMode, ...]] = {
    "G61": (PathMode(3, "G61", 0.0),),
    "G61.1": (PathMode(3, "G61.1", 0.0),),
    "G64": (PathMode(3, "G64", None),),
    "G64 P0.05": (PathMode(3, "G64 P0.05", 0.05, 0.05),),
    "G64 P0.05 Q0.01": (PathMode(3, "G64 P0.05 Q0.01", 0.05, 0.01),),
    "G64 P0.05 Q0": (PathMode(3, "G64 P0.05 Q0", 0.05),),
    "G64 Q0.01": (PathMode(3, "G64 Q0.01", None, 0.01),),
    "G20 G64 P0.1\nG61": (PathMode(3, "G64 P0.1", 2.54, 2.54), PathMode(4, "G61", 0.0)),
}


@pytest.mark.parametrize("text", PATH_MODES)
def test_a_path_mode_has_its_path_tolerance(text: str, setups: dict[str, Setup]) -> None:
    read = program(f"{HEAD}{text}\nM2\n", setups["linuxcnc"])
    assert [m.tolerance_mm for m in read.path_modes] == pytest.approx(
        [m.tolerance_mm for m in PATH_MODES[text]]
    )
    assert [replace(m, tolerance_mm=None) for m in read.path_modes] == [
        replace(m, tolerance_mm=None) for m in PATH_MODES[text]
    ]


def test_iso_controls_have_no_path_tolerance_in_g64(setups: dict[str, Setup]) -> None:
    read = program(f"{HEAD}G64 P0.05\nG61\nM2\n", setups["fanuc"], "fanuc")
    assert read.path_modes == (PathMode(3, "G64", None), PathMode(4, "G61", 0.0))


def test_words_that_store_the_present_position_are_kept(setups: dict[str, Setup]) -> None:
    text = f"{HEAD}G92 X5 Z7\nG20\nG10 L20 P2 Y3\nG1 X1\nG92 X2\nG10 L2 P1 X7\nG52 X3\nM2\n"
    read = program(text, setups["linuxcnc"])
    words = read.words
    assert words is not None
    got = [
        (c.axis, c.unit_mm, c.moves, c.line, text[words.start[c.word] : words.end[c.word]])
        for c in read.captures
    ]
    assert got == [
        (0, 1.0, 1, 3, "X5"),
        (2, 1.0, 1, 3, "Z7"),
        (1, INCH, 1, 5, "Y3"),
        (0, INCH, 2, 7, "X2"),
    ]
    assert isinstance(read.captures[0], Capture)


#: Blocks behind `HEAD`, and the cutter compensation of the last move. Tool 1 has the radius 4, tool 3 the
#: radius -3, tool 2 none.
COMPENSATED: dict[tuple[str, str], CutterCompensation | None] = {
    ("linuxcnc", "G41 D1\nG1 X50 F60"): CutterCompensation(0, True, 4.0, 1),
    ("linuxcnc", "G42 D1\nG1 X50 F60"): CutterCompensation(0, False, 4.0, 1),
    ("linuxcnc", "G41 D3\nG1 X50 F60"): CutterCompensation(0, False, 3.0, 1),
    ("linuxcnc", "G42 D3\nG1 X50 F60"): CutterCompensation(0, True, 3.0, 1),
    ("linuxcnc", "T1 M6\nG0 X1 Y1 Z1\nG41\nG1 X50 Y50 Z5 F60"): CutterCompensation(0, True, 4.0, 1),
    ("linuxcnc", "T1 M6\nG0 X1 Y1 Z1\nG41 D0\nG1 X50 Y50 Z5 F60"): CutterCompensation(0, True, 4.0, 1),
    ("linuxcnc", "T1 M6\nG0 X1 Y1 Z1\nG42 D3\nG1 X50 Y50 Z5 F60"): CutterCompensation(0, True, 3.0, 1),
    ("fanuc", "G18 G41 D1\nG1 X50. F60."): CutterCompensation(1, True, 4.0, 1),
    ("fanuc", "G19 G42 D1\nG1 Y50. F60."): CutterCompensation(2, False, 4.0, 1),
    ("linuxcnc", "G41.1 D5\nG1 X50 F60"): CutterCompensation(0, True, 2.5, 1),
    ("linuxcnc", "G42.1 D5\nG1 X50 F60"): CutterCompensation(0, False, 2.5, 1),
    ("linuxcnc", "G41.1 D-5\nG1 X50 F60"): CutterCompensation(0, False, 2.5, 1),
    ("linuxcnc", "G20 G41.1 D1\nG1 X50 F60"): CutterCompensation(0, True, 12.7, 1),
    ("linuxcnc", "G41 D1\nG1 X50 F60\nG40\nX9"): None,
    ("linuxcnc", "T0 M6\nG0 X1 Y1 Z1\nG41\nG1 X50 Y50 Z5 F60"): CutterCompensation(0, True, 0.0, 1),
    ("fanuc", "G41 D0\nG1 X50. F60."): CutterCompensation(0, True, 0.0, 1),
    ("linuxcnc", "G41 D1\nG1 X50 F60\nG40\nX9\nG42 D1\nX99"): CutterCompensation(0, False, 4.0, 2),
    ("linuxcnc", "G1 X50 F60"): None,
}


@pytest.mark.parametrize(("control", "text"), COMPENSATED)
def test_the_contour_is_compensated_by_the_radius(control: str, text: str, setups: dict[str, Setup]) -> None:
    read = program(f"{HEAD}{text}\nM2\n", setups[control], control)
    assert frame(read).compensation == COMPENSATED[control, text]


UNKNOWN = "the control makes the path of the tool from the radius of tool {0}, which is not known; give "
UNKNOWN += "radius_mm, and wear_mm, in [tools.{0}] of the machine or job file"
NO_D = "G41 has no D word, and the tool in the spindle is not known; give D, or T and M6 before it"
NO_RADIUS = "G41 has no D word, and which radius it takes is not known; give D"
IN_COMPENSATION = "in cutter compensation; give G40 before"
#: Control and blocks behind `HEAD`: line, code and sentence.
NOT_COMPENSATED: dict[tuple[str, str], tuple[int, str, str]] = {
    ("linuxcnc", "G41 D2\nG1 X5 F60"): (3, "OLP513", UNKNOWN.format(2)),
    ("linuxcnc", "G41 D9\nG1 X5 F60"): (3, "OLP513", UNKNOWN.format(9)),
    ("linuxcnc", "G41\nG1 X5 F60"): (3, "OLP513", NO_D),
    ("fanuc", "T1 M6\nG41\nG1 X5. Y5. Z5. F60."): (4, "OLP513", NO_RADIUS),
    ("linuxcnc", "G41 D1.5\nG1 X5 F60"): (
        3, "OLP516", "D1.5 is not a number of a table; expected an integer from 0"
    ),
    ("linuxcnc", "G41.1\nG1 X5 F60"): (
        3, "OLP516", "G41.1 needs a D word with the diameter of the cutter"
    ),
    ("linuxcnc", "G19 G41 D1\nG1 Y5 F60"): (
        3, "OLP518", "this control has no cutter compensation in this plane; program the path of the tool"
    ),
    ("linuxcnc", "G41 D1\nG1 X9 F60\nG42 D1 X99"): (
        5, "OLP528", "cutter compensation is on already, and how the control goes over is not known; program "
        "G40 between the two contours",
    ),
    ("linuxcnc", "G41 D1\nG1 X9 F60\nT1 M6"): (5, "OLP518", f"a tool change is {IN_COMPENSATION}"),
    ("linuxcnc", "G41 D1\nG1 X9 F60\nG20"): (
        5, "OLP518", f"units, probing or machine positions are {IN_COMPENSATION}"
    ),
    ("linuxcnc", "G41 D1\nG1 X9 F60\nG18 G61"): (5, "OLP518", f"a change of plane is {IN_COMPENSATION}"),
}  # fmt: skip


@pytest.mark.parametrize(("control", "text"), NOT_COMPENSATED)
def test_what_compensation_cannot_be_or_hold_is_said(
    control: str, text: str, setups: dict[str, Setup]
) -> None:
    line, code, why = NOT_COMPENSATED[control, text]
    said = refusal(f"{HEAD}{text}\nM2\n", setups[control], control)
    assert (said["line"], said["code"], said["why"]) == (line, code, why)


def test_wear_is_added_to_the_radius(setups: dict[str, Setup]) -> None:
    setup = setups["linuxcnc"]
    for wear, left, radius in ((-0.5, True, 3.5), (0.25, True, 4.25), (-5.0, False, 1.0)):
        worn = {**setup.machine.tools, 1: replace(setup.machine.tools[1], wear_mm=wear)}
        read = program(
            f"{HEAD}G41 D1\nG1 X9 F60\nM2\n", replace(setup, machine=replace(setup.machine, tools=worn))
        )
        assert frame(read).compensation == CutterCompensation(0, left, radius, 1)


MIXED = (
    "the tool length in force was set in the other unit, and the control does not convert it: it "
    "loses the position in this block; give G49 before G20 or G21, and G43 after it"
)
CUTTING = "offsets and reference positions are used in cutter compensation; give G40 before"
SPINDLE = (
    "takes the length of the tool in the spindle, which is not known; give T and M6 before it, or `tool` in "
    "the job file"
)
BESIDE = "a tool length beside M6 is that of the tool before the change; put it into the next block"
DWELL = "a dwell and a motion are in one block; put the dwell into its own block"
TABLE = "is not a number of a table; expected an integer from 0"
NUMBER = "G10 needs a P word with the number of a work offset, 1 for G54"
POSITION = (
    "is stored as the present position, but the axis has not been commanded yet; M100 in line 3 may have "
    "moved it: list 100 in still_m_codes of the machine file if it moves no axis, or command X, Y and Z "
    "behind it"
)
LOST = (
    "with G92 in force, which the control does not count there: it loses the position in this block; "
    "give G92.1 before it"
)
#: Control and blocks behind `HEAD`: what is said of them.
REFUSED: dict[tuple[str, str], dict[str, object]] = {
    ("linuxcnc", "G58 X1"): {
        "why": 'work offset G58 is used but not defined; give [work_offsets."G58"] in the machine or '
        "job file",
        "code": "OLP520", "missing": ("work_offsets", "G58"),
    },
    ("linuxcnc", "G58\n\nX1"): {
        "why": 'work offset G58 is used but not defined; give [work_offsets."G58"] in the machine or '
        "job file",
        "code": "OLP520", "missing": ("work_offsets", "G58"), "line": 5,
    },
    ("fanuc", "G54.1 P9 X1."): {
        "why": 'work offset G54.1P9 is used but not defined; give [work_offsets."G54.1P9"] in the machine or '
        "job file",
        "code": "OLP520", "missing": ("work_offsets", "G54.1P9"),
    },
    ("linuxcnc", "G92 X5\nG10 L2 P1 R5"): {
        "why": f"a work offset is turned {LOST}", "code": "OLP518", "line": 4,
    },
    ("linuxcnc", "G56\nG92 Y5\nG53 G0 X1"): {
        "why": f"G53 is used in a turned work offset {LOST}", "code": "OLP518",
        "line": 5,
    },
    ("linuxcnc", "G56\nG10 L20 P1 X5"): {
        "why": "G10 L20 stores a position in a work offset that is turned, which is not read; state the "
        "offset with G10 L2",
        "code": "OLP526", "line": 4,
    },
    ("fanuc", "G56\nX1."): {
        "why": "work offset G56 is rotated, which this control does not do so; "
        "state it with A_deg = B_deg = C_deg = 0",
        "code": "OLP523", "line": 4,
    },
    ("linuxcnc", "G43 H9"): {
        "why": "G43 uses tool 9, which is not defined; give [tools.9] in the machine or job file",
        "code": "OLP521", "missing": ("tools", "9"),
    },
    ("linuxcnc", "G43.2 H9"): {
        "why": "G43.2 uses tool 9, which is not defined; give [tools.9] in the machine or job file",
        "code": "OLP521", "missing": ("tools", "9"),
    },
    ("linuxcnc", "T9 M6"): {
        "why": "M6 uses tool 9, which is not defined; give [tools.9] in the machine or job file",
        "code": "OLP521", "missing": ("tools", "9"),
    },
    ("linuxcnc", "M61 Q9\nX1"): {
        "why": "tool 9 is in the spindle but not defined; give [tools.9] in the machine or job file",
        "code": "OLP521", "missing": ("tools", "9"), "line": 4,
    },
    ("linuxcnc", "M6"): {
        "why": "M6 changes to a tool, but no T word comes before it; give T", "code": "OLP516",
    },
    ("linuxcnc", "T1 M6 G43 H0"): {"why": BESIDE, "code": "OLP518"},
    ("linuxcnc", "T0 M6 G43"): {"why": BESIDE, "code": "OLP518"},
    ("linuxcnc", "T1 M6 G43.2 H0"): {"why": BESIDE, "code": "OLP518"},
    ("linuxcnc", "M61"): {"why": "M61 needs a Q word with the tool number", "code": "OLP516"},
    ("linuxcnc", "M61 Q1.5"): {"why": f"Q1.5 {TABLE}", "code": "OLP516"},
    ("linuxcnc", "T1.5"): {"why": f"T1.5 {TABLE}", "code": "OLP516"},
    ("fanuc", "T-1"): {"why": f"T-1 {TABLE}", "code": "OLP516"},
    ("linuxcnc", "G4 P-0.1"): {"why": "a dwell is negative; expected P0 or more", "code": "OLP516"},
    ("fanuc", "G4 X1. Y1."): {"why": DWELL, "code": "OLP518"},
    ("fanuc", "G4 P1 Z1."): {"why": DWELL, "code": "OLP518"},
    ("fanuc", "G4 G0 X1."): {"why": DWELL, "code": "OLP518"},
    ("haas", "G4 P1 G1"): {"why": DWELL, "code": "OLP518"},
    ("haas", "G4 P1 G2"): {"why": DWELL, "code": "OLP518"},
    ("haas", "G4 P1 G3"): {"why": DWELL, "code": "OLP518"},
    ("linuxcnc", "G43"): {"why": f"G43 {SPINDLE}", "code": "OLP532"},
    ("linuxcnc", "G43 H0"): {"why": f"G43 {SPINDLE}", "code": "OLP532"},
    ("linuxcnc", "G43.2 H0"): {"why": f"G43.2 {SPINDLE}", "code": "OLP532"},
    ("linuxcnc", "G43.2 X1"): {
        "why": "G43.2 needs an H word with the number of the tool length", "code": "OLP516",
    },
    ("fanuc", "G43"): {"why": "G43 needs an H word with the number of the tool length", "code": "OLP516"},
    ("fanuc", "G44"): {"why": "G44 needs an H word with the number of the tool length", "code": "OLP516"},
    ("linuxcnc", "G43 H1\nG20 G55"): {"why": MIXED, "code": "OLP518", "line": 4},
    ("linuxcnc", "G43 H1\nG20\nG92 X1"): {"why": MIXED, "code": "OLP518", "line": 5},
    ("linuxcnc", "G43 H1\nG20\nG49"): {"why": MIXED, "code": "OLP518", "line": 5},
    ("linuxcnc", "G43 H1\nG20\nG28 Z1"): {"why": MIXED, "code": "OLP518", "line": 5},
    ("linuxcnc", "G43 H1\nG20\nG53 X1"): {"why": MIXED, "code": "OLP518", "line": 5},
    ("linuxcnc", "G43 H1\nG20\nG10 L2 P1 X1"): {"why": MIXED, "code": "OLP518", "line": 5},
    ("linuxcnc", "G10 L1 P1 X5"): {
        "why": "G10 L1 writes lengths or the radius of tool 1 that is not the one of the machine file; give "
        "X_mm = 5 in [tools.1] as the program writes it",
        "code": "OLP526",
    },
    ("linuxcnc", "G10 P1 X5"): {
        "why": "G10 without L writes tables of the control, which is not read; expected L2 or L20",
        "code": "OLP526",
    },
    ("fanuc", "G10 L0 P1 X5."): {
        "why": "G10 L0 writes tables of the control, which is not read; expected L2 or L20", "code": "OLP526",
    },
    ("fanuc", "G10 L2 P1 R5"): {
        "why": "G10 R turns the work offset, which this control does not do here; leave R out",
        "code": "OLP526",
    },
    ("linuxcnc", "G10 L20 P1 X5 R0"): {
        "why": "G10 R turns the work offset, which this control does not do here; leave R out",
        "code": "OLP526",
    },
    ("linuxcnc", "G10 L2 X5"): {"why": NUMBER, "code": "OLP516"},
    ("linuxcnc", "G10 L2 P10 X5"): {"why": NUMBER, "code": "OLP516"},
    ("fanuc", "G10 L2 P7 X5."): {"why": NUMBER, "code": "OLP516"},
    ("linuxcnc", "G10 L2 P1.5 X5"): {"why": f"P1.5 {TABLE}", "code": "OLP516"},
    ("linuxcnc", "M100\nG92 Y5"): {"why": f"Y {POSITION}", "code": "OLP524", "line": 4},
    ("linuxcnc", "M100\nG10 L20 P1 Z5"): {"why": f"Z {POSITION}", "code": "OLP524", "line": 4},
    ("fanuc", "G54 G4 P500"): {
        "why": "P may be that of G54 or of G4; put G54 in a block of its own", "code": "OLP518",
    },
    ("fanuc", "G98 G54 G82 X1. Z-5. R2. P300"): {
        "why": "P may be that of G54 or of G82; put G54 in a block of its own", "code": "OLP518",
    },
    ("fanuc", "G54.1 X1."): {
        "why": "G54.1 needs a P word with the number of the work offset", "code": "OLP516",
    },
    ("haas", "G154 X1."): {
        "why": "G154 needs a P word with the number of the work offset", "code": "OLP516",
    },
}  # fmt: skip


@pytest.mark.parametrize(("control", "text"), REFUSED)
def test_what_changes_offsets_and_tools_is_refused_in_these_words(
    control: str, text: str, setups: dict[str, Setup]
) -> None:
    assert refusal(f"{HEAD}{text}\nM2\n", setups[control], control) == {"line": 3} | REFUSED[control, text]


@pytest.mark.parametrize(
    "text", ["G10 L2 P2 X1", "G92 X1", "G28 X1", "G30 X1", "G53 G0 X1", "G52 X1", "G55", "G59.3"]
)
def test_offsets_are_refused_in_cutter_compensation(text: str, setups: dict[str, Setup]) -> None:
    before = f"{HEAD}G41 D1\n"
    said = refusal(f"{before}{text}\nM2\n", setups["linuxcnc"])
    assert said == {"line": 4, "why": CUTTING, "code": "OLP518"}
    said = refusal(f"{before}G81 X5 Z1 R2\nM2\n", setups["linuxcnc"])
    assert said["why"] == "the cycle G81 is in cutter compensation; give G40 before it"
    program(f"{before}G40\n{text}\nM2\n", setups["linuxcnc"])
    program(f"{before}G4 P1\nM8\nM2\n", setups["linuxcnc"])


@pytest.mark.parametrize(
    ("control", "text"),
    [
        # what looks like these and is good
        ("linuxcnc", "T1 M6 G43 H2"),
        ("linuxcnc", "T1 M6"),
        ("linuxcnc", "G4 P0"),
        ("fanuc", "G4 X1."),
        ("fanuc", "G4 P500"),
        ("fanuc", "G43 H1\nG20\nG55"),
        ("linuxcnc", "G43 H1\nG20\nG21\nG55"),
        ("linuxcnc", "G20\nG43 H1\nG55"),
        ("linuxcnc", "G43 H1\nG49\nG20\nG55"),
        ("linuxcnc", "G43 H1\nG20\nG61"),
        ("linuxcnc", "G10 L2 P1 X5 R0"),
        ("linuxcnc", "G10 L2 P0 X5"),
        ("linuxcnc", "G10 L2 P9 X5"),
        ("fanuc", "G10 L2 P6 X5."),
        ("linuxcnc", "M100\nG92.1"),
        ("linuxcnc", "G58\nG54"),
        ("fanuc", "M61 Q2"),
    ],
)  # fmt: skip
def test_what_is_alike_and_good_is_read(control: str, text: str, setups: dict[str, Setup]) -> None:
    program(f"{HEAD}{text}\nM2\n", setups[control], control)


#: Words beside a move, and which axes are unknown behind it.
MOVING = {
    "M100": "XYZ", "M6 T1": "XYZ", "M3.5": "XYZ", "M60": "XYZ", "M2.5": "XYZ", "M10": "XYZ",
    "M3 S1": "", "M8": "", "M61 Q1": "", "M50": "", "M66 P1 L0": "", "M0": "",
    "G28": "XYZ", "G28 Z5": "Z", "G30 X1 Y1": "XY", "G91 G28 Y0": "Y",
}  # fmt: skip


@pytest.mark.parametrize("text", MOVING)
def test_axes_that_the_control_moves_are_unknown(text: str, setups: dict[str, Setup]) -> None:
    path = program(f"{HEAD}{text}\nM2\n", setups["linuxcnc"]).toolpath
    unknown = "".join(a for a, v in zip("XYZ", path.end_mm[-1].tolist(), strict=True) if math.isnan(v))
    assert unknown == MOVING[text]
    if unknown:
        assert int(path.flag[-1]) == Flag.PASS | Flag.CONTROL
        assert path.line[-1] == 3
    via = text.startswith("G") and text != "G28"
    assert len(path) == 1 + bool(unknown) + via
    if via:
        assert int(path.flag[1]) & Flag.PASS
        assert not int(path.flag[1]) & Flag.CONTROL


def test_moves_of_the_control_lie_among_the_moves_that_are_resolved_with_them(
    setups: dict[str, Setup],
) -> None:
    """Two of them at one place, one under block delete, arcs behind each, and steps from where nothing is
    known."""
    text = (
        "G0 X1 Y1 Z1\nM100\nM100\nG0 X2 Y2 Z2\nG2 X4 I1\nG1 X3 F1\n/M100\nY7\n"
        "G91 X1\nX1 Y1 Z1\nG90 X5 Y5 Z5\nM100\nG0 X1 Y1 Z1\nG3 X3 Y1 I1\nM100\nM2\n"
    )
    path = program(f"G21 G17 G90 G53 G0 X0 Y0 Z0\n{text}", setups["linuxcnc"]).toolpath
    own = np.flatnonzero((path.flag & Flag.CONTROL) > 0).tolist()
    assert own == [2, 3, 7, 12, 15]
    assert np.isnan(path.end_mm[own]).all()
    assert [bool(path.flag[i] & Flag.DELETED) for i in own] == [False, False, True, False, False]
    assert path.line[own].tolist() == [3, 4, 8, 13, 16]
    assert path.arcs.move.tolist() == [5, 14]
    zero = path.end_mm[1] - 1
    assert (path.end_mm[5] - zero).tolist() == [4, 2, 2]
    assert (path.end_mm[6] - zero).tolist() == [3, 2, 2]
    known = [np.isfinite(path.end_mm[i]).tolist() for i in (8, 9, 10, 11)]
    assert known == [[False, True, False], [False, True, False], [False, True, False], [True, True, True]]


def test_the_job_states_where_the_axes_and_which_tool_are_at_the_start(
    setups: dict[str, Setup], tmp_path: Path
) -> None:
    setup = setups["linuxcnc"]
    at = replace(
        setup,
        job=replace(setup.job, start_mm=(1.0, None, 3.0), payload_kg=7.0),
        machine=replace(setup.machine, default_tool=2, length_active=True, default_work_offset="G55"),
    )
    read = program("G21 G0 X5\nM2\n", at)
    assert read.toolpath.start_mm[0] == 1.0
    assert read.toolpath.start_mm[2] == 3.0
    assert math.isnan(read.toolpath.start_mm[1])
    assert read.toolpath.end_mm[0, 0] == 10 + 1 + 5
    assert read.toolpath.end_mm[0, 2] == 3.0
    one = frame(read)
    assert (one.tool, one.length_mm, one.payload_kg) == (2, (1.0, 2.0, 60.0), 7.0)
    fanuc = replace(
        setups["fanuc"], machine=replace(setups["fanuc"].machine, default_tool=2, length_active=True)
    )
    assert refusal("G0 Z1.\nH3\n", fanuc, "fanuc")["code"] == "OLP518"
    without = replace(at, machine=replace(at.machine, length_active=False))
    two = frame(program("G21 G0 X5\nM2\n", without))
    assert (two.tool, two.length_mm, two.offset_mm) == (2, (0.0, 0.0, 0.0), (10.0, 20.0, 30.0))
    unknown = replace(at, machine=replace(at.machine, default_tool=9))
    assert refusal("G0 X1\n", unknown) == {
        "line": 1,
        "why": "the tool in the spindle at the start uses tool 9, which is not defined; give [tools.9] in "
        "the machine or job file",
        "code": "OLP521",
        "missing": ("tools", "9"),
    }
