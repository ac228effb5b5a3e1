"""The parts of a TP program as text: header, lines, positions. Nothing here knows what they mean."""

from __future__ import annotations

import re

from olp.core.errors import ProgramError
from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.robots.targets import ABSENT, Span
from olp.program.text.numbers import LARGEST

#: The letters of a position in their usual order, and their units.
_LETTERS = (b"X", b"Y", b"Z", b"W", b"P", b"R")
_USUAL_UNITS = (b"mm", b"mm", b"mm", b"deg", b"deg", b"deg")
_AXES = tuple(letter.decode() for letter in _LETTERS)
_USUAL_AXES = frozenset(_AXES)
#: Their numbers in `_POSITION`.
_NUMBERS = slice(5, 11)
_PART = pattern(rb"(?im)^[ \t]*/(PROG|ATTR|APPL|MN|POS|END)\b[^\r\n]*")
#: A line with its number; a statement ends with the semicolon at the end of a line.
_LINE = pattern(rb"(?m)^[ \t]*(\d*)[ \t]*:([^\r\n]*?)(;?)[ \t]*\r?$")
#: A position: in the usual form, as controls write it, of one group and without external axes; or in any.
_STATED = rb"\s*=\s*([-+]?(?:\d+\.?\d*|\.\d+))\s*"
_POSITION = pattern(
    rb"P\[\s*(\d+)\s*(?::[^\]]*)?\]\s*\{(?:\s*GP1\s*:\s*UF\s*:\s*(\d+|F)\s*,\s*UT\s*:\s*(\d+|F)\s*,\s*"
    rb"CONFIG\s*:\s*'([^'{}]*)'\s*,\s*"
    + rb",\s*".join(
        name + _STATED + unit + rb"\s*" for name, unit in zip(_LETTERS, _USUAL_UNITS, strict=True)
    )
    + rb"|([^{}]*))\}\s*;"
)
#: The number of its text in any form.
_OTHER = 11
_GROUP = pattern(rb"GP(\d+)\s*:")
_COUNT = pattern(rb"(?im)^[ \t]*LINE_COUNT[ \t]*=[ \t]*(\d+)")
_NUMBER = rb"([-+]?(?:\d+\.?\d*|\.\d+))"
_AXIS = pattern(rb"\b(X|Y|Z|W|P|R|E\d|J\d)\s*=\s*(?:" + _NUMBER + rb"|\*+)\s*([A-Za-z]+\b(?!\s*=))?")
#: Units of values by their axis; others have either.
_UNITS = {**dict.fromkeys("XYZ", (b"mm",)), **dict.fromkeys("WPR", (b"deg",))}
_EITHER = (b"mm", b"deg")
_FRAME = pattern(rb"UF\s*:\s*(\d+|F)\s*,\s*UT\s*:\s*(\d+|F)")
_CONFIG = pattern(rb"CONFIG\s*:\s*'([^']*)'")


@dataclass(frozen=True, slots=True)
class Line:
    """A statement of the main part: its `line`, its bytes with the number, and its `text` without."""

    line: int
    span: Span
    text: bytes
    first: int


@dataclass(frozen=True, slots=True)
class Position:
    """A position of the first group: its `line`, the bytes of all of it and of its number.

    `frame` and `tool` are -1 for the active one. `axes` are bytes and values by their letters. `config` are
    the bytes of the configuration, and `others` is what else it states. `foreign` is the first value in a
    unit that is not read, and `turning` are the external axes in deg."""

    line: int
    span: Span
    number: Span
    frame: int
    tool: int
    axes: dict[str, tuple[Span, float]]
    config: Span
    others: bytes
    foreign: str
    turning: tuple[str, ...] = ()

    @property
    def outer(self) -> tuple[float, ...]:
        """The values of the external axes from the first to the last that is stated."""
        if self.axes.keys() == _USUAL_AXES:
            return ()
        stated = {int(name[1:]): value for name, (_, value) in self.axes.items() if name[0] == "E"}
        if not stated:
            return ()
        return tuple(stated.get(number, ABSENT) for number in range(1, max(stated) + 1))


def parts(data: bytes) -> dict[str, list[Span]]:
    """The bytes of the parts of a program by their names."""
    marks = list(_PART.finditer(data))
    ends = [*(mark.start() for mark in marks[1:]), len(data)][: len(marks)]
    found: dict[str, list[Span]] = {}
    for mark, end in zip(marks, ends, strict=True):
        found.setdefault(mark[1].decode().upper(), []).append((mark.end(), end))
    return found


def line_count(data: bytes, header: Span) -> tuple[Span, int] | None:
    """The bytes of the count of lines in the header, and the count; None where there is none."""
    match = _COUNT.search(data, *header)
    return None if match is None else (match.span(1), int(match[1]))


def lines(data: bytes, main: Span) -> list[Line]:
    """The statements of a main part, each with the lines in which it goes on. Raises ProgramError where one
    does not end."""
    found: list[Line] = []
    begin, first, text = -1, 0, b""
    count, place = data.count(b"\n", 0, main[0]) + 1, main[0]
    for match in _LINE.finditer(data, *main):
        count += data.count(b"\n", place, match.start())
        place = match.start()
        if begin < 0:
            begin, first, line, text = match.start(), match.start(2), count, b""
        text += match[2]
        if match[3]:
            found.append(Line(line, (begin, match.end()), text, first))
            begin = -1
    if begin >= 0:
        raise ProgramError("the statement has no semicolon at its end", line=line, code="OLP510")
    return found


def positions(data: bytes, part: Span, found: dict[int, list[Position]]) -> None:
    """Add the positions of a part to those `found` by their numbers. One that is not taught, or in joints,
    lacks X, Y and Z."""
    count, place = data.count(b"\n", 0, part[0]) + 1, part[0]
    for match in _POSITION.finditer(data, *part):
        count += data.count(b"\n", place, match.start())
        place = match.start()
        own = _position(data, match, count) if match[2] is None else _usual(match, count)
        found.setdefault(int(match[1]), []).append(own)


def _usual(match: re.Match[bytes], line: int) -> Position:
    """A position in the usual form; a number that is too large to be one is left out."""
    _, frame, tool, _, x, y, z, w, p, r, _ = match.groups()
    spans = match.regs
    values = float(x), float(y), float(z), float(w), float(p), float(r)
    axes = dict(zip(_AXES, zip(spans[_NUMBERS], values, strict=True), strict=True))
    if max(values) >= LARGEST or min(values) <= -LARGEST:
        axes = {name: axis for name, axis in axes.items() if abs(axis[1]) < LARGEST}
    return Position(
        line, spans[0], spans[1], -1 if frame == b"F" else int(frame), -1 if tool == b"F" else int(tool),
        axes, spans[4], b"", "",
    )  # fmt: skip


def _position(data: bytes, match: re.Match[bytes], line: int) -> Position:
    """A position in any form."""
    whole = match.span(_OTHER)
    groups = list(_GROUP.finditer(data, *whole))
    bounds = [*(group.start() for group in groups[1:]), whole[1]][: len(groups)]
    span, others = (whole if not groups else (0, 0)), b""
    for group, end in zip(groups, bounds, strict=True):
        if group[1] == b"1":
            span = group.end(), end
        else:
            others += data[group.start() : end]
    frame, config = _FRAME.search(data, *span), _CONFIG.search(data, *span)
    axes: dict[str, tuple[Span, float]] = {}
    foreign, turning = "", []
    for axis in _AXIS.finditer(data, *span):
        letter, stated, unit = axis.groups()
        name = letter.decode()
        if stated is not None and abs(value := float(stated)) < LARGEST:
            axes[name] = axis.span(2), value
        if unit is not None and not foreign and unit not in _UNITS.get(name, _EITHER):
            foreign = axis[0].decode("latin-1")
        if name[0] == "E" and unit == b"deg":
            turning.append(name)
    used = [-1 if frame is None or frame[k] == b"F" else int(frame[k]) for k in (1, 2)]
    return Position(
        line, match.span(), match.span(1), used[0], used[1], axes,
        (span[0], span[0]) if config is None else config.span(1), b"".join(others.split()), foreign,
        tuple(turning),
    )  # fmt: skip
