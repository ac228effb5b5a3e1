"""What a program says to its control alone: modes of smoothing, tolerances, ways to accelerate.

A correction does not need these words, so the readers of programs leave them as they are. They are found in
the text, outside of comments and quotes.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.values import dataclass
from olp.program.asked import places
from olp.program.program import Program

#: a number that stands as such in a text
NUMBER = re.compile(rb"[ \t]*([+-]?(?:\d+\.?\d*|\.\d+))[ \t]*")


@dataclass(frozen=True, slots=True)
class Said:
    """`before` are the values by name at the start of a program; `changes` are (line, name, value) in order
    of lines, from which on they hold. `beside` are (line, word): what is not in the time."""

    before: Mapping[str, float]
    changes: tuple[tuple[int, str, float], ...]
    beside: tuple[tuple[int, str], ...]

    def columns(self, line: Index) -> dict[str, Array]:
        """The values on lines (m,), by name."""
        result = {}
        for name, first in self.before.items():
            rows = [(at, value) for at, own, value in self.changes if own == name]
            value = np.array([first, *(value for _, value in rows)])
            result[name] = value[np.searchsorted([at for at, _ in rows], line, "right")]
        return result


def spoken(program: Program, wanted: re.Pattern[bytes]) -> Iterator[tuple[int, re.Match[bytes]]]:
    """The places of a pattern outside of comments and quotes: line and match."""
    marks = program.dialect.comment_marks()
    for line, found, before in places(program, wanted):
        quoted = before.count(b'"') % 2 == 1
        if not quoted and not any(_open(before, begin, end) for begin, end in marks):
            yield line, found


def _open(before: bytes, begin: bytes, end: bytes) -> bool:
    at = before.rfind(begin)
    return at >= 0 and (not end or before.find(end, at) < 0)


def number(text: bytes) -> float | None:
    """The number that a text is, None for an expression."""
    match = NUMBER.fullmatch(text)
    return None if match is None else float(match[1])
