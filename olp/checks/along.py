"""Figures of a whole nominal path: the largest and the rms of a size at its waypoints and between them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from olp.core.arrays import Array, Index, Mask, all_in_row, distinct
from olp.core.geometry import arc_points
from olp.core.toolpath import Flag, Toolpath
from olp.core.values import dataclass
from olp.program.text.columns import apart, marked, picked, spans
from olp.proof.deviation import cutting_moves

#: waypoints that are sampled at most
_WAYPOINTS = 4096
#: samples between waypoints, over the length of all moves that cut
_BETWEEN = 8192
#: the largest samples of each size, around which more are taken
_LARGEST = 8
#: moves that are looked at together
_BLOCK = 1 << 14
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
    """(m,) `move` and the `share` of it, 1 at its end; `length` of the move in mm."""

    move: Index
    share: Array
    length: Array


@dataclass(frozen=True, slots=True, eq=False)
class Along:
    """Where figures of a `path` are taken: at waypoints, and at samples between them `step_mm` apart, which
    are even over the length of what cuts. A rapid counts with its end alone."""

    path: Toolpath
    step_mm: float
    _places: _Places
    _point: Array

    @staticmethod
    def of(path: Toolpath) -> Along:
        """The places of a path; none where no waypoint is known."""
        pick = _waypoints(path)
        length = _lengths(path) if len(pick) else np.zeros(0)
        between, step_mm = _between(length)
        places = _Places(
            np.concatenate((pick, between.move)), np.concatenate((np.ones(len(pick)), between.share)),
            np.concatenate((picked(length, pick), between.length)),
        )  # fmt: skip
        return Along(path, step_mm, places, _points(path, places))

    def figures(self, sizes: Sizes) -> list[Figure]:
        """Of each size in the order in which `sizes` names them; none where no waypoint is known. Around the
        largest samples more are taken."""
        if not len(self._point):
            return []
        values = _named(sizes(self._point, self._places.move))
        near = _near(self._places, values, self.step_mm)
        more = _named(sizes(_points(self.path, near), near.move)) if len(near.move) else {}
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


def _waypoints(path: Toolpath) -> Index:
    """Some moves that end at a known position, evenly among all of them."""
    known = marked(len(path), lambda some: all_in_row(np.isfinite(path.end_mm[some])))
    count = sum(int(np.count_nonzero(known[some])) for some in spans(len(known)))
    pick = np.linspace(0, count - 1, min(count, _WAYPOINTS)).astype(np.int64)
    return pick if count == len(path) else _ordinal(known, pick)


def _ordinal(mask: Mask, pick: Index) -> Index:
    """(m,) the rows of those true entries of a mask whose numbers (m,), from 0 and rising, are picked."""
    rows, before = [np.zeros(0, np.int64)], 0
    for some in spans(len(mask)):
        own = np.flatnonzero(mask[some])
        first, last = np.searchsorted(pick, (before, before + len(own)))
        rows.append(some.start + own[pick[first:last] - before])
        before += len(own)
    return np.concatenate(rows)


def _lengths(path: Toolpath) -> Array:
    """(n,) length in mm of each move that cuts, 0 for others."""
    length = apart((len(path),), np.float64)
    for some in spans(len(path), _BLOCK):
        part = path.part(some.start, some.stop)
        cuts = cutting_moves(part) & ((part.flag & _AWAY) == 0)
        length[some] = np.where(cuts, np.nan_to_num(_own_lengths(part)), 0.0)
    return length


def _own_lengths(path: Toolpath) -> Array:
    """(n,) length in mm of each move, NaN where it is not known."""
    away, arcs = path.end_mm - path.starts_mm(), path.arcs
    length = np.sqrt(np.einsum("ij,ij->i", away, away))
    if len(arcs):
        begin = path.starts_mm()[arcs.move] - arcs.centre_mm
        begin[np.arange(len(arcs)), (arcs.plane + 2) % 3] = 0.0
        radius = np.sqrt(np.einsum("ij,ij->i", begin, begin))
        length[arcs.move] = np.maximum(length[arcs.move], radius * np.abs(arcs.sweep_rad))
    return np.asarray(length)


def _starts(path: Toolpath, move: Index) -> Array:
    """(m, 3) axis positions at the start of moves (m,)."""
    return np.where(
        (move > 0)[:, None], picked(path.end_mm, np.maximum(move - 1, 0)), np.array(path.start_mm)
    )


def _between(length: Array) -> tuple[_Places, float]:
    """Places between waypoints, one in each of so many equal parts of all lengths, and the length of a
    part."""
    whole, last = 0.0, 0
    for a, ends in _ends(length):
        whole, cuts = float(ends[-1]), np.flatnonzero(length[a : a + len(ends)] > 0.0)
        last = a + int(cuts[-1]) if cuts.size else last
    if not whole > 0.0:
        return _Places(np.zeros(0, np.int64), np.zeros(0), np.zeros(0)), 0.0
    part = np.arange(_BETWEEN)
    place_mm = (part + np.mod(part * _GOLDEN, 1.0)) * (whole / _BETWEEN)
    move, end, done = np.full(_BETWEEN, last), np.full(_BETWEEN, whole), 0
    for a, ends in _ends(length):
        some = slice(done, int(np.searchsorted(place_mm, ends[-1])))
        inside = np.searchsorted(ends, place_mm[some], side="right")
        move[some], end[some], done = a + inside, ends[inside], some.stop
    own = picked(length, move)
    share = (place_mm - (end - own)) / own
    return _Places(move, np.clip(share, 0.0, 1.0), own), whole / _BETWEEN


def _ends(length: Array) -> Iterator[tuple[int, Array]]:
    """Blocks of moves: the first of each, and (k,) the length of the path up to the end of each move."""
    before = 0.0
    for some in spans(len(length), _BLOCK):
        ends = np.cumsum(np.concatenate(([before], length[some])))[1:]
        yield some.start, ends
        before = float(ends[-1])


def _near(places: _Places, values: dict[tuple[str, int], Array], step_mm: float) -> _Places:
    """More places within two steps of the largest values, on the same moves."""
    tops = [np.argpartition(value, -min(_LARGEST, len(value)))[-_LARGEST:] for value in values.values()]
    top = distinct(np.concatenate([np.zeros(0, np.int64), *tops]))
    top = top[places.length[top] > 0.0]
    offset_mm = np.linspace(-2.0, 2.0, 4 * _AROUND + 1) * step_mm
    move, length = (np.repeat(column[top], len(offset_mm)) for column in (places.move, places.length))
    share = places.share[top][:, None] + offset_mm / places.length[top][:, None]
    return _Places(move, np.clip(share, 0.0, 1.0).ravel(), length)


def _points(path: Toolpath, places: _Places) -> Array:
    """(m, 3) axis positions."""
    points = picked(path.end_mm, places.move)
    inside = np.flatnonzero(places.share < 1.0)
    move, share = places.move[inside], places.share[inside]
    start, end = _starts(path, move), picked(path.end_mm, move)
    points[inside] = start + share[:, None] * (end - start)
    arcs = path.arcs
    if len(arcs):
        which = np.minimum(np.searchsorted(arcs.move, move), len(arcs) - 1)
        curved = np.flatnonzero(arcs.move[which] == move)
        which = which[curved]
        points[inside[curved]] = arc_points(
            start[curved], end[curved], arcs.centre_mm[which], arcs.plane[which], arcs.sweep_rad[which],
            share[curved],
        )  # fmt: skip
    return points
