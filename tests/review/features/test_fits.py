"""The reference elements are those of numpy and scipy, which did not write them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares

from olp.review.features.fits import circle, circle_of_powers, line_residuals, plane_residuals


def by_lstsq(columns: np.ndarray, values: np.ndarray, weight: np.ndarray) -> np.ndarray:
    root = np.sqrt(weight)
    factors = np.linalg.lstsq(columns * root[:, None], values * root, rcond=None)[0]
    return np.asarray(values - columns @ factors)


@pytest.mark.parametrize("seed", range(5))
def test_lines_and_planes_are_those_of_numpy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    u, v = rng.uniform(-300.0, 500.0, (2, 60))
    values, weight = rng.normal(0.0, 0.02, 60), rng.uniform(0.1, 4.0, 60)
    ones = np.ones(60)
    line = by_lstsq(np.stack((ones, u), axis=1), values, weight)
    np.testing.assert_allclose(line_residuals(u, values, weight), line, atol=1e-12)
    plane = by_lstsq(np.stack((ones, u, v), axis=1), values, weight)
    np.testing.assert_allclose(plane_residuals(u, v, values, weight), plane, atol=1e-12)


@pytest.mark.parametrize("sweep_deg", [90.0, 180.0, 360.0])
def test_circles_are_those_of_scipy(sweep_deg: float) -> None:
    rng = np.random.default_rng(int(sweep_deg))
    angle = np.radians(np.sort(rng.uniform(0.0, sweep_deg, 80)))
    radius = 25.0 + rng.normal(0.0, 0.05, 80)
    x, y = 0.3 + radius * np.cos(angle), -0.2 + radius * np.sin(angle)
    weight = rng.uniform(0.2, 3.0, 80)

    def residuals(p: np.ndarray) -> np.ndarray:
        return np.asarray(np.sqrt(weight) * (np.hypot(x - p[0], y - p[1]) - p[2]))

    judged = least_squares(residuals, (0.0, 0.0, 25.0), xtol=1e-15, ftol=1e-15, gtol=1e-15).x
    found = circle(x, y, weight, (0.0, 0.0, 25.0))
    np.testing.assert_allclose((found.x_mm, found.y_mm, found.radius_mm), judged, atol=1e-7)
    np.testing.assert_allclose(found.residuals, np.hypot(x - judged[0], y - judged[1]) - judged[2], atol=1e-7)


def test_a_circle_of_powers_is_exact_for_its_own_points() -> None:
    angle = np.linspace(0.3, 0.9, 13)
    found = circle_of_powers(-7.0 + 12.0 * np.cos(angle), 5.0 + 12.0 * np.sin(angle))
    np.testing.assert_allclose(found, (-7.0, 5.0, 12.0), atol=1e-9)


def test_a_plane_through_points_of_a_line_has_no_slope_across_it() -> None:
    u = np.linspace(0.0, 100.0, 11)
    residuals = plane_residuals(u, np.zeros(11), 0.001 * u, np.ones(11))
    np.testing.assert_allclose(residuals, 0.0, atol=1e-12)


def test_splitting_the_weight_of_a_point_changes_nothing() -> None:
    u, values = np.array([0.0, 1.0, 2.0, 5.0]), np.array([0.0, 3.0, -1.0, 2.0])
    weight = np.array([1.0, 2.0, 1.0, 1.0])
    again = np.array([0, 1, 1, 2, 3])
    apart = line_residuals(u[again], values[again], np.ones(5))
    np.testing.assert_allclose(apart, line_residuals(u, values, weight)[again], atol=1e-12)
