"""Lines of an unrolled text: which line, of which file, each one was made from."""

from __future__ import annotations

import numpy as np
import pytest

from olp.core.errors import InputError, ProgramError
from olp.program.origin import Files, Origin, Unrolled, in_original, origin_of, original_of, quoted

#: A program of three lines and two files of subprograms, of two lines each.
ORIGIN = Origin(
    ("sub/a.ngc", 'b "1".ngc'), np.array([3, 5]), (b"A\r\n", b"B\n", b"C\n", b"D\n", b"E\n", b"F\n", b"G"),
    np.array([1, 4, 5, 6, 7, 3]),
)  # fmt: skip
ALONE = Origin((), np.zeros(0, np.int64), (b"A\n", b"\xe9"), np.array([2, 2, 1]))
TEXT = Unrolled.of(b"1\n2\n3\n4\n5\n6\n", ORIGIN)


def test_lines_of_the_program_itself() -> None:
    assert (ORIGIN.lines, ALONE.lines) == (3, 2)


def test_each_line_was_made_from_one() -> None:
    assert ORIGIN.lines_of(range(8)).tolist() == [0, 1, 4, 5, 6, 7, 3, 3]
    assert ORIGIN.lines_of([[2], [0]]).tolist() == [[4], [0]]
    assert [ORIGIN.line_of(line) for line in (0, 1, 2, 6, 9)] == [0, 1, 4, 3, 3]
    assert ALONE.lines_of([1, 2, 3]).tolist() == [2, 2, 1]
    empty = Origin((), np.zeros(0, np.int64), (), np.zeros(0, np.int64))
    assert empty.lines_of([0, 5]).tolist() == [0, 5]


def test_lines_of_a_text_that_was_made_through_another_one() -> None:
    """The program between has six lines of its own, of which two were made from the first file."""
    inner = Origin(
        ("sub/a.ngc", 'b "1".ngc'), np.array([6, 8]), tuple(b"%d\n" % i for i in range(10)),
        np.array([1, 2, 4, 6, 7, 8, 9, 10, 2]),
    )  # fmt: skip
    whole = inner.through(ORIGIN)
    # lines 1, 2, 4 and 6 as ORIGIN has them, then both lines of each file
    assert whole.line.tolist() == [1, 4, 6, 3, 4, 5, 6, 7, 4]
    assert (whole.files, whole.texts) == (ORIGIN.files, ORIGIN.texts)
    assert whole.first.tolist() == [3, 5]
    assert [whole.place(line) for line in whole.line[[3, 5, 7]].tolist()] == [
        "3", "2 of a.ngc", '2 of b "1".ngc'
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("line", "file", "number", "place", "text"),
    [
        (1, None, 1, "1", "A"), (3, None, 3, "3", "C"), (4, "sub/a.ngc", 1, "1 of a.ngc", "D"),
        (5, "sub/a.ngc", 2, "2 of a.ngc", "E"), (6, 'b "1".ngc', 1, '1 of b "1".ngc', "F"),
        (7, 'b "1".ngc', 2, '2 of b "1".ngc', "G"),
    ],
)  # fmt: skip
def test_a_line_has_a_file_and_a_number_in_it(
    line: int, file: str | None, number: int, place: str, text: str
) -> None:
    assert ORIGIN.file_of(line) == (file, number)
    assert ORIGIN.place(line) == place
    assert ORIGIN.text(line) == text
    cells = {None: f"{number},", "sub/a.ngc": f"{number},a.ngc", 'b "1".ngc': f'{number},"b ""1"".ngc"'}
    assert Files(ORIGIN).cells(line) == cells[file]


def test_lines_without_files() -> None:
    assert (ALONE.file_of(2), ALONE.place(2), ALONE.text(2)) == ((None, 2), "2", "é")
    for origin in (None, ALONE):
        assert (Files(origin).head, Files(origin).cells(12)) == ("", "12")
    assert Files(ORIGIN).head == ",file"


def test_the_files_are_counted_through() -> None:
    assert list(ORIGIN.counted()) == [
        {"name": "a.ngc", "lines_from": 4}, {"name": 'b "1".ngc', "lines_from": 6}
    ]  # fmt: skip
    assert list(ALONE.counted()) == []


@pytest.mark.parametrize(
    ("cell", "expected"),
    [("a b", "a b"), ("a,b", '"a,b"'), ('a"b', '"a""b"'), ("a\nb", '"a\nb"'), ("a\rb", '"a\rb"'), ("", ""),
     ("a;b", "a;b")],
)  # fmt: skip
def test_cells_of_a_table(cell: str, expected: str) -> None:
    assert quoted(cell) == expected


def test_a_text_knows_its_original() -> None:
    assert origin_of(TEXT) is ORIGIN
    assert original_of(TEXT) == b"A\r\nB\nC\n"
    assert (origin_of(b"x"), original_of(b"x")) == (None, b"x")


def test_errors_get_the_line_of_the_original() -> None:
    others = (
        ProgramError("b", line=3),
        ProgramError("c", line=1),
        ProgramError("d"),
        ProgramError("e", line=2, file="x"),
    )
    with pytest.raises(ProgramError) as caught, in_original(TEXT):
        raise ProgramError("a", line=4, others=others)
    rows = [(each.file, each.line) for each in (caught.value, *caught.value.others)]
    assert rows == [('b "1".ngc', 1), ("sub/a.ngc", 2), (None, 1), (None, None), ("x", 2)]
    with pytest.raises(InputError) as other, ORIGIN.errors():
        raise InputError("a", line=6)
    assert (other.value.file, other.value.line) == (None, 3)
    with pytest.raises(ProgramError) as plain, in_original(b"x"):
        raise ProgramError("a", line=4)
    assert plain.value.line == 4
