"""One axis with backlash and a dead band, held against the same rule row by row."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from olp.compensation.dead_band import UNKNOWN, follow

NAN = float("nan")


def row_by_row(position: list[float], backlash: list[float], band: float) -> tuple[list[float], ...]:
    """The rule as it is stated: an interval of the lag that each motion narrows."""
    plays: list[float] = []
    loads: list[float] = []
    turns: list[float] = []
    load = low = high = float("nan")
    for wanted, width in zip(position, backlash, strict=True):
        half = max(width, 0.0) / 2
        turn = False
        if wanted != wanted or load != load:
            load, low, high = wanted, -1.0, 1.0
        elif wanted != load:
            sign = 1.0 if wanted > load else -1.0
            step = abs(wanted - load)
            # play that has to be taken up before the middle of the load moves, and until it is known
            first = 1.0 - (high if sign > 0 else -low)
            last = 1.0 - (low if sign > 0 else -high)
            turn = first > 1e-9
            if turn and step <= band:
                turn = False
            else:
                load = wanted
                if half == 0.0 or step >= half * (last - first) / 2:
                    low = high = sign
                else:
                    # while the interval narrows the middle of the load goes half as far as the drive
                    rest = last - first - 2 * step / half
                    low, high = (1.0 - rest, 1.0) if sign > 0 else (-1.0, -1.0 + rest)
        plays.append((low + high) / 2)
        loads.append(load)
        turns.append(turn)
    return plays, loads, turns


def check(position: list[float], backlash: list[float], band: float) -> None:
    play, load, turns, _ = follow(np.array(position), np.array(backlash), band)
    plays, loads, turned = row_by_row(position, backlash, band)
    np.testing.assert_array_equal(load, loads)
    np.testing.assert_array_equal(turns, turned)
    np.testing.assert_allclose(play, plays, rtol=0, atol=1e-12)


STEPS = st.sampled_from([0.0, 1e-13, -1e-13, 1e-4, -1e-4, 3e-4, -3e-4, 5e-4, -5e-4, 0.002, -0.002, 4.0, -4.0])


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(
    st.lists(st.tuples(STEPS, st.sampled_from([0.0, -0.001, 0.001, 0.004]), st.booleans()), max_size=40),
    st.sampled_from([0.0, 2e-4, 5e-4]), st.booleans(),
)  # fmt: skip
def test_an_axis_follows_as_row_by_row(
    rows: list[tuple[float, float, bool]], band: float, gaps: bool
) -> None:
    position = np.cumsum([step for step, _, _ in rows]).tolist()
    if gaps:
        position = [NAN if lost else x for x, (_, _, lost) in zip(position, rows, strict=True)]
    check(position, [width for _, width, _ in rows], band)


@pytest.mark.parametrize("seed", range(20))
def test_a_long_walk_is_followed_as_row_by_row(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = 3000
    smooth = np.cumsum(rng.normal(0, 1e-4, count)) + np.sin(np.arange(count) / rng.uniform(3, 300))
    check(smooth.tolist(), rng.uniform(0.002, 0.006, count).tolist(), float(rng.choice([0.0, 3e-4, 0.5])))


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(
    st.lists(st.tuples(STEPS, st.sampled_from([0.0, -0.001, 0.001, 0.004]), st.booleans()), max_size=40),
    st.sampled_from([0.0, 2e-4, 5e-4]), st.booleans(), st.lists(st.integers(0, 40), max_size=6),
)  # fmt: skip
def test_in_parts_an_axis_follows_as_in_one(
    rows: list[tuple[float, float, bool]], band: float, gaps: bool, cuts: list[int]
) -> None:
    position = np.cumsum([step for step, _, _ in rows])
    if gaps:
        position = np.array([NAN if lost else x for x, (_, _, lost) in zip(position, rows, strict=True)])
    width = np.array([width for _, width, _ in rows])
    *whole, end = follow(position, width, band)
    parts, rest = [], UNKNOWN
    for a, b in pairwise(sorted([0, *(min(cut, len(rows)) for cut in cuts), len(rows)])):
        *part, rest = follow(position[a:b], width[a:b], band, rest)
        parts.append(part)
    for one, some in zip(whole, zip(*parts, strict=True), strict=True):
        np.testing.assert_array_equal(np.concatenate(some), one)
    assert rest.like(end) and (end == rest or rest.position != rest.position)


def test_the_side_is_free_until_the_first_motion() -> None:
    play, load, turns, _ = follow(np.array([5.0, 5.0, 4.0, 4.0003, 4.001]), np.full(5, 0.004), 0.0005)
    assert play.tolist() == [0.0, 0.0, -1.0, -1.0, 1.0]
    assert load.tolist() == [5.0, 5.0, 4.0, 4.0, 4.001]
    assert turns.tolist() == [False, False, False, False, True]


def test_no_rows_are_followed_by_none() -> None:
    *parts, rest = follow(np.zeros(0), np.zeros(0), 0.1)
    assert [len(part) for part in parts] == [0, 0, 0] and rest == UNKNOWN
