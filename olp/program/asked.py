"""What lines of a program ask of the control beside motion, as the dialects find it in their texts."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from olp.core.values import dataclass
from olp.program.program import Program

#: turn of the spindle by M code
TURNS: Mapping[int, int] = {3: 1, 4: -1, 5: 0}
_CHANGE = 6
#: M codes that end a program, or call another one
_CALLS = (2, 30, 97, 98, 99)
#: M codes that are told as what they do
_TOLD = (3, 4, _CHANGE, *_CALLS)


@dataclass(frozen=True, slots=True)
class Asked:
    """What a line asks for: M codes, a speed of the spindle, a tool change, a turn of the spindle (None: the
    one before)."""

    line: int
    codes: tuple[int, ...] = ()
    speed: float | None = None
    change: bool = False
    turn: int | None = None


def by_codes(
    line: int, codes: Sequence[int], speed: float | None = None, turns: Mapping[int, int] = TURNS
) -> Asked:
    """What the M codes of a line ask for."""
    turn = next((turns[c] for c in reversed(codes) if c in turns), None)
    return Asked(line, tuple(c for c in codes if c not in _TOLD), speed, _CHANGE in codes, turn)


def places(program: Program, wanted: re.Pattern[bytes]) -> Iterator[tuple[int, re.Match[bytes], bytes]]:
    """The places of a pattern in the text: the line, the match, and what stands before it in its line."""
    for found in wanted.finditer(program.data):
        line = int(np.searchsorted(program.line_start, found.start(), "right"))
        yield line, found, program.data[int(program.line_start[line - 1]) : found.start()]


def said(before: bytes) -> bool:
    """Whether what stands behind these bytes of a line is in a comment or in quotes."""
    return b";" in before or before.count(b'"') % 2 == 1
