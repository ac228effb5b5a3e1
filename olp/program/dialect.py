"""What every dialect of programs gives: its names, its marks, its table of statements.

A dialect is a value, `DIALECT` in its own file, which has a line in `olp.program.registry`. Its fields say
all that other modules have to know of it: none of them asks for its name. Reading gives a `Program`:
immutable bytes, words, nominal moves, and which word holds which coordinate of which move.
Programs of blocks of words (RS-274) and of whole statements (APT, DMIS, lists) are written by
`olp.compensation.writing`. It needs only what is stated here and in the program.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import field, replace
from enum import Enum
from typing import Any

from olp.core.machine import Machine
from olp.core.patterns import pattern
from olp.core.progress import Progress, silent
from olp.core.toolpath import Interpolated
from olp.core.values import dataclass
from olp.program.kept import Kept
from olp.program.origin import Unrolled
from olp.program.text.line_ends import split
from olp.program.text.signs import NO_SIGNS, Signs

#: Block delete as controls have it: `/` where the line begins, or `/1` to `/9` for one of several switches.
SKIP_MARK = pattern(rb"[ \t]*/\d?[ \t]*")


@dataclass(frozen=True, slots=True)
class Options:
    """How a program is to be read: `block_delete` leaves `/` blocks out. `tell` is told what share of
    the text is read."""

    block_delete: bool = False
    tell: Progress = field(default=silent, repr=False)


class Support(Enum):
    """What becomes of a statement."""

    CORRECTED = "corrected"  #: its coordinates are edited
    READ = "read"  #: changes how later statements are understood; its bytes are unchanged
    UNCHANGED = "carried"  #: has no effect on the path
    REFUSED = "refused"  #: may move the machine, and is not read

    @property
    def title(self) -> str:
        """The word for people; values are those of reports."""
        return "unchanged" if self is Support.UNCHANGED else self.value


@dataclass(frozen=True, slots=True)
class Row:
    """A row of the support matrix: a statement, what becomes of it, and why."""

    statement: str
    support: Support
    why: str = ""

    def as_dict(self) -> dict[str, str]:
        return {"statement": self.statement, "support": self.support.value, "why": self.why}


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect:
    """A dialect of programs.

    `reader` reads a text. Called with data, setup, this dialect, options, and `words` by keyword, it returns
    a `Program` (`olp.program.registry.read`). With `long_texts` it takes a long text as it is in its file.
    `unroller` writes loops, calls and expressions out. It is
    called with data, this dialect, and by keyword what `olp.program.rs274.flatten.unroll.flatten` takes. It
    is None where the dialect has none. Where the dialect `expands_cycles` it writes canned cycles as plain
    moves. With `unrolls_with_tools` it takes `setup` too: contours beside which
    the control keeps the tool become the path of the tool. `keeper` puts the corrections of an unrolled text
    into the program that it was made from. It is called with that text, the corrected one, where each line
    begins in it, and this dialect, and returns a `Kept`. `asks` finds what a program asks of the control
    beside motion and beside its words (`olp.program.asked.Asked`), in order of lines. `toucher` writes a
    program of touches. It is called with this dialect, `olp.program.touches.Touches`, decimals, notes, and
    the name of the log.

    `path_mode` is how the control goes from move to move where a program does not say it. `inch_decimals` are
    the decimals of inch programs for a least increment of 0.001 mm, `free_digits` those that centres of arcs
    may have beyond those of positions. `marks`: a corrected program says so in a comment. `comment` are the
    marks around a comment. `skip_mark` is what block delete looks for where a line begins, None where the job
    file cannot state its switch. `first` are the beginnings of lines, in capitals, that stay before all
    others, in this order; `|` separates alternatives.

    `signs` are what shows the dialect of a text or a file. `folder_endings` are endings by which a file in a
    folder is known as a program, also where several dialects have them. `languages` are those of
    `olp.program.foreign` that its own texts look like. With `payload_comments` the payload may change inside
    a program. `path_tolerance`: programs state how far the control may leave the path (G64 P), and without it
    the control has no bound. `axes_at_ram`: axis positions count at the end of the ram, whatever stylus or
    tool is active. `points`: programs state points, and all of them count, however the machine goes there.
    `contours_assumed` says what is assumed of contours under cutter compensation, empty where nothing is.

    `tips` is empty but for a machine with rotary axes: how tool centre point control leads these there, where
    the program does not say it (`Frame.tip`). `leads` is what the control does where the machine file does
    not say it, empty where programs of such machines are not read. `direction_words` are those that state the
    three components of the direction of the tool there. `tips_from_zero` is as in `JointMachine`,
    where the machine file does not state it.
    """

    name: str
    title: str
    path_mode: str
    reader: Callable[..., Any]
    long_texts: bool = False
    unroller: Callable[..., Unrolled] | None = None
    unrolls_with_tools: bool = False
    expands_cycles: bool = False
    keeper: Callable[..., Kept] | None = None
    asks: Callable[..., Iterable[Any]] | None = None
    toucher: Callable[..., bytes] | None = None
    signs: Signs = NO_SIGNS
    folder_endings: tuple[str, ...] = ()
    languages: frozenset[str] = frozenset()
    payload_comments: bool = False
    path_tolerance: bool = False
    axes_at_ram: bool = False
    points: bool = False
    inch_decimals: int = 5
    free_digits: int = 1
    comment: tuple[bytes, bytes] = (b"(", b")")
    skip_mark: re.Pattern[bytes] | None = None
    first: tuple[bytes, ...] = ()
    marks: bool = True
    contours_assumed: str = ""
    tips: Interpolated = ""
    leads: Interpolated = ""
    tips_from_zero: bool = False
    direction_words: tuple[bytes, ...] = ()

    def rows(self) -> Sequence[Row]:
        """The support matrix, from the table that the reader uses."""
        raise NotImplementedError

    def set_as(self, machine: Machine) -> Dialect:
        """The dialect with what the machine file states of the settings of its control."""
        return self

    def with_tips(self, tips: Interpolated) -> Dialect:
        """The dialect on a machine with rotary axes, which tool centre point control leads so."""
        return replace(self, tips=tips)

    def lines(self, data: bytes) -> list[bytes]:
        """The lines of a text with their ends, as errors count them."""
        return split(data)

    def comment_marks(self) -> tuple[tuple[bytes, bytes], ...]:
        """The marks around all comments that a program may have; an empty second one is the end of a line."""
        return ((self.comment[0].strip(), self.comment[1]),)

    def continues(self, line: bytes) -> bool:
        """Whether the statement of a line goes on in the next line."""
        return False

    def straightened(self, line: bytes) -> bytes:
        """The line with a straight move to the end of its arc; unchanged where arcs have no such line."""
        return line

    def support(self) -> list[dict[str, str]]:
        """The support matrix as plain data: statement, support, why."""
        return [row.as_dict() for row in self.rows()]


@dataclass(frozen=True, slots=True, kw_only=True)
class StatementDialect(Dialect):
    """A dialect of whole statements: `table` says what becomes of each by its name, and why."""

    table: Mapping[bytes, tuple[Support, str]]

    def lines(self, data: bytes) -> list[bytes]:
        """The lines of a text with their ends, as errors count them."""
        return split(data)

    def continues(self, line: bytes) -> bool:
        return line.rstrip().endswith(b"$") and b"$$" not in line

    def rows(self) -> Sequence[Row]:
        return [Row(name.decode(), support, why) for name, (support, why) in self.table.items()]
