"""Planned feeds in F words: which bytes change, to what, and that they read back."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine
from hypothesis import given, settings
from hypothesis import strategies as st
from program.feeds.test_timing import reading, setup_of, statements, timed

import olp
from olp.core.errors import CannotCompute, ProgramError
from olp.files.config import load_setup
from olp.program.feeds.moves import lengths_mm
from olp.program.feeds.words import FeedsWritten, check_feeds, write_feeds
from olp.program.program import Program
from olp.program.registry import DIALECTS, read
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


@pytest.mark.slow
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


@pytest.mark.slow
@settings(max_examples=6)
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


@pytest.mark.parametrize(
    ("text", "share", "want"),
    [
        # a feed is changed where it differs by more than 1 %
        ("F600", 0.995, b"600"), ("F600", 0.991, b"600"), ("F600", 0.985, b"591"), ("F100.", 0.98, b"98."),
        # and takes another decimal where rounding changes it by more than 1 %
        ("F1", 1 / 3, b"0.33"), ("F11", 1 / 3, b"3.7"), ("F100", 1 / 3, b"33"), ("F3", 0.5, b"1.5"),
        ("F33", 0.5, b"16.5"), ("F333", 0.5, b"166"), ("F60.0", 1 / 3, b"20.0"),
        ("F0.000007", 0.5, b"0.000003"), ("F.000007", 0.5, b".000003"),
        # digits before the point keep their number
        ("F007", 0.5, b"003.5"), ("F+.5", 0.5, b"+.25"), ("F00.5", 0.5, b"00.25"), ("F+0600", 0.5, b"+0300"),
        ("F1000", 0.5, b"500"), ("F010", 0.01, b"000.1"), ("F 1\t2 .0", 0.5, b"6.0"), ("F0.5", 0.5, b"0.25"),
    ],
)  # fmt: skip
def test_a_planned_feed_keeps_the_form_of_its_word(text: str, share: float, want: bytes) -> None:
    written = halved(f"G1 X9 {text}\n", share=share)
    assert values(written.data) == [want]
    assert blanked(written.data) == blanked(f"G1 X9 {text}\n".encode())
    assert (written.words, written.changed) == (1, int(want != text[1:].encode()))


def test_a_feed_that_would_round_to_nothing_is_refused() -> None:
    for text, control in (("G1 X5\nX9 F.000001", "linuxcnc"), ("G1 X5.\nX9. F1", "fanuc")):
        with pytest.raises(ProgramError, match="cannot be written in the form of") as caught:
            halved(text.replace("X5", "X5 F60"), control, share=0.1)
        assert (caught.value.line, caught.value.code) == (2, "OLP561")


def test_what_the_shared_words_count() -> None:
    program = reading("F600\nG1 X10\nX20\nF60\nX30\nX40\nF6\n")
    lines = np.array([2, 3, 5, 6])
    planned, programmed = np.array([2.0, 8.0, 10.0, 20.0]), np.array([1.0, 1.0, 5.0, 5.0])
    mean = write_feeds(program, lines, planned, programmed)
    assert mean.data == b"F120\nG1 X10\nX20\nF20\nX30\nX40\nF6\n"
    assert (mean.words, mean.changed, mean.shared, mean.slower, mean.kept) == (3, 2, 2, 2, ())
    least = write_feeds(program, lines, planned, programmed, shared="least")
    assert least.data == b"F75\nG1 X10\nX20\nF15\nX30\nX40\nF6\n"
    assert (least.changed, least.shared, least.slower) == (2, 2, 0)


def test_lines_that_are_not_planned_do_not_count() -> None:
    program = reading("F600\nG1 X10\nX20\nX30\n")
    some = write_feeds(program, np.array([3]), np.array([4.0]), np.array([1.0]))
    assert (some.data, some.shared) == (b"F150\nG1 X10\nX20\nX30\n", 0)
    none = write_feeds(program, np.zeros(0, np.int64), np.zeros(0), np.zeros(0))
    assert (none.data, none.words, none.changed) == (program.data, 1, 0)
    # a line that is planned faster than its feed keeps it
    faster = write_feeds(program, np.array([2, 3]), np.array([1.0, 1.0]), np.array([2.0, 2.0]))
    assert (faster.data, faster.changed) == (program.data, 0)
    rapids = write_feeds(reading("G0 X9\nF60\n"), np.array([1]), np.array([2.0]), np.array([1.0]))
    assert (rapids.data, rapids.words, rapids.changed, rapids.kept) == (b"G0 X9\nF60\n", 1, 0, ())


def test_a_line_counts_as_slower_from_one_percent_on() -> None:
    program = reading("F600\nG1 X10\nX20\n")
    for first, slower in ((1.015, 1), (1.005, 0)):
        seconds = np.array([first, 0.1])
        written = write_feeds(program, np.array([2, 3]), seconds, np.array([1.0, 0.115]))
        assert (written.changed, written.slower) == (0, slower)


def test_words_are_needed() -> None:
    bare = read(b"G1 X1 F60\n", setup_of("linuxcnc", ""), DIALECTS["linuxcnc"], words=False)
    with pytest.raises(CannotCompute, match="was read without its words"):
        write_feeds(bare, np.array([1]), np.array([2.0]), np.array([1.0]))


def test_words_under_block_delete_do_not_count() -> None:
    program = reading("G1 X10 F600\n/F60\nX20\n")
    args = np.array([1, 3]), np.array([2.0, 2.0]), np.array([1.0, 1.0])
    assert write_feeds(program, *args).data == b"G1 X10 F300\n/F30\nX20\n"
    assert write_feeds(program, *args, block_delete=True).data == b"G1 X10 F300\n/F60\nX20\n"


def test_a_feed_of_statements_holds_again_after_a_cycle() -> None:
    program = statements(
        "FROM/0,0,0\nFEDRAT/600,MMPM\nGOTO/1,0,0\nCYCLE/DRILL,DEPTH,1,CLEAR,2,MMPM,50\nGOTO/1,0,0\n"
        "CYCLE/OFF\nGOTO/2,0,0\nFEDRAT/MMPM,60\nGOTO/3,0,0\nGOTO/4,0,0\nFEDRAT/5\nRAPID\nGOTO/5,0,0"
    )
    lines = np.array([4, 6, 8, 10, 11])
    written = write_feeds(program, lines, np.array([2.0, 9.0, 2.0, 4.0, 4.0]), np.ones(5))
    assert written.data == program.data.replace(b"/600,", b"/300,").replace(b",60", b",15")
    assert (written.words, written.changed, written.shared, written.slower, written.kept) == (3, 2, 2, 0, ())


def test_words_over_unknown_lengths_are_named() -> None:
    program = statements(
        "FEDRAT/600,MMPM\nGOTO/1,0,0\nGOTO/2,0,0\nFEDRAT/60\nGOTO/3,0,0\nLOADTL/1\nFEDRAT/30\nGOTO/3,0,0"
    )
    written = write_feeds(program, np.array([3, 4, 6, 9]), np.full(4, 2.0), np.ones(4))
    assert written.data == program.data.replace(b"/60\n", b"/30\n")
    assert (written.words, written.changed, written.slower, written.kept) == (3, 1, 3, (2, 8))


FIRST = "G1 X9 F600\nX12 F60\nG0 X1\nG38.2 Z1 F60\nG1 Z5 F60"


@pytest.mark.parametrize(
    ("second", "same"),
    [
        (FIRST, True), (FIRST.replace("600", "599.9"), True), (FIRST.replace("F60\nG0", "F1\nG0"), True),
        (FIRST.replace("600", "600.0001"), False), (FIRST.replace("F60\nG0", "F61\nG0"), False),
        (FIRST.replace("X12", "X12.001"), False), (FIRST.replace("G0 X1", "G1 X1"), False),
        ("\n" + FIRST, False), (FIRST + "\nX2", False),
    ],
)  # fmt: skip
def test_a_text_with_other_feeds_is_read_back(second: str, same: bool) -> None:
    before, after = reading(FIRST), reading(second)
    if same:
        check_feeds(before, after)
        return
    with pytest.raises(CannotCompute, match="is not read back as the same moves"):
        check_feeds(before, after)


def test_feeds_that_are_not_known_stay_so() -> None:
    def told(text: str) -> Program:
        return statements(f"FEDRAT/60\nGOTO/1,0,0\nGOTO/2,0,0\nLOADTL/1\n{text}GOTO/3,0,0")

    known = told("")
    check_feeds(known, told(""))
    assert known.statements is not None
    unknown = replace(known, statements=replace(known.statements, feed_mm_s=np.array([1.0, 1.0, 1.0, 1.0])))
    for before, after in ((known, unknown), (unknown, known)):
        with pytest.raises(CannotCompute):
            check_feeds(before, after)
    # without words the moves alone are compared
    check_feeds(replace(known, words=None), unknown)
    check_feeds(unknown, replace(known, words=None))


def test_blocks_under_block_delete_are_compared_as_they_run() -> None:
    before, after = reading("G1 X9 F60\n/F600\nX12"), reading("G1 X9 F60\n/F900\nX12")
    check_feeds(before, after, block_delete=True)
    with pytest.raises(CannotCompute):
        check_feeds(before, after)
