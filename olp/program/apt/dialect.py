"""The dialect of APT and cutter-location data: how its texts are detected, read and marked."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from olp.core.machine import Setup
from olp.program.apt.table import TABLE
from olp.program.asked import Asked
from olp.program.dialect import Dialect, Options, StatementDialect
from olp.program.origin import Unrolled
from olp.program.program import Program
from olp.program.text.signs import APT


def _read(data: bytes, setup: Setup, dialect: Dialect, options: Options, *, words: bool) -> Program:
    from olp.program.apt.reader import read

    return read(data, setup, dialect, options, words=words)


def _unroll(data: bytes, dialect: Dialect, **options: Any) -> Unrolled:
    from olp.program.apt.unroll import unroll

    return unroll(data, dialect, **options)


def _asks(program: Program) -> Iterator[Asked]:
    from olp.program.apt.asks import asks

    return asks(program)


DIALECT = StatementDialect(
    name="apt",
    table=TABLE,
    title="APT and cutter-location data (ISO 4343, ISO 3592)",
    path_mode="the post-processor's",
    reader=_read,
    unroller=_unroll,
    asks=_asks,
    signs=APT,
    folder_endings=APT.endings,
    leads="vector",
    tips_from_zero=True,
    comment=(b"$$ ", b""),
    first=(b"%", b"$$*", b"PARTNO"),
    contours_assumed="points under CUTCOM are corrected where they are stated: that the tool is there, or no "
    "farther from there than its wear, is assumed",
)
