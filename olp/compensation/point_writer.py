"""Digits of programs whose statements state their whole point (APT, DMIS, lists, described languages)."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from olp.compensation.digits import INT10, POW10, AxisRows, incremental
from olp.compensation.rows import Rows
from olp.compensation.writer import Task, Writer
from olp.core.arrays import Array, Index, Mask
from olp.core.toolpath import Flag
from olp.program.text.numbers import MOST_DECIMALS

#: digits of inserted numbers, where the program itself has as many
FINE_DECIMALS = 6


class PointWriter(Writer):
    """A writer of whole points: a later part of a move is the same statement again with other numbers, which
    may count in a frame that is turned."""

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        assert task.program.statements is not None
        self.statements = task.program.statements
        frames = self.path.frames
        stated = self.statements.restated
        self._restated = np.array(sorted(stated), np.int64)
        self._relative = np.array([stated[m] for m in self._restated.tolist()], bool)
        chords = self.statements.chords
        self._chords = np.array([(c.first, c.last, c.bare) for c in chords], np.int64).reshape(-1, 3)
        #: chords without a statement of their own
        self.chorded = np.concatenate(
            [np.arange(c.first, c.bare + 1) for c in chords] or [np.zeros(0, np.int64)]
        )
        self.turn = None
        if any(f.turn is not None for f in frames):
            self.turn = np.array([np.eye(3) if f.turn is None else f.turn for f in frames])
        used = self.words.decimals[self.program.slot[self.program.slot >= 0]]
        finest = min(int(used.max(initial=0)), FINE_DECIMALS)
        #: (frames, 3) the fewest decimals of numbers
        self.fewest = np.array(
            [[max(self._least(axis, f.unit_mm), finest) for axis in range(3)] for f in frames], np.int64
        ).reshape(-1, 3)

    def template(self, move: int) -> tuple[bytes, bytes, bytes, bytes]:
        """The statement of a move without its three numbers: the text before, between and behind them."""
        raise NotImplementedError

    def _least(self, axis: int, unit_mm: float) -> int:
        """The fewest decimals that the machine needs."""
        return self.style.least(axis, unit_mm)

    def _digits(self, rows: Rows) -> None:
        """What is written at each row, and where that leads."""
        move, part = rows.move, slice(rows.first, rows.first + len(rows.move))
        frame = self.path.frame[move]
        command, raw = self._middled(rows, self.plan.command_mm[part]), self.plan.raw[part]
        local = self.local(command, frame)
        slot = np.where(rows.head[:, None], self.program.slot[move], -1)
        given = slot >= 0
        own = np.where(given, self.words.decimals[slot], 0).astype(np.int64)
        word = np.where(given, self.words.mantissa[slot], 0)
        decimals = np.minimum(np.maximum(own, self.fewest[frame]), MOST_DECIMALS)
        with np.errstate(invalid="ignore"):
            wanted = np.rint(local * POW10[decimals])
        unknown = np.isnan(wanted)
        mantissa = np.where(unknown, 0.0, wanted).astype(np.int64)
        more = decimals - own
        same = mantissa == np.where(
            more >= 0, word * INT10[np.maximum(more, 0)],
            np.rint(word / POW10[np.maximum(-more, 0)]).astype(np.int64),
        )  # fmt: skip
        counting = (rows.flag & np.uint8(Flag.INCREMENTAL)) != 0
        without = (self.program.slot[move] < 0).all(axis=1) & ~np.isin(move, self.chorded)
        held = np.asarray(raw.any(axis=1) | without, bool)
        written = np.where(unknown, local, mantissa / POW10[decimals])
        # a number that is kept is the program's own, to the last bit
        nominal = self.path.end_mm[move]
        rows.emitted[:] = np.where(held[:, None], nominal, self.placed(written, frame))
        kept = same.all(axis=1) & ~held & rows.head & given.all(axis=1)
        rows.emitted[kept] = nominal[kept]
        rows.mantissa[:], rows.decimals[:] = mantissa, decimals
        rows.write[:] = ~same & ~held[:, None]
        tails = ~rows.head & ~held
        rows.write[tails] = True
        alike = (wanted == np.rint(self.local(nominal, frame) * POW10[decimals])).all(axis=1)
        self._restate(rows, alike, held)
        self._keep_arcs(rows, alike)
        changes = np.flatnonzero(counting[1:] != counting[:-1]) + 1
        for a, b in pairwise([0, *changes.tolist(), len(move)]):
            if counting[a]:
                self._counted(rows, a, b, local, word, own, given, held)

    def _restate(self, rows: Rows, alike: Mask, held: Mask) -> None:
        """Points that their statements do not state as x, y, z: all three are written, or none."""
        if not self._restated.size:
            return
        move = rows.move
        known = np.minimum(np.searchsorted(self._restated, move), len(self._restated) - 1)
        which = (self._restated[known] == move) & rows.head & ~held
        for i in np.flatnonzero(which).tolist():
            same = bool(alike[i])
            if same and self._relative[known[i]]:
                # it counts from the point before, which is written already
                before = rows.emitted[i - 1] if i else rows.entry
                start = self.path.starts_mm(int(move[i]), int(move[i]) + 1)[0]
                same = bool((before == start).all())
            rows.write[i] = not same
            if same:
                rows.emitted[i] = self.path.end_mm[move[i]]

    def _keep_arcs(self, rows: Rows, alike: Mask) -> None:
        """Arcs that are read as chords: all chords are written, or the statement of the arc is kept."""
        low, high = np.searchsorted(self._chords[:, 0], (rows.move[0], rows.move[-1] + 1))
        for first, last, bare in self._chords[low:high].tolist():
            a, b, c = np.searchsorted(rows.move, (first, bare + 1, last + 1)).tolist()
            before = rows.emitted[a - 1] if a else rows.entry
            start = self.path.starts_mm(first, first + 1)[0]
            kept = bool(alike[a:b].all() and rows.head[a:b].all() and (before == start).all())
            kept = kept and not rows.write[b:c].any()
            rows.write[a:b] = not kept
            if kept:
                rows.emitted[a:b] = self.path.end_mm[rows.move[a:b]]

    def _middled(self, rows: Rows, command: Array) -> Array:
        """Commands with the positions of holes corrected as the middle of their strokes needs it."""
        strokes = self.statements.strokes
        low, high = np.searchsorted(strokes[:, 0], (rows.move[0], rows.move[-1] + 1))
        if high == low:
            return command
        top, bottom = (np.searchsorted(rows.move, strokes[low:high, k]) for k in (0, 1))
        end = self.path.end_mm
        away = command - end[rows.move]
        middled = command.copy()
        middled[top] += np.nan_to_num(away[bottom] - away[top]) / 2
        return middled

    def _counted(
        self, rows: Rows, a: int, b: int, local: Array, word: Index, own: Index, given: Mask, held: Mask
    ) -> None:
        """Distances a..b: differences of rounded positions, so that nothing drifts."""
        frame = self.path.frame[rows.move[a:b]]
        before = rows.emitted[a - 1] if a else rows.entry
        entry = self.local(before[None], frame[:1])[0]
        nominal = self.local(self.path.end_mm[rows.move[a:b]], frame)
        places = np.empty((b - a, 3))
        for axis in range(3):
            grid = int(max(own[a:b, axis].max(initial=0), self.fewest[frame[0], axis]))
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

    def local(self, point: Array, frame: npt.NDArray[np.int32]) -> Array:
        """Axis positions as numbers of the program, before rounding."""
        away = point - self.frame_offset_mm[frame]
        if self.turn is not None:
            away = np.einsum("nij,ni->nj", self.turn[frame], away)
        return np.asarray(away / self.frame_unit_mm[frame][:, None], float)

    def placed(self, number: Array, frame: npt.NDArray[np.int32]) -> Array:
        """Axis positions of numbers of the program."""
        value = number * self.frame_unit_mm[frame][:, None]
        if self.turn is not None:
            value = np.einsum("nij,nj->ni", self.turn[frame], value)
        return np.asarray(value + self.frame_offset_mm[frame], float)
