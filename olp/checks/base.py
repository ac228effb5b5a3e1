"""Findings with lists of lines."""

from __future__ import annotations

from collections.abc import Sequence

from olp.core.arrays import Array, Index, Mask, distinct
from olp.core.toolpath import Toolpath
from olp.findings.catalogue import Finding

#: lines that a finding lists
_LISTED = 20


def finding(code: str, message: str, lines: Sequence[int] = (), count: int | None = None) -> Finding:
    """A finding at the given lines; `count` is their number, and the first 20 are listed."""
    unique = sorted(set(lines))
    return Finding(
        code,
        message,
        unique[0] if unique else None,
        tuple(unique[:_LISTED]),
        len(unique) if count is None else count,
    )


def first_line(path: Toolpath, moves: Mask) -> list[int]:
    """The first line of moves; none where there is no move."""
    return [int(path.line[moves].min())] if moves.any() else []


def lines_of(path: Toolpath, moves: Mask | Array | Index) -> list[int]:
    """The line numbers of moves, each once."""
    lines: list[int] = distinct(path.line[moves]).tolist()
    return lines
