"""What the statements of a job do to positions and moves before these are read: where shifts hold, and which
position variables the run gives other values."""

from __future__ import annotations

from collections.abc import Sequence

from olp.core.patterns import pattern
from olp.program.robots.inform.table import ASSIGNING, BLOCKS, MOVING, POINTING, STILL
from olp.program.robots.inform.text import Statement

_WORD = pattern(rb"(?i)\*|[A-Z][A-Z0-9$]*")
_MOVE = pattern(rb"(?i)(?:S|E|EI|I)?MOV[A-Z]?\b")
_VARIABLE = pattern(rb"(?i)(?<![\w$])P(?:X?)(\d{1,5})(?!\d)")
#: One that is chosen in the run.
_CHOSEN = pattern(rb"(?i)(?<![\w$])PX?\[")
_LABEL = pattern(rb"\*([\w-]+)")
_STATION = rb"MOV[JL][ \t]+L?(?:EC|EX)\d+\b"
#: A move of positioners alone.
STATION_ALONE = pattern(rb"(?i)" + _STATION + rb"(?!.*\+(?!" + _STATION + rb"))")
#: Moves of an arc.
ARC_MOVES = frozenset((b"MOVC", b"SMOVC"))
#: Moves behind which an arc begins.
_LEADING = frozenset((b"MOVL", b"MOVJ", b"SMOVL"))
#: Moves that an arc consists of.
_POINTS = 3
#: Statements behind which the next one does not follow, unless they have a condition.
_ENDS = frozenset((b"RET", b"END", b"ABORT"))
_CONDITION = pattern(rb"(?i)(?<!\w)IF(?!\w)")


def word_of(text: bytes) -> bytes:
    """The first word of a statement in capitals; `*` for a label."""
    match = _WORD.match(text)
    return b"" if match is None else match[0].upper()


class Arcs:
    """The arcs of a job: `points` are the three moves (MOVC) of each, by the line of each. Another move of
    the robot stands before them, and no fourth one behind. Nothing between leads elsewhere. `runs` are all
    moves (MOVC, SMOVC) with no other move between, however many, and whatever else is. `parting` are the
    lines of moves that only part an arc from the next one, which begins where it ends."""

    def __init__(self, statements: Sequence[Statement]) -> None:
        self.points: dict[int, tuple[Statement, ...]] = {}
        self.runs: dict[int, tuple[Statement, ...]] = {}
        self.parting: set[int] = set()
        run: list[Statement] = []
        before: list[Statement] = []
        led: Statement | None = None
        for statement in statements:
            word = word_of(statement.text)
            if word in ARC_MOVES:
                run.append(statement)
            elif word not in STILL:
                before = self._closed(before, led, run)
                moves = word in _LEADING and STATION_ALONE.match(statement.text) is None
                run, led = [], statement if moves else None
        self._closed(before, led, run)
        self._gather(statements)

    def _gather(self, statements: Sequence[Statement]) -> None:
        run: list[Statement] = []
        for statement in (some for some in statements if _MOVE.match(some.text)):
            if word_of(statement.text) in ARC_MOVES:
                run.append(statement)
                self.runs |= {every.line: tuple(run) for every in run}
            else:
                run = []

    def _closed(
        self, before: list[Statement], led: Statement | None, run: list[Statement]
    ) -> list[Statement]:
        """Add a run of moves behind another move, which may be the one that parts it from the run before.
        Gives the run where it is an arc."""
        if led is None or len(run) != _POINTS:
            return []
        self.points |= {statement.line: tuple(run) for statement in run}
        first, parting = run[0].text[4:].split(), led.text[4:].split()
        if before and word_of(led.text) == b"MOVL" and before[-1].text[4:].split()[:1] == first[:1]:
            self.parting |= {led.line, run[0].line} if first == parting else set()
        return run


class Flow:
    """What is known of a whole job. `assigned` and `used` are lines in which position variables get another
    value, or give their own to others; `chosen` is a line in which the run decides which one does."""

    def __init__(self, statements: Sequence[Statement]) -> None:
        self.assigned: dict[int, int] = {}
        self.used: dict[int, int] = {}
        self.chosen = 0
        self._moved: dict[int, str] = {}
        for statement in statements:
            self._variables(statement)
        if any(word_of(statement.text) in MOVING for statement in statements):
            self._follow(statements)

    def moved(self, statement: Statement) -> str:
        """What moves the targets of the moves of a statement, empty where nothing does."""
        return self._moved.get(statement.line, "")

    def _variables(self, statement: Statement) -> None:
        text = statement.text
        word = word_of(text)
        if not word or word in POINTING or _MOVE.match(text):
            return
        assigns = word in ASSIGNING
        if assigns and _CHOSEN.search(text):
            self.chosen = self.chosen or statement.line
        for k, match in enumerate(_VARIABLE.finditer(text)):
            first = assigns and k == 0 and match.start() == len(word) + _blank(text, len(word))
            table = self.assigned if first else self.used
            table.setdefault(int(match[1]), statement.line)

    def _follow(self, statements: Sequence[Statement]) -> None:
        """Which statements a shift reaches, also by jumps and loops. A label has what any way to it has."""
        labels: dict[bytes, str] = {}
        size = -1
        while size != len(labels):
            size, way = len(labels), _Way(labels)
            for statement in statements:
                if way.behind(statement):
                    self._moved[statement.line] = way.state


class _Way:
    """The way through a job from its first line on: the shift of each place, empty for none. `labels` are
    those of labels and of the begins of loops that are reached from elsewhere, by their names or lines."""

    def __init__(self, labels: dict[bytes, str]) -> None:
        self.labels, self.state = labels, ""
        self._ended = False
        # of each block: where it begins, the shift there, and that at the ends of its branches
        self._blocks: list[tuple[bytes, str, list[str]]] = []

    def behind(self, statement: Statement) -> str:
        """The shift of a statement."""
        if self._ended:
            self.state, self._ended = "", False
        word, text = word_of(statement.text), statement.text
        if word == b"*":
            match = _LABEL.match(text)
            self.state = self.state or self.labels.get(b"" if match is None else match[1], "")
        elif word in MOVING:
            self.state = MOVING[word][1]
        elif any(word == end for end, _ in MOVING.values()):
            self.state = ""
        elif word in BLOCKS:
            self._block(BLOCKS[word], b"*%d" % statement.line)
        if self.state and word in (b"JUMP", b"JMP"):
            for label in _LABEL.findall(text):
                self.labels.setdefault(label, self.state)
        self._ended = word in _ENDS and _CONDITION.search(text) is None
        return self.state

    def _block(self, kind: str, begin: bytes) -> None:
        """Behind a block is what any way through it has, and at the begin of a loop what its end has."""
        if kind in ("if", "loop"):
            self.state = self.state or self.labels.get(begin, "")
            self._blocks.append((begin if kind == "loop" else b"", self.state, []))
        elif self._blocks:
            loop, before, ends = self._blocks[-1]
            ends.append(self.state)
            if kind == "else":
                self.state = before
                return
            self._blocks.pop()
            if loop and self.state:
                self.labels.setdefault(loop, self.state)
            self.state = next((state for state in (*ends, before) if state), "")


def _blank(text: bytes, place: int) -> int:
    return len(text[place:]) - len(text[place:].lstrip())
