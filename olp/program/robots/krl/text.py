"""The lines of a KRL text, and the aggregates in them. Nothing here knows what they mean."""

from __future__ import annotations

from collections.abc import Iterator

from olp.core.patterns import pattern
from olp.core.spool import Text
from olp.core.values import dataclass
from olp.program.robots import line
from olp.program.robots.targets import NOWHERE, Span
from olp.program.text.line_ends import split
from olp.program.text.numbers import LARGEST

_CODE = pattern(rb'(?:[^;"]|"[^"]*"?)*')
_AGGREGATE = pattern(rb"(?i)\{\s*(?:(FRAME|POS|E3POS|E6POS|AXIS|E3AXIS|E6AXIS)\s*:)?([^{}:\"]*)\}")
_COMPONENT = pattern(
    rb"(?i)\s*([A-Z]\w*)(?:\s+|(?=[-+.']))"
    rb"([-+]?(?:\d+\.?\d*|\.\d+)(?:E[-+]?\d+)?|'[BH][\dA-F]+')\s*(?:,|$)"
)
#: Components of positions in their order, and those of joints.
_OF_POSES = ("X", "Y", "Z", "A", "B", "C", "S", "T", "E1", "E2", "E3", "E4", "E5", "E6")
_OF_JOINTS = ("A1", "A2", "A3", "A4", "A5", "A6", "", "", *_OF_POSES[8:])
#: The places of six joints, or of a place and its angles.
SIX = slice(6)
#: Those of status and turn.
STATUS = 6
TURN = 7
#: Those of external axes.
OUTER = slice(8, 14)
#: A position in the usual form, as taught points have it.
_N = rb"([-+]?(?:\d+\.?\d*|\.\d+))"
_USUAL = pattern(
    rb"\{\s*(?:(?:FRAME|POS|E3POS|E6POS)\s*:\s*)?"
    + rb"\s*,\s*".join(name.encode() + rb"\s+" + _N for name in _OF_POSES[:6])
    + b"".join(rb"(?:\s*,\s*" + name.encode() + rb"\s+" + _N + rb")?" for name in _OF_POSES[6:])
    + rb"\s*\}"
)
_PART = pattern(rb"\{[^{}]*\}|[^{}:]+")
_WORD = pattern(rb"\w*")
#: Stands for a component that is not stated.
_UNSTATED = b"nan"
NAN = float(_UNSTATED)
#: Bases of bit strings by their letters.
_BASES = {"B": 2, "H": 16}


@dataclass(frozen=True, slots=True)
class Line(line.Line):
    """A line with its first `word` in capitals, empty where it begins with something else."""

    word: bytes


@dataclass(frozen=True, slots=True)
class Aggregate:
    """An aggregate of numbers: its bytes, (14,) the bytes and the value of each component, and whether these
    are joints. What is not stated is `NOWHERE` and NaN."""

    span: Span
    spans: tuple[Span, ...]
    numbers: tuple[float, ...]
    joints: bool

    @property
    def whole(self) -> bool:
        """Whether all six joints are stated, or a place with its angles."""
        return NOWHERE not in self.spans[SIX]

    def outer(self, absent: float) -> tuple[float, ...]:
        """The values of the external axes; `absent` is that of one which is not stated, and stays."""
        # NaN alone differs from itself
        return tuple([value if value == value else absent for value in self.numbers[OUTER]])


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
            word = _WORD.match(rest)
            assert word is not None
            yield Line(number, place + len(code) - len(rest), rest.rstrip(), word[0].upper())
        place += len(raw)


def aggregate(data: Text, span: Span) -> Aggregate | None:
    """The aggregate that bytes are; None where they are none, or one of its components is no number."""
    if data[span[0] : span[0] + 1] != b"{":
        return None
    usual = _USUAL.fullmatch(data, *span)
    if usual is not None:
        numbers = tuple(map(float, usual.groups(_UNSTATED)))
        # the first one is stated, and none is more or less than NaN
        if max(numbers) >= LARGEST or min(numbers) <= -LARGEST:
            return None
        return Aggregate(usual.regs[0], usual.regs[1:], numbers, joints=False)
    match = _AGGREGATE.fullmatch(data, *span)
    if match is None:
        return None
    values: dict[str, tuple[Span, float]] = {}
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
    joints = (match[1] or b"").upper().endswith(b"AXIS") or "A1" in values
    stated = [values.get(name, (NOWHERE, NAN)) for name in (_OF_JOINTS if joints else _OF_POSES)]
    return Aggregate(match.span(), tuple(own for own, _ in stated), tuple(v for _, v in stated), joints)


def parts(data: bytes, span: Span) -> list[Span]:
    """The bytes of the operands of the operator `:`, without blanks around them."""
    found = []
    for match in _PART.finditer(data, *span):
        text = match[0]
        begin = match.start() + len(text) - len(text.lstrip())
        found.append((begin, begin + len(text.strip())))
    return [(a, b) for a, b in found if b > a]
