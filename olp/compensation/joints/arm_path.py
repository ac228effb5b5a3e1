"""The path of a robot program on an arm: targets as axis values, and straight moves between poses."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import field, replace

import numpy as np

from olp.compensation.joints.arm_postures import Settled, Wanted, led, nearest, straight_wrist
from olp.compensation.joints.curves import Curves
from olp.compensation.joints.directed import Directions
from olp.compensation.joints.drilled import Drilled
from olp.compensation.joints.motion import Motion
from olp.compensation.joints.path import JointPath
from olp.core.arrays import Array, Index, Mask
from olp.core.errors import ConfigError, ProgramError
from olp.core.machine import Vector
from olp.core.values import dataclass
from olp.kinematics.carried import Carried, carried_arm
from olp.kinematics.coordinates import Coordinates
from olp.kinematics.errors import MachineErrors
from olp.kinematics.poses import Poses, turned
from olp.kinematics.postures import AXES, POSTURES, Arm
from olp.kinematics.structure import Structure
from olp.program.program import Program
from olp.program.robots.dialect import RobotDialect
from olp.program.robots.poses import Pose, matrices, matrix
from olp.program.robots.targets import Target, Targets, Use

#: Decimals that stand for the axis values, which no text has.
_DECIMALS = 6
#: A branch that is nearer to its border than this says nothing, mm or deg.
_BORDER = 0.01
#: deg by which a straight move turns an axis at most
_FURTHEST_DEG = 180.0
#: Axes of a straight move that are this near to even ones, deg, are those of the nearest posture.
_NEAR_DEG = 15.0
#: The column of the wrist in `Arm.branches`.
_WRIST = 2
#: A wrist that is this near to straight is named as a cause, deg.
_STRAIGHT_DEG = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class ArmPath(JointPath):
    """Moves of an arm by its axis values. Straight moves (`feed`) lead the tip along a line, and turn the
    tool evenly. Programs count the third joint `from_level` where the control does. Where they count steps of
    motors, `half_deg` (n, axes) are half of one at the ends of moves, 0 elsewhere."""

    from_level: bool = False
    half_deg: Array = field(default_factory=lambda: np.zeros((0, AXES)))

    def singular(self, axes: Array) -> str:
        held = carried_arm(self.motion.structure)
        assert held is not None
        straight = abs(float(held.arm.branches(held.own(axes)[None, None])[0, 0, _WRIST]))
        if straight > _STRAIGHT_DEG:
            return ""
        return f": the wrist is {straight:.2g} deg from straight, where two of its axes turn the tool alike"

    def between(self, start: Array, end: Array, share: Array, move: Index) -> Array:
        place = np.asarray(start + share[:, None] * (end - start))
        place[share == 1.0] = end[share == 1.0]
        rows = np.flatnonzero(self.feed[move] & (share != 0.0) & (share != 1.0))
        if not rows.size:
            return place
        held, tool = carried_arm(self.motion.structure), self.tool[move[rows]]
        assert held is not None
        arm = held.arm
        ends = [self.motion.nominal(axes[rows], tool) for axes in (start, end)]
        levers = np.array([machine.tool_mm for machine in self.motion.machines])[tool]
        flange = held.held(_flange(led(ends[0], ends[1], share[rows]), levers), place[rows])
        own = held.own(place[rows])
        found = arm.near(flange, own)
        far = np.flatnonzero(~(np.abs(found - own).max(axis=1) < _NEAR_DEG))
        found[far] = nearest(own[far], arm.postures(flange.only(far)))
        lost = np.flatnonzero(np.isnan(found).any(axis=1))
        if lost.size:
            raise straight_wrist(int(self.line[move[rows[lost[0]]]]))
        place[rows] = held.joined(found, held.along(place[rows]))
        return place


def arm_path(
    program: Program, structure: Structure, errors: MachineErrors, start_deg: Array, *, from_level: bool
) -> ArmPath:  # fmt: skip
    """The path of a robot program. `start_deg` (axes,) is where the arm is at first, NaN where that is not
    stated, and `from_level` as in `ArmPath`. Raises ProgramError with all targets that no posture reaches, or
    that name several."""
    held, targets, dialect = carried_arm(structure), program.targets, program.dialect
    assert held is not None
    assert targets is not None
    assert isinstance(dialect, RobotDialect)
    arm, structure = held.arm, held.kept(structure)
    count, uses, path = len(targets.uses), targets.uses, program.toolpath
    known = np.array([use is not None for use in uses], bool)
    rows = np.flatnonzero(known)
    used = Used([use for use in uses if use is not None], targets.targets, path.line[rows].astype(np.int64))
    touched = np.array([frame.touched is not None for frame in path.frames] or [False])[path.frame[rows]]
    used.refuse_unread(touched, [path.frames[k].work_offset for k in path.frame[rows].tolist()])
    levers = [(use.tool or Pose()).origin_mm for use in used.uses]
    places = {lever: place for place, lever in enumerate(dict.fromkeys([*levers, (0.0, 0.0, 0.0)]))}
    tool = np.zeros(count, np.int64)
    tool[rows] = [places[lever] for lever in levers]
    motion = Motion.of(structure, errors, [(lever, None) for lever in places])
    if held.track is not None and motion.width[held.column] != 0.0:
        raise ConfigError(
            f"the calibration states backlash.{held.track.name}, and a program keeps where its track is as "
            "written, so it is not taken up; approach each place of the track from one side, and state "
            "errors measured so"
        )
    unit = np.array([frame.unit_mm for frame in path.frames] or [1.0])[path.frame[rows]]
    joints, along = used.joints(arm, from_level=from_level), used.along(held)
    flange = used.flange(unit, levers)
    stated = np.isfinite(joints[:, 0])
    whole = held.joined(joints, along)[stated]
    reached = held.held(motion.nominal(whole, tool[rows][stated]), whole)
    flange.rotation[stated], flange.position[stated] = reached.rotation, reached.position
    postures = np.full((len(rows), POSTURES, AXES), np.nan)
    posed, config = np.flatnonzero(~stated), used.config()
    postures[posed] = arm.postures(Poses(flange.rotation[posed], flange.position[posed]))
    values, fits = postures.copy(), np.zeros(postures.shape[:2], bool)
    if posed.size:
        own = postures[posed]
        values[posed], fits[posed] = dialect.fitting(config[posed], own, arm.branches(own))
    travel = held.own(np.array([joint.travel for joint in structure.joints.values()]).T)
    straight = used.mask("straight")
    begins: Mask = rows != np.append(-1, rows[:-1]) + 1
    before = path.line[np.maximum(rows - 1, 0)].astype(np.int64)
    wanted = Wanted(
        flange, joints, values, fits, straight, used.mask("free"),
        np.isnan(config).any(axis=1) | (config.shape[1] == 0), begins, np.where(begins, before, 0),
        _known_at(targets, rows, arm), used.mask("led"), used.line,
    )  # fmt: skip
    wordless = np.array([not words for words in used.of("config")], bool)
    width, none_held = len(structure.order), np.array([places[(0.0, 0.0, 0.0)]])

    def reached_at(k: int, own: Array) -> Poses:
        axes = held.joined(own[None], along[[k]])
        return held.held(motion.nominal(axes, none_held), axes)

    settled = Settled(arm, wanted, postures, travel, reached_at)
    end = np.full((count, width), np.nan)
    end[rows] = held.joined(settled.axes(held.own(start_deg), wordless), along)
    if settled.left:
        left = np.array(list(settled.left))
        straight[left], known[rows[left]], end[rows[left]] = False, False, np.nan
        program = _leaving(program, rows[left], settled.left.values())
    feed, unsplit, none = np.zeros(count, bool), np.zeros(count, bool), np.zeros(count, bool)
    feed[rows], unsplit[rows] = straight, used.mask("whole")
    start = np.vstack((np.full((1, width), np.nan), end[:-1]))[:count]
    _refuse_turns(arm, held.own(start[rows]), held.own(end[rows]), straight & stated, used.line)
    feed &= np.isfinite(start).all(axis=1)
    return ArmPath(
        program, motion, Coordinates.of_axes(structure), start, end,
        np.full((count, width), -1, np.int32), tool, none, none,
        np.zeros((count, 3)), np.zeros((count, width)), np.ones(count), np.ones(width), feed, known, ~known,
        none, none, np.full(width, _DECIMALS), replace(Drilled.none(count), whole=unsplit),
        Directions.none(count), Curves.none(count), from_level=from_level,
        half_deg=_filled(rows, held.joined(used.half_deg(arm), 0.0), count),
    )  # fmt: skip


def _leaving(program: Program, moves: Index, why: Iterable[ProgramError]) -> Program:
    """A program that leaves moves as they are written: their targets keep their numbers. Raises `why` where
    one is on an arc, which is led from there."""
    targets = program.targets
    assert targets is not None
    if any(((arc.first <= moves) & (moves <= arc.last)).any() for arc in targets.arcs):
        raise ProgramError.together(iter(why))
    held = {use.target for move in moves.tolist() if (use := targets.uses[move]) is not None}
    own = [replace(one, held=one.held or k in held) for k, one in enumerate(targets.targets)]
    what = "left as written: where this move begins depends on the run, and so does the posture of the arm"
    remark = "told", int(program.toolpath.line[moves[0]]), what
    return replace(program, targets=replace(targets, targets=tuple(own)), remarks=(*program.remarks, remark))


def _refuse_turns(arm: Arm, start: Array, end: Array, straight: Mask, line: Index) -> None:
    """Raises ProgramError for a straight move (n,) to joint values in which no straight move ends that begins
    at axis values (n, 6)."""
    before, after = arm.branches(start), arm.branches(end)
    across = ((before * after < 0.0) & (np.minimum(abs(before), abs(after)) > _BORDER)).any(axis=1)
    lost = straight & (across | (np.abs(end - start).max(axis=1) > _FURTHEST_DEG))
    if lost.any():
        raise ProgramError(
            "this straight move goes to joint values on the other side of a singular posture, or beyond half "
            "a turn, where it does not lead; move to them by joints",
            line=int(line[np.argmax(lost)]),
            code="OLP566",
        )


def _known_at(targets: Targets, rows: Index, arm: Arm) -> Array:
    """(n, 6) axis values to which the moves before `rows` go as written; NaN where none are known."""
    values = np.full((len(rows), AXES), np.nan)
    for row, move in enumerate(rows.tolist()):
        own = targets.known_at.get(move - 1)
        if own is not None:
            values[row, arm.columns] = own
    return values


def _filled(rows: Index, values: Array, count: int) -> Array:
    """(n, axes) values at rows, 0 elsewhere."""
    filled = np.zeros((count, values.shape[1]))
    filled[rows] = values
    return filled


@dataclass(frozen=True, slots=True, eq=False)
class Used:
    """Moves (n,) to targets in their order, with their lines, as columns."""

    uses: list[Use]
    targets: tuple[Target, ...]
    line: Index

    def mask(self, name: str) -> Mask:
        """(n,) a yes or no of each use."""
        return np.array([getattr(use, name) for use in self.uses], bool)

    def of(self, name: str) -> list[tuple[float, ...]]:
        """What the targets say, one tuple a move."""
        return [getattr(self.targets[use.target], name) for use in self.uses]

    def joints(self, arm: Arm, *, from_level: bool) -> Array:
        """(n, 6) axis values that targets state, NaN where they state poses."""
        values, blank = np.empty((len(self.uses), AXES)), (np.nan,) * AXES
        values[:, arm.columns] = np.array([own or blank for own in self.of("joints")]).reshape(-1, AXES)
        return arm.from_second(values) if from_level else values

    def along(self, held: Carried) -> Array:
        """(n,) where the carriage of an arm is, mm: the first external axis. 0 where the arm stands."""
        moved = held.track is not None
        return np.array([own[0] if moved else 0.0 for own in self.of("outer")]).reshape(len(self.uses))

    def half_deg(self, arm: Arm) -> Array:
        """(n, 6) half of a step of the motors, in which targets count joints; 0 where they do not."""
        values = np.zeros((len(self.uses), AXES))
        for row, counts in enumerate(self.of("counts")):
            if counts:
                values[row, arm.columns] = 0.5 / np.array(counts)
        return values

    def config(self) -> Array:
        """(n, k) the words that name postures; NaN where one is not stated."""
        own = self.of("config")
        width = max((len(words) for words in own), default=0)
        blank = (np.nan,) * width
        return np.array([words or blank for words in own], float).reshape(len(own), width)

    def flange(self, unit_mm: Array, levers: list[Vector]) -> Poses:
        """(n) where the flange is at each target, with `levers` from there to the tips."""
        uses = self.uses
        point = np.array(self.of("point")).reshape(-1, 3) * unit_mm[:, None]
        point += np.array([use.shift_mm for use in uses]).reshape(-1, 3)
        frames, tools = ([getattr(use, name) or Pose() for use in uses] for name in ("frame", "tool"))
        turns, held = _turns(frames), np.swapaxes(_turns(tools), -1, -2)
        origin = np.array([frame.origin_mm for frame in frames]).reshape(-1, 3)
        rotation = turns @ matrices(np.array([use.turn for use in uses]).reshape(-1, 4))
        tips = Poses(rotation @ held, origin + turned(turns, point))
        return _flange(tips, np.array(levers).reshape(-1, 3))

    def refuse_unread(self, touched: Mask, frames: list[str]) -> None:
        """Raises ProgramError for tools and frames that do not say where the flange is.
        `touched` (n,) are targets in `frames` that were set by touching."""
        for k, use in enumerate(self.uses):
            line, target = int(self.line[k]), self.targets[use.target]
            if use.tool is None:
                raise ProgramError(
                    "on an arm the tool is a frame with its own directions, and the program does not state "
                    "it; expected a tool with its numbers in the program, or gauge_to_tip_mm and "
                    "gauge_to_tip_deg in [tools.N]",
                    line=line,
                    code="OLP521",
                )
            if touched[k] and not target.joints:
                raise ProgramError(
                    f'{frames[k]} was set by touching, which is not read on arms; expected set_by = "true"',
                    line=line,
                    code="OLP523",
                )


def _turns(frames: list[Pose]) -> Array:
    """(n, 3, 3) the rotations of frames, most of which are the very same."""
    known = {id(frame): frame for frame in frames}
    number = {key: place for place, key in enumerate(known)}
    each = np.array([matrix(frame.turn) for frame in known.values()]).reshape(-1, 3, 3)
    return each[np.array([number[id(frame)] for frame in frames], np.int64)]


def _flange(tips: Poses, levers: Array) -> Poses:
    """Where the flange is with tips at the ends of levers."""
    return Poses(tips.rotation, tips.position - turned(tips.rotation, levers))
