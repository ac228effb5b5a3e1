"""Which statements of a RAPID text may move the robot, and behind which it is not known where it is."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import zip_longest

from olp.core.patterns import pattern
from olp.core.rapid_modules import GIVEN
from olp.core.values import dataclass
from olp.program.dialect import Support
from olp.program.robots.rapid.forms import FORMS, JOINT_MOVES
from olp.program.robots.rapid.table import TABLE
from olp.program.robots.rapid.text import Statement
from olp.program.robots.targets import Span

_ROUTINE = pattern(rb"(?i)(?:LOCAL\s+|TASK\s+)?(PROC|FUNC|TRAP|RECORD)\s+(?:\w+\s+)?(\w+)")
_PROC = pattern(rb"(?i)(?:LOCAL\s+)?(?:PROC|TRAP)\s+(\w+)")
_PARAMETER = pattern(rb"(\w+)\s*(?:\{[^}]*\}\s*)?(?=[,|)])")
#: A parameter through which a routine may change what its caller gives, and any.
_CHANGING = pattern(rb"(?i)\s*(?:INOUT|VAR|PERS|REF)\s")
_PART = pattern(
    rb"(?:[^,()\[\]{}]|\([^()]*(?:\([^()]*\)[^()]*)*\)|\[[^\[\]]*(?:\[[^\[\]]*\][^\[\]]*)*\]|\{[^{}]*\})+"
)
_WORD = pattern(rb"\s*(?<!\w)([A-Za-z]\w*)")
_HARMLESS_TAIL = pattern(
    rb"(?is).*[\s)](?:GOTO\s+\w+|RETURN\b.*|EXIT|EXITCYCLE|STOP|BREAK|(?:Set|Reset|Wait|TPWrite|Incr|Decr|"
    rb"SetDO|SetGO|SetAO|WaitTime)\b.*|[\w.{}]+\s*:=.*)"
)
_NAMES = pattern(rb"[A-Za-z]\w*")
#: Names that stand alone as arguments.
_MENTIONED = pattern(rb"(?:^|[\s,(])([A-Za-z]\w*)\s*(?=,|$)")
#: The same, and components and elements of data.
_PARTLY_MENTIONED = pattern(
    rb"(?:^|[\s,(=])([A-Za-z]\w*)\s*(?:\{[^}]*\}\s*)?(?:\.\s*\w+\s*(?:\{[^}]*\}\s*)?)*(?=[,\\]|$)"
)
#: Instructions that give components of data another value.
_WRITING = frozenset(
    (b"ADD", b"INCR", b"DECR", b"CLEAR", b"TPREADNUM", b"TPREADDNUM", b"TPREADFK", b"READANYBIN",
     b"UNPACKRAWBYTES", b"READRAWBYTES", b"GETDATAVAL", b"GETSYSDATA", b"BITSET", b"BITCLEAR")
)  # fmt: skip
#: Functions of the control that change an argument, as `changing_parameters`.
_WRITING_FUNCTIONS = {b"STRTOVAL": [False, True]}
_FUNCTION = pattern(rb"(?<![\w.\\])([A-Za-z]\w*)\s*\(")
#: The second argument of a search: where it writes what it has found.
_FOUND = pattern(rb"\A[^,]*(?:,\s*\\[^,]*)*,\s*([A-Za-z]\w*)")
#: An assignment to a whole datum.
_WHOLE = pattern(rb"(?s)\s*[A-Za-z]\w*\s*:=\s*(.*?)\s*")
_AREA = pattern(rb"(?i)\s*SingArea\b[^\\]*\\\s*(Wrist|LockAxis4)")
_ARC_MODE = pattern(rb"(?i)\s*CirPathMode\b[^\\]*\\\s*(CirPointOri|Wrist\w*)")
_OPENING = ord("(")
_CLOSING = ord(")")
#: The word of a short IF.
IF = b"IF"
#: What a short IF must not hold.
_MOVES = pattern(rb"(?i)(?<!GOTO )\b(?:Move|Trigg|Search|Arc|PDisp|EOffs)\w*\b")


def routine_of(statement: Statement) -> str:
    """The name of a routine that a statement begins, in capitals."""
    match = _PROC.match(statement.text) or _ROUTINE.match(statement.text)
    return "" if match is None else match[match.lastindex or 1].decode("latin-1").upper()


def parameters_of(statement: Statement) -> list[str]:
    """The names that callers give values to, in capitals, of the routine that a statement begins."""
    given = statement.text.partition(b"(")[2]
    return [name.decode("latin-1").upper() for name in _PARAMETER.findall(given)]


def changing_parameters(statements: Iterable[Statement]) -> dict[bytes, list[bool]]:
    """Of each routine by its name in capitals, whether it may change what it is given for each parameter that
    is not optional, in any of its declarations."""
    found: dict[bytes, list[bool]] = {}
    for statement in statements:
        if statement.block != "routine":
            continue
        name = routine_of(statement).encode("latin-1")
        parts = _PART.findall(statement.text.partition(b"(")[2].rpartition(b")")[0])
        own = [_CHANGING.match(part) is not None for part in parts if part.strip()[:1] != b"\\"]
        known = found.setdefault(name, own)
        if known is not own:
            both = zip_longest(known, own, fillvalue=True)
            found[name] = [a or b for a, b in both]
    return found


def _arguments(text: bytes, changing: list[bool]) -> list[bytes]:
    """The names that a call gives to parameters which may change them, and to optional ones."""
    names, place = [], 0
    for part in _PART.findall(text):
        own, _, optional = part.partition(b"\\")
        names += _NAMES.findall(optional)
        if own.strip():
            if place >= len(changing) or changing[place]:
                names += _NAMES.findall(own)
            place += 1
    return names


def _given_to_functions(text: bytes, changing: Mapping[bytes, list[bool]]) -> list[bytes]:
    """The names that a statement gives to functions which may change them."""
    names: list[bytes] = []
    for match in _FUNCTION.finditer(text) if b"(" in text else ():
        name = match[1].upper()
        own = _WRITING_FUNCTIONS.get(name) or changing.get(name, [])
        if any(own):
            names += _arguments(_inside(text, match.end()), own)
    return names


def _inside(text: bytes, begin: int) -> bytes:
    """What stands between a bracket before byte `begin` and the one that closes it."""
    depth = 1
    for place, byte in enumerate(text[begin:], begin):
        depth += (byte == _OPENING) - (byte == _CLOSING)
        if depth == 0:
            return text[begin:place]
    return text[begin:]


def area_of(statement: Statement) -> str:
    """By which switch of `SingArea` the tool does not turn evenly on straight moves; empty for others."""
    match = _AREA.match(statement.text)
    return "" if match is None else match[1].decode("latin-1")


def locks(area: str) -> bool:
    """Whether a switch of `SingArea` turns the tool otherwise at the end of a move, too."""
    return area.upper() == "LOCKAXIS4"


def arc_mode_of(statement: Statement) -> str:
    """By which switch of `CirPathMode` the tool turns otherwise on arcs than from their start to their end;
    empty for others."""
    match = _ARC_MODE.match(statement.text)
    return "" if match is None else match[1].decode("latin-1")


def first_of(
    say: Callable[[Statement], str], word: bytes, data: bytes, statements: Iterable[Statement]
) -> tuple[str, int]:
    """The first thing that statements say, with its line; "" and 0 where none does, as in a text without the
    `word`, which is in capitals."""
    if word not in data.upper():
        return "", 0
    said = ((say(statement), statement.line) for statement in statements)
    return next((each for each in said if each[0]), ("", 0))


def first_area(data: bytes, statements: Sequence[Statement]) -> tuple[str, int]:
    """The first switch of `SingArea`, with its line, and before it one that `locks`; as `first_of`."""

    def locking(statement: Statement) -> str:
        area = area_of(statement)
        return area if locks(area) else ""

    found = first_of(locking, b"SINGAREA", data, statements)
    return found if found[0] else first_of(area_of, b"SINGAREA", data, statements)


def may_move(text: bytes) -> bool:
    """Whether a short IF holds an instruction that moves."""
    return _MOVES.search(b" ".join(text.split())) is not None


def inner_move(statement: Statement) -> Statement | None:
    """The move in a short IF, None where that holds none."""
    for match in _WORD.finditer(statement.text):
        word = match[1].upper()
        if word in FORMS or word in JOINT_MOVES:
            begin = statement.begin + match.start(1)
            return Statement.of(statement.line, begin, statement.end, statement.text[match.start(1) :])
    return None


def calls(text: bytes) -> bool:
    """Whether a short IF may call a routine."""
    return _HARMLESS_TAIL.fullmatch(text) is None


def is_assignment(statement: Statement) -> bool:
    match = GIVEN.match(statement.text.lstrip())
    return match is not None


def value_in(statement: Statement) -> Span | None:
    """The bytes of what a statement gives to a whole datum; None for others."""
    match = _WHOLE.fullmatch(statement.text)
    return None if match is None else (statement.begin + match.start(1), statement.begin + match.end(1))


def given_in(statement: Statement, changing: Mapping[bytes, list[bool]]) -> list[str]:
    """The names that may get another value in a statement, in capitals: those that it assigns, and what it
    gives to a routine, a function or an instruction. A move changes no data but the point that a search has
    found. `changing` are routines of the text, as `changing_parameters` has them."""
    text, word = statement.text, statement.word
    names = [] if statement.block == "routine" else _given_to_functions(text, changing)
    if statement.block:
        return [name.decode("latin-1").upper() for name in names]
    inner = inner_move(statement) if word == IF else None
    if inner is not None:
        return given_in(inner, changing)
    if is_assignment(statement):
        names += GIVEN.findall(text)
    elif word in FORMS:
        names += _FOUND.findall(text) if FORMS[word].stopped else []
    elif word in JOINT_MOVES or word.startswith(b"MOVE"):
        pass
    elif word in changing:
        names += _arguments(text.lstrip()[len(word) :], changing[word])
    else:
        form = _PARTLY_MENTIONED if word in _WRITING or word not in TABLE else _MENTIONED
        names += [*GIVEN.findall(text), *form.findall(text.lstrip().partition(b" ")[2])]
    return [name.decode("latin-1").upper() for name in names]


@dataclass(slots=True)
class _Routine:
    moves: bool
    calls: set[str]


def moving_routines(statements: Sequence[Statement]) -> tuple[set[str], set[str]]:
    """The routines of a text that may move the robot, and all routines of it; names in capitals."""
    routines: dict[str, _Routine] = {}
    current: _Routine | None = None
    for statement in statements:
        if statement.block == "routine":
            current = routines.setdefault(routine_of(statement), _Routine(moves=False, calls=set()))
            continue
        if current is None or statement.block or is_assignment(statement):
            continue
        word = statement.word
        row = TABLE.get(word)
        if (
            (word == IF and calls(statement.text))
            or (row is not None and row[0] in (Support.CORRECTED, Support.REFUSED))
            or statement.text.lstrip()[:1] == b"%"
        ):
            current.moves = True
        elif row is None and word:
            current.calls.add(word.decode("latin-1"))
    moving = {name for name, routine in routines.items() if routine.moves}
    while True:
        more = {
            name
            for name, routine in routines.items()
            if name not in moving and any(c in moving or c not in routines for c in routine.calls)
        }
        if not more:
            return moving, set(routines)
        moving |= more
