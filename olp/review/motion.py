"""Times of samples on the re-timed motion, and its speeds with their limits."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index
from olp.core.errors import ProgramError
from olp.core.machine import Machine
from olp.core.toolpath import Toolpath
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.program.feeds.moves import lengths_mm
from olp.program.feeds.timing import timing
from olp.program.program import Program
from olp.review.samples import Samples

if TYPE_CHECKING:
    # a page without a planned motion does not load what plans one
    from olp.trajectory.motion import Motion
    from olp.trajectory.plan import Trajectory
    from olp.trajectory.route import Route

#: Most rows of a table of motion, about.
MOST_ROWS = 20_000
#: Pieces that are thinned at once, to bound memory.
_BLOCK = 1 << 16
#: Columns of a row of motion before those of the axes.
_STATED = 4
#: Difference of shares of a run that are equal but for rounding.
_ROUNDING = 1e-9
#: Sampled instants of a piece, as shares of its time: its peaks are at or near one of them.
_INSTANTS = np.array([0.0, 0.25, 0.5, 0.75, 1.0])


@dataclass(frozen=True, slots=True, eq=False)
class MotionTable:
    """Of m times in order: (m,) `time_s`, `line` of the corrected program, `speed_mm_s`, and `feed_mm_s`, NaN
    in rapids; (m, axes) positions, velocities, accelerations and jerks of the axes, in mm or deg and s. In
    each column, values that are left out are between those of the rows beside them."""

    time_s: Array
    line: Index
    speed_mm_s: Array
    feed_mm_s: Array
    position_mm: Array
    velocity: Array
    acceleration: Array
    jerk: Array


@dataclass(frozen=True, slots=True, eq=False)
class _Runs:
    """Runs of one line: (r,) `line` of each, how many runs the line had before (`again`), and (k,) the run of
    each of k moves or pieces."""

    line: Index
    again: Index
    of: Index

    @staticmethod
    def find(line: Index) -> _Runs:
        new = np.diff(line, prepend=-1) != 0
        of = np.cumsum(new) - 1
        lines = line[new]
        order = np.argsort(lines, kind="stable")
        first = np.searchsorted(lines[order], lines[order], "left")
        again = np.empty(len(lines), np.int64)
        again[order] = np.arange(len(lines)) - first
        return _Runs(lines, again, of)

    def partners(self, other: _Runs) -> tuple[Index, Index]:
        """Runs that both have, in order in both."""
        wide = max(int(self.again.max(initial=0)), int(other.again.max(initial=0))) + 1
        _, mine, theirs = np.intersect1d(
            self.line * wide + self.again, other.line * wide + other.again, return_indices=True
        )
        order = np.argsort(mine, kind="stable")
        mine, theirs = mine[order], theirs[order]
        ahead = theirs > np.concatenate(([-1], np.maximum.accumulate(theirs)[:-1]))
        return mine[ahead], theirs[ahead]


def retimed(corrected: Toolpath, samples: Samples, trajectories: Sequence[Trajectory]) -> tuple[Array, Array]:
    """(n,) s at which the motion of the corrected program arrives at each sample, and at which it leaves it;
    stretches follow one another.

    The time of a sample is that of its distance along the line, as a motion that rounds corners does not
    reach the waypoints.
    """
    from olp.trajectory.from_program import SHORTEST_MM

    length = lengths_mm(corrected)
    moving = ~(length <= SHORTEST_MM)
    driven = np.isfinite(length) & moving
    moves = np.flatnonzero(moving)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], driven[moves], [False])).astype(np.int8)))
    arrival, leaving = np.full((2, len(samples)), np.nan)
    begin = 0.0
    for (first, stop), trajectory in zip(
        zip(edges[0::2].tolist(), edges[1::2].tolist(), strict=True), trajectories, strict=True
    ):
        mine = moves[first:stop]
        a = int(np.searchsorted(samples.part, mine[0], "left"))
        b = int(np.searchsorted(samples.part, mine[-1], "right"))
        times = _along(corrected, length, mine, samples, a, b, trajectory.motion)
        arrival[a:b], leaving[a:b] = begin + times[0], begin + times[1]
        begin += trajectory.duration_s
    arrival = filled(arrival)
    return arrival, np.maximum(filled(leaving), arrival)


def _along(
    path: Toolpath, length: Array, moves: Index, samples: Samples, a: int, b: int, motion: Motion
) -> tuple[Array, Array]:
    """Times at which samples a..b are reached and left, in the motion of the stretch that `moves` drive."""
    runs = _Runs.find(path.line[moves].astype(np.int64))
    size = length[moves]
    done = np.concatenate(([0.0], np.cumsum(size)))
    # moves without a length are where the one before them ended
    rank = np.searchsorted(moves, samples.part[a:b], "right") - 1
    exact = (rank >= 0) & (moves[np.maximum(rank, 0)] == samples.part[a:b])
    rank = np.maximum(rank, 0)
    position = done[rank] + np.where(exact, samples.within[a:b], 1.0) * size[rank]
    run = runs.of[rank]
    start, total = _spans(runs.of, size, done)
    share = (position - start[run]) / np.maximum(total[run], 1e-12)

    time, travelled, piece = _travel(motion)
    pieces = _Runs.find(motion.line)
    mine, theirs = runs.partners(pieces)
    run_of_piece = np.full(len(pieces.line), -1, np.int64)
    run_of_piece[theirs] = mine
    of = pieces.of[piece]
    steps = np.bincount(of, np.diff(travelled, prepend=0.0), minlength=len(pieces.line))
    begin = np.concatenate(([0.0], np.cumsum(steps)))[:-1]
    known = run_of_piece[of] >= 0
    done_share = np.clip((travelled - begin[of]) / np.maximum(steps[of], 1e-12), 0.0, 1.0)
    progress = np.maximum.accumulate(_snapped(np.asarray(run_of_piece[of] + done_share, float)[known]))
    wanted = _snapped(np.asarray(run + np.clip(share, 0.0, 1.0), float))
    return _passing(wanted, progress, time[known])


def _snapped(position: Array) -> Array:
    """Positions with rounding at the ends of runs removed, as the motion may rest there."""
    whole = np.rint(position)
    return np.where(np.abs(position - whole) < _ROUNDING, whole, position)


def _passing(position: Array, progress: Array, time: Array) -> tuple[Array, Array]:
    """First and last time at which a progress that never falls is at each position."""
    after = np.clip(np.searchsorted(progress, position, "left"), 0, len(progress) - 1)
    before = np.maximum(after - 1, 0)
    gap = progress[after] - progress[before]
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.where(gap > 0.0, (position - progress[before]) / gap, 1.0)
    first = time[before] + np.clip(share, 0.0, 1.0) * (time[after] - time[before])
    last = np.clip(np.searchsorted(progress, position, "right") - 1, 0, len(progress) - 1)
    return first, np.where(progress[last] == position, np.maximum(time[last], first), first)


def _spans(of: Index, size: Array, done: Array) -> tuple[Array, Array]:
    """Of each run the distance before it, and its length."""
    total = np.bincount(of, size).astype(float)
    first = np.searchsorted(of, np.arange(len(total)), "left")
    return done[first], total


def _travel(motion: Motion) -> tuple[Array, Array, Index]:
    """Times, the distance travelled until then, and the piece, at several instants of each piece."""
    seconds = np.diff(motion.start_s)
    count = len(_INSTANTS) - 1
    piece = np.repeat(np.arange(len(motion)), count)
    # each piece has the distance from its start to its end
    u = (seconds[:, None] * _INSTANTS[1:]).ravel()
    travelled = np.empty(len(piece))
    for a in range(0, len(motion), _BLOCK):
        some = np.arange(a, min(a + _BLOCK, len(motion)))
        instants = (seconds[some, None] * _INSTANTS).ravel()
        position = motion.positions(np.repeat(some, len(_INSTANTS)), instants)
        step = np.diff(position.reshape(len(some), len(_INSTANTS), 3), axis=1)
        travelled[a * count : (a + len(some)) * count] = np.sqrt((step * step).sum(axis=2)).ravel()
    time = motion.start_s[piece] - motion.start_s[0] + u
    return (
        np.concatenate(([0.0], time)),
        np.concatenate(([0.0], np.cumsum(travelled))),
        np.concatenate((piece[:1], piece)),
    )


def filled(time: Array) -> Array:
    """Times, with the one before for samples that no motion reaches."""
    return np.maximum.accumulate(np.nan_to_num(time, nan=0.0))


def feed_seconds(program: Program, machine: Machine) -> Array:
    """(n,) s that each move takes without accelerations: at the programmed feed, or in rapids and without
    feed at the limits of velocity; rapids of an axis without such a limit take no time. The program was read
    with its words."""
    path = program.toolpath
    try:
        feed = timing(program).feed_mm_s
    except ProgramError:
        feed = np.full(len(path), np.inf)
    length = np.nan_to_num(lengths_mm(path))
    step = np.abs(np.nan_to_num(path.end_mm - path.starts_mm()))
    stated = [machine.axes[name].velocity_mm_s for name in AXES]
    least = (step / np.array([np.inf if v is None else v for v in stated])).max(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.fmax(length / feed, least))


def by_feed(seconds: Array, samples: Samples) -> Array:
    """(n,) s at which the nominal program reaches each sample, where each move takes as long."""
    before = np.concatenate(([0.0], np.cumsum(seconds)))
    return filled(before[samples.move] + samples.share * seconds[samples.move])


def table(trajectories: Sequence[Trajectory], routes: Sequence[Route]) -> MotionTable:
    """The motion as at most about MOST_ROWS rows that keep every peak."""
    parts = []
    begin = 0.0
    total = max(sum(len(t.motion) for t in trajectories), 1)
    for trajectory, route in zip(trajectories, routes, strict=True):
        motion = trajectory.motion
        feed = _feeds(route)
        room = max(MOST_ROWS * len(motion) // total, 200)
        for a, b in pairwise([*range(0, len(motion), _BLOCK), len(motion)]):
            rows = _rows(motion, a, b, begin, feed)
            parts.append(thinned(rows, max(room * (b - a) // len(motion), 100)))
        begin += trajectory.duration_s
    if not parts:
        return split(np.zeros((0, _STATED + 4 * len(AXES))))
    rows = np.concatenate(parts)
    rows[:, 0] = np.maximum.accumulate(rows[:, 0])
    return split(rows)


def _feeds(route: Route) -> tuple[Index, Array]:
    """Lines of a route and the feed of each, NaN for rapids."""
    line, first = np.unique(route.line, return_index=True)
    feed = np.where(np.isfinite(route.feed_mm_s[first]), route.feed_mm_s[first], np.nan)
    return line, feed


def _rows(motion: Motion, a: int, b: int, begin: float, feed: tuple[Index, Array]) -> Array:
    """Rows of pieces a..b: time, line, speed, feed, and the axes' positions and their three derivatives."""
    piece, u = instants(motion, a, b)
    position, velocity, acceleration, jerk = motion.of(piece, u)
    line = motion.line[piece]
    row = np.minimum(np.searchsorted(feed[0], line), len(feed[0]) - 1)
    speed = np.sqrt((velocity * velocity).sum(axis=1))
    time = begin + motion.start_s[piece] - motion.start_s[0] + u
    columns = (time, line, speed, feed[1][row])
    return np.column_stack((*columns, position, velocity, acceleration, jerk))


def instants(motion: Motion, a: int, b: int) -> tuple[Index, Array]:
    """Pieces a..b, each as often as it is looked at, and the seconds since its begin."""
    seconds = np.diff(motion.start_s[a : b + 1])
    return np.repeat(np.arange(a, b), len(_INSTANTS)), (seconds[:, None] * _INSTANTS).ravel()


def thinned(rows: Array, most: int) -> Array:
    """Of blocks of rows those where a column has its least or largest value, and the first and last."""
    watched = (2, *range(_STATED + (rows.shape[1] - _STATED) // 4, rows.shape[1]))
    blocks = max(most // (2 * len(watched) + 2), 1)
    wide = -(-len(rows) // blocks)
    if wide <= 2 * len(watched) + 2:
        return rows
    edges = np.arange(0, len(rows), wide)
    pad = len(edges) * wide - len(rows)
    keep = [edges, np.minimum(edges + wide, len(rows)) - 1]
    for column in watched:
        values = np.pad(rows[:, column], (0, pad), mode="edge").reshape(len(edges), wide)
        keep += [edges + values.argmin(axis=1), edges + values.argmax(axis=1)]
    index = np.unique(np.minimum(np.concatenate(keep), len(rows) - 1))
    return np.asarray(rows[index])


def split(rows: npt.NDArray[np.float64]) -> MotionTable:
    """The table of rows (m, 4 + 4 axes): time, line, speed, feed, and four states of the axes."""
    states = np.split(rows[:, _STATED:], 4, axis=1)
    return MotionTable(rows[:, 0], rows[:, 1].astype(np.int64), rows[:, 2], rows[:, 3], *states)
