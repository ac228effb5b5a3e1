"""What is collected while a program of statements is read: points of a chunk, then words, moves and arcs of
the whole text, and at the end the `Program`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask
from olp.core.errors import ProgramError
from olp.core.toolpath import Flag, Frame, Kind
from olp.core.values import dataclass
from olp.program.dialect import Dialect
from olp.program.path_columns import PathColumns
from olp.program.program import (
    ArcSlots,
    ArcText,
    ChordText,
    Program,
    StatedFeeds,
    Statements,
    Towards,
    Words,
)
from olp.program.text.columns import Packed
from olp.program.text.statements import Chunk, Field, Statement, is_cards

#: Powers of ten by their exponent: those of the decimals of a number.
_POW10 = 10.0 ** np.arange(19)
_NONE = (-1, -1, -1)
#: Refused by a table of statements, wherever the statement is.
NOT_READ = "OLP512"
#: columns of cards and of old terminals: a text within one of these widths is kept within it
_WIDTHS = (72, 80)


@dataclass(frozen=True, slots=True)
class Point:
    """A point that was read singly: its line, the bytes of its statement, the fields of its coordinates and
    of its direction. `incremental`: the coordinates are distances, and a single one is along Z. A `form`
    other than 0, a number of the reader, has other numbers, `values`. Where such a point moves, the text
    `lead` and x, y, z replace the bytes of `fields`."""

    line: int
    begin: int
    end: int
    fields: Sequence[Field]
    direction: Sequence[Field] = ()
    incremental: bool = False
    form: int = 0
    values: tuple[float, ...] = ()
    lead: bytes = b""


@dataclass(slots=True, eq=False)
class Points:
    """The points of a chunk in order.

    (m,) `line` from 1, `begin` and `end` of their statements, `incremental` and `form`. (m, 3) `slot` word or
    -1, `value` as written, `direction` (NaN where none is stated) and `aim`, its words or -1. Those of
    another form than 0 have their numbers in `value` and `direction`."""

    line: Index
    begin: Index
    end: Index
    slot: Index
    value: Array
    direction: Array
    incremental: Mask
    form: Index
    aim: Index

    def __len__(self) -> int:
        return len(self.line)


def in_order(
    events: Sequence[Statement],
    points: Points,
    event: Callable[[Statement, int], None],
    by_table: Callable[[Statement], ProgramError | None],
) -> None:
    """Takes each statement between the points of a chunk, with the row of the point behind it. A refusal by
    the table of statements names the later ones, too."""
    rows = np.searchsorted(points.line, np.array([one.line for one in events], np.int64)).tolist()
    for k, (statement, row) in enumerate(zip(events, rows, strict=True)):
        try:
            event(statement, row)
        except ProgramError as error:
            if error.code == NOT_READ:
                error.others = tuple(filter(None, map(by_table, events[k + 1 :])))
            raise


#: A point that was read singly: its words, its numbers, its direction, and the words of that.
Lone = tuple[Point, tuple[int, ...], Array, Array, tuple[int, ...]]


class StatementCollector(PathColumns):
    """Columns of one program while it is read. Without `keep_words` those that only writing needs are left
    out."""

    def __init__(self, data: bytes, dialect: Dialect, *, keep_words: bool) -> None:
        super().__init__(keep_words=keep_words)
        self.data, self.dialect = data, dialect
        self.words = self._base = 0
        self._lone: list[tuple[int, int, bool, int, int]] = []
        self.arcs: dict[int, ArcText] = {}
        self.broken: dict[int, bytes] = {}
        self.strokes: list[tuple[int, int]] = []
        self.restated: dict[int, bool] = {}
        self.chords: list[ChordText] = []
        self.remarks: dict[str, tuple[int, str]] = {}
        self._towards: list[tuple[int, Array, Index]] = []
        self._feeds: list[tuple[int, float, int, int]] = [(0, float("nan"), 0, -1)]
        self.pauses: list[tuple[int, float]] = []

    # -- words and points of a chunk -----------------------------------------------------------------

    def begin(self, chunk: Chunk) -> None:
        """Begin a chunk: its lines, and the words of its plain points."""
        self.columns.put("line_start", chunk.line_start, np.int32)
        self.columns.put("line_end", chunk.line_end, np.int32)
        self._base = self.words
        self._put_words(chunk.mantissa, chunk.decimals, chunk.pointed, chunk.start, chunk.end)

    def finish(self) -> None:
        """End a chunk: the words that were read singly come after those of its plain points."""
        if self._lone:
            mantissa, decimals, pointed, start, end = zip(*self._lone, strict=True)
            self.words -= len(self._lone)
            self._lone = []
            self._put_words(mantissa, decimals, pointed, start, end)

    def points(self, chunk: Chunk, alone: Sequence[Point]) -> Points:
        """The points of a chunk, those that were read in columns and those that were read singly."""
        three = np.arange(3)
        slot = chunk.first[:-1, None] + three
        direction = np.full((len(slot), 3), np.nan)
        value = chunk.mantissa / _POW10[chunk.decimals]
        wide = chunk.width == 6
        if wide.any():
            direction[wide] = value[slot[wide] + 3]
        points = Points(
            line=chunk.point + (chunk.first_line + 1),
            begin=chunk.line_start[chunk.point],
            end=chunk.line_end[chunk.point],
            slot=slot + self._base,
            value=value[slot],
            direction=direction,
            incremental=np.zeros(len(slot), bool),
            form=np.zeros(len(slot), np.int64),
            aim=np.where(wide[:, None], slot + self._base + 3, -1),
        )
        return _merged(points, [self._alone(p) for p in alone]) if alone else points

    def _alone(self, point: Point) -> Lone:
        if point.form:
            return self._of_another_form(point)
        slot = tuple(self.word(f) for f in point.fields)
        value = np.array([_value(f) for f in point.fields])
        if len(slot) == 1:
            slot, value = (-1, -1, slot[0]), np.array([0.0, 0.0, value[0]])
        direction = np.array([_value(f) for f in point.direction] or [np.nan] * 3)
        return point, slot, value, direction, tuple(self.word(f) for f in point.direction) or _NONE

    def _of_another_form(self, point: Point) -> Lone:
        """Three words without a number, and the numbers of the statement."""
        decimals = max((f.number[1] for f in point.fields if f.number is not None), default=0)
        slot = tuple(self._put_word(0, decimals, f.start, f.end) for f in point.fields)
        if slot[0] >= 0:
            self.broken[slot[0]] = self.broken.get(slot[0], b"") + point.lead
        values = np.array((*point.values, *[np.nan] * 6)[:6])
        return point, slot, values[:3], values[3:], _NONE

    def word(self, field: Field) -> int:
        """Add a word for a number; returns its index."""
        pair = field.number
        assert pair is not None
        return self._put_word(*pair, field.start, field.end)

    def _put_word(self, mantissa: int, decimals: int, start: int, end: int) -> int:
        if not self.keep_words:
            return -1
        text = self.data[start:end]
        if b"$" in text:
            mark = text.index(b"$")
            stop = max(text.rfind(b"\n"), text.rfind(b"\r")) + 1
            self.broken[self.words] = text[mark:stop]
        self._lone.append((mantissa, decimals, b"." in text, start, end))
        self.words += 1
        return self.words - 1

    def _put_words(
        self,
        mantissa: npt.ArrayLike,
        decimals: npt.ArrayLike,
        pointed: npt.ArrayLike,
        start: npt.ArrayLike,
        end: npt.ArrayLike,
    ) -> None:
        count = len(np.asarray(start))
        if self.keep_words:
            self.columns.put("mantissa", mantissa, np.int64)
            self.columns.put("decimals", decimals, np.int8)
            self.columns.put("pointed", pointed, np.bool_)
            self.columns.put("word_start", start, np.int32)
            self.columns.put("word_end", end, np.int32)
        self.words += count

    # -- moves ---------------------------------------------------------------------------------------

    def put_stated_moves(
        self,
        kind: npt.NDArray[np.uint8],
        flag: npt.NDArray[np.uint8],
        line: npt.ArrayLike,
        frame: npt.ArrayLike,
        end_mm: Array,
        slot: npt.ArrayLike,
        begin: npt.ArrayLike,
        end: npt.ArrayLike,
    ) -> None:
        self.put_moves(kind, flag, line, frame, end_mm, slot)
        if self.keep_words:
            self.columns.put("begin_byte", begin, np.int32)
            self.columns.put("end_byte", end, np.int32)

    def put_directions(self, stated: Array, slot: Index) -> None:
        """Directions (m, 3) of the tool in the next moves, NaN where a move states none, and their words."""
        self._towards.append((self.moves, stated, slot))

    def put_lone(
        self,
        kind: Kind,
        flag: Flag,
        line: int,
        frame: int,
        end_mm: Iterable[float],
        slot: Sequence[int] = _NONE,
    ) -> None:
        """One move without a statement that could be edited."""
        self.put_stated_moves(
            np.array([kind], np.uint8), np.array([flag], np.uint8), [line], [frame],
            np.array([list(end_mm)], float), [slot], [-1], [-1],
        )  # fmt: skip

    def put_feed(self, move: int, mm_s: float, line: int, word: int = -1) -> None:
        """A feed from a move on, and the word that states it."""
        self._feeds.append((move, mm_s, line, word))

    # -- the end -------------------------------------------------------------------------------------

    def program(
        self, frames: Sequence[Frame], start_mm: tuple[float, float, float], end_line: int, rapid: bytes
    ) -> Program:
        """The whole program. Takes the columns: call it once only."""
        take = self.columns.take
        path = self.toolpath(frames, start_mm)
        line_start, line_end = take("line_start", np.int32), take("line_end", np.int32)
        longest = int((line_end - line_start).max(initial=0))
        rest, dwell = np.zeros(len(path) + 1, bool), np.zeros(len(path) + 1)
        for move, seconds in self.pauses:
            rest[move] = True
            dwell[move] += seconds
        cards = is_cards(self.data)
        move, line, word = np.array([(m, n, w) for m, _, n, w in self._feeds], np.int64).T
        feeds = StatedFeeds(move, line, word)
        statements = Statements(
            begin=take("begin_byte", np.int32), end=take("end_byte", np.int32),
            feed_mm_s=self._feed(path.kind, path.flag), rest=rest, dwell_s=dwell, arcs=self.arcs,
            broken=self.broken, strokes=np.array(self.strokes, np.int64).reshape(-1, 2),
            feeds=feeds, rapid=rapid, restated=self.restated, chords=tuple(self.chords),
            cards=cards,
            width=72 if cards else next((w for w in _WIDTHS if longest <= w), 0),
        )  # fmt: skip
        count = len(path.arcs)
        return Program(
            data=self.data,
            dialect=self.dialect,
            toolpath=path,
            words=self._words() if self.keep_words else None,
            slot=take("slot", np.int32, 3),
            arc_slots=ArcSlots(np.full((count, 5), -1, np.int32), np.ones(count, bool)),
            line_start=line_start,
            line_end=line_end,
            remarks=tuple((name, line, text) for name, (line, text) in self.remarks.items()),
            end_line=end_line,
            statements=statements,
            towards=self._directions(len(path)),
        )

    def _directions(self, count: int) -> Towards | None:
        if not self._towards:
            return None
        towards = Towards.none(count)
        for first, stated, slot in self._towards:
            towards.stated[first : first + len(stated)] = stated
            towards.slot[first : first + len(slot)] = slot if self.keep_words else -1
        return towards

    def _feed(self, kind: npt.NDArray[np.uint8], flag: npt.NDArray[np.uint8]) -> Array:
        move, value, *_ = (np.array(column) for column in zip(*self._feeds, strict=True))
        feed = value[np.searchsorted(move, np.arange(len(kind)), "right") - 1]
        feed[kind == Kind.RAPID] = np.inf
        feed[(flag & np.uint8(Flag.CONTROL)) != 0] = np.nan
        return np.asarray(feed, float)

    def _words(self) -> Words:
        """Words in the order of reading, which is not that of lines: so no index leads from lines to
        words."""
        take = self.columns.take
        start = take("word_start", np.int32)
        return Words(
            letter=np.zeros(len(start), np.uint8),
            mantissa=self.columns.packed("mantissa"),
            decimals=take("decimals", np.int8),
            pointed=take("pointed", np.bool_),
            start=start,
            number=Packed.of(start, start),
            end=Packed.of(take("word_end", np.int32), start),
            first_word=np.zeros(0, np.int32),
        )


def _value(field: Field) -> float:
    pair = field.number
    assert pair is not None
    return pair[0] / 10.0 ** pair[1]


def _merged(points: Points, alone: Sequence[Lone]) -> Points:
    """Points read in columns and points read singly, in the order of their lines."""
    more = Points(
        line=np.array([p.line for p, *_ in alone], np.int64),
        begin=np.array([p.begin for p, *_ in alone], np.int64),
        end=np.array([p.end for p, *_ in alone], np.int64),
        slot=np.array([slot for _, slot, *_ in alone], np.int64),
        value=np.array([value for _, _, value, *_ in alone]),
        direction=np.array([direction for *_, direction, _ in alone]),
        incremental=np.array([p.incremental for p, *_ in alone]),
        form=np.array([p.form for p, *_ in alone], np.int64),
        aim=np.array([aim for *_, aim in alone], np.int64),
    )
    order = np.argsort(np.concatenate((points.line, more.line)), kind="stable")
    columns = (
        np.concatenate((getattr(points, name), getattr(more, name)))[order] for name in Points.__slots__
    )
    return Points(*columns)


__all__ = ["Point", "Points", "Statement", "StatementCollector"]
