"""Reads KRL: moves, and the positions whose numbers can be edited.

A move goes in the base and with the tool that are in force, so these are followed through the text. Where
they depend on the run, a move is refused.
"""

from __future__ import annotations

import re

from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.core.paired import own_end
from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.dialect import Dialect, Options
from olp.program.program import Program
from olp.program.robots.frames import Located
from olp.program.robots.krl import flow
from olp.program.robots.krl.active import Active, State
from olp.program.robots.krl.data import Declared, assigned, declares, key_of, pose_of
from olp.program.robots.krl.text import SIX, STATUS, TURN, Aggregate, Line, lines, parts
from olp.program.robots.krl.turning import Turning
from olp.program.robots.krl.words import words_of
from olp.program.robots.moves import DecidedInRun, RobotMoves, not_read, take_all
from olp.program.robots.poses import Pose, multiplied, rotated
from olp.program.robots.targets import ABSENT, NOWHERE, Span, Use

_MOVE = pattern(rb"(?i)(S?(?:LIN|PTP|CIRC))\s*(?=[\s{])(.*)")
_DISTANCE = pattern(rb"(?i)(S?(?:LIN|PTP|CIRC)_REL)\b")
_OTHER_MOVE = pattern(rb"(?i)(SPLINE|SPL|ASYPTP)\b")
#: An argument of an arc, up to its comma.
_ARGUMENT = pattern(rb"(?:\{[^{}]*\}|\[[^\]]*\]|[^{}\[\],])+")
_ANGLE = pattern(rb"(?i)\s*CA\b.*")
_ACTUAL = pattern(rb"(?i)\$(?:POS_ACT|AXIS_ACT)")
_HOME = pattern(rb"XHOME\d*")
_NAME = pattern(rb"([A-Za-z_]\w*)\s*(?:\[\s*([^\]]*?)\s*\])?")
_SENSOR = pattern(rb"(?i)(RSI_MOVECORR|RSI_ON)\b")
_TRIGGER = pattern(rb"(?i)(?:TRIGGER|SYN\s+(?:OUT|PULSE))\b")
_DATA_OF = pattern(rb"(?i)(?:GLOBAL\s+)?DEFDAT\s+(\w+)")
_LEADS = pattern(
    rb"(?i)(?:GOTO|EXIT|RETURN|HALT|CONTINUE|WAIT|INTERRUPT|BRAKE|RESUME|ANIN|ANOUT|DIGIN|ENDSPLINE|"
    rb"ON_ERROR_PROCEED)\b"
)


@dataclass(frozen=True, slots=True)
class _Stated:
    """A position: its numbers, the `line` that states them, and its name with its index; None where they
    stand in the move."""

    line: Line
    numbers: Aggregate
    name: re.Match[bytes] | None


@dataclass(slots=True)
class _Block:
    """An open block: whether it is a loop, the moves before it, what is in force at its begin, and at the
    ends of its branches. `whole`: one of its branches runs in any case."""

    loop: bool
    moves: int
    begin: State
    ends: list[State]
    whole: bool = False


def read(
    data: bytes, setup: Setup, dialect: Dialect, options: Options | None = None, *, words: bool = True
) -> Program:
    """Read a whole program. Raises ProgramError with the line of the first statement that cannot be read
    correctly."""
    return _Reader(data, setup).run(dialect, options or Options(), words=words)


class _Reader:
    """Reads one program."""

    def __init__(self, data: bytes, setup: Setup) -> None:
        self.data = data
        self.moves = RobotMoves(data, setup, "BASE0")
        every, end = list(lines(data)), own_end(data)
        self.declared = Declared(data, every)
        self.lines = [line for line in every if line.begin < end]
        self.flow = flow.Flow(self.lines)
        self.active = Active(data, setup, self.declared, self.moves.frames, self.moves.remark)
        self.turning = Turning(self.lines)
        self.blocks: list[_Block] = []
        #: whether a routine has begun
        self.begun = False
        self.targets: dict[Span, int] = {}
        self.bases: dict[tuple[str, str], Located] = {}
        self.listed = self.triggered = False
        self.refusals: list[ProgramError] = []

    def run(self, dialect: Dialect, options: Options, *, words: bool) -> Program:
        for line in self.lines:
            self._mentioned(line)
        take_all(self.lines, self._statement, self.moves, self.refusals, options)
        self.moves.hold(self.active.named)
        self._taken()
        self.moves.hold_mentioned((line.begin, line.end) for line in self.lines if not declares(line))
        return self.moves.program(dialect, words=words)

    def _taken(self) -> None:
        """Tools and bases of the control's own data, which stay as they are."""
        for name, (line, place) in self.declared.taken.items():
            self.moves.remark(f"taken: {name}", line, f"{name} is taken as in {place}")
        self.moves.hold(self.declared.taken)

    def _mentioned(self, line: Line) -> None:
        """A routine may give its arguments other values, and its parameters hide data of the same name."""
        if flow.routine_of(line):
            changed = [name for name, _ in flow.parameters_of(line)]
        else:
            changed = [] if line.word == b"BAS" or declares(line) else self.flow.changed_in(line.text)
        for name in changed:
            self.declared.change(name, line.line)

    # -- statements ----------------------------------------------------------------------------------

    def _statement(self, line: Line) -> None:
        text = line.text
        block = flow.block_of(line)
        if block is not None:
            self.turning.forget()
            self._block(block.lastgroup or "", line)
            return
        if self.listed or declares(line):
            return
        self.turning.take(line)
        move = _MOVE.fullmatch(text) if line.word in flow.PATHS else None
        if move is not None:
            try:
                self._move(line, move[1].upper(), line.begin + move.start(2))
            finally:
                self.triggered = False
            return
        distance = _DISTANCE.match(text)
        if distance is not None:
            what = f"{distance[1].decode().upper()} goes a distance from where the robot is"
            raise DecidedInRun(what, line=line.line, code="OLP533")
        other = _OTHER_MOVE.match(text)
        if other is not None:
            what = f"{other[1].decode().upper()} is not read; post straight moves to positions"
            raise not_read(what, line.line)
        if _SENSOR.match(text):
            raise not_read("targets are moved by what a sensor says", line.line)
        if _TRIGGER.match(text):
            self.triggered = True
        elif self.active.take(line) or _LEADS.match(text) or assigned(text) is not None or b"(" in text:
            self._calls(line)
        else:
            shown = text[:60].decode("latin-1")
            raise ProgramError(f"`{shown}` is not a statement of KRL", line=line.line, code="OLP510")

    def _calls(self, line: Line) -> None:
        """Routines that a statement calls, and what they may do."""
        for name in flow.calls_in(line.text):
            if name == b"BAS":
                continue
            self.turning.forget()
            if self.flow.moves(name):
                self.moves.known = False
            if self.flow.may_set(name):
                shown = name.decode("latin-1")
                self.active.forget(f"{shown} in line {line.line} may set it")
            if not self.flow.known(name):
                what = f"{name.decode('latin-1')} is in another file: correct that too"
                self.moves.remark("called", line.line, what)

    def _block(self, kind: str, line: Line) -> None:
        """Where the flow of the program parts and meets."""
        if kind == "data":
            self.listed = line.text.upper().find(b"DEFDAT") >= 0
            self._module(line)
        elif kind in ("routine", "last"):
            self.blocks = []
            self.moves.known = False
            why = "this routine does not set it" if self.flow.sets else ""
            self.active.forget(why, begun=self.begun)
            self.begun = True
        elif kind == "label":
            self.moves.known = False
            if self.flow.sets:
                self.active.forget(f"moves jump to line {line.line}")
        elif kind in ("if", "loop"):
            self._calls(line)
            if self.flow.sets_in_loop(line.line):
                self.active.forget(f"the loop of line {line.line} sets it")
            self.blocks.append(_Block(kind == "loop", self.moves.count, self.active.state, []))
        elif self.blocks:
            self._branch(kind, line)

    def _module(self, line: Line) -> None:
        """Raises ProgramError where a list of data is that of another module."""
        names = (flow.routine_of(every) for every in self.lines)
        data, own = _DATA_OF.match(line.text), next((name for name in names if name), b"")
        if data is not None and own and data[1].upper() != own:
            raise ProgramError(
                f"the data are those of {data[1].decode('latin-1')}, and the program is "
                f"{own.decode('latin-1')}; give the two files of one module",
                line=line.line,
                code="OLP533",
            )

    def _branch(self, kind: str, line: Line) -> None:
        block = self.blocks[-1]
        if block.moves != self.moves.count:
            self.moves.known = False
        block.ends.append(self.active.state)
        if kind == "else":
            block.whole |= not line.text.upper().startswith(b"CASE")
            self.active.state = block.begin
            return
        self._calls(line)
        self.blocks.pop()
        ends = {(state.base, state.tool, state.still) for state in block.ends}
        if not (block.whole or line.text.upper().startswith((b"UNTIL", b"ENDLOOP"))):
            ends.add((block.begin.base, block.begin.tool, block.begin.still))
        if len(ends) > 1:
            self.active.forget(f"the branches up to line {line.line} set it differently")

    # -- moves ---------------------------------------------------------------------------------------

    def _move(self, line: Line, word: bytes, begin: int) -> None:
        words = words_of(self.data, begin, line)
        target, terms = words.target, words.terms
        if _ACTUAL.fullmatch(self.data, *target):
            return
        if self.blocks and any(block.loop and block.moves == self.moves.count for block in self.blocks):
            # the first move in a loop begins where the last one ends, or before the loop
            self.moves.known = False
        arc, state = word.endswith(b"CIRC"), self.active.state
        within = self.data[slice(*words.within)] if words.within != NOWHERE else b""
        if self.moves.arm and (arc or word.endswith(b"LIN")):
            self.turning.check(within, line)
        if words.within != NOWHERE:
            state = self.active.within(within, words.within[0], line)
        if arc:
            self._arc(line, target, state, words.zone, by_via=word == b"SCIRC")
            return
        stated = self._stated(terms[0], line) if len(terms) == 1 else None
        home = self._home(terms) if stated is None else ""
        if home or (stated is not None and stated.numbers.joints):
            self.moves.joint_move(
                line.line, lambda: self._joints(terms[0], stated, words.zone, line),
                stands=self._stands(home, line),
            )  # fmt: skip
            return
        base = self.active.base(state, line.line)
        use, frame = self._use(line, target, terms, stated, base, words.zone)
        tool = self.active.tool(state, line.line)
        self.moves.move(
            line.line, use, frame, tool, self.active.feed, straight=word.endswith(b"LIN"),
            whole=self.triggered,
        )  # fmt: skip

    def _arc(self, line: Line, span: Span, state: State, zone: Span, *, by_via: bool) -> None:
        """An arc through a position to another one."""
        stated = list(_ARGUMENT.finditer(self.data, *span))
        if len(stated) > 2 and _ANGLE.fullmatch(stated[2][0]):
            what = "CA ends this arc by its angle, elsewhere than its end says; program the end"
            raise not_read(what, line.line)
        if len(stated) != 2:
            raise ProgramError(
                f"the arc has {len(stated)} positions; expected its via point and its end",
                line=line.line,
                code="OLP516",
            )
        self.turning.check_arc(line)
        base, uses = self.active.base(state, line.line), []
        for match in stated:
            begin = match.start() + len(match[0]) - len(match[0].lstrip())
            own = begin, begin + len(match[0].strip())
            uses.append(self._use(line, own, parts(self.data, own), None, base, zone))
        (via, frame), (end, other) = uses
        if frame.name != other.name:
            raise not_read("via point and end of this arc are in different frames", line.line)
        tool = self.active.tool(state, line.line)
        self.moves.arc(
            line.line, via, end, frame, tool, self.active.feed, whole=self.triggered, turned_by_via=by_via
        )

    def _stated(self, span: Span, line: Line) -> _Stated | None:
        """The position that a term is; None where the text states none. Raises ProgramError where its numbers
        depend on the run."""
        numbers = self.declared.aggregate(span)
        if numbers is not None:
            return _Stated(line, numbers, None)
        name = _NAME.fullmatch(self.data, *span)
        if name is None or key_of(name[1], name[2]) not in self.declared.values:
            return None
        return _Stated(*self._position(name[1], name[2], line), name)

    def _home(self, terms: list[Span]) -> str:
        """The name of the home position to which a move goes, whose joints the control knows; else empty."""
        name = _NAME.fullmatch(self.data, *terms[0]) if len(terms) == 1 else None
        key = "" if name is None else key_of(name[1], name[2])
        known = {stated.upper() for stated in self.moves.setup.job.joint_targets}
        return key if key in known or _HOME.fullmatch(key.encode("latin-1")) else ""

    def _stands(self, home: str, line: Line) -> tuple[float, ...]:
        """The joint values of a home position, of the control's own data or of the job; none where neither
        states them."""
        own = self.declared.system_value(home, line.line) if home else None
        joints = () if own is None or not (own.joints and own.whole) else own.numbers[SIX]
        return self.moves.stated_joints(home, joints, line.line)

    def _joints(self, span: Span, stated: _Stated | None, zone: Span, line: Line) -> Use | None:
        """How a move uses joint values; None where the text does not state all six."""
        if stated is None or not stated.numbers.whole:
            return None
        numbers, name = stated.numbers, stated.name
        if numbers.span not in self.targets:
            a, b, c, d, e, f = numbers.numbers[SIX]
            self.targets[numbers.span] = self.moves.joint_target(
                stated.line.line, numbers.span, numbers.spans[SIX], (a, b, c, d, e, f),
                numbers.outer(ABSENT), "" if name is None else name[1].decode("latin-1"),
                NOWHERE if name is None else (stated.line.begin, stated.line.end),
            )  # fmt: skip
        named = NOWHERE if name is None else span
        return Use(self.targets[numbers.span], (line.begin, line.end), span, named, zone=zone)

    def _use(
        self, line: Line, span: Span, terms: list[Span], stated: _Stated | None, base: Located, zone: Span
    ) -> tuple[Use, Located]:
        """How a move uses its target, and the frame that this is in. In a product the last term with a name
        is the target; numbers behind it are a shift in it. A single term is `stated`, where the text states
        it."""
        statement = (line.begin, line.end)
        last = self.declared.aggregate(terms[-1]) if len(terms) > 1 else None
        shift = Pose() if last is None else pose_of(last, line.line)
        own = terms[-1] if last is None else terms[-2]
        frame = self._frame(base, terms[: terms.index(own)], line)
        index, named = self._target(own, stated or self._known(own, line), line)
        turn, place = self.moves.targets[index].turn, (own[0], span[1])
        if last is None:
            return Use(index, statement, place, named, turn=turn, zone=zone), frame
        x, y, z = last.spans[:3]
        use = Use(
            index, statement, place, named, rotated(turn, shift.origin_mm), multiplied(turn, shift.turn),
            zone=zone, offsets=(x, y, z), offset_turn=turn, along_tool=True,
        )  # fmt: skip
        return use, frame

    def _frame(self, base: Located, terms: list[Span], line: Line) -> Located:
        """The base, with the frames that stand before a target."""
        if not terms:
            return base
        text = self.data[terms[0][0] : terms[-1][1]].decode("latin-1")
        key = base.name, text
        if key not in self.bases:
            pose = Pose()
            for term in terms:
                pose = pose.then(self._pose(term, line))
            self.bases[key] = base.holding(f"{base.name} : {text}", pose)
        return self.bases[key]

    def _pose(self, span: Span, line: Line) -> Pose:
        numbers = self.declared.aggregate(span)
        name = _NAME.fullmatch(self.data, *span)
        if numbers is None and name is not None:
            numbers = self._position(name[1], name[2], line)[1]
            self.moves.hold([name[1].decode("latin-1")])
        if numbers is None:
            raise self._computed(span, line)
        return pose_of(numbers, line.line)

    def _position(self, name: bytes, index: bytes | None, line: Line) -> tuple[Line, Aggregate]:
        """A position with a name. Raises ProgramError where the text does not state it with its numbers."""
        key = key_of(name, index)
        if index is not None and not index.strip().isdigit():
            raise DecidedInRun(
                f"the position {key} is chosen in the run; program it with its number",
                line=line.line,
                code="OLP533",
            )
        found = self.declared.value(key, line.line, "the position")
        if found is None:
            raise DecidedInRun(
                f"the position {key} is not stated in this text; give the .dat file beside it, or declare it "
                "with its numbers",
                line=line.line,
                code="OLP533",
            )
        return found[0].line, found[1]

    def _known(self, span: Span, line: Line) -> _Stated:
        """The position that a term is. Raises ProgramError where the text does not state it."""
        stated = self._stated(span, line)
        if stated is not None:
            return stated
        name = _NAME.fullmatch(self.data, *span)
        if name is None:
            raise self._computed(span, line)
        return _Stated(*self._position(name[1], name[2], line), name)

    def _target(self, span: Span, stated: _Stated, line: Line) -> tuple[int, Span]:
        """The place of a target, and the bytes of its name, `NOWHERE` where it is stated in the move."""
        numbers, name = stated.numbers, stated.name
        if numbers.span not in self.targets:
            what = "the position" if name is None else f"the position {key_of(name[1], name[2])}"
            if not (numbers.joints or numbers.whole):
                # what it lacks is as it is where the robot comes from
                raise DecidedInRun(
                    f"{what} lacks one of X, Y, Z, A, B, C; state all of them", line=line.line, code="OLP533"
                )
            pose = pose_of(numbers, line.line, what)
            x, y, z, a, b, c, _, turn, along, *_ = numbers.spans
            self.targets[numbers.span] = self.moves.target(
                stated.line.line, numbers.span, (x, y, z), pose.origin_mm, pose.turn, numbers.outer(0.0),
                "" if name is None else name[1].decode("latin-1"),
                NOWHERE if name is None else (stated.line.begin, stated.line.end), (a, b, c),
                () if turn == NOWHERE else (turn,), numbers.numbers[STATUS : TURN + 1],
                numbers.outer(ABSENT), along=along,
            )  # fmt: skip
        return self.targets[numbers.span], NOWHERE if name is None else span

    def _computed(self, span: Span, line: Line) -> DecidedInRun:
        shown = self.data[slice(*span)][:60].decode("latin-1")
        return DecidedInRun(
            f"the target `{shown}` is computed, or lacks numbers; program it with its numbers",
            line=line.line,
            code="OLP533",
        )
