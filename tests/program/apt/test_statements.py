"""Statements of cutter-location data by hand: units, tools, axes, homes, cycles, feeds and rests."""

from __future__ import annotations

import math

import numpy as np
import pytest
from cases.acceptance import machine

from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.core.toolpath import Flag, Kind
from olp.files.config import load_setup
from olp.program.program import Program
from olp.program.registry import DIALECTS, Options, read

TABLES = (
    '[work_offsets.G54]\nset_by = "true"\nX_mm = 100.0\n[work_offsets.CSYS2]\nset_by = "true"\nX_mm = 500.0\n'
    "[tools.3]\nZ_mm = 30.0\ngauge_to_tip_mm = [0.0, 0.0, -30.0]\n"
)
NAN = math.nan


@pytest.fixture(scope="module")
def setup(tmp_path_factory: pytest.TempPathFactory) -> Setup:
    return load_setup(machine(tmp_path_factory.mktemp("apt"), tables=TABLES))


def program(text: str, setup: Setup, head: str = "UNITS/MM\n", **options: bool) -> Program:
    return read((head + text).encode(), setup, DIALECTS["apt"], Options(**options))


def x_of(text: str, setup: Setup) -> list[float | None]:
    """Axis X behind each move, None where it is unknown."""
    return [None if math.isnan(x) else x for x in program(text, setup).toolpath.end_mm[:, 0].tolist()]


def refused(text: str, setup: Setup, words: str, **options: bool) -> int | None:
    with pytest.raises(ProgramError, match=words) as caught:
        program(text, setup, **options)
    return caught.value.line


@pytest.mark.parametrize(
    ("unit", "x_mm"),
    [("MM", 102.0), ("INCH", 150.8), ("INCHES", 150.8), ("IN", 150.8)],
)
def test_units(unit: str, x_mm: float, setup: Setup) -> None:
    assert x_of(f"UNITS/{unit}\nGOTO/2,0,0\n", setup) == [pytest.approx(x_mm)]
    assert refused("GOTO/1,0,0\nUNITS/CM\n", setup, "expected MM or INCH") == 3


def test_units_change_what_comes_behind_them(setup: Setup) -> None:
    assert x_of("GOTO/2,0,0\nUNITS/INCH\nGOTO/2,0,0\n", setup) == [102.0, pytest.approx(150.8)]


@pytest.mark.parametrize("word", ("LOADTL/3", "LOAD/TOOL,3", "TOOLNO/3", "TURRET/3", "LOADTL/3.0,ADJUST,9"))
def test_a_tool_brings_its_length_and_moves_the_axes_somewhere(word: str, setup: Setup) -> None:
    path = program(f"GOTO/1,2,3\n{word}\nGOTO/1,2,3\n", setup).toolpath
    assert path.end_mm[:, 2].tolist()[::2] == [3.0, 33.0]
    assert np.isnan(path.end_mm[1]).all()
    assert int(path.flag[1]) & Flag.CONTROL and path.kind[1] == Kind.RAPID
    assert path.frames[int(path.frame[2])].tool == 3


def test_a_tool_at_the_start_is_no_move(setup: Setup) -> None:
    path = program("LOADTL/3\nGOTO/1,2,3\n", setup).toolpath
    assert path.end_mm.tolist() == [[101.0, 2.0, 33.0]]
    for text in ("LOADTL/3.5\n", "LOADTL\n", "LOAD/TOOL\n", "LOADTL/A\n"):
        assert refused(text, setup, "needs the number of a tool") == 2
    assert refused("GOTO/1,2,3\nLOADTL/4\n", setup, "4") == 3


def test_home_is_where_the_program_comes_from(setup: Setup) -> None:
    path = program("FROM/1,2,3\nGOTO/4,5,6\nGOHOME\nGOTO/7,8,9\n", setup).toolpath
    assert list(path.start_mm) == [101.0, 2.0, 3.0]
    assert path.end_mm[:, 0].tolist() == [104.0, 101.0, 107.0]
    assert path.kind[1] == Kind.RAPID and int(path.flag[1]) & Flag.PASS
    assert x_of("GOTO/4,5,6\nGOHOME\nGOTO/7,8,9\n", setup) == [104.0, None, 107.0]
    # a second one is a move
    assert x_of("FROM/1,2,3\nGOTO/4,5,6\nFROM/2,2,3\nGOHOME\n", setup) == [104.0, 102.0, 102.0]
    assert refused("FROM/1,2\n", setup, "FROM needs three numbers") == 2


@pytest.mark.parametrize("word", ("RETRCT", "GOCLER"))
def test_after_a_retract_no_position_is_known(word: str, setup: Setup) -> None:
    assert x_of(f"GOTO/4,5,6\n{word}\nGOTO/7,8,9\n", setup) == [104.0, None, 107.0]


def test_a_second_coordinate_system_has_an_offset_of_its_own(setup: Setup) -> None:
    moved = "1,0,0,5,0,1,0,0,0,0,1,0"
    same = "1,0,0,0,0,1,0,0,0,0,1,0"
    assert x_of(f"GOTO/1,0,0\nCSYS/{moved}\nGOTO/1,0,0\nCSYS/{same}\nGOTO/1,0,0\n", setup) == [
        101.0,
        501.0,
        101.0,
    ]
    assert x_of("GOTO/1,0,0\nCSYS/0,0,0,1,0,0,0,1,0\nGOTO/1,0,0\n", setup) == [101.0, 101.0]
    assert x_of("GOTO/1,0,0\nORIGIN/5,0,0\nGOTO/1,0,0\nORIGIN/NOMORE\nGOTO/1,0,0\n", setup) == [
        101.0,
        501.0,
        101.0,
    ]
    assert refused("CSYS/PART\n", setup, "given by the name PART; expected its numbers") == 2


def test_a_transform_of_the_processor_is_refused_unless_it_ends(setup: Setup) -> None:
    for ending in ("TRACUT\n", "TRACUT/NOMORE\n", "TRACUT/OFF\n"):
        assert x_of(ending + "GOTO/1,0,0\n", setup) == [101.0]
    assert refused("TRACUT/MATRIX1\n", setup, "transforms points in the APT processor") == 2


def test_the_axis_of_the_tool_is_a_direction(setup: Setup) -> None:
    assert x_of("TLAXIS/0,0,1\nGOTO/1,0,0\n", setup) == [101.0]
    assert x_of("TLAXIS/0,0.6,0.8\nGOTO/1,0,0\n", setup) == [101.0]
    assert refused("TLAXIS/0,0,2\n", setup, "TLAXIS has length 2; expected a direction of length 1") == 2
    assert refused("TLAXIS/0,1\n", setup, "three numbers only") == 2
    assert refused("GOTO/0,0,0,0,0,2\n", setup, "the tool axis has length 2") == 2


@pytest.mark.parametrize(
    ("cycle", "z"),
    [
        ("DRILL,DEPTH,8,CLEAR,2", [2.0, -8.0, 2.0]),
        ("DRILL,FEDTO,8,RAPTO,2", [2.0, -8.0, 2.0]),
        ("DRILL,DEPTH,-8,CLEAR,-2,RTRCTO,5", [2.0, -8.0, 5.0]),
        ("DRILL,FEDTO,8,CLEAR,2,RETURN,7", [2.0, -8.0, 7.0]),
        ("DRILL,CLEAR,2", [2.0]),
        ("DRILL", [0.0]),
    ],
)
def test_a_cycle_makes_strokes_at_each_point(cycle: str, z: list[float], setup: Setup) -> None:
    path = program(f"CYCLE/{cycle}\nGOTO/1,0,0\nGOTO/4,0,0\nCYCLE/OFF\n", setup).toolpath
    assert path.end_mm[:, 2].tolist() == z * 2
    assert path.end_mm[:, 0].tolist() == [101.0] * len(z) + [104.0] * len(z)
    kinds = [Kind.RAPID, Kind.LINE, Kind.RAPID][: len(z)]
    assert path.kind.tolist() == kinds * 2


def test_a_cycle_ends_and_comes_again(setup: Setup) -> None:
    text = "CYCLE/DRILL,DEPTH,8,CLEAR,2\nGOTO/1,0,0\nCYCLE/OFF\nGOTO/2,0,0\nCYCLE/ON\nGOTO/3,0,0\n"
    assert x_of(text, setup) == [101.0] * 3 + [102.0] + [103.0] * 3


def feeds(text: str, setup: Setup) -> list[float]:
    """mm/min of the moves, as the statements say."""
    statements = program(text, setup).statements
    assert statements is not None
    return (60.0 * statements.feed_mm_s).tolist()


@pytest.mark.parametrize(
    ("feed", "mm_min"),
    [
        ("FEDRAT/120", 120.0), ("FEDRAT/120,MMPM", 120.0), ("FEDRAT/MMPM,120", 120.0),
        ("FEDRAT/10,IPM", 254.0), ("FEDRAT/120.5,PERMIN", 120.5),
        ("SPINDL/600,RPM\nFEDRAT/.5,MMPR", 300.0), ("SPINDL/600,RPM\nFEDRAT/.1,IPR", 1524.0),
        ("SPINDL/RPM,600,CCLW\nFEDRAT/.5,PERREV", 300.0), ("SPINDL/-600\nFEDRAT/.5,PERREV", 300.0),
    ],
)  # fmt: skip
def test_feeds_have_units(feed: str, mm_min: float, setup: Setup) -> None:
    assert feeds(f"{feed}\nGOTO/1,0,0\n", setup) == pytest.approx([mm_min])


def test_feeds_per_turn_need_turns(setup: Setup) -> None:
    assert np.isnan(feeds("FEDRAT/.5,MMPR\nGOTO/1,0,0\n", setup)).all()
    assert np.isnan(feeds("FEDRAT/.5,INVERS\nGOTO/1,0,0\n", setup)).all()
    inch = "UNITS/INCH\nFEDRAT/10,PERMIN\nGOTO/1,0,0\nFEDRAT/10\nGOTO/2,0,0\n"
    assert feeds(inch, setup) == pytest.approx([254.0, 254.0])


def test_a_feed_of_a_cycle_is_in_the_unit_of_the_program(setup: Setup) -> None:
    cycle = "UNITS/{}\nFEDRAT/100\nCYCLE/DRILL,DEPTH,.5,CLEAR,.1,PERMIN,10\nGOTO/1,0,0\nCYCLE/OFF\n"
    for unit, feed in (("MM", 10.0), ("INCH", 254.0)):
        assert feeds(cycle.format(unit), setup)[1] == pytest.approx(feed)


def test_a_cycle_has_its_own_feed(setup: Setup) -> None:
    text = "FEDRAT/100\nGOTO/0,0,0\nCYCLE/DRILL,DEPTH,8,CLEAR,2,{}\nGOTO/1,0,0\nCYCLE/OFF\nGOTO/2,0,0\n"
    for words, feed in (("MMPM,50", 50.0), ("IPM,2", 50.8)):
        got = feeds(text.format(words), setup)
        assert [got[0], got[2], got[4]] == pytest.approx([100.0, feed, 100.0])


@pytest.mark.parametrize(
    ("word", "rest", "seconds"),
    [
        ("DELAY/2.5", True, 2.5), ("DELAY/-1", True, 0.0), ("SPINDL/600,RPM\nDELAY/5,REV", True, 0.5),
        ("DELAY/5,REV", True, 0.0), ("STOP", True, 0.0), ("OPSTOP", True, 0.0), ("SPINDL/ON", True, 0.0),
        ("COOLNT/ON", False, 0.0),
    ],
)  # fmt: skip
def test_rests(word: str, rest: bool, seconds: float, setup: Setup) -> None:
    statements = program(f"FEDRAT/100\nGOTO/1,0,0\n{word}\nGOTO/2,0,0\n", setup).statements
    assert statements is not None
    assert bool(statements.rest[1]) is rest
    assert statements.dwell_s.tolist() == pytest.approx([0.0, seconds, 0.0])


def test_a_delay_has_a_time(setup: Setup) -> None:
    assert refused("GOTO/1,0,0\nDELAY/REV\n", setup, "DELAY needs a number of seconds") == 3


@pytest.mark.parametrize("side", ("LEFT", "RIGHT", "ON"))
def test_cutter_compensation_is_a_contour_or_refused(side: str, setup: Setup) -> None:
    text = f"GOTO/0,0,0\nCUTCOM/{side}\nGOTO/9,0,0\nCUTCOM/OFF\nGOTO/9,9,0\n"
    assert refused(text, setup, "makes the path inside the control") == 3
    path = program(text, setup, contour=True).toolpath
    kept = [path.frames[int(k)].compensation for k in path.frame]
    assert [c if c is None else c.left for c in kept] == [
        None,
        None if side == "ON" else side == "LEFT",
        None,
    ]


def test_a_distance_adds_to_the_point_before_it(setup: Setup) -> None:
    text = "GOTO/1,2,3\nGODLTA/1,0,0\nGODLTA/-4.5\nGOTO/0,0,0\nGODLTA/0,1,0\n"
    assert program(text, setup).toolpath.end_mm.tolist() == [
        [101.0, 2.0, 3.0], [102.0, 2.0, 3.0], [102.0, 2.0, -1.5], [100.0, 0.0, 0.0], [100.0, 1.0, 0.0]
    ]  # fmt: skip
    assert (
        refused("TLAXIS/0,.6,.8\nGOTO/1,2,3\nGODLTA/1\n", setup, "goes along the tool axis, which is tilted")
        == 4
    )


def test_fini_ends_the_program(setup: Setup) -> None:
    done = program("GOTO/1,0,0\nFINI\n", setup)
    assert done.end_line == 3


def test_two_arcs_need_a_point_between_them(setup: Setup) -> None:
    text = "GOTO/10,0,0\nCIRCLE/0,0,0,0,0,1,10\nCIRCLE/0,0,0,0,0,1,10\nGOTO/0,10,0\n"
    assert refused(text, setup, "an arc follows an arc without a GOTO") == 4
