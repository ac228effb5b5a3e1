"""Arcs stay arcs: a circular or helical move is commanded as an arc wherever one fits the bent path.

The corrected path of an arc is sampled. Least squares finds the circle through its end points that leaves the
samples least. Where it leaves them by more than the tolerance, the piece is divided.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from olp.compensation.invert import bent
from olp.compensation.lines import Cuts, no_cuts
from olp.core.arrays import Array, Index, Mask, distinct, most_in_row
from olp.core.errors import CannotCompute
from olp.core.geometry import (
    PLANES,
    ArcShapes,
    Plane,
    arc_directions,
    arc_points,
    arms,
    in_planes,
    put_in_planes,
)
from olp.core.toolpath import Toolpath
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.errormodel.sampling import steps_needed

#: a centre is moved by a millimetre only to gain a micrometre of fit
_STIFFNESS = 1e-3
#: rounds of division, at most
_DEEPEST = 14
#: pieces of all arcs that do not fit yet: of few arcs, and for each arc
_PIECES = 20_000
_PIECES_PER_ARC = 16
#: mm; the step of a fit behind such a one is its square or so, below the digits of a number
_STILL_MM = 1e-7
#: rad; arcs beyond this sweep need not have equal radii at both ends
WIDE = 0.95 * np.pi
#: rad; a piece that sweeps more may be a whole turn whose ends nearly meet
_NEARLY_WHOLE = 1.9 * np.pi
#: mm; ends that are moved alike meet as they did
_ALIKE_MM = 1e-9
#: digits that rounding moves the two ends of a turn apart at most, and one to spare
_CLOSE_DIGITS = 3.0
#: samples at a time, so that memory is small
_BATCH = 1 << 16
#: (3, 3) axes of each plane: first, second, third
_AXES = np.array(PLANES)


@dataclass(frozen=True, slots=True, eq=False)
class Pieces:
    """Pieces of arcs: index of the arc in `Arcs`, and the shares of its sweep where the piece begins and
    ends."""

    arc: Index
    begin: Array
    end: Array

    def __len__(self) -> int:
        return len(self.arc)

    def pick(self, which: npt.NDArray[np.generic]) -> Pieces:
        return Pieces(self.arc[which], self.begin[which], self.end[which])

    @staticmethod
    def joined(parts: Sequence[Pieces]) -> Pieces:
        return Pieces(*(np.concatenate([getattr(p, name) for p in parts]) for name in Pieces.__slots__))


def subdivide_arcs(
    path: Toolpath,
    model: ErrorModel,
    target: Array,
    free: Mask,
    tolerance: float,
    turning: Mask | None,
    band: float,
    digit: float = 0.0,
    one_radius: bool = False,
) -> Cuts:
    """Cuts (move, share, target) of the arcs that are `free` to be split and that one arc does not fit within
    `tolerance` mm; where an axis has backlash (`turning`), also where that axis turns round. A whole turn
    that does not come back to its start is cut too, as its last `digit` (mm) would decide about a turn.
    With `one_radius` no arc may end on another radius than it begins on."""
    arcs = path.arcs
    arc = np.flatnonzero(free[arcs.move])
    if not arc.size:
        return no_cuts()
    pieces = Pieces(arc, np.zeros(len(arc)), np.ones(len(arc)))
    if turning is not None:
        pieces = _at_quadrants(path, pieces, turning, band)
    tools = path.tool_mm()
    done: list[Pieces] = []
    while len(pieces):
        fitting = _fitting(path, model, target, pieces, tools, tolerance, one_radius)
        whole, pieces = _opened(path, model, target, fitting, tools, digit)
        done.append(whole)
    pieces = Pieces.joined(done)
    inner = pieces.end < 1.0
    arc, end = pieces.arc[inner], pieces.end[inner]
    starts, ends = _ends(path, target, arc)
    centre = arcs.centre_mm[arc] + (ends - path.end_mm[arcs.move[arc]])
    return arcs.move[arc], end, arc_points(starts, ends, centre, arcs.plane[arc], arcs.sweep_rad[arc], end)


def _fitting(
    path: Toolpath, model: ErrorModel, target: Array, pieces: Pieces, tools: Array, tolerance: float,
    one_radius: bool,
) -> Pieces:  # fmt: skip
    """The pieces, divided until one arc fits each. Raises CannotCompute as `subdivide_arcs`."""
    arcs = path.arcs
    done: list[Pieces] = []
    most = max(_PIECES, _PIECES_PER_ARC * len(pieces))
    for _ in range(_DEEPEST):
        if not len(pieces) or len(pieces) > most:
            break
        away = np.zeros(len(pieces))
        for part, count in sample_groups(path, model, target, pieces, tools, tolerance):
            away[part] = fit_pieces(path, model, target, pieces.pick(part), tools, count, one_radius)
        good = away <= tolerance
        done.append(pieces.pick(good))
        # the departure of an arc goes with about the third power of its length
        parts = np.clip(np.ceil((away[~good] / tolerance) ** (1 / 3) * 1.05), 2, 16)
        pieces = _divided(pieces.pick(~good), parts.astype(np.int64))
    if len(pieces):
        raise CannotCompute(
            "this arc exceeds the tolerance however finely it is divided into arcs; raise --tolerance-um",
            line=int(path.line[arcs.move[pieces.arc[0]]]),
        )
    return Pieces.joined(done)


def _opened(
    path: Toolpath, model: ErrorModel, target: Array, pieces: Pieces, tools: Array, digit: float
) -> tuple[Pieces, Pieces]:
    """Pieces that stay, and both parts of the others: half a turn is cut off at the end of those that are
    whole turns, or nearly, and whose commands do not meet. As written they could end before their start or
    behind it. An arc that fits the whole may not fit the parts."""
    arcs = path.arcs
    sweep = np.abs(arcs.sweep_rad[pieces.arc]) * (pieces.end - pieces.begin)
    whole = np.flatnonzero(sweep > _NEARLY_WHOLE)
    if not whole.size:
        return pieces, pieces.pick(whole)
    part = pieces.pick(whole)
    bend = sampled(path, model, target, part, tools, 2)
    plane = arcs.plane[part.arc]
    first, last = bend.command[:, 0], bend.command[:, -1]
    radius = np.hypot(*arms(bend.point[:, 0], bend.centre, plane))
    turns = sweep[whole] / (2 * np.pi)
    short = np.abs(turns - np.rint(turns)) * 2 * np.pi * radius
    moved = np.hypot(*arms(last - bend.point[:, -1], first - bend.point[:, 0], plane))
    odd = np.flatnonzero((short < 2 * moved + _CLOSE_DIGITS * digit) & (moved > _ALIKE_MM))
    cut = part.pick(odd)
    middle = cut.end - np.pi / np.abs(arcs.sweep_rad[cut.arc])
    kept = np.ones(len(pieces), bool)
    kept[whole[odd]] = False
    parts = Pieces(cut.arc, cut.begin, middle), Pieces(cut.arc, middle, cut.end)
    return pieces.pick(kept), Pieces.joined(parts)


def _divided(pieces: Pieces, count: Index) -> Pieces:
    """Each piece in `count` equal ones."""
    which = np.repeat(np.arange(len(pieces)), count)
    k = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
    step = (pieces.end - pieces.begin) / count
    begin = pieces.begin[which] + k * step[which]
    last = k == count[which] - 1
    end = np.where(last, pieces.end[which], pieces.begin[which] + (k + 1) * step[which])
    return Pieces(pieces.arc[which], begin, end)


def _ends(path: Toolpath, target: Array, arc: Index) -> tuple[Array, Array]:
    """Targets at the start and the end of arcs; the start lies in the frame of the arc's own move."""
    move = path.arcs.move[arc]
    goal = target.take(move, axis=0)
    return _starts(path, move) + (goal - path.end_mm.take(move, axis=0)), goal


def _starts(path: Toolpath, move: Index) -> Array:
    """(n, 3) where moves begin as the program says."""
    start = path.end_mm.take(np.maximum(move - 1, 0), axis=0)
    start[move == 0] = path.start_mm
    return start


@dataclass(frozen=True, slots=True, eq=False)
class Bend:
    """How pieces of arcs are bent: nominal `point` and `command` (n, s, 3) at shares (s,) of the piece.
    `centre` (n, 3) is nominal, `mismatch` (n,) is that of the nominal radii at both ends. `rigid` (n,) pieces
    are shifted, not bent."""

    point: Array
    command: Array
    share: Array
    centre: Array
    mismatch: Array
    rigid: Mask


def sample_groups(
    path: Toolpath, model: ErrorModel, target: Array, pieces: Pieces, tools: Array, tolerance: float
) -> Iterator[tuple[Index, int]]:
    """Pieces (indices) that need the same number of samples, in batches, so that nothing of the error is
    missed."""
    arcs = path.arcs
    start, end = _ends(path, target, pieces.arc)
    plane, finish = arcs.plane[pieces.arc], path.end_mm.take(arcs.move[pieces.arc], axis=0)
    radius = np.hypot(*arms(finish, arcs.centre_mm.take(pieces.arc, axis=0), plane))
    share = pieces.end - pieces.begin
    delta = np.abs(end - start) * share[:, None]
    reach = np.minimum(radius * np.abs(arcs.sweep_rad[pieces.arc]) * share, 2 * radius)
    put_in_planes(delta, plane, reach, reach)
    tool = tools if tools.ndim == 1 else tools[arcs.move[pieces.arc]]
    count = steps_needed(model, delta, tool, tolerance / 4, at_least=8, at_most=256)
    # as many for each turn: half turns apart, samples would not say where the centre is
    turns = np.ceil(np.abs(arcs.sweep_rad[pieces.arc]) * share / (2 * np.pi) - 1e-9)
    count *= np.maximum(turns, 1.0).astype(np.int64)
    for steps in distinct(count).tolist():
        group = np.flatnonzero(count == steps)
        size = max(1, _BATCH // steps)
        for a in range(0, len(group), size):
            yield group[a : a + size], steps


def sampled(
    path: Toolpath, model: ErrorModel, target: Array, pieces: Pieces, tools: Array, count: int
) -> Bend:
    """Sample pieces at `count` equal steps."""
    arcs, move = path.arcs, path.arcs.move[pieces.arc]
    start, end = _ends(path, target, pieces.arc)
    plane, sweep = arcs.plane[pieces.arc], arcs.sweep_rad[pieces.arc]
    # where the part really lies: the centres are moved with the end points
    centre = arcs.centre_mm.take(pieces.arc, axis=0) + (end - path.end_mm.take(move, axis=0))
    rows = np.arange(len(pieces))
    tool = tools if tools.ndim == 1 else tools[move]
    share = np.linspace(0.0, 1.0, count + 1)
    spread = pieces.begin[:, None] + share * (pieces.end - pieces.begin)[:, None]
    point = ArcShapes.of(start, end, centre, plane, sweep).at(rows[:, None], spread).reshape(-1, 3)
    play = None
    which = np.zeros(0, np.int64)
    if model.backlash_at(point[:1]) is not None or tool.ndim > 1:
        which = np.repeat(rows, len(share))
    if model.backlash_at(point[:1]) is not None:
        play = arc_directions(
            start[which], end[which], centre[which], plane[which], sweep[which], spread.reshape(-1)
        )  # fmt: skip
        play = _inside(play.reshape(len(pieces), len(share), 3)).reshape(-1, 3)
    command = bent(model, point, tool if tool.ndim == 1 else tool[which], play)
    shape = (len(pieces), len(share), 3)
    point, command = point.reshape(shape), command.reshape(shape)
    away = command - point
    r0, r1 = (np.hypot(*arms(point[:, k], centre, plane)) for k in (0, -1))
    # most pieces are not, as their ends show
    rigid = most_in_row(np.abs(away[:, -1] - away[:, 0])) < _ALIKE_MM
    some = np.flatnonzero(rigid)
    rigid[some] = np.abs(away[some] - away[some, :1]).max(axis=(1, 2)) < _ALIKE_MM
    return Bend(point, command, share, centre, r1 - r0, rigid)


def _inside(play: Array) -> Array:
    """Directions (n, s, 3) of pieces between turns: at its ends a piece takes those of its inside."""
    play[:, 0], play[:, -1] = play[:, 1], play[:, -2]
    return play


def fit_pieces(
    path: Toolpath, model: ErrorModel, target: Array, pieces: Pieces, tools: Array, count: int,
    one_radius: bool = False,
) -> Array:  # fmt: skip
    """(n,) how far the best arc leaves the bent path of each piece, in mm, sampled at `count` steps."""
    bend = sampled(path, model, target, pieces, tools, count)
    sweep = path.arcs.sweep_rad[pieces.arc] * (pieces.end - pieces.begin)
    plane = path.arcs.plane[pieces.arc]
    ends = bend.command[:, 0], bend.command[:, -1]
    away = departure(bend, plane, *ends, sweep, fit(bend, plane, *ends, sweep, one_radius))
    away[bend.rigid] = 0.0
    return away


def fit(
    bend: Bend, plane: npt.NDArray[np.int8], start: Array, end: Array, sweep: Array, one_radius: bool = False
) -> Array:
    """Centres (n, 3) of the arcs from `start` to `end` that leave the samples least.

    Least squares on the radial distance; the radius goes linearly from one end to the other. The nominal
    difference of the radii (mostly 0) has a large weight. The weight is small for more than half a circle,
    where a short chord would swing the far side, unless the arc has `one_radius`.
    """
    command, share = bend.command, bend.share
    (q0, q1), (s0, s1), (e0, e1) = (_columns(some, plane)[:2] for some in (command, start, end))
    centre = bend.centre + (command[:, 0] - bend.point[:, 0] + command[:, -1] - bend.point[:, -1]) / 2
    x, y = _columns(centre, plane)[:2]
    x_start, y_start = x, y
    strong = np.where((np.abs(sweep) > WIDE) & (not one_radius), 1.0, 100.0)[:, None]
    mismatch = bend.mismatch[:, None]
    soft = _STIFFNESS * _STIFFNESS
    for _ in range(4):
        rs, re = np.hypot(s0 - x, s1 - y), np.hypot(e0 - x, e1 - y)
        us0, us1, ue0, ue1 = (s0 - x) / rs, (s1 - y) / rs, (e0 - x) / re, (e1 - y) / re
        j0, j1 = q0 - x, q1 - y
        f = _length(j0, j1)
        j0 /= f
        j1 /= f
        f -= rs + (re - rs) * share
        j0 -= us0 + (ue0 - us0) * share
        j1 -= us1 + (ue1 - us1) * share
        g = strong * (re - rs - mismatch)
        k0, k1 = strong * (us0 - ue0), strong * (us1 - ue1)
        n00 = _dot(j0, j0) + k0 * k0 + soft
        n11 = _dot(j1, j1) + k1 * k1 + soft
        n01 = _dot(j0, j1) + k0 * k1
        b0 = _dot(j0, f) - k0 * g - soft * (x - x_start)
        b1 = _dot(j1, f) - k1 * g - soft * (y - y_start)
        det = n00 * n11 - n01 * n01
        step0, step1 = (b0 * n11 - b1 * n01) / det, (b1 * n00 - b0 * n01) / det
        x = x + step0
        y = y + step1
        if max(np.abs(step0).max(initial=0.0), np.abs(step1).max(initial=0.0)) < _STILL_MM:
            break
    x, y = np.where(bend.rigid[:, None], x_start, x), np.where(bend.rigid[:, None], y_start, y)
    put_in_planes(centre, plane, x[:, 0], y[:, 0])
    return centre


def departure(
    bend: Bend, plane: npt.NDArray[np.int8], start: Array, end: Array, sweep: Array, centre: Array
) -> Array:
    """(n,) how far the arcs from `start` to `end` about `centre` (n, 3) leave the samples."""
    share = bend.share
    (q0, q1, q2), (s0, s1, s2), (e0, e1, e2) = (_columns(some, plane) for some in (bend.command, start, end))
    x, y, _ = _columns(centre, plane)
    rs, re = np.hypot(s0 - x, s1 - y), np.hypot(e0 - x, e1 - y)
    # the control counts the angle about the new centre, and reaches the end with its own sweep
    begin = np.arctan2(s1 - y, s0 - x)
    turn = _near(np.arctan2(e1 - y, e0 - x) - begin, sweep[:, None])
    # ends that rounding made one point
    turn = np.where(turn == 0.0, sweep[:, None], turn)
    reached = _near(np.arctan2(q1 - y, q0 - x) - begin, share * turn) / turn
    radial = _length(q0 - x, q1 - y) - (rs + (re - rs) * reached)
    level = (q2 - (s2 + (e2 - s2) * reached)) * rs / np.hypot(rs, (e2 - s2) / turn)
    return np.asarray(most_in_row(_length(radial, level)))


def _columns(point: Array, plane: Plane) -> list[Array]:
    """Coordinates along the axes of their planes: (n, s) of points (n, s, 3), (n, 1) of points (n, 3)."""
    columns = in_planes(point if point.ndim == 3 else point[:, None], plane)
    return [np.ascontiguousarray(column) for column in columns]


def _length(first: Array, second: Array) -> Array:
    """Lengths of vectors of moderate size: a third of the time of `np.hypot`."""
    return np.asarray(np.sqrt(first * first + second * second))


def _dot(first: Array, second: Array) -> Array:
    """(n, 1) sums of products along rows (n, s)."""
    return np.asarray(np.einsum("ij,ij->i", first, second)[:, None])


def _near(angle: Array, guess: Array) -> Array:
    """Angles with as many whole turns added as bring them near a guess."""
    return np.asarray(angle + 2 * np.pi * np.rint((guess - angle) / (2 * np.pi)), float)


def _at_quadrants(path: Toolpath, pieces: Pieces, turning: Mask, band: float) -> Pieces:
    """Cut arcs where an axis with backlash turns round, unless it goes on by less than the band."""
    arcs = path.arcs
    axes = _AXES[arcs.plane[pieces.arc]]
    start = _starts(path, arcs.move[pieces.arc])
    along, across = arms(start, arcs.centre_mm[pieces.arc], arcs.plane[pieces.arc])
    angle, radius = np.arctan2(across, along), np.hypot(along, across)
    sweep = arcs.sweep_rad[pieces.arc]
    owners, shares = [np.arange(len(pieces))], [np.zeros(len(pieces))]
    least = np.minimum(np.sqrt(2 * band / radius) / np.abs(sweep), 0.25)
    low, high = np.minimum(angle, angle + sweep), np.maximum(angle, angle + sweep)
    # the first axis turns at multiples of pi, the second half-way between
    for which, phase in ((0, 0.0), (1, np.pi / 2)):
        first, last = np.ceil((low - phase) / np.pi), np.floor((high - phase) / np.pi)
        count = np.where(turning[axes[:, which]], np.maximum(last - first + 1, 0), 0).astype(np.int64)
        owner = np.repeat(np.arange(len(pieces)), count)
        k = first[owner] + np.arange(len(owner)) - (np.cumsum(count) - count)[owner]
        share = (phase + k * np.pi - angle[owner]) / sweep[owner]
        inner = (least[owner] < share) & (share < 1 - least[owner])
        owners.append(owner[inner])
        shares.append(share[inner])
    owner, begin = np.concatenate(owners), np.concatenate(shares)
    order = np.lexsort((begin, owner))
    owner, begin = owner[order], begin[order]
    goes_on = np.append(owner[1:] == owner[:-1], False)
    return Pieces(pieces.arc[owner], begin, np.where(goes_on, np.append(begin[1:], 1.0), 1.0))
