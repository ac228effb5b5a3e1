"""What each dialect says: one table of cases for the suites that run over all dialects.

A dialect joins with a `Case`: how it says points, distances and comments, which characters it is made of, and
where real programs of it are.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from judge import inform

from olp.program import registry
from olp.program.rs274.profiles.base import Act, Profile
from olp.program.rs274.profiles.fagor import DIALECT as FAGOR

NUMBER = rb"[+-]?(?:\d+\.?\d*|\.\d+)"
Lines = list[str]


@dataclass(frozen=True)
class Case:
    """One dialect. `coordinates` finds the numbers of motion statements, its groups the three of them;
    `support` are the kinds of statements that it has, and its lengths count in `unit_mm`. `in_order` finds
    the points in the order of the moves where the text has another one."""

    name: str
    controller: str
    alphabet: str
    head: Lines
    tail: Lines
    point: Callable[[Sequence[float], int], str]
    distance: Callable[[Sequence[float], int], str] | None
    comment: Callable[[str], str]
    coordinates: re.Pattern[bytes]
    specimens: tuple[str, ...]
    examples: tuple[bytes, ...] = ()
    keys: str = ""
    support: frozenset[str] = frozenset({"corrected", "read", "carried", "refused"})
    unit_mm: int = 1
    in_order: Callable[[bytes], np.ndarray] | None = None

    def program(self, points: np.ndarray, digits: int) -> bytes:
        rows = [self.point(p, digits) for p in points.tolist()]
        return ("\n".join([*self.head, *rows, *self.tail]) + "\n").encode()


def _words(values: Sequence[float], digits: int) -> str:
    return " ".join(f"{a}{v:.{digits}f}" for a, v in zip("XYZ", values, strict=True))


def _list(values: Sequence[float], digits: int) -> str:
    return ",".join(f"{v:.{digits}f}" for v in values)


_positions = itertools.count(1)


def _val3(values: Sequence[float], digits: int) -> str:
    """A straight move to a point in the world."""
    return f"movel({{{{{_list(values, digits)},0,0,0}},{{ssame,esame,wsame}}}},t,m)"


def _karel(values: Sequence[float], digits: int) -> str:
    """A position of its own, and the move there."""
    name = f"p{next(_positions)}"
    return f"{name} = POS({_list(values, digits)},0,180,0,config)\nMOVE TO {name}"


def _tp(values: Sequence[float], digits: int) -> str:
    """A move, and its position in a part of its own."""
    x, y, z = (f"{v:.{digits}f}" for v in values)
    name = f"P[{next(_positions)}]"
    head = "\n GP1:\n UF : 1, UT : 1, CONFIG : 'N U T, 0, 0, 0',\n"
    point = f" X = {x} mm, Y = {y} mm, Z = {z} mm,\n W = 0 deg, P = 0 deg, R = 0 deg\n"
    return f"   1:L {name} 100mm/sec FINE ;\n/POS\n{name}{{{head}{point}}};\n/MN"


def _ur(values: Sequence[float], digits: int) -> str:
    """In metres, in a frame that the program states."""
    x, y, z = (f"{v / 1000.0:.{digits + 3}f}" for v in values)
    return f"movel(pose_trans(p[0.25,0.2,-0.3,0,0,0],p[{x},{y},{z},0,0,0]),1.2,0.25,0,0)"


def _rapid(values: Sequence[float], digits: int) -> str:
    rest = "[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]"
    return f"MoveL [[{_list(values, digits)}],{rest}],v100,fine,rod\\WObj:=G54;"


def _inform(values: Sequence[float], digits: int) -> str:
    """A position, and the move there, in parts of their own."""
    name = f"C{next(_positions):05d}"
    return f"//POS\n{name}={_list(values, digits)},0.00,0.00,0.00\n//INST\nMOVL {name} V=100.0"


def _krl(values: Sequence[float], digits: int) -> str:
    x, y, z = (f"{v:.{digits}f}" for v in values)
    return f"LIN {{X {x},Y {y},Z {z},A 0,B 0,C 0}}"


def _rs274(name: str, profile: Profile) -> Case:
    opening, closing = profile.comment
    head = ["G21 G90 G17 G54 G94 F600"] if profile.codes.get(540) is Act.EVENT else ["G21 G90 G17 G94 F600"]
    between = " "
    if profile.commands is not None:
        head, between = ["G21", "G90", "G0 F600"], "\n"
    return Case(
        name, name, "GXYZIJKRFMTNSPQHLDOE%/;()[]#=+-. 0123456789\r\n\t:<>\"'^!_*",
        head, ["M2"] if profile.commands is None else [],
        lambda p, d: f"G1 {_words(p, d)}", lambda p, d: f"G91{between}G1 {_words(p, d)}",
        lambda text: f"{opening.decode()}{text}{closing.decode()}",
        re.compile(rb"(?m)^G1 X(" + NUMBER + rb") Y(" + NUMBER + rb") Z(" + NUMBER + rb")"),
        ("gcode_cncjs/*",) if name == "linuxcnc" else ("gcode_fanuc*/*",) if name == "fanuc" else (),
        (b"%\n%\n", b"\xef\xbb\xbfG21\nG0 X1\n"),
    )  # fmt: skip


#: A control of this family whose texts are words alone needs no case of its own.
RS274 = {name: d for name, d in registry.DIALECTS.items() if isinstance(d, Profile) and d.translator is None}
#: Dialects whose words may be omitted.
BLOCKS = (*RS274, "fagor", "sinumerik")
CASES = {
    **{name: _rs274(name, profile) for name, profile in RS274.items()},
    "fagor": replace(
        _rs274("fagor", FAGOR), head=["G71 G90 G17 G54 G94 F600"],
        examples=(b"T1.1 M6\nG43 Z5\nG44\n", b"T1\n", b"(T1.2) T1.2\n", b"G54 X1\n", b"%\n%\n"),
    ),
    "sinumerik": Case(
        "sinumerik", "sinumerik", "GXYZIJKRFMTNSPDACL%_/;()[]$=+-.,\" 0123456789\r\n\t:<>*",
        ["%_N_TEST_MPF", ";$PATH=/_N_MPF_DIR", "G71 G90 G17 G54 G94 F600"], ["M30"],
        lambda p, d: f"G1 {_words(p, d)}", lambda p, d: f"G91 G1 {_words(p, d)}",
        lambda text: f"; {text}",
        re.compile(rb"(?m)^G1 X(" + NUMBER + rb") Y(" + NUMBER + rb") Z(" + NUMBER + rb")"),
        ("gcode_sinumerik/*",),
        (
            b"G1 X=5 Y=AC(3) Z1\nX=IC(1)\n", b'MSG("a;(b")\nG0 X1', b"G2 X10 Y0 I=AC(5) J=AC(0) TURN=2",
            b"T=\"A\" M6\nD1\nSUPA Z0 D0", b"MCALL CYCLE81(5,0,1,-3)\nX1 Y2\nMCALL",
            b"R1=5\nX=R1", b"G4 F2\nG4 S3", b"TRANS X1\nATRANS Y2\nG0 X0",
            b"G500 G505 G641 ADIS=0.1 G0 X1", b"L\xf6\xff", b'MSG("', b"X=AC(",
            b"N10 LABEL: G0 X1\nGOTOB LABEL", b"C25.815\nC2=5\n:10 X1", b"/2 N5 G0 X1\n/TRANS X1",
        ),
    ),
    "apt": Case(
        "apt", "apt", "GOTDLAFRMCIEUNSP/,.+-$ 0123456789\r\n\t=()'",
        ["PARTNO TEST", "UNITS/MM", "FEDRAT/600,MMPM"], ["FINI"],
        lambda p, d: f"GOTO/{_list(p, d)}", lambda p, d: f"GODLTA/{_list(p, d)}",
        lambda text: f"$$ {text}",
        re.compile(rb"(?m)^GOTO/(" + NUMBER + rb"),(" + NUMBER + rb"),(" + NUMBER + rb")"),
        ("apt_cldata/*",),
        (
            b"GOTO/1,2,3$", b"GOTO/1,2,$\n3", b"GOTO/1.$\n5,2,3", b"$$ $\nGOTO/1,2,3\n",
            b"GOTO/1,2,3,0,0,1\nGOTO/4,5,6",
            b"CIRCLE/0,0,0,0,0,1\nGOTO/1,0,0", b"GODLTA/1\nGOTO/1,2,3\nGODLTA/-2", b"RAPID\nGOTO/1,2,3",
            b"GOTO/1E2,2D0,3", b"GOTO/1E999,0,0",
            b"INDIRV/1,0,0\nTLON,GOFWD/(CIRCLE/0,0,0,1),ON,(LINE/0,0,0,1,0,0)",
            b"CYCLE/DRILL,DEPTH,5,CLEAR,1\nGOTO/1,2,3\nCYCLE/OFF\nGOTO/2,3,4", b"PPRINT $\nGOTO/1,2,3",
            b"\xef\xbb\xbfGOTO/1,2,3\r\nGOTO/1,2,4\r\n", b"GOTO/1,2,3\rGOTO/1,2,4\r", b"LOADTL/1\nGOTO/0,0,0",
            b"$$-> CSYS / 1,0,0,0, $\n0,1,0,0, $\n0,0,1,0\nGOTO/1,2,3\n", b"GOTO/99999999999999999999,1,2",
        ),
    ),
    "heidenhain": Case(
        "heidenhain", "heidenhain", "LXYZICRDFMAQBEGNPTOS+-=.~;:/\" 0123456789\r\n\t",
        ["0 BEGIN PGM T MM", "1 L F600"], ["9 END PGM T MM"],
        lambda p, d: f"L {_words(p, d)}", lambda p, d: f"L I{_words(p, d).replace(' ', ' I')}",
        lambda text: f"; {text}",
        re.compile(rb"(?m)^L X(" + NUMBER + rb") Y(" + NUMBER + rb") Z(" + NUMBER + rb")"),
        ("heidenhain/*",),
        (
            b"BEGIN PGM A MM\nL X+1 Y+2 Z+3 R0 FMAX M3\nX5\nEND PGM A MM\n",
            b"L X1 Y2 Z3 F100\nCC X0 Y2\nC X-1 Y2 DR+\nC DR-\nCC\nL X5\nCP IPA+360 IZ-1 DR+\n",
            b"L X1 Y2 Z3 F MAX\nCR X2 Y3 R1 DR-\nCC IX1 Y0\nCP PA90 DR-\n"
            b"CYCL DEF 200 ~\n Q200=1 ~\n Q201=-2~\n"
            b" Q203=0\nL X4 M99\nCYCL CALL\n",
            b"TOOL CALL 1 Z S100 DL+0.1\nL X1 Y2 Z3 M91\nM140 MB MAX\nL X1 Y2 Z3\nCYCL DEF 7.0\n"
            b"CYCL DEF 7.1 IX5\n",
            b"CYCL DEF 1.0\nCYCL DEF 1.1 DIST2\nCYCL DEF 1.2 DEPTH-3\nL X1 Y1 Z1 M99\n", b"/81 M30\nL X1\n",
            b"\xef\xbb\xbfL X1 Y2 Z3\r\nL IX1\r\n",
            b"CALL LBL 1\nLBL 1\nM127\nLBL 0\nL X1 Y1 Z1 FQ2",
            b"L X+Q5", b"C X1 DR+", b"L X99999999999999999999", b"~", b"L X1 ~\nY5", b"CC",
            b"TOOL CALL \"A\" Z", b"L  X5 ;~\nY",
        ),
    ),
    "dmis": Case(
        "dmis", "dmis", "GOTPMEASCRDUNI/,.+-$ 0123456789\r\n\t=()'F",
        ["DMISMN/'TEST',05.2", "UNITS/MM,ANGDEC", "MODE/PROG,MAN"], ["ENDFIL"],
        lambda p, d: f"GOTO/{_list(p, d)}", None,
        lambda text: f"$$ {text}",
        re.compile(rb"(?m)^GOTO/(" + NUMBER + rb"),(" + NUMBER + rb"),(" + NUMBER + rb")"),
        ("dmis/*",),
        (
            b"GOTO/CART,1,2,3", b"MEAS/POINT,F(A),1\nPTMEAS/CART,1,2,3,0,0,1\nENDMES", b"PTMEAS/CART,1,2,3",
            b"F(A)=FEAT/POINT,CART,1,2,3,0,0,1\nGOTO/1,2,$\n3", b"MEAS/POINT,F(A),1\nENDMES\nGOTO/1,2,3",
            b"MODE/MAN\nGOTO/1,2,3", b"IF/(A .EQ. 1)\nGOTO/1,2,3\nENDIF",
            b"TEXT/OPER,'GOTO/1,2,$$'\nGOTO/1,2,3",
            b"$$ a $\nGOTO/1,2,3", b"D(A)=DATSET/DAT(A),ZDIR\nGOTO/1,2,3", b"BEGIN/CHFILE\nX = 3\nEND/CHFILE",
        ),
    ),
    "list": Case(
        "list", "list", "XYZ_mminch,;.+-# 0123456789\r\n\t\"eE=",
        ["X_mm,Y_mm,Z_mm"], [],
        _list, None, lambda text: f"# {text}",
        re.compile(rb"(?m)^(" + NUMBER + rb"),(" + NUMBER + rb"),(" + NUMBER + rb")"),
        (),
        (
            b"X_mm;Y_mm;Z_mm\n1,5;2,5;3,5\n", b"X_inch Y_inch Z_inch\n 1.50  2.5  -3\n", b"1,2,3",
            b"X_mm,Y_mm,Z_mm", b'X_mm,Y_mm,Z_mm\n"1","2","3"', b"X_mm,Y_mm,Z_mm\n1,2,3,\n",
            b"\xef\xbb\xbfX_mm,Y_mm,Z_mm\r\n1e1,2E-1,.5\r", b"X_mm,Y_mm,Z_mm\n1,2,\n",
            b"# frame=G55\nX_mm,Y_mm,Z_mm\n1,2,3", b"X_mm,Y_mm,Z_mm\n1e99,2,3",
            b"X_mm,Y_mm,Z_mm\n" + b"0" * 50 + b"1,2,3", b'X_mm,Y_mm,Z_mm\n"1,2,3',
        ),
    ),
    "kawasaki-as": Case(
        "kawasaki-as", "kawasaki-as", "LMOVETRANSPOINDW().,;\"+-= #0123456789\r\n\tp",
        [".PROGRAM test()", "SPEED 100 MM/S ALWAYS"], [".END"],
        lambda p, d: f"LMOVE TRANS({_list(p, d)})", lambda p, d: f"DRAW {_list(p, d)}",
        lambda text: f"; {text}",
        re.compile(rb"(?m)^LMOVE TRANS\((" + NUMBER + rb"),(" + NUMBER + rb"),(" + NUMBER + rb")\)"),
        (),
        (
            b"LMOVE p\n.TRANS\np 1 2 3\n.END", b"LMOVE TRANS(1,2,3,0,180,0) ; x",
            b"JMOVE #a\nLMOVE TRANS(1,2,3)",
            b'PRINT ";"\nLMOVE TRANS(1,2,3)', b"LMOVE TRANS(1E400,2,3)", b"DRAW 1,2,3",
            b".TRANS\np 1 2 3\np 1 2 3\n.END\nLMOVE p", b"TOOL 99\nLMOVE TRANS(1,2,3)",
            b"LMOVE TRANS(1,2,3)\rLMOVE TRANS(1,2,3)",
        ),
    ),
    "val2": Case(
        "val2", "val2", "MOVESTRANSPD().,;\"+-= #0123456789\r\n\tp",
        ["SPEED 100 ALWAYS"], [],
        lambda p, d: f"MOVES TRANS({_list(p, d)})", lambda p, d: f"DRAW {_list(p, d)}",
        lambda text: f"; {text}",
        re.compile(rb"(?m)^MOVES TRANS\((" + NUMBER + rb"),(" + NUMBER + rb"),(" + NUMBER + rb")\)"),
        (),
        (b"10 SET a = TRANS(1,2,3)\n20 MOVES a\n30 MOVES a", b"MOVE #p\nMOVES TRANS(1,2,3)"),
    ),
    "karel": Case(
        "karel", "karel", "MOVETPSDLYIN().,;'+-= #$0123456789\r\n\tp",
        ["PROGRAM test", "BEGIN"], ["END test"],
        _karel, None, lambda text: f"-- {text}",
        re.compile(rb"(?m)^p\d+ = POS\((" + NUMBER + rb"),(" + NUMBER + rb"),(" + NUMBER + rb"),"),
        (),
        (
            b"p = POS(1,2,3,0,180,0,c)\nMOVE TO p\nMOVE TO p", b"MOVE TO p", b"MOVE NEAR p BY 100",
            b"p = POS(1,2,3,0,180,0,c)\np = POS(1,2,3,0,180,0,c)\nMOVE TO p -- 'x'", b"$MOTYPE = LINEAR",
        ),
        support=frozenset({"corrected", "carried", "refused"}),
    ),
    "urscript": Case(
        "urscript", "urscript", "movelpjdfnP[](),.=:#_ 0123456789\r\n\te+-",
        ["def t():", "  set_tcp(p[0,0,-0.12,0,0,0])"], ["end"],
        _ur, None, lambda text: f"# {text}",
        re.compile(rb"(?m)^movel\(pose_trans\(p\[0.25,0.2,-0.3,0,0,0\],p\[(" + NUMBER + rb"),("
                   + NUMBER + rb"),(" + NUMBER + rb"),"),
        ("urscript/*",),
        (
            b"set_tcp(p[0,0,0,0,0,0])\nmovel(p[1,2,3,0,0,0],a=1,v=1,r=0)",
            b"P=p[0,0,0,0,0,0]\nP[1]=2\nmovel(P)",
            b"def a():\nmovel(p[1,2,3,0,0,0])\nend\nset_tcp(p[0,0,0,0,0,0])", b"if movel(p[0,0,0,0,0,0]):",
            b"movej([0,0,0,0,0,0])\nmovej(get_inverse_kin(p[1,2,3,0,0,0]))",
            b"movel(p[1e3,2,3,0,0,0],1,1,2,0)",
        ),
        unit_mm=1000,
    ),
    "fanuc-tp": Case(
        "fanuc-tp", "fanuc-tp", "LJCP[]RUFTXYZW:;,.='{}+-/MNGCOS 0123456789\r\n\t!*",
        ["/PROG T", "/ATTR", "/MN"], ["/END"],
        _tp, None, lambda text: f"   1:  !{text} ;",
        re.compile(rb"X = (" + NUMBER + rb") mm, Y = (" + NUMBER + rb") mm, Z = (" + NUMBER + rb") mm"),
        ("fanuc_ls/*",),
        (
            b"/PROG A\n/MN\n 1:J P[1] 10% FINE ;\n/POS\nP[1]{\n GP1:\n UF : 0, UT : 0,"
            b" CONFIG : 'N U T, 0, 0, 0',\n X = 1 mm, Y = 2 mm, Z = 3 mm,\n"
            b" W = 0 deg, P = 0 deg, R = 0 deg\n};\n",
            b"/MN\n1:",
            b"/PROG A\n/MN\n 1:L P[1] 10mm/sec FINE ;\n/POS\nP[1]{\n GP1:\n UF : 0, UT : 0,\n J1= 1 deg\n};",
            b"/PROG A\n/MN\n 1:  UFRAME_NUM=1 ;\n 2:  PR[1,1]=5 ;\n 3:L PR[1] 10mm/sec FINE ;\n",
            b"/PROG A\n/MN\n 1:  IF (R[1]=1) THEN ;\n 2:  ENDIF ;\n 3:  ! don't ;\n",
            b"/PROG A\n/MN\n 4:C P[1]\n  :  P[2] FINE ;",
        ),
    ),
    "abb-rapid": Case(
        "abb-rapid", "abb-rapid", "MoveLJROCVabsptw[](),;:=!\\{}%\"+-. 0123456789\r\n\tEN",
        ["MODULE T", "PERS tooldata rod:=[TRUE,[[0,0,-120],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];",
         "PROC main()"], ["ENDPROC", "ENDMODULE"],
        _rapid, None, lambda text: f"! {text}",
        re.compile(rb"(?m)^MoveL \[\[(" + NUMBER + rb"),(" + NUMBER + rb"),(" + NUMBER + rb")\]"),
        ("rapid/*",),
        (
            b"MoveL [[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,z1,tool0;",
            b"CONST robtarget p{2}:=[[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],"
            b"[[4,5,6],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]];\nMoveJ p{2},v100,z1,tool0;",
            b"MoveL Offs(p,1,2,3),v100,z1,tool0;", b"MoveL p,v100\\V:=10,z1\\Z:=3,tool0\\WObj:=wobj0;",
            b"IF x THEN\nENDIF;\nELSE", b"%x%;", b"MODULE m\nRECORD r\nnum a;\nENDRECORD\nr.a:=5;",
            b"TPWrite \"a;b!\";", b"MoveAbsJ [[0,0,0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tool0;",
        ),
    ),
    "kuka-krl": Case(
        "kuka-krl", "kuka-krl", "LINPTPXYZABCDEF{},:;=$#_[]()&\"'. 0123456789\r\n\t+-",
        ["&ACCESS RVP", "DEF t()", "$TOOL={X 0,Y 0,Z -120,A 0,B 0,C 0}",
         "$BASE={X 250,Y 200,Z -300,A 0,B 0,C 0}"], ["END"],
        _krl, None, lambda text: f"; {text}",
        re.compile(rb"(?m)^LIN \{X (" + NUMBER + rb"),Y (" + NUMBER + rb"),Z (" + NUMBER + rb"),"),
        ("krl/*.src",),
        (
            b"DEFDAT a\nDECL E6POS XP={X 1,Y 2,Z 3,A 0,B 0,C 0,S 'B1',T 35}\nENDDAT\nDEF a()\nPTP XP\nEND",
            b"LIN {FRAME: X 1, Y 2, Z 3, A 0, B 0, C 0} C_DIS ; x", b"LIN p:{X 1,Y 2,Z 3,A 0,B 0,C 0}",
            b"PTP {A1 0,A2 0,A3 0,A4 0,A5 0,A6 0}\nPTP XHOME\nLIN $POS_ACT", b"$BASE=BASE_DATA[1]",
            b"FDAT_ACT=FP1\nBAS(#PTP_PARAMS,100)\nPTP XP1", b"IF a THEN\nELSE\nENDIF\nLOOP\nEXIT\nENDLOOP",
            b"SLIN XP1 WITH $VEL.CP=1, $BASE=SBASE(FP1.BASE_NO) C_SPL", b"CIRC a,b", b"x[1].X='HFF'",
        ),
    ),
    "yaskawa-inform": Case(
        "yaskawa-inform", "yaskawa-inform", "MOVJLCP/=,#*'().+- 0123456789\r\n\tNOIS\x1a",
        ["/JOB", "//NAME T", "//POS", "///NPOS 0,0,0,0,0,0", "///USER 1", "///TOOL 1", "///POSTYPE USER",
         "///RECTAN", "///RCONF 0,0,0,0,0,0,0,0", "//INST", "///GROUP1 RB1", "NOP"], ["END"],
        _inform, None, lambda text: f"'{text}",
        re.compile(rb"(?m)^C\d+=(" + NUMBER + rb"),(" + NUMBER + rb"),(" + NUMBER + rb"),"),
        ("inform_jbi/*",),
        (
            b"/JOB\r\n//NAME A\r\n//POS\r\n///NPOS 1,0,0,0,0,0\r\n///TOOL 0\r\n///POSTYPE PULSE\r\n"
            b"///PULSE\r\nC00000=1,2,3,4,5,6\r\n//INST\r\nNOP\r\nMOVL C00000 V=1.0\r\nEND\r\n\x1a",
            b"//POS\n///TOOL 1\n///POSTYPE BASE\n///RECTAN\nC1=1,2,3,0,0,0\nBC1=5\n//INST\n"
            b"MOVJ C1 BC1 VJ=5 PL=0 NWAIT UNTIL IN#(1)=ON\nMOVL C1 BC1 V=5\0\0",
            b"MOVC C1 V=5", b"MOVL C1\nMOVC C1\nMOVC C1\nMOVC C1",
            b"MOVL C1 V=5 FOO", b"MOVL P[1] V=5", b"MOVL LP001 V=5\nSFTON P1\nMOVL P1\nSFTOF",
            b"SET P[I1] P2\nMOVL P3 V=1", b"JUMP *A IF B0=1\n*A\nFOR I0=1 TO 3\nNEXT I0\nMSG \"a // b\"",
            b"C1=1,x,3", b"/JOB\nNOP\nMOVJ C00000 VJ=50\nEND\n",
            b"//POS\n///POSTYPE MTOOL\nC1=1,2,3,4,5,6\n//INST\nMOVJ C1",
        ),
        in_order=lambda text: np.array([move.numbers[:3] for move in inform.moves(text)]),
    ),
    "staubli-val3": Case(
        "staubli-val3", "staubli-val3", "movelpjc{},()[]=.<>/!-?CDAT\"' xyz0123456789\r\n\t+-\xe4",
        ["<?xml version=\"1.0\" encoding=\"utf-8\"?>",
         "<Programs xmlns=\"http://www.staubli.com/robotics/VAL3/Program/2\">",
         "<Program name=\"start\"><Code><![CDATA[begin"],
        ["end]]></Code></Program></Programs>", "<!--olp: file a.dtx-->",
         "<Database xmlns=\"http://www.staubli.com/robotics/VAL3/Data/2\"><Datas>",
         "<Data name=\"t\" type=\"tool\" size=\"1\"><Value key=\"0\" z=\"-120\"/></Data>",
         "</Datas></Database>"],
        _val3, None, lambda text: f"// {text}",
        re.compile(rb"(?m)^movel\(\{\{(" + NUMBER + rb"),(" + NUMBER + rb"),(" + NUMBER + rb"),"),
        ("val3/*.p?x",),
        (
            b"<a><Program><Code>begin\nmovel({{1,2,3,0,0,0},{sfree,efree,wfree}},flange,m)\nend</Code></Program></a>",
            b"<a><b></a></b>", b"<!DOCTYPE a [<!ENTITY b SYSTEM 'c'>]><a>&b;</a>", b"<a>" * 40 + b"</a>" * 40,
            b"<a><Program name='a'><Code>if a\nwhile b\nendIf</Code></Program></a>",
            b"<a><Program name='a'><Code>p.trsf.x=1\nmovel(p,t,m)\ncall a()</Code></Program></a>",
            b"<a/>\n<!--olp: file ../b.dtx-->\n<a><Data name='p' type='pointRx'><Value x='1e99'/></Data></a>",
            b"\xff\xfe<\0a\0", b"<a b='1", b"<![CDATA[",
        ),
    ),
}  # fmt: skip
#: Named frames of the test's machines.
FRAMES = {
    name: {"X_mm": 250.0, "Y_mm": 200.0, "Z_mm": -300.0, "set_by": "true"}
    for name in ("G54", "MCS", "A", "CSYS2", "CSYS3", "UFRAME1", "UF1", "world")
}
