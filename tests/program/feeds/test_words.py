"""Planned feeds in F words: which bytes change, to what, and that they read back."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine
from hypothesis import given, settings
from hypothesis import strategies as st
from program.feeds.test_timing import reading, setup_of, timed

import olp
from olp.core.errors import ProgramError
from olp.files.config import load_setup
from olp.program.feeds.moves import lengths_mm
from olp.program.feeds.words import FeedsWritten, write_feeds
from olp.workflows.retime import Retiming

START = "start_mm = { X = 0.0, Y = 0.0, Z = 0.0 }"
CALCULATOR = 'decimal_point = "calculator"'
PLACES = st.floats(-50, 50)
_F = re.compile(rb"([Ff]\s*)([\d. \t+]+)")


def blanked(text: bytes) -> bytes:
    """The text without the numbers behind F."""
    return _F.sub(rb"\1#", text)


def values(text: bytes) -> list[bytes]:
    return [number for _, number in _F.findall(text)]


def halved(text: str, control: str = "linuxcnc", keys: str = "", share: float = 0.5) -> FeedsWritten:
    """As if each line with feed moves had been planned to take longer by so much."""
    program = reading(text, control, keys)
    path = program.toolpath
    lines = np.unique(path.line[path.kind != 0]).astype(np.int64)
    seconds = np.ones(len(lines))
    return write_feeds(program, lines, seconds / share, seconds)


#: text, control, the number after F at half the feed
STYLES: dict[str, tuple[str, str, list[bytes]]] = {
    "whole": ("G1 X9 F600", "linuxcnc", [b"300"]),
    "a point at the end": ("G1 X9 F600.", "linuxcnc", [b"300."]),
    "decimals": ("G1 X9 F600.00", "linuxcnc", [b"300.00"]),
    "none before the point": ("G1 X9 F.5", "linuxcnc", [b".25"]),
    "nought before the point": ("G1 X9 F0.5", "linuxcnc", [b"0.25"]),
    "leading noughts": ("G1 X9 F0600", "linuxcnc", [b"0300"]),
    "a sign": ("G1 X9 F+600", "linuxcnc", [b"+300"]),
    "lower case and blanks": ("g1 x9 f 6 0 0 y1", "linuxcnc", [b"300"]),
    "inch": ("G20 G1 X1 F7.5", "linuxcnc", [b"3.75"]),
    "a digit more": ("G1 X9 F3", "linuxcnc", [b"1.5"]),
    "no more than needed": ("G1 X9 F333", "linuxcnc", [b"166"]),
    "inverse time": ("G93\nG1 X9 F8\nX12 F6", "linuxcnc", [b"4", b"3"]),
    "by turns": ("S600\nG95\nG1 X9 F0.2", "linuxcnc", [b"0.1"]),
    "whole on a control that counts": ("G1 X9. F601", "fanuc", [b"300"]),
    "with a point on one": ("G1 X9. F3.", "haas", [b"1.5"]),
    "calculator": ("G1 X9 F3", "fanuc.", [b"1.5"]),
    "an F word on its own": ("F600\nG1 X9\nX12", "linuxcnc", [b"300"]),
    "one that nothing uses": ("F600\nG0 X9\nF60\nG1 X12", "linuxcnc", [b"600", b"30"]),
    "in comments": ("G1 X9 F600 (F600)\n;F6\n", "linuxcnc", [b"300", b"600", b"6"]),
    "after the end": ("G1 X9 F600\nM2\nF600", "linuxcnc", [b"300", b"600"]),
}


@pytest.mark.parametrize("name", STYLES)
def test_style_is_kept(name: str) -> None:
    text, control, want = STYLES[name]
    keys = CALCULATOR if control.endswith(".") else ""
    written = halved(text, control.rstrip("."), keys)
    assert [v.replace(b" ", b"") for v in values(written.data)] == want
    assert blanked(written.data) == blanked(text.encode())
    halves = timed(text, control.rstrip("."), keys).feed_mm_s / 2.0
    got = timed(written.data.decode(), control.rstrip("."), keys).feed_mm_s
    np.testing.assert_allclose(got, halves, rtol=0.01)


@given(
    st.decimals(min_value="0.001", max_value=99999, places=3).map(str) | st.integers(1, 99999).map(str),
    st.floats(0.001, 1.5),
)
def test_a_written_feed_is_the_planned_one_and_never_more(number: str, share: float) -> None:
    text = f"G21 G1 X9 F{number} (part)\r\nY3\r\n"
    if not float(number) > 0.0:
        return
    written = halved(text, share=share)
    before, after = (float(values(t)[0]) for t in (text.encode(), written.data))
    assert after <= before
    # a word is kept within 1 % of itself, which is a little more of the planned feed
    assert after == pytest.approx(min(share, 1.0) * before, rel=0.0102, abs=1e-6)
    assert blanked(written.data) == blanked(text.encode())
    assert (written.changed == 0) == (written.data == text.encode())


def test_a_feed_that_its_style_cannot_hold_is_refused() -> None:
    with pytest.raises(ProgramError, match="decimal point") as caught:
        halved("G1 X5. F60\nX9. F1", "fanuc", share=0.1)
    assert caught.value.line == 2


def test_a_word_for_several_blocks() -> None:
    program = reading("G1 X10 F600\nX20\nX30 F60\n")
    lines = np.array([1, 2, 3])
    planned, programmed = np.array([2.0, 8.0, 10.0]), np.array([1.0, 1.0, 10.0])
    mean = write_feeds(program, lines, planned, programmed)
    assert mean.data == b"G1 X10 F120\nX20\nX30 F60\n"
    assert (mean.words, mean.changed, mean.shared, mean.slower) == (2, 1, 1, 1)
    least = write_feeds(program, lines, planned, programmed, shared="least")
    assert least.data == b"G1 X10 F75\nX20\nX30 F60\n"
    assert (least.changed, least.shared, least.slower) == (1, 1, 0)


def test_words_over_moves_that_are_not_timed_stay(tmp_path: Path) -> None:
    path = machine(tmp_path / "m", tables=TRUE_ZERO)
    text = b"G1 X5 F6000\nG0 Y0 Z0\nG1 X50 F6000\n"
    result = olp.retime(text, path)
    assert result.with_feeds().startswith(b"G1 X5 F6000\nG0 Y0 Z0\nG1 X50 F")
    assert result.report["write_feed"]["kept_lines"] == [1]
    assert result.report["write_feed"]["changed"] == 1


def retimed(text: str) -> Retiming:
    return olp.retime(text.encode(), setup_of("linuxcnc", ""))


def test_the_planned_mean_of_a_block_in_every_mode() -> None:
    """One motion, written in four ways: the means are the same speed."""
    move = "X100\nM0\nG1 X0"
    for text in (
        f"G1 F6000 {move} F6000",
        f"G20 F236.2205\nG21 G1 {move} F6000",
        "G93 G1 X100 F60\nM0\nX0 F60",
        "S1000\nG95 G1 F6 X100\nM0\nX0 F6",
    ):
        result = retimed(text)
        written = result.with_feeds()
        assert blanked(written) == blanked(text.encode())
        program = reading(written.decode())
        feed = timed(written.decode()).feed_mm_s
        mean = lengths_mm(program.toolpath) / result.lines.seconds
        np.testing.assert_allclose(feed, mean, rtol=0.01)
        assert result.report["write_feed"]["duration_s"] > result.duration_s


@settings(max_examples=10)
@given(st.lists(st.tuples(PLACES, PLACES, st.none() | st.floats(1, 30000)), min_size=1, max_size=12))
def test_written_programs_move_alike_and_no_faster(moves: list[tuple[float, float, float | None]]) -> None:
    text = "G21 G90 G1 F3000\n" + "".join(
        f"X{x:.3f} Y{y:.3f}{'' if f is None else f' F{f:.1f}'}\n" for x, y, f in moves
    )
    result = retimed(text)
    for shared in ("mean", "least"):
        written = result.with_feeds(shared)
        assert blanked(written) == blanked(text.encode())
        before, after = reading(text), reading(written.decode())
        np.testing.assert_array_equal(before.toolpath.end_mm, after.toolpath.end_mm)
        assert (timed(written.decode()).feed_mm_s <= timed(text).feed_mm_s).all()
        assert result.report["write_feed"]["duration_s"] >= result.duration_s * 0.99


def test_one_long_block_is_written_in_closed_form(tmp_path: Path) -> None:
    """Rest to rest with ramps that reach the acceleration: T = L/F + F/A + A/J."""
    path = machine(tmp_path / "m", tables=TRUE_ZERO, job=START)
    setup = load_setup(path, path.with_name("job.toml"))
    feed, way = 300.0, 500.0
    axis = setup.machine.axes["X"]
    seconds = way / feed + feed / axis.acceleration_mm_s2 + axis.acceleration_mm_s2 / axis.jerk_mm_s3
    result = olp.retime(f"G1 X{way} F{60 * feed:.2f}\n".encode(), setup)
    assert result.duration_s == pytest.approx(seconds, rel=1e-6)
    assert result.with_feeds() == f"G1 X{way} F{60 * way / seconds:.2f}\n".encode()
