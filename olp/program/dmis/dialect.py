"""The dialect of DMIS part programs: how its texts are detected, read and marked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from olp.core.machine import Setup
from olp.program.dialect import Dialect, Options, StatementDialect
from olp.program.dmis.table import TABLE
from olp.program.program import Program
from olp.program.text.signs import DMIS

if TYPE_CHECKING:
    from olp.program.touches import Touches


def _read(data: bytes, setup: Setup, dialect: Dialect, options: Options, *, words: bool) -> Program:
    from olp.program.dmis.reader import read

    return read(data, setup, dialect, options, words=words)


def _touching(dialect: Dialect, touches: Touches, digits: int, notes: Sequence[str], log: str) -> bytes:
    from olp.program.dmis.probing import probing_program

    return probing_program(dialect, touches, digits, notes, log)


DIALECT = StatementDialect(
    name="dmis",
    table=TABLE,
    title="DMIS part programs of coordinate measuring machines (ISO 22093)",
    path_mode="the control's own approach and retract",
    reader=_read,
    toucher=_touching,
    signs=DMIS,
    folder_endings=DMIS.endings,
    axes_at_ram=True,
    points=True,
    comment=(b"$$ ", b""),
    first=(b"FILNAM|DMISMN|DMISMD",),
)
