"""Statements of cutter-location data by hand: units, tools, axes, homes, cycles, feeds and rests."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import machine
from cases.readings import feeds_of, said, text_of, word_of

from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.core.toolpath import CutterCompensation, Flag, Kind
from olp.files.config import load_setup
from olp.program.apt import reader
from olp.program.apt.table import TABLE
from olp.program.dialect import Support
from olp.program.program import Program
from olp.program.registry import DIALECTS, Options, read
from olp.program.text.statements import chunks

TABLES = (
    '[work_offsets.G54]\nset_by = "true"\nX_mm = 100.0\n[work_offsets.CSYS2]\nset_by = "true"\nX_mm = 500.0\n'
    "[tools.3]\nZ_mm = 30.0\ngauge_to_tip_mm = [0.0, 0.0, -30.0]\n"
)
TURNED = (
    '[work_offsets.G54]\nset_by = "true"\nX_mm = 100.0\nC_deg = 90.0\n'
    '[work_offsets.CSYS2]\nset_by = "true"\nA_deg = 90.0\n[tools.3]\nZ_mm = 30.0\n[tools.4]\nZ_mm = 40.0\n'
    '[job_defaults]\nwork_offset = "G54"\ntool = 4\nlength_active = {}\n'
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


def test_a_transform_without_numbers_is_refused_unless_it_ends(setup: Setup) -> None:
    assert x_of("TRACUT/NOMORE\nTRACUT/OFF\nTRACUT\nGOTO/1,0,0\n", setup) == [101.0]
    assert refused("TRACUT/MATRIX1\n", setup, "TRACUT does not state its transform in numbers") == 2


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
        ("SPINDL/240.0\nDELAY/2.5,REV", True, 0.625), ("DELAY/5,REV", True, 0.0), ("STOP", True, 0.0),
         ("OPSTOP", True, 0.0), ("SPINDL/ON", True, 0.0),
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
def test_points_under_cutter_compensation_keep_their_side(side: str, setup: Setup) -> None:
    text = f"GOTO/0,0,0\nCUTCOM/{side}\nGOTO/9,0,0\nCUTCOM/OFF\nGOTO/9,9,0\n"
    path = program(text, setup).toolpath
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


# -- refusals ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "line", "code", "words"),
    [
        ("UNITS/CM", 2, "OLP516", "UNITS names a unit that is not read"),
        ("UNITS", 2, "OLP516", "UNITS names a unit that is not read"),
        ("GOTO/10,0,0\nCIRCLE/0,0,0,0,0,1\nCIRCLE/0,0,0,0,0,1", 4, "OLP532", "an arc follows an arc"),
        ("LOADTL/3.5", 2, "OLP516", "LOADTL needs the number of a tool"),
        ("TURRET/3.05", 2, "OLP516", "TURRET needs the number of a tool"),
        ("TLAXIS/0,0,1,0", 2, "OLP516", "TLAXIS is read with three numbers only"),
        ("TLAXIS/0,A,1", 2, "OLP516", "TLAXIS is read with three numbers only"),
        ("TLAXIS/0,0,1.002", 2, "OLP516", r"TLAXIS has length 1\.002; expected"),
        ("TLAXIS/0,0,.998", 2, "OLP516", r"TLAXIS has length 0\.998; expected"),
        ("CSYS/PART", 2, "OLP523", "given by the name PART"),
        ("TRACUT/M1", 2, "OLP523", "TRACUT does not state its transform in numbers"),
        ("TRACUT/NOMORE,5", 2, "OLP523", "TRACUT does not state its transform in numbers"),
        ("TRACUT/1,0,0,0,1,0,0,0,1", 2, "OLP523", "expected 12 numbers of a matrix"),
        ("TRACUT/-1,0,0,0,0,1,0,0,0,0,1,0", 2, "OLP523", "the matrix of TRACUT mirrors"),
        ("TRACUT/2,0,0,0,0,2,0,0,0,0,2,0", 2, "OLP523", "the matrix of TRACUT scales or shears"),
        ("TRANS/1,2", 2, "OLP516", "TRANS is read with three numbers"),
        ("TRANS/1,2,A", 2, "OLP516", "TRANS is read with three numbers"),
        ("GOHOME/1,2,3\nFROM/1,2", 3, "OLP516", "FROM needs three numbers"),
        ("PREFUN/91", 2, "OLP512", "PREFUN/91 gives the control a G code"),
        ("PREFUN/ON", 2, "OLP512", "PREFUN without a number"),
        ("PREFUN/55", 2, "OLP523", "PREFUN/55 selects a work offset, and the job counts from G54"),
        ("AUXFUN/98", 2, "OLP512", "AUXFUN/98 is M98, which calls another program"),
        ("SET/HOLDER,SETOOL,0,0,100", 2, "OLP512", "SET/HOLDER puts a head between"),
        ("SET/LOCK,AAXIS,ON", 2, "OLP512", "SET/LOCK holds an axis"),
        ("SET/ADJUST,ON", 2, "OLP512", "SET/ADJUST is read as SET/MODE only"),
        ("SET", 2, "OLP512", "SET/nothing is read as SET/MODE only"),
        ("OPSKIP/ON\nGOTO/1,2,3", 3, "OLP525", "OPSKIP of line 2 is in force"),
        ("ROTATE/AAXIS,ATANGL,0.5", 2, "OLP512", "only an angle of 0 is read"),
        ("ROTATE/AAXIS", 2, "OLP512", "only an angle of 0 is read"),
        ("FROM/1,A,3", 2, "OLP516", "FROM needs three numbers"),
        ("DELAY/REV", 2, "OLP516", "DELAY needs a number"),
        ("INSERT/X1", 2, "OLP512", "INSERT gives the control a block"),
        ("RAPID/5", 2, "OLP510", "RAPID has words that are not read"),
        ("RAPID,5", 2, "OLP510", "RAPID has words that are not read"),
        ("A=COOLNT/ON", 2, "OLP512", "A = COOLNT is not read"),
        ("A=5", 2, "OLP512", "A = 5 is an assignment that is not read"),
        ("A=POINT/1,2,3", 2, "OLP512", "A = POINT defines geometry"),
        ("A=RAPID", 2, "OLP510", "RAPID has words that are not read"),
        ("GODLTA/1,2", 2, "OLP516", "GODLTA has 2 numbers; expected a distance along the tool axis, or "
        "three"),
        ("GODLTA/1,2,3,0,0,1", 2, "OLP516", "GODLTA has 6 numbers; expected a distance"),
        ("GODLTA/", 2, "OLP516", "GODLTA has 0 numbers"),
        ("GOTO/1,2", 2, "OLP516", "GOTO has 2 numbers; expected three, or six"),
        ("GOTO/1,2,3,4", 2, "OLP516", "GOTO has 4 numbers; expected three, or six"),
        ("GOTO/1,,3", 2, "OLP516", "GOTO names nothing where a number is expected"),
        ("GOTO/1,B,C", 2, "OLP516", "GOTO names B where a number is expected"),
        ("GOTO/0,0,0\nGOTO/0,0,0,0,0,1.002", 3, "OLP516", r"the tool axis has length 1\.002; expected"),
        ("GOTO/0,0,0,0,0,.998\nGOTO/0,0,0,0,0,1", 2, "OLP516", r"the tool axis has length 0\.998; expected"),
        ("CYCLE/DRILL\nGOTO/1,0,0\nCIRCLE/0,0,0,0,0,1\nGOTO/0,1,0", 5, "OLP518", "while a CYCLE is in force"),
        ("GOTO/1,0,0\nRAPID\nCIRCLE/0,0,0,0,0,1\nGOTO/0,1,0", 5, "OLP518", "an arc is at rapid"),
        ("GOTO/1,0,0\nCIRCLE/0,0,0,0,0,1\nGOTO/0,1,0,0,.6,.8", 4, "OLP518", "or its tool axis changes"),
        ("TLAXIS/0,.6,.8\nGOTO/1,2,3\nGODLTA/1,0,0\nGODLTA/1", 5, "OLP518", "GODLTA with one number"),
        ("ROTABL/90", 2, "OLP512", "ROTABL turns the part or the head"),
        ("MATRIX/A,1", 2, "OLP512", "MATRIX defines geometry"),
        ("FROBNICATE/1", 2, "OLP512", "FROBNICATE is not a statement that olp knows"),
    ],
)  # fmt: skip
def test_a_refusal_has_its_line_its_code_and_its_sentence(
    text: str, line: int, code: str, words: str, setup: Setup
) -> None:
    with pytest.raises(ProgramError, match=words) as caught:
        program(text + "\n", setup)
    assert (caught.value.line, caught.value.code) == (line, code)


@pytest.mark.parametrize("axis", ("0,0,1.0009", "0,0,.9991", "0,.6005,.8007", ".6005,0,.8007"))
def test_a_direction_that_is_rounded_has_length_1(axis: str, setup: Setup) -> None:
    """The tool is 30 mm long: its length along the axis is that of the direction of length 1."""
    tilt = np.array([float(n) for n in axis.split(",")])
    want = np.array([101.0, 2.0, 3.0]) + 30.0 * tilt / np.linalg.norm(tilt)
    for text in (f"LOADTL/3\nTLAXIS/{axis}\nGOTO/1,2,3\n", f"LOADTL/3\nGOTO/1,2,3,{axis}\n"):
        assert program(text, setup).toolpath.end_mm[0] == pytest.approx(want, abs=1e-12)


def test_refusals_of_the_table_are_named_together(setup: Setup) -> None:
    """Those that other statements may put right are not among them."""
    text = (
        "GOTO/1,2,3\nPOINT/1\nA=LINE/1\nUNITS/CM\nMACRO/1\nRAPID\nGOTO/1,2,3\nCOOLNT/ON\nPARTNO "
        "IF\nIF/1\nFINI\nDO/2\n"
    )
    with pytest.raises(ProgramError, match="POINT defines geometry") as caught:
        program(text, setup)
    others = caught.value.others
    assert [(e.line, e.code) for e in others] == [(6, "OLP512"), (11, "OLP512")]
    assert [str(e)[:12] for e in others] == ["6: MACRO bra", "11: IF branc"]
    with pytest.raises(ProgramError) as caught:
        program("GOTO/1,2\nMACRO/1\n", setup)
    assert caught.value.others == ()


@pytest.mark.parametrize(
    ("block", "moves"),
    [
        *((text, True) for text in (
            "G0 Z0", "g0z0", "X1", "Y=.5", "U-1", "V1", "W1", "A1", "B1", "C1", "M98", "M6", "M06 T1", "m 06",
            "P1000", "L5", "S500 P 1", "(TEXT) Z 1.", "N10 G 28",
        )),
        *((text, False) for text in (
            "M8", "M60", "M68", "F100 S5000", "T1", "(GO) M8", "M8 (X)", "Z-1 BELOW",
            "STOCK SIZE X350. Y150.",
            "G", "N10", "E5", "I1 J1", "", "O1",
        )),
    ],
)  # fmt: skip
def test_text_for_the_control_does_not_move(block: str, moves: bool, setup: Setup) -> None:
    for text in (f"INSERT/{block}\nGOTO/1,0,0\n", f" insert {block}\nGOTO/1,0,0\n"):
        if moves:
            assert refused(text, setup, "INSERT gives the control a block that may move the machine") == 2
        else:
            assert x_of(text, setup) == [101.0]


# -- tools, frames, axes -------------------------------------------------------------------------------


def turned(tmp_path_factory: pytest.TempPathFactory, active: str) -> Setup:
    keys = TURNED.format(active)
    return load_setup(machine(tmp_path_factory.mktemp("turned"), tables=keys))


@pytest.fixture(scope="module")
def turned_setup(tmp_path_factory: pytest.TempPathFactory) -> Setup:
    return turned(tmp_path_factory, "true")


def test_a_turned_frame_turns_points_homes_and_axes(turned_setup: Setup) -> None:
    """C is 90 degrees: X of the program is Y of the machine, and Y is against X. The tool is 40 mm long."""
    path = program(
        "FROM/1.0,2.,3\nGOTO/4,5,6\nGOHOME\nGOTO/1,0,0,0,.6,.8\nGODLTA/1,2,3\n", turned_setup
    ).toolpath
    assert path.start_mm == pytest.approx((98.0, 1.0, 43.0))
    want = [[95.0, 4.0, 46.0], [98.0, 1.0, 43.0], [76.0, 1.0, 32.0], [74.0, 2.0, 35.0]]
    assert path.end_mm == pytest.approx(np.array(want))
    assert path.flag.tolist() == [0, Flag.PASS, Flag.WHOLE, Flag.INCREMENTAL]
    assert path.line.tolist() == [3, 4, 5, 6]
    assert [path.frames[k].tool for k in path.frame.tolist()] == [4, 4, 4, 4]
    assert path.frames[int(path.frame[2])].tool_mm == pytest.approx((24.0, 0.0, -32.0))


def test_an_axis_that_is_not_stated_is_that_of_the_machine(turned_setup: Setup) -> None:
    """The second frame lies on its side: Z of the program is against Y of the machine."""
    moved = "CSYS/1,0,0,5,0,1,0,0,0,0,1,0\n"
    path = program(
        f"GOTO/0,0,0\n{moved}GOTO/0,0,1\nGOTO/0,0,1,0,-1,0\nGOTO/0,0,1,0,0,1\n", turned_setup
    ).toolpath
    assert path.end_mm[1:] == pytest.approx(
        np.array([[0.0, -1.0, 40.0], [0.0, -1.0, -40.0], [0.0, -1.0, 40.0]])
    )


def test_the_length_of_the_first_tool_counts_where_the_machine_says_so(
    tmp_path_factory: pytest.TempPathFactory, turned_setup: Setup
) -> None:
    inactive = turned(tmp_path_factory, "false")
    ends = [program("GOTO/1,2,3\n", s).toolpath.end_mm[0, 2] for s in (turned_setup, inactive)]
    assert ends == [43.0, 3.0]
    assert program("GOTO/1,2,3\n", inactive).toolpath.frames[0].tool_mm == (0.0, 0.0, -40.0)
    loaded = program("GOTO/1,2,3\nTOOLNO/3\nGOTO/1,2,3\nLOADTL/0\nGOTO/1,2,3\n", inactive).toolpath
    assert loaded.end_mm[::2, 2].tolist() == [3.0, 33.0, 3.0]
    assert [repr(loaded.frames[k].tool) for k in loaded.frame.tolist()[::2]] == ["4", "3", "0"]


def test_the_first_coordinate_system_may_have_a_frame_of_its_own(tmp_path: Path) -> None:
    tables = TABLES + '[work_offsets.CSYS1]\nset_by = "true"\nX_mm = 700.0\n'
    setup = load_setup(machine(tmp_path, tables=tables))
    assert x_of("GOTO/1,0,0\nORIGIN/5,0,0\nGOTO/1,0,0\nORIGIN/OFF\nGOTO/1,0,0\n", setup) == [
        701.0,
        501.0,
        701.0,
    ]


def test_coordinate_systems_that_differ_below_a_nanometre_are_one(setup: Setup) -> None:
    text = "GOTO/1,0,0\nCSYS/{},0,0,{},0,1,0,0,0,0,1,0\nGOTO/1,0,0\n"
    for x, origin, second in (("1.0000000004", "0", 101.0), ("1", "-0.0000000004", 101.0), ("1", ".4", 501.0),
                              ("1.000000001", "0", 501.0)):  # fmt: skip
        assert x_of(text.format(x, origin), setup) == [101.0, second]
    assert x_of("GOTO/1,0,0\nORIGIN/0,0,0\nGOTO/1,0,0\nCSYS\nGOTO/1,0,0\n", setup) == [101.0] * 3


def test_a_coordinate_system_of_creo_is_in_a_comment(setup: Setup) -> None:
    point = "GOTO/1,0,0\n"
    for comment in ("$$-> CSYS / 1,0,0,5,0,1,0,0,0,0,1,0", "  $$->csys/1,0,0,5, $\n 0,1,0,0,$  \n0,0,1,0"):
        back = "$$-> CSYS / 1,0,0,0,  $\n  0,1,0,0,  $\n  0,0,1,0\n"
        assert x_of(f"{point}{comment}\n{point}{back}{point}", setup) == [101.0, 501.0, 101.0]
    for comment in (
        "$$-> CSYS",
        "$$-> MFGNO / 5,1,2,3",
        "$$-> CSYSTEM / 1,0,0,5",
        "$$ -> CSYS / 5,0,0",
        "$$->",
    ):
        assert x_of(f"{point}{comment}\n{point}", setup) == [101.0, 101.0]
    # a comment that goes on takes its next lines along, whatever they say
    assert x_of(f"{point}$$-> PART / A, $\nROTABL/1 $\nMACRO/1\n{point}", setup) == [101.0, 101.0]
    assert x_of(f"{point}$$-> PART / A, $", setup) == [101.0]


def test_a_csys_and_an_origin_make_a_coordinate_system_together(setup: Setup) -> None:
    moved, back = "CSYS/1,0,0,5,0,1,0,0,0,0,1,0\n", "CSYS/1,0,0,0,0,1,0,0,0,0,1,0\n"
    point = "GOTO/1,0,0\n"
    third = f"{point}{moved}{point}ORIGIN/5,0,0\n{point}"
    assert refused(third, setup, "coordinate system 3 of the program needs the frame CSYS3") == 6
    # an origin that ends leaves the system that it was in, and the other way round
    text = f"{moved}{point}ORIGIN/NOMORE\n{point}"
    assert x_of(point + text, setup) == [101.0, 501.0, 501.0]
    text = f"{point}ORIGIN/5,0,0\n{point}{back}{point}"
    assert x_of(text, setup) == [101.0, 501.0, 501.0]


def test_a_frame_that_is_not_defined_is_named_with_its_use(tmp_path: Path) -> None:
    bare = load_setup(machine(tmp_path))
    assert refused("GOTO/1,0,0\n", bare, "the program needs the frame G54, which is not defined") == 2


def test_an_unknown_position_is_in_the_frame_before_it(setup: Setup) -> None:
    path = program("LOADTL/3\nGOTO/1,2,3\nRETRCT\nLOADTL/0\nGOTO/1,2,3\nGOHOME\n", setup).toolpath
    assert [path.frames[k].tool for k in path.frame.tolist()] == [3, 3, 3, 0, 0]
    assert path.line.tolist() == [3, 4, 5, 6, 7]
    assert path.flag.tolist() == [0, 129, 129, 0, 129]
    assert np.isnan(path.end_mm).any(axis=1).tolist() == [False, True, True, False, True]
    first = program("RETRCT\nGOTO/1,2,3\n", setup).toolpath
    assert np.isnan(first.start_mm).all()
    assert first.line.tolist() == [3]


def test_turns_of_the_tool_are_whole_moves(setup: Setup) -> None:
    axes = ("", ",0,.6,.8", ",0,.6,.8", "", ",0,0,1", ",0,0,-1", "")
    text = "LOADTL/3\n" + "".join(f"GOTO/{k},2,3{axis}\n" for k, axis in enumerate(axes))
    path = program(text, setup).toolpath
    assert path.flag.tolist() == [0, Flag.WHOLE, 0, 0, Flag.WHOLE, Flag.WHOLE, 0]
    up = [(0, 30), (18, 24), (18, 24), (18, 24), (0, 30), (0, -30), (0, -30)]
    want = [[100.0 + k, 2.0 + y, 3.0 + z] for k, (y, z) in enumerate(up)]
    assert path.end_mm == pytest.approx(np.array(want))
    # also over a change of the state, and not at the start of the program
    parted = program("GOTO/1,2,3,0,.6,.8\nUNITS/MM\nGOTO/2,2,3\nUNITS/MM\nGOTO/3,2,3,0,0,1\n", setup).toolpath
    assert parted.flag.tolist() == [0, 0, Flag.WHOLE]


def test_distances_add_up_over_a_change_of_the_state(setup: Setup) -> None:
    text = "GOTO/1,2,3\nUNITS/MM\nGODLTA/1,0,0\nGODLTA/0,1,0\nGOTO/0,0,0\nGODLTA/0,0,1\nUNITS/MM\nGODLTA/5\n"
    want = [[1, 2, 3], [2, 2, 3], [2, 3, 3], [0, 0, 0], [0, 0, 1], [0, 0, 6]]
    path = program(text, setup).toolpath
    assert (path.end_mm - [100.0, 0.0, 0.0]).tolist() == want
    assert path.flag.tolist() == [0, 16, 16, 0, 16, 16]


# -- cycles --------------------------------------------------------------------------------------------


def test_holes_are_along_the_tool(setup: Setup) -> None:
    """Tool 3 is 30 mm long; the holes are 10 mm deep, begin 5 mm above their point and end 20 mm above."""
    cycle = "CYCLE/DRILL,DEPTH,10,CLEAR,5,RTRCTO,20,MMPM,60\n"
    done = program(
        f"LOADTL/3\nTLAXIS/0,.6,.8\nFEDRAT/120\n{cycle}GOTO/1,2,3\nGOTO/5,6,7\nCYCLE/OFF\nGOTO/9,6,7\n", setup
    )
    path, statements = done.toolpath, done.statements
    assert statements is not None
    up, points = np.array([0.0, 0.6, 0.8]), np.array([[101.0, 2, 3], [105, 6, 7], [109, 6, 7]])
    heights = [30 + 5, 30 - 10, 30 + 20] * 2 + [30]
    want = [points[k // 3] + up * height for k, height in enumerate(heights)]
    assert path.end_mm == pytest.approx(np.array(want))
    assert path.kind.tolist() == [Kind.RAPID, Kind.LINE, Kind.RAPID] * 2 + [Kind.LINE]
    assert path.flag.tolist() == [Flag.CYCLE] * 6 + [0]
    assert path.line.tolist() == [6, 6, 6, 7, 7, 7, 9]
    assert statements.strokes.tolist() == [[0, 1], [3, 4]]
    lifts = [path.frames[k].lift_mm for k in path.frame.tolist()]
    assert lifts[:6] == [pytest.approx((0.0, 3.0, 4.0))] * 6
    assert lifts[6] == (0.0, 0.0, 0.0)
    assert statements.feed_mm_s.tolist() == [np.inf, 1.0, np.inf] * 2 + [2.0]
    assert [text_of(done, a, b) for a, b in zip(statements.begin, statements.end, strict=True)] == [
        b"GOTO/1,2,3", b"", b"", b"GOTO/5,6,7", b"", b"", b"GOTO/9,6,7"
    ]  # fmt: skip
    assert (done.slot >= 0).all(axis=1).tolist() == [True, False, False, True, False, False, True]


def test_a_cycle_that_turns_the_tool_makes_each_hole_along_its_own_axis(setup: Setup) -> None:
    text = "CYCLE/DRILL,DEPTH,10,CLEAR,5\nGOTO/1,2,3,0,0,1\nGOTO/1,2,3,0,.6,.8\n"
    ends = program(text, setup).toolpath.end_mm
    want = [[0, 0, 5], [0, 0, -10], [0, 0, 5], [0, 3, 4], [0, -6, -8], [0, 3, 4]]
    assert ends - [101.0, 2.0, 3.0] == pytest.approx(np.array(want, float))


@pytest.mark.parametrize(
    ("cycle", "z"),
    [
        ("CLEAR", [0.0]), ("INIT", [0.0]), ("PARAM", [0.0]), ("AVOID", [0.0]), ("CLEAR,2", [2.0]),
        ("BORE,CLEAR,3,DEPTH,4", [3.0, -4.0, 3.0]), ("DRILL,DEPTH,4", [0.0]),
        ("DRILL,RAPTO,1,FEDTO,4,RTRCTO,0", [1.0, -4.0, 0.0]), ("DRILL,5,DEPTH,A,CLEAR,2", [2.0]),
    ],
)  # fmt: skip
def test_words_of_a_cycle(cycle: str, z: list[float], setup: Setup) -> None:
    """A cycle of words that only set values is none: its points are straight moves."""
    path = program(f"CYCLE/{cycle}\nGOTO/1,0,0\n", setup).toolpath
    assert path.end_mm[:, 2].tolist() == z
    message = cycle in ("CLEAR", "INIT", "PARAM", "AVOID")
    assert path.kind[0] == (Kind.LINE if message else Kind.RAPID)
    assert ((path.flag & Flag.CYCLE) != 0).tolist() == [len(z) == 3] * len(z)
    assert [frame.lift_mm[2] for frame in path.frames][-1] == (z[0] if z[0] else 0.0)


def test_a_message_of_a_cycle_leaves_the_one_in_force(setup: Setup) -> None:
    text = "CYCLE/DRILL,DEPTH,8,CLEAR,2\nCYCLE/INIT\nGOTO/1,0,0\nCYCLE/NOMORE\nGOTO/2,0,0\n"
    assert x_of(text, setup) == [101.0] * 3 + [102.0]


def test_lengths_of_a_cycle_are_in_the_unit_of_the_program(setup: Setup) -> None:
    text = "UNITS/INCH\nCYCLE/DRILL,DEPTH,.5,CLEAR,.1,RTRCTO,2\nGOTO/0,0,0\n"
    assert program(text, setup).toolpath.end_mm[:, 2] == pytest.approx([2.54, -12.7, 50.8])


def test_the_tip_is_known_after_a_hole(setup: Setup) -> None:
    """A distance begins where the hole ends, 20 mm above its point."""
    text = "GOTO/0,0,9\nCYCLE/DRILL,DEPTH,8,CLEAR,2,RTRCTO,20\nGOTO/1,0,0\nCYCLE/OFF\nGODLTA/-1\n"
    assert program(text, setup).toolpath.end_mm[:, 2].tolist() == [9.0, 2.0, -8.0, 20.0, 19.0]


# -- feeds, words, remarks -----------------------------------------------------------------------------


def test_the_words_of_feeds_are_those_of_their_statements(setup: Setup) -> None:
    text = (
        "FEDRAT/MMPM,120\nGOTO/0,0,0\nFEDRAT/OFF\nGOTO/1,0,0\nFEDRAT/60.5,IPM,7\n"
        "CYCLE/DRILL,DEPTH,8,CLEAR,2\nGOTO/2,0,0\nCYCLE/OFF\nFEDRAT/5\nGOTO/3,0,0\n"
    )
    done = program(text, setup)
    assert feeds_of(done) == [
        (0, 0, None), (0, 2, b"120"), (1, 4, None), (2, 6, b"60.5"), (3, 8, None), (5, 6, b"60.5"), (5, 10,
         b"5")
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("feed", "mm_min"),
    [
        ("FEDRAT/.5,INVERSE", NAN), ("FEDRAT/.5,INVERS", NAN), ("FEDRAT/2", 50.8), ("FEDRAT/2,7", 50.8),
        ("SPINDL/600\nFEDRAT/.1,PERREV", 1524.0), ("SPINDL/600\nFEDRAT/.1,MMPR", 60.0),
        ("SPINDL/600,5\nFEDRAT/.1,IPR", 1524.0), ("SPINDL/600\nSPINDL/OFF\nFEDRAT/.1,IPR", 1524.0),
        ("FEDRAT/2,IPM", 50.8), ("FEDRAT/2,MMPM", 2.0), ("FEDRAT/2,PERMIN", 50.8), ("FEDRAT/MMPM", NAN),
    ],
)  # fmt: skip
def test_feeds_of_a_program_in_inches(feed: str, mm_min: float, setup: Setup) -> None:
    assert feeds(f"UNITS/INCH\n{feed}\nGOTO/1,0,0\n", setup) == pytest.approx([mm_min], nan_ok=True)


def test_rests_at_one_place_add_up_and_those_in_a_cycle_are_behind_its_holes(setup: Setup) -> None:
    text = (
        "GOTO/0,0,0\nDELAY/1\nDELAY/2.5\nCYCLE/DRILL,DEPTH,8,CLEAR,2\nGOTO/1,0,0\nDELAY/4\nGOTO/2,0,0\nSTOP\n"
    )
    statements = program(text, setup).statements
    assert statements is not None
    assert statements.dwell_s.tolist() == [0.0, 3.5, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0]
    assert np.flatnonzero(statements.rest).tolist() == [1, 4, 7]


def test_a_program_without_a_unit_is_in_mm_and_says_so(setup: Setup) -> None:
    done = program("RAPID\nGOTO/2,0,0\nCUTCOM/OFF\nGOTO/3,0,0\n", setup, head="")
    assert done.remarks == (("unit", 2, "the program states no unit"),)
    assert done.toolpath.end_mm[:, 0].tolist() == [102.0, 103.0]
    assert program("GOTO/2,0,0\n", setup).remarks == ()


def test_compensation_of_the_cutter_is_in_the_frame(setup: Setup) -> None:
    text = (
        "CUTCOM/LEFT\nGOTO/0,0,0\nCUTCOM/ON\nGOTO/1,0,0\nCUTCOM/RIGHT\nGOTO/2,0,0\nCUTCOM/OFF\nGOTO/3,0,0\n"
    )
    path = program(text, setup).toolpath
    left, right = CutterCompensation(0, True), CutterCompensation(0, False)
    assert [path.frames[k].compensation for k in path.frame.tolist()] == [left, left, right, None]


def test_the_end_of_a_program(setup: Setup) -> None:
    assert program("GOTO/1,0,0\nFINI\nGOTO/2,0,0\nROTABL/1\n", setup).end_line == 3
    assert program("GOTO/1,0,0\n", setup).end_line == 3
    assert program("GOTO/1,0,0", setup).end_line == 2
    assert x_of("GOTO/1,0,0\nFINI\nGOTO/2,0,0\n", setup) == [101.0]
    assert program("RAPID/\nGOTO/1,0,0\n", setup).toolpath.kind.tolist() == [Kind.RAPID]


def test_a_comma_or_two_at_the_end_mean_nothing(setup: Setup) -> None:
    assert x_of("GOTO/1,2,3,\nGOTO/1,2,3,,\nGODLTA/1,2,3,,\n", setup) == [101.0, 101.0, 102.0]


# -- a text in pieces ----------------------------------------------------------------------------------

WHOLE = """PARTNO CARDS
UNITS/MM
SPINDL/600,CLW
FEDRAT/120,MMPM
FROM/0,0,50
GOTO/1,2,3
RAPID
$$ between
GOTO/10,0,5
CIRCLE/0,0,5,0,0,1,10
$$ a comment, and more text
GOTO/0,10,5
GODLTA/1,0,0
GODLTA/-2
FEDRAT/60
$$-> CSYS / 1,0,0,7,  $
  0,1,0,0, $
  0,0,1,0
GOTO/1.5,2.$
5,3.
GOTO/1,2,3,0,0,1
LOADTL/3
GOTO/1,2,3,0,.6,.8
GOTO/1,2,3
CYCLE/DRILL,DEPTH,8,CLEAR,2
GOTO/1,0,0
DELAY/2
GOTO/4,0,0
CYCLE/OFF
RAPID
INDIRV/0,1,0
GOHOME
GOTO/10,0,5,0,0,1
TLON,GOFWD/(CIRCLE/0,0,5,10),ON,(LINE/0,0,5,0,10,5)
STOP
FINI
GOTO/9,9,9
"""


@pytest.mark.parametrize("size", (1, 20, 60, 130, 300))
def test_a_text_says_the_same_in_pieces(size: int, setup: Setup, monkeypatch: pytest.MonkeyPatch) -> None:
    """Long texts are read in pieces of whole lines: what holds for the next point goes on in the next one."""
    whole = said(program(WHOLE, setup, head=""))
    assert len(whole["kind"]) == 19
    monkeypatch.setattr(reader, "chunks", lambda data, **told: chunks(data, size, **told))
    assert said(program(WHOLE, setup, head="")) == whole


def test_a_text_in_pieces_is_refused_alike(setup: Setup, monkeypatch: pytest.MonkeyPatch) -> None:
    for text in ("GOTO/1,2,3\nGOTO/1,2,3\nROTABL/1\n", "GOTO/1,2,3\nGOTO/1,2,3,0,0,2\n"):
        outcomes = []
        for size in (1, 1000):
            monkeypatch.setattr(reader, "chunks", lambda data, size=size, **told: chunks(data, size, **told))
            with pytest.raises(ProgramError) as caught:
                program(text, setup)
            outcomes.append((str(caught.value), caught.value.code))
        assert outcomes[0] == outcomes[1]


def test_without_words_the_path_is_the_same(setup: Setup) -> None:
    data = WHOLE.encode()
    bare = read(data, setup, DIALECTS["apt"], words=False)
    full = read(data, setup, DIALECTS["apt"])
    assert bare.words is None
    assert len(bare.slot) == 0
    assert bare.toolpath.end_mm == pytest.approx(full.toolpath.end_mm, rel=0, abs=0, nan_ok=True)
    assert bare.toolpath.kind.tolist() == full.toolpath.kind.tolist()


@pytest.mark.parametrize(("longest", "width"), [(71, 72), (72, 72), (73, 80), (80, 80), (81, 0)])
def test_lines_of_old_terminals_are_kept_as_narrow(longest: int, width: int, setup: Setup) -> None:
    text = f"PPRINT {'A' * (longest - 7)}\r\nGOTO/1,2,3\r\n"
    statements = program(text, setup).statements
    assert statements is not None
    assert (statements.width, statements.cards, statements.mark) == (width, False, b"$")
    assert (statements.rapid, statements.decimal) == (b"RAPID", b"")


def test_cards_have_their_numbers_behind_72_columns(setup: Setup) -> None:
    cards = ["UNITS/MM", "GOTO/1,2,3", "GOTO/4,5,6", "FINI"]
    text = "".join(f"{card:<72}{10 * k:08d}\n" for k, card in enumerate(cards))
    done = program(text, setup, head="")
    assert done.statements is not None
    assert (done.statements.width, done.statements.cards) == (72, True)
    assert done.toolpath.end_mm.tolist() == [[101.0, 2.0, 3.0], [104.0, 5.0, 6.0]]


def test_words_of_statements_have_no_letters(setup: Setup) -> None:
    done = program("GOTO/1,2.,-.5\nGOTO/1E1,2,3\nGOTO/4$\n4,5,$\n6\nGODLTA/-2.50\n", setup)
    words = done.words
    assert words is not None
    assert (words.letter == 0).all()
    assert words.number[:].tolist() == words.start.tolist()
    assert len(words.first_word) == 0
    rows = [[word_of(done, k) for k in row] for row in done.slot.tolist()]
    assert rows == [
        [(b"1", 1.0, False), (b"2.", 2.0, True), (b"-.5", -0.5, True)],
        [(b"1E1", 10.0, False), (b"2", 2.0, False), (b"3", 3.0, False)],
        [(b"4$\n4", 44.0, False), (b"5", 5.0, False), (b"6", 6.0, False)],
        [None, None, (b"-2.50", -2.5, True)],
    ]
    assert done.statements is not None
    assert [(word_of(done, k), mark) for k, mark in done.statements.broken.items()] == [
        ((b"4$\n4", 44.0, False), b"$\n")
    ]  # fmt: skip
    once = program("GOTO/4$\r4$\r4,5,6\r", setup, head="UNITS/MM\r").statements
    assert once is not None
    assert list(once.broken.values()) == [b"$\r4$\r"]
    lone = program("GOTO/1,2,3\nRETRCT\n", setup).statements
    assert lone is not None
    assert (lone.begin.tolist(), lone.end.tolist()) == ([9, -1], [19, -1])
    assert program("GOTO/1,2,3\nRETRCT\n", setup).slot.tolist()[1] == [-1, -1, -1]
    arcs = program("GOTO/10,0,5\nCIRCLE/0,0,5,0,0,1\nGOTO/0,10,5\n", setup).arc_slots
    assert arcs.word.tolist() == [[-1] * 5]
    assert arcs.absolute.tolist() == [True]


# -- the table of statements ---------------------------------------------------------------------------

#: words of APT by what becomes of their statements
WORDS = {
    Support.CORRECTED: "GOTO GODLTA CIRCLE MOVARC TLON",
    Support.READ: "INDIRV AUTOPS FROM GOHOME RAPID FEDRAT UNITS UNIT LOADTL LOAD TOOLNO TURRET CYCLE CUTCOM "
    "MULTAX "
    "TLAXIS CSYS MSYS ORIGIN TRACUT TRANS SPINDL DELAY STOP OPSTOP RETRCT GOCLER UNLOAD AUXFUN PREFUN SET "
    "OPSKIP ROTABL ROTATE ROTHED COPY FINI",
    Support.UNCHANGED: "INSERT PARTNO PPRINT REMARK REM TITLE TPRINT DISPLY PRINT PAINT END-OF-PATH END "
    "MACHIN "
    "INTOL OUTTOL TOLER CUTTER TOOL SELECT SELCTL COOLNT CLEARP CLRSRF SEQNO SETUP TRNTYP "
    "ARCSLP "
    "LEADER NOPOST CLPRNT PITCH MCHTOL DPMULTAX INDEX TLDATA CSI_SET_FLUTE_LENGTH CSI_SET_EXTENSION_LENGTH "
    "TOOL_OFFSET CLAMP CHKPTS MAXIPM LINTOL CATPROCESS BOX STOCK MODE DRESS REWIND PLABEL TMARK LPRINT CHECK "
    "SLOWDN AIR LETTER OVPLOT PENDWN PENUP PPLOT DRAFT TLSPEC OPNAME OPTYPE APPLY TLNAME MFGNO",
    Support.REFUSED: "GOLFT GORGT GOFWD GOBACK GOUP GODOWN GO TLLFT TLRGT TLNDON TLOFPS TLONPS INDIRP "
    "CONTUR PROFIL POCKET SCURV NOPS POINT LINE PLANE VECTOR MATRIX CYLNDR SPHERE PATERN TABCYL "
    "ELLIPS "
    "REFSYS ZSURF OBTAIN MACRO TERMAC CALL LOOPST LOOPND JUMPTO IF TRANTO CALSUB BREAK RESERV READ REPEAT DO "
    "TILT PALLET HEAD THREAD NURBS SPLINE BSPLIN POLYLN PIERCE MIRROR SWITCH SYN PPFUN",
}  # fmt: skip
OF_TWO_WORDS = {b"TOOL PATH": Support.UNCHANGED, b"$$-> CSYS": Support.READ}


def test_each_word_has_its_row_in_the_table() -> None:
    want = {word.encode(): support for support, words in WORDS.items() for word in words.split()}
    assert {word: support for word, (support, _) in TABLE.items()} == want | OF_TWO_WORDS
    clear = {*WORDS[Support.UNCHANGED].split(), "TOOL PATH"} - {"INSERT"}
    assert {word.decode() for word, (_, why) in TABLE.items() if why == ""} == clear


def test_what_has_no_effect_on_the_path_is_passed_over(setup: Setup) -> None:
    words = [*WORDS[Support.UNCHANGED].split(), "TOOL PATH", "MULTAX"]
    assert x_of("".join(f"{word}/ON\n{word.lower()} / 1,2\n" for word in words) + "GOTO/1,0,0\n", setup) == [
        101.0
    ]


def test_what_the_table_refuses_is_refused_with_its_reason(setup: Setup) -> None:
    words = WORDS[Support.REFUSED].split()
    with pytest.raises(ProgramError) as caught:
        program("".join(f"{word}/1\n" for word in words), setup)
    errors = [caught.value, *caught.value.others]
    assert [error.line for error in errors] == list(range(2, len(words) + 2))
    for word, error in zip(words, errors, strict=True):
        assert str(error) == f"{error.line}: {word} {TABLE[word.encode()][1]}"
    assert refused("go / 1\n", setup, "GO drives the tool along geometry") == 2


@pytest.mark.parametrize("word", ("PARTNO", "PPRINT", "INSERT", "REMARK", "REM", "TITLE", "TPRINT", "DISPLY"))
def test_the_rest_of_a_line_of_text_is_text(word: str, setup: Setup) -> None:
    for text in (f"{word} GOTO/1,2,3 $\n", f"{word.lower()}=ROTABL/1 $ 5\n", f"{word} A=5, 'B\n"):
        assert x_of(text + "GOTO/1,0,0\n", setup) == [101.0]
    assert refused(f"{word}X/1\n", setup, f"{word}X is not a statement that olp knows") == 2
