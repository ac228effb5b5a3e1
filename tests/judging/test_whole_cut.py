"""The judge of the whole cut, on programs with figures by hand."""

from __future__ import annotations

from pathlib import Path

import pytest
from cases.acceptance import TRUE_ZERO, machine
from cases.whole_cut import judge_whole, marks

pytestmark = pytest.mark.oracle
HEAD = b"G21 G90 G54\n"
#: 0.02 um of X per mm of X
SCALE = '[[curves]]\nfile = "x.csv"\ninterpolation = "linear"\n'
CURVE = {"x.csv": "X_mm,EXX_um\n-1000,-20\n2000,40\n"}
TOOLS = TRUE_ZERO + "[tools.1]\nZ_mm = 100.0\n"


def stiff(folder: Path) -> Path:
    return machine(folder, SCALE, CURVE, tables=TOOLS)


def test_the_last_cut_before_a_tool_change_counts(tmp_path: Path) -> None:
    stiff(tmp_path)
    text = HEAD + b"G0 X0 Y0 Z0\nG1 X100 F500\nT1 M6\nG0 X0 Y1 Z1\nG1 X50\nM2\n"
    whole = judge_whole(text, text, tmp_path)
    assert whole.by_line == pytest.approx({3: 2.0, 6: 1.0}, abs=1e-6)
    assert whole.left_out == 0
    assert (whole.lines, whole.arcs, whole.holes, whole.inserted) == (2, 0, 0, 0)


def test_a_tool_change_before_the_first_move_forgets_a_known_start(tmp_path: Path) -> None:
    stiff(tmp_path)
    text = HEAD + b"T1 M6\nG0 Y1 Z1\nG1 X50 F500\nX100\nM2\n"
    whole = judge_whole(text, text, tmp_path, start_mm=(1000.0, 0.0, 0.0))
    # of the first cut, only its end
    assert whole.by_line == pytest.approx({4: 1.0, 5: 2.0}, abs=1e-6)
    assert whole.left_out > 0
    plain = text.replace(b"T1 M6\n", b"")
    assert judge_whole(plain, plain, tmp_path, start_mm=(1000.0, 0.0, 0.0)).left_out == 0


def test_an_axis_that_stays_after_an_arc_and_a_tool_change_is_unknown(tmp_path: Path) -> None:
    """Where the reader of the programs went astray, a cut seemed to start elsewhere."""
    stiff(tmp_path)
    text = HEAD + b"G0 X0 Y0 Z0\nG2 X20 I10 F500\nT1 M6\nG0 Y5 Z3\nG1 X60\nM2\n"
    other = text.replace(b"X20 I10", b"X20.002 I10.001")
    whole = judge_whole(text, other, tmp_path)
    assert whole.possible_by_line[6] == pytest.approx(1.2, abs=1e-6)
    assert whole.left_out > 0
    assert whole.arcs == 1


def test_holes_and_inserted_blocks_are_counted(tmp_path: Path) -> None:
    stiff(tmp_path)
    text = HEAD + b"G0 X0 Y0 Z5\nG81 X50 Y0 Z-5 R2 F100\nX100\nG80\nG0 X0\nG1 X40\nM2\n"
    other = text.replace(b"G1 X40", b"G1 X20\nX40")
    whole = judge_whole(text, other, tmp_path)
    assert (whole.lines, whole.holes, whole.inserted) == (1, 2, 1)
    assert whole.by_line == pytest.approx({3: 1.0, 4: 2.0, 7: 0.8}, abs=1e-6)


def test_what_is_off_is_marked_and_judged(tmp_path: Path) -> None:
    stiff(tmp_path)
    text = HEAD + b"G0 X0 Y0 Z5\n(olp off)\nG1 X500 F100\n(olp on)\nG1 X400\nG53 G0 Z0\nM2\n"
    assert marks(text).left == {3, 4, 7}
    whole = judge_whole(text, text, tmp_path)
    # to 500 mm and from there, where the tool is left 10 um off
    assert whole.by_line == pytest.approx({4: 10.0, 6: 10.0}, abs=1e-6)
    assert whole.loose == 1
