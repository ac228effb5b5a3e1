"""Writes the plan of an arm into the targets of its program: positions and orientations in their own form.

A target whose moves want different numbers is declared again under another name, and each part of a move
states its own.
"""

from __future__ import annotations

import re

import numpy as np

from olp.compensation.joints.arm_path import ArmPath
from olp.compensation.joints.planning import JointLimits, JointPlan
from olp.compensation.joints.writer import WrittenJoints
from olp.compensation.tally import Tally
from olp.compensation.target_arcs import SHARE, pieces_of, stated, stepped
from olp.core.arrays import Array, Index
from olp.core.errors import ProgramError
from olp.core.machine import ZERO, Vector
from olp.core.spool import whole
from olp.core.values import dataclass
from olp.kinematics.carried import carried_arm
from olp.kinematics.poses import Poses, rotation_vector, turned
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
from olp.program.robots.targets import NOWHERE, Part, Span, Target, Use
from olp.program.text.numbers import MOST_DECIMALS, number, spliced, written

#: A number that is nearer to what is wanted than this share of its last digit is right.
_RIGHT = 0.5 + 1e-6
#: mm and rad by which a pose is off from computing alone
_COMPUTED = 1e-8
#: By decimals: the last digit, and how far it goes.
_DIGITS = tuple((10.0**-k, max(10.0**-k, _COMPUTED)) for k in range(MOST_DECIMALS + 1))
#: Numbers of a place.
_PLACE = 3
#: Groups of moves that a move is compared with, where none wants the very same digits.
_COMPARED = 8
#: A branch that is nearer to its border than this says nothing, mm or deg.
_BORDER = 1e-6
#: A number in the usual form, with its decimals.
_PLAIN = re.compile(rb"-?(?:0|[1-9]\d{0,6})(?:\.(\d{1,12}))?")
_NAMES = re.compile(rb"[A-Za-z_]\w*")


@dataclass(frozen=True, slots=True)
class _Wanted:
    """What a row wants of its target: `values` and how they are written (`texts`), how far a digit of each
    goes, and the numbers of axes' turns."""

    values: tuple[float, ...]
    digits: tuple[float, ...]
    texts: tuple[bytes, ...]
    turns: tuple[bytes, ...]

    def right_for(self, other: _Wanted) -> bool:
        """Whether the numbers are right for another row to their last digit."""
        near = all(
            abs(_value(text) - value) <= _RIGHT * digit
            for text, value, digit in zip(self.texts, other.values, self.digits, strict=True)
        )
        return near and self.turns == other.turns


def _value(text: bytes) -> float:
    """The value of a number; one that the text leaves out is zero."""
    return float(text or b"0")


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
        by_target: dict[int, list[tuple[int, _Wanted]]] = {}
        edits, own = self._arcs(rows, places, turns)
        for k, row in enumerate(rows.tolist()):
            if row in own:
                continue
            if in_joints[k]:
                wanted = self._wanted_joints(row)
            else:
                wanted = self._wanted(row, places[k], turns[k], shifted=bool(last[row]))
            if last[row]:
                by_target.setdefault(self._use(row).target, []).append((row, wanted))
            else:
                edits += self._part(row, wanted)
        for place, wants in by_target.items():
            edits += self._target(self.targets.targets[place], wants)
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
        numbers = (x, y, z, *self.dialect.turn_values(turn, self._numbers(target.turned)))
        wanted = self._in_digits(row, target, numbers, angle_between(turn, target.turn), of)
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

    def _wanted(self, row: int, place: Vector, turn: Quaternion, *, shifted: bool) -> _Wanted:
        """The numbers of a target with which a row brings the tip to a place in its frame, turned so; without
        `shifted` those of the pose itself."""
        move, use = self.moves[row], self._use(row)
        target, shift = self.targets.targets[use.target], ZERO
        if shifted:
            if use.turn != target.turn:
                turn = multiplied(turn, multiplied(inverted(use.turn), target.turn))
            shift = use.shift_mm
            if use.along_tool:
                shift = rotated(turn, rotated(inverted(target.turn), shift))
        unit = self._unit(move)
        point = [(a - b) / unit for a, b in zip(place, shift, strict=True)]
        numbers = (*point, *self.dialect.turn_values(turn, self._numbers(target.turned)))
        return self._in_digits(row, target, numbers, angle_between(turn, target.turn), move)

    def _numbers(self, spans: tuple[Span, ...]) -> list[float]:
        return [_value(self.data[a:b]) for a, b in spans]

    def _unit(self, move: int) -> float:
        toolpath = self.program.toolpath
        return toolpath.frames[int(toolpath.frame[move])].unit_mm

    def _wanted_joints(self, row: int) -> _Wanted:
        """The numbers of a target that states joints."""
        target = self._target_of(row)
        unit: Array | float = self.dialect.joint_unit_deg
        decimals = self.dialect.joint_decimals
        if target.counts:
            # motors go by whole steps
            unit, decimals = 1.0 / np.array(target.counts), 0
        axes = self.held.own(self.plan.command[row : row + 1])
        axes = self.arm.from_level(axes) if self.path.from_level else axes
        numbers = axes[0, self.arm.columns] / unit
        made = [
            self._written(span, value, decimals)
            for span, value in zip((*target.numbers, *target.turned), numbers.tolist(), strict=True)
        ]
        values, digits, texts = zip(*made, strict=True)
        return _Wanted(values, digits, texts, ())

    def _in_digits(
        self, row: int, target: Target, numbers: tuple[float, ...], turned_rad: float, move: int
    ) -> _Wanted:
        """Numbers as they are written: those that are right to their last digit keep their bytes. The words
        of the target are those of a move."""
        dialect, off = self.dialect, turned_rad / self.dialect.turn_unit_rad
        made = [
            self._written(span, value, dialect.decimals)
            for span, value in zip(target.numbers, numbers[:_PLACE], strict=True)
        ]
        made += [
            self._written(span, value, dialect.turn_decimals, off)
            for span, value in zip(target.turned, numbers[_PLACE:], strict=True)
        ]
        values, digits, texts = zip(*made, strict=True)
        return _Wanted(values, digits, texts, self._turns(row, target, move))

    def _written(
        self, span: Span, value: float, fewest: int, off: float | None = None
    ) -> tuple[float, float, bytes]:
        """The value of a number, its last digit, and how it is written in place of another one, which is
        `off` by so much."""
        text = self.data[span[0] : span[1]]
        plain, form = _PLAIN.fullmatch(text), None
        if plain is not None:
            own = len(plain[1] or b"")
        else:
            form = number(text)
            if form is None or form.letter:
                form = number(b"0.0")
            own = 0 if form is None else form.decimals
        decimals = min(max(fewest, own), MOST_DECIMALS)
        digit, least = _DIGITS[decimals]
        if (abs(_value(text) - value) if off is None else off) <= max(_RIGHT * digit, _COMPUTED):
            return _value(text), least, text
        if form is None and abs(value) > digit:
            return value, least, b"%.*f" % (decimals, value)
        form = form or number(text)
        assert form is not None
        return value, least, written(form, value, decimals)

    def _turns(self, row: int, target: Target, move: int) -> tuple[bytes, ...]:
        if not target.turns:
            return ()
        return self.dialect.turn_texts(self.program, target, self.nominal[move], self.commands[row])

    # -- edits ---------------------------------------------------------------------------------------

    def _target(self, target: Target, wants: list[tuple[int, _Wanted]]) -> list[Replacement]:
        """New numbers of a target, and declarations of its own for each further group of moves."""
        groups: list[tuple[_Wanted, list[int]]] = []
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

    def _edited(self, target: Target, wanted: _Wanted) -> list[Replacement]:
        spans = (*target.numbers, *target.turned, *target.turns)
        return [
            (a, b, text)
            for (a, b), text in zip(spans, (*wanted.texts, *wanted.turns), strict=True)
            if text != self.data[a:b]
        ]

    def _cloned(self, target: Target, wanted: _Wanted, rows: list[int]) -> list[Replacement]:
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

    def _part(self, row: int, wanted: _Wanted) -> list[Replacement]:
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
        text = self._written(target.along, value, self.dialect.decimals)[2]
        return b"" if text == self.data[slice(*target.along)] else text

    def _new_name(self, target: Target) -> str:
        """A name that the text does not have, made from that of a target."""
        if not self.names:
            self.names = {word.decode("latin-1").upper() for word in _NAMES.findall(self.data)}
        name = self.dialect.named(self.program, target, self.names)
        self.names.add(name.upper())
        self.made += 1
        return name
