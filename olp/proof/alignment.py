"""The alignment of two sequences of moves, page by page, so that memory is small.

Every nominal unit, a move or a whole hole, ends with one unit of the corrected program. Where the tip is near
the waypoints this is plain; elsewhere the alignment with the least squares of distances is taken.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from olp.compensation.plan import TargetRows
from olp.core.arrays import Array, Index, Mask, all_in_row, any_in_row, distinct, most_in_row
from olp.core.geometry import PLANES, segment_distance
from olp.core.toolpath import Flag, Kind
from olp.proof.pages import Page, Tips

#: mm; beyond this all distances count the same, so one wrong coordinate does not shift the others.
FAR_MM = 1.0
#: Moves that are as the control makes them: their ends may be anywhere.
FREE = np.uint8(Flag.PASS | Flag.CONTROL | Flag.MACHINE)
#: mm2; cost of a nominal move that would end with a move of another kind.
_OTHER_KIND_MM2 = 4.0
#: Units that are aligned at once where nothing is in doubt: at first, and at most.
_FIRST_BLOCK = 16
_BLOCK = 4096
#: Where a unit may end beside the place that the length of the path tells.
_BESIDE = np.arange(-2, 4)
#: Nominal units that are aligned at once.
_WINDOW = 12
#: How many of them are kept: the last ones depend on what comes behind them.
_KEPT = 6
#: rad; angles of an arc count from this much before its start.
_WHOLE = 1e-3
#: rad; an arc that turns farther passes its end before it ends there.
_TURN = 2 * np.pi - _WHOLE
#: Inserted moves that a window allows at first; more where the alignment needs them.
_SPARE = 64
#: Inserted moves that a window allows at most while some waypoint is far off.
_MOST_SPARE = 1 << 12
#: How often a window is widened in vain before waypoints count as far off indeed.
_MOST_TRIES = 64


class Alignment:
    """The alignment of two pages, from their first units on."""

    def __init__(
        self, nominal: Page, target: TargetRows, path: Page, tips: Tips, near_mm: float, tries: int
    ) -> None:
        """`target` (n, 3) are the nominal waypoints of all moves, `tries` are windows that were widened in
        vain so far."""
        self.mine, self.theirs, self.near = nominal, path, near_mm
        part, begin = nominal.path, nominal.first
        last = begin + nominal.last
        self.target = target[last]
        self.begin = np.empty_like(self.target)
        self.begin[1:] = self.target[:-1]
        self.begin[0] = target[begin - 1] if begin else np.array(part.start_mm)
        before = max(path.first - 1, 0)
        tip = tips.of(before, path.first + len(path.path))
        own = tip[path.first - before :]
        self.tip = own.take(path.last, axis=0)
        free = (part.flag[nominal.last] & FREE) != 0
        self.unknown = np.asarray(all_in_row(np.isnan(self.target)))
        self.loose = free | self.unknown
        #: what is left uncorrected is known by its commands
        self.said = part.end_mm.take(nominal.last, axis=0)
        self.written = path.path.end_mm.take(path.last, axis=0)
        # a rapid with an unknown axis is left uncorrected
        partly = any_in_row(np.isnan(self.target)) & (nominal.kind == Kind.RAPID)
        self.reach = np.where(partly, FAR_MM / 2, near_mm)
        self.lost = np.asarray(all_in_row(np.isnan(self.tip)))
        index = np.full(len(part), -1, np.int64)
        index[part.arcs.move] = np.arange(len(part.arcs))
        self.arc = index[nominal.last]
        self.arcs = part.arcs
        move = self.arcs.move
        #: the centres move with the waypoints, by the shift of the zero
        self.centre = self.arcs.centre_mm + np.nan_to_num(target[begin + move] - part.end_mm[move])
        self.first_tip = tip[:1] if path.first else np.array(path.path.start_mm)[None]
        self.turning = np.flatnonzero(self.arc >= 0)
        sweep = np.abs(self.arcs.sweep_rad[self.arc[self.turning]])
        self.turning, self.sweep = self.turning[sweep > _TURN], sweep[sweep > _TURN]
        self.tries = tries

    @cached_property
    def length(self) -> Array:
        """(u + 1,) mm, the length of the nominal path before each unit, and all of it."""
        return _lengths(self.mine, self.begin, self.target)

    @cached_property
    def gone(self) -> Array:
        """The same of the corrected path."""
        return _lengths(self.theirs, np.vstack((self.first_tip, self.tip[:-1])), self.tip)

    @cached_property
    def least(self) -> Array:
        """(u,) mm, before which a unit does not end: a path of whole turns passes its end before."""
        least = np.full(len(self.mine), -np.inf)
        least[self.turning] = np.diff(self.length)[self.turning] * (1.0 - np.pi / self.sweep)
        return least

    @cached_property
    def lonely(self) -> Mask:
        """(u,) whether no tip is near both a waypoint and the one before it."""
        # false where an axis is unknown
        return any_in_row(np.abs(self.target - self.begin) > 2 * self.reach.max(initial=0.0))

    def ends(self) -> Index:
        """The unit of the corrected program at which each nominal unit ends, of the first nominal units: as
        many as the pages tell for certain."""
        count, total = len(self.mine), len(self.theirs)
        ends = np.zeros(count, np.int64)
        i = j = 0
        size = _FIRST_BLOCK
        while i < count and not self._short(i, j):
            some = self._stretch(i, j, size)
            size = min(2 * size, _BLOCK) if len(some) == size else max(_FIRST_BLOCK, 2 * len(some))
            if not len(some):
                skipped = self._plain_split(i, j)
                some = self._window(i, j) if skipped is None else np.array([j + skipped])
                if not len(some):
                    break
            ends[i : i + len(some)] = some
            i, j = i + len(some), int(some[-1]) + 1
        if i == count and self.mine.final:
            # what comes behind the last move, such as the second half of a whole circle, belongs to it
            ends[-1] = total - 1
        return ends[:i]

    def _short(self, i: int, j: int) -> bool:
        """Whether the pages end too soon behind unit i and unit j for a window."""
        return (i + _WINDOW > len(self.mine) and not self.mine.final) or (
            j + _WINDOW + _SPARE >= len(self.theirs) and not self.theirs.final
        )

    def _room(self, i: int, j: int) -> int:
        """How many moves may be inserted before unit i when unit j is the next."""
        return (self.theirs.left - j) - (self.mine.left - i)

    def _near(self, i: Index, j: Index) -> Mask:
        """Whether nominal units end at units of the corrected program, beyond doubt."""
        good: Mask = _within(self.tip[j], self.target[i], self.reach[i])
        free = np.flatnonzero(self.loose[i])
        if free.size:
            j_free, i_free = j[free], i[free]
            good[free] |= self.lost[j_free] | self.unknown[i_free]
            good[free] |= _within(self.written[j_free], self.said[i_free], np.full(len(free), self.near))
        good &= self.mine.kind[i] == self.theirs.kind[j]
        return good

    def _in_step(self, i: int, j: int, count: int) -> bool:
        """Whether the next units, and the one behind them, end one by one at the units from j on."""
        mine = slice(i, min(i + count + 1, len(self.mine)))
        others = slice(j, j + mine.stop - i)
        if others.stop > len(self.theirs):
            return False
        alike = self.lonely[mine] & (self.mine.kind[mine] == self.theirs.kind[others])
        return bool((alike & _within(self.tip[others], self.target[mine], self.reach[mine])).all())

    def _stretch(self, i: int, j: int, size: int) -> Index:
        """The ends of the next units, `size` at most, up to the first that is in any doubt.

        Parts are as long together as the whole. So the length of the path tells about where each unit ends.
        """
        # what comes behind a unit has to be on the page
        rows = np.arange(i, min(i + size, len(self.mine) - (not self.mine.final)))
        if self._in_step(i, j, len(rows)):
            return j + np.arange(len(rows))
        before = self.length[rows] - self.length[i] + self.gone[j]
        about = np.searchsorted(self.gone[1:], before + np.diff(self.length[i : i + len(rows) + 1]))
        choice = np.clip(about[:, None] + _BESIDE, j, len(self.theirs) - 1)
        near = self._near(np.repeat(rows, len(_BESIDE)), choice.ravel()).reshape(choice.shape)
        row, beside = np.nonzero(near)
        of, end = rows[row], choice[row, beside]
        ended = (self.gone[end + 1] - before[row] >= self.least[of]) & ~self._goes_on(of, end)
        near[row, beside] = ended
        ends: Index = choice[np.arange(len(rows)), near.argmax(axis=1)]
        begin = np.concatenate(([j], ends[:-1] + 1))
        inserted = ends - begin
        good = any_in_row(near) & (inserted >= 0) & (inserted <= _SPARE)
        good &= ends - rows <= self._room(0, 0)
        if not self.theirs.final:
            good &= about + _BESIDE[-1] + 1 < len(self.theirs)
        count = len(good) if good.all() else int(np.argmin(good))
        inserted = inserted[:count]
        if inserted.any():
            owner = np.repeat(np.arange(count), inserted)
            first = np.cumsum(inserted) - inserted
            part = begin[owner] + np.arange(len(owner)) - first[owner]
            of = rows[owner]
            # one that ends as the unit does leaves a choice
            gone = self.gone[part + 1] - self.gone[begin[owner]]
            astray = self._unlike(of, part) | (self._near(of, part) & (gone >= self.least[of]))
            astray |= self._along(of, part) >= self.near
            count = int(owner[int(np.argmax(astray))]) if astray.any() else count
        return ends[:count]

    def _plain_split(self, i: int, j: int) -> int | None:
        """The number of moves inserted before the end of unit i where they all lie along it, None where that
        is not plain."""
        ahead = np.arange(j, j + min(self._room(i, j), _SPARE) + 1)
        gone = self.gone[ahead + 1] - self.gone[j]
        of = np.full(len(ahead), i)
        end = np.flatnonzero(self._near(of, ahead) & (gone >= self.least[i]) & ~self._goes_on(of, ahead))
        if not end.size:
            return None
        count = int(end[0])
        of = of[:count]
        astray = (self._along(of, ahead[:count]) >= self.near) | self._unlike(of, ahead[:count])
        return None if astray.any() else count

    def _unlike(self, i: Index, j: Index) -> Mask:
        """Whether units j are no parts of nominal units i: a part of a rapid is a rapid, and of no other."""
        unlike: Mask = (self.mine.kind[i] == Kind.RAPID) != (self.theirs.kind[j] == Kind.RAPID)
        return unlike

    def _goes_on(self, i: Index, j: Index) -> Mask:
        """Whether units i go on behind units j: what comes there ends as they do, and is no part of the next
        unit. Such is a step that takes up backlash within a short move."""
        on: Mask = (i + 1 < len(self.mine)) & (j + 1 < len(self.theirs))
        some = np.flatnonzero(on)
        on[some] = self._unlike(i[some] + 1, j[some] + 1)
        some = np.flatnonzero(on)
        on[some] = self._near(i[some], j[some] + 1)
        return on

    def _along(self, i: Index, j: Index) -> Array:
        """(m,) mm, how far the ends of units j (m,) are from nominal units i (m,) as lines or arcs."""
        known = ~np.isnan(self.target[i])
        begin, end, point = (
            np.where(known, some, 0.0) for some in (self.begin[i], self.target[i], self.tip[j])
        )
        nowhere = np.asarray(any_in_row(np.isnan(begin)))
        begin = np.where(nowhere[:, None], end, begin)
        away = segment_distance(point, begin, end)
        curved = np.flatnonzero(self.arc[i] >= 0)
        for plane in distinct(self.arcs.plane[self.arc[i[curved]]]).tolist():
            some = curved[self.arcs.plane[self.arc[i[curved]]] == plane]
            away[some] = self._from_arcs(self.arc[i[some]], begin[some], end[some], point[some], plane)
        away[np.isnan(away)] = FAR_MM
        return away

    def _from_arcs(self, arc: Index, begin: Array, end: Array, point: Array, plane: int) -> Array:
        """(m,) distances of points from nominal arcs of a plane: across them, and beyond their ends."""
        first, second, third = PLANES[plane]
        centre, sweep = self.centre[arc], self.arcs.sweep_rad[arc]
        (x0, y0), (x1, y1), (x, y) = (
            (some[:, first] - centre[:, first], some[:, second] - centre[:, second])
            for some in (begin, end, point)
        )
        radius, first_radius = np.hypot(x1, y1), np.hypot(x0, y0)
        angle = np.sign(sweep) * (np.arctan2(y, x) - np.arctan2(y0, x0))
        # a little before the start is at the start
        angle = np.mod(angle + 0.5 * _WHOLE, 2 * np.pi) - 0.5 * _WHOLE
        size = np.abs(sweep)
        beyond = np.maximum(angle - size, 0.0) * radius
        # rounded words state radii that differ at both ends; between them the radius goes linearly, and the
        # turn is the one with the nearest radius
        wider = (radius - first_radius) / size
        with np.errstate(divide="ignore", invalid="ignore"):
            turns = np.nan_to_num(np.rint(((np.hypot(x, y) - first_radius) / wider - angle) / (2 * np.pi)))
        turns = np.clip(turns, 0, np.maximum(np.floor((size - angle) / (2 * np.pi)), 0))
        along = np.clip(angle + 2 * np.pi * turns, 0.0, size)
        across = np.hypot(x, y) - first_radius - wider * along
        low = np.minimum(begin[:, third], end[:, third])
        high = np.maximum(begin[:, third], end[:, third])
        level = np.maximum(np.maximum(low - point[:, third], point[:, third] - high), 0.0)
        away: Array = np.sqrt(across**2 + beyond**2 + level**2)
        return away

    def _window(self, i: int, j: int) -> Index:
        """The ends of the next units, by the least squares of all distances; none where the page is too short
        for that.

        Where the units have more parts than the window allows, some end far off or the last at its edge.
        """
        rows = min(_WINDOW, self.mine.left - i)
        kept = rows if i + rows == self.mine.left else _KEPT
        spare, room = _SPARE, self._room(i, j)
        while True:
            width = rows + min(room, spare)
            if j + width > len(self.theirs):
                return np.zeros(0, np.int64)
            ends = self._aligned(i, j, rows, width)
            far = self._far(i + np.arange(kept), ends[:kept])
            more = far and spare < _MOST_SPARE and self.tries < _MOST_TRIES
            if spare >= room or (ends[-1] - j < width - 1 and not more):
                self.tries += far
                return ends[:kept]
            spare *= 4

    def _far(self, i: Index, j: Index) -> bool:
        """Whether some nominal unit would end far from its waypoint."""
        away = most_in_row(off_mm(self.tip[j], self.target[i]))
        return bool(((away >= FAR_MM) & ~self.loose[i]).any())

    def _aligned(self, i: int, j: int, rows: int, width: int) -> Index:
        """Dynamic programming over `rows` nominal units and `width` units of the corrected program."""
        columns = np.arange(j, j + width)
        best = np.full(width + 1, np.inf)
        best[0] = 0.0
        back = np.zeros((rows, width), np.int64)
        ends_mm2, inner_mm2 = self._costs(i + np.arange(rows), columns)
        totals = np.zeros((rows, width + 1))
        np.cumsum(inner_mm2, axis=1, out=totals[:, 1:])
        for r in range(rows):
            total = totals[r]
            # best[c]: the units before end before column c
            gain = best - total
            least = np.minimum.accumulate(gain)
            lower = gain < np.concatenate(([np.inf], least[:-1]))
            back[r] = np.maximum.accumulate(np.where(lower, np.arange(width + 1), 0))[:width]
            best = np.full(width + 1, np.inf)
            best[1:] = least[:width] + total[:width] + ends_mm2[r]
        whole = i + rows == self.mine.left and j + width == self.theirs.left
        column = width - 1 if whole else int(np.argmin(best[1:]))
        ends = np.zeros(rows, np.int64)
        for r in range(rows - 1, -1, -1):
            ends[r] = j + column
            column = int(back[r, column]) - 1
        return ends

    def _costs(self, i: Index, j: Index) -> tuple[Array, Array]:
        """(rows, width) mm2: what it costs that each of units i ends at each of units j, and that each of
        these is a part of it."""
        shape = len(i), len(j)
        i, j = np.repeat(i, len(j)), np.tile(j, len(i))
        loose = self.loose[i, None]
        tip = np.where(loose, self.written[j], self.tip[j])
        target = np.where(loose, self.said[i], self.target[i])
        end = np.minimum((off_mm(tip, target) ** 2).sum(axis=1), FAR_MM**2)
        end += np.where(self.mine.kind[i] == self.theirs.kind[j], 0.0, _OTHER_KIND_MM2)
        part = np.minimum(self._along(i, j), FAR_MM) ** 2
        part += np.where(self._unlike(i, j), _OTHER_KIND_MM2, 0.0)
        return end.reshape(shape), part.reshape(shape)


def _lengths(units: Page, begin: Array, end: Array) -> Array:
    """(u + 1,) mm, the length of the path before each unit, and all of it; 0 for what is not known."""
    path = units.path
    own = np.nan_to_num(np.sqrt(((end - begin) ** 2).sum(axis=1)))
    if len(path.arcs):
        unit = np.searchsorted(units.last, path.arcs.move)
        radius = np.empty(len(unit))
        rise = np.empty(len(unit))
        for plane, (first, second, third) in enumerate(PLANES):
            some = path.arcs.plane == plane
            arm = path.end_mm[path.arcs.move[some]] - path.arcs.centre_mm[some]
            radius[some] = np.hypot(arm[:, first], arm[:, second])
            rise[some] = (end - begin)[unit[some], third]
        own[unit] = np.nan_to_num(np.hypot(radius * path.arcs.sweep_rad, rise))
    return np.concatenate(([0.0], np.cumsum(own)))


def off_mm(tip: Array, target: Array) -> Array:
    """(m, 3) mm: how far tips are from targets along each axis. An axis that is unknown in both is as meant,
    one that is unknown in one of them is far off."""
    away = np.abs(tip - target)
    return np.where(np.isnan(away), np.where(np.isnan(tip) & np.isnan(target), 0.0, FAR_MM), away)


def _within(tip: Array, target: Array, reach: Array) -> Mask:
    """Whether tips (m, 3) are within reach (m,) of targets, as `off_mm` says."""
    away = np.abs(tip - target)
    good = (away[:, 0] < reach) & (away[:, 1] < reach) & (away[:, 2] < reach)
    blind = np.flatnonzero(np.isnan(away[:, 0] + away[:, 1] + away[:, 2]))
    if blind.size:
        good[blind] = most_in_row(off_mm(tip[blind], target[blind])) < reach[blind]
    return np.asarray(good)
