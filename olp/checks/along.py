"""Figures of a whole nominal path: the largest and the rms of a size at its waypoints and between them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.geometry import arc_points
from olp.core.toolpath import Flag, Toolpath
from olp.proof.deviation import cutting_moves

#: waypoints that are sampled at most
_WAYPOINTS = 4096
#: samples between waypoints, over the length of all moves that cut
_BETWEEN = 8192
#: the largest samples of each size, around which more are taken
_LARGEST = 8
#: more samples on either side of each of them
_AROUND = 8
#: fraction of the golden section: samples so spread keep no step with the period of a cyclic error
_GOLDEN = (5.0**0.5 - 1.0) / 2.0
#: moves that are left as they are
_AWAY = np.uint8(Flag.PASS | Flag.CONTROL | Flag.MACHINE)

#: Sizes by name at points (n, 3) of moves (n,): pairs of a name and (n,) values of 0 or above.
Sizes = Callable[[Array, Index], Iterable[tuple[str, Array]]]


@dataclass(frozen=True, slots=True)
class Figure:
    """The largest and the rms of one size over a path."""

    name: str
    largest: float
    rms: float


@dataclass(frozen=True, slots=True, eq=False)
class _Places:
    """(m,) `move` and the `share` of it, 1 at its end."""

    move: Index
    share: Array


def figures(path: Toolpath, sizes: Sizes) -> list[Figure]:
    """Of each size in the order in which `sizes` names them; none where no waypoint is known.

    Both are of waypoints and of samples between them, which are even over the length of what cuts. Around the
    largest samples more are taken. A rapid counts with its end alone.
    """
    known = np.flatnonzero(np.isfinite(path.end_mm).all(axis=1))
    if not len(known):
        return []
    pick = known[np.linspace(0, len(known) - 1, min(len(known), _WAYPOINTS)).astype(np.int64)]
    length = _lengths(path)
    between, step_mm = _between(length)
    places = _Places(
        np.concatenate((pick, between.move)), np.concatenate((np.ones(len(pick)), between.share))
    )
    values = _named(sizes(_points(path, places), places.move))
    near = _near(places, values, length, step_mm)
    more = _named(sizes(_points(path, near), near.move)) if len(near.move) else {}
    return [
        Figure(
            name,
            max(float(value.max()), float(more[name, number].max()) if (name, number) in more else 0.0),
            float(np.sqrt(np.mean(value * value))),
        )
        for (name, number), value in values.items()
    ]


def _named(pairs: Iterable[tuple[str, Array]]) -> dict[tuple[str, int], Array]:
    """Values by name; two of one name, such as two cyclic errors of a component, are numbered."""
    values: dict[tuple[str, int], Array] = {}
    for name, value in pairs:
        number = 0
        while (name, number) in values:
            number += 1
        values[name, number] = value
    return values


def _lengths(path: Toolpath) -> Array:
    """(n,) length in mm of each move that cuts, 0 for others."""
    start = path.starts_mm()
    away = path.end_mm - start
    length = np.sqrt(np.einsum("ij,ij->i", away, away))
    arcs = path.arcs
    if len(arcs):
        begin = start[arcs.move] - arcs.centre_mm
        begin[np.arange(len(arcs)), (arcs.plane + 2) % 3] = 0.0
        radius = np.sqrt(np.einsum("ij,ij->i", begin, begin))
        length[arcs.move] = np.maximum(length[arcs.move], radius * np.abs(arcs.sweep_rad))
    cuts = cutting_moves(path) & ((path.flag & _AWAY) == 0)
    return np.where(cuts, np.nan_to_num(length), 0.0)


def _between(length: Array) -> tuple[_Places, float]:
    """Places between waypoints, one in each of so many equal parts of all lengths, and the length of a
    part."""
    ends = np.cumsum(length)
    if not ends[-1] > 0.0:
        return _Places(np.zeros(0, np.int64), np.zeros(0)), 0.0
    part = np.arange(_BETWEEN)
    place_mm = (part + np.mod(part * _GOLDEN, 1.0)) * (ends[-1] / _BETWEEN)
    move = np.minimum(np.searchsorted(ends, place_mm, side="right"), int(np.flatnonzero(length)[-1]))
    share = (place_mm - (ends - length)[move]) / length[move]
    return _Places(move, np.clip(share, 0.0, 1.0)), float(ends[-1]) / _BETWEEN


def _near(places: _Places, values: dict[tuple[str, int], Array], length: Array, step_mm: float) -> _Places:
    """More places within two steps of the largest values, on the same moves."""
    tops = [np.argpartition(value, -min(_LARGEST, len(value)))[-_LARGEST:] for value in values.values()]
    top = np.unique(np.concatenate([np.zeros(0, np.int64), *tops]))
    top = top[length[places.move[top]] > 0.0]
    offset_mm = np.linspace(-2.0, 2.0, 4 * _AROUND + 1) * step_mm
    move = np.repeat(places.move[top], len(offset_mm))
    share = places.share[top][:, None] + offset_mm / length[places.move[top]][:, None]
    return _Places(move, np.clip(share, 0.0, 1.0).ravel())


def _points(path: Toolpath, places: _Places) -> Array:
    """(m, 3) axis positions."""
    points = path.end_mm[places.move].copy()
    inside = np.flatnonzero(places.share < 1.0)
    move, share = places.move[inside], places.share[inside]
    start, end = path.starts_mm()[move], path.end_mm[move]
    points[inside] = start + share[:, None] * (end - start)
    arcs = path.arcs
    if len(arcs):
        index = np.full(len(path), -1, np.int64)
        index[arcs.move] = np.arange(len(arcs))
        curved = np.flatnonzero(index[move] >= 0)
        which = index[move[curved]]
        points[inside[curved]] = arc_points(
            start[curved], end[curved], arcs.centre_mm[which], arcs.plane[which], arcs.sweep_rad[which],
            share[curved],
        )  # fmt: skip
    return points
