"""The elements of an XML text with the bytes of their attributes. Nothing here knows what they mean.

Nothing outside the text is ever read: a document type, which alone may name other files and entities, is
refused, and so are elements that are nested deeper than those of the language.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import field

from olp.core.errors import ProgramError
from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.robots.targets import Span
from olp.program.text.line_ends import split

_NAME = rb"[^\s<>/=\"'!?&]+"
_VALUE = rb"\"[^\"<]*\"|'[^'<]*'"
_TOKEN = pattern(
    rb"(?s)<!--.*?-->|<\?.*?\?>|(?P<data><!\[CDATA\[.*?\]\]>)|</(?P<close>" + _NAME + rb")\s*>|"
    rb"<(?P<open>"
    + _NAME
    + rb")(?P<words>(?:\s+"
    + _NAME
    + rb"\s*=\s*(?:"
    + _VALUE
    + rb"))*)\s*(?P<end>/?)>|<"
)
_ATTRIBUTE = pattern(rb"(" + _NAME + rb")\s*=\s*(" + _VALUE + rb")")
_OPENING = b"<![CDATA["
_CLOSING = b"]]>"
#: Elements of the language are nested six deep.
_DEEPEST = 32


@dataclass(slots=True, eq=False)
class Element:
    """An element: its `name` without a prefix, its bytes `begin` to `end`, and the end `head` of its first
    tag. `attributes` are the bytes of their values. `texts` are the bytes of what stands between its
    `children`, and whether it is without entities."""

    name: str
    begin: int
    head: int
    attributes: dict[str, Span]
    end: int = -1
    children: list[Element] = field(default_factory=list)
    texts: list[tuple[Span, bool]] = field(default_factory=list)

    def text(self, data: bytes, name: str) -> str:
        """The value of an attribute, "" where there is none."""
        span = self.attributes.get(name)
        return "" if span is None else data[slice(*span)].decode("utf-8", "replace").strip()

    def all_of(self, *names: str) -> Iterator[Element]:
        """The elements within, at any depth, that have one of some names."""
        for child in self.children:
            if child.name in names:
                yield child
            yield from child.all_of(*names)


def elements(data: bytes, begin: int, end: int, line_of: Lines) -> Element:
    """The elements of the bytes `begin` to `end`, within one without a name. Raises ProgramError where they
    are no XML that is read."""
    root = Element("", begin, begin, {}, end)
    open_, place = [root], begin
    for match in _TOKEN.finditer(data, begin, end):
        if match.start() > place:
            open_[-1].texts.append(((place, match.start()), False))
        place = match.end()
        name = match["open"]
        if name is not None:
            _begin(data, match.span("words"), (match.start(), match.end()), name, open_)
            if match["end"]:
                open_.pop().end = match.end()
            elif len(open_) > _DEEPEST:
                raise _refused(f"elements are nested more than {_DEEPEST} deep", line_of(match.start()))
        elif match["close"] is not None:
            if len(open_) == 1 or _plain(match["close"]) != open_[-1].name:
                raise _refused(
                    f"</{match['close'].decode('latin-1')}> ends no element", line_of(match.start())
                )
            open_.pop().end = match.end()
        elif match["data"] is not None:
            own = match.start() + len(_OPENING), match.end() - len(_CLOSING)
            open_[-1].texts.append((own, True))
        elif match[0] == b"<":
            what = "a document type or a mark that is not read begins here"
            raise _refused(what, line_of(match.start()))
    if len(open_) > 1:
        raise _refused(f"<{open_[-1].name}> is not ended", line_of(open_[-1].begin))
    return root


def _begin(data: bytes, words: Span, tag: Span, name: bytes, open_: list[Element]) -> None:
    attributes = {}
    for match in _ATTRIBUTE.finditer(data, *words):
        a, b = match.span(2)
        attributes[match[1].decode("latin-1")] = (a + 1, b - 1)
    element = Element(_plain(name), tag[0], tag[1], attributes)
    open_[-1].children.append(element)
    open_.append(element)


def _plain(name: bytes) -> str:
    """A name without its prefix."""
    return name.rpartition(b":")[2].decode("latin-1")


def _refused(what: str, line: int) -> ProgramError:
    return ProgramError(f"this is no XML that is read: {what}", line=line, code="OLP506")


class Lines:
    """The numbers of the lines of a text by their bytes."""

    def __init__(self, data: bytes) -> None:
        self._starts: list[int] = []
        place = 0
        for raw in split(data):
            self._starts.append(place)
            place += len(raw)

    def __call__(self, place: int) -> int:
        return max(bisect_right(self._starts, place), 1)
