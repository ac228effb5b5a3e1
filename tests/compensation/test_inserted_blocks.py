"""Words of a block that is split: which part they go to, by hand."""

from __future__ import annotations

from pathlib import Path

import pytest
from cases.acceptance import TRUE_ZERO, machine, unstamped

import olp

#: A line to X400 bends by 25 um at X160, so it needs more parts than one.
BEND = {"x.csv": "X_mm,EYX_um\n-1000,0\n150,0\n160,25\n2000,25\n"}
CURVE = '[[curves]]\nfile = "x.csv"\ninterpolation = "linear"\n'
HEAD = b"G21 G90 G54\nG0 X0. Y0. Z0.\n"


def parts(folder: Path, block: bytes, head: bytes = HEAD, controller: str = "linuxcnc") -> list[bytes]:
    path = machine(folder, CURVE, BEND, tables=TRUE_ZERO, controller=controller)
    text = unstamped(olp.correct(head + block + b"\nM2\n", path).data)
    lines = text[len(head) :].splitlines()[:-1]
    assert len(lines) >= 3
    return lines


@pytest.mark.parametrize(
    ("word", "controller"),
    [*((word, "linuxcnc") for word in (b"M0", b"M1", b"M2", b"M30")), (b"M5", "mazak"), (b"M9", "mazak")],
)
def test_what_ends_a_block_goes_to_its_last_part(tmp_path: Path, word: bytes, controller: str) -> None:
    *first, last = parts(tmp_path, b"G1 X400. F100. " + word, controller=controller)
    assert last.endswith(b" " + word)
    assert not any(word in line.split() for line in first)


@pytest.mark.parametrize("word", (b"M3 S500", b"M4 S500", b"M5", b"M7", b"M8", b"M9"))
def test_what_begins_a_block_stays_with_its_first_part(tmp_path: Path, word: bytes) -> None:
    """On LinuxCNC spindle and coolant stop before the motion of their block, too."""
    first, *rest = parts(tmp_path, b"G1 X400. F100. " + word)
    assert first.endswith(word)
    assert not any(b"M" in line for line in rest)


@pytest.mark.parametrize("word", (b"M17", b"M017", b"M 17", b"m30"))
def test_the_end_of_a_sinumerik_program_stays_whole(tmp_path: Path, word: bytes) -> None:
    """M17 is read as the end of a program: only M1 went to the last part, and the 7 stayed."""
    *first, last = parts(tmp_path, b"G1 X400. F100. " + word, HEAD.replace(b"G21", b"G71"), "sinumerik")
    assert last.endswith(b" " + word)
    assert not any(b"M" in line.upper() or line.split()[-1].isdigit() for line in first)


def test_both_keep_their_order(tmp_path: Path) -> None:
    first, *_, last = parts(tmp_path, b"G1 X400. F100. M48 M5 M9", controller="mazak")
    assert b"M48" in first and b"M5" not in first and b"M9" not in first
    assert last.endswith(b" M5 M9")


def test_every_part_of_a_deletable_block_is_deletable(tmp_path: Path) -> None:
    lines = parts(tmp_path, b"/G1 X400. F100.\nG1 X0. Y0. Z0.")
    assert all(line.startswith(b"/") for line in lines[: len(lines) // 2])


def test_parts_in_g93_share_the_time_of_their_block(tmp_path: Path) -> None:
    """F1.25 is 0.8 min a block: the times of the parts, 1 / F each, add up to that."""
    lines = parts(tmp_path, b"G1 X400. F1.25", HEAD + b"G93\n")
    feeds = [float(line.split(b"F")[1].split()[0]) for line in lines]
    assert sum(1 / feed for feed in feeds) == pytest.approx(0.8, rel=1e-4)
    # as long as its part is
    x_mm = [0.0, *(float(line.split(b"X")[1].split()[0]) for line in lines)]
    for a, b, feed in zip(x_mm, x_mm[1:], feeds, strict=False):
        assert 1 / feed == pytest.approx(0.8 * (b - a) / 400.0, rel=1e-3)


def test_an_exact_stop_is_at_the_end_of_its_block(tmp_path: Path) -> None:
    """Fanuc: G9 stops behind its own block, so behind the last part of it."""
    text = b"G21 G90 G54\nG0 X0. Y0. Z0.\nG9 G1 X400. F100.\nG09 X0.\nM2\n"
    path = machine(
        tmp_path, CURVE, BEND, controller="fanuc", tables=TRUE_ZERO, keys='decimal_point = "calculator"\n'
    )
    lines = unstamped(olp.correct(text, path).data).splitlines()[2:-1]
    stops = [k for k, line in enumerate(lines) if b"G9" in line or b"G09" in line]
    assert len(stops) == 2 and stops[1] == len(lines) - 1 and stops[0] > 0
    assert all(lines[k].split()[-1] in (b"G9", b"G09") for k in stops)


def test_a_step_in_g93_takes_time_as_its_length_does(tmp_path: Path) -> None:
    """Of 25 um beside 100 mm in 0.05 min the step gets 1/4000: F80000, and no million times F20."""
    backlash = "[backlash]\nX_um = 25.0\n"
    path = machine(tmp_path, backlash, {}, tables=TRUE_ZERO)
    text = HEAD + b"G1 X10. F100.\nG93 G1 X110. F20\nX10. F20\nM2\n"
    lines = unstamped(olp.correct(text, path).data).splitlines()
    feeds = [float(line.split(b"F")[1].split()[0]) for line in lines if b"F" in line][1:]
    assert max(feeds) == pytest.approx(80_000.0, rel=0.02)
    assert sorted(feeds)[:-1] == pytest.approx([20.0] * (len(feeds) - 1))
