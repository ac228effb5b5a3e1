"""How far the tip is from the nominal path: at the waypoints and between them.

The actual path of a program is its commands plus the error model, sampled so finely that nothing of the model
is missed between two samples. It is compared with the nominal path move by move: `groups` says which moves of
the program belong to which nominal move.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask
from olp.core.geometry import arc_distance, arc_points, arms, segment_distance
from olp.core.toolpath import Flag, Kind, Toolpath
from olp.errormodel.base import ErrorModel
from olp.errormodel.reversal import play_after, play_interval, play_states, plays
from olp.errormodel.sampling import clear_length_mm, longer, steps_needed

#: enough for deviations, which are small, and half the memory
Single = npt.NDArray[np.float32]

#: nominal moves at a time, so that memory is small
_BLOCK = 1 << 15
#: steps over the box at most in which an unknown axis is tried, and two of them
_MOST_PROBES = (1 << 10, 1 << 7)
#: samples of an arc move at the least, and of a move at the most
_ARC_STEPS = 8
_MOST_STEPS = 1 << 12
#: rad between samples of an arc at most. What is off in one direction counts across the arc, and the largest
#: of it is then missed by 0.12 %.
_ARC_ANGLE_RAD = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Deviation:
    """Deviation per nominal move, in mm: `waypoint` at its end, `path` the largest along it and at its end,
    `bend` the part of it that comes from chords. NaN where the position is unknown. `side` (n,) is how much
    more it may be because the side of the backlash is not known yet."""

    waypoint: Single
    path: Single
    bend: Single
    side: Array


def cutting_moves(path: Toolpath) -> Mask:
    """(n,) moves on which the whole path counts and not its end alone: feed moves, but not of canned cycles,
    nor to a touch whose path the control chooses."""
    own = (path.kind == Kind.PROBE) & ((path.flag & np.uint8(Flag.WHOLE)) != 0)
    cutting = (path.kind != Kind.RAPID) & ((path.flag & np.uint8(Flag.CYCLE)) == 0)
    return np.asarray(cutting & ~own)


def measure(
    nominal: Toolpath, target_mm: Array, path: Toolpath, groups: Index, model: ErrorModel, bend_mm: float
) -> Deviation:
    """Compare the actual path of `path` with the nominal one.

    `target_mm` (n, 3) are the nominal waypoints where the part really lies; `groups` (n,) is the index of
    the last move of `path` that belongs to each nominal move.
    """
    count = len(nominal)
    waypoint = np.full(count, np.nan, np.float32)
    worst = np.full(count, np.nan, np.float32)
    bend = np.zeros(count, np.float32)
    tracer = Tracer(nominal, target_mm, path, groups, model, bend_mm)
    for a in range(0, count, _BLOCK):
        b = min(a + _BLOCK, count)
        tracer.block(a, b, waypoint[a:b], worst[a:b], bend[a:b])
    _from_unknown(nominal, target_mm, path, groups, model, bend_mm, worst)
    return Deviation(waypoint, worst, bend, _unknown_side(path, groups, model))


def _from_unknown(
    nominal: Toolpath, target: Array, path: Toolpath, groups: Index, model: ErrorModel, bend_mm: float,
    worst: Single,
) -> None:  # fmt: skip
    """A feed move may start where an axis is unknown. How far the tip may be off there in the others: the
    largest over the box of the unknown axis. What an unknown play changes is in `side`."""
    start = nominal.starts_mm()
    first = np.concatenate(([0], groups[:-1] + 1)) if len(groups) else groups
    some = (np.isnan(start) & ~np.isnan(target)).any(axis=1) & np.isfinite(start).any(axis=1)
    some &= nominal.kind != Kind.RAPID
    command = path.starts_mm()
    play_of: Array | None = None
    for i in np.flatnonzero(some).tolist():
        known, at = np.isfinite(start[i]), int(first[i])
        if at >= len(path) or not np.isfinite(command[at][known]).all():
            continue
        if play_of is None:
            play_of = plays(model, path.end_mm)
        box, tool = np.array(model.box_mm), path.tool_mm(at, at + 1)
        most = _MOST_PROBES[int((~known).sum()) - 1]
        span = np.where(known, 0.0, box[:, 1] - box[:, 0])
        # where the error bends, and not only at the corners of the box
        steps = int(steps_needed(model, span[None], tool, bend_mm, at_least=8, at_most=most)[0])
        ranges = [
            command[at][axis : axis + 1] if known[axis] else np.linspace(low, high, steps + 1)
            for axis, (low, high) in enumerate(box.tolist())
        ]
        point = np.stack(np.meshgrid(*ranges), axis=-1).reshape(-1, 3)
        meant = start[i] + target[i] - nominal.end_mm[i]
        play = None if play_of is None else np.broadcast_to(play_of[max(at - 1, 0)], point.shape)
        away = point + model.error(point, tool, play) - meant
        worst[i] = np.fmax(worst[i], np.sqrt(np.nansum(away[:, known] ** 2, axis=1)).max())


def _unknown_side(path: Toolpath, groups: Index, model: ErrorModel) -> Array:
    """(n,) mm: what the unknown play changes at most at the start or at the end of each group of moves. It
    shrinks with the range that an axis has moved, and is 0 once that range is the backlash."""
    width = model.backlash_at(path.end_mm) if len(groups) else None
    if width is None:
        return np.zeros(len(groups))
    low, high = play_interval(path.end_mm, width)
    half = (high - low) / 2
    half[np.isnan(path.end_mm)] = 0.0
    rows = np.flatnonzero((half > 0.0).any(axis=1))
    unknown = np.zeros(len(path))
    if rows.size:
        tool = path.tool_mm()
        tool = tool if tool.ndim == 1 else tool[rows]
        for axis in range(3):
            ahead = np.zeros((len(rows), 3))
            ahead[:, axis] = half[rows, axis]
            change = model.error(path.end_mm[rows], tool, ahead) - model.error(
                path.end_mm[rows], tool, -ahead
            )
            unknown[rows] += np.linalg.norm(np.nan_to_num(change), axis=1) / 2
    largest = np.maximum(unknown, np.concatenate((unknown[:1], unknown[:-1])))
    first = np.concatenate(([0], groups[:-1] + 1))
    result = np.maximum(largest[groups], largest[np.minimum(first, len(path) - 1)])
    return np.asarray(result)


class Tracer:
    """Goes through the nominal moves in blocks, and keeps the play of the axes from block to block."""

    def __init__(
        self, nominal: Toolpath, target: Array, path: Toolpath, groups: Index, model: ErrorModel, bend: float
    ) -> None:
        self.nominal, self.target, self.path, self.groups = nominal, target, path, groups
        self.model, self.bend = model, bend
        self.play: Array | None = None
        self.last: Array | None = None
        self.plays = np.zeros((0, 3))
        #: where the tip is, and how far off, at the end of the moves before
        self.before = self._start()
        self.away = np.float32(np.nan)
        self.clear_mm = clear_length_mm(model, path.tools_mm(), bend)
        self.has_play = model.backlash_at(np.array(model.box_mm).mean(axis=1)[None]) is not None
        #: (n, 3) axes that are unknown at the end of a nominal move, None where there are none
        blind = np.isnan(target)
        self.blind = blind if blind.any() else None
        self.nominal_arc = _arc_index(nominal)
        self.path_arc = _arc_index(path)

    @staticmethod
    def trace(path: Toolpath, model: ErrorModel, step_mm: float) -> tuple[Array, Index]:
        """Where the tip really is (m, 3) along a path, every `step_mm`, and the move of each (m,)."""
        tracer = Tracer(path, path.end_mm, path, np.arange(len(path)), model, 1.0)
        start, end, tool = path.starts_mm(), path.end_mm, path.tool_mm()
        length = np.nan_to_num(np.sqrt(((end - start) ** 2).sum(axis=1)))
        arc = tracer.path_arc
        rows = np.flatnonzero(arc >= 0)
        if rows.size:
            radius = np.sqrt(np.nansum((start[rows] - path.arcs.centre_mm) ** 2, axis=1))
            length[rows] = np.maximum(length[rows], radius * np.abs(path.arcs.sweep_rad))
        steps = np.maximum(np.ceil(length / step_mm), 1).astype(np.int64)
        point, part, _ = tracer.points(start, end, arc, steps)
        return tracer.actual(point, tool if tool.ndim == 1 else tool[part]), part

    def points(
        self, start: Array, end: Array, arc: Index, steps: Index, turns: Mask | None = None
    ) -> tuple[Array, Index, Array]:
        """Sample moves at equal steps, and the arcs `turns` where an axis turns round, too: positions, the
        move of each sample, and its share of the move."""
        part = np.repeat(np.arange(len(steps)), steps)
        offset = np.cumsum(steps) - steps
        share = (np.arange(len(part)) - offset[part] + 1) / steps[part]
        if turns is not None and turns.any():
            of, more = self._quarters(start, arc, np.flatnonzero(turns))
            part, share = np.concatenate((part, of)), np.concatenate((share, more))
            order = np.lexsort((share, part))
            part, share = part[order], share[order]
        if len(part) == len(steps):
            return end, part, share
        point = self._at(start, end, arc, part, share)
        point[share == 1.0] = end
        return point, part, share

    def _quarters(self, start: Array, arc: Index, rows: Index) -> tuple[Index, Array]:
        """The arcs among moves `rows` that pass a quadrant between their ends, and the shares of them."""
        arcs, which = self.path.arcs, arc[rows]
        size, sign = np.abs(arcs.sweep_rad[which]), np.sign(arcs.sweep_rad[which])
        along, across = arms(start[rows], arcs.centre_mm[which], arcs.plane[which])
        first = np.mod(-sign * np.arctan2(across, along), np.pi / 2)
        count = np.maximum(np.ceil((size - first) / (np.pi / 2)), 0).astype(np.int64)
        of = np.repeat(np.arange(len(rows)), count)
        quarter = np.arange(len(of)) - (np.cumsum(count) - count)[of]
        share = (first[of] + quarter * np.pi / 2) / size[of]
        within = (share > 0.0) & (share < 1.0)
        return rows[of[within]], share[within]

    def block(self, a: int, b: int, waypoint: Single, worst: Single, bend: Single) -> None:
        """Fill the columns of nominal moves a..b."""
        first = int(self.groups[a - 1]) + 1 if a else 0
        last = int(self.groups[b - 1]) + 1
        ends = self.groups[a:b] - first
        if last == first:
            self._ends(a, b, self.before[None], ends, waypoint)
            worst[:], self.away = waypoint, waypoint[-1]
            return
        path = self.path
        start, end = path.starts_mm(first, last), path.end_mm[first:last]
        owner = np.searchsorted(self.groups[a:b], np.arange(first, last))
        tool = path.tool_mm(first, last)
        delta = np.where(np.isnan(end), 0.0, end - start)
        steps = np.ones(len(end), np.int64)
        known = np.asarray(np.isfinite(delta).all(axis=1))
        arc = self.path_arc[first:last]
        cut = known & (path.kind[first:last] != Kind.RAPID)
        which = longer(delta, self.clear_mm)
        which = which[cut[which]]
        if which.size:
            steps[which] = steps_needed(
                self.model, delta[which], tool if tool.ndim == 1 else tool[which], self.bend,
                at_most=_MOST_STEPS,
            )  # fmt: skip
        curved = np.flatnonzero((arc >= 0) & known)
        if curved.size:
            steps[curved] = self._arc_steps(arc[curved], start[curved], delta[curved], tool, curved)
        reached, inner = self._samples(start, end, arc, steps, known, tool, path.kind[first:last])
        # ends of parts inside a nominal move lie along it, too
        cuts = np.setdiff1d(np.arange(len(end)), ends)
        tips = np.concatenate((self.before[None], reached))
        self._ends(a, b, tips, ends, waypoint)
        worst[:] = waypoint
        if len(inner.part) or len(cuts):
            self._bend(a, tips, inner, owner, arc >= 0, bend)
            self._along(a, b, first, owner, inner.with_ends(cuts, reached), worst)
        self._starts(a, b, first, owner, tips, waypoint, worst)

    def _ends(self, a: int, b: int, tips: Array, ends: Index, waypoint: Single) -> None:
        """How far the tip is off at the ends of nominal moves a..b, behind `ends` of the moves that reach
        `tips` [1:]. A hole with fewer pecks than the nominal one has strokes that end before them, at -1."""
        away = self._known(a + np.arange(b - a), tips[ends + 1] - self.target[a:b])
        waypoint[:] = np.sqrt(np.einsum("ij,ij->i", away, away))

    def _samples(
        self, start: Array, end: Array, arc: Index, steps: Index, known: Mask, tool: Array,
        kind: npt.NDArray[np.uint8],
    ) -> tuple[Array, _Inner]:  # fmt: skip
        """Where the tip really is at the end of each part, and at samples inside parts."""
        long = np.arange(len(end)) if self.has_play else np.flatnonzero(steps > 1)
        turns = (arc[long] >= 0) & known[long] if self.has_play else None
        point, part, share = self.points(start[long], end[long], arc[long], steps[long], turns)
        part = long[part]
        inside = share < 1.0
        if self.has_play:
            # play depends on all earlier moves, so the samples are taken in order
            before = self.play
            actual = self.actual(point, tool if tool.ndim == 1 else tool[part])
            plays = self.plays
            before = plays[0] if before is None else before
            samples = _Inner(part[inside], share[inside], actual[inside])
            taken_up = self._turns(start, end, arc, part, share, np.vstack((before, plays)), tool, kind)
            return actual[~inside], samples.with_more(taken_up)
        part, share, point = part[inside], share[inside], point[inside]
        reached = self.actual(end, tool)
        return reached, _Inner(part, share, self.actual(point, tool if tool.ndim == 1 else tool[part]))

    def _turns(
        self, start: Array, end: Array, arc: Index, part: Index, share: Array, plays: Array, tool: Array,
        kind: npt.NDArray[np.uint8],
    ) -> _Inner:  # fmt: skip
        """Samples where an axis that turned round has taken up its backlash: from there on the tip is off by
        all of it. `plays` are those before and at each of the samples `share` of `part`."""
        turned = np.flatnonzero((plays[1:] != plays[:-1]).any(axis=1) & (kind[part] != Kind.RAPID))
        # a move ends with its sample at 1, and the next one begins at 0
        early = (np.concatenate(([1.0], share[:-1])) % 1.0)[turned]
        part, span = part[turned], share[turned] - early
        old, new = plays[:-1][turned], plays[1:][turned]
        begin = self._at(start, end, arc, part, early)
        stop = self._at(start, end, arc, part, share[turned])
        moved = stop - begin
        width = self.model.backlash_at(begin)
        assert width is not None
        needed = np.abs(new - old) / 2 * np.maximum(np.nan_to_num(width), 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            of_span = needed / np.abs(moved)
        rows, axis = np.nonzero((new != old) & (of_span < 1.0))
        where = early[rows] + of_span[rows, axis] * span[rows]
        point = self._at(start, end, arc, part[rows], where)
        play = play_after(old[rows], point - begin[rows], width[rows])
        play[np.arange(len(rows)), axis] = new[rows, axis]
        error = self.model.error(point, tool if tool.ndim == 1 else tool[part[rows]], play)
        return _Inner(part[rows], where, point + error)

    def _at(self, start: Array, end: Array, arc: Index, part: Index, share: Array) -> Array:
        """(m, 3) positions on moves at shares of them."""
        point = start[part] + share[:, None] * (end - start)[part]
        curved = np.flatnonzero(arc[part] >= 0)
        if curved.size:
            arcs, which = self.path.arcs, arc[part[curved]]
            point[curved] = arc_points(
                start[part[curved]], end[part[curved]], arcs.centre_mm[which], arcs.plane[which],
                arcs.sweep_rad[which], share[curved],
            )  # fmt: skip
        return np.asarray(point)

    def _start(self) -> Array:
        """(3,) where the tip is before the first move."""
        start = np.array(self.path.start_mm)[None]
        tool = self.path.tool_mm(0, 1) if len(self.path) else np.zeros(3)
        return np.asarray((start + self.model.error(start, tool))[0])

    def _starts(
        self, a: int, b: int, first: int, owner: Index, tips: Array, waypoint: Single, worst: Single
    ) -> None:
        """A cut starts where the moves before it ended, which may be farther off than any of its samples."""
        away = np.concatenate(([self.away], waypoint[:-1]))
        self.before, self.away = tips[-1], waypoint[-1]
        begin = np.concatenate(([0], self.groups[a : b - 1] + 1 - first))
        farther = (np.nan_to_num(away, nan=np.inf) > worst) & (self.nominal.kind[a:b] != Kind.RAPID)
        known = np.isfinite(self._known(a + np.arange(b - a), tips[begin])).all(axis=1)
        farther &= (begin < len(tips) - 1) & known
        rows = np.flatnonzero(farther)
        rows = rows[owner[begin[rows]] == rows]
        if rows.size:
            starts = _Inner(begin[rows], np.zeros(len(rows)), tips[begin[rows]])
            self._along(a, b, first, owner, starts, worst)

    def _arc_steps(self, arc: Index, start: Array, delta: Array, tool: Array, rows: Index) -> Index:
        """Steps of the moves `rows`, which are arcs."""
        arcs = self.path.arcs
        radius = np.sqrt(np.nansum((start - arcs.centre_mm[arc]) ** 2, axis=1))
        sweep = np.abs(arcs.sweep_rad[arc])
        # no axis moves farther than the arc is long and wide, or than the helix rises
        reach = np.maximum(np.minimum(radius * sweep, 2 * radius)[:, None], np.abs(delta))
        needed = steps_needed(
            self.model, reach, tool if tool.ndim == 1 else tool[rows], self.bend, at_least=_ARC_STEPS,
            at_most=_MOST_STEPS,
        )  # fmt: skip
        return np.maximum(needed, np.ceil(sweep / _ARC_ANGLE_RAD).astype(np.int64))

    def actual(self, point: Array, tool: Array) -> Array:
        """Where the tip really is; keeps the play of the axes from call to call."""
        play = None
        if self.has_play and len(point):
            chain = point if self.last is None else np.concatenate((self.last, point))
            width = self.model.backlash_at(chain)
            assert width is not None
            play = play_states(chain, width, self.play)[len(chain) - len(point) :]
            self.last, self.play, self.plays = point[-1:], play[-1], play
        return point + self.model.error(point, tool, play)

    def _known(self, move: Index, point: Array) -> Array:
        """(m, 3) points without the axes that are unknown at the ends of their nominal moves (m,)."""
        return point if self.blind is None else np.where(self.blind[move], 0.0, point)

    def _along(self, a: int, b: int, first: int, owner: Index, inner: _Inner, worst: Single) -> None:
        """Distances of samples from their nominal move, the largest per move."""
        nominal = self.nominal
        goal = self.target[a:b]
        begin = np.zeros_like(goal)
        begin[1:] = goal[:-1]
        begin[0] = self.target[a - 1] if a else np.array(nominal.start_mm)
        of = owner[inner.part]
        actual = self._known(a + of, inner.actual)
        distance = segment_distance(actual, self._known(a + of, begin[of]), self._known(a + of, goal[of]))
        arc = self.nominal_arc[a:b]
        rows = np.flatnonzero(arc[of] >= 0)
        if rows.size:
            which = arc[of[rows]]
            arcs = nominal.arcs
            shift = goal[of[rows]] - nominal.end_mm[a:b][of[rows]]
            distance[rows] = arc_distance(
                actual[rows], self._known(a + of[rows], nominal.starts_mm(a, b)[of[rows]] + shift),
                self._known(a + of[rows], goal[of[rows]]),
                self._known(a + of[rows], arcs.centre_mm[which] + shift), arcs.plane[which],
                arcs.sweep_rad[which],
                self._near(owner, first, inner.part[rows], inner.share[rows], of[rows]),
            )  # fmt: skip
        np.fmax.at(worst, of, distance)

    def _near(self, owner: Index, first: int, part: Index, share: Array, of: Index) -> Array:
        """Roughly where on its nominal arc each sample lies: by the angles of the arcs that it became."""
        turn = np.zeros(len(owner))
        arc = self.path_arc[first : first + len(owner)]
        turn[arc >= 0] = np.abs(self.path.arcs.sweep_rad[arc[arc >= 0]])
        total = np.bincount(owner, turn)
        before = np.cumsum(turn) - turn
        begin = np.cumsum(total) - total
        place = before[part] - begin[of] + share * turn[part]
        return np.asarray(place / np.maximum(total[of], 1e-12))

    def _bend(self, a: int, tips: Array, inner: _Inner, owner: Index, curved: Mask, bend: Single) -> None:
        """How far the samples of straight parts leave the chord between the actual ends of their part, which
        are `tips` and the ones behind them."""
        straight = ~curved[inner.part]
        part, actual = inner.part[straight], inner.actual[straight]
        of = a + owner[part]
        departure = segment_distance(
            *(self._known(of, some) for some in (actual, tips[part], tips[part + 1]))
        )
        np.fmax.at(bend, owner[part], departure)


@dataclass(frozen=True, slots=True, eq=False)
class _Inner:
    """Samples inside parts: the part, the share of it, and where the tip is."""

    part: Index
    share: Array
    actual: Array

    def with_more(self, other: _Inner) -> _Inner:
        """These and others."""
        return _Inner(
            np.concatenate((self.part, other.part)),
            np.concatenate((self.share, other.share)),
            np.concatenate((self.actual, other.actual)),
        )

    def with_ends(self, cuts: Index, reached: Array) -> _Inner:
        """These, and the ends of the parts `cuts`."""
        return self.with_more(_Inner(cuts, np.ones(len(cuts)), reached[cuts]))


def _arc_index(path: Toolpath) -> Index:
    """(n,) index into the arcs of each move, -1 where it is none."""
    index = np.full(len(path), -1, np.int64)
    index[path.arcs.move] = np.arange(len(path.arcs))
    return index
