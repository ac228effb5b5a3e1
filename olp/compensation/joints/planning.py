"""What a machine with rotary joints is commanded, move by move: waypoints, splits between them, backlash."""

from __future__ import annotations

import numpy as np

from olp.compensation.joints.path import JointPath, unreached
from olp.compensation.joints.runs import Runs
from olp.compensation.joints.sampling import spread
from olp.core.arrays import Array, Index, Mask, distinct
from olp.core.errors import NotInvertible, ProgramError
from olp.core.values import dataclass
from olp.kinematics.correction import CorrectedPoses, deviations, left_angles
from olp.kinematics.poses import Poses

#: The share of a tolerance that a split leaves to what lies between its samples.
_SHARE = 0.7
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
#: Rows whose commands are found at a time, so that memory is small.
_BATCH = 1 << 15


@dataclass(frozen=True, slots=True)
class JointLimits:
    """The numerical tolerances of a correction: mm at the tip, rad of the tool."""

    tolerance_mm: float
    tolerance_rad: float


@dataclass(frozen=True, slots=True, eq=False)
class JointPlan:
    """Rows of the corrected program: their `move` (r,) and the `share` of it at which they end; a share of 0
    takes up backlash. (r, axes) `command` are corrected programmed coordinates, NaN where a move stays as it
    is;
    `axes` the axis values of these and `target` the poses that they bring the tool to. `side` (r, axes) are
    those of the backlash. `left_rad` (r,) are angles that remain, `limited` (r,) rows near a singular
    posture. Arcs are written as `straight` parts, or all stay as they are.
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


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """Rows at shares of moves with their commands, before backlash, on whose `side` they are."""

    move: Index
    share: Array
    axes: Array
    target: Poses
    side: Array
    left_rad: Array
    limited: Mask

    @staticmethod
    def join(parts: list[_Rows]) -> _Rows:
        rotation = np.concatenate([part.target.rotation for part in parts])
        position = np.concatenate([part.target.position for part in parts])
        names = ("move", "share", "axes", "side", "left_rad", "limited")
        columns = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
        return _Rows(target=Poses(rotation, position), **columns)

    def only(self, rows: Index | Mask) -> _Rows:
        return _Rows(
            self.move[rows], self.share[rows], self.axes[rows],
            self.target.only(rows), self.side[rows],
            self.left_rad[rows], self.limited[rows],
        )  # fmt: skip


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
    ends = _solved(path, runs.move, runs.end, runs.side)
    split = np.flatnonzero(feed[runs.move])
    begins = _solved(path, runs.move[split], runs.begin[split], runs.side[split])
    inner = _split(path, begins, ends.only(split), limits)
    back = begins.only(runs.turned[split])
    rows = _Rows.join([ends, *inner, back])
    order = np.lexsort((rows.share, rows.move))
    return _finished(path, rows.only(order), straight)


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
    done = _solved(path, move, share, runs.side[run])
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


def _solved(path: JointPath, move: Index, share: Array, side: Array) -> _Rows:
    """The commands at shares of moves; `side` (r, axes) of the backlash there."""
    motion, parts = path.motion, []
    rotary = np.array([unit == "deg" for unit in motion.structure.units])
    for a in range(0, max(len(move), 1), _BATCH):
        some, at = move[a : a + _BATCH], share[a : a + _BATCH]
        tool, shift, own = path.tool[some], path.shift_mm[some], side[a : a + _BATCH]
        try:
            axes = motion.axes(path.at(some, at), tool, path.tip[some])
        except NotInvertible as error:
            raise unreached(int(path.line[some[error.rows[0]]])) from None
        nominal = motion.nominal(axes, tool)
        done = _commanded(path, some, axes, tool, shift)
        target = Poses(nominal.rotation, nominal.position + shift)
        pole = path.directions.keep(motion.structure, some, nominal.rotation[:, :, 2])
        held = np.flatnonzero(path.held[some] | pole)
        if held.size:
            stands = axes[held]
            # where no word of a rotary axis changes, its backlash stays
            play = np.where(path.stay[some[held], None] & rotary, 0.5 * motion.width * own[held], 0.0)
            solved = motion.linear(stands - play, tool[held], target.only(held))
            done.values[held], done.left_rad[held] = solved.values, solved.left_rad
            done.limited[held] = pole[held]
        left = left_angles(motion.structure, done.left_rad, target)
        parts.append(_Rows(some, at, done.values, target, own, left, done.limited))
    return _Rows.join(parts)


def _commanded(path: JointPath, move: Index, axes: Array, tool: Index, shift: Array) -> CorrectedPoses:
    structure = path.motion.structure
    try:
        done = path.motion.command(axes, tool, shift)
    except NotInvertible as error:
        if not error.rows:
            raise
        rows = np.array(error.rows)
        lines, first = np.unique(path.line[move[rows]], return_index=True)
        raise ProgramError.together(
            ProgramError(
                "no axis values bring the tool to where this move has it"
                f"{path.singular(axes[rows[row]])}; expected a target within reach, "
                "away from a singular posture",
                line=line,
                code="OLP566",
            )
            for line, row in zip(lines.tolist(), first.tolist(), strict=True)
        ) from None
    out = np.flatnonzero(done.beyond.any(axis=1))
    if out.size:
        row = int(out[np.argmin(path.line[move[out]])])
        column = int(np.argmax(done.beyond[row]))
        name = structure.order[column]
        low, high = structure.joints[name].travel
        raise ProgramError(
            f"the corrected command of {name} "
            f"is {done.values[row, column]:.6g} {structure.units[column]}, out "
            f"of its travel {low:g} to {high:g}; move the part, or state the travel in the machine file",
            line=int(path.line[move[row]]),
            code="OLP567",
        )
    return done


def _split(path: JointPath, begin: _Rows, end: _Rows, limits: JointLimits) -> list[_Rows]:
    """Rows between the ends of moves, so that nothing between them leaves the tolerances."""
    found: list[_Rows] = []
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
        rows = _solved(path, begin.move[owner], share, end.side[owner])
        found.append(rows)
        key = np.append(owner, np.arange(len(apart))), np.append(share, begin.share)
        order = np.lexsort(key[::-1])
        begins = _Rows.join([rows, begin]).only(order)
        key = np.append(owner, np.arange(len(apart))), np.append(share, end.share)
        order = np.lexsort(key[::-1])
        begin, end = begins, _Rows.join([rows, end]).only(order)
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


def _parts(path: JointPath, begin: _Rows, end: _Rows, limits: JointLimits) -> Index:
    """(s,) into how many parts each stretch between two rows has to be split; 1 where it may stay."""
    count = path.samples(end.move, begin.axes, end.axes, end.share - begin.share)
    chords = path.curves.chords(end.move, end.share - begin.share, _SHARE * limits.tolerance_mm)
    parts = np.ones(len(count), np.int64)
    totals = np.cumsum(count)
    a = 0
    while a < len(count):
        b = max(int(np.searchsorted(totals, (totals[a - 1] if a else 0) + _BATCH)), a + 1)
        worst = _worst(path, begin.only(np.arange(a, b)), end.only(np.arange(a, b)), limits, count[a:b])
        bends = np.clip(np.ceil(np.sqrt(worst)), 2, _MOST_PARTS).astype(np.int64)
        bends = np.maximum(bends, chords[a:b])
        parts[a:b] = np.where(worst > 1.0, bends, 1)
        a = b
    return parts


def _worst(path: JointPath, begin: _Rows, end: _Rows, limits: JointLimits, count: Index) -> Array:
    """(s,) the largest deviation in each stretch over what may be."""
    motion = path.motion
    owner, step = spread(count)
    part = (step + 1) / (count[owner] + 1)
    move = begin.move[owner]
    tool, tip = path.tool[move], path.tip[move]
    ends = [motion.programmed(rows.axes, path.tool[rows.move], path.tip[rows.move]) for rows in (begin, end)]
    written = path.between(ends[0][owner], ends[1][owner], part, move)
    share = begin.share[owner] + part * (end.share - begin.share)[owner]
    nominal = motion.targets(path.at(move, share), tool, tip)
    target = Poses(nominal.rotation, nominal.position + path.shift_mm[move])
    axes = motion.axes(written, tool, tip)
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
    over = np.maximum(distance / limits.tolerance_mm, angle / limits.tolerance_rad) / _SHARE
    worst = np.zeros(len(count))
    np.maximum.at(worst, owner, over)
    return worst


def _finished(path: JointPath, rows: _Rows, straight: bool) -> JointPlan:
    """The plan of rows in their order, with a row for each move that stays as it is."""
    motion, count = path.motion, len(path)
    still = np.setdiff1d(np.arange(count), distinct(rows.move))
    own = rows.side
    axes = rows.axes + 0.5 * motion.width * own
    command = motion.programmed(axes, path.tool[rows.move], path.tip[rows.move])
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
