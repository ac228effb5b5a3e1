"""Which moves of a corrected program belong to which move of the nominal one, from the two programs alone.

A correction keeps all moves in their order. It splits some, puts steps that take up backlash before others,
and may change the number of pecks of a hole. So the two sequences are aligned: every nominal move ends with
one move of the corrected program, and those between two such ends lie along the later move. Where the tip is
near the waypoints this is plain; elsewhere the alignment with the least squares of distances is taken.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.errors import ProgramError
from olp.core.geometry import PLANES, segment_distance
from olp.core.toolpath import Flag, Kind, Toolpath
from olp.errormodel.base import ErrorModel
from olp.errormodel.reversal import plays
from olp.program.program import Program

#: mm; beyond this all distances count the same, so one wrong coordinate does not shift the others.
_FAR_MM = 1.0
#: mm2; cost of a nominal move that would end with a move of another kind.
_OTHER_KIND_MM2 = 4.0
#: Share of waypoints that may be far off before the programs count as different jobs.
_MOST_FAR = 0.5
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
#: Inserted moves that a window allows at first; more where the alignment needs them.
_SPARE = 64
#: Inserted moves that a window allows at most while some waypoint is far off.
_MOST_SPARE = 1 << 12
#: How often a window is widened in vain before waypoints count as far off indeed.
_MOST_TRIES = 64
#: Kind of a whole hole.
_HOLE = 255
#: Moves that are as the control makes them: their ends may be anywhere.
_FREE = np.uint8(Flag.PASS | Flag.CONTROL | Flag.MACHINE)


def match(program: Program, target_mm: Array, corrected: Program, model: ErrorModel, near_mm: float) -> Index:
    """(n,) index of the last move of `corrected` for each move of `program`, whose waypoints are
    `target_mm` (n, 3).

    Within `near_mm` of its waypoint a move counts as found. Raises ProgramError where the two programs are
    not the same job: fewer moves, or most waypoints farther off than 1 mm.
    """
    holes = len(program.holes) == len(corrected.holes)
    mine, theirs = _units(program, holes), _units(corrected, holes)
    if len(theirs) < len(mine) or (len(theirs) and not len(mine)):
        word = "fewer than" if len(mine) else "not"
        raise ProgramError(
            f"the corrected program has {len(theirs)} moves and holes, {word} the {len(mine)} of the "
            "nominal one, so it is not a correction of it; give the two programs of one job",
            code="OLP562",
        )
    if not len(mine):
        return np.zeros(0, np.int64)
    path = corrected.toolpath
    play = plays(model, path.end_mm)
    # where an axis is unknown the error may be, too: then the command alone is compared
    tip = path.end_mm + np.nan_to_num(model.error(path.end_mm, path.tool_mm(), play))
    aligned = _Alignment(program.toolpath, target_mm, mine, path, tip, theirs, near_mm)
    ends = aligned.ends()
    _refuse_others(program, target_mm, mine, tip[theirs.last[ends]])
    return _groups(target_mm, mine, tip, theirs, ends)


@dataclass(frozen=True, slots=True, eq=False)
class _Units:
    """Moves, whole holes as one: (u,) `first` and `last` move and `kind`."""

    first: Index
    last: Index
    kind: Index

    def __len__(self) -> int:
        return len(self.last)


def _units(program: Program, holes: bool) -> _Units:
    path = program.toolpath
    starts = np.ones(len(path), bool)
    kind = path.kind.astype(np.int64)
    if holes:
        for hole in program.holes:
            starts[hole.first + 1 : hole.last] = False
            kind[hole.first : hole.last] = _HOLE
    first = np.flatnonzero(starts)
    last = np.append(first[1:], len(path)) - 1 if len(path) else first
    return _Units(first, last, kind[first])


class _Alignment:
    """The alignment of two sequences of units."""

    def __init__(
        self, nominal: Toolpath, target: Array, mine: _Units, path: Toolpath, tip: Array, theirs: _Units,
        near_mm: float,
    ) -> None:  # fmt: skip
        self.mine, self.theirs, self.near = mine, theirs, near_mm
        self.target, self.tip = target[mine.last], tip[theirs.last]
        self.begin = np.empty_like(self.target)
        self.begin[1:], self.begin[0] = self.target[:-1], np.array(nominal.start_mm)
        free = (nominal.flag[mine.last] & _FREE) != 0
        self.unknown = np.asarray(np.isnan(self.target).all(axis=1))
        self.loose = free | self.unknown
        #: what is left uncorrected is known by its commands
        self.said, self.written = nominal.end_mm[mine.last], path.end_mm[theirs.last]
        # a rapid with an unknown axis is left uncorrected
        partly = np.isnan(self.target).any(axis=1) & (mine.kind == Kind.RAPID)
        self.reach = np.where(partly, _FAR_MM / 2, near_mm)
        self.lost = np.asarray(np.isnan(self.tip).all(axis=1))
        index = np.full(len(nominal), -1, np.int64)
        index[nominal.arcs.move] = np.arange(len(nominal.arcs))
        self.arc = index[mine.last]
        self.arcs = nominal.arcs
        move = self.arcs.move
        #: the centres move with the waypoints, by the shift of the zero
        self.centre = self.arcs.centre_mm + np.nan_to_num(target[move] - nominal.end_mm[move])
        #: the length of the path before each unit, and all of it
        self.length = _lengths(nominal, mine, self.begin, self.target)
        start = np.vstack((path.starts_mm()[:1], self.tip[:-1]))
        self.gone = _lengths(path, theirs, start, self.tip)
        #: mm, before which a unit does not end: a path of whole turns passes its end before it ends there
        self.least = np.full(len(mine), -np.inf)
        turning = np.flatnonzero(self.arc >= 0)
        sweep = np.abs(self.arcs.sweep_rad[self.arc[turning]])
        turning, sweep = turning[sweep > 2 * np.pi - _WHOLE], sweep[sweep > 2 * np.pi - _WHOLE]
        self.least[turning] = np.diff(self.length)[turning] * (1.0 - np.pi / sweep)
        self.tries = 0

    def ends(self) -> Index:
        """(u,) the unit of the corrected program at which each nominal unit ends."""
        count, total = len(self.mine), len(self.theirs)
        if count == total:
            return np.arange(count)
        ends = np.zeros(count, np.int64)
        i = j = 0
        size = _FIRST_BLOCK
        while i < count:
            some = self._stretch(i, j, size)
            size = min(2 * size, _BLOCK) if len(some) == size else max(_FIRST_BLOCK, 2 * len(some))
            if not len(some):
                skipped = self._plain_split(i, j)
                some = self._window(i, j) if skipped is None else np.array([j + skipped])
            ends[i : i + len(some)] = some
            i, j = i + len(some), int(some[-1]) + 1
        # what comes behind the last move, such as the second half of a whole circle, belongs to it
        ends[-1] = total - 1
        return ends

    def _room(self, i: int, j: int) -> int:
        """How many moves may be inserted before unit i when unit j is the next."""
        return (len(self.theirs) - j) - (len(self.mine) - i)

    def _near(self, i: Index, j: Index) -> Mask:
        """Whether nominal units end at units of the corrected program, beyond doubt."""
        away = _apart(self.tip[j], self.target[i]).max(axis=1)
        unknown = self.loose[i] & (self.lost[j] | self.unknown[i])
        good: Mask = (away < self.reach[i]) | unknown
        free = np.flatnonzero(self.loose[i])
        if free.size:
            same = _apart(self.written[j[free]], self.said[i[free]]).max(axis=1) < self.near
            good[free] |= same
        good &= self.mine.kind[i] == self.theirs.kind[j]
        return good

    def _stretch(self, i: int, j: int, size: int) -> Index:
        """The ends of the next units, `size` at most, up to the first that is in any doubt.

        Parts are as long together as the whole. So the length of the path tells about where each unit ends.
        """
        rows = np.arange(i, min(i + size, len(self.mine)))
        before = self.length[rows] - self.length[i] + self.gone[j]
        about = np.searchsorted(self.gone[1:], before + np.diff(self.length[i : i + len(rows) + 1]))
        choice = np.clip(about[:, None] + _BESIDE, j, len(self.theirs) - 1)
        near = self._near(np.repeat(rows, len(_BESIDE)), choice.ravel()).reshape(choice.shape)
        near &= self.gone[choice + 1] - before[:, None] >= self.least[rows][:, None]
        ends: Index = choice[np.arange(len(rows)), near.argmax(axis=1)]
        begin = np.concatenate(([j], ends[:-1] + 1))
        inserted = ends - begin
        good = near.any(axis=1) & (inserted >= 0) & (inserted <= _SPARE)
        good &= ends - rows <= len(self.theirs) - len(self.mine)
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
        end = np.flatnonzero(self._near(np.full(len(ahead), i), ahead) & (gone >= self.least[i]))
        if not end.size:
            return None
        count = int(end[0])
        of = np.full(count, i)
        astray = (self._along(of, ahead[:count]) >= self.near) | self._unlike(of, ahead[:count])
        return None if astray.any() else count

    def _unlike(self, i: Index, j: Index) -> Mask:
        """Whether units j are no parts of nominal units i: a part of a rapid is a rapid, and of no other."""
        unlike: Mask = (self.mine.kind[i] == Kind.RAPID) != (self.theirs.kind[j] == Kind.RAPID)
        return unlike

    def _along(self, i: Index, j: Index) -> Array:
        """(m,) mm, how far the ends of units j (m,) are from nominal units i (m,) as lines or arcs."""
        known = ~np.isnan(self.target[i])
        begin, end, point = (
            np.where(known, some, 0.0) for some in (self.begin[i], self.target[i], self.tip[j])
        )
        nowhere = np.asarray(np.isnan(begin).any(axis=1))
        begin = np.where(nowhere[:, None], end, begin)
        away = segment_distance(point, begin, end)
        curved = np.flatnonzero(self.arc[i] >= 0)
        for plane in np.unique(self.arcs.plane[self.arc[i[curved]]]).tolist():
            some = curved[self.arcs.plane[self.arc[i[curved]]] == plane]
            away[some] = self._from_arcs(self.arc[i[some]], begin[some], end[some], point[some], plane)
        return np.nan_to_num(away, nan=_FAR_MM)

    def _from_arcs(self, arc: Index, begin: Array, end: Array, point: Array, plane: int) -> Array:
        """(m,) distances of points from nominal arcs of a plane: across them, and beyond their ends."""
        first, second, third = PLANES[plane]
        centre, sweep = self.centre[arc], self.arcs.sweep_rad[arc]
        (x0, y0), (x1, y1), (x, y) = (
            (some[:, first] - centre[:, first], some[:, second] - centre[:, second])
            for some in (begin, end, point)
        )
        radius = np.hypot(x1, y1)
        across = np.hypot(x, y) - radius
        angle = np.sign(sweep) * (np.arctan2(y, x) - np.arctan2(y0, x0))
        # a little before the start is at the start
        angle = np.mod(angle + 0.5 * _WHOLE, 2 * np.pi) - 0.5 * _WHOLE
        beyond = np.maximum(angle - np.abs(sweep), 0.0) * radius
        low = np.minimum(begin[:, third], end[:, third])
        high = np.maximum(begin[:, third], end[:, third])
        level = np.maximum(np.maximum(low - point[:, third], point[:, third] - high), 0.0)
        away: Array = np.sqrt(across**2 + beyond**2 + level**2)
        return away

    def _window(self, i: int, j: int) -> Index:
        """The ends of the next units, by the least squares of all distances.

        Where the units have more parts than the window allows, some end far off or the last at its edge.
        """
        rows = min(_WINDOW, len(self.mine) - i)
        kept = rows if i + rows == len(self.mine) else _KEPT
        spare, room = _SPARE, self._room(i, j)
        while True:
            width = rows + min(room, spare)
            ends = self._aligned(i, j, rows, width)
            far = self._far(i + np.arange(kept), ends[:kept])
            more = far and spare < _MOST_SPARE and self.tries < _MOST_TRIES
            if spare >= room or (ends[-1] - j < width - 1 and not more):
                self.tries += far
                return ends[:kept]
            spare *= 4

    def _far(self, i: Index, j: Index) -> bool:
        """Whether some nominal unit would end far from its waypoint."""
        away = _apart(self.tip[j], self.target[i]).max(axis=1)
        return bool(((away >= _FAR_MM) & ~self.loose[i]).any())

    def _aligned(self, i: int, j: int, rows: int, width: int) -> Index:
        """Dynamic programming over `rows` nominal units and `width` units of the corrected program."""
        columns = np.arange(j, j + width)
        best = np.full(width + 1, np.inf)
        best[0] = 0.0
        back = np.zeros((rows, width), np.int64)
        for r in range(rows):
            end, inner = self._costs(i + r, columns)
            total = np.concatenate(([0.0], np.cumsum(inner)))
            # best[c]: the units before end before column c
            gain = best - total
            least = np.minimum.accumulate(gain)
            lower = gain < np.concatenate(([np.inf], least[:-1]))
            back[r] = np.maximum.accumulate(np.where(lower, np.arange(width + 1), 0))[:width]
            best = np.full(width + 1, np.inf)
            best[1:] = least[:width] + total[:width] + end
        whole = i + rows == len(self.mine) and j + width == len(self.theirs)
        column = width - 1 if whole else int(np.argmin(best[1:]))
        ends = np.zeros(rows, np.int64)
        for r in range(rows - 1, -1, -1):
            ends[r] = j + column
            column = int(back[r, column]) - 1
        return ends

    def _costs(self, i: int, j: Index) -> tuple[Array, Array]:
        """mm2: what it costs that unit i ends at each of units j, and that each of them is a part of it."""
        away = np.minimum((_apart(self.tip[j], self.target[i : i + 1]) ** 2).sum(axis=1), _FAR_MM**2)
        if self.loose[i]:
            away = np.minimum((_apart(self.written[j], self.said[i : i + 1]) ** 2).sum(axis=1), _FAR_MM**2)
        end = away + np.where(self.mine.kind[i] == self.theirs.kind[j], 0.0, _OTHER_KIND_MM2)
        of = np.full(len(j), i)
        part = np.minimum(self._along(of, j), _FAR_MM) ** 2
        part += np.where(self._unlike(of, j), _OTHER_KIND_MM2, 0.0)
        return end, part


def _lengths(path: Toolpath, units: _Units, begin: Array, end: Array) -> Array:
    """(u + 1,) mm, the length of the path before each unit, and all of it; 0 for what is not known."""
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


def _apart(tip: Array, target: Array) -> Array:
    """(m, 3) mm: how far tips are from targets along each axis. An axis that is unknown in both is as meant,
    one that is unknown in one of them is far off."""
    away = np.abs(tip - target)
    return np.where(np.isnan(tip) & np.isnan(target), 0.0, np.nan_to_num(away, nan=_FAR_MM))


def _refuse_others(program: Program, target: Array, mine: _Units, tip: Array) -> None:
    """Raise ProgramError where most waypoints are far off: this is another job."""
    nominal = program.toolpath
    counted = ((nominal.flag[mine.last] & _FREE) == 0) & ~np.isnan(target[mine.last]).all(axis=1)
    near = _apart(tip, target[mine.last]).max(axis=1) < _FAR_MM
    far = counted & ~near
    if counted.any() and far.sum() > _MOST_FAR * counted.sum():
        stated = program.in_original()
        line = stated.place(int(stated.toolpath.line[mine.last[np.argmax(far)]]))
        raise ProgramError(
            f"{int(far.sum())} of {int(counted.sum())} waypoints are farther than {_FAR_MM:g} mm from those "
            f"of the nominal program, the first at its line {line}; it is not a "
            "correction of this program for this machine",
            code="OLP562",
        )


def _groups(target: Array, mine: _Units, tip: Array, theirs: _Units, ends: Index) -> Index:
    """(n,) the last move of the corrected program for each nominal move, from those of the units."""
    groups = np.zeros(len(target), np.int64)
    groups[mine.last] = theirs.last[ends]
    for u in np.flatnonzero(mine.last > mine.first).tolist():
        # of a hole: the strokes one by one; one peck more belongs to the last stroke
        first, last = int(mine.first[u]), int(mine.last[u])
        begin, end = int(theirs.first[ends[u]]), int(theirs.last[ends[u]])
        count = last - first
        begin += _first_stroke(target[first : last + 1], tip[begin : end + 1])
        groups[first:last] = np.minimum(begin + np.arange(count), end)
    return groups


def _first_stroke(target: Array, tip: Array) -> int:
    """With how many moves the corrected hole begins before the first of the nominal one: a rapid to the hole
    that the nominal program does not need."""
    extra = max(len(tip) - len(target), 0)
    few = min(2, len(target), len(tip))
    away = [np.abs(tip[k : k + few] - target[:few]).sum() for k in range(extra + 1)]
    return int(np.argmin(away))
