"""New words in a text: each number as its digits say, in its place; against plain strings."""

from __future__ import annotations

from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from olp.program.text.edits import BARE, EditList, Edits, Prefixes, number_text, render, splice

#: Mantissas at the borders of the tables: of four, eight and more digits.
BORDERS = (0, 1, 9, 10, 99, 100, 9_999, 10_000, 10_001, 99_999_999, 100_000_000, 123_456_789_012)


def plain(mantissa: int, decimals: int, leading_zero: bool) -> str:
    """The number by Python's decimals."""
    text = f"{Decimal(abs(mantissa)).scaleb(-decimals):.{decimals}f}"
    if not leading_zero and text.startswith("0."):
        text = text[1:]
    return ("-" if mantissa < 0 else "") + text


@pytest.mark.parametrize("leading_zero", (True, False))
@pytest.mark.parametrize("decimals", range(11))
def test_one_number_at_a_time(decimals: int, leading_zero: bool) -> None:
    for mantissa in (*BORDERS, *(-m for m in BORDERS)):
        expected = plain(mantissa, decimals, leading_zero)
        assert number_text(mantissa, decimals, leading_zero=leading_zero).decode() == expected
        edits = EditList(Prefixes())
        edits.add(0, 0, mantissa, decimals, b"")
        text, length = render(edits.done(), Prefixes(), leading_zero=leading_zero)
        assert (text.tobytes().decode(), length.tolist()) == (expected, [len(expected)])


@settings(max_examples=30)
@given(
    rows=st.lists(
        st.tuples(
            st.one_of(st.sampled_from(BORDERS), st.integers(-(10**11), 10**11), st.none()),
            st.integers(0, 10),
            st.sampled_from((b"", b" X", b"\nG1 Y", b" long comment ")),
            st.integers(0, 3),
            st.integers(0, 3),
        ),
        max_size=12,
    ),
    leading_zero=st.booleans(),
    offset=st.sampled_from((0, 1000)),
)
def test_many_edits_are_those_of_plain_strings(
    rows: list[tuple[int | None, int, bytes, int, int]], leading_zero: bool, offset: int
) -> None:
    """Each edit leaves some bytes alone and then replaces some."""
    source = bytes(range(97, 97 + 26)) * 5
    prefixes = Prefixes()
    edits = EditList(prefixes)
    expected, at = b"", 0
    for mantissa, decimals, prefix, kept, taken in rows:
        start, end = at + kept, at + kept + taken
        if mantissa is None:
            edits.add(start + offset, end + offset, BARE, 0, prefix)
        else:
            edits.add(start + offset, end + offset, mantissa, decimals, prefix)
        number = "" if mantissa is None else plain(mantissa, decimals, leading_zero)
        expected += source[at:start] + prefix + number.encode()
        at = end
    expected += source[at:]
    text = splice(np.frombuffer(source, np.uint8), offset, edits.done(), prefixes, leading_zero=leading_zero)
    assert text.tobytes() == expected


def test_insertions_come_before_what_is_replaced_there_and_in_their_order() -> None:
    prefixes = Prefixes()
    first, second = EditList(prefixes), EditList(prefixes)
    first.add(1, 2, BARE, 0, b"R")
    first.add(1, 1, BARE, 0, b"2", order=2)
    second.add(1, 1, BARE, 0, b"1", order=1)
    second.add(0, 0, 7, 0, b"N")
    edits = Edits.join([first.done(), second.done()])
    text = splice(np.frombuffer(b"abc", np.uint8), 0, edits, prefixes, leading_zero=True)
    assert text.tobytes() == b"N7a12Rc"
