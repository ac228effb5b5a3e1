"""The largest values of many polynomials at once, by branch and bound.

A polynomial stays inside the hull of its control points; each cut gives the control points of its halves.
Parts whose control points are below a value that is reached elsewhere are dropped.
Source: G. Farin, "Curves and Surfaces for CAGD", on subdivision.
"""

from __future__ import annotations

from functools import cache
from math import comb

import numpy as np

from olp.core.arrays import Array

#: share by which a bound may exceed the value that is reached
_CLOSE = 1e-8
#: cuts after which the bound is taken
_CUTS = 40


def nodes(degree: int) -> Array:
    """(degree + 1,) points in [0, 1], ends included, whose values define a polynomial."""
    result: Array = 0.5 - 0.5 * np.cos(np.pi * np.arange(degree + 1) / degree)
    return result


def largest(values: Array, enough: float) -> float:
    """The largest norm on [0, 1] of m polynomials, given by their values (degree + 1, c, m) at `nodes`.

    Values are vectors of c numbers (c = 1: absolute values). The result is exact to 1e-8 of itself above
    `enough`; below, it is a bound."""
    degree, width = len(values) - 1, values.shape[1]
    if not np.isfinite(values).all():
        return np.inf
    best = max(enough, float(np.sqrt(_squares(values).max(initial=0.0))))
    controls = np.tensordot(_to_controls(degree), values, 1)
    hull = float(np.sqrt(_squares(controls).max(initial=0.0)))
    halves = _halves(degree)
    for _ in range(_CUTS):
        most = np.sqrt(_squares(controls).max(axis=0))
        keep = most > best * (1.0 + _CLOSE)
        if not keep.any():
            return min(best, hull) if best == enough else best
        cut = halves @ controls[:, :, keep].reshape(degree + 1, -1)
        controls = np.concatenate([e.reshape(degree + 1, width, -1) for e in np.split(cut, 2)], axis=2)
        best = max(best, float(np.sqrt(_squares(controls[[0, -1]]).max())))
    return max(best, float(np.sqrt(_squares(controls).max())))


def _squares(vectors: Array) -> Array:
    """(n, m) squared norms of (n, c, m)."""
    result: Array = np.einsum("ncm,ncm->nm", vectors, vectors)
    return result


@cache
def _to_controls(degree: int) -> Array:
    """(degree + 1, degree + 1) from values at the nodes to control points."""
    x = nodes(degree)[:, None]
    i = np.arange(degree + 1)
    binomial = np.array([comb(degree, k) for k in range(degree + 1)], float)
    return np.asarray(np.linalg.inv(binomial * x**i * (1.0 - x) ** (degree - i)), np.float64)


@cache
def _halves(degree: int) -> Array:
    """(2 degree + 2, degree + 1) from control points to those of both halves."""
    first_half = np.array([[comb(i, j) * 0.5**i for j in range(degree + 1)] for i in range(degree + 1)])
    return np.concatenate((first_half, first_half[::-1, ::-1]))
