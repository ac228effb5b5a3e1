"""Probabilities of normal vectors in space."""

from __future__ import annotations

import math

import numpy as np

from olp.core.arrays import Array

#: Directions of half a sphere over which `within` integrates, at least: right to some parts in a thousand.
FEWEST = 128
#: The same, at most: right to one part in a thousand.
MOST = 1024
#: Directions times positions, at most, where this leaves more than FEWEST.
WORK = 1e7
#: Beyond so many standard deviations the probability counts as zero.
_SIGMAS = 6.0
#: Positions that are computed at once, to limit memory.
_BLOCK = 1024


def within(covariance: Array, offset: Array, radius: float) -> Array:
    """(n,) probability that offset + x is no longer than `radius`, x normal about zero with covariance
    (n, 3, 3); offset (n, 3).

    Along every direction w of the unit sphere x = rho A w (A A.T the covariance), which is in the ball for
    rho in an interval. The distribution of rho is chi with 3 degrees of freedom, so one integral over
    directions remains.
    """
    size = np.sqrt((offset**2).sum(axis=1))
    reach = _SIGMAS * np.sqrt(np.trace(covariance, axis1=1, axis2=2))
    probability = np.where(size + reach <= radius, 1.0, 0.0)
    near = np.flatnonzero(np.abs(size - radius) < reach)
    count = int(np.clip(WORK / max(len(near), 1), FEWEST, MOST))
    z = (np.arange(count) + 0.5) / count
    turn = np.arange(count) * (math.pi * (3.0 - math.sqrt(5.0)))
    flat = np.sqrt(1.0 - z * z)
    # the third principal axis is the longest: points lie evenly along it
    points = np.stack([flat * np.cos(turn), flat * np.sin(turn), z])
    for a in range(0, len(near), _BLOCK):
        part = near[a : a + _BLOCK]
        values, vectors = np.linalg.eigh(covariance[part])
        axes = np.sqrt(np.maximum(values, 0.0))
        # in principal axes: A w = axes * w, and the offset turned likewise
        turned = np.einsum("nij,ni->nj", vectors, offset[part])
        square = (axes**2) @ (points**2)
        across = (turned * axes) @ points
        rest = radius**2 - (turned**2).sum(axis=1)[:, None]
        under = across**2 + square * rest
        root = np.sqrt(np.maximum(under, 0.0))
        with np.errstate(divide="ignore", invalid="ignore"):
            high, low = (-across + root) / square, (-across - root) / square
        share = 0.5 * (_signed_chi(high) - _signed_chi(low))
        fixed = square <= 1e-24 * radius**2
        share = np.where(fixed, (rest >= 0.0) * 1.0, np.where(under > 0.0, share, 0.0))
        probability[part] = share.mean(axis=1)
    return np.clip(probability, 0.0, 1.0)


def normal(x: Array | float) -> Array:
    """The standard normal distribution function."""
    from scipy.special import ndtr

    return np.asarray(ndtr(x), float)


def _signed_chi(rho: Array) -> Array:
    """The distribution function of chi with 3 degrees of freedom at |rho|, with the sign of rho."""
    from scipy.special import erf

    size = np.minimum(np.abs(rho), 40.0)
    value = erf(size * math.sqrt(0.5)) - math.sqrt(2.0 / math.pi) * size * np.exp(-0.5 * size * size)
    return np.asarray(np.copysign(value, rho))
