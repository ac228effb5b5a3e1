"""Rows of lists by hand: bytes, numbers, frames, tools and speeds, read in columns and row by row."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import machine
from cases.readings import said, text_of, word_of

from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.core.toolpath import Flag, Kind
from olp.files.config import load_setup
from olp.files.point_profile import PointProfile
from olp.program.dialect import Support
from olp.program.pointlist import reader
from olp.program.pointlist.base import PointList
from olp.program.pointlist.columns import Columns, columns, plain_numbers
from olp.program.pointlist.dialect import DIALECT, with_layout
from olp.program.program import Program
from olp.program.registry import read
from olp.program.text.delimited import detected_layout
from olp.program.text.numbers import number

TABLES = (
    '[work_offsets.G54]\nset_by = "true"\nX_mm = 100.0\n[work_offsets.G55]\nset_by = "true"\nC_deg = 90.0\n'
    "[tools.1]\nZ_mm = 30.0\n[tools.2]\nZ_mm = 40.0\n"
)
NAN = math.nan


@pytest.fixture(scope="module")
def setup(tmp_path_factory: pytest.TempPathFactory) -> Setup:
    return load_setup(machine(tmp_path_factory.mktemp("list"), tables=TABLES))


@pytest.fixture(params=("in columns", "row by row"))
def way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    if request.param == "row by row":
        monkeypatch.setattr(reader, "columns", lambda *_: None)
    return str(request.param)


def dialect(**keys: object) -> PointList:
    return with_layout(PointProfile(**keys).layout)  # type: ignore[arg-type]


def listed(text: str | bytes, setup: Setup, own: PointList = DIALECT) -> Program:
    return read(text.encode() if isinstance(text, str) else text, setup, own)


def rows_of(program: Program) -> list[tuple[int, bytes, list[float], list[bytes]]]:
    """Of each row: its line, its bytes, its position without the work offset, its numbers as written."""
    assert program.statements is not None
    statements = zip(program.statements.begin.tolist(), program.statements.end.tolist(), strict=True)
    words = [[word_of(program, k) for k in row] for row in program.slot.tolist()]
    return [
        (line, text_of(program, a, b), end, [word[0] for word in row if word is not None])
        for line, (a, b), end, row in zip(
            program.toolpath.line.tolist(), statements,
            (program.toolpath.end_mm - [100.0, 0.0, 0.0]).tolist(), words, strict=True,
        )
    ]  # fmt: skip


HEADED = "X_mm,Y_mm,Z_mm\n"
#: text, lines and numbers of its rows
TEXTS: dict[str, tuple[str, list[tuple[int, str, list[float]]]]] = {
    "a row": (HEADED + "1,2.5,-3", [(2, "1,2.5,-3", [1, 2.5, -3])]),
    "rows": (HEADED + "1,2,3\n4,5,6\n", [(2, "1,2,3", [1, 2, 3]), (3, "4,5,6", [4, 5, 6])]),
    "line ends of Windows": (
        HEADED.replace("\n", "\r\n") + "1,2,3\r\n4,5,6\r\n", [(2, "1,2,3", [1, 2, 3]), (3, "4,5,6", [4, 5,
        6])]
    ),
    "blank rows and comments": (
        f"# a\n\n{HEADED}\n  # 1,2,3\n1,2,3\n \t \n#4,5,6\n4,5,6\n\n",
        [(6, "1,2,3", [1, 2, 3]), (9, "4,5,6", [4, 5, 6])],
    ),
    "blanks": (HEADED + " 1 ,  2.50 , 3 \n", [(2, " 1 ,  2.50 , 3 ", [1, 2.5, 3])]),
    "a byte order mark": ("\ufeff" + HEADED + "1,2,3", [(2, "1,2,3", [1, 2, 3])]),
    "other columns": (
        "name,Z_mm,note,Y_mm,X_mm,more\nP,3.,a b,2,1,x\n,6,,5,4,\n",
        [(2, "P,3.,a b,2,1,x", [1, 2, 3]), (3, ",6,,5,4,", [4, 5, 6])],
    ),
    "more cells than names": (HEADED + "1,2,3,4\n5,6,7\n", [(2, "1,2,3,4", [1, 2, 3]), (3, "5,6,7", [5, 6,
    7])]),
    "tabs": ("X_mm\tY_mm\tZ_mm\n1\t2\t3\n", [(2, "1\t2\t3", [1, 2, 3])]),
    "blanks alone": ("X_mm Y_mm  Z_mm\n  1   2\t3 \n4 5 6 7", [(2, "  1   2\t3 ", [1, 2, 3]), (3, "4 5 6 7",
    [4, 5, 6])]),
    "commas of decimals": (
        "X_mm;Y_mm;Z_mm\n1,5;-2;,25\n+4;5,;6\n", [(2, "1,5;-2;,25", [1.5, -2, 0.25]), (3, "+4;5,;6", [4, 5,
        6])]
    ),
    "inches": ("X_inch,Y_inch,Z_inch\n1,2,.5\n", [(2, "1,2,.5", [25.4, 50.8, 12.7])]),
    "metres": ("X_m,Y_m,Z_m\n.001,.002,.5\n", [(2, ".001,.002,.5", [1, 2, 500])]),
    "other marks": ("// a\nX_mm Y_mm Z_mm\n// b\n1 2 3\n", [(4, "1 2 3", [1, 2, 3])]),
    "exponents": (HEADED + "1e1,-2.5E-1,3\n", [(2, "1e1,-2.5E-1,3", [10, -0.25, 3])]),
    "quotes": (HEADED + '"1","2",3\n', [(2, '"1","2",3', [1, 2, 3])]),
    "old line ends": (HEADED.replace("\n", "\r") + "1,2,3\r4,5,6\r", [(2, "1,2,3", [1, 2, 3]), (3, "4,5,6",
    [4, 5, 6])]),
    "many digits": (
        HEADED + "1.00000000000000000001,2.000000000000000000000,3\n",
        [(2, "1.00000000000000000001,2.000000000000000000000,3", [1, 2, 3])],
    ),
    "large numbers": (HEADED + "10000000.00000000,2,3\n", [(2, "10000000.00000000,2,3", [1e7, 2, 3])]),
}  # fmt: skip


@pytest.mark.parametrize("name", TEXTS)
def test_rows_have_their_lines_bytes_and_numbers(name: str, way: str, setup: Setup) -> None:
    text, want = TEXTS[name]
    got = rows_of(listed(text, setup))
    assert [(line, row) for line, row, _, _ in got] == [(line, row.encode()) for line, row, _ in want]
    assert np.array([end for *_, end, _ in got]) == pytest.approx(
        np.array([end for *_, end in want]), abs=1e-9
    )
    # the numbers are those of the row, in the order of X, Y and Z
    for (_, row, _, numbers), (*_, end) in zip(got, want, strict=True):
        assert all(cell in row for cell in numbers)
        unit = 25.4 if "inch" in text else 1000.0 if "X_m," in text else 1.0
        values = [float(cell.replace(b",", b".")) * unit for cell in numbers]
        assert values == pytest.approx(end)


@pytest.mark.parametrize("name", TEXTS)
def test_the_mantissas_of_a_row_are_its_numbers(name: str, way: str, setup: Setup) -> None:
    program = listed(TEXTS[name][0], setup)
    for row in program.slot.tolist():
        for index in row:
            text, value, _ = word_of(program, index) or (b"", NAN, False)
            assert value == pytest.approx(float(text.replace(b",", b".")), abs=1e-12)


#: what is read in columns, and the numbers of its first row
PLAIN: dict[str, tuple[bytes, list[float] | None]] = {
    "plain": (b"1,2,3\n", [1, 2, 3]), "no line end": (b"1,2,3", [1, 2, 3]), "blanks": (b" 1 , 2 ,3\r\n", [1,
    2, 3]),
    "a mark of bytes": (b"\xef\xbb\xbf1,2,3\n", [1, 2, 3]), "points": (b"1.,.5,-3.25\n", [1, 0.5, -3.25]),
    "15 digits": (b"999999999999.999,2,3\n", [999999999999.999, 2, 3]),
    "40 characters": (b"0000000000000000000000000000000000000001,2,3\n", None),
    "16 digits": (b"1000000000000.000,2,3\n", None), "quotes": (b'"1",2,3\n', None), "nothing": (b"", None),
    "comments": (b"# 1,2,3\n", None), "lone line ends": (b"1,2,3\r4,5,6\n", None), "two cells": (b"1,2\n",
    None),
    "an empty cell": (b"1,,3\n", None), "an exponent": (b"1e1,2,3\n", None), "a word": (b"1,2,z\n", None),
    "two numbers": (b"1 2,2,3\n", None), "a later word": (b"1,2,3\n1,x,3\n", None),
    "two points": (b"1.2.3,2,3\n", None),
    "a mark behind a number": (b"1,2!,3\n", None), "a mark before a number": (b"1,!2,3\n", None),
    "a short last row": (b"1,2,3\n5", None), "a short last row of two": (b"1,2,3\n5\n", None),
    "a sign alone": (b"-,2,3\n", None),
}  # fmt: skip


@pytest.mark.parametrize("name", PLAIN)
def test_plain_tables_are_read_in_columns(name: str) -> None:
    data, want = PLAIN[name]
    layout = PointProfile(header=False, columns={"X": 1, "Y": 2, "Z": 3}).layout  # type: ignore[arg-type]
    got = columns(data, layout, 0, [0, 1, 2], [])
    if want is None and name != "40 characters":
        assert got is None
        return
    if got is not None:
        assert got.value[0].tolist() == (want or [1.0, 2.0, 3.0])
        assert got.line[0] == 1


def found(data: bytes, header_line: int, xyz: list[int], others: list[int], **keys: object) -> Columns | None:
    layout = PointProfile(header=False, columns={"X": 1, "Y": 2, "Z": 3}, **keys).layout  # type: ignore[arg-type]
    return columns(data, layout, header_line, xyz, others)


@pytest.mark.parametrize("comma", (False, True))
def test_numbers_in_columns_are_those_that_are_read_singly(comma: bool) -> None:
    """Each character that is printed, between digits, before, behind and alone: the same number, or none."""
    mark = b"," if comma else b"."
    for character in map(bytes, zip(range(33, 256), strict=False)):
        for cell in (b"1%c5", b"%c5", b"5%c", b"%c", b"1%c%c2", b"-1%c25"):
            data = cell.replace(b"%c", character)
            text = np.frombuffer(b" " + data + b" ", np.uint8)
            got = plain_numbers(text, np.array([1]), np.array([1 + len(data)]), comma)
            want = number(data, mark)
            assert got is None or want is not None, data
            if got is not None and want is not None:
                assert got[0][0] / 10.0 ** got[1][0] == pytest.approx(want.value), data


def test_columns_are_where_they_are_asked_for() -> None:
    data = b"a,b,c,d,e\n% 1\n 7 , 3 ,x y, 2,1\n#\n17,13,z,12,11,\n"
    got = found(data, 1, [4, 3, 1], [0, 2], comment="%")
    assert got is not None
    assert got.line.tolist() == [3, 5]
    assert got.value.tolist() == [[1.0, 2.0, 3.0], [11.0, 12.0, 13.0]]
    assert [data[a:b] for a, b in zip(got.begin, got.end, strict=True)] == [
        b" 7 , 3 ,x y, 2,1",
        b"17,13,z,12,11,",
    ]
    assert [[data[a:b] for a, b in row] for row in got.cells] == [[b"7", b"x y"], [b"17", b"z"]]
    assert [[data[a:b] for a, b in zip(*row, strict=True)] for row in zip(got.start, got.stop,
    strict=True)] == [
        [b"1", b"2", b"3"], [b"11", b"12", b"13"]
    ]  # fmt: skip


def test_columns_between_blanks_are_where_they_are_asked_for() -> None:
    data = b"1 2  3\tx\n  11 12 13   y\n"
    got = found(data, 0, [2, 0, 1], [3], delimiter="space")
    assert got is not None
    assert got.value.tolist() == [[3.0, 1.0, 2.0], [13.0, 11.0, 12.0]]
    assert [[data[a:b] for a, b in row] for row in got.cells] == [[b"x"], [b"y"]]
    assert found(data + b"21 22 23\n", 0, [2, 0, 1], [3], delimiter="space") is None
    assert found(data + b"21 22 23\n", 0, [2, 0, 1], [], delimiter="space") is not None


def test_other_columns_may_be_empty_and_may_not_be_missing() -> None:
    got = found(b"1,2,3,\n4,5,6, \n", 0, [0, 1, 2], [3])
    assert got is not None
    assert (got.cells[:, 0, 0] == got.cells[:, 0, 1]).all()
    assert found(b"1,2,3\n4,5,6,7\n", 0, [0, 1, 2], [3]) is None


def test_a_decimal_comma_allows_no_point() -> None:
    keys = {"delimiter": "semicolon", "decimal": "comma"}
    got = found(b"1,5;2;-0,25\n", 0, [0, 1, 2], [], **keys)
    assert got is not None
    assert got.value.tolist() == [[1.5, 2.0, -0.25]]
    assert found(b"1,5;2.5;3\n", 0, [0, 1, 2], [], **keys) is None
    assert found(b"1,5;2;3\n", 0, [0, 1, 2], [], delimiter="semicolon") is None
    # a point in another column is nothing of the numbers
    assert found(b"1,5;2;3;4.5\n", 0, [0, 1, 2], [3], **keys) is not None


# -- what a row does -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("keys", "kinds", "flag"),
    [
        ({}, [Kind.RAPID] * 3, 0), ({"insert": True}, [Kind.RAPID] * 3, 0),
        ({"joined": "lines"}, [Kind.RAPID, Kind.LINE, Kind.LINE], Flag.WHOLE),
        ({"joined": "lines", "insert": True}, [Kind.RAPID, Kind.LINE, Kind.LINE], 0),
        ({"joined": "lines", "insert": True, "columns": {"t": "t"}}, [Kind.RAPID, Kind.LINE, Kind.LINE],
         Flag.WHOLE),
    ],
)  # fmt: skip
def test_how_rows_are_joined(
    keys: dict[str, object], kinds: list[Kind], flag: int, way: str, setup: Setup
) -> None:
    path = listed("X_mm,Y_mm,Z_mm,t\n1,2,3,0\n4,5,6,1\n7,8,9,2\n", setup, dialect(**keys)).toolpath
    assert path.kind.tolist() == kinds
    assert path.flag.tolist() == [flag] * 3
    assert path.frames[0].tool is None


def test_each_row_has_its_tool(way: str, setup: Setup) -> None:
    path = listed("X_mm,Y_mm,Z_mm,tool\n1,2,3,2\n1,2,3,1\n1,2,3,2\n", setup).toolpath
    frames = [path.frames[k] for k in path.frame.tolist()]
    assert [f.tool for f in frames] == [2, 1, 2]
    assert [f.tool_mm for f in frames] == [(0.0, 0.0, -40.0), (0.0, 0.0, -30.0), (0.0, 0.0, -40.0)]
    assert path.end_mm.tolist() == [[101.0, 2.0, 3.0]] * 3


def test_rows_without_a_tool_have_that_of_the_machine(setup: Setup) -> None:
    path = listed("X_mm,Y_mm,Z_mm,tool\n1,2,3,\n1,2,3,2\n1,2,3, \n", setup).toolpath
    assert [path.frames[k].tool for k in path.frame.tolist()] == [None, 2, None]


def test_a_frame_that_the_list_names_turns_its_points(way: str, setup: Setup) -> None:
    text = "# frame = G55\nX_mm,Y_mm,Z_mm,tool\n1,2,3,1\n4,5,6,2\n"
    path = listed(text, setup).toolpath
    assert path.end_mm == pytest.approx(np.array([[-2.0, 1.0, 3.0], [-5.0, 4.0, 6.0]]))
    assert {f.work_offset for f in path.frames} == {"G55"}
    # a comment comes before the profile, and that before the machine
    own = dialect(frame="G55")
    assert listed("X_mm,Y_mm,Z_mm\n1,2,3\n", setup, own).toolpath.frames[0].work_offset == "G55"
    assert listed("# frame=G54\nX_mm,Y_mm,Z_mm\n1,2,3\n", setup, own).toolpath.frames[0].work_offset == "G54"


@pytest.mark.parametrize(
    ("header", "unit", "mm_s"),
    [("speed (mm/s)", None, [5.0, 7.5]), ("speed (mm/min)", None, [5 / 60, 0.125]), ("speed", None, [NAN,
    NAN]),
     ("speed", "m/s", [5000.0, 7500.0]), ("feed", "inch/min", [5 * 25.4 / 60, 7.5 * 25.4 / 60])],
)  # fmt: skip
def test_speeds_have_units(header: str, unit: str | None, mm_s: list[float], way: str, setup: Setup) -> None:
    layout = detected_layout([f"X_mm,Y_mm,Z_mm,{header}"])
    assert layout is not None
    own = with_layout(replace(layout, joined="lines", speed_unit=unit or layout.speed_unit))
    text = f"X_mm,Y_mm,Z_mm,{header}\n1,2,3,9\n4,5,6,5\n7,8,9,7.5\n"
    statements = listed(text, setup, own).statements
    assert statements is not None
    assert statements.feed_mm_s.tolist() == pytest.approx([math.inf, *mm_s], nan_ok=True)


def test_a_row_without_a_speed_keeps_that_before_it(setup: Setup) -> None:
    own = dialect(joined="lines", speed_unit="mm/s", columns={"speed": "v", "tool": "tool"})
    text = "X_mm,Y_mm,Z_mm,tool,v\n1,2,3,1,\n4,5,6,1,\n7,8,9,1,5\n7,8,9,1,\n7,8,9,1,x\n7,8,9,1,2\n7,8,9\n"
    statements = listed(text, setup, own).statements
    assert statements is not None
    assert statements.feed_mm_s.tolist() == pytest.approx([math.inf, NAN, 5, 5, 5, 2, 2], nan_ok=True)


# -- remarks and refusals ------------------------------------------------------------------------------


def test_what_is_remarked_of_a_list(way: str, setup: Setup) -> None:
    text = "# a\nX_mm,Y_mm,Z_mm,A,B\n\n1,2,3,0,0\n1,2,4,0,0\n1,2,5,0,90\n1,2,6,7,90\n"
    assert listed(text, setup).remarks == (
        ("told", 4, "columns are separated by comma"),
        (
            "told",
            4,
            "X in column X_mm, Y in column Y_mm, Z in column Z_mm, A in column A, B in column B; in mm",
        ),
        ("told", 4, "positions are stated in G54"),
        ("turning", 6, "the orientation changes from row to row"),
        ("joined", 4, "how the machine goes from row to row is not stated"),
    )
    unmarked = dialect(stamp=False, joined="lines", frame="G54")
    assert listed("X_mm,Y_mm,Z_mm\n1,2,3\n", setup, unmarked).remarks == (
        ("unmarked", 2, "the profile allows no comment, so nothing marks the corrected list"),
    )
    assert listed("X_mm,Y_mm,Z_mm\n", setup, dialect(frame="G54")).remarks == (
        ("joined", 1, "how the machine goes from row to row is not stated"),
    )


@pytest.mark.parametrize("column", "ABCIJK")
def test_each_column_of_a_direction_may_turn(column: str, way: str, setup: Setup) -> None:
    text = f"X_mm,Y_mm,Z_mm,{column}\n1,2,3,1\n1,2,3,1\n1,2,3,2\n"
    assert ("turning", 4, "the orientation changes from row to row") in listed(text, setup).remarks
    assert "turning" not in {name for name, *_ in listed(text.replace(",2\n", ",1\n"), setup).remarks}


@pytest.mark.parametrize(
    ("text", "line", "code", "words"),
    [
        ("", None, "OLP504", "has no positions; expected one row per waypoint"),
        (" \n", None, "OLP504", "has no positions"),
        ("1,2,3,4\n", None, "OLP504", "does not show which columns hold X, Y and Z"),
        ("1,2,3\n", None, "OLP504", "states no unit of X, Y and Z"),
        ("X_mm,Y_mm,Z_mm\n1,2,3\n1,2\n", 3, "OLP504", "2 columns; expected at least 3 between commas"),
        ("X_mm,Y_mm,Z_mm\n1,2,3\n1,q,r\n", 3, "OLP504", 'column 2 is "q"; expected a number with a '
        'decimal point'),
        ("X_mm,Y_mm,Z_mm,tool\n1,2,3,1\n1,2,3,T1\n", 3, "OLP504", '"T1" is not a tool number'),
        ("X_mm,Y_mm,Z_mm,tool\n1,2,3,1\n1,2,3,9\n1,2,3,9\n", 3, "OLP521", "tool 9"),
        ("X_mm,Y_mm,Z_mm,tool\n1,2,3,\n1,2,3,9\n1,2,3,9\n", 3, "OLP521", "tool 9"),
        ("X_mm,Y_mm,Z_mm\n1,2,3\n1,2,1/5\n", 3, "OLP504", 'column 3 is "1/5"; expected a number'),
        ("# frame=G54\n# frame=G55\nX_mm,Y_mm,Z_mm\n1,2,3\n", 2, "OLP504",
         "the frame is G55 here and G54 before"),
        ("# frame=G57\nX_mm,Y_mm,Z_mm\n1,2,3\n", 3, "OLP520", "needs the frame G57"),
    ],
)  # fmt: skip
def test_a_refusal_has_its_line_its_code_and_its_sentence(
    text: str, line: int | None, code: str, words: str, setup: Setup
) -> None:
    with pytest.raises(ProgramError, match=words) as caught:
        listed(text, setup)
    assert (caught.value.line, caught.value.code) == (line, code)


def test_a_profile_without_columns_is_refused(setup: Setup) -> None:
    own = with_layout(replace(PointProfile().layout, columns={"X": "X_mm", "Y": "Y_mm"}))
    with pytest.raises(ProgramError, match="has no columns for X, Y and Z") as caught:
        listed("X_mm,Y_mm,Z_mm\n1,2,3\n", setup, own)
    assert (caught.value.line, caught.value.code) == (None, "OLP504")
    with pytest.raises(
        ProgramError, match='there is no column "Q"; expected one of X_mm, Y_mm, Z_mm'
    ) as caught:
        listed("X_mm,Y_mm,Z_mm\n1,2,3\n", setup, dialect(columns={"tool": "Q"}))
    assert (caught.value.line, caught.value.code) == (1, "OLP504")


def test_both_ways_say_the_same(setup: Setup, monkeypatch: pytest.MonkeyPatch) -> None:
    text = "X_mm,speed_mm/s,tool,Z_mm,Y_mm,A\n1.5,5,1,2,3,0\n4.25,6,2,5,6,0\n 7,7,1,8.0,9,1\n"
    own = replace(DIALECT, layout=replace(detected_layout(text.split("\n")), joined="lines"))  # type: ignore[type-var]
    fast = said(listed(text, setup, own))
    monkeypatch.setattr(reader, "columns", lambda *_: None)
    assert said(listed(text, setup, own)) == fast


# -- the dialect ---------------------------------------------------------------------------------------


def test_the_table_of_support_names_each_column() -> None:
    turn = "three linear axes cannot turn the tool"
    unchanged = ["speed", "blend", "name", "line"]
    want = {f"column {k}": (Support.CORRECTED, "") for k in "XYZ"}
    want |= {f"column {k}": (Support.UNCHANGED, turn) for k in "ABCIJK"}
    want |= {f"column {k}": (Support.UNCHANGED, "") for k in unchanged}
    want["column tool"] = (Support.READ, "the tool of the row: its tool vector")
    want["column t"] = (Support.UNCHANGED, "with a column of time no row is inserted")
    want |= {"any other column": (Support.UNCHANGED, ""), "comment": (Support.UNCHANGED, "")}
    want["a row without numbers"] = (Support.REFUSED, "it may be a waypoint")
    assert {row.statement: (row.support, row.why) for row in DIALECT.rows()} == want


def test_the_marks_of_a_list_are_those_of_its_layout() -> None:
    own = dialect(comment="//", stamp=False)
    assert (own.name, own.comment, own.marks) == ("list", (b"// ", b""), False)
    assert own.layout == PointProfile(comment="//", stamp=False).layout
    assert (DIALECT.comment, DIALECT.marks, DIALECT.layout) == ((b"# ", b""), True, None)
    assert (DIALECT.signs.endings, DIALECT.points, DIALECT.path_mode) == (("csv", "tsv"), True, "not stated")
    assert DIALECT.title == "list of positions (CSV, TXT)"


def test_without_words_the_path_is_the_same(way: str, setup: Setup, tmp_path: Path) -> None:
    data = b"X_mm,Y_mm,Z_mm\n1,2,3\n4,5,6\n"
    bare = read(data, setup, DIALECT, words=False)
    assert bare.words is None
    assert bare.toolpath.end_mm.tolist() == [[101.0, 2.0, 3.0], [104.0, 5.0, 6.0]]
