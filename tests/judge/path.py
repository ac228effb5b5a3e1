"""Compares the path a machine really takes with the nominal one, matched in order.

The corrected moves are grouped to the nominal moves: every nominal end point is reached, in sequence, by
the end of some corrected move. Dynamic programming over the two sequences never confuses path passes that
overlap in space. Each dense point of a group is then measured to its own nominal line or arc.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from . import linuxcnc
from .linuxcnc import ARC, DWELL, FRAMES, KINDS, CanonMoves
from .model import JudgeModel

PLANE_AXES = np.array([(0, 1, 2), (1, 2, 0), (2, 0, 1)])  # first, second, normal of XY, YZ, ZX
CIRCLE_FUZZ = 1e-6  # rad: a smaller sweep is a full circle, as in the control
SHARED = 0.5**2  # mm2: price of a nominal end point without a corrected one of its own
SLACK = 12  # nominal end points may share corrected moves (a zero-length move that vanished)


@dataclass(frozen=True, slots=True)
class _Curves:
    """Moves as curves over a fraction in [0, 1]; `arc`: row in the arc columns, -1 for lines."""

    begin: np.ndarray
    end: np.ndarray
    arc: np.ndarray
    axes: np.ndarray
    centre: np.ndarray
    radius: np.ndarray
    angle: np.ndarray
    sweep: np.ndarray

    @classmethod
    def of(cls, moves: CanonMoves) -> _Curves:
        begin, end = moves.begin, moves.axis
        rows = np.flatnonzero(moves.kind == ARC)
        arc = np.full(len(moves), -1)
        arc[rows] = np.arange(len(rows))
        axes = PLANE_AXES[moves.plane[rows]]
        r = rows[:, None]
        centre = moves.centre[r, axes[:, :2]]
        first, last = begin[r, axes[:, :2]] - centre, end[r, axes[:, :2]] - centre
        start, stop = np.arctan2(first[:, 1], first[:, 0]), np.arctan2(last[:, 1], last[:, 0])
        turns = moves.turns[rows]
        direction = np.where(turns > 0, 1.0, -1.0)
        sweep = np.mod(direction * (stop - start), 2 * np.pi)
        sweep[sweep < CIRCLE_FUZZ] += 2 * np.pi
        sweep = direction * (sweep + 2 * np.pi * (np.abs(turns) - 1))
        radius = np.stack([np.hypot(*first.T), np.hypot(*last.T)], axis=1)
        return cls(begin, end, arc, axes, centre, radius, start, sweep)

    def lengths(self) -> np.ndarray:
        lengths = np.linalg.norm(self.end - self.begin, axis=1)
        rows = np.flatnonzero(self.arc >= 0)
        rise = (self.end - self.begin)[rows, self.axes[:, 2]]
        lengths[rows] = np.hypot(np.abs(self.sweep) * self.radius.mean(axis=1), rise)
        return np.asarray(lengths)

    def at(self, move: np.ndarray, fraction: np.ndarray) -> np.ndarray:
        """(m, 3) points of moves at fractions; unequal radii make a spiral, as the control runs it."""
        t = fraction[:, None]
        points = (1.0 - t) * self.begin[move] + t * self.end[move]
        on_arc = np.flatnonzero(self.arc[move] >= 0)
        a, s = self.arc[move[on_arc]], fraction[on_arc]
        radius = self.radius[a, 0] + s * (self.radius[a, 1] - self.radius[a, 0])
        angle = self.angle[a] + s * self.sweep[a]
        points[on_arc, self.axes[a, 0]] = self.centre[a, 0] + radius * np.cos(angle)
        points[on_arc, self.axes[a, 1]] = self.centre[a, 1] + radius * np.sin(angle)
        return np.asarray(points)

    def nearest(self, move: np.ndarray, points: np.ndarray) -> np.ndarray:
        """(m,) fraction of the own move nearest to each point."""
        along = self.end[move] - self.begin[move]
        square = np.einsum("ij,ij->i", along, along)
        dot = np.einsum("ij,ij->i", points - self.begin[move], along)
        share = np.clip(np.divide(dot, square, out=np.ones(len(move)), where=square > 0), 0.0, 1.0)
        rows = np.flatnonzero(self.arc[move] >= 0)
        if len(rows):
            share[rows] = self._nearest_on_arc(move[rows], points[rows])
        return np.asarray(share)

    def _nearest_on_arc(self, move: np.ndarray, points: np.ndarray) -> np.ndarray:
        a = self.arc[move]
        offset = points[np.arange(len(a))[:, None], self.axes[a, :2]] - self.centre[a]
        turned = np.sign(self.sweep[a]) * (np.arctan2(offset[:, 1], offset[:, 0]) - self.angle[a])
        size = np.abs(self.sweep[a])
        candidates = [np.zeros(len(a)), np.ones(len(a))]
        for turn in range(int(np.ceil(size.max() / (2 * np.pi)))):
            candidates.append(np.clip((np.mod(turned, 2 * np.pi) + 2 * np.pi * turn) / size, 0.0, 1.0))
        best, least = candidates[0], np.full(len(a), np.inf)
        for candidate in candidates:
            distance = np.linalg.norm(self.at(move, candidate) - points, axis=1)
            best, least = np.where(distance < least, candidate, best), np.minimum(distance, least)
        for _ in range(3):  # Gauss-Newton on the fraction: a helix or spiral is not nearest at equal angle
            step = 1e-6
            here = self.at(move, best)
            slope = (self.at(move, best + step) - here) / step
            square = np.maximum(np.einsum("ij,ij->i", slope, slope), 1e-30)
            best = np.clip(best + np.einsum("ij,ij->i", points - here, slope) / square, 0.0, 1.0)
        return best


@dataclass(frozen=True, slots=True)
class DensePath:
    """Commanded axis positions along moves: `move` is the row in `moves`, `last` marks ends of moves."""

    moves: CanonMoves
    points: np.ndarray
    move: np.ndarray
    last: np.ndarray


def densify(moves: CanonMoves, spacing_mm: float = 1.0, least: int = 4) -> DensePath:
    """Points along every move, ends included, at most `spacing_mm` apart and at least `least` a move."""
    moves = moves.pick(moves.kind != DWELL)
    curves = _Curves.of(moves)
    lengths = curves.lengths()
    count = np.where(lengths > 0, np.maximum(np.ceil(lengths / spacing_mm), least), 1).astype(int)
    count = np.where(curves.arc >= 0, np.maximum(count, 3 * least), count)
    move = np.repeat(np.arange(len(moves)), count)
    ends = np.cumsum(count)
    step = np.arange(len(move)) - np.repeat(ends - count, count) + 1
    points = curves.at(move, step / count[move])
    last = np.zeros(len(move), bool)
    last[ends - 1] = True
    points[last] = moves.axis
    return DensePath(moves, points, move, last)


@dataclass(frozen=True, slots=True)
class ActualPath:
    """Tip path of the machine under commanded moves, as axis positions that an exact machine would have."""

    dense: DensePath
    points: np.ndarray
    determined: np.ndarray  # (m,) position and backlash are determined
    inside: np.ndarray  # (m,) command in the calibrated box


def actual(moves: CanonMoves, model: JudgeModel, spacing_mm: float = 1.0, *, least: int = 4) -> ActualPath:
    """The path the machine really takes: error with the tool vector of the tool in the spindle and play."""
    dense = densify(moves, spacing_mm, least)
    known = dense.moves.known
    before = np.vstack([np.full((1, 3), moves.start_known), known[:-1]])
    settled = (known & before)[dense.move] | (known[dense.move] & dense.last[:, None])
    play, taken_up = np.zeros(dense.points.shape), np.ones(dense.points.shape, bool)
    for axis in np.flatnonzero(model.has_play):
        rows = np.flatnonzero(settled[:, axis])
        column = np.zeros((len(rows), 3))
        column[:, axis] = dense.points[rows, axis]
        taken_up[:, axis] = False
        if len(rows):
            states, determined = model.play(column)
            play[rows, axis], taken_up[rows, axis] = states[:, axis], determined[:, axis]
    points = dense.points + model.error_mm(dense.points, tool_vectors(dense.moves, model)[dense.move], play)
    determined = settled.all(axis=1) & taken_up.all(axis=1)
    return ActualPath(dense, points, determined, model.inside(dense.points))


def tool_vectors(moves: CanonMoves, model: JudgeModel) -> np.ndarray:
    """(n, 3) tool vector of each move."""
    vectors = np.zeros((len(moves), 3))
    for tool in np.unique(moves.tool):
        vectors[moves.tool == tool] = model.tool_vector_mm(int(tool)) if tool > 0 else 0.0
    return vectors


def shifts(moves: CanonMoves, model: JudgeModel, by_frame: Mapping[str, Any] | None = None) -> np.ndarray:
    """(n, 3) target - nominal of each move from zero setting; `by_frame` overrides the machine file's."""
    shifts = np.zeros((len(moves), 3))
    for frame in np.unique(moves.frame):
        name = FRAMES[frame]
        shift = by_frame[name] if by_frame is not None and name in by_frame else model.zero_shift(name)
        shifts[moves.frame == frame] = shift
    for tool in np.unique(moves.tool):
        active = (moves.tool == tool) & (moves.length != 0).any(axis=1)
        for frame in np.unique(moves.frame[active]):
            if tool > 0:
                shifts[active & (moves.frame == frame)] += model.tool_shift(int(tool), FRAMES[frame])
    return shifts


def match(ends: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """(n,) for each nominal vertex the row of the corrected end that reaches it, never going back.

    Minimises the sum of squared distances plus SHARED for every vertex that has no end of its own; the last
    vertex belongs to the last end.
    """
    m, n = len(ends), len(vertices)
    before = SLACK + max(n - m, 0)
    width = before + max(m - n, 0) + SLACK + 1
    padded = np.full((before + m + n + width, 3), np.inf)
    padded[before : before + m] = ends
    x, y, z = np.ascontiguousarray(padded.T)
    total, earlier = np.zeros(width), np.zeros(width)
    fresh, shared = np.zeros((2, n, (width + 7) // 8), np.uint8)
    for i, (vx, vy, vz) in enumerate(vertices.tolist()):
        band = slice(i, i + width)  # column k of row i stands for the end j = i - before + k
        here = (x[band] - vx) ** 2 + (y[band] - vy) ** 2 + (z[band] - vz) ** 2
        if i:
            share = np.append(total[1:] + SHARED, np.inf)  # the same end j is one column to the right above
            shared[i] = np.packbits(share < earlier, bitorder="little")
            here += np.minimum(share, earlier)
        total, earlier = here, np.minimum.accumulate(here)
        new = np.ones(width, bool)
        new[1:] = total[1:] < earlier[:-1]
        fresh[i] = np.packbits(new, bitorder="little")
    matches = np.zeros(n, int)
    column = m - n + before
    for i in range(n - 1, -1, -1):
        matches[i] = i - before + column
        if i and shared[i, column >> 3] >> (column & 7) & 1:
            column += 1
        elif i:
            bits = np.unpackbits(fresh[i - 1], bitorder="little", count=width)
            column = int(np.flatnonzero(bits[: column + 1])[-1])
    return matches


@dataclass(frozen=True, slots=True)
class PathError:
    """How far an actual path is from the nominal target path, in um."""

    max_um: float
    rms_um: float
    vertex_max_um: float
    vertex_rms_um: float
    backtrack_um: float  # largest step back along the own nominal move
    worst_line: int  # nominal source line
    worst_own_line: int  # line of the program that was judged
    worst_point_mm: tuple[float, float, float]
    by_move_um: np.ndarray = field(repr=False)  # (n,) largest per nominal move, nan where not judged
    judged: int
    left_out: int  # points with an unknown position, unknown play, or on a skipped line
    outside: int  # judged points with a command outside the calibrated box, where the box face counts


@dataclass(frozen=True, slots=True)
class Deviation:
    """Corrected against nominal target (`after`), and the uncorrected program against it (`before`)."""

    after: PathError
    before: PathError
    lines: np.ndarray = field(repr=False)  # (n,) source line of each nominal move
    groups: np.ndarray = field(repr=False)  # (n,) row of the corrected move that ends each nominal move

    @property
    def max_um(self) -> float:
        return self.after.max_um

    @property
    def rms_um(self) -> float:
        return self.after.rms_um

    @property
    def vertex_max_um(self) -> float:
        return self.after.vertex_max_um

    @property
    def worst_line(self) -> int:
        return self.after.worst_line


def deviation(
    corrected: CanonMoves,
    nominal: CanonMoves,
    model: JudgeModel,
    *,
    spacing_mm: float = 1.0,
    skip_lines: Collection[int] = (),
    kinds: Collection[str] = KINDS,
    forget_at_tool_change: bool = False,
    shift_by_frame: Mapping[str, Any] | None = None,
    smooth_rad: float = 0.0,
) -> Deviation:
    """Distance of the actual path to nominal path + zero shift, after and before correction.

    `skip_lines` are nominal lines that are left uncorrected on purpose (G53, G28, unknown axes). Points with
    unknown axes or play are left out and counted. `forget_at_tool_change`: an axis is unknown after a tool
    change until it moves again. Where two nominal cuts meet with a turn of at most `smooth_rad`, a point of
    one may lie on the other.
    """
    moves = nominal.pick(nominal.kind != DWELL)
    own = corrected.pick(corrected.kind != DWELL)
    if not len(moves) or not len(own):
        raise ValueError("a program without moves")
    if forget_at_tool_change:
        moves, own = _forget(moves), _forget(own)
    shift = shifts(moves, model, shift_by_frame)
    uncorrected = np.isin(moves.line, list(skip_lines))
    real = actual(own, model, spacing_mm)
    groups = match(real.points[real.dense.last], moves.axis + shift)
    after = _measure(real, groups, moves, shift, uncorrected, kinds, smooth_rad)
    if not after.judged:
        raise ValueError("no point could be judged: nowhere are all axes known on a line that counts")
    raw = actual(moves, model, spacing_mm)
    before = _measure(raw, np.arange(len(moves)), moves, shift, uncorrected, kinds, smooth_rad)
    return Deviation(after, before, moves.line, groups)


def _forget(moves: CanonMoves) -> CanonMoves:
    known = moves.known.copy()
    for change in np.flatnonzero(np.diff(moves.tool)) + 1:
        moved = np.logical_or.accumulate(np.abs(moves.axis[change:] - moves.axis[change - 1]) > 1e-9, axis=0)
        known[change:] &= moved
        known[change - 1] = False
    return replace(moves, known=known)


def _measure(
    real: ActualPath,
    groups: np.ndarray,
    moves: CanonMoves,
    shift: np.ndarray,
    uncorrected: np.ndarray,
    kinds: Collection[str],
    smooth_rad: float = 0.0,
) -> PathError:
    dense = real.dense
    skip = uncorrected | ~np.isin(moves.kind, [KINDS.index(kind) for kind in kinds])
    owner_of_move = np.searchsorted(groups, np.arange(len(dense.moves)))
    owner = np.minimum(owner_of_move, len(moves) - 1)[dense.move]
    curves = _Curves.of(moves)
    points = real.points - shift[owner]
    fraction = curves.nearest(owner, points)
    distance = 1e3 * np.linalg.norm(points - curves.at(owner, fraction), axis=1)
    if smooth_rad:
        for other, joined in _neighbours(curves, moves, owner, smooth_rad):
            rows = np.flatnonzero(joined)
            near = curves.at(other[rows], curves.nearest(other[rows], points[rows]))
            distance[rows] = np.minimum(distance[rows], 1e3 * np.linalg.norm(points[rows] - near, axis=1))
    end_known = np.asarray(moves.known.all(axis=1), bool)
    whole = end_known & np.concatenate([[moves.start_known], end_known[:-1]])
    # a path from another zero, another tool or an uncorrected position has no nominal path
    whole[1:] &= (np.diff(shift, axis=0) == 0).all(axis=1) & (np.diff(moves.tool) == 0) & ~uncorrected[:-1]
    at_end = dense.last & (dense.move == groups[owner])
    use = real.determined & ~skip[owner] & (whole[owner] | (end_known[owner] & at_end))
    by_move = np.full(len(moves), np.nan)
    np.fmax.at(by_move, owner[use], distance[use])
    ends = real.points[dense.last][groups]
    determined_end = real.determined[dense.last][groups] & end_known & ~skip
    vertex = 1e3 * np.linalg.norm(ends - moves.axis - shift, axis=1)[determined_end]
    along = (fraction * curves.lengths()[owner])[use]
    block = 1e6 * owner[use]
    back = np.maximum.accumulate(along + block) - along - block if use.any() else np.zeros(1)
    kept = np.flatnonzero(use)
    worst = kept[np.argmax(distance[kept])] if len(kept) else 0
    x, y, z = dense.points[worst].tolist()
    return PathError(
        float(distance[kept].max(initial=0.0)),
        float(np.sqrt(np.mean(distance[kept] ** 2))) if len(kept) else 0.0,
        float(vertex.max(initial=0.0)),
        float(np.sqrt(np.mean(vertex**2))) if len(vertex) else 0.0,
        float(1e3 * back.max()),
        int(moves.line[owner[worst]]),
        int(dense.moves.line[dense.move[worst]]),
        (x, y, z),
        by_move,
        len(kept),
        int(len(use) - len(kept)),
        int((~real.inside[kept]).sum()),
    )


def _neighbours(
    curves: _Curves, moves: CanonMoves, owner: np.ndarray, smooth_rad: float
) -> list[tuple[np.ndarray, np.ndarray]]:
    """The cut behind and the one before each owner, and whether the path goes over to it without a corner."""
    every = np.arange(len(moves))
    step = 1e-6
    first = curves.at(every, np.full(len(moves), step)) - curves.begin
    last = curves.end - curves.at(every, np.full(len(moves), 1 - step))
    with np.errstate(invalid="ignore"):
        first, last = (way / np.linalg.norm(way, axis=1)[:, None] for way in (first, last))
    cut = np.isin(moves.kind, [KINDS.index(kind) for kind in ("feed", "arc")])
    smooth = np.einsum("ij,ij->i", last[:-1], first[1:]) > np.cos(smooth_rad)
    smooth &= cut[:-1] & cut[1:]
    behind, before = np.append(smooth, False), np.append(False, smooth)
    return [
        (np.minimum(owner + 1, len(moves) - 1), behind[owner]),
        (np.maximum(owner - 1, 0), before[owner]),
    ]


def judge_programs(
    nominal: bytes,
    corrected: bytes,
    machine: str | Path,
    *,
    interpreter: Mapping[str, Any] | None = None,
    **how: Any,
) -> Deviation:
    """Both programs through LinuxCNC and the judge's model of one machine folder."""
    setup = dict(interpreter or {})
    return deviation(
        linuxcnc.interpret(corrected, machine, **setup),
        linuxcnc.interpret(nominal, machine, **setup),
        JudgeModel(machine),
        **how,
    )


def away(moves: CanonMoves, points: np.ndarray) -> np.ndarray:
    """(n,) distance in mm of points (n, 3) from the nearest move that cuts."""
    curves, least = _Curves.of(moves), np.full(len(points), np.inf)
    for move in np.flatnonzero((moves.kind == linuxcnc.FEED) | (moves.kind == ARC)):
        rows = np.full(len(points), move)
        there = curves.at(rows, curves.nearest(rows, points))
        least = np.minimum(least, np.linalg.norm(there - points, axis=1))
    return least
