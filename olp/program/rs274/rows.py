"""The motion lines of a chunk of RS-274 text while they are read."""

from __future__ import annotations

from dataclasses import field

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Index, Mask
from olp.core.values import dataclass
from olp.program.rs274.cycle_runs import CycleWords, Ends
from olp.program.rs274.motion import Blocks
from olp.program.rs274.special_blocks import OwnMove


@dataclass(slots=True, eq=False)
class Rows:
    """The motion lines of a chunk (n,) while they are read: how many have a frame, how many a position.
    `present` is the index of the frame in force, None after what may have changed it. `runs` are those of
    canned cycles by their first row, and `cycles` the words of all. `own` are the moves that the control
    makes by itself among the rows that have no position yet.

    What holds for the rows wherever they start is there at once: line `number`, `plane`, `kind` and `flag` of
    the moves, the `word` (n, 3) of each coordinate, and whether these are `incremental`."""

    blocks: Blocks
    frame: npt.NDArray[np.int32]
    runs: dict[int, Ends]
    cycles: CycleWords
    number: Index
    plane: npt.NDArray[np.int16]
    kind: npt.NDArray[np.uint8]
    flag: npt.NDArray[np.uint8]
    word: Index
    incremental: Mask
    assigned: int = 0
    resolved: int = 0
    present: int | None = None
    own: list[OwnMove] = field(default_factory=list)

    def waiting(self, upto: int) -> int:
        """How many moves there are up to a row that are not collected yet."""
        return max(upto - self.resolved, 0) + len(self.own)
