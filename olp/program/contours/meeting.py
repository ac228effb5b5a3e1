"""Where the carriers of two elements meet: lines and circles in a plane."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.values import dataclass


@dataclass(frozen=True, slots=True, eq=False)
class Carriers:
    """(k,) lines through `point` (k, 2) in direction `along` (k, 2), or circles about `centre` (k, 2) with
    `size`, where `arc`."""

    arc: Mask
    point: Array
    along: Array
    centre: Array
    size: Array


def meeting(a: Carriers, b: Carriers, near: Array) -> Array:
    """(k, 2) points on both carriers, of two the one that is nearer to `near`; NaN where they do not meet."""
    found = np.full(near.shape, np.nan)
    for first, second in ((a, b), (b, a)):
        some = np.flatnonzero(~first.arc & second.arc)
        found[some] = _nearer(*_line_and_circle(first, second, some), near[some])
    some = np.flatnonzero(~a.arc & ~b.arc)
    found[some] = _lines(a, b, some)
    some = np.flatnonzero(a.arc & b.arc)
    found[some] = _nearer(*_circles(a, b, some), near[some])
    return found


def _nearer(first: Array, second: Array, near: Array) -> Array:
    closer = np.square(first - near).sum(axis=1) <= np.square(second - near).sum(axis=1)
    return np.where(closer[:, None], first, second)


def _lines(a: Carriers, b: Carriers, some: Index) -> Array:
    p, d, q, e = a.point[some], a.along[some], b.point[some], b.along[some]
    cross = d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0]
    away = q - p
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (away[:, 0] * e[:, 1] - away[:, 1] * e[:, 0]) / cross
        return np.asarray(p + share[:, None] * d)


def _line_and_circle(line: Carriers, circle: Carriers, some: Index) -> tuple[Array, Array]:
    p, d, c, size = line.point[some], line.along[some], circle.centre[some], circle.size[some]
    foot = p + ((c - p) * d).sum(axis=1)[:, None] * d
    with np.errstate(invalid="ignore"):
        half = np.sqrt(size**2 - np.square(foot - c).sum(axis=1))[:, None] * d
    return foot - half, foot + half


def _circles(a: Carriers, b: Carriers, some: Index) -> tuple[Array, Array]:
    c, size, away = a.centre[some], a.size[some], b.centre[some] - a.centre[some]
    apart = np.hypot(away[:, 0], away[:, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        along = away / apart[:, None]
        share = (size**2 - b.size[some] ** 2 + apart**2) / (2 * apart)
        half = np.sqrt(size**2 - share**2)
    across = np.column_stack((-along[:, 1], along[:, 0])) * half[:, None]
    foot = c + along * share[:, None]
    return foot - across, foot + across
