"""Commands to words of one axis, by hand: which digits are written, and which omitted words come in."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest

from olp.compensation.digits import AxisRows, absolute, incremental
from olp.compensation.style import fewest_decimals

NAN = math.nan


def rows(
    command: Sequence[float],
    words: Sequence[str | None],
    *,
    raw: Sequence[int] = (),
    reset: Sequence[int] = (),
    nominal: Sequence[float] | None = None,
    offset: float = 0.0,
    unit: float = 1.0,
) -> AxisRows:
    count = len(command)
    texts = [word or "" for word in words]

    def mask(which: Sequence[int]) -> np.ndarray:
        return np.isin(np.arange(count), list(which))

    return AxisRows(
        command=np.array(command, float),
        nominal=np.array(command if nominal is None else nominal, float),
        given=np.array([word is not None for word in words]),
        raw=mask(raw),
        reset=mask(reset),
        word=np.array([int(text.replace(".", "") or 0) for text in texts]),
        decimals=np.array([len(text.partition(".")[2]) for text in texts], np.int8),
        offset=offset,
        unit=unit,
    )


def written(digits: object) -> list[str | None]:
    """The new words, None where nothing is written."""
    d = digits
    assert hasattr(d, "write") and hasattr(d, "mantissa") and hasattr(d, "decimals")
    return [
        f"{m / 10.0**k:.{k}f}" if w else None
        for w, m, k in zip(d.write.tolist(), d.mantissa.tolist(), d.decimals.tolist(), strict=True)
    ]


def test_a_word_keeps_its_digits_unless_it_has_too_few() -> None:
    got = absolute(rows([1.23456] * 3, ["1.0", "1.2000", "1.234"]), 0.0, 2, 3)
    assert written(got) == ["1.23", "1.2346", "1.235"]
    assert got.emitted == pytest.approx([1.23, 1.2346, 1.235])


def test_a_word_that_says_it_already_is_left_alone() -> None:
    got = absolute(rows([1.2, 1.2004, 1.2006], ["1.2", "1.200", "1.200"]), 0.0, 3, 3)
    assert written(got) == [None, None, "1.201"]
    assert got.decimals.tolist() == [3, 3, 3]


def test_an_omitted_axis_holds_until_it_is_off_by_more_than_half_a_digit() -> None:
    got = absolute(rows([1.0004, 1.0005, 1.0006, 1.0006], ["1.000", None, None, None]), 0.0, 3, 3)
    assert written(got) == [None, None, "1.001", None]
    assert got.emitted == pytest.approx([1.0, 1.0, 1.001, 1.001])


def test_before_the_first_word_the_position_on_entry_holds() -> None:
    got = absolute(rows([5.0004, 5.001], [None, None]), 5.0, 3, 3)
    assert written(got) == [None, "5.001"]
    assert got.emitted == pytest.approx([5.0, 5.001])


def test_an_inserted_word_goes_back_where_the_command_does() -> None:
    got = absolute(rows([0.002, 0.0, 0.0], [None, None, None]), 0.0, 3, 3)
    assert written(got) == ["0.002", "0.000", None]


def test_an_unknown_command_writes_nothing() -> None:
    got = absolute(rows([NAN, 1.0, NAN], [None, "1.0", None]), NAN, 1, 1)
    assert written(got) == [None, None, None]
    assert math.isnan(got.emitted[0])
    assert got.emitted[1:].tolist() == [1.0, 1.0]


def test_raw_words_and_resets_are_taken_as_they_are() -> None:
    got = absolute(
        rows([9.0, 2.001, 2.001], ["2.0", None, None], raw=[0], nominal=[2.0, 2.0, 2.0]), 0.0, 3, 3
    )
    assert written(got) == [None, "2.001", None]
    got = absolute(rows([9.0, 7.5, 7.5], [None, None, None], reset=[0], nominal=[7.5] * 3), 0.0, 3, 3)
    assert written(got) == [None, None, None]
    assert got.emitted.tolist() == [7.5] * 3


def test_offset_and_unit_lead_from_words_to_positions() -> None:
    """Axis 126.4 mm is 1.0394 inch past an offset of 100 mm, to four digits."""
    got = absolute(rows([126.4], ["1.0"], offset=100.0, unit=25.4), 0.0, 4, 4)
    assert written(got) == ["1.0394"]
    assert got.emitted == pytest.approx([100.0 + 1.0394 * 25.4])


def test_half_a_digit_is_that_of_the_unit() -> None:
    """Half of 0.001 inch is 0.0127 mm."""
    for size, word in ((0.0126, None), (0.0128, "0.001")):
        assert written(absolute(rows([size], [None], unit=25.4), 0.0, 3, 3)) == [word]


def test_steps_in_g91_do_not_drift() -> None:
    """Thirds of a millimetre: the sum of the words is the position to half a digit throughout."""
    got = incremental(rows([1 / 3, 2 / 3, 1.0, 4 / 3], ["0.3", "0.3", None, "0.333"]), 0.0, 3)
    assert written(got) == ["0.333", "0.334", "0.333", None]
    assert got.emitted == pytest.approx([0.333, 0.667, 1.0, 1.333])


def test_steps_count_from_the_position_on_entry() -> None:
    got = incremental(rows([10.5, 10.5, 10.25], ["0.5", None, None]), 10.0, 2)
    assert written(got) == [None, None, "-0.25"]
    assert got.emitted.tolist() == [10.5, 10.5, 10.25]


def test_steps_in_inches() -> None:
    got = incremental(rows([25.4, 12.7], ["1.0", "-0.4"], unit=25.4), 0.0, 2)
    assert written(got) == [None, "-0.50"]
    assert got.emitted == pytest.approx([25.4, 12.7])


def test_a_raw_step_keeps_its_word_and_the_next_counts_from_its_end() -> None:
    got = incremental(rows([9.0, 3.25, 3.5], ["2.0", "1.0", None], raw=[0]), 1.0, 2)
    assert written(got) == [None, "0.25", "0.25"]
    assert got.emitted.tolist() == [3.0, 3.25, 3.5]


def test_a_raw_step_between_two_others() -> None:
    got = incremental(rows([1.5, 9.0, 5.0, 5.25], ["1.5", "2.0", "1.25", None], raw=[1]), 0.0, 2)
    assert written(got) == [None, None, "1.50", "0.25"]
    assert got.emitted.tolist() == [1.5, 3.5, 5.0, 5.25]


@pytest.mark.parametrize(("step", "word"), [("1.500000000005", None), ("1.5000000002", "1.50")])
def test_a_step_of_many_digits_is_left_alone_where_it_says_the_same(step: str, word: str | None) -> None:
    """Also between raw ones, and where the position behind it is rounded."""
    got = incremental(rows([9.0, 3.5, 5.0], ["2.0", "1.5", step], raw=[0]), 0.0, 2)
    assert written(got) == [None, None, word]
    got = incremental(rows([1.5], [step]), 0.0, 2)
    assert written(got) == [word]
    got = incremental(rows([1.004, 2.504], ["1.004", step]), 0.0, 2)
    assert written(got) == [None, word]


def test_a_reset_step_starts_again_where_the_machine_has_it() -> None:
    command, words = [NAN, 4.5, 5.0], [None, "0.5", "0.5"]
    got = incremental(rows(command, words, reset=[0], nominal=[4.0, 4.5, 5.0]), NAN, 1)
    assert written(got) == [None, None, None]
    assert got.emitted.tolist() == [4.0, 4.5, 5.0]


def test_an_unknown_step_stays_unknown() -> None:
    got = incremental(rows([NAN, 3.0], ["1.0", "1.0"]), NAN, 1)
    assert written(got) == [None, None]
    assert np.isnan(got.emitted).all()


@pytest.mark.parametrize(
    ("increment_mm", "unit_mm", "decimals"),
    [
        (0.001, 1.0, 3), (0.0001, 1.0, 4), (0.005, 1.0, 3), (1.0, 1.0, 0), (10.0, 1.0, 0),
        (0.001, 25.4, 4), (0.0001, 25.4, 5), (0.001, 1000.0, 6), (0.001, 10.0, 4), (0.01, 0.001, 0),
    ],
)  # fmt: skip
def test_digits_that_a_least_increment_needs(increment_mm: float, unit_mm: float, decimals: int) -> None:
    """A control in inches takes one digit more; in other units the increment is converted."""
    assert fewest_decimals(increment_mm, unit_mm, 4) == decimals
