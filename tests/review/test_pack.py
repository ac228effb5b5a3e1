"""What is packed comes out again: positions to 0.1 um, deviations to 1 nm, texts to the letter."""

from __future__ import annotations

import time
import zlib
from itertools import accumulate
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from judge.unpacker import decoded

from olp.core.errors import CannotCompute
from olp.review import knots, pack
from olp.review.knots import Curve
from olp.review.pack import DEVIATION_MM, POSITION_MM, TIME_S, Arrays, resolution

TEN_METRES = 10_000.0
TEXTS = st.lists(st.text(st.characters(exclude_characters="\n", exclude_categories=["Cs"])), min_size=1).map(
    "\n".join
)


def unpacked(arrays: Arrays, name: str) -> Any:
    return decoded(arrays.specs, zlib.decompress(arrays.deflated()), name)


def rows(most: float, columns: int = 3) -> st.SearchStrategy[np.ndarray]:
    """Points along an axis, jumps from end to end among them."""
    row = st.lists(st.floats(-most, most), min_size=columns, max_size=columns)
    return st.lists(row, max_size=40).map(lambda values: np.array(values, float).reshape(-1, columns))


@pytest.mark.slow
@given(rows(TEN_METRES))
def test_positions_on_a_long_axis_come_out_to_half_a_step(values: np.ndarray) -> None:
    arrays = Arrays()
    arrays.quantised("P", values, POSITION_MM)
    assert np.abs(unpacked(arrays, "P") - values).max(initial=0.0) <= POSITION_MM / 2 + 1e-11


@pytest.mark.slow
@given(rows(TEN_METRES), st.integers(0, 2**32))
def test_deviations_do_not_suffer_from_where_they_are(values: np.ndarray, seed: int) -> None:
    deltas = np.random.default_rng(seed).normal(0.0, 0.05, (3, *values.shape))
    arrays = Arrays()
    arrays.quantised("P", values, POSITION_MM)
    arrays.quantised("a", deltas[0], DEVIATION_MM, keep=True)
    arrays.quantised("b", deltas[1], DEVIATION_MM, keep=True)
    arrays.quantised("c", deltas[2], DEVIATION_MM, plus=["a", "b"])
    for name, delta in zip("abc", deltas, strict=True):
        assert np.abs(unpacked(arrays, name) - delta).max(initial=0.0) <= DEVIATION_MM / 2 + 1e-15


def test_times_may_pass_what_four_bytes_hold() -> None:
    seconds = np.linspace(0.0, 90_000.0, 4000)
    arrays = Arrays()
    arrays.quantised("t", seconds, TIME_S)
    assert np.abs(unpacked(arrays, "t") - seconds).max() <= TIME_S / 2 + 1e-10


def test_values_beyond_what_a_double_counts_are_refused() -> None:
    arrays = Arrays()
    arrays.quantised("t", [2.0**48 - 1.0, 1.0 - 2.0**48], 1.0)
    assert unpacked(arrays, "t").tolist() == [2.0**48 - 1.0, 1.0 - 2.0**48]
    for value in (2.0**48, -(2.0**48)):
        with pytest.raises(CannotCompute, match="'t' are too large"):
            arrays.quantised("t", [0.0, value], 1.0)


@pytest.mark.slow
@given(st.lists(st.integers(1 - 2**48, 2**48 - 1), max_size=60), st.integers(0, 3))
def test_whole_numbers_come_out_however_often_they_are_differenced(values: list[int], order: int) -> None:
    """Steps of any size, and paths so smooth that they are differenced."""
    for _ in range(order):
        values = [v % 2**48 for v in accumulate(values)]
    arrays = Arrays()
    arrays.quantised("v", np.array(values), 1.0)
    assert unpacked(arrays, "v").tolist() == values


def test_what_is_smooth_is_stored_in_few_bytes() -> None:
    """A path whose third differences are 0 has none but the first rows."""
    index = np.arange(10_000)
    arrays = Arrays()
    arrays.quantised("v", np.column_stack((index**3 % 2**40 * 0 + index * index, 7 * index, 0 * index)), 1.0)
    assert arrays.specs["v"]["order"][1] == 2 or arrays.specs["v"]["order"][1] == 1
    assert arrays.specs["v"]["width"] == [1, 1, 0]
    assert len(arrays.deflated()) < 200


#: Straight stretches, with jumps between them
CURVES = st.lists(
    st.builds(np.linspace, st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.integers(1, 400)),
    min_size=1,
    max_size=12,
).map(np.concatenate)


@pytest.mark.slow
@given(CURVES, st.sampled_from([1e-3, 0.1, 1.0]), st.integers(1, 300))
def test_a_curve_by_its_knots_is_within_a_step(values: np.ndarray, step: float, band: int) -> None:
    arrays = Arrays()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(knots, "_APART", 16)
        patch.setattr(knots, "_BAND", 16 * band)
        arrays.bent("v", Curve.of(values, step))
    assert np.abs(unpacked(arrays, "v") - values).max() <= step * (1 + 1e-9)


def test_a_straight_curve_has_a_knot_every_256_rows() -> None:
    arrays = Arrays()
    arrays.bent("v", Curve.of(np.arange(1000.0), 1.0))
    assert unpacked(arrays, "v_at").tolist() == [0, 256, 512, 768, 999]
    arrays.bent("spike", Curve.of(np.where(np.arange(1000) == 300, 50.0, 0.0), 1.0))
    assert unpacked(arrays, "spike")[299:302].tolist() == [0.0, 50.0, 0.0]
    arrays.bent("nothing", Curve.of([], 1.0))
    assert unpacked(arrays, "nothing").tolist() == []


@pytest.mark.slow
@given(st.integers(0, 2**32), st.integers(1, 400), st.sampled_from([0.0, 1e-3, 10.0]))
def test_values_over_the_length_of_a_path_come_out_to_half_a_step(seed: int, n: int, wild: float) -> None:
    """Also where the path rests, and where they are not straight at all."""
    rng = np.random.default_rng(seed)
    path = np.cumsum(rng.normal(0.0, 2.0, (n, 3)) * rng.integers(0, 2, (n, 1)), axis=0)
    size = np.linalg.norm(np.diff(path, axis=0, prepend=path[:1]), axis=1)
    values = np.cumsum(size / rng.choice([20.0, 50.0])) + np.cumsum(wild * rng.random(n))
    arrays = Arrays()
    arrays.quantised("P", path, POSITION_MM, keep=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(knots, "_APART", 16)
        patch.setattr(knots, "_BAND", 64)
        arrays.along("t", values, TIME_S, "P")
    assert np.abs(unpacked(arrays, "t") - values).max() <= TIME_S / 2 + 1e-9


def test_times_at_a_constant_feed_cost_nothing() -> None:
    rng = np.random.default_rng(1)
    path = np.round(np.cumsum(rng.normal(0.0, 2.0, (5000, 3)), axis=0), 4)
    size = np.linalg.norm(np.diff(path, axis=0, prepend=path[:1]), axis=1)
    arrays = Arrays()
    arrays.quantised("P", path, POSITION_MM, keep=True)
    arrays.along("t", np.cumsum(size) / 20.0, TIME_S, "P")
    assert np.abs(unpacked(arrays, "t_rest")).max() <= 1.0
    assert len(unpacked(arrays, "t_at")) == 21


@given(TEXTS)
def test_texts_come_out_to_the_letter(text: str) -> None:
    arrays = Arrays()
    arrays.text("nominal", text)
    assert "\n".join(unpacked(arrays, "nominal")) == text


@pytest.mark.parametrize(("dtype", "kind"), [("f4", np.float32), ("u4", np.uint32), ("u1", np.uint8)])
def test_raw_values_come_out_as_they_are(dtype: str, kind: type) -> None:
    values = np.arange(30).astype(kind).reshape(10, 3)
    arrays = Arrays()
    arrays.raw("odd", [1, 2, 3], "u1")
    arrays.raw("v", values, dtype)
    assert (unpacked(arrays, "v") == values).all()
    assert unpacked(arrays, "v").dtype == kind


def test_a_stream_of_many_arrays_is_one_stream() -> None:
    """Threads deflate them; any inflater takes the whole, whose sum is right."""
    values = np.random.default_rng(0).integers(0, 255, (20, 5_432))
    arrays = Arrays()
    for k, some in enumerate(values):
        arrays.raw(f"v{k}", some, "u1")
    for k, some in enumerate(values):
        assert (unpacked(arrays, f"v{k}") == some).all()


def test_nothing_is_a_stream_too() -> None:
    assert zlib.decompress(Arrays().deflated()) == b""


@given(st.floats(1e-6, 1e9), st.integers(10, 10_000))
def test_resolution_shows_as_many_levels_as_asked(peak: float, levels: int) -> None:
    step = resolution(peak, 1e-4, levels)
    assert 1e-4 <= step <= 1.0
    assert step == pytest.approx(10.0 ** round(np.log10(step)))
    assert step == 1e-4 or peak / step >= levels * (1 - 1e-12)


def test_a_curve_is_looked_at_by_bands(monkeypatch: pytest.MonkeyPatch) -> None:
    """Columns of doubles are made for a band only, and knots do not depend on where bands end."""
    values = np.random.default_rng(2).normal(size=5000).cumsum()
    along = np.arange(len(values), dtype=float)
    asked = []

    def columns(rows: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        asked.append(len(values[rows]))
        return values[rows], values[rows], along[rows]

    whole = knots.knots(len(values), columns, 1.0)
    monkeypatch.setattr(knots, "_BAND", 512)
    del asked[:]
    assert knots.knots(len(values), columns, 1.0).tolist() == whole.tolist()
    assert max(asked) == 513 and len(asked) == 10


def test_values_less_others_are_their_difference() -> None:
    rng = np.random.default_rng(3)
    values, others = rng.normal(0.0, 1e3, (2, 200, 3))
    for less in (others, others[0]):
        arrays, plain = Arrays(), Arrays()
        arrays.quantised("P", values, POSITION_MM, less=less)
        plain.quantised("P", values - less, POSITION_MM)
        assert arrays.deflated() == plain.deflated()


def test_few_parts_wait_to_be_deflated(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the packing is ahead of the threads that deflate, it waits: parts of long programs are large."""
    deflated = pack._deflated

    def slowly(data: bytes) -> bytes:
        time.sleep(0.002)
        return deflated(data)

    monkeypatch.setattr(pack, "_deflated", slowly)
    arrays, waiting = Arrays(), []
    for k in range(60):
        arrays.raw(f"r{k}", np.arange(8), "u1")
        waiting.append(sum(not part.done() for part in arrays._parts))
    assert max(waiting) <= pack._WAITING
    assert all((unpacked(arrays, f"r{k}") == np.arange(8)).all() for k in range(60))
