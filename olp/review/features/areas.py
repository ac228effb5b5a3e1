"""Areas that coplanar feed moves cover: faced surfaces and floors of pockets.

The plane of a level is divided into square cells. Where passes lie no farther apart than a cell is wide, they
meet every cell of the area; single passes meet rows of cells. An area is where whole blocks of cells are met:
three by three cells as wide as the tool, or, for small areas, five by five of half that width. Where the
radius of the tool is not stated, what it covers is not known, so that no area is found.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.review.features.alike import alike, members
from olp.review.features.chains import Chains
from olp.review.features.moves import Moves

#: Width of a cell in diameters of the tool, and how many cells a block has on each side of its middle. A cell
#: is a little wider than the diameter, as passes that lie just that far apart touch each other.
_SCALES = ((1.01, 1), (0.505, 2))
#: Points of paths in a cell, along it.
_POINTS = 3
#: Points that are looked at at once.
_BLOCK = 1 << 18
#: Cells are numbered so that those of one row follow each other.
_ROW = 1 << 31
#: The cells around one, itself too.
_AROUND = np.array([a * _ROW + b for a in (-1, 0, 1) for b in (-1, 0, 1)])
#: Of a chain in an area at least this share is in it.
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
        for width, reach in _SCALES if radius > 0.0 else ():
            free = rows[area[rows] < 0]
            for some in _covered(chains, free, width * 2.0 * radius, reach):
                area[some] = count
                count += 1
    return Areas(area, _inner(moves, chains, area))


def _covered(chains: Chains, rows: Index, cell_mm: float, reach: int) -> Iterator[Index]:
    """The moves in each area of one level."""
    # the cells of a block are met by a path of that many cells
    least_mm = (2 * reach + 1) ** 2 * cell_mm
    if chains.length_mm[rows].sum() < least_mm:
        return
    met = np.unique(np.concatenate([np.unique(cell) for _, cell in _cells(chains, rows, cell_mm)]))
    cell = met
    for _ in range(reach):
        cell = cell[np.logical_and.reduce([_among(cell, cell + step) for step in _AROUND.tolist()])]
    if not len(cell):
        return
    for _ in range(reach):
        cell = np.unique(cell[:, None] + _AROUND)
    owner = _components(cell)
    hits = np.zeros((len(rows), 2))
    best = np.full(len(rows), -1, np.int64)
    for move, met_by in _cells(chains, rows, cell_mm):
        place = np.minimum(np.searchsorted(cell, met_by), len(cell) - 1)
        inside = _among(cell, met_by)
        hits[:, 0] += np.bincount(move, minlength=len(rows))
        hits[:, 1] += np.bincount(move[inside], minlength=len(rows))
        best[move[inside]] = owner[place[inside]]
    own = (best >= 0) & (hits[:, 1] >= _INSIDE * hits[:, 0])
    for k in np.unique(best[own]).tolist():
        some = rows[own & (best == k)]
        if chains.length_mm[some].sum() >= least_mm:
            yield some


def _cells(chains: Chains, rows: Index, cell_mm: float) -> Iterator[tuple[Index, Index]]:
    """(k,) moves, counted among `rows`, and (k,) the cells that points along them are in."""
    count = np.ceil(chains.length_mm[rows] / cell_mm * _POINTS).astype(np.int64) + 1
    ends = np.cumsum(count)
    cuts: Index = np.searchsorted(ends, np.arange(_BLOCK, ends[-1] + _BLOCK, _BLOCK)) + 1
    for part in np.split(np.arange(len(rows)), np.unique(np.minimum(cuts, len(rows)))):
        move = np.repeat(part, count[part])
        within = np.arange(len(move)) - np.repeat(np.cumsum(count[part]) - count[part], count[part])
        share = within / np.maximum(count[move] - 1, 1)
        point = chains.points(rows[move], share)
        # an offset that no digit of a program has keeps points off the edges of cells
        number = np.floor(point / cell_mm + np.sqrt(0.5)).astype(np.int64)
        yield move, number[:, 0] * _ROW + number[:, 1]


def _among(sorted_values: Index, values: Index) -> Mask:
    if not len(sorted_values):
        return np.zeros(len(values), bool)
    place = np.minimum(np.searchsorted(sorted_values, values), len(sorted_values) - 1)
    return np.asarray(sorted_values[place] == values)


def _components(cell: Index) -> Index:
    """(k,) the component of each of the cells (k,), rising: cells that touch each other."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    pairs = []
    for step in (1, _ROW - 1, _ROW, _ROW + 1):
        there = np.minimum(np.searchsorted(cell, cell + step), len(cell) - 1)
        mine = np.flatnonzero(cell[there] == cell + step)
        pairs.append((mine, there[mine]))
    first, second = (np.concatenate([pair[k] for pair in pairs]) for k in (0, 1))
    graph = coo_array((np.ones(len(first), np.int8), (first, second)), shape=(len(cell), len(cell)))
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)


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
