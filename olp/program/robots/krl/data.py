"""What a KRL text declares and assigns: positions, frames, and the tool and base numbers of taught moves."""

from __future__ import annotations

import re
from collections.abc import Iterable

from olp.core.errors import ProgramError
from olp.core.paired import own_end, place_of
from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.robots.krl.text import SIX, Aggregate, Line, aggregate
from olp.program.robots.moves import DecidedInRun
from olp.program.robots.poses import Pose, of_zyx
from olp.program.robots.targets import Span

_LEAD = rb"(?:(?:GLOBAL|DECL|CONST)\s+)+\w+\s+"
_PLAIN = rb"(?:INT|REAL|BOOL|CHAR|FRAME|POS|E3POS|E6POS|AXIS|E3AXIS|E6AXIS|SIGNAL|STRUC|ENUM|FDAT)\s+"
_DECLARED = pattern(rb"(?i)(?:" + _LEAD + rb"|" + _PLAIN + rb")(?=[A-Z_$])")
_OTHER = pattern(rb"(?i)(?:GLOBAL\s+)?(?:EXT|EXTFCT|STRUC|ENUM|SIGNAL|IMPORT|CHANNEL)\b")
_VALUE = pattern(rb"([\w$]+)\s*(?:\[([^\]]*)\])?\s*(?:=\s*(.*))?", re.DOTALL)
#: What stands in the brackets of an index; it may itself have one.
_INDEX = rb"(?:[^\[\]]|\[[^\[\]]*\])*"
_ASSIGNED = pattern(
    rb"([\w$]+)\s*(?:\[("
    + _INDEX
    + rb")\])?\s*((?:\.\s*[\w$]+\s*(?:\["
    + _INDEX
    + rb"\])?\s*)*)=(?!=)\s*(.*)",
    re.DOTALL,
)
#: What a trigger gives another value while the robot goes on.
_BEHIND = pattern(rb"(?i)TRIGGER\b.*\bDO\s+(\w+)[^=]*=(?!=)")
#: The first words of both.
_DECLARING = frozenset(
    (b"GLOBAL", b"DECL", b"CONST", b"INT", b"REAL", b"BOOL", b"CHAR", b"FRAME", b"POS", b"E3POS", b"E6POS",
     b"AXIS", b"E3AXIS", b"E6AXIS", b"SIGNAL", b"STRUC", b"ENUM", b"FDAT", b"EXT", b"EXTFCT", b"IMPORT",
     b"CHANNEL")
)  # fmt: skip
_SECTIONS = frozenset((b"GLOBAL", b"DEFDAT", b"ENDDAT"))
_SECTION = pattern(rb"(?i)(?:GLOBAL\s+)?(DEFDAT|ENDDAT)\b")
_TAUGHT = pattern(rb"(?i)\b(TOOL_NO|BASE_NO)\s+(\d+)")
_FIXED = pattern(rb"(?i)\bIPO_FRAME\s+#TCP\b")


@dataclass(frozen=True, slots=True)
class Value:
    """A value with a name: its line, and its bytes. `listed`: it is in a list of data (DEFDAT), else a
    statement assigns it."""

    line: Line
    span: Span
    listed: bool


@dataclass(frozen=True, slots=True)
class Taught:
    """Tool and base of a taught point (FDAT), None where the text does not state them. `fixed`: the tool
    stands still."""

    tool: int | None
    base: int | None
    fixed: bool


def assigned(text: bytes) -> re.Match[bytes] | None:
    """An assignment: name, index, components, value; None for other statements."""
    return _ASSIGNED.fullmatch(text)


def is_declaration(text: bytes) -> bool:
    return _DECLARED.match(text) is not None or _OTHER.match(text) is not None


def declares(line: Line) -> bool:
    """Whether a line is a declaration."""
    return line.word in _DECLARING and is_declaration(line.text)


def key_of(name: bytes, index: bytes | None) -> str:
    """A name with its index, in capitals and without blanks."""
    if index is not None:
        name = name + b"[" + b"".join(index.split()) + b"]"
    return name.decode("latin-1").upper()


class Declared:
    """All values of a text by their names (`key_of`), and the lines where a name gets a part of a value, or
    one that is computed. What the control's own data state counts where the program states nothing: `taken`
    are the names of those that were asked for, each with the line that does, and where it is stated."""

    def __init__(self, data: bytes, lines: Iterable[Line]) -> None:
        self.data = data
        self.values: dict[str, list[Value]] = {}
        self.changed: dict[str, int] = {}
        self.taken: dict[str, tuple[int, str]] = {}
        self._system: dict[str, list[Value]] = {}
        #: names that a routine declares as its own, without a value, with their lines
        self._own: dict[str, int] = {}
        self._own_end = own_end(data)
        self._single: dict[str, tuple[Value, Aggregate]] = {}
        self._aggregates: dict[Span, Aggregate | None] = {}
        listed = False
        for line in lines:
            section = _SECTION.match(line.text) if line.word in _SECTIONS else None
            if section is not None:
                listed = section[1].upper() == b"DEFDAT"
                continue
            self._take(line, listed=listed)

    def _take(self, line: Line, *, listed: bool) -> None:
        head = _DECLARED.match(line.text) if line.word in _DECLARING else None
        if head is None and b"=" not in line.text:
            return
        behind = _BEHIND.match(line.text) if line.word == b"TRIGGER" else None
        if behind is not None:
            self.changed.setdefault(key_of(behind[1], None), line.line)
            return
        place = 0 if head is None else head.end()
        match = assigned(line.text) if head is None else _VALUE.fullmatch(line.text, place)
        if match is None:
            return
        value = 4 if head is None else 3
        if head is not None and match[value] is None and not listed:
            self._own.setdefault(key_of(match[1], None), line.line)
        if match[value] is None or (head is None and match[1][:1] == b"$"):
            return
        key, span = key_of(match[1], match[2]), match.span(value)
        if match[2] is not None and not match[2].strip().isdigit():
            # any element of the array
            self.changed.setdefault(key_of(match[1], None), line.line)
        if head is None and match[3].strip():
            self.changed.setdefault(key, line.line)
            return
        own = (line.begin + span[0], line.begin + span[1])
        values = self.values if line.begin < self._own_end else self._system
        values.setdefault(key, []).append(Value(line, own, listed))

    def change(self, name: bytes, line: int) -> None:
        """A call may give a name another value."""
        self.changed.setdefault(key_of(name, None), line)

    def value(self, key: str, line: int, what: str) -> tuple[Value, Aggregate] | None:
        """The only value of a name and its numbers, None where the text states none. Raises ProgramError
        where it depends on the run, or is computed."""
        if key in self._single:
            return self._single[key]
        found = self.values.get(key, [])
        if not found and key in self._system:
            found = self._system[key]
            self.taken.setdefault(key, (line, place_of(self.data, found[0].line.line)))
        array = key.partition("[")[0]
        again = self.changed.get(key) or self.changed.get(array)
        if len({self.data[slice(*value.span)] for value in found}) > 1:
            again = found[1].line.line
        if again is None and any(value.listed for value in found):
            # one of the same name in a routine is another one
            again = self._own.get(array)
        if again is not None:
            raise DecidedInRun(
                f"{what} {key} gets another value in {place_of(self.data, again)}, so its value here depends "
                "on the run; state it once, with its numbers",
                line=line,
                code="OLP533",
            )
        if not found:
            return None
        numbers = self.aggregate(found[0].span)
        if numbers is None:
            raise DecidedInRun(
                f"{what} {key} is not stated with its numbers in {place_of(self.data, found[0].line.line)}",
                line=line,
                code="OLP533",
            )
        self._single[key] = found[0], numbers
        return found[0], numbers

    def system_value(self, key: str, line: int) -> Aggregate | None:
        """The numbers that the control's own data state for a name, None where they state none."""
        found = self._system.get(key, [])
        numbers = self.aggregate(found[0].span) if len(found) == 1 else None
        if numbers is not None:
            self.taken.setdefault(key, (line, place_of(self.data, found[0].line.line)))
        return numbers

    def aggregate(self, span: Span) -> Aggregate | None:
        """The aggregate that bytes are (`text.aggregate`), which is read once."""
        if span not in self._aggregates:
            self._aggregates[span] = aggregate(self.data, span)
        return self._aggregates[span]

    def frame(self, key: str, line: int) -> Pose | None:
        """The pose of a frame with a name; as `value`."""
        found = self.value(key, line, "the frame")
        return None if found is None else pose_of(found[1], line, f"the frame {key}")

    def taught(self, name: str) -> Taught | None:
        """Tool and base of a taught point; None where the text states none, or several."""
        found = self.values.get(name, [])
        if len(found) != 1 or name in self.changed:
            return None
        text = self.data[slice(*found[0].span)]
        numbers = {word.upper(): int(number) for word, number in _TAUGHT.findall(text)}
        return Taught(numbers.get(b"TOOL_NO"), numbers.get(b"BASE_NO"), _FIXED.search(text) is not None)


def pose_of(numbers: Aggregate, line: int, what: str = "the position") -> Pose:
    """The pose of an aggregate. Raises ProgramError where it is none."""
    if numbers.joints or not numbers.whole:
        raise ProgramError(
            f"{what} lacks one of X, Y, Z, A, B, C; state all of them", line=line, code="OLP533"
        )
    x, y, z, *angles = numbers.numbers[SIX]
    return Pose((x, y, z), of_zyx(angles))
