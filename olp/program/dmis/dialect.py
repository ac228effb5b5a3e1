"""The dialect of DMIS part programs: how its texts are detected, read and marked."""

from __future__ import annotations

import re

from olp.core.machine import Setup
from olp.program.dialect import Dialect, Options, StatementDialect
from olp.program.dmis.table import TABLE
from olp.program.program import Program
from olp.program.text.signs import POINTS_BY_SLASH

#: endings of files, in small letters
_ENDINGS = ("dmi", "dms", "dmis")


def _read(data: bytes, setup: Setup, dialect: Dialect, options: Options, *, words: bool) -> Program:
    from olp.program.dmis.reader import read

    return read(data, setup, dialect, options, words=words)


DIALECT = StatementDialect(
    name="dmis",
    table=TABLE,
    title="DMIS part programs of coordinate measuring machines (ISO 22093)",
    path_mode="the control's own approach and retract",
    reader=_read,
    endings=_ENDINGS,
    folder_endings=_ENDINGS,
    sign=re.compile(
        rb"(?im)^[ \t]*(DMISMN|FILNAM|SNSLCT|SNSET|PTMEAS|MEAS[ \t]*/|ENDMES|ENDFIL|WKPLAN|TECOMP|"
        rb"UNITS[ \t]*/[ \t]*\w+[ \t]*,|GOTO[ \t]*/[ \t]*CART|"
        rb"MODE[ \t]*/[ \t]*(?:MAN|PROG|AUTO)|F\([^)]*\)[ \t]*=[ \t]*FEAT|"
        rb"FEDRAT[ \t]*/[ \t]*\w+VEL)"
    ),
    shared_sign=POINTS_BY_SLASH,
    axes_at_ram=True,
    points=True,
    comment=(b"$$ ", b""),
    first=(b"FILNAM|DMISMN|DMISMD",),
)
