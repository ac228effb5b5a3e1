"""What a machine with rotary joints is commanded, move by move: waypoints, splits between them, backlash."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from olp.compensation.joints.commanded import Rows, led, refuse_beyond, solved
from olp.compensation.joints.path import JointPath
from olp.compensation.joints.play import Play, with_play
from olp.compensation.joints.runs import Runs
from olp.compensation.joints.sampling import spread
from olp.core.arrays import Array, Index, Mask, distinct
from olp.core.errors import ProgramError
from olp.core.values import dataclass
from olp.kinematics.correction import beyond_travel, deviations
from olp.kinematics.poses import Poses

#: The share of a tolerance that a split leaves to what lies between its samples.
_SHARE = 0.7
#: The same where axes have backlash, and dead bands.
_SHARE_WITH_PLAY = 0.55
#: A move is split into at most so many parts at a time.
_MOST_PARTS = 64
#: Rounds of splitting; each leaves less than half of a deviation.
_MOST_ROUNDS = 12
#: Rows of a program at most, for each of its moves and as a base: so that no short text makes work without
#: end.
_MOST_ROWS = 1_000_000
#: Further rows for each of its moves.
_ROWS_PER_MOVE = 100
#: mm or deg below which a command is none: an arc along which there is no other one stays.
_NOTHING = 1e-9
#: Of angles that remain by less than this share of the tolerance, all counts as correctable.
LITTLE_LEFT = 0.05
#: Samples that are looked at at a time, so that memory is small.
_BATCH = 1 << 15


@dataclass(frozen=True, slots=True)
class JointLimits:
    """The numerical tolerances of a correction: mm at the tip, rad of the tool."""

    tolerance_mm: float
    tolerance_rad: float


@dataclass(frozen=True, slots=True, eq=False)
class JointPlan:
    """Rows of the corrected program: their `move` (r,) and the `share` of it at which they end. The tool
    stands while a row takes up backlash: its share is 0, or that of a row beside it.

    (r, axes) `command` are corrected programmed coordinates, NaN where a move stays as it is; `axes` the axis
    values of these and `target` the poses that they bring the tool to. `side` (r, axes) are those of the
    backlash. `left_rad` (r,) are angles that remain, `limited` (r,) rows near a singular posture. Arcs are
    written as `straight` parts, or all stay as they are.
    """

    move: Index
    share: Array
    command: Array
    axes: Array
    target: Poses
    side: Array
    left_rad: Array
    limited: Mask
    straight: bool

    @property
    def stands(self) -> Mask:
        """(r,) rows that take up backlash: the tool has to come to them."""
        same = np.zeros(len(self.move), bool)
        same[1:] = (self.move[1:] == self.move[:-1]) & (self.share[1:] == self.share[:-1])
        past = np.append(same[1:], False)[: len(same)] & (self.share == 1.0)
        return np.asarray((self.share == 0.0) | (same & (self.share < 1.0)) | past)


def planned(path: JointPath, limits: JointLimits) -> JointPlan:
    """The plan of a path. Raises ProgramError with the line of a feed move from or to an unknown position, of
    a command that does not exist, and of one that leaves the travel of an axis."""
    known = np.asarray(np.isfinite(path.end).all(axis=1), bool)
    solid = known & ~path.kept
    _refuse_unknown(path, known)
    runs = Runs.of(path, solid)
    straight = _corrects_arcs(path, runs)
    feed = path.feed & ~path.holes.whole & (path.start != path.end).any(axis=1)
    feed = np.where(path.curves.mask, straight, feed)
    ends = solved(path, runs.move, runs.end, runs.side)
    split = np.flatnonzero(feed[runs.move])
    begins = _begun(path, runs, ends, split)
    inner = _split(path, begins, ends.only(split), limits)
    rows = Rows.join([ends, *inner])
    rows = rows.only(np.lexsort((rows.share, rows.move)))
    if path.motion.width.any():
        play = Play.of(path, rows, limits.tolerance_mm, limits.tolerance_rad)
        rows = with_play(path, rows, begins.only(begins.share == 0.0), play)
    return _finished(path, rows, straight)


def _begun(path: JointPath, runs: Runs, ends: Rows, which: Index) -> Rows:
    """The begins of some runs. One that begins where the one before ends, as most do, is solved there."""
    move, before = runs.move[which], np.maximum(which - 1, 0)
    last = runs.move[before]
    bends = path.curves.mask | path.held | path.directions.led
    alike = (which > 0) & (runs.begin[which] == 0.0) & (runs.end[before] == 1.0)
    alike &= ~bends[move] & ~bends[last] & (path.start[move] == path.end[last]).all(axis=1)
    alike &= (path.tool[move] == path.tool[last]) & (path.tip[move] == path.tip[last])
    alike &= (path.shift_mm[move] == path.shift_mm[last]).all(axis=1)
    same, other = np.flatnonzero(alike), np.flatnonzero(~alike)
    there = replace(
        ends.only(before[same]), move=move[same], share=np.zeros(len(same)), side=runs.side[which[same]]
    )
    rest = which[other]
    fresh = solved(path, runs.move[rest], runs.begin[rest], runs.side[rest])
    return Rows.join([there, fresh]).only(np.argsort(np.append(same, other)))


def _corrects_arcs(path: JointPath, runs: Runs) -> bool:
    """Whether anything is to be corrected along an arc of a path."""
    of = np.flatnonzero(path.curves.mask[runs.move])
    if not of.size:
        return False
    count = path.curves.samples(runs.move[of], runs.end[of] - runs.begin[of])
    owner, step = spread(count + 1)
    run = of[owner]
    share = runs.begin[run] + step / np.maximum(count[owner], 1) * (runs.end - runs.begin)[run]
    move, width = runs.move[run], path.motion.width
    done = solved(path, move, share, runs.side[run])
    nominal = path.motion.axes(path.at(move, share), path.tool[move], path.tip[move])
    return bool(np.abs(done.axes + 0.5 * width * done.side - nominal).max() > _NOTHING)


def _refuse_unknown(path: JointPath, known: Mask) -> None:
    wrong = np.flatnonzero(path.feed & ~(known & np.isfinite(path.start).all(axis=1)))
    if wrong.size:
        first = int(wrong[0])
        nowhere = np.isnan(path.end[first]) | np.isnan(path.start[first])
        order = path.coordinates.names
        names = ", ".join(name for name, missing in zip(order, nowhere.tolist(), strict=True) if missing)
        raise ProgramError(
            f"a feed move begins or ends where {names} has not been commanded; command all axes before "
            "it, after a change to tool centre point control again, or state start_mm and start_deg",
            line=int(path.line[first]),
            code="OLP524",
        )


def _split(path: JointPath, begin: Rows, end: Rows, limits: JointLimits) -> list[Rows]:
    """Rows between the ends of moves, so that nothing between them leaves the tolerances."""
    found: list[Rows] = []
    most = _MOST_ROWS + _ROWS_PER_MOVE * len(path)
    for _ in range(_MOST_ROUNDS):
        if not len(begin.move):
            return found
        parts = _parts(path, begin, end, limits)
        apart = np.flatnonzero(parts > 1)
        begin, end, parts = begin.only(apart), end.only(apart), parts[apart]
        if parts.sum() + sum(len(rows.move) for rows in found) > most:
            break
        owner, step = spread(parts - 1)
        share = begin.share[owner] + (step + 1) / parts[owner] * (end.share - begin.share)[owner]
        rows = solved(path, begin.move[owner], share, end.side[owner])
        found.append(rows)
        key = np.append(owner, np.arange(len(apart))), np.append(share, begin.share)
        order = np.lexsort(key[::-1])
        begins = Rows.join([rows, begin]).only(order)
        key = np.append(owner, np.arange(len(apart))), np.append(share, end.share)
        order = np.lexsort(key[::-1])
        begin, end = begins, Rows.join([rows, end]).only(order)
    if len(begin.move):
        first = int(np.argmin(path.line[begin.move]))
        raise ProgramError(
            "between the ends of this move no number of splits keeps the path within tolerance"
            f"{path.singular(begin.axes[first])}; expected an "
            "error without steps; raise --tolerance-um or --tolerance-urad",
            line=int(path.line[begin.move[first]]),
            code="OLP566",
        )
    return found


def _parts(path: JointPath, begin: Rows, end: Rows, limits: JointLimits) -> Index:
    """(s,) into how many parts each stretch between two rows has to be split; 1 where it may stay."""
    count = path.samples(end.move, begin.axes, end.axes, end.share - begin.share)
    share = _SHARE_WITH_PLAY if path.motion.width.any() else _SHARE
    chords = path.curves.chords(end.move, end.share - begin.share, share * limits.tolerance_mm)
    parts = np.ones(len(count), np.int64)
    totals = np.cumsum(count)
    a = 0
    while a < len(count):
        b = max(int(np.searchsorted(totals, (totals[a - 1] if a else 0) + _BATCH)), a + 1)
        worst = (
            _worst(path, begin.only(np.arange(a, b)), end.only(np.arange(a, b)), limits, count[a:b]) / share
        )
        bends = np.clip(np.ceil(np.sqrt(worst)), 2, _MOST_PARTS).astype(np.int64)
        bends = np.maximum(bends, chords[a:b])
        parts[a:b] = np.where(worst > 1.0, bends, 1)
        a = b
    return parts


def _worst(path: JointPath, begin: Rows, end: Rows, limits: JointLimits, count: Index) -> Array:
    """(s,) the largest deviation in each stretch in tolerances."""
    motion = path.motion
    owner, step = spread(count)
    part = (step + 1) / (count[owner] + 1)
    move = begin.move[owner]
    tool, tip = path.tool[move], path.tip[move]
    share = begin.share[owner] + part * (end.share - begin.share)[owner]
    nominal = motion.targets(path.at(move, share), tool, tip)
    target = Poses(nominal.rotation, nominal.position + path.shift_mm[move])
    axes = led(path, begin, end, owner, part)
    actual = motion.actual(axes, tool)
    distance, angle = deviations(motion.structure, actual, target)
    left = np.maximum(begin.left_rad, end.left_rad)
    angle -= left[owner]
    whole = ~(begin.limited | end.limited | path.held[begin.move]) & (
        left > LITTLE_LEFT * limits.tolerance_rad
    )
    rows = np.flatnonzero(whole[owner])
    angle[rows] = np.maximum(
        angle[rows], motion.correctable(axes[rows], tool[rows], actual.only(rows), target.only(rows))
    )
    over = np.maximum(distance / limits.tolerance_mm, angle / limits.tolerance_rad)
    worst = np.zeros(len(count))
    np.maximum.at(worst, owner, over)
    return worst


def _finished(path: JointPath, rows: Rows, straight: bool) -> JointPlan:
    """The plan of rows in their order, with a row for each move that stays as it is."""
    motion, count = path.motion, len(path)
    still = np.setdiff1d(np.arange(count), distinct(rows.move))
    own = rows.side
    axes = rows.axes + 0.5 * motion.width * own
    if motion.width.any():
        # a drive leads its load
        refuse_beyond(path, rows.move, axes, beyond_travel(motion.structure, axes))
    command = path.commanded(rows.move, rows.share, axes)
    blank = np.full((len(still), path.end.shape[1]), np.nan)
    move, share = np.append(rows.move, still), np.append(rows.share, np.ones(len(still)))
    order = np.lexsort((share, move))
    eye = np.broadcast_to(np.eye(3), (len(still), 3, 3))
    return JointPlan(
        move[order], share[order], np.vstack((command, blank))[order], np.vstack((axes, blank))[order],
        Poses(np.concatenate((rows.target.rotation, eye))[order],
              np.concatenate((rows.target.position, blank[:, :3]))[order]),
        np.vstack((own, np.zeros(blank.shape)))[order],
        np.append(rows.left_rad, np.zeros(len(still)))[order],
        np.append(rows.limited, np.zeros(len(still), bool))[order],
        straight,
    )  # fmt: skip
