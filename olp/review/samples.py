"""The nominal path in samples, and the deviation of the tip at each with either program.

A sample is at a share of a nominal move. The moves of the corrected program are cut where the tip is at that
point, so that a deviation is the distance from the nominal point.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields

import numpy as np
import numpy.typing as npt

from olp.compensation.plan import zero_shifts
from olp.core.arrays import Array, Index, Mask, distinct
from olp.core.errors import CannotCompute
from olp.core.progress import Progress, silent
from olp.core.toolpath import Kind, Toolpath
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.errormodel.reversal import plays
from olp.errormodel.sampling import clear_length_mm, longer, steps_needed
from olp.program.feeds.moves import lengths_mm
from olp.program.program import Program
from olp.proof.judgement import Judgements
from olp.proof.proof import Counts
from olp.proof.smooth_joints import SmoothJoints
from olp.review.parts import BLOCK, Ends, Parts, error_mm, held_mm, set_beside, set_in_holes, with_taken_up

Single = npt.NDArray[np.float32]

#: Number of samples of a path, about, within the steps below.
SAMPLES = 100_000
#: Shortest step between samples in mm.
FINEST_MM = 0.5
#: Longest step between samples in mm.
COARSEST_MM = 10.0
#: Between two samples of a feed move the error bends by less than this, in mm.
BEND_MM = 1e-4
#: Largest angle of a chord of an arc in rad.
_TURN = np.pi / 36
#: Largest distance of a chord from its arc in mm.
_SAGITTA_MM = 0.01
#: Most steps of a move.
_MOST_STEPS = 1 << 12
#: A cut gets a sample at its start where that is farther off than the others by more than this share of it,
_LESS = 0.005
#: and by more than this, in mm.
_LESS_MM = 1e-5


@dataclass(slots=True, eq=False)
class Samples:
    """The n samples of a path in program order.

    (n,) nominal `move` and `share` of it. (n,) `part`, the move of the corrected program, and `within`, the
    share of it. (n, 3) `axis_mm` and `command_mm`, nominal and corrected axis positions. (n, 3) `uncorrected`
    and `corrected`, deviations of the tip from its nominal point in mm. (n,) `joined`, whether the path leads
    here from the sample before. (n,) `arc_mm` along the path. `play` (n, 3) is that of the nominal commands,
    None where no axis has backlash.
    """

    move: Index
    share: Array
    part: Index
    within: Array
    axis_mm: Array
    command_mm: Array
    uncorrected: Single
    corrected: Single
    joined: Mask
    arc_mm: Array
    play: Array | None

    def __len__(self) -> int:
        return len(self.move)

    def become(self, which: Index) -> None:
        """Be some of the samples, each once or several times. One column is copied at a time, the largest
        first, whose room the others can take: a long program has none for all of them twice."""
        names = [column.name for column in fields(self) if getattr(self, column.name) is not None]
        for name in sorted(names, key=lambda name: -int(getattr(self, name).nbytes)):
            setattr(self, name, getattr(self, name)[which])

    @property
    def correction(self) -> Array:
        """(n, 3) corrected command minus nominal command."""
        return self.command_mm - self.axis_mm


def sample(
    nominal: Program, corrected: Program, groups: Index, model: ErrorModel, step_mm: float | None = None,
    tell: Progress = silent,
) -> Samples:  # fmt: skip
    """Samples every `step_mm`, or finer where the error requires it.

    `groups` (n,) is the last corrected move of each nominal move. Between waypoints the tip of the corrected
    program is the one beside the sample, at waypoints the one at the end of the move. Raises CannotCompute
    for a path without any known position.
    """
    path, written = nominal.toolpath, corrected.toolpath
    shift = zero_shifts(path.frames, model) if path.frames else np.zeros((1, 3))
    ends, other = Ends.of(path), Ends.of(written)
    parts = Parts.of(ends, other, groups, shift, model)
    start = bool(np.isfinite(path.start_mm).all())
    move, share, part, within = _merged(_steps(path, model, step_mm), parts, start=start)
    command = other.at(part, within)
    play_there = plays(model, command)
    more = with_taken_up(written, model, (move, share, part, within), command, play_there)
    if more is not None:
        move, share, part, within = more
        command = other.at(part, within)
        play_there = plays(model, command)
    axis = ends.at(move, share)
    tell("sample", 0.3)
    tip = _Tip(model, path, shift)
    play = plays(model, axis)
    # deviations in half the memory: that is finer than the page shows
    joints = SmoothJoints.of(path)
    result = tip.deviation(move, share, axis, axis, play)
    uncorrected = _across(joints, move, share, result).astype(np.float32)
    tell("sample", 0.5)
    result = tip.deviation(move, share, axis, command, play_there)
    tell("sample", 0.7)
    beside = set_beside(ends, other, parts, move, share, part, within, command, result)
    rows = distinct(np.concatenate((beside, set_in_holes(nominal, corrected, move, axis, command))))
    own = None if play_there is None else play_there[rows]
    tell("sample", 0.8)
    result[rows] = tip.deviation(move[rows], share[rows], axis[rows], command[rows], own)
    corrected_mm = _across(joints, move, share, result).astype(np.float32)
    del result
    # of several samples at one point the last is used: the moves before it took up backlash
    keep = np.ones(len(move), bool)
    keep[:-1] = (np.diff(move) != 0) | (np.diff(share) > 1e-12)
    keep &= np.isfinite(uncorrected).all(axis=1) & np.isfinite(corrected_mm).all(axis=1)
    if not keep.any():
        raise CannotCompute(
            "no position of the program is known, so there is nothing to show; command X, Y and Z "
            "first, or give a machine file and a job file with start_mm"
        )
    started = np.isfinite(ends.length)[move]
    length = np.nan_to_num(ends.length)
    arc_mm = np.concatenate(([0.0], np.cumsum(length)))[move] + share * length[move]
    every = Samples(
        move, share, part, within, axis, command, uncorrected, corrected_mm, started, arc_mm, play
    )  # fmt: skip
    if not keep.all():
        every.become(np.flatnonzero(keep))
    every.joined[0] = False
    return every


def _across(joints: SmoothJoints | None, move: Index, share: Array, deviation: Array) -> Array:
    """Deviations of which at smooth joints of contours only what the proof counts is left."""
    if joints is not None:
        ends = np.flatnonzero(share == 1.0)
        rows, off = joints.across(move[ends], deviation[ends])
        deviation[ends[rows]] = off
    return deviation


def waypoints(samples: Samples, table: Judgements, rows: slice = slice(None)) -> Mask:
    """(m,) which samples, or which of some, are waypoints: ends of moves, but not of the strokes of a hole
    above its bottom, which have no figure of their own."""
    inside = (table.counts == Counts.HOLE) & np.isnan(table.corrected)
    return np.asarray((samples.share[rows] == 1.0) & ~inside[samples.move[rows]])


def away_mm(position_mm: Array, share: Array, waypoint: Mask, delta_mm: Array) -> Array:
    """(n,) mm: how far the tip is off at samples, as in the proof. At waypoints that is from the nominal
    point, before them from the path of the move: where the tip is behind its start or beyond its end, from
    there.
    `position_mm` and `delta_mm` are (n, 3), `share` and `waypoint` (n,)."""
    away = np.empty(len(share))
    for a in range(0, len(share), BLOCK):
        rows = np.arange(a, min(a + BLOCK, len(share)))
        here, delta, own = position_mm[rows], delta_mm[rows].astype(float), share[rows]
        # the tangent of arcs: from the sample before to the one behind
        begins = own == 0.0
        before, behind = np.where(begins, rows, np.maximum(rows - 1, 0)), np.where(own == 1.0, rows, rows + 1)
        behind = np.minimum(behind, len(share) - 1)
        # a start may be there twice, before and after backlash is taken up
        behind[begins & (share[behind] == 0.0)] += 1
        behind = np.minimum(behind, len(share) - 1)
        back, ahead = position_mm[before], position_mm[behind]
        step = ahead - back
        length = np.sqrt(np.einsum("ij,ij->i", step, step))
        along = np.einsum("ij,ij->i", delta, step) / np.maximum(length, 1e-12)
        done, left = np.sqrt(((here - back) ** 2).sum(axis=1)), np.sqrt(((ahead - here) ** 2).sum(axis=1))
        on = np.clip(
            along, np.where(waypoint[before] | (share[before] == 0.0), -done, -np.inf),
            np.where(waypoint[behind], left, np.inf),
        )  # fmt: skip
        on[waypoint[rows]] = 0.0
        squares = np.einsum("ij,ij->i", delta, delta) - along * along + (along - on) ** 2
        away[rows] = np.sqrt(np.maximum(squares, 0.0))
    return away


def with_starts(samples: Samples, nominal: Program, table: Judgements) -> Samples:
    """The samples, and the start of each cut that the table of judgements states to be farther off than they
    show, by more than `_LESS` or `_LESS_MM`. They are added to the same samples; of long programs the worst.
    """
    path = nominal.toolpath
    first = np.flatnonzero(np.diff(samples.move, prepend=-1))
    first = first[1:] if len(first) else first
    move = samples.move[first]
    starts = samples.joined[first] & (path.kind[move] != Kind.RAPID)
    starts &= (samples.move[first - 1] == move - 1) & (path.frame[move] == path.frame[move - 1])
    # what is there already, unless backlash was taken up there
    moved = np.any(samples.uncorrected[first] != samples.uncorrected[first - 1], axis=1)
    moved |= np.any(samples.corrected[first] != samples.corrected[first - 1], axis=1)
    starts &= (samples.share[first] > 0.0) | moved
    first, move = first[starts], move[starts]
    more = np.zeros(len(first))
    ends, groups = waypoints(samples, table), _groups(nominal)
    for layer in ("uncorrected", "corrected"):
        delta = getattr(samples, layer)
        away = away_mm(samples.axis_mm, samples.share, ends, delta)
        drawn, largest = np.zeros(len(path)), np.zeros(len(path), np.float32)
        np.maximum.at(drawn, groups[samples.move], away)
        np.fmax.at(largest, groups, getattr(table, layer) - table.side.get(layer, np.float32(0.0)))
        stated, before = largest[groups[move]], drawn[groups[move]]
        there = np.sqrt(np.einsum("ij,ij->i", delta[first - 1], delta[first - 1]))
        missed = np.minimum(stated, there) - before
        more = np.fmax(more, np.where(missed > np.maximum(_LESS_MM, _LESS * stated), missed, 0.0))
    spare = max(SAMPLES - len(samples), SAMPLES // 10)
    chosen = np.sort(np.argsort(-more, kind="stable")[: min(spare, np.count_nonzero(more))])
    first, move = first[chosen], move[chosen]
    order = np.sort(np.concatenate((np.arange(len(samples)), first - 1)), kind="stable")
    samples.become(order)
    begins = np.flatnonzero(np.diff(order, prepend=-1) == 0)
    samples.move[begins], samples.share[begins], samples.joined[begins] = move, 0.0, True
    return samples


def _groups(nominal: Program) -> Index:
    """(n,) the move whose figure is that of each move: of the strokes of a hole it is one for all."""
    groups = np.arange(len(nominal.toolpath))
    move, hole = nominal.holes.moves()
    feed = nominal.toolpath.kind[move] != Kind.RAPID
    groups[move[feed]] = nominal.holes.ends(feed)[0][hole[feed]]
    return groups


@dataclass(frozen=True, slots=True, eq=False)
class _Tip:
    """The tip of a machine on a path whose part is shifted by `shift` (k, 3) in each frame."""

    model: ErrorModel
    path: Toolpath
    shift: Array

    def deviation(self, move: Index, share: Array, axis: Array, command: Array, play: Array | None) -> Array:
        """(n, 3) distance of the tip at axis positions `command` from its nominal point at `axis`."""
        tip = error_mm(self.model, command, self.path.tool_mm(), move, play)
        for a in range(0, len(move), BLOCK):
            rows = slice(a, a + BLOCK)
            tip[rows] -= held_mm(self.path, self.shift, move[rows], share[rows])
            tip[rows] += command[rows] - axis[rows]
        return tip


def by_source(
    path: Toolpath, samples: Samples, model: ErrorModel
) -> Iterator[tuple[str, npt.NDArray[np.float32]]]:
    """(name, (n,) mm) of each source of error: the size of its part of the error of the nominal program."""
    tool = path.tool_mm()
    sizes: dict[str, npt.NDArray[np.float32]] = {}
    for a in range(0, len(samples), BLOCK):
        rows = slice(a, a + BLOCK)
        tool_vector = tool if tool.ndim == 1 else tool[samples.move[rows]]
        play = None if samples.play is None else samples.play[rows]
        for name, value in model.contributions(samples.axis_mm[rows], tool_vector, play):
            size = sizes.setdefault(name, np.zeros(len(samples), np.float32))
            size[rows] = np.sqrt(np.einsum("ij,ij->i", value, value))
    for name in sorted(sizes, key=lambda name: -float(sizes[name].max(initial=0.0))):
        yield name, sizes.pop(name)


def _steps(path: Toolpath, model: ErrorModel, step_mm: float | None) -> Index:
    """(n,) the number of equal steps of each move."""
    length = lengths_mm(path)
    known = np.isfinite(length)
    length[~known] = 0.0
    if step_mm is None:
        # every move has a sample at its end; the others are for long moves
        spare = max(SAMPLES - len(path), SAMPLES // 10)
        step_mm = float(np.clip(length.sum() / spare, FINEST_MM, COARSEST_MM))
    steps = np.maximum(np.ceil(length / step_mm - 1e-9), 1).astype(np.int64)
    delta = path.end_mm - path.starts_mm()
    which = longer(delta, clear_length_mm(model, path.tools_mm(), BEND_MM))
    which = which[known[which] & (path.kind[which] != Kind.RAPID)]
    if which.size:
        tool = path.tool_mm()
        tool_vector = tool if tool.ndim == 1 else tool[which]
        finer = steps_needed(model, delta[which], tool_vector, BEND_MM, at_most=_MOST_STEPS)
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


def _merged(steps: Index, parts: Parts, *, start: bool) -> tuple[Index, Array, Index, Array]:
    """Samples at equal steps and at the ends of corrected moves, in order: nominal move and share, corrected
    move and share."""
    count = steps - 1
    move = np.repeat(np.arange(len(steps)), count)
    first = np.cumsum(count) - count
    share = (np.arange(len(move)) - first[move] + 1) / steps[move]
    if start and len(steps):
        move, share = np.concatenate(([0], move)), np.concatenate(([0.0], share))
    both = np.concatenate((move, parts.owner))
    done = np.concatenate((share, parts.cut))
    ends_part = np.zeros(len(both), bool)
    ends_part[len(move) :] = True
    # equal keys keep the order of the corrected program
    order = np.lexsort((ends_part, done, both))
    both, done, ends_part = both[order], done[order], ends_part[order]
    part = np.minimum(np.cumsum(ends_part) - ends_part, len(parts.owner) - 1)
    with np.errstate(invalid="ignore", divide="ignore"):
        within = (done - parts.begin[part]) / (parts.cut - parts.begin)[part]
    within = np.clip(np.where(ends_part | ~np.isfinite(within), 1.0, within), 0.0, 1.0)
    if start and len(steps):
        within[0] = 0.0
    return both, done, part, within
