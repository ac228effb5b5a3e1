"""The parts of a job of INFORM as text: header, positions, statements. Nothing here knows what they mean."""

from __future__ import annotations

from collections import Counter

from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.robots.targets import Span
from olp.program.text.numbers import LARGEST

_LINE = pattern(rb"([^\r\n]*)(\r\n|\n|\r|\Z)")
#: Lines that hold from where they stand for all positions behind them, and the two that say what these are.
_HEADER = pattern(rb"///[ \t]*(USER|TOOL|POSTYPE|RCONF|RECTAN|PULSE|ANGLE)\b[ \t]*([^\r\n]*?)[ \t]*")
_FORMS = (b"RECTAN", b"PULSE", b"ANGLE")
_KEYS = {b"USER": "user", b"TOOL": "tool", b"POSTYPE": "kind", b"RCONF": "posture"}
#: Parts of a header in the order in which controls write them.
_ORDER = ("user", "tool", "kind", "form", "posture")
_POSITION = pattern(rb"[ \t]*(BC|EC|BP|EX|C|P)(\d{1,6})[ \t]*=[ \t]*([^\r\n]*?)[ \t]*")
_NUMBER = pattern(rb"[ \t]*([-+]?(?:\d+\.?\d*|\.\d+))[ \t]*(,|\Z)")
#: The end of what is executed in a line.
_REMARK = pattern(rb"[ \t]*//.*|[ \t\x00\x1a]+\Z")
_STRING = pattern(rb'"[^"]*"')
_COUNTS = pattern(rb"(?m)^[ \t]*///[ \t]*NPOS[ \t]+(\d+)[ \t]*,[ \t]*(\d+)[ \t]*,[ \t]*(\d+)")
_COUNTED = pattern(rb"(?m)^[ \t]*(C|BC|EC)\d+[ \t]*=")
#: Positions that are taught, in the order of their counts.
TAUGHT = (b"C", b"BC", b"EC")
#: Sections that state no positions, and that execute nothing.
_INSTRUCTIONS = b"INST"
_ARGUMENTS = b"ARGINFO"
#: What the teach pendant puts at the end of a file.
_ENDS = b" \t\x00\x1a"
#: What editors put at the begin of a text in UTF-8.
_MARK = b"\xef\xbb\xbf"


@dataclass(frozen=True, slots=True)
class Header:
    """What holds for a position: its frame, tool, kind, form and posture, and the lines that say so."""

    user: bytes = b""
    tool: bytes = b""
    kind: bytes = b""
    form: bytes = b""
    posture: bytes = b""
    lines: tuple[tuple[str, bytes], ...] = ()

    def with_line(self, name: bytes, value: bytes, line: bytes) -> Header:
        """The same behind another line of a header."""
        key = _key(name)
        if (key, line) in self.lines:
            return self
        values = {"user": self.user, "tool": self.tool, "kind": self.kind, "form": self.form,
                  "posture": self.posture, key: name if name in _FORMS else value}  # fmt: skip
        lines = {**dict(self.lines), key: line}
        return Header(**values, lines=tuple(lines.items()))

    def before(self, other: Header, eol: bytes) -> bytes:
        """The lines that lead from another header to this one."""
        if other is self:
            return b""
        own, others = dict(self.lines), dict(other.lines)
        return b"".join(own[key] + eol for key in _ORDER if key in own and own[key] != others.get(key))


@dataclass(frozen=True, slots=True)
class Position:
    """A position: its `line`, its bytes (from the begin of the line), and its numbers with their bytes. They
    are None where one of them is no number."""

    line: int
    span: Span
    header: Header
    numbers: tuple[tuple[Span, float], ...] | None


@dataclass(frozen=True, slots=True)
class Statement:
    """What a line executes: its bytes, without blanks around it and the remark behind it."""

    line: int
    span: Span
    text: bytes


@dataclass(frozen=True, slots=True)
class Job:
    """A job. `positions` are those of each name, such as C1, BC1 and P60. `places` are the bytes where
    further ones go, by C, BC and EC, with the headers that hold there."""

    positions: dict[tuple[bytes, int], list[Position]]
    statements: list[Statement]
    places: dict[bytes, tuple[int, Header]]


def _key(name: bytes) -> str:
    return _KEYS.get(name, "form")


def job_of(data: bytes) -> Job:
    """The parts of a text."""
    positions: dict[tuple[bytes, int], list[Position]] = {}
    statements: list[Statement] = []
    header, section = Header(), b""
    # behind the last of its kind, else before the first position of all
    places: dict[bytes, tuple[int, Header]] = {}
    first: tuple[int, Header] | None = None
    for number, line in enumerate(_LINE.finditer(data), 1):
        text = line[1]
        bare = text.removeprefix(_MARK).strip(_ENDS) if number == 1 else text.strip(_ENDS)
        if not bare or bare[:1] == b"'":
            continue
        if bare[:1] == b"/":
            if bare[:2] == b"//" and bare[2:3] != b"/":
                section = bare[2:].split(maxsplit=1)[0].upper() if bare[2:].strip() else b""
            head = _HEADER.fullmatch(bare)
            if head is not None and section != _INSTRUCTIONS:
                header = header.with_line(head[1], head[2], bare)
            continue
        stated = None if section == _INSTRUCTIONS else _POSITION.fullmatch(text)
        if stated is not None:
            key = stated[1], int(stated[2])
            span = line.start(), line.start() + stated.end(3)
            own = Position(number, span, header, _numbers(data, (line.start() + stated.start(3), span[1])))
            positions.setdefault(key, []).append(own)
            first = first or (line.start(), header)
            if key[0] in TAUGHT and line[2]:
                places[key[0]] = line.end(), header
        elif section != _ARGUMENTS:
            statements.append(_statement(number, line.start(), text))
    if first is not None:
        places.setdefault(b"C", first)
    return Job(positions, statements, places)


def _statement(number: int, begin: int, text: bytes) -> Statement:
    shown = _STRING.sub(lambda hit: b"_" * len(hit[0]), text)
    remark = _REMARK.search(shown)
    end = len(text) if remark is None else remark.start()
    lead = len(text) - len(text.lstrip())
    return Statement(number, (begin + lead, begin + end), text[lead:end])


def _numbers(data: bytes, span: Span) -> tuple[tuple[Span, float], ...] | None:
    """The numbers of a list; None where it is in another form."""
    found: list[tuple[Span, float]] = []
    place = span[0]
    while True:
        match = _NUMBER.match(data, place, span[1])
        if match is None or abs(float(match[1])) >= LARGEST:
            return None
        found.append((match.span(1), float(match[1])))
        place = match.end()
        if match[2] != b",":
            return tuple(found)


def counted(data: bytes) -> dict[bytes, tuple[Span, int]]:
    """The bytes of the counts of taught positions in the header, and these, by C, BC and EC. One that is
    wrong is left out."""
    match = _COUNTS.search(data)
    if match is None:
        return {}
    own = Counter(_COUNTED.findall(data))
    stated = {kind: (match.span(k), int(match[k])) for k, kind in enumerate(TAUGHT, 1)}
    return {kind: stated[kind] for kind in TAUGHT if stated[kind][1] == own[kind]}


def added_to(text: bytes) -> Counter[bytes]:
    """How many positions lines declare, by C, BC and EC."""
    return Counter(_COUNTED.findall(text))


def without_repeats(before: bytes, added: bytes) -> bytes:
    """Lines of positions that follow a text, without those of headers that hold already."""
    current: dict[str, bytes] = {}
    for line in _LINE.finditer(before):
        head = _HEADER.fullmatch(line[1].strip(_ENDS))
        if head is not None:
            current[_key(head[1])] = head[0]
    pending, kept = dict(current), b""
    for line in _LINE.finditer(added):
        head = _HEADER.fullmatch(line[1].strip(_ENDS))
        if head is not None:
            pending[_key(head[1])] = head[0]
        elif line[1]:
            kept += _changes(current, pending, line[2]) + line[0]
            current = dict(pending)
    ends = _LINE.match(added)
    return kept + _changes(current, pending, b"\n" if ends is None else ends[2])


def _changes(current: dict[str, bytes], wanted: dict[str, bytes], eol: bytes) -> bytes:
    return b"".join(wanted[key] + eol for key in _ORDER if wanted.get(key, b"") != current.get(key, b""))
