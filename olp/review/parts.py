"""The moves of a corrected program along those of the nominal one, and the positions of the tip on them."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.geometry import PLANES, arc_points
from olp.core.toolpath import Kind, Toolpath
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.errormodel.reversal import plays, taken_up
from olp.program.feeds.moves import lengths_mm
from olp.program.program import Program

#: Kinds of straight moves.
_STRAIGHT = (Kind.RAPID, Kind.LINE, Kind.PROBE)
#: Samples that are evaluated at once, so that their temporaries fit the cache.
BLOCK = 1 << 16


@dataclass(frozen=True, slots=True, eq=False)
class Ends:
    """The moves of a path from end to end; (n,) `arc` index or -1, (n,) `length` in mm."""

    path: Toolpath
    arc: Index
    length: Array

    @staticmethod
    def of(path: Toolpath) -> Ends:
        arc = np.full(len(path), -1, np.int64)
        arc[path.arcs.move] = np.arange(len(path.arcs))
        return Ends(path, arc, lengths_mm(path))

    def start(self, move: Index) -> Array:
        """(m, 3) axis positions at the start of moves."""
        start = self.path.end_mm[np.maximum(move - 1, 0)]
        start[move == 0] = self.path.start_mm
        return start

    def at(self, move: Index, share: Array) -> Array:
        """(m, 3) axis positions at shares of moves; a share of 1 is the end, also with an unknown start."""
        position = np.empty((len(move), 3))
        for a in range(0, len(move), BLOCK):
            rows = slice(a, a + BLOCK)
            position[rows] = self._at(move[rows], share[rows])
        return position

    def _at(self, move: Index, share: Array) -> Array:
        end = self.path.end_mm[move]
        start = self.start(move)
        position = start + share[:, None] * (end - start)
        curved = np.flatnonzero((self.arc[move] >= 0) & (share < 1.0))
        if curved.size:
            arcs, which = self.path.arcs, self.arc[move[curved]]
            position[curved] = arc_points(
                start[curved], end[curved], arcs.centre_mm[which], arcs.plane[which], arcs.sweep_rad[which],
                share[curved],
            )  # fmt: skip
        whole = share == 1.0
        position[whole] = end[whole]
        return position

    def directions(self, move: Index, share: Array) -> Array:
        """(m, 3) unit tangents at shares of moves."""
        step = 1e-6
        first = np.minimum(share, 1.0 - step)
        step_mm = self.at(move, first + step) - self.at(move, first)
        with np.errstate(invalid="ignore", divide="ignore"):
            size_mm = np.sqrt(np.einsum("ij,ij->i", step_mm, step_mm))
            return np.asarray(np.nan_to_num(step_mm / size_mm[:, None]))


@dataclass(frozen=True, slots=True, eq=False)
class Parts:
    """Of the m moves of a corrected program: (m,) `owner`, the nominal move, and the shares of it at which
    they `begin` and end (`cut`)."""

    owner: Index
    begin: Array
    cut: Array

    @staticmethod
    def of(ends: Ends, other: Ends, groups: Index, shift: Array, model: ErrorModel) -> Parts:
        owner = np.searchsorted(groups, np.arange(len(other.path)))
        cut = _cuts(ends, other, owner, groups, shift, model)
        begin = np.zeros(len(cut))
        begin[1:] = np.where(np.diff(owner) == 0, cut[:-1], 0.0)
        return Parts(owner, begin, cut)


def _cuts(ends: Ends, other: Ends, owner: Index, groups: Index, shift: Array, model: ErrorModel) -> Array:
    """(m,) the share of its nominal move that is done at the end of each corrected move."""
    nominal, corrected = ends.path, other.path
    cut = np.ones(len(corrected))
    inner = np.ones(len(corrected), bool)
    inner[groups] = False
    inner &= np.isfinite(ends.length)[owner]
    rows = np.flatnonzero(inner)
    if not rows.size:
        return cut
    move = owner[rows]
    tool = nominal.tool_mm()
    command = corrected.end_mm[rows]
    play = plays(model, corrected.end_mm)
    error = error_mm(model, command, tool, move, None if play is None else play[rows])
    nothing = np.zeros(len(rows))
    tip = command + error - held_mm(nominal, shift, move, nothing)
    start = ends.start(move)
    along = nominal.end_mm[move] - start
    along += held_mm(nominal, shift, move, nothing + 1.0) - held_mm(nominal, shift, move, nothing)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.einsum("ij,ij->i", tip - start, along) / np.einsum("ij,ij->i", along, along)
    curved = np.flatnonzero(ends.arc[move] >= 0)
    if curved.size:
        length = np.nan_to_num(other.length)
        done = np.cumsum(length)
        before = np.concatenate(([0.0], done[groups]))
        total = np.diff(before)[move[curved]]
        guess = (done[rows[curved]] - before[move[curved]]) / np.maximum(total, 1e-12)
        share[curved] = _arc_share(ends, move[curved], tip[curved], guess)
    share = np.clip(np.nan_to_num(share, nan=1.0), 0.0, 1.0)
    cut[rows] = share
    if (np.diff(cut) < 0.0)[np.diff(owner) == 0].any():
        # a step back only takes up backlash: the tip does not move
        rank = 2.0 * (np.cumsum(np.diff(move, prepend=-1) != 0) - 1)
        cut[rows] = np.clip(np.maximum.accumulate(share + rank) - rank, 0.0, 1.0)
    return cut


def with_taken_up(
    written: Toolpath, model: ErrorModel, samples: tuple[Index, Array, Index, Array], command: Array,
    play: Array | None,
) -> tuple[Index, Array, Index, Array] | None:  # fmt: skip
    """Samples (moves, shares, parts, shares of these) with those where an axis that turned round has taken up
    its backlash, inside of a cut of the corrected program. From there on the tip is off by all of it.
    `command` and `play` (n, 3) are those of the samples. None where there are none more."""
    width = model.backlash_at(command)
    if play is None or width is None:
        return None
    move, share, part, within = samples
    turned = 1 + np.flatnonzero((play[1:] != play[:-1]).any(axis=1))
    turned = turned[written.kind[part[turned]] != Kind.RAPID]
    before = turned - 1
    rows, _, of_span = taken_up(play[before], play[turned], command[turned] - command[before], width[before])
    rows, before = turned[rows], before[rows]
    if not rows.size:
        return None
    # a move or a part goes on, or begins at 0
    early = np.where(move[before] == move[rows], share[before], 0.0)
    begun = np.where(part[before] == part[rows], within[before], 0.0)
    order = np.argsort(rows + of_span / 2, kind="stable")
    rows, early, begun, of_span = rows[order], early[order], begun[order], of_span[order]
    columns = (
        (move, move[rows]), (share, early + of_span * (share[rows] - early)),
        (part, part[rows]), (within, begun + of_span * (within[rows] - begun)),
    )  # fmt: skip
    moves, shares, parts, withins = (np.insert(column, rows, values) for column, values in columns)
    return moves.astype(np.int64), shares.astype(float), parts.astype(np.int64), withins.astype(float)


def _arc_share(ends: Ends, move: Index, tip: Array, guess: Array) -> Array:
    """Shares of arcs by the angle of points near them; `guess` gives the turn."""
    arcs, which = ends.path.arcs, ends.arc[move]
    rows = np.arange(len(move))
    axes = np.array(PLANES)[arcs.plane[which]]
    centre, sweep, start = arcs.centre_mm[which], arcs.sweep_rad[which], ends.start(move)

    def angle(point: Array) -> Array:
        first, second = (point[rows, axes[:, i]] - centre[rows, axes[:, i]] for i in (0, 1))
        return np.asarray(np.arctan2(second, first))

    turned = angle(tip) - angle(start)
    turned += 2 * np.pi * np.rint((guess * sweep - turned) / (2 * np.pi))
    return np.asarray(turned / sweep)


def set_beside(
    ends: Ends, other: Ends, parts: Parts, move: Index, share: Array, part: Index, within: Array,
    command: Array, result: Array,
) -> Index:  # fmt: skip
    """Shift commands (n, 3) along their moves, and `within` with them, until the tip is beside its sample.
    Returns which were shifted.

    Equal shares of a move and of its corrected parts are not at the same position. Deviations `result` (n, 3)
    change evenly from the beginning of a part to its end; a difference from that along the path is not a
    deviation of the path.
    """
    rows = np.flatnonzero((within < 1.0) & (within > 0.0) & np.isfinite(other.length[part]))
    if not rows.size:
        return rows
    which = part[rows]
    # the last sample of a part is its end
    end = np.searchsorted(part, np.arange(len(parts.cut)), "right") - 1
    first, last = result[end[np.maximum(which - 1, 0)]], result[end[which]]
    first = np.where(np.isfinite(first), first, last)
    with np.errstate(invalid="ignore", divide="ignore"):
        even = (share[rows] - parts.begin[which]) / (parts.cut - parts.begin)[which]
    even = np.clip(np.nan_to_num(even), 0.0, 1.0)[:, None]
    extra = result[rows] - first - even * (last - first)
    ahead = np.einsum("ij,ij->i", extra, ends.directions(move[rows], share[rows]))
    step = np.nan_to_num(ahead) / np.maximum(other.length[which], 1e-9)
    within[rows] = np.clip(within[rows] - step, 0.0, 1.0)
    command[rows] = other.at(which, within[rows])
    return rows


def set_in_holes(nominal: Program, corrected: Program, move: Index, axis: Array, command: Array) -> Index:
    """Strokes of canned cycles: a corrected hole may need one peck more or less, so pecks have no partners;
    the partner of a point of the stroke is the same point of the corrected hole. Returns the samples of
    which the command was set."""
    holes, others = nominal.holes, corrected.holes
    if not len(holes) or len(holes) != len(others):
        return np.zeros(0, np.int64)
    path = nominal.toolpath
    of = np.full(len(path), -1, np.int64)
    strokes, hole = holes.moves()
    of[strokes] = hole
    axes = np.array(PLANES)[holes.plane]
    mine, theirs = (np.column_stack((some.place_mm, some.r_mm, some.z_mm)) for some in (holes, others))
    rows = np.flatnonzero(of[move] >= 0)
    which = of[move[rows]]
    first, second, third = (axes[which, i] for i in range(3))
    there = axis[rows]
    index = np.arange(len(rows))
    change = (theirs - mine)[which]
    on = np.abs(there[index, first] - mine[which, 0]) + np.abs(there[index, second] - mine[which, 1]) < 1e-9
    depth = mine[which, 3] - mine[which, 2]
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.clip(np.nan_to_num((there[index, third] - mine[which, 2]) / depth), 0.0, 1.0)
    there[index, first] += change[:, 0]
    there[index, second] += change[:, 1]
    there[index, third] += change[:, 2] + share * (change[:, 3] - change[:, 2])
    command[rows[on]] = there[on]
    return np.asarray(rows[on])


def held_mm(path: Toolpath, shift: Array, move: Index, share: Array) -> Array:
    """(m, 3) the shift of the part from its offsets, at shares of moves. It changes along a line that begins
    in one frame and ends in another; an arc has the shift of its own frame."""
    own = path.frame[move]
    before = np.where(
        (move > 0) & np.isin(path.kind[move], _STRAIGHT), path.frame[np.maximum(move - 1, 0)], own
    )
    return np.asarray(shift[before] + share[:, None] * (shift[own] - shift[before]))


def error_mm(model: ErrorModel, points: Array, tool: Array, move: Index, play: Array | None) -> Array:
    """(n, 3) error of the tip, in blocks whose temporaries fit the cache."""
    error = np.empty_like(points)
    for a in range(0, len(points), BLOCK):
        rows = slice(a, a + BLOCK)
        tool_vector = tool if tool.ndim == 1 else tool[move[rows]]
        error[rows] = model.error(points[rows], tool_vector, None if play is None else play[rows])
    return error
