"""Least-squares reference lines, planes and circles, weighted by length of path.

They are the reference elements of ISO 12780-1 (LSLI), ISO 12781-1 (LSPL) and ISO 12181-1 (LSCI): the sum of
the squares of the local deviations is smallest. Each point counts by the length of path that it stands for,
so that neither the density of samples nor the split of a line into parts changes a figure.
"""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array
from olp.core.values import dataclass

#: Most steps of Gauss and Newton: deviations are small beside radii, so that each squares the error.
_STEPS = 12
#: Change of a circle in mm at which the steps end.
_ENOUGH_MM = 1e-10


def line_residuals(along: Array, away: Array, weight: Array) -> Array:
    """(k,) residuals of `away` (k,) about the least-squares line over `along` (k,)."""
    return _residuals(np.stack((np.ones_like(along), along - _mean(along, weight)), axis=1), away, weight)


def plane_residuals(first: Array, second: Array, away: Array, weight: Array) -> Array:
    """(k,) residuals of `away` (k,) about the least-squares plane over coordinates (k,) in the plane."""
    columns = (np.ones_like(first), first - _mean(first, weight), second - _mean(second, weight))
    return _residuals(np.stack(columns, axis=1), away, weight)


@dataclass(frozen=True, slots=True, eq=False)
class Circle:
    """A least-squares circle: centre and radius in mm, (k,) radial `residuals` of its points."""

    x_mm: float
    y_mm: float
    radius_mm: float
    residuals: Array


def circle(x: Array, y: Array, weight: Array, near: tuple[float, float, float]) -> Circle:
    """The circle through points (k,) with the smallest sum of squares of radial distances, sought from
    `near`, a centre and a radius."""
    centre_x, centre_y, radius = near
    for _ in range(_STEPS):
        dx, dy = x - centre_x, y - centre_y
        away = np.maximum(np.hypot(dx, dy), _ENOUGH_MM)
        columns = np.stack((dx / away, dy / away, np.ones_like(away)), axis=1)
        step = _solution(columns, away - radius, weight)
        centre_x, centre_y, radius = centre_x + step[0], centre_y + step[1], radius + step[2]
        if np.abs(step).max() < _ENOUGH_MM:
            break
    residuals = np.hypot(x - centre_x, y - centre_y) - radius
    return Circle(float(centre_x), float(centre_y), float(radius), residuals)


def circle_of_powers(x: Array, y: Array) -> tuple[float, float, float]:
    """Centre and radius of the circle about which the powers of points (k,) have the smallest sum of squares
    (Kasa, IEEE Trans. Instrum. Meas. 25, 1976). Of points within micrometres of a circle it is that one."""
    columns = np.stack((2.0 * x, 2.0 * y, np.ones_like(x)), axis=1)
    a, b, c = _solution(columns, x**2 + y**2, np.ones_like(x)).tolist()
    return a, b, max(c + a**2 + b**2, 0.0) ** 0.5


def _mean(values: Array, weight: Array) -> float:
    return float(values @ weight / weight.sum())


def _residuals(columns: Array, values: Array, weight: Array) -> Array:
    return np.asarray(values - columns @ _solution(columns, values, weight))


def _solution(columns: Array, values: Array, weight: Array) -> Array:
    """(c,) the factors of columns (k, c) with the smallest weighted sum of squares. Where several are best,
    as for points in a line, it is the shortest."""
    scale = np.sqrt((columns**2).mean(axis=0))
    scaled = columns / np.where(scale > 0.0, scale, 1.0)
    heavy = scaled * weight[:, None]
    solved = np.linalg.lstsq(heavy.T @ scaled, heavy.T @ values, rcond=1e-12)[0]
    return np.asarray(solved / np.where(scale > 0.0, scale, 1.0))
