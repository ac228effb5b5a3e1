"""Arcs among the points of a stretch: resolved in columns, and as chords where they lie in no plane of two
axes. What their joints with straight moves show of their direction is judged at the end."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index
from olp.core.errors import ProgramError
from olp.core.toolpath import Flag, Kind
from olp.program.apt.arcs import ArcForm, joints, resolved
from olp.program.apt.chords import chorded, leaning
from olp.program.apt.events import Events
from olp.program.program import ChordText

#: so many joints in the opposite direction are no coincidence
_SEVERAL = 3


class Part(NamedTuple):
    """Moves of a stretch in columns, as `put_stated_moves` takes them."""

    kind: npt.NDArray[np.uint8]
    flag: npt.NDArray[np.uint8]
    line: Index
    frame: Index
    end: Array
    slot: Index
    begin: Index
    stop: Index

    def repeated(self, count: Index) -> Part:
        """Each move so many times."""
        return Part(
            np.repeat(self.kind, count), np.repeat(self.flag, count), np.repeat(self.line, count),
            np.repeat(self.frame, count), np.repeat(self.end, count, axis=0),
            np.repeat(self.slot, count, axis=0), np.repeat(self.begin, count), np.repeat(self.stop, count),
        )  # fmt: skip


class ArcMoves(Events):
    """The part of a reader that makes moves of arcs."""

    def _with_arcs(
        self, arcs: Sequence[tuple[int, ArcForm]], path: Part, offset: Array, turn: Array | None
    ) -> Part:
        """Points some of which end arcs; arcs in no plane of two axes become chords."""
        rows, forms = np.array([row for row, _ in arcs]), [form for _, form in arcs]
        end, line, kind = path.end, path.line, path.kind
        wrong = (kind[rows] == Kind.RAPID) | ((path.flag[rows] & ~np.uint8(Flag.INCREMENTAL)) != 0)
        if wrong.any():
            raise ProgramError(
                "an arc is at rapid, or its tool axis changes, which is not read",
                line=int(line[rows[wrong][0]]),
                code="OLP518",
            )
        here = np.array(self.position)
        start = np.where(rows[:, None] > 0, end[np.maximum(rows - 1, 0)], here)
        before = np.where(rows[:, None] > 1, end[np.maximum(rows - 2, 0)], here)
        straight = (rows > 0) & (kind[np.maximum(rows - 1, 0)] == Kind.LINE) & ~np.isin(rows - 1, rows)
        shift = np.broadcast_to(offset, end.shape)
        lean = leaning(forms, turn)
        direction = np.zeros(len(rows), np.int64)
        chords: dict[int, Array] = {}
        for i in np.flatnonzero(lean).tolist():
            row = int(rows[i])
            if path.flag[row]:
                raise ProgramError(
                    "an arc in no plane of two axes of the machine ends with GODLTA, which is not read; "
                    "write its end as GOTO",
                    line=int(line[row]),
                    code="OLP518",
                )
            arc = chorded(
                forms[i], start[i], end[row], before[i], int(line[row]), self.unit_mm, shift[row], turn
            )
            chords[row], direction[i] = arc.end, arc.joint
        plain = np.flatnonzero(~lean)
        base = self.collector.moves
        count = np.ones(len(end), np.int64)
        count[list(chords)] = [len(c) for c in chords.values()]
        last = base + np.cumsum(count) - 1
        if plain.size:
            some = rows[plain]
            geometry = resolved(
                [forms[i] for i in plain.tolist()], start[plain], end[some], line[some], self.unit_mm,
                shift[some], turn,
            )  # fmt: skip
            direction[plain] = joints(geometry, start[plain], before[plain])
            kind[some] = np.where(geometry.sweep > 0, Kind.ARC_CCW, Kind.ARC_CW)
            self.collector.put_arcs(last[some], geometry.centre, geometry.plane, geometry.sweep)
            for i in plain.tolist():
                self.collector.arcs[int(last[rows[i]])] = forms[i].text
        self._check_turns(forms, np.where(straight, direction, 0))
        if not chords:
            return path
        path = path.repeated(count)
        for i in np.flatnonzero(lean).tolist():
            row, text = int(rows[i]), forms[i].text
            stop = int(last[row]) - base + 1
            first = stop - int(count[row])
            path.end[first:stop] = chords[row]
            bare = stop if text.whole else stop - 1
            path.slot[first:bare] = path.begin[first:bare] = path.stop[first:bare] = -1
            self.collector.chords.append(
                ChordText(base + first, base + stop - 1, text.begin, text.end, text.whole)
            )
            self.collector.remarks.setdefault(
                "chords", (forms[i].line, "arcs in no plane of two axes of the machine are read as chords")
            )
        return path

    def _check_turns(self, forms: Sequence[ArcForm], directions: Index) -> None:
        """What the joints of arcs with straight moves before them show of the direction of turning."""
        for form, direction in zip(forms, directions.tolist(), strict=True):
            if form.begins is not None or form.angle_rad is not None:
                continue
            if not form.confirmed and self.unconfirmed is None:
                self.unconfirmed = form.line
            if direction > 0:
                self.onward += 1
            elif direction < 0:
                self.back.append(form.line)

    def _judge_turns(self) -> None:
        """Refuse a program whose arcs turn back where they should go on; remark one that shows neither."""
        if len(self.back) >= _SEVERAL and len(self.back) > 2 * self.onward:
            raise ProgramError(
                "the arc begins in the direction opposite to the move before it: arcs seem to turn the other "
                "way about their normals than in programs of this form; have the CAM system write points",
                line=self.back[0],
                code="OLP530",
            )
        doubt = self.unconfirmed if self.unconfirmed is not None else next(iter(self.back), None)
        if doubt is not None and not self.onward:
            self.collector.remarks["arcs"] = (doubt, "nothing shows which way arcs turn about their normals")
