"""What the programs of an application may do: which move, which change data, and which are called again."""

from __future__ import annotations

import re
from collections.abc import Iterable

from olp.core.patterns import pattern
from olp.core.projects import FileLines
from olp.program.robots.line import Line
from olp.program.robots.val3.code import Routine, lines_in
from olp.program.robots.val3.files import Application
from olp.program.robots.val3.table import AWAY, STILL
from olp.program.robots.val3.values import REFERENCE, arguments

_MOVES = pattern(rb"(?i)\bmove[ljc]\s*\(")
_CALLED = pattern(rb"(?is)call\s+([A-Za-z_][\w:]*)\s*\((.*)\)")
_CREATES = pattern(rb"(?i)taskCreate(Sync)?\b")
#: A statement that begins a task: what it runs, and what it gives to that.
TASK = pattern(rb"(?is)taskCreate(?:Sync)?\b[^,]*,.*?,\s*([A-Za-z_][\w:]*)\s*\((.*)\)")
_SET = pattern(rb"([A-Za-z_]\w*)\s*(?:\[[^\[\]]*\])?\s*(?:\.\s*\w+\s*)*=(?!=)")
#: What gets a value, with its index.
_GIVEN = pattern(rb"[A-Za-z_]\w*\s*(?:\[([^\[\]]*)\]\s*)?(?:\.\s*\w+\s*)*=(?!=)")
_FOR = pattern(rb"(?i)for\s+([A-Za-z_]\w*)\s*(?:\[[^\[\]]*\])?\s*=")
_LINK = pattern(rb"(?i)link\s*\(\s*([A-Za-z_]\w*)")
_NAMED = pattern(rb"(?<![\w$:.])([$A-Za-z_]\w*)\s*\(")
#: Functions and statements that take data and do not change them.
_READS = STILL | frozenset(
    (
        b"if while until call switch case for return movel movej movec appro compose position here herej "
        b"link abs sqrt sin cos tan asin acos atan atan2 exp log ln power min max round roundup rounddown "
        b"trunc random limit sel tostring tonum chr asc len left right mid find replace insert delete clock "
        b"date and or not xor elseif isinrange configofjoint interpolatel interpolatec align band bor bnot "
        b"bxor getmonitorspeed workingmode estop ispowered iscalibrated getjointforce getlatch fromframe "
        b"taskcreate taskcreatesync do"
    ).split()
)


class Reach:
    """What the programs of an application do, whatever the run. `elsewhere` are data that programs which are
    not followed give other values, and where. `beside` are those that tasks may change at any time. `task` is
    the statement that begins the only task which moves the robot, where nothing else does: it is followed."""

    def __init__(self, application: Application, data: bytes) -> None:
        self._files, self.routines = FileLines(data), application.routines
        self._sets: dict[str, set[str]] = {name: set() for name in self.routines}
        self._moving = dict.fromkeys(self.routines, False)
        self._calls: dict[str, list[str]] = {}
        for name, routine in self.routines.items():
            lines = lines_in(routine.nodes)
            self._moving[name] = any(_MOVES.search(line.text) for line in lines)
            self._calls[name] = [called for line in lines if (called := self._called(line)) is not None]
        self._spread()
        first = application.first
        self.task = None if first is None else self._only_mover(first)
        begun = None if self.task is None else self._begun_by(self.task)
        if first is not None and begun is not None:
            self._calls[first.name].append(begun.name)
        self._count = self._counted(first)
        self.beside = self._beside(first)
        self.elsewhere: dict[str, str] = {}
        for name, routine in self.routines.items():
            if routine is first or self._count.get(name):
                continue
            for line in lines_in(routine.nodes):
                for own in self._own(line) - set(routine.locals) - {p[0] for p in routine.parameters}:
                    where = self._shown(line.line)
                    self.elsewhere.setdefault(
                        own, f"it gets another value in {where}, which this program does not run"
                    )

    def _shown(self, line: int) -> str:
        file, number = self._files.of(line)
        return f"line {number} of {file}" if file else f"line {number}"

    def _called(self, line: Line) -> str | None:
        match = _CALLED.fullmatch(line.text)
        if match is None or (name := match[1].decode("latin-1")) not in self.routines:
            return None
        return name

    # -- tasks ---------------------------------------------------------------------------------------

    def _begun_by(self, line: Line) -> Routine | None:
        """The program that a task runs; None for one that is not in this application."""
        match = TASK.fullmatch(line.text)
        return None if match is None else self.routines.get(match[1].decode("latin-1"))

    def moves_beside(self, line: Line) -> bool:
        """Whether a statement begins a task that may move the robot beside the programs that are followed."""
        if line is self.task or not _CREATES.match(line.text):
            return False
        routine = self._begun_by(line)
        return routine is None or self.moving(routine)

    def _only_mover(self, first: Routine) -> Line | None:
        """The statement of the first program that begins the only task which moves the robot; None where
        another one may, or it cannot be followed as a call."""
        self.task = None
        every = [line for routine in self.routines.values() for line in lines_in(routine.nodes)]
        movers = [line for line in every if self.moves_beside(line)]
        begins = [node for node in first.nodes if isinstance(node, Line) and movers == [node]]
        routine = self._begun_by(begins[0]) if begins else None
        match = _CREATES.match(begins[0].text) if begins else None
        if routine is None or match is None or match[1] or any(p[2] for p in routine.parameters):
            return None
        own = {routine.name, *self._counted(routine)}
        others = (line for r in self.routines.values() if r.name not in own for line in lines_in(r.nodes))
        away = any(not AWAY.isdisjoint(_words(line)) for line in others)
        return None if away or self._moving[first.name] else begins[0]

    def _beside(self, first: Routine | None) -> dict[str, str]:
        """The data that tasks change, or the first program while it is followed through one, and where."""
        found: dict[str, str] = {}
        for routine in self.routines.values():
            for line in lines_in(routine.nodes):
                begun = self._begun_by(line) if _CREATES.match(line.text) else None
                if begun is not None and line is not self.task:
                    match = TASK.fullmatch(line.text)
                    assert match is not None
                    for name in self._passed(match[2], begun.name):
                        found.setdefault(
                            name, f"the task of {self._shown(line.line)} may change it at any time"
                        )
        if first is not None and self.task is not None:
            behind = [line for line in lines_in(first.nodes) if line.begin > self.task.begin]
            for name in self.changed(behind) - set(first.locals):
                what = (
                    f"the program that begins the task of {self._shown(self.task.line)} changes it meanwhile"
                )
                found.setdefault(name, what)
        return found

    # -- changes -------------------------------------------------------------------------------------

    def _own(self, line: Line) -> set[str]:
        """The names that a statement gives a value itself."""
        found = set(self.given(line))
        for form in (_SET, _FOR, _LINK):
            match = form.match(line.text)
            if match is not None:
                found.add(match[1].decode("latin-1"))
        return found

    def given(self, line: Line) -> list[str]:
        """The names that a statement gives to instructions that may change them."""
        text, found = line.text, []
        if b"(" not in text:
            return []
        for match in _NAMED.finditer(text):
            if match[1].lower() in _READS or text[: match.start()].rstrip().lower().endswith(b"call"):
                continue
            for a, b in arguments(_inside(text, match.end()), 0):
                argument = REFERENCE.fullmatch(_inside(text, match.end())[a:b])
                if argument is not None and not argument[3]:
                    found.append(argument[1].decode("latin-1"))
        return found

    def _spread(self) -> None:
        """What a program calls, it does too."""
        own = {
            name: {n for line in lines_in(routine.nodes) for n in self._own(line)} - set(routine.locals)
            for name, routine in self.routines.items()
        }
        self._sets = own
        again = True
        while again:
            again = False
            for name, routine in self.routines.items():
                before = self._moving[name], len(self._sets[name])
                for line in lines_in(routine.nodes):
                    called = self._called(line)
                    if called is not None:
                        self._moving[name] |= self._moving[called]
                        self._sets[name] |= self._through(line, called) - set(routine.locals)
                again |= before != (self._moving[name], len(self._sets[name]))

    def _through(self, line: Line, called: str) -> set[str]:
        """The names of the caller that a call gives other values."""
        match = _CALLED.fullmatch(line.text)
        assert match is not None
        return self._passed(match[2], called)

    def _passed(self, given: bytes, called: str) -> set[str]:
        """The names that a program gives other values which has `given` arguments."""
        parameters = self.routines[called].parameters
        found = self._sets[called] - {name for name, _, _ in parameters}
        for (name, _, by_reference), (a, b) in zip(parameters, arguments(given, 0), strict=False):
            argument = REFERENCE.fullmatch(given[a:b])
            if by_reference and name in self._sets[called] and argument is not None:
                found.add(argument[1].decode("latin-1"))
        return found

    def _counted(self, first: Routine | None) -> dict[str, int]:
        """How often each program is called by those that run, 2 for several times."""
        count: dict[str, int] = {}
        waiting = [] if first is None else list(self._calls.get(first.name, ()))
        while waiting:
            name = waiting.pop()
            count[name] = count.get(name, 0) + 1
            if count[name] <= 2:
                waiting += self._calls[name]
        return count

    # -- what is asked -------------------------------------------------------------------------------

    def moving(self, routine: Routine) -> bool:
        return self._moving.get(routine.name, False)

    def moves(self, line: Line) -> bool:
        """Whether a statement may move the robot."""
        called = self._called(line)
        return _MOVES.search(line.text) is not None or (called is not None and self._moving[called])

    def changed(self, lines: Iterable[Line]) -> set[str]:
        """The names that statements may give other values."""
        found: set[str] = set()
        for line in lines:
            called = self._called(line)
            found |= self._own(line) if called is None else self._through(line, called)
        return found

    def used(self, program: str, name: str) -> str:
        """The first line that uses a number otherwise than as one of a target, empty for none; `program` has
        it, or the application where that is empty."""
        mention = re.compile(rb"(?<![\w.:])%s(?!\w)" % re.escape(name.encode("latin-1")))
        for routine in self.routines.values():
            if program != (routine.name if routine.has(name) else ""):
                continue
            for line in lines_in(routine.nodes):
                text = line.text
                if _MOVES.search(text) or self._called(line) is not None:
                    continue
                given = _GIVEN.match(text)
                if given is not None and not (given[1] and mention.search(given[1])):
                    value = text[given.end() :].strip()
                    text = b"" if value[:1] == b"{" or REFERENCE.fullmatch(value) else value
                if mention.search(text):
                    return self._shown(line.line)
        return ""

    def repeated(self, routine: Routine) -> bool:
        """Whether a program is called several times."""
        return self._count.get(routine.name, 0) > 1


def _words(line: Line) -> list[bytes]:
    """The names before brackets in a statement, in small letters."""
    return [match[1].lower() for match in _NAMED.finditer(line.text)]


def _inside(text: bytes, begin: int) -> bytes:
    """What stands between a bracket that opens before a byte and the one that closes it."""
    depth = 1
    for place in range(begin, len(text)):
        if text[place] in b"(":
            depth += 1
        elif text[place] in b")":
            depth -= 1
            if depth == 0:
                return text[begin:place]
    return text[begin:]
