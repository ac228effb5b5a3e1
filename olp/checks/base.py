"""Findings with lists of lines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from olp.core.arrays import Array, Index, Mask, distinct
from olp.core.toolpath import Flag, Toolpath
from olp.findings.catalogue import Finding
from olp.program.text.columns import spans

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


def first_lines(path: Toolpath) -> dict[int, int]:
    """The frames of the moves of a path, ascending, each with the first line of those in it."""
    none = np.iinfo(np.int64).max
    lines = np.full(len(path.frames), none)
    for some in spans(len(path)):
        frame = path.frame[some]
        runs = np.flatnonzero(np.diff(frame, prepend=-1))
        np.minimum.at(lines, frame[runs], np.minimum.reduceat(path.line[some], runs))
    return {number: line for number, line in enumerate(lines.tolist()) if line < none}


def beside_axes(path: Toolpath, some: slice) -> Mask:
    """(m,) moves of a part of a path whose blocks also move another axis, and are never split. Blocks that
    call a cycle behind their motion are not split either, but move X, Y and Z alone."""
    stop = min(some.stop, len(path) - 1)
    calls = np.zeros(some.stop - some.start, bool)
    behind = slice(some.start + 1, stop + 1)
    cycle = (path.flag[behind] & np.uint8(Flag.CYCLE)) != 0
    calls[: stop - some.start] = cycle & (path.line[behind] == path.line[some.start : stop])
    return np.asarray(((path.flag[some] & np.uint8(Flag.WHOLE)) != 0) & ~calls)


def lines_of(path: Toolpath, moves: Mask | Array | Index) -> list[int]:
    """The line numbers of moves, each once."""
    lines: list[int] = distinct(path.line[moves]).tolist()
    return lines
