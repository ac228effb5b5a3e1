"""Whole texts of statements, worked by hand: numbers that change, and statements that come in.

Three machines. One is too long by 0.1 um/mm in X, Y and Z, so 10.001 becomes 10.000. One leans: at Y 100 X
becomes X + 0.010 and Z becomes Z - 0.020. One has a backlash of 6 um in X and 4 um in Y: a drive leads by
half of it, and where it turns round a statement comes in.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from cases.acceptance import TRUE_ZERO, machine, unstamped

import olp
from olp.compensation.writer import Writer

CURVE = '[[curves]]\nfile = "{}.csv"\ninterpolation = "linear"\n'
SCALES = {f"{a.lower()}.csv": f"{a}_mm,E{a}{a}_um\n-1000,-100\n2000,200\n" for a in "XYZ"}
LEANS = {"y.csv": "Y_mm,EXY_um,EZY_um\n-1000,100,-200\n2000,-200,400\n"}
MACHINES = {
    "scale": ("".join(CURVE.format(axis) for axis in "xyz"), SCALES),
    "leans": (CURVE.format("y"), LEANS),
    "plays": ("[backlash]\nX_um = 6.0\nY_um = 4.0\n", {}),
}
TABLE = '[work_offsets.TABLE]\nX_mm = 10.0\nZ_mm = 3.0\nC_deg = 90.0\nset_by = "true"\n'
FRAMES = TABLE + TRUE_ZERO + '[work_offsets.MCS]\nset_by = "true"\n[tools.1]\nZ_mm = 0.0\n'
APT = "PARTNO A\nUNITS/MM\nLOADTL/1\nFEDRAT/600,MMPM\n"
#: a rapid to X 20, which takes up the play for motions in +X and +Y
THERE = APT + "RAPID\nGOTO/20,0,0\nGOTO/30,0,0\n"
TAKEN = APT + "RAPID\nGOTO/19.995,-0.004,0\nRAPID\nGOTO/20.003,0.002,0.000\nGOTO/30.003,0.002,0\n"
CENTRE, LATER = "30.0030,20.0020,0", "29.9970,20.0020,0.0000"


def card(text: str, number: int | str) -> str:
    return f"{text:<72}{number:>8}\n"


CARDS = ["PARTNO A", "UNITS/MM", "LOADTL/1", "FEDRAT/600,MMPM", "RAPID", "GOTO/0,0,0", "GOTO/20,0,0"]

#: machine, control, text, corrected text, and how many numbers change, words and statements come in
CASES = {
    "points": (
        "scale",
        "apt",
        APT + "GOTO/10.001,20.002,0\nGOTO/ 20.002 , 20.002,5.0005 $$ end\nGODLTA/0,10.001,0\nGODLTA/5.0005\n"
        "GOTO/1,2,$\n3\nFINI\n",
        # as fine as the finest of them
        APT + "GOTO/10.0000,20.0000,0\nGOTO/ 20.0000 , 20.0000,5.0000 $$ end\nGODLTA/0,10.0000,0\n"
        "GODLTA/5.0000\n"
        "GOTO/0.9999,1.9998,$\n2.9997\nFINI\n",
        (10, 0, 0),
    ),
    "many digits": (
        "scale",
        "apt",
        APT + "GOTO/10.001,20.002,0\nGOTO/10.001,20.002,3.1003100000\nFINI\n",
        APT + "GOTO/10.000000,20.000000,0\nGOTO/10.000000,20.000000,3.1000000000\nFINI\n",
        (5, 0, 0),
    ),
    "distances along the tool": (
        "leans",
        "apt",
        APT + "GOTO/0,100,0\nGODLTA/5\nGODLTA/0,100,1\nGODLTA/-2.5\nFINI\n",
        APT + "GOTO/0.010,100,-0.020\nGODLTA/5\nGODLTA/0.010,100,0.980\nGODLTA/-2.5\nFINI\n",
        (4, 0, 0),
    ),
    "circles": (
        "scale",
        "apt",
        APT + "GOTO/10.001,0,5.0005\nCIRCLE/0,0,5.0005,0,0,1,10.001\nGOTO/0,10.001,5.0005\n"
        "INDIRV/-1,0,0\nTLON,GOFWD/(CIRCLE/0,0,5.0005,10.001),ON,(LINE/0,0,5.0005,-10.001,0,5.0005)\nFINI\n",
        APT + "GOTO/10.0000,0,5.0000\nCIRCLE/0,0,5.00000,0,0,1,10.00000\nGOTO/0,10.0000,5.0000\n"
        "INDIRV/-1,0,0\n"
        "TLON,GOFWD/(CIRCLE/0,0,5.00000,10.00000),ON,(LINE/0,0,5.00000,-10.0000,0,5.0000)\nFINI\n",
        (11, 0, 0),
    ),
    "steps before lines": (
        "plays",
        "apt",
        THERE + "GOTO/10,5,0 $$ back\nGOTO/30,5,0\nGODLTA/-5,0,0\nFINI\n",
        TAKEN + "GOTO/29.997,0.002,0 $$ back\nGOTO/9.997,5.002,0.000\nGOTO/10.003,5.002,0\n"
        "GOTO/30.003,5.002,0.000\n"
        "GODLTA/-0.006,0,0\nGODLTA/-5.000,0.000,0.000\nFINI\n",
        (9, 0, 4),
    ),
    "steps in inches": (
        "plays",
        "apt",
        "PARTNO A\nUNITS/INCH\nLOADTL/1\nFEDRAT/600,IPM\nGOTO/0,0,0\nGOTO/20,0,0\nGOTO/10,5,0\nFINI\n",
        # 3 um are 0.000118 inch, 2 um 0.000079
        "PARTNO A\nUNITS/INCH\nLOADTL/1\nFEDRAT/600,IPM\nGOTO/0,0,0\nGOTO/20.00012,0,0\n"
        "GOTO/19.99988,0.00008,0\nGOTO/9.99988,5.00008,0.00000\nFINI\n",
        (3, 0, 1),
    ),
    "an angle": (
        "plays",
        "apt",
        THERE + "MOVARC/30,20,0,0,0,1,20.0,ANGLE,180\nGOTO/30,40,0 $$ top\nFINI\n",
        TAKEN + f"MOVARC/{CENTRE},0,0,1,20.0,ANGLE,90.000000\nGOTO/50.003,20.002,0 $$ top\n"
        f"GOTO/49.997,20.002,0.000\n"
        f"MOVARC/{LATER},0,0,1,20.0000,ANGLE,90.000000\nGOTO/29.997,40.002,0.000\nFINI\n",
        (9, 0, 3),
    ),
    "a circle of NX": (
        "plays",
        "apt",
        THERE + "CIRCLE/30,20,0,0,0,-1,20.00000000000,0.06,0.5,10,0\nGOTO/30,40,0\nFINI\n",
        TAKEN + f"CIRCLE/{CENTRE},0,0,-1,20.00000000000,0.06,0.5,10,0\nGOTO/50.003,20.002,0\n"
        f"GOTO/49.997,20.002,0.000\nCIRCLE/{LATER},0,0,-1,20.0000000000,0.06,0.5,10,0\nGOTO/29.997,40.002,0.000\nFINI\n",
        (8, 0, 3),
    ),
    "an arc that meets its line the second time": (
        "plays",
        "apt",
        THERE + "INDIRV/1,0,0\nTLON,GOFWD/(CIRCLE/30,20,0,20),ON,2,INTOF,(LINE/30,20,0,10,20,0)\n"
        "GOTO/10,50,0\nFINI\n",
        # its parts meet theirs the first time, and each begins in its own direction
        TAKEN + f"INDIRV/1,0,0\nTLON,GOFWD/(CIRCLE/{CENTRE},20),ON,(LINE/{CENTRE},$\n50.003,20.002,0)\n"
        "GOTO/49.997,20.002,0.000\nINDIRV/0.000000,1.000000,0.000000\n"
        f"TLON,GOFWD/(CIRCLE/{LATER},20.0000),ON,(LINE/29.9970,$\n20.0020,0.0000,29.997,40.002,0.000)\n"
        "GOTO/29.997,39.998,0.000\nINDIRV/-1.000000,0.000000,0.000000\n"
        "TLON,GOFWD/(CIRCLE/29.9970,19.9980,0.0000,20.0000),ON,(LINE/29.9970,$\n"
        "19.9980,0.0000,9.997,19.998,0.000)\n"
        "GOTO/9.997,20.002,0\nGOTO/9.997,50.002,0.000\nFINI\n",
        (12, 0, 6),
    ),
    "a step before an arc": (
        "plays",
        "apt",
        THERE + "INDIRV/-1,0,0\nTLON,GOFWD/(CIRCLE/30,20,0,20),ON,(LINE/30,20,0,10,20,0)\n"
        "GOTO/10,50,0\nFINI\n",
        TAKEN + "GOTO/29.997,0.002,0.000\nINDIRV/-1,0,0\nTLON,GOFWD/(CIRCLE/29.9970,20.0020,0,20),ON,"
        "(LINE/29.9970,20.0020,0,$\n9.997,20.002,0)\nGOTO/9.997,50.002,0\nFINI\n",
        (12, 0, 2),
    ),
    "cards": (
        "plays",
        "apt",
        "".join(card(line, 10 * k) for k, line in enumerate([*CARDS, "GOTO/10,5,0", "FINI"], 1)),
        "".join(card(line, 10 * k) for k, line in enumerate(CARDS[:5], 1))
        + card("GOTO/-0.005,-0.004,0", 60) + card("RAPID", "") + card("GOTO/0.003,0.002,0.000", "")
        + card("GOTO/20.003,0.002,0", 70) + card("GOTO/19.997,0.002,0", 80)
        + card("GOTO/9.997,5.002,0.000", "") + card("FINI", 90),
        (6, 0, 2),
    ),
    "points of a measuring machine": (
        "scale",
        "dmis",
        "DMISMN/'A',05.2\nUNITS/MM,ANGDEC\nGOTO/10.001,20.002,0\nGOTO/CART,20.002,20.002,5.0005\nENDFIL\n",
        "DMISMN/'A',05.2\nUNITS/MM,ANGDEC\nGOTO/10.0000,20.0000,0\nGOTO/CART,20.0000,20.0000,5.0000\n"
        "ENDFIL\n",
        (5, 0, 0),
    ),
    "a plain list": (
        "scale",
        "list",
        "X_mm,Y_mm,Z_mm\n10.001,20.002,0\n20.002,20.002,5.0005\n",
        "X_mm,Y_mm,Z_mm\n10.0000,20.0000,0\n20.0000,20.0000,5.0000\n",
        (5, 0, 0),
    ),
    "a frame that is turned": (
        "leans",
        "list",
        "# frame=TABLE\nX_mm,Y_mm,Z_mm\n0,0,0\n100.0,0,0\n100.0,5.0,1.0\n200.0,5.0,1.0\n",
        # its X runs along Y of the machine, its Y against X
        "# frame=TABLE\nX_mm,Y_mm,Z_mm\n0,0,0\n100.0,-0.010,-0.020\n100.0,4.990,0.980\n200.0,4.980,0.960\n",
        (6, 0, 0),
    ),
    "a list of columns": (
        # a number takes from the space behind it
        "scale",
        "list",
        "X_mm    Y_mm     Z_mm\n 10.001   20.002   +0.0 # one\n 20.002   20.002 5.0005\n",
        "X_mm    Y_mm     Z_mm\n 10.0000  20.0000   +0.0 # one\n 20.0000  20.0000 5.0000\n",
        (5, 0, 0),
    ),
    "a list with decimal commas": (
        "scale",
        "list",
        "X_mm;Y_mm;Z_mm\r\n10,001;20,002;0,0\r\n20,002;20,002;5,0005\r\n",
        "X_mm;Y_mm;Z_mm\r\n10,0000;20,0000;0,0\r\n20,0000;20,0000;5,0000\r\n",
        (5, 0, 0),
    ),
}  # fmt: skip


@pytest.mark.parametrize("chunk", (1 << 15, 1))
@pytest.mark.parametrize("name", CASES)
def test_statements_are_changed_and_inserted(
    name: str, chunk: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    of, control, text, expected, counts = CASES[name]
    calibration, curves = MACHINES[of]
    path = machine(tmp_path, calibration, curves, tables=FRAMES, controller=control)
    # as one, and a move at a time
    monkeypatch.setattr(Writer, "chunk", chunk)
    result = olp.correct(text.encode(), path)
    assert unstamped(result.data).decode() == expected
    moves = result.report["moves"]
    assert (moves["changed_words"], moves["inserted_words"], moves["inserted_blocks"]) == counts


#: head, rows, corrected rows: what is written otherwise than a number needs keeps its own form
LISTS = [
    ("X_mm,Y_mm,Z_mm", "10.001,20.002,0\n010.001,20.002,0.5", "10.000,20.000,0\n010.000,20.000,0.5"),
    ("X_mm,Y_mm,Z_mm", "10.001,20.002,0\n+10.001,20.002,0.5", "10.000,20.000,0\n+10.000,20.000,0.5"),
    ("X_mm,Y_mm,Z_mm", "10.001,20.002,-0\n10.001,-20.002,-0.0", "10.000,20.000,-0\n10.000,-20.000,-0.0"),
    ("X_mm,Y_mm,Z_mm", "10.001,20.002,0\n.5,-.5,5.", "10.000,20.000,0\n.5,-.5,5."),
    ("X_mm,Y_mm,Z_mm", "10.001,20.002,0\n1e2,-20.002,5", "10.000,20.000,0\n99.990,-20.000,5"),
    ("X_mm Y_mm Z_mm", "10.001 20.002 0\n-5 20.002 5", "10.000 20.000 0\n-5 20.000 5"),
    (
        "    X_mm    Y_mm  Z_mm",
        "  10.001  20.002  0\n 100.010  20.002  0\n  -5.000  20.002  5",
        "  10.000  20.000  0\n 100.000  20.000  0\n  -5.000  20.000  5",
    ),
    ("X_mm,Y_mm,N,Z_mm", "10.001,20.002,7,0\n10.001,20.002,8,3", "10.000,20.000,7,0\n10.000,20.000,8,3"),
    ("X_mm,Y_mm,Z_mm", "0.000,-0.001,0.001\n0.001,0.001,0.001", "0.000,-0.001,0.001\n0.001,0.001,0.001"),
]


@pytest.mark.parametrize(("head", "rows", "expected"), LISTS)
def test_numbers_of_lists_keep_their_form(head: str, rows: str, expected: str, tmp_path: Path) -> None:
    calibration, curves = MACHINES["scale"]
    path = machine(tmp_path, calibration, curves, tables=TRUE_ZERO, controller="list")
    result = olp.correct(f"{head}\n{rows}\n".encode(), path)
    assert unstamped(result.data).decode() == f"{head}\n{expected}\n"
