"""Frames, tools and touch-offs by hand: turns, tool vectors, errors of stored lengths, and what is "
"missing."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from olp.core.errors import ConfigError, ProgramError
from olp.core.machine import ZERO, Axis, Job, Machine, Setup, Tool, Vector, WorkOffset
from olp.core.toolpath import CutterCompensation, LengthError
from olp.program.frames import (
    FrameTable,
    length_errors_of,
    tool_vector_of,
    touch_of,
    touch_tool_of,
    turn_of,
    turned,
)

#: directions from tip to gauge point, in machine coordinates
UP: Vector = (0.0, 0.0, 1.0)
DOWN: Vector = (0.0, 0.0, -1.0)
AXES = {axis: Axis((-1000.0, 1000.0), 0.001, 100.0, 1000.0, 1e5) for axis in "XYZ"}
TRUE = WorkOffset("G54", (10.0, 20.0, 30.0), set_by="true")
TOUCH = WorkOffset("G55", (10.0, 20.0, 30.0), set_by="touch")


def setup_of(*tools: Tool, payload: float = 0.0, job_tools: tuple[Tool, ...] = (), **more: object) -> Setup:
    machine = Machine(
        "m", "FXYZ", "linuxcnc", AXES, work_offsets={"G54": TRUE, "G55": TOUCH},
        tools={tool.number: tool for tool in tools}, **more,  # type: ignore[arg-type]
    )  # fmt: skip
    return Setup(machine, Job(tools={tool.number: tool for tool in job_tools}, payload_kg=payload))


def length(number: int, z: float, **more: object) -> Tool:
    return Tool(number, (0.0, 0.0, z), **more)  # type: ignore[arg-type]


# -- turns ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("angles", "rows"),
    [
        ((90, 0, 0), [[1, 0, 0], [0, 0, -1], [0, 1, 0]]), ((0, 90, 0), [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]),
        ((0, 0, 90), [[0, -1, 0], [1, 0, 0], [0, 0, 1]]),
            # first about X, then about Y, then about Z
        ((90, 90, 90), [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]), ((90, 0, 90), [[0, 0, 1], [1, 0, 0], [0, 1, 0]]),
        ((0, 90, 90), [[0, -1, 0], [0, 0, 1], [-1, 0, 0]]), ((90, 90, 0), [[0, 1, 0], [0, 0, -1], [-1, 0,
         0]]),
    ],
)  # fmt: skip
def test_turns_about_one_axis_after_the_other(angles: Vector, rows: list[list[float]]) -> None:
    turn = turn_of(angles)
    assert turn is not None
    assert np.array(turn) == pytest.approx(np.array(rows, float), abs=1e-15)
    assert turned(turn, (1.0, 2.0, 3.0)) == pytest.approx(tuple(np.array(rows) @ [1.0, 2.0, 3.0]))


def test_a_turn_is_the_product_of_its_turns() -> None:
    a, b, c = (np.radians(angle) for angle in (17.0, -31.0, 53.0))
    about_x = [[1, 0, 0], [0, math.cos(a), -math.sin(a)], [0, math.sin(a), math.cos(a)]]
    about_y = [[math.cos(b), 0, math.sin(b)], [0, 1, 0], [-math.sin(b), 0, math.cos(b)]]
    about_z = [[math.cos(c), -math.sin(c), 0], [math.sin(c), math.cos(c), 0], [0, 0, 1]]
    want = np.array(about_z) @ np.array(about_y) @ np.array(about_x)
    assert np.array(turn_of((17.0, -31.0, 53.0))) == pytest.approx(want, abs=1e-15)


def test_no_turn_changes_nothing() -> None:
    assert turn_of(ZERO) is None
    assert turned(None, (1.0, 2.0, 3.0)) == (1.0, 2.0, 3.0)
    assert turn_of((0.0, 0.0, 1e-9)) is not None


# -- tools and touch-offs ------------------------------------------------------------------------------


def test_the_vector_of_a_tool() -> None:
    setup = setup_of(length(1, 50.0), length(2, -5.0), length(3, 0.0, gauge_to_tip_mm=(1.0, 2.0, -9.0)))
    assert tool_vector_of(setup, 1, 7) == (0.0, 0.0, -50.0)
    assert tool_vector_of(setup, 3, 7) == (1.0, 2.0, -9.0)
    for number, words in (
        (4, "tool 4 is in the spindle but not defined; give [tools.4] in the machine or job file"),
        (
            2,
            "tool 2 has Z_mm = -5, which is a touch-off value and not a length; give tools.2.gauge_to_tip_mm",
        ),
    ):
        with pytest.raises(ProgramError) as caught:
            tool_vector_of(setup, number, 7)
        assert (caught.value.line, caught.value.code) == (7, "OLP521")
        assert (caught.value.message, caught.value.missing) == (words, ("tools", str(number)))


def test_where_an_offset_was_touched() -> None:
    setup = setup_of(length(1, 50.0), length(2, -5.0))
    assert touch_of(setup, TRUE, 1) is None
    assert touch_of(setup, TOUCH, 1) == ((10.0, 20.0, 30.0), ZERO)
    with_tool = replace(TOUCH, touch_tool=1)
    # where it is not stated, at the offset with the length of the tool
    assert touch_of(setup, with_tool, 1) == ((10.0, 20.0, 80.0), (0.0, 0.0, -50.0))
    stated = replace(with_tool, touched_at_mm=(None, 7.0, 0.0))
    assert touch_of(setup, stated, 1) == ((10.0, 7.0, 0.0), (0.0, 0.0, -50.0))
    loaded = setup_of(length(1, 50.0), payload=3.0)
    assert touch_of(loaded, with_tool, 1) == ((10.0, 20.0, 80.0), (0.0, 0.0, -50.0, 3.0))
    assert touch_of(loaded, replace(TOUCH, touched_payload_kg=0.0), 1) == ((10.0, 20.0, 30.0), ZERO)
    assert touch_of(setup, replace(TOUCH, touched_payload_kg=4.0), 1) == ((10.0, 20.0, 30.0), (*ZERO, 4.0))
    for number in (2, 9):
        with pytest.raises(ProgramError, match=f"G55 was touched off with tool {number}, whose") as caught:
            touch_of(setup, replace(TOUCH, touch_tool=number), 7)
        assert (caught.value.line, caught.value.code) == (7, "OLP521")
        assert caught.value.missing == ("tools", str(number))


def test_the_tool_whose_length_is_in_an_offset() -> None:
    assert touch_tool_of(replace(TOUCH, touch_tool=3)) == 3
    assert touch_tool_of(replace(TRUE, touch_tool=3)) is None
    assert touch_tool_of(TOUCH) is None


# -- errors of stored lengths --------------------------------------------------------------------------

AT = (1.0, 2.0, 3.0)
#: set on the machine on one setter, on a presetter, true, and on a setter with a known constant
ON_MACHINE = length(1, 50.0, set_by="touch", touched_at_mm=AT)
ALSO = length(2, 60.0, set_by="touch", touched_at_mm=(4.0, 5.0, 6.0))
PRESET = length(3, 70.0, setter="presetter", constant_mm=0.02)
REAL = length(4, 80.0)
UNKNOWN = length(5, 90.0, setter="other")
ALL = (ON_MACHINE, ALSO, PRESET, REAL, UNKNOWN)
OWN = (AT, (0.0, 0.0, -50.0))
OTHER = ((4.0, 5.0, 6.0), (0.0, 0.0, -60.0))


@pytest.mark.parametrize(
    ("cutting", "touching", "want"),
    [
        (1, 1, ()), (4, None, ()), (4, 4, ()), (3, 3, ()),
        # one setter: its constant is in both lengths
        (1, 2, (LengthError(UP, OWN, 0.0), LengthError(DOWN, OTHER, 0.0))),
        (2, 1, (LengthError(UP, OTHER, 0.0), LengthError(DOWN, OWN, 0.0))),
        (3, None, (LengthError(UP, None, 0.02),)), (3, 4, (LengthError(UP, None, 0.02),)),
        (4, 3, (LengthError(DOWN, None, 0.02),)), (9, 3, (LengthError(DOWN, None, 0.02),)),
    ],
)  # fmt: skip
def test_errors_of_lengths(cutting: int, touching: int | None, want: tuple[LengthError, ...]) -> None:
    assert length_errors_of(setup_of(*ALL), cutting, touching) == want


def test_a_tilted_tool_has_its_error_along_itself() -> None:
    axis = (0.6, 0.0, 0.8)
    setup = setup_of(*ALL)
    assert length_errors_of(setup, 3, 3, axis) == (
        LengthError(axis, None, 0.02),
        LengthError(DOWN, None, 0.02),
    )
    assert length_errors_of(setup, 3, None, axis) == (LengthError(axis, None, 0.02),)
    assert length_errors_of(setup, 4, 4, axis) == ()


def test_the_payload_of_the_job_is_with_a_length_that_was_set() -> None:
    errors = length_errors_of(setup_of(*ALL, payload=3.0), 1, 2)
    assert [error.touched for error in errors] == [
        (AT, (0.0, 0.0, -50.0, 3.0)),
        (OTHER[0], (0.0, 0.0, -60.0, 3.0)),
    ]


@pytest.mark.parametrize(
    ("cutting", "touching", "axis", "words"),
    [
        (1, None, UP, "tools.1: the work offset was not touched off with a tool, and tool 1 cuts, so "
        "the constant of "
         "its setter counts and is not known; name the tool that touched in touch_tool of the work "
         "offset, or give "
         "tools.1.k_um, from a master of known length"),
        (1, 3, UP, "tools.1: tool 3 touched the work offset, and tool 1 with another setter cuts, so "
        "the constant of "
         "its setter counts and is not known; set both lengths on one setter, or give tools.1.k_um, "
         "from a master of "
         "known length"),
        (3, 5, UP, "tools.5: tool 5 touched the work offset, and tool 3 with another setter cuts, so "
        "the constant of "
         "its setter counts and is not known; set both lengths on one setter, or give tools.5.k_um, "
         "from a master of "
         "known length"),
        (1, 1, (0.6, 0.0, 0.8), "tools.1: tool 1 is tilted, and tool 1 touched the work offset along Z, "
        "so the "
         "constant of its setter counts and is not known; give tools.1.k_um, from a master of known length"),
    ],
)  # fmt: skip
def test_a_constant_that_counts_and_is_not_known(
    cutting: int, touching: int | None, axis: Vector, words: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        length_errors_of(setup_of(*ALL), cutting, touching, axis)
    assert caught.value.message == words


def test_one_tool_states_the_constant_of_its_setter() -> None:
    other = length(6, 40.0, setter="other", constant_mm=0.05)
    for setup in (setup_of(*ALL, other), setup_of(*ALL, job_tools=(other,))):
        assert length_errors_of(setup, 5, None) == (LengthError(UP, None, 0.05),)
    # tools that name no setter are of one
    unnamed = length(7, 40.0, constant_mm=0.03)
    errors = length_errors_of(setup_of(*ALL, unnamed), 1, None)
    assert errors == (LengthError(UP, OWN, 0.03),)
    clash = length(8, 40.0, setter="other", constant_mm=0.06)
    with pytest.raises(ConfigError) as caught:
        length_errors_of(setup_of(*ALL, clash, other), 5, None)
    assert caught.value.message == (
        "tools.6.k_um = 50 and tools.8.k_um = 60 are of one setter; expected one constant, or the key "
        "setter in both"
    )


def test_a_length_relative_to_another_tool_has_no_error_of_its_own() -> None:
    for z in (-5.0, 0.0):
        relative = length(6, z, set_by="touch", touched_at_mm=AT)
        with pytest.raises(ConfigError) as caught:
            length_errors_of(setup_of(relative, ALSO), 6, 2)
        assert caught.value.message == (
            f"tools.6.Z_mm = {z:g} is relative to another tool and no length; give tools.6.gauge_to_tip_mm"
        )
        known = replace(relative, gauge_to_tip_mm=(0.0, 0.0, -40.0))
        errors = length_errors_of(setup_of(known, ALSO), 6, 2)
        assert errors[0] == LengthError(UP, (AT, (0.0, 0.0, -40.0)), 0.0)
    # a touch whose position is not stated counts with its constant alone
    unstated = length(6, 40.0, set_by="touch", constant_mm=0.01)
    assert length_errors_of(setup_of(unstated), 6, None) == (LengthError(UP, None, 0.01),)


# -- the table of frames -------------------------------------------------------------------------------


def test_frames_are_made_once() -> None:
    table = FrameTable(setup_of(*ALL))
    tool = {"tool": 4, "length": (0.0, 0.0, 80.0), "tool_vector": (0.0, 0.0, -80.0)}
    assert table.index(TRUE, 1, unit_mm=1.0) == 0
    assert table.index(TRUE, 1, unit_mm=25.4, **tool) == 1  # type: ignore[arg-type]
    assert table.index(TRUE, 9, unit_mm=1.0) == 0
    assert table.index(TOUCH, 9, unit_mm=1.0) == 2
    assert table.lifted(1, (0.0, 1.0, 2.0)) == 3
    assert table.lifted(1, ZERO) == 1
    assert table.lifted(1, (0.0, 1.0, 2.0)) == 3
    plain, inch, touched, lifted = table.frames
    assert (plain.offset_mm, plain.unit_mm, plain.tool, plain.work_offset) == (
        (10.0, 20.0, 30.0),
        1.0,
        None,
        "G54",
    )
    assert (inch.offset_mm, inch.unit_mm, inch.tool) == ((10.0, 20.0, 110.0), 25.4, 4)
    assert (inch.length_mm, inch.tool_mm) == ((0.0, 0.0, 80.0), (0.0, 0.0, -80.0))
    assert (plain.touched, touched.touched) == (None, ((10.0, 20.0, 30.0), ZERO))
    assert (lifted.offset_mm, lifted.lift_mm) == ((10.0, 21.0, 112.0), (0.0, 1.0, 2.0))
    assert lifted.origin_mm() == inch.origin_mm() == (10.0, 20.0, 30.0)


def test_a_frame_has_its_turn_its_payload_and_its_compensation() -> None:
    table = FrameTable(setup_of(payload=3.0))
    left = CutterCompensation(0, True)
    table.index(replace(TRUE, rotation_deg=(0.0, 0.0, 90.0)), 1, unit_mm=1.0, compensation=left)
    (frame,) = table.frames
    assert (frame.payload_kg, frame.compensation) == (3.0, left)
    assert np.array(frame.turn) == pytest.approx(np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]), abs=1e-15)


def test_lengths_count_where_they_are_active() -> None:
    table = FrameTable(setup_of(*ALL))
    for active, tool, lengths in (
        (True, 3, (LengthError(UP, None, 0.02),)),
        (False, 3, ()),
        (True, None, ()),
    ):
        number = table.index(TRUE, 1, unit_mm=1.0, tool=tool, length_active=active)
        assert table.frames[number].lengths == lengths
    # the offset was touched with the tool that cuts
    own = replace(TOUCH, touch_tool=3)
    assert table.frames[table.index(own, 1, unit_mm=1.0, tool=3, length_active=True)].lengths == ()


def test_a_tool_along_another_axis_has_its_length_there() -> None:
    table = FrameTable(setup_of(*ALL))
    axis = (0.6, 0.0, 0.8)
    tool = {"tool": 4, "length": (0.0, 0.0, 80.0), "tool_vector": (0.0, 0.0, -80.0), "axis": axis}
    frame = table.frames[table.index(TRUE, 1, unit_mm=1.0, **tool)]  # type: ignore[arg-type]
    assert frame.offset_mm == pytest.approx((58.0, 20.0, 94.0))
    assert frame.length_mm == pytest.approx((48.0, 0.0, 64.0))
    assert frame.tool_mm == pytest.approx((-48.0, 0.0, -64.0))
    for vector in ((1.0, 0.0, -80.0), (0.0, 1.0, -80.0)):
        with pytest.raises(ProgramError, match="tool 4 is tilted and its vector has X or Y") as caught:
            table.index(TRUE, 7, unit_mm=1.0, tool=4, tool_vector=vector, axis=axis)
        assert (caught.value.line, caught.value.code) == (7, "OLP523")
        # along Z nothing is turned
        assert table.index(TRUE, 7, unit_mm=1.0, tool=4, tool_vector=vector) > 0


def test_a_frame_that_is_not_defined() -> None:
    table = FrameTable(setup_of())
    assert table.work_offset("G55", 7, "this") is TOUCH
    with pytest.raises(ProgramError) as caught:
        table.work_offset("G57", 7, "this position")
    assert caught.value.message == (
        "this position needs the frame G57, which is not defined; give [work_offsets.G57] in the job "
        "file: X_mm, "
        "Y_mm, Z_mm and, where it is turned, A_deg, B_deg, C_deg"
    )
    assert (caught.value.line, caught.value.code) == (7, "OLP520")
    assert caught.value.missing == ("work_offsets", "G57")
