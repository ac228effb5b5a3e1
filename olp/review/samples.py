"""The nominal path in samples, and beside each what the machine would do with either program.

A sample lies at a share of a nominal move. The moves of the corrected program that stand for it are cut where
the tip is at that place, so that a deviation is the distance from the place that the tip should be at.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from olp.compensation.plan import zero_shifts
from olp.errormodel import ErrorModel, play_states
from olp.errormodel.base import Array, Mask
from olp.errormodel.sampling import clear_length_mm, longer, steps_needed
from olp.exceptions import CannotCompute
from olp.geometry import PLANES, arc_points
from olp.program.feeds import lengths_mm
from olp.program.program import Program
from olp.toolpath import Kind, Toolpath

Index = npt.NDArray[np.int64]

#: samples that a path is given unless its length asks for fewer, and the shortest and longest step between
#: them
SAMPLES, FINEST_MM, COARSEST_MM = 100_000, 0.5, 10.0
#: between two samples of a feed move the error bends by less than this
BEND_MM = 1e-4
#: chords of arcs turn by no more than this, and leave the arc by no more than that
_TURN, _SAGITTA_MM = np.pi / 36, 0.01
_MOST_STEPS = 1 << 12
_STRAIGHT = (Kind.RAPID, Kind.LINE, Kind.PROBE)
#: samples that are evaluated at once
_BLOCK = 1 << 16


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Of n samples in program order: (n,) nominal `move` and `share` of it; (n,) `part`, the move of the
    corrected program, and the share of it as `within`; (n, 3) `axis_mm` and `command_mm`, nominal and
    corrected axis positions; (n, 3) deviations of the tip from its nominal place in mm, `uncorrected` and
    `result`; (n,) `joined`, whether the path leads here from the sample before; (n,) `way_mm` along the path.
    `play` (n, 3) is that of the nominal commands, None where no axis has lost motion."""

    move: Index
    share: Array
    part: Index
    within: Array
    axis_mm: Array
    command_mm: Array
    uncorrected: Array
    result: Array
    joined: Mask
    way_mm: Array
    play: Array | None

    def __len__(self) -> int:
        return len(self.move)

    @property
    def correction(self) -> Array:
        """(n, 3) command written less nominal command."""
        return self.command_mm - self.axis_mm


def sample(
    nominal: Program, corrected: Program, groups: Index, model: ErrorModel, step_mm: float | None = None
) -> Samples:
    """Samples every `step_mm`, or finer where the error asks for it.

    `groups` (n,) is the last corrected move of each nominal move. Between way-points the tip of the corrected
    program is taken where it is beside the sample, at way-points where it ends up. Raises CannotCompute for a
    path without any known position.
    """
    path, written = nominal.toolpath, corrected.toolpath
    shift = zero_shifts(path.frames, model) if path.frames else np.zeros((1, 3))
    ends, other = _Ends.of(path), _Ends.of(written)
    owner = np.searchsorted(groups, np.arange(len(written)))
    cut = _cuts(ends, other, owner, groups, shift, model)
    steps = _steps(path, model, step_mm)
    move, share, part, within = _merged(steps, owner, cut, start=bool(np.isfinite(path.start_mm).all()))
    axis = ends.at(move, share)
    tool = path.per_frame([f.tool_mm for f in path.frames])
    held = _held(path, shift, move, share)
    play = _plays(model, axis)
    uncorrected = _error(model, axis, tool, move, play) - held
    command, play_there = _beside(ends, other, move, share, part, within, model, tool, held)
    _in_holes(nominal, corrected, move, axis, command)
    result = _error(model, command, tool, move, play_there) - held + (command - axis)
    # of several samples at one place the last stands for all: what came before took up lost motion
    keep = np.append((np.diff(move) != 0) | (np.diff(share) > 1e-12), True)
    keep &= np.isfinite(uncorrected).all(axis=1) & np.isfinite(result).all(axis=1)
    if not keep.any():
        raise CannotCompute(
            "the program brings the tip to no known position, so there is nothing to show; give start_mm in "
            "the job file, or command X, Y and Z first"
        )
    started = np.isfinite(ends.length)[move]
    length = np.nan_to_num(ends.length)
    way = np.concatenate(([0.0], np.cumsum(length)))[move] + share * length[move]
    joined = started[keep]
    joined[0] = False
    return Samples(
        move[keep], share[keep], part[keep], within[keep], axis[keep], command[keep], uncorrected[keep],
        result[keep], joined, way[keep], None if play is None else play[keep],
    )  # fmt: skip


def by_source(
    path: Toolpath, samples: Samples, model: ErrorModel
) -> Iterator[tuple[str, npt.NDArray[np.float32]]]:
    """(name, (n,) mm) of each source of error: the size of what it alone does to the tip of the nominal
    program."""
    tool = path.per_frame([f.tool_mm for f in path.frames])
    found: dict[str, npt.NDArray[np.float32]] = {}
    for a in range(0, len(samples), _BLOCK):
        rows = slice(a, a + _BLOCK)
        lever = tool if tool.ndim == 1 else tool[samples.move[rows]]
        play = None if samples.play is None else samples.play[rows]
        for name, value in model.contributions(samples.axis_mm[rows], lever, play):
            size = found.setdefault(name, np.zeros(len(samples), np.float32))
            size[rows] = np.sqrt(np.einsum("ij,ij->i", value, value))
    yield from sorted(found.items(), key=lambda item: -float(item[1].max(initial=0.0)))


@dataclass(frozen=True, slots=True, eq=False)
class _Ends:
    """The moves of a path from end to end; (n,) `arc` index or -1, (n,) `length` in mm."""

    path: Toolpath
    start: Array
    arc: Index
    length: Array

    @staticmethod
    def of(path: Toolpath) -> _Ends:
        arc = np.full(len(path), -1, np.int64)
        arc[path.arcs.move] = np.arange(len(path.arcs))
        return _Ends(path, path.starts_mm(), arc, lengths_mm(path))

    def at(self, move: Index, share: Array) -> Array:
        """(m, 3) axis positions at shares of moves; at a share of 1 that is the end, also of unknown
        starts."""
        end = self.path.end_mm[move]
        start = self.start[move]
        out = start + share[:, None] * (end - start)
        curved = np.flatnonzero((self.arc[move] >= 0) & (share < 1.0))
        if curved.size:
            arcs, which = self.path.arcs, self.arc[move[curved]]
            out[curved] = arc_points(
                start[curved], end[curved], arcs.centre_mm[which], arcs.plane[which], arcs.sweep_rad[which],
                share[curved],
            )  # fmt: skip
        whole = share == 1.0
        out[whole] = end[whole]
        return out

    def directions(self, move: Index, share: Array) -> Array:
        """(m, 3) unit tangents at shares of moves."""
        step = 1e-6
        first = np.minimum(share, 1.0 - step)
        out = self.at(move, first + step) - self.at(move, first)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(np.nan_to_num(out / np.sqrt(np.einsum("ij,ij->i", out, out))[:, None]))


def _steps(path: Toolpath, model: ErrorModel, step_mm: float | None) -> Index:
    """(n,) into how many equal steps each move goes."""
    length = lengths_mm(path)
    known = np.isfinite(length)
    length[~known] = 0.0
    if step_mm is None:
        step_mm = float(np.clip(length.sum() / SAMPLES, FINEST_MM, COARSEST_MM))
    steps = np.maximum(np.ceil(length / step_mm - 1e-9), 1).astype(np.int64)
    delta = path.end_mm - path.starts_mm()
    which = longer(delta, clear_length_mm(model, path.tools_mm(), BEND_MM))
    which = which[known[which] & (path.kind[which] != Kind.RAPID)]
    if which.size:
        tool = path.tool_mm()
        lever = tool if tool.ndim == 1 else tool[which]
        finer = steps_needed(model, delta[which], lever, BEND_MM, at_most=_MOST_STEPS)
        steps[which] = np.maximum(steps[which], finer)
    arcs = path.arcs
    if len(arcs):
        turn = np.abs(arcs.sweep_rad)
        radius = np.maximum(length[arcs.move] / np.maximum(turn, 1e-12), 1e-6)
        chord = np.minimum(2.0 * np.arccos(np.clip(1.0 - _SAGITTA_MM / radius, -1.0, 1.0)), _TURN)
        steps[arcs.move] = np.maximum(
            steps[arcs.move], np.ceil(turn / np.maximum(chord, 1e-3)).astype(np.int64)
        )
    return steps


def _cuts(ends: _Ends, other: _Ends, owner: Index, groups: Index, shift: Array, model: ErrorModel) -> Array:
    """(m,) the share of its nominal move that is done where each corrected move ends."""
    nominal, corrected = ends.path, other.path
    cut = np.ones(len(corrected))
    inner = np.ones(len(corrected), bool)
    inner[groups] = False
    inner &= np.isfinite(ends.length)[owner]
    rows = np.flatnonzero(inner)
    if not rows.size:
        return cut
    move = owner[rows]
    tool = nominal.per_frame([f.tool_mm for f in nominal.frames])
    command = corrected.end_mm[rows]
    play = _plays(model, corrected.end_mm)
    error = _error(model, command, tool, move, None if play is None else play[rows])
    nothing = np.zeros(len(rows))
    tip = command + error - _held(nominal, shift, move, nothing)
    start, along = ends.start[move], nominal.end_mm[move] - ends.start[move]
    along += _held(nominal, shift, move, nothing + 1.0) - _held(nominal, shift, move, nothing)
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
        # a step back is one that only takes up lost motion: the tip stands still
        rank = 2.0 * (np.cumsum(np.diff(move, prepend=-1) != 0) - 1)
        cut[rows] = np.clip(np.maximum.accumulate(share + rank) - rank, 0.0, 1.0)
    return cut


def _beside(
    ends: _Ends, other: _Ends, move: Index, share: Array, part: Index, within: Array, model: ErrorModel,
    tool: Array, held: Array,
) -> tuple[Array, Array | None]:  # fmt: skip
    """(n, 3) commands that bring the tip beside each sample, and the play there; `within` follows."""
    command = other.at(part, within)
    play = _plays(model, command)
    # chords of one piece and equal angles of another are not at one place at one time
    rows = np.flatnonzero((within < 1.0) & (within > 0.0) & (share < 1.0) & np.isfinite(other.length)[part])
    if not rows.size:
        return command, play
    direction = ends.directions(move[rows], share[rows])
    some = command[rows]
    for _ in range(2):
        tip = some + _error(model, some, tool, move[rows], None if play is None else play[rows]) - held[rows]
        ahead = np.einsum("ij,ij->i", tip - ends.at(move[rows], share[rows]), direction)
        step = np.nan_to_num(ahead) / np.maximum(other.length[part[rows]], 1e-9)
        within[rows] = np.clip(within[rows] - step, 0.0, 1.0)
        some = other.at(part[rows], within[rows])
    command[rows] = some
    return command, play


def _in_holes(nominal: Program, corrected: Program, move: Index, axis: Array, command: Array) -> None:
    """Strokes of canned cycles: a hole may take one peck more or less than before, so pecks have no partners;
    what stands for a place of the stroke is the same place of the corrected hole."""
    holes = nominal.holes
    if not holes or len(holes) != len(corrected.holes):
        return
    path = nominal.toolpath
    of = np.full(len(path), -1, np.int64)
    for k, hole in enumerate(holes):
        of[hole.first : hole.last] = k
    axes = np.array([PLANES[h.plane] for h in holes])
    mine, theirs = (
        np.array([(*h.place_mm, h.r_mm, h.z_mm) for h in some]) for some in (holes, corrected.holes)
    )
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


def _arc_share(ends: _Ends, move: Index, tip: Array, guess: Array) -> Array:
    """Shares of arcs by the angle of points near them; `guess` says on which turn."""
    arcs, which = ends.path.arcs, ends.arc[move]
    rows = np.arange(len(move))
    axes = np.array(PLANES)[arcs.plane[which]]
    centre, sweep, start = arcs.centre_mm[which], arcs.sweep_rad[which], ends.start[move]

    def angle(point: Array) -> Array:
        first, second = (point[rows, axes[:, i]] - centre[rows, axes[:, i]] for i in (0, 1))
        return np.asarray(np.arctan2(second, first))

    turned = angle(tip) - angle(start)
    turned += 2 * np.pi * np.rint((guess * sweep - turned) / (2 * np.pi))
    return np.asarray(turned / sweep)


def _merged(steps: Index, owner: Index, cut: Array, *, start: bool) -> tuple[Index, Array, Index, Array]:
    """Samples at equal steps and at the ends of corrected moves, in order: nominal move and share, corrected
    move and share."""
    count = steps - 1
    move = np.repeat(np.arange(len(steps)), count)
    first = np.cumsum(count) - count
    share = (np.arange(len(move)) - first[move] + 1) / steps[move]
    if start and len(steps):
        move, share = np.concatenate(([0], move)), np.concatenate(([0.0], share))
    both = np.concatenate((move, owner))
    at = np.concatenate((share, cut))
    ends_part = np.zeros(len(both), bool)
    ends_part[len(move) :] = True
    # equal keys stay in the order of the corrected program
    order = np.lexsort((ends_part, at, both))
    both, at, ends_part = both[order], at[order], ends_part[order]
    part = np.minimum(np.cumsum(ends_part) - ends_part, len(owner) - 1)
    begin = np.zeros(len(cut))
    begin[1:] = np.where(np.diff(owner) == 0, cut[:-1], 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        within = (at - begin[part]) / (cut - begin)[part]
    within = np.clip(np.where(ends_part | ~np.isfinite(within), 1.0, within), 0.0, 1.0)
    if start and len(steps):
        within[0] = 0.0
    return both, at, part, within


def _held(path: Toolpath, shift: Array, move: Index, share: Array) -> Array:
    """(m, 3) where the part lies from where the offsets say, at shares of moves: a line that begins in one
    frame and ends in another goes from the one to the other, an arc is all of its own."""
    own = path.frame[move]
    before = np.where(
        (move > 0) & np.isin(path.kind[move], _STRAIGHT), path.frame[np.maximum(move - 1, 0)], own
    )
    return np.asarray(shift[before] + share[:, None] * (shift[own] - shift[before]))


def _plays(model: ErrorModel, points: Array) -> Array | None:
    width = model.lost_motion_mm(points)
    return None if width is None else play_states(points, width)


def _error(model: ErrorModel, points: Array, tool: Array, move: Index, play: Array | None) -> Array:
    """(n, 3) error of the tip, a block at a time: the temporaries of all at once would not fit the cache."""
    out = np.empty_like(points)
    for a in range(0, len(points), _BLOCK):
        rows = slice(a, a + _BLOCK)
        lever = tool if tool.ndim == 1 else tool[move[rows]]
        out[rows] = model.error(points[rows], lever, None if play is None else play[rows])
    return out
