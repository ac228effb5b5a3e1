"""A program in bands: consecutive lines, each band complete in itself, so that working columns are small.

A band ends only at a quiet place, between two plain feed moves that are alike, and where no axis turns round.
No rule of a correction looks across one. So what is made from the bands is the same as from the whole,
whatever their size.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Mask, all_in_row
from olp.core.spool import unload
from olp.core.toolpath import Flag, Kind, Toolpath
from olp.core.values import dataclass
from olp.program.program import Program

#: Moves of a band, at least.
SIZE = 1 << 15
#: Moves behind a band that are known with it.
AHEAD = 1000
#: Places that are looked at together.
_LOOKED_AT = 1 << 10
#: Flags of moves that lead to the next one as any feed move does.
_PLAIN = np.uint8(Flag.WHOLE | Flag.INCREMENTAL | Flag.INVERSE_TIME)


@dataclass(frozen=True, slots=True, eq=False)
class Band:
    """A band of a program as a `program` of its own, whose moves count from the first of the band. Its text,
    words and lines are those of the whole, and `end` is where its text ends. `first` is the number of moves
    before it, `share` the share of the whole that they are, and `until` that with the band. `ahead_mm` (m, 3)
    are the ends of the moves behind it."""

    program: Program
    first: int
    end: int
    share: float
    until: float
    ahead_mm: Array

    @property
    def middle(self) -> float:
        """The share of the whole up to the middle of the band."""
        return (self.share + self.until) / 2


def bands(program: Program) -> Iterator[Band]:
    """A program in bands of `SIZE` moves at least. One that is not written in blocks, whose words may be
    omitted, is one band."""
    path = program.toolpath
    count = max(len(path), 1)
    for first, last in spans(path, SIZE) if program.in_blocks else [(0, len(path))]:
        end = len(program.data) if last == len(path) else program.text_of(last)
        ahead = path.end_mm[last : last + AHEAD]
        yield Band(_part(program, first, last), first, end, first / count, last / count, ahead)
        unload()


def spans(path: Toolpath, size: int) -> Iterator[tuple[int, int]]:
    """First and last moves of bands of `size` moves at least."""
    # behind a contour an axis may be held until it moves again
    stop = _first_contour(path)
    first = last = 0
    while last < len(path):
        last = _quiet(path, first + size, stop)
        yield first, last
        first = last
    if not len(path):
        yield 0, 0


def _quiet(path: Toolpath, move: int, stop: int) -> int:
    """The first quiet place from a move on and before move `stop`, else the end of the path."""
    for a in range(move, stop, _LOOKED_AT):
        quiet = np.flatnonzero(_quiet_before(path, a, min(a + _LOOKED_AT, stop)))
        if quiet.size:
            return a + int(quiet[0])
    return len(path)


def _quiet_before(path: Toolpath, a: int, b: int) -> Mask:
    """(b - a,) whether the place before each of moves a..b is quiet; `a` is 1 at least."""
    before, behind = slice(a - 1, b - 1), slice(a, b)
    kind, flag = path.kind, path.flag
    feed = _is_feed(kind[before]) & _is_feed(kind[behind])
    alike = (flag[before] == flag[behind]) & ((flag[behind] & ~_PLAIN) == 0)
    alike &= (path.frame[before] == path.frame[behind]) & (path.line[before] != path.line[behind])
    ways = directions(path, a - 1, b)
    curved = (kind[before] != Kind.LINE) | (kind[behind] != Kind.LINE)
    alike &= curved | all_in_row(ways[:-1] == ways[1:])
    return np.asarray(feed & alike)


def directions(path: Toolpath, a: int, b: int) -> Array:
    """(b - a, 3) the directions in which moves a..b drive each axis: 1, -1, or 0 where it stands still or
    where its motion is not known."""
    end = path.end_mm[a:b]
    start = np.vstack((path.start_mm if a == 0 else path.end_mm[a - 1], end[:-1]))
    return np.asarray(np.sign(np.nan_to_num(end - start)))


def _is_feed(kind: npt.NDArray[np.uint8]) -> Mask:
    return np.asarray((kind >= Kind.LINE) & (kind <= Kind.ARC_CCW))


def _first_contour(path: Toolpath) -> int:
    """The first move along a contour that the control offsets; the number of moves where there is none."""
    some = [k for k, frame in enumerate(path.frames) if frame.compensation is not None]
    on = np.flatnonzero(np.isin(path.frame, some)) if some else np.zeros(0, np.int64)
    return int(on[0]) if on.size else len(path)


def _part(program: Program, first: int, last: int) -> Program:
    """The moves `first`..`last` of a program."""
    path, slots = program.toolpath, program.arc_slots
    if first == 0 and last == len(path):
        return program
    arcs = path.arcs.within(first, last)
    arc_slots = slots.part(arcs) if len(slots.word) else slots
    # a position that is stored before the first move belongs to the first band
    captures = tuple(
        replace(capture, moves=capture.moves - first)
        for capture in program.captures
        if first < capture.moves <= last or first == 0 == capture.moves
    )
    programmed, blocks = program.programmed, program.blocks
    if programmed is not None and blocks is not None:
        begin, end = int(blocks[first]), int(blocks[last - 1]) + 1
        programmed, blocks = _part(programmed, begin, end), blocks[first:last] - begin
    return replace(
        program, programmed=programmed, blocks=blocks, toolpath=path.part(first, last),
        slot=program.slot[first:last], arc_slots=arc_slots,
        captures=captures, holes=program.holes.part(first, last),
        called=program.called.part(first, last),
    )  # fmt: skip
