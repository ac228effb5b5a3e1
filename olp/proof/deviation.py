"""How far the tip is from the nominal path: at the waypoints and between them.

The actual path of a program is its commands plus the error model, sampled so finely that nothing of the model
is missed between two samples. It is compared with the nominal path move by move: `groups` says which moves of
the program belong to which nominal move.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from olp.compensation.plan import TargetRows
from olp.core.arrays import Array, Index, Mask, all_in_row, any_in_row
from olp.core.geometry import ArcShapes, Segments, arms, put_in_planes
from olp.core.progress import Progress, silent
from olp.core.spool import unload
from olp.core.toolpath import Flag, Kind, Toolpath
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.errormodel.reversal import play_after, play_interval, taken_up
from olp.errormodel.sampling import clear_length_mm, longer, steps_needed
from olp.program.text.columns import apart, spans
from olp.proof.courses import Courses, arc_index, peaks
from olp.proof.samples import Nearness, Samples, between, equal_steps, kinds, runs, shares_inside
from olp.proof.smooth_joints import SmoothJoints
from olp.proof.unknown_sides import UnknownSides
from olp.proof.unknown_starts import UnknownStarts

#: enough for deviations, which are small, and half the memory
Single = npt.NDArray[np.float32]

#: nominal moves at a time, and moves that they became, so that memory is small; down to a quarter of them ...
_BLOCK = 1 << 15
#: ... where they would have more samples
_SAMPLES = 1 << 16
#: steps of a move at the most
_MOST_STEPS = 1 << 12
#: Steps of an arc at the least, and rad of each at the most. What is off in one direction counts across the
#: arc as a sine, and what the error grows with the position as a sine of twice the angle: `peaks` finds the
#: largest between the samples.
_ARC_STEPS = 4
_ARC_ANGLE_RAD = 0.3
#: The same where the samples themselves are compared: the largest is then missed by 0.12 %.
_SAMPLED_STEPS = 8
_SAMPLED_ANGLE_RAD = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Deviation:
    """Deviation per nominal move, in mm: `waypoint` at its end, `path` the largest along it and at its end.
    NaN where the position is unknown. `bend_mm` is the largest part that comes from chords of moves that
    count. `side` (n,) is how much more it may be because the side of the backlash is not known yet.
    Where a contour under cutter compensation goes straight on (`SmoothJoints`), only what is across the path
    counts."""

    waypoint: Single
    path: Single
    bend_mm: float
    side: Single


def cutting_moves(path: Toolpath) -> Mask:
    """(n,) moves on which the whole path counts and not its end alone: feed moves, but not of canned cycles,
    nor to a touch whose path the control chooses."""
    own = (path.kind == Kind.PROBE) & ((path.flag & np.uint8(Flag.WHOLE)) != 0)
    cutting = (path.kind != Kind.RAPID) & ((path.flag & np.uint8(Flag.CYCLE)) == 0)
    return np.asarray(cutting & ~own)


def measure(
    nominal: Toolpath, target_mm: TargetRows, path: Toolpath, groups: Index, counted: Mask | None,
    model: ErrorModel, bend_mm: float, tell: Progress = silent, *, elsewhere: Mask | None = None,
) -> Deviation:  # fmt: skip
    """Compare the actual path of `path` with the nominal one. Nominal moves (n,) that something else judges
    `elsewhere` along their way are compared where the moves end that they became, and not between.

    `target_mm` (n, 3) are the nominal waypoints where the part really lies; `groups` (n,) is the index of
    the last move of `path` that belongs to each nominal move. (n,) `counted` are those whose chords count,
    None where the bend is not asked for, which is 0 then.
    """
    count = len(nominal)
    waypoint, worst = (apart((count,), np.float32) for _ in range(2))
    largest = 0.0
    tracer = Tracer(nominal, target_mm, path, groups, model, bend_mm, elsewhere)
    starts = UnknownStarts(nominal, target_mm, path, groups, model, bend_mm)
    sides = UnknownSides(path, model) if tracer.has_play else None
    # without play one 0 stands for all
    side = np.broadcast_to(np.float32(0.0), count) if sides is None else apart((count,), np.float32)
    a, least = 0, max(_BLOCK // 4, 1)
    size = least
    while a < count:
        parts = int(groups[a - 1]) + size if a else size
        b = min(max(int(np.searchsorted(groups, parts)), a + 1), a + size, count)
        bend = None if counted is None else np.zeros(b - a, np.float32)
        samples = tracer.block(a, b, waypoint[a:b], worst[a:b], bend)
        size = min(max((b - a) * _SAMPLES // max(samples, 1), least), _BLOCK)
        if counted is not None and bend is not None:
            largest = max(largest, float(bend.max(initial=0.0, where=counted[a:b])))
        starts.block(a, b, worst[a:b])
        if sides is not None:
            side[a:b] = sides.of(int(groups[a - 1]) + 1 if a else 0, groups[a:b])
        tell("prove", b / count)
        unload()
        a = b
    return Deviation(waypoint, worst, largest, side)


class Tracer:
    """Goes through the nominal moves in blocks, and keeps the play of the axes from block to block."""

    def __init__(
        self,
        nominal: Toolpath,
        target: TargetRows,
        path: Toolpath,
        groups: Index,
        model: ErrorModel,
        bend: float,
        elsewhere: Mask | None = None,
    ) -> None:
        self.nominal, self.target, self.path, self.groups = nominal, target, path, groups
        self.model, self.bend, self.elsewhere = model, bend, elsewhere
        #: the play, and the least and the greatest that are possible
        self.play: Array | None = None
        self.between: Array | None = None
        self.last: Array | None = None
        self.plays = np.zeros((0, 3))
        #: where the tip is, and how far off, at the end of the moves before
        self.before = self._start()
        self.away = np.float32(np.nan)
        self.clear_mm = clear_length_mm(model, path.tools_mm(), bend)
        self.has_play = model.backlash_at(np.array(model.box_mm).mean(axis=1)[None]) is not None
        self.joints = SmoothJoints.of(nominal)
        #: (n, 3) axes that are unknown at the end of a nominal move, None where there are none
        unknown = any(np.isnan(nominal.end_mm[some]).any() for some in spans(len(nominal)))
        self.blind = _unknown(nominal.end_mm) if unknown else None

    @staticmethod
    def trace(path: Toolpath, model: ErrorModel, step_mm: float) -> tuple[Array, Index]:
        """Where the tip really is (m, 3) along a path, every `step_mm`, and the move of each (m,)."""
        parts = list(Tracer.traced(path, model, step_mm))
        if not parts:
            return np.zeros((0, 3)), np.zeros(0, np.int64)
        return np.concatenate([tip for tip, _ in parts]), np.concatenate([move for _, move in parts])

    @staticmethod
    def traced(path: Toolpath, model: ErrorModel, step_mm: float) -> Iterator[tuple[Array, Index]]:
        """The same in parts of whole moves, so that memory is small."""
        tracer = Tracer(path, path.end_mm, path, np.arange(len(path)), model, 1.0)
        steps, samples = apart((len(path),), np.int64), 0
        parts: list[int] = []
        for some in spans(len(path)):
            steps[some] = equal_steps(path.part(some.start, some.stop), step_mm)
            # every part has the moves whose last sample is in the next _BLOCK ones
            ends = samples + np.cumsum(steps[some])
            begins = np.diff(ends // _BLOCK, prepend=samples // _BLOCK if parts else -1)
            parts.extend((some.start + np.flatnonzero(begins)).tolist())
            samples = int(ends[-1])
        for a, b in pairwise((*parts, len(path))):
            start, end, arc = path.starts_mm(a, b), path.end_mm[a:b], arc_index(path, a, b)
            point, part, _ = tracer.points(start, end, arc, steps[a:b])
            tool = path.tool_mm(a, b)
            yield tracer.actual(point, tool if tool.ndim == 1 else tool[part]), part + a
            unload()

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
        point, last = self._at(start, end, arc, part, share), np.flatnonzero(share == 1.0)
        for axis in range(3):
            point[last, axis] = end[:, axis]
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

    def block(self, a: int, b: int, waypoint: Single, worst: Single, bend: Single | None) -> int:
        """Fill the columns of nominal moves a..b. Returns the number of samples that were held at once."""
        first = int(self.groups[a - 1]) + 1 if a else 0
        last = int(self.groups[b - 1]) + 1
        ends = self.groups[a:b] - first
        if last == first:
            self._ends(a, b, self.before[None], ends, waypoint)
            worst[:], self.away = waypoint, waypoint[-1]
            return 0
        path = self.path
        start, end = path.starts_mm(first, last), path.end_mm[first:last]
        owner = owner_of(self.groups[a:b], first, last)
        tool = path.tool_mm(first, last)
        delta = np.where(np.isnan(end), 0.0, end - start)
        steps = np.ones(len(end), np.int64)
        known = np.asarray(all_in_row(np.isfinite(delta)))
        arc = arc_index(path, first, last)
        cut = known & (path.kind[first:last] != Kind.RAPID)
        if self.elsewhere is not None:
            cut &= ~self.elsewhere[a:b][owner]
        which = longer(delta, self.clear_mm)
        which = which[cut[which]]
        if which.size:
            steps[which] = steps_needed(
                self.model, delta[which], tool if tool.ndim == 1 else tool[which], self.bend,
                at_most=_MOST_STEPS,
            )  # fmt: skip
        curved = np.flatnonzero((arc >= 0) & known)
        courses = cache(lambda: Courses.of(self.nominal, self.target, a, b, self._known))
        smooth = np.zeros(len(end), bool)
        if curved.size:
            smooth[curved] = (courses().arc[owner[curved]] >= 0) & (not self.has_play)
            steps[curved] = self._arc_steps(
                arc[curved], start[curved], delta[curved], tool, curved, smooth[curved]
            )
        inner = None
        if self.has_play:
            reached, inner = self._in_order(start, end, arc, steps, known, tool, path.kind[first:last])
        else:
            reached = self.actual(end, tool)
        # ends of parts inside a nominal move lie along it, too
        inside = np.ones(len(end), bool)
        inside[ends[ends >= 0]] = False
        cuts = np.flatnonzero(inside)
        tips = np.concatenate((self.before[None], reached))
        self._ends(a, b, tips, ends, waypoint)
        worst[:] = waypoint
        near = Nearness(path, first, owner)
        chords = cache(lambda: self._chords(a, owner, tips))
        parts = [inner] if inner is not None else self._between_ends(start, end, arc, smooth, steps, tool)
        for some in parts:
            if bend is not None:
                self._bend(a, some, owner, arc >= 0, chords(), bend)
            if len(some.part) and smooth[some.part[0]]:
                rows = some.part[np.flatnonzero(np.diff(some.part, prepend=-1))]
                begin = tips.take(rows, axis=0) if tool.ndim == 1 else self.actual(start[rows], tool[rows])
                some = self._curves(a, owner, rows, begin, tips, some, steps, courses(), near, worst)
            if len(some.part):
                self._along(a, owner, some, courses(), near, worst)
        if cuts.size:
            self._along(a, owner, Samples(cuts, np.ones(len(cuts)), reached[cuts]), courses(), near, worst)
        self._starts(a, b, owner, tips, waypoint, courses, near, worst)
        return int(steps.sum()) if self.has_play else len(end)

    def _ends(self, a: int, b: int, tips: Array, ends: Index, waypoint: Single) -> None:
        """How far the tip is off at the ends of nominal moves a..b, behind `ends` of the moves that reach
        `tips` [1:]. A hole with fewer pecks than the nominal one has strokes that end before them, at -1."""
        away = self._known(a + np.arange(b - a), tips.take(ends + 1, axis=0) - self.target[a:b])
        waypoint[:] = np.sqrt(np.einsum("ij,ij->i", away, away))
        if self.joints is not None:
            self.joints.put_across(waypoint, a + np.arange(b - a), away)

    def _in_order(
        self, start: Array, end: Array, arc: Index, steps: Index, known: Mask, tool: Array,
        kind: npt.NDArray[np.uint8],
    ) -> tuple[Array, Samples]:  # fmt: skip
        """Where the tip really is at the end of each part, and at samples inside parts. The play depends on
        all earlier moves, so they are taken in order."""
        point, part, share = self.points(start, end, arc, steps, (arc >= 0) & known)
        inside, before = share < 1.0, self.play
        actual = self.actual(point, tool if tool.ndim == 1 else tool[part])
        plays = self.plays
        before = plays[0] if before is None else before
        samples = Samples(part[inside], share[inside], actual[inside])
        taken_up = self._turns(start, end, arc, part, share, np.vstack((before, plays)), tool, kind)
        return actual[~inside], samples.with_more(taken_up)

    def _between_ends(
        self, start: Array, end: Array, arc: Index, smooth: Mask, steps: Index, tool: Array
    ) -> Iterator[Samples]:
        """Samples inside parts of a machine without play, few at a time: of straight ones, of arcs that are
        sampled as `smooth` curves, then of other arcs."""
        for kind in (arc < 0, smooth, (arc >= 0) & ~smooth):
            for rows in runs(np.flatnonzero((steps > 1) & kind), steps):
                of, share = shares_inside(steps[rows])
                if arc[rows[0]] >= 0:
                    point = self._shapes(start, end, arc, rows).at(of, share)
                else:
                    point = between(start[rows], end[rows], of, share)
                part = rows.take(of)
                yield Samples(part, share, self.actual(point, tool if tool.ndim == 1 else tool[part]))

    def _turns(
        self, start: Array, end: Array, arc: Index, part: Index, share: Array, plays: Array, tool: Array,
        kind: npt.NDArray[np.uint8],
    ) -> Samples:  # fmt: skip
        """Samples where an axis that turned round has taken up its backlash: from there on the tip is off by
        all of it. `plays` are those before and at each of the samples `share` of `part`."""
        turned = np.flatnonzero(any_in_row(plays[1:] != plays[:-1]) & (kind[part] != Kind.RAPID))
        # a move ends with its sample at 1, and the next one begins at 0
        early = (np.concatenate(([1.0], share[:-1])) % 1.0)[turned]
        part, span = part[turned], share[turned] - early
        old, new = plays[:-1][turned], plays[1:][turned]
        begin = self._at(start, end, arc, part, early)
        stop = self._at(start, end, arc, part, share[turned])
        moved = stop - begin
        width = self.model.backlash_at(begin)
        assert width is not None
        rows, axis, of_span = taken_up(old, new, moved, width)
        where = early[rows] + of_span * span[rows]
        point = self._at(start, end, arc, part[rows], where)
        play = play_after(old[rows], point - begin[rows], width[rows])
        play[np.arange(len(rows)), axis] = new[rows, axis]
        error = self.model.error(point, tool if tool.ndim == 1 else tool[part[rows]], play)
        return Samples(part[rows], where, point + error)

    def _at(self, start: Array, end: Array, arc: Index, part: Index, share: Array) -> Array:
        """(m, 3) positions on moves at shares of them."""
        rows = np.flatnonzero(arc >= 0)
        if not rows.size:
            return between(start, end, part, share)
        shapes = self._shapes(start, end, arc, rows)
        straight, curved, of = kinds(arc >= 0, part)
        on_arcs = shapes.at(of, share[curved])
        if not straight.size:
            return on_arcs
        on_lines = between(start, end, part[straight], share[straight])
        point = np.empty((len(part), 3))
        for axis in range(3):
            point[curved, axis], point[straight, axis] = on_arcs[:, axis], on_lines[:, axis]
        return point

    def _shapes(self, start: Array, end: Array, arc: Index, rows: Index) -> ArcShapes:
        """The shapes of the moves `rows`, which are arcs."""
        arcs, which = self.path.arcs, arc.take(rows)
        return ArcShapes.of(
            start.take(rows, axis=0), end.take(rows, axis=0), arcs.centre_mm.take(which, axis=0),
            arcs.plane.take(which), arcs.sweep_rad.take(which),
        )  # fmt: skip

    def _start(self) -> Array:
        """(3,) where the tip is before the first move."""
        start = np.array(self.path.start_mm)[None]
        tool = self.path.tool_mm(0, 1) if len(self.path) else np.zeros(3)
        return np.asarray((start + self.model.error(start, tool))[0])

    def _starts(
        self, a: int, b: int, owner: Index, tips: Array, waypoint: Single, courses: Callable[[], Courses],
        near: Nearness, worst: Single,
    ) -> None:  # fmt: skip
        """A cut starts where the moves before it ended, which may be farther off than any of its samples."""
        away = np.concatenate(([self.away], waypoint[:-1]))
        self.before, self.away = tips[-1], waypoint[-1]
        farther = np.where(np.isnan(away), np.inf, away) > worst
        farther &= self.nominal.kind[a:b] != Kind.RAPID
        rows = np.flatnonzero(farther)
        begin = np.concatenate(([0], self.groups[a : b - 1] + 1 - near.first))[rows]
        tip = tips.take(begin, axis=0)
        some = (begin < len(tips) - 1) & all_in_row(np.isfinite(self._known(a + rows, tip)))
        rows, begin, tip = rows[some], begin[some], tip[some]
        some = owner[begin] == rows
        if some.any():
            starts = Samples(begin[some], np.zeros(int(some.sum())), tip[some])
            self._along(a, owner, starts, courses(), near, worst)

    def _arc_steps(
        self, arc: Index, start: Array, delta: Array, tool: Array, rows: Index, smooth: Mask
    ) -> Index:
        """Steps of the moves `rows`, which are arcs; those of some are samples of a `smooth` curve."""
        arcs = self.path.arcs
        centre, plane = arcs.centre_mm[arc], arcs.plane[arc]
        sweep = np.abs(arcs.sweep_rad[arc])
        length = sweep * np.hypot(*arms(start, centre, plane))
        # no axis of its plane moves farther than the arc is long, and the third one as the helix rises
        reach = np.abs(delta)
        put_in_planes(reach, plane, length, length)
        angle = np.where(smooth, _ARC_ANGLE_RAD, _SAMPLED_ANGLE_RAD)
        wide = np.ceil(sweep / angle).astype(np.int64)
        needed = steps_needed(
            self.model, reach, tool if tool.ndim == 1 else tool[rows], self.bend,
            at_least=np.where(smooth, np.maximum(wide, _ARC_STEPS), _SAMPLED_STEPS), at_most=_MOST_STEPS,
        )  # fmt: skip
        return np.maximum(needed, wide)

    def actual(self, point: Array, tool: Array) -> Array:
        """Where the tip really is; keeps the play of the axes from call to call."""
        play = None
        if self.has_play and len(point):
            chain = point if self.last is None else np.concatenate((self.last, point))
            width = self.model.backlash_at(chain)
            assert width is not None
            low, high = play_interval(chain, width, self.between)
            self.between = np.stack((low[-1], high[-1]))
            play = ((low + high) * 0.5)[len(chain) - len(point) :]
            self.last, self.play, self.plays = point[-1:], play[-1], play
        actual = self.model.error(point, tool, play)
        actual += point
        return actual

    def _known(self, move: Index, point: Array) -> Array:
        """(m, 3) points without the axes that are unknown at the ends of their nominal moves (m,)."""
        return point if self.blind is None else np.where(self.blind[move], 0.0, point)

    def _along(
        self, a: int, owner: Index, inner: Samples, courses: Courses, near: Nearness, worst: Single
    ) -> None:
        """Distances of samples from their nominal move, the largest per move."""
        of = owner[inner.part]
        actual = self._known(a + of, inner.actual)
        distance = courses.distance(
            actual, of, lambda rows: near.share(inner.part[rows], inner.share[rows], of[rows])
        )
        if self.joints is not None:
            self.joints.put_across(distance, a + of, actual - courses.goal[of])
            self.joints.put_across(distance, a + of - 1, actual - courses.begin[of])
        # of one kind with the column: else numpy takes ten times as long
        np.fmax.at(worst, of, distance.astype(np.float32))

    def _curves(
        self, a: int, owner: Index, rows: Index, begin: Array, tips: Array, inner: Samples, steps: Index,
        courses: Courses, near: Nearness, worst: Single,
    ) -> Samples:  # fmt: skip
        """How far arcs `rows` leave their nominal arcs, the largest per move, from equal steps: the samples
        `inner`, and the tip where they `begin` and end. Returns those that lie beyond the ends of their
        nominal arc, where more counts than what is across it."""
        count = steps[rows] + 1
        tail = np.cumsum(count) - 1
        head = tail - count + 1
        within = np.ones(int(count.sum()), bool)
        within[head] = within[tail] = False
        within = np.flatnonzero(within)
        point, share = np.empty((int(count.sum()), 3)), np.zeros(int(count.sum()))
        point[head], point[within], point[tail] = begin, inner.actual, tips.take(rows + 1, axis=0)
        share[within], share[tail] = inner.share, 1.0
        part = np.repeat(rows, count)
        of = owner[part]
        radial, level, beyond = courses.shapes.across(
            self._known(a + of, point), courses.arc[of], near.share(part, share, of)
        )
        np.fmax.at(worst, owner[rows], peaks((radial, level), count).astype(np.float32))
        return inner.pick(beyond[within])

    def _chords(self, a: int, owner: Index, tips: Array) -> Segments:
        """The chords between the actual ends of parts, which are `tips` and the ones behind them."""
        of = a + owner
        return Segments.of(self._known(of, tips[:-1]), self._known(of, tips[1:]))

    def _bend(
        self, a: int, inner: Samples, owner: Index, curved: Mask, chords: Segments, bend: Single
    ) -> None:
        """How far the samples of straight parts leave the chord of their part."""
        part, actual = inner.part, inner.actual
        if curved.any():
            straight = np.flatnonzero(~curved[part])
            part, actual = part[straight], actual.take(straight, axis=0)
        if not len(part):
            return
        mine = owner[part]
        departure = chords.distance(self._known(a + mine, actual), part)
        np.fmax.at(bend, mine, departure.astype(np.float32))


def owner_of(groups: Index, first: int, last: int) -> Index:
    """(last - first,) the nominal move that each of moves `first`..`last` belongs to; `groups` (n,) are the
    last ones of nominal moves."""
    move = np.arange(first, last)
    # mostly nothing is inserted, and a search takes long
    if np.array_equal(groups, move):
        return move - first
    return np.searchsorted(groups, move)


def _unknown(end_mm: Array) -> Mask:
    """(n, 3) which axes are unknown at the ends of moves."""
    unknown = apart(end_mm.shape, np.bool_)
    for some in spans(len(unknown)):
        unknown[some] = np.isnan(end_mm[some])
    return unknown
