"""Whole texts of blocks, worked by hand: which words change, which come in, and which blocks.

Three machines. One is too long by 0.1 um/mm in X, Y and Z, so 10.001 becomes 10.000; circles stay so. One
leans: along Y it leaves X by -0.1 um/mm and Z by 0.2 um/mm, so at Y 100 X becomes X + 0.010 and Z becomes
Z - 0.020. One has a backlash of 6 um in X and 4 um in Y: a drive leads by half of it.
"""

from __future__ import annotations

from math import hypot
from pathlib import Path

import pytest
from cases.acceptance import TRUE_ZERO, machine, unstamped

import olp
from olp.compensation.writer import Writer
from olp.core.errors import ProgramError

CURVE = '[[curves]]\nfile = "{}.csv"\ninterpolation = "linear"\n'
SCALE = "".join(CURVE.format(axis) for axis in "xyz")
SCALES = {f"{a.lower()}.csv": f"{a}_mm,E{a}{a}_um\n-1000,-100\n2000,200\n" for a in "XYZ"}
LEANS = {"y.csv": "Y_mm,EXY_um,EZY_um\n-1000,100,-200\n2000,-200,400\n"}
#: X and Y are turned by 100 urad: X becomes X - Y / 10000, and Y becomes Y + X / 10000
TURNED = {
    "x.csv": "X_mm,EYX_um\n-1000,100\n2000,-200\n",
    "y.csv": "Y_mm,EXY_um\n-1000,-100\n2000,200\n",
}
MACHINES = {
    "scale": (SCALE, SCALES),
    "leans": (CURVE.format("y"), LEANS),
    "X": ("[backlash]\nX_um = 6.0\n", {}),
    "shifted": (
        CURVE.format("x"),
        {"x.csv": "X_mm,EXX_um,EYX_um,EZX_um\n-1000,-10,20,-30\n2000,-10,20,-30\n"},
    ),
    "kink": (CURVE.format("z"), {"z.csv": "Z_mm,EZZ_um\n-1000,0\n20,0\n40,10\n2000,10\n"}),
    "turned": (CURVE.format("x") + CURVE.format("y"), TURNED),
    "XY": ("[backlash]\nX_um = 6.0\nY_um = 4.0\n", {}),
}
HEAD = "G21 G90 G54\nG0 X0 Y0 Z0\n"
#: As corrected: a rapid has taken up the play for a motion in +X, and in +X and +Y.
HEADS = {
    "X": "G21 G90 G54\nG0 X-0.005 Y0 Z0\nX0.003\n",
    "XY": "G21 G90 G54\nG0 X-0.005 Y-0.004 Z0\nX0.003 Y0.002\n",
    "shifted": "G21 G90 G54\nG0 X.010 Y-.020 Z.030\n",
}


def corrected(folder: Path, name: str, text: str, **options: object) -> olp.Correction:
    calibration, curves = MACHINES[name]
    path = machine(folder, calibration, curves, tables=TRUE_ZERO, **options)  # type: ignore[arg-type]
    return olp.correct(f"{text}M2\n".encode(), path)


def tally(result: olp.Correction) -> tuple[int, int, int]:
    moves = result.report["moves"]
    return moves["changed_words"], moves["inserted_words"], moves["inserted_blocks"]


#: machine, text, corrected text, and the words changed, the words inserted, the blocks inserted
CASES = {
    "centres": (
        "scale",
        "G1 X10.001 Y20.002 F100\n"
        "G2 X30.003 Y20.002 I10.001 J0\n"
        "G2 I5.0005\nG2 I5.0005 P2\nG3 X30.003 Y20.002 Z5.0005 J5.0005 P3\n"
        "G90.1 G2 X40.004 Y10.001 I30.003 J10.001\n"
        "G91.1 g2x50.005y0.0i10.001j0\n",
        # a digit more than positions have, and not fewer than the word
        "G1 X10.000 Y20.000 F100\n"
        "G2 X30.000 Y20.000 I10.0000 J0\n"
        "G2 I5.0000\nG2 I5.0000 P2\nG3 X30.000 Y20.000 Z5.0000 J5.0000 P3\n"
        "G90.1 G2 X40.000 Y10.000 I30.0000 J10.0000\n"
        "G91.1 g2x50.000y0.0i10.0000j0\n",
        (17, 0, 0),
    ),
    "centres of other planes": (
        "scale",
        "G18 G2 X20.002 Z0 I10.001 K0 F100\nG19 G2 Y20.002 Z0 J10.001 K0\nG91 G17 G2 X20.002 I10.001\n",
        "G18 G2 X20.000 Z0 I10.0000 K0 F100\nG19 G2 Y20.000 Z0 J10.0000 K0\nG91 G17 G2 X20.000 I10.0000\n",
        (6, 0, 0),
    ),
    "one centre word": (
        "scale",
        "G1 F100\nG2 X20.002 Y20.002 J20.002\nG3 X0 Y0 I-20.002\n"
        "G18 G2 X20.002 Z20.002 K20.002 Y10.001\nG19 G3 Z40.004 Y30.003 J20.002\n",
        "G1 F100\nG2 X20.000 Y20.000 J20.0000\nG3 X0 Y0 I-20.0000\n"
        "G18 G2 X20.000 Z20.000 K20.0000 Y10.000\nG19 G3 Z40.000 Y30.000 J20.0000\n",
        (11, 0, 0),
    ),
    "absolute centres": (
        "scale",
        "G90.1 G1 F100\nG2 X20.002 Y20.002 I20.002 J0\nG3 X0 Y0 I0. J20.002\n",
        "G90.1 G1 F100\nG2 X20.000 Y20.000 I20.0000 J0\nG3 X0 Y0 I0. J20.0000\n",
        (4, 0, 0),
    ),
    "radii": (
        "scale",
        "G1 F100\nG2 X10.001 Y0 R10.001\nG3 X20.002 Y0 R-10.001\n\tG2\tx40.004\ty0\tr20.002\n"
        "G2 X60.006 Y0 R10.004\nX50.005 Y0 R-10.00100\n",
        "G1 F100\nG2 X10.000 Y0 R10.0000\nG3 X20.000 Y0 R-10.0000\n\tG2\tx40.000\ty0\tr20.0000\n"
        "G2 X60.000 Y0 R10.0030\nX50.000 Y0 R-10.00000\n",
        (10, 0, 0),
    ),
    "a radius that is too coarse": (
        "scale",
        # near a half circle the last digit of R moves the centre far
        "G1 F100\nG2 X20.002 Y0 R10.001\n\tG3\tx40.004\ty0\tr10.001\nG18 G2 X20.002 Z0 R10.001\n",
        "G1 F100\nG2 X20.000 Y0 I10.0000 J0.0000\n\tG3\tx40.000\ty0\ti10.0000\tj0.0000\n"
        "G18 G2 X20.000 Z0 K0.0000 I-10.0000\n",
        (6, 0, 0),
    ),
    "centre words that come in": (
        "turned",
        "G1 F100\nG2 X20 Y0 I10\n\tg3\tx0\ty0\ti-10\nG2 I10 F90\nG2 I4.9 F90\n",
        # 4.9 mm are turned by half of a position's digit: no word is worth it
        "G1 F100\nG2 X20 Y0.002 I10 J0.0010\n\tg3\tx0\ty0\ti-10\tj-0.0010\nG2 I10 J0.0010 F90\nG2 I4.9 F90\n",
        (1, 3, 0),
    ),
    "what is only shifted": (
        "shifted",
        "G1 X20 F100\nG2 X20.5 Y.5 I.25 J.25\nG3 X0 Y0 R15\nG90.1 G2 X10 Y0 I5 J0\nG92 X1 Y1 Z1\nG1 X5\n",
        # a centre that counts from the start keeps its words
        "G1 X20.010 F100\nG2 X20.510 Y.480 I.25 J.25\nG3 X.010 Y-.020 R15\n"
        "G90.1 G2 X10.010 Y-.020 I5.0100 J-.0200\nG92 X1.010 Y.980 Z1.030\nG1 X5.010\n",
        (16, 0, 0),
    ),
    "more than one turn": (
        "scale",
        "G1 X20.002 F100\nG3 X19.977 Y1 I-20.002 J0 P2\n",
        "G1 X20.000 F100\nG3 X19.975 Y1 I-20.0000 J0 P2\n",
        (3, 0, 0),
    ),
    "nearly a whole circle": (
        "scale",
        # both ends become 5.000, so half a turn is cut off
        "G1 X5.000 F100\nG3 X5.001 Y0 I0.0005 J-10\n",
        "G1 X5.000 F100\nG3 X5.000 Y-19.998 I0.0000 J-9.9990\nX5.000 Y0.000 I0.0000 J9.9990\n",
        (4, 0, 1),
    ),
    "as many digits as most words have": (
        "leans",
        "G1 X1.0000 Y2.00 F100\nX5.0000\nX7.0\nY100\n",
        "G1 X1.0002 Y2.00 F100\nX5.0002\nX7.0\nY100 X7.0100 Z-0.020\n",
        (2, 2, 0),
    ),
    "inches": (
        "scale",
        "G20 G1 X1.0001 Y2.0002 F10\nG2 X3.0003 Y2.0002 I1.0001 J0\n"
        "G3 X2.0002 R1.0001\nG2 X3.0003 Y2.0002 R-1.0001\n",
        "G20 G1 X1.00000 Y2.00000 F10\nG2 X3.00000 Y2.00000 I1.000000 J0\n"
        "G3 X2.00000 R1.000000\nG2 X3.00000 Y2.00000 R-1.000000\n",
        (10, 0, 0),
    ),
    "words of the style of the block": (
        "leans",
        "G1 Y100 F100\ng1y200\nG1\tY100.\tF100\n\ty200f100\nN10G1Y-100.0F90(c)\ny-.5x1.\n",
        # Y -0.5 is X 1 - 0.00005
        "G1 Y100 X0.010 Z-0.020 F100\ng1y200x0.020z-0.040\nG1\tY100.\tX0.010\tZ-0.020\tF100\n"
        "\ty200x0.020z-0.040f100\nN10G1Y-100.0X-0.010Z0.020F90(c)\ny-.5x1.z0.000\n",
        (0, 11, 0),
    ),
    "inserted words hold": (
        "leans",
        "G1 Y100 F100\nx0\ny200z-1\nG91\nY100\ny-100.x5\nG90 G20\nY10.\nG91 Y1.\n",
        "G1 Y100 X0.010 Z-0.020 F100\nx0.010\ny200z-1.040x0.020\nG91\n"
        "Y100 X0.010 Z-0.020\ny-100.x4.990z0.020\nG90 G20\nY10. X0.19785 Z-0.04137\n"
        "G91 Y1. X0.00010 Z-0.00020\n",
        (3, 10, 0),
    ),
    "no zero in front of the point": (
        "leans",
        "G1 X.5 Y100. F100\nY50.\n",
        "G1 X.510 Y100. Z-.020 F100\nY50. X.505 Z-.010\n",
        (1, 3, 0),
    ),
    "no more than nine digits": (
        "leans",
        "G1 X1.000000000000 Y2.0 F100\nX5.000000000000\nY100\nG91 Y100\n",
        "G1 X1.000200000000 Y2.0 F100\nX5.000200000000\nY100 X5.010000000 Z-0.020\nG91 Y100 X0.010 Z-0.020\n",
        (2, 4, 0),
    ),
    "behind deleted blocks": (
        "leans",
        "G0 Y100\n/G1 Y200 F60\nG1 Y100\nX5\n/Y200 X7\n/Y150\nG1 Y150 X1\nG91 X5\n",
        "G0 Y100 X0.010 Z-0.020\n/G1 Y200 X0.020 Z-0.040 F60\nG1 Y100 X0.010 Z-0.020\nX5.010\n"
        "/Y200 X7.020 Z-0.040\n/Y150 X7.015 Z-0.030\nG1 Y150 X1.015 Z-0.030\nG91 X5\n",
        (3, 10, 0),
    ),
    "a word that a deleted block may have had": (
        "leans",
        "G0 Y100\nF60\n/G1 Y200\nG1 Y200 Z5\n/G1 Y100\n/G1 Y300\nG1 Y300\nX1\n",
        "G0 Y100 X0.010 Z-0.020\nF60\n/G1 Y200 X0.020 Z-0.040\nG1 Y200 Z4.960 X0.020\n"
        "/G1 Y100 X0.010 Z4.980\n/G1 Y300 X0.030 Z4.940\nG1 Y300 X0.030 Z4.940\nX1.030\n",
        (2, 11, 0),
    ),
    "stored positions": (
        "leans",
        "G0 Y100\nG92 X5 Y6 Z7\nG1 Y106 F100\nG92.1\nG1 X0 Y0\nG20\nG10 L20 P1 X0.5 Y0. Z-.25\nY10.\n",
        "G0 Y100 X0.010 Z-0.020\nG92 X5.010 Y6 Z6.980\nG1 Y106 X5.020 Z6.960 F100\nG92.1\n"
        "G1 X0 Y0 Z0.000\nG20\nG10 L20 P1 X0.5 Y0. Z-.25\nY10. X0.50100 Z-0.25200\n",
        (2, 7, 0),
    ),
    "stored positions in inches": (
        "leans",
        "G0 Y254\nG20 G92 X1 Z-.5\nG1 X1.5 F4\n",
        # 25.4 um are 0.001 inch; Z at 50.8 um is finer in inches than in mm
        "G0 Y254 X0.025 Z-0.051\nG20 G92 X1.00098 Z-0.50201\nG1 X1.50100 Z-0.50200 F4\n",
        (3, 3, 0),
    ),
}
TURNS = {
    "a step before a line is a block behind the last": (
        "X",
        "G1 X20 F100\nX10 Y5\nX30\n",
        "G1 X20.003 F100\nX19.997 Y0.000\nX9.997 Y5.000\nX10.003\nX30.003\n",
        (5, 0, 3),
    ),
    "a step before an arc": (
        "X",
        "G1 X20 F100\nG3 X20 Y0 I-20 J0\nG1 X40\n",
        "G1 X20.003 F100\nG1 X19.997\nG3 X-20.003 Y0 I-20 J0\nG1 X-19.997\n"
        "G3 X20.003 Y0.000 I20.0000 J0.0000\nG1 X40.003\n",
        (4, 0, 4),
    ),
    "two turns of a deleted helix": (
        "X",
        "G1 X20 F100\n/N5 G3 X20 Y0 Z6 I-20 J0 P2 M0 F200\nG1 X40 Y0 Z0\n",
        "G1 X20.003 F100\n/G1 X19.997 F200\n/N5 G3 X-20.003 Y0 Z1.500 I-20 J0 P1  F200\n/G1 X-19.997\n"
        "/G3 X20.003 Y0.000 Z3.000 I20.0000 J0.0000\n/G1 X19.997\n"
        "/G3 X-20.003 Y0.000 Z4.500 I-20.0000 J0.0000\n"
        "/G1 X-19.997\n/G3 X20.003 Y0.000 Z6.000 I20.0000 J0.0000 M0\nG1 X40.003 Y0 Z0\n",
        (5, 0, 8),
    ),
    "all four quarters": (
        "XY",
        "G1 X20 F100\r\nG2 X20 Y0 I-20 J0\r\n",
        "G1 X20.003 F100\r\nG1 X19.997 Y-0.002\r\nG2 X-0.003 Y-20.002 I-20 J0\r\nG1 Y-19.998\r\n"
        "G2 X-20.003 Y0.002 I0.0000 J20.0000\r\nG1 X-19.997\r\nG2 X0.003 Y20.002 I20.0000 J0.0000\r\n"
        "G1 Y19.998\r\nG2 X20.003 Y-0.002 I0.0000 J-20.0000\r\n",
        (5, 0, 8),
    ),
    "a helix of ZX": (
        "XY",
        "G18 G1 X20 F100\nG3 X20 Z0 I-20 K0 Y4\n",
        "G18 G1 X20.003 F100\nG1 X19.997\nG3 X-20.003 Z0 I-20 K0 Y2.002\nG1 X-19.997\n"
        "G3 X20.003 Y4.002 Z0.000 K0.0000 I20.0000\n",
        (5, 0, 4),
    ),
    "a circle of YZ": (
        "XY",
        "G19 G1 Y20 F100\nG3 Y20 Z0 J-20 K0\n",
        "G19 G1 Y20.002 F100\nG1 Y19.998\nG3 Y-20.002 Z0 J-20 K0\nG1 Y-19.998\n"
        "G3 Y20.002 Z0.000 J20.0000 K0.0000\n",
        (4, 0, 4),
    ),
    "an arc that relies on the code before it": (
        "X",
        "G2 X20 I10 F100\nX0 I-10 F50\nN7 Y0 X20 I10\nG1 X5\n",
        "G2 X20.003 I10 F100\nG1 X19.997 F50\nG2 X-0.003 I-10 F50\nG1 X0.003\n"
        "N7 G2 Y0 X20.003 I10\nG1 X19.997\nX4.997\n",
        (5, 0, 4),
    ),
    "a radius": (
        "X",
        "G2 X20 Y0 R10 F100\nG3 X0 Y0 R10\n",
        "G2 X20.003 Y0 R10 F100\nG1 X19.997\nG3 X-0.003 Y0 R10\n",
        (3, 0, 2),
    ),
    "quarters about an absolute centre": (
        "XY",
        "G1 X20 F100\nG90.1 G2 X20 Y0 I0 J0\n",
        # each quarter is shifted by half of the backlash in the directions in which it goes
        "G1 X20.003 F100\nG1 X19.997 Y-0.002\nG90.1 G2 X-0.003 Y-20.002 I-0.0030 J-0.0020\nG1 Y-19.998\n"
        "G2 X-20.003 Y0.002 I-0.0030 J0.0020\nG1 X-19.997\nG2 X0.003 Y20.002 I0.0030 J0.0020\nG1 Y19.998\n"
        "G2 X20.003 Y-0.002 I0.0030 J-0.0020\n",
        (7, 0, 8),
    ),
    "parts of arcs with a radius": (
        "XY",
        "G1 X20 Y5 F100\nG2 X25 Y0 R5\nG3 X35 Y10 R-10\n",
        # a part of at most half a circle has no minus
        "G1 X20.003 Y5.002 F100\nG1 Y4.998\nG2 X25.003 Y-0.002 R5\nG3 X35.003 Y-10.002 R10.0000\n"
        "G1 Y-9.998\nG3 X45.003 Y0.002 I0.0000 J10.0000\nG1 X44.997\nG3 X34.997 Y10.002 I-10.0000 J0.0000\n",
        (9, 0, 6),
    ),
    "circles in G91": (
        "X",
        "G1 X20 F100\nG91\nG3 X0 Y0 I-20 J0\nX0 Y0 I20\nG90 G1 X0\n",
        "G1 X20.003 F100\nG91\nG1 X-0.006\nG3 X-40.000 Y0 I-20 J0\nG1 X0.006\n"
        "G3 X40.000 Y0.000 I20.0000 J0.0000\n"
        "X40.000 Y0 I20\nG1 X-0.006\nG3 X-40.000 Y0.000 I-20.0000 J0.0000\nG90 G1 X-0.003\n",
        (5, 0, 6),
    ),
    "a circle without an end": (
        "X",
        "G1 X20 F100\nN3 g3 i-20 j0 m1 (c)\n",
        "G1 X20.003 F100\nG1 X19.997\nN3 g3 i-20 j0  x-20.003 (c)\nG1 X-19.997\n"
        "G3 X20.003 Y0.000 I20.0000 J0.0000 m1\n",
        (2, 1, 4),
    ),
    "times in G93": (
        "X",
        "G93 G1 X20 F2\nX10 F4.5\nX30 F.5\nG94 X0 F100\n",
        # a step of 6 um has as much of the time as of the length
        "G93 G1 X20.003 F2\nX19.997 F7504.5000\nX9.997 F4.5000\nX10.003 F1667.1667\nX30.003 F0.5000\n"
        "G94 X29.997 F100\nX-0.003\n",
        (5, 0, 4),
    ),
    "distances, and words that end a block": (
        "X",
        "G91 G1 X20 F100\nX-10 Y1\nX5.000 M1 (there)\nX3 M9 M30\n",
        "G91 G1 X20 F100\nX-0.006 Y0.000\nX-10.000 Y1.000\nX0.006  (there)\nX5.000 M1\nX3 M9 M30\n",
        (4, 0, 3),
    ),
    "the time of a circle in G93": (
        "X",
        "G1 X20 F100\nG93 G3 X20 Y0 I20 J0 F2\nG94 G1 X40 F100\n",
        # halves of the circle have twice the feed, the step as much of the time as of the length
        "G1 X20.003 F100\nG93 G3 X60.003 Y0 I20 J0 F4.0000\nG1 X59.997 F41894.1852\n"
        "G3 X19.997 Y0.000 I-20.0000 J0.0000 F4.0000\nG94 G1 X20.003 F100\nX40.003\n",
        (4, 0, 4),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_words_are_changed_and_inserted(name: str, tmp_path: Path) -> None:
    of, text, expected, counts = CASES[name]
    result = corrected(tmp_path, of, HEAD + text)
    assert unstamped(result.data).decode() == HEADS.get(of, HEAD) + expected + "M2\n"
    assert tally(result) == counts


@pytest.mark.parametrize("name", TURNS)
def test_steps_take_up_the_play(name: str, tmp_path: Path) -> None:
    of, text, expected, counts = TURNS[name]
    result = corrected(tmp_path, of, HEAD + text)
    assert unstamped(result.data).decode() == HEADS[of] + expected + "M2\n"
    assert tally(result) == counts
    assert result.report["deviation"]["holds"]


@pytest.mark.parametrize("chunk", (1, 2))
@pytest.mark.parametrize(
    "name",
    [
        "stored positions",
        "a word that a deleted block may have had",
        "behind deleted blocks",
        "two turns of a deleted helix",
    ],
)
def test_texts_are_the_same_where_they_are_written_in_chunks(
    name: str, chunk: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    of, text, expected, counts = (CASES | TURNS)[name]
    monkeypatch.setattr(Writer, "chunk", chunk)
    result = corrected(tmp_path, of, HEAD + text)
    assert unstamped(result.data).decode() == HEADS.get(of, HEAD) + expected + "M2\n"
    assert tally(result) == counts


def test_parts_of_a_long_helix_state_their_own_turns(tmp_path: Path) -> None:
    """Z has a kink in the middle of 3.3 turns: the first and the last third, 1.1 turns each, stay whole."""
    text = HEAD.replace("X0", "X10") + "G1 F100\nG3 X3.4549 Y4.7553 Z40 I-5 J0 P4\n"
    result = corrected(tmp_path, "kink", text)
    first, *rest, last, _ = unstamped(result.data).decode().splitlines()[3:]
    # 1.1 turns are 36 degrees more than one
    assert first == "G3 X9.0451 Y2.9389 Z13.333 I-5 J0 P2"
    assert last.startswith("X3.455 Y4.755 Z39.990 I-1.545") and last.endswith(" P2")
    assert rest and not any("P" in line for line in rest)
    assert result.report["deviation"]["holds"]


REFUSED = {
    "G91": ("G1 X20 F100\nG91 G2 X-40 I-20\n", 4, "sets G91 too; put that code into a block of its own"),
    "G54": ("G1 X20 F100\nG54 G2 X-20 I-20\n", 4, "sets G54 too"),
    "G21": ("G1 X20 F100\nG21 G2 X-20 I-20\n", 4, "sets G21 too"),
    "G92.1": ("G1 X20 F100\nG92.1 G2 X-20 I-20\n", 4, "sets G92.1 too"),
    "G93": (
        "G1 X20 F100\nG93 G3 X20 Y0 I-20 J0 F1.5\n",
        4,
        "G93 gives no time for it; program the arc in G94",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_no_step_can_come_before_is_refused(name: str, tmp_path: Path) -> None:
    text, line, says = REFUSED[name]
    with pytest.raises(ProgramError) as caught:
        corrected(tmp_path, "X", HEAD + text)
    assert (caught.value.line, caught.value.code) == (line, "OLP561")
    assert says in str(caught.value)


def test_a_short_arc_that_rounding_would_make_a_circle_is_refused(tmp_path: Path) -> None:
    """Both ends become 5.000."""
    with pytest.raises(ProgramError, match="the last digit decides") as caught:
        corrected(tmp_path, "scale", HEAD + "G1 X5.000 F100\nG2 X5.001 Y0 I0.0005 J-10\n")
    assert (caught.value.line, caught.value.code) == (4, "OLP561")


def test_a_tiny_arc_keeps_its_radius_where_rounding_would_turn_it_further(tmp_path: Path) -> None:
    """A quarter of a circle with a radius of three digits, as CAM systems write at corners."""
    text = HEAD + "".join(f"G1 X{x} Y{x} F100\nG3 X{x}.003 Y{x}.003 R0.003\n" for x in (4, 6, 8, 11))
    result = corrected(tmp_path, "turned", text)
    arcs = [line.split() for line in result.data.decode().splitlines() if line.startswith("G3 ")]
    assert [float(words[-1][1:]) for words in arcs] == pytest.approx([0.003] * 4, abs=1e-3)
    assert result.report["deviation"]["holds"]


def test_a_circle_that_rounding_would_make_a_short_arc_is_refused(tmp_path: Path) -> None:
    """It begins at 5.002, and ends at 5.0025: in G3 that is ahead, in G2 behind."""
    text = HEAD + "G1 X5.003 F100\n{} X5.0030 Y0 J10\n"
    with pytest.raises(ProgramError, match="the last digit decides"):
        corrected(tmp_path, "scale", text.format("G3"))
    assert b"G2 X5.0025 Y0" in corrected(tmp_path, "scale", text.format("G2")).data


@pytest.mark.parametrize("form", ["I0.007 J-0.650", "R0.650"])
def test_a_short_arc_keeps_its_radius_where_rounding_would_turn_it_over(form: str, tmp_path: Path) -> None:
    """The arc rises by 0.04 um only: with both ends rounded up by 0.4 um its middle is below them."""
    text = HEAD + "".join(f"G1 X{x} Y0 F100\nG2 X{x}.014 {form}\n" for x in (4, 6, 8))
    result = corrected(tmp_path, "turned", text)
    arcs = [line.split() for line in result.data.decode().splitlines() if line.startswith("G2 ")]
    radii = [hypot(*(float(word[1:]) for word in words[2:] if word[0] in "IJR")) for words in arcs]
    assert radii == pytest.approx([0.65] * 3, abs=2e-4)
    assert all(float(words[-1][1:]) * (1 if form[0] == "R" else -1) > 0 for words in arcs)
    assert result.report["deviation"]["holds"]


@pytest.mark.parametrize(
    ("head", "space"),
    [
        ("G21G90G54\nG0X0Y0Z0\n", ""), ("G21 G90 G54\nG0 X0 Y0 Z0\n", " "),
        # two of five words, three of five, three of six
        ("G21 G90G54\nG0 X0Y0Z0\n", ""), ("G21 G90 G54\nG0 X0Y0Z0\n", " "),
        ("G21 G90G54\nG0 X0Y0 Z0F9\n", " "),
    ],
)  # fmt: skip
def test_a_word_behind_the_first_of_a_block_is_spaced_as_most_are(
    head: str, space: str, tmp_path: Path
) -> None:
    text = corrected(tmp_path, "leans", head + "Y100\nY200\n").data
    assert f"Y100{space}X0.010{space}Z-0.020\nY200{space}X0.020{space}Z-0.040\n".encode() in text


@pytest.mark.parametrize(
    ("text", "expected", "counts"),
    [
        # without a point a number counts in digits: 10.010 mm
        (
            "G1 X10010 Y100000 F100\nY200.\nX10.\nG91 Y1000 X50\n",
            "G1 X10.020 Y100000 Z-0.020 F100\nY200. X10.030 Z-0.040\nX10.020\nG91 Y1000 X50\n",
            (2, 3, 0),
        ),
        # 1.0010 inch
        (
            "G20 G1 X10010 Y100000 F100\nY20.\nX10.\nG91 Y1000 X50\n",
            "G20 G1 X1.0020 Y100000 Z-0.0020 F100\nY20. X1.0030 Z-0.0040\nX10.0020\nG91 Y1000 X50\n",
            (2, 3, 0),
        ),
    ],
)
def test_numbers_without_a_point(text: str, expected: str, counts: tuple[int, ...], tmp_path: Path) -> None:
    head = "G21 G90 G54\nG0 X0. Y0. Z0.\n"
    result = corrected(tmp_path, "leans", head + text, controller="fanuc")
    assert unstamped(result.data).decode() == head + expected + "M2\n"
    assert tally(result) == counts


def test_other_codes_may_come_with_the_arc(tmp_path: Path) -> None:
    text = corrected(tmp_path, "X", HEAD + "G1 X20 F100\nG17 G94 G3 X20 Y0 I-20 J0\n").data
    assert b"\nG1 X19.997\nG17 G94 G3 X-20.003 Y0 I-20 J0\n" in text
