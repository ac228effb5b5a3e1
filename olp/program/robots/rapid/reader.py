"""Reads RAPID: statements to moves, and the targets whose numbers can be edited.

Moves carry their tool and their frame, so a target is right wherever the program comes from. Where a move
begins is known only between moves that follow each other in every run: elsewhere its end alone is corrected.
"""

from __future__ import annotations

from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.program.dialect import Dialect, Options, Support
from olp.program.program import Program
from olp.program.robots.frames import Located, Tool
from olp.program.robots.moves import DecidedInRun, RobotMoves, take_all
from olp.program.robots.poses import NO_TURN, inverted, multiplied, of_zyx, rotated
from olp.program.robots.rapid import flow
from olp.program.robots.rapid.data import NO_MODULE, Declared, Given, Scope
from olp.program.robots.rapid.forms import FORMS, JOINT_MOVES, Form
from olp.program.robots.rapid.table import TABLE
from olp.program.robots.rapid.text import Lines, Statement, statements
from olp.program.robots.rapid.values import JOINTTARGET, ROBTARGET, joints_of, target_of
from olp.program.robots.rapid.words import Words, moved, name_of, words_of
from olp.program.robots.targets import NOWHERE, Span, Use

#: Words of moves that are read, in capitals; those of processes and signals change no path.
_KNOWN = frozenset(
    (b"V", b"T", b"Z", b"INPOS", b"CONC", b"TLOAD", b"NOEOFFS", b"ON", b"OFF", b"WEAVE", b"SEAMNAME",
     b"RETRACT", b"NOCONC", b"QUICK", b"OPENHLIFT", b"CLOSEHLIFT", b"T2", b"T3", b"T4", b"T5", b"T6", b"T7",
     b"T8", b"TRIGGDATA1", b"TRIGGDATA2", b"TRIGGDATA3", b"DODATA", b"AODATA", b"GODATA", b"DISP", b"ONDIST",
     b"OFFDIST", b"MOVESTARTTIMER", b"TIME")
)  # fmt: skip
#: Words that belong to the whole of a move, which is not split.
_PATHS = frozenset((b"CONC", b"T", b"ON", b"OFF", b"ONDIST", b"OFFDIST", b"MOVESTARTTIMER"))
#: Words of moves whose path is decided while the robot moves.
_LEFT = {
    b"ID": "another robot moves at the same time",
    b"CORR": "a sensor leads the robot along this move",
    b"TRACK": "a sensor leads the robot along this move",
}
#: What ends a routine, or a record, behind END.
_ROUTINES = frozenset((b"PROC", b"FUNC", b"TRAP", b"RECORD"))
_NOT_READ = "OLP512"
#: What moves the values of external axes alone, from which poses count where they are declared so.
_OUTER = (b"EOFFSON", b"EOFFSSET")


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
        self.moves = RobotMoves(data, setup, "wobj0")
        self.declared = Declared(data, self.moves)
        self.routine = NO_MODULE
        #: of open blocks: whether it is a loop, and the moves before it
        self.blocks: list[tuple[bool, int]] = []
        self.tools: dict[tuple[Scope, str], Tool] = {}
        self.frames: dict[tuple[Scope, str], Located] = {}
        self.refusals: list[ProgramError] = []
        #: whether straight moves, and others, take any posture that is near
        self.free = [False, False]
        #: the switch of SingArea that may be in force, with its line, and the first one of the text
        self.area = self.any_area = ("", 0)

    def run(self, dialect: Dialect, options: Options, *, words: bool) -> Program:
        if self.data[:2] in (b"\xff\xfe", b"\xfe\xff"):
            raise ProgramError("the text is UTF-16; save it as plain text", line=1, code="OLP502")
        every = list(statements(self.data, Lines(self.data)))
        rest = self._declare(every)
        self.moving, self.routines = flow.moving_routines(rest)
        self.any_area = flow.first_area(self.data, rest)
        self.arc_mode = flow.first_of(flow.arc_mode_of, b"CIRPATHMODE", self.data, rest)
        take_all(rest, self._statement, self.moves, self.refusals, options)
        self.moves.hold_mentioned((statement.begin, statement.end) for statement in every)
        return self.moves.program(dialect, words=words)

    def _declare(self, every: list[Statement]) -> list[Statement]:
        """Keep the data, and what changes them; returns the other statements."""
        routine, inside, rest = NO_MODULE, False, []
        changing = flow.changing_parameters(every)
        for statement in every:
            if statement.block == "module":
                routine = routine.next_module()
            if statement.block == "routine":
                routine = routine.of(flow.routine_of(statement))
                self.declared.parameters[routine] = flow.parameters_of(statement)
                inside = statement.text.upper().split()[-2:-1] == [b"RECORD"]
            elif statement.block == "end":
                inside = False
            if inside and statement.block != "routine":
                continue
            if statement.block == "end" and statement.text.upper()[3:] in _ROUTINES:
                routine = routine.of("")
            if not statement.block and self.declared.declare(statement, routine):
                continue
            given = flow.given_in(statement, changing)
            if given:
                value = flow.value_in(statement)
                for name in given:
                    self.declared.give(name, Given(statement, routine, value))
            rest.append(statement)
        return rest

    # -- statements ----------------------------------------------------------------------------------

    def _statement(self, statement: Statement) -> None:
        if statement.block:
            self._block(statement)
            return
        if not statement.text.strip():
            return
        word = statement.word
        if word in FORMS or word in JOINT_MOVES:
            self._any_move(statement, word)
        elif word == flow.IF:
            self._short_if(statement)
        elif flow.is_assignment(statement):
            return
        else:
            self._instruction(statement, word)

    def _any_move(self, statement: Statement, word: bytes, *, whole: bool = False) -> None:
        if word in FORMS:
            self._move(statement, word, FORMS[word], whole=whole)
        else:
            self._loop_begins()
            self.moves.joint_move(statement.line, lambda: self._joints(statement, word))

    def _instruction(self, statement: Statement, word: bytes) -> None:
        row = TABLE.get(word)
        if row is None:
            self._call(statement, word)
        elif word in _OUTER and not self.moves.external.counts:
            return
        elif row[0] is Support.REFUSED:
            raise ProgramError(f"{word.decode('latin-1')} {row[1]}", line=statement.line, code=_NOT_READ)
        elif word == b"SOFTACT":
            self.moves.remark("soft", statement.line, row[1])
        elif word == b"SINGAREA":
            self.area = flow.area_of(statement), statement.line
        elif word in (b"CONFL", b"CONFJ"):
            self.free[word == b"CONFJ"] = b"\\OFF" in statement.text.upper().replace(b" ", b"")

    def _call(self, statement: Statement, word: bytes) -> None:
        """A call of a routine, which may move the robot."""
        name = word.decode("latin-1")
        if not name and statement.text.lstrip()[:1] != b"%":
            shown = statement.text.strip()[:60].decode("latin-1")
            raise ProgramError(f"`{shown}` is not a statement of RAPID", line=statement.line, code="OLP510")
        if name in self.routines and name not in self.moving:
            self.area = self.any_area
            return
        if name not in self.routines:
            what = f"{name or 'a routine'} is in another file: correct that too"
            self.moves.remark("called", statement.line, what)
        self.area = self.any_area
        self._unknown()

    def _short_if(self, statement: Statement) -> None:
        move = flow.inner_move(statement)
        if move is not None:
            # parts of it would stand before the IF
            self._any_move(move, move.word, whole=True)
            self._unknown()
        elif flow.may_move(statement.text):
            raise ProgramError(
                "this IF without THEN is not read; write IF, THEN and ENDIF",
                line=statement.line,
                code=_NOT_READ,
            )
        elif flow.calls(statement.text):
            self.area = self.any_area
            self._unknown()

    def _block(self, statement: Statement) -> None:
        """Where the flow of the program parts and meets."""
        block, self.area = statement.block, self.any_area
        if block in ("routine", "label", "module"):
            self._unknown()
            if block == "module":
                self.routine = self.routine.next_module()
            if block != "label":
                self.routine, self.blocks = self.routine.of(flow.routine_of(statement)), []
        elif block in ("if", "loop", "test"):
            self.blocks.append((block == "loop", self.moves.count))
        elif block in ("elseif", "case", "part"):
            if statement.text.upper().partition(b"(")[0].strip() in (b"ERROR", b"UNDO", b"BACKWARD"):
                self.blocks = []
                self._unknown()
            elif self.blocks and self.blocks[-1][1] != self.moves.count:
                self._unknown()
        elif block == "end":
            what = statement.text.upper()[3:]
            if what in (b"IF", b"FOR", b"WHILE", b"TEST") and self.blocks:
                if self.blocks.pop()[1] != self.moves.count:
                    self._unknown()
            elif what in _ROUTINES:
                self.routine, self.blocks = self.routine.of(""), []
                self._unknown()

    def _unknown(self) -> None:
        self.moves.known = False

    def _loop_begins(self) -> None:
        """The first move in a loop begins where the last one ends, or before the loop."""
        if any(loop and before == self.moves.count for loop, before in self.blocks):
            self._unknown()

    # -- moves ---------------------------------------------------------------------------------------

    def _move(self, statement: Statement, word: bytes, form: Form, *, whole: bool) -> None:
        """A move, or an arc."""
        words = words_of(statement, statement.begin + len(word), self.data, form)
        line = statement.line
        self._refuse_words(statement, words, form)
        if form.arc and self.arc_mode[0]:
            raise ProgramError(
                f"how the tool turns on this arc is set by CirPathMode\\{self.arc_mode[0]} in line "
                f"{self.arc_mode[1]}, which is not read; program CirPathMode\\ObjectFrame, or straight moves",
                line=line,
                code=_NOT_READ,
            )
        spans = (words.via, words.target) if form.arc else (words.target,)
        uses = [self._use(statement, span, words.zone, straight=form.straight) for span in spans]
        tool, frame = self._tool(words.tool, line), self._frame(words.frame, line)
        stated = b"" if b"T" in words.others else words.others.get(b"V", words.speed)
        feed = self.declared.speed(stated, self.routine)
        self._loop_begins()
        whole |= form.whole or not _PATHS.isdisjoint(words.others)
        if self._uneven(form):
            what = f"the tool may not turn evenly here (SingArea\\{self.area[0]} in line {self.area[1]})"
            self.moves.remark("area", line, f"{what}: lines and arcs are corrected at their points")
            for use in uses:
                self.moves.move(line, use, frame, tool, feed, straight=False, whole=True)
        elif form.arc:
            self.moves.arc(line, uses[0], uses[1], frame, tool, feed, whole=whole)
        else:
            self.moves.move(line, uses[0], frame, tool, feed, straight=form.straight, whole=whole)
        if form.stopped:
            self._unknown()

    def _refuse_words(self, statement: Statement, words: Words, form: Form) -> None:
        """Raises ProgramError for words of a move that are not read, and where the tool of one along a line
        or an arc may not turn evenly. The words of a search say what it looks for."""
        line = statement.line
        for name, why in _LEFT.items():
            if name in words.others:
                raise DecidedInRun(f"{why} (\\{name.decode()})", line=line, code="OLP533")
        unread = [name for name in words.others if name not in _KNOWN]
        if unread and not form.stopped:
            raise ProgramError(
                f"a move with \\{unread[0].decode('latin-1')} is not read", line=line, code=_NOT_READ
            )
        if self._uneven(form) and (self.free[0] or flow.locks(self.area[0])):
            what = f"SingArea\\{self.area[0]} in line {self.area[1]}"
            what += ", with ConfL\\Off" if self.free[0] else ""
            raise ProgramError(
                f"the tool may not turn evenly on this move ({what}), which is not read on arms; program "
                "SingArea\\Off before it",
                line=line,
                code=_NOT_READ,
            )

    def _uneven(self, form: Form) -> bool:
        """Whether the tool of a move along a line or an arc may not turn evenly."""
        return form.straight and self.moves.arm and self.area[0] != ""

    def _tool(self, name: str, line: int) -> Tool:
        key = (self.routine, name)
        if key not in self.tools:
            pose = self.declared.tool(name, self.routine, line)
            self.tools[key] = self.moves.frames.tool(name, pose, line)
        return self.tools[key]

    def _frame(self, name: str, line: int) -> Located:
        key = (self.routine, name)
        if key not in self.frames:
            pose = self.declared.frame(name, self.routine, line)
            self.frames[key] = self.moves.frames.located(name, pose, line)
        return self.frames[key]

    def _use(self, statement: Statement, span: Span, zone: Span, *, straight: bool) -> Use:
        """How a move uses the target of some bytes. Raises ProgramError where the text does not state it with
        numbers."""
        line = statement.line
        shift, turn = moved(self.data, span), None
        inner = span if shift is None else shift.inner
        index, named = self._target(inner, line)
        target = self.moves.targets[index]
        place = (0.0, 0.0, 0.0)
        if shift is not None:
            place = shift.shift_mm
            if shift.tool:
                place = rotated(target.turn, place)
                a, b, c = shift.turns_deg
                if any(shift.turns_deg):
                    # Rx Ry Rz is the inverse of Rz Ry Rx with all angles against it
                    turn = multiplied(target.turn, inverted(of_zyx((-c, -b, -a))))
        return Use(
            index, (statement.begin, statement.end), span, named, place,
            target.turn if turn is None else turn, zone=zone,
            offsets=() if shift is None else shift.numbers,
            offset_turn=target.turn if shift is not None and shift.tool else NO_TURN,
            along_tool=shift is not None and shift.tool, free=self.free[not straight],
        )  # fmt: skip

    def _joints(self, statement: Statement, word: bytes) -> Use | None:
        """How a move uses joint values; None where the text does not state them."""
        words = words_of(statement, statement.begin + len(word), self.data, FORMS[b"MOVEJ"])
        span, line, named = words.target, statement.line, NOWHERE
        match = JOINTTARGET.match(self.data, *span)
        if match is not None and not self.data[match.end() : span[1]].strip():
            stated = joints_of(match)
            place: int | None = self.moves.joint_target(
                line, match.span(), stated.spans, stated.degrees, stated.outer
            )
        else:
            name = name_of(self.data[slice(*span)])
            named = span
            place = None if name is None else self.declared.joints(*name, self.routine, line)
        if place is None:
            return None
        return Use(place, (statement.begin, statement.end), span, named, zone=words.zone)

    def _target(self, span: Span, line: int) -> tuple[int, Span]:
        """The place of a target, and the bytes of its name, `NOWHERE` where it is stated in the move."""
        match = ROBTARGET.match(self.data, *span)
        if match is not None and not self.data[match.end() : span[1]].strip():
            stated, value = target_of(match, line), match.span()
            place = self.moves.target(
                line, value, stated.spans, stated.point, stated.turn, stated.rest, turned=stated.turned,
                turns=stated.turns, config=stated.config, outer=stated.outer, along=stated.along,
            )  # fmt: skip
            return place, NOWHERE
        name = name_of(self.data[slice(*span)])
        if name is None:
            shown = self.data[slice(*span)].decode("latin-1").strip()[:60]
            raise DecidedInRun(
                f"the target `{shown}` is computed; program it with its numbers", line=line, code="OLP533"
            )
        return self.declared.target(*name, self.routine, line), span
