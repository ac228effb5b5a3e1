"""The columns of a path, collected chunk by chunk: moves and arcs, and at the end their `Toolpath`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index
from olp.core.toolpath import Arcs, Frame, Toolpath
from olp.program.text.columns import Columns


class PathColumns:
    """Without `keep_words` the columns that only writing needs are left out. `moves` counts the moves
    so far, and `frame` is the frame of the last one, -1 before any."""

    def __init__(self, *, keep_words: bool) -> None:
        self.keep_words = keep_words
        self.columns = Columns()
        self.moves = 0
        self.frame = -1

    def put_moves(
        self,
        kind: npt.NDArray[np.uint8],
        flag: npt.NDArray[np.uint8],
        line: npt.ArrayLike,
        frame: npt.ArrayLike,
        end_mm: Array,
        slot: npt.ArrayLike,
    ) -> None:
        """Moves (m,) in order, their ends (m, 3) and the words of these (m, 3)."""
        self.columns.put("kind", kind, np.uint8)
        self.columns.put("flag", flag, np.uint8)
        self.columns.put("line", line, np.int32)
        self.columns.put("frame", frame, np.int32)
        if len(kind):
            self.frame = int(np.asarray(frame)[-1])
        self.columns.put("end", end_mm, np.float64)
        if self.keep_words:
            self.columns.put("slot", slot, np.int32)
        self.moves += len(kind)

    def put_arcs(self, move: Index, centre: Array, plane: Index, sweep: Array) -> None:
        """Arcs (k,): which moves they are, centres (k, 3), planes and angles."""
        self.columns.put("arc_move", move, np.int64)
        self.columns.put("arc_centre", centre, np.float64)
        self.columns.put("arc_plane", plane, np.int8)
        self.columns.put("arc_sweep", sweep, np.float64)

    def toolpath(self, frames: Sequence[Frame], start_mm: tuple[float, float, float]) -> Toolpath:
        """The whole path. Takes the columns: call it once only."""
        take = self.columns.take
        return Toolpath(
            kind=take("kind", np.uint8),
            flag=take("flag", np.uint8),
            line=take("line", np.int32),
            frame=take("frame", np.int32),
            end_mm=take("end", np.float64, 3),
            frames=tuple(frames),
            arcs=Arcs(
                take("arc_move", np.int64), take("arc_centre", np.float64, 3), take("arc_plane", np.int8),
                take("arc_sweep", np.float64),
            ),
            start_mm=start_mm,
        )  # fmt: skip
