"""Contours under cutter compensation: which blocks and words a correction inserts, holds and refuses."""

from __future__ import annotations

from pathlib import Path

import pytest
from cases.acceptance import TRUE_ZERO, machine, unstamped

import olp
from olp.core.errors import ProgramError

HEAD = b"G21 G90 G54 G64 P0.001 Q0\nG0 X0 Y0 Z10\nG1 Z0 F600\n"
#: a rectangle, entered and left
RECTANGLE = b"G41 D1 X20 Y20\nX100\nY80\nX20\nY20\nG40 G0 X0 Y0\n"
PLAY = "[backlash]\nX_um = 6.0\nY_um = 6.0\n"
#: leaning columns: X and Y follow Z
LEANING = "[squareness]\nB0Z_urad = 500.0\nA0Z_urad = 500.0\n"
#: X is bent along Y
BENT = {"y.csv": "Y_mm,EXY_um\n-1000,0\n0,0\n30,30\n60,0\n90,30\n120,0\n2000,0\n"}
CURVE_Y = '[[curves]]\nfile = "y.csv"\ninterpolation = "linear"\n'


def tool(radius_mm: float) -> str:
    return f"{TRUE_ZERO}[tools.1]\nZ_mm = 0.0\nradius_mm = {radius_mm}\n[job_defaults]\ntool = 1\n"


def corrected(folder: Path, body: bytes, calibration: str = "", **options: object) -> olp.Correction:
    path = machine(folder, calibration, BENT, tables=tool(5.0))
    return olp.correct(HEAD + body + b"M2\n", path, contour=True, **options)  # type: ignore[arg-type]


def body(result: olp.Correction) -> list[bytes]:
    return unstamped(result.data).splitlines()[HEAD.count(b"\n") :]


def test_no_step_takes_up_backlash_along_a_contour(tmp_path: Path) -> None:
    result = corrected(tmp_path, RECTANGLE, PLAY)
    # the one block takes it up in the rapid before the contour
    assert result.report["moves"]["inserted_blocks"] == 1
    assert result.data.index(b"G41") > result.data.index(b"\n", result.data.index(b"G0 X"))
    off = result.data.count(b"\n")
    plain = corrected(tmp_path, RECTANGLE.replace(b"G41 D1", b"G1").replace(b"G40 ", b""), PLAY)
    assert plain.data.count(b"\n") > off


def test_the_proof_counts_what_a_turn_without_a_step_leaves(tmp_path: Path) -> None:
    slanted = b"G41 D1 X20 Y20\nX100 Y30\nX20 Y60\nG40 G0 X0 Y0\n"
    deviation = corrected(tmp_path, slanted, PLAY).report["deviation"]
    assert not deviation["holds"]
    assert 1.0 < deviation["path_max_um"] < 7.0


@pytest.mark.parametrize("off", [b"G40\n", b"G40 "])
def test_an_axis_that_the_program_leaves_beside_the_contour_gets_no_word(tmp_path: Path, off: bytes) -> None:
    text = b"G41 D1 X20 Y20\nX100\nZ-20\nY80\n" + off + b"G0 Z50\nX0\nG1 Z40\nY0\n"
    lines = body(corrected(tmp_path, text, LEANING))
    assert lines[2] == b"Z-20" and lines[3].startswith(b"Y79.990 X100.010")
    assert lines[-5].endswith(b"Z50") and b"X" not in lines[-5]
    assert not [line for line in lines[-5:-2] if b"Y" in line]
    assert lines[-4].startswith(b"X-0.0") and b"X" in lines[-3] and lines[-2].startswith(b"Y0.0")


def test_the_first_and_the_last_move_are_not_split(tmp_path: Path) -> None:
    text = b"G41 D1 X20 Y110\nX100 Y20\nX200 Y110\nG40 G1 X20 Y0\n"
    lines = body(corrected(tmp_path, text, CURVE_Y))
    assert lines[0].startswith(b"G41") and lines[1].startswith(b"X")
    assert b"G40" in lines[-2] and lines[-1] == b"M2"
    assert len(lines) > 5


def test_no_part_ends_near_a_concave_corner(tmp_path: Path) -> None:
    """Half as far from the corners as a radius of 5 mm cuts off, the chords bend at Y = 90 all the same."""
    inside = b"G41 D1 X20 Y20\nX100\nY91\nX20\nG40 G0 X0 Y0\n"
    outside = inside.replace(b"G41", b"G42")
    assert b"Y90" not in corrected(tmp_path, inside, CURVE_Y).data
    assert b"Y90" in corrected(tmp_path, outside, CURVE_Y).data


@pytest.mark.parametrize(
    ("entry", "line"),
    [(b"G41 D1 X5.001 Y0\nX60\n", 4), (b"G41 D1 X20 Y0\nG3 X30.002 Y0 I5.001\nG1 X60\n", 5)],
)
def test_what_the_control_would_refuse_is_refused_with_its_line(
    tmp_path: Path, entry: bytes, line: int
) -> None:
    """Stretched by 1e-3, a move or an arc becomes less than the cutter is wide."""
    stretch = {"x.csv": "X_mm,EXX_um\n-1000,-1000\n2000,2000\n"}
    path = machine(tmp_path, CURVE_Y.replace("y.csv", "x.csv"), stretch, tables=tool(5.0))
    text = HEAD + entry + b"Y30\nG40 G0 X0 Y0\nM2\n"
    with pytest.raises(ProgramError, match="control would refuse") as caught:
        olp.correct(text, path, contour=True)
    assert caught.value.line == line
    assert olp.correct(text.replace(b"G41 D1", b"G1"), path).report["deviation"]["holds"]


def test_an_unknown_radius_is_said(tmp_path: Path) -> None:
    known = corrected(tmp_path, RECTANGLE).findings
    unknown = corrected(tmp_path, RECTANGLE.replace(b"D1", b"D7")).findings
    (one,), (other,) = ([f for f in some if f.code == "OLP305"] for some in (known, unknown))
    assert not one.lines and "radius" not in one.message
    assert other.lines and "radius_mm" in other.message


def test_points_under_cutcom_get_no_step(tmp_path: Path) -> None:
    path = machine(tmp_path, PLAY, tables=tool(5.0))
    text = b"UNITS/MM\nRAPID\nGOTO/0,0,0\nFEDRAT/600,MMPM\n%sGOTO/50,0,0\nGOTO/20,30,0\n%sGOTO/0,0,0\nFINI\n"
    on = olp.correct(text % (b"CUTCOM/LEFT\n", b"CUTCOM/OFF\n"), path, contour=True)
    off = olp.correct(text % (b"", b""), path)
    # one of them takes it up in the rapid before the contour
    assert on.data.count(b"GOTO") == 5 < off.data.count(b"GOTO")
