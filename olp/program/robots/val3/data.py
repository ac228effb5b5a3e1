"""The data of an application (`.dtx`): points, joints, frames, tools, transforms and motion descriptions.

Both forms are read, that of VAL 3 s7 and later (`Value` elements with a key), and that of s6 (`valuePoint`
with an index, and elements for its numbers). A number that is left out is zero, and has no bytes of its own:
it gets a place within the name of the element, which no other number has.
"""

from __future__ import annotations

from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.robots.targets import NOWHERE, Span
from olp.program.robots.val3.xml import Element, Lines
from olp.program.text.numbers import LARGEST

TRANSFORM = ("x", "y", "z", "rx", "ry", "rz")
JOINTS = ("j1", "j2", "j3", "j4", "j5", "j6")
WORDS = ("shoulder", "elbow", "wrist")
#: Types of data that say where the robot is or goes, and the names of their numbers.
NUMBERS = {
    "point": TRANSFORM, "pointRx": TRANSFORM, "pointRs": TRANSFORM, "frame": TRANSFORM, "tool": TRANSFORM,
    "trsf": TRANSFORM, "joint": JOINTS, "jointRx": JOINTS, "jointRs": JOINTS[:4],
    "mdesc": ("accel", "vel", "decel", "tmax", "rmax", "leave", "reach"),
    "num": ("value",),
}  # fmt: skip
#: What each type of point and joint is called here.
KINDS = {"pointRx": "point", "pointRs": "point", "jointRx": "joint", "jointRs": "joint"}
_NUMBER = pattern(rb"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*")
_FATHER = pattern(rb"\s*([\w:]+)\s*(?:\[\s*(\d+)\s*\])?\s*")
_ARRAY = ("array", "")

#: A number: its bytes, and its value.
Slot = tuple[Span, float]
#: What is stated as a number, and is none.
NO_NUMBER: Slot = (NOWHERE, float("nan"))


@dataclass(frozen=True, slots=True)
class Entry:
    """A value of the datum `name`: its line, its bytes, and those of the `host` that has its numbers. `slots`
    are its numbers, `words` the rest of what it says. `father` is the frame or tool that it counts from."""

    name: str
    line: int
    span: Span
    host: Span
    index: Span
    slots: dict[str, Slot]
    words: dict[str, str]
    father: tuple[str, str] | None


@dataclass(frozen=True, slots=True)
class Datum:
    """Data of one name: its `kind` without Rx or Rs, its line, its entries by their index, the bytes of its
    stated `size` (None where it states none), and whether it can get further entries."""

    name: str
    kind: str
    line: int
    entries: dict[str, Entry]
    size: Span | None
    grows: bool

    def following(self, data: bytes) -> int:
        """The first index that no entry has."""
        stated = 0
        if self.size is not None and data[slice(*self.size)].strip().isdigit():
            stated = int(data[slice(*self.size)])
        return max([stated, *(int(index) + 1 for index in self.entries if index.isdigit())])

    @property
    def end(self) -> int:
        """The last byte of its last entry."""
        return max(entry.span[1] for entry in self.entries.values())


class Reader:
    """Reads the data of one file. `line_of` counts lines of the whole text."""

    def __init__(self, data: bytes, line_of: Lines) -> None:
        self.data, self.line_of = data, line_of

    def all_of(self, root: Element) -> list[Datum]:
        found = [self._datum(element) for element in root.all_of("Data")]
        for section in root.all_of(*(f"{kind}Section" for kind in NUMBERS)):
            kind = section.name.removesuffix("Section")
            found += [self._old(element, kind) for element in section.children if element.name == kind]
        return [datum for datum in found if datum is not None]

    # -- s7 and later --------------------------------------------------------------------------------

    def _datum(self, element: Element) -> Datum | None:
        kind = element.text(self.data, "type")
        if kind not in NUMBERS:
            return None
        entries: dict[str, Entry] = {}
        name = element.text(self.data, "name")
        for value in element.children:
            if value.name != "Value":
                continue
            father = _FATHER.fullmatch(value.text(self.data, "fatherId").encode("latin-1", "replace"))
            named = None if father is None else (father[1].decode(), (father[2] or b"0").decode())
            key = value.attributes.get("key", (value.begin, value.begin))
            entries[value.text(self.data, "key") or "0"] = self._entry(name, value, [value], key, kind, named)
        grows = element.text(self.data, "xsi:type") in _ARRAY
        return Datum(
            element.text(self.data, "name"), KINDS.get(kind, kind), self.line_of(element.begin), entries,
            element.attributes.get("size"), grows,
        )  # fmt: skip

    # -- s6 ------------------------------------------------------------------------------------------

    def _old(self, element: Element, kind: str) -> Datum:
        father = next((e for e in element.children if e.name in ("fFather", "pFather", "tFather")), None)
        named = None
        if father is not None and father.text(self.data, "name"):
            alias = father.text(self.data, "alias")
            name = father.text(self.data, "name")
            named = f"{alias}:{name}" if alias else name, father.text(self.data, "fatherIndex") or "0"
        entries, own = {}, element.text(self.data, "name")
        for value in element.children:
            index = value.attributes.get("index")
            if not value.name.startswith("value") or index is None:
                continue
            parts = [child for child in value.children if child.name.endswith("Value")] or [value]
            entries[value.text(self.data, "index")] = self._entry(own, value, parts, index, kind, named)
        return Datum(element.text(self.data, "name"), kind, self.line_of(element.begin), entries, None, True)

    # -- both ----------------------------------------------------------------------------------------

    def _entry(
        self,
        own: str,
        value: Element,
        parts: list[Element],
        index: Span,
        kind: str,
        father: tuple[str, str] | None,
    ) -> Entry:
        host, slots, words = parts[0], {}, {}
        for part in parts:
            for name in part.attributes:
                words[name] = part.text(self.data, name)
        # of two the first one counts
        spans = {name: place for part in reversed(parts) for name, place in part.attributes.items()}
        for k, name in enumerate(NUMBERS[kind]):
            slots[name] = self._slot(spans.get(name), host.begin + 1 + k)
        span = (value.begin, value.end)
        return Entry(
            own, self.line_of(value.begin), span, (host.begin, host.head), index, slots, words, father
        )

    def _slot(self, span: Span | None, absent: int) -> Slot:
        """A number by the bytes of its attribute, `NO_NUMBER` where these are none."""
        if span is None:
            return (absent, absent), 0.0
        match = _NUMBER.fullmatch(self.data, *span)
        if match is None or abs(float(match[1])) >= LARGEST:
            return NO_NUMBER
        return match.span(1), float(match[1])


def stated(data: bytes, entry: Entry, texts: dict[str, bytes]) -> list[tuple[int, int, bytes]]:
    """The edits that give numbers of an entry other texts: in place of theirs, or as attributes of their
    own."""
    names = list(entry.slots)
    edits: list[tuple[int, int, bytes]] = []
    for name, text in texts.items():
        (a, b), _ = entry.slots[name]
        if b > a:
            edits.append((a, b, text))
            continue
        place = max(
            (entry.slots[n][0][1] + 1 for n in names[: names.index(name)] if _has(entry, n)),
            default=entry.index[1] + 1
            if entry.host[0] < entry.index[0] < entry.index[1] < entry.host[1]
            else -1,
        )
        if place < 0:
            # behind the name of the element
            match = pattern(rb"<[^\s/>]+").match(data, *entry.host)
            assert match is not None
            place = match.end()
        edits.append((place, place, b" " + name.encode() + b'="' + text + b'"'))
    return edits


def _has(entry: Entry, name: str) -> bool:
    a, b = entry.slots[name][0]
    return b > a
