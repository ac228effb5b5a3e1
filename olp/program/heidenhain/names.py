"""The names of statements of Heidenhain programs as the table has them, and why some are refused."""

from __future__ import annotations

import re

from olp.core.errors import ProgramError
from olp.program.dialect import Support
from olp.program.heidenhain.statements import Statement
from olp.program.heidenhain.table import TABLE, UNROLL

_FN = re.compile(rb"FN[ \t]*(\d+)\b", re.I)
_NAMES = sorted(TABLE, key=len, reverse=True)
_NAME = re.compile(
    rb"(?:" + b"|".join(re.escape(n).replace(rb"\ ", rb"[ \t]*") for n in _NAMES) + rb")(?![A-Z])"
)
_UNKNOWN = (
    Support.REFUSED,
    "is not a statement that olp knows in this dialect, and may move the machine",
)


def name_of(upper: bytes) -> bytes:
    """The name of a statement as the table has it, else its first word."""
    match = _NAME.match(upper)
    if upper.startswith(b"Q") and b"=" in upper:
        return b"Q"
    fn = _FN.match(upper)
    if fn is not None:
        return b"FN " + str(int(fn[1])).encode()
    if match is not None:
        return (
            b" ".join(re.sub(rb"([A-Z])(\d)", rb"\1 \2", match[0]).split())
            if match[0] not in TABLE
            else match[0]
        )
    return upper.split()[0]


def refuse(name: bytes, statement: Statement) -> None:
    """Refuse a statement where the table does so, or does not have it. Raises ProgramError."""
    support, why = TABLE.get(name, _UNKNOWN)
    if support is not Support.REFUSED:
        return
    shown = name.decode("latin-1") if name in TABLE else statement.shown
    code = "OLP511" if UNROLL in why else "OLP512"
    if name in (b"RL", b"RR"):
        code = "OLP513"
    hint = UNROLL if why.endswith(UNROLL) else ""
    message = f"{shown} {why.removesuffix(UNROLL).rstrip(': ')}"
    raise ProgramError(message, line=statement.line, code=code, hint=hint)


def refuse_also_unrolled(statement: Statement) -> None:
    """Refuse what --flatten does not write out either. Raises ProgramError."""
    name = name_of(statement.upper)
    if name in TABLE and UNROLL not in TABLE[name][1]:
        refuse(name, statement)
