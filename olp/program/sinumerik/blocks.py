"""Blocks of Sinumerik programs cut into pieces: words, assignments, calls and keywords.

A block is one line. `;` outside of a string starts a comment. An address of one letter takes its number
directly; one that ends in a digit, or has several letters, needs `=`. So `C25.815` is C with 25.815, and
`C2=5` is an axis C2. Source: Siemens, Programming Manual Fundamentals, section "Fundamental principles of NC
programming".
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from enum import Enum

from olp.core.errors import ProgramError
from olp.core.values import dataclass

_COMMENT = re.compile(rb'(?:[^";]|"[^"]*"?)*')
#: What comes before the words of a line; a byte order mark is before those of the first.
_HEAD = re.compile(
    rb"(?:\xef\xbb\xbf)?[ \t]*(?:/(\d?)[ \t]*)?(?:[N:][ \t]*(\d+)(?![\d.]))?[ \t]*", re.IGNORECASE
)
_LABEL = re.compile(rb"([A-Z_][A-Z0-9_]+)[ \t]*:(?!=)[ \t]*", re.IGNORECASE)
NUMBER = re.compile(rb"[+-]?[ \t]*(?:\d+\.?\d*|\.\d+)")
_WORD = re.compile(
    rb"([A-Z])[ \t]*([+-]?[ \t]*(?:\d+\.?\d*|\.\d+))(?![\d.]|[A-Z_]{2}|[ \t]*[=\[(])", re.IGNORECASE
)
_NAME = re.compile(rb"[$A-Z_][$A-Z0-9_]*", re.IGNORECASE)
_BLANK = re.compile(rb"[ \t\r]*")
#: A value of an expression: a number, with an exponent or not, a string, a name.
_OPERAND = re.compile(
    rb"(?:\d+\.?\d*|\.\d+)(?:EX[+-]?\d+)?|'[HB][0-9A-F]+'|\"[^\"]*\"|[$A-Z_][$A-Z0-9_]*", re.IGNORECASE
)
_OPERATOR = re.compile(
    rb"<<|<>|==|<=|>=|[-+*/<>:]|(?:DIV|MOD|AND|OR|XOR|B_AND|B_OR|B_XOR)(?![A-Z0-9_])", re.IGNORECASE
)
_SIGN = re.compile(rb"(?:[-+]|(?:NOT|B_NOT)(?![A-Z0-9_]))[ \t]*", re.IGNORECASE)


class Form(Enum):
    """How a piece is written."""

    WORD = 0  #: a letter and a number
    EQUAL = 1  #: an address or a variable, `=` and a value
    NAME = 2  #: a keyword or a call, with or without arguments in brackets


@dataclass(frozen=True, slots=True)
class Piece:
    """One piece of a block: its bytes `start`..`end` and those of its value, which are empty where it has
    none. The value of a call is what its brackets hold. `name` is in capitals."""

    form: Form
    name: str
    start: int
    end: int
    value: int
    value_end: int
    #: whether a name has brackets
    called: bool = False


@dataclass(frozen=True, slots=True)
class Block:
    """A line in pieces: whether it is under block delete, its number and its label where it has them."""

    deleted: bool
    number: bytes
    label: str
    pieces: tuple[Piece, ...]


def without_comment(line: bytes) -> bytes:
    """A line up to its comment."""
    match = _COMMENT.match(line)
    return line[: match.end()] if match else line


def block_of(line: bytes) -> Block:
    """The pieces of a line without its comment. Raises ProgramError, without a line, for what is none."""
    head = _HEAD.match(line)
    assert head is not None
    deleted = head[0].lstrip().startswith(b"/")
    place, label = head.end(), ""
    while found := _LABEL.match(line, place):
        place, label = found.end(), found[1].decode().upper()
    return Block(deleted, head[2] or b"", label, tuple(_pieces(line, place)))


def _pieces(line: bytes, place: int) -> Iterator[Piece]:
    place = _skip(line, place)
    while place < len(line):
        piece = _piece(line, place)
        yield piece
        place = _skip(line, piece.end)


def _piece(line: bytes, place: int) -> Piece:
    word = _WORD.match(line, place)
    if word is not None:
        name = word[1].decode().upper()
        return Piece(Form.WORD, name, place, word.end(), word.start(2), word.end(2))
    found = _NAME.match(line, place)
    if found is None:
        raise unknown(line[place:])
    name, end = found[0].decode().upper(), found.end()
    after = _skip(line, end)
    if line[after : after + 1] == b"[":
        end = _closed(line, after)
        name += line[after:end].decode("latin-1").upper().replace(" ", "")
        after = _skip(line, end)
    if line[after : after + 1] == b"=" and line[after : after + 2] != b"==":
        value = _skip(line, after + 1)
        stop = expression_end(line, value)
        if stop == value:
            raise unknown(line[place:])
        return Piece(Form.EQUAL, name, place, stop, value, stop)
    if line[after : after + 1] == b"(":
        stop = _closed(line, after)
        return Piece(Form.NAME, name, place, stop, after + 1, stop - 1, called=True)
    return Piece(Form.NAME, name, place, end, end, end)


def unknown(text: bytes) -> ProgramError:
    shown = text.strip()[:60].decode("latin-1")
    return ProgramError(
        f"`{shown}` is not understood and may move the machine; expected words of an address and a number",
        code="OLP510",
    )


def expression_end(line: bytes, place: int) -> int:
    """Where the expression that begins at a place ends; the place itself where none begins there."""
    end = place
    while True:
        here = _skip(line, place)
        while sign := _SIGN.match(line, here):
            here = sign.end()
        if line[here : here + 1] == b"(":
            here = _closed(line, here)
        else:
            operand = _OPERAND.match(line, here)
            if operand is None:
                return end
            here = operand.end()
            for opens in (b"[", b"("):
                after = _skip(line, here)
                if line[after : after + 1] == opens:
                    here = _closed(line, after)
        end = here
        operator = _OPERATOR.match(line, _skip(line, here))
        if operator is None:
            return end
        place = operator.end()


def arguments(line: bytes, piece: Piece) -> list[bytes]:
    """The arguments of a call as written, without blanks around them; empty ones for those left out."""
    return [line[a:b] for a, b in argument_spans(line, piece)]


def argument_spans(line: bytes, piece: Piece) -> list[tuple[int, int]]:
    """Where the arguments of a call are in the line."""
    text = line[piece.value : piece.value_end]
    if not text.strip():
        return []
    ends, depth, quoted = [], 0, False
    for i, byte in enumerate(text):
        if byte == 34:
            quoted = not quoted
        elif not quoted:
            depth += (byte in b"([") - (byte in b")]")
            if byte == 44 and not depth:
                ends.append(i)
    spans = []
    for start, end in zip([0, *(end + 1 for end in ends)], [*ends, len(text)], strict=True):
        part = text[start:end]
        begin = piece.value + start + len(part) - len(part.lstrip())
        spans.append((begin, begin + len(part.strip())))
    return spans


def _closed(line: bytes, place: int) -> int:
    """Behind the bracket that closes the one at a place."""
    depth, quoted = 0, False
    for i in range(place, len(line)):
        byte = line[i]
        if byte == 34:
            quoted = not quoted
        elif not quoted:
            depth += (byte in b"([") - (byte in b")]")
            if not depth:
                return i + 1
    raise ProgramError(
        f"the bracket of `{line[place:].strip()[:60].decode('latin-1')}` is not closed; expected one line",
        code="OLP510",
    )


def _skip(line: bytes, place: int) -> int:
    blank = _BLANK.match(line, place)
    return blank.end() if blank else place
