"""What other correctors of programs get wrong: their defects and their users' complaints, each as a test."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine, points, unstamped, words
from judge import machines
from judge.machines import Recipe

import olp
from olp.core.errors import AlreadyCorrected, OutsideBox, ProgramError

#: 1 mm in X over 100 mm of Y, a skew that shows
SKEW = "[squareness]\nC0Y_urad = -10000.0\n"

#: errors of 10 mm/m, so that they are read off by eye
WIDE = f"{TRUE_ZERO}[check]\nlargest_correction_um = 30000.0\n"


@pytest.fixture
def skewed(tmp_path: Path) -> Path:
    return machine(tmp_path, SKEW, tables=WIDE)


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Smooth errors of some 100 um, straightness and angles too."""
    return machines.random_machine(tmp_path_factory.mktemp("bent"), 4, Recipe(peak_um=(90.0, 110.0)))


def correct(text: bytes, path: Path) -> bytes:
    return unstamped(olp.correct(text, path).data)


def refusal(text: bytes, path: Path) -> ProgramError:
    with pytest.raises(ProgramError) as caught:
        olp.correct(text, path)
    return caught.value


# -- skew filters --------------------------------------------------------------------------------------


def test_a_skew_needs_no_more_than_two_lines(tmp_path: Path) -> None:
    """The wish that controls refuse ("do it on the PC"): one number, no curves."""
    path = machine(tmp_path, "[squareness]\nC0Y_urad = 50.0\n", tables=WIDE)
    assert words(correct(b"G0 X0. Y100. Z0.\n", path), "X") == [0.005]


def test_a_move_in_y_alone_gets_its_x(skewed: Path) -> None:
    """A filter that edits only the words it finds leaves the whole millimetre."""
    text = correct(b"G21 G90\nG0 X0. Y0. Z0.\nG1 Y100. F100\nN10 G1 Y50.\n", skewed)
    end = points(text)
    assert end[1] == pytest.approx((-1.0, 100.0, 0.0), abs=2e-4)
    assert end[-1] == pytest.approx((-0.5, 50.0, 0.0), abs=2e-4)
    assert b"N10 G1 Y50." in text


def test_arcs_are_corrected_too(skewed: Path) -> None:
    text = correct(b"G21 G90 G17\nG0 X0. Y0. Z0.\nG2 X10. Y10. I10. F100\n", skewed)
    assert points(text)[-1][:2] == pytest.approx((9.9, 10.0), abs=1e-3)


def test_offsets_and_comments_are_no_moves(skewed: Path) -> None:
    head = b"G21 G90\n(X1 Y2 G1 Z3)\nG10 L2 P1 X5. Y0. Z0. ; X7 Y8\n"
    text = correct(head + b"G0 X0. Y100. Z0. (to Y100)\n", skewed)
    assert text == head + b"G0 X-1.000 Y100. Z0. (to Y100)\n"


def test_digits_are_kept_where_there_are_more_than_three(tmp_path: Path) -> None:
    path = machine(tmp_path, "[squareness]\nC0Y_urad = -12.3\n", tables=WIDE)
    text = correct(b"G0 X0.00001 Y100.00000 Z0.00000\n", path)
    assert text == b"G0 X-0.00122 Y100.00000 Z0.00000\n"


# -- height maps ---------------------------------------------------------------------------------------


def test_incremental_programs_stay_incremental(skewed: Path) -> None:
    text = correct(b"G21 G90\nG0 X0. Y0. Z0.\nG91\nG1 X20. F100\nY100.\nX20.\nG90\nG0 X0. Y0.\n", skewed)
    end = points(text)
    assert end[-2] == pytest.approx((39.0, 100.0, 0.0), abs=1e-3)
    assert [abs(x) <= 20.01 for x in words(text, "X")] == [True] * len(words(text, "X"))


def test_a_move_to_where_the_uncorrected_axis_stands_is_written(tmp_path: Path) -> None:
    """Two states are kept apart: nominal Z stays at -1, the corrected one does not."""
    path = machine(tmp_path, "[squareness]\nA0Z_urad = 0.0\n" + CURVE, {"x.csv": TILT}, tables=WIDE)
    text = correct(b"G0 X0. Y0. Z-1.\nG0 X100. Z-1.\nG0 Z-1.\n", path)
    assert words(text, "Z") == [-1.0, -1.5, -1.5]


CURVE = '[[curves]]\nfile = "x.csv"\ninterpolation = "linear"\n'
TILT = "X_mm,EZX_um\n-1000,-5000\n2000,10000\n"


def test_machine_moves_stay_machine_moves(skewed: Path) -> None:
    text = correct(b"G21 G90\nG0 X0. Y100. Z0.\nG53 G0 Z0.\nG28 Z0.\nG0 X0. Y0. Z0.\n", skewed)
    assert b"\nG53 G0 Z0.\nG28 Z0.\n" in text


def test_depths_of_cycles_are_corrected(tmp_path: Path) -> None:
    path = machine(tmp_path, CURVE, {"x.csv": TILT}, tables=WIDE)
    text = correct(b"G21 G90\nG0 X0. Y0. Z20.\nG99 G81 X100. Y0. Z-10. R5. F100\nX200.\nG80\n", path)
    z, r = words(text, "Z"), words(text, "R")
    assert z[1] == pytest.approx(-10.5, abs=1e-3)
    assert r[0] == pytest.approx(4.5, abs=1e-3)
    assert z[2] == pytest.approx(-11.0, abs=1e-3)


@pytest.mark.parametrize("block", [b"G1 X#1 Y50\n", b"G1 X[1+2] Y50\n", b"o100 call\n"])
def test_expressions_are_refused_with_their_line(skewed: Path, block: bytes) -> None:
    assert refusal(b"G21 G90\nG0 X0. Y0. Z0.\n" + block, skewed).line == 3


def test_no_radius_is_left_behind_on_a_line(bent: Path) -> None:
    text = correct(
        b"G21 G90 G54\nG0 X-40. Y0. Z0.\nG2 X40. Y0. R40. F500\nG3 X-40. Y0. R-41.\nG1 X0.\n", bent
    )
    motion = ""
    for block in text.decode().splitlines():
        code = re.search(r"G0?([0-3])(?!\d)", block)
        motion = code[1] if code else motion
        if "olp-corrected" not in block:
            assert bool(re.search("[RIJK]", block)) == (motion in ("2", "3") and "X" in block), block


def test_rapids_are_corrected_too(skewed: Path) -> None:
    assert words(correct(b"G0 X0. Y0. Z5.\nG0 X10. Y100.\nG0 Y0.\n", skewed), "X") == [0.0, 9.0, 10.0]


def test_the_first_move_and_the_retract_keep_their_height(bent: Path) -> None:
    """A broken tool is the price of a first move that goes elsewhere: none is off by more than the error."""
    text = correct(b"G21 G90 G54\nG0 Z35.\nG0 X-30. Y-20.\nG1 Z-5. F300\nX30. Y25.\nG0 Z35.\nM30\n", bent)
    heights = words(text, "Z")
    assert abs(heights[0] - 35.0) <= 0.15
    assert abs(heights[-1] - 35.0) <= 0.15
    assert min(heights) >= -5.15


# -- backlash by text ------------------------------------------------------------------------------------


def test_no_move_is_made_that_nobody_asked_for(tmp_path: Path) -> None:
    """No positioning move at an unknown height: inserted blocks and words take up play and no more."""
    path = machine(tmp_path, "[backlash]\nX_um = 20.0\nY_um = 20.0\n", tables=WIDE)
    nominal = b"G21G90\nG0X10Y10\nG0Z5\nG1Z-1F100\nX20\nY20\nX10\nY10\nG0Z5\n"
    text = correct(nominal, path)
    assert len(re.findall(rb"(?m)^G0(?!\d)", text)) == len(re.findall(rb"(?m)^G0(?!\d)", nominal))
    first = text.split(b"\n")
    # the rapid before the first cut goes past X and Y by their play and comes back
    assert (first[1], first[2][:4]) == (b"G0X10Y10", b"G0Z5")
    steps = np.abs(np.diff(points(text)[2:], axis=0))
    assert ((steps <= 0.0321) | (steps >= 5.9)).all()


def test_modal_lines_and_words_without_spaces_are_read(tmp_path: Path) -> None:
    path = machine(tmp_path, "[backlash]\nX_um = 20.0\n", tables=WIDE)
    end = points(correct(b"G21G90\nG0X-9Y0Z0\nG1X10F100\nX20\nX5\nX30\n", path))[:, 0]
    assert [float(np.abs(end - x).min()) < 1e-9 for x in (10.01, 20.01, 4.99, 30.01)] == [True] * 4


# -- people who want their arcs back ---------------------------------------------------------------------


def test_arcs_stay_arcs(bent: Path) -> None:
    text = correct(
        b"G21 G90 G54\nG0 X-40. Y0. Z0.\nG2 X40. Y0. I40. J0. F500\nG2 X-40. Y0. I-40. J0.\n", bent
    )
    assert b"G1" not in text
    assert 2 <= len(points(text)) - 1 <= 24


# -- order and sum of corrections ------------------------------------------------------------------------


def test_sources_add_up_whatever_their_order(tmp_path: Path) -> None:
    both = machine(tmp_path / "both", SKEW + CURVE, {"x.csv": TILT}, tables=WIDE)
    swapped = machine(tmp_path / "swapped", CURVE + SKEW, {"x.csv": TILT}, tables=WIDE)
    text = b"G0 X50. Y100. Z1.\n"
    assert correct(text, both) == correct(text, swapped)
    assert points(correct(text, both))[0] == pytest.approx((49.0, 100.0, 0.755), abs=1e-3)


# -- twice, and outside ----------------------------------------------------------------------------------


def test_a_map_is_never_applied_twice(skewed: Path) -> None:
    once = olp.correct(b"G0 X0. Y100. Z0.\n", skewed).data
    with pytest.raises(AlreadyCorrected, match="stamp"):
        olp.correct(once, skewed)


@pytest.mark.parametrize(
    "block", [b"G0 X1999.9999 Y100. Z0.\n", b"G0 X0. Y2001. Z0.\n", b"G0 X0. Y0. Z-1001.\n"]
)
def test_outside_the_calibrated_box_nothing_is_guessed(tmp_path: Path, block: bytes) -> None:
    """Others clamp, extrapolate, or take the highest value there, and say nothing."""
    path = machine(tmp_path, "[squareness]\nC0Y_urad = 10000.0\n", tables=WIDE)
    with pytest.raises(OutsideBox) as caught:
        olp.correct(b"G21 G90\n" + block, path)
    assert caught.value.line == 2
    held = olp.correct(b"G21 G90\n" + block, path, outside_box="hold")
    assert "OLP403" in {finding.code for finding in held.findings}


def test_leaving_the_travel_is_an_error_not_a_silent_skip(tmp_path: Path) -> None:
    """A firmware leaves out the correction where it would leave the travel; the step stays in the part."""
    path = machine(tmp_path, "[squareness]\nC0Y_urad = -10000.0\n", tables=WIDE)
    path.write_text(path.read_text().replace("[-1000.0, 2000.0]", "[0.0, 500.0]", 1))
    result = olp.correct(b"G21 G90\nG0 X0. Y100. Z0.\n", path, accept=["OLP452"])
    assert points(result.data)[0][0] == pytest.approx(-1.0, abs=1e-3)
    assert [(f.code, f.line) for f in result.findings if f.severity.name == "ERROR"] == [("OLP402", 2)]
