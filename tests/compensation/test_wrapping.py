"""Lines that are too long go on in the next one, behind a comma."""

from __future__ import annotations

import pytest

from olp.compensation.wrapping import carded, wrapped

POINT = b"GOTO/1,2,3"


@pytest.mark.parametrize(
    ("width", "expected"),
    [
        (0, POINT), (10, POINT), (9, b"GOTO/1,$\n2,3"), (8, b"GOTO/1,$\n2,3"),
        # the mark takes one column: there is no comma before it
        (7, POINT),
    ],
)  # fmt: skip
def test_a_line_breaks_behind_the_last_comma_that_leaves_room_for_the_mark(
    width: int, expected: bytes
) -> None:
    assert wrapped(POINT, width, b"$") == expected


def test_the_mark_has_its_own_width() -> None:
    assert wrapped(POINT, 9, b" $") == b"GOTO/1, $\n2,3"
    assert wrapped(POINT, 8, b" $") == POINT


def test_a_line_breaks_as_often_as_it_needs() -> None:
    assert wrapped(b"A/11,22,33,44,5\n", 7, b"$") == b"A/11,$\n22,33,$\n44,5\n"
    # the last piece fits as it is
    assert wrapped(b"A/11,22,33,4444\n", 7, b"$") == b"A/11,$\n22,33,$\n4444\n"
    assert wrapped(b"A/11,2222222222,3\n", 7, b"$") == b"A/11,$\n2222222222,3\n"


def test_only_long_lines_are_broken_and_each_keeps_its_line_end() -> None:
    text = b"A/1,2\r\nA/111,222,333\r\nB/1,2\r\nA/444,555,666\nC/777,888,999"
    expected = b"A/1,2\r\nA/111,$\r\n222,333\r\nB/1,2\r\nA/444,$\n555,666\nC/777,$\n888,999"
    assert wrapped(text, 9, b"$") == expected


@pytest.mark.parametrize("line", [b"A/111,222,333 $$ why", b"T/'a, b, and c'"])
def test_a_line_with_a_comment_or_a_text_is_unchanged(line: bytes) -> None:
    assert wrapped(line + b"\n", 9, b"$") == line + b"\n"
    assert carded(line, 9, b"$").rstrip() == line


def test_short_lines_are_unchanged() -> None:
    text = b"A/1\n\nB/2"
    assert wrapped(text, 8, b"$") is text


def card(body: bytes, number: bytes = b"") -> bytes:
    return body.ljust(12) + number.rjust(8)


def test_numbers_of_cards_come_back_behind_the_width() -> None:
    text = b"\n".join(
        [
            card(b"UNITS/MM", b"10"),
            b"GOTO/1,22,3    " + b"      20",  # grew
            b"G/4  " + b"AB     3",  # shrank
            b"GOTO/5,6,7",  # is new
            card(b"FINI", b"40"),
        ]
    )
    assert carded(text, 12, b"$").split(b"\n") == [
        card(b"UNITS/MM", b"10"),
        card(b"GOTO/1,22,3", b"20"),
        card(b"G/4")[:12] + b"AB     3",
        card(b"GOTO/5,6,7"),
        card(b"FINI", b"40"),
    ]


def test_a_card_that_is_too_long_goes_on_without_a_number() -> None:
    got = carded(b"GOTO/1.25,2.25,3" + b"     120" + b"\r\nFINI", 12, b"$")
    assert got.split(b"\n") == [card(b"GOTO/1.25,$", b"120") + b"\r", card(b"2.25,3") + b"\r", card(b"FINI")]


def test_each_number_is_written_once() -> None:
    """A statement that is stated again has its number again."""
    lines = [card(b"GOTO/1,2,3", b"50"), card(b"GOTO/4,5,6", b"50"), card(b"GOTO/7,8,9", b"51")]
    assert carded(b"\n".join(lines), 12, b"$").split(b"\n") == [lines[0], card(b"GOTO/4,5,6"), lines[2]]
    # also behind a card without a number
    between = [lines[0], card(b"A/1"), lines[1]]
    assert carded(b"\n".join(between), 12, b"$").split(b"\n")[2] == card(b"GOTO/4,5,6")


@pytest.mark.parametrize("line", [b"", b"   ", b"\r"])
def test_empty_lines_of_cards_are_unchanged(line: bytes) -> None:
    assert carded(b"A\n" + line + b"\nB", 3, b"$") == b"A          \n" + line + b"\nB          "


@pytest.mark.parametrize(
    ("line", "numbered"),
    [
        (b"GO/1 ABCD 1 2 ", False), (b"GO/1 ABCDE123", False), (b"A/123456", False), (b"A 12345678", True),
        (b"A/1,12345678", False), (b"A/1,2,3,4,5,12345678", True), (b"AB  ABCD1234", True),
        (b"AB  abcd1234", False),
    ],
)  # fmt: skip
def test_what_is_the_number_of_a_card(line: bytes, numbered: bool) -> None:
    """Its last eight columns, of up to four letters and digits, behind a space or beyond the width."""
    got = carded(line, 12, b"$")
    assert (got[12:] == line[-8:]) == numbered
    assert got[:12].rstrip() == (line[:-8].rstrip() if numbered else line[:12].rstrip())
