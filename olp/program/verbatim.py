"""Programs of lists and described languages: the moves and numbers that their readers collect, as columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Index
from olp.core.machine import Setup
from olp.core.toolpath import Arcs, Frame, Kind, Toolpath
from olp.core.values import dataclass
from olp.program.dialect import Dialect
from olp.program.pointlist.columns import plain_numbers
from olp.program.program import ArcSlots, Program, StatedFeeds, Statements, Words
from olp.program.text.columns import Packed
from olp.program.text.line_ends import split
from olp.program.text.numbers import MOST_DECIMALS, number

Small = npt.NDArray[np.int32]
#: speeds are read, and none is written
_UNWRITTEN = StatedFeeds(np.zeros(1, np.int64), np.ones(1, np.int64), np.full(1, -1))

#: what is kept of a move, and of a number (`spans`): type of the values and how many there are
_KEPT: dict[str, tuple[Any, int]] = {
    "kind": (np.uint8, 0), "flag": (np.uint8, 0), "line": (np.int32, 0), "frame": (np.int32, 0),
    "end": (np.float64, 3), "slot": (np.int32, 3), "bounds": (np.int32, 2), "feed": (np.float64, 0),
    "spans": (np.int64, 2),
}  # fmt: skip


@dataclass(slots=True)
class Moves:
    """Moves that are collected singly or many at once, and the numbers of the text by their bytes.

    Each move has `kind`, `flag`, `line`, `frame`, `end`, `slot`, the bytes of its statement (-1, -1 where
    none may be copied), and its feed. `plain` are mantissa, decimals, first byte and last byte of all
    numbers, where they are known as columns.
    """

    lists: dict[str, list[Any]] = field(default_factory=lambda: {name: [] for name in _KEPT})
    columns: list[dict[str, npt.NDArray[Any]]] = field(default_factory=list)
    plain: tuple[Index, npt.NDArray[np.int8], Index, Index] | None = None
    number_count: int = 0

    def number(self, start: int, end: int) -> int:
        """A number of the text; returns its slot."""
        self.lists["spans"].append((start, end))
        self.number_count += 1
        return self.number_count - 1

    def numbers(self, spans: Sequence[tuple[int, int]]) -> int:
        """Numbers of the text, with slots that follow one another; returns the first."""
        self.lists["spans"].extend(spans)
        self.number_count += len(spans)
        return self.number_count - len(spans)

    def put(
        self, *, kind: int, flag: int, line: int, frame: int, end: Sequence[float], slot: Sequence[int],
        bounds: tuple[int, int], feed: float,
    ) -> None:  # fmt: skip
        """One move."""
        lists = self.lists
        lists["kind"].append(kind)
        lists["flag"].append(flag)
        lists["line"].append(line)
        lists["frame"].append(frame)
        lists["end"].append(end)
        lists["slot"].append(slot)
        lists["bounds"].append(bounds)
        lists["feed"].append(feed)

    def put_all(self, **moves: npt.ArrayLike) -> None:
        """Many moves; with `spans` their numbers, whose slots continue from `number_count`."""
        self._close()
        made = {name: _column(name, values) for name, values in moves.items()}
        self.number_count += len(made["spans"]) if "spans" in made else 0
        self.columns.append(made)

    def _close(self) -> None:
        """Turn the moves that were put singly into columns."""
        if any(self.lists.values()):
            self.columns.append({name: _column(name, values) for name, values in self.lists.items()})
            self.lists = {name: [] for name in _KEPT}

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
        """The whole program."""
        self._close()
        all_ = {
            name: np.concatenate([c[name] for c in self.columns if name in c] or [_column(name, [])])
            for name in _KEPT
        }
        starts, stops = _line_bounds(data)
        kind, bounds = all_["kind"], all_["bounds"]
        x, y, z = (float("nan") if v is None else v for v in setup.job.start_mm)
        count = len(kind)
        return Program(
            data=data,
            dialect=dialect,
            toolpath=Toolpath(
                kind=kind, flag=all_["flag"], line=all_["line"], frame=all_["frame"], end_mm=all_["end"],
                frames=tuple(frames), arcs=Arcs.none(), start_mm=(x, y, z),
            ),
            words=self._words(data, all_["spans"], decimal, len(starts)) if words else None,
            slot=all_["slot"],
            arc_slots=ArcSlots(np.zeros((0, 5), np.int32), np.zeros(0, bool)),
            line_start=starts,
            line_end=stops,
            remarks=tuple(remarks),
            end_line=len(starts),
            statements=Statements(
                begin=bounds[:, 0], end=bounds[:, 1],
                feed_mm_s=np.where(kind == Kind.RAPID, np.inf, all_["feed"]),
                rest=np.zeros(count + 1, bool), dwell_s=np.zeros(count + 1), arcs={}, broken={},
                strokes=np.zeros((0, 2), np.int64), feeds=_UNWRITTEN, decimal=decimal,
            ),
        )  # fmt: skip

    def _words(self, data: bytes, spans: Index, decimal: bytes, lines: int) -> Words:
        """Numbers as words without letters."""
        start, stop = spans[:, 0], spans[:, 1]
        if self.plain is None and len(spans):
            text = np.frombuffer(data, np.uint8)
            order = np.argsort(start, kind="stable")
            apart = bool((start[order][1:] >= stop[order][:-1]).all())
            parsed = plain_numbers(text, start, stop, decimal == b",") if apart else None
            self.plain = None if parsed is None else (*parsed, start, stop)
        if self.plain is not None:
            mantissa, decimals, start, stop = self.plain
            fine = decimals > MOST_DECIMALS
            if fine.any():
                mantissa = np.where(fine, np.rint(mantissa / 10.0 ** (decimals - MOST_DECIMALS)), mantissa)
                decimals = np.minimum(decimals, MOST_DECIMALS)
        else:
            # one that is larger than any machine stays a word, and is refused where it would be written
            forms = [number(data[a:b], decimal) for a, b in spans.tolist()]
            decimals = np.array(
                [0 if n is None else min(max(n.places, 0), MOST_DECIMALS) for n in forms], np.int8
            )
            value = np.array([0.0 if n is None else n.value for n in forms], float)
            mantissa = np.rint(value * 10.0 ** decimals.astype(np.int64))
        begin = start.astype(np.int32)
        return Words(
            letter=np.zeros(len(start), np.uint8),
            mantissa=Packed.of(mantissa.astype(np.int64)),
            decimals=decimals.astype(np.int8),
            pointed=np.ones(len(start), bool),
            start=begin,
            number=Packed.of(begin, begin),
            end=Packed.of(stop, begin),
            first_word=np.zeros(lines + 1, np.int32),
        )


def _column(name: str, values: npt.ArrayLike) -> npt.NDArray[Any]:
    kind, width = _KEPT[name]
    column = np.asarray(values, kind)
    return column.reshape(-1, width) if width else column


def _line_bounds(data: bytes) -> tuple[Small, Small]:
    """(lines,) where each line begins and where its text ends."""
    if b"\r" not in data:
        text = np.frombuffer(data, np.uint8)
        newline = np.flatnonzero(text == 10)
        ends = newline if newline.size and newline[-1] == len(text) - 1 else np.append(newline, len(text))
        return np.concatenate(([0], ends[:-1] + 1)).astype(np.int32), ends.astype(np.int32)
    starts, stops = [], []
    begin = 0
    for raw in split(data):
        starts.append(begin)
        stops.append(begin + len(raw.rstrip(b"\r\n")))
        begin += len(raw)
    return np.array(starts or [0], np.int32), np.array(stops or [0], np.int32)
