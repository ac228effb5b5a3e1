"""The statements of a URScript text, with their lines and bytes. Nothing here knows what they mean."""

from __future__ import annotations

from collections.abc import Iterator

from olp.core.patterns import pattern
from olp.core.values import dataclass

_STRING = pattern(rb"\"[^\"]*\"|'[^']*'")
#: A call as a statement, and what may stand behind one in its line: another call, or an assignment.
_CALLS = pattern(rb"[ \t]*(?!(?:if|elif|while|for|return|not|def|thread)\b)[A-Za-z_]\w*[ \t]*\(")
_BEHIND = pattern(
    rb"[ \t]*(?!(?:and|or|xor|in)\b)(?:(?:global|local)[ \t]+)?[A-Za-z_]\w*[ \t]*(?:\(|\[|=(?!=))"
)

_CLOSING = ord(")")


@dataclass(frozen=True, slots=True)
class Line:
    """A statement: its first line, its first byte, and its text without comments and what strings say."""

    line: int
    begin: int
    text: bytes


def lines_of(data: bytes) -> Iterator[Line]:
    """The lines of a text without their comments. One that ends in a bracket goes on in the lines behind it,
    up to the one that closes it. Calls in one line are statements of their own."""
    open_: list[Line] = []
    depth = 0
    for line in _each_line(data):
        open_.append(line)
        depth += _depth(line)
        if depth <= 0:
            yield from _statements(_joined(open_))
            open_, depth = [], 0
    # one that nothing closes is a line of its own
    yield from open_


def _each_line(data: bytes) -> Iterator[Line]:
    """The lines of a text, without comments and what strings say."""
    place = 3 if data[:3] == b"\xef\xbb\xbf" else 0
    for number, raw in enumerate(data[place:].splitlines(keepends=True), 1):
        text = raw.rstrip(b"\r\n")
        if b'"' in text or b"'" in text:
            text = _STRING.sub(lambda hit: b"_" * len(hit[0]), text)
        text = text[: text.find(b"#")] if b"#" in text else text
        yield Line(number, place, text.rstrip())
        place += len(raw)


def _depth(line: Line) -> int:
    """How many brackets a line opens more than it closes."""
    text = line.text
    return text.count(b"(") + text.count(b"[") - text.count(b")") - text.count(b"]")


def _statements(line: Line) -> Iterator[Line]:
    """The statements of a line."""
    while _CALLS.match(line.text) is not None:
        end = closed(line.text)
        if _BEHIND.match(line.text, end) is None:
            break
        yield Line(line.line, line.begin, line.text[:end])
        blank = len(line.text[end:]) - len(line.text[end:].lstrip())
        line = Line(line.line, line.begin + end + blank, line.text[end + blank :])
    yield line


def closed(text: bytes) -> int:
    """The byte behind the bracket that closes the first one."""
    depth = 0
    for place, byte in enumerate(text):
        depth += (byte in b"([") - (byte in b")]")
        if depth == 0 and byte == _CLOSING:
            return place + 1
    return len(text)


def _joined(lines: list[Line]) -> Line:
    """Lines as one, with blanks between them."""
    first, *others = lines
    text = first.text
    for line in others:
        text = text.ljust(line.begin - first.begin) + line.text
    return Line(first.line, first.begin, text)
