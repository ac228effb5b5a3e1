"""Arcs that enter a contour, as LinuxCNC makes them.

Measured on its interpreter: the tool ends beside the end of the programmed arc, as on any arc. It gets there
from the point where it is on another arc, whose centre lies on the line through that end and the programmed
one. Where it lies behind the end, the tool arrives against the direction of the contour.
"""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index
from olp.program.contours.elements import Elements

#: cosine below which LinuxCNC finds no centre
_ACROSS = 1e-4


def entering(elements: Elements) -> Index:
    """The elements that are such arcs."""
    return np.flatnonzero(elements.first & elements.arc)


def centre_on(end: Array, toward: Array, start: Array) -> Array:
    """(k, 2) centres of arcs from `start` to `end` (k, 2), on the line through the end and the points
    `toward`. NaN where the start lies across that line, so that there is none."""
    way = toward - end
    with np.errstate(divide="ignore", invalid="ignore"):
        way = way / np.hypot(*way.T)[:, None]
        back = start - end
        along, length = (back * way).sum(axis=1), np.hypot(*back.T)
        size = np.where(np.abs(along) < _ACROSS * length, np.nan, length**2 / (2 * along))
    return np.asarray(end + size[:, None] * way)


def entry_arcs(elements: Elements, begin: Array, end: Array) -> tuple[Index, Array, Array]:
    """The elements that enter a contour on an arc, and of the tool's path there the centres (m, 2) and the
    sweeps (m,) in rad. `begin` and `end` (k, 2) are the ends of the tool's path along all elements."""
    some = entering(elements)
    start, stop = begin[some], end[some]
    centre = centre_on(stop, elements.centre[some], start)
    a, b = start - centre, stop - centre
    sense = np.sign(elements.sweep[some])
    gone = sense * (np.arctan2(b[:, 1], b[:, 0]) - np.arctan2(a[:, 1], a[:, 0])) % (2 * np.pi)
    turns = np.maximum(np.ceil(np.abs(elements.sweep[some]) / (2 * np.pi) - 1e-9) - 1, 0)
    return some, centre, sense * (gone + 2 * np.pi * turns)
