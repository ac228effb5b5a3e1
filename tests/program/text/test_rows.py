"""The one reader of delimited tables: lines, cells, places, and the bytes of cells."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import olp
from olp.core.errors import InputError
from olp.program.text.delimited import Layout, mapping
from olp.program.text.numbers import Number
from olp.program.text.rows import CSV, LOOSE_CSV, Cells, Form, decoded, form_of, place_of

PACKAGE = Path(olp.__file__).parent
XYZ = mapping({"X": "x", "Y": "y", "Z": 3})


def reads_csv(source: str) -> bool:
    """Whether a text splits rows by the csv module, or lines at commas that are not an argument."""
    return any(
        isinstance(node, ast.Attribute) and node.attr in ("reader", "DictReader")
        and isinstance(node.value, ast.Name) and node.value.id == "csv"
        for node in ast.walk(ast.parse(source))
    )  # fmt: skip


@pytest.mark.slow
def test_delimited_text_is_split_in_one_place() -> None:
    modules = {p.relative_to(PACKAGE).as_posix() for p in PACKAGE.rglob("*.py") if reads_csv(p.read_text())}
    assert modules == {"program/text/rows.py"}
    assert reads_csv("import csv\nrows = list(csv.reader(lines))")


def test_rows_are_numbered_as_an_editor_does() -> None:
    text = "# a\n\nx,y\n  # b\r\n1, 2\r3,4"
    assert list(LOOSE_CSV.rows(text)) == [(3, ["x", "y"]), (5, ["1", "2"]), (6, ["3", "4"])]
    assert list(LOOSE_CSV.lines("a\r\n b \n\nc")) == [(1, "a"), (2, " b "), (3, ""), (4, "c")]
    assert list(LOOSE_CSV.rows(text, 3)) == [(5, ["1", "2"]), (6, ["3", "4"])]


def test_what_ends_a_line_and_what_a_quote() -> None:
    assert list(LOOSE_CSV.rows('1, "2,3"\x0c\n')) == [(1, ["1", "2,3"])]
    assert list(CSV.rows('1, "2,3"\x0c\n')) == [(1, ["1", '"2', '3"'])]
    assert list(CSV.rows("1\x0c2\n")) == [(1, ["1"]), (2, ["2"])]
    assert list(LOOSE_CSV.rows("1\x0c2\n")) == [(1, ["1\x0c2"])]


def test_remarks_and_blanks() -> None:
    form = Form(None, ("//",), remark="//")
    assert list(form.lines("1  2 // 3\n//")) == [(1, "1  2 "), (2, "")]
    assert list(form.rows("1  2 // 3\n//\n\t4")) == [(1, ["1", "2"]), (3, ["4"])]


def test_a_cell_beyond_all_measure_is_refused() -> None:
    with pytest.raises(InputError, match="not a table of comma-separated values"):
        CSV.cells("1," + "2" * 200_000)


def test_text_that_is_not_utf8_is_refused_with_its_line() -> None:
    assert decoded(b"\xef\xbb\xbfa") == "a"
    with pytest.raises(InputError, match="byte 0xff is not UTF-8") as caught:
        decoded(b"a\nb\n\xff")
    assert caught.value.line == 3


def test_places() -> None:
    assert [place_of(c, ["a", "b"]) for c in (1, 2, "b", "c")] == [0, 1, 1, None]


def test_bytes_of_cells() -> None:
    data = b'# c\nx;y;z\n 1,5 ;"2";3;tail\n4;?\n'
    cells = Cells(data, Layout(XYZ, "semicolon", "comma"))
    assert (cells.header_line, [cells.place(role) for role in ("X", "Y", "Z", "tool")]) == (
        2,
        [0, 1, 2, None],
    )
    (line, first), (_, second) = cells.rows()
    assert (line, [data[a:b] for a, b in first]) == (3, [b"1,5", b"2", b"3", b"tail"])
    number = cells.number(first, 0)
    assert isinstance(number, Number) and number.value == 1.5
    assert cells.number(second, 1) == 'column 2 is "?"; expected a number with a decimal comma'
    assert cells.number(second, 2) == "2 columns; expected at least 3 between semicolons"
    assert [cells.word(first, place) for place in (3, 4, None)] == ["tail", "", ""]


def test_a_column_that_is_not_there_is_said() -> None:
    with pytest.raises(InputError, match='no column "y"; expected one of x, z') as caught:
        Cells(b"\nx,z\n", Layout(XYZ)).place("Y")
    assert caught.value.line == 2


CELL = st.text(alphabet="ab1.- ", max_size=4).map(str.strip)


@given(st.lists(st.lists(CELL, min_size=2, max_size=5), min_size=1, max_size=5), st.sampled_from(",;\t"))
def test_both_ways_of_reading_find_the_same_cells(table: list[list[str]], mark: str) -> None:
    """What is no quote within a cell is the same as text and as bytes."""
    text = "\n".join(mark.join(f'"{c}"' if " " in c else c for c in row) for row in table)
    names = {",": "comma", ";": "semicolon", "\t": "tab"}
    layout = Layout(XYZ, names[mark], header=False)  # type: ignore[arg-type]
    cells = Cells(text.encode(), layout)
    rows = [(line, [cells.text(span) for span in row]) for line, row in cells.rows()]
    assert rows == list(form_of(layout).rows(text))


@pytest.mark.parametrize(
    ("row", "cells"),
    [
        (b'"a,b",1', ["a,b", "1"]),
        (b'"a"",b",1', ['a"",b', "1"]),
        (b'"a"""",b",1,2', ['a"""",b', "1", "2"]),
        (b'"",1', ["", "1"]),
        (b' "a" , 1 ', ["a", "1"]),
        (b'"a,1', ['"a,1']),
        (b"a,,1,", ["a", "", "1", ""]),
    ],
)
def test_a_comma_in_quotes_ends_no_cell(row: bytes, cells: list[str]) -> None:
    table = Cells(row, Layout(XYZ, header=False))
    ((line, spans),) = table.rows()
    assert line == 1
    assert [table.text(span) for span in spans] == cells
