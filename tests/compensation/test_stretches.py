"""Digits of many stretches at once are those of one stretch after the other."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from olp.compensation.digits import AxisRows, Digits, absolute, incremental
from olp.compensation.stretches import Decimals, Stretches, digits_of

NAN = float("nan")


def one_by_one(rows: AxisRows, stretches: Stretches, before: float, decimals: Decimals) -> list[Digits]:
    """The plain way: each stretch by itself, from where the one before left the axis."""
    digits = []
    for a, b, counting in zip(stretches.bounds, stretches.bounds[1:], stretches.counting, strict=False):
        part = rows.part(slice(a, b))
        assert isinstance(part.unit, np.ndarray)
        unit = float(part.unit[0])
        part = AxisRows(
            part.command, part.nominal, part.given, part.raw, part.reset, part.word, part.decimals,
            part.offset, unit,
        )  # fmt: skip
        least, usual, grid = (
            int(np.broadcast_to(n, len(rows.command))[a])
            for n in (decimals.least, decimals.usual, decimals.grid)
        )
        digits.append(incremental(part, before, grid) if counting else absolute(part, before, least, usual))
        before = float(digits[-1].emitted[-1])
    return digits


@st.composite
def programs(draw: st.DrawFn) -> tuple[AxisRows, Stretches, float, Decimals]:
    """Rows near a few positions, so that omitted axes hold and move on, with rare unknown and kept ones."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    count = draw(st.integers(1, 60))
    counting = rng.random(count) < draw(st.sampled_from([0.0, 0.2, 0.5, 1.0]))
    inch = np.where(rng.random(count) < draw(st.sampled_from([0.0, 0.3])), 25.4, 1.0)
    command = rng.choice([0.0, 1.0, 2.5], count) + rng.normal(0, draw(st.sampled_from([1e-4, 1e-3])), count)
    rare = draw(st.sampled_from([0.0, 0.1]))
    command[rng.random(count) < rare / 2] = NAN
    given = rng.random(count) < draw(st.sampled_from([0.0, 0.3, 0.9]))
    reset = rng.random(count) < rare
    nominal = np.where(reset, NAN, np.round(command, 1))
    rows = AxisRows(
        command, nominal, given, rng.random(count) < rare, reset,
        np.where(given, rng.integers(-3000, 3000, count), 0), rng.integers(0, 5, count).astype(np.int8),
        rng.choice([0.0, 0.1], count), inch,
    )  # fmt: skip
    metric = inch == 1.0
    decimals = Decimals(
        np.where(metric, 3, 4).astype(np.int8), np.where(metric, 3, 5).astype(np.int8), draw(st.just(4))
    )
    before = float(rng.choice([0.0, 1.0, NAN]))
    return rows, Stretches.of(counting, inch), before, decimals


@given(programs())
def test_all_stretches_at_once_write_what_one_after_the_other_does(
    program: tuple[AxisRows, Stretches, float, Decimals],
) -> None:
    expected, got = one_by_one(*program), digits_of(*program)
    for name in ("emitted", "mantissa", "decimals", "write"):
        column = np.concatenate([getattr(d, name) for d in expected])
        # what is not written has no number
        shown = np.ones(len(column), bool) if name in ("emitted", "write") else got.write
        assert np.array_equal(getattr(got, name)[shown], column[shown], equal_nan=name == "emitted"), name


def test_stretches_end_where_the_mode_or_the_unit_changes() -> None:
    counting = np.array([False, False, True, True, False])
    assert Stretches.of(counting, 1.0).bounds.tolist() == [0, 2, 4, 5]
    mixed = Stretches.of(counting, np.array([1.0, 25.4, 25.4, 1.0, 1.0]))
    assert mixed.bounds.tolist() == [0, 1, 2, 3, 4, 5]
    assert mixed.counting.tolist() == [False, False, True, True, False]
