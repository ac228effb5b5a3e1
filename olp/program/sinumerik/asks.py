"""What Sinumerik programs ask of the control beside motion and beside their words: M6, which is none."""

from __future__ import annotations

from collections.abc import Iterator

from olp.core.patterns import pattern
from olp.program.asked import Asked, places, said
from olp.program.program import Program

_M6 = pattern(rb"(?i)(?<![A-Z0-9_])M0*6(?![\d.=])")


def asks(program: Program) -> Iterator[Asked]:
    """The lines that change the tool, in order."""
    for line, _, before in places(program, _M6):
        if not said(before):
            yield Asked(line, change=True)
