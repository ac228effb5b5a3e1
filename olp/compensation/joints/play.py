"""Backlash along the rows of a plan: which side of it every axis is on, and the rows that take it up.

The load of an axis follows its drive at half of the backlash, so a drive that leads by this half brings its
load where it should be. Which way an axis goes is that of its corrected values: an axis that the program
leaves where it is may go either way for the correction alone. It turns round only when it would be off by
more than a dead band, and only there the drive goes through its backlash while the load stands.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from olp.compensation.dead_band import Rest, follow
from olp.compensation.joints.commanded import Rows, led, solved
from olp.compensation.joints.path import JointPath
from olp.compensation.joints.sampling import spread
from olp.core.arrays import Array, Index, Mask, distinct
from olp.core.toolpath import Flag
from olp.core.values import dataclass

#: The share of a tolerance that the dead bands of all axes take together.
BAND_SHARE = 0.3
#: Rounds in which moves are split where an axis turns round inside of them.
_ROUNDS = 8
#: A move is split inside of a stretch only, and not this near to its ends.
_EDGE = 1e-9
#: Digits, and a share of the backlash, by which an axis goes farther past an end than its backlash.
_PAST = 4.0
_PAST_SHARE = 0.1
#: Moves whose blocks are not repeated.
_FIXED = np.uint8(Flag.CYCLE | Flag.WHOLE | Flag.DELETED | Flag.INVERSE_TIME)
#: Samples at a time, so that memory is small.
_BATCH = 1 << 15
#: Below this a motion moves the tip by nothing, mm or rad per mm or rad.
_TINY = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class Play:
    """(axes,) of each axis in mm or deg: the `width` of its backlash, and by how much its load may be off
    rather than turn round (`band`). It goes `past` an end by so much more than its backlash. `travel`
    (2, axes) are its ends. What is not `free` is not corrected."""

    width: Array
    band: Array
    past: Array
    travel: Array
    free: Mask

    @staticmethod
    def of(path: JointPath, rows: Rows, tolerance_mm: float, tolerance_rad: float) -> Play:
        """What moves the tip or turns the tool by its share of a tolerance at some row."""
        motion = path.motion
        width, count = motion.width, len(motion.width)
        most = np.full((2, count), _TINY)
        for a in range(0, len(rows.move), _BATCH):
            some = slice(a, a + _BATCH)
            slopes = motion.slopes(rows.axes[some], path.tool[rows.move[some]])
            turns = slopes[:, 3:]
            if motion.structure.symmetric_tool:
                turns = np.cross(turns, rows.target.rotation[some][:, :, 2][:, :, None], axis=1)
            sizes = [np.linalg.norm(part, axis=1).max(axis=0) for part in (slopes[:, :3], turns)]
            most = np.maximum(most, sizes)
        band = np.minimum(tolerance_mm / most[0], tolerance_rad / most[1])
        band *= BAND_SHARE / max(int((width != 0.0).sum()), 1)
        joints, units = motion.structure.joints.values(), motion.structure.units
        digits = dict.fromkeys(units, 0.0)
        for unit, places in zip(path.coordinates.units, path.places.tolist(), strict=True):
            digits[unit] = max(digits.get(unit, 0.0), 10.0**-places)
        return Play(
            width, np.where(_rotary(path), np.degrees(band), band),
            _PAST * np.array([digits[unit] for unit in units]) + _PAST_SHARE * width,
            np.array([joint.travel for joint in joints]).T, np.array([joint.correct for joint in joints]),
        )  # fmt: skip

    def way(self, axis: int, start: float, ahead: Array) -> float:
        """The side on which a load is to rest at `start`: that of its next motion, to one of the positions
        `ahead`, or the other one where it cannot be approached inside of the travel. 0: the axis is clamped,
        and stays."""
        moved = np.flatnonzero(np.abs(ahead - start) > self.band[axis])
        if not moved.size and not self.free[axis]:
            return 0.0
        way = float(np.sign(ahead[moved[0]] - start)) if moved.size else 1.0
        low, high = self.travel[:, axis]
        beyond = start - way * (0.5 * self.width[axis] + self.past[axis])
        return way if low <= beyond <= high else -way


def with_play(path: JointPath, rows: Rows, begins: Rows, play: Play) -> Rows:
    """The rows with the sides of the backlash on which they are, and further ones: where an axis turns round
    inside of a move, and where it takes up its backlash while the tool stands. `begins` are the places at
    the share 0 of the moves that may be split, in order."""
    rows = _turned_inside(path, rows, begins, play)
    found = _followed(path, rows, begins, play)
    if path.stay.any():
        begins = _standing(path, begins, found.side[np.searchsorted(rows.move, begins.move)])
        rows = _standing(path, rows, found.side)
        found = _followed(path, rows, begins, play)
    rows = replace(rows, side=found.side)
    steps, before = _steps(rows, begins, found)
    past, ends = _approaches(path, rows, found, play)
    joined = Rows.join([rows, steps, past])
    place = np.concatenate((np.arange(len(rows.move)), before - 0.5, ends - 0.5))
    return joined.only(np.argsort(place, kind="stable"))


def _standing(path: JointPath, rows: Rows, side: Array) -> Rows:
    """The rows with other sides, and other linear axis values where rotary ones stand on them."""
    stays = path.stay[rows.move] & (side != rows.side).any(axis=1)
    rows, some = replace(rows, side=side), np.flatnonzero(stays)
    again = solved(path, rows.move[some], rows.share[some], side[some])
    order = np.argsort(np.append(np.flatnonzero(~stays), some), kind="stable")
    return Rows.join([rows.only(~stays), again]).only(order)


def _steps(rows: Rows, begins: Rows, found: _Followed) -> tuple[Rows, Index]:
    """Rows at which drives go through their backlash, and the rows (k,) before which they come."""
    stretch = _Stretches.of(rows, begins)
    some = np.flatnonzero(found.turns[stretch.row].any(axis=1))
    where, begin = stretch.row[some], stretch.begin.only(some)
    before = np.vstack((np.zeros((1, rows.side.shape[1])), rows.side))[where]
    return replace(
        begin,
        move=rows.move[where],
        share=np.where(begin.move == rows.move[where], begin.share, 0.0),
        side=np.where(found.turns[where], rows.side[where], before),
    ), where


def _approaches(path: JointPath, rows: Rows, found: _Followed, play: Play) -> tuple[Rows, Index]:
    """Rows past the ends of moves that do not cut, from where an axis comes back by more than its backlash,
    and the rows (k,) before which they come."""
    where = np.flatnonzero(found.approaches.any(axis=1))
    step = np.where(found.approaches, rows.side * (play.width + play.past), 0.0)[where]
    begin = rows.only(where)
    axes = begin.axes - step
    return replace(begin, axes=axes, target=path.motion.actual(axes, path.tool[begin.move])), where


@dataclass(frozen=True, slots=True, eq=False)
class _Stretches:
    """(s,) rows of moves that may be split, and where the stretches begin that end with them."""

    row: Index
    begin: Rows

    @staticmethod
    def of(rows: Rows, begins: Rows) -> _Stretches:
        row = np.flatnonzero(np.isin(rows.move, begins.move))
        same = (row > 0) & (rows.move[row] == rows.move[row - 1])
        first = len(rows.move) + np.searchsorted(begins.move, rows.move[row])
        return _Stretches(row, Rows.join([rows, begins]).only(np.where(same, row - 1, first)))


def _turned_inside(path: JointPath, rows: Rows, begins: Rows, play: Play) -> Rows:
    """The rows, and others where an axis turns round inside of a move: where tips are led, the axes do not
    go evenly."""
    fresh = np.ones(len(rows.move), bool)
    for _ in range(_ROUNDS):
        stretch = _Stretches.of(rows, begins)
        chosen = np.flatnonzero(fresh[stretch.row])
        begin, end = stretch.begin.only(chosen), rows.only(stretch.row[chosen])
        where, share = _extremes(path, begin, end, play)
        if not where.size:
            break
        more = solved(path, end.move[where], share, end.side[where])
        order = np.lexsort((np.append(rows.share, more.share), np.append(rows.move, more.move)))
        new = np.append(np.zeros(len(rows.move), bool), np.ones(len(where), bool))[order]
        rows = Rows.join([rows, more]).only(order)
        # a stretch that was cut, on both sides of the cut
        fresh = new | np.append(False, new[:-1])
    return rows


def _extremes(path: JointPath, begin: Rows, end: Rows, play: Play) -> tuple[Index, Array]:
    """(k,) stretches inside of which an axis with backlash turns round, farther from both ends than its dead
    band, and the shares of the moves where it does."""
    count = path.samples(end.move, begin.axes, end.axes, end.share - begin.share)
    totals, found, a = np.cumsum(count), [], 0
    while a < len(count):
        b = max(int(np.searchsorted(totals, (totals[a - 1] if a else 0) + _BATCH)), a + 1)
        some = np.arange(a, b)
        where, share = _turning(path, begin.only(some), end.only(some), count[a:b], play)
        found.append((where + a, share))
        a = b
    if not found:
        return np.zeros(0, np.int64), np.zeros(0)
    return np.concatenate([where for where, _ in found]), np.concatenate([share for _, share in found])


def _turning(path: JointPath, begin: Rows, end: Rows, count: Index, play: Play) -> tuple[Index, Array]:
    owner, step = spread(count + 2)
    part = step / (count + 1)[owner]
    axes = led(path, begin, end, owner, part)
    inner = np.flatnonzero((step > 0) & (step <= count[owner]))
    behind, ahead = axes[inner] - axes[inner - 1], axes[inner + 1] - axes[inner]
    bend, slope = ahead - behind, 0.5 * (ahead + behind)
    with np.errstate(divide="ignore", invalid="ignore"):
        # the top of the parabola through three samples
        top = -slope / bend
        value = axes[inner] - 0.5 * slope**2 / bend
    mine = owner[inner]
    least = np.where(step[inner] == 1, -1.0, -0.5)[:, None]
    most = np.where(step[inner] == count[mine], 1.0, 0.5)[:, None]
    within = (top > least) & (top <= most) & (play.width != 0.0)
    first, last = axes[np.cumsum(count + 2) - count - 2], axes[np.cumsum(count + 2) - 1]
    away = np.minimum(np.abs(value - first[mine]), np.abs(value - last[mine]))
    at, column = np.nonzero(within & (away > play.band))
    at_part = (step[inner][at] + top[at, column]) / (count + 1)[mine[at]]
    where = mine[at]
    share = begin.share[where] * (begin.move[where] == end.move[where])
    share = share + at_part * (end.share[where] - share)
    free = (at_part > _EDGE) & (at_part < 1.0 - _EDGE)
    pairs = np.unique(np.stack((where[free], np.round(share[free], 9))), axis=1)
    return pairs[0].astype(np.int64), pairs[1]


@dataclass(frozen=True, slots=True, eq=False)
class _Followed:
    """(r, axes) the sides of the backlash at rows, where an axis `turns` round before a row, and where it is
    `unknown` on which side it would be, so that a row `approaches`."""

    side: Array
    turns: Mask
    approaches: Mask


def _followed(path: JointPath, rows: Rows, begins: Rows, play: Play) -> _Followed:
    count = len(path)
    # moves that are not corrected move the axes, too
    still = np.setdiff1d(np.arange(count), distinct(rows.move))
    nominal = path.axes(still, path.end[still])
    move = np.append(rows.move, still)
    order = np.argsort(move, kind="stable")
    where = np.argsort(order, kind="stable")[: len(rows.move)]
    # where no word of an axis changes, its drive stands and not its load
    stays = path.stay[rows.move][:, None] & _rotary(path)
    drive = rows.axes + np.where(stays, 0.5 * play.width * rows.side, 0.0)
    position = np.vstack((drive, nominal))[order]
    # the first row is where the machine is before
    first = path.axes(np.arange(len(path))[:1], path.start[:1])
    position, where, order = np.vstack((first, position)), where + len(first), np.append(-1, order)
    may = np.append(_approachable(path, rows, begins), np.zeros(len(still), bool))
    wanted = np.append(_wanted(path, rows, begins), np.zeros(len(still), bool))
    # the row before the first one is no row of the plan
    may = np.where(order < 0, False, may[order] & wanted[order])
    side, turns = np.zeros(rows.axes.shape), np.zeros(rows.axes.shape, bool)
    approaches = turns.copy()
    for axis in np.flatnonzero(play.width).tolist():
        column = _Column(position[:, axis], play, axis, may)
        side[:, axis], turns[:, axis] = column.side[where], column.turns[where]
        approaches[:, axis] = column.approaches[where]
    return _Followed(side, turns & ~stays, approaches & ~stays)


class _Column:
    """One axis along all `position`s (n,), which are not known in places. Where it would be unknown on which
    side it is, and a row `may` (n,) come before, its side is that of the next motion."""

    def __init__(self, position: Array, play: Play, axis: int, may: Mask) -> None:
        self.width, self.band, count = float(play.width[axis]), float(play.band[axis]), len(position)
        self.side, self.turns = np.zeros(count), np.zeros(count, bool)
        self.approaches = np.zeros(count, bool)
        known = np.isfinite(position)
        edge = np.flatnonzero(np.diff(np.concatenate(([False], known, [False])).astype(np.int8)))
        for a, b in edge.reshape(-1, 2).tolist():
            self._follow(a, position[a:b], Rest(float(position[a]), float(position[a])))
            open_ = np.flatnonzero(may[a:b] & (np.abs(self.side[a:b]) < 1.0))
            if open_.size:
                row = a + int(open_[0])
                start = float(position[row])
                way = play.way(axis, start, position[row:b])
                if way:
                    self._follow(row, position[row:b], Rest(start, start, way, 2.0))
                    self.approaches[row] = True

    def _follow(self, begin: int, position: Array, rest: Rest) -> None:
        width = np.full(len(position), self.width)
        side, _, turns, _ = follow(position, width, self.band, rest)
        # where nothing was known before, the drive goes to the side on which it is then
        before = np.append(rest.side * min(rest.taken / 2.0, 1.0), side[:-1])
        some = slice(begin, begin + len(position))
        self.side[some], self.turns[some] = side, turns | ((np.abs(before) < 1.0) & (side != before))


def _wanted(path: JointPath, rows: Rows, begins: Rows) -> Mask:
    """(r,) rows behind which a feed move begins, and others that are judged."""
    behind = np.isin(rows.move + 1, begins.move) & _last(rows)
    return np.asarray(behind | path.judged[rows.move], bool)


def _approachable(path: JointPath, rows: Rows, begins: Rows) -> Mask:
    """(r,) the ends of moves that may be gone past: those that do not cut, and whose blocks may be
    repeated."""
    toolpath = path.program.toolpath
    fixed = (toolpath.flag & _FIXED) != 0
    cuts = np.isin(np.arange(len(path)), begins.move) | (path.feed & np.isfinite(path.start).all(axis=1))
    free = ~(fixed | cuts | path.holes.strokes | path.holes.whole)
    return np.asarray(free[rows.move] & _last(rows), bool)


def _last(rows: Rows) -> Mask:
    """(r,) the last rows of their moves."""
    return np.append(rows.move[1:] != rows.move[:-1], True)[: len(rows.move)]


def _rotary(path: JointPath) -> Mask:
    return np.array([unit == "deg" for unit in path.motion.structure.units])
