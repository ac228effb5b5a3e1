"""Columns that grow: what is put is what is taken, and little more is reserved than that."""

from __future__ import annotations

import tempfile

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from olp.core.spool import unload
from olp.program.text import columns as module
from olp.program.text.columns import Columns, Packed, apart, marked, spans


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


def test_a_long_column_is_in_a_file(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is in it is the same, also after it left memory, and it stays when the columns end."""
    monkeypatch.setattr(module, "_FIRST", 16)
    monkeypatch.setattr(module, "_MOST", 64)
    columns, parts = Columns(), [np.arange(n) for n in (1, 150, 70, 400)]
    for part in parts:
        columns.put("a", np.stack((part, -part), axis=1), np.int32)
        columns.put("b", part, np.int64)
    assert len(columns._columns["a"].block) == 64
    taken, packed = columns.take("a", np.int32, 2), columns.packed("b")
    del columns
    expected = [k for part in parts for k in part.tolist()]
    for _ in range(2):
        assert taken.tolist() == [[k, -k] for k in expected]
        assert packed[:].tolist() == expected
        unload()
    assert not taken.flags.owndata and not taken.flags.writeable and packed.small.dtype == np.uint16


def test_a_long_array_to_be_filled_keeps_what_is_put(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_MOST", 64)
    array = apart((1000, 2), np.float32)
    assert not array.any()
    for some in spans(1000):
        array[some] = np.arange(some.start, some.stop)[:, None]
    assert not array.flags.owndata and array[:, 1].tolist() == list(range(1000))


def test_a_column_is_in_memory_where_no_file_has_room(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(**_: int) -> None:
        raise OSError

    monkeypatch.setattr(module, "_MOST", 1024)
    monkeypatch.setattr(tempfile, "TemporaryFile", full)
    monkeypatch.setattr(module, "room", lambda: 0)
    columns = Columns()
    columns.put("a", np.arange(5000), np.int32)
    assert columns.take("a", np.int32).tolist() == list(range(5000))
    assert apart((5000,), np.int8).flags.owndata


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


def test_a_mask_is_asked_for_by_spans(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_MOST", 7)
    asked: list[slice] = []

    def of(some: slice) -> np.ndarray:
        asked.append(some)
        return np.arange(some.start, some.stop) % 3 == 1

    assert np.array_equal(marked(20, of), np.arange(20) % 3 == 1)
    assert [(some.start, some.stop) for some in asked] == [(0, 7), (7, 14), (14, 20)]
