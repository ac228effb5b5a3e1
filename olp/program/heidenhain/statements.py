"""Statements of Heidenhain conversational programs that are no plain motion block: their text, without its
number and its comments, joined where it goes on in further lines."""

from __future__ import annotations

import re

from olp.core.errors import ProgramError
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
_SHIFT = re.compile(rb"[ \t]*(I?)([XYZABCUVW])[ \t]*([-+]?)[ \t]*(Q[LR]?\d+|\d+\.?\d*|\.\d+)[ \t]*", re.I)
_TRANS = re.compile(
    rb"TRANS[ \t]+(DATUM|MIRROR|ROTATION|SCALE)\b(?:[ \t]+AXIS\b)?[ \t]*(.*)", re.I | re.S
)  # fmt: skip


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


@dataclass(frozen=True, slots=True)
class CycleText:
    """A CYCL DEF: the `number` of the cycle, its `part` (7.1: 1; None for cycles of Q parameters), and the
    rest of the text. `values` are its parameters as written, by their numbers."""

    number: int
    part: int | None
    rest: bytes
    values: dict[int, bytes]

    def shifts(self, statement: Statement) -> list[tuple[str, bool, bytes]]:
        """The words of a datum shift: axis, whether it counts from the shift before, and its number or its
        parameter. Raises ProgramError for what is none."""
        words, place = [], 0
        while found := _SHIFT.match(self.rest, place):
            words.append((found[2].decode().upper(), bool(found[1]), found[3] + found[4]))
            place = found.end()
        if place < len(self.rest) or not words:
            table = self.rest.upper().startswith((b"#", b"TABLE"))
            raise ProgramError(
                "the datum shift is taken from a table of the control; state it with numbers"
                if table
                else f"{statement.shown} is not understood; expected axes with numbers, such as X+10",
                line=statement.line,
                code="OLP526" if table else "OLP510",
            )
        return words


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


#: What a TRANS statement without its values is as a CYCL DEF: its number, and the text that ends it.
_AS_CYCLE = {
    b"DATUM": (7, b"X0 Y0 Z0"),
    b"MIRROR": (8, b""),
    b"ROTATION": (10, b"ROT 0"),
    b"SCALE": (11, b"SCL 1"),
}


def cycle_of(statement: Statement) -> CycleText | None:
    """The parts of a CYCL DEF, or of the TRANS that does the same; None where the statement is none."""
    match = _CYCLE.match(statement.text)
    if match is None:
        trans = _TRANS.match(statement.text)
        return None if trans is None else _of_trans(trans)
    part = None if match[2] is None else int(match[2])
    values = {int(v[1]): v[2] for v in _VALUE.finditer(match[3])}
    return CycleText(int(match[1]), part, match[3].strip(), values)


def _of_trans(match: re.Match[bytes]) -> CycleText:
    number, ended = _AS_CYCLE[match[1].upper()]
    rest = match[2].strip()
    return CycleText(number, 1, ended if rest.upper() == b"RESET" else rest, {})
