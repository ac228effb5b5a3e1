"""Statements of Heidenhain conversational programs that are no plain motion block: their text, without its
number and its comments, joined where it goes on in further lines."""

from __future__ import annotations

import re

from olp.core.values import dataclass

_NUMBER = re.compile(rb"[ \t]*(?P<mark>/?)[ \t]*\d*[ \t]*(?P<late>/?)[ \t]*")
_QUOTED = re.compile(rb'"[^"]*"')
_CYCLE = re.compile(rb"CYCLE?[ \t]+DEF[ \t]*(\d+)(?:\.(\d+))?[ \t]*(.*)", re.I | re.S)
_VALUE = re.compile(rb"Q(\d+)[ \t]*=[ \t]*([-+]?(?:Q[LR]?\d+|\d*\.?\d+|\d+\.))", re.I)
#: M functions with words of their own, which move no axis: group 1 is the function
OPERANDS = re.compile(
    rb"(?<![A-Z])(M(?:118(?=[ \t]+[XYZABCUVW][ \t]*[-+]?[Q\d.])|120(?=[ \t]*LA)|103(?=[ \t]*F)|"
    rb"101(?=[ \t]*BT)))"
    rb"((?:[ \t]*(?:[XYZABCUVWF]|LA|BT)[ \t]*[-+]?(?:Q[LR]?)?[\d.]+)+)"
)
_WORD = re.compile(rb"(I?)([XYZABCUVW])[ \t]*([-+]?(?:\d+\.?\d*|\.\d+))", re.I)


@dataclass(frozen=True, slots=True)
class Statement:
    """A statement with its `line` from 1, its `text` with the case that it has, and in capitals as `upper`.
    `deleted`: it begins with `/`. `span` are the bytes of its lines, where it is known."""

    line: int
    text: bytes
    deleted: bool
    span: tuple[int, int] = (-1, -1)

    @property
    def upper(self) -> bytes:
        return self.text.upper()

    @property
    def shown(self) -> str:
        """The text for messages."""
        text = self.text.decode("latin-1")
        return text if len(text) <= 40 else text[:37] + "..."

    def numbers(self) -> dict[bytes, tuple[bool, float]]:
        """The axis words: by letter whether it counts from the value before, and its number."""
        return {w[2].upper(): (bool(w[1]), float(w[3])) for w in _WORD.finditer(self.text)}


@dataclass(frozen=True, slots=True)
class CycleText:
    """A CYCL DEF: the `number` of the cycle, its `part` (7.1: 1; None for cycles of Q parameters), and the
    rest of the text. `values` are its parameters as written, by their numbers."""

    number: int
    part: int | None
    rest: bytes
    values: dict[int, bytes]


def of_lines(lines: list[bytes], number: int) -> Statement:
    """The statement of some lines, of which the first has this number."""
    parts = []
    deleted = False
    for k, raw in enumerate(lines):
        text = raw.strip()
        if k == 0:
            head = _NUMBER.match(text)
            assert head is not None
            deleted = bool(head["mark"] or head["late"])
            text = text[head.end() :]
        parts.append(without_comment(text).removesuffix(b"~").strip())
    return Statement(number, b" ".join(parts).strip(), deleted)


def without_comment(text: bytes) -> bytes:
    """The text up to its comment; a `;` between quotes opens none."""
    if b";" not in text:
        return text
    masked = _QUOTED.sub(lambda m: b" " * len(m[0]), text)
    end = masked.find(b";")
    return text if end < 0 else text[:end]


def cycle_of(statement: Statement) -> CycleText | None:
    """The parts of a CYCL DEF; None where the statement is none."""
    match = _CYCLE.match(statement.text)
    if match is None:
        return None
    part = None if match[2] is None else int(match[2])
    values = {int(v[1]): v[2] for v in _VALUE.finditer(match[3])}
    return CycleText(int(match[1]), part, match[3].strip(), values)
