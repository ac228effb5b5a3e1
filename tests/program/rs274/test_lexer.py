"""Words of blocks by hand: their letters, numbers and bytes, and which lines hold more than words."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from olp.program.rs274.block_text import BlockText
from olp.program.rs274.lexer import WordChunk, chunks, lex, slow_number
from olp.program.text.line_ends import STRAY_CR

FREE = BlockText()
STRICT = BlockText(odd_bytes=None, skips_control=False, nested_comments=False, open_comments=False)
Row = tuple[int, str, int, int, bool, int, int, int]


def lexed(text: bytes, rules: BlockText = FREE) -> WordChunk:
    return lex(np.frombuffer(text, np.uint8), rules)


def rows(chunk: WordChunk) -> list[Row]:
    """Line, letter, mantissa, decimals, point, and the bytes of letter, number and end of each word."""
    columns = (
        chunk.line,
        chunk.letter,
        chunk.mantissa,
        chunk.decimals,
        chunk.pointed,
        chunk.start,
        chunk.number,
        chunk.end,
    )
    return [(a, chr(b), *rest) for a, b, *rest in zip(*(c.tolist() for c in columns), strict=True)]


def spoken(chunk: WordChunk) -> list[str]:
    """The words of each line, in capitals, with their numbers as written less leading zeros."""
    lines: list[list[str]] = [[] for _ in chunk.line_start]
    for line, letter, mantissa, decimals, *_ in rows(chunk):
        digits = f"{abs(mantissa):0{decimals + 1}d}"
        cut = len(digits) - decimals
        number = digits[:cut] + ("." + digits[cut:] if decimals else "")
        lines[line].append(letter + "-" * (mantissa < 0) + number)
    return [" ".join(words) for words in lines]


def test_a_word_has_its_number_and_its_bytes() -> None:
    chunk = lexed(b"G1 X-2.50\nY+.5\r\n\nz7.")
    assert rows(chunk) == [
        (0, "G", 1, 0, False, 0, 1, 2),
        (0, "X", -250, 2, True, 3, 4, 9),
        (1, "Y", 5, 1, True, 10, 11, 14),
        (3, "Z", 7, 0, True, 17, 18, 20),
    ]
    assert chunk.first_word.tolist() == [0, 2, 3, 3, 4]
    assert chunk.line_start.tolist() == [0, 10, 16, 17]
    # without carriage return and line feed
    assert chunk.line_end.tolist() == [9, 14, 16, 20]
    assert chunk.odd.tolist() == chunk.marks.tolist() == chunk.comments.tolist() == []
    assert not chunk.deleted.any()


def test_blanks_inside_words_count_among_their_bytes() -> None:
    chunk = lexed(b"X 1 2.\t5 Y3\nZ - 4")
    assert rows(chunk) == [
        (0, "X", 125, 1, True, 0, 2, 8),
        (0, "Y", 3, 0, False, 9, 10, 11),
        (1, "Z", -4, 0, False, 12, 14, 17),
    ]
    assert chunk.first_word.tolist() == [0, 2, 3]


@pytest.mark.parametrize("text", [b"X1\nY2", b"X1\nY2\n", b"X 1\nY 2", b"X 1\nY 2\n"])
def test_the_last_line_end_begins_no_line(text: bytes) -> None:
    chunk = lexed(text)
    assert spoken(chunk) == ["X1", "Y2"]
    assert chunk.first_word.tolist() == [0, 1, 2]


def test_an_empty_line_is_a_line() -> None:
    assert spoken(lexed(b"\n\nX1\n\n")) == ["", "", "X1", ""]
    assert list(chunks(b"", FREE)) == []


#: Texts without line ends, and their words.
NUMBERS = {
    "X12345678": "X12345678",
    "X123456789": "X123456789",
    "X.12345678": "X0.12345678",
    "X.123456789": "X0.123456789",
    "X12345678.87654321": "X12345678.87654321",
    "X00000000000000000007": "X7",
    "X999999999999": "X999999999999",
    "X-000999999999999.5": "X-999999999999.5",
    "X.1234567890123456789": "X0.123456789012345678",
    "X1.1234567890123456789": "X1.12345678901234567",
    "X123456789012.1234567": "X123456789012.123456",
    "X-0.001": "X-0.001",
    "X+0010.0100": "X10.0100",
    "X-.5Y+.25Z5.": "X-0.5 Y0.25 Z5",
    "x1y2z3a4b5c6": "X1 Y2 Z3 A4 B5 C6",
    "A1Z2": "A1 Z2",
    "n10g0x1.5y-2": "N10 G0 X1.5 Y-2",
    "X1 .5": "X1.5",
    "X - 1": "X-1",
    "X90817263 Y54": "X90817263 Y54",
}


@pytest.mark.parametrize("text", NUMBERS)
def test_numbers_are_read_digit_by_digit(text: str) -> None:
    chunk = lexed(text.encode())
    assert spoken(chunk) == [NUMBERS[text]]
    assert not chunk.odd.size


@pytest.mark.parametrize("digits", range(1, 13))
def test_a_number_of_any_length_has_its_value_on_both_sides_of_its_point(digits: int) -> None:
    number = "987654321987"[:digits]
    text = f"X{number}.{number[::-1][:6]}Y-{number}Z.{number}".encode()
    chunk = lexed(text)
    fraction = number[::-1][:6]
    assert chunk.mantissa.tolist() == [int(number + fraction), -int(number), int(number)]
    assert chunk.decimals.tolist() == [len(fraction), 0, digits]
    assert chunk.pointed.tolist() == [True, False, True]


def test_a_number_is_parsed_alone_where_it_is_long() -> None:
    assert slow_number(b"+12.50") == (1250, 2)
    assert slow_number(b"-.5") == (-5, 1)
    assert slow_number(b"7.") == (7, 0)
    assert slow_number(b"0") == slow_number(b"-0") == (0, 0)
    assert slow_number(b"000123456789012") == (123456789012, 0)
    assert slow_number(b"1234567890123") is None
    assert slow_number(b"1." + b"3" * 30) == (int("1" + "3" * 17), 17)
    for text in (b"", b"+", b"-", b".", b"-.", b"1.2.3", b"1-2", b"--1", b"+-1", b"1,2"):
        assert slow_number(text) is None, text


#: Lines that hold more than words.
ODD = [
    *("X", "X.", "X-", "X+.", "X1.2.3", "X1-2", "X--1", "X+-1", "X1+", "1", "-1", ".5", "XY1", "X1Y", "1X2"),
    *("X1,5", "X,5", "X1/2", "X1/Y2", "X#1", "X[1]", "X=1", "@1", "[1", "`1", "{1", "X1 \xe9", "\xc11"),
    *("X1234567890123", "X1)", "X1 ) Y2", "//X1", "/0X1", "X1 %", "X1?", "X1!", "X1*", "X1:2"),
    *("/ /X1", "/55X1", "XX1", "X1 Y", "G1 X\x7f1", "<a>"),
]


@pytest.mark.parametrize("text", ODD)
def test_a_line_with_more_than_words_is_odd_and_its_words_are_dropped(text: str) -> None:
    line = text.encode("latin-1")
    for before, after in ((b"", b""), (b"G0 X1\n", b"\nY2"), (b"G 0 X1\n", b"\nY 2\n")):
        chunk = lexed(before + line + after)
        assert chunk.odd.tolist() == [before.count(b"\n")]
        assert spoken(chunk) == ["G0 X1"] * bool(before) + [""] + ["Y2"] * bool(after)
        assert chunk.first_word[-1] == len(chunk.letter)


def test_several_odd_lines_are_each_named_once() -> None:
    chunk = lexed(b"X1.\nX=1 Y#2\nY2\n[1] Z.\nZ3")
    assert chunk.odd.tolist() == [1, 3]
    assert chunk.first_word.tolist() == [0, 1, 1, 2, 2, 3]


#: Texts, their words by line, which lines are under block delete, and which have a tape mark.
HEADS: dict[str, tuple[list[str], list[int], list[int]]] = {
    "/X1\nY2": (["X1", "Y2"], [0], []),
    " / X1\n": (["X1"], [0], []),
    "X1\n/2Y2\nZ3": (["X1", "Y2", "Z3"], [1], []),
    "/1G0X1": (["G0 X1"], [0], []),
    "/9G0X1": (["G0 X1"], [0], []),
    "/\n/\nX1": (["", "", "X1"], [0, 1], []),
    "/\n2": (["", ""], [0], []),
    "%\nX1\n%": (["", "X1", ""], [], [0, 2]),
    " % text # X1\nX2": (["", "X2"], [], [0]),
    "(a) /X1": (["X1"], [], []),
    "%/X1\n/%X1": (["", ""], [1], [0]),
}


@pytest.mark.parametrize("text", HEADS)
def test_marks_at_the_start_of_a_line(text: str) -> None:
    words, deleted, marks = HEADS[text]
    chunk = lexed(text.encode())
    odd = [i for i, line in enumerate(text.splitlines()) if line in ("(a) /X1", "2", "/%X1")]
    assert chunk.odd.tolist() == odd
    assert spoken(chunk) == ["" if i in odd else line for i, line in enumerate(words)]
    assert np.flatnonzero(chunk.deleted).tolist() == deleted
    assert chunk.marks.tolist() == marks
    assert chunk.marks.dtype == np.int64


#: Texts, their words by line, and where comments open.
COMMENTS: dict[str, tuple[list[str], list[int]]] = {
    "X1(Y2)Z3": (["X1 Z3"], [2]),
    "(X1)": ([""], [0]),
    "(a)(b)X1": (["X1"], [0, 3]),
    "X1;Y2 (Z3\nZ4": (["X1", "Z4"], [2]),
    ";\nX1": (["", "X1"], [0]),
    "X1 (a;b) Y2": (["X1 Y2"], [3]),
    "X1 (a) Y2 ; Z3 (b)\n(c)Z4": (["X1 Y2", "Z4"], [3, 10, 19]),
    "X1 (a (b) Y2": (["X1 Y2"], [3]),
    "X(a)1": (["X1"], [1]),
    "X1(a)2": (["X12"], [2]),
    "X1 () Y2": (["X1 Y2"], [3]),
    "; a ; b\n; c": (["", ""], [0, 8]),
    "X1;(a\nY2)": (["X1", ""], [2]),
}


@pytest.mark.parametrize("text", COMMENTS)
@pytest.mark.parametrize("before", ["", "G21\n", "(head)\n"])
def test_comments_end_with_a_bracket_or_with_their_line(text: str, before: str) -> None:
    words, opens = COMMENTS[text]
    chunk = lexed((before + text).encode())
    assert spoken(chunk) == {"": [], "G21\n": ["G21"], "(head)\n": [""]}[before] + words
    first = [0] if before == "(head)\n" else []
    assert chunk.comments.tolist() == first + [place + len(before) for place in opens]
    assert chunk.odd.tolist() == ([before.count("\n") + 1] if text.endswith("Y2)") else [])


@pytest.mark.parametrize(
    ("text", "rules", "odd"),
    [
        ("(a\nX1", {}, [0]),
        ("X1 (a\n(b)", {}, [0]),
        ("X1 (a\nY2 (b", {}, [0, 1]),
        ("X1 (a\nX2", {"open_comments": True}, []),
        ("X1 ;(a\nX2", {}, []),
        ("(a (b) X1\n(c)", {}, []),
        ("(a (b) X1\n(c)", {"nested_comments": False}, [0]),
        ("(a)(b) X1\n(c (d)", {"nested_comments": False}, [1]),
        ("(a;b) X1\n(c)", {"nested_comments": False}, []),
        ("; (a) (b)\nX1 ; (c", {"nested_comments": False}, []),
        ("(a\rb) X1\nX1\rX2\n\r\n", {}, [0, 1]),
        ("X1\rX2", {"odd_bytes": None}, []),
        ("X1\rX2", {"cr_ends_line": True}, []),
        ("%\nX1\n% a\n%\r\n", {"marks_in_pairs": True}, [2]),
        ("% a\nX1\n %\t", {"marks_in_pairs": True}, [0]),
        ("% a\nX1", {}, []),
        ("X12345\nX1234\nX123", {"longest": 5}, [0]),
        ("X12345\r\nX1234\nX123", {"longest": 5}, [0]),
        ("X\0001", {}, []),
        ("X\0001\nY1", {"skips_control": False}, [0]),
    ],
)
def test_lines_that_a_control_refuses_are_odd(text: str, rules: dict[str, object], odd: list[int]) -> None:
    chunk = next(chunks(text.encode(), BlockText(**rules)))  # type: ignore[arg-type]
    assert chunk.odd.tolist() == odd
    assert not set(odd) & set(chunk.line.tolist())


def test_brackets_in_a_comment_may_close_right_before_it() -> None:
    text = b"X1 (a (b)) Y2\n(a (b) (X9)\t) X3 (c (X8) to 1)\n(a (b) X4)\n(d) Y5\n"
    chunk = next(chunks(text, BlockText(inner_brackets=True)))
    assert chunk.odd.tolist() == [2]
    words = [(int(n), text[a:b]) for n, a, b in zip(chunk.line, chunk.start, chunk.end, strict=True)]
    assert words == [(0, b"X1"), (0, b"Y2"), (1, b"X3"), (3, b"Y5")]
    assert next(chunks(text, BlockText())).odd.tolist() == [0, 1, 2]


@pytest.mark.parametrize("code", range(33))
def test_control_characters_are_blanks_or_odd(code: int) -> None:
    """Tab, line feed, carriage return and space are blanks on any control."""
    text = b"X1" + bytes([code]) + b"2\n(a" + bytes([code]) + b")\nY3"
    words = ["X12", "", "Y3"] if code != 10 else ["X1", "", "", "", "Y3"]
    for rules in (FREE, STRICT):
        chunk = lexed(text, rules)
        if code == 10:
            assert chunk.odd.tolist() == [1, 2, 3]
        else:
            strange = rules is STRICT and code not in (9, 13, 32)
            assert chunk.odd.tolist() == [0] * strange
            assert spoken(chunk) == ["" if strange else words[0], *words[1:]]


TEXT = b"""%
N10 G0 X1.5 Y-2 (a X9)\r
/2 G1 X 12345678901 Y.5 ; b

X=1
(c) Z3 (d
Y[2] \x00
%% X7
X1.25 Y2
"""


def columns(parts: Iterator[WordChunk]) -> dict[str, list[object]]:
    """What the chunks hold together; lines count from the start of the text."""
    all_: dict[str, list[object]] = {}
    words = 0
    for part in parts:
        for name in ("letter", "mantissa", "decimals", "pointed", "start", "number", "end"):
            all_.setdefault(name, []).extend(getattr(part, name).tolist())
        for name in ("line_start", "line_end", "deleted", "comments"):
            all_.setdefault(name, []).extend(getattr(part, name).tolist())
        for name in ("line", "marks", "odd"):
            all_.setdefault(name, []).extend((getattr(part, name) + part.first_line).tolist())
        all_.setdefault("first_word", []).extend((part.first_word[:-1] + words).tolist())
        assert part.first_word[-1] == len(part.letter)
        words += len(part.letter)
    return all_


@pytest.mark.parametrize(
    "rules",
    [
        FREE,
        STRICT,
        BlockText(odd_bytes=STRAY_CR, marks_in_pairs=True, longest=20),
        BlockText(odd_bytes=None, cr_ends_line=True, open_comments=True),
    ],
)
@pytest.mark.parametrize(
    "text", [TEXT, TEXT[:-1], TEXT.replace(b"\n", b"\r\r\n"), TEXT.replace(b"=", b"\r=")]
)
def test_chunks_of_any_size_hold_the_same(text: bytes, rules: BlockText) -> None:
    whole = columns(chunks(text, rules))
    assert len(whole["line_start"]) == text.count(b"\n") + (text[-1:] != b"\n") + (
        rules.cr_ends_line and b"\r=" in text
    )
    for size in (1, 2, 7, 30, 60, len(text) - 1, len(text)):
        parts = list(chunks(text, rules, size))
        assert len(parts) > 1 or size > 60
        assert columns(iter(parts)) == whole


def test_a_chunk_ends_with_the_line_of_its_last_byte() -> None:
    text = b"X1\nX2\nX3\nX4"
    assert [part.first_line for part in chunks(text, FREE, 1)] == [0, 1, 2, 3]
    assert [len(part.line_start) for part in chunks(text, FREE, 2)] == [1, 1, 1, 1]
    assert [len(part.line_start) for part in chunks(text, FREE, 3)] == [2, 2]
    assert [len(part.line_start) for part in chunks(text, FREE, 9)] == [4]


def test_bytes_of_the_words_spell_them() -> None:
    """Law: from the letter to the end, blanks and comments taken out, a word is its letter and its number."""
    text = b"n10 g0 x1.5 y - 2 (a) z+0.25 ; b\nX00 1 .\t5Y2"
    for _, letter, mantissa, decimals, pointed, start, number, end in rows(lexed(text)):
        assert text[start : start + 1].upper() == letter.encode()
        digits = text[number:end].translate(None, b" \t")
        assert b" " not in text[number : number + 1] and b" " not in text[end - 1 : end]
        assert (b"." in digits) == pointed
        assert float(digits) == mantissa / 10**decimals
