"""Areas that coplanar feed moves cover: faced surfaces and floors of pockets.

The plane of a level is divided into square cells, three to the width of the tool. What a pass meets, and the
cells around, is covered: passes that lie no farther apart than the tool is wide leave no gap. An area is
where whole blocks of seven by seven cells are covered, which a pass and its neighbour alone do not. Where the
radius of the tool is not stated, what it covers is not known, so that no area is found; nor is one in a level
that has too many cells.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask
from olp.core.values import dataclass
from olp.review.features.alike import alike, members
from olp.review.features.chains import Chains
from olp.review.features.moves import Moves

#: Width of a cell in radii of the tool: a little more than a third of its diameter, as passes that lie a
#: diameter apart touch each other.
_CELL = 0.674
#: Cells on a side of a block.
_BLOCK_CELLS = 7
#: Fewest moves of an area: two rings alone are a wall cut twice.
_FEWEST = 5
#: Most cells of a level.
_MOST_CELLS = 16_000_000
#: Points of paths in a cell, along it.
_POINTS = 2
#: Points that are looked at at once.
_BLOCK = 1 << 18
#: Of a chain, or of a move, in an area at least this share is in it.
_INSIDE = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Areas:
    """(m,) the `area` of each move of the chains, from 0, or -1; (c,) `inner`: chains that only clear an
    area, so that they are no walls of the part."""

    area: Index
    inner: Mask


def areas_of(moves: Moves, chains: Chains) -> Areas:
    """The areas of the chains of a program."""
    area = np.full(len(chains.row), -1, np.int64)
    tool = moves.scene.table.tool[chains.row]
    operation, turn = moves.operation[chains.row], moves.turn_of(chains.row)
    group = alike((operation, turn, chains.end[:, 2]), (0, 0, moves.near_mm))
    count = 0
    for rows in members(group):
        radius = moves.scene.tool_radii_mm.get(int(tool[rows[0]]), 0.0)
        for some in _covered(chains, rows, _CELL * radius) if radius > 0.0 else ():
            area[some] = count
            count += 1
    return Areas(area, _inner(moves, chains, area))


def _covered(chains: Chains, rows: Index, cell_mm: float) -> Iterator[Index]:
    """The moves in each area of one level."""
    from scipy.ndimage import label, maximum_filter, minimum_filter

    # two passes of a block
    least_mm = 2 * _BLOCK_CELLS * cell_mm
    if chains.length_mm[rows].sum() < least_mm:
        return
    ends = np.concatenate((chains.start[rows, :2], chains.end[rows, :2]))
    # arcs leave the box around their ends by half of their length at most
    bulge = float(np.where(chains.straight[rows], 0.0, chains.length_mm[rows] / 2.0).max())
    low = ends.min(axis=0) - bulge - _BLOCK_CELLS * cell_mm
    size = np.ceil((ends.max(axis=0) + bulge - low) / cell_mm).astype(np.int64) + _BLOCK_CELLS
    if size.prod() > _MOST_CELLS:
        return
    met = np.zeros(size, np.uint8)
    for _, cell in _cells(chains, rows, low, cell_mm):
        met[cell[:, 0], cell[:, 1]] = 1
    whole = minimum_filter(maximum_filter(met, 3, mode="constant"), _BLOCK_CELLS, mode="constant")
    owner, count = label(maximum_filter(whole, _BLOCK_CELLS, mode="constant"), np.ones((3, 3)))
    if not count:
        return
    hits = np.zeros((2, len(rows)))
    best = np.zeros(len(rows), np.int64)
    for move, cell in _cells(chains, rows, low, cell_mm):
        own = owner[cell[:, 0], cell[:, 1]]
        hits[0] += np.bincount(move, minlength=len(rows))
        hits[1] += np.bincount(move[own > 0], minlength=len(rows))
        best[move[own > 0]] = own[own > 0]
    inside = hits[1] >= _INSIDE * hits[0]
    for k in range(1, count + 1):
        some = rows[inside & (best == k)]
        if len(some) >= _FEWEST and chains.length_mm[some].sum() >= least_mm:
            yield some


def _cells(
    chains: Chains, rows: Index, low: Array, cell_mm: float
) -> Iterator[tuple[Index, npt.NDArray[np.int64]]]:
    """(k,) moves, counted among `rows`, and (k, 2) the cells that points along them are in."""
    count = np.ceil(chains.length_mm[rows] / cell_mm * _POINTS).astype(np.int64) + 1
    ends = np.cumsum(count)
    cuts: Index = np.searchsorted(ends, np.arange(_BLOCK, ends[-1] + _BLOCK, _BLOCK)) + 1
    for part in np.split(np.arange(len(rows)), np.unique(np.minimum(cuts, len(rows)))):
        move = np.repeat(part, count[part])
        within = np.arange(len(move)) - np.repeat(np.cumsum(count[part]) - count[part], count[part])
        share = within / np.maximum(count[move] - 1, 1)
        yield move, np.floor((chains.points(rows[move], share) - low) / cell_mm).astype(np.int64)


def _inner(moves: Moves, chains: Chains, area: Index) -> Mask:
    """(c,) chains that are for the most part in an area and are open, or closed and inside of a larger one of
    the same area and sense of rotation."""
    inner = np.zeros(len(chains), bool)
    if not (area >= 0).any():
        return inner
    inside = chains.sums(np.where(area >= 0, chains.length_mm, 0.0)) > _INSIDE * chains.sums(chains.length_mm)
    inner = inside & ~chains.closed
    rings = np.flatnonzero(inside & chains.closed)
    if not rings.size:
        return inner
    low, high, turned = _outlines(chains)
    most = np.full(len(chains), -1, np.int64)
    np.maximum.at(most, chains.chain, area)
    for ring in rings.tolist():
        others = rings[(most[rings] == most[ring]) & (rings != ring)]
        around = (low[others] <= low[ring] + moves.near_mm).all(axis=1)
        around &= (high[others] >= high[ring] - moves.near_mm).all(axis=1)
        around &= np.sign(turned[others]) == np.sign(turned[ring])
        around &= np.abs(turned[others]) > np.abs(turned[ring]) + moves.near_mm
        inner[ring] = bool(around.any())
    return inner


def _outlines(chains: Chains) -> tuple[Array, Array, Array]:
    """(c, 2) lowest and highest coordinates of chains, and (c,) twice the area inside, with the sign of the
    sense of rotation."""
    rows = np.arange(len(chains.row))
    low, high = np.full((len(chains), 2), np.inf), np.full((len(chains), 2), -np.inf)
    twice = np.zeros(len(chains))
    before = chains.start[:, :2]
    for share in np.linspace(0.0, 1.0, 9)[1:]:
        point = chains.points(rows, np.full(len(rows), share))
        np.minimum.at(low, chains.chain, np.minimum(point, before))
        np.maximum.at(high, chains.chain, np.maximum(point, before))
        twice += chains.sums(before[:, 0] * point[:, 1] - before[:, 1] * point[:, 0])
        before = point
    return low, high, twice
