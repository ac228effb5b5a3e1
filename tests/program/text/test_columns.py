"""Columns that grow: what is put is what is taken, and little more is reserved than that."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from olp.program.text import columns as module
from olp.program.text.columns import Columns, Packed, apart


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


def test_a_large_column_has_memory_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is in it is the same, also where blocks and column are large."""
    monkeypatch.setattr(module, "_OWN", 1)
    columns, parts = Columns(), [np.arange(n) for n in (1, 1500, 70, 40_000)]
    for part in parts:
        columns.put("a", np.stack((part, -part), axis=1), np.int32)
    taken = columns.take("a", np.int32, 2)
    assert taken.tolist() == [[k, -k] for part in parts for k in part.tolist()]
    assert not taken.flags.owndata and not taken.flags.writeable


def test_one_number_stands_for_a_column_of_equal_ones() -> None:
    columns = Columns()
    columns.put("a", np.full(3000, 7), np.int32)
    columns.put("b", np.full(3000, np.nan), np.float64)
    columns.put("c", np.full((3000, 2), 7), np.int32)
    one, nan, rows = columns.take("a", np.int32), columns.take("b", np.float64), columns.take("c", np.int32)
    assert one.dtype == np.int32 and one.tolist() == [7] * 3000 and one.strides == (0,)
    assert np.isnan(nan).all() and nan.strides == (0,) and rows.tolist() == [[7, 7]] * 3000


def test_too_large_a_column_is_out_of_memory() -> None:
    with pytest.raises(MemoryError):
        apart((1 << 50,), np.float64)


@pytest.mark.parametrize(
    ("values", "kind"),
    [([], "u1"), ([7, 7, 7], "u1"), ([0, 255], "u1"), ([0, 256], "u2"), ([-1, 127], "i1"), ([-1, 128], "i2"),
     ([-128, 5], "i1"), ([-129, 5], "i2"), ([5, -(2**40)], "i8"), ([2**31], "u4"), ([2**62], "u8")],
)  # fmt: skip
def test_packed_numbers_take_few_bytes_and_are_given_at_full_width(values: list[int], kind: str) -> None:
    numbers = np.array(values, np.int64)
    packed = Packed.of(numbers)
    assert packed.small.dtype == np.dtype(kind)
    assert len(packed) == len(values)
    for full in (packed[:], packed[np.arange(len(values))]):
        assert full.dtype == np.int64
        assert full.tolist() == values
    assert [int(packed[k]) for k in range(len(values))] == values


def test_packed_numbers_behind_others() -> None:
    before = np.array([10, 70_000, 2_000_000_000], np.int32)
    packed = Packed.of(before + np.array([1, 0, 255]), before)
    assert packed.small.tolist() == [1, 0, 255]
    assert packed.small.dtype == np.uint8
    assert packed[np.array([2, 0])].tolist() == [2_000_000_255, 11]
    assert int(packed[1]) == 70_000
    assert Packed.of(before, before).small.strides == (0,)
