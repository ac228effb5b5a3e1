"""The path of a program in all axes of a machine: linear columns as they were read, rotary ones beside
them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from olp.compensation.joints.curves import Curves
from olp.compensation.joints.directed import Directions
from olp.compensation.joints.drilled import Drilled
from olp.compensation.joints.motion import Motion
from olp.compensation.joints.posed import refuse_poses, unreached
from olp.compensation.joints.refused import KEPT, refuse_tips, refuse_unread
from olp.compensation.joints.sampling import Resolution
from olp.compensation.joints.tilts import (
    found_positions,
    refuse_lengths,
    refuse_off_normal,
    stands_before,
    stated_afresh,
)
from olp.compensation.style import fewest_decimals
from olp.core.arrays import Array, Index, Mask
from olp.core.errors import ConfigError, NotInvertible, ProgramError
from olp.core.machine import ZERO, Machine, Vector
from olp.core.toolpath import Flag, Kind, Toolpath, Touch
from olp.core.turns import turned
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.kinematics.coordinates import Coordinates
from olp.kinematics.errors import MachineErrors
from olp.kinematics.structure import Structure
from olp.program.pointlist.axis_list import AxisList
from olp.program.program import Program
from olp.program.rs274.rotary import RotaryWords

#: Decimals of an axis that states no least increment.
_UNSTATED_DECIMALS = 6


@dataclass(frozen=True, slots=True, eq=False)
class JointPath:
    """The moves of a program in all axes, columns by move.

    (n, axes) `start` and `end` are programmed `coordinates`, mm and deg, NaN where unknown. In a turned frame
    they are along its words. The linear ones state the tip where `tip` (n,), else they are axis values. In
    `vector` (n,) the direction of the tool goes evenly, else each axis. `slot` (n, axes) are their words, -1
    where there is none. `tool` is the place of the tool in `motion`, `shift_mm` (n, 3) where the part really
    lies. `offset` (n, axes), `unit` (n,) and, of words without a point, `scale` (axes,) lead from words to
    coordinates. `feed` are moves that cut, `judged` those that the proof judges, `kept` moves that stay
    uncorrected. `held` (n,) are moves whose rotary axes stay as programmed: where these stand, tool centre
    point control begins, a tilted plane is fixed to them, or a hole is made. In the last two no word of
    theirs changes: these moves `stay` (n,). `places` (axes,) are the fewest decimals of words in mm and deg.
    `holes` are those of cycles, `directions` those that words state, `curves` the arcs, `listed` the rows of
    a list of axis values."""

    program: Program
    motion: Motion
    coordinates: Coordinates
    start: Array
    end: Array
    slot: npt.NDArray[np.int32]
    tool: Index
    tip: Mask
    vector: Mask
    shift_mm: Array
    offset: Array
    unit: Array
    scale: Array
    feed: Mask
    judged: Mask
    kept: Mask
    held: Mask
    stay: Mask
    places: Index
    holes: Drilled
    directions: Directions
    curves: Curves
    listed: AxisList | None = None

    def __len__(self) -> int:
        return len(self.end)

    @property
    def line(self) -> npt.NDArray[np.int32]:
        return self.program.toolpath.line

    def at(self, move: Index, share: Array) -> Array:
        """(r, axes) programmed coordinates at shares of moves."""
        place = self.between(self.start[move], self.end[move], share, move)
        return self.curves.along(place, move, share)

    def axes(self, move: Index, programmed: Array) -> Array:
        """(r, axes) axis values of coordinates of moves, NaN where unknown. Where not all coordinates are
        known, words of rotary axes state theirs all the same."""
        known = np.isfinite(programmed).all(axis=1)
        axes = np.full((len(move), len(self.motion.structure.order)), np.nan)
        axes[known] = self.motion.axes(programmed[known], self.tool[move[known]], self.tip[move[known]])
        if not self.coordinates.poses:
            alone = np.ix_(~known, self.coordinates.rotary)
            axes[alone] = programmed[alone]
        return axes

    def commanded(self, move: Index, share: Array, axes: Array) -> Array:
        """(r, axes) coordinates that state axis values at shares of moves, next to the programmed ones."""
        found = self.motion.programmed(axes, self.tool[move], self.tip[move])
        return self.coordinates.beside(found, self.at(move, share)) if self.coordinates.poses else found

    def between(self, start: Array, end: Array, share: Array, move: Index) -> Array:
        """(r, axes) coordinates at shares of ways from `start` to `end`, led as in moves. Raises ProgramError
        where the tool has directions there that are not reached."""
        try:
            return self.motion.between(start, end, share, self.tool[move], self.vector[move])
        except NotInvertible as error:
            assert error.row is not None
            raise unreached(int(self.line[move[error.row]])) from None

    def singular(self, axes: Array) -> str:
        """Words on a singular posture that axis values (axes,) are near; empty where they are near none."""
        return ""

    def samples(self, move: Index, begin: Array, end: Array, share: Array | float = 1.0) -> Index:
        """(r,) how many samples lie on stretches of moves between axis values; they take `share` of these."""
        straight = Resolution.of(self.motion).samples(begin, end)
        return np.maximum(straight, self.curves.samples(move, share))

    @staticmethod
    def of(
        program: Program, structure: Structure, errors: MachineErrors, machine: Machine, *,
        rotated: Mapping[str, Mapping[str, float]], start_deg: Mapping[str, float],
        tips_from_zero: bool | None = None, swivel_axis: str = "",
    ) -> JointPath:  # fmt: skip
        """The path of a program that was read with its words. `rotated` are the rotary values of work
        offsets, `start_deg` those at the start, `tips_from_zero` and `swivel_axis` as in `JointMachine`.
        Raises ProgramError for what is not read on such a machine."""
        refuse_unread(program)
        path, holes = program.toolpath, Drilled.of(program)
        words = Coordinates.of_words(structure)
        order = words.names
        letters = [name for name, unit in zip(order, words.units, strict=True) if unit == "deg"]
        rotary = RotaryWords.none(len(path), len(letters))
        if program.in_blocks:
            rotary = RotaryWords.of(program, letters, machine)
        turns = [
            [rotated.get(frame.work_offset, {}).get(letter, 0.0) for letter in letters]
            for frame in path.frames
        ]
        offsets = np.array(turns, float).reshape(len(path.frames), len(letters))
        first = np.array([start_deg.get(letter, np.nan) for letter in letters])
        degrees, directions = _degrees(program, structure, letters, rotary, first, offsets, swivel_axis)
        tip, vector, fixed = _modes(path, words)
        end, slot = np.empty((len(path), len(order))), np.full((len(path), len(order)), -1, np.int32)
        offset, scale = np.zeros(end.shape), np.ones(len(order))
        linear = np.array([frame.offset_mm for frame in path.frames]).reshape(-1, 3)[path.frame]
        for column, name in enumerate(order):
            if name in letters:
                own = letters.index(name)
                end[:, column], slot[:, column] = degrees[:, own], rotary.slot[:, own]
                offset[:, column], scale[column] = offsets[path.frame, own], rotary.scale[own]
            else:
                own = AXES.index(name)
                end[:, column], slot[:, column] = path.end_mm[:, own], program.slot[:, own]
                offset[:, column] = linear[:, own]
        columns = words.linear.tolist()
        tools = list(dict.fromkeys((frame.tool_mm, frame.turn) for frame in path.frames)) or [(ZERO, None)]
        motion = Motion.of(structure, errors, tools)
        tool_of = np.array([tools.index((frame.tool_mm, frame.turn)) for frame in path.frames] or [0])
        matrices = path.turns()
        if matrices is not None:
            inverse = matrices.inverse[matrices.of_frame[path.frame]]
            end[:, columns] = turned(inverse, end[:, columns])
            offset[:, columns] = turned(inverse, offset[:, columns])
        unit = np.array([frame.unit_mm for frame in path.frames] or [1.0])[path.frame]
        given = slot[:, columns] >= 0
        for move, axis, _ in program.levels:
            given[move, axis] = True
        if fixed.any():
            refuse_lengths(program, fixed, given)
            stated = _words(program, slot[:, columns]) * unit[:, None] + offset[:, columns]
            for move, axis, level_mm in program.levels:
                stated[move, axis] = level_mm
            end[:, columns] = np.where(fixed[:, None], stated, end[:, columns])
        given[holes.strokes, 2] = True
        elsewhere = tip & ((path.flag & np.uint8(Flag.MACHINE)) != 0)
        mode = tip + 2 * elsewhere + 4 * fixed
        fresh = stated_afresh(program, fixed, degrees)
        end[:, columns] = _stated_in_mode(end[:, columns], given, mode, elsewhere, fresh)
        refuse_tips(program, structure, tip & ~fixed & (not words.poses), end, offset, tips_from_zero)
        pairs = zip(path.frames, offsets, strict=True)
        shifts = [_shift(structure, errors, frame.touched, row, words) for frame, row in pairs]
        tool = tool_of[path.frame]
        refuse_poses(program, words, motion, end, tool, holes)
        kept = (path.flag & KEPT) != 0
        arc = np.zeros(len(path), bool)
        arc[path.arcs.move] = True
        feed = ((path.kind == Kind.LINE) | arc) & ~kept
        start = _starts(motion, words, end, tool, tip, np.array(path.start_mm), start_deg)
        refuse_off_normal(program, structure, fixed, feed, start, end)
        curves = Curves.of_program(program, start, end, columns, kept)
        stay = stands_before(fixed | holes.whole, feed, degrees)
        held = np.append(tip[1:] & ~tip[:-1], False)[: len(tip)] | stay
        return JointPath(
            program, motion, words, start, end, slot, tool, tip, vector,
            np.array(shifts).reshape(-1, 3)[path.frame], offset, unit, scale, feed, feed, kept, held, stay,
            _places(words), holes, directions, curves,
        )  # fmt: skip

    @staticmethod
    def of_list(
        rows: AxisList, structure: Structure, errors: MachineErrors, tools: Mapping[int, Vector]
    ) -> JointPath:
        """The path of a list of axis values. `tools` are vectors by number, that of -1 counts where a row
        states none. Raises ProgramError for tools that are not there."""
        count, axes = rows.values.shape
        line = rows.program.toolpath.line
        for number, at in zip(rows.tool.tolist(), line.tolist(), strict=True):
            if number not in tools:
                known = ", ".join(str(tool) for tool in tools if tool >= 0) or "none"
                raise ProgramError(
                    f"tool {number} has no vector gauge_to_tip_mm; the tools that have one: {known}",
                    line=at,
                    code="OLP504",
                )
        motion = Motion.of(structure, errors, [(vector, None) for vector in tools.values()])
        columns = Coordinates.of_axes(structure)
        places = {number: place for place, number in enumerate(tools)}
        feed = np.full(count, rows.joined)
        feed[:1] = False
        none = np.zeros(count, bool)
        return JointPath(
            rows.program, motion, columns,
            np.vstack((np.full((1, axes), np.nan), rows.values[:-1])), rows.values,
            np.full((count, axes), -1, np.int32), np.array([places[n] for n in rows.tool.tolist()]),
            none, none, np.zeros((count, 3)), np.zeros((count, axes)), np.ones(count), np.ones(axes),
            feed, ~none, none, none, none, _places(columns), Drilled.none(count),
            Directions.none(count), Curves.none(count), rows,
        )  # fmt: skip


def _places(words: Coordinates) -> Index:
    """(axes,) the fewest decimals of words: those of the least increments, where they are stated."""
    return np.array(
        [fewest_decimals(step, 1.0, 0) if step > 0.0 else _UNSTATED_DECIMALS for step in words.steps]
    )


def _starts(
    motion: Motion, words: Coordinates, end: Array, tool: Index, tip: Mask, start_mm: Array,
    start_deg: Mapping[str, float],
) -> Array:  # fmt: skip
    """(n, axes) coordinates at the start of each move, in the mode and with the tool of the move itself."""
    if not len(end):
        return end
    first = np.array([start_deg.get(name, np.nan) for name in words.names])
    first[words.linear] = start_mm
    start = np.vstack((first, end[:-1]))
    before_tip, before_tool = np.append(False, tip[:-1]), np.append(tool[:1], tool[:-1])
    start[:1] = motion.programmed(start[:1], tool[:1], before_tip[:1])
    turns = np.array([turn is not None for turn in motion.turns])
    other = (tip | turns[tool] | turns[before_tool]) & (before_tool != tool)
    changed = np.flatnonzero((before_tip != tip) | other)
    changed = changed[np.isfinite(start[changed]).all(axis=1)]
    axes = motion.axes(start[changed], before_tool[changed], before_tip[changed])
    stated = motion.programmed(axes, tool[changed], tip[changed])
    start[changed] = words.beside(stated, start[changed])
    return np.asarray(start)


def _words(program: Program, slot: npt.NDArray[np.int32]) -> Array:
    """(n, 3) the numbers of linear words, NaN where there is none."""
    words = program.words
    assert words is not None
    return np.where(slot >= 0, words.mantissa[slot] / 10.0 ** words.decimals[slot], np.nan)


def _stated_in_mode(end: Array, given: Mask, mode: Index, elsewhere: Mask, fresh: Mask) -> Array:
    """(n, 3) linear coordinates, NaN until they are stated after a change between axis values and tips, or in
    a tilted plane that is `fresh` (n,). `elsewhere` (n,) states machine positions while tips are stated."""
    changes = np.append(True, mode[1:] != mode[:-1])[: len(mode)] | fresh
    if not changes[1:].any() and not elsewhere.any() and not fresh.any():
        return end
    order = np.arange(len(end))
    began = np.maximum.accumulate(np.where(changes, order, -1))
    stated = np.maximum.accumulate(np.where(given, order[:, None], -1), axis=0)
    first = (began == 0) & ~fresh[:1].any()
    in_plane = (mode & 4) != 0
    last = np.take_along_axis(end, np.maximum(stated, 0), axis=0)
    kept = ((stated >= began[:, None]) | first[:, None]) & ~elsewhere[:, None]
    return np.where(kept, np.where(in_plane[:, None], last, end), np.nan)


def _modes(path: Toolpath, words: Coordinates) -> tuple[Mask, Mask, Mask]:
    """(n,) moves whose words state the tip, along which the tool turns as a vector, and that are in a
    tilted plane."""
    modes = [frame.tip for frame in path.frames]
    tip = np.array([words.poses or mode != "" for mode in modes], bool)[path.frame]
    vector, fixed = (
        np.array([mode == one for mode in modes], bool)[path.frame] for one in ("vector", "fixed")
    )
    return tip, vector, fixed


def _degrees(
    program: Program, structure: Structure, letters: list[str], rotary: RotaryWords, first: Array,
    offsets: Array, swivel_axis: str,
) -> tuple[Array, Directions]:  # fmt: skip
    """(n, letters) the rotary values of all moves, from `first` (letters,) on, and the directions of the tool
    that the program states. Raises ProgramError for what is not read."""
    found = found_positions(program, structure, letters, swivel_axis)
    degrees = rotary.follow(program, first, offsets, found)
    directions = Directions.of(program, rotary)
    directions.refuse_other_axes(program, structure)
    if directions.stated.any():
        since = np.vstack((first, degrees))
        found = directions.positions(program, structure, letters, rotary, found, since)
        degrees = rotary.follow(program, first, offsets, found)
    rotary.refuse_ways(program, degrees)
    return degrees, directions


def _shift(
    structure: Structure, errors: MachineErrors, touched: Touch | None, turned: Array, words: Coordinates
) -> Vector:
    """Where the part lies from where its offset says, in workpiece coordinates."""
    if touched is None:
        return (0.0, 0.0, 0.0)
    position, tool = touched
    values = np.zeros((1, len(words.names)))
    values[0, words.linear], values[0, words.rotary] = position, turned
    motion = Motion.of(structure, errors, [((tool[0], tool[1], tool[2]), None)])
    try:
        axes = motion.axes(values, np.zeros(1, np.int64), np.array([words.poses]))
    except NotInvertible:
        raise ConfigError(
            "a work offset was set by touching where no axis values bring the tool to; expected "
            'set_by = "true" in its table, or the machine position where the tool touched'
        ) from None
    x, y, z = motion.machines[0].deviation(axes)[0][0].tolist()
    return (x, y, z)
