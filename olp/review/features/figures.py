"""Vectors of length 1, ranges, and numbers for people."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array


def unit(vector: Array) -> Array:
    """A vector, or rows of vectors, of length 1."""
    size = np.sqrt((vector**2).sum(axis=-1, keepdims=True))
    return np.asarray(vector / np.where(size > 0.0, size, 1.0))


def spread(values: Array) -> float:
    """Largest less smallest."""
    return float(values.max() - values.min())


def number(value: float) -> str:
    """A length in mm for people, to a micrometre."""
    text = f"{value:.3f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def counted(count: int, word: str) -> str:
    """A number of things: "1 level", "4 levels"."""
    return f"{count} {word}" if count == 1 else f"{count} {word}s"
