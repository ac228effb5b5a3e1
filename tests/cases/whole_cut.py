"""A judge of the whole cut: every feed from where the tool really is, and the feed strokes of holes.

Stricter than `acceptance.judged`, and of `judge` alone, too. Feeds after moves that were left uncorrected
count. Where the side of the backlash is not known yet, two figures are given: of what is certain, and of the
worst that is possible.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from cases.acceptance import APART_MM, apart, matched
from judge import linuxcnc
from judge.linuxcnc import ARC, DWELL, FEED, RAPID, CanonMoves
from judge.model import JudgeModel
from judge.path import DensePath, _Curves, densify, shifts, tool_vectors

#: what the judge's arcs may be off
ARCS_UM = 0.27
#: Without an unknown play the stated maximum is at most this factor above the judge's, and this much.
FACTOR = 1.5
MORE_UM = 0.5
#: the axis along which a hole is drilled, by plane
_DRILLED = (2, 0, 1)
_CODE = re.compile(r"G([0-9.]+)")
_REMARK = re.compile(r"\([^)\n]*\)|;[^\n]*")
_CYCLES = (73.0, 74.0, *(float(code) for code in range(81, 90)))


@dataclass(frozen=True, slots=True)
class Marks:
    """Lines of a program: `cycles` drill a hole each, `left` are uncorrected on purpose, of them `homes` with
    G28 or G30; `changes` put a tool into
    the spindle."""

    cycles: frozenset[int]
    left: frozenset[int]
    homes: frozenset[int]
    changes: frozenset[int]


def marks(text: bytes) -> Marks:
    """Read line by line: modal motion, G53, G28 and G30, and sections that are switched off."""
    cycles, left, homes, changes = set(), set(), set(), set()
    cycle = off = False
    for number, raw in enumerate(text.decode("ascii").splitlines(), 1):
        lowered = raw.lower()
        if "olp off" in lowered or "olp on" in lowered:
            off = "olp off" in lowered
        block = re.sub(r"\s", "", _REMARK.sub("", raw)).upper()
        codes = [float(code) for code in _CODE.findall(block)]
        if any(code in _CYCLES for code in codes):
            cycle = True
        elif any(code in (0.0, 1.0, 2.0, 3.0, 80.0) for code in codes):
            cycle = False
        if off or any(code in (28.0, 30.0, 53.0) for code in codes):
            left.add(number)
        if re.search(r"M0?6(?![0-9])", block):
            changes.add(number)
        if 28.0 in codes or 30.0 in codes:
            homes.add(number)
        if cycle and re.search("[XYZ]", block):
            cycles.add(number)
    return Marks(frozenset(cycles), frozenset(left), frozenset(homes), frozenset(changes))


@dataclass(frozen=True, slots=True)
class Whole:
    """Figures in um. `certain_um` is the largest where the state of the machine is known, `possible_um` the
    largest with every side of the backlash that is possible. By nominal line, the same. `open` counts points
    of cuts with an unknown play, `left_out` those with an unknown position, `loose` cuts that start where an
    uncorrected move ended. Of what was judged, `lines`, `arcs` and `holes` count nominal ones, and `inserted`
    the moves of the corrected program that end within a nominal cut. Without `matched`, lines of holes are
    split, and their strokes count as cuts."""

    certain_um: float
    possible_um: float
    by_line: dict[int, float]
    possible_by_line: dict[int, float]
    judged: int
    open: int
    left_out: int
    loose: int
    lines: int
    arcs: int
    holes: int
    inserted: int
    #: nominal line that ends with each line of the corrected program
    owners: dict[int, int]
    matched: bool

    @property
    def worst_line(self) -> int:
        return max(self.possible_by_line, key=lambda line: self.possible_by_line[line], default=0)


def judge_whole(
    nominal: bytes,
    corrected: bytes,
    folder: Path,
    *,
    start_mm: tuple[float, float, float] | None = None,
    spacing_mm: float = 0.5,
) -> Whole:
    """Both programs through LinuxCNC and the judge's model; `start_mm` where the start is known."""
    model = JudgeModel(folder)
    how = {} if start_mm is None else {"start_mm": start_mm, "find_known": False}
    said, written = marks(nominal), marks(corrected)
    moves, own = (
        _forget_homes(_forget_changes(m.pick(m.kind != DWELL), mark.changes), mark.homes)
        for m, mark in (
            (linuxcnc.interpret(text, folder, **how), mark)
            for text, mark in ((nominal, said), (corrected, written))
        )
    )
    real = _Tips.of(own, model, spacing_mm, written.changes)
    shift = shifts(moves, model)
    holes, other = _runs(moves, said.cycles), _runs(own, written.cycles)
    split = len(holes) != len(other)
    if split:
        holes, other = [], []
    result = _Sum(moves)
    owner = np.full(len(own), -1)
    ends = real.middle[real.dense.last]
    for (a, b), (c, d) in zip(_between(holes, len(moves)), _between(other, len(own)), strict=True):
        if a == b or c == d:
            continue
        mine = replace(moves.pick(np.arange(a, b)), start=moves.begin[a])
        theirs = replace(own.pick(np.arange(c, d)), start=own.begin[c])
        vertices = moves.axis[a:b] + shift[a:b] + _apart(mine, said)
        groups = matched(ends[c:d] + _apart(theirs, written), theirs, vertices, mine)
        owner[c:d] = np.minimum(a + np.searchsorted(groups, np.arange(d - c)), b - 1)
        at_end = np.zeros(len(own), bool)
        at_end[c + groups] = True
        _cuts(result, real, moves, shift, owner, at_end, said, (c, d))
    for (a, b), (c, d) in zip(holes, other, strict=True):
        owner[c:d] = b - 1
        if moves.line[a] not in said.left:
            _hole(result, real, moves, shift, (a, b), (c, d))
    left = np.isin(moves.line, list(said.left))
    feeds = np.isin(moves.kind, (FEED, ARC))
    before = np.concatenate([[False], left[:-1]])
    known = owner >= 0
    owners = dict(zip(own.line[known].tolist(), moves.line[owner[known]].tolist(), strict=True))
    return result.done(int((feeds & before & ~left).sum()), owners, matched=not split)


def compare(stated_um: float, whole: Whole) -> None:
    """The stated maximum is not below the judge's, and not far above."""
    not_below(stated_um, whole)
    above = FACTOR * whole.possible_um + MORE_UM
    if not whole.left_out and not whole.open:
        assert stated_um <= above, f"stated {stated_um:.2f}, is {whole.possible_um:.2f} um"


def not_below(stated_um: float, whole: Whole) -> None:
    """The stated maximum is not below the judge's."""
    assert stated_um >= whole.possible_um - ARCS_UM, (
        f"stated {stated_um:.2f}, is {whole.possible_um:.2f} um (certain: {whole.certain_um:.2f}), "
        f"line {whole.worst_line}"
    )
    assert whole.possible_um or not stated_um or whole.left_out, f"stated {stated_um:.2f}, but no cut is off"


def _first_after(moves: CanonMoves, lines: frozenset[int]) -> list[int]:
    """The first move after each of these tool changes, or in its block; the programs have no loops."""
    first = np.searchsorted(moves.line, sorted(lines), side="left")
    return sorted({k for k in first.tolist() if k < len(moves)})


def _forget_changes(moves: CanonMoves, changes: frozenset[int]) -> CanonMoves:
    """All axes are unknown after a tool change until the program moves them, even where the tool stays."""
    known = moves.known.copy()
    for change in _first_after(moves, changes):
        away = np.abs(moves.axis[change:] - moves.begin[change]) > 1e-9
        known[change:] &= np.logical_or.accumulate(away, axis=0)
    return replace(moves, known=known)


def _known_before(moves: CanonMoves, changes: frozenset[int]) -> np.ndarray:
    """(n, 3) axes known where each move begins: as the move before ended, but none after a tool change."""
    before = np.vstack([np.full((1, 3), moves.start_known), moves.known])[: len(moves)]
    before[_first_after(moves, changes)] = False
    return np.asarray(before)


def _forget_homes(moves: CanonMoves, homes: frozenset[int]) -> CanonMoves:
    """The axes that a reference point moves are unknown until the program commands them again."""
    known = moves.known.copy()
    at_home = np.isin(moves.line, list(homes))
    for last in np.flatnonzero(at_home & ~np.append(at_home[1:], False)).tolist():
        first = last
        while first > 0 and at_home[first - 1]:
            first -= 1
        before = moves.axis[first - 1] if first else moves.start
        driven = (np.abs(moves.axis[first : last + 1] - before) > 1e-9).any(axis=0)
        again = np.abs(moves.axis[last + 1 :] - moves.axis[last]) > 1e-9
        known[last, driven] = False
        known[last + 1 :, driven] &= np.logical_or.accumulate(again, axis=0)[:, driven]
    return replace(moves, known=known)


@dataclass(frozen=True, slots=True)
class _Tips:
    """Where the tip is along a dense path: at `middle` of what is possible, and, of the rows where a play is
    not known, (rows, corners, 3) at its limits."""

    dense: DensePath
    middle: np.ndarray
    settled: np.ndarray
    rows: np.ndarray
    corners: np.ndarray

    @classmethod
    def of(cls, moves: CanonMoves, model: JudgeModel, spacing_mm: float, changes: frozenset[int]) -> _Tips:
        dense = densify(moves, spacing_mm)
        known = dense.moves.known
        before = _known_before(dense.moves, changes)
        settled = (known & before)[dense.move] | (known[dense.move] & dense.last[:, None])
        after = np.isin(dense.move, _first_after(moves, changes))
        first = after & np.concatenate([[True], np.diff(dense.move) != 0])
        low, high = np.zeros(dense.points.shape), np.zeros(dense.points.shape)
        for axis in np.flatnonzero(model.has_play).tolist():
            start = moves.start[axis] if moves.start_known else None
            low[:, axis], high[:, axis] = _sides(
                model, axis, dense.points[:, axis], settled[:, axis], first, start
            )
        tool = tool_vectors(dense.moves, model)[dense.move]
        middle = dense.points + model.error_mm(dense.points, tool, (low + high) / 2)
        rows = np.flatnonzero(((high - low) > 1e-9).any(axis=1))
        corners = np.stack([
            dense.points[rows]
            + model.error_mm(dense.points[rows], tool[rows], np.where(pick, high[rows], low[rows]))
            for pick in itertools.product((False, True), repeat=3)
        ], axis=1)  # fmt: skip
        return cls(dense, middle, settled.all(axis=1), rows, corners)


def _sides(
    model: JudgeModel, axis: int, place: np.ndarray, settled: np.ndarray, changed: np.ndarray,
    start: float | None,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """The least and the greatest play of an axis at each of its positions."""
    half = 0.5 * model.backlash_at(axis, np.clip(place, *model.box[axis]))
    low, high = np.full(len(place), -1.0), np.full(len(place), 1.0)
    last, a, b = start, -np.inf, np.inf
    for i, (q, h, good, new) in enumerate(
        zip(place.tolist(), half.tolist(), settled.tolist(), changed.tolist(), strict=True)
    ):
        if new or not good:
            last, a, b = None, -np.inf, np.inf
        if not good:
            continue
        step = 0.0 if last is None else q - last
        last = q
        if h > 1e-12:
            # a and b: the error that the backlash leaves, in mm
            a, b = max(-h, min(h, a - step)), max(-h, min(h, b - step))
            low[i], high[i] = -b / h, -a / h
        elif step:
            a = b = 0.0
            low[i] = high[i] = np.sign(step)
        elif a == b and i:
            low[i], high[i] = low[i - 1], high[i - 1]
    return low, high


class _Sum:
    """Collects distances by nominal line."""

    def __init__(self, moves: CanonMoves) -> None:
        self.lines, self.kind = moves.line, moves.kind
        self.cuts: set[int] = set()
        self.holes = self.inserted = 0
        self.certain: dict[int, float] = {}
        self.possible: dict[int, float] = {}
        self.judged = self.open = self.left_out = 0

    def add(self, owner: np.ndarray, certain: np.ndarray, possible: np.ndarray) -> None:
        """(m,) nominal moves, distances in mm where certain (NaN elsewhere), and the largest possible."""
        self.judged += len(owner)
        for line in np.unique(self.lines[owner]).tolist():
            mine = self.lines[owner] == line
            known = certain[mine]
            known = known[np.isfinite(known)]
            if len(known):
                self.certain[line] = max(self.certain.get(line, 0.0), 1e3 * float(known.max()))
            self.possible[line] = max(self.possible.get(line, 0.0), 1e3 * float(possible[mine].max()))

    def done(self, loose: int, owners: dict[int, int], *, matched: bool) -> Whole:
        largest = (max(values.values(), default=0.0) for values in (self.certain, self.possible))
        arcs = sum(int(self.kind[cut]) == ARC for cut in self.cuts)
        return Whole(
            *largest, self.certain, self.possible, self.judged, self.open, self.left_out, loose,
            len(self.cuts) - arcs, arcs, self.holes, self.inserted, owners, matched,
        )  # fmt: skip


def _runs(moves: CanonMoves, lines: frozenset[int]) -> list[tuple[int, int]]:
    """Where the moves of each of these lines begin and end."""
    found = []
    a = 0
    for b in [*(np.flatnonzero(np.diff(moves.line)) + 1).tolist(), len(moves)]:
        if b > a and int(moves.line[a]) in lines:
            found.append((a, b))
        a = b
    return found


def _between(runs: list[tuple[int, int]], count: int) -> Iterator[tuple[int, int]]:
    a = 0
    for begin, end in runs:
        yield a, begin
        a = end
    yield a, count


def _apart(moves: CanonMoves, said: Marks) -> np.ndarray:
    """As `acceptance.apart`; what is left uncorrected, one block each, is away from the rest too."""
    left = np.isin(moves.line, list(said.left))
    return apart(moves) + np.outer(APART_MM * left, (0.0, 1.0, 0.0))


def _cuts(
    result: _Sum, real: _Tips, moves: CanonMoves, shift: np.ndarray, owner_of: np.ndarray,
    at_end: np.ndarray, said: Marks, span: tuple[int, int],
) -> None:  # fmt: skip
    """Distances of the feeds of moves `span` of the corrected program from their nominal lines and arcs."""
    dense = real.dense
    rows = np.flatnonzero((dense.move >= span[0]) & (dense.move < span[1]))
    owner = owner_of[dense.move[rows]]
    cutting = np.isin(moves.kind, (FEED, ARC))
    known = moves.known.all(axis=1)
    whole = known & _known_before(moves, said.changes).all(axis=1)
    # from another zero or another tool there is no nominal path, but an end
    whole[1:] &= (np.diff(shift, axis=0) == 0).all(axis=1) & (np.diff(moves.tool) == 0)
    counts = cutting[owner] & (dense.moves.kind[dense.move[rows]] != RAPID)
    end = dense.last[rows] & at_end[dense.move[rows]]
    begins = counts & whole[owner] & np.concatenate([[True], np.diff(dense.move[rows]) != 0]) & (rows > 0)
    has_nominal = whole[owner] | (known[owner] & end)
    result.left_out += int((counts & ~(has_nominal & real.settled[rows])).sum())
    pick = counts & has_nominal & real.settled[rows]
    result.inserted += int((pick & dense.last[rows] & ~end).sum())
    # a cut starts where the move before it ended
    rows = np.concatenate([rows[pick], rows[begins] - 1])
    owner = np.concatenate([owner[pick], owner[begins]])
    end = np.concatenate([end[pick], np.zeros(begins.sum(), bool)])
    keep = real.settled[rows]
    rows, owner, end = rows[keep], owner[keep], end[keep]
    if not len(rows):
        return
    result.cuts |= set(owner.tolist())
    curves = _Curves.of(moves)

    def away(tips: np.ndarray, own: np.ndarray, end: np.ndarray) -> np.ndarray:
        points = tips - shift[own]
        # the end of a cut has its own point on the path
        share = np.where(end, 1.0, curves.nearest(own, points))
        return np.asarray(np.linalg.norm(points - curves.at(own, share), axis=1))

    certain = away(real.middle[rows], owner, end)
    possible = certain.copy()
    index = np.searchsorted(real.rows, rows)
    doubtful = np.flatnonzero(np.isin(rows, real.rows))
    for corner in range(real.corners.shape[1]):
        here = away(real.corners[index[doubtful], corner], owner[doubtful], end[doubtful])
        possible[doubtful] = np.maximum(possible[doubtful], here)
    certain[doubtful] = np.nan
    result.open += len(doubtful)
    result.add(owner, certain, possible)


def _hole(
    result: _Sum, real: _Tips, moves: CanonMoves, shift: np.ndarray, mine: tuple[int, int],
    theirs: tuple[int, int],
) -> None:  # fmt: skip
    """Distances of the feed strokes of a hole from its axis, and of the deepest from the bottom."""
    dense = real.dense
    strokes = np.arange(*mine)[moves.kind[mine[0] : mine[1]] == FEED]
    if not len(strokes):
        return
    drill = _DRILLED[int(moves.plane[mine[0]])]
    level = np.concatenate([moves.axis[strokes, drill], moves.begin[strokes, drill]])
    deepest = int(strokes[np.argmin(moves.axis[strokes, drill])])
    bottom = moves.axis[deepest] + shift[deepest]
    top = bottom[drill] + float(np.ptp(level))
    feeds = dense.moves.kind[dense.move] == FEED
    rows = np.flatnonzero((dense.move >= theirs[0]) & (dense.move < theirs[1]) & feeds & real.settled)
    if not len(rows):
        result.left_out += 1
        return
    # a stroke starts where the move before it ended
    begin = rows[np.concatenate([[True], np.diff(dense.move[rows]) != 0])] - 1
    rows = np.union1d(rows, begin[begin >= 0])

    def away(tips: np.ndarray) -> np.ndarray:
        held = np.tile(bottom, (len(tips), 1))
        held[:, drill] = np.clip(tips[:, drill], bottom[drill], top)
        size = np.linalg.norm(tips - held, axis=1)
        low = int(np.argmin(tips[:, drill]))
        size[low] = max(size[low], float(np.linalg.norm(tips[low] - bottom)))
        return np.asarray(size)

    certain = away(real.middle[rows])
    possible = certain.copy()
    doubtful = np.flatnonzero(np.isin(rows, real.rows))
    if len(doubtful):
        index = np.searchsorted(real.rows, rows[doubtful])
        for corner in range(real.corners.shape[1]):
            tips = real.middle[rows].copy()
            tips[doubtful] = real.corners[index, corner]
            possible = np.maximum(possible, away(tips))
        certain[doubtful] = np.nan
    result.open += len(doubtful)
    result.holes += 1
    result.add(np.full(len(rows), deepest), certain, possible)
