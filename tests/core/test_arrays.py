"""What stands in for NumPy's functions of sets gives the same; NumPy itself is the judge."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from olp.core.arrays import (
    all_in_row,
    any_in_row,
    distinct,
    distinct_rows,
    is_in,
    median,
    most_in_row,
)

finite = st.one_of(st.sampled_from([0.0, -0.0, 1.0]), st.floats(-1e6, 1e6))
numbers = arrays.arrays(np.float64, st.integers(1, 40), elements=finite)
whole = arrays.arrays(st.sampled_from([np.int32, np.int64, np.uint8]), arrays.array_shapes(max_dims=2))
rows = arrays.arrays(np.float64, st.tuples(st.integers(0, 20), st.just(3)), elements=finite)


@given(st.one_of(numbers, whole))
def test_distinct_values_are_those_of_numpy(values: npt.NDArray[np.generic]) -> None:
    ours, judged = distinct(values), np.unique(values)
    assert ours.dtype == judged.dtype
    assert np.array_equal(ours, judged)


def test_nothing_has_no_distinct_values() -> None:
    assert distinct(np.zeros(0, np.int64)).shape == (0,)


@pytest.mark.parametrize("shape", [(5,), (2, 3), ()])
def test_one_number_that_stands_for_all_is_the_distinct_one(shape: tuple[int, ...]) -> None:
    found = distinct(np.broadcast_to(np.int32(7), shape))
    assert found.tolist() == [7]
    assert found.dtype == np.int32


@given(whole, arrays.arrays(np.int64, st.integers(0, 30), elements=st.integers(-3, 300)))
def test_membership_is_that_of_numpy(values: npt.NDArray[np.int64], some: npt.NDArray[np.int64]) -> None:
    judged = np.isin(values, some)
    for given_as in (some, some.tolist(), set(some.tolist())):
        assert np.array_equal(is_in(values, given_as), judged)


@pytest.mark.parametrize("kind", (np.uint8, np.int16, np.int32, np.float32, np.float64))
@pytest.mark.parametrize("highest", (250, 10**6))
def test_membership_is_that_of_numpy_in_many_values_of_any_kind(kind: type, highest: int) -> None:
    rng = np.random.default_rng(3)
    values = rng.integers(0, 200, 6000).astype(kind)
    for count in (1, 12, 40, 400):
        some = rng.integers(-5, highest, count)
        for given_as in (some, some.astype(float), some + 0.5):
            assert np.array_equal(is_in(values, given_as), np.isin(values, given_as))


@given(rows)
def test_rows_are_judged_as_numpy_does(values: npt.NDArray[np.float64]) -> None:
    values = np.where(values == 1.0, np.nan, values)
    some = values > 0.0
    assert np.array_equal(any_in_row(some), some.any(axis=1))
    assert np.array_equal(all_in_row(some), some.all(axis=1))
    assert np.array_equal(most_in_row(values), values.max(axis=1), equal_nan=True)


@given(rows)
def test_distinct_rows_are_those_of_numpy(values: npt.NDArray[np.float64]) -> None:
    assert np.array_equal(distinct_rows(values), np.unique(values, axis=0))


@given(numbers)
def test_the_median_is_that_of_numpy_to_the_last_bit(values: npt.NDArray[np.float64]) -> None:
    assert median(values) == np.median(values)


@pytest.mark.parametrize(("values", "middle"), [([3.0], 3.0), ([4.0, 1.0], 2.5), ([9.0, 1.0, 2.0], 2.0)])
def test_the_median_by_hand(values: list[float], middle: float) -> None:
    assert median(np.array(values)) == middle
