"""What is collected while a program is read: word, move and arc columns, holes and remarks; at the end the
`Program`.

Nothing here interprets; indices of words count over the whole text (`Context.base` leads from a chunk there).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask
from olp.core.errors import ProgramError
from olp.core.spool import Text
from olp.core.toolpath import Toolpath
from olp.program.holes import Holes
from olp.program.path_columns import PathColumns
from olp.program.program import ArcSlots, Called, Program, SharedWords, Words
from olp.program.rs274.axis_state import AxisState
from olp.program.rs274.extrusion import Extruder
from olp.program.rs274.lexer import WordChunk
from olp.program.text.columns import Packed


class Collector(PathColumns):
    """The columns of one program while it is read. Without `keep_words` those that only writing needs are
    left out.

    `moves` and `word_count` count the moves and words so far, `start` is the axis position before the first
    move. `remarks` leads from a name to the first line of it and a text.
    """

    def __init__(self, data: Text, start: tuple[float, float, float], *, keep_words: bool) -> None:
        super().__init__(keep_words=keep_words)
        self.data = data
        self.start = start
        self.word_count = 0
        self.holes: list[Holes] = []
        self.called: list[tuple[int, ...]] = []
        self.levels: list[tuple[int, int, float]] = []
        self.remarks: dict[str, tuple[int, str]] = {}

    def put_words(self, chunk: WordChunk) -> None:
        self.columns.put("line_start", chunk.line_start, np.int32)
        self.columns.put("line_end", chunk.line_end - chunk.line_start, np.int32)
        if self.keep_words:
            for name in ("letter", "mantissa", "decimals", "pointed"):
                column = getattr(chunk, name)
                self.columns.put(name, column, column.dtype)
            self.columns.put("word_start", chunk.start, np.int32)
            for name in ("number", "end"):
                self.columns.put("word_" + name, getattr(chunk, name) - chunk.start, np.int32)
            self.columns.put("first_word", chunk.first_word[:-1] + self.word_count, np.int32)
        self.word_count += len(chunk.letter)

    def put_worded_arcs(
        self, move: Index, centre: Array, plane: Index, sweep: Array, words: Index, absolute: Mask
    ) -> None:
        self.put_arcs(move, centre, plane, sweep)
        self.columns.put("arc_words", words, np.int32)
        self.columns.put("arc_absolute", absolute, np.bool_)

    def put_shared(self, extruder: Extruder, base: int) -> None:
        """The words of the extruder on the next lines, whose first word is the program's `base`th."""
        if self.keep_words:
            word = extruder.word
            self.columns.put("shared_word", np.where(word >= 0, word + base, -1), np.int32)
            self.columns.put("shared_before", extruder.before, np.float64)
            self.columns.put("shared_distance", extruder.distance, np.bool_)

    def program(self, state: AxisState, end_line: int, closings: Index) -> Program:
        """The whole program, with the frames and path modes of the final `state`. Takes the columns: call it
        once only."""
        path = self.toolpath(state.frames, self.start)
        line_start, line_end = self._line_bounds()
        return Program(
            data=self.data,
            dialect=state.profile,
            toolpath=path,
            words=self._words() if self.keep_words else None,
            slot=self.columns.take("slot", np.int32, 3),
            arc_slots=ArcSlots(
                self.columns.take("arc_words", np.int32, 5), self.columns.take("arc_absolute", np.bool_)
            ),
            line_start=line_start,
            line_end=line_end,
            captures=tuple(state.captures),
            path_modes=tuple(state.path_modes),
            holes=Holes.join(self.holes),
            called=Called.of(self.called),
            levels=tuple(self.levels),
            remarks=tuple((name, line, text) for name, (line, text) in self.remarks.items()),
            end_line=end_line,
            calculator=not state.bare_increments,
            shared=SharedWords(
                self.columns.take("shared_word", np.int32),
                self.columns.take("shared_before", np.float64),
                self.columns.take("shared_distance", np.bool_),
            ),
            closings=closings,
            tilts=tuple(replace(tilt, move=_move_at(path, tilt.line)) for tilt in state.tilts),
        )

    def _line_bounds(self) -> tuple[npt.NDArray[np.int32], Packed]:
        """(lines,) where each line begins, and where its text ends."""
        start: npt.NDArray[np.int32] = self.columns.take("line_start", np.int32)
        return start, self.columns.packed("line_end", start)

    def _words(self) -> Words:
        self.columns.put("first_word", [self.word_count], np.int32)
        take, packed = self.columns.take, self.columns.packed
        start = take("word_start", np.int32)
        return Words(
            take("letter", np.uint8), packed("mantissa"), take("decimals", np.int8),
            take("pointed", np.bool_), start, packed("word_number", start), packed("word_end", start),
            take("first_word", np.int32),
        )  # fmt: skip


def _move_at(path: Toolpath, line: int) -> int:
    """The move that the control makes by itself on a line. Raises ProgramError where no move is before it."""
    move = int(np.searchsorted(path.line, line))
    if move == len(path) or path.line[move] != line:
        raise ProgramError(
            "the control turns rotary axes here before the first move; program a position before it",
            line=line,
            code="OLP524",
        )
    return move
