"""How a motion uses its limits: by line of the program, and where it falls below half its feed.

Each piece is sampled in the middle and at both ends, weighted by the trapezoidal rule.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Protocol

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask
from olp.core.values import dataclass
from olp.trajectory.motion import Motion
from olp.trajectory.plan import Trajectory
from olp.trajectory.route import Route

#: the limits of a motion, in the order of the columns
LIMITS = (*(f"{axis} {what}" for what in ("velocity", "acceleration", "jerk") for axis in "XYZ"), "feed")
#: share of a limit from which it counts as reached
AT_LIMIT = 0.98
#: share of the feed below which a motion is slow
SLOW = 0.5
#: the samples of a piece, as shares of its time
_SHARE = np.array([0.0, 0.5, 1.0])
#: their weights
_WEIGHT = np.array([0.25, 0.5, 0.25])
#: pieces per block
_BLOCK = 1 << 13


class Tip(Protocol):
    """Where a feed is the speed of a tip that other axes move: of segments (m,) the ways `way_mm` and feeds
    `feed_mm_s` of the tip. The lines of the motion number its segments."""

    @property
    def way_mm(self) -> Array: ...

    @property
    def feed_mm_s(self) -> Array: ...

    def seen(self, position: Array, velocity: Array, segment: Index) -> tuple[Array, Array]:
        """Positions (n, 3) mm and speeds (n,) mm/s of the tip at (n, axes) positions and velocities of the
        motion."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class LineUse:
    """Of the m lines that move: (m,) `line`; `seconds` without dwells, and `dwell_s`; `length_mm` of the
    polyline.

    Of their feed moves only: `feed_seconds`, `feed_length_mm` and `feed_mm_s`, the programmed feed, averaged
    over the length where there are several (inf where all are rapids). `fastest_mm_s` is the top speed,
    `at_limit_s` (m, 10) the time at each of `LIMITS`, and `most` (m, 10) the largest use of it. With other
    axes these are three times as many limits in the same order, and the feed."""

    line: Index
    seconds: Array
    dwell_s: Array
    length_mm: Array
    feed_seconds: Array
    feed_length_mm: Array
    feed_mm_s: Array
    fastest_mm_s: Array
    at_limit_s: Array
    most: Array

    def __len__(self) -> int:
        return len(self.line)

    def achieved_mm_s(self) -> Array:
        """(m,) mean speed of the feed moves; of all moves where all are rapids; 0 where nothing moves."""
        rapid = ~np.isfinite(self.feed_mm_s)
        return _over(
            np.where(rapid, self.length_mm, self.feed_length_mm),
            np.where(rapid, self.seconds, self.feed_seconds),
        )

    def lost_s(self) -> Array:
        """(m,) time of the feed moves beyond that at their feed."""
        return np.asarray(self.feed_seconds - _over(self.feed_length_mm, self.feed_mm_s))

    def limit(self) -> Index:
        """(m,) which of `LIMITS` slows the line down: the one reached for the longest time, else the one used
        most."""
        return _limit(self.at_limit_s, self.most)

    @staticmethod
    def joined(parts: Sequence[LineUse]) -> LineUse:
        """Lines of several stretches; lines of the same number are added."""
        if len(parts) == 1:
            return parts[0]
        return LineUse._added(parts)

    def numbered(self, line: Index) -> LineUse:
        """The same with other numbers (m,) of the lines; lines that get the same number are added."""
        return LineUse._added([replace(self, line=line)])

    @staticmethod
    def _added(parts: Sequence[LineUse]) -> LineUse:
        if not parts:
            none, wide = np.zeros(0), np.zeros((0, len(LIMITS)))
            return LineUse(none.astype(np.int64), none, none, none, none, none, none, none, wide, wide)
        columns = {f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(LineUse)}
        line, row = np.unique(columns["line"], return_inverse=True)
        table: dict[str, Array] = {}
        nominal = _over(columns["feed_length_mm"], columns["feed_mm_s"])
        for name, values in columns.items():
            if name in ("fastest_mm_s", "most"):
                table[name] = np.zeros((len(line), *values.shape[1:]))
                np.maximum.at(table[name], row, values)
            else:
                table[name] = np.zeros((len(line), *values.shape[1:]))
                np.add.at(table[name], row, values)
        table["feed_mm_s"] = _feed(table["feed_length_mm"], _sums(row, nominal, len(line)))
        return LineUse(line.astype(np.int64), **{k: v for k, v in table.items() if k != "line"})


@dataclass(frozen=True, slots=True, eq=False)
class SlowStretches:
    """(k,) stretches in order in which the speed is below half the feed.

    `start_s` and `seconds`; `lost_s` against the feed; where the stretch is slowest, `line`, `position_mm`
    (k, 3), `slowest_mm_s` and `feed_mm_s`; and which of `LIMITS` slows it down, as for lines."""

    start_s: Array
    seconds: Array
    lost_s: Array
    line: Index
    position_mm: Array
    slowest_mm_s: Array
    feed_mm_s: Array
    limit: Index

    def __len__(self) -> int:
        return len(self.line)


def usage(trajectory: Trajectory, route: Route, tip: Tip | None = None) -> tuple[LineUse, SlowStretches]:
    """How the motion along a route uses its limits, by line and in slow stretches. Lengths, speeds and feeds
    are those of the `tip` where it is given."""
    motion, limits = trajectory.motion, trajectory.limits
    line, row = np.unique(motion.line, return_inverse=True)
    count, axes = len(line), motion.axes
    wide = 3 * axes + 1
    feed = feeds_of_pieces(motion, route) if tip is None else tip.feed_mm_s[motion.line]
    bounds = (limits.velocity, limits.acceleration, limits.jerk)
    still: Mask = np.logical_not(motion.time[:, 1:].any(axis=1))
    at_limit, most = np.zeros((count, wide)), np.zeros((count, wide))
    fastest = np.zeros(count)
    stretches = _StretchCollector(wide)
    for a in range(0, len(motion), _BLOCK):
        piece = np.arange(a, min(a + _BLOCK, len(motion)))
        width = motion.start_s[piece + 1] - motion.start_s[piece]
        # sample by sample, all pieces each time: sums over the few samples are then sums of long rows
        shape, tiled = (len(_SHARE), len(piece), axes), np.tile(piece, len(_SHARE))
        flat = motion.of(tiled, (_SHARE[:, None] * width).ravel())
        states = [state.reshape(shape) for state in flat]
        if tip is None:
            place, speed = states[0], np.sqrt((states[1] * states[1]).sum(axis=2))
        else:
            at, fast = tip.seen(flat[0], flat[1], motion.line[tiled])
            place, speed = at.reshape(*shape[:2], 3), fast.reshape(shape[:2])
        use = np.empty((*shape[:2], wide))
        for i, bound in enumerate(bounds):
            np.abs(states[i + 1] / bound, out=use[:, :, axes * i : axes * (i + 1)])
        use[:, :, -1] = speed / feed[piece]
        weight = _WEIGHT[:, None] * width
        held = weight[:, :, None] * (use >= AT_LIMIT)
        first = np.flatnonzero(np.diff(row[piece], prepend=-1))
        own = row[piece[first]]
        np.add.at(at_limit, own, np.add.reduceat(held.sum(axis=0), first))
        np.maximum.at(most, own, np.maximum.reduceat(use.max(axis=0), first))
        np.maximum.at(fastest, own, np.maximum.reduceat(speed.max(axis=0), first))
        time = motion.start_s[piece] + _SHARE[:, None] * width
        moving = np.flatnonzero(~still[piece])
        stretches.add(
            time[:, moving], speed[:, moving], feed[piece[moving]], motion.line[piece[moving]],
            place[:, moving], held[:, moving], use[:, moving],
        )  # fmt: skip
    width = np.diff(motion.start_s)
    cutting = np.isfinite(feed) & ~still
    if tip is None:
        way = np.sqrt((np.diff(route.point_mm, axis=0) ** 2).sum(axis=1))
        length, feed_length, nominal = _lengths(way, route.feed_mm_s, route.line, line)
    else:
        length, feed_length, nominal = _lengths(tip.way_mm, tip.feed_mm_s, route.line, line)
    return (
        LineUse(
            line.astype(np.int64), _sums(row, width * ~still, count),
            _sums(row, width * still, count), length,
            _sums(row, width * cutting, count), feed_length, _feed(feed_length, nominal),
            fastest, at_limit, most,
        ),
        stretches.gathered(),
    )  # fmt: skip


def _lengths(way_mm: Array, feed_mm_s: Array, moved: Index, line: Index) -> tuple[Array, Array, Array]:
    """Of each line (m,): the length of its moves, that of its feed moves, and their time at their feed. The
    lines of the moves are `moved`.

    Lines whose moves are too short for pieces of their own are left out.
    """
    index = np.minimum(np.searchsorted(line, moved), len(line) - 1)
    own = line[index] == moved
    fed = np.where(np.isfinite(feed_mm_s), way_mm, 0.0)
    columns = (way_mm, fed, fed / feed_mm_s)
    length, feed_length, nominal = (_sums(index[own], column[own], len(line)) for column in columns)
    return length, feed_length, nominal


def feeds_of_pieces(motion: Motion, route: Route) -> Array:
    """(n,) the feed of the segment that each piece of the motion drives.

    A line has one feed, or moves with several (canned cycles). Their pieces are assigned by how much of the
    line's length lies before a piece.
    """
    order = np.argsort(route.line, kind="stable")
    line, first = np.unique(route.line[order], return_index=True)
    if not len(line):
        return np.full(len(motion), np.inf)
    feed = route.feed_mm_s[order]
    low, high = np.minimum.reduceat(feed, first), np.maximum.reduceat(feed, first)
    index = np.minimum(np.searchsorted(line, motion.line), len(line) - 1)
    piece_feed = high[index]
    mixed = np.flatnonzero(low < high)
    if not len(mixed):
        return np.asarray(piece_feed, float)
    step = np.sqrt((np.diff(route.point_mm, axis=0) ** 2).sum(axis=1))[order]
    stop = np.append(first[1:], len(feed))
    by_line = np.argsort(motion.line, kind="stable")
    edges = np.searchsorted(motion.line[by_line], line[mixed])
    ends = np.searchsorted(motion.line[by_line], line[mixed], side="right")
    for k, a, b in zip(mixed.tolist(), edges.tolist(), ends.tolist(), strict=True):
        if a == b:
            continue
        piece = by_line[a:b]
        width = motion.start_s[piece + 1] - motion.start_s[piece]
        begin, end = motion.positions(piece, np.zeros(len(piece))), motion.positions(piece, width)
        length = np.sqrt(((end - begin) ** 2).sum(axis=1))
        done = (np.cumsum(length) - 0.5 * length) / max(float(length.sum()), 1e-300)
        own = slice(int(first[k]), int(stop[k]))
        limit = np.cumsum(step[own]) / max(float(step[own].sum()), 1e-300)
        piece_feed[piece] = feed[own][np.minimum(np.searchsorted(limit, done), len(limit) - 1)]
    return np.asarray(piece_feed, float)


class _StretchCollector:
    """Collects slow stretches, which may begin in one block of pieces and end in a later one."""

    def __init__(self, wide: int) -> None:
        self._wide = wide
        self._count = 0
        self._slow = False
        self._rows: list[tuple[Array, ...]] = []

    def add(
        self, time: Array, speed: Array, feed: Array, line: Index, position: Array, held: Array, use: Array
    ) -> None:
        """Add k samples (k, n) of n pieces: positions (k, n, 3), time at limits and use of them (k, n, wide);
        feed and line (n,) of each piece."""
        flat = ((speed < SLOW * feed) & np.isfinite(feed)).T.ravel()
        if not flat.size:
            return
        begins = flat & ~np.concatenate(([self._slow], flat[:-1]))
        number = self._count + np.cumsum(begins) - 1
        self._count, self._slow = self._count + int(begins.sum()), bool(flat[-1])
        sample = np.flatnonzero(flat)
        if not len(sample):
            return
        piece, part = np.divmod(sample, len(speed))
        seconds, lost = _below(time[:, piece], speed[:, piece] / feed[piece], part)
        columns = (
            number[sample].astype(float), time[part, piece], seconds, lost, speed[part, piece], feed[piece],
            line[piece].astype(float), *position[part, piece].T, *held[part, piece].T,
            *use[part, piece].T,
        )  # fmt: skip
        # the samples of a block are many, the stretches few
        self._rows.append(_reduced(columns))

    def gathered(self) -> SlowStretches:
        empty = tuple(np.zeros(0) for _ in range(10 + 2 * self._wide))
        rows = self._rows or [empty]
        columns = _reduced(tuple(np.concatenate(c) for c in zip(*rows, strict=True)))
        _, time, weight, lost, speed, feed, line, x, y, z = columns[:10]
        held, most = np.split(np.stack(columns[10:], axis=1), 2, axis=1)
        limit = _limit(held, most)
        return SlowStretches(
            time, weight, lost, line.astype(np.int64), np.stack((x, y, z), axis=1), speed, feed, limit,
        )  # fmt: skip


def _below(time: Array, share: Array, sample: Index) -> tuple[Array, Array]:
    """(n,) the time below half the feed around each slow sample, and how much of it is lost against the feed.

    `time` and `share` of the feed (k, n) are those of the k samples of its piece; its number in that piece is
    `sample` (n,). Between two slow samples each has half of the time. Next to a fast one it has the part
    below half the feed.
    """
    every = np.arange(len(sample))
    own = share[sample, every]
    seconds, lost = np.zeros(len(sample)), np.zeros(len(sample))
    for step in (-1, 1):
        beside = sample + step
        inside = (beside >= 0) & (beside < len(share))
        beside = np.where(inside, beside, sample)
        other = share[beside, every]
        span = np.abs(time[beside, every] - time[sample, every])
        slow = other < SLOW
        part = np.where(slow, 0.5, (SLOW - own) / np.where(slow, 1.0, other - own)) * span
        # mean share: over the nearer half up to a slow neighbour, or over all up to half the feed
        mean = np.where(slow, 0.75 * own + 0.25 * other, 0.5 * (own + SLOW))
        seconds += part
        lost += part * (1.0 - mean)
    return seconds, lost


def _reduced(columns: tuple[Array, ...]) -> tuple[Array, ...]:
    """One row per stretch: the earliest time, sums of times, and other values where the speed is least."""
    number, time, weight, lost, speed, *rest = columns
    if not len(number):
        return columns
    first = np.flatnonzero(np.diff(number, prepend=-1.0))
    slowest = np.lexsort((speed, number))[first]
    half = 5 + (len(rest) - 5) // 2
    held = [np.add.reduceat(column, first) for column in rest[5:half]]
    held += [np.maximum.reduceat(column, first) for column in rest[half:]]
    return (
        number[first], time[first], np.add.reduceat(weight, first), np.add.reduceat(lost, first),
        speed[slowest], *(column[slowest] for column in rest[:5]), *held,
    )  # fmt: skip


def _limit(at_limit_s: Array, most: Array) -> Index:
    """(n,) which of `LIMITS` is reached for the longest time; where none is, the one used most."""
    reached = at_limit_s.max(axis=1) > 0.0
    limit = np.where(reached, at_limit_s.argmax(axis=1), most.argmax(axis=1))
    return np.asarray(limit, np.int64)


def _sums(row: npt.NDArray[np.intp], values: Array, count: int) -> Array:
    """(count,) sums of values by row."""
    return np.asarray(np.bincount(row, values, minlength=count), float)


def _feed(length: Array, nominal_s: Array) -> Array:
    """Mean feed over the length; inf where no move has one."""
    return np.where(nominal_s > 0.0, length / np.where(nominal_s > 0.0, nominal_s, 1.0), np.inf)


def _over(above: Array, below: Array) -> Array:
    """Quotients, 0 where the divisor is 0."""
    good = below > 0.0
    return np.asarray(np.where(good, above / np.where(good, below, 1.0), 0.0), float)
