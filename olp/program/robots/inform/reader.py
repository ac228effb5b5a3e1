"""Reads jobs of INFORM: moves, and the positions whose numbers can be edited.

A position has the frame, the tool and the form of the header lines before it, so it is right wherever the
robot comes from.
"""

from __future__ import annotations

import re

from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.dialect import Dialect, Options
from olp.program.program import Program
from olp.program.robots.frames import Located, Tool
from olp.program.robots.inform.flow import ARC_MOVES, STATION_ALONE, Arcs, Flow, word_of
from olp.program.robots.inform.places import Places
from olp.program.robots.inform.table import BLOCKS, BY_DISTANCE, MOVING, REFUSED, SETTING, STILL
from olp.program.robots.inform.text import Position, Statement, job_of
from olp.program.robots.moves import NAN, RobotMoves, not_read, take_all
from olp.program.robots.poses import Pose
from olp.program.robots.targets import Span, Use

_MOVE = pattern(rb"(?i)S?MOV[LJC][ \t]+((C|P)(\d{1,6})|L?PX?\d+|L?P(?:\[[^\]]*\]|\([^)]*\)))(?![\w\[(])(.*)")
_VALUE = rb"(?:\d+\.?\d*|\.\d+|L?[BIDR](?:\d+|\[[^\]]*\]))"
#: Words behind a move that change nothing of its path, and those that belong to all of it.
_PLAIN = rb"(?:V[JRE]?|PL|CR|ACC|DEC)=" + _VALUE + rb"|CONT"
_OUTER = rb"(?:BC|EC|BP|EX)\d+"
_HELD = rb"NWAIT|T\d+|T=" + _VALUE + rb"|(?:UNTIL|SRCH)[ \t].*"
_STATION = rb"\+MOV[JL][ \t]+L?(?:EC|EX)\d+"
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
_WHOLE = pattern(rb"(?i)(?<!\w)(?:" + _HELD + rb"|L?(?:BP|EX)\d)")
#: A positioner that goes somewhere, and one that goes where the text does not state.
_STATIONED = pattern(rb"(?i)(?<!\w)L?E[CX]\d")
_SOMEWHERE = pattern(rb"(?i)(?<!\w)L?EX\d")
_AXES_BESIDE = pattern(rb"(?i)(?<!\w)(BC|EC|BP|EX)(\d+)")
#: What ends a move before its position is reached.
_UNTIL = pattern(rb"(?i)(?<!\w)(?:UNTIL|SRCH)[ \t]")
_SPEED = pattern(rb"(?i)(?<!\w)V=(\d+\.?\d*|\.\d+)(?![\w.])")
_LEVEL = pattern(rb"(?i)(?<!\w)PL=\S+")
#: A stop at a via point, or one that may be, and a rounding, which several arcs do not have.
_STOPS = pattern(rb"(?i)(?<!\w)(?:PL=(?![1-9]\d*(?!\S))|CR=)")
_MOVES = frozenset((b"MOVL", b"MOVJ", b"SMOVL"))
#: Moves whose path counts from a positioner, where one moves.
_WITH_STATION = frozenset((b"SMOVL", b"SMOVC"))
#: Words of a posture that are the same all along an arc: those of the arm.
_ARM = slice(1, 3)
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
        self.arcs = Arcs(self.job.statements)
        self.places = Places(data, self.moves, self.job)
        #: where the positioner is, None where that is not known
        self.station: tuple[float, ...] | None = ()
        #: of the arc that is read, as `_why_unled` says
        self._unled: str | None = None
        self.blocks: list[_Block] = []
        self.refusals: list[ProgramError] = []

    def run(self, dialect: Dialect, options: Options, *, words: bool) -> Program:
        take_all(self.job.statements, self._statement, self.moves, self.refusals, options)
        return self.moves.program(dialect, words=words)

    # -- statements ----------------------------------------------------------------------------------

    def _statement(self, statement: Statement) -> None:
        word = word_of(statement.text)
        if word in REFUSED:
            raise not_read(f"{word.decode()} {REFUSED[word]}", statement.line)
        if STATION_ALONE.match(statement.text):
            self.station = None
            return
        if statement.line in self.arcs.parting:
            return
        if word in _MOVES:
            self._move(statement, straight=word != b"MOVJ")
        elif word in ARC_MOVES:
            self._arc(statement)
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

    def _move(self, statement: Statement, *, straight: bool, whole: bool = False, left: str = "") -> None:
        """A move; `left` says why it stays as it is written, where its own words do not."""
        move = self._words(statement)
        tail = move[4]
        if any(block.loop and block.moves == self.moves.count for block in self.blocks):
            # the first move in a loop begins where the last one ends, or before the loop
            self.moves.known = False
        position, why = self._position(move[2], move[3], statement)
        if position is None or left:
            self.moves.left(statement.line)
            if position is not None:
                self.moves.hold((self.places.name(position),))
            self.station = None
            self.moves.remark("left", statement.line, f"left as written: {why or left}")
            return
        self._known_words(tail, statement)
        if move[2].upper() == b"P":
            what = f"{move[1].decode()} may be used by other jobs, too: correct these with it"
            self.moves.remark("shared", statement.line, what)
        begin = statement.span[0]
        place = begin + move.start(1), begin + move.end(1)
        speed = _SPEED.search(tail)
        whole |= _WHOLE.search(tail) is not None
        self._to(statement, position, place, tail, NAN if speed is None else float(speed[1]),
                 straight=straight, whole=whole)  # fmt: skip
        if _UNTIL.search(tail):
            self.moves.known = False

    def _arc(self, statement: Statement) -> None:
        """One of the moves of an arc. Three of them that can be followed are read with the second one. Others
        are corrected where they go, and their path is not known."""
        run = self.arcs.runs[statement.line]
        if statement is run[0]:
            self._unled = self._why_unled(run)
        if self._unled is not None:
            self._move(statement, straight=False, whole=True, left=self._unled)
        elif statement is run[0]:
            self._move(statement, straight=True)
        elif statement is run[1]:
            self._bent(run)

    def _why_unled(self, run: tuple[Statement, ...]) -> str | None:
        """None where the path of an arc is followed; else why its points are left, empty where they are
        corrected."""
        moves = [self._words(own) for own in run]
        stated = [self._position(move[2], move[3], own) for move, own in zip(moves, run, strict=True)]
        positions = [position for position, _ in stated if position is not None]
        if len(positions) < len(run):
            return next(why for position, why in stated if position is None)
        if any(word_of(own.text) in _WITH_STATION for own in run):
            why = "the path of SMOVC counts from a positioner"
        elif self.arcs.points.get(run[0].line) != run:
            why = (
                "an arc is followed in a run of three MOVC behind MOVL or MOVJ, with nothing between that "
                "leads elsewhere"
            )
        elif any(self.places.in_joints(position, run[0].line) for position in positions):
            why = "a point of this arc is in pulses or joints"
        elif any(_UNTIL.search(move[4]) for move in moves):
            why = "this arc may end before its point"
        elif any(_STATIONED.search(move[4]) for move in moves):
            why = "a positioner may move along this arc"
        else:
            return None
        self.moves.remark(f"points: {why}", run[0].line, f"{why}: it is corrected at its points")
        return ""

    def _bent(self, run: tuple[Statement, ...]) -> None:
        """An arc from the first of its moves through the second to the third."""
        (first, *_), (via, *place), (end, frame, tool) = (self._point(own) for own in run)
        postures = [self.moves.targets[use.target].config for use in (first, via, end)]
        if len({words[_ARM] for words in postures if words[0] == words[0]}) > 1:
            raise not_read(
                "the points of this arc have different postures; post them with the same ///RCONF",
                run[1].line,
            )
        if place != [frame, tool]:
            raise not_read("via point and end of this arc have different frames or tools", run[1].line)
        tails = [self.moves.data[slice(*use.zone)] for use in (via, end)]
        # what is said at the via point alone counts up to there, or belongs there
        same = len({tuple(_LEVEL.sub(b"", tail).split()) for tail in tails}) == 1
        whole = not same or run[2].line - run[1].line > 1 or _STOPS.search(tails[0]) is not None
        speed = _SPEED.search(tails[1])
        self.moves.arc(
            run[1].line, via, end, frame, tool, NAN if speed is None else float(speed[1]),
            turned_by_via=True, whole=whole or _WHOLE.search(tails[1]) is not None,
        )  # fmt: skip

    def _point(self, statement: Statement) -> tuple[Use, Located, Tool]:
        """A point of an arc, with its frame and its tool."""
        move, line, begin = self._words(statement), statement.line, statement.span[0]
        position, _ = self._position(move[2], move[3], statement)
        assert position is not None
        self._known_words(move[4], statement)
        if move[2].upper() == b"P":
            what = f"{move[1].decode()} may be used by other jobs, too: correct these with it"
            self.moves.remark("shared", line, what)
        beside = self._beside(move[4])
        index = self.places.target(position, beside, line)
        target = self.moves.targets[index]
        place = begin + move.start(1), begin + move.end(1)
        use = Use(index, statement.span, place, place, turn=target.turn, zone=(place[1], statement.span[1]))
        return use, self.places.frame(position, target, line), self.places.tool(position, line)

    @staticmethod
    def _beside(tail: bytes) -> list[tuple[bytes, int]]:
        """The positions of the axes beside the robot."""
        return [(kind.upper(), int(number)) for kind, number in _AXES_BESIDE.findall(tail)]

    def _words(self, statement: Statement) -> re.Match[bytes]:
        """The words of a move. Raises ProgramError where they are not known."""
        move = _MOVE.fullmatch(statement.text)
        if move is None:
            raise ProgramError("the words of this move are not read", line=statement.line, code="OLP516")
        return move

    def _to(
        self, statement: Statement, position: Position, place: Span, tail: bytes, feed: float, *,
        straight: bool, whole: bool,
    ) -> None:  # fmt: skip
        """A move to a position that the text states."""
        line, span = statement.line, statement.span
        beside = self._beside(tail)
        zone, station = (place[1], span[1]), self.places.station(beside, line)
        somewhere = _SOMEWHERE.search(tail) is not None
        if station or somewhere:
            # parts would lead a positioner to its end before the move ends
            moved = somewhere or station != self.station or not self.moves.known
            whole |= moved
            self.station = None if somewhere else station
            if moved and straight and word_of(statement.text) in _WITH_STATION:
                what = "a positioner moves, and the path counts from it: the move is corrected at its end"
                self.moves.remark("station", line, what)
                straight = False
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
