"""Circular moves with their centres: arcs of the program, and circles that it states as short chords.

A run of at least twelve chords is a part of a circle where its vertices lie on one circle and the chords turn
evenly one way. The path leaves the circle at both ends: any smooth curve is near a circle for a while.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.geometry import PLANES
from olp.core.values import dataclass
from olp.review.features.chains import Chains
from olp.review.features.fits import circle_of_powers
from olp.review.features.moves import Does, Moves

#: Fewest chords of a circle.
CHORDS = 12
#: Chords turn by at most this, in rad.
_TURN = np.pi / 6
#: No chord is longer than this many of the usual ones.
_EVEN = 3.0
#: A circle through three of the vertices is at most so many times as far from the others as the best one.
_LOOSE = 4.0
#: Beyond the ends of a circle the path is off it by this many times what its vertices may be. A curve with
#: evenly changing curvature is off by four times as much an eighth of the length beyond.
_LEAVES = 5.0
#: So many chords before twelve on a circle the path is off it, by this many times what they are. A curve with
#: evenly changing curvature is off by sixteen times as much there.
_BEFORE = 6
_DRIFTS = 20.0
#: The chords that a circle is found in bend by at least so many times what their vertices may be off.
_BENT = 10.0
#: Runs of twelve chords that are looked at at once.
_BLOCK = 1 << 12
#: Arcs of a spline turn by less than this, in rad, and are no longer than this many of the moves beside them.
_LEAST_TURN = np.pi / 18
_LONG = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class Circular:
    """The k circular moves of a program: (k,) `row` and `radius_mm`. In rad (k,) `begin` is the angle at
    which each begins, and `sweep` by how much it goes on. (k, 3) `centre` and the unit vectors `first` and
    `second` of the plane are in the frame shown. (k,) `rise`: it changes its level on the way."""

    row: Index
    centre: Array
    first: Array
    second: Array
    radius_mm: Array
    begin: Array
    sweep: Array
    rise: Mask

    def take(self, which: Index | Mask) -> Circular:
        """Some of them."""
        return Circular(
            self.row[which], self.centre[which], self.first[which], self.second[which],
            self.radius_mm[which], self.begin[which], self.sweep[which], self.rise[which],
        )  # fmt: skip

    @staticmethod
    def joined(parts: list[Circular]) -> Circular:
        """All moves of several, in program order."""
        names = ("row", "centre", "first", "second", "radius_mm", "begin", "sweep", "rise")
        columns = [np.concatenate([getattr(part, name) for part in parts]) for name in names]
        every = Circular(*columns)
        return every.take(np.argsort(every.row, kind="stable"))


def arcs_of(moves: Moves) -> Circular:
    """The arcs of a path, without those of freeform stretches and of splines."""
    path, arcs = moves.path, moves.path.arcs
    usable = (moves.does[arcs.move] == Does.LEVEL_ARC) | (moves.does[arcs.move] == Does.OTHER_ARC)
    usable &= ~moves.freeform[moves.stretch[arcs.move]] if len(arcs) else usable
    usable &= (np.abs(arcs.sweep_rad) >= _LEAST_TURN) | _longer(moves, arcs.move)
    row = arcs.move[usable]
    axes = np.array(PLANES)[arcs.plane[usable]]
    unit = np.eye(3)
    start = moves.starts_mm(row)
    arm = start - arcs.centre_mm[usable]
    every = np.arange(len(row))
    x, y = arm[every, axes[:, 0]], arm[every, axes[:, 1]]
    rise = path.end_mm[row, axes[:, 2]] - start[every, axes[:, 2]]
    return Circular(
        row, moves.shown(row, arcs.centre_mm[usable]), unit[axes[:, 0]], unit[axes[:, 1]], np.hypot(x, y),
        np.arctan2(y, x), arcs.sweep_rad[usable], np.abs(rise) > moves.near_mm,
    )  # fmt: skip


def _longer(moves: Moves, row: Index) -> Mask:
    """(k,) moves that are much longer than the feed moves beside them."""
    feed = np.where(moves.does == Does.RAPID, 0.0, np.nan_to_num(moves.length_mm))
    padded = np.concatenate(([0.0], feed, [0.0]))
    return np.asarray(feed[row] > _LONG * np.maximum(padded[row], padded[row + 2]))


def chords_of(moves: Moves, chains: Chains) -> Circular:
    """Chords of circles among the lines of chains."""
    found = [part for a, b in _runs(chains) for part in _fitted(moves, chains, a, b)]
    return Circular.joined(found) if found else arcs_of(moves).take(np.zeros(0, np.int64))


def _runs(chains: Chains) -> Iterator[tuple[int, int]]:
    """Runs `a`..`b` of at least twelve lines, each of which turns a little to the same side."""
    step = (chains.end - chains.start)[:, :2]
    line = chains.straight
    linked = chains.linked()[:-1] & line[:-1] & line[1:]
    turn = np.arctan2(
        step[:-1, 0] * step[1:, 1] - step[:-1, 1] * step[1:, 0],
        step[:-1, 0] * step[1:, 0] + step[:-1, 1] * step[1:, 1],
    )
    side = np.where(linked & (np.abs(turn) <= _TURN), np.sign(turn), 0.0)
    edges = np.flatnonzero(np.diff(side, prepend=0.0, append=0.0))
    for begin, end in pairwise(edges.tolist()):
        # links begin..end are between lines begin..end + 1
        if side[begin] != 0.0 and end + 1 - begin >= CHORDS:
            yield begin, end + 1


@dataclass(frozen=True, slots=True, eq=False)
class _Run:
    """A run of k chords: (k + 1, 2) vertices and (k,) lengths."""

    vertices: Array
    length: Array
    near_mm: float

    @staticmethod
    def of(moves: Moves, chains: Chains, a: int, b: int) -> _Run:
        vertices = np.concatenate((chains.start[a:b, :2], chains.end[b - 1 : b, :2]))
        return _Run(vertices, chains.length_mm[a:b], moves.near_mm)

    def likely(self) -> list[tuple[int, int]]:
        """Chords with which a circle may begin, and how many of them to begin with, rising."""
        found: list[tuple[int, int]] = []
        stride = 1
        while CHORDS * stride <= len(self.length):
            found += [(begin, CHORDS * stride) for begin in self._bent(stride).tolist()]
            stride *= 4
        return sorted(found)

    def _bent(self, stride: int) -> Index:
        """The chords at which twelve times `stride` chords begin that lie on the circle through three of
        their vertices, bend well, and before which the path is off that circle."""
        rows = np.arange(len(self.length) - CHORDS * stride + 1)
        found = []
        for part in np.array_split(rows, 1 + len(rows) // _BLOCK):
            points = self.vertices[part[:, None] + stride * np.arange(CHORDS + 1)]
            begin = points[:, 0]
            p, q = points[:, CHORDS // 2] - begin, points[:, CHORDS] - begin
            with np.errstate(invalid="ignore", divide="ignore"):
                p2, q2 = (p**2).sum(axis=1), (q**2).sum(axis=1)
                twice = 2.0 * (p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0])
                x = begin[:, 0] + (q[:, 1] * p2 - p[:, 1] * q2) / twice
                y = begin[:, 1] + (p[:, 0] * q2 - q[:, 0] * p2) / twice
                radius = np.hypot(begin[:, 0] - x, begin[:, 1] - y)
                away = np.hypot(points[:, :, 0] - x[:, None], points[:, :, 1] - y[:, None])
                # how far the middle is from the line through the ends
                bend = np.abs(twice) / 2.0 / np.sqrt(q2)
            ripple = np.abs(away - radius[:, None]).max(axis=1)
            # this circle is not the best one
            on = (ripple <= _LOOSE * self.near_mm) & ~(bend < _BENT * self.near_mm)
            before = part - _BEFORE * stride
            there = self.vertices[np.maximum(before, 0)]
            off = np.abs(np.hypot(there[:, 0] - x, there[:, 1] - y) - radius)
            leaves = off > np.maximum(_LEAVES * self.near_mm, _DRIFTS * ripple)
            # a chord that is too long is none of the circle, though its ends may be on it
            leaves |= self.length[np.maximum(part - 1, 0)] > _EVEN * self.length[part]
            found.append(part[on & ((before < 0) | leaves)])
        return np.concatenate(found)

    def on_circle(self, a: int, b: int) -> tuple[float, float, float] | None:
        """Centre and radius of the circle of chords a..b; None where they lie on none, or are uneven."""
        length = self.length[a:b]
        if length.max() > _EVEN * np.median(length):
            return None
        points = self.vertices[a : b + 1]
        middle = points.mean(axis=0)
        x, y, radius = circle_of_powers(*(points - middle).T)
        found = (float(middle[0]) + x, float(middle[1]) + y, radius)
        return found if self._away(points, found).max() <= self.near_mm else None

    def ends(self, a: int, b: int, circle: tuple[float, float, float]) -> bool:
        """Whether the path is off a circle an eighth of its chords before a and behind b, or goes on with a
        chord that is too long. A curve of changing curvature goes on near it."""
        beyond = max((b - a) // 8, 1)
        usual = _EVEN * float(np.median(self.length[a:b]))
        for there, chord in ((a - beyond, a - 1), (b + beyond, b)):
            if not 0 <= there < len(self.vertices) or self.length[chord] > usual:
                continue
            if self._away(self.vertices[there : there + 1], circle)[0] <= _LEAVES * self.near_mm:
                return False
        return True

    @staticmethod
    def _away(points: Array, circle: tuple[float, float, float]) -> Array:
        x, y, radius = circle
        return np.asarray(np.abs(np.hypot(points[:, 0] - x, points[:, 1] - y) - radius))


def _fitted(moves: Moves, chains: Chains, a: int, b: int) -> Iterator[Circular]:
    """The parts of lines a..b that lie on one circle each, as long as possible, one after the other."""
    run = _Run.of(moves, chains, a, b)
    done, count = 0, b - a
    for begin, chords in run.likely():
        if begin < done or run.on_circle(begin, begin + chords) is None:
            continue
        low, step = begin + chords, chords
        while low < count and run.on_circle(begin, min(low + step, count)) is not None:
            low = min(low + step, count)
            step *= 2
        high = min(low + step, count + 1)
        while high - low > 1:
            middle = (low + high) // 2
            if run.on_circle(begin, middle) is None:
                high = middle
            else:
                low = middle
        fitted = run.on_circle(begin, low)
        assert fitted is not None
        done = low
        if run.ends(begin, low, fitted):
            yield _chords(moves, chains, a + begin, a + low, fitted)


def _chords(moves: Moves, chains: Chains, a: int, b: int, fitted: tuple[float, float, float]) -> Circular:
    """Lines a..b as moves on a circle."""
    x, y, radius = fitted
    count = b - a
    turn = moves.turn(int(chains.row[a]))
    first = np.tile(turn[:, 0], (count, 1))
    second = np.tile(turn[:, 1], (count, 1))
    angles = [
        np.arctan2(points[:, 1] - y, points[:, 0] - x) for points in (chains.start[a:b], chains.end[a:b])
    ]
    sweep = np.mod(angles[1] - angles[0] + np.pi, 2.0 * np.pi) - np.pi
    centre = np.tile(turn @ np.array((x, y, chains.start[a, 2])), (count, 1))
    return Circular(
        chains.row[a:b],
        centre,
        first,
        second,
        np.full(count, radius),
        angles[0],
        sweep,
        np.zeros(count, bool),
    )
