"""The path of a robot program on an arm: targets as axis values, and straight moves between poses."""

from __future__ import annotations

import numpy as np

from olp.compensation.joints.curves import Curves
from olp.compensation.joints.directed import Directions
from olp.compensation.joints.drilled import Drilled
from olp.compensation.joints.motion import Motion
from olp.compensation.joints.path import JointPath
from olp.core.arrays import Array, Index
from olp.core.errors import ProgramError
from olp.core.values import dataclass
from olp.kinematics.errors import MachineErrors
from olp.kinematics.poses import Poses, rotation_vector, rotations, turned
from olp.kinematics.postures import AXES, Arm
from olp.kinematics.structure import Structure
from olp.program.program import Program
from olp.program.robots.dialect import RobotDialect
from olp.program.robots.poses import Pose, matrix
from olp.program.robots.targets import Targets, Use

#: A straight move whose axes turn by more than this is followed in steps, deg.
_FAR_DEG = 30.0
#: Steps of such a move.
_STEPS = 32
#: deg; postures nearer to each other are one, such as where an arm is stretched out
_SAME_DEG = 1e-4
#: Decimals that stand for the axis values, which no text has.
_DECIMALS = 6
#: External axes that are not there have at least this.
_ABSENT = 9e8


@dataclass(frozen=True, slots=True, eq=False)
class ArmPath(JointPath):
    """Moves of an arm by its axis values. Straight moves (`feed`) lead the tip along a line, and turn the
    tool evenly."""

    def between(self, start: Array, end: Array, share: Array, move: Index) -> Array:
        place = np.asarray(start + share[:, None] * (end - start))
        place[share == 1.0] = end[share == 1.0]
        rows = np.flatnonzero(self.feed[move] & (share != 0.0) & (share != 1.0))
        if not rows.size:
            return place
        arm, tool = Arm.of(self.motion.structure), self.tool[move[rows]]
        assert arm is not None
        ends = [self.motion.nominal(axes[rows], tool) for axes in (start, end)]
        levers = np.array([machine.tool_mm for machine in self.motion.machines])[tool]
        flange = _flange(_led(ends[0], ends[1], share[rows]), levers)
        found = _nearest(place[rows], arm.postures(flange))
        lost = np.flatnonzero(np.isnan(found).any(axis=1))
        if lost.size:
            raise _straight_wrist(int(self.line[move[rows[lost[0]]]]))
        place[rows] = found
        return place


def arm_path(program: Program, structure: Structure, errors: MachineErrors, start_deg: Array) -> ArmPath:
    """The path of a robot program. `start_deg` (6,) is where the arm is at first, NaN where that is not
    stated. Raises ProgramError with all targets that no posture reaches, or that name several."""
    arm, targets, dialect = Arm.of(structure), program.targets, program.dialect
    assert arm is not None
    assert targets is not None
    assert isinstance(dialect, RobotDialect)
    count, uses = len(targets.uses), targets.uses
    line = program.toolpath.line.tolist()
    _refuse_unread(program, targets, dialect.outer_from, line)
    known = np.array([use is not None for use in uses], bool)
    rows = np.flatnonzero(known)
    stated = [use for use in uses if use is not None]
    levers = [(use.tool or Pose()).origin_mm for use in stated]
    tools = list(dict.fromkeys(levers)) or [(0.0, 0.0, 0.0)]
    tool = np.zeros(count, np.int64)
    tool[rows] = [tools.index(lever) for lever in levers]
    tips = [tip_of(program, targets, int(row)) for row in rows]
    flange = Poses(
        np.array([matrix(tip.turn) @ matrix(use.tool.turn).T if use.tool else matrix(tip.turn)
                  for tip, use in zip(tips, stated, strict=True)]).reshape(-1, 3, 3),
        np.array([tip.origin_mm for tip in tips]).reshape(-1, 3),
    )  # fmt: skip
    flange = _flange(flange, np.array(levers).reshape(-1, 3))
    end = np.full((count, AXES), np.nan)
    travel = np.array([joint.travel for joint in structure.joints.values()]).T
    settled = _Settled(arm, dialect, targets, stated, flange, travel)
    end[rows] = settled.axes(np.array(line)[rows], rows, start_deg)
    feed = np.array([use is not None and use.straight for use in uses], bool)
    start = np.vstack((np.full((1, AXES), np.nan), end[:-1]))[:count]
    feed &= np.isfinite(start).all(axis=1)
    none = np.zeros(count, bool)
    return ArmPath(
        program, Motion.of(structure, errors, [(vector, None) for vector in tools]), start, end,
        np.full((count, AXES), -1, np.int32), tool, none, none, np.zeros((count, 3)),
        np.zeros((count, AXES)), np.ones(count), np.ones(AXES), feed, known, ~known, none, none,
        np.full(AXES, _DECIMALS), Drilled.none(count), Directions.none(count), Curves.none(count),
    )  # fmt: skip


def tip_of(program: Program, targets: Targets, row: int) -> Pose:
    """Where a move brings the tip, in machine coordinates."""
    use = targets.uses[row]
    assert use is not None
    unit = program.toolpath.frames[int(program.toolpath.frame[row])].unit_mm
    point = targets.targets[use.target].point
    x, y, z = (unit * value + shift for value, shift in zip(point, use.shift_mm, strict=True))
    return use.frame.then(Pose((x, y, z), use.turn))


def _refuse_unread(program: Program, targets: Targets, outer_from: int, lines: list[int]) -> None:
    """Raises ProgramError for tools and frames that do not say where the flange is, and external axes."""
    frames = program.toolpath.frames
    for use, line, frame in zip(targets.uses, lines, program.toolpath.frame.tolist(), strict=True):
        if use is None:
            continue
        if use.tool is None:
            raise ProgramError(
                "on an arm the tool is a frame with its own directions, and the program does not state it; "
                "expected a tool with its numbers in the program",
                line=line,
                code="OLP521",
            )
        if frames[frame].touched is not None:
            raise ProgramError(
                f"{frames[frame].work_offset} was set by touching, which is not read on arms; expected "
                'set_by = "true"',
                line=line,
                code="OLP523",
            )
        outer = targets.targets[use.target].rest[outer_from:]
        if any(value != 0.0 and abs(value) < _ABSENT for value in outer):
            raise ProgramError(
                "an external axis is not at zero, and the machine file of this arm has none; leave it out, "
                "or correct the program at zero",
                line=line,
                code="OLP563",
            )


class _Settled:
    """Which posture each target is reached with: near the one before where the move is straight, else the one
    that the words of the target name."""

    def __init__(
        self, arm: Arm, dialect: RobotDialect, targets: Targets, uses: list[Use], flange: Poses,
        travel: Array,
    ) -> None:  # fmt: skip
        self.arm, self.uses, self.flange, self.travel = arm, uses, flange, travel
        self.postures = arm.postures(flange)
        self.rest = [targets.targets[use.target].rest for use in uses]
        self.named = np.zeros((0, 8, AXES)), np.zeros((0, 8), bool)
        if uses:
            rest = np.array(self.rest, float)
            values, fits = dialect.fitting(rest, self.postures, arm.branches(self.postures))
            beyond = (values < travel[0]) | (values > travel[1])
            self.named = values, fits & ~beyond.any(axis=2)

    def axes(self, line: Index, rows: Index, start_deg: Array) -> Array:
        """(n, 6) axis values of all targets."""
        values, last, before, lost = np.empty((len(self.uses), AXES)), start_deg, -1, False
        refusals: list[ProgramError] = []
        for k, row in enumerate(rows.tolist()):
            if row != before + 1:
                last, lost = np.full(AXES, np.nan), False
            before = row
            try:
                last = values[k] = self._of(k, last, int(line[k]))
                lost = False
            except ProgramError as error:
                # where the posture before is not known, this one is not, too
                if not (lost and self._follows(k)):
                    refusals.append(error)
                last, lost = np.full(AXES, np.nan), True
        if refusals:
            raise ProgramError.together(iter(refusals))
        return values

    def _of(self, k: int, last: Array, line: int) -> Array:
        if np.isnan(self.postures[k, :, 0]).all():
            raise _refused("no posture of this arm reaches this target", line)
        if self._follows(k) and np.isfinite(last).all():
            straight, postures = self.uses[k].straight, self.postures[k]
            if not straight:
                postures = self._within(postures, last)
            found: Array = _nearest(last[None], postures[None])[0]
            if not straight:
                found = found + 360.0 * ((found < self.travel[0]) * 1.0 - (found > self.travel[1]))
            if straight and np.nanmax(np.abs(found - last)) > _FAR_DEG and k:
                found = self._followed(k, last)
        else:
            found = self._named(k, line)
        if np.isnan(found).all():
            raise _refused("no posture within the travel of the axes leads on to this target", line)
        if np.isnan(found).any():
            raise _straight_wrist(line)
        return found

    def _follows(self, k: int) -> bool:
        """Whether a target is reached with a posture near the one before."""
        return self.uses[k].straight or self.uses[k].free

    def _within(self, postures: Array, last: Array) -> Array:
        """Those of postures (8, 6) that are within travel, perhaps by a turn; NaN in place of others."""
        near = last + (postures - last + 180.0) % 360.0 - 180.0
        near = near + 360.0 * ((near < self.travel[0]) * 1.0 - (near > self.travel[1]))
        beyond = ((near < self.travel[0]) | (near > self.travel[1])).any(axis=1)
        return np.where(beyond[:, None], np.nan, postures)

    def _followed(self, k: int, last: Array) -> Array:
        """The posture at the end of a long straight move, followed step by step."""
        share = np.arange(1, _STEPS + 1) / _STEPS
        ends = [
            Poses(self.flange.rotation[[j] * _STEPS], self.flange.position[[j] * _STEPS]) for j in (k - 1, k)
        ]
        for postures in self.arm.postures(_led(ends[0], ends[1], share)):
            last = _nearest(last[None], postures[None])[0]
        return last

    def _named(self, k: int, line: int) -> Array:
        """The posture that the words of a target name."""
        values, fits = self.named[0][k], self.named[1][k]
        found: list[Array] = []
        for value in values[fits]:
            if all(np.nanmax(np.abs(value - other)) > _SAME_DEG for other in found):
                found.append(value)
        if not found and self.uses[k].free:
            raise _refused(
                "no posture of this target is the one that its configuration names, and the control is told "
                "not to look at that; state start_deg in the job file, where the arm is before it",
                line,
            )
        if not found:
            raise _refused(
                "no posture that reaches this target within the travel of the axes is the one that its "
                "configuration names; check the directions of the axes in the machine file",
                line,
            )
        if len(found) > 1:
            raise _refused("the configuration of this target names several postures", line)
        return found[0]


def _refused(what: str, line: int) -> ProgramError:
    return ProgramError(what, line=line, code="OLP566")


def _straight_wrist(line: int) -> ProgramError:
    return _refused(
        "the wrist is straight here, so how two of its axes share a turn is not stated; move the target, or "
        "turn it",
        line,
    )


def _nearest(near: Array, postures: Array) -> Array:
    """(n, 6) those of postures (n, 8, 6) that are nearest to axis values, with the turns of these."""
    away = (postures - near[:, None] + 180.0) % 360.0 - 180.0
    size = np.where(np.isnan(postures[:, :, 0]), np.inf, 0.0)
    size = size + np.nanmax(np.where(np.isnan(away), 0.0, np.abs(away)), axis=2)
    best = np.argmin(size, axis=1)
    row = np.arange(len(near))
    found = near + away[row, best]
    found[np.isinf(size[row, best])] = np.nan
    return np.asarray(found)


def _led(begin: Poses, end: Poses, share: Array) -> Poses:
    """Poses at shares of ways: evenly along lines, and evenly turned."""
    way = rotation_vector(end.rotation @ np.swapaxes(begin.rotation, -1, -2))
    turn = rotations(share[:, None] * way)
    return Poses(turn @ begin.rotation, begin.position + share[:, None] * (end.position - begin.position))


def _flange(tips: Poses, levers: Array) -> Poses:
    """Where the flange is with tips at the ends of levers."""
    return Poses(tips.rotation, tips.position - turned(tips.rotation, levers))
