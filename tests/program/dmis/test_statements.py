"""Statements of DMIS by hand: units, styli, datums, modes, features, branches, macros and speeds."""

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
from olp.program.registry import DIALECTS, read

TABLES = (
    '[work_offsets.MCS]\nset_by = "true"\n[work_offsets.PART]\nset_by = "true"\nX_mm = 100.0\n'
    "[styli.LONG]\noffset_mm = [1.0, 2.0, -50.0]\n"
)


@pytest.fixture(scope="module")
def setup(tmp_path_factory: pytest.TempPathFactory) -> Setup:
    path = machine(tmp_path_factory.mktemp("dmis"), controller="dmis", tables=TABLES)
    return load_setup(path)


def program(text: str, setup: Setup, head: str = "UNITS/MM,ANGDEC\nD(PART)=TRANS/XORIG,1\n") -> Program:
    return read((head + text).encode(), setup, DIALECTS["dmis"])


def ends(text: str, setup: Setup) -> list[list[float] | None]:
    """Axis positions behind each move, None where they are unknown."""
    rows = program(text, setup).toolpath.end_mm.tolist()
    return [None if math.isnan(row[0]) else row for row in rows]


def refused(text: str, setup: Setup, words: str) -> int | None:
    with pytest.raises(ProgramError, match=words) as caught:
        program(text, setup)
    return caught.value.line


@pytest.mark.parametrize(("unit", "mm"), [("MM", 1.0), ("CM", 10.0), ("M", 1000.0), ("INCH", 25.4)])
def test_units(unit: str, mm: float, setup: Setup) -> None:
    text = f"GOTO/1,2,3\nUNITS/{unit},ANGDEC\nGOTO/1,2,3\n"
    assert ends(text, setup) == [
        [101.0, 2.0, 3.0], [pytest.approx(100.0 + mm), pytest.approx(2 * mm), pytest.approx(3 * mm)]
    ]  # fmt: skip
    assert refused("UNITS/FOOT\n", setup, "expected MM, CM, M or INCH") == 3
    assert refused("UNITS\n", setup, "expected MM, CM, M or INCH") == 3


def test_a_stylus_is_that_of_the_machine_file_or_of_the_program(setup: Setup) -> None:
    """The axes count at the end of the ram: the tip less the offset of the stylus."""
    text = "SNSLCT/S(LONG)\nGOTO/1,2,3\n"
    assert ends(text, setup) == [[100.0, 0.0, 53.0]]
    own = "S(OWN)=SNSDEF/PROBE,FIXED,CART,0,4,-20,0,0,1,4\nSNSLCT/S(OWN)\nGOTO/1,2,3\n"
    assert ends(own, setup) == [[101.0, -2.0, 23.0]]
    cm = "UNITS/CM,ANGDEC\n" + own
    assert ends(cm, setup) == [[pytest.approx(110.0), pytest.approx(-20.0), pytest.approx(230.0)]]


@pytest.mark.parametrize(
    "definition",
    [
        "PROBE,INDEX,CART,0,0,-20,0,0,1,4",
        "PROBE,FIXED,POL,0,0,-20",
        "PROBE,FIXED,CART,0,0",
        "PROBE,FIXED,CART,A,0,1",
    ],
)
def test_a_stylus_without_a_fixed_offset_has_to_be_stated(definition: str, setup: Setup) -> None:
    text = f"S(OWN)=SNSDEF/{definition}\nSNSLCT/S(OWN)\nGOTO/1,2,3\n"
    assert refused(text, setup, "the stylus OWN is selected, and its offset is not stated") == 5


def test_another_stylus_leaves_the_position_unknown_and_the_same_does_not(setup: Setup) -> None:
    text = "SNSLCT/S(LONG)\nGOTO/1,2,3\nSNSLCT/S(LONG)\nGOTO/2,2,3\nSNSLCT/S(OTHER)\n"
    assert ends(text, setup) == [[100.0, 0.0, 53.0], [101.0, 0.0, 53.0], None]
    assert refused("SNSLCT/RT(A)X\n", setup, "SNSLCT names no sensor") == 3


@pytest.mark.parametrize("word", ("TRANS/XORIG,1", "ROTATE/ZAXIS,0", "DATSET/DAT(A),ZDIR"))
def test_a_datum_is_a_frame_by_its_label(word: str, setup: Setup) -> None:
    text = f"D(MCS)={word}\nGOTO/1,2,3\nRECALL/D(part)\nGOTO/1,2,3\nRECALL/DA(MCS)\nGOTO/1,2,3\n"
    assert [row and row[0] for row in ends(text, setup)] == [1.0, 101.0, 1.0]
    assert refused(f"{word}\n", setup, "has no label, so its frame has no name") == 3
    assert refused("RECALL/S(LONG)\n", setup, "RECALL is read for datums only") == 3


def test_points_in_manual_mode_are_left_alone(setup: Setup) -> None:
    flags = program("GOTO/1,2,3\nMODE/MAN\nGOTO/2,2,3\nMODE/PROG,MAN\nGOTO/3,2,3\n", setup).toolpath.flag
    assert [bool(flag & Flag.PASS) for flag in flags.tolist()] == [False, True, False]


def test_touches_are_inside_a_feature(setup: Setup) -> None:
    text = "GOTO/1,2,3\nMEAS/POINT,F(P),1\nPTMEAS/CART,2,2,3,-1,0,0\nENDMES\nGOTO/1,2,3\n"
    path = program(text, setup).toolpath
    assert path.kind.tolist() == [Kind.RAPID, Kind.PROBE, Kind.RAPID]
    assert [bool(flag & Flag.WHOLE) for flag in path.flag.tolist()] == [False, True, False]
    chosen = "GOTO/1,2,3\nRMEAS/POINT,F(P),1\nENDMES\nGOTO/1,2,3\n"
    assert [row is None for row in ends(chosen, setup)] == [False, True, False]
    assert refused("PTMEAS/CART,2,2,3,-1,0,0\n", setup, "PTMEAS is outside MEAS and ENDMES") == 3
    assert refused("MEAS/POINT,F(P),1\nMEAS/POINT,F(P),1\n", setup, "MEAS is inside MEAS") == 4
    assert refused("ENDMES\n", setup, "ENDMES has no MEAS before it") == 3


def test_where_the_control_may_go_elsewhere_no_position_is_known(setup: Setup) -> None:
    assert ends("GOTO/1,2,3\nGOHOME\nGOTO/1,2,3\n", setup)[1] is None
    assert program("GOHOME\nGOTO/1,2,3\n", setup).toolpath.start_mm[0] != 0.0
    branch = "GOTO/1,2,3\nIF/(A.EQ.1)\nGOTO/2,2,3\nELSE\nGOTO/3,2,3\nENDIF\nGOTO/4,2,3\n"
    assert [row and row[0] for row in ends(branch, setup)] == [101.0, None, 102.0, None, 103.0, None, 104.0]
    loop = "DO/I,1,3\nGOTO/2,2,3\nENDDO\nGOTO/4,2,3\n"
    assert [row and row[0] for row in ends(loop, setup)] == [102.0, None, 104.0]


@pytest.mark.parametrize(
    "inner", ("UNITS/INCH,ANGDEC", "SNSLCT/S(LONG)", "D(MCS)=TRANS/XORIG,1", "RECALL/D(MCS)", "MODE/MAN")
)
def test_the_state_does_not_change_inside_a_branch(inner: str, setup: Setup) -> None:
    words = "is inside {}, so whether it holds is known at run time only"
    assert refused(f"GOTO/1,2,3\nIF/(A.EQ.1)\n{inner}\nENDIF\n", setup, words.format("IF")) == 5
    assert refused(f"GOTO/1,2,3\nDO/I,1,3\n{inner}\nENDDO\n", setup, words.format("DO")) == 5
    # behind it, it may
    assert program(f"GOTO/1,2,3\nDO/I,1,3\nIF/(A.EQ.1)\nENDIF\nENDDO\n{inner}\n", setup)


def test_ends_of_branches_have_a_begin(setup: Setup) -> None:
    assert refused("ENDIF\n", setup, "ENDIF has no IF before it") == 3
    assert refused("DO/I,1,3\nENDIF\n", setup, "ENDIF has no IF before it") == 4
    assert refused("IF/(A.EQ.1)\nENDDO\n", setup, "ENDDO has no DO before it") == 4


def test_macros_that_do_not_move(setup: Setup) -> None:
    text = "M(A)=MACRO\nTEXT/OPER,'a'\nENDMAC\nGOTO/1,2,3\nCALL/M(A)\nCALL/M(a)\n"
    assert ends(text, setup) == [[101.0, 2.0, 3.0]]
    assert refused("CALL/M(B)\n", setup, "CALL runs a macro that is not in this program") == 3
    assert refused("CALL\n", setup, "CALL runs a macro that is not in this program") == 3
    assert refused("M(A)=MACRO\nGOTO/1,2,3\nENDMAC\n", setup, "the macro A moves the machine") == 4


def test_compensation_by_the_control_is_remarked_once(setup: Setup) -> None:
    def remarked(text: str) -> list[int]:
        return [line for what, line, _ in program(text, setup).remarks if what == "thermal"]

    assert remarked("TECOMP/ON\nTEMPR/A\nGOTO/1,2,3\n") == [3]
    assert remarked("TECOMP/OFF\nGOTO/1,2,3\nTEMPR/A\n") == [5]
    assert remarked("TECOMP/OFF\nGOTO/1,2,3\n") == []


@pytest.mark.parametrize(
    ("speed", "mm_s"),
    [("MMPS,20", 20.0), ("20,MMPS", 20.0), ("MPM,.6", 10.0), ("IPS,2", 50.8), ("IPM,60", 25.4)],
)
def test_measuring_speeds_have_units(speed: str, mm_s: float, setup: Setup) -> None:
    text = (
        f"FEDRAT/MESVEL,{speed}\nFEDRAT/POSVEL,MMPS,99\nMEAS/POINT,F(P),1\nPTMEAS/CART,2,2,3,-1,0,0\nENDMES\n"
    )
    statements = program(text, setup).statements
    assert statements is not None
    assert statements.feed_mm_s.tolist() == pytest.approx([mm_s])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("GOTO/1,2", "GOTO has 2 numbers; expected x,y,z"),
        ("GOTO/1,2,3,0,0,1", "GOTO has 6 numbers; expected x,y,z"),
        ("GOTO/CART,1,A,3", "GOTO has A where a number is expected"),
        ("GOTO/POL,1,2,3", "GOTO/POL is not read"),
        ("MEAS/POINT,F(P),1\nPTMEAS/1,2,3", "PTMEAS/1 is not read; expected CART"),
        ("MEAS/POINT,F(P),1\nPTMEAS/CART,1,2,3,4", "PTMEAS has 4 numbers; expected x,y,z and a direction"),
        ("SCAN/A", "scans along a path that is not read"),
        ("CALIB/SENS,S(LONG)", "only the run of the program decides"),
        ("ROTAB/A", "moves an axis that is not read"),
        ("WHATEVER/1", "is not a statement that olp knows"),
        ("A=5", "is assigned, and its effect is known at run time only"),
    ],
)
def test_what_is_not_read_is_refused(text: str, words: str, setup: Setup) -> None:
    assert refused(text + "\n", setup, words) == 3 + text.count("\n")


def test_a_point_may_end_with_one_comma_and_name_its_form(setup: Setup) -> None:
    for point in ("1,2,3", "1,2,3,", "CART,1,2,3", "CART,1,2,3,"):
        assert ends(f"GOTO/{point}\n", setup) == [[101.0, 2.0, 3.0]]


def test_endfil_ends_the_program_and_units_are_remarked_where_they_lack(setup: Setup) -> None:
    assert program("GOTO/1,2,3\nENDFIL\n", setup).end_line == 4
    without = program("GOTO/1,2,3\n", setup, head="D(PART)=TRANS/XORIG,1\n").remarks
    assert [line for what, line, _ in without if what == "unit"] == [2]
    assert not [1 for what, *_ in program("GOTO/1,2,3\n", setup).remarks if what == "unit"]
    assert np.isfinite(program("GOTO/1,2,3\n", setup).toolpath.end_mm).all()
