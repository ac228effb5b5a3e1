"""The extruder of a printer: where it is before each move, and which moves feed material.

Its word belongs to a whole move. Where that move is split, the word is shared out, so each part feeds its
share (`olp.compensation.shared_words`).
"""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index, Mask, is_in
from olp.core.values import dataclass
from olp.program.rs274.codes import ABSOLUTE, INCREMENTAL, PRESET
from olp.program.rs274.commands import Commands, last_of_line, own_words
from olp.program.rs274.modes import Context
from olp.program.rs274.motion import modal

#: M82: positions of the extruder are absolute.
_ABSOLUTE_M = 82
#: M83: they are distances.
_RELATIVE_M = 83
_NAN = float("nan")


@dataclass(frozen=True, slots=True, eq=False)
class Extruder:
    """Of the lines of a chunk, what they say of the extruder.

    (lines,) whether they feed material or hold it, the index of its `word` in the chunk or -1, its position
    `before`, and whether the word is a `distance`."""

    feeding: Mask
    word: Index
    before: Array
    distance: Mask


class Extrusion:
    """Follows the extruder chunk by chunk. `position` is where it is, NaN where that is not known."""

    def __init__(self, commands: Commands) -> None:
        self._commands = commands
        self._absolute = self._axes_absolute = 1
        self._position = 0.0

    def follow(self, context: Context, lost: Index) -> Extruder:
        """The extruder on the lines of a chunk. After the lines `lost` its position is not known."""
        chunk = context.chunk
        lines = len(chunk.line_start)
        sets = np.zeros(lines, bool)
        sets[context.codes.line[context.codes.code == PRESET]] = True
        word = last_of_line(chunk, self._commands.extruder, (context.motion >= 0) | sets)
        relative = self._relative(context)
        value = np.where(word >= 0, context.value[word] if len(chunk.letter) else 0.0, 0.0)
        unknown = np.zeros(lines, bool)
        unknown[lost] = True
        step = (word >= 0) & relative & ~sets & ~unknown
        anchor = ((word >= 0) & ~step) | unknown
        value[unknown] = _NAN
        total = np.cumsum(np.where(step, value, 0.0))
        source = np.maximum.accumulate(np.where(anchor, np.arange(lines), -1))
        after = np.where(source >= 0, value[source] + total - total[source], self._position + total)
        before = np.concatenate(([self._position], after[:-1]))
        self._position = float(after[-1]) if lines else self._position
        moved = (word >= 0) & ~sets
        with np.errstate(invalid="ignore"):
            feeding = moved & np.where(step, value >= 0.0, ~(value < before))
        return Extruder(feeding, np.where(sets, -1, word), np.where(step, 0.0, before), step)

    def _relative(self, context: Context) -> Mask:
        """(lines,) whether words of the extruder are distances."""
        chunk = context.chunk
        lines = len(chunk.line_start)
        own = np.flatnonzero(own_words(chunk) & (chunk.letter == ord("M")) & context.active[chunk.line])
        code = context.value[own]
        which = is_in(code, (_ABSOLUTE_M, _RELATIVE_M))
        line, on = chunk.line[own[which]], (code[which] == _ABSOLUTE_M).astype(np.int64)
        distance = is_in(context.codes.code, (ABSOLUTE, INCREMENTAL))
        axes_line = context.codes.line[distance]
        axes_on = (context.codes.code[distance] == ABSOLUTE).astype(np.int64)
        if self._commands.extruder_follows:
            line, on = np.append(line, axes_line), np.append(on, axes_on)
            order = np.argsort(line, kind="stable")
            line, on = line[order], on[order]
            axes_line, axes_on = axes_line[:0], axes_on[:0]
        absolute = modal(lines, line, on, self._absolute)
        axes = modal(lines, axes_line, axes_on, self._axes_absolute)
        if lines:
            self._absolute, self._axes_absolute = int(absolute[-1]), int(axes[-1])
        return np.asarray((absolute == 0) | (axes == 0), bool)
