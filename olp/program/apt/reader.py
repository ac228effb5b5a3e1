"""Reads APT and cutter-location data: statements to a nominal toolpath and the words that can be edited.

A chunk is read in steps. Plain GOTOs are read in columns, and all other statements one by one
(`text.statements`). Then come the events between the points in their order, and the points between two
changes of frame at once. Nothing here knows an error model.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Sequence

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.core.progress import Progress
from olp.core.toolpath import Flag, Kind
from olp.program.apt.arc_moves import ArcMoves, Part
from olp.program.apt.arcs import tlon
from olp.program.apt.events import Cycle
from olp.program.apt.placing import UNIT, axis_of
from olp.program.apt.table import FREE, TABLE
from olp.program.dialect import Dialect, Options, Support
from olp.program.frames import UP
from olp.program.program import Program
from olp.program.statement_rows import NOT_READ, Point, Points, in_order
from olp.program.text.statements import Chunk, Comment, Statement, chunks, shown

NAN = float("nan")
_FREE = re.compile(rb"(?i)(?:" + b"|".join(FREE) + rb")(?![A-Z])")
_CREO = re.compile(rb"\$\$->\s*([A-Z_]+)\s*/?")
_RAPID = frozenset((b"RAPID", b"RAPID/"))


def read(data: bytes, setup: Setup, dialect: Dialect, options: Options, *, words: bool = True) -> Program:
    """Read a whole program. Raises ProgramError with the line of the first statement that cannot be read
    correctly."""
    return _Reader(data, setup, dialect, options, words).run(options.tell)


class _Reader(ArcMoves):
    """Reads one program."""

    def run(self, tell: Progress) -> Program:
        for chunk in chunks(self.data, tell=tell):
            self._chunk(chunk)
        self._judge_turns()
        x, y, z = self.start
        end = self.ended or self.data.count(b"\n") + 1
        return self.collector.program(self.table.frames, (x, y, z), end, b"RAPID")

    # -- one chunk -----------------------------------------------------------------------------------

    def _chunk(self, chunk: Chunk) -> None:
        collector = self.collector
        collector.begin(chunk)
        if self.ended:
            collector.finish()
            return
        events: list[Statement] = []
        alone: list[Point] = []
        last_line = 0
        for item in chunk.statements(_FREE):
            if item.line <= last_line:
                continue
            if isinstance(item, Comment):
                if item.text.lstrip()[:4] == b"$$->":
                    system = self._creo(chunk, item)
                    last_line = item.line + system.lines - 1
                    events.append(system)
                continue
            text = item.text.strip().upper()
            if text[:2] in (b"GO", b"TL") and (point := self._point(item, text)) is not None:
                alone.append(point)
            if text[:4] != b"GOTO":
                events.append(item)
            if text[:4] == b"FINI":
                break
        self.points = collector.points(chunk, alone)
        self.done = 0
        in_order(events, self.points, self._event, self._by_table)
        if self.ended:
            collector.finish()
            return
        self._resolve(len(self.points))
        # what was stated for the point after the last one holds for the first of the next chunk
        count = len(self.points)
        self.rapid = [row - count for row in self.rapid]
        self.arcs = [(row - count, form) for row, form in self.arcs]
        collector.finish()

    def _event(self, statement: Statement, row: int) -> None:
        text = statement.text.strip().upper()
        if text in _RAPID:
            self.rapid.append(row)
            return
        label, major = statement.head()
        if statement.text.lstrip()[:2] == b"$$":
            label, major = b"", b"CSYS"
        free = _FREE.match(text)
        if free:
            label, major = b"", free[0]
        first = major.split(b",")[0].strip()
        handler = self._handlers.get(first)
        if first == b"RAPID":
            raise ProgramError(
                "RAPID has words that are not read; expected RAPID alone", line=statement.line, code="OLP510"
            )
        if label:
            what = TABLE.get(first, (Support.REFUSED, "is an assignment that is not read"))[1]
            raise ProgramError(
                f"{shown(label)} = {shown(first)} {what or 'is not read'}", line=statement.line, code="OLP512"
            )
        if handler is not None:
            handler(statement, row)
            return
        if first == b"TLON":
            self._tlon(statement, row)
        refusal = self._by_table(statement)
        if refusal is not None:
            raise refusal

    def _by_table(self, statement: Statement) -> ProgramError | None:
        """Why a statement is refused wherever it is; None where that depends on others, or it is read."""
        label, major = statement.head()
        text = statement.text.strip().upper()
        free = _FREE.match(text)
        if free:
            label, major = b"", free[0]
        first = major.split(b",")[0].strip()
        if label or text[:2] == b"$$":
            return None
        support, why = TABLE.get(
            first, (Support.REFUSED, "is not a statement that olp knows in APT, and may move the machine")
        )
        if support is not Support.REFUSED:
            return None
        return ProgramError(f"{shown(first)} {why}", line=statement.line, code=NOT_READ)

    # -- points --------------------------------------------------------------------------------------

    def _point(self, statement: Statement, text: bytes) -> Point | None:
        """A GOTO, GODLTA or TLON that was not read in columns."""
        _, major = statement.head()
        line = statement.line
        if major.split(b",")[0] == b"TLON":
            self.driven[line], fields = tlon(statement, self.collector)
            return Point(line, statement.begin, statement.end, fields)
        if major not in (b"GOTO", b"GODLTA"):
            return None
        fields = statement.fields()
        if fields and not fields[-1].text:
            fields = fields[:-1]
        if any(f.number is None for f in fields):
            bad = next(f for f in fields if f.number is None)
            raise ProgramError(
                f"{shown(major)} names {shown(bad.text) or 'nothing'} where a number is expected; send the "
                "output of the APT processor (CLDATA)",
                line=line,
                code="OLP516",
            )
        if len(fields) not in ((1, 3) if major == b"GODLTA" else (3, 6)):
            raise ProgramError(
                f"{shown(major)} has {len(fields)} numbers; expected "
                + ("a distance along the tool axis, or three" if major == b"GODLTA" else "three, or six"),
                line=line,
                code="OLP516",
            )
        return Point(
            line, statement.begin, statement.end, fields[:3], fields[3:], incremental=major == b"GODLTA"
        )

    # -- stretches of points -------------------------------------------------------------------------

    def _resolve(self, upto: int) -> None:
        """Positions, kinds and arcs of the points up to `upto`, which have one frame except for tool axes."""
        a, self.done = self.done, max(upto, self.done)
        if upto <= a:
            return
        points, count = self.points, upto - a
        part = slice(a, upto)
        line = points.line[part]
        if self.skipped:
            raise ProgramError(
                f"OPSKIP of line {self.skipped} is in force, so a switch at the control decides whether the "
                "machine goes to this point; end it before the point with OPSKIP/OFF",
                line=int(line[0]),
                code="OLP525",
            )
        if not self.unit_stated:
            self.collector.remarks.setdefault("unit", (int(line[0]), "the program states no unit"))
        frame, tilting, up = self._aimed(points, part) if self.tips else self._frames(points, part)
        offset, turn = self._offset_and_turn(frame)
        value = points.value[part] * self.unit_mm
        value = value if turn is None else value @ turn.T
        incremental = points.incremental[part]
        end = value + offset
        if incremental.any():
            self._check_increments(points, part, turn)
            end = _summed(value, end, incremental, self.position)
        kind = np.full(count, Kind.LINE, np.uint8)
        now = bisect_left(self.rapid, upto)
        kind[np.array(self.rapid[:now], np.int64) - a] = Kind.RAPID
        if self.tips and not np.isfinite(self.position).all():
            # from where the tool comes is not known
            kind[0] = Kind.RAPID
        del self.rapid[:now]
        flag = np.where(incremental, np.uint8(Flag.INCREMENTAL), np.uint8(0))
        flag[tilting] |= np.uint8(Flag.WHOLE)
        slot, begin, stop = points.slot[part], points.begin[part], points.end[part]
        arcs = [(row - a, form) for row, form in self.arcs if row < upto]
        self.arcs = [(row, form) for row, form in self.arcs if row >= upto]
        if self.cycle is not None:
            if arcs:
                raise ProgramError(
                    "an arc is not read while a CYCLE is in force; end the cycle with CYCLE/OFF",
                    line=int(line[arcs[0][0]]),
                    code="OLP518",
                )
            self._holes(self.cycle, line, frame, end, slot, begin, stop, up)
        else:
            path = Part(kind, flag, line, frame, end, slot, begin, stop)
            if arcs:
                path = self._with_arcs(arcs, path, offset, turn)
            self.collector.put_stated_moves(*path)
        self.position = end[-1].tolist()

    def _frames(self, points: Points, part: slice) -> tuple[Index, Mask, Array]:
        """Of each point: the number of its frame, whether the tool turns on the move to it, and the direction
        (n, 3) from tip to gauge point in machine coordinates."""
        direction, line = points.direction[part], int(points.line[part][0])
        count = len(direction)
        turning = np.zeros(count, bool)
        stated, size = _sizes(points, part)
        if not stated.any():
            number = self._frame(line)
            return np.full(count, number), turning, np.broadcast_to(self.up, (count, 3))
        held = np.maximum.accumulate(np.where(stated, np.arange(count), -1))
        axes = np.where((held >= 0)[:, None], (direction / size[:, None])[held], np.array(self.axis))
        before = np.vstack((np.array(self.axis), axes[:-1]))
        turning = (axes != before).any(axis=1)
        if not self.collector.moves:
            turning[0] = False
        unique, which = np.unique(axes, axis=0, return_inverse=True)
        which = which.reshape(-1)
        number_of, up = np.zeros(len(unique), np.int64), np.zeros((len(unique), 3))
        for k, (x, y, z) in enumerate(unique.tolist()):
            self.axis = axis_of(x, y, z)
            number_of[k] = self._frame(line)
            up[k] = self.up
        x, y, z = axes[-1].tolist()
        self.axis = axis_of(x, y, z)
        return number_of[which], turning, up[which]

    def _aimed(self, points: Points, part: slice) -> tuple[Index, Mask, Array]:
        """The same where rotary axes turn the tool: points state its tip and its direction."""
        direction, line = points.direction[part].copy(), points.line[part]
        arcs = [row for row, _ in self.arcs if row < part.stop]
        if self.cycle is not None or arcs:
            raise ProgramError(
                "on a machine with rotary joints this is not corrected: an arc or a CYCLE; write its points",
                line=int(points.line[arcs[0]]) if arcs else int(line[0]),
                code="OLP565",
            )
        stated, _ = _sizes(points, part)
        number, count = self._frame(int(line[0])), len(line)
        turn = self.table.frames[number].turn
        if not stated[0] and (self.axis, turn) != self.aimed:
            direction[0] = self.axis
        if stated.any():
            x, y, z = direction[np.flatnonzero(stated)[-1]].tolist()
            self.axis = axis_of(x, y, z)
        self.aimed = self.axis, turn
        self.collector.put_directions(direction, points.aim[part])
        return np.full(count, number), np.zeros(count, bool), np.tile(UP, (count, 1))

    def _offset_and_turn(self, frame: Index) -> tuple[Array, Array | None]:
        frames = self.table.frames
        first = frames[int(frame[0])]
        turn = None if first.turn is None else np.array(first.turn)
        if (frame == frame[0]).all():
            return np.array(first.offset_mm), turn
        return np.array([f.offset_mm for f in frames])[frame], turn

    def _check_increments(self, points: Points, part: slice, turn: Array | None) -> None:
        alone = points.incremental[part] & (points.slot[part][:, 0] < 0)
        if alone.any() and self.axis != UP:
            raise ProgramError(
                "GODLTA with one number goes along the tool axis, which is tilted here; write it with three",
                line=int(points.line[part][np.flatnonzero(alone)[0]]),
                code="OLP518",
            )

    def _holes(
        self, cycle: Cycle, line: Index, frame: Index, end: Array, slot: Index, begin: Index,
        stop: Index, ups: Array,
    ) -> None:  # fmt: skip
        """Moves of holes: to the clearance above the stated point, down, and up."""
        collector = self.collector
        tip = np.array(self.position)
        clear_mm, depth_mm = cycle.clear_mm or 0.0, cycle.depth_mm
        stroke = depth_mm is not None and cycle.clear_mm is not None
        for i in range(len(line)):
            line_of, up = int(line[i]), ups[i]
            x, y, z = (up * clear_mm).tolist()
            own = self.table.lifted(int(frame[i]), (x, y, z))
            tip = end[i] + up * clear_mm
            flag = np.array([Flag.CYCLE if stroke else 0], np.uint8)
            collector.put_stated_moves(
                np.array([Kind.RAPID], np.uint8), flag, [line_of], [own], tip[None],
                slot[i : i + 1], begin[i : i + 1], stop[i : i + 1],
            )  # fmt: skip
            collector.put_feed(collector.moves, cycle.feed_mm_s, line_of)
            if depth_mm is not None and stroke:
                collector.strokes.append((collector.moves - 1, collector.moves))
                collector.put_lone(Kind.LINE, Flag.CYCLE, line_of, own, end[i] - up * depth_mm)
                tip = end[i] + up * (cycle.retract_mm if cycle.retract_mm is not None else clear_mm)
                collector.put_lone(Kind.RAPID, Flag.CYCLE, line_of, own, tip)
        collector.put_feed(collector.moves, self.feed_mm_s, *self.feed_stated)
        end[-1] = tip

    # -- events --------------------------------------------------------------------------------------

    def _creo(self, chunk: Chunk, comment: Comment) -> Statement:
        """The statement that Creo writes in a comment, which goes on where its line ends with `$`."""
        text, last = comment.text.strip(), comment.line - 1 - chunk.first_line
        lines = 1
        match = _CREO.match(text.upper())
        while text.endswith(b"$") and last + 1 < len(chunk.line_start):
            last, lines = last + 1, lines + 1
            text = text[:-1] + chunk.raw(last).rstrip()
        csys = match is not None and match[1] == b"CSYS"
        body = b"$$" + text[text.find(b"/") :] if csys else b"TITLE"
        return Statement(comment.line, comment.begin, comment.end, body, None, lines)


def _sizes(points: Points, part: slice) -> tuple[Mask, Array]:
    """(m,) which points state a direction, and the lengths of these. Raises ProgramError where one is not
    1."""
    direction = points.direction[part]
    stated, size = ~np.isnan(direction[:, 0]), np.sqrt((direction * direction).sum(axis=1))
    wrong = stated & ~(np.abs(size - 1.0) < UNIT)
    if wrong.any():
        bad = int(np.flatnonzero(wrong)[0])
        raise ProgramError(
            f"the tool axis has length {size[bad]:.6g}; expected a direction of length 1",
            line=int(points.line[part][bad]),
            code="OLP516",
        )
    return stated, size


def _summed(value: Array, point: Array, incremental: Mask, start: Sequence[float]) -> Array:
    """(n, 3) ends of points, some of them distances, from `at`."""
    order = np.arange(len(value))
    total = np.cumsum(np.where(incremental[:, None], value, 0.0), axis=0)
    source = np.maximum.accumulate(np.where(~incremental, order, -1))
    from_point = point[source] + (total - total[source])
    return np.asarray(np.where((source >= 0)[:, None], from_point, np.array(start) + total), float)
