"""Interpolation against scipy, and the dense table against the interpolant it samples."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from olp.core.interpolation import Interpolant, dense_table


def knots(rng: np.random.Generator, n: int, spread: float) -> np.ndarray:
    return np.cumsum(10.0 * np.exp(spread * rng.normal(size=n))) - 200.0


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(st.integers(2, 30), st.integers(0, 10**6), st.booleans())
def test_pchip_equals_scipy(n: int, seed: int, plateaus: bool) -> None:
    rng = np.random.default_rng(seed)
    x, y = knots(rng, n, 0.7), rng.normal(size=(n, 4))
    if plateaus:
        y = np.round(y)
    q = np.concatenate([x, rng.uniform(x[0], x[-1], 100)])
    expected = PchipInterpolator(x, y, axis=0)(q)
    np.testing.assert_allclose(Interpolant.through(x, y, "pchip")(q), expected, rtol=1e-12, atol=1e-13)


@given(st.integers(2, 30), st.integers(0, 10**6))
def test_linear_equals_interp_and_holds_outside(n: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = knots(rng, n, 0.7), rng.normal(size=(n, 1))
    q = rng.uniform(x[0] - 50.0, x[-1] + 50.0, 100)
    curve = Interpolant.through(x, y, "linear")
    np.testing.assert_allclose(curve(q)[:, 0], np.interp(q, x, y[:, 0]), rtol=1e-12, atol=1e-13)
    np.testing.assert_array_equal(curve.inside(q), (q >= x[0]) & (q <= x[-1]))


@pytest.mark.parametrize("kind", ["linear", "pchip"])
@given(n=st.integers(2, 12), seed=st.integers(0, 10**6))
@settings(max_examples=30, deadline=None)
def test_slope_and_curvature_bound_the_curve(kind: str, n: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    curve = Interpolant.through(knots(rng, n, 0.3), rng.normal(size=(n, 3)), kind)
    for a, b in zip(curve.x[:-1], curve.x[1:], strict=True):
        q = np.linspace(a, b, 65)
        step = q[1] - q[0]
        value = curve(q)
        assert np.all(np.abs(np.diff(value, axis=0)) <= curve.max_slope() * step * (1 + 1e-9) + 1e-13)
        bend = np.abs(value[:-2] - 2.0 * value[1:-1] + value[2:])
        assert np.all(bend <= curve.max_curvature() * step**2 * (1 + 1e-9) + 1e-12)


@pytest.mark.parametrize(
    "knots", [np.linspace(-300.0, 1700.0, 41), np.sort(np.random.default_rng(4).uniform(0, 2000, 41))]
)
def test_the_dense_table_meets_its_tolerance(knots: np.ndarray) -> None:
    rng = np.random.default_rng(5)
    values = np.cumsum(rng.normal(size=(41, 3)), axis=0) * [5e-3, 5e-3, 1e-5]
    curve = Interpolant.through(knots, values, "pchip")
    table = dense_table(knots, curve, curve.max_curvature().tolist(), [1e-7, 1e-7, 1e-10])
    q = rng.uniform(knots[0], knots[-1], 100_000)
    difference = np.abs(np.stack(table.lookup(q), axis=1) - curve(q)).max(axis=0)
    worst = table.step**2 / 8.0 * curve.max_curvature()
    assert np.all(difference <= worst * (1 + 1e-6))
    if table.nodes is None:
        assert np.all(difference < [1e-7, 1e-7, 1e-10])


@pytest.mark.parametrize(
    "knots", [np.arange(-2, 9) * 25.0, np.array([0.0, 12.5, 20.0, 55.0, 60.0]), np.array([0, 1.23, 9.7])]
)
def test_linear_data_stay_exact(knots: np.ndarray) -> None:
    rng = np.random.default_rng(6)
    curve = Interpolant.through(knots, rng.normal(size=(len(knots), 2)), "linear")
    table = dense_table(knots, curve, [0.0, 0.0], [1e-7, 1e-7])
    q = rng.uniform(knots[0] - 5.0, knots[-1] + 5.0, 10_000)
    np.testing.assert_allclose(np.stack(table.lookup(q), axis=1), curve(q), atol=1e-12)


def test_a_constant_column_is_a_number() -> None:
    knots = np.array([0.0, 10.0, 20.0])
    curve = Interpolant.through(knots, np.array([[1.0, 2.0], [1.0, 3.0], [1.0, 2.0]]), "pchip")
    constant, varying = dense_table(knots, curve, curve.max_curvature().tolist(), [1e-7, 1e-7]).lookup(
        np.array([5.0, 99.0])
    )
    assert constant == 1.0
    np.testing.assert_allclose(varying, [2.75, 2.0])
