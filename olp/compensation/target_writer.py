"""Writes a plan back into a program of a robot: numbers of targets changed, targets cloned, moves split."""

from __future__ import annotations

import re
import sys
from typing import ClassVar

import numpy as np

from olp.compensation.digits import POW10
from olp.compensation.point_writer import PointWriter
from olp.compensation.rows import Rows
from olp.compensation.target_arcs import SHARE, pieces_of, stated, stepped
from olp.compensation.writer import Task
from olp.core.arrays import Array, Index, Mask
from olp.core.errors import ProgramError
from olp.core.spool import whole
from olp.core.toolpath import Flag, Kind
from olp.core.values import dataclass
from olp.program.robots.arcs import Bent
from olp.program.robots.dialect import Replacement, RobotDialect
from olp.program.robots.poses import NO_TURN, matrix
from olp.program.robots.targets import NOWHERE, Part, Target, Use
from olp.program.text.numbers import MOST_DECIMALS, number, spliced, written

#: A number that is nearer to what is wanted than this share of its last digit is right.
_RIGHT = 0.5 + 1e-6
#: Groups of rows that are compared with another row, where none wants the very same digits.
_COMPARED = 8
_NAMES = re.compile(rb"[A-Za-z_]\w*")
#: Flags of moves that the text does not state as targets.
_NOT_STATED = np.uint8(Flag.CONTROL)


@dataclass(slots=True, eq=False)
class _Wanted:
    """What rows want of their targets: (r, 3) numbers before rounding (`value`), `decimals` and `mantissa`.
    `stated` (r,) rows have a target, and `right` (r, 3) are its numbers that stay as they are written."""

    value: Array
    decimals: Index
    mantissa: Index
    stated: Mask
    right: Mask


class TargetWriter(PointWriter):
    """A writer of targets. A target that moves want to differ is cloned, and each part of a move that is
    split states its own."""

    #: Rows at a time: all, as moves far apart may share a target.
    chunk: ClassVar[int] = sys.maxsize

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        program = task.program
        assert isinstance(program.dialect, RobotDialect)
        assert program.targets is not None
        self.dialect, self.stated = program.dialect, program.targets
        # the writer puts the stamp where the language has it
        self._stamp, self.stamp = self.stamp, b""
        self._names: set[str] = set()
        self._clones = self._made = 0

    def _rewritten(self, rows: Rows, begin: int, end: int) -> bytes | None:
        last = np.append(rows.move[1:] != rows.move[:-1], True)[: len(rows)]
        wanted = self._wanted(rows)
        arcs, own = self._arcs(rows, wanted)
        edits = [*arcs, *self._targets(rows, np.flatnonzero(last & wanted.stated & ~own), wanted),
                 *self._parts(rows, np.flatnonzero(~last & wanted.stated & ~own), wanted)]  # fmt: skip
        blocks = self.tally.inserted_blocks - self._clones
        if self._stamp and (edits or self.stamp_always):
            edits.append(self.dialect.stamped(self.program, self._stamp))
            blocks += 1
        if blocks:
            edits += self.dialect.counted(self.program, blocks)
        edits = self.dialect.completed(self.program, edits, self._made)
        return spliced(whole(self.program.data), edits) if edits else None

    def _wanted(self, rows: Rows) -> _Wanted:
        """Numbers of all rows as their targets state them, before they move along with their moves."""
        move, part = rows.move, slice(rows.first, rows.first + len(rows.move))
        command = self.plan.command_mm[part].copy()
        raw = self.plan.raw[part].any(axis=1)
        command[raw] = self.path.end_mm[move][raw]
        local = self.local(command, self.path.frame[move])
        slot = self.program.slot[move]
        stated = (slot >= 0).all(axis=1) & ((rows.flag & _NOT_STATED) == 0)
        own = np.where(slot >= 0, self.words.decimals[slot], 0).astype(np.int64)
        least = np.maximum(self.fewest[self.path.frame[move]], self.dialect.decimals)
        decimals = np.minimum(np.maximum(own, least), MOST_DECIMALS)
        mantissa = np.where(stated[:, None], np.rint(np.nan_to_num(local) * POW10[decimals]), 0.0)
        rows.emitted[:] = np.where(
            stated[:, None], self.placed(mantissa / POW10[decimals], self.path.frame[move]), np.nan
        )
        at = np.flatnonzero(stated)
        point = np.full(local.shape, np.nan)
        points = [self.stated.targets[self._use(rows, row).target].point for row in at.tolist()]
        point[at] = np.array(points).reshape(-1, 3)
        right: Mask = np.rint(point * POW10[decimals]) == mantissa
        return _Wanted(local, decimals, mantissa.astype(np.int64), stated, right)

    # -- targets -------------------------------------------------------------------------------------

    def _targets(self, rows: Rows, last: Index, wanted: _Wanted) -> list[Replacement]:
        """Numbers of the targets at the ends of moves, and clones of targets whose moves differ."""
        by_target: dict[int, list[int]] = {}
        for row in last.tolist():
            by_target.setdefault(self._use(rows, row).target, []).append(row)
        edits: list[Replacement] = []
        for place, own in by_target.items():
            target = self.stated.targets[place]
            groups = self._groups(rows, own, wanted)
            for k, group in enumerate(groups):
                first = k == 0 and not target.held
                right = bool(wanted.right[group[0]].all())
                kept = target.held and right
                # the shift of a move is its own, and takes up what the target does not
                shifted = [row for row in group if not (first or kept) and self._use(rows, row).offsets]
                for row in shifted:
                    base = None if target.held else groups[0][0]
                    edits += self._shifted(rows, row, target, base, wanted)
                fixed = [row for row in group if first or kept or not self._use(rows, row).offsets]
                # with numbers of its own a row ends where they say
                for row in fixed if right else [row for row in fixed if row != group[0]]:
                    rows.emitted[row] = self._reached(rows, row, group[0], wanted)
                if first:
                    edits += self._renumbered(target, group[0], wanted)
                elif fixed and not kept:
                    edits += self._cloned(rows, target, fixed, wanted)
        return edits

    def _shifted(
        self, rows: Rows, row: int, target: Target, first: int | None, wanted: _Wanted
    ) -> list[Replacement]:
        """New numbers of the shift of a row, whose target has the numbers that row `first` gives it, or those
        of the text where that is None."""
        use, move = self._use(rows, row), int(rows.move[row])
        decimals = int(wanted.decimals[row].max())
        base = np.array(target.point)
        if first is not None and not wanted.right[first].all():
            base = wanted.mantissa[first] / POW10[wanted.decimals[first]]
        turn, shift = matrix(use.offset_turn), np.array(use.shift_mm) / self.frame_of(move).unit_mm
        new = np.round(turn.T @ (shift + wanted.value[row] - base), decimals)
        reached = (base + turn @ new - shift)[None]
        rows.emitted[row] = self.placed(reached, self.path.frame[move : move + 1])[0]
        edits = [
            (a, b, self._number((a, b), float(value), decimals))
            for (a, b), value in zip(use.offsets, new, strict=True)
        ]
        self.tally.changed_words += len(edits)
        return edits

    def _groups(self, all_: Rows, rows: list[int], wanted: _Wanted) -> list[list[int]]:
        """Rows that want the same of a target: first those that have no shift of their own, the largest group
        before others."""
        if len(rows) == 1:
            return [rows]
        groups: list[list[int]] = []
        known: dict[tuple[int, ...], list[int]] = {}
        for row in rows:
            key = tuple(wanted.mantissa[row].tolist())
            group = known.get(key) or next(
                (g for g in groups[:_COMPARED] if self._near(g[0], row, wanted)), None
            )
            if group is None:
                groups.append([])
                group = known[key] = groups[-1]
            group.append(row)
        plain = {id(g): any(not self._use(all_, row).offsets for row in g) for g in groups}
        return sorted(groups, key=lambda g: (plain[id(g)], len(g)), reverse=True)

    @staticmethod
    def _near(first: int, row: int, wanted: _Wanted) -> bool:
        """Whether the numbers of row `first` are right for another row to their last digit."""
        away = np.abs(wanted.value[row] * POW10[wanted.decimals[first]] - wanted.mantissa[first])
        return bool((away <= _RIGHT).all())

    def _reached(self, rows: Rows, row: int, first: int, wanted: _Wanted) -> Array:
        """Where a row ends with the numbers that row `first` gives to its target."""
        if wanted.right[first].all():
            return np.asarray(self.path.end_mm[rows.move[row]])
        number = wanted.mantissa[first] / POW10[wanted.decimals[first]]
        frame = self.path.frame[rows.move[row : row + 1]]
        return np.asarray(self.placed(number[None], frame)[0])

    def _renumbered(self, target: Target, row: int, wanted: _Wanted) -> list[Replacement]:
        """New numbers in place of those of a target, where they differ."""
        texts = self._numbers(target, row, wanted)
        edits = [
            (a, b, text)
            for (a, b), text in zip(target.numbers, texts, strict=True)
            if text != self.program.data[a:b]
        ]
        self.tally.changed_words += len(edits)
        return edits

    def _cloned(self, rows: Rows, target: Target, group: list[int], wanted: _Wanted) -> list[Replacement]:
        """A declaration of its own for the moves of a group, which name it."""
        data, first = self.program.data, target.value[0]
        texts = self._numbers(target, group[0], wanted)
        numbers = [(a - first, b - first, text) for (a, b), text in zip(target.numbers, texts, strict=True)]
        name = self._new_name(target)
        text = spliced(data[slice(*target.value)], numbers)
        edits = [self.dialect.clone(self.program, target, name, text)]
        for row in group:
            named = self._use(rows, row).named
            assert named != NOWHERE
            edits.append((*named, name.encode()))
        self.tally.inserted_blocks += 1
        self._clones += 1
        return edits

    def _new_name(self, target: Target) -> str:
        """A name that the text does not have, made from that of a target."""
        if not self._names:
            self._names = {word.decode("latin-1").upper() for word in _NAMES.findall(self.program.data)}
        name = self.dialect.named(self.program, target, self._names)
        self._names.add(name.upper())
        self._made += 1
        return name

    # -- parts ---------------------------------------------------------------------------------------

    def _parts(self, rows: Rows, inner: Index, wanted: _Wanted) -> list[Replacement]:
        """Statements of the parts of moves before their ends."""
        edits: list[Replacement] = []
        for row in inner.tolist():
            move, use = int(rows.move[row]), self._use(rows, row)
            target = self.stated.targets[use.target]
            scale = POW10[wanted.decimals[row]]
            shift = np.array(use.shift_mm) / self.frame_of(move).unit_mm
            value = np.rint((wanted.value[row] + shift) * scale)
            reached = (value / scale - shift)[None]
            rows.emitted[row] = self.placed(reached, self.path.frame[move : move + 1])[0]
            if rows.take_up[row] and self.path.flag[move] & np.uint8(Flag.WHOLE):
                raise ProgramError(
                    "an axis turns round at the begin of this move, and another axis moves in it, so no step "
                    "that takes up backlash can be put before it; make it two moves",
                    line=int(self.path.line[move]),
                    code="OLP561",
                )
            texts = [
                self._number(target.numbers[k], float(value[k] / scale[k]), int(wanted.decimals[row, k]))
                for k in range(3)
            ]
            share = float(self.plan.reach[rows.first + row])
            # a step that takes up backlash has to be reached
            stop = bool(rows.take_up[row] or self.path.kind[move] == Kind.RAPID)
            name = self._new_name(target) if self.dialect.names_parts else ""
            part = Part((texts[0], texts[1], texts[2]), share, stop, name)
            edits += self.dialect.part(self.program, move, use, part)
            self.tally.inserted_blocks += 1
        return edits

    # -- arcs ----------------------------------------------------------------------------------------

    def _arcs(self, rows: Rows, wanted: _Wanted) -> tuple[list[Replacement], Mask]:
        """Arcs in place of one where that would leave the tolerance. Also (r,) the rows that are written by
        that: of chords, and of via points whose targets stay as they are."""
        edits: list[Replacement] = []
        own = np.zeros(len(rows), bool)
        for arc in self.stated.arcs:
            first, behind = np.searchsorted(rows.move, (arc.first, arc.last + 1)).tolist()
            line, middle = int(self.path.line[arc.last]), arc.middle - arc.first
            if rows.take_up[first:behind].any():
                raise stepped(line)
            # the last row of each chord
            ends = np.searchsorted(rows.move, np.arange(arc.first, arc.last + 1), "right") - 1
            command = self.plan.command_mm[rows.first + np.append(first - 1, ends)]
            rows.emitted[first:behind] = self.plan.command_mm[rows.first + first : rows.first + behind]
            bent = Bent(command, [NO_TURN], middle + 1, SHARE * self.tolerance_mm, np.nan)
            pieces = pieces_of(arc, bent, line)
            own[first : behind - 1] = True
            own[ends[middle]] = bool(pieces)

            def part(chord: int, of: int, ends: Index = ends) -> Part:
                return self._on_arc(rows, int(ends[chord]), of, wanted)

            for piece in pieces:
                edits += stated(self.program, arc, piece, part)
            self.tally.inserted_blocks += max(len(pieces) - 1, 0)
        return edits, own

    def _on_arc(self, rows: Rows, row: int, of: int, wanted: _Wanted) -> Part:
        """A point of an arc with the words of the target of move `of`."""
        use = self.stated.uses[of]
        assert use is not None
        target = self.stated.targets[use.target]
        shift = np.array(self._use(rows, row).shift_mm) / self.frame_of(of).unit_mm
        value = (wanted.value[row] + shift).tolist()
        x, y, z = (self._number(target.numbers[k], value[k], int(wanted.decimals[row, k])) for k in range(3))
        name = self._new_name(target) if self.dialect.names_parts else ""
        return Part((x, y, z), 1.0, False, name)

    def _use(self, rows: Rows, row: int) -> Use:
        use = self.stated.uses[int(rows.move[row])]
        assert use is not None
        return use

    def _numbers(self, target: Target, row: int, wanted: _Wanted) -> list[bytes]:
        """The three numbers that a row gives to its target; those that are right keep their bytes."""
        own = (column[row].tolist() for column in (wanted.right, wanted.mantissa, wanted.decimals))
        return [
            self.program.data[a:b] if right else self._number((a, b), mantissa / 10.0**decimals, decimals)
            for (a, b), right, mantissa, decimals in zip(target.numbers, *own, strict=True)
        ]

    def _number(self, span: tuple[int, int], value: float, decimals: int) -> bytes:
        """A value in the form of a number of the text, never with an exponent."""
        form = number(self.program.data[slice(*span)])
        if form is None or form.letter:
            form = number(b"0.0")
            assert form is not None
        return written(form, value, max(decimals, form.decimals))
