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


@pytest.mark.parametrize("leading_zero", (True, False))
@pytest.mark.parametrize(
    ("mantissas", "decimals"),
    [
        ((0, 9_999, -9_999, 123), (0, 4)), ((0, 10_000, -10_001, 99_999_999), (0, 1)),
        ((7, -12_345_678, 99_999_999), (5, 8)),
        ((99_999_999, 100_000_000, -1), (0, 8)), ((123_456_789, 5, -5), (9, 0)),
        ((10**16 - 1, 10**8, 1), (8, 3)),
        ((10**18 - 1, -(10**17), 0), (18, 10)),
    ],
)  # fmt: skip
def test_numbers_of_one_and_of_several_decimals(
    mantissas: tuple[int, ...], decimals: tuple[int, int], leading_zero: bool
) -> None:
    for first, second in (decimals, decimals[::-1], decimals[:1] * 2, decimals[1:] * 2):
        prefixes = Prefixes()
        edits = EditList(prefixes)
        expected = b""
        for place, mantissa in enumerate(mantissas):
            count = second if place % 2 else first
            prefix = (b"", b" X", b"\nG1 Y", b" X")[place]
            edits.add(place, place + 1, mantissa, count, prefix)
            edits.add(place + 1, place + 1, BARE, 0, b"R")
            expected += prefix + plain(mantissa, count, leading_zero).encode() + b"R"
        source = np.frombuffer(b"abcdefgh", np.uint8)[: len(mantissas)]
        text = splice(source, 0, edits.done(), prefixes, leading_zero=leading_zero)
        assert text.tobytes() == expected
        run, length = render(edits.done(), prefixes, leading_zero=leading_zero)
        assert (run.tobytes(), int(length.sum())) == (expected, len(expected))
        assert prefixes.table[:2] == [b"", b"R"] and len(set(prefixes.table)) == len(prefixes.table)


def test_a_text_without_edits_is_itself() -> None:
    source = np.frombuffer(b"abc", np.uint8)
    edits = EditList(Prefixes())
    assert len(edits.done()) == 0
    assert splice(source, 5, edits.done(), Prefixes(), leading_zero=True) is source
    edits.add(6, 7, 12, 1)
    done = edits.done()
    assert len(done) == 1
    assert [column.tolist() for column in (done.start, done.end, done.mantissa, done.decimals, done.prefix,
      done.order)] == [
        [6], [7], [12], [1], [0], [0]
    ]  # fmt: skip
    assert (done.decimals.dtype, done.prefix.dtype, done.order.dtype) == (np.int8, np.int32, np.int32)
    assert splice(source, 5, done, Prefixes(), leading_zero=True).tobytes() == b"a1.2c"


def test_edits_are_joined_in_the_order_of_the_text() -> None:
    prefixes = Prefixes()
    lists = [EditList(prefixes) for _ in range(3)]
    lists[0].add(9, 9, 3, 0, b"c", order=1)
    lists[1].add(2, 5, 1, 1, b"a")
    lists[2].add(9, 12, 4, 0, b"d")
    lists[0].add(9, 9, 2, 0, b"b")
    joined = Edits.join([each.done() for each in lists])
    assert joined.mantissa.tolist() == [1, 2, 3, 4]
    assert joined.start.tolist() == [2, 9, 9, 9]
    assert [prefixes.table[i] for i in joined.prefix.tolist()] == [b"a", b"b", b"c", b"d"]
    assert joined.order.tolist() == [0, 0, 1, 0]


@pytest.mark.parametrize(
    ("mantissa", "decimals", "text"),
    [(0, 0, "0"), (0, 3, "0.000"), (-5, 1, "-0.5"), (12345, 2, "123.45"), (-12, 0, "-12"),
     (7, 20, "0.00000000000000000007")],
)  # fmt: skip
def test_one_number_as_text(mantissa: int, decimals: int, text: str) -> None:
    assert number_text(mantissa, decimals).decode() == text
    assert number_text(mantissa, decimals, leading_zero=True).decode() == text
    assert number_text(mantissa, decimals, leading_zero=False).decode() == text.replace("0.", ".", 1)
