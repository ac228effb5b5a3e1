"""Writes the plan of an arm into the targets of its program: positions and orientations in their own form.

A target whose moves want different numbers is declared again under another name, and each part of a move
states its own.
"""

from __future__ import annotations

import re

import numpy as np

from olp.compensation.joints.arm_numbers import StatedNumbers, Wanted
from olp.compensation.joints.arm_path import ArmPath
from olp.compensation.joints.planning import JointLimits, JointPlan
from olp.compensation.joints.writer import WrittenJoints
from olp.compensation.tally import Tally
from olp.compensation.target_arcs import SHARE, pieces_of, stated, stepped
from olp.core.arrays import Index
from olp.core.errors import ProgramError
from olp.core.machine import ZERO, Vector
from olp.core.spool import whole
from olp.core.values import dataclass
from olp.kinematics.carried import carried_arm
from olp.kinematics.poses import Poses, rotation_vector, turned
from olp.kinematics.postures import AXES
from olp.program.robots.arcs import Bent
from olp.program.robots.dialect import Replacement, RobotDialect
from olp.program.robots.poses import (
    Pose,
    Quaternion,
    angle_between,
    inverted,
    matrices,
    multiplied,
    of_vectors,
    products,
    rotated,
)
from olp.program.robots.targets import NOWHERE, Part, Target, Use
from olp.program.text.numbers import spliced

#: Numbers of a place.
_PLACE = 3
#: Groups of moves that a move is compared with, where none wants the very same digits.
_COMPARED = 8
#: A branch that is nearer to its border than this says nothing, mm or deg.
_BORDER = 1e-6
_NAMES = re.compile(rb"[A-Za-z_]\w*")


@dataclass(frozen=True, slots=True)
class _Aim:
    """Where a row of a `move` leads with its `target`: the point in the frame, in the units of the text, and
    the orientation there."""

    row: int
    move: int
    target: Target
    point: Vector
    turn: Quaternion


def write_arm(path: ArmPath, plan: JointPlan, limits: JointLimits) -> WrittenJoints:
    """The text of a robot program with its plan, arcs within `limits`. Raises ProgramError where it cannot be
    written."""
    return _Writer(path, plan, limits).written()


class _Writer:
    """Writes one program."""

    def __init__(self, path: ArmPath, plan: JointPlan, limits: JointLimits) -> None:
        program, targets = path.program, path.program.targets
        held = carried_arm(path.motion.structure)
        assert isinstance(program.dialect, RobotDialect)
        assert targets is not None
        assert held is not None
        self.path, self.plan, self.program, self.targets = path, plan, program, targets
        self.data, self.limits, self.stands = program.data, limits, plan.stands
        self.moves: list[int] = plan.move.tolist()
        self.dialect, self.held, self.arm, self.tally = program.dialect, held, held.arm, Tally()
        self.nominal, self.commands = (held.own(axes).tolist() for axes in (path.end, plan.command))
        self.clones = self.made = 0
        self.names: set[str] = set()

    def written(self) -> WrittenJoints:
        plan = self.plan
        rows = np.flatnonzero(np.isfinite(plan.command).all(axis=1))
        last = np.append(plan.move[1:] != plan.move[:-1], True)[: len(plan.move)]
        tool = self.path.tool[plan.move[rows]]
        poses = self.path.motion.nominal(plan.command[rows], tool)
        # frames count from where the carriage is at the ends of moves
        places, turns = self._in_frames(rows, self.held.held(poses, self.path.end[plan.move[rows]]))
        in_joints = np.array([bool(self._target_of(row).joints) for row in rows.tolist()], bool)
        self._keep_branches(rows[~in_joints])
        by_target: dict[int, list[tuple[int, Wanted]]] = {}
        edits, own = self._arcs(rows, places, turns)
        kept = [(k, row) for k, row in enumerate(rows.tolist()) if row not in own]
        aims = [
            self._aim(row, places[k], turns[k], shifted=bool(last[row]))
            for k, row in kept
            if not in_joints[k]
        ]
        wants = {
            **self._in_joints([row for k, row in kept if in_joints[k]]),
            **dict(zip((aim.row for aim in aims), self._in_digits(aims), strict=True)),
        }
        for _, row in kept:
            wanted = wants[row]
            if last[row]:
                by_target.setdefault(self._use(row).target, []).append((row, wanted))
            else:
                edits += self._part(row, wanted)
        for place, uses in by_target.items():
            edits += self._target(self.targets.targets[place], uses)
        parts = np.bincount(plan.move, minlength=len(self.path))
        if not edits:
            return WrittenJoints(None, self.tally, np.ones(len(self.path), np.int64))
        blocks = self.tally.inserted_blocks - self.clones
        if blocks:
            edits += self.dialect.counted(self.program, blocks)
        edits = self.dialect.completed(self.program, edits, self.made)
        return WrittenJoints(spliced(whole(self.data), edits), self.tally, parts)

    # -- arcs ----------------------------------------------------------------------------------------

    def _arcs(
        self, rows: Index, places: list[Vector], turns: list[Quaternion]
    ) -> tuple[list[Replacement], set[int]]:
        """Arcs in place of one where that would leave the tolerance. Also the rows of chords, and of via
        points whose targets stay as they are. `places` and `turns` are those of `rows`."""
        edits: list[Replacement] = []
        own: set[int] = set()
        plan, limits = self.plan, self.limits
        for arc in self.targets.arcs:
            first, behind = np.searchsorted(plan.move, (arc.first, arc.last + 1)).tolist()
            line, middle = int(self.path.line[arc.last]), arc.middle - arc.first
            side = plan.side[first - 1 : behind]
            if behind - first != arc.last - arc.first + 1 or (side != side[0]).any():
                raise stepped(line)
            k = int(np.searchsorted(rows, first))
            points, turned_ = np.array(places[k - 1 : k + behind - first]), turns[k - 1 : k + behind - first]
            bent = Bent(
                points, turned_, middle + 1, SHARE * limits.tolerance_mm, SHARE * limits.tolerance_rad
            )
            pieces = pieces_of(arc, bent, line)
            own.update(range(first, behind - 1))
            if not pieces:
                own.remove(first + middle)

            def part(chord: int, of: int, first: int = first, k: int = k) -> Part:
                return self._on_arc(first + chord, of, places[k + chord], turns[k + chord])

            for piece in pieces:
                edits += stated(self.program, arc, piece, part)
            self.tally.inserted_blocks += max(len(pieces) - 1, 0)
        return edits, own

    def _on_arc(self, row: int, of: int, place: Vector, turn: Quaternion) -> Part:
        """A point of an arc at a place in its frame, with the words of the target of move `of`."""
        use, unit = self.targets.uses[of], self._unit(of)
        assert use is not None
        target = self.targets.targets[use.target]
        x, y, z = (value / unit for value in place)
        (wanted,) = self._in_digits([_Aim(row, of, target, (x, y, z), turn)])
        name = self._new_name(target) if self.dialect.names_parts else ""
        a, b, c, *turned_ = wanted.texts
        return Part((a, b, c), 1.0, False, name, tuple(turned_), wanted.turns)

    def _target_of(self, row: int) -> Target:
        return self.targets.targets[self._use(row).target]

    def _use(self, row: int) -> Use:
        use = self.targets.uses[self.moves[row]]
        assert use is not None
        return use

    def _keep_branches(self, rows: Index) -> None:
        """Raises ProgramError where a corrected posture is of another branch than the programmed one."""
        plan, path = self.plan, self.path
        nominal, command = path.at(plan.move[rows], plan.share[rows]), plan.command[rows]
        before, after = (self.arm.branches(self.held.own(axes)) for axes in (nominal, command))
        other = ((before * after < 0.0) & (np.minimum(abs(before), abs(after)) > _BORDER)).any(axis=1)
        if other.any():
            raise ProgramError(
                "the corrected posture is on the other side of a singular one than the programmed one, so "
                "its configuration changes; move the target",
                line=int(path.line[plan.move[rows[int(np.argmax(other))]]]),
                code="OLP566",
            )

    # -- what is wanted ------------------------------------------------------------------------------

    def _in_frames(self, rows: Index, poses: Poses) -> tuple[list[Vector], list[Quaternion]]:
        """Where the tip is at poses of the end of the lever, and how it is turned, in the frames of rows.
        On a track poses and frames count from the carriage."""
        uses = [self._use(row) for row in rows.tolist()]
        frames = np.array([use.frame.turn for use in uses]).reshape(-1, 4)
        tools = np.array([(use.tool or Pose()).turn for use in uses]).reshape(-1, 4)
        origin = np.array([use.frame.origin_mm for use in uses]).reshape(-1, 3)
        back = frames * (1.0, -1.0, -1.0, -1.0)
        places = turned(matrices(back), poses.position - origin)
        turns = products(products(back, of_vectors(rotation_vector(poses.rotation))), tools)
        return places.tolist(), turns.tolist()

    def _aim(self, row: int, place: Vector, turn: Quaternion, *, shifted: bool) -> _Aim:
        """The pose of a target with which a row brings the tip to a place in its frame, turned so; without
        `shifted` that pose itself."""
        move, use = self.moves[row], self._use(row)
        target, shift = self.targets.targets[use.target], ZERO
        if shifted:
            if use.turn != target.turn:
                turn = multiplied(turn, multiplied(inverted(use.turn), target.turn))
            shift = use.shift_mm
            if use.along_tool:
                shift = rotated(turn, rotated(inverted(target.turn), shift))
        unit = self._unit(move)
        x, y, z = ((a - b) / unit for a, b in zip(place, shift, strict=True))
        return _Aim(row, move, target, (x, y, z), turn)

    def _unit(self, move: int) -> float:
        toolpath = self.program.toolpath
        return toolpath.frames[int(toolpath.frame[move])].unit_mm

    def _in_joints(self, rows: list[int]) -> dict[int, Wanted]:
        """What rows want of targets that state joints, by the rows."""
        if not rows:
            return {}
        targets = [self._target_of(row) for row in rows]
        axes = self.held.own(self.plan.command[rows])
        axes = self.arm.from_level(axes) if self.path.from_level else axes
        # motors go by whole steps
        unit = np.array(
            [
                1.0 / np.array(own.counts) if own.counts else [self.dialect.joint_unit_deg] * AXES
                for own in targets
            ]
        )
        fewest = np.array([0 if target.counts else self.dialect.joint_decimals for target in targets])
        stated = StatedNumbers.of(self.data, [(*own.numbers, *own.turned) for own in targets])
        wanted = axes[:, self.arm.columns] / unit
        off = np.full(wanted.shape, np.nan)
        return dict(zip(rows, stated.written(wanted, fewest[:, None], off, [()] * len(rows)), strict=True))

    def _in_digits(self, aims: list[_Aim]) -> list[Wanted]:
        """Numbers of targets as they are written: those that are right to their last digit keep their
        bytes."""
        if not aims:
            return []
        dialect = self.dialect
        stated = StatedNumbers.of(self.data, [(*aim.target.numbers, *aim.target.turned) for aim in aims])
        wanted = np.array(
            [
                (*aim.point, *dialect.turn_values(aim.turn, own))
                for aim, own in zip(aims, stated.values[:, _PLACE:].tolist(), strict=True)
            ]
        )
        off = np.full(wanted.shape, np.nan)
        off[:, _PLACE:] = [[angle_between(aim.turn, aim.target.turn) / dialect.turn_unit_rad] for aim in aims]
        fewest = np.full(wanted.shape[1], dialect.turn_decimals)
        fewest[:_PLACE] = dialect.decimals
        return stated.written(wanted, fewest, off, [self._turns(aim) for aim in aims])

    def _turns(self, aim: _Aim) -> tuple[bytes, ...]:
        if not aim.target.turns:
            return ()
        return self.dialect.turn_texts(
            self.program, aim.target, self.nominal[aim.move], self.commands[aim.row]
        )

    # -- edits ---------------------------------------------------------------------------------------

    def _target(self, target: Target, wants: list[tuple[int, Wanted]]) -> list[Replacement]:
        """New numbers of a target, and declarations of its own for each further group of moves."""
        groups: list[tuple[Wanted, list[int]]] = []
        known: dict[tuple[tuple[bytes, ...], tuple[bytes, ...]], list[int]] = {}
        for row, wanted in wants:
            key = wanted.texts, wanted.turns
            rows = known.get(key) or next(
                (rows for first, rows in groups[:_COMPARED] if first.right_for(wanted)), None
            )
            if rows is None:
                rows = known[key] = []
                groups.append((wanted, rows))
            rows.append(row)
        groups.sort(key=lambda group: -len(group[1]))
        edits: list[Replacement] = []
        if not target.held:
            edits = self._edited(target, groups.pop(0)[0])
            self.tally.changed_words += len(edits)
        for wanted, rows in groups:
            if not target.held or self._edited(target, wanted):
                edits += self._cloned(target, wanted, rows)
        return edits

    def _edited(self, target: Target, wanted: Wanted) -> list[Replacement]:
        spans = (*target.numbers, *target.turned, *target.turns)
        return [
            (a, b, text)
            for (a, b), text in zip(spans, (*wanted.texts, *wanted.turns), strict=True)
            if text != self.data[a:b]
        ]

    def _cloned(self, target: Target, wanted: Wanted, rows: list[int]) -> list[Replacement]:
        start = target.value[0]
        numbers = [(a - start, b - start, text) for a, b, text in self._edited(target, wanted)]
        name = self._new_name(target)
        text = spliced(self.data[slice(*target.value)], numbers)
        edits = [self.dialect.clone(self.program, target, name, text)]
        for row in rows:
            named = self._use(row).named
            assert named != NOWHERE
            edits.append((*named, name.encode()))
        self.tally.inserted_blocks += 1
        self.clones += 1
        return edits

    def _part(self, row: int, wanted: Wanted) -> list[Replacement]:
        """The statement of a part of a move before its end."""
        move, use = self.moves[row], self._use(row)
        target = self.targets.targets[use.target]
        x, y, z, *turned = wanted.texts
        share = float(self.plan.share[row])
        name = self._new_name(target) if self.dialect.names_parts else ""
        # a step that takes up backlash has to be reached
        along = self._along(row, target)
        part = Part((x, y, z), share, bool(self.stands[row]), name, tuple(turned), wanted.turns, along)
        self.tally.inserted_blocks += 1
        return self.dialect.part(self.program, move, use, part)

    def _along(self, row: int, target: Target) -> bytes:
        """Where the track is at the end of a part; empty where it stands."""
        if self.held.track is None or target.along == NOWHERE:
            return b""
        value = float(self.plan.command[row, self.held.column])
        stated = StatedNumbers.of(self.data, [[target.along]])
        fewest = np.array([self.dialect.decimals])
        (wanted,) = stated.written(np.array([[value]]), fewest, np.full((1, 1), np.nan), [()])
        (text,) = wanted.texts
        return b"" if text == self.data[slice(*target.along)] else text

    def _new_name(self, target: Target) -> str:
        """A name that the text does not have, made from that of a target."""
        if not self.names:
            self.names = {word.decode("latin-1").upper() for word in _NAMES.findall(self.data)}
        name = self.dialect.named(self.program, target, self.names)
        self.names.add(name.upper())
        self.made += 1
        return name
