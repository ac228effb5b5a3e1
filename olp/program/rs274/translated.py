"""What a translation says beside the words of a chunk, carried out while it is read (`translation`)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Index, Mask
from olp.core.errors import ProgramError
from olp.program.rs274.axis_state import AxisState
from olp.program.rs274.codes import INCREMENTAL, TOOL_CHANGE
from olp.program.rs274.flatten.language import UNROLL
from olp.program.rs274.modes import Context
from olp.program.rs274.offset_state import EventBlock
from olp.program.rs274.translation import Drilling, Translation

#: Plane code of the plane across Z.
_XY = 170


class Beside:
    """Actions and cycles of one chunk. `lines` (lines of the chunk,) are those that have some, `calls` those
    whose motion calls a cycle."""

    def __init__(self, translation: Translation, context: Context, state: AxisState, last: int) -> None:
        self._translation, self._context, self._state = translation, context, state
        self.lines = np.zeros(len(context.active), bool)
        self.calls = self.lines.copy()
        own = translation.drillings or translation.counted or translation.of_spindle
        if not (translation.refused or translation.actions or own):
            return
        first = context.chunk.first_line
        refused = self._active(translation.refused, first, last)
        if refused.size:
            raise ProgramError.together(translation.refused[n] for n in (refused + first + 1).tolist())
        self.lines[self._active(translation.actions, first, last)] = True
        self.calls[self._active(translation.drillings, first, last)] = True
        self.lines |= self.calls
        self.lines[self._active(translation.of_spindle, first, last)] = True
        self._counted(self._active(translation.counted, first, last).tolist())

    def _active(self, table: Mapping[int, Any], first: int, last: int) -> Index:
        """The lines of the chunk, from 0, that count and are in a table by line."""
        line = np.sort(np.fromiter(table, np.int64, len(table))) - (first + 1)
        line = line[slice(*np.searchsorted(line, (0, last)))]
        return line[self._context.active[line]]

    def act(self, line: int) -> bool:
        """Carry out the actions of a line of the chunk; whether it has any."""
        number = self._context.number(line)
        actions = self._translation.actions.get(number, ())
        for action in actions:
            action.run(self._state, number)
        return bool(actions)

    def numbered(self, number: int, block: EventBlock) -> EventBlock:
        """The block of a line by its number, with the tool in the spindle in its words for that. Raises
        ProgramError where it is not known."""
        letters = self._translation.of_spindle.get(number, "")
        if not letters:
            return block
        changes, spindle = TOOL_CHANGE in block.m_codes, self._state.spindle
        if changes or spindle is None:
            why = "the tool is changed in this block; divide it" if changes else (
                "this tool is not known; give T and M6 before it, or `tool` in [job_defaults]"
            )  # fmt: skip
            raise ProgramError(
                f"{letters[0]}A is the offset of the tool in the spindle, and {why}",
                line=number,
                code="OLP532",
            )
        words = [replace(w, value=float(spindle)) if w.letter in letters else w for w in block.words]
        return EventBlock.of(words, block.events)

    def forgets(self, line: int) -> bool:
        """Whether an action of a line lets the control move axes by itself."""
        actions = self._translation.actions.get(self._context.number(line), ())
        return any(action.moves(self._state) for action in actions)

    def drilling(self, line: int, *, moves: bool) -> Drilling | None:
        """The cycle that a line calls, where it `moves` or calls it always."""
        drilling = self._translation.drillings.get(self._context.number(line))
        return drilling if drilling is not None and (moves or drilling.always) else None

    @property
    def central(self) -> Index:
        """The lines of the chunk whose centres are absolute, whatever the mode."""
        central = self._translation.central
        first = self._context.chunk.first_line + 1
        return central[slice(*np.searchsorted(central, (first, first + len(self.lines))))] - first

    def _counted(self, active: list[int]) -> None:
        """Blocks whose words say themselves whether they are distances: this has to be what the mode says, as
        the blocks that are inserted behind them follow the mode."""
        context, first = self._context, self._context.chunk.first_line
        for line in active:
            relative, absolute = self._translation.counted[first + line + 1]
            incremental = bool(context.distance[line] == INCREMENTAL)
            if absolute if incremental else relative:
                what = f"{relative[:1]} is a distance in G90"
                if incremental:
                    what = f"{absolute[:1]} is a position in G91"
                raise ProgramError(
                    what,
                    hint=UNROLL,
                    line=context.number(line),
                    code="OLP511",
                )


def check_frames(
    state: AxisState,
    number: Index,
    incremental: Mask,
    plane: npt.NDArray[np.int16],
    frame: npt.NDArray[np.int32],
) -> None:
    """Refuse rows whose meaning depends on machine data of the control, as its profile says. (n,) the lines
    of the rows, whether they are distances, their planes and frames."""
    profile = state.profile
    follow = profile.lengths_follow_plane and not state.setup.machine.lengths_along_z
    if follow and (plane != _XY).any():
        long = np.array([any(f.length_mm) for f in state.frames])[frame]
        bad = np.flatnonzero((plane != _XY) & long)
        if bad.size:
            raise ProgramError(
                "a tool length is in force outside of G17, and machine data say along which axis it counts; "
                "state lengths_along_z = true in the machine file where it is Z",
                line=int(number[bad[0]]),
                code="OLP518",
            )
    if profile.increments_take_offsets and incremental.any():
        before = np.concatenate(([state.last_frame], frame[:-1]))
        for row in np.flatnonzero(incremental & (before != frame) & (before >= 0)).tolist():
            if state.frames[int(before[row])].offset_mm != state.frames[int(frame[row])].offset_mm:
                raise ProgramError(
                    "a distance comes behind a change of offsets, and machine data say whether it counts "
                    "that change too; program a position first",
                    line=int(number[row]),
                    code="OLP518",
                )
    state.last_frame = int(frame[-1])
