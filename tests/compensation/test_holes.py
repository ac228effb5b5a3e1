"""Whole texts of canned cycles, worked by hand, on the machines of test_blocks."""

from __future__ import annotations

import functools
import random
from pathlib import Path

import pytest
from cases.acceptance import TRUE_ZERO, machine, unstamped
from cases.fast import some_fast

import olp
from olp.compensation.writer import Writer
from olp.program.rs274 import reader
from olp.program.rs274.lexer import chunks

CURVE = '[[curves]]\nfile = "{}.csv"\ninterpolation = "linear"\n'
#: 10.001 becomes 10.000 in X, Y and Z
SCALE = "".join(CURVE.format(axis) for axis in "xyz")
SCALES = {f"{a.lower()}.csv": f"{a}_mm,E{a}{a}_um\n-1000,-100\n2000,200\n" for a in "XYZ"}
#: at Y 100 X becomes X + 0.010 and Z becomes Z - 0.020
LEANS = {"y.csv": "Y_mm,EXY_um,EZY_um\n-1000,100,-200\n2000,-200,400\n"}
MACHINES = {
    "scale": (SCALE, SCALES),
    "leans": (CURVE.format("y"), LEANS),
    "plays": ("[backlash]\nX_um = 6.0\nZ_um = 4.0\n", {}),
}
#: machine, text, corrected text, and the words changed, the words inserted, the blocks inserted
CASES = {
    "a series inherits R and depth": (
        "scale",
        "G0 X0 Y0 Z5.0005\nG99 G81 X10.001 Y20.002 Z-10.001 R2.0002 F100\nX20.002\nY30.003 Z-20.002\n"
        "X0 R1.0001\nG98 X5.0005\nG80\nG0 X0 Y0 Z10.001\nG83 X10.001 Z-10.001 R1 Q3\nX20.002\n",
        "G0 X0 Y0 Z5.0000\nG99 G81 X10.000 Y20.000 Z-10.000 R2.0000 F100\nX20.000\nY30.000 Z-20.000\n"
        "X0 R1.0000\nG98 X5.0000\nG80\nG0 X0 Y0 Z10.000\nG83 X10.000 Z-10.000 R1 Q3\nX20.000\n",
        (14, 0, 0),
    ),
    "in ZX": (
        "scale",
        "G0 X0 Y5.0005 Z0\nG18 G99 G81 X10.001 Z20.002 Y-10.001 R2.0002 F100\nZ10.001\nG80\nG1 X20.002\n",
        "G0 X0 Y5.0000 Z0\nG18 G99 G81 X10.000 Z20.000 Y-10.000 R2.0000 F100\nZ10.000\nG80\nG1 X20.000\n",
        (7, 0, 0),
    ),
    "in YZ": (
        "scale",
        "G0 X5.0005 Y0 Z0\nG19 G99 g81y10.001z20.002x-10.001r2.0002f100\nz10.001\n",
        "G0 X5.0000 Y0 Z0\nG19 G99 g81y10.000z20.000x-10.000r2.0000f100\nz10.000\n",
        (6, 0, 0),
    ),
    "in inches": (
        "scale",
        "G0 X0 Y0 Z5.0005\nG20 G99 G81 X1.0001 Y2.0002 Z-1.0001 R.10001 F10\nX2.0002\nG91 X1.0001 L2\n",
        "G0 X0 Y0 Z5.0000\nG20 G99 G81 X1.00000 Y2.00000 Z-1.00000 R0.10000 F10\nX2.00000\nG91 X1.00000 L2\n",
        (7, 0, 0),
    ),
    "words where the inherited ones are wrong": (
        "leans",
        "G0 X0 Y0 Z5\nG99 G81 X10 Y100 Z-10 R2 F100\nX20\nY200\n\ty300\nX5 Z-20\nG80\nG0 Y0\n",
        # after the cycle Z is at R: Y goes to 0, so X and Z come back
        "G0 X0 Y0 Z5\nG99 G81 X10.010 Y100 Z-10.020 R1.980 F100\nX20.010\nY200 X20.020 R1.960 Z-10.040\n"
        "\ty300 x20.030 r1.940 z-10.060\nX5.030 Z-20.060\nG80\nG0 Y0 X5.000 Z2.000\n",
        (6, 8, 0),
    ),
    "half a digit": (
        "leans",
        "G0 X0 Y0 Z5\nG99 G81 X10 Y0 Z-10 R2 F100\nY5\nY5.1\n",
        # at Y 5 X is off by half a digit: no word is worth it
        "G0 X0 Y0 Z5\nG99 G81 X10 Y0 Z-10 R2 F100\nY5 R1.999 Z-10.001\nY5.1 X10.001\n",
        (0, 3, 0),
    ),
    "where Z is behind the cycle": (
        "leans",
        # at the initial level, which has no correction; at R; at R, which is higher
        "G0 X0 Y0 Z5\nG98 G81 X10 Y100 Z-10 R2 F100\nG80\nG0 Y200\nG99 G81 Y100 Z-10 R2\nG80\nG0 Y200\n"
        "G98 G81 Y100 Z-10 R7\nG80\nG0 Y200\n",
        "G0 X0 Y0 Z5\nG98 G81 X10.010 Y100 Z-10.020 R1.980 F100\nG80\nG0 Y200 X10.020 Z4.960\n"
        "G99 G81 Y100 Z-10.020 R1.980 X10.010\nG80\nG0 Y200 X10.020 Z1.960\n"
        "G98 G81 Y100 Z-10.020 R6.980 X10.010\nG80\nG0 Y200 X10.020 Z6.960\n",
        (7, 8, 0),
    ),
    "repeats that need different words": (
        "leans",
        # each is 0.020 lower than the one before; R counts from Z 5, and the depth from R
        "G0 X0 Y0 Z5\nG91 G81 X10 Y100 Z-10 R-3 F100 L3\nX5\nG80\nG90 G0 Y0\n",
        "G0 X0 Y0 Z5\nG91 G81 X10.010 Y100 Z-10 R-3.020 F100 L1\nX10.010 Y100.000 R-3.040\n"
        "X10.010 Y100.000 R-3.060\nX5\nG80\nG90 G0 Y0 X35.000 Z2.000\n",
        (2, 2, 2),
    ),
    "repeats that need the same words": (
        "leans",
        "G0 X0 Y100 Z5\nG91 G81 X10 Z-10 R-3 F100 L3\nX5 L2\nG80\nG90 G0 Y0\n",
        "G0 X0.010 Y100 Z4.980\nG91 G81 X10 Z-10 R-3 F100 L3\nX5 L2\nG80\nG90 G0 Y0 X40.000 Z2.000\n",
        (2, 2, 0),
    ),
    "play": (
        "plays",
        # the level is reached from above, then from the bottom of the hole before; after G98 from above
        "G0 X0 Y0 Z5\nG99 G81 X10 Y20 Z-10 R2 F100\nX20\nX15\nG98 X12\n",
        "G0 X0 Y0 Z5\nG99 G81 X10.003 Y20 Z-10.002 R1.998 F100\nX20.003 R2.002\nX14.997\n"
        "G98 X11.997 R1.998\n",
        (6, 2, 0),
    ),
    "left as it is": (
        "scale",
        "G0 X0 Y0 Z5.0005\nG99 G81 X10.001 Y20 Z-10.001 R2 F100\n(olp off)\nX30 Z-11\nX40 R3\n"
        "(olp on)\nX20.002\n",
        "G0 X0 Y0 Z5.0000\nG99 G81 X10.000 Y19.998 Z-10.000 R2 F100\n(olp off)\nX30 Z-11\nX40 R3\n(olp on)\n"
        "X20.000 Y19.998 R2.9997 Z-10.9989\n",
        (5, 3, 0),
    ),
}


@pytest.mark.parametrize("chunk", (1 << 15, 1))
@pytest.mark.parametrize("name", CASES)
def test_words_of_holes(name: str, chunk: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    of, text, expected, counts = CASES[name]
    calibration, curves = MACHINES[of]
    head = "G21 G90 G54\n"
    path = machine(tmp_path, calibration, curves, tables=TRUE_ZERO)
    # as one, and a block at a time
    monkeypatch.setattr(Writer, "chunk", chunk)
    result = olp.correct(f"{head}{text}G80\nM2\n".encode(), path)
    assert unstamped(result.data).decode() == f"{head}{expected}G80\nM2\n"
    moves = result.report["moves"]
    assert (moves["changed_words"], moves["inserted_words"], moves["inserted_blocks"]) == counts


#: what comes between two series: other moves, in G91 too, another frame, what is left as it is
BETWEEN = (
    "G80\nG0 Z9\nG81 Z-3 R1 X4",
    "G80\nG1 Z9\nX7.5\nG91 X1.001 Y2\nG90\nG99 G81 Y4 Z-3 R2",
    "G80\nG92 X3 Y5\nG0 Z7.001\nG82 X5 Z-3.001 R1 P1\nG0 G92.1\nG0 Y8\nG81 Z-4 R3",
    "G80\n(olp off)\nG0 X3 Z8\nG81 Z-3 R1\n(olp on)\nX8\nG80\nG0 X3\nG81 Z-3.5 R1",
    "G0\nG81 Z-6 R0.5\nG80\nG18\nG0 X1 Y2\nG81 Z1 Y-1 R4\nG17\nG0 Z5\nG81 Z-3 R2",
)


def drilled(seed: int) -> str:
    """Series of holes, some with depths, levels, returns and repeats, the last ones in G91."""
    draw = random.Random(seed)
    lines = ["G0 X0 Y0 Z5", f"G99 G8{draw.choice('123')} X10 Y20 Z-10 R2 Q3 P1 F100"]
    lines[1] = lines[1].replace(" Q3", "" if "G83" not in lines[1] else " Q3")
    lines[1] = lines[1].replace(" P1", "" if "G82" not in lines[1] else " P1")
    for _ in range(30):
        words = [f"{a}{draw.uniform(0, 300):.3f}" for a in "XY" if draw.random() < 0.7] or ["X5"]
        words += [f"Z{draw.uniform(-20, -5):.2f}"] * (draw.random() < 0.2)
        words += [f"R{draw.uniform(0, 9):.2f}"] * (draw.random() < 0.2)
        words += ["L2"] * (draw.random() < 0.1)
        words[:0] = [draw.choice(["G98", "G99"])] * (draw.random() < 0.1)
        if draw.random() < 0.1:
            lines += [draw.choice(["(c)", "M8", *BETWEEN])]
        lines.append(" ".join(words))
    return "\n".join(lines) + "\nG91 X1 L3\nX2 Y2\n"


@pytest.mark.parametrize("seed", some_fast(range(8), 3))
@pytest.mark.parametrize("of", MACHINES)
def test_a_series_is_written_the_same_at_once_and_block_by_block(
    seed: int, of: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calibration, curves = MACHINES[of]
    path = machine(tmp_path, calibration, curves, tables=TRUE_ZERO)
    data = f"G21 G90 G54\n{drilled(seed)}G80\nM2\n".encode()
    whole = olp.correct(data, path)
    monkeypatch.setattr(Writer, "chunk", 1)
    monkeypatch.setattr(reader, "chunks", functools.partial(chunks, size=1))
    single = olp.correct(data, path)
    assert single.data == whole.data
    assert single.report["deviation"] == whole.report["deviation"]
    assert single.report["moves"] == whole.report["moves"]
