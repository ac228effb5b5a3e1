"""Blocks of canned cycles, carried out many at once: series in one frame, with the straight moves between.

What a series keeps goes over from one such run to the next. The strokes of holes are in `strokes`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, is_in
from olp.core.budget import Budget
from olp.core.errors import ProgramError
from olp.core.geometry import PLANES
from olp.core.toolpath import Flag, Kind
from olp.program.directives import Directives
from olp.program.holes import CHANGED, Holes
from olp.program.rs274.axis_state import AxisState
from olp.program.rs274.codes import CYCLES, INVERSE_TIME, RETRACT_TO_R
from olp.program.rs274.collector import Collector
from olp.program.rs274.cycle_runs import CycleRun, Refused
from olp.program.rs274.cycles import HOLE_STROKES, LCNC_CLEARANCE_MM, MOST_REPEATS, levels, repeats_error
from olp.program.rs274.modes import Context, scaled
from olp.program.rs274.motion import fill
from olp.program.rs274.rows import Rows
from olp.program.rs274.state import BROKEN_SERIES, KNOWN_BY, NAN, OPEN_RETRACT, TURNED_SERIES
from olp.program.rs274.strokes import Drilling, Step, Strokes, strokes
from olp.program.rs274.turned import Turning

#: Kinds of the moves of a hole, and steps that are moves.
_RAPID = np.uint8(Kind.RAPID)
_LINE = np.uint8(Kind.LINE)
_FEED = np.uint8(Step.FEED)


class CycleBlocks:
    """Carries blocks of canned cycles out from the position in `state`, and puts their moves and holes into
    `collector`."""

    def __init__(self, state: AxisState, collector: Collector, switches: Directives, budget: Budget) -> None:
        self._state = state
        self._collector = collector
        self._switches = switches
        self._budget = budget
        self._turning: Turning | None = None
        # of the last block of a series its line, from 0 (-1 where none goes on), frame and cycle, and the
        # number of moves after it
        self._line = self._frame = self._code = self._moves = -1

    def leave(self, context: Context, line: int) -> None:
        """Keep for the next chunk whether a series of cycles has ended up to this line, the last one read."""
        if self._line >= 0 and self._ended(context, line + 1):
            self._line = -1

    def _ended(self, context: Context, row: int) -> bool:
        """Whether another motion code came into force between the last block of a cycle and this line."""
        first = max(self._line + 1 - context.chunk.first_line, 0)
        return self._line < 0 or not CYCLES.issuperset(context.motion[first:row].tolist())

    def run(self, context: Context, rows: Rows, some: slice) -> None:
        """Carry out some rows, which are one or more of `runs` with the moves between them. Raises
        ProgramError for the first block that cannot be carried out."""
        state, frame = self._state, int(rows.frame[some.start])
        value = scaled(context, state, self._collector.remarks)
        run = CycleRun.of(context, rows.cycles, rows.blocks.line[some], value)
        refused = Refused(context, run.line)
        self._turning = Turning.of(state.frames[frame].turn)
        self._check_modes(context, run, refused)
        self._begin(context, run, frame, refused)
        drilling = self._drilling(context, run, frame, refused)
        counter = self._counter(run)
        times = self._times(context, run, counter, refused)
        if self._wanting(run):
            refused.all(
                f"a canned cycle starts where an axis has not been commanded yet; {KNOWN_BY}",
                "OLP524",
            )
        for bad, why in drilling.faults():
            refused.where(bad, why)
        # a block that makes too many holes is not laid out
        count = min(refused.row, self._affordable(np.where(times > 0, times, 0) * HOLE_STROKES))
        of = np.repeat(np.arange(count), times[:count])
        of = of[: self._affordable(HOLE_STROKES + drilling.pecks[of])] if refused.row else of[:0]
        end = self._ends(run, rows.blocks.slot[some], frame)
        place, holes = self._places(run, frame, of, end), drilling.pick(of)
        start = np.vstack((self._along(np.array(state.position)), end[run.row[run.first[1:]] - 1]))
        initial, to_r = self._initials(run, drilling, start), context.retract[run.line[of]] == RETRACT_TO_R
        levels = drilling.level(initial)
        made = strokes(holes, start, run.series[of], place, to_r, levels, beside=self._beside())
        # zero repeats make none: the words are kept for the blocks that follow
        if of.size:
            self._spend(made, of, refused)
        refused.raise_first()
        self._collector.holes.append(
            self._holes(context, run, holes, place, of, times, counter, levels, made)
        )
        self._put(context, run, rows, some, end, of, made)
        state.series.go_on(len(run.first) - 1, float(initial[-1]))

    def _wanting(self, run: CycleRun) -> bool:
        """Whether a position is not known and the first block does not state it: in G90 it may state a place
        in the plane."""
        first, second, third = PLANES[run.plane]
        unknown = np.isnan(self._along(np.array(self._state.position)))
        stated = [not run.incremental and run.slot["XYZ"[axis]][0] >= 0 for axis in (first, second)]
        return bool(unknown[third] or (unknown[[first, second]] & ~np.array(stated)).any())

    # -- what a block says -------------------------------------------------------------------------

    def _check_modes(self, context: Context, run: CycleRun, refused: Refused) -> None:
        """Refuse modes in which the control makes no cycle."""
        state, line, name, other = self._state, run.line, run.name, run.other
        if not state.profile.cycles.other_axes:
            refused.where(
                other > 0,
                lambda i: ProgramError(
                    f"{name(i)} moves {chr(other[i])} too, which the control refuses; move it in a block of "
                    "its own",
                    code="OLP518",
                ),
            )
        refused.where(
            np.asarray(context.feed_mode[line] == INVERSE_TIME),
            lambda i: ProgramError(f"{name(i)} is in inverse time (G93); give G94 before it", code="OLP518"),
        )
        if state.compensation is not None:
            refused.all(f"{name(0)} is in cutter compensation; give G40 before it", "OLP518")
        if self._turning is not None and not self._turning.keeps_axis(PLANES[run.plane][2]):
            refused.all(
                f"{name(0)} is in a frame that turns, mirrors or scales its tool axis; end that before it",
                "OLP518",
            )
        open_return = OPEN_RETRACT
        if modes := state.profile.return_modes:
            open_return = f"a canned cycle has no return mode; give {' or '.join(f'M{m}' for m in modes)}"
        refused.where(np.asarray(context.retract[line] < 0), open_return, "OLP532")
        for code, turning in state.profile.cycles.turning.items():
            spindle = " or ".join(f"M{m}" for m in turning)
            still = (run.code == code) & ~is_in(context.spindle[line], turning)
            why = f"the cycle G{code / 10:g} needs a turning spindle; give {spindle} before it"
            refused.where(still, why, "OLP518")

    def _begin(self, context: Context, run: CycleRun, frame_index: int, refused: Refused) -> None:
        """Begin a series with the first of the blocks, or go on with one."""
        state, series, rules = self._state, self._state.series, self._state.profile.cycles
        frame, third = state.frames[frame_index], PLANES[run.plane][2]
        ground, unit = frame.offset_mm[third], frame.unit_mm
        if self._ended(context, int(run.line[0])):
            series.begin((state.position[third] - ground) / unit)
        else:
            before = state.frames[self._frame]
            series.broken |= (before.offset_mm[third], before.unit_mm) != (ground, unit)
            series.broken |= self._moves != self._collector.moves
            if series.broken and not rules.keeps_numbers:
                refused.all(BROKEN_SERIES, "OLP518")
            if self._code != run.code[0] and rules.new_code_forgets:
                series.held = {}
        if state.profile.return_level:
            self._begin_at_level(run, refused)
        self._line, self._frame = context.chunk.first_line + int(run.line[-1]), frame_index
        self._code = int(run.code[-1])

    def _begin_at_level(self, run: CycleRun, refused: Refused) -> None:
        """The series returns to the level that a code of the control states."""
        series, level = self._state.series, self._state.return_level
        if run.incremental:
            refused.all(
                "what a canned cycle in G91 counts from is not known of this control; give G90", "OLP518"
            )
        if level is None:
            refused.all(
                f"a canned cycle has no level to return to; give G{self._state.profile.return_level / 10:g} "
                "with the level before it",
                "OLP532",
            )
        series.initial = NAN if level is None else level

    def _drilling(self, context: Context, run: CycleRun, frame_index: int, refused: Refused) -> Drilling:
        """The numbers of the blocks and those inherited from their series."""
        state, frame, third = self._state, self._state.frames[frame_index], PLANES[run.plane][2]
        depth = "XYZ"[third]
        self._check_levels(run, depth, refused)
        series = state.series
        dwell = run.number("P")
        if (run.slot["P"] >= 0).any():
            bare = state.profile.dwell_s(dwell, pointed=False)
            pointed = context.chunk.pointed[run.slot["P"]]
            dwell = np.where(pointed, state.profile.dwell_s(dwell, pointed=True), bare)
        peck = run.number("Q")
        if letter := state.profile.cycles.first_peck:
            peck = np.where(np.isnan(peck), run.number(letter), peck)
        r, z, q, p = (
            self._inherited(run, letter, given)
            for letter, given in (
                ("R", run.number("R")), (depth, run.number(depth)), ("Q", peck),
                ("P", dwell),
            )
        )  # fmt: skip
        lacking = [("R", np.isnan(r)), (depth, np.isnan(z))]
        refused.where(
            lacking[0][1] | lacking[1][1],
            lambda i: ProgramError(
                f"{run.name(i)} has no "
                f"{' and no '.join(letter for letter, lacks in lacking if lacks[i])} word; give it",
                code="OLP531",
            ),
        )
        r, z = levels(r, z, absolute=not series.incremental, initial_z=self._initial)
        unit = frame.unit_mm
        return Drilling(
            run.code, run.plane, r, z, q, p, LCNC_CLEARANCE_MM / unit, unit, frame.offset_mm[third],
            state.profile.cycles,
        )  # fmt: skip

    def _check_levels(self, run: CycleRun, depth: str, refused: Refused) -> None:
        """Take over the levels that the series has of G90 where G91 is in force now, or the other way round;
        refuse them where what they are then is not known."""
        series, rules = self._state.series, self._state.profile.cycles
        held, own = series.held, run.series == 0
        stated = [run.slot[letter][own] >= 0 for letter in ("R", depth)]
        turned = rules.levels_follow_distance and series.incremental is not run.incremental
        if not turned or held.keys().isdisjoint(("R", depth)) or (stated[0][0] and stated[1][0]):
            series.incremental = run.incremental
        elif not rules.levels_stay or stated[0].any() or stated[1].any():
            refused.all(TURNED_SERIES, "OLP518")
        elif series.incremental:
            r, z = (NAN if (number := held.get(letter)) is None else number for letter in ("R", depth))
            held["R"], held[depth] = levels(r, z, absolute=False, initial_z=self._initial)
            series.incremental = False

    @property
    def _initial(self) -> float:
        """The program coordinate of the tool axis before the series."""
        initial = self._state.series.initial
        return NAN if initial is None else initial

    def _inherited(self, run: CycleRun, letter: str, given: Array) -> Array:
        """(n,) the numbers of a word, those of the blocks before where a block has none; NaN where none."""
        held = self._state.series.held
        before, missing = held.get(letter), np.isnan(given)
        number = np.where(run.series > 0, NAN, NAN if before is None else before)
        if len(run.first) > 1:
            held.pop(letter, None)
        if not missing.all():
            source = np.maximum.accumulate(np.where(missing, -1, np.arange(len(given))))
            known = source >= run.first[run.series]
            number[known] = given[source[known]]
            if known[-1]:
                held[letter] = float(number[-1])
        return number

    def _times(self, context: Context, run: CycleRun, counter: Index, refused: Refused) -> Index:
        """(n,) how many holes each block makes: its L word, or K on ISO controls."""
        if counter.max() < 0:
            return np.ones(len(counter), np.int64)
        times = np.where(counter >= 0, np.rint(context.value[counter]), 1.0)
        if self._state.profile.cycles.stores:
            first, second, _ = PLANES[run.plane]
            placed = np.maximum(run.slot["XYZ"[first]], run.slot["XYZ"[second]]) >= 0
            refused.where(
                (times == 0) & placed,
                "a canned cycle with zero repeats stores its values, and whether it goes to its place is not "
                "known; leave the place out",
                "OLP531",
            )
        least = int(not self._state.profile.cycles.stores)
        refused.where(times < least, "a canned cycle has zero repeats; give one or more", "OLP531")
        refused.where(times > MOST_REPEATS, lambda i: repeats_error(int(times[i])))
        return np.clip(times, 0, 1e9).astype(np.int64)

    def _counter(self, run: CycleRun) -> Index:
        """(n,) the word of each block that counts its holes, -1 where there is none."""
        slot = np.full(len(run.line), -1, np.int64)
        rules = self._state.profile.cycles
        for letter in reversed(rules.repeat_words):
            counts = run.slot[letter] >= 0
            if not counts.any():
                continue
            if rules.first_peck and letter == "K":
                counts &= run.slot[rules.first_peck] < 0
            slot = np.where(counts, run.slot[letter], slot)
        return slot

    # -- the holes ---------------------------------------------------------------------------------

    def _affordable(self, cost: Array | Index) -> int:
        """How many of the first that may be paid for, and one more, which is refused then."""
        return int(np.searchsorted(np.cumsum(cost), self._budget.left, "right")) + 1

    def _ends(self, run: CycleRun, slot: Index, frame_index: int) -> Array:
        """(m, 3) where the rows of runs in G90 end along the words, those of holes in the plane only. `slot`
        (m, 3) are the words."""
        frame, position = self._state.frames[frame_index], self._along(np.array(self._state.position))
        offset = self._along(np.array(frame.offset_mm))
        return fill(slot, run.value, None, offset, frame.unit_mm, position.tolist())

    def _places(self, run: CycleRun, frame_index: int, of: Index, end: Array) -> Array:
        """(h, 2) where holes of blocks (h,) are, along the first and second axis of the plane, of the `end`
        (m, 3) of all rows."""
        plane = list(PLANES[run.plane][:2])
        if not run.incremental:
            return end[run.row[of]][:, plane]
        steps = np.stack([run.number("XYZ"[axis])[of] for axis in plane], axis=1)
        steps *= self._state.frames[frame_index].unit_mm
        before = self._along(np.array(self._state.position))[plane]
        return np.cumsum(np.vstack((before, np.nan_to_num(steps))), axis=0)[1:]

    def _initials(self, run: CycleRun, drilling: Drilling, start: Array) -> Array:
        """(k,) the number of the tool axis before each series, of positions `start` (k, 3) before them."""
        numbers = (start[:, PLANES[run.plane][2]] - drilling.ground) / drilling.unit
        numbers[: None if self._state.profile.return_level else 1] = self._initial
        return numbers

    def _along(self, point: Array) -> Array:
        """A point (3,) of the axes along the words."""
        return point if self._turning is None else self._turning.words(point)

    def _beside(self) -> bool:
        """Whether the tool still is beside the contour that the last move was of: the next one goes to all
        that is programmed, and is one of the cycle."""
        last = self._collector.frame
        of = self._state.frames[last].compensation if last >= 0 else None
        return of is not None and of.radius_mm > 0 and self._state.profile.contours.returns

    def _spend(self, made: Strokes, of: Index, refused: Refused) -> None:
        """Take the work of the holes from the budget, of one after the other."""
        cost = np.cumsum(HOLE_STROKES + np.bincount(made.hole, minlength=len(of)))
        over = int(np.searchsorted(cost, self._budget.left, "right"))
        try:
            self._budget.spend(int(cost[-1]))
        except ProgramError as error:
            refused.where(np.arange(refused.row) == of[over], error.message, error.code)

    def _holes(
        self, context: Context, run: CycleRun, drilling: Drilling, place: Array, of: Index, times: Index,
        counter: Index, levels: Array, made: Strokes,
    ) -> Holes:  # fmt: skip
        """The holes (h,) of blocks `of`; `levels` (k,) are those of the tool axis before the series."""
        chunk, base, line = context.chunk, context.base, run.line[of]
        if self._turning is not None:
            there = np.zeros((len(place), 3))
            there[:, list(PLANES[run.plane][:2])] = place
            place = self._turning.axes(there)[:, list(PLANES[run.plane][:2])]
        moving = made.step <= _FEED
        moves = np.bincount(made.hole[moving], minlength=len(of))
        before = np.cumsum(moves) - moves
        first = self._collector.moves + before + run.straight.searchsorted(run.row[of])
        rest = np.flatnonzero(~moving)
        word, counter = np.stack([run.slot[letter][of] for letter in CHANGED], axis=1), counter[of]
        begin = np.cumsum(times) - times
        return Holes(
            line=(chunk.first_line + 1 + line).astype(np.int32),
            first=first,
            last=first + moves,
            word=np.where(word >= 0, word + base, -1).astype(np.int32),
            counter=np.where(counter >= 0, counter + base, -1).astype(np.int32),
            last_word=(chunk.first_word[line + 1] - 1 + base).astype(np.int32),
            plane=np.full(len(of), run.plane, np.int8),
            place_mm=place,
            r_mm=drilling.level(drilling.r),
            z_mm=drilling.level(drilling.z),
            initial_mm=levels[run.series[of]],
            incremental=np.full(len(of), run.incremental),
            repeat=(np.arange(len(of)) - begin[of]).astype(np.int32),
            repeats=times[of].astype(np.int32),
            series=(self._state.series.count + run.series[of]).astype(np.int32),
            code=run.code[of].astype(np.int32),
            rest_hole=made.hole[rest],
            rest_after=(np.cumsum(moving) - before[made.hole])[rest],
            rest_s=made.seconds[rest],
        )

    def _put(
        self, context: Context, run: CycleRun, rows: Rows, some: slice, end: Array, of: Index, made: Strokes
    ) -> None:
        """Put the moves of holes into the collector, with the straight moves between, of the `end` (m, 3) of
        all rows, and take over the position behind them."""
        moving, deleted = made.step <= _FEED, context.chunk.deleted[run.line]
        point = made.point[moving]
        if self._turning is not None:
            point = self._turning.axes(point)
        line = context.chunk.first_line + 1 + run.line
        flag = np.where(deleted, np.uint8(Flag.CYCLE | Flag.DELETED), np.uint8(Flag.CYCLE))
        flag[self._switches.off(line)] |= np.uint8(Flag.PASS)
        block = of[made.hole[moving]]
        order = np.concatenate((run.straight, run.row[block])).argsort(kind="stable")

        def ordered(straight: npt.NDArray[Any], hole: npt.NDArray[Any]) -> npt.NDArray[Any]:
            return np.concatenate((straight[run.straight], hole))[order]

        end = ordered(end, point)
        self._collector.put_moves(
            ordered(rows.kind[some], np.where(made.step[moving] == _FEED, _LINE, _RAPID)),
            ordered(rows.flag[some], flag[block]), ordered(rows.number[some], line[block]),
            ordered(rows.frame[some], np.full(len(block), rows.frame[some.start])), end,
            ordered(rows.word[some], np.full((len(block), 3), -1)),
        )  # fmt: skip
        self._moves = self._collector.moves
        if len(end):
            self._state.position[:] = end[-1].tolist()
