"""Programs of lists and described languages: what their readers found, as columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.machine import Setup
from olp.program.dialect import Dialect
from olp.program.numbertext import MOST_DECIMALS, Number
from olp.program.program import ArcSlots, Program, StatedFeeds, Statements, Words
from olp.toolpath import Arcs, Frame, Kind, Toolpath

Small = npt.NDArray[np.int32]
Index = npt.NDArray[np.int64]
#: speeds are read, and none is written back
_UNWRITTEN = StatedFeeds(np.zeros(1, np.int64), np.ones(1, np.int64), np.full(1, -1))


@dataclass(slots=True)
class Moves:
    """Moves on their way: `kind`, `flag`, `line`, `frame`, `end` and the `slot` of each, the bytes of its
    statement (-1, -1 where none may be copied), its feed, each a list or a column; and the numbers of the
    text with their bytes, or `plain`: mantissa, decimals, first byte and last of each, as columns."""

    numbers: list[Number] = field(default_factory=list)
    spans: list[tuple[int, int]] = field(default_factory=list)
    kind: Any = field(default_factory=list)
    flag: Any = field(default_factory=list)
    line: Any = field(default_factory=list)
    frame: Any = field(default_factory=list)
    end: Any = field(default_factory=list)
    slot: Any = field(default_factory=list)
    bounds: Any = field(default_factory=list)
    feed: Any = field(default_factory=list)
    plain: tuple[Index, npt.NDArray[np.int8], Index, Index] | None = None

    def program(
        self,
        data: bytes,
        dialect: Dialect,
        setup: Setup,
        frames: Sequence[Frame],
        remarks: Sequence[tuple[str, int, str]],
        *,
        decimal: bytes,
        words: bool,
    ) -> Program:
        """All of it."""
        starts, stops = _line_bounds(data)
        kind = np.array(self.kind, np.uint8)
        bounds = np.array(self.bounds, np.int32).reshape(-1, 2)
        x, y, z = (float("nan") if v is None else v for v in setup.job.start_mm)
        count = len(kind)
        return Program(
            data=data,
            dialect=dialect,
            toolpath=Toolpath(
                kind=kind, flag=np.array(self.flag, np.uint8), line=np.array(self.line, np.int32),
                frame=np.array(self.frame, np.int32), end_mm=np.array(self.end, float).reshape(-1, 3),
                frames=tuple(frames), arcs=Arcs.none(), start_mm=(x, y, z),
            ),
            words=self._words(len(starts)) if words else None,
            slot=np.array(self.slot, np.int32).reshape(-1, 3),
            arc_slots=ArcSlots(np.zeros((0, 5), np.int32), np.zeros(0, bool)),
            line_start=starts,
            line_end=stops,
            remarks=tuple(remarks),
            end_line=len(starts),
            statements=Statements(
                begin=bounds[:, 0], end=bounds[:, 1],
                feed_mm_s=np.where(kind == Kind.RAPID, np.inf, np.array(self.feed, float)),
                rest=np.zeros(count + 1, bool), dwell_s=np.zeros(count + 1), arcs={}, broken={},
                strokes=np.zeros((0, 2), np.int64), feeds=_UNWRITTEN, decimal=decimal,
            ),
        )  # fmt: skip

    def _words(self, lines: int) -> Words:
        """Numbers as words without letters."""
        if self.plain is not None:
            mantissa, decimals, start, stop = self.plain
            fine = decimals > MOST_DECIMALS
            if fine.any():
                mantissa = np.where(fine, np.rint(mantissa / 10.0 ** (decimals - MOST_DECIMALS)), mantissa)
                decimals = np.minimum(decimals, MOST_DECIMALS)
        else:
            decimals = np.array([min(max(n.places, 0), MOST_DECIMALS) for n in self.numbers], np.int8)
            value = np.array([n.value for n in self.numbers], float)
            mantissa = np.rint(value * 10.0 ** decimals.astype(np.int64))
            start, stop = np.array(self.spans, np.int64).reshape(-1, 2).T
        return Words(
            letter=np.zeros(len(start), np.uint8),
            mantissa=mantissa.astype(np.int64),
            decimals=decimals.astype(np.int8),
            pointed=np.ones(len(start), bool),
            start=start.astype(np.int32),
            number=start.astype(np.int32),
            end=stop.astype(np.int32),
            first_word=np.zeros(lines + 1, np.int32),
        )


def _line_bounds(data: bytes) -> tuple[Small, Small]:
    """(lines,) where each line begins and where its text ends."""
    if b"\r" not in data:
        text = np.frombuffer(data, np.uint8)
        newline = np.flatnonzero(text == 10)
        ends = newline if newline.size and newline[-1] == len(text) - 1 else np.append(newline, len(text))
        return np.concatenate(([0], ends[:-1] + 1)).astype(np.int32), ends.astype(np.int32)
    starts, stops = [], []
    at = 0
    for raw in data.splitlines(keepends=True):
        starts.append(at)
        stops.append(at + len(raw.rstrip(b"\r\n")))
        at += len(raw)
    return np.array(starts or [0], np.int32), np.array(stops or [0], np.int32)
