"""Why statements of Sinumerik programs are refused."""

from __future__ import annotations

import re

from olp.core.errors import ProgramError
from olp.program.rs274.flatten.language import UNROLL
from olp.program.sinumerik.blocks import Piece
from olp.program.sinumerik.table import REFUSED, UNROLLED

#: How positions of rotary axes are approached.
ROTARY_ONLY = (b"DC", b"ACP", b"ACN")
_KEYWORD = re.compile(rb"[ \t]*(?:N\d+)?[ \t]*([A-Z]+)", re.IGNORECASE)


def unroll(what: str) -> ProgramError:
    """What is read once the program is unrolled."""
    return ProgramError(
        f"{what} uses parameters, expressions, flow control or calls", hint=UNROLL, code="OLP511"
    )


def refused(name: str) -> ProgramError:
    """A statement of the table of those that are refused."""
    return ProgramError(f"{name} {REFUSED[name]}", code="OLP512", word=name)


def no_number(name: str, value: bytes) -> ProgramError:
    """A word that counts along a line or about a pole has another value than a number, AC( ) or IC( )."""
    way = value.partition(b"(")[0].strip().upper()
    shown = f"`{name}={value.decode('latin-1')}`"
    if way in ROTARY_ONLY:
        return ProgramError(
            f"{shown} is not read: {way.decode()} belongs to rotary axes; write AC( ) or IC( )", code="OLP512"
        )
    return ProgramError(f"{shown} is not a number; write a number, AC( ) or IC( )", code="OLP510")


def return_elsewhere(what: str) -> ProgramError:
    """RET with arguments, or beside other words."""
    return ProgramError(
        f"`{what.strip()}` may go on at another block or level than behind the call; write RET alone in a "
        "block, and the jump with GOTOF behind the call",
        code="OLP542",
    )


def statement(piece: Piece) -> ProgramError:
    """Why a keyword or a call is refused."""
    if piece.name in REFUSED:
        return refused(piece.name)
    if piece.name in UNROLLED:
        return unroll(f"`{piece.name}`")
    return ProgramError(
        f"`{piece.name}` is a subprogram or a statement that is not known, and may move the machine",
        hint=UNROLL,
        code="OLP511",
        word=piece.name,
    )


def parametric(code: bytes) -> ProgramError | None:
    """Why a line that is not cut into pieces is refused, where it begins as flow control does."""
    found = _KEYWORD.match(code)
    name = found[1].decode().upper() if found else ""
    return unroll(f"`{name}`") if name in UNROLLED else None
