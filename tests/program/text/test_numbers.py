"""Numbers in a text: what is one, and how another value looks in its form."""

from __future__ import annotations

import numpy as np
import pytest

from olp.program.text.numbers import Placing, number, spliced, written


@pytest.mark.parametrize(
    ("text", "value", "digit"),
    [
        (b"12.50", 12.5, 0.01), (b"-3", -3.0, 1.0), (b"+.5", 0.5, 0.1), (b"7.", 7.0, 1.0),
        (b"1.5e3", 1500.0, 100.0), (b"1.5D-2", 0.015, 0.001), (b"2E+1", 20.0, 10.0),
        (b"99999999.9", 99999999.9, 0.1), (b"1e-99", 1e-99, 1e-99), (b"1e-9", 1e-9, 1e-9),
    ],
)  # fmt: skip
def test_a_number_has_a_value_and_a_last_digit(text: bytes, value: float, digit: float) -> None:
    got = number(text)
    assert got is not None
    assert (got.value, got.digit) == (value, pytest.approx(digit))


@pytest.mark.parametrize(
    "text",
    [b"", b".", b"-", b"1.2.3", b"1,5", b"x1", b"1x", b"1e", b"e5", b" 1", b"100000000", b"-100000000.0",
     b"1e100", b"1e-100", b"0.1e+9", b"0" * 41, b"nan", b"inf", b"--1"],
)  # fmt: skip
def test_what_is_no_number_of_a_position(text: bytes) -> None:
    assert number(text) is None


def test_forty_characters_are_a_number_still() -> None:
    assert number(b"0" * 39 + b"1") is not None


def test_the_decimal_mark_is_the_one_that_is_stated() -> None:
    comma = number(b"1,25", b",")
    assert comma is not None and comma.value == 1.25
    assert number(b"1.25", b",") is None
    whole = number(b"125", b",")
    assert whole is not None and whole.value == 125.0


@pytest.mark.parametrize(("text", "places"), [(b"1.25", 2), (b"3", 0), (b"1.5e-3", 4), (b"2e2", -2)])
def test_places_count_from_the_point_without_the_exponent(text: bytes, places: int) -> None:
    got = number(text)
    assert got is not None and got.places == places


@pytest.mark.parametrize(
    ("form", "value", "expected"),
    [
        # digits and sign
        ("1.00", 2.5, "2.50"), ("1.00", -2.5, "-2.50"), ("+1.00", 2.5, "+2.50"), ("+1.00", -2.5, "-2.50"),
        ("-1.00", 2.5, "2.50"), ("1.00", 2.006, "2.01"), ("1.00", -0.001, "0.00"), ("+1.0", -0.01, "+0.0"),
        # without a point, and with one alone
        ("5", 7.4, "7"), ("5.", 7.4, "7."), ("12", 3.0, "3"), ("12", 0.0, "0"),
        # nothing before the point
        (".5", 0.25, ".2"), (".5", 1.25, "1.2"), ("-.50", -0.25, "-.25"), ("+.50", 0.75, "+.75"),
        # zeros before the first digit
        ("007", 8.0, "008"), ("007.5", -8.25, "-008.2"), ("007", 1234.0, "1234"), ("10.0", 2.0, "2.0"),
        ("00", 3.0, "03"), ("0.5", 12.0, "12.0"), ("01.0", 2.0, "02.0"),
        # exponents
        ("1.5e3", 2500.0, "2.5e3"), ("1.5E+03", 2500.0, "2.5E+03"), ("1.5D-02", 0.25, "2.5D-01"),
        ("1.5e-2", 25.0, "2.5e1"), ("-1.50e+2", 1.0, "1.00e+0"), ("1.5e3", -0.0, "0.0e0"),
    ],
)  # fmt: skip
def test_a_value_is_written_in_the_form_of_a_number(form: str, value: float, expected: str) -> None:
    like = number(form.encode())
    assert like is not None
    assert written(like, value).decode() == expected


@pytest.mark.parametrize(
    ("form", "decimals", "decimal", "expected"),
    [("1.0", 3, b".", "2.345"), ("1.0000", 3, b".", "2.3451"), ("1", 2, b".", "2.35"), ("1", 2, b",", "2,35"),
     ("1", 0, b",", "2"), ("1.0", 2, b",", "2.35"), ("1.0", None, b".", "2.3")],
)  # fmt: skip
def test_more_decimals_than_the_form_has(
    form: str, decimals: int | None, decimal: bytes, expected: str
) -> None:
    like = number(form.encode())
    assert like is not None
    assert written(like, 2.3451, decimals, decimal).decode() == expected


def test_comma_forms_stay_comma_forms() -> None:
    like = number(b"1,50", b",")
    assert like is not None
    assert written(like, 2.25, decimal=b",") == b"2,25"


@pytest.mark.parametrize("text", ["12.5", "-0.250", "+7.", ".125", "007.5", "1.5e3", "2.50E-02", "0", "00.5"])
def test_a_number_in_its_own_form_is_itself(text: str) -> None:
    like = number(text.encode())
    assert like is not None
    assert written(like, like.value).decode() == text


# -- where the new number goes ------------------------------------------------------------------------


def placed(line: bytes, old: bytes, new: bytes, *others: bytes) -> bytes:
    """The line with one of its numbers replaced; `old` and `others` are all its numbers."""
    spans = [(line.index(text), line.index(text) + len(text)) for text in (old, *others)]
    start, end = zip(*spans, strict=True)
    placing = Placing(line, np.array(start), np.array(end))
    return spliced(line, placing.placed([(*spans[0], new)]))


@pytest.mark.parametrize(
    ("line", "old", "new", "expected"),
    [
        # one blank: nothing is padded
        (b"X 1.5 Y", b"1.5", b"12.5", b"X 12.5 Y"), (b"X 1.5 Y", b"1.5", b"1", b"X 1 Y"),
        # two blanks before a number: its right edge stays, and one blank remains
        (b"X   1.5 Y", b"1.5", b"12.5", b"X  12.5 Y"), (b"X   1.5 Y", b"1.5", b"112.5", b"X 112.5 Y"),
        (b"X   1.5 Y", b"1.5", b"1112.5", b"X 1112.5 Y"), (b"X   1.5 Y", b"1.5", b"1", b"X     1 Y"),
        (b"X\t 1.5", b"1.5", b"12.5", b"X\t12.5"), (b"  1.5", b"1.5", b"12.5", b" 12.5"),
        # two blanks behind: its left edge stays
        (b"X 1.5   Y", b"1.5", b"12.5", b"X 12.5  Y"), (b"X 1.5   Y", b"1.5", b"1112.5", b"X 1112.5 Y"),
        (b"X 1.5   Y", b"1.5", b"1", b"X 1     Y"),
    ],
)  # fmt: skip
def test_columns_keep_their_edges(line: bytes, old: bytes, new: bytes, expected: bytes) -> None:
    assert placed(line, old, new) == expected


def test_edits_are_made_in_the_order_of_the_text() -> None:
    edits = [(4, 5, b"E"), (0, 1, b"A"), (2, 2, b"x"), (2, 2, b"y")]
    assert spliced(b"abcdef", edits) == b"AbxycdEf"
    assert spliced(b"abc", []) == b"abc"


@pytest.mark.parametrize(
    ("line", "old", "new", "others", "expected"),
    [
        # a tab is a blank, before and behind
        (b"X \t1.5 Y", b"1.5", b"12.5", (), b"X 12.5 Y"), (b"X\t\t1.5", b"1.5", b"1", (), b"X\t\t  1"),
        (b"X 1.5\t\tY", b"1.5", b"12.5", (), b"X 12.5\t\tY"),
        # one padded number makes the text padded, also for the others
        (b"X 1.5   2.5", b"1.5", b"12.5", (b"2.5",), b"X 12.5   2.5"),
        (b"X 1.5   2.5", b"1.5", b"1", (b"2.5",), b"X   1   2.5"),
        (b"X 2.5  1.5  Y", b"1.5", b"12.5", (b"2.5",), b"X 2.5 12.5  Y"),
        # a left edge: the blanks behind are taken, but for the last one, at the end of a text all of them
        (b"1.5  2.5 Y", b"1.5", b"1.25", (), b"1.25 2.5 Y"), (b"1.5  2", b"1.5", b"1.2345", (), b"1.2345 2"),
        (b"X 1.5  ", b"1.5", b"12.50", (), b"X 12.50"), (b"X 1.5   ", b"1.5", b"12.5", (), b"X 12.5  "),
        (b"1.5  Y2.5 ", b"2.5", b"2", (b"1.5",), b"1.5  Y2   "),
        (b"1.5  Y2.5;", b"2.5", b"2", (b"1.5",), b"1.5  Y2;"),
        (b"1.5  Y2.5\t;", b"2.5", b"2", (b"1.5",), b"1.5  Y2  \t;"),
        (b"1.5  Y2.5;", b"2.5", b"2.25", (b"1.5",), b"1.5  Y2.25;"),
        # the same width, and a number at the start of the text
        (b"X   1.5", b"1.5", b"2.5", (), b"X   2.5"),
        (b"1.5   2.5", b"1.5", b"12.5", (b"2.5",), b"12.5   2.5"),
        (b"  1.5", b"1.5", b"112.5", (), b" 112.5"), (b"1.5", b"1.5", b"12.5", (), b"12.5"),
    ],
)  # fmt: skip
def test_edges_of_columns(
    line: bytes, old: bytes, new: bytes, others: tuple[bytes, ...], expected: bytes
) -> None:
    assert placed(line, old, new, *others) == expected


def test_a_number_holds_its_form() -> None:
    form = number(b"+007.50E-02")
    assert form is not None
    assert (form.plus, form.whole, form.bare, form.mark, form.decimals) == (True, 3, False, b".", 2)
    assert (form.letter, form.exponent_digits, form.exponent_plus, form.places) == (b"E", 2, False, 4)
    plain = number(b".5e+3")
    assert plain is not None
    assert (plain.plus, plain.whole, plain.bare, plain.letter) == (False, 0, True, b"e")
    assert (plain.exponent_digits, plain.exponent_plus, plain.places) == (1, True, -2)
    whole = number(b"-12")
    assert whole is not None
    assert (whole.plus, whole.whole, whole.bare, whole.mark, whole.decimals, whole.letter) == (
        False,
        2,
        False,
        b"",
        0,
        b"",
    )
    assert (whole.exponent_digits, whole.exponent_plus) == (0, False)
