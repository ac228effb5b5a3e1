"""The dialect of Heidenhain conversational programs: how its texts are detected, read and marked."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from olp.core.machine import Setup
from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.asked import Asked
from olp.program.dialect import Dialect, Options, StatementDialect
from olp.program.heidenhain.table import TABLE
from olp.program.origin import Unrolled
from olp.program.program import Program
from olp.program.text.signs import HEIDENHAIN

_ARC = pattern(rb"(?i)^([ \t]*\d*[ \t]*)C[RP]?\b|DR[ \t]*[-+]")


def _read(data: bytes, setup: Setup, dialect: Dialect, options: Options, *, words: bool) -> Program:
    from olp.program.heidenhain.reader import read

    return read(data, setup, dialect, options, words=words)


def _unroll(data: bytes, dialect: Dialect, **options: Any) -> Unrolled:
    from olp.program.heidenhain.unroll import unroll

    return unroll(data, dialect, **options)


def _asks(program: Program) -> Iterator[Asked]:
    from olp.program.heidenhain.asks import asks

    return asks(program)


@dataclass(frozen=True, slots=True, kw_only=True)
class Conversational(StatementDialect):
    """Statements that go on in the next line where a line ends with `~`."""

    def continues(self, line: bytes) -> bool:
        return line.rstrip().endswith(b"~")

    def straightened(self, line: bytes) -> bytes:
        return _ARC.sub(lambda m: b"" if m[1] is None else m[1] + b"L", line)


DIALECT = Conversational(
    name="heidenhain",
    table=TABLE,
    title="Heidenhain conversational",
    path_mode="not stated",
    reader=_read,
    unroller=_unroll,
    asks=_asks,
    unrolls_with_tools=True,
    signs=HEIDENHAIN,
    folder_endings=("h", "hnc"),
    inch_decimals=4,
    leads="axes",
    tips_from_zero=True,
    direction_words=(b"TX", b"TY", b"TZ"),
    comment=(b"; ", b""),
    first=(b"BEGIN PGM|0 BEGIN PGM|0  BEGIN PGM",),
)
