"""What a Sinumerik makes of its words, by hand: where a program ends, or why it is refused."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine

import olp
from olp.core.errors import ProgramError, Refused
from olp.core.machine import Setup
from olp.core.toolpath import Flag, Kind
from olp.files.config import load_setup
from olp.program import survey
from olp.program.feeds.stated import programmed
from olp.program.program import Program
from olp.program.registry import DIALECTS, dialect_of, read
from olp.program.rs274 import reader
from olp.program.rs274.lexer import chunks
from olp.program.sinumerik.flatten.unroll import flatten
from olp.program.sinumerik.translate import translate

SINUMERIK = DIALECTS["sinumerik"]
#: Two offsets, and a tool that programs call by its name.
TABLES = (
    TRUE_ZERO
    + '[work_offsets.G505]\nX_mm = 1000.0\nset_by = "true"\n'
    + '[tools.7]\nname = "MILL 8"\nZ_mm = 70.0\nradius_mm = 4.0\ngauge_to_tip_mm = [0.0, 0.0, -70.0]\n'
    + "[tools.2]\nZ_mm = 20.0\ngauge_to_tip_mm = [0.0, 0.0, -20.0]\n"
)


@pytest.fixture(scope="module")
def setup(tmp_path_factory: pytest.TempPathFactory) -> Setup:
    return load_setup(machine(tmp_path_factory.mktemp("m"), tables=TABLES, controller="sinumerik"))


def program(text: str, setup: Setup) -> Program:
    return read(text.encode(), setup, SINUMERIK)


def test_m96_is_a_code_of_the_builder(setup: Setup) -> None:
    """It branches on other controls; here it may move axes where the machine file does not say otherwise."""
    text = "G71 G90 G17 G54\nG0 X1 Y2 Z3\nM96\nG1 X5 F600\n"
    assert np.isnan(program(text, setup).toolpath.end_mm[-1]).tolist() == [False, True, True]
    still = replace(setup, machine=replace(setup.machine, still_m_codes=frozenset({96})))
    assert end(text, still) == [5.0, 2.0, 3.0]
    with pytest.raises(ProgramError, match="M98 calls a subprogram"):
        program(text.replace("M96", "M98"), setup)


def end(text: str, setup: Setup) -> list[float]:
    return [round(v, 9) for v in program(text, setup).toolpath.end_mm[-1].tolist()]


ZERO = "G0 X0 Y0 Z0\n"
#: A program, and where it ends.
ENDS: dict[str, tuple[float, float, float]] = {
    # words with `=`, and functions around numbers
    "X=5 Y = -3.5 Z0": (5, -3.5, 0),
    ZERO + "G91 X1\nX=IC(2) Y3": (3, 3, 0),
    ZERO + "X=AC(4) Y1": (4, 1, 0),
    # one letter takes its number directly: an axis C, and not an axis C25
    ZERO + "X1 C25.815": (1, 0, 0),
    # a numbered spindle ends no program, and turns nothing else
    ZERO + "M2=3\nX1": (1, 0, 0),
    "N10 def real _TOL, XY2 ; a\nDEF INT _K\n" + ZERO + "X1": (1, 0, 0),
    ZERO + "X1\nM17\nX2": (1, 0, 0),
    ZERO + "X1\nRET\nX2": (1, 0, 0),
    # strings and comments with marks of the other kind
    ZERO + 'MSG("X5; (Y6")\nX1 ; (X9': (1, 0, 0),
    ZERO + "N10 X1\n:20 Y2": (1, 2, 0),
    # inches of lengths, and of lengths and feeds
    ZERO + "G70 X1": (25.4, 0, 0),
    ZERO + "G700 X1\nG71 Y1": (25.4, 1, 0),
    ZERO + "G710 X1": (1, 0, 0),
    # settable offsets
    ZERO + "G505 X1": (1001, 0, 0),
    ZERO + "G500 X1": (1, 0, 0),
    # the programmable frame: TRANS replaces all of it, ATRANS adds, unprogrammed axes stay
    "TRANS X10 Y5\nG0 X1 Y1 Z0": (11, 6, 0),
    ZERO + "X5\nTRANS X10\nY1": (5, 1, 0),
    "TRANS X10\nATRANS X5 Y2\nG0 X0 Y0 Z0": (15, 2, 0),
    "TRANS X10\nTRANS Y2\nG0 X0 Y0 Z0": (0, 2, 0),
    "TRANS X10\nTRANS\nG0 X0 Y0 Z0": (0, 0, 0),
    "ROT Z90\nG0 X1 Y0 Z0": (0, 1, 0),
    "ROT RPL=90\nTRANS X3\nG0 X1 Y0 Z0": (4, 0, 0),
    "TRANS X10\nAROT Z90\nG0 X1 Y0 Z0": (10, 1, 0),
    "ROT Z90\nATRANS X10\nG0 X1 Y0 Z0": (0, 11, 0),
    "TRANS X10\nROT Z90\nG0 X1 Y0 Z0": (0, 1, 0),
    "MIRROR X0\nG0 X1 Y2 Z0": (-1, 2, 0),
    "SCALE X2 Y2 Z2\nATRANS X1\nG0 X1 Y0 Z0": (4, 0, 0),
    "TRANS X1\nROT\nG0 X1 Y0 Z0": (1, 0, 0),
    # machine coordinates keep the length of the tool, D0 ends it
    'T="MILL 8" M6\nG0 X0 Y0 Z0': (0, 0, 70),
    'T="MILL 8" M6\nG0 X0 Y0 Z0\nSUPA Z5': (0, 0, 75),
    'T="MILL 8" M6\nG0 X0 Y0 Z0 D0': (0, 0, 0),
    "T2 M6\nD0\nG0 X0 Y0 Z0\nD1 Z1": (0, 0, 21),
    "T2 M6\nG0 X0 Y0 Z0\nG153 Z1 D0": (0, 0, 1),
    # arcs
    ZERO + "G2 X10 Y0 CR=5": (10, 0, 0),
    ZERO + "G2 X10 Y0 I=AC(5) J=AC(0)": (10, 0, 0),
    # times, speeds and limits are no motion
    ZERO + "G4 F5\nX1": (1, 0, 0),
    ZERO + "G26 X5 S1000\nX1": (1, 0, 0),
    ZERO + "S1=500 M1=3 H5 LIMS=2000 SPOS=90\nX1": (1, 0, 0),
    ZERO + "CYCLE800()\nTRAFOOF\nX1": (1, 0, 0),
    # both parts of the programmable offset, one by one
    "TRANS X10 Y10 Z10\nATRANS X5 Y5\nG58 X20\nG0 X0 Y0 Z0": (25, 15, 10),
    "TRANS X10 Y10 Z10\nATRANS X5 Y5\nG58 X20\nG59 X10 Y10\nG0 X0 Y0 Z0": (30, 20, 10),
    "G59 X3\nTRANS\nG0 X0 Y0 Z0": (0, 0, 0),
    # a turned frame stays where the offset changes, and machine coordinates have none
    "ROT Z90\nG505 G0 X1 Y0 Z0": (1000, 1, 0),
    "ROT Z90\nG0 X1 Y0 Z0\nG0 SUPA X5 Y6": (5, 6, 0),
    # settable offsets that the program writes
    "$P_UIFR[1]=CTRANS(X,10,Y,20)\nG54 G0 X0 Y0 Z0": (10, 20, 0),
    "$P_UIFR[6]=CTRANS(X,10,Y,20) : CROT(X,0,Z,0.0)\nG506 G0 X0 Y0 Z0": (10, 20, 0),
    "$P_UIFR[5,Y,TR]=-7.5\nG505 G0 X0 Y0 Z0": (1000, -7.5, 0),
    # other axes, with functions around their numbers
    ZERO + "X1 C=DC(30) B=ACP(5)": (1, 0, 0),
    # the depth of a hole by its mode, and where one of the two is 0
    ZERO + "CYCLE82(9,1,2,-5,0,0.5,0,1,12)": (0, 0, 9),
    ZERO + "CYCLE82(9,1,2,0,5,0.5)": (0, 0, 9),
    # the side, with the radius of the edge in force, and off again
    "T7 M6\nNORM G450 DISC=0\nG0 X0 Y0 Z0\nG1 G41 D1 X10 Y10\nX20\nG41 X30": (30, 14, 70),
    "T7 M6\nKONT\nNORM\nG0 X0 Y0 Z0\nG1 G42 X10 Y10\nX20\nG40 X30": (30, 10, 70),
    # a cycle behind every block with motion, and behind no other
    ZERO + "Z9\nMCALL CYCLE81(7,0,2,-5)\nX1\nMCALL\nX2": (2, 0, 7),
    ZERO + "Z9\nX1\nCYCLE82(4,0,2,,5,1)": (1, 0, 4),
}


@pytest.mark.parametrize("text", ENDS, ids=lambda t: t.replace("\n", " | "))
def test_a_program_ends_where_the_manual_says(text: str, setup: Setup) -> None:
    assert end(text, setup) == [float(v) for v in ENDS[text]]


#: A program whose last line is refused, what is said, and the code.
REFUSED: dict[str, tuple[str, str]] = {
    ZERO + "X=IC(2)": ("X is a distance in G90; unroll", "OLP511"),
    'RET("AA",1)': ("may go on at another block", "OLP542"),
    "X1 RET": ("write RET alone", "OLP542"),
    "G1 X50 F500\nFB=100 X60": ("give F there", "OLP512"),
    "X=DC(20)": ("DC belongs to rotary axes", "OLP512"),
    ZERO + "G91\nX=AC(2)": ("X is a position in G91; unroll", "OLP511"),
    "R1=5+1": ("--flatten", "OLP511"),
    # the control rounds it, or makes TRUE of it
    "DEF INT _NNN\n_NNN=2.7": ("--flatten", "OLP511"),
    ZERO + "DEF INT _NNN=2.7\nX=_NNN": ("--flatten", "OLP511"),
    "DEF BOOL _FLAG\n_FLAG=5": ("--flatten", "OLP511"),
    "MYVAR=5": ("--flatten", "OLP511"),
    "R1=5\nX=R1+1": ("--flatten", "OLP511"),
    "R1=5\nX=-R1": ("--flatten", "OLP511"),
    # the number has no room in the place of the name
    "R1=123.4\nX=R1": ("--flatten", "OLP511"),
    "/_A=5": ("depend on the switch", "OLP525"),
    "DEF STRING[9] SS=5\nX=SS": ("--flatten", "OLP511"),
    "X=R1": ("--flatten", "OLP511"),
    "X=2*3": ("--flatten", "OLP511"),
    "IF R1==1 GOTOF A": ("--flatten", "OLP511"),
    "DEF REAL A, B=2*3": ("--flatten", "OLP511"),
    "DEF AXIS A": ("--flatten", "OLP511"),
    "MYSUB": ("subprogram or a statement that is not known", "OLP511"),
    "L100 P2": ("`L100` uses", "OLP511"),
    "TRAORI": ("rotary axes", "OLP512"),
    'CYCLE800(0,"T",0,57,0,0,0,30,0,0)': ("rotary axes", "OLP512"),
    "G33 Z-10 K1": ("thread", "OLP512"),
    # no work offset, as on other controls
    "ROT Z30\nG58 X5": ("turned, scaled or mirrored", "OLP512"),
    "G59 X5\nTRANS X1": ("manuals differ", "OLP518"),
    "TRANS X1\nG70\nG59 X5": ("turned, scaled or mirrored", "OLP512"),
    "G58 X5 F100": ("blocks of their own", "OLP518"),
    ZERO + "$P_UIFR[1]=CTRANS(X,1)": ("counts from the next G54", "OLP518"),
    "G70\n$P_UIFR[2]=CTRANS(X,1)": ("in which unit", "OLP518"),
    "$P_UIFR[2,X,TR]=1": ("is not defined", "OLP520"),
    "$P_UIFR[2]=CROT(Z,1)": ("as shifts", "OLP512"),
    "$P_UIFR[2]=CTRANS(X,1):CROT(Z,0.5)": ("as shifts", "OLP512"),
    "$P_UIFR[2]=CTRANS(A,1)": ("as shifts", "OLP512"),
    "$TC_DP3[1,1]=100": ("variable of the control", "OLP512"),
    "G21": ("not known to the sinumerik profile", "OLP512"),
    "G43 H1": ("not known to the sinumerik profile", "OLP512"),
    "G291": ("ISO mode", "OLP512"),
    "G18\nROT RPL=30": ("tilts the plane", "OLP512"),
    "ROT X30": ("tilts the plane", "OLP512"),
    "G110 X5": ("G110 uses", "OLP511"),
    "X1 RND=2": ("`RND=2` uses", "OLP511"),
    "G41 X1": ("edge in force", "OLP532"),
    "T2 M6\nG41 X1": ("radius of tool 2, which is not known", "OLP513"),
    "T7 M6\nKONT\nG41 X1": ("comes with KONT", "OLP518"),
    "T7 M6\nG451\nDISC=50 OFFN=1\nG42 X1": ("comes with DISC, G451, OFFN", "OLP518"),
    "T7 M6\nG41 X1\nG42 X2": ("on already", "OLP528"),
    "T7 M6\nG41 X1\nTRANS X2": ("frame is in cutter compensation", "OLP518"),
    "T7 M6\nG41 X1\nD0": ("another edge is in cutter compensation", "OLP518"),
    "T7 M6\nG41 X1\nT2\nM6": ("tool change is in cutter compensation", "OLP518"),
    "T7 M6\nG41 X1\nG505": ("offsets is in cutter compensation", "OLP518"),
    "POCKET3(1,2,3)": ("inside the control", "OLP512"),
    "X1 ?": ("is not understood", "OLP510"),
    "X=AC(1": ("not closed", "OLP510"),
    "X1Y": ("is not understood", "OLP510"),
    'T="NONE"': ("name of 0 tools", "OLP521"),
    "T2 M6\nD2": ("another edge", "OLP521"),
    "D1": ("tool in the spindle, which is not known", "OLP532"),
    "/TRANS X1": ("block delete", "OLP525"),
    "T2 M6\nG0 X0 Y0 Z0\nG18 X1": ("outside of G17", "OLP518"),
    ZERO + "G91 X1\nG505 X1": ("behind a change of offsets", "OLP518"),
    "MCALL CYCLE81(7,0,2)": ("DP or DPR", "OLP531"),
    "MCALL CYCLE82(7,0,2,-5,,0,0,1,11)": ("1 takes DPR", "OLP531"),
    "MCALL CYCLE82(7,0,2,,5,0,0,1,12)": ("1 takes DPR", "OLP531"),
    "MCALL CYCLE82(7,0,2,-5,6,0,0,1,12)": ("depth twice", "OLP531"),
    "MCALL CYCLE82(7,0,2,-5,,0,1,1,12)": ("to a diameter", "OLP544"),
    "MCALL CYCLE82(7,0,2,-5,,0,0,2,12)": ("another plane", "OLP544"),
    "MCALL CYCLE81(7,0,2,-5,6)": ("depth twice", "OLP531"),
    "MCALL CYCLE86(7,0,2,-5,,1,3,1,1,1,45)": ("wall of the hole", "OLP544"),
    "MCALL POCKET3(7)": ("inside the control", "OLP512"),
    "MCALL CYCLE81(7,0,2,R5)": ("--flatten", "OLP511"),
    "NaN": ("not known", "OLP511"),
}


@pytest.mark.parametrize("text", REFUSED, ids=lambda t: t.replace("\n", " | "))
def test_what_is_not_read_is_refused_with_its_line_and_a_way(text: str, setup: Setup) -> None:
    message, code = REFUSED[text]
    with pytest.raises(ProgramError) as caught:
        program(text, setup)
    assert message in str(caught.value)
    assert (caught.value.code, caught.value.line) == (code, text.count("\n") + 1)


def test_all_refusals_of_a_text_are_told_together(setup: Setup) -> None:
    with pytest.raises(ProgramError) as caught:
        program("TRAORI\nX1\nR1=2*3\nM30\nR3=4", setup)
    assert [e.line for e in (caught.value, *caught.value.others)] == [1, 3]


def test_lengths_may_count_along_z_in_every_plane(setup: Setup) -> None:
    stated = replace(setup, machine=replace(setup.machine, lengths_along_z=True))
    path = program("T2 M6\nG0 X0 Y0 Z0\nG18\nG2 X10 Z0 I5 K0 F100", stated).toolpath
    assert path.end_mm[-1].tolist() == [10.0, 0.0, 20.0]
    assert path.arcs.centre_mm.tolist() == [[5.0, 0.0, 20.0]]


CONSTANT = [
    "DEF REAL _X_HOME=-12.5, _F_CUT\n_F_CUT=250\nG1 X=_X_HOME Y5 F=_F_CUT\n_X_HOME=3\nX=_X_HOME",
    "R12=7 R13=-2 R14=3\nTRANS X=R12 Y5\nG1 X1 Y=R13 F100\nG2 X=R12 I=R14",
    "DEF REAL _ZERO\nG0 X4\nX=_ZERO",
]


@pytest.mark.parametrize("text", CONSTANT)
def test_variables_that_stand_for_numbers_are_read_as_they_are_unrolled(text: str, setup: Setup) -> None:
    own = program(ZERO + text, setup)
    plain = read(bytes(flatten((ZERO + text).encode(), SINUMERIK)), setup, SINUMERIK)
    assert own.toolpath.end_mm.tolist() == plain.toolpath.end_mm.tolist()
    assert programmed(own).tolist() == pytest.approx(programmed(plain).tolist(), nan_ok=True)


def test_a_number_comes_in_the_place_of_a_variable(tmp_path: Path) -> None:
    """Where it has to change; the others stay."""
    path = machine(tmp_path, "[squareness]\nC0Y_urad = 2000.0\n", tables=TRUE_ZERO, controller="sinumerik")
    text = "G71 G90 G54\nG0 X0 Y0 Z0\n_X_OUT=-10 _F_CUT=250\nG1 X=_X_OUT Y50.0 F=_F_CUT ; X=5\n"
    text += "SUPA X=_X_OUT\nM30\n"
    written = olp.correct(text.encode(), load_setup(path)).data
    assert b"_X_OUT=-10 _F_CUT=250\n" in written
    assert re.search(rb"\nG1 X=-9\.\d+ Y50\.0 F=_F_CUT ; X=5\nSUPA X=_X_OUT\n", written)


def test_a_call_that_is_refused_is_one_reason_with_its_arguments(setup: Setup) -> None:
    text = b"G0 X0 Y0 Z5\nPOCKET3(50,0,2,-10,MAX(1,2))\nG1 X1 A3=0 F100\nCYCLE61(50,,2)\n"
    with pytest.raises(Refused) as caught:
        survey.read_all(text, setup, SINUMERIK)
    assert [reason.line for reason in caught.value.reasons] == [2, 3, 4]


def test_a_hole_goes_down_behind_the_motion_of_its_block(setup: Setup) -> None:
    """To RFP + SDIS as a rapid, to the bottom at the feed, and to RTP."""
    path = program(ZERO + "Z9\nMCALL CYCLE85(7,1,2,-5)\nX1\nF200\nY1\nMCALL", setup).toolpath
    rows = [(k, *p) for k, p in zip(path.kind[2:].tolist(), path.end_mm[2:].tolist(), strict=True)]
    hole = [(Kind.RAPID, 3), (Kind.LINE, -5), (Kind.LINE, 3), (Kind.RAPID, 7)]
    first = [(Kind.RAPID, 1, 0, 9), *((k, 1, 0, z) for k, z in hole)]
    assert rows == [*first, (Kind.RAPID, 1, 1, 7), *((k, 1, 1, z) for k, z in hole)]
    # no block may come behind a motion that calls a cycle, and its strokes have no words
    flags = path.flag[2:].tolist()
    assert flags == [Flag.WHOLE, *[Flag.CYCLE] * 4] * 2


DEPTHS = {
    "1,2,-5,0,0,0,1,12": -5,
    "1,2,0,5": -4,
    "1,2,,5,0,0,1,11": -4,
    "1,2,-5": -5,
    "1,2,-4,5": -4,
    "1,2,-5,0": -5,
}


@pytest.mark.parametrize("given", DEPTHS)
def test_how_deep_a_hole_is(given: str, setup: Setup) -> None:
    path = program(f"{ZERO}CYCLE82(9,{given})", setup).toolpath
    assert path.end_mm[path.kind == Kind.LINE, 2].tolist() == [DEPTHS[given]]


def test_turns_beyond_the_first_part_of_an_arc(setup: Setup) -> None:
    path = program(ZERO + "G2 X10 Y0 I5 J0 TURN=2 Z-3", setup).toolpath
    assert path.arcs.sweep_rad.tolist() == pytest.approx([-5 * np.pi])


def test_feeds_in_metric_units_beside_lengths_in_inches(setup: Setup) -> None:
    feeds = [programmed(program(f"{g} G0 X0 Y0 Z0\nG1 F120 X1", setup))[-1] for g in ("G70", "G700", "G71")]
    assert feeds == pytest.approx([2.0, 2.0 * 25.4, 2.0])


@pytest.mark.parametrize(
    ("file", "text", "name"),
    [
        ("a.mpf", b"G0 X1", "sinumerik"), ("A.SPF", b"", "sinumerik"),
        ("a.nc", b"%_N_A_MPF\nG0 X1", "sinumerik"),
        ("a.nc", b"N10 MCALL CYCLE81(1,2,3)", "sinumerik"), ("a.nc", b"G0 X1", "haas"),
    ],
)  # fmt: skip
def test_texts_are_known_by_their_ending_and_their_signs(file: str, text: bytes, name: str) -> None:
    assert dialect_of(None, DIALECTS["haas"], text, file).name == name


def test_plain_lines_stay_byte_for_byte(setup: Setup) -> None:
    """Their translation is themselves, of the same length."""
    text = b"N10 G1 X1.5 Y-.5 F100 ; CYCLE81(\nG17 G90 M3 S100\n/1 N5 g0z5\r\nT1\n"
    assert translate(text).text is text
    other = text + b"X=1 CR=5 (\n" + b'MSG("a;b") ; X=5\n'
    assert len(translate(other).text) == len(other)


def test_numbers_in_brackets_are_edited_inside_of_them(tmp_path: Path) -> None:
    """Words that are inserted come behind the bracket; centres of later parts are written as positions."""
    path = machine(tmp_path, "[squareness]\nC0Y_urad = 2000.0\nB0Z_urad = 1000.0\n", tables=TRUE_ZERO,
                   controller="sinumerik")  # fmt: skip
    text = (
        b"G71 G90 G54 F600\nG0 X0 Y0 Z0\nG1 X=AC(10) Y=AC(20)\nY=AC(60)\nY=AC(20)\nZ5\n"
        b"G2 X60 Y20 I=AC(35) J=AC(20) TURN=1\nM30\n"
    )
    written = olp.correct(text, load_setup(path)).data
    assert re.search(rb"\nY=AC\(60\.?\d*\) X[\d.]+\n", written)
    sweep = read(written, load_setup(path), SINUMERIK).toolpath.arcs.sweep_rad
    assert sweep.sum() == pytest.approx(-3 * np.pi, abs=1e-3)
    assert re.search(rb"G1 X=AC\(\d+\.\d+\) Y=AC\(\d+\.?\d*\)\n", written)
    tails = [line for line in written.splitlines() if line.startswith(b"X") and b"I" in line]
    assert tails and all(re.fullmatch(rb"X\S+ Y\S+( Z\S+)? I=AC\(\S+\) J=AC\(\S+\)", line) for line in tails)
    assert not re.search(rb"\bP\d", written)


def test_no_block_comes_between_a_motion_and_its_hole(tmp_path: Path) -> None:
    """Each hole of the corrected text is made once, also where play has to be taken up."""
    path = machine(tmp_path, "[squareness]\nC0Y_urad = 900.0\n[backlash]\nX_um = 20.0\nY_um = 20.0\n",
                   tables=TRUE_ZERO, controller="sinumerik")  # fmt: skip
    setup = load_setup(path)
    body = "".join(
        f"{g} X{x} Y{y}\n" for g, x, y in [("G0", 0, 0), ("G1", 90, 7), ("G0", 20, 80), ("G1", 5, 5)]
    )
    head = "G71 G90 G54 F600\nG0 X0 Y0 Z9\nG1 Z8\nMCALL CYCLE81(9,0,2,-5)\n"
    text = f"{head}{body}MCALL\nG1 X1 Y1\nM30\n".encode()
    written = olp.correct(text, setup).data
    assert written != text
    counts = [int((read(t, setup, SINUMERIK).toolpath.flag == Flag.CYCLE).sum()) for t in (text, written)]
    assert counts == [12, 12]


@pytest.mark.parametrize("size", [1, 40, 200])
def test_the_reading_does_not_depend_on_the_chunks(
    size: int, setup: Setup, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = "".join(
        t.replace(ZERO, "") + f"\nG40 G0 X{i} Y1 Z2\n"
        for i, t in enumerate(ENDS)
        if "M17" not in t and "G2 " not in t and "G41" not in t and "G42" not in t
    )
    text = f"T2 M6\n{ZERO}{text.replace('RET', '')}"
    text = text.replace("G91 X1\nX=IC(2) Y3", "G91 X1\nX=IC(2) Y3\nG90")
    whole = program(text, setup).toolpath
    monkeypatch.setattr(reader, "chunks", partial(chunks, size=size))
    parts = program(text, setup).toolpath
    for name in ("kind", "flag", "line", "end_mm"):
        assert np.array_equal(getattr(whole, name), getattr(parts, name), equal_nan=name == "end_mm")


@pytest.mark.parametrize(
    "line",
    [
        "X=5", "G1 x=-5.5Y=.5 F=300", "G2 X=1 Y2 CR=5.25", "g3x1y=2cr=-.5", "N5 S=500 M3 ; X=7", "T=2",
        "X=5 ;a", "X=5", "I=5 J=-5 K=.1", "X= 5", "X =5", "X=AC(5)", "CR =5", "A=5 U=6",
    ],
)  # fmt: skip
def test_numbers_with_a_sign_are_the_same_words_in_columns_and_one_by_one(line: str) -> None:
    """What stands beside it takes a line out of the columns."""
    beside = line.partition(";")[0] + " SOFT"
    code = line.partition(";")[0].encode()
    columns = translate(f"{line}\r\n".encode())
    single = translate(beside.encode())
    assert not columns.refused and not single.refused
    assert columns.text[: len(code)].split() == single.text[: len(code)].split()


@pytest.mark.parametrize(
    "line", ["X=5 +3", "X=5-3", "X=5 DIV 2", "X=R1", "X=--5", "X=5*2", "CR=5 *2", "XA=5", "X=-"]
)
def test_expressions_are_no_numbers(line: str) -> None:
    assert translate(line.encode()).refused


def test_numbers_with_a_sign_are_read_in_columns() -> None:
    """No line of them is cut into pieces one by one."""
    text = b"X=5 Y=6.5 F=300\nG2 X1 CR=5\nS=1 T=2 ; CYCLE81(X=5)\n"
    assert translate(text).text == b"X 5 Y 6.5 F 300\nG2 X1 R  5\nS 1 T 2 ; CYCLE81(X=5)\n"
    # at both ends of a text
    assert translate(b"X=5 Y=2").text == b"X 5 Y 2"
    assert translate(b"G2\nX1 CR=2.").text == b"G2\nX1 R  2."


def test_a_byte_order_mark_before_the_first_line_is_no_word(setup: Setup) -> None:
    text = b"\xef\xbb\xbfG71 G90\nR1=5\nG0 X=R1 Y0 Z0\nM30\n"
    unrolled = flatten(text, SINUMERIK)
    assert unrolled.startswith(b"\xef\xbb\xbfG71 G90\n")
    assert read(unrolled, setup, SINUMERIK).toolpath.end_mm[-1].tolist() == [5.0, 0.0, 0.0]
    assert end("\N{ZERO WIDTH NO-BREAK SPACE};a\nG71 G0 X1 Y2 Z3\nM30\n", setup) == [1.0, 2.0, 3.0]
