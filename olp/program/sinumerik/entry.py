"""How a Sinumerik text is turned into words and unrolled; modules are loaded when they are first used."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from olp.program.asked import Asked
from olp.program.origin import Unrolled
from olp.program.program import Program
from olp.program.rs274.translation import Translation


def translate_text(data: bytes, *, tips: bool = False) -> Translation:
    """`olp.program.sinumerik.translate.translate`."""
    from olp.program.sinumerik.translate import translate

    return translate(data, tips=tips)


def unroll_text(data: bytes, dialect: Any, **options: Any) -> Unrolled:
    """`olp.program.sinumerik.flatten.unroll.flatten`."""
    from olp.program.sinumerik.flatten.unroll import flatten

    return flatten(data, dialect, **options)


def asked_of(program: Program) -> Iterator[Asked]:
    """`olp.program.sinumerik.asks.asks`."""
    from olp.program.sinumerik.asks import asks

    return asks(program)
