"""Files of measured points: layouts detected from the file, profiles, and what is wrong with a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from olp.core.errors import ConfigError, InputError, UsageError
from olp.files.point_profile import BUILT_IN, ColumnsTable, PointProfile, load_profile, with_options
from olp.files.points import layout_of, parse_points, read_points

NUMBERS = st.floats(-1e5, 1e5).map(lambda v: round(v, 6))


@pytest.mark.parametrize(("text", "points", "names"), [
    ("# frame=G54\nX_mm,Y_mm,Z_mm,line\n1,2,3,7\n1,2,4,8\n", [[1, 2, 3], [1, 2, 4]], None),
    ("// SA 2024.1\n// Frame: A\nM::P1, 1.0, 2.0, 3.0\nP2,1,2,4\n", [[1, 2, 3], [1, 2, 4]], ("M::P1", "P2")),
    ("Coll Main P1 1.0 2.0 3.0\nColl Main P2 1.0 2.0 4.0\n", [[1, 2, 3], [1, 2, 4]], ("P1", "P2")),
    ("Coll Main 1 1.0 2.0 3.0\nColl Main 2 1.0 2.0 4.0\n", [[1, 2, 3], [1, 2, 4]], ("1", "2")),
    ("X;Y;Z\n1,5;2,5;3,5\n", [[1.5, 2.5, 3.5]], None),
    ("1 2 3\n4 5 6\n", [[1, 2, 3], [4, 5, 6]], None),
    ("X [inch]\tY [inch]\tZ [inch]\n1\t0\t-1\n", [[25.4, 0, -25.4]], None),
    ("name,x_um,y_um,z_um\nA,1000,2000,3000\n", [[1, 2, 3]], ("A",)),
])  # fmt: skip
def test_the_layout_is_detected_from_the_file(
    text: str, points: list[list[float]], names: tuple[str, ...] | None
) -> None:
    read = parse_points(text.encode(), "f.csv")
    assert read.points_mm == pytest.approx(np.array(points, float))
    assert read.names == names


def test_frame_time_and_line_are_read() -> None:
    points = parse_points(b"# frame=G55\nt_s,X_mm,Y_mm,Z_mm,line\n0,1,2,3,4\n0.5,1,2,3,9\n", "f")
    assert (points.frame, points.line.tolist(), points.time_s.tolist()) == ("G55", [4, 9], [0.0, 0.5])


def test_the_sampler_of_linuxcnc_gives_axis_positions() -> None:
    text = b"0 1.0 2.0 3.0 2\noverrun\n5 1.5 2.0 3.0 2\n"
    points = parse_points(text, "samples", load_profile("linuxcnc-sampler"))
    assert points.points_mm.tolist() == [[1.0, 2.0, 3.0], [1.5, 2.0, 3.0]]
    assert points.profile.positions == "axes"


@pytest.mark.parametrize(("text", "line", "words"), [
    ("", None, "holds no points"),
    ("X_mm,Y_mm,Z_mm\n", None, "holds no points"),
    ("0 1 2 3 4\n", None, "--column"),
    ("X_mm,Y_mm,Z_mm\n1,2,a\n", 2, 'column 3 is "a"'),
    ("X_mm,Y_mm,Z_mm\n1,2,3\n\n1,2\n", 4, "2 columns; expected at least 3"),
    ("X_mm,Y_mm,Z_mm\n1,2,3\n1,nan,3\n", 3, "not finite"),
])  # fmt: skip
def test_what_is_wrong_is_stated_with_its_line(text: str, line: int | None, words: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_points(text.encode(), "f.csv")
    assert words in str(caught.value)
    assert caught.value.line == line
    assert caught.value.file == "f.csv"


def test_a_file_that_is_no_text() -> None:
    with pytest.raises(InputError, match="not UTF-8"):
        parse_points(b"X_mm,Y_mm,Z_mm\n\xff\xfe\n", "f")


def test_columns_by_name_with_a_misspelt_one(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("East,North,Height\n1,2,3\n")
    profile = with_options(BUILT_IN["olp"], ["X=East", "Y=North", "Z=Height"], unit="m")
    assert read_points(path, profile).points_mm.tolist() == [[1000.0, 2000.0, 3000.0]]
    with pytest.raises(InputError, match="did you mean Height"):
        read_points(path, with_options(profile, ["Z=Heigth"]))
    with pytest.raises(UsageError, match="X=East"):
        with_options(profile, ["Q=1"])


@given(
    delimiter=st.sampled_from(["comma", "semicolon", "tab", "space"]),
    unit=st.sampled_from(["mm", "um", "m", "inch"]),
    positions=st.sampled_from(["tip", "axes"]),
    columns=st.tuples(*[st.integers(1, 9) | st.sampled_from(["a", "X mm", 'q"']) for _ in range(3)]),
)
def test_a_saved_profile_is_read_as_it_was(
    tmp_path_factory: pytest.TempPathFactory,
    delimiter: str,
    unit: str,
    positions: str,
    columns: tuple[object, ...],
) -> None:
    profile = with_options(
        PointProfile(columns=ColumnsTable(X=columns[0], Y=columns[1], Z=columns[2])), [],
        delimiter=delimiter, unit=unit, positions=positions,
    )  # fmt: skip
    path = tmp_path_factory.mktemp("p") / "profile.toml"
    path.write_text(profile.to_toml(), "utf-8")
    assert load_profile(path) == profile


@pytest.mark.slow
@given(st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS), min_size=1, max_size=20), st.sampled_from(";\t, "))
def test_points_come_back(rows: list[tuple[float, float, float]], mark: str) -> None:
    text = mark.join("XYZ") + "\n" + "".join(mark.join(map(repr, row)) + "\n" for row in rows)
    assert parse_points(text.encode(), "f").points_mm.tolist() == [list(row) for row in rows]


def test_an_unknown_key_of_a_profile_names_the_nearest(tmp_path: Path) -> None:
    path = tmp_path / "p.toml"
    path.write_text('schema = "olp-points-1"\ndelimitter = "comma"\n')
    with pytest.raises(ConfigError, match="did you mean delimiter"):
        load_profile(path)


def test_the_line_of_a_row_without_its_name_is_stated() -> None:
    profile = PointProfile(header=False, columns=ColumnsTable(X=1, Y=2, Z=3, name=4))
    with pytest.raises(InputError, match="3 columns; expected at least 4") as caught:
        parse_points(b"1,2,3,A\n# aside\n1,2,3\n", "f.csv", profile)
    assert caught.value.line == 3


@pytest.mark.parametrize("item", ["X=0", "X=00", "X= ", "X=", "=3", "Q=3"])
def test_a_column_that_cannot_be_is_no_traceback(item: str) -> None:
    with pytest.raises(UsageError, match="--column"):
        with_options(PointProfile(), [item])


def test_digits_that_are_no_number_are_a_name() -> None:
    assert with_options(PointProfile(), ["X=\u00b2"]).columns.X == "\u00b2"


@pytest.mark.parametrize("text", [
    "name,X_mm,Y_mm,Z_mm\nP#1,1,2,3\nP#2,4,5,6\n",
    "# all of it\n name,X_mm,Y_mm,Z_mm\n   # aside, 1, 2, 3\nP#1,1,2,3\n\n \t\nP#2,4,5,6\n",
    "name,X_mm,Y_mm,Z_mm\r\nP#1,1,2,3\r\n\r\nP#2,4,5,6\r\n",
    "name,X_mm,Y_mm,Z_mm\rP#1,1,2,3\rP#2,4,5,6\r",
])  # fmt: skip
def test_a_hash_in_a_name_is_no_comment(text: str) -> None:
    points = parse_points(text.encode(), "f.csv")
    assert points.names == ("P#1", "P#2")
    assert points.points_mm.tolist() == [[1, 2, 3], [4, 5, 6]]


def test_a_mark_behind_a_number_is_refused_with_its_line() -> None:
    with pytest.raises(InputError, match='column 3 is "3 # so"') as caught:
        parse_points(b"X_mm,Y_mm,Z_mm\n1,2,3\n1,2,3 # so\n", "f.csv")
    assert caught.value.line == 3


def test_a_layout_is_detected_from_the_head_of_a_long_file() -> None:
    row = b"1.000000, 2.000000,3.000000\n"
    assert layout_of(b"X;Y;Z\n" + b"1;2;3\n" * 50_000) == layout_of(b"X;Y;Z\n1;2;3\n")
    assert layout_of(b"\xef\xbb\xbfX_mm,Y_mm,Z_mm\n" + row) is not None
    assert layout_of(b"G21 G90\nG1 X1 Y2 Z3 F4\n") is None
