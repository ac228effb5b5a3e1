"""Reads jobs of INFORM: moves, and the positions whose numbers can be edited.

A position has the frame, the tool and the form of the header lines before it, so it is right wherever the
robot comes from.
"""

from __future__ import annotations

from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.dialect import Dialect, Options
from olp.program.program import Program
from olp.program.robots.frames import Located, Tool
from olp.program.robots.inform.flow import Flow, word_of
from olp.program.robots.inform.places import Places
from olp.program.robots.inform.table import BLOCKS, BY_DISTANCE, MOVING, REFUSED, SETTING, STILL
from olp.program.robots.inform.text import Position, Statement, job_of
from olp.program.robots.moves import NAN, RobotMoves, not_read, take_all
from olp.program.robots.poses import Pose
from olp.program.robots.targets import Span, Use

_MOVE = pattern(rb"(?i)MOV[LJ][ \t]+((C|P)(\d{1,6})|L?PX?\d+|L?P(?:\[[^\]]*\]|\([^)]*\)))(?![\w\[(])(.*)")
_VALUE = rb"(?:\d+\.?\d*|\.\d+|L?[BIDR](?:\d+|\[[^\]]*\]))"
#: Words behind a move that change nothing of its path, and those that belong to all of it.
_PLAIN = rb"(?:V[JRE]?|PL|CR|ACC|DEC)=" + _VALUE + rb"|CONT"
_OUTER = rb"(?:BC|EC|BP|EX)\d+"
_HELD = rb"NWAIT|T\d+|T=" + _VALUE + rb"|UNTIL[ \t].*"
_STATION = rb"\+MOV[JL][ \t]+(?:EC|EX)\d+"
_TAIL = pattern(
    rb"(?i)(?:[ \t]*(?:"
    + _PLAIN
    + rb"|"
    + _OUTER
    + rb"|"
    + _HELD
    + rb"|"
    + _STATION
    + rb")(?![\w=(\[]))*[ \t]*"
)
_WHOLE = pattern(rb"(?i)(?<!\w)(?:" + _HELD + rb"|(?:BP|EX)\d)")
_AXES_BESIDE = pattern(rb"(?i)(?<!\w)(BC|EC|BP|EX)(\d+)")
_UNTIL = pattern(rb"(?i)(?<!\w)UNTIL[ \t]")
_SPEED = pattern(rb"(?i)(?<!\w)V=(\d+\.?\d*|\.\d+)(?![\w.])")
#: A move of a positioner alone.
_STATION_ALONE = pattern(rb"(?i)MOV[JL][ \t]+(?:EC|EX)\d+\b(?!.*\+)")
_WORD = pattern(rb"[\w.+#=]+|\S")
#: What leads elsewhere, or ends the job: where the next statement is reached, the robot stays.
_FLOW = frozenset((b"JUMP", b"JMP", b"RET", b"END", b"ABORT"))


@dataclass(frozen=True, slots=True)
class _Block:
    loop: bool
    moves: int


def read(
    data: bytes, setup: Setup, dialect: Dialect, options: Options | None = None, *, words: bool = True
) -> Program:
    """Read a whole job. Raises ProgramError with the line of the first statement that cannot be read
    correctly."""
    return _Reader(data, setup).run(dialect, options or Options(), words=words)


class _Reader:
    """Reads one job."""

    def __init__(self, data: bytes, setup: Setup) -> None:
        self.setup = setup
        self.moves = RobotMoves(data, setup, "BASE")
        self.job = job_of(data)
        self.flow = Flow(self.job.statements)
        self.places = Places(data, self.moves, self.job)
        self.station: tuple[float, ...] = ()
        self.blocks: list[_Block] = []
        self.refusals: list[ProgramError] = []

    def run(self, dialect: Dialect, options: Options, *, words: bool) -> Program:
        take_all(self.job.statements, self._statement, self.refusals, options)
        return self.moves.program(dialect, words=words)

    # -- statements ----------------------------------------------------------------------------------

    def _statement(self, statement: Statement) -> None:
        word = word_of(statement.text)
        if word in REFUSED:
            raise not_read(f"{word.decode()} {REFUSED[word]}", statement.line)
        if _STATION_ALONE.match(statement.text):
            return
        if word in (b"MOVL", b"MOVJ"):
            self._move(statement, straight=word == b"MOVL")
        elif word in BY_DISTANCE:
            self.moves.left(statement.line)
            what = "left as written: it moves by a distance from where the robot is"
            self.moves.remark("left", statement.line, what)
        elif word == b"*":
            self.moves.known = False
        elif word in BLOCKS:
            self._block(BLOCKS[word])
        elif word in SETTING:
            shown = statement.text[:40].decode("latin-1")
            self.moves.remark(
                "set", statement.line, f"`{shown}` sets numbers that the job file has to state, too"
            )
        elif not (word in STILL or word in MOVING or word in _FLOW):
            self.moves.known = False
            shown = statement.text[:40].decode("latin-1")
            self.moves.remark("called", statement.line, f"`{shown}` may move the robot: correct that too")

    def _block(self, kind: str) -> None:
        """Where the flow of the job parts and meets."""
        if kind in ("if", "loop"):
            self.blocks.append(_Block(kind == "loop", self.moves.count))
            return
        if not self.blocks or self.blocks[-1].moves != self.moves.count:
            self.moves.known = False
        if kind == "end" and self.blocks:
            self.blocks.pop()

    # -- moves ---------------------------------------------------------------------------------------

    def _move(self, statement: Statement, *, straight: bool) -> None:
        move = _MOVE.fullmatch(statement.text)
        if move is None:
            raise ProgramError("the words of this move are not read", line=statement.line, code="OLP516")
        tail = move[4]
        self._known_words(tail, statement)
        if any(block.loop and block.moves == self.moves.count for block in self.blocks):
            # the first move in a loop begins where the last one ends, or before the loop
            self.moves.known = False
        position, why = self._position(move[2], move[3], statement)
        if position is None:
            self.moves.left(statement.line)
            self.moves.remark("left", statement.line, f"left as written: {why}")
            return
        if move[2].upper() == b"P":
            what = f"{move[1].decode()} may be used by other jobs, too: correct these with it"
            self.moves.remark("shared", statement.line, what)
        begin = statement.span[0]
        place = begin + move.start(1), begin + move.end(1)
        speed = _SPEED.search(tail)
        whole = _WHOLE.search(tail) is not None
        self._to(statement, position, place, tail, NAN if speed is None else float(speed[1]),
                 straight=straight, whole=whole)  # fmt: skip
        if _UNTIL.search(tail):
            self.moves.known = False

    def _to(
        self, statement: Statement, position: Position, place: Span, tail: bytes, feed: float, *,
        straight: bool, whole: bool,
    ) -> None:  # fmt: skip
        """A move to a position that the text states."""
        line, span = statement.line, statement.span
        beside = [(kind.upper(), int(number)) for kind, number in _AXES_BESIDE.findall(tail)]
        zone, station = (place[1], span[1]), self.places.station(beside, line)
        # parts would lead a positioner to its end before the move ends
        whole |= station != self.station
        self.station = station
        if self.places.in_joints(position, line):
            held: Tool | None = None
            if straight and self.moves.arm:
                tool = self.places.tool(position, line)
                held = Tool(tool.name, tool.pose or Pose(tool.vector_mm))

            def taken() -> Use | None:
                index = self.places.joints(position, beside, line)
                return None if index is None else Use(index, span, place, place, zone=zone)

            self.moves.joint_move(line, taken, straight=straight, tool=held, feed=feed, whole=whole)
            return
        index = self.places.target(position, beside, line)
        target = self.moves.targets[index]
        use = Use(index, span, place, place, turn=target.turn, zone=zone)
        frame: Located = self.places.frame(position, target, line)
        self.moves.move(
            line, use, frame, self.places.tool(position, line), feed, straight=straight, whole=whole
        )

    def _known_words(self, tail: bytes, statement: Statement) -> None:
        """Raises ProgramError with the first word behind a move whose effect on its path is not known."""
        known = _TAIL.match(tail)
        word = _WORD.search(tail, 0 if known is None else known.end())
        if word is not None:
            raise not_read(
                f"`{word[0].decode('latin-1')}` behind a move is not read: what it does to the path is not "
                "known; post the move without it",
                statement.line,
            )

    def _position(
        self, kind: bytes | None, number: bytes, statement: Statement
    ) -> tuple[Position | None, str]:
        """The position of a move; None where the run decides it, and why."""
        moved = self.flow.moved(statement)
        if moved:
            return None, f"{moved} moves the target"
        if kind is None:
            return None, "the text does not state where this move goes"
        key = kind.upper(), int(number)
        name = f"{key[0].decode()}{number.decode()}"
        if key[0] == b"P":
            if self.flow.chosen:
                return None, f"line {self.flow.chosen} may give {name} another value"
            if key[1] in self.flow.assigned:
                return None, f"{name} gets another value in line {self.flow.assigned[key[1]]}"
            if key[1] in self.flow.used:
                return None, f"line {self.flow.used[key[1]]} uses the numbers of {name}, so these stay"
        found = self.job.positions.get(key, [])
        if not found and key[0] == b"P":
            return None, f"the text does not state {name}"
        if len(found) != 1:
            what = "is not stated" if not found else "is stated twice"
            raise ProgramError(f"the position {name} {what}", line=statement.line, code="OLP533")
        return found[0], ""
