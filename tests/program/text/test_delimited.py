"""The layout that the first rows of a table show: its delimiter, decimal mark, columns and units."""

from __future__ import annotations

import pytest

from olp.core.errors import InputError
from olp.program.text import delimited
from olp.program.text.delimited import Layout, detected_layout, first_lines, mapping, stated_frame


@pytest.mark.parametrize(
    ("header", "columns", "unit"),
    [
        ("X,Y,Z", {"X": "X", "Y": "Y", "Z": "Z"}, None),
        ("z;y;x", {"X": "x", "Y": "y", "Z": "z"}, None),
        ("X_mm,Y_mm,Z_mm", {"X": "X_mm", "Y": "Y_mm", "Z": "Z_mm"}, "mm"),
        ("x [inch],y [inch],z", {"X": "x [inch]", "Y": "y [inch]", "Z": "z"}, "inch"),
        ("X(um),Y(um),Z(um)", {"X": "X(um)", "Y": "Y(um)", "Z": "Z(um)"}, "um"),
        ("X m,Y m,Z m", {"X": "X m", "Y": "Y m", "Z": "Z m"}, "m"),
        ("Label,X,Y,Z,Time_s", {"X": "X", "Y": "Y", "Z": "Z", "t": "Time_s", "name": "Label"}, None),
        ("t [ms],X,Y,Z,nx,ny,nz",
         {"X": "X", "Y": "Y", "Z": "Z", "t": "t [ms]", "I": "nx", "J": "ny", "K": "nz"}, None),
        ("line,X,Y,Z,rx_deg,ry,rz [rad]",
         {"X": "X", "Y": "Y", "Z": "Z", "line": "line", "A": "rx_deg", "B": "ry", "C": "rz [rad]"}, None),
        ("X,Y,Z,zone,stylus,sx,stylus_y,SZ_mm",
         {"X": "X", "Y": "Y", "Z": "Z", "blend": "zone", "tool": "stylus", "SX": "sx", "SY": "stylus_y",
          "SZ": "SZ_mm"},
         None),
        # the first cell with a name of its role holds it
        ("tag,X,Y,Z,point", {"X": "X", "Y": "Y", "Z": "Z", "name": "tag"}, None),
        ("other,X,Y,Z", {"X": "X", "Y": "Y", "Z": "Z"}, None),
        ('"X","Y","Z"', {"X": "X", "Y": "Y", "Z": "Z"}, None),
    ],
)  # fmt: skip
def test_a_header_names_its_columns(header: str, columns: dict[str, str], unit: str | None) -> None:
    mark = ";" if ";" in header else ","
    row = mark.join("1" * len(header.split(mark)))
    layout = detected_layout(["# c", "", header, row])
    assert layout is not None
    assert dict(layout.columns) == columns
    assert list(layout.columns) == [role for role in delimited.ROLES if role in columns]
    assert (layout.unit, layout.header, layout.speed_unit) == (unit, True, None)
    shown = ", ".join(f"{role} in column {name}" for role, name in layout.columns.items())
    name = {";": "semicolon", ",": "comma"}[mark]
    assert layout.assumed == (
        f"columns are separated by {name}",
        f"{shown}; in {unit}" if unit else f"{shown}; no unit is stated",
    )


@pytest.mark.parametrize("role", delimited.ROLES)
def test_every_name_of_a_role_is_known(role: str) -> None:
    for name in delimited.ROLES[role]:
        head = [axis for axis in delimited.AXES if axis != role]
        layout = detected_layout([",".join([name.upper(), *head]), "1,2,3,4"])
        assert layout is not None and layout.columns[role] == name.upper()


@pytest.mark.parametrize(
    ("speed", "unit"),
    [("feed_mm/min", "mm/min"), ("Speed [m/s]", "m/s"), ("velocity (inch/min)", "inch/min"),
     ("feedrate mm_s", "mm/s"),
     ("feed", None)],
)  # fmt: skip
def test_a_header_may_state_the_unit_of_speeds(speed: str, unit: str | None) -> None:
    layout = detected_layout([f"X,Y,Z,{speed}", "1,2,3,4"])
    assert layout is not None
    assert (layout.columns["speed"], layout.speed_unit) == (speed, unit)
    assert unit is None or unit in delimited.MM_S


@pytest.mark.parametrize(
    ("rows", "delimiter", "decimal", "columns"),
    [
        (["1,2,3"], "comma", "point", {"X": 1, "Y": 2, "Z": 3}),
        (["1.5;-2;3e1"], "semicolon", "point", {"X": 1, "Y": 2, "Z": 3}),
        (["1,5;2;3"], "semicolon", "comma", {"X": 1, "Y": 2, "Z": 3}),
        (["1\t+.5\t3."], "tab", "point", {"X": 1, "Y": 2, "Z": 3}),
        (["1 2   3"], "space", "point", {"X": 1, "Y": 2, "Z": 3}),
        (["1,5 2,5 3,5"], "space", "comma", {"X": 1, "Y": 2, "Z": 3}),
        (["1,5 2,5 3"], "comma", "point", None),
        # names before three numbers, as SpatialAnalyzer writes them
        (["P1,1,2,3"], "comma", "point", {"X": 2, "Y": 3, "Z": 4, "name": 1}),
        (["Set,P1,1,2,3"], "comma", "point", {"X": 3, "Y": 4, "Z": 5, "name": 2}),
        (["Set,7,1,2,3"], "comma", "point", {"X": 3, "Y": 4, "Z": 5, "name": 2}),
        (["A;B;P1;1;2;3"], "semicolon", "point", {"X": 4, "Y": 5, "Z": 6, "name": 3}),
        # a choice is left
        (["1,2"], "", "", None), (["1,2,3,4"], "", "", None), (["P1,1,2"], "", "", None),
        (["Set,7,8,1,2,3"], "", "", None),
        (["P1,1,2,3,end"], "", "", None), (["a,b,c"], "", "", None), (["X,Y,W", "1,2,3"], "", "", None),
        (["X_mm,Y_inch,Z", "1,2,3"], "", "", None), ([], "", "", None), (["# 1,2,3", "  "], "", "", None),
    ],
)  # fmt: skip
def test_rows_without_a_header(
    rows: list[str], delimiter: str, decimal: str, columns: dict[str, int] | None
) -> None:
    layout = detected_layout(rows)
    if columns is None:
        assert layout is None
        return
    assert layout is not None
    assert (layout.delimiter, layout.decimal, dict(layout.columns)) == (delimiter, decimal, columns)
    assert (layout.header, layout.unit, layout.comment) == (False, None, "#")
    assumed = [f"columns are separated by {delimiter}"]
    if decimal == "comma":
        assumed.append("the decimal mark is a comma")
    shown = ", ".join(f"{role} in column {number}" for role, number in columns.items())
    assert layout.assumed == (*assumed, f"{shown}; no unit is stated")


@pytest.mark.parametrize(("mark", "comment"), [("#", "#"), ("//", "//"), ("%", "%"), ("  //", "//")])
def test_lines_of_comments_are_no_rows(mark: str, comment: str) -> None:
    layout = detected_layout([f"{mark} X,Y", "1;2;3", f"{mark} 1,2"])
    assert layout is not None
    assert (layout.comment, layout.delimiter) == (comment, "semicolon")
    layout = detected_layout([f"{mark} a", "# b", "X Y Z", "1 2 3"])
    assert layout is not None and layout.comment == comment


def test_the_last_row_shows_the_delimiter() -> None:
    layout = detected_layout(["X Y Z", "1\t2\t3"])
    assert layout is None
    layout = detected_layout(["X\tY\tZ", "1,5\t2,5\t3,5"])
    assert layout is not None and (layout.delimiter, layout.decimal) == ("tab", "comma")


def test_the_first_lines_of_a_text() -> None:
    assert first_lines(b"\xef\xbb\xbfa\r\nb\rc\nd") == ["a", "b", "c", "d"]
    assert first_lines(b"") == [""]
    assert first_lines(b"\xff") == ["�"]
    assert first_lines(b"a\n" * 100) == ["a"] * 40
    # the line at the end of the bytes that are looked at may be cut, and is left out
    size = 1 << 16
    whole = b"a" * (size - 2) + b"\n"
    assert first_lines(whole + b"b")[1:] == ["b"]
    assert first_lines(whole + b"bc")[1:] == [""]
    assert len(first_lines(b"a" * (size + 5))[0]) == size


@pytest.mark.parametrize(
    ("lines", "frame"),
    [
        (["# frame=G54"], "G54"), (["#frame = part_1 x"], "part_1"), (["// FRAME=a"], "a"),
        (["% ; frame=b"], "b"),
        (["frame=c"], "c"), (["X,Y,Z", "# frame=d"], "d"), (["# frame=e", "# frame=e"], "e"),
        (["# a frame=f"], None),
        (["X,Y,Z"], None), ([], None), (["# frame=g", "1,2,3"], "g"),
    ],
)  # fmt: skip
def test_a_comment_may_name_the_frame(lines: list[str], frame: str | None) -> None:
    assert stated_frame(lines) == frame


@pytest.mark.parametrize("file", ["", "points.csv"])
def test_two_frames_are_refused(file: str) -> None:
    with pytest.raises(InputError) as caught:
        stated_frame(["# frame=a", "", "# frame=b"], file)
    assert (caught.value.file, caught.value.line) == (file or None, 3)
    assert caught.value.message == "the frame is b here and a before; expected one frame per file"


def test_units_are_lengths_times_and_speeds() -> None:
    assert delimited.MM == {"mm": 1.0, "um": 0.001, "m": 1000.0, "inch": 25.4}
    assert delimited.SECONDS == {"s": 1.0, "ms": 0.001, "us": 0.000001}
    # a minute has 60 s
    for length in ("mm", "m", "inch"):
        assert delimited.MM_S[f"{length}/min"] * 60 == pytest.approx(delimited.MM[length], rel=1e-15)
    assert (delimited.MM_S["mm/s"], delimited.MM_S["m/s"]) == (1.0, 1000.0)


def test_a_layout_without_a_unit_says_where_to_give_it() -> None:
    columns = mapping({"X": 1})
    assert Layout(columns, unit="inch").unit_mm == 25.4
    with pytest.raises(InputError, match=r"^states no unit of X, Y and Z; give it in the header \(X_mm or"):
        _ = Layout(columns).unit_mm
    with pytest.raises(TypeError):
        columns["Y"] = 2  # type: ignore[index]
    assert Layout(columns) == Layout(
        columns,
        "comma",
        "point",
        None,
        "s",
        None,
        True,
        "#",
        None,
        None,
        None,
        None,
        "points",
        False,
        True,
        (),
    )
