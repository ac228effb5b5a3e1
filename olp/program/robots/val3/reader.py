"""Reads applications of VAL 3: their programs are followed from the first one on, as the control runs them.

A number that a move uses is where the text states it: in the data, in an assignment, or in a call. Where it
depends on the run, the move is refused.
"""

from __future__ import annotations

from bisect import bisect_right

from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.core.patterns import pattern
from olp.core.projects import FileLines, parts
from olp.program.dialect import Dialect, Options
from olp.program.program import Program
from olp.program.robots.line import Line
from olp.program.robots.moves import DecidedInRun, RobotMoves, not_read
from olp.program.robots.val3 import table
from olp.program.robots.val3.assigning import assign, is_assignment
from olp.program.robots.val3.code import Block, Node, Routine, lines_in, word_of
from olp.program.robots.val3.files import Application, application
from olp.program.robots.val3.moving import Moving
from olp.program.robots.val3.places import Places
from olp.program.robots.val3.reach import TASK, Reach
from olp.program.robots.val3.state import Scope, State
from olp.program.robots.val3.values import CALL, Thing, balanced

MOVE = pattern(rb"(?is)(?:[A-Za-z_][^={}()\"]*=\s*)?(move[ljc])\s*\((.*)\)")
_HAS_MOVE = pattern(rb"(?i)\bmove[ljc]\s*\(")
_CALLED = pattern(rb"(?is)call\s+([A-Za-z_][\w:]*)\s*\((.*)\)")
_LINK = pattern(rb"(?is)link\s*\((.*)\)")
_LEADS = pattern(rb"(?i)(?:break|continue|wait|exit)\b")
_ALTERED = pattern(rb"(?i)alter(?!\w*[ \t]*=)\w*\s*\(")
#: Programs call each other so deep at most.
_DEEPEST = 24


def read(
    data: bytes, setup: Setup, dialect: Dialect, options: Options | None = None, *, words: bool = True
) -> Program:
    """Read a whole application. Raises ProgramError with the line of the first statement that cannot be read
    correctly, as it counts through all files of the text."""
    return _Reader(data, setup).run(dialect, options or Options(), words=words)


class _Reader:
    """Reads one application."""

    def __init__(self, data: bytes, setup: Setup) -> None:
        self.data, self._files = data, FileLines(data)
        self.application: Application = application(data)
        self.reach = Reach(self.application, data)
        self.state = State(data, self.application.data, self.reach.elsewhere, self.reach.beside)
        self.moves = RobotMoves(data, setup, "world")
        places = Places(self.state, self.moves.frames)
        self.moving = Moving(data, self.state, places, self.moves)
        self.refusals: list[ProgramError] = []
        self.tell = Options().tell
        self.count, self.taken = 1, 0
        #: whether no other task moves the robot
        self.alone = True

    def run(self, dialect: Dialect, options: Options, *, words: bool) -> Program:
        self.tell = options.tell
        first = self.application.first
        if first is not None:
            scope = Scope(first)
            for name, kind, _ in first.parameters:
                scope.own[name] = Thing.empty(kind, name, "0")
                scope.own[name].why = "the caller gives it; correct the program that calls this one"
            self.count = max(len(lines_in(first.nodes)), 1)
            others = (r for r in self.application.routines.values() if r is not first)
            self.alone = not any(
                map(self.reach.moves_beside, (line for r in others for line in lines_in(r.nodes)))
            )
            self._nodes(first.nodes, scope, 0)
        if self.refusals:
            first_error = self.refusals[0]
            first_error.others = tuple(self.refusals[1:])
            raise first_error
        self.moving.check(self.reach)
        routines = self.application.routines.values()
        lines = [line for routine in routines for line in lines_in(routine.nodes)]
        self.moves.hold_mentioned((line.begin, line.end) for line in lines)
        self._count_files()
        return self.moves.program(dialect, words=words)

    def _count_files(self) -> None:
        """Say where the files begin whose moves are read: lines of reports count through all of them."""
        lines = sorted(set(self.moves.moves.lists["line"]))
        for part in parts(self.data):
            behind = bisect_right(lines, part.lines)
            count = self.data.count(b"\n", part.begin, part.end) + 1
            if part.name and behind < len(lines) and lines[behind] <= part.lines + count:
                what = f"{part.name} begins here: lines count through all files of the application"
                self.moves.remark(part.name, part.lines + 1, what)

    # -- flow ----------------------------------------------------------------------------------------

    def _nodes(self, nodes: list[Node], scope: Scope, depth: int) -> bool:
        """Follow statements; whether they all run."""
        for node in nodes:
            if isinstance(node, Block):
                self._block(node, scope, depth)
                continue
            if word_of(node.text) == "return":
                return False
            try:
                self._statement(node, scope, depth)
            except DecidedInRun as error:
                self.moves.decided(error)
            except ProgramError as error:
                self.refusals.append(error)
                self.moves.known = False
            self.taken += 1
            if self.taken % 4096 == 0:
                self.tell("read", min(self.taken / self.count, 1.0))
        return True

    def _block(self, block: Block, scope: Scope, depth: int) -> None:
        """Where the flow of a program parts and meets."""
        lines = block.lines()
        changed = self.reach.changed(lines)
        moving = any(self.reach.moves(line) for line in lines)
        self.alone &= not any(map(self.reach.moves_beside, lines))
        begin = block.branches[0][0]
        why = (
            f"it gets another value in the block of line {self._shown(begin.line)}, so it depends on the run"
        )
        for head in [head for head, _ in block.branches] + ([] if block.tail is None else [block.tail]):
            if _HAS_MOVE.search(head.text):
                self.refusals.append(not_read("a move in the line of a block", head.line))
        if block.loop:
            self.state.forget(changed, why, scope)
            self.moves.known &= not moving
        saved = self.state.saved(changed, scope)
        begun = self.moves.count
        for k, (_, nodes) in enumerate(block.branches):
            if k:
                self.state.put_back(saved)
                self.moves.known &= self.moves.count == begun
            self._nodes(nodes, scope, depth)
        self.moves.known &= not moving
        self.state.forget(changed, why, scope)

    def _shown(self, line: int) -> str:
        name, number = self._files.of(line)
        return f"{number} of {name}" if name else str(number)

    # -- statements ----------------------------------------------------------------------------------

    def _statement(self, line: Line, scope: Scope, depth: int) -> None:
        text = line.text
        if not balanced(text):
            raise ProgramError("a bracket is not closed in this line", line=line.line, code="OLP510")
        move, call = MOVE.fullmatch(text), _CALLED.fullmatch(text)
        if move is not None and not _HAS_MOVE.search(move[2]):
            self.moves.known &= self.alone
            self.moving.take(line, move, scope, repeated=self.reach.repeated(scope.routine))
        elif _HAS_MOVE.search(text):
            raise not_read("a move within a value is not read; write it in a line of its own", line.line)
        elif _ALTERED.search(text):
            raise not_read("the path is altered in the run", line.line)
        elif call is not None:
            self._call(line, call[1].decode("latin-1"), line.begin + call.start(2), scope, depth)
        elif word_of(text).startswith("taskcreate"):
            self._task(line, scope, depth)
        elif is_assignment(text):
            assign(self.state, line, scope)
            self._instructions(line, scope)
        elif _LINK.fullmatch(text):
            self._link(line, scope)
        elif CALL.fullmatch(text):
            self._instructions(line, scope)
        elif not _LEADS.match(text):
            shown = text[:60].decode("latin-1")
            raise ProgramError(f"`{shown}` is not a statement of VAL 3", line=line.line, code="OLP510")

    def _instructions(self, line: Line, scope: Scope) -> None:
        """What an instruction may do to the data that it is given."""
        names = self.reach.given(line)
        self.state.forget(names, f"line {self._shown(line.line)} may change it", scope)
        match = CALL.fullmatch(line.text)
        if match is not None and match[1].lower() in table.AWAY:
            self.moves.known = False

    def _task(self, line: Line, scope: Scope, depth: int) -> None:
        match = TASK.fullmatch(line.text)
        name = "" if match is None else match[1].decode("latin-1")
        if match is not None and line is self.reach.task:
            what = f"{name} is followed from here on: no other task moves the robot"
            self.moves.remark("task", line.line, what)
            self._call(line, name, line.begin + match.start(2), scope, depth)
        if not self.reach.moves_beside(line):
            return
        self.alone = False
        what = "another task may move the robot at the same time"
        if name in self.application.routines:
            what = (
                f"{name} is a task of its own, which moves the robot; correct it by itself, with "
                f"{name}.pgx in place of this program"
            )
        raise DecidedInRun(what, line=line.line, code="OLP512")

    def _link(self, line: Line, scope: Scope) -> None:
        """The frame that a point counts from, from here on."""
        begin = line.begin + line.text.index(b"(") + 1
        given = self.state.arguments(begin, line.end - 1)
        things = [self.state.thing(span, scope) for span in given]
        if len(things) != 2 or things[0] is None:
            return
        father = things[1]
        if father is None:
            name = self.data[slice(*given[1])].decode("latin-1").strip()
            things[0].father = (name, "0")
        else:
            things[0].father = (father.name, father.key)
        self.state.changed(things[0])

    def _call(self, line: Line, name: str, begin: int, scope: Scope, depth: int) -> None:
        given = self.state.arguments(begin, line.end - 1)
        routine = self.application.routines.get(name)
        if routine is None:
            self.moves.known = False
            self.moves.remark("called", line.line, f"{name} is in another application: correct that too")
            self._instructions(line, scope)
            return
        if depth >= _DEEPEST:
            raise not_read(f"programs call each other more than {_DEEPEST} deep", line.line)
        inner = self._given(routine, given, scope)
        self.moving.enter(line, routine)
        self._nodes(routine.nodes, inner, depth + 1)
        self.moving.leave()

    def _given(self, routine: Routine, given: list[tuple[int, int]], scope: Scope) -> Scope:
        """What the names of a program mean that is called with arguments."""
        inner = Scope(routine)
        for k, (name, kind, by_reference) in enumerate(routine.parameters):
            span = given[k] if k < len(given) else (-1, -1)
            thing = self.state.thing(span, scope) if span[0] >= 0 else None
            if thing is not None and by_reference:
                if thing in scope.own.values():
                    inner.own[name] = thing
                else:
                    inner.alias[name] = (thing.name, thing.key)
                continue
            own = Thing.empty(kind.removesuffix("Rx"), name, "0") if thing is None else thing.copy()
            if kind == "num" and span[0] >= 0:
                own.slots["value"] = self.state.number(span, scope)
            elif thing is None:
                own.why = "it is given by a call that does not state its numbers"
            inner.own[name] = own
        return inner
