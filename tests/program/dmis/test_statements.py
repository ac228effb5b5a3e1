"""Statements of DMIS by hand: units, styli, datums, modes, features, branches, macros and speeds."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import machine
from cases.readings import feeds_of, said, text_of

from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.core.toolpath import Flag, Kind
from olp.files.config import load_setup
from olp.program.dialect import Support
from olp.program.dmis import reader
from olp.program.dmis.table import TABLE
from olp.program.program import Program
from olp.program.registry import DIALECTS, read
from olp.program.text.statements import chunks

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
    assert refused("RECALL/RT(1)\n", setup, "RECALL is read for datums, sensors and features only") == 3


def test_a_sensor_that_is_recalled_has_to_be_selected(setup: Setup) -> None:
    """Whether RECALL selects it too, the controls do not agree; LK writes both."""
    point = [[100.0, 0.0, 53.0]]
    for word in ("S", "SA"):
        assert ends(f"RECALL/{word}(LONG)\nSNSLCT/S(LONG)\nGOTO/1,2,3\n", setup) == point
        assert ends(f"SNSLCT/S(LONG)\nRECALL/{word}(LONG)\nGOTO/1,2,3\n", setup) == point
        assert ends(f"RECALL/{word}(OWN)\nSNSLCT/{word}(LONG)\nGOTO/1,2,3\n", setup) == point
        words = "RECALL brings the sensor OWN back, .*; put SNSLCT behind it"
        assert refused(f"SNSLCT/S(LONG)\nRECALL/{word}(OWN)\nGOTO/1,2,3\n", setup, words) == 4
    again = "SNSLCT/S(LONG)\nGOTO/1,2,3\nRECALL/S(OWN)\nSNSLCT/S(LONG)\nGOTO/2,2,3\n"
    assert ends(again, setup) == [*point, [101.0, 0.0, 53.0]]
    assert refused("SNSLCT/S(LONG)\nRECALL/S(OWN)\nGOTO/1,2,3\nSNSLCT/S(LONG)\n", setup, "OWN back") == 4


@pytest.mark.parametrize(
    "comment",
    [
        "$$<CONSTRUCT_PLANE name = 'PLN: PNT1 $\n- PNT2- PNT3'>\n",
        "$$CONST/PLANE,F(P),BF,FA(A)$\n,FA(B),FA(C)\n",
        "$$ a $\n F2 - A $- B $\n  F3'>\n",
        "$$CALL/EXTERN,DMIS,'C:\\Sous$\nprg.dmi',A\n",
        "$$ a $\n$$ b\n",
        "$$ a $\n\n",
    ],
)
def test_a_comment_goes_on_where_its_next_line_is_no_statement(comment: str, setup: Setup) -> None:
    """As LK writes them; with the line as a statement of its own no control runs the program."""
    path = program(f"{comment}GOTO/1,2,3\n", setup).toolpath
    assert path.end_mm.tolist() == [[101.0, 2.0, 3.0]]
    assert path.line.tolist() == [3 + comment.count("\n")]


@pytest.mark.parametrize(
    "after",
    ["goto/1,2,3", "PTMEAS/CART,1,2,3", "A=5", "F(A)=FEAT/POINT", "ELSE", "(A B)", "GO$\nTO/1,2,3", "IF (A)"],
)
def test_what_may_be_a_statement_behind_an_open_comment_is_refused(after: str, setup: Setup) -> None:
    words = "the comment before ends with `\\$`"
    assert refused(f"$$ a $\n{after}\n", setup, words) == 4
    assert refused(f"$$ a $\n- b $\n{after}\n", setup, words) == 5


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
        ("GOTO/PROBCS,1,2,3", "GOTO/PROBCS is not read"),
        ("MEAS/POINT,F(P),1\nPTMEAS/1,2,3", "PTMEAS/1 is not read; expected CART"),
        ("MEAS/POINT,F(P),1\nPTMEAS/CART,1,2,3,4", "PTMEAS has 4 numbers; expected x,y,z and a direction"),
        ("SCAN/A", "scans in a form that is not known"),
        ("CALIB/RTAB,RT(1)", "expected CALIB/SENS"),
        ("JUMPTO/(L1)", "JUMPTO jumps, so which statements run"),
        ("LOCATE/XYDIR", "only the run of the program decides"),
        ("ROTAB/A", "moves an axis that is not read"),
        ("WHATEVER/1", "is not a statement that olp knows"),
        ("A=5", "is assigned, and its effect is known at run time only"),
    ],
)
def test_what_is_not_read_is_refused(text: str, words: str, setup: Setup) -> None:
    assert refused(text + "\n", setup, words) == 3 + text.count("\n")


def test_a_point_may_end_with_one_comma_and_name_its_form(setup: Setup) -> None:
    for point in ("1,2,3", "1,2,3,", "CART,1,2,3", "CART,1,2,3,", "1,2,3,,", "CART,1,2,3,,"):
        assert ends(f"GOTO/{point}\n", setup) == [[101.0, 2.0, 3.0]]


def test_endfil_ends_the_program_and_units_are_remarked_where_they_lack(setup: Setup) -> None:
    assert program("GOTO/1,2,3\nENDFIL\n", setup).end_line == 4
    without = program("GOTO/1,2,3\n", setup, head="D(PART)=TRANS/XORIG,1\n").remarks
    assert [line for what, line, _ in without if what == "unit"] == [2]
    assert not [1 for what, *_ in program("GOTO/1,2,3\n", setup).remarks if what == "unit"]
    assert np.isfinite(program("GOTO/1,2,3\n", setup).toolpath.end_mm).all()


# -- refusals ------------------------------------------------------------------------------------------

NAN = math.nan
FIXED = "PROBE,FIXED,CART,0,4,-20"


@pytest.mark.parametrize(
    ("text", "line", "code", "words"),
    [
        ("UNITS/FOOT", 3, "OLP512", "UNITS names a unit that is not read"),
        ("UNITS", 3, "OLP512", "UNITS names a unit that is not read"),
        ("SNSLCT", 3, "OLP516", "SNSLCT names no sensor"),
        ("SNSLCT/LONG", 3, "OLP516", "SNSLCT names no sensor"),
        ("SNSLCT/S(NONE)\nGOTO/1,2,3", 4, "OLP522", r'the stylus NONE is selected, .* \[styli\."NONE"\]'),
        ("TRANS/XORIG,1", 3, "OLP516", "TRANS has no label"),
        ("RECALL/RT(1)", 3, "OLP516", r"RECALL is read for datums, sensors and features only; give D\(\)"),
        ("RECALL", 3, "OLP516", "RECALL is read for datums, sensors and features only"),
        ("RECALL/ALIGN,'P'", 3, "OLP516", "RECALL is read for datums, sensors and features only"),
        ("RECALL/S(A)\nGOTO/1,2,3", 3, "OLP516", "RECALL brings the sensor A back"),
        ("///", 3, "OLP512", "a slash is not a statement that olp knows in DMIS"),
        ("RECALL/D(OTHER)\nGOTO/1,2,3", 4, "OLP520", r"the datum D\(OTHER\) needs the frame OTHER"),
        ("MEAS/POINT,F(A),1\nRMEAS/POINT,F(A),1", 4, "OLP532", "MEAS is inside MEAS"),
        ("ENDMES", 3, "OLP532", "ENDMES has no MEAS before it"),
        ("PTMEAS/CART,1,2,3", 3, "OLP532", "PTMEAS is outside MEAS and ENDMES"),
        ("IF/(A)\nENDDO", 4, "OLP532", "ENDDO has no DO before it"),
        ("ENDIF", 3, "OLP532", "ENDIF has no IF before it"),
        ("IF/(A)\nUNITS/MM\nENDIF", 4, "OLP511", "UNITS is inside IF, so whether it holds"),
        ("M(A)=MACRO\nUNITS/MM\nENDMAC", 4, "OLP511", "UNITS is inside MACRO, so whether it holds"),
        ("M(A)=MACRO\nTEXT/A\nGOTO/1,2,3\nENDMAC", 5, "OLP512", "the macro A moves the machine"),
        ("CALL/M(B)", 3, "OLP542", "CALL runs a macro that is not in this program"),
        ("IF/(A)\nTEXT/A", 4, "OLP532", "IF has no end"),
        ("DO/I,1,3\nIF/(A)\nENDIF", 5, "OLP532", "DO has no end"),
        ("A=5", 3, "OLP511", "A is assigned, and its effect is known at run time only"),
        ("ROTAB/1", 3, "OLP512", "ROTAB moves an axis that is not read"),
        ("UNITS A/MM", 3, "OLP512", "UNITS A is not a statement that olp knows"),
        ("TEXT (A)/MM", 3, "OLP512", r"TEXT \(A\) is not a statement that olp knows"),
        ("S(A)=LOCATE/1", 3, "OLP512", "LOCATE goes to a position that only the run of the program decides"),
        ("CALIB", 3, "OLP512", "CALIB/nothing is not read"),
        ("DMESW/COMAND,'X'", 3, "OLP512", "DMESW hands a command to the software of the machine"),
        ("DMESW", 3, "OLP512", "DMESW hands a command to the software of the machine"),
        ("PAMEAS/DISTANCE,1,P(A)", 3, "OLP532", "PAMEAS is outside MEAS"),
        ("CALIB/SENS,S(A)\nMEAS/POINT,F(A),1", 4, "OLP532", "MEAS is inside MEAS"),
        ("GOTO/POL,1,2", 3, "OLP516", "GOTO/POL has 2 numbers; expected r,angle,height$"),
        ("PTMEAS/POL,1,2,3,4", 3, "OLP516", "PTMEAS/POL has 4 numbers; expected r,angle,height and a dir"),
        ("GOTO/INCR,1,0,0", 3, "OLP516", "GOTO/INCR has 3 numbers; expected a distance and i,j,k in a GOTO"),
        ("PTMEAS/INCR,1,0,0,1", 3, "OLP516", "PTMEAS/INCR has 4 numbers; expected a distance"),
        ("GOTO/POL,1,A,3", 3, "OLP511", "GOTO has A where a number is expected"),
        ("GOTO/INCR,1,0,0,.99", 3, "OLP516", r"the direction of GOTO/INCR has length 0\.99; expected"),
        ("WKPLAN/NONE\nGOTO/POL,1,2,3", 4, "OLP518", "POL counts in the working plane"),
        ("$$ a $\nGOTO/1,2,3", 4, "OLP510", "the comment before ends with `\\$`"),
        ("PTMEAS/", 3, "OLP512", "PTMEAS/nothing is not read; expected CART"),
        ("PTMEAS/1,2,3", 3, "OLP512", "PTMEAS/1 is not read; expected CART"),
        ("GOTO/1,,3", 3, "OLP511", "GOTO has nothing where a number is expected"),
        ("GOTO/CART,1,A,B", 3, "OLP511", "GOTO has A where a number is expected"),
        ("GOTO/", 3, "OLP516", "GOTO has 0 numbers; expected x,y,z$"),
        ("GOTO/CART,1,2,3,0,0,1", 3, "OLP516", "GOTO has 6 numbers; expected x,y,z$"),
        ("GOTO/1,2,3\nGOTO/1,2,3,0,0,1", 4, "OLP516", "GOTO has 6 numbers; expected x,y,z$"),
        ("PTMEAS/CART,1,2", 3, "OLP516", "PTMEAS has 2 numbers; expected x,y,z and a direction$"),
    ],
)  # fmt: skip
def test_a_refusal_has_its_line_its_code_and_its_sentence(
    text: str, line: int, code: str, words: str, setup: Setup
) -> None:
    with pytest.raises(ProgramError, match=words) as caught:
        program(text + "\n", setup)
    assert (caught.value.line, caught.value.code) == (line, code)


def test_what_is_missing_in_the_files_is_named(setup: Setup, tmp_path: Path) -> None:
    with pytest.raises(ProgramError) as caught:
        program("SNSLCT/S(NONE)\nGOTO/1,2,3\n", setup)
    assert caught.value.missing == ("styli", "NONE")
    bare = load_setup(machine(tmp_path, controller="dmis"))
    with pytest.raises(ProgramError, match="the frame of the machine needs the frame MCS") as caught:
        program("GOTO/1,2,3\n", bare, head="UNITS/MM\n")
    assert caught.value.missing == ("work_offsets", "MCS")


def test_refusals_of_the_table_are_named_together(setup: Setup) -> None:
    """Those that other statements may put right are not among them, nor is what is behind the end."""
    text = "ROTAB/1\nA=5\nSCAN/1\nTEXT/A\nIF/1\nMEAS/A\n(B)\nIF (C)\nXTERN/1\nS(D)=CASE/1\nENDFIL\nJUMPTO/1\n"
    with pytest.raises(ProgramError, match="ROTAB") as caught:
        program(text, setup)
    others = caught.value.others
    assert [(e.line, e.code) for e in others] == [(5, "OLP512"), (11, "OLP512"), (12, "OLP512")]
    assert [str(e)[:9] for e in others] == ["5: SCAN s", "11: XTERN", "12: CASE "]
    with pytest.raises(ProgramError) as caught:
        program("A=5\nSCAN/1\n", setup)
    assert caught.value.others == ()


def test_behind_the_end_nothing_counts(setup: Setup) -> None:
    text = "GOTO/1,2,3\nENDFIL\nGOTO/A\nGOTO/4,5,6\nROTAB/1\nPTMEAS/1\n"
    assert ends(text, setup) == [[101.0, 2.0, 3.0]]
    assert program("DO/I,1,3\nENDFIL\n", setup).end_line == 4
    assert program("GOTO/1,2,3", setup).end_line == 3
    assert program("GOTO/1,2,3\n", setup).end_line == 4


# -- frames and styli ----------------------------------------------------------------------------------


def test_the_tool_of_the_machine_counts_until_a_stylus_is_selected(tmp_path: Path) -> None:
    """Axes count at the end of the ram: a tool of 30 mm has its tip as far below."""
    tables = TABLES + "[tools.3]\nZ_mm = 30.0\n[job_defaults]\ntool = 3\n"
    setup = load_setup(machine(tmp_path, controller="dmis", tables=tables))
    path = program("GOTO/1,2,3\nSNSLCT/S(LONG)\nGOTO/1,2,3\n", setup).toolpath
    assert path.end_mm[[0, 2]].tolist() == [[101.0, 2.0, 33.0], [100.0, 0.0, 53.0]]
    frames = [path.frames[k] for k in path.frame.tolist()]
    assert [f.tool for f in frames] == [3, 3, None]
    assert [f.tool_mm for f in frames[::2]] == [(0.0, 0.0, -30.0), (1.0, 2.0, -50.0)]
    assert [f.length_mm for f in frames[::2]] == [(0.0, 0.0, 30.0), (-1.0, -2.0, 50.0)]


def test_a_turned_datum_turns_points(tmp_path: Path) -> None:
    tables = '[work_offsets.PART]\nset_by = "true"\nX_mm = 100.0\nC_deg = 90.0\n'
    setup = load_setup(machine(tmp_path, controller="dmis", tables=tables))
    assert program("GOTO/1,2,3\n", setup).toolpath.end_mm == pytest.approx(np.array([[98.0, 1.0, 3.0]]))


def test_names_of_datums_are_found_in_capitals_or_not(tmp_path: Path) -> None:
    tables = '[work_offsets.part]\nset_by = "true"\nX_mm = 100.0\n'
    path = machine(
        tmp_path, controller="dmis", tables=tables, job='[work_offsets.Part]\nset_by = "true"\nX_mm = 300.0'
    )
    setup = load_setup(path, path.with_name("job.toml"))
    # the job comes before the machine
    assert ends("GOTO/1,2,3\n", setup) == [[301.0, 2.0, 3.0]]


@pytest.mark.parametrize(
    ("definition", "offset"),
    [
        ("PROBE,FIXED,CART,0.5,4,-20.25", [0.5, 4, -20.25]), ("FIXED,CART,0,4,-20,0,0,1,4", [0, 4, -20]),
        ("CART,0,4,-20", None), ("PROBE,CART,0,4,-20,FIXED", None), ("PROBE,FIXED,CART,0,4", None),
        ("PROBE,FIXED,0,4,-20", None), ("FIXED,0,4,-20,9", None),
    ],
)  # fmt: skip
def test_which_definitions_of_a_stylus_have_an_offset(
    definition: str, offset: list[float] | None, setup: Setup
) -> None:
    text = f"S(OWN)=SNSDEF/{definition}\nSNSDEF/PROBE,FIXED,CART,7,7,7\nSNSLCT/SA( OWN )\nGOTO/0,0,0\n"
    if offset is None:
        assert refused(text, setup, "the stylus OWN is selected") == 6
    else:
        assert ends(text, setup) == [[100.0 - offset[0], 0.0 - offset[1], 0.0 - offset[2]]]


def test_the_last_definition_of_a_stylus_holds(setup: Setup) -> None:
    text = f"S(OWN)=SNSDEF/{FIXED}\nS(OWN)=SNSDEF/INDEX,CART,0,0,1\nSNSLCT/S(OWN)\nGOTO/0,0,0\n"
    assert refused(text, setup, "the stylus OWN is selected") == 6


def test_what_is_recalled_and_is_no_datum_changes_nothing(setup: Setup) -> None:
    for text in ("RECALL/F(A)", "RECALL/FA(A)", "MODE", "MODE/AUTO,MAN", "FROM/9,9,9", "RAPID/ON",
    "DECL/A",
                 "ENDMAC", "MACRO/1", "(A B)", "( C )", "FEDRAT/MESVEL", "ASSIGN/A", "TEXT/MAN",
                 "$\n"):  # fmt: skip
        path = program(f"{text}\nGOTO/1,2,3\n", setup).toolpath
        assert path.end_mm.tolist() == [[101.0, 2.0, 3.0]], text
        assert path.flag.tolist() == [0]


def test_an_unknown_position_has_its_line_and_the_frame_before_it(setup: Setup) -> None:
    path = program("GOTO/1,2,3\nGOHOME\nSNSLCT/S(LONG)\nGOTO/1,2,3\nGOHOME\n", setup).toolpath
    assert path.line.tolist() == [3, 4, 5, 6, 7]
    assert path.flag.tolist() == [0, 129, 129, 0, 129]
    assert path.kind.tolist() == [Kind.RAPID] * 5
    assert [path.frames[k].tool_mm[2] for k in path.frame.tolist()] == [0.0, 0.0, 0.0, -50.0, -50.0]
    assert np.isnan(path.end_mm).all(axis=1).tolist() == [False, True, True, False, True]
    assert np.isnan(program("GOHOME\nGOTO/1,2,3\n", setup).toolpath.start_mm).all()


def test_where_the_machine_starts_is_that_of_the_job(tmp_path: Path) -> None:
    path = machine(tmp_path, controller="dmis", tables=TABLES, job="start_mm = { X = 1.0, Z = 3.0 }")
    start = program("GOTO/1,2,3\n", load_setup(path, path.with_name("job.toml"))).toolpath.start_mm
    assert (start[0], start[2]) == (1.0, 3.0)
    assert math.isnan(start[1])


# -- branches, features, remarks -----------------------------------------------------------------------


@pytest.mark.parametrize("form", ("IF/(A.EQ.1)", "IF (A .EQ. 1)", "IF(A .EQ. 1)", "if/(A.EQ.1)"))
def test_each_branch_begins_anywhere(form: str, setup: Setup) -> None:
    text = f"GOTO/1,2,3\n{form}\nGOTO/2,2,3\nELSEIF/(B)\nGOTO/3,2,3\nENDIF\nGOTO/4,2,3\n"
    want = [101.0, None, 102.0, None, 103.0, None, 104.0]
    assert [row and row[0] for row in ends(text, setup)] == want
    nested = f"{form}\nDO/I,1,2\n{form}\nENDIF\nENDDO\nENDIF\nMODE/MAN\nGOTO/1,2,3\n"
    assert ends(nested, setup) == [[101.0, 2.0, 3.0]]
    assert refused(f"{form}\nDO/I,1,2\nENDDO\nMODE/MAN\nENDIF\n", setup, "MODE is inside IF") == 6


def test_a_macro_ends_and_its_name_is_found_in_any_field(setup: Setup) -> None:
    text = "M(Ab)=MACRO/A\nTEXT/OPER,'a'\nENDMAC\nENDMAC\nUNITS/MM\nCALL/X,M(aB),Y\nGOTO/1,2,3\n"
    assert ends(text, setup) == [[101.0, 2.0, 3.0]]
    moved = "GOTO/1,2,3\nM(A)=MACRO\nENDMAC\nGOTO/2,2,3\n"
    assert ends(moved, setup) == [[101.0, 2.0, 3.0], [102.0, 2.0, 3.0]]


def test_a_feature_with_touches_ends_where_the_last_touch_is(setup: Setup) -> None:
    text = (
        "GOTO/1,2,3\nMEAS/POINT,F(P),1\nGOTO/1,2,4\nENDMES\nMEAS/POINT,F(P),1\n"
        "PTMEAS/CART,2,2,3\nPTMEAS/CART,3,2,3,0,0,1,\nGOTO/5,5,5\nENDMES\nGOTO/1,2,3\n"
    )
    path = program(text, setup).toolpath
    assert path.kind.tolist() == [0, 0, 0, Kind.PROBE, Kind.PROBE, 0, 0]
    assert path.flag.tolist() == [0, 0, 129, Flag.WHOLE, Flag.WHOLE, 0, 0]
    assert path.end_mm[3:, 0].tolist() == [102.0, 103.0, 105.0, 101.0]


def test_points_of_the_operator_are_not_corrected_whatever_they_are(setup: Setup) -> None:
    text = (
        "MODE/MAN\nMEAS/POINT,F(P),1\nPTMEAS/CART,2,2,3\nENDMES\nGOTO/1,2,3\nMODE/AUTO,PROG,MAN\nGOTO/1,2,3\n"
    )
    assert program(text, setup).toolpath.flag.tolist() == [Flag.WHOLE | Flag.PASS, Flag.PASS, 0]


def test_remarks_have_their_words(setup: Setup) -> None:
    text = "TEMPR/A\nTECOMP/ON\nGOTO/1,2,3\nGOTO/1,2,4\n"
    assert program(text, setup, head="").remarks == (
        ("thermal", 1, "TEMPR makes the control compensate"), ("unit", 3, "the program states no UNITS")
    )  # fmt: skip
    for text, line in (("TECOMP", 3), ("TECOMP/ON,OFF", 3), ("TECOMP/OFF,ON", None)):
        remarks = program(f"{text}\nGOTO/1,2,3\n", setup).remarks
        assert [at for what, at, _ in remarks if what == "thermal"] == ([] if line is None else [line])


@pytest.mark.parametrize(
    ("speed", "mm_s"),
    [("MPMM,6", 100.0), ("MMPM,60", 1.0), ("MPM,6", 100.0), ("IPM,6", 2.54), ("IPS,.5,9", 12.7),
    ("MMPS,2,IPS", 2.0),
     ("7", NAN), ("KNOTS,7", NAN)],
)  # fmt: skip
def test_speeds_of_measuring(speed: str, mm_s: float, setup: Setup) -> None:
    text = (
        f"MEAS/POINT,F(P),2\nPTMEAS/CART,2,2,3\nFEDRAT/MESVEL,{speed}\nPTMEAS/CART,3,2,3\n"
        f"ENDMES\nGOTO/1,1,1\n"
    )
    statements = program("FEDRAT/MESVEL,MMPS,5\n" + text, setup).statements
    assert statements is not None
    assert statements.feed_mm_s.tolist() == pytest.approx([5.0, mm_s, math.inf], nan_ok=True)


def test_only_the_speed_of_measuring_is_a_feed(setup: Setup) -> None:
    text = (
        "GOTO/1,1,1\nFEDRAT/POSVEL,MMPS,9\nGOTO/1,1,2\nFEDRAT/MESVEL,MMPS,5\nGOTO/1,1,1\n"
        "UNITS/MM\nGOTO/1,1,1\n"
    )
    text += "FEDRAT/MESVEL\nFEDRAT\nFEDRAT/20,MESVEL\nGOTO/1,1,1\n"
    done = program(text, setup)
    assert feeds_of(done) == [(0, 0, None), (2, 6, None), (4, 10, None)]
    assert done.statements is not None
    begins = zip(done.statements.begin, done.statements.end, strict=True)
    assert {text_of(done, a, b) for a, b in begins} == {b"GOTO/1,1,1", b"GOTO/1,1,2"}


# -- comments, headers, pieces -------------------------------------------------------------------------


@pytest.mark.parametrize(
    "comment", ("$$", "$$ a", "  $$ a $\n", "$$ a $\n$$ b", "$$ a $ \n  $$ b $\n$$", "$$ $\n\n", "$$ a$b")
)
def test_comments_that_end_before_the_next_line(comment: str, setup: Setup) -> None:
    assert ends(f"{comment}\nGOTO/1,2,3\n", setup) == [[101.0, 2.0, 3.0]]


def test_a_comment_may_go_on_at_the_end_of_the_text(setup: Setup) -> None:
    assert ends("GOTO/1,2,3\n$$ a $", setup) == [[101.0, 2.0, 3.0]]
    assert ends("GOTO/1,2,3\n$$ a $\n", setup) == [[101.0, 2.0, 3.0]]
    text = "GOTO/1,2,3\n$$ a\n$$ b  $\n  GOTO/1,2,3\n"
    assert refused(text, setup, "this line may belong to it") == 6


def test_the_header_of_winwerth_is_no_program(setup: Setup) -> None:
    text = "BEGIN / CHFILE\nROTAB/1\nGOTO/A\nA=5\nend/chfile\nGOTO/1,2,3\nEND/CHFILE\n"
    with pytest.raises(ProgramError, match="END is not a statement"):
        program(text + "END/X\n", setup)
    assert ends(text.removesuffix("END/CHFILE\n"), setup) == [[101.0, 2.0, 3.0]]
    assert refused("BEGIN/OTHER\nROTAB/1\nEND/CHFILE\n", setup, "BEGIN is not a statement") == 3


WHOLE = """DMISMN/'a',05.2
UNITS/MM,ANGDEC
S(OWN)=SNSDEF/PROBE,FIXED,CART,0,4,-20,0,0,1,4
$$ a comment
D(PART)=TRANS/XORIG,1
GOTO/1,2,3
SNSLCT/S(OWN)
FEDRAT/MESVEL,MMPS,5
GOTO/CART,1.$
5,2,3
MEAS/POINT,F(P),1
PTMEAS/CART,2,2,3,-1,0,0
GOTO/2,2,3
PTMEAS/CART,3,2,3
ENDMES
MODE/MAN
GOTO/4,2,3
MODE/PROG,MAN
IF/(A.EQ.1)
GOTO/5,2,3
GOTO/6,2,3
ENDIF
MEAS/POINT,F(P),1
ENDMES
M(A)=MACRO
ENDMAC
CALL/M(A)
RECALL/D(MCS)
GOTO/1,2,3
ENDFIL
GOTO/9,9,9
"""


@pytest.mark.parametrize("size", (1, 20, 60, 130, 300))
def test_a_text_says_the_same_in_pieces(size: int, setup: Setup, monkeypatch: pytest.MonkeyPatch) -> None:
    """Long texts are read in pieces of whole lines: what holds for the next point goes on in the next one."""
    whole = said(program(WHOLE, setup, head=""))
    assert len(whole["kind"]) == 13
    monkeypatch.setattr(reader, "chunks", lambda data, **told: chunks(data, size, **told))
    assert said(program(WHOLE, setup, head="")) == whole


# -- the table of statements ---------------------------------------------------------------------------

#: words of DMIS by what becomes of their statements
WORDS = {
    Support.CORRECTED: "GOTO PTMEAS",
    Support.READ: "MEAS RMEAS ENDMES FROM GOHOME RAPID UNITS SNSDEF SNSLCT TRANS ROTATE DATSET RECALL "
    "MODE TECOMP PAMEAS CALIB WKPLAN DMESW "
    "TEMPR FEDRAT IF ELSE ELSEIF ENDIF DO ENDDO MACRO ENDMAC CALL ENDFIL",
    Support.UNCHANGED: "FEAT TOL CONST DATDEF DATTRG OUTPUT EVAL REFMNT BOUND FILNAM DMISMN DMISMD "
    "DVPOFT DECPL "
    "TEXT SNSET ACLRAT FLY PRCOMP SAVE DMEID "
    "DMESWI DMESWV MATDEF GECOMP PATH SCNMOD "
    "SCNSET SCNPLN DISPLY DISPLAY VFORM OPEN CLOSE WRITE REPORT GEOALG "
    "ALGDEF LITDEF "
    "FILDEF CZSLCT CZONE PIEZOWFP POINTDIST SCANFILTER SPLINESCAN3D W3D DELETE DEVICE DID FINPOS MFGDEV "
    "PARTID "
    "PARTREV PARTSER QISDEF OPERID PLANID LOTID DATE TIME CMPNTGRP SENSOR SNSMNT SNSGRP WRIST EXTENS "
    "THLDEF CLMPID "
    "CLMPSN FIXTID FIXTSN PREVOP PROCID ROTDEF CRGDEF ERROR BADTST ALGOR LOTNUM KEYCHAR QUERY VALUE "
    "LIGHTOPTION "
    "SIMREQT UNCERTSET UNCERTALG ENDXTN DECL PSTHRU ASSIGN OBTAIN PROMPT PAUSE",
    Support.REFUSED: "SCAN JUMPTO SELECT CASE ENDCAS DFTCAS ENDSEL XTERN INCLUD LOCATE ITERAT BFSET PTBUFF "
    "GOTARG ENDGO "
    "RESUME ROTSET ROTAB CRSLCT CRMODE THLCHG",
}  # fmt: skip


def test_each_word_has_its_row_in_the_table() -> None:
    want = {word.encode(): support for support, words in WORDS.items() for word in words.split()}
    assert {word: support for word, (support, _) in TABLE.items()} == want
    feature = (
        "FEAT TOL CONST DATDEF DATTRG OUTPUT EVAL REFMNT BOUND ASSIGN OBTAIN PROMPT PATH SCNMOD SCNSET "
        "SCNPLN PAUSE"
    )
    clear = {*WORDS[Support.UNCHANGED].split()} - {*feature.split()}
    clear |= {"ENDMES", "ELSE", "ELSEIF", "ENDIF", "ENDDO", "ENDMAC"}
    assert {word.decode() for word, (_, why) in TABLE.items() if why == ""} == clear


def test_what_has_no_effect_on_the_path_is_passed_over(setup: Setup) -> None:
    words = WORDS[Support.UNCHANGED].split()
    text = "".join(f"{word}/ON\nF(A) = {word.lower()} / 1,2\n" for word in words)
    assert ends(text + "GOTO/1,2,3\n", setup) == [[101.0, 2.0, 3.0]]


def test_what_the_table_refuses_is_refused_with_its_reason(setup: Setup) -> None:
    words = WORDS[Support.REFUSED].split()
    with pytest.raises(ProgramError) as caught:
        program("".join(f"{word}/1\n" for word in words), setup)
    errors = [caught.value, *caught.value.others]
    assert [error.line for error in errors] == list(range(3, len(words) + 3))
    for word, error in zip(words, errors, strict=True):
        assert str(error) == f"{error.line}: {word} {TABLE[word.encode()][1]}"
