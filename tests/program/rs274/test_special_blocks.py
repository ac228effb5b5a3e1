"""Blocks that are more than a motion, by hand: where the axes are behind them, or why they are refused."""

from __future__ import annotations

import functools
import math
from dataclasses import replace

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine
from cases.blocks import moves

from olp.core.errors import ProgramError
from olp.core.machine import Setup, Tool, WorkOffset
from olp.core.toolpath import Flag, Kind, Toolpath
from olp.files.config import load_setup
from olp.program.registry import DIALECTS, read
from olp.program.rs274 import reader
from olp.program.rs274.lexer import chunks

START = "G21 G90 G17 G54\nG0 X1 Y2 Z3\n"


@pytest.fixture(scope="module")
def setup(tmp_path_factory: pytest.TempPathFactory) -> Setup:
    offsets = "X_mm = 100.0\nY_mm = 200.0\nZ_mm = 300.0\n"
    return load_setup(machine(tmp_path_factory.mktemp("m"), tables=TRUE_ZERO + offsets))


def path(text: str, setup: Setup) -> Toolpath:
    return read((START + text).encode(), setup, DIALECTS["linuxcnc"]).toolpath


def ends(text: str, setup: Setup) -> list[list[float | None]]:
    """Axis positions behind the moves of a text, None where unknown; without the move of the start."""
    return [[None if math.isnan(v) else v for v in row] for row in path(text, setup).end_mm[1:].tolist()]


def refused(text: str, setup: Setup) -> str:
    with pytest.raises(ProgramError) as caught:
        path(text, setup)
    assert caught.value.line == 3
    return str(caught.value)


def test_a_thread_is_a_straight_move_that_is_never_split(setup: Setup) -> None:
    read_path = path("M3 S9 G33 X5 Z-4 K1\nZ-6 K1.5\nG0 Z9\n", setup)
    assert read_path.kind[1:].tolist() == [Kind.LINE, Kind.LINE, Kind.RAPID]
    assert read_path.end_mm[1:].tolist() == [[105, 202, 296], [105, 202, 294], [105, 202, 309]]
    assert ((read_path.flag & Flag.WHOLE) != 0).tolist() == [False, True, True, False]


def test_a_thread_needs_its_lead(setup: Setup) -> None:
    assert "G33 needs K" in refused("M3 S9 G33 Z-4\n", setup)
    assert "turning spindle" in refused("G33 Z-4 K1\n", setup)
    assert "turning spindle" in refused("M5 G33 Z-4 K1\n", setup)


@pytest.mark.parametrize(("code", "kind"), [("G0", Kind.RAPID), ("G1", Kind.LINE)])
def test_g53_takes_axis_positions(code: str, kind: Kind, setup: Setup) -> None:
    text = f"F60\nG53 {code} X7\nG0 Y5\n"
    assert ends(text, setup) == [[7.0, 202.0, 303.0], [7.0, 205.0, 303.0]]
    moves = path(text, setup)
    assert moves.kind[1] == kind
    flags = int(moves.flag[1])
    assert flags & Flag.MACHINE and flags & Flag.PASS
    assert not int(moves.flag[2]) & Flag.MACHINE


def test_g53_is_refused_in_g91_and_with_other_motion(setup: Setup) -> None:
    assert "G53 takes axis positions, and the block is in G91" in refused("G91 G53 G0 X7\n", setup)
    assert "G53 takes G0 or G1 only" in refused("G53 G2 X7 I3 F60\n", setup)


def test_g53_before_any_motion_code_takes_the_stated_one(setup: Setup) -> None:
    stated = 'or motion = "G0" or "G1" in [job_defaults] of the machine file'
    # behind a code the start is past
    for before, helps in (("", True), ("G80\n", False)):
        with pytest.raises(ProgramError, match="G53 takes G0 or G1 only") as caught:
            read(f"G21 G90\n{before}G53 X7\n".encode(), setup, DIALECTS["linuxcnc"])
        assert (stated in str(caught.value)) is helps
    told = replace(setup, machine=replace(setup.machine, default_motion="G0"))
    assert read(b"G21 G90\nG53 X7\n", told, DIALECTS["linuxcnc"]).toolpath.kind.tolist() == [Kind.RAPID]


def test_g28_goes_to_its_point_and_then_where_the_machine_has_it(setup: Setup) -> None:
    assert ends("G28 Z9\n", setup) == [[101.0, 202.0, 309.0], [101.0, 202.0, None]]
    assert ends("G91 G28 Z9\n", setup)[0] == [101.0, 202.0, 312.0]


def test_a_probe_may_stop_anywhere_on_its_path(setup: Setup) -> None:
    text = "G38.2 Z-5 F60\nG0 Z9\n"
    assert ends(text, setup) == [[101.0, 202.0, 295.0], [101.0, 202.0, None], [101.0, 202.0, 309.0]]
    assert path(text, setup).kind[1] == Kind.PROBE


@pytest.mark.parametrize(
    ("block", "holes"),
    [
        ("G90 G81 X11 Z-2 R1 F60", [(111.0, 202.0)]),
        ("G90 G81 X11 Z-2 R1 L3 F60", [(111.0, 202.0)] * 3),
        ("G91 G81 X10 Z-2 R-1 F60", [(111.0, 202.0)]),
        ("G91 G81 X10 Z-2 R-1 L3 F60", [(111.0, 202.0), (121.0, 202.0), (131.0, 202.0)]),
        ("G91 G81 Y-10 Z-2 R-1 L2 F60", [(101.0, 192.0), (101.0, 182.0)]),
    ],
)
def test_repeated_holes_step_in_g91_only_and_along_their_words_only(
    block: str, holes: list[tuple[float, float]], setup: Setup
) -> None:
    moves = path(block + "\nG80\n", setup)
    bottoms = moves.end_mm[moves.kind == Kind.LINE]
    assert [tuple(row) for row in bottoms[:, :2].tolist()] == holes
    z = 298.0 if "G90" in block else 300.0
    assert np.unique(bottoms[:, 2]).tolist() == [z]


def test_g98_is_the_level_before_and_g99_the_level_r(setup: Setup) -> None:
    # LinuxCNC begins in G99
    for code, z in (("G98", 303.0), ("G99", 301.0), ("", 301.0)):
        assert ends(f"{code} G81 X4 Z-2 R1 F60\nG80\n", setup)[-1] == [104.0, 202.0, z]


def test_g10_l20_makes_the_position_the_value_given(setup: Setup) -> None:
    """Axis X 101 becomes program X 30, so X31 is axis X 102; G54 has 71 then."""
    assert ends("G10 L20 P1 X30\nG0 X31\n", setup) == [[102.0, 202.0, 303.0]]
    assert ends("G92 X30\nG0 X31\n", setup) == [[102.0, 202.0, 303.0]]
    assert ends("G10 L2 P1 X30\nG0 X31\n", setup) == [[61.0, 202.0, 303.0]]


@pytest.mark.parametrize("p", ("0", "-1", "1.5"))
def test_turns_of_an_arc_are_an_integer_from_one(p: str, setup: Setup) -> None:
    assert "expected an integer from 1" in refused(f"G2 X1 Y2 I5 P{p} F60\n", setup)


PASS, DELETED, INCREMENTAL, CYCLE = Flag.PASS, Flag.DELETED, Flag.INCREMENTAL, Flag.CYCLE
MACHINE, CONTROL, NONE = Flag.MACHINE, Flag.CONTROL, Flag(0)
#: Blocks behind `START`: kind, flags and end of their moves, None where an axis is unknown.
FLAGS: dict[str, list[tuple[str, Flag, tuple[float | None, float | None, float | None]]]] = {
    "/G28 Z9": [
        ("RAPID", PASS | DELETED, (101, 202, 309)),
        ("RAPID", PASS | CONTROL | DELETED, (101, 202, None)),
    ],
    "G91 G28 Y1 Z0": [
        ("RAPID", PASS | INCREMENTAL, (101, 203, 303)),
        ("RAPID", PASS | CONTROL, (101, None, None)),
    ],
    "G28": [("RAPID", PASS | CONTROL, (None, None, None))],
    # another axis goes home alone
    "G1 X1 F60\nG91 G28 B0\nX2": [
        ("LINE", NONE, (101, 202, 303)),
        ("RAPID", PASS | INCREMENTAL, (101, 202, 303)),
        ("RAPID", PASS | CONTROL, (101, 202, 303)),
        ("LINE", INCREMENTAL, (103, 202, 303)),
    ],
    "G30 Z0 C0": [
        ("RAPID", PASS, (101, 202, 300)),
        ("RAPID", PASS | CONTROL, (101, 202, None)),
    ],
    "/G53 G0 X7": [("RAPID", PASS | MACHINE | DELETED, (7, 202, 303))],
    "G1 F60\nG53 X7 Z1": [("LINE", PASS | MACHINE, (7, 202, 1))],
    "G20\nG53 X2": [("RAPID", PASS | MACHINE, (50.8, 202, 303))],
    "G38.2 X5 Z3 F60": [
        ("PROBE", NONE, (105, 202, 303)),
        ("RAPID", PASS | CONTROL, (None, 202, 303)),
    ],
    "G91 G38.3 X0 Y-4 F60": [
        ("PROBE", INCREMENTAL, (101, 198, 303)),
        ("RAPID", PASS | CONTROL, (101, None, 303)),
    ],
    "G1 F60\nG38.2 Z1\n/Z0\nG0 X1 Y1 Z1": [
        ("PROBE", NONE, (101, 202, 301)),
        ("RAPID", PASS | CONTROL, (101, 202, None)),
        ("PROBE", DELETED, (101, 202, 300)),
        ("RAPID", PASS | CONTROL | DELETED, (101, 202, None)),
        ("RAPID", NONE, (101, 201, 301)),
    ],
    "G81 X2 Z1 R2\n/X3\n(olp off)\nX4": [
        ("RAPID", CYCLE, (102, 202, 303)),
        ("RAPID", CYCLE, (102, 202, 302)),
        ("LINE", CYCLE, (102, 202, 301)),
        ("RAPID", CYCLE, (102, 202, 302)),
        ("RAPID", CYCLE | DELETED, (103, 202, 302)),
        ("LINE", CYCLE | DELETED, (103, 202, 301)),
        ("RAPID", CYCLE | DELETED, (103, 202, 302)),
        ("RAPID", CYCLE | PASS, (104, 202, 302)),
        ("LINE", CYCLE | PASS, (104, 202, 301)),
        ("RAPID", CYCLE | PASS, (104, 202, 302)),
    ],
    # the block of a cycle sends the axes home first
    "G81 X2 Z1 R2\nG28 X3": [
        ("RAPID", CYCLE, (102, 202, 303)),
        ("RAPID", CYCLE, (102, 202, 302)),
        ("LINE", CYCLE, (102, 202, 301)),
        ("RAPID", CYCLE, (102, 202, 302)),
        ("RAPID", PASS, (103, 202, 302)),
        ("RAPID", PASS | CONTROL, (None, 202, 302)),
    ],
    "M6 T1\nG0 X5": [
        ("RAPID", PASS | CONTROL, (None, None, None)),
        ("RAPID", NONE, (105, None, None)),
    ],
    "/M100": [("RAPID", PASS | CONTROL | DELETED, (None, None, None))],
}  # fmt: skip


@pytest.fixture(scope="module")
def with_tool(setup: Setup) -> Setup:
    return replace(setup, machine=replace(setup.machine, tools={1: Tool(1)}))


@pytest.mark.parametrize("text", FLAGS)
def test_moves_of_the_control_have_their_flags(text: str, with_tool: Setup) -> None:
    read_ = read((START + text + "\nM2\n").encode(), with_tool, DIALECTS["linuxcnc"])
    assert [row[1:4] for row in moves(read_)[1:]] == FLAGS[text]
    assert read_.toolpath.frame[-1] == len(read_.toolpath.frames) - 1
    assert read_.slot[np.isnan(read_.toolpath.end_mm).all(axis=1)].max(initial=-1) == -1


@pytest.mark.parametrize("text", ["G28", "M100", "M6 T1"])
def test_where_the_program_starts_is_unknown_behind_a_move_of_the_control(
    text: str, with_tool: Setup
) -> None:
    known = replace(with_tool, job=replace(with_tool.job, start_mm=(1.0, 2.0, 3.0)))
    toolpath = read(f"G21 G90\n{text}\nG0 X5\nM2\n".encode(), known, DIALECTS["linuxcnc"]).toolpath
    assert np.isnan(toolpath.start_mm).all()
    assert toolpath.line.tolist() == [3]
    assert np.isnan(toolpath.end_mm[0]).tolist() == [False, True, True]
    plain = read(b"G21 G90\nG0 X5\nM2\n", known, DIALECTS["linuxcnc"]).toolpath
    assert plain.start_mm == (1.0, 2.0, 3.0)
    assert plain.end_mm[0].tolist() == [105.0, 2.0, 3.0]


def holes(text: str, setup: Setup, control: str = "linuxcnc") -> list[tuple[int, float, float, float]]:
    """Series, and the axis positions of the level before it, of R and of the depth, of each hole."""
    read_ = read((START + text + "\nM2\n").encode(), setup, DIALECTS[control])
    return [(h.series, h.initial_mm, h.r_mm, h.z_mm) for h in read_.holes]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        # words are inherited within a series
        (
            "G81 X2 Z1 R2\nX3\nX4 Z-1\nX5 R1",
            [(1, 303, 302, 301)] * 2 + [(1, 303, 302, 299), (1, 303, 301, 299)],
        ),
        # a move ends it, and so does G80, whatever comes between
        ("G98 G81 X2 Z1 R2\nG0 Z9\nG81 X3 Z1 R2", [(1, 303, 302, 301), (2, 309, 302, 301)]),
        ("G98 G81 X2 Z1 R2\nG80\nG81 X3 Z1 R2", [(1, 303, 302, 301), (2, 303, 302, 301)]),
        ("G81 X2 Z1 R2\nG80\nG81 X3 Z1 R2", [(1, 303, 302, 301), (2, 302, 302, 301)]),
        ("G81 X2 Z1 R2\n\nF60\nG82 X3 Z1 R2 P0", [(1, 303, 302, 301)] * 2),
        ("G81 X2 Z1 R2\nG80\n\nG0\nF60\nG81 X3 Z1 R2", [(1, 303, 302, 301), (2, 302, 302, 301)]),
        # incremental: R from the level before the series, the depth from R
        ("G91 G81 X2 Z-1 R-2", [(1, 303, 301, 300)]),
        # in inches, and with the tool axis along Y or X
        ("G20 G98 G81 X2 Z-1 R1", [(1, 303, 325.4, 274.6)]),
        ("G18 G81 X2 Z1 Y-3 R1", [(1, 202, 201, 197)]),
        ("G19 G81 X-2 Z1 R0", [(1, 101, 100, 98)]),
    ],
)
def test_levels_of_holes_count_from_their_series(
    text: str, expected: list[tuple[int, float, float, float]], setup: Setup
) -> None:
    got = holes(text, setup)
    assert [row[0] for row in got] == [row[0] for row in expected]
    assert np.array(got) == pytest.approx(np.array(expected), abs=1e-9)


def test_each_spot_of_a_program_may_end_a_chunk(setup: Setup, monkeypatch: pytest.MonkeyPatch) -> None:
    """Series of cycles, codes and positions go over from chunk to chunk, wherever these are cut."""
    text = START + (
        "G98 G81 X2 Z1 R2\nX3\nG80\nG0 Z5\nG81 X4 Z1 R2\n(a)\nX5 L2\nG91 G0 X1\nG90 G82 X6 Z1 R3 P1\nM8\n"
        "G99 X7\nG80\nG55\nG1 X1 F60\nG2 X3 I1\nX5 I1\nM2\n"
    )
    frames = {"G55": WorkOffset("G55", offset_mm=(1.0, 2.0, 3.0), set_by="true")}
    there = replace(setup, machine=replace(setup.machine, work_offsets=setup.machine.work_offsets | frames))
    whole = read(text.encode(), there, DIALECTS["linuxcnc"])
    assert [hole.series for hole in whole.holes] == [1, 1, 2, 2, 2, 3, 3]
    for size in (i for i, letter in enumerate(text) if letter == "\n"):
        monkeypatch.setattr(reader, "chunks", functools.partial(chunks, size=size))
        cut = read(text.encode(), there, DIALECTS["linuxcnc"])
        assert moves(cut) == moves(whole)
        assert list(cut.holes) == list(whole.holes)
        assert cut.toolpath.arcs.move.tolist() == whole.toolpath.arcs.move.tolist()
        assert cut.toolpath.arcs.centre_mm.tolist() == whole.toolpath.arcs.centre_mm.tolist()
        assert cut.arc_slots.word.tolist() == whole.arc_slots.word.tolist()


def test_rests_of_holes_are_dwells_and_reversals(setup: Setup) -> None:
    """How many moves of the hole come before each, and how long it is."""
    text = "M3 S100\nG84 X2 Z1 R2 P0.5\nG80\nG86 X3 Z1 R2 P2\nG80\nG89 X3 Z1 R2 P0\nG80\nG85 X4 Z1 R2\nG80\n"
    read_ = read((START + text + "M2\n").encode(), setup, DIALECTS["linuxcnc"])
    assert [hole.rests for hole in read_.holes] == [
        ((3, 0.0), (3, 0.0), (3, 0.5), (4, 0.0), (4, 0.0)),
        ((2, 2.0), (2, 0.0), (3, 0.0)),
        ((1, 0.0),),
        (),
    ]


#: blocks of a series that are refused, and what the refusal says
WRONG = {
    "X2 A5": "moves A too",
    "X3 L0": "zero repeats; give one",
    "X4 L20001": "makes 20001 holes",
    "X5 Z5": "has R 2 below the bottom 5",
    "X6 P-1": "negative dwell P -1",
}


@pytest.mark.parametrize("first", WRONG)
@pytest.mark.parametrize("second", WRONG)
def test_of_the_wrong_blocks_of_a_series_the_first_is_refused(first: str, second: str, setup: Setup) -> None:
    text = f"G82 X1 Z1 R2 P1\nX9\n{first}\nX8\n{second}\nM2\n"
    with pytest.raises(ProgramError, match=WRONG[first]) as caught:
        path(text, setup)
    assert caught.value.line == 5


def test_each_hole_begins_where_the_one_before_ended_however_many_there_are(setup: Setup) -> None:
    """The numbers of blocks of a series, in G90 and in G91, against a plain loop over them."""
    rng = np.random.default_rng(7)
    for absolute in (True, False):
        x = np.round(rng.uniform(-5, 5, 50), 3)
        y = np.where(rng.random(50) < 0.5, np.round(rng.uniform(-5, 5, 50), 3), np.nan)
        blocks = [f"X{a}" + ("" if math.isnan(b) else f" Y{b}") for a, b in zip(x, y, strict=True)]
        code = "G90" if absolute else "G91"
        text = f"{code} G99 G81 Z-1 R{2 if absolute else -1} {blocks[0]}\n" + "\n".join(blocks[1:])
        read_ = read((START + text + "\nG80\nM2\n").encode(), setup, DIALECTS["linuxcnc"])
        place = [1.0, 2.0]
        expected = []
        for a, b in zip(x.tolist(), y.tolist(), strict=True):
            place[0] = a if absolute else place[0] + a
            if not math.isnan(b):
                place[1] = b if absolute else place[1] + b
            expected.append((100 + place[0], 200 + place[1]))
        assert np.array([hole.place_mm for hole in read_.holes]) == pytest.approx(np.array(expected))
        assert [hole.last - hole.first for hole in read_.holes] == [4, *[3] * 49]
        assert {hole.r_mm for hole in read_.holes} == {302.0}


@pytest.mark.parametrize("block", ["G4 P1 T1 M6", "G4 P1\nT1 M6", "T1\nG64 P0.01\nM6\nG4 P1"])
def test_a_tool_changes_the_frame_whatever_else_its_block_does(block: str, with_tool: Setup) -> None:
    got = path(f"G0 X1 Y2 Z3\n{block}\nX2 Y2 Z3\n", with_tool)
    assert got.frames[got.frame[-1]].tool == 1
    assert got.frames[got.frame[0]].tool != 1


def test_what_changes_no_frame_makes_none(setup: Setup) -> None:
    got = path("G0 X1 Y2 Z3\nG4 P1\nX2\nG64 P0.01\nX3\nG53 G0 Z1\nX4 Y4 Z4\n", setup)
    assert len(got.frames) == 1
    assert got.line.tolist() == [2, 3, 5, 7, 8, 9]


@pytest.mark.parametrize("code", ["G92 Z0", "G10 L20 P1 Z0"])
def test_a_place_that_a_probe_has_touched_is_not_stored(code: str, setup: Setup) -> None:
    with pytest.raises(ProgramError, match="a probe has touched, which only the control knows") as caught:
        path(f"G38.2 Z-50 F60\n{code}\nG0 Z1\n", setup)
    assert caught.value.code == "OLP524"
    # X was not moved by it
    path(f"G38.2 Z-50 F60\n{code.replace('Z', 'X')}\nG0 Z1\n", setup)
