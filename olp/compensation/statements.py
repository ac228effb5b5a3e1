"""Writes a plan back into a program of whole statements (APT, DMIS, lists): numbers changed, statements
inserted, nothing else.

Every statement that moves says its whole point, so a later part of a move is the same statement again with
other numbers. Goes through the rows in chunks, as `writer` does for blocks of words.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from olp.compensation.digits import AxisRows, incremental
from olp.compensation.plan import Plan, targets
from olp.compensation.rows import Rows
from olp.compensation.stamp import stamped
from olp.compensation.statement_arcs import FINE_DECIMALS, MOST_DECIMALS, ROW, arc_edits
from olp.compensation.style import Style
from olp.compensation.tally import Tally
from olp.compensation.wrapping import carded, wrapped
from olp.core.arrays import Array, Index, Mask
from olp.core.machine import Vector
from olp.core.toolpath import Flag, Kind
from olp.errormodel.base import ErrorModel
from olp.program.program import Program
from olp.program.text.edits import BARE, EditList, Edits, Prefixes, splice

CHUNK = 1 << 15
_POW10 = 10.0 ** np.arange(19)
_INT10 = 10 ** np.arange(19, dtype=np.int64)
_BYPASS = np.uint8(Flag.CONTROL | Flag.PASS)


class StatementWriter:
    """One writing of one program. `text()` gives the corrected bytes; `parts` then holds, per move of the
    nominal path, how many moves the corrected text has for it."""

    def __init__(
        self,
        program: Program,
        plan: Plan,
        model: ErrorModel,
        *,
        tolerance_mm: float,
        increments_mm: Vector,
        stamp: bytes = b"",
    ) -> None:
        assert program.words is not None
        assert program.statements is not None
        self.program, self.plan, self.model = program, plan, model
        self.words, self.statements = program.words, program.statements
        self.tolerance_mm, self.stamp = tolerance_mm, stamp
        self.style = Style.of(program, increments_mm)
        self.prefixes = Prefixes()
        self.tally = Tally()
        self.path = program.toolpath
        self.targets = targets(self.path, plan.shift_mm)
        self.emitted = [float(v) for v in self.path.start_mm]
        self.parts = np.zeros(len(self.path), np.int32)
        frames = self.path.frames
        self.offset = np.array([f.offset_mm for f in frames]).reshape(-1, 3)
        self.unit = np.array([f.unit_mm for f in frames])
        self.turn = None
        if any(f.turn is not None for f in frames):
            self.turn = np.array([np.eye(3) if f.turn is None else f.turn for f in frames])
        used = self.words.decimals[program.slot[program.slot >= 0]]
        self.finest = min(int(used.max(initial=0)), FINE_DECIMALS)
        self.broken = np.array(sorted(self.statements.broken), np.int64)
        self.changed = False

    def text(self) -> bytes:
        """The corrected text; the program's own bytes where nothing changes."""
        source = np.frombuffer(self.program.data, np.uint8)
        out: list[bytes] = []
        at = 0
        for first, last in self._spans():
            edits = self._edits(first, last)
            to = len(source) if last == len(self.plan) else self._start_of(int(self.plan.move[last]))
            if edits:
                joined = Edits.join(edits)
                text = splice(source[at:to], at, joined, self.prefixes, leading_zero=self.style.leading_zero)
                lines = carded if self.statements.cards else wrapped
                out.append(lines(text.tobytes(), self.statements.width, self.statements.mark))
                self.changed = True
            else:
                out.append(self.program.data[at:to])
            at = to
        out.append(self.program.data[at:])
        if self.changed and self.stamp:
            stamp = self.stamp.ljust(self.statements.width + 8) if self.statements.cards else self.stamp
            out[0] = stamped(out[0], stamp, self.program.eol(1), self.program.dialect.first)
        return b"".join(out)

    def _start_of(self, move: int) -> int:
        """Where the first byte that says a move stands, at the start of its line."""
        arc = self.statements.arcs.get(move)
        begin = int(self.program.line_start[self.path.line[move] - 1])
        return begin if arc is None else min(begin, arc.begin)

    def _spans(self) -> list[tuple[int, int]]:
        """Chunks of rows that end between statements."""
        count, lines = len(self.plan), self.path.line
        cuts = [0]
        while cuts[-1] < count:
            cut = min(cuts[-1] + CHUNK, count)
            while cut < count and lines[self.plan.move[cut]] == lines[self.plan.move[cut - 1]]:
                cut += 1
            cuts.append(cut)
        return list(pairwise(cuts))

    # -- one chunk ---------------------------------------------------------------------------------

    def _edits(self, first: int, last: int) -> list[Edits]:
        move = self.plan.move[first:last]
        count = len(move)
        rows = Rows(
            first=first,
            move=move,
            head=np.concatenate(([True], move[1:] != move[:-1])),
            flag=self.path.flag[move],
            emitted=np.empty((count, 3)),
            entry=np.array(self.emitted),
            write=np.zeros((count, 3), bool),
            mantissa=np.zeros((count, 3), np.int64),
            decimals=np.zeros((count, 3), np.int8),
        )
        self._mark_take_ups(rows)
        self._digits(rows)
        edits = [*self._changes(rows), *self._insertions(rows), *arc_edits(self, rows)]
        self.emitted = [float(v) for v in rows.emitted[-1]]
        self.parts[move[0] : move[-1] + 1] += np.bincount(move - move[0]).astype(np.int32)
        return [e for e in edits if len(e)]

    def _mark_take_ups(self, rows: Rows) -> None:
        """Lost motion is taken up in a statement before that of an arc, which stays the arc's own."""
        take_up = self.plan.take_up[rows.first : rows.first + len(rows.move)]
        arc = np.isin(self.path.kind[rows.move], (Kind.ARC_CW, Kind.ARC_CCW))
        rows.before = np.zeros(len(rows.move), bool)
        at = np.flatnonzero(take_up & arc & rows.head)
        while at.size:
            rows.before[at] = True
            rows.head[at] = False
            rows.head[at + 1] = True
            at = at[take_up[at + 1]] + 1

    def _digits(self, rows: Rows) -> None:
        """What is written at each row, and where that leads."""
        move, part = rows.move, slice(rows.first, rows.first + len(rows.move))
        frame = self.path.frame[move]
        command, raw = self._middled(rows, self.plan.command_mm[part]), self.plan.raw[part]
        unit = self.unit[frame]
        local = self.local(command, frame)
        slot = np.where(rows.head[:, None], self.program.slot[move], -1)
        given = slot >= 0
        own = np.where(given, self.words.decimals[slot], 0).astype(np.int64)
        word = np.where(given, self.words.mantissa[slot], 0)
        fewest = self.fewest(unit)
        decimals = np.minimum(np.maximum(own, fewest), MOST_DECIMALS)
        with np.errstate(invalid="ignore"):
            wanted = np.rint(local * _POW10[decimals])
        unknown = np.isnan(wanted)
        mantissa = np.where(unknown, 0.0, wanted).astype(np.int64)
        more = decimals - own
        same = mantissa == np.where(
            more >= 0, word * _INT10[np.maximum(more, 0)],
            np.rint(word / _POW10[np.maximum(-more, 0)]).astype(np.int64),
        )  # fmt: skip
        counting = (rows.flag & np.uint8(Flag.INCREMENTAL)) != 0
        held = raw.any(axis=1) | ((rows.flag & _BYPASS) != 0) | ~(self.program.slot[move] >= 0).any(axis=1)
        written = np.where(unknown, local, mantissa / _POW10[decimals])
        # a number that stays says what the program says, to the last bit
        nominal = self.path.end_mm[move]
        rows.emitted[:] = np.where(held[:, None], nominal, self.placed(written, frame))
        kept = same.all(axis=1) & ~held & rows.head & given.all(axis=1)
        rows.emitted[kept] = nominal[kept]
        rows.mantissa[:], rows.decimals[:] = mantissa, decimals
        rows.write[:] = ~same & ~held[:, None]
        tails = ~rows.head & ~held
        rows.write[tails] = True
        changes = np.flatnonzero(counting[1:] != counting[:-1]) + 1
        for a, b in pairwise([0, *changes.tolist(), len(move)]):
            if counting[a]:
                self._counted(rows, a, b, local, word, own, given, held)

    def _middled(self, rows: Rows, command: Array) -> Array:
        """Commands with the places of holes corrected as the middle of their strokes asks for."""
        strokes = self.statements.strokes
        low, high = np.searchsorted(strokes[:, 0], (rows.move[0], rows.move[-1] + 1))
        if high == low:
            return command
        top, bottom = (np.searchsorted(rows.move, strokes[low:high, k]) for k in (0, 1))
        end = self.path.end_mm
        away = command - end[rows.move]
        out = command.copy()
        out[top] += np.nan_to_num(away[bottom] - away[top]) / 2
        return out

    def _counted(
        self, rows: Rows, a: int, b: int, local: Array, word: Index, own: Index, given: Mask, held: Mask
    ) -> None:
        """Distances a..b: differences of rounded places, so that nothing drifts."""
        frame = self.path.frame[rows.move[a:b]]
        before = rows.emitted[a - 1] if a else rows.entry
        entry = self.local(before[None], frame[:1])[0]
        nominal = self.local(self.path.end_mm[rows.move[a:b]], frame)
        places = np.empty((b - a, 3))
        for axis in range(3):
            grid = int(max(own[a:b, axis].max(initial=0), self.fewest(self.unit[frame[:1]])[0, axis]))
            column = AxisRows(
                command=local[a:b, axis], nominal=nominal[:, axis], given=given[a:b, axis],
                raw=np.repeat(held[a:b, None], 3, axis=1)[:, axis], reset=np.zeros(b - a, bool),
                word=word[a:b, axis], decimals=own[a:b, axis].astype(np.int8), offset=0.0, unit=1.0,
            )  # fmt: skip
            digits = incremental(column, float(entry[axis]), min(grid, MOST_DECIMALS))
            places[:, axis] = digits.emitted
            rows.mantissa[a:b, axis], rows.decimals[a:b, axis] = digits.mantissa, digits.decimals
            rows.write[a:b, axis] = digits.write & ~held[a:b]
        rows.emitted[a:b] = self.placed(places, frame)

    def fewest(self, unit: Array) -> Index:
        """(n, 3) the fewest decimals of numbers in units (n,)."""
        metric = np.array([max(self.style.least(axis, 1.0), self.finest) for axis in range(3)])
        if (unit == 1.0).all():
            return np.broadcast_to(metric, (len(unit), 3))
        inch = np.array([max(self.style.least(axis, 25.4), self.finest) for axis in range(3)])
        return np.where((unit == 1.0)[:, None], metric, inch)

    def local(self, point: Array, frame: npt.NDArray[np.int32]) -> Array:
        """Axis positions as numbers of the program, before rounding."""
        away = point - self.offset[frame]
        if self.turn is not None:
            away = np.einsum("nij,ni->nj", self.turn[frame], away)
        return np.asarray(away / self.unit[frame][:, None], float)

    def placed(self, number: Array, frame: npt.NDArray[np.int32]) -> Array:
        """Axis positions of numbers of the program."""
        value = number * self.unit[frame][:, None]
        if self.turn is not None:
            value = np.einsum("nij,nj->ni", self.turn[frame], value)
        return np.asarray(value + self.offset[frame], float)

    # -- edits of points ---------------------------------------------------------------------------

    def _changes(self, rows: Rows) -> list[Edits]:
        """Numbers of the statements that are there."""
        slot = self.program.slot[rows.move]
        change = rows.write & rows.head[:, None]
        short = (slot[:, 2] >= 0) & (slot[:, 0] < 0)
        out = [*self._spelled(rows, np.flatnonzero(short & change[:, :2].any(axis=1)))]
        change[short & change[:, :2].any(axis=1)] = False
        row, axis = np.nonzero(change & (slot >= 0))
        word = slot[row, axis]
        prefix = np.zeros(len(word), np.int32)
        if self.broken.size:
            for k in np.flatnonzero(np.isin(word, self.broken)).tolist():
                prefix[k] = self.prefixes(self.statements.broken[int(word[k])])
        out.append(
            Edits(
                self.words.number[word].astype(np.int64), self.words.end[word].astype(np.int64),
                rows.mantissa[row, axis], rows.decimals[row, axis], prefix, np.zeros(len(word), np.int32),
            )
        )  # fmt: skip
        self.tally.changed_words += len(word)
        return out

    def _spelled(self, rows: Rows, which: Index) -> list[Edits]:
        """One distance along the tool axis becomes three, where the others change too."""
        edits = EditList(self.prefixes)
        for row in which.tolist():
            word = int(self.program.slot[rows.move[row], 2])
            start, end = int(self.words.number[word]), int(self.words.end[word])
            for axis in range(3):
                place = (start, end) if axis == 0 else (end, end)
                mantissa, decimals = int(rows.mantissa[row, axis]), int(rows.decimals[row, axis])
                edits.add(*place, mantissa, decimals, b"" if axis == 0 else b",", order=axis)
            self.tally.changed_words += 1
            self.tally.inserted_words += 2
        return [edits.done()]

    def _insertions(self, rows: Rows) -> list[Edits]:
        """Later parts of straight moves: the statement again, with other numbers."""
        arc = np.isin(self.path.kind[rows.move], (Kind.ARC_CW, Kind.ARC_CCW))
        take_up = self.plan.take_up[rows.first : rows.first + len(rows.move)]
        tails = np.flatnonzero(~rows.head & rows.write.any(axis=1) & (~arc | take_up))
        if not tails.size:
            return []
        moves, which = np.unique(rows.move[tails], return_inverse=True)
        pieces = np.zeros((len(moves), 4), np.int64)
        place = np.zeros((len(moves), 2), np.int64)
        for i, move in enumerate(moves.tolist()):
            lead, between, last, trail = self._template(move)
            eol = self.program.eol(int(self.path.line[move]))
            pieces[i] = [self.prefixes(p) for p in (eol + lead, between, last, trail)]
            place[i] = self.statements.end[move], self._start_of(move)
        out = []
        ahead = rows.before[tails]
        at = np.where(ahead, place[which, 1], place[which, 0])
        order = (tails * ROW).astype(np.int32)
        zero = np.zeros(len(tails), np.int8)
        bare = np.full(len(tails), BARE)
        lead = pieces[which, 0]
        if ahead.any():
            # in front of an arc the line end stands behind
            for k in np.flatnonzero(ahead).tolist():
                text = self.prefixes.table[int(lead[k])]
                lead[k] = self.prefixes(text.lstrip(b"\r\n"))
        for axis in range(3):
            prefix = lead if axis == 0 else pieces[which, axis]
            out.append(
                Edits(
                    at, at, rows.mantissa[tails, axis], rows.decimals[tails, axis],
                    prefix.astype(np.int32), order + np.int32(axis),
                )
            )  # fmt: skip
        out.append(Edits(at, at, bare, zero, pieces[which, 3].astype(np.int32), order + np.int32(3)))
        ends = [self.prefixes(self.program.eol(int(self.path.line[m]))) for m in moves.tolist()]
        behind = np.flatnonzero(ahead)
        closing = np.array(ends, np.int32)[which[behind]]
        out.append(
            Edits(at[behind], at[behind], bare[behind], zero[behind], closing, order[behind] + np.int32(4))
        )
        self.tally.inserted_blocks += len(tails)
        return out

    def _template(self, move: int) -> tuple[bytes, bytes, bytes, bytes]:
        """The statement of a move without its three numbers: what stands before, between and behind them.
        A comment at its end, and marks of continuation inside its words, are left out."""
        data, statements = self.program.data, self.statements
        slot = self.program.slot[move]
        begin, end = int(statements.begin[move]), int(statements.end[move])
        words = [s for s in slot.tolist() if s >= 0]
        start = [int(self.words.number[s]) for s in words]
        stop = [int(self.words.end[s]) for s in words]
        arc = statements.arcs.get(move)
        if arc is not None and arc.whole:
            return b"GOTO/", b",", b",", b""
        lead = data[begin : start[0]]
        if len(words) == 3:
            between, last = data[stop[0] : start[1]], data[stop[1] : start[2]]
        else:
            between = last = b","
        trail = data[stop[-1] : end]
        comment = trail.find(b"$$")
        if comment >= 0:
            trail = trail[:comment].rstrip()
        if self.path.kind[move] == Kind.RAPID:
            lead = statements.rapid + self.program.eol(int(self.path.line[move])) + lead
        return lead, between, last, trail
