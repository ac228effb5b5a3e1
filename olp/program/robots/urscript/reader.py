"""Reads URScript: lines to moves, and the poses whose numbers can be edited. Lengths are in metres.

A pose states the tool tip in the robot's base. The tool is that of `set_tcp`, or of machine and job.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from math import degrees

from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.core.patterns import pattern
from olp.program.dialect import Dialect, Options, Support
from olp.program.program import Program
from olp.program.robots.frames import Located, Tool
from olp.program.robots.moves import NAN, DecidedInRun, RobotMoves, take_all
from olp.program.robots.poses import NO_TURN, Pose, of_vector
from olp.program.robots.targets import NOWHERE, Span, Use
from olp.program.robots.urscript.calls import Calls
from olp.program.robots.urscript.named import ASSIGNED, ELEMENT, Names
from olp.program.robots.urscript.table import LEFT, TABLE
from olp.program.robots.urscript.text import Line, closed, lines_of
from olp.program.robots.urscript.tools import Tools
from olp.program.text.numbers import LARGEST

_N = rb"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*"
#: A pose with all its numbers, each a group.
POSE = pattern(rb"p\[" + b",".join([_N] * 6) + rb"\]")
#: Joint values likewise.
JOINTS = pattern(rb"\[" + b",".join([_N] * 6) + rb"\]")
_JOINTS = pattern(rb"\s*(?:\[[^\[\]]*\]|d2r\(.*\))\s*")
#: A pose that is reached near given joints.
_INVERSE = pattern(rb"\s*get_inverse_kin\((.*)\)\s*")
_NEAR = pattern(rb"\s*(?:qnear\s*=(?!=))?\s*(.*?)\s*")
_DEFINED = pattern(rb"(?m)^[ \t]*(?:def|thread)[ \t]+(\w+)")
#: Words of moves, which a line that begins a block must not have.
_MOVING = pattern(rb"\b(?:opti)?(?:move|servo|speed)[jlpc]\b")
_CALL = pattern(rb"\s*([A-Za-z_]\w*)\s*\((.*)\)\s*")
_NAME = pattern(rb"\s*([A-Za-z_]\w*)\s*")
_ARGUMENT = pattern(rb"(?:[^,\[\]()]|\[[^\[\]]*\]|\((?:[^()]|\([^()]*\))*\))+")
_NAMED = pattern(rb"\s*([atvr]|mode)\s*=(?!=)\s*(.*?)\s*")
#: Statements that are read as calls.
_ALONE = (b"movel", b"movep", b"movej", b"movec", b"set_tcp")
#: Words of moves behind their targets, in their order, where that is not the usual one.
_ORDERS = {b"movep": ("a", "v", "r"), b"movec": ("a", "v", "r", "mode")}
_NUMBER = pattern(rb"\s*([-+]?(?:\d+\.?\d*|\.\d+))\s*")
_TRANSFORMED = pattern(rb"\s*pose_trans\((.*)\)\s*")
_ADDED = pattern(rb"\s*pose_add\((.*)\)\s*")
_WORDS = pattern(rb"[A-Za-z_]\w*")
#: In metres, as lengths of the language are.
_MM_PER_M = 1000.0


def _states(value: bytes) -> bool:
    """Whether a value is a pose or joints with numbers."""
    return POSE.fullmatch(value) is not None or JOINTS.fullmatch(value) is not None


def _within(begin: int, text: bytes) -> Span:
    """The bytes of a text from byte `begin` on, without blanks around it."""
    return begin + len(text) - len(text.lstrip()), begin + len(text.rstrip())


def read(
    data: bytes, setup: Setup, dialect: Dialect, options: Options | None = None, *, words: bool = True
) -> Program:
    """Read a whole program. Raises ProgramError with the line of the first statement that cannot be read
    correctly."""
    return _Reader(data, setup).run(dialect, options or Options(), words=words)


class _Reader:
    """Reads one program."""

    def __init__(self, data: bytes, setup: Setup) -> None:
        self.data, self.setup = data, setup
        self.moves = RobotMoves(data, setup, "base", _MM_PER_M)
        self.targets: dict[Span, int] = {}
        #: frames by their text, and by the bytes of the pose where that is a name
        self.frames: dict[tuple[bytes, Span | None], Located] = {}
        #: joints near which poses are reached by a movej, by the places of these
        self.near: dict[int, tuple[float, ...]] = {}
        #: functions of the text
        self.defined = set(_DEFINED.findall(data))
        self.blocks: list[tuple[bytes, int]] = []
        self.refusals: list[ProgramError] = []

    def run(self, dialect: Dialect, options: Options, *, words: bool) -> Program:
        every = [line for line in lines_of(self.data) if line.text.strip()]
        self.calls = Calls(every)
        self.names = Names(every, _states, self.calls.recursive)
        given = [match for line in every if (match := ASSIGNED.fullmatch(line.text)) is not None]
        self.joints = {match[2] for match in given if match[3][:1] == b"["}
        self.tools = Tools(every, lambda text: self._tcp(text, anywhere=True))
        take_all(every, self._statement, self.moves, self.refusals, options)
        self.moves.hold_mentioned(self._statements(every))
        return self.moves.program(dialect, words=words)

    def _statements(self, every: list[Line]) -> Iterator[Span]:
        """The bytes of all lines but those that state poses with a name."""
        stated = set(self.names.lines)
        for line in every:
            if line.line not in stated:
                yield line.begin, line.begin + len(line.text)

    # -- statements ----------------------------------------------------------------------------------

    def _statement(self, line: Line) -> None:
        text = line.text.strip()
        if text[:1] == b"$":
            # the number of a node in the tree of the pendant
            return
        first = _WORDS.match(text)
        word = b"" if first is None else first[0]
        if text.count(b"(") != text.count(b")") or text.count(b"[") != text.count(b"]"):
            raise ProgramError("a bracket is not closed in this line", line=line.line, code="OLP510")
        if word in (b"def", b"thread", b"if", b"while", b"for", b"elif", b"else", b"end"):
            if _MOVING.search(text):
                raise ProgramError(
                    "a move in the line of a block; write it in a line of its own",
                    line=line.line,
                    code="OLP512",
                )
            self._block(line, word)
            return
        match, element = ASSIGNED.fullmatch(text), ELEMENT.match(text)
        self.names.assigned(line)
        call = _CALL.fullmatch(text)
        row = TABLE.get(word)
        if word in LEFT:
            raise DecidedInRun(f"{word.decode()} {LEFT[word]}", line=line.line, code="OLP512")
        if row is not None and row[0] is Support.REFUSED:
            raise ProgramError(f"{word.decode()} {row[1]}", line=line.line, code="OLP512")
        if word in _ALONE and (call is None or closed(text) < len(text)):
            what = "something else stands in the line of this statement; write it in a line of its own"
            raise ProgramError(what, line=line.line, code="OLP510")
        if call is not None and word in (b"movel", b"movep", b"movej"):
            self._move(line, call)
        elif call is not None and word == b"movec":
            self._arc(line, call)
        elif call is not None and word == b"set_tcp":
            self.tools.set(line, self._tcp(call[2]))
        elif match is not None:
            self._value(line, match[3])
        elif element is not None:
            self._value(line, text[element.end() :])
        elif row is None or row[0] is not Support.UNCHANGED or self.calls.may_move(text):
            self._call(line)

    def _value(self, line: Line, value: bytes) -> None:
        """A value that a function gives may come with moves."""
        moving = _MOVING.search(value)
        if moving is not None:
            what = f"{moving[0].decode()} in a value is not read; write the move in a line of its own"
            raise DecidedInRun(what, line=line.line, code="OLP512")
        if b"(" in value:
            self._call(line)

    def _call(self, line: Line) -> None:
        """A statement that calls functions, or whose word is not known."""
        self.tools.called(line.text)
        if self.calls.still(line.text):
            return
        name = _WORDS.search(line.text)
        if name is None or name[0] not in self.defined:
            shown = line.text.strip()[:40].decode("latin-1")
            what = f"`{shown}` may move: the next move is corrected at its end"
            self.moves.remark("called", line.line, what)
        if name is not None and name[0] == b"force_mode":
            what = "from here on forces lead the robot along some axes, which no target states"
            self.moves.remark("force", line.line, what)
        self.moves.known = False

    def _block(self, line: Line, word: bytes) -> None:
        if word not in (b"def", b"thread") and self.defined & set(_WORDS.findall(line.text)):
            self.tools.called(line.text)
            self.moves.known &= not self.calls.own_may_move(line.text)
        self.tools.block(line, word)
        self.names.block(line, word)
        if word in (b"elif", b"else", b"end"):
            moved = bool(self.blocks) and self.blocks[-1][1] != self.moves.count
            kind = self.blocks[-1][0] if self.blocks else b""
            if word == b"end" and self.blocks:
                self.blocks.pop()
            if moved or kind in (b"def", b"thread"):
                self.moves.known = False
        else:
            self.blocks.append((word, self.moves.count))
            if word in (b"def", b"thread"):
                self.moves.known = False

    def _tcp(self, text: bytes, *, anywhere: bool = False) -> Pose | None:
        """The pose that the words of a `set_tcp` state, here or `anywhere`; None where they state none with
        numbers."""
        first = _ARGUMENT.match(text)
        return None if first is None else self._pose(first[0], anywhere=anywhere)

    # -- moves ---------------------------------------------------------------------------------------

    def _move(self, line: Line, call: re.Match[bytes]) -> None:
        lead = len(line.text) - len(line.text.lstrip())
        start = line.begin + lead
        place = start + call.start(2)
        arguments = [(place + m.start(), m[0]) for m in _ARGUMENT.finditer(call[2])]
        if not arguments:
            raise ProgramError("the move has no target", line=line.line, code="OLP516")
        begin, target = arguments[0]
        inverse = _INVERSE.fullmatch(target) if call[1] == b"movej" else None
        near: tuple[float, ...] = ()
        if inverse is not None:
            parts = list(_ARGUMENT.finditer(inverse[1]))
            near = self._near(line, target, [part[0] for part in parts[1:]])
            begin, target = begin + inverse.start(1) + parts[0].start(), parts[0][0]
        in_joints = _JOINTS.fullmatch(target) is not None or self._is_joints(target)
        rest = self._rest(call[1], arguments[1:])
        timed = "t" in rest and self._number(rest["t"]) != 0.0
        feed = _MM_PER_M * (self._number(rest["v"]) if "v" in rest else NAN)
        if in_joints:
            self._begins_in_loop()
            statement, straight = (start, line.begin + len(line.text)), call[1] != b"movej"
            self.moves.joint_move(
                line.line, lambda: self._joints(line, begin, target, statement, rest), straight=straight,
                tool=self._tool(line) if straight and self.moves.arm else None,
                feed=feed if straight else NAN, whole=timed,
            )  # fmt: skip
            return
        use, frame = self._use(line, start, begin, target, rest.get("r", NOWHERE))
        if call[1] == b"movej":
            self._reached_near(line, use.target, near)
        self._begins_in_loop()
        self.moves.move(
            line.line, use, frame, self._tool(line), feed, straight=call[1] != b"movej", whole=timed
        )

    def _near(self, line: Line, target: bytes, given: list[bytes]) -> tuple[float, ...]:
        """The joints in degrees near which a pose is reached; none where the robot is. Raises ProgramError
        where an arm needs them, and the text does not state them."""
        match = _NEAR.fullmatch(given[0]) if given else None
        named = None if match is None else self.names.get(match[1])
        value = b"" if match is None else match[1]
        stated = JOINTS.fullmatch(value if named is None else self.data[slice(*named.value)])
        if len(given) > 1 or (given and stated is None and self.moves.arm):
            raise self._computed(line, target)
        return () if stated is None else tuple(degrees(float(group)) for group in stated.groups())

    def _reached_near(self, line: Line, index: int, near: tuple[float, ...]) -> None:
        """Raises ProgramError where a pose is reached near other joints by another move."""
        if self.moves.arm and self.near.setdefault(index, near) != near:
            raise DecidedInRun(
                "this pose is reached near other joints by another movej; give each its own",
                line=line.line,
                code="OLP533",
            )
        self.moves.targets[index] = replace(self.moves.targets[index], config=near)

    def _arc(self, line: Line, call: re.Match[bytes]) -> None:
        """An arc through a pose to another one."""
        start = line.begin + len(line.text) - len(line.text.lstrip())
        place = start + call.start(2)
        arguments = [(place + m.start(), m[0]) for m in _ARGUMENT.finditer(call[2])]
        if len(arguments) < 2:
            raise ProgramError("the arc lacks its via point or its end", line=line.line, code="OLP516")
        if any(_JOINTS.fullmatch(text) or self._is_joints(text) for _, text in arguments[:2]):
            what = "joints in a movec are not read; write the pose"
            raise DecidedInRun(what, line=line.line, code="OLP533")
        rest = self._rest(call[1], arguments[2:])
        if "mode" in rest and self._number(rest["mode"]) != 0.0:
            raise DecidedInRun(
                "mode 1 of movec turns the tool along with the arc, which is not read; write mode 0",
                line=line.line,
                code="OLP512",
            )
        zone = rest.get("r", NOWHERE)
        (via, frame), (end, other) = (self._use(line, start, *each, zone) for each in arguments[:2])
        if frame.name != other.name:
            what = "via point and end of this arc are in different frames"
            raise DecidedInRun(what, line=line.line, code="OLP512")
        speed = self._number(rest["v"]) if "v" in rest else NAN
        self._begins_in_loop()
        self.moves.arc(line.line, via, end, frame, self._tool(line), speed * _MM_PER_M)

    def _begins_in_loop(self) -> None:
        """The first move in a loop begins where the last one ends, or before the loop."""
        if any(loop in (b"while", b"for") and before == self.moves.count for loop, before in self.blocks):
            self.moves.known = False

    def _joints(
        self, line: Line, begin: int, text: bytes, statement: Span, rest: dict[str, Span]
    ) -> Use | None:
        """How a move uses joint values, in rad; None where the text does not state them with numbers."""
        named, blank = self.names.get(text), len(text) - len(text.lstrip())
        span = (begin + blank, begin + len(text.rstrip()))
        match = JOINTS.fullmatch(self.data, *(span if named is None else named.value))
        if match is None:
            return None
        key = match.span()
        if key not in self.targets:
            a, b, c, d, e, f = (degrees(float(group)) for group in match.groups())
            self.targets[key] = self.moves.joint_target(
                line.line if named is None else named.line, key, [match.span(k) for k in range(1, 7)],
                (a, b, c, d, e, f), (), "" if named is None else text.strip().decode("latin-1"),
                NOWHERE if named is None else named.statement,
            )  # fmt: skip
        place = NOWHERE if named is None else span
        return Use(self.targets[key], statement, span, place, zone=rest.get("r", NOWHERE))

    def _rest(self, name: bytes, arguments: list[tuple[int, bytes]]) -> dict[str, Span]:
        """The bytes of acceleration, speed, time and radius of a move, by their names."""
        order = _ORDERS.get(name, ("a", "v", "t", "r"))
        found: dict[str, Span] = {}
        for (begin, text), usual in zip(arguments, order, strict=False):
            match = _NAMED.fullmatch(text)
            key = usual if match is None else match[1].decode()
            first, last = (0, len(text)) if match is None else match.span(2)
            found[key] = (begin + first, begin + last)
        return found

    def _number(self, span: Span) -> float:
        match = _NUMBER.fullmatch(self.data, *span)
        return NAN if match is None else float(match[1])

    def _is_joints(self, text: bytes) -> bool:
        """Whether a name stands for joint values with numbers."""
        return text.strip() in self.joints

    def _use(self, line: Line, start: int, begin: int, text: bytes, zone: Span) -> tuple[Use, Located]:
        """How a move, which begins at byte `start`, uses the target that is the text from byte `begin` on.
        Also the frame that this is in."""
        frame, stated = self.moves.frames.world, _TRANSFORMED.fullmatch(text)
        if stated is not None:
            parts = list(_ARGUMENT.finditer(stated[1]))
            located = self._frame(line, parts[0][0]) if len(parts) == 2 else None
            if located is None:
                raise self._computed(line, text)
            frame = located
            begin, text = begin + stated.start(1) + parts[1].start(), parts[1][0]
        place, added = _within(begin, text), Pose()
        offsets: tuple[Span, ...] = ()
        sum_ = _ADDED.fullmatch(text)
        if sum_ is not None:
            parts = list(_ARGUMENT.finditer(sum_[1]))
            behind = None if len(parts) != 2 else self._pose(parts[1][0])
            if behind is None or behind.turn != NO_TURN:
                raise self._computed(line, text)
            first = begin + sum_.start(1)
            numbers = POSE.fullmatch(self.data, *_within(first + parts[1].start(), parts[1][0]))
            added, offsets = behind, () if numbers is None else tuple(map(numbers.span, (1, 2, 3)))
            begin, text = first + parts[0].start(), parts[0][0]
        index, named = self._target(line, begin, text)
        use = Use(
            index, (start, line.begin + len(line.text)), place, named, added.origin_mm,
            self.moves.targets[index].turn, zone=zone, offsets=offsets,
        )  # fmt: skip
        return use, frame

    def _target(self, line: Line, begin: int, text: bytes) -> tuple[int, Span]:
        """The place of a target, and the bytes of its name."""
        span, named = _within(begin, text), self.names.get(text)
        match = POSE.fullmatch(self.data, *(span if named is None else named.value))
        if match is None:
            raise self._computed(line, text)
        key = match.span()
        if key not in self.targets:
            numbers = [float(group) for group in match.groups()]
            if max(map(abs, numbers)) * _MM_PER_M >= LARGEST:
                raise ProgramError("a number is larger than a machine", line=line.line, code="OLP516")
            name = "" if named is None else text.strip().decode("latin-1")
            self.targets[key] = self.moves.target(
                line.line if named is None else named.line, key,
                (match.span(1), match.span(2), match.span(3)), (numbers[0], numbers[1], numbers[2]),
                of_vector(numbers[3:]), (), name, NOWHERE if named is None else named.statement,
                (match.span(4), match.span(5), match.span(6)),
            )  # fmt: skip
        return self.targets[key], NOWHERE if named is None else span

    def _frame(self, line: Line, text: bytes) -> Located | None:
        """The frame that a pose, or the name of one, is; None where there is none with numbers."""
        named = self.names.get(text)
        key = text, None if named is None else named.value
        if key not in self.frames:
            pose, name = self._pose(text), b"".join(text.split()).decode("latin-1")
            if pose is None:
                return None
            self.frames[key] = self.moves.frames.located(f"pose_trans {name}", pose, line.line)
        return self.frames[key]

    def _computed(self, line: Line, text: bytes) -> DecidedInRun:
        shown = text.strip()[:60].decode("latin-1")
        return DecidedInRun(
            f"the target `{shown}` is computed, or gets several values; program it with its numbers",
            line=line.line,
            code="OLP533",
        )

    def _pose(self, text: bytes, *, anywhere: bool = False) -> Pose | None:
        """A pose with numbers, or that of a name, here or `anywhere`; None where there is none. One that is a
        frame or a tool keeps its numbers."""
        named = self.names.get(text, anywhere=anywhere)
        if named is not None:
            self.moves.hold([text.strip().decode("latin-1")])
        value = text.strip() if named is None else self.data[slice(*named.value)]
        match = POSE.fullmatch(value)
        if match is None:
            return None
        x, y, z, *turn = (float(group) for group in match.groups())
        return Pose((x * _MM_PER_M, y * _MM_PER_M, z * _MM_PER_M), of_vector(turn))

    def _tool(self, line: Line) -> Tool:
        """The tool of a move: that of `set_tcp`, else the one of machine or job."""
        if self.tools.tool is not None:
            return self.tools.tool
        if self.tools.why:
            raise DecidedInRun(
                f"the tool of this move is not stated: {self.tools.why}; call set_tcp in the function of the "
                "move, before it",
                line=line.line,
                code="OLP521",
            )
        number = self.setup.machine.default_tool
        if not number:
            raise ProgramError(
                "no set_tcp states the tool; state it, or the tool of the installation with "
                "job_defaults.tool in the machine file",
                line=line.line,
                code="OLP521",
            )
        return self.moves.frames.numbered_tool("tcp", number, None, line.line)
