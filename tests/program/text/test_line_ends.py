"""Lines of a text with their ends."""

from __future__ import annotations

import pytest

from olp.program.text.line_ends import LINE_END, LINE_END_TEXT, LONE_CR, STRAY_CR, split, stray_cr


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


@pytest.mark.parametrize(
    ("data", "place"),
    [
        (b"a\r\nb\r\r\n", -1),
        (b"a\r\nb\r", -1),
        (b"", -1),
        (b"a\r\nb\rc\r\n", 4),
        (b"\ra\n", 0),
        (b"a\r\r", -1),
    ],
)
def test_a_carriage_return_within_a_line_is_found(data: bytes, place: int) -> None:
    assert stray_cr(data) == place


def test_another_line_end_may_be_given() -> None:
    assert split(b"a;b;c", LONE_CR) == [b"a;b;c"]
    assert split(b"a\rb\r\nc\r\r\nd\r", LONE_CR) == [b"a\r", b"b\r\nc\r\r\nd\r"]


def test_carriage_returns_at_the_end_of_the_text_are_lines_but_not_within_one() -> None:
    assert len(LONE_CR.findall(b"a\r\r")) == 1
    assert len(STRAY_CR.findall(b"a\r\r")) == 0
    assert len(STRAY_CR.findall(b"a\rb\r\n\r")) == 1
