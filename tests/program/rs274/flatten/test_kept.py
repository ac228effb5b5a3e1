"""Lines of a program that keeps its flow: from what each visit needs to one text; worked by hand."""

from __future__ import annotations

from collections import Counter

import pytest

from olp.core.errors import ProgramError
from olp.program.registry import DIALECTS
from olp.program.rs274.flatten.kept import _merged, _of_visits

PROFILE = DIALECTS["linuxcnc"]


def kept(source: bytes, *visits: tuple[bytes, bytes]) -> bytes:
    return _of_visits(source, Counter(visits), PROFILE)  # type: ignore[arg-type]


def refused(source: bytes, *visits: tuple[bytes, bytes]) -> str:
    with pytest.raises(ProgramError) as caught:
        kept(source, *visits)
    return caught.value.message


def test_numbers_one_digit_apart_are_those_of_most_visits() -> None:
    assert _merged(Counter({b"G1 X1.000": 1, b"G1 X1.001": 2})) == b"G1 X1.001"
    assert _merged(Counter({b"G1 X1.0 Y2": 3, b"G1 X0.9 Y1": 1})) == b"G1 X1.0 Y2"
    for other in (b"G1 X1.002", b"G1 X0.998"):
        with pytest.raises(ProgramError, match="its passes need X"):
            _merged(Counter({b"G1 X1.000": 2, other: 1}))


def test_visits_that_differ_in_more_than_lengths_are_refused() -> None:
    for other in (b"G1 X1.000 (b)", b"G0 X1.000 (a)", b"G1 X1.000 F5 (a)"):
        with pytest.raises(ProgramError, match="need other words"):
            _merged(Counter({b"G1 X1.000 (a)": 2, other: 1}))
    with pytest.raises(ProgramError, match="need other words"):
        _merged(Counter({b"G1 X1.000\nX2.000": 1, b"G1 X2.000": 1}))
    # a word that holds the position is taken, and so is the number of the block
    assert _merged(Counter({b"G1 X1.000": 2, b"N7 G1 X1.000 Y3.0": 1})) == b"N7 G1 X1.000 Y3.0"


def test_an_expression_stays_and_the_number_of_its_block_is_not_repeated() -> None:
    first, later = (b"N10 G1 X5 Y4", b"N10 G1 X5 Y3.9"), (b"G1 X5 Y4", b"G1 X5 Y3.9")
    for visits in ((first,), (later,), (first, later)):
        number = b"N10 " if first in visits else b""
        assert kept(b"N10 G1 X[2+3] Y4\r\n", *visits) == number + b"G1 X[2+3] Y3.9\r\n"


def test_an_expression_whose_number_changes_or_is_there_twice_is_refused() -> None:
    assert "an expression gives its X" in refused(b"G1 X[2+3] Y4\n", (b"G1 X5 Y4", b"G1 X4.9 Y4"))
    twice = b"G1 X5 Y3.9\nX5 Y4"
    assert "an expression gives its X" in refused(b"G1 X[2+3] Y4\n", (b"G1 X5 Y4", twice))
    assert kept(b"G1 X[2+3] Y4\n", (b"G1 X5 Y4", b"G1 X4 Y3.9\nX5 Y4")) == b"G1 X4 Y3.9\nX[2+3] Y4\n"
