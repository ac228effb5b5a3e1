"""A program as read: immutable bytes, word columns, nominal moves, and which word holds which coordinate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import field, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask
from olp.core.spool import Text
from olp.core.toolpath import Toolpath
from olp.core.values import dataclass
from olp.program.dialect import Dialect
from olp.program.holes import Holes
from olp.program.origin import Origin, Unrolled
from olp.program.rs274.profiles.base import Profile
from olp.program.rs274.state import Capture, PathMode
from olp.program.text.columns import Packed
from olp.program.text.line_ends import LINE_END

if TYPE_CHECKING:
    from olp.program.robots.targets import Targets
    from olp.program.tilts import Tilt

Small = npt.NDArray[np.int32]


@dataclass(frozen=True, slots=True, eq=False)
class Words:
    """All words of the text: `start` of the letter, `number` and `end` of its digits, as byte positions;
    the number is `mantissa` / 10**`decimals`. `first_word` (lines + 1,) leads from line to words."""

    letter: npt.NDArray[np.uint8]
    mantissa: Packed
    decimals: npt.NDArray[np.int8]
    pointed: npt.NDArray[np.bool_]
    start: Small
    number: Packed
    end: Packed
    first_word: Small

    def of_line(self, line: int) -> range:
        """Indices of the words of a line, counted from 1."""
        return range(int(self.first_word[line - 1]), int(self.first_word[line]))


@dataclass(frozen=True, slots=True, eq=False)
class Poles:
    """Per arc of the toolpath, where blocks of their own state the centres. `form` is that of the block of
    the arc, and `begin` the byte where the block of its centre begins, -1 where its words cannot be edited.
    `taken` is `AS_BEFORE` where the centre is that of the arc before, and `STATED` where a block states it.
    Else that block takes the present position over, and it is the number of moves before it."""

    form: npt.NDArray[np.uint8]
    begin: Small
    taken: Small

    def part(self, arcs: slice) -> Poles:
        """Those of some arcs."""
        return Poles(self.form[arcs], self.begin[arcs], self.taken[arcs])


#: `Poles.taken`: the pole is that of the arc before.
AS_BEFORE = -1
#: `Poles.taken`: the pole is stated by the arc itself.
STATED = -2


@dataclass(frozen=True, slots=True, eq=False)
class ArcSlots:
    """Per arc of the toolpath: (m, 5) indices of its I, J, K, R, P words or -1, and whether I, J, K are
    absolute. Where blocks of their own state the centres, the words of these for I, J, K, and `poles`."""

    word: Small
    absolute: npt.NDArray[np.bool_]
    poles: Poles | None = None

    def part(self, arcs: slice) -> ArcSlots:
        """Those of some arcs."""
        return ArcSlots(
            self.word[arcs], self.absolute[arcs], None if self.poles is None else self.poles.part(arcs)
        )


@dataclass(frozen=True, slots=True, eq=False)
class SharedWords:
    """Per line of the text a word that is shared out where its move is split, as that of an extruder.

    `word` is its index or -1, `before` its value before the move, and `distance` whether it is one. All are
    empty where a program has no such words."""

    word: Small
    before: npt.NDArray[np.float64]
    distance: npt.NDArray[np.bool_]

    @staticmethod
    def none() -> SharedWords:
        return SharedWords(np.zeros(0, np.int32), np.zeros(0), np.zeros(0, bool))


@dataclass(frozen=True, slots=True)
class ArcText:
    """How a program of statements states an arc: bytes `begin`..`end` of what states it beside its end point.

    `centres` are the words of its centre, two sets where the centre is stated twice. `radius` and `angle` (in
    degrees) are words, -1 where not stated; `direction` are the words of the direction in which it begins,
    empty where not stated. `whole`: the bytes state its end point too. `long` are the bytes that only arcs of
    more than half a circle have.
    """

    begin: int
    end: int
    centres: tuple[tuple[int, int, int], ...]
    radius: int = -1
    angle: int = -1
    direction: tuple[int, ...] = ()
    whole: bool = False
    long: tuple[int, int] | None = None


@dataclass(frozen=True, slots=True)
class ChordText:
    """An arc in no plane of two axes: its chords are the moves `first`..`last`, and the bytes `begin`..`end`
    state it. The last chord has a statement of its own unless these bytes are the `whole` arc."""

    first: int
    last: int
    begin: int
    end: int
    whole: bool

    @property
    def bare(self) -> int:
        """The last chord without a statement of its own."""
        return self.last if self.whole else self.last - 1


@dataclass(frozen=True, slots=True, eq=False)
class StatedFeeds:
    """(k,) feeds as stated: the first `move` of each, its `line`, and the `word` of its number, -1
    where no word could be changed."""

    move: Index
    line: Index
    word: Index


@dataclass(frozen=True, slots=True, eq=False)
class Definitions:
    """Of each stroke, what defines its cycle.

    (k, 2) the bytes of the `text`, and of the `number` of the surface in it, -1 where these are not known.
    (k,) the `surface` in numbers of the program, NaN where the cycle counts from the present height."""

    text: npt.NDArray[np.int64]
    number: npt.NDArray[np.int64]
    surface: npt.NDArray[np.float64]

    @staticmethod
    def of(rows: Sequence[tuple[int, int, int, int, float]]) -> Definitions:
        """Of strokes in order: text, number and surface."""
        table = np.array(rows, float).reshape(-1, 5)
        return Definitions(table[:, :2].astype(np.int64), table[:, 2:4].astype(np.int64), table[:, 4])


@dataclass(frozen=True, slots=True, eq=False)
class Called:
    """Holes of cycles that blocks call with levels of their own.

    (k, 2) `strokes`: the moves to the hole and to its bottom. (k, 2) the bytes of the `text` of the call, and
    (k, 3, 2) of the `numbers` of its levels, -1 for one that it does not state. Levels are where the tool
    goes back to, where the hole begins, and its bottom. `alone` (k,): the call itself makes the hole."""

    strokes: Index
    text: Index
    numbers: Index
    alone: Mask

    @staticmethod
    def of(rows: Sequence[tuple[int, ...]]) -> Called:
        """Of holes in order: moves, text, three numbers, and 1 where it is made alone."""
        table = np.array(rows, np.int64).reshape(-1, 11)
        return Called(table[:, :2], table[:, 2:4], table[:, 4:10].reshape(-1, 3, 2), table[:, 10] != 0)

    def part(self, first: int, last: int) -> Called:
        """The holes whose bottoms are among moves `first`..`last`, with moves counted from `first`."""
        some = slice(*np.searchsorted(self.strokes[:, 1], (first, last)).tolist())
        return Called(self.strokes[some] - first, self.text[some], self.numbers[some], self.alone[some])

    def __len__(self) -> int:
        return len(self.strokes)


@dataclass(frozen=True, slots=True, eq=False)
class Statements:
    """What a program of whole statements has beside its words.

    (n,) `begin`, `end`: the bytes that state the end of each move, -1 where no statement does. (n,)
    `feed_mm_s`: inf for rapids, NaN where it is not known. (n + 1,) `rest` and `dwell_s`: before, between and
    after the moves. `feeds`: where feeds are stated. `arcs`: by move. `broken`: the marks of continuation
    inside words, by word.

    `rapid` is the line that makes the next statement a rapid. `mark` joins lines, none of which becomes
    longer than `width` bytes (0: no limit). `cards` have their numbers after that width, in the last eight
    columns. `strokes` (k, 2): the moves to the hole and to its bottom. `restated` are moves whose statements
    have other numbers than x, y, z, so that all three replace them where one changes: true where the
    statement counts from the point before. `chords` are arcs that are read as chords. `decimal` is the
    decimal mark of texts whose numbers keep their own form and column, empty for others. `definitions` are
    those of the cycles of strokes, None where no cycle has any.
    """

    begin: Small
    end: Small
    feed_mm_s: npt.NDArray[np.float64]
    rest: npt.NDArray[np.bool_]
    dwell_s: npt.NDArray[np.float64]
    arcs: Mapping[int, ArcText]
    broken: Mapping[int, bytes]
    strokes: npt.NDArray[np.int64]
    feeds: StatedFeeds
    rapid: bytes = b""
    cards: bool = False
    mark: bytes = b"$"
    width: int = 0
    decimal: bytes = b""
    restated: Mapping[int, bool] = field(default_factory=dict)
    chords: tuple[ChordText, ...] = ()
    definitions: Definitions | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Towards:
    """Directions of the tool in the workpiece that statements state: of each move (n, 3) the `slot` of its
    numbers or -1, and the direction as `stated`, NaN where there is none. Where they are `lasting`, a move
    without one has that of the move before; else its rotary axes stay."""

    slot: Small
    stated: Array
    lasting: bool = True

    @staticmethod
    def none(count: int, *, lasting: bool = True) -> Towards:
        return Towards(np.full((count, 3), -1, np.int32), np.full((count, 3), np.nan), lasting)


@dataclass(frozen=True, slots=True, eq=False)
class Program:
    """A program as read.

    `data` is the text. `slot` (n, 3): index of the X, Y, Z word of each move, -1 where omitted. `calculator`:
    lengths without a decimal point are whole units. `statements` is None for blocks of words. `closings` are
    brackets that close behind a number, sorted. `tilts` are moves by which the control turns rotary axes to a
    plane. `levels` are moves of cycles in planes, each with its height along the words, mm. `by_original`:
    lines are those of the text that this one was unrolled from (`in_original`).

    Along contours under cutter compensation `toolpath` is that of the tool. `programmed` is then the program
    with the contour in its place, and (n,) `blocks` the move of it that each move belongs to. `targets` are
    those of a program of a robot, which several moves may use. `towards` are directions of the tool, where
    rotary axes turn it.
    """

    data: Text
    dialect: Dialect
    toolpath: Toolpath
    words: Words | None
    slot: Small
    arc_slots: ArcSlots
    line_start: Small
    line_end: Small | Packed
    captures: tuple[Capture, ...] = ()
    path_modes: tuple[PathMode, ...] = ()
    holes: Holes = field(default_factory=Holes.none)
    called: Called = field(default_factory=lambda: Called.of([]))
    remarks: tuple[tuple[str, int, str], ...] = field(default=())
    end_line: int = 0
    calculator: bool = True
    statements: Statements | None = None
    shared: SharedWords = field(default_factory=SharedWords.none)
    closings: Index = field(default_factory=lambda: np.zeros(0, np.int64))
    tilts: tuple[Tilt, ...] = ()
    levels: tuple[tuple[int, int, float], ...] = ()
    by_original: bool = False
    programmed: Program | None = None
    blocks: Index | None = None
    targets: Targets | None = None
    towards: Towards | None = None

    @property
    def in_blocks(self) -> bool:
        """Whether it is written in blocks, whose words may be omitted."""
        return self.statements is None or self.arc_slots.poles is not None

    def text_of(self, move: int) -> int:
        """Where the text of a move begins: its line, or that of the centre of its arc."""
        line = int(self.line_start[self.toolpath.line[move] - 1])
        poles, arcs = self.arc_slots.poles, self.toolpath.arcs
        if poles is None:
            return line
        arc = int(np.searchsorted(arcs.move, move))
        own = arc < len(arcs.move) and arcs.move[arc] == move and poles.begin[arc] >= 0
        return min(line, int(poles.begin[arc])) if own else line

    @property
    def lines(self) -> int:
        """The lines of the text, or of the original."""
        origin = self.origin
        return origin.lines if origin is not None and self.by_original else len(self.line_start)

    @property
    def origin(self) -> Origin | None:
        """Where the lines of the text come from; None where it was not unrolled."""
        return self.data.origin if isinstance(self.data, Unrolled) else None

    def in_original(self) -> Program:
        """The same with the lines of the text that this one was unrolled from, as people are told them. Lines
        do not rise any more, so it is neither written nor timed."""
        origin = self.origin
        if origin is None or self.by_original:
            return self
        line_of, path = origin.line_of, self.toolpath
        return replace(
            self,
            toolpath=replace(path, line=self.original_lines(path.line).astype(np.int32)),
            path_modes=tuple(replace(mode, line=line_of(mode.line)) for mode in self.path_modes),
            holes=replace(self.holes, line=self.original_lines(self.holes.line).astype(np.int32)),
            remarks=tuple((name, line_of(line), text) for name, line, text in self.remarks),
            by_original=True,
        )

    def original_lines(self, line: npt.ArrayLike) -> Index:
        """The lines that lines of the text were made from; the same where it was not unrolled."""
        origin = self.origin
        return np.asarray(line, np.int64) if origin is None else origin.lines_of(line)

    def errors(self) -> AbstractContextManager[None]:
        """Errors with a line of the text get the line of its original, where it was unrolled."""
        return nullcontext() if self.origin is None else self.origin.errors()

    def place(self, line: int) -> str:
        """A line in words; of the original with its file where that is not the program's."""
        return self.origin.place(line) if self.origin is not None and self.by_original else str(line)

    @property
    def verbatim(self) -> bool:
        """Whether numbers keep their own form and column, and no row is inserted."""
        return self.statements is not None and bool(self.statements.decimal) and self.targets is None

    @property
    def rs274(self) -> Profile:
        """The dialect of a program of blocks of words."""
        assert isinstance(self.dialect, Profile)
        return self.dialect

    def text(self, line: int) -> str:
        """The text of a line, counted from 1, for messages."""
        if self.origin is not None and self.by_original:
            return self.origin.text(line)
        return self.data[int(self.line_start[line - 1]) : int(self.line_end[line - 1])].decode("latin-1")

    def eol(self, line: int) -> bytes:
        """The line end that a block after this line takes: this line's, or the first one of the text."""
        end = int(self.line_end[line - 1])
        mark = LINE_END.match(self.data, end) or LINE_END.search(self.data)
        return mark[0] if mark else b"\n"
