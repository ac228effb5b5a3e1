"""Which posture of an arm each target of a robot program is reached with: near the one before where the move
is straight, else the one that the words of the target name."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.errors import ProgramError
from olp.core.values import dataclass
from olp.kinematics.poses import Poses, rotation_vector, rotations
from olp.kinematics.postures import AXES, POSTURES, Arm

#: A straight move whose axes turn by more than this is followed in steps, deg.
_FAR_DEG = 30.0
#: Steps of such a move.
_STEPS = 32
#: deg; postures nearer to each other are one, such as where an arm is stretched out
_SAME_DEG = 1e-4
#: Where no word names a posture, any other one is further away than the nearest one by this factor.
_APART = 2.0
#: Pairs of targets that are compared at a time, so that memory is small.
_BATCH = 1 << 12


@dataclass(frozen=True, slots=True, eq=False)
class Wanted:
    """What targets (n,) ask of an arm: `flange` poses, and axis values (n, 6) where they state `joints`, else
    NaN. `values` and `fits` are the postures that their words name (`RobotDialect.fitting`). Moves go
    `straight`, or with any posture near by where they are `free`; `open` ones do not name one posture.
    `begins` are moves whose start is not known, and `behind` is the line of the move that leaves it open:
    their own where the run decides it. `known_at` (n, 6) are axis values from which such a move begins
    all the same, NaN where none are known; those that are `led` go straight from there. `line` is that of
    the move."""

    flange: Poses
    joints: Array
    values: Array
    fits: Mask
    straight: Mask
    free: Mask
    open: Mask
    begins: Mask
    behind: Index
    known_at: Array
    led: Mask
    line: Index


class Settled:
    """The postures of all targets, one after the other. Those in `left` by their numbers have none, for the
    reasons: the run decides where a move begins, and its language has no word that names a posture.
    `reached_at` gives the flange of a target by its number at other axis values (6,)."""

    def __init__(
        self, arm: Arm, wanted: Wanted, postures: Array, travel: Array,
        reached_at: Callable[[int, Array], Poses],
    ) -> None:  # fmt: skip
        self.arm, self.wanted, self.travel, self.reached_at = arm, wanted, travel, reached_at
        self.postures = postures
        beyond: Mask = (wanted.values < travel[0]) | (wanted.values > travel[1])
        self.fits = wanted.fits & ~beyond.any(axis=2)
        self.reached = np.asarray(np.isfinite(postures[:, :, 1]).any(axis=1), bool)
        self.next, self.furthest = self._steps()
        self.left: dict[int, ProgramError] = {}

    def axes(self, start_deg: Array, wordless: Mask | None = None) -> Array:
        """(n, 6) axis values of all targets. `start_deg` (6,) is where the arm is at first, NaN where that
        is not known; NaN of those that are `left`, which are `wordless` (n,). Raises ProgramError with all
        targets that no posture reaches, or that name several, and where all are left."""
        wanted = self.wanted
        values, last, which, lost = np.empty(wanted.joints.shape), start_deg, -1, False
        undecided: Mask = np.zeros(len(values), bool) if wordless is None else wordless & wanted.begins
        undecided &= (wanted.behind == wanted.line) & self.reached
        # before the first move start_deg may say where the arm is
        undecided[:1] = False
        refusals: list[ProgramError] = []
        in_joints = np.isfinite(wanted.joints[:, 0]).tolist()
        begins, line = wanted.begins.tolist(), wanted.line.tolist()
        k = 0
        while k < len(values):
            if begins[k]:
                last, which, lost = wanted.known_at[k], -1, False
            numbers = self._on(k, which, begins)
            if numbers:
                behind = k + len(numbers)
                values[k:behind] = _unwrapped(last, self.postures[np.arange(k, behind), numbers])
                k, last, which, lost = behind, values[behind - 1], numbers[-1], False
                continue
            try:
                found, which = (wanted.joints[k], -1) if in_joints[k] else self._of(k, last, line[k])
                last = values[k] = found
                lost = False
            except ProgramError as error:
                if undecided[k] or (lost and k - 1 in self.left and self._follows(k) and self.reached[k]):
                    self.left[k] = error
                    values[k] = np.nan
                # where the posture before is not known, this one is not, too
                elif not (lost and self._follows(k)):
                    refusals.append(error)
                last, which, lost = np.full(AXES, np.nan), -1, True
            k += 1
        refusals += self.left.values() if len(self.left) == len(values) else []
        if refusals:
            raise ProgramError.together(iter(refusals))
        return values

    def _on(self, k: int, which: int, begins: list[bool]) -> list[int]:
        """The numbers of the postures of straight moves from `k` on, each near the one before, which is
        `which`; those that follow one another without a long way."""
        numbers: list[int] = []
        while which >= 0 and k < len(begins) and not begins[k] and self.furthest[k][which] <= _FAR_DEG:
            which = self.next[k][which]
            numbers.append(which)
            k += 1
        return numbers

    def _steps(self) -> tuple[list[list[int]], list[list[float]]]:
        """From each posture of the target before (n, 8) the number of the nearest one, and the way of the
        axis that goes furthest, deg. Only straight moves have them."""
        count = len(self.postures)
        number = np.full((count, POSTURES), -1)
        size = np.full((count, POSTURES), np.inf)
        rows = np.flatnonzero(self.wanted.straight)
        rows = rows[rows > 0]
        for a in range(0, len(rows), _BATCH):
            some = rows[a : a + _BATCH]
            away = np.zeros((len(some), POSTURES, POSTURES))
            columns = (np.moveaxis(self.postures[own], 2, 0) for own in (some, some - 1))
            for after, before in zip(*columns, strict=True):
                way = np.abs(after[:, None] - before[:, :, None])
                # both are within half a turn
                np.maximum(away, np.minimum(way, 360.0 - way), out=away)
            away[np.isnan(away)] = np.inf
            number[some] = np.argmin(away, axis=2)
            size[some] = np.min(away, axis=2)
        return number.tolist(), size.tolist()

    def _follows(self, k: int) -> bool:
        """Whether a target is reached with a posture near the one before."""
        return bool(self.wanted.straight[k] or self.wanted.free[k] or self.wanted.open[k])

    def _of(self, k: int, last: Array, line: int) -> tuple[Array, int]:
        """The axis values of a target behind others, and their posture by its number, -1 where it is not
        known."""
        wanted = self.wanted
        if not self.reached[k]:
            raise _refused("no posture of this arm reaches this target", line)
        known = bool(np.isfinite(last).all())
        if wanted.straight[k] and known:
            return self._led(k, last, line, k - 1)
        if known and wanted.led[k] and (wanted.free[k] or wanted.open[k]):
            return self._led(k, last, line, -1)
        if known and (wanted.free[k] or wanted.open[k]):
            found = self._near(k, last, line)
        else:
            found = self._named(k, line)
        if np.isnan(found).all():
            raise _refused("no posture within the travel of the axes leads on to this target", line)
        if np.isnan(found).any():
            raise straight_wrist(line)
        return found, self._number(k, found)

    def _led(self, k: int, last: Array, line: int, begin: int) -> tuple[Array, int]:
        """The posture at the end of a straight move that goes a long way, or from a posture whose number is
        not known. It begins at a target by its number, or at axis values `last` alone where that is -1."""
        found: Array = nearest(last[None], self.postures[k][None])[0]
        if np.nanmax(np.abs(found - last)) > _FAR_DEG:
            found = self._followed(k, last, begin)
        if np.isnan(found).any():
            raise straight_wrist(line)
        return found, self._number(k, found)

    def _number(self, k: int, found: Array) -> int:
        """The number of the posture that axis values are, turns left out."""
        away = np.abs((self.postures[k] - found + 180.0) % 360.0 - 180.0).max(axis=1)
        return int(np.argmin(np.where(np.isnan(away), np.inf, away)))

    def _near(self, k: int, last: Array, line: int) -> Array:
        """The posture near the one before, within the travel of the axes, perhaps by a turn."""
        postures = self.wanted.values[k] if self.wanted.open[k] else self.postures[k]
        near = last + (postures - last + 180.0) % 360.0 - 180.0
        near = near + 360.0 * ((near < self.travel[0]) * 1.0 - (near > self.travel[1]))
        outside: Mask = (near < self.travel[0]) | (near > self.travel[1])
        beyond = outside.any(axis=1)
        if self.wanted.open[k]:
            beyond |= ~self.wanted.fits[k]
        away = np.nanmax(np.where(np.isnan(near), -1.0, np.abs(near - last)), axis=1)
        away = np.where(beyond | (away < 0.0), np.inf, away)
        order = np.argsort(away, kind="stable")
        if np.isinf(away[order[0]]):
            return np.full(AXES, np.nan)
        found = near[order[0]]
        within = [row for row in order[1:] if np.isfinite(away[row])]
        others = np.array([row for row in within if not _same(near[row], found)], np.int64)
        if self.wanted.open[k] and others.size and away[others[0]] < _APART * away[order[0]]:
            raise _refused(
                "the target does not state its configuration, and two postures are about as near to the one "
                "before; state it, or program a target between",
                line,
            )
        return np.asarray(found)

    def _followed(self, k: int, last: Array, begin: int) -> Array:
        """The posture at the end of a long straight move (`_led`), followed step by step."""
        share, flange = np.arange(1, _STEPS + 1) / _STEPS, self.wanted.flange
        first = self.reached_at(k, last) if begin < 0 else flange.only(np.array([begin]))
        end, all_steps = flange.only(np.array([k])), np.zeros(_STEPS, np.int64)
        for postures in self.arm.postures(led(first.only(all_steps), end.only(all_steps), share)):
            last = nearest(last[None], postures[None])[0]
        return last

    def _named(self, k: int, line: int) -> Array:
        """The posture that the words of a target name."""
        found: list[Array] = []
        for value in self.wanted.values[k][self.fits[k]]:
            if all(not _same(value, other) for other in found):
                found.append(value)
        if len(found) == 1:
            return found[0]
        behind = int(self.wanted.behind[k])
        if behind not in (0, line) and (self.wanted.open[k] or (not found and self.wanted.free[k])):
            raise _refused(
                "the target is reached from the posture before it, and where the move of line "
                f"{behind} goes is not read; state the configuration, the numbers of that move, or "
                "joint_targets",
                line,
            )
        if self.wanted.open[k]:
            raise _refused(
                "the target does not state its configuration, so it is reached from the posture before it, "
                "which is not known here; state the configuration, or start_deg in the job file",
                line,
            )
        if not found and self.wanted.free[k]:
            raise _refused(
                "no posture of this target is the one that its configuration names, and the control is told "
                "not to look at that; state start_deg in the job file, where the arm is before it",
                line,
            )
        if not found:
            raise _refused(
                "no posture that reaches this target within the travel of the axes is the one that its "
                "configuration names; check that, or the axes and base of the machine",
                line,
            )
        raise _refused("the configuration of this target names several postures", line)


def _unwrapped(last: Array, postures: Array) -> Array:
    """(n, 6) postures one after the other, with the turns by which each is near the one before; the first is
    near `last` (6,)."""
    ways = np.diff(postures, axis=0, prepend=last[None])
    near = last + np.cumsum((ways + 180.0) % 360.0 - 180.0, axis=0)
    return np.asarray(postures + 360.0 * np.rint((near - postures) / 360.0))


def _same(one: Array, other: Array) -> bool:
    return bool(np.nanmax(np.abs(one - other)) <= _SAME_DEG)


def _refused(what: str, line: int) -> ProgramError:
    return ProgramError(what, line=line, code="OLP566")


def straight_wrist(line: int) -> ProgramError:
    """Why a pose is refused at which two axes of the wrist turn the tool alike."""
    return _refused(
        "the wrist is straight here, so how two of its axes share a turn is not stated; move the target, or "
        "turn it",
        line,
    )


def nearest(near: Array, postures: Array) -> Array:
    """(n, 6) those of postures (n, 8, 6) that are nearest to axis values, with the turns of these."""
    away = (postures - near[:, None] + 180.0) % 360.0 - 180.0
    size = np.where(np.isnan(postures[:, :, 0]), np.inf, 0.0)
    size = size + np.nanmax(np.where(np.isnan(away), 0.0, np.abs(away)), axis=2)
    best = np.argmin(size, axis=1)
    row = np.arange(len(near))
    found = near + away[row, best]
    found[np.isinf(size[row, best])] = np.nan
    return np.asarray(found)


def led(begin: Poses, end: Poses, share: Array) -> Poses:
    """Poses at shares of ways: evenly along lines, and evenly turned."""
    way = rotation_vector(end.rotation @ np.swapaxes(begin.rotation, -1, -2))
    turn = rotations(share[:, None] * way)
    return Poses(turn @ begin.rotation, begin.position + share[:, None] * (end.position - begin.position))
