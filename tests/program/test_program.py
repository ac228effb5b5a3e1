"""A program as a value: lines of the text and of its original, words of a line, line ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from program.test_frames import setup_of

from olp.core.errors import ProgramError
from olp.program.origin import Origin, Unrolled
from olp.program.program import Program
from olp.program.registry import named, read

#: Four lines of the program and two of a file, from which six lines were made.
ORIGIN = Origin(
    ("/a/sub.nc",), np.array([4]), (b"O1\r\n", b"G21\n", b"M98 P7\n", b"M2", b"(SUB)\n", b"X5 \xe4\n"),
    np.array([2, 6, 5, 6, 3, 4]),
)  # fmt: skip
TEXT = b"G21 G90 G54 G61\nG81 G98 X1 Y1 Z-1 R1 F60\nG80\nG1 X5\n\nM2\n"


def parsed(text: bytes = TEXT) -> Program:
    setup = setup_of()
    return read(text, replace(setup, job=replace(setup.job, start_mm=(0.0, 0.0, 5.0))), named("linuxcnc"))


def test_lines_of_an_unrolled_text_are_those_of_its_original() -> None:
    program = parsed(Unrolled.of(TEXT, ORIGIN))
    told = program.in_original()
    assert (program.by_original, told.by_original) == (False, True)
    assert (program.lines, told.lines) == (6, 4)
    assert program.toolpath.line.tolist() == [2, 2, 2, 2, 4]
    assert told.toolpath.line.tolist() == [6, 6, 6, 6, 6]
    assert told.toolpath.line.dtype == np.int32
    assert ([m.line for m in program.path_modes], [m.line for m in told.path_modes]) == ([1], [2])
    assert ([h.line for h in program.holes], [h.line for h in told.holes]) == ([2], [6])
    assert program.original_lines([1, 3, 0]).tolist() == [2, 5, 0]
    assert (program.text(1), told.text(6), told.text(1)) == ("G21 G90 G54 G61", "X5 \xe4", "O1")
    assert (program.place(6), told.place(6), told.place(4)) == ("6", "2 of sub.nc", "4")
    assert told.in_original() is told


def test_remarks_are_those_of_the_original_too() -> None:
    origin = Origin((), np.zeros(0, np.int64), (b"a\n", b"b\n", b"c\n"), np.array([3, 2]))
    program = parsed(Unrolled.of(b"G0 X1 Y1 Z1\nG0 X2\n", origin))
    assert [line for _, line, _ in program.remarks] == [1]
    told = program.in_original()
    assert [(name, line) for name, line, _ in told.remarks] == [(program.remarks[0][0], 3)]
    assert told.remarks[0][2] == program.remarks[0][2]
    assert told.lines == 3


def test_a_text_that_was_not_unrolled_is_its_own_original() -> None:
    program = parsed()
    assert program.in_original() is program
    assert program.origin is None
    assert program.original_lines([1, 5]).tolist() == [1, 5]
    assert (program.lines, program.place(3), program.text(3)) == (6, "3", "G80")


def test_errors_have_the_line_of_the_original() -> None:
    for data, line, file in ((Unrolled.of(TEXT, ORIGIN), 2, "/a/sub.nc"), (TEXT, 4, None)):
        with pytest.raises(ProgramError) as caught, parsed(data).errors():
            raise ProgramError("wrong", line=4)
        assert (caught.value.line, caught.value.file) == (line, file)


def test_words_of_a_line() -> None:
    words = parsed().words
    assert words is not None
    assert [list(words.of_line(n)) for n in (1, 2, 3, 5, 6)] == [
        [0, 1, 2, 3], [4, 5, 6, 7, 8, 9, 10], [11], [], [14]
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "ends"),
    [
        (b"G21\nG0 X1\r\nX2\n", [b"\n", b"\r\n", b"\n"]), (b"G21\r\nG0 X1", [b"\r\n", b"\r\n"]), (b"G0 X1",
         [b"\n"]),
    ],
)  # fmt: skip
def test_line_ends_that_a_block_takes(text: bytes, ends: list[bytes]) -> None:
    program = parsed(text)
    assert [program.eol(n + 1) for n in range(len(ends))] == ends


def test_which_numbers_keep_their_form() -> None:
    assert not parsed().verbatim
    listed = read(b"X_mm,Y_mm,Z_mm\n1,2,3\n", setup_of(), named("list"))
    assert listed.verbatim
    assert not read(b"GOTO/1,2,3\n", setup_of(), named("apt")).verbatim
    assert parsed().rs274 is named("linuxcnc")
