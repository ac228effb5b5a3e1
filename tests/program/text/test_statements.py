"""Statements that APT and DMIS share: which lines are plain points, and the words of all others."""

from __future__ import annotations

import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from olp.core.errors import ProgramError
from olp.program.text.statements import (
    Chunk,
    Comment,
    Statement,
    chunks,
    is_cards,
    number_of,
    shown,
)

FREE = re.compile(rb"(?i)PARTNO\b")


def only(data: bytes) -> Chunk:
    (chunk,) = chunks(data)
    return chunk


def statements(data: bytes) -> list[Statement | Comment]:
    return [each for chunk in chunks(data) for each in chunk.statements(FREE)]


def fields(text: str) -> list[tuple[bytes, bytes]]:
    """The words of a statement, and the bytes that each one was in the text."""
    data = text.encode()
    (statement,) = statements(data)
    assert isinstance(statement, Statement)
    return [(f.text, data[f.start : f.end]) for f in statement.fields()]


@pytest.mark.parametrize(
    ("text", "pair"),
    [
        (b"0", (0, 0)), (b"12", (12, 0)), (b"-12.50", (-1250, 2)), (b"+.5", (5, 1)), (b"7.", (7, 0)),
        (b"123456789012", (123456789012, 0)), (b"1234567890123", None),
        (b"-123456789.012", (-123456789012, 3)),
        (b"0000000000000012", (12, 0)), (b"0.123456789012345678", (123456789012345678, 18)),
        (b"0.1234567890123456789", (123456789012345678, 18)),
        # exponents
        (b"1.5E2", (150, 0)), (b"1.5e+1", (15, 0)), (b"1.5D0", (15, 1)), (b"1.5d-3", (15, 4)),
        (b"-2E1", (-20, 0)),
        (b"2E-18", (2, 18)), (b"2E-19", None), (b"1E17", (10**17, 0)), (b"1E18", None), (b"-1E18", None),
        (b"9E17", (9 * 10**17, 0)), (b"1E-017", (1, 17)), (b"1E+0017", None), (b"1E19", None),
        (b"1.5E19", None),
        # other words
        (b"", None), (b".", None), (b"-", None), (b"+", None), (b"1.2.3", None), (b"--1", None),
        (b"1-", None), (b"A", None),
        (b"1E", None), (b"E5", None), (b"1 2", None), (b"1,5", None), (b"0x1", None), (b"\xb2", None),
    ],
)  # fmt: skip
def test_numbers_of_statements(text: bytes, pair: tuple[int, int] | None) -> None:
    assert number_of(text) == pair


def test_text_is_shown_in_printable_form() -> None:
    assert shown(b"GOTO/1") == "GOTO/1"
    assert shown(b"\xff\t\n") == "\\xff??"
    assert shown(b"a" * 50) == "a" * 40


@pytest.mark.parametrize(
    ("line", "numbers"),
    [
        ("GOTO/1,2,3", 3), ("goto/1,2,3", 3), ("  GOTO /  -1.5 , +2 ,3. ", 3), ("GOTO/1,2,3,0,0,1", 6),
        ("GOTO/1 2 3", 3),
        ("GOTO/1,2,3,", 3), ("GOTO/.5,-.5,+.5", 3), ("\tGOTO/1,\t2,3\t", 3), ("GoTo/1,2,3", 3),
        ("GOTO/1234567890,0,9", 3),
        # statements that are read one by one
        ("GOTO/1,2", 0), ("GOTO/1,2,3,4", 0), ("GOTO/1,2,3,4,5", 0), ("GOTO/1,2,3,4,5,6,7", 0), ("GOTO/", 0),
        ("GOTO", 0),
        ("GOTO/,1,2,3", 0), ("GOTO/1,,2,3", 0), ("GOTO/1,2,3,,", 0), ("GOTO/1,2,A", 0), ("GOTO/1,2,3E1", 0),
        ("GODLTA/1,2,3", 0), ("FROM/1,2,3", 0), ("GOTX/1,2,3", 0), ("XOTO/1,2,3", 0), ("GXTO/1,2,3", 0),
        ("GOXO/1,2,3", 0),
        ("AGOTO/1,2,3", 0), ("L=GOTO/1,2,3", 0), ("1GOTO/1,2,3", 0), ("GO TO/1,2,3", 0), ("GOTO1/1,2,3", 0),
        ("GOTO/1/2,3", 0), ("GOTO/1,2,3 $$ a", 0), ("GOTO/1,2,3 $", 0), ("GOTO/(1,2,3)", 0),
        ("GOTO/1,2,3;", 0),
        ("GOTO/1,2,3:", 0), ("GOTO/1,2,'3'", 0), ("GOTO/1,2,3*", 0), ("GOTO/1,2,[3]", 0), ("GOTO/1,2,3{", 0),
        ("GOTO/1.2.3,4,5", 0), ("GOTO/1,2,-", 0), ("GOTO/1,2,3-4", 0), ("GOTO/1,2,1234567890123456789", 0),
        ("GOTO/1,2,3\xff", 0), ("GOTO/1,2,3@", 0), ("GOTO/1,2,3`", 0),
        *((f"GOTO/1,2,3{c}", 0) for c in "AZaz"), ("/GOTO/1,2,3", 0), ("GOTO,1,2,3", 0),
    ],
)  # fmt: skip
@pytest.mark.parametrize("place", [0, 1, 2])
def test_plain_points_are_read_in_columns(line: str, numbers: int, place: int) -> None:
    lines = [b"GOTO/10,20,30", b"FROM/7,8,9", b""]
    lines.insert(place, line.encode("latin-1"))
    lines.insert(4, b"GOTO/4,5,6")
    if line.endswith(" $") and place == 0:
        # it goes on in the next line, which is no plain point then
        lines.insert(1, b"FROM/1")
    chunk = only(b"\n".join(lines))
    first = lines.index(line.encode("latin-1"))
    assert (first in chunk.point.tolist()) is (numbers > 0)
    assert (first in chunk.others.tolist()) is (numbers == 0)
    assert len(lines) - 1 in chunk.point.tolist()
    if numbers:
        k = chunk.point.tolist().index(first)
        assert chunk.width[k] == numbers
        held = slice(int(chunk.first[k]), int(chunk.first[k + 1]))
        read = chunk.mantissa[held] / 10.0 ** chunk.decimals[held]
        written = re.findall(r"[-+.\d]+", line)
        assert read.tolist() == [float(number) for number in written]
        spans = zip(chunk.start[held].tolist(), chunk.end[held].tolist(), strict=True)
        assert [chunk.data[a:b].decode() for a, b in spans] == written
        assert chunk.pointed[held].tolist() == ["." in number for number in written]


def test_a_line_behind_one_that_goes_on_is_no_point() -> None:
    chunk = only(b"FROM/1,$\nGOTO/1,2,3\nGOTO/4,5,6\nFROM/$ \n GOTO/7,8,9\nFROM/9 $")
    assert chunk.point.tolist() == [2]
    assert chunk.others.tolist() == [0, 1, 3, 4, 5]


_LINES = st.sampled_from(
    [b"GOTO/1.5,-2,3", b"  goto / 1, 2 ,3 ", b"GOTO/1,2,3,0,0,1", b"", b"$$ c", b"FROM/1,2,3", b"GOTO/1,2",
     b"L=GOTO/1,2,3",
     b"GOTO/1,2,3 $$ c", b"FOO/A, 'b,c', (1,2)", b"FROM/1,$\n2,3", b" \t", b"GOTO/1,2,$\n3"]
)  # fmt: skip


@settings(max_examples=40)
@given(
    st.lists(_LINES, max_size=12),
    st.sampled_from([b"\n", b"\r\n", b"\r\r\n", b"\r"]),
    st.booleans(),
    st.integers(1, 60),
)
def test_chunks_of_any_size_are_the_whole(lines: list[bytes], eol: bytes, ended: bool, size: int) -> None:
    data = eol.join(line.replace(b"\n", eol) for line in lines) + eol * ended
    whole, pieces = (_as_statements(data, limit) for limit in (1 << 18, size))
    assert whole == pieces
    text = data.replace(b"\r\r\n", b"\n").replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    assert [row[0] for row in whole] == sorted({row[0] for row in whole})
    assert sum(len(chunk.line_start) for chunk in chunks(data, size)) == len(text.splitlines())


def _as_statements(data: bytes, size: int) -> list[tuple[int, int, int, bytes]]:
    """Line, bytes and text of every statement. The numbers of plain points are those of their words."""
    rows = []
    count = 0
    for chunk in chunks(data, size):
        assert chunk.first_line == count
        count += len(chunk.line_start)
        for k, line in enumerate(chunk.point.tolist()):
            raw, begin = chunk.raw(line), int(chunk.line_start[line])
            rows.append((chunk.first_line + line + 1, begin, int(chunk.line_end[line]), raw))
            words = Statement(1, begin, begin + len(raw), raw).fields()
            held = slice(int(chunk.first[k]), int(chunk.first[k + 1]))
            columns = zip(
                chunk.mantissa[held], chunk.decimals[held], chunk.start[held], chunk.end[held], strict=True
            )
            assert [(f.number, f.start, f.end) for f in words] == [((m, d), a, b) for m, d, a, b in columns]
        rows += [(each.line, each.begin, each.end, each.text) for each in chunk.statements(FREE)]
    return sorted(rows)


@pytest.mark.parametrize(
    ("text", "label", "major"),
    [
        ("FOO/1", b"", b"FOO"), ("foo /1", b"", b"FOO"), ("L1 = FOO/1", b"L1", b"FOO"),
        ("l1=foo  bar", b"L1", b"FOO BAR"),
        ("FOO", b"", b"FOO"), ("FOO/A=B", b"", b"FOO"), ("=FOO", b"", b"FOO"), ("a=b=c/1", b"A", b"B=C"),
    ],
)  # fmt: skip
def test_heads_of_statements(text: str, label: bytes, major: bytes) -> None:
    (statement,) = statements(text.encode())
    assert isinstance(statement, Statement)
    assert statement.head() == (label, major)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("FOO", []), ("FOO/", []), ("FOO/a", ["a"]), ("FOO/ a , b", ["a", "b"]), ("FOO/a,b,", ["a", "b"]),
        ("FOO/a, ", ["a"]),
        ("FOO/a,,b", ["a", "", "b"]), ("FOO/,a", ["", "a"]), ("FOO/a b", ["a b"]), ("FOO/1 2", ["1", "2"]),
        ("FOO/1 2 a", ["1 2 a"]), ("FOO/1\t-2.5E1, 3", ["1", "-2.5E1", "3"]), ("FOO/a/b", ["a/b"]),
        # brackets and quotes keep their commas
        ("FOO/(1,2),3", ["(1,2)", "3"]), ("FOO/a,(b,(c,d)),e", ["a", "(b,(c,d))", "e"]),
        ("FOO/'a,b',c", ["'a,b'", "c"]),
        ("FOO/'(',a", ["'('", "a"]), ("FOO/(a),", ["(a)"]), ("FOO/(a), ", ["(a)"]),
        ("FOO/(a),,b", ["(a)", "", "b"]),
        ("FOO/(1) 2", ["(1) 2"]), ("FOO/1 2,(3)", ["1", "2", "(3)"]), ("FOO/''',',a", ["''','", "a"]),
    ],
)  # fmt: skip
def test_fields_of_statements(text: str, expected: list[str]) -> None:
    got = fields(text)
    assert [piece.decode() for piece, _ in got] == [piece.upper() for piece in expected]
    # an empty one is at its comma
    assert [raw.decode() for _, raw in got] == expected


def test_a_comment_may_be_the_last_line_of_a_statement() -> None:
    assert [each.text for each in statements(b"FOO/1,$\n$$ c\nBAR/2\n")] == [b"FOO/1,", b"BAR/2"]
    assert [each.text for each in statements(b"FOO/1,$\n2 $$ c\nBAR/2\n")] == [b"FOO/1,2 ", b"BAR/2"]


def test_fields_of_a_joined_statement_keep_their_places() -> None:
    text = "$$ c\nL=FOO/A, 12$ \n34 , b$\r\nc,'x$',(1,$\n2), 5 6 $$ d\n"
    data = text.encode()
    comment, statement = statements(data)
    assert isinstance(comment, Comment) and isinstance(statement, Statement)
    assert (comment.line, comment.begin, comment.end, comment.text) == (1, 0, 4, b"$$ c")
    assert (statement.line, statement.lines) == (2, 4)
    assert data[statement.begin : statement.end] == data[5:-1]
    assert statement.text == b"L=FOO/A, 1234 , bc,'x$',(1,2), 5 6 "
    got = [(f.text, data[f.start : f.end]) for f in statement.fields()]
    assert got == [
        (b"A", b"A"), (b"1234", b"12$ \n34"), (b"BC", b"b$\r\nc"), (b"'X$'", b"'x$'"),
        (b"(1,2)", b"(1,$\n2)"),
        (b"5", b"5"), (b"6", b"6"),
    ]  # fmt: skip
    assert [f.number for f in statement.fields()] == [None, (1234, 0), None, None, None, (5, 0), (6, 0)]
    assert data[statement.place(0)] == ord("L")


def test_simple_fields_of_a_joined_statement() -> None:
    data = b"FOO/a,$\n b ,1$\n2\n"
    (statement,) = statements(data)
    assert isinstance(statement, Statement)
    assert [(f.text, data[f.start : f.end]) for f in statement.fields()] == [
        (b"A", b"a"), (b"B", b"b"), (b"12", b"1$\n2")
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("line", "text"),
    [
        (b"FOO/1 $$ c", b"FOO/1 "), (b"FOO/'$$' $$ c", b"FOO/'$$' "), (b"FOO/'$$'", b"FOO/'$$'"),
        (b"FOO/1 $$ c $", b"FOO/1 "), (b"FOO/'a$", None), (b"PARTNO A $ B", b"PARTNO A $ B"),
        (b" partno $$ B", b" partno $$ B"),
        (b"PARTNOX $$ B", b"PARTNOX "),
    ],
)  # fmt: skip
def test_comments_behind_statements(line: bytes, text: bytes | None) -> None:
    (statement, *_) = statements(line + b"\nBAR/2\n")
    assert isinstance(statement, Statement)
    assert statement.text == (b"FOO/'aBAR/2" if text is None else text)
    assert (statement.line, statement.begin) == (1, 0)


@pytest.mark.parametrize(
    ("data", "line", "message"),
    [
        (b"A\nFOO/$1\n", 2,
         "a `$` is inside a statement; expected it at the end of a line that goes on, or twice before "
         "a comment"),
        (b"A\nFOO/1$\n2,$3\n", 3,
         "a `$` is inside a statement; expected it at the end of a line that goes on, or twice "
         "before a comment"),
        (b"A\nFOO/1$", 2, "the last line ends with `$`, so it should go on; remove the `$`"),
        (b"A\nFOO/1$\n2 $\n", 3, "the last line ends with `$`, so it should go on; remove the `$`"),
    ],
)  # fmt: skip
def test_dollars_that_are_refused(data: bytes, line: int, message: str) -> None:
    with pytest.raises(ProgramError) as caught:
        statements(data)
    assert (caught.value.line, caught.value.code, caught.value.message) == (line, "OLP510", message)


def card(text: str, number: str) -> bytes:
    return text.ljust(72).encode() + number.rjust(8).encode()


@pytest.mark.parametrize("eol", [b"\n", b"\r\n"])
def test_the_numbers_of_cards_are_blanks(eol: bytes) -> None:
    cards = [
        card("GOTO/1,2,3", "10"),
        card("GOTO/4,5,6", "AB    20"),
        card("FOO/7", "30"),
        card("FOO/8", "00000040"),
    ]
    data = eol.join(cards) + eol
    assert is_cards(data)
    chunk = only(data)
    assert chunk.point.tolist() == [0, 1]
    assert chunk.mantissa.tolist() == [1, 2, 3, 4, 5, 6]
    assert [each.text.rstrip() for each in chunk.statements(FREE)] == [b"FOO/7", b"FOO/8"]


def test_what_are_no_cards() -> None:
    cards = [card("GOTO/1,2,3", f"{n}0") for n in range(1, 5)]
    assert is_cards(b"\n".join(cards))
    assert is_cards(b"\n\n".join(cards))
    # the last line may be cut off; two others are too few
    assert is_cards(b"\n".join([*cards[:3], b"GOTO"]))
    assert not is_cards(b"\n".join([*cards[:2], b"GOTO"]))
    assert not is_cards(b"\n".join([*cards, b"FOO/1", b""]))
    assert not is_cards(b"\n".join([*cards, b" " * 70 + b"A 123456789", b""]))
    assert not is_cards(b"\n".join([*cards, card("FOO", "ABCDE 1"), b""]))
    assert not is_cards(b"\n".join([*cards, card("FOO", "1 2"), b""]))
    # lines without a number do not count, and one number is too few
    assert is_cards(b"\n".join([*cards[:2], card("FOO", ""), card("FOO", ""), b""]))
    assert not is_cards(b"\n".join([cards[0], card("FOO", ""), card("FOO", ""), b""]))
    # only the first lines are looked at
    assert is_cards(b"\n".join([*cards * 10, b"FOO/1", b"FOO/2"]))


def test_marks_at_the_start_of_a_text() -> None:
    chunk = only(b"\xef\xbb\xbfGOTO/1,2,3\n")
    assert (chunk.point.tolist(), chunk.start.tolist()) == ([0], [8, 10, 12])
    for mark in (b"\xff\xfe", b"\xfe\xff"):
        with pytest.raises(ProgramError) as caught:
            list(chunks(mark + b"G\0"))
        assert (caught.value.line, caught.value.code) == (1, "OLP502")
        assert caught.value.message == (
            "the text is UTF-16; expected one byte per character; save it as plain text"
        )
    assert list(chunks(b"")) == []
