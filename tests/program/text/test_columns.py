"""Columns that grow: what is put is what is taken, and little more is reserved than that."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from olp.program.text.columns import Columns


@pytest.mark.slow
@given(st.lists(st.integers(0, 3000), max_size=6))
def test_a_column_is_what_was_put_in_order(lengths: list[int]) -> None:
    columns = Columns()
    parts = [np.arange(n) + 10 * n for n in lengths]
    for part in parts:
        columns.put("a", part, np.int32)
        columns.put("b", np.stack((part, -part), axis=1), np.float64)
    expected = np.concatenate((np.zeros(0, int), *parts))
    one, two = columns.take("a", np.int32), columns.take("b", np.float64, 2)
    assert one.dtype == np.int32 and one.tolist() == expected.tolist()
    assert two.dtype == np.float64 and two.tolist() == np.stack((expected, -expected), axis=1).tolist()


def test_a_column_is_taken_once_and_read_only() -> None:
    columns = Columns()
    columns.put("a", [1, 2], np.int8)
    taken = columns.take("a", np.int8)
    with pytest.raises(ValueError, match="read-only"):
        taken[0] = 3
    assert columns.take("a", np.int8).shape == (0,)
    assert columns.take("b", np.float64, 3).shape == (0, 3)
    # what was taken is empty again
    columns.put("a", [7], np.int64)
    assert columns.take("a", np.int64).tolist() == [7]


def test_little_is_reserved_beyond_what_is_there() -> None:
    columns = Columns()
    for count in range(1, 200):
        columns.put("a", np.zeros((1000, 3)), np.float64)
        column = columns._columns["a"]
        reserved = sum(map(len, [*column.full, column.block]))
        assert reserved <= 1000 * count + min(1000 * count + 1024, 1 << 16)
    assert columns.take("a", np.float64, 3).nbytes == 199 * 1000 * 24
