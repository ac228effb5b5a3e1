"""Values of data while a program of VAL 3 is followed, and expressions that state them with numbers."""

from __future__ import annotations

from collections.abc import Sequence

from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.robots.poses import Pose, Quaternion, inverted, of_zyx, zyx_of
from olp.program.robots.targets import NOWHERE, Span
from olp.program.robots.val3.data import NO_NUMBER, NUMBERS, TRANSFORM, WORDS, Entry, Slot
from olp.program.text.numbers import LARGEST

#: A name with its index and its fields.
REFERENCE = pattern(rb"([A-Za-z_]\w*(?::\w+)?)\s*(?:\[\s*([^\[\]]*?)\s*\])?\s*((?:\.\s*\w+\s*)*)")
CALL = pattern(rb"(?s)([$A-Za-z_][\w:]*)\s*\((.*)\)")
_NUMBER = pattern(rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
#: Bytes that say where an argument ends.
_PARTING = pattern(rb"[\"()\[\]{},]")
_MARKS = (b"()", b"{}", b"[]")


@dataclass(slots=True, eq=False)
class Thing:
    """The value of a datum: its numbers, None where the text does not state one, and its further `words`.
    `entry` is where it is declared, and `father` the name and index of what it counts from. `why` says why
    nothing of it is known. `version` counts the values that the program gave it."""

    kind: str
    name: str
    key: str
    slots: dict[str, Slot | None]
    words: dict[str, str]
    entry: Entry | None = None
    father: tuple[str, str] | None = None
    why: str = ""
    version: int = 0
    grows: bool = False

    @staticmethod
    def empty(kind: str, name: str, key: str) -> Thing:
        """Data without a stated value: all numbers are zero, and have no bytes."""
        return Thing(kind, name, key, dict.fromkeys(NUMBERS.get(kind, ()), (NOWHERE, 0.0)), {})

    def copy(self) -> Thing:
        return Thing(
            self.kind, self.name, self.key, dict(self.slots), dict(self.words), self.entry, self.father,
            self.why, self.version, self.grows,
        )  # fmt: skip

    @property
    def shown(self) -> str:
        """The name as people and job files write it."""
        return self.name if self.key == "0" else f"{self.name}[{self.key}]"

    @property
    def declared(self) -> bool:
        """Whether all its numbers are those of its declaration."""
        return self.entry is not None and all(self.slots[n] == s for n, s in self.entry.slots.items())

    def known(self) -> list[Slot] | None:
        """All its numbers; None where one is not known."""
        found = [slot for slot in self.slots.values() if slot is not None and slot is not NO_NUMBER]
        return found if not self.why and len(found) == len(self.slots) else None

    def pose(self) -> Pose | None:
        numbers = self.known()
        return None if numbers is None else pose_of([value for _, value in numbers])


@dataclass(frozen=True, slots=True)
class Aggregate:
    """Numbers in braces, and the words of a second pair of braces."""

    span: Span
    parts: tuple[Span, ...]
    words: tuple[str, ...] = ()
    nested: bool = False


def pose_of(numbers: Sequence[float]) -> Pose:
    """The pose of x, y, z, rx, ry, rz."""
    x, y, z, *angles = numbers
    return Pose((x, y, z), of_xyz(angles))


def of_xyz(angles_deg: Sequence[float]) -> Quaternion:
    """Rx(first) Ry(second) Rz(third), in degrees: turned about x, then about the new y, then the new z."""
    first, second, third = angles_deg
    return inverted(of_zyx((-third, -second, -first)))


def xyz_of(turn: Quaternion, third_deg: float = 0.0) -> tuple[float, float, float]:
    """The angles of `of_xyz`. Where the second is a right angle, the third is `third_deg`."""
    third, second, first = zyx_of(inverted(turn), -third_deg)
    return (-first + 0.0, -second + 0.0, -third + 0.0)


def balanced(text: bytes) -> bool:
    """Whether every bracket is closed."""
    return all(text.count(marks[:1]) == text.count(marks[1:]) for marks in _MARKS)


def arguments(text: bytes, begin: int) -> list[Span]:
    """The bytes of the arguments of a list that begins at a byte, without blanks around them."""
    found, depth, first, quoted = [], 0, 0, False
    for match in _PARTING.finditer(text + b","):
        mark, place = match[0], match.start()
        if mark == b'"':
            quoted = not quoted
        elif quoted:
            continue
        elif mark in b"([{":
            depth += 1
        elif mark in b")]}":
            depth -= 1
        elif depth == 0:
            own = text[first:place]
            lead = begin + first + len(own) - len(own.lstrip())
            found.append((lead, lead + len(own.strip())))
            first = place + 1
    return [(a, b) for a, b in found if b > a]


def literal(text: bytes, begin: int) -> Slot | None:
    """The number that a text is, None where it is none."""
    match = _NUMBER.fullmatch(text)
    if match is None or abs(float(text)) >= LARGEST:
        return None
    return (begin, begin + len(text)), float(text)


def aggregate(text: bytes, begin: int) -> Aggregate | None:
    """The aggregate that a text is, None where it is none."""
    if text[:1] != b"{" or text[-1:] != b"}" or not balanced(text):
        return None
    span = begin, begin + len(text)
    parts = arguments(text[1:-1], begin + 1)
    if len(parts) == 2 and text[1:-1].lstrip()[:1] == b"{":
        (a, b), (c, d) = parts
        first, second = text[a - begin : b - begin], text[c - begin : d - begin]
        if first[-1:] != b"}" or second[:1] + second[-1:] != b"{}":
            return None
        words = tuple(w.strip().decode("latin-1").lower() for w in second[1:-1].split(b","))
        return Aggregate(span, tuple(arguments(first[1:-1], a + 1)), words, nested=True)
    return Aggregate(span, tuple(parts))


def words_of(words: Sequence[str]) -> dict[str, str]:
    """The words of a configuration by their names."""
    return dict(zip(WORDS, words, strict=False))


def transform(slots: Sequence[Slot | None]) -> dict[str, Slot | None]:
    return dict(zip(TRANSFORM, slots, strict=True))
