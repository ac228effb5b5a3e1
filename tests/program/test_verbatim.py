"""Programs of lists and described languages: the columns that moves and numbers become."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from olp.core.machine import Axis, Machine, Setup
from olp.core.toolpath import Flag, Frame, Kind
from olp.program.pointlist.dialect import DIALECT
from olp.program.program import Program
from olp.program.verbatim import Moves

AXES = {axis: Axis((-1000.0, 1000.0), 0.001, 100.0, 1000.0, 1e5) for axis in "XYZ"}
SETUP = Setup(Machine("m", "FXYZ", "linuxcnc", AXES))


def program(
    moves: Moves, data: bytes, *, decimal: bytes = b".", words: bool = True, setup: Setup = SETUP
) -> Program:
    frames = (Frame(), Frame(unit_mm=25.4))
    return moves.program(data, DIALECT, setup, frames, [("a", 1, "b")], decimal=decimal, words=words)


def numbers(data: bytes, *texts: bytes) -> Moves:
    """Moves whose only content are these numbers of the text, in this order."""
    moves = Moves()
    for slot, text in enumerate(texts):
        begin = data.index(text)
        assert moves.number(begin, begin + len(text)) == slot
    return moves


def test_moves_one_by_one_and_many_at_once() -> None:
    data = b"1 2 3\r\n4 5 6\n7 8 9\r\n10 11 12"
    moves = Moves()
    slots = [moves.number(i, i + 1) for i in (0, 2, 4)]
    moves.put(
        kind=Kind.RAPID, flag=0, line=1, frame=0, end=(1.0, 2.0, 3.0), slot=slots, bounds=(0, 5), feed=5.0
    )
    moves.put_all(
        kind=[Kind.LINE] * 2, flag=[Flag.PASS, 0], line=[2, 3], frame=[1, 1], end=[[4, 5, 6], [7, 8, 9]],
        slot=np.arange(6).reshape(2, 3) + moves.number_count, bounds=[[7, 12], [13, 18]],
        feed=[2.5, math.inf],
        spans=[[i, i + 1] for i in (7, 9, 11, 13, 15, 17)],
    )  # fmt: skip
    assert moves.number_count == 9
    slots = [moves.number(a, b) for a, b in ((20, 22), (23, 25), (26, 28))]
    assert slots == [9, 10, 11]
    moves.put(
        kind=Kind.LINE, flag=0, line=4, frame=0, end=(10.0, 11.0, 12.0), slot=slots, bounds=(-1, -1), feed=7.0
    )
    read = program(moves, data)
    path = read.toolpath
    assert path.kind.tolist() == [Kind.RAPID, Kind.LINE, Kind.LINE, Kind.LINE]
    assert path.flag.tolist() == [0, Flag.PASS, 0, 0]
    assert (path.line.tolist(), path.frame.tolist()) == ([1, 2, 3, 4], [0, 1, 1, 0])
    assert path.end_mm.tolist() == [[1, 2, 3], [4, 5, 6], [7, 8, 9], [10, 11, 12]]
    assert read.slot.tolist() == [[0, 1, 2], [3, 4, 5], [6, 7, 8], [9, 10, 11]]
    assert len(path.frames) == 2 and path.frames[1].unit_mm == 25.4
    assert len(path.arcs.move) == 0
    statements = read.statements
    assert statements is not None
    assert (statements.begin.tolist(), statements.end.tolist()) == ([0, 7, 13, -1], [5, 12, 18, -1])
    assert statements.feed_mm_s.tolist() == [math.inf, 2.5, math.inf, 7.0]
    assert (statements.rest.tolist(), statements.dwell_s.tolist()) == ([False] * 5, [0.0] * 5)
    assert (statements.arcs, statements.broken, statements.strokes.shape) == ({}, {}, (0, 2))
    feeds = statements.feeds
    assert (feeds.move.tolist(), feeds.line.tolist(), feeds.word.tolist()) == ([0], [1], [-1])
    words = read.words
    assert words is not None
    assert words.mantissa[:].tolist() == list(range(1, 13))
    assert [data[a:b] for a, b in zip(words.number, words.end, strict=True)] == data.split()
    assert words.start.tolist() == words.number[:].tolist()
    assert (words.pointed.tolist(), words.letter.tolist()) == ([True] * 12, [0] * 12)
    assert words.first_word.tolist() == [0] * 5
    assert (read.line_start.tolist(), read.line_end.tolist()) == ([0, 7, 13, 20], [5, 12, 18, 28])
    assert (read.end_line, read.remarks, read.arc_slots.word.shape) == (4, (("a", 1, "b"),), (0, 5))
    assert read.arc_slots.absolute.shape == (0,)
    assert np.isnan(path.start_mm).all()
    assert [column.dtype for column in (path.kind, path.flag, path.line, path.frame, read.slot)] == [
        np.uint8, np.uint8, np.int32, np.int32, np.int32
    ]  # fmt: skip


def test_without_moves_there_are_empty_columns() -> None:
    read = program(Moves(), b"")
    assert (read.toolpath.end_mm.shape, read.slot.shape) == ((0, 3), (0, 3))
    assert read.words is not None and len(read.words.start) == 0
    assert read.words.first_word.tolist() == [0, 0]
    assert (read.line_start.tolist(), read.line_end.tolist()) == ([0], [0])
    assert program(Moves(), b"", words=False).words is None
    assert read.statements is not None and read.statements.decimal == b"."


def test_the_start_is_that_of_the_job() -> None:
    setup = replace(SETUP, job=replace(SETUP.job, start_mm=(1.0, None, 3.0)))
    start = program(Moves(), b"", setup=setup).toolpath.start_mm
    assert (start[0], start[2]) == (1.0, 3.0) and math.isnan(start[1])


@pytest.mark.parametrize(
    ("data", "starts", "ends"),
    [
        (b"ab\nc\n", [0, 3], [2, 4]), (b"ab\nc", [0, 3], [2, 4]), (b"\n\n", [0, 1], [0, 1]), (b"a", [0], [1]),
        (b"ab\r\nc\r\n", [0, 4], [2, 5]), (b"ab\rc", [0, 3], [2, 4]), (b"\r", [0], [0]),
        (b"a\r\r\nb", [0, 4], [1, 5]),
        (b"\n", [0], [0]), (b"a\n\nb", [0, 2, 3], [1, 2, 4]),
    ],
)  # fmt: skip
def test_where_lines_begin_and_end(data: bytes, starts: list[int], ends: list[int]) -> None:
    read = program(Moves(), data)
    assert (read.line_start.tolist(), read.line_end.tolist()) == (starts, ends)


@pytest.mark.parametrize(
    ("texts", "decimal", "mantissa", "decimals"),
    [
        # in columns, also out of order
        ((b"1.5", b"-2.25", b"+.125"), b".", [15, -225, 125], [1, 2, 3]),
        ((b"7", b"1.5", b"3.50"), b".", [7, 15, 350], [0, 1, 2]),
        ((b"1,5", b"-2,25"), b",", [15, -225], [1, 2]),
        ((b"0.123456789074", b"2"), b".", [1234567891, 2], [10, 0]),
        ((b"100000000.5", b"2"), b".", [1000000005, 2], [1, 0]),
        # one by one; what is larger than any machine is 0
        ((b"100000000.5", b"2e1", b"3"), b".", [0, 20, 3], [0, 0, 0]),
        ((b"1.5e1", b"2.5"), b".", [15, 25], [0, 1]), ((b"1.5E-3", b"-7.0"), b".", [15, -70], [4, 1]),
        ((b"2e2", b"1"), b".", [200, 1], [0, 0]), ((b"1,5e1", b"2,5"), b",", [15, 25], [0, 1]),
        # no more than ten decimals
        ((b"0.1234567890", b"1"), b".", [1234567890, 1], [10, 0]),
        ((b"0.12345678905", b"2"), b".", [1234567890, 2], [10, 0]),
        ((b"0.12345678907", b"2"), b".", [1234567891, 2], [10, 0]),
        ((b"1.5e-11", b"2"), b".", [0, 2], [10, 0]),
        ((b"0.000000000026e0", b"2"), b".", [0, 2], [10, 0]),
        ((b"3.00000000016e0", b"2"), b".", [30000000002, 2], [10, 0]),
    ],
)  # fmt: skip
def test_numbers_are_words(
    texts: tuple[bytes, ...], decimal: bytes, mantissa: list[int], decimals: list[int]
) -> None:
    for order in (1, -1):
        data = b" ; ".join(texts[::order])
        words = program(numbers(data, *texts), data, decimal=decimal).words
        assert words is not None
        assert (words.mantissa[:].tolist(), words.decimals.tolist()) == (mantissa, decimals)
        assert [data[a:b] for a, b in zip(words.start, words.end, strict=True)] == list(texts)
        assert (words.mantissa[:].dtype, words.decimals.dtype) == (np.int64, np.int8)


def test_a_number_may_be_used_twice() -> None:
    data = b"1.5 2.50"
    moves = numbers(data, b"1.5", b"2.50", b"1.5")
    words = program(moves, data).words
    assert words is not None
    assert (words.mantissa[:].tolist(), words.decimals.tolist()) == ([15, 250, 15], [1, 2, 1])


def test_known_numbers_are_taken_as_they_are() -> None:
    data = b"1.5 2.50"
    moves = numbers(data, b"1.5", b"2.50")
    moves.plain = (np.array([7, 8]), np.array([1, 0], np.int8), np.array([0, 4]), np.array([3, 8]))
    words = program(moves, data).words
    assert words is not None
    assert (words.mantissa[:].tolist(), words.decimals.tolist()) == ([7, 8], [1, 0])
