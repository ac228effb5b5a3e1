"""The lines of a KRL text, and the aggregates in them. Nothing here knows what they mean."""

from __future__ import annotations

from collections.abc import Iterator

from olp.core.patterns import pattern
from olp.core.spool import Text
from olp.core.values import dataclass
from olp.program.robots.line import Line
from olp.program.robots.targets import Span
from olp.program.text.line_ends import split
from olp.program.text.numbers import LARGEST

_CODE = pattern(rb'(?:[^;"]|"[^"]*"?)*')
_AGGREGATE = pattern(rb"(?i)\{\s*(?:(FRAME|POS|E3POS|E6POS|AXIS|E3AXIS|E6AXIS)\s*:)?([^{}:\"]*)\}")
_COMPONENT = pattern(
    rb"(?i)\s*([A-Z]\w*)(?:\s+|(?=[-+.']))"
    rb"([-+]?(?:\d+\.?\d*|\.\d+)(?:E[-+]?\d+)?|'[BH][\dA-F]+')\s*(?:,|$)"
)
#: A position in the usual form, as taught points have it: its components in their order.
_ORDER = ("X", "Y", "Z", "A", "B", "C", "S", "T", "E1", "E2", "E3", "E4", "E5", "E6")
_N = rb"([-+]?(?:\d+\.?\d*|\.\d+))"
_USUAL = pattern(
    rb"\{\s*(?:(?:FRAME|POS|E3POS|E6POS)\s*:\s*)?"
    + rb"\s*,\s*".join(name.encode() + rb"\s+" + _N for name in _ORDER[:6])
    + b"".join(rb"(?:\s*,\s*" + name.encode() + rb"\s+" + _N + rb")?" for name in _ORDER[6:])
    + rb"\s*\}"
)
_PART = pattern(rb"\{[^{}]*\}|[^{}:]+")
#: Bases of bit strings by their letters.
_BASES = {"B": 2, "H": 16}


@dataclass(frozen=True, slots=True)
class Aggregate:
    """An aggregate of numbers: its bytes, the bytes and the value of each component by its name in capitals,
    and whether these are joints."""

    span: Span
    values: dict[str, tuple[Span, float]]
    joints: bool


def lines(data: bytes) -> Iterator[Line]:
    """The lines that are neither blank, nor comments, nor of the header of a file."""
    place = 3 if data[:3] == b"\xef\xbb\xbf" else 0
    for number, raw in enumerate(split(data[place:]), 1):
        code = raw
        if b";" in raw:
            match = _CODE.match(raw)
            assert match is not None
            code = match[0]
        rest = code.lstrip()
        if rest and rest[:1] != b"&":
            yield Line(number, place + len(code) - len(rest), rest.rstrip())
        place += len(raw)


def aggregate(data: Text, span: Span) -> Aggregate | None:
    """The aggregate that bytes are; None where they are none, or one of its components is no number."""
    values: dict[str, tuple[Span, float]] = {}
    if data[span[0] : span[0] + 1] != b"{":
        return None
    match = _USUAL.fullmatch(data, *span)
    if match is not None:
        whole, *spans = match.regs
        values = {
            name: (own, float(text))
            for name, own, text in zip(_ORDER, spans, match.groups(), strict=True)
            if text is not None
        }
        large = any(not -LARGEST < value < LARGEST for _, value in values.values())
        return None if large else Aggregate(whole, values, joints=False)
    match = _AGGREGATE.fullmatch(data, *span)
    if match is None:
        return None
    place, end = match.span(2)
    for component in _COMPONENT.finditer(data, place, end):
        if component.start() != place:
            return None
        name, text = component[1].decode().upper(), component[2].decode()
        value = float(int(text[2:-1], _BASES[text[1].upper()])) if text[0] == "'" else float(text)
        if name in values or abs(value) >= LARGEST:
            return None
        values[name] = component.span(2), value
        place = component.end()
    if place < end:
        return None
    kind = (match[1] or b"").upper()
    return Aggregate(match.span(), values, kind.endswith(b"AXIS") or "A1" in values)


def parts(data: bytes, span: Span) -> list[Span]:
    """The bytes of the operands of the operator `:`, without blanks around them."""
    found = []
    for match in _PART.finditer(data, *span):
        text = match[0]
        begin = match.start() + len(text) - len(text.lstrip())
        found.append((begin, begin + len(text.strip())))
    return [(a, b) for a, b in found if b > a]
