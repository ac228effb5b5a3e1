"""Words that say the same after the correction keep their digits, right blocks their count of holes."""

from __future__ import annotations

from pathlib import Path

import pytest
from cases.acceptance import TRUE_ZERO, machine, unstamped

import olp

HEAD = "G21 G90 G54 G64 P0.01\nG0 X1 Y2 Z3\nF100\n"
SAME = {
    "many digits": "G1 X69.04314720812182 Y46.380710659898476\n"
    "G2 X69.7994923857868 Y45.568527918781726 I-10.210659898477157 J-10.00253807106599\n",
    "many digits in G91": "G91\nG1 X69.04314720812182 Y46.380710659898476\nX-.000000000000123 Y12.5\nG90\n",
    "repeats in G91": "G91 G81 X1.5 Y1.25 Z-2 R-1 L3\nG80 G90\n",
    "repeats in G90": "G81 X1.5 Y1.25 Z-2 R-1 L3\nG80\n",
    "pecks of many digits": "G83 X1.012345678901234 Z-2.000000000000123 R1.1 Q.7\nX3\nG80\n",
}
#: 1 um each mm along X
STRETCH = {"x.csv": "X_mm,EXX_um\n-1000,-1000\n2000,2000\n"}
CURVE = '[[curves]]\nfile = "x.csv"\n'


@pytest.mark.parametrize("name", SAME)
def test_a_model_of_zeros_changes_no_word(name: str, tmp_path: Path) -> None:
    text = f"{HEAD}{SAME[name]}M2\n".encode()
    where = machine(tmp_path, CURVE, {"x.csv": "X_mm,EXX_um\n-1000,0\n2000,0\n"}, tables=TRUE_ZERO)
    result = olp.correct(text, where, accept=["OLP440"])
    assert unstamped(result.data) == text


@pytest.mark.parametrize("name", ["many digits in G91"])
def test_one_changed_word_leaves_the_others(name: str, tmp_path: Path) -> None:
    text = f"{HEAD}{SAME[name]}M2\n".encode()
    where = machine(tmp_path, CURVE, STRETCH, tables=TRUE_ZERO)
    written = olp.correct(text, where).data
    assert b"Y46.380710659898476\n" in written
    assert b"Y12.5\n" in written
    assert b"X69.04314720812182" not in written


@pytest.mark.parametrize("control", ["linuxcnc", "fanuc", "haas"])
def test_repeats_at_one_place_are_written_once(control: str, tmp_path: Path) -> None:
    """In G90 a count makes the same hole again."""
    where = machine(tmp_path, CURVE, STRETCH, tables=TRUE_ZERO, controller=control)
    text = b"G21 G90 G54\nG0 X100. Y0. Z3.\nF100 S100 M3\nG81 X500. Z-6. R3. L2\nG80\nM2\n"
    written = olp.correct(text, where).data.decode()
    assert "G81 X499.5" in written
    assert "L2" in written
    assert written.count("G81") == 1


def test_repeats_are_written_out_only_where_they_differ(tmp_path: Path) -> None:
    knee = {"x.csv": "X_mm,EXX_um\n-1000,-1000\n300,300\n2000,300\n"}
    where = machine(tmp_path, CURVE, knee, tables=TRUE_ZERO)
    text = f"{HEAD}G91 G81 X0 Y5 Z-2 R-1 L3\nX100 L2\nX200 L2\nG80 G90\nM2\n".encode()
    written = olp.correct(text, where).data.decode()
    assert "Y5 Z-2 R-1 L3" in written
    assert "L2" not in written
    assert written.count(" L1\nX") == 2


def test_a_block_left_as_it_is_gives_its_words_to_the_next(tmp_path: Path) -> None:
    """A hole under `olp off` states R and depth anew: the next one inherits these, and needs no words."""
    where = machine(tmp_path, CURVE, STRETCH, tables=TRUE_ZERO)
    text = f"{HEAD}G99 G81 X5 Z-100 R2\n(olp off)\nX5 Y3 Z-120 R1\n(olp on)\nX70\nX80\nG80\nM2\n".encode()
    written = olp.correct(text, where).data.decode()
    assert "X5 Y3 Z-120 R1\n(olp on)\nX69.930\nX79.920\n" in written
