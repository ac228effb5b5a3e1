"""Lines of a text with their ends, and columns that grow."""

from __future__ import annotations

import numpy as np
import pytest

from olp.program.text.columns import Columns
from olp.program.text.line_ends import LINE_END, LINE_END_TEXT, LONE_CR, split


@pytest.mark.parametrize(
    ("data", "lines"),
    [
        (b"", []), (b"a", [b"a"]), (b"a\n", [b"a\n"]), (b"a\nb", [b"a\n", b"b"]), (b"\n\n", [b"\n", b"\n"]),
        (b"a\r\nb\r\r\nc\rd\r", [b"a\r\n", b"b\r\r\n", b"c\r", b"d\r"]), (b"\r\r", [b"\r", b"\r"]),
        (b"a\r\r\n", [b"a\r\r\n"]), (b"a\x0bb\x0cc\x85", [b"a\x0bb\x0cc\x85"]),
    ],
)  # fmt: skip
def test_lines_keep_their_ends(data: bytes, lines: list[bytes]) -> None:
    assert split(data) == lines
    assert (
        LINE_END.split(data)
        == [line.rstrip(b"\r\n") for line in [*lines, b""]][: len(LINE_END.findall(data)) + 1]
    )
    text = data.decode("latin-1")
    assert [len(part) for part in LINE_END_TEXT.split(text)] == [len(part) for part in LINE_END.split(data)]


def test_another_line_end_may_be_given() -> None:
    assert split(b"a;b;c", LONE_CR) == [b"a;b;c"]
    assert split(b"a\rb\r\nc\r\r\nd\r", LONE_CR) == [b"a\r", b"b\r\nc\r\r\nd\r"]


def test_columns_are_appended_to_and_taken_once() -> None:
    columns = Columns(3)
    parts = [np.arange(start, stop) for start, stop in ((0, 1), (1, 64), (64, 65), (65, 400), (400, 400))]
    for part in parts:
        columns.put("a", part, np.int32)
        columns.put("b", np.column_stack([part, -part]), float)
    a, b = columns.take("a", np.int32), columns.take("b", float, 2)
    assert (a.dtype, b.dtype) == (np.int32, float)
    np.testing.assert_array_equal(a, np.arange(400))
    np.testing.assert_array_equal(b, np.column_stack([np.arange(400), -np.arange(400)]))
    assert not a.flags.writeable
    assert not b.flags.writeable
    assert columns.take("a", np.int8, 3).shape == (0, 3)
    assert columns.take("c", np.int8).shape == (0,)
    assert columns.take("c", np.int8).dtype == np.int8
    # what was taken is empty again
    columns.put("a", [7], np.int64)
    assert columns.take("a", np.int64).tolist() == [7]
