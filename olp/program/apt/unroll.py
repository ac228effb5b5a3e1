"""Writes the copies of COPY out: the statements between INDEX and COPY again, moved as it says.

`INDEX/n` begins a range, and `COPY/n,…,k` ends it and repeats it k times: SAME as it is, TRANSL, XYROT, YZROT
and ZXROT moved once more each time, MODIFY by a matrix. Numbers that move are written again, all else is
copied byte for byte. INDEX and COPY themselves are left out.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from olp.core.budget import RUN_BYTES, Budget
from olp.core.errors import ProgramError, UsageError
from olp.core.progress import Progress, silent
from olp.core.values import dataclass
from olp.program.apt.table import FREE
from olp.program.apt.transforms import NOTHING, Rigid, rigid
from olp.program.dialect import Dialect
from olp.program.origin import Origin, Unrolled
from olp.program.text.line_ends import split
from olp.program.text.statements import Comment, Field, Statement, chunks, is_cards, number_of, shown

_FREE = re.compile(rb"(?i)(?:" + b"|".join(FREE) + rb")(?![A-Z])")
_GROUP = re.compile(rb"(?i)\(\s*(CIRCLE|CYLNDR|LINE)\s*/([^()]*)\)")
_CSYS = re.compile(rb"(?i)\s*\$\$->\s*CSYS")
_TOKEN = re.compile(rb"[^\s,]+")
#: decimals of numbers that are turned, at least
_DECIMALS = 6
#: what the numbers of a statement are: P a point of three, D a direction, - a number that stays
_NUMBERS = {
    b"GOTO": "PD", b"GODLTA": "D", b"CIRCLE": "PD", b"MOVARC": "PD", b"INDIRV": "D", b"TLAXIS": "D",
    b"LINE": "PP", b"CYLNDR": "PD",
}  # fmt: skip
#: statements that would have to move too, in a way that is not written
_FIXED = frozenset((b"FROM", b"TRACUT", b"TRANS", b"CSYS", b"MSYS", b"ORIGIN", b"UNITS", b"UNIT"))
_TOO_LONG = "the copies are more than {limit} bytes; divide the program"


@dataclass(frozen=True, slots=True)
class _Piece:
    """A statement or another line with its line end: its first line, and what it says where it may move."""

    text: bytes
    line: int
    lines: int
    major: bytes


def unroll(
    data: bytes,
    dialect: Dialect,
    *,
    limit: int = RUN_BYTES,
    tell: Progress = silent,
    expand_cycles: bool = False,
    **_: Any,
) -> Unrolled:
    """A program with its copies written out, and the origin of each line. Raises ProgramError with the line
    of a COPY whose range or form is not read, and UsageError where cycles are to be expanded too."""
    if expand_cycles:
        raise UsageError("cycles are made by the post-processor; leave --expand-cycles out")
    budget = Budget.of_run(len(data), limit, _TOO_LONG, tell)
    pieces: list[_Piece] = []
    begins: dict[bytes, int] = {}
    copied: set[bytes] = set()
    ended = False
    for piece, statement in _statements(data):
        ended |= piece.major == b"FINI"
        if statement is None or ended or piece.major != b"COPY":
            pieces.append(piece)
            if piece.major == b"INDEX" and statement is not None:
                begins[_number(statement)] = len(pieces)
            continue
        number = _number(statement)
        if number not in begins:
            raise ProgramError(
                f"COPY/{shown(number)} has no INDEX/{shown(number)} before it; "
                "expected one where its range begins",
                line=piece.line,
                code="OLP532",
            )
        if is_cards(data):
            raise ProgramError(
                "copies of cards are not written, as their lines are full; "
                "save the program without the numbers behind column 72",
                line=piece.line,
                code="OLP512",
            )
        copied.add(number)
        pieces += _copies(pieces[begins[number] :], statement, budget)
    pieces = [p for p in pieces if p.major != b"INDEX" or _number(_again(p.text)) not in copied]
    text = b"".join(p.text for p in pieces)
    lines = [p.line + k for p in pieces for k in range(p.lines)]
    first = np.zeros(0, np.int64)
    return Unrolled.of(text, Origin((), first, tuple(split(data)), np.array(lines, np.int64)))


def _copies(some: Sequence[_Piece], statement: Statement, budget: Budget) -> list[_Piece]:
    """The copies of a range. Each is moved from the range itself, so that no rounding adds up."""
    move, count = _form(statement)
    pieces: list[_Piece] = []
    total = NOTHING
    try:
        budget.spend(count * (sum(len(p.text) for p in some) + 1))
    except ProgramError as error:
        error.line = statement.line
        raise
    for _ in range(count):
        total = total.then(move)
        pieces += [p if total == NOTHING else _moved(p, total) for p in some]
    return pieces


def _number(statement: Statement) -> bytes:
    """The number of INDEX or COPY, which is all that they have to have in common."""
    fields = statement.fields()
    return fields[0].text if fields else b""


def _statements(data: bytes) -> list[tuple[_Piece, Statement | None]]:
    """All lines of a text in order, those of a statement together."""
    lines = split(data)
    found: dict[int, Statement] = {}
    for chunk in chunks(data):
        for item in chunk.statements(_FREE):
            if not isinstance(item, Comment):
                found[item.line] = item
    pieces: list[tuple[_Piece, Statement | None]] = []
    line = 1
    while line <= len(lines):
        statement = found.get(line)
        count = 1 if statement is None else statement.lines
        text = b"".join(lines[line - 1 : line - 1 + count])
        major = b"" if statement is None else statement.head()[1].split(b",")[0].strip()
        if statement is None and text.lstrip()[:4].upper() == b"GOTO":
            major = b"GOTO"
        if statement is not None and _FREE.match(statement.text.lstrip()):
            major = b""
        if _CSYS.match(text):
            major = b"CSYS"
        pieces.append((_Piece(text, line, count, major), statement))
        line += count
    return pieces


def _form(statement: Statement) -> tuple[Rigid, int]:
    """How each copy lies to the one before it, and how many there are."""
    words = [f.text for f in statement.fields()]
    pair = number_of(words[-1]) if len(words) > 2 else None
    if pair is None or pair[0] % 10 ** pair[1] or pair[0] < 0:
        raise ProgramError(
            "COPY has no number of copies; expected COPY/range,form,copies",
            line=statement.line,
            code="OLP516",
        )
    form = words[1] if len(words) > 2 else b""
    if form == b"SAME" and len(words) == 3:
        move = NOTHING
    elif form == b"MODIFY":
        move = rigid(words[2:-1], statement)
    else:
        move = rigid(words[1:-1], statement)
    return move, pair[0] // 10 ** pair[1]


def _moved(piece: _Piece, move: Rigid) -> _Piece:
    """A statement with its points moved. Raises ProgramError for one that would have to move otherwise."""
    if piece.major in _FIXED or (piece.major == b"GOHOME" and b"/" in piece.text):
        raise ProgramError(
            f"{shown(piece.major)} is in the range of a COPY that moves it, which is not read; "
            "put it before the INDEX",
            line=piece.line,
            code="OLP518",
        )
    if piece.major == b"TLON":
        groups = _groups(piece, move)
    elif piece.major in _NUMBERS:
        statement = _again(piece.text)
        fields = [f for f in statement.fields() if f.number is not None]
        if 0 < len(fields) < 3 and move.turn is not None and move.turn[2][2] != 1.0:
            raise ProgramError(
                f"{shown(piece.major)} has one number, along a tool axis that the copy does not turn; "
                "write it with three",
                line=piece.line,
                code="OLP518",
            )
        groups = [(_NUMBERS[piece.major], fields)]
    else:
        return piece
    edits: list[tuple[int, int, bytes]] = []
    for kinds, fields in groups:
        edits += _edits(kinds, fields, move)
    text = piece.text
    for start, end, number in sorted(edits, reverse=True):
        kept = re.findall(rb"\$[ \t]*\r?\n", text[start:end])
        text = text[:start] + b"".join(kept) + number + text[end:]
    return _Piece(text, piece.line, piece.lines, piece.major)


def _again(text: bytes) -> Statement:
    """The statement of a text of one, whose bytes count from its own start."""
    chunk = next(iter(chunks(text)))
    statement = next((s for s in chunk.statements(_FREE) if isinstance(s, Statement)), None)
    return statement or Statement(1, 0, len(text), text.rstrip(b"\r\n"))


def _groups(piece: _Piece, move: Rigid) -> list[tuple[str, list[Field]]]:
    """The numbers of TLON: of its circle or cylinder, and of its line."""
    statement = _again(piece.text)
    groups = []
    for match in _GROUP.finditer(statement.text):
        kind = match[1].upper()
        if kind == b"CIRCLE" and move.turn is not None and abs(move.turn[2][2] - 1.0) > 1e-12:
            raise ProgramError(
                "a CIRCLE of TLON has no normal that could turn; have the CAM system write CYLNDR or GOTOs",
                line=piece.line,
                code="OLP518",
            )
        offset = match.start(2)
        fields = [
            Field(
                m[0].upper(), statement.place(offset + m.start()), statement.place(offset + m.end() - 1) + 1
            )
            for m in _TOKEN.finditer(match[2])
        ]
        groups.append((_NUMBERS.get(kind, "P") if kind != b"CIRCLE" else "P", fields))
    return groups


def _edits(kinds: str, fields: Sequence[Field], move: Rigid) -> list[tuple[int, int, bytes]]:
    """New numbers of a statement: start, end, text."""
    edits = []
    for k, kind in enumerate(kinds):
        three = fields[3 * k : 3 * k + 3]
        pairs = [f.number for f in three]
        if len(three) < 3 or None in pairs:
            break
        if kind == "D" and move.turn is None:
            continue
        value = np.array([n[0] / 10.0 ** n[1] for n in pairs if n is not None])
        moved = move.placed(value[None])[0] if kind == "P" else move.directed(value[None])[0]
        for field, pair, new in zip(three, pairs, moved.tolist(), strict=True):
            assert pair is not None
            decimals = max(pair[1], _DECIMALS if move.turn is not None else _of_shift(move))
            number = f"{new:.{decimals}f}".encode()
            if number_of(number) != pair:
                edits.append((field.start, field.end, number))
    return edits


def _of_shift(move: Rigid) -> int:
    """Decimals of a shift as it was stated."""
    return max(len(f"{v:.9f}".rstrip("0").partition(".")[2]) for v in move.shift)
