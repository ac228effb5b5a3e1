"""Writes the plan of a machine with rotary joints into its program: words changed and inserted, blocks
inserted, nothing else.

Rotary words are rounded first. The linear ones are then solved for the position that these rotary words give,
and rounded, so that the rounding of an angle does not move the tip.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from olp.compensation.digits import AxisRows, Digits
from olp.compensation.inserted_blocks import end_word_edits
from olp.compensation.joints.direction_words import DirectionWords
from olp.compensation.joints.drilled import lifted, middled
from olp.compensation.joints.path import JointPath
from olp.compensation.joints.planning import JointPlan
from olp.compensation.joints.rounded_play import loads
from olp.compensation.stretches import Decimals, Stretches, digits_of
from olp.compensation.style import Style
from olp.compensation.tally import Tally
from olp.compensation.writer import outside
from olp.core.arrays import Array, Index, Mask, distinct, is_in
from olp.core.errors import ProgramError
from olp.core.machine import Vector
from olp.core.toolpath import Flag
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.program.text.edits import BARE, EditList, Edits, Prefixes, splice

Small = npt.NDArray[np.int8]

#: The largest number of axes that have words; orders of insertions leave room for them and for F.
PLACES = 16
#: The share of the time of a block in G93 that a step takes which takes up backlash.
_TAKE_UP_SHARE = 0.05
#: Decimals of F in G93, where a block is split.
_FEED_DECIMALS = 4


@dataclass(frozen=True, slots=True, eq=False)
class WrittenJoints:
    """The corrected text, None where nothing changes, what was changed, and `parts` (n,), how many moves it
    has for each nominal one."""

    text: bytes | None
    tally: Tally
    parts: Index


class JointWriter:
    """A writer of blocks of words."""

    def __init__(self, path: JointPath, plan: JointPlan) -> None:
        program = path.program
        assert program.words is not None
        self.path, self.plan, self.program, self.words = path, plan, program, program.words
        words = path.coordinates
        self.order, self.rotary = words.names, words.rotary
        x, y, z = words.linear.tolist()
        increments: Vector = (words.steps[x], words.steps[y], words.steps[z])
        self.style = Style.of(program, increments)
        self.prefixes, self.tally = Prefixes(), Tally()
        self.head = np.append(True, plan.move[1:] != plan.move[:-1])[: len(plan.move)]
        self.solid = np.asarray(np.isfinite(plan.command).all(axis=1), bool)
        # columns of axes, and behind them those of the components of directions
        self.led = path.directions.led[plan.move]
        names = self._direction_words() if self.led.any() else ()
        self.names = [*(name.encode() for name in self.order), *names]
        shape = (len(plan.move), len(self.names))
        self.write, self.mantissa = np.zeros(shape, bool), np.zeros(shape, np.int64)
        self.decimals = np.zeros(shape, np.int8)
        slot = np.hstack((path.slot, path.directions.slot))[:, : len(self.names)]
        self.slot = np.where(self.head[:, None], slot[plan.move], -1)

    def _direction_words(self) -> tuple[bytes, ...]:
        return self.program.dialect.direction_words

    def written(self) -> WrittenJoints:
        made = self._drill(self._linear(self.plan.command.copy(), self.rotary_words()))
        edits = [
            *self._replaced(),
            *self._inserted_words(),
            *self._inserted_blocks(),
            made,
            self._straightened(),
        ]
        edits = [part for part in edits if len(part)]
        tails = self._tails()
        parts = np.bincount(self.plan.move[self.head | tails], minlength=len(self.path))
        data = self.program.data
        if not edits:
            return WrittenJoints(None, self.tally, parts)
        text = splice(
            np.frombuffer(data, np.uint8), 0, Edits.join(self._placed(edits)), self.prefixes,
            leading_zero=self.style.leading_zero,
        ).tobytes()  # fmt: skip
        return WrittenJoints(text, self.tally, parts)

    def rotary_words(self) -> Array:
        """(r, axes) the rotary values as they are written, NaN in the other columns."""
        command, drilled = self.plan.command, self.path.holes.strokes[self.plan.move]
        emitted = np.full(command.shape, np.nan)
        for column in np.flatnonzero(self.rotary).tolist():
            emitted[:, column] = self._round(column, command[:, column], drilled)
        self._aim(emitted)
        return emitted

    def _placed(self, edits: list[Edits]) -> list[Edits]:
        """The edits as they are made, beside the marks of the language."""
        return outside(edits, self.program.closings)

    def _starts(self, line: Index) -> tuple[list[bytes], Index]:
        """The different texts before the first word of blocks behind lines, and which of them each has."""
        return self.style.block_starts(line)

    def _ends(self, tails: Index, line: Index, edits: EditList) -> None:
        """What changes at the end of the blocks `tails` of split `line`s."""
        self._inverse_time(tails, edits)
        end_word_edits(self.program, distinct(line), edits)

    def _linear(self, command: Array, emitted: Array) -> Array:
        """Commands whose linear axes meet the position with the rotary ones as written."""
        rows = np.flatnonzero(self.solid)
        if self.path.coordinates.poses:
            # the linear words state the tip, however the tool is turned
            return command
        motion, move = self.path.motion, self.plan.move[rows]
        axes = loads(self.path, self.plan, emitted)[rows]
        axes += 0.5 * motion.width * self.plan.side[rows]
        axes[:, self.rotary] = emitted[rows][:, self.rotary]
        tool = self.path.tool[move]
        command[rows] = motion.programmed(axes, tool, self.path.tip[move])
        return command

    def _aim(self, emitted: Array) -> None:
        """The digits of directions, and the rotary values that they lead to."""
        if not self.led.any():
            return
        words, columns = (
            DirectionWords.of(self.path, self.plan, self.head, emitted),
            slice(len(self.order), None),
        )
        self.write[:, columns] = words.write[:, None]
        self.mantissa[:, columns], self.decimals[:, columns] = words.mantissa, words.decimals
        emitted[np.ix_(self.led, self.rotary)] = words.axes[np.ix_(self.led, self.rotary)]

    def _drill(self, command: Array) -> Edits:
        """The digits of linear axes; returns the edits of cycles, whose strokes have no words."""
        path, plan, holes = self.path, self.plan, self.path.holes
        columns, made = self.path.coordinates.linear.tolist(), EditList(self.prefixes)
        drilled = holes.strokes[plan.move]
        if len(holes):
            row_of = np.searchsorted(plan.move, np.arange(len(path)), "right") - 1
            linear, nominal = command[:, columns], path.end[:, columns]
            usual = np.array([self.style.usual(2, unit) for unit in path.unit.tolist()])
            away = (linear[row_of] - nominal)[:, 2]
            lift = lifted(self.program, holes, away, path.unit, usual, made, self.tally)
            linear = middled(holes, linear, nominal, row_of, self.program.toolpath.frame)
            linear[:, 2] = np.where(drilled, (nominal[:, 2] + lift)[plan.move], linear[:, 2])
            command[:, columns] = linear
        for column in columns:
            command[:, column] = self._round(column, command[:, column], drilled)
        return made.done()

    # -- digits ------------------------------------------------------------------------------------

    def _round(self, column: int, command: Array, drilled: Mask) -> Array:
        """The digits of one axis; returns the positions as written. In the strokes of cycles, `drilled` (r,),
        Z goes where it is commanded, and the other axes stay."""
        path, plan, slot = self.path, self.plan, self.slot[:, column]
        given = slot >= 0
        flag = path.program.toolpath.flag[plan.move]
        nominal = path.end[plan.move, column]
        own = drilled & (self.order[column] == AXES[2])
        turned = self.led & self.rotary[column]
        still = self._stay(slot)
        unit = np.ones(len(slot)) if self.rotary[column] else path.unit[plan.move]
        least, usual, finest = self._places(column, unit)
        rows = AxisRows(
            command=command,
            nominal=np.where(own, command, nominal),
            given=given,
            raw=~self.solid | drilled | turned | still,
            reset=self._set_by_control(column, flag, nominal) | own | turned | still,
            word=np.where(given, self.words.mantissa[slot], 0),
            decimals=np.where(given, self._own_decimals(column, slot, unit), 0).astype(np.int8),
            offset=path.offset[plan.move, column],
            unit=unit,
        )
        counting = (flag & np.uint8(Flag.INCREMENTAL)) != 0
        if not len(slot):
            return command
        first = float(path.start[plan.move[0], column])
        digits: Digits = digits_of(rows, Stretches.of(counting, unit), first, Decimals(least, usual, finest))
        self.write[:, column] = digits.write & self.solid & ~drilled & ~turned & ~still
        self.mantissa[:, column], self.decimals[:, column] = digits.mantissa, digits.decimals
        return digits.emitted

    def _stay(self, slot: Index) -> Mask:
        """(r,) rows whose `slot` states nothing, and which end where no word says."""
        return np.zeros(len(slot), bool)

    def _set_by_control(self, column: int, flag: npt.NDArray[np.uint8], nominal: Array) -> Mask:
        """(r,) rows at which the control makes an axis unknown, or turns it to where it finds it."""
        lost = ((flag & np.uint8(Flag.CONTROL)) != 0) & np.isnan(nominal)
        tilts = [tilt.move for tilt in self.program.tilts]
        if not tilts or not self.rotary[column]:
            return np.asarray(lost, bool)
        turned = is_in(self.plan.move, tilts) & (self.slot[:, column] < 0) & np.isfinite(nominal)
        return np.asarray(lost | turned, bool)

    def _own_decimals(self, column: int, slot: Index, unit: Array) -> Index:
        """Decimals of the words of an axis, with those that a number without a point hides."""
        if not self.rotary[column]:
            return self.style.decimals(slot, AXES.index(self.order[column]), unit)
        hidden = np.rint(-np.log10(self.path.scale[column])).astype(np.int64)
        own = self.words.decimals[slot].astype(np.int64)
        return np.where(self.words.pointed[slot], own, own + hidden)

    def _places(self, column: int, unit: Array) -> tuple[Small, Small, Small]:
        """(r,) the fewest decimals of words of an axis, the usual ones, and those of distances."""
        name = self.order[column]
        if not self.rotary[column]:
            axis = AXES.index(name)
            tables = [
                np.array([places(axis, one) for one in distinct(unit).tolist()])
                for places in (self.style.least, self.style.usual, self.style.grid)
            ]
            which = np.searchsorted(distinct(unit), unit)
            least, usual, finest = (table[which].astype(np.int8) for table in tables)
            return least, usual, finest
        fewest = max(int(self.path.places[column]), 1)
        used = self.path.slot[:, column]
        own = self._own_decimals(column, used[used >= 0].astype(np.int64), unit)
        common = int(np.bincount(own).argmax()) if own.size else 0
        counts = (fewest, max(fewest, common), max(fewest, int(own.max(initial=0))))
        least, usual, finest = (np.full(len(unit), count, np.int8) for count in counts)
        return least, usual, finest

    # -- edits -------------------------------------------------------------------------------------

    def _tails(self) -> Mask:
        """(r,) rows that get a block of their own: a part whose rounded end is where it began needs none."""
        return ~self.head & self.write.any(axis=1)

    def _edit(
        self, rows: Index, column: int, start: Index, end: Index, prefix: Index | int, order: Index | int
    ) -> Edits:
        return Edits.of(start, end, self.mantissa[rows, column], self.decimals[rows, column], prefix, order)

    def _replaced(self) -> list[Edits]:
        edits = []
        for column in range(len(self.names)):
            rows = np.flatnonzero(self.write[:, column] & (self.slot[:, column] >= 0))
            index = self.slot[rows, column]
            edits.append(self._edit(rows, column, self.words.number[index], self.words.end[index], 0, 0))
            self.tally.changed_words += len(rows)
        return edits

    def _letters(self) -> list[int]:
        """The columns in the order in which inserted words are written."""
        axes = sorted(range(len(self.order)), key=lambda column: (self.rotary[column], self.order[column]))
        return [*axes, *range(len(self.order), len(self.names))]

    def _inserted_words(self) -> list[Edits]:
        """Words of axes that a block omits, behind its last coordinate word, in that word's style."""
        missing = self.write & (self.slot < 0) & self.head[:, None]
        rows = np.flatnonzero(missing.any(axis=1))
        if not rows.size:
            return []
        slot = np.hstack((self._leading(), self._arc_slots()))[rows]
        ends = np.where(slot >= 0, self.words.end[slot], -1)
        last = np.take_along_axis(slot, ends.argmax(axis=1)[:, None], axis=1)[:, 0]
        place = ends.max(axis=1).astype(np.int64)
        style = self.style.separators(last, self.program)
        edits = []
        for number, column in enumerate(self._letters()):
            for which in distinct(style[missing[rows, column]]).tolist():
                some = np.flatnonzero(missing[rows, column] & (style == which))
                prefix = self.prefixes(self.style.separator(which, self.names[column]))
                edits.append(self._edit(rows[some], column, place[some], place[some], prefix, number + 1))
                self.tally.inserted_words += len(some)
        return edits

    def _leading(self) -> npt.NDArray[np.int32]:
        """(r, k) the words behind the last of which inserted ones are put."""
        return self.slot

    def _arc_slots(self) -> npt.NDArray[np.int32]:
        """(r, 5) the words of centres, radii and turns of arcs that become straight."""
        curves, slot = self.path.curves, np.full((len(self.head), 5), -1, np.int32)
        if self.plan.straight:
            rows = np.flatnonzero(self.head & curves.mask[self.plan.move])
            slot[rows] = curves.slot[curves.of[self.plan.move[rows]]]
        return slot

    def _straightened(self) -> Edits:
        """What makes blocks of arcs those of straight moves: G1, and no centre, radius or turns."""
        edits, words, curves = EditList(self.prefixes), self.words, self.path.curves
        if not self.plan.straight:
            return edits.done()
        curves.refuse_kept(self.program)
        text, closings = self.program.data, set(self.program.closings.tolist())
        for i in curves.code[curves.code >= 0].tolist():
            start, end = int(words.number[i]), int(words.end[i])
            edits.add(start, end, BARE, 0, text[start : end - 1] + b"1")
        for i in curves.slot[curves.slot >= 0].tolist():
            start, end = int(words.start[i]), int(words.end[i])
            start -= text[start - 1 : start] in (b" ", b"\t")
            edits.add(start, end + (end in closings), BARE, 0)
        made = edits.done()
        self.tally.changed_words += len(made)
        return made

    def _inserted_blocks(self) -> list[Edits]:
        tails = np.flatnonzero(self._tails())
        if not tails.size:
            return []
        line = self.path.line[self.plan.move[tails]].astype(np.int64)
        place = self.program.line_end[line - 1].astype(np.int64)
        starts, which = self._starts(line)
        columns, edits = self._letters(), []
        first = np.argmax(self.write[tails][:, columns], axis=1)
        for number, column in enumerate(columns):
            letter = self.names[column]
            chosen = np.flatnonzero(self.write[tails, column])
            lead = np.array([self.prefixes(start + letter) for start in starts])[which[chosen]]
            begins = first[chosen] == number
            prefix = np.where(begins, lead, self.prefixes(b" " + letter))
            order = tails[chosen] * PLACES + PLACES + number
            at = place[chosen]
            edits.append(self._edit(tails[chosen], column, at, at, prefix, order))
        self.tally.inserted_blocks += len(tails)
        extra = EditList(self.prefixes)
        self._ends(tails, line, extra)
        return [*edits, extra.done()]

    def _inverse_time(self, tails: Index, edits: EditList) -> None:
        """In G93 every part of a block gets its share of the time: F grows by what its path shrinks."""
        flag, plan = self.program.toolpath.flag, self.plan
        timed = tails[(flag[plan.move[tails]] & np.uint8(Flag.INVERSE_TIME)) != 0]
        for move in distinct(plan.move[timed]).tolist():
            rows = np.flatnonzero((plan.move == move) & (self.head | self._tails()))
            line = int(self.path.line[move])
            index = self.style.word(line, "F")
            if index is None:
                raise ProgramError(
                    "this block in G93 has no F word; expected one in every block", line=line, code="OLP561"
                )
            value = float(self.words.mantissa[index]) / 10.0 ** int(self.words.decimals[index])
            share = np.diff(plan.share[rows], prepend=0.0)
            share = np.where(share > 0.0, share, _TAKE_UP_SHARE)
            decimals = max(int(self.words.decimals[index]), _FEED_DECIMALS)
            for row, feed in zip(rows.tolist(), np.rint(value / share * 10**decimals).tolist(), strict=True):
                if self.head[row]:
                    edits.add(int(self.words.number[index]), int(self.words.end[index]), int(feed), decimals)
                else:
                    at = int(self.program.line_end[line - 1])
                    edits.add(at, at, int(feed), decimals, b" F", row * PLACES + 2 * PLACES - 1)
