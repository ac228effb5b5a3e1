"""The statements of a URScript text, with their lines and bytes. Nothing here knows what they mean."""

from __future__ import annotations

from collections.abc import Iterator

from olp.core.patterns import pattern
from olp.core.values import dataclass

_STRING = pattern(rb"\"[^\"]*\"|'[^']*'")


@dataclass(frozen=True, slots=True)
class Line:
    """A statement: its first line, its first byte, and its text without comments and what strings say."""

    line: int
    begin: int
    text: bytes


def lines_of(data: bytes) -> Iterator[Line]:
    """The lines of a text without their comments. One that ends in a bracket goes on in the lines behind it,
    up to the one that closes it."""
    open_: list[Line] = []
    depth = 0
    for line in _each_line(data):
        open_.append(line)
        depth += _depth(line)
        if depth <= 0:
            yield _joined(open_)
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


def _joined(lines: list[Line]) -> Line:
    """Lines as one, with blanks between them."""
    first, *others = lines
    text = first.text
    for line in others:
        text = text.ljust(line.begin - first.begin) + line.text
    return Line(first.line, first.begin, text)
