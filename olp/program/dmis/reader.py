"""Reads DMIS part programs: motion statements to a nominal toolpath and the words that can be edited.

Only the ends of positioning (GOTO) and touching (PTMEAS) count: the control decides the path between them.
Feature nominals, tolerances and actuals stay unchanged. Nothing here knows an error model.
"""

from __future__ import annotations

import re

import numpy as np

from olp.core.arrays import Array, Mask, any_in_row
from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.core.progress import Progress
from olp.core.toolpath import Flag, Kind
from olp.program.dialect import Dialect, Options, Support
from olp.program.dmis.events import Events
from olp.program.dmis.points import FORMS, INCREMENT, POLAR, POLAR_DEGREES, cartesian, restated
from olp.program.dmis.table import TABLE
from olp.program.program import Program
from olp.program.statement_rows import NOT_READ, Point, in_order
from olp.program.text.statements import Chunk, Comment, Statement, chunks, shown

NAN = float("nan")
_NO_TEXT = re.compile(rb"(?!)")


def read(data: bytes, setup: Setup, dialect: Dialect, options: Options, *, words: bool = True) -> Program:
    """Read a whole program. Raises ProgramError with the line of the first statement that cannot be read
    correctly."""
    return _Reader(data, setup, dialect, words).run(options.tell)


class _Reader(Events):
    """Reads one program."""

    def run(self, tell: Progress) -> Program:
        for chunk in chunks(self.data, tell=tell):
            self._chunk(chunk)
        if self.nesting and not self.ended:
            raise ProgramError(
                f"{shown(self.nesting[-1])} has no end", line=max(self.data.count(b"\n"), 1), code="OLP532"
            )
        x, y, z = self.start
        end = self.ended or self.data.count(b"\n") + 1
        return self.collector.program(self.table.frames, (x, y, z), end, b"")

    def _chunk(self, chunk: Chunk) -> None:
        collector = self.collector
        collector.begin(chunk)
        events: list[Statement] = []
        alone: list[Point] = []
        for item in () if self.ended else chunk.statements(_NO_TEXT, _goes_on):
            if isinstance(item, Comment):
                self._check_comment(chunk, item)
                continue
            if self._in_header(item):
                continue
            _, major = item.head()
            if major in (b"GOTO", b"PTMEAS"):
                point = self._point(item, major)
                alone.append(point)
                if major == b"PTMEAS":
                    self.touches.add(point.line)
            if major != b"GOTO":
                events.append(item)
            if major == b"ENDFIL":
                break
        self.points = collector.points(chunk, alone)
        self.done = 0
        in_order(events, self.points, self._event, self._by_table)
        if not self.ended:
            self._resolve(len(self.points))
        collector.finish()

    def _in_header(self, statement: Statement) -> bool:
        """The block BEGIN/CHFILE … END/CHFILE of WinWerth has keys and values, no statements."""
        text = b"".join(statement.text.upper().split())
        was = self.header
        if text == b"BEGIN/CHFILE":
            self.header = True
        elif text == b"END/CHFILE":
            self.header = False
        return was or self.header

    def _check_comment(self, chunk: Chunk, comment: Comment) -> None:
        """Refuse a statement after a comment that ends with `$`: it may belong to it."""
        if not comment.text.rstrip().endswith(b"$") or comment.text.strip() == b"$$":
            return
        line = comment.line + comment.text.count(b"\n") - chunk.first_line
        if line < len(chunk.line_start):
            after = chunk.raw(line).strip()
            if after and not after.startswith(b"$$"):
                raise ProgramError(
                    "the comment before ends with `$`, so this line may belong to it; "
                    "take that `$` away, or put `$$` before this line",
                    line=chunk.first_line + line + 1,
                    code="OLP510",
                )

    def _event(self, statement: Statement, row: int) -> None:
        label, major = statement.head()
        if major.startswith(b"(") and major.endswith(b")"):
            return
        first = _word(major)
        handler = self._handlers.get(first)
        if handler is not None:
            handler(statement, label, row)
            return
        if first == b"PTMEAS":
            if self.feature is None:
                raise ProgramError(
                    "PTMEAS is outside MEAS and ENDMES; expected MEAS before it",
                    line=statement.line,
                    code="OLP532",
                )
            self.feature = (self.feature[0], True)
            return
        if label and b"/" not in statement.text:
            raise ProgramError(
                f"{shown(label)} is assigned, and its effect is known at run time only",
                line=statement.line,
                code="OLP511",
            )
        refusal = self._by_table(statement)
        if refusal is not None:
            raise refusal

    def _by_table(self, statement: Statement) -> ProgramError | None:
        """Why a statement is refused wherever it is; None where that depends on others, or it is read."""
        label, major = statement.head()
        text = statement.text.strip()
        bracketed = major.startswith(b"(") and major.endswith(b")")
        first = _word(major)
        if not text or bracketed:
            return None
        if label and b"/" not in statement.text:
            return None
        support, why = TABLE.get(
            first, (Support.REFUSED, "is not a statement that olp knows in DMIS, and may move the machine")
        )
        if support is not Support.REFUSED:
            return None
        return ProgramError(f"{shown(first) or 'a slash'} {why}", line=statement.line, code=NOT_READ)

    # -- points --------------------------------------------------------------------------------------

    def _point(self, statement: Statement, major: bytes) -> Point:
        fields = statement.fields()
        if fields and fields[-1].text == b"":
            fields = fields[:-1]
        if fields and fields[0].text in FORMS:
            return restated(statement, major, fields)
        if fields and fields[0].text == b"CART":
            fields = fields[1:]
        elif major == b"PTMEAS" or (fields and fields[0].number is None):
            first = shown(fields[0].text) if fields else "nothing"
            raise ProgramError(
                f"{shown(major)}/{first} is not read; expected CART and x,y,z, or POL and r,angle,height, as "
                "numbers",
                line=statement.line,
                code="OLP512",
            )
        bad = next((f for f in fields if f.number is None), None)
        if bad is not None:
            raise ProgramError(
                f"{shown(major)} has {shown(bad.text) or 'nothing'} where a number is expected; "
                "its value is known at run time only",
                line=statement.line,
                code="OLP511",
            )
        if len(fields) not in ((3, 6) if major == b"PTMEAS" else (3,)):
            raise ProgramError(
                f"{shown(major)} has {len(fields)} numbers; expected x,y,z"
                + (" and a direction" if major == b"PTMEAS" else ""),
                line=statement.line,
                code="OLP516",
            )
        return Point(statement.line, statement.begin, statement.end, fields[:3])

    def _resolve(self, upto: int) -> None:
        """The points up to `upto`, which have one frame and one stylus."""
        a, self.done = self.done, max(upto, self.done)
        if upto <= a:
            return
        part = slice(a, upto)
        line = self.points.line[part]
        wide = ~np.isnan(self.points.direction[part][:, 0]) & (self.points.form[part] == 0)
        if wide.any():
            raise ProgramError(
                "GOTO has 6 numbers; expected x,y,z", line=int(line[np.flatnonzero(wide)[0]]), code="OLP516"
            )
        if self.macro is not None:
            raise ProgramError(
                f"the macro {self.macro} moves the machine, which is not read; write out its moves",
                line=int(line[0]),
                code="OLP512",
            )
        number = self._frame(int(line[0]))
        frame = self.table.frames[number]
        value = self._cartesian(part) * self.unit_mm
        if frame.turn is not None:
            value = value @ np.array(frame.turn).T
        relative = self.points.form[part] == INCREMENT
        end = value + np.where(relative[:, None], 0.0, np.array(frame.offset_mm))
        touch = np.array([n in self.touches for n in line.tolist()])
        if relative.any():
            self._add_up(end, relative, touch)
        lost = any_in_row(np.isnan(end))
        kind = np.where(touch, np.uint8(Kind.PROBE), np.uint8(Kind.RAPID))
        flag = np.where(touch, np.uint8(Flag.WHOLE), np.uint8(0))
        if self.manual:
            flag |= np.uint8(Flag.PASS)
        flag[lost] |= np.uint8(Flag.PASS | Flag.CONTROL)
        if not self.unit_stated:
            self.collector.remarks.setdefault("unit", (int(line[0]), "the program states no UNITS"))
        for row in np.flatnonzero((self.points.form[part] != 0) & ~lost).tolist():
            self.collector.restated[self.collector.moves + row] = bool(relative[row])
        # where the probe is after a touch, only the control knows
        self.position = [NAN] * 3 if touch[-1] or self.manual else end[-1].tolist()
        self.collector.put_stated_moves(
            kind, flag, line, np.full(len(line), number), end,
            np.where(lost[:, None], -1, self.points.slot[part]),
            self.points.begin[part], self.points.end[part],
        )  # fmt: skip

    def _cartesian(self, part: slice) -> Array:
        """(n, 3) x, y, z of points in the unit of the program, or distances of those that are increments."""
        value, form = self.points.value[part], self.points.form[part]
        polar = np.isin(form, (POLAR, POLAR_DEGREES))
        if polar.any() and self.plane is None:
            raise ProgramError(
                "POL counts in the working plane, and WKPLAN names another than XYPLAN, YZPLAN or ZXPLAN; "
                "write the point as CART",
                line=int(self.points.line[part][np.flatnonzero(polar)[0]]),
                code="OLP518",
            )
        return cartesian(value, form, self.plane or 0, self.angle_rad)

    def _add_up(self, end: Array, relative: Mask, touch: Mask) -> None:
        """Points that count from the one before them, in place; NaN where only the control knows that one, as
        after a `touch`."""
        for i in np.flatnonzero(relative).tolist():
            before = np.array(self.position) if i == 0 else end[i - 1]
            end[i] = NAN if np.isnan(before).any() or self.manual or (i and touch[i - 1]) else end[i] + before


def _word(major: bytes) -> bytes:
    """The word of a major part: IF may have its condition behind it without a slash."""
    return major.split(b" ")[0].split(b"(")[0] if major[:3] in (b"IF ", b"IF(") else major


def _goes_on(raw: bytes) -> bool:
    """Whether a line behind a comment that ends with `$` goes on with it: no control runs it as a
    statement."""
    if raw.lstrip()[:2] == b"$$" or not raw.strip():
        return False
    label, major = Statement(0, 0, len(raw), raw).head()
    if label or major.startswith(b"("):
        return False
    if major.endswith(b"$"):
        # its word may be parted over both lines
        return not any(word.startswith(major[:-1].rstrip()) for word in TABLE)
    return _word(major) not in TABLE
