"""Rows of the plan on their way into text: where each leads as written, and the digits that say so."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from olp.compensation.digits import Digits
from olp.core.arrays import Array, Index, Mask
from olp.core.toolpath import Flag

if TYPE_CHECKING:
    from olp.compensation.writer import Writer



@dataclass(slots=True, eq=False)
class Rows:
    """Rows of the plan on their way into text. `head` marks the row that keeps its block's own line."""

    first: int
    move: npt.NDArray[np.int32]
    head: Mask
    flag: npt.NDArray[np.uint8]
    emitted: Array
    entry: Array
    write: Mask
    mantissa: Index
    decimals: npt.NDArray[np.int8]
    before: Mask = field(default_factory=lambda: np.zeros(0, bool))

    def serial(self, row: int) -> int:
        """Order of a row's words among insertions at one place."""
        return row * 8 + 16

    def number(self, writer: Writer, row: int, axis: int) -> tuple[int, int]:
        """Mantissa and decimals that say where the axis is after the row, whether or not it changes."""
        if self.write[row, axis] or self.flag[row] & np.uint8(Flag.INCREMENTAL):
            return int(self.mantissa[row, axis]), int(self.decimals[row, axis])
        frame = writer.frame_of(int(self.move[row]))
        decimals = writer.style.usual(axis, frame.unit_mm)
        value = (self.emitted[row, axis] - frame.offset_mm[axis]) / frame.unit_mm
        return round(value * 10**decimals), decimals

    def put(self, a: int, b: int, axis: int, digits: Digits) -> None:
        self.emitted[a:b, axis] = digits.emitted
        self.write[a:b, axis] = digits.write
        self.mantissa[a:b, axis] = digits.mantissa
        self.decimals[a:b, axis] = digits.decimals
