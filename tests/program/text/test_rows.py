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


def test_a_binary_file_is_refused_by_its_name() -> None:
    head = b"%PDF-"
    message = "this is a PDF document, which is not read; give the program that the CAM system writes for "
    message += "the control"
    with pytest.raises(InputError) as caught:
        decoded(head + b"a" * (1023 - len(head)) + b"\0")
    assert (caught.value.message, caught.value.line) == (message, 1)
    # only the first bytes are looked at, and a text may have such a byte
    text = head + b"a" * (1024 - len(head)) + b"\0"
    assert decoded(text) == text.decode()
    assert decoded(b"a,b\0" + b"c" * 60) == "a,b\0" + "c" * 60
    # languages of other controls are not looked for
    assert decoded(b"COMPON\n\0" + b"c" * 60).startswith("COMPON")


@pytest.mark.parametrize(
    ("data", "line", "byte"), [(b"\xe9", 1, "0xe9"), (b"a\r\nb\n\xfc\n", 3, "0xfc"), (b"a\rb\xff", 1, "0xff")]
)
def test_bytes_that_are_not_utf8(data: bytes, line: int, byte: str) -> None:
    with pytest.raises(InputError) as caught:
        decoded(data)
    assert caught.value.line == line
    assert caught.value.message == f"byte {byte} is not UTF-8; expected a text file saved as UTF-8"


def test_forms_of_rows() -> None:
    assert list(CSV.rows("# a\n  # b\n\n \n;\n1,#2\n")) == [(5, [";"]), (6, ["1", "#2"])]
    two = Form(";", ("//", "%"))
    assert list(two.rows("//a\n %b\n#;c\n1;2//3\n")) == [(3, ["#", "c"]), (4, ["1", "2//3"])]
    remark = Form(remark="!")
    assert list(remark.rows("1,2 ! 3\n! 4\n5!6!7\n")) == [(1, ["1", "2"]), (3, ["5"])]
    assert Form() == Form(",", ("#",), None, False, False)
    assert list(Form(None).rows("  1\t2 \n")) == [(1, ["1", "2"])]
    # quotes behind blanks count in loose forms only
    assert LOOSE_CSV.cells('a, "b,c" ,d') == ["a", "b,c", "d"]
    assert CSV.cells('a,"b,c"') == ["a", "b,c"]
    with pytest.raises(InputError, match=r"^is not a table of comma-separated values \("):
        CSV.cells("1," + "2" * 200_000)


@pytest.mark.parametrize(
    ("delimiter", "comment", "row", "cells"),
    [
        ("comma", "//", '1, "2,3"', ["1", "2,3"]), ("semicolon", "#", "1;2 ; 3", ["1", "2", "3"]),
        ("tab", "%", "1\t2", ["1", "2"]), ("space", "%", " 1  2\t3 ", ["1", "2", "3"]),
    ],
)  # fmt: skip
def test_the_form_of_a_layout(delimiter: str, comment: str, row: str, cells: list[str]) -> None:
    layout = Layout(XYZ, delimiter, comment=comment, header=False)  # type: ignore[arg-type]
    text = f"# a\n{comment} b\n{row}\n"
    assert list(form_of(layout).rows(text)) == [(3, cells)]
    table = Cells(text.encode(), layout)
    assert [(line, [table.text(span) for span in spans]) for line, spans in table.rows()] == [(3, cells)]
    assert list(form_of(layout).lines("a\x0cb\n")) == [(1, "a\x0cb")]


def test_bytes_of_two_per_character_are_refused() -> None:
    for mark in (b"\xff\xfe", b"\xfe\xff"):
        with pytest.raises(InputError) as caught:
            Cells(mark + b"x\0", Layout(XYZ))
        assert (caught.value.line, caught.value.message) == (
            1, "the text is UTF-16; expected one byte per character; save it as UTF-8"
        )  # fmt: skip


@pytest.mark.parametrize(
    ("delimiter", "row", "cells"),
    [
        ("space", b" 1 \t22  3", [b"1", b"22", b"3"]), ("tab", b" 1 \t 2\t\t3 ", [b"1", b"2", b"", b"3"]),
        ("tab", b'"a\tb"\t1', [b"a\tb", b"1"]), ("comma", b"\t1\t,\t2", [b"1", b"2"]),
        ("comma", b'\t"a,b"\t,2', [b"a,b", b"2"]),
        ("comma", b'a"b,c"d', [b'a"b', b'c"d']), ("comma", b'"a" x,1', [b'"a" x', b"1"]),
        ("comma", b'" a ",1', [b"a", b"1"]),
        ("comma", b'""', [b""]), ("comma", b'"', [b'"']), ("space", b'"a" "', [b"a", b'"']),
        ("comma", b'"a,b" x,c,"d,', [b'"a,b" x', b"c", b'"d,']),
        ("semicolon", b"1;2;", [b"1", b"2", b""]), ("comma", b"1", [b"1"]),
        ("comma", b'1, "2""3,4",5', [b"1", b'2""3,4', b"5"]),
    ],
)  # fmt: skip
def test_cells_without_blanks_and_quotes(delimiter: str, row: bytes, cells: list[bytes]) -> None:
    layout = Layout(XYZ, delimiter, header=False)  # type: ignore[arg-type]
    for before, behind in ((b"", b""), (b"# a\n", b"\n9,9")):
        table = Cells(before + row + behind, layout)
        line, spans = next(table.rows())
        assert line == 1 + before.count(b"\n")
        assert [table.data[slice(*span)] for span in spans] == cells
        assert table.bounds == (len(before), len(before) + len(row))


def test_lines_of_cells_are_numbered_as_an_editor_does() -> None:
    data = b"\xef\xbb\xbf\n# a\r\n// b\rx,y\r\r\n 1,2\n \n\t\n3,4"
    table = Cells(data, Layout(mapping({"X": "x", "Y": "y"}), comment="//"))
    assert (table.header, table.header_line) == (["x", "y"], 4)
    assert [(line, [table.text(s) for s in spans]) for line, spans in table.rows()] == [
        (5, ["1", "2"]),
        (8, ["3", "4"]),
    ]
    assert table.bounds == (len(data) - 3, len(data))
    empty = Cells(b"", Layout(XYZ))
    assert (empty.header, empty.header_line, list(empty.rows())) == ([], 0, [])
    mark = Cells(b"\xef\xbb\xbfx,1\n", Layout(XYZ, header=False))
    assert [[mark.text(s) for s in spans] for _, spans in mark.rows()] == [["x", "1"]]
    assert mark.header == []


def test_what_is_wrong_with_a_cell_or_a_column() -> None:
    cells = Cells(b"1,\xe9\xe9,%s\n" % (b"x" * 50), Layout(XYZ, header=False))
    ((_, row),) = cells.rows()
    assert cells.text(row[1]) == "éé"
    assert cells.number(row, 1) == 'column 2 is "éé"; expected a number with a decimal point'
    assert cells.number(row, 2) == f'column 3 is "{"x" * 40}"; expected a number with a decimal point'
    assert cells.number(row, 3) == "3 columns; expected at least 4 between commas"
    assert [cells.word(row, place) for place in (0, 2, 3, None)] == ["1", "x" * 50, "", ""]
    with pytest.raises(InputError) as caught:
        cells.place("X")
    assert (caught.value.line, caught.value.message) == (
        1,
        'there is no column "x"; expected one of their numbers',
    )
    assert (cells.place("Z"), cells.place("tool")) == (2, None)
    comma = Cells(b"1,5;1.5", Layout(XYZ, "semicolon", "comma", header=False))
    ((_, row),) = comma.rows()
    number = comma.number(row, 0)
    assert isinstance(number, Number) and number.value == 1.5
    assert comma.number(row, 1) == 'column 2 is "1.5"; expected a number with a decimal comma'
