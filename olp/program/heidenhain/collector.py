"""What is collected while a Heidenhain program is read: words, moves, arcs, feeds and rests; at the end the
`Program`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask
from olp.core.toolpath import Flag, Frame, Kind
from olp.program.dialect import Dialect
from olp.program.heidenhain.chunk import LATE_M
from olp.program.heidenhain.columns import Blocks
from olp.program.program import (
    ArcSlots,
    Definitions,
    Poles,
    Program,
    StatedFeeds,
    Statements,
    Towards,
)
from olp.program.rs274.collector import Collector
from olp.program.tilts import Tilt

#: M functions that say how a block is carried out, and stop nothing
_NO_REST = (
    89,
    90,
    91,
    92,
    94,
    97,
    98,
    99,
    103,
    107,
    108,
    109,
    110,
    111,
    120,
    124,
    126,
    127,
    129,
    136,
    137,
    138,
)

_POLES = (("form", np.uint8), ("begin", np.int32), ("taken", np.int32))


class Collected(Collector):
    """Columns of one program while it is read."""

    def __init__(self, data: bytes, start: tuple[float, float, float], *, keep_words: bool) -> None:
        super().__init__(data, start, keep_words=keep_words)
        self.strokes: list[tuple[int, int]] = []
        self.definitions: list[tuple[int, int, int, int, float]] = []
        self.pauses: list[tuple[int, float]] = []
        self.tilts: list[Tilt] = []
        #: directions of the tool: moves, what they state, and their words
        self.towards: list[tuple[Index, Array, Index]] = []

    def put_blocks(self, blocks: Blocks) -> None:
        words = blocks.words
        self.put_words(replace(words, letter=blocks.letter))
        m = np.flatnonzero(blocks.letter == ord("M"))
        code = np.rint(blocks.value[m]).astype(np.int64)
        rests = ~np.isin(code, _NO_REST)
        self.columns.put("rest_line", words.line[m[rests]] + words.first_line + 1, np.int64)
        self.columns.put("rest_late", np.isin(code[rests], LATE_M), np.bool_)

    def put_feeds(self, mm_s: Array) -> None:
        self.columns.put("feed", mm_s, np.float64)

    def put_feed_words(self, line: Index, word: Index) -> None:
        self.columns.put("feed_line", line, np.int64)
        self.columns.put("feed_word", word, np.int64)

    def put_poles(self, form: npt.ArrayLike, begin: npt.ArrayLike, taken: npt.ArrayLike) -> None:
        self.columns.put("pole_form", form, np.uint8)
        self.columns.put("pole_begin", begin, np.int32)
        self.columns.put("pole_taken", taken, np.int32)

    def put_one(
        self, kind: Kind, flag: Flag, line: int, frame: int, end_mm: Sequence[float], feed_mm_s: float,
        slot: Sequence[int] = (-1, -1, -1),
    ) -> None:  # fmt: skip
        """One move."""
        self.put_moves(
            np.array([kind], np.uint8), np.array([flag], np.uint8), [line], [frame],
            np.array([list(end_mm)], float), [list(slot)],
        )  # fmt: skip
        self.put_feeds(np.array([feed_mm_s]))

    def finished(self, dialect: Dialect, frames: Sequence[Frame], end_line: int) -> Program:
        """The whole program. Takes the columns: call it once only."""
        take = self.columns.take
        path = self.toolpath(frames, self.start)
        line_start, line_end = self._line_bounds()
        words = self._words() if self.keep_words else None
        rest, dwell = self._rests(path.line)
        return Program(
            data=self.data,
            dialect=dialect,
            toolpath=path,
            words=words,
            slot=take("slot", np.int32, 3),
            arc_slots=ArcSlots(
                take("arc_words", np.int32, 5), take("arc_absolute", np.bool_),
                Poles(*(take("pole_" + name, kind) for name, kind in _POLES)),
            ),
            line_start=line_start,
            line_end=line_end,
            remarks=tuple((name, line, text) for name, (line, text) in self.remarks.items()),
            end_line=end_line,
            tilts=tuple(self.tilts),
            towards=self._directions(len(path)),
            levels=tuple(self.levels),
            statements=Statements(
                begin=line_start[path.line - 1], end=line_end[path.line - 1],
                feed_mm_s=take("feed", np.float64), rest=rest, dwell_s=dwell, arcs={}, broken={},
                strokes=np.array(self.strokes, np.int64).reshape(-1, 2), feeds=self._feeds(path.line),
                definitions=Definitions.of(self.definitions),
            ),
        )  # fmt: skip

    def _directions(self, count: int) -> Towards | None:
        if not self.towards:
            return None
        towards = Towards.none(count, lasting=False)
        for moves, stated, slot in self.towards:
            towards.stated[moves] = stated
            towards.slot[moves] = slot if self.keep_words else -1
        return towards

    def _rests(self, line: npt.NDArray[np.int32]) -> tuple[Mask, Array]:
        take = self.columns.take
        rest, dwell = np.zeros(len(line) + 1, bool), np.zeros(len(line) + 1)
        at, late = take("rest_line", np.int64), take("rest_late", np.bool_)
        rest[np.searchsorted(line, at[late], "right")] = True
        rest[np.searchsorted(line, at[~late])] = True
        for move, seconds in self.pauses:
            rest[move] = True
            dwell[move] += seconds
        return rest, dwell

    def _feeds(self, path_line: npt.NDArray[np.int32]) -> StatedFeeds:
        line, word = self.columns.take("feed_line", np.int64), self.columns.take("feed_word", np.int64)
        line, word = np.concatenate(([0], line)), np.concatenate(([-1], word))
        return StatedFeeds(np.searchsorted(path_line, line), line, word)
