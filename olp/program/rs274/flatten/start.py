"""Where the axes of a program of LinuxCNC stand before it moves them, in its own coordinates.

The job states axis positions (`start_mm`). Less the work offset in force they are positions of the program,
as long as no tool length and no further shift is in force. An axis keeps its place until something moves it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence, Set

from olp.core.machine import Setup
from olp.core.units import AXES
from olp.program.rs274.codes import (
    CUTTER_COMPENSATION,
    DWELL,
    HOMES,
    LENGTHS,
    PROBES,
    SHIFTS,
    WORK_OFFSETS,
    WRITE_OFFSET,
)
from olp.program.rs274.state import NAN

#: G49, which changes nothing where no length is in force.
_LENGTH_OFF = 490
#: Behind these, words and axes no longer differ by the work offset alone, or axes have moved.
_ENDS = (LENGTHS - {_LENGTH_OFF}) | SHIFTS | HOMES | PROBES | CUTTER_COMPENSATION | {WRITE_OFFSET, 281, 301}


class Start:
    """The axes at the start, in mm; NaN where one has moved or is not known."""

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        self._frame = setup.machine.default_work_offset
        known = setup.machine.located and not setup.machine.length_active
        self._axes = [NAN if mm is None or not known else mm for mm in setup.job.start_mm]

    def position_mm(self, axis: int) -> float:
        """The position of an axis in program coordinates, in mm; NaN where it is not known."""
        offset = self._setup.work_offset(self._frame)
        if offset is None or any(offset.rotation_deg):
            return NAN
        return self._axes[axis] - offset.offset_mm[axis]

    def follow(self, codes: Set[int], words: Sequence[tuple[str, float | None]], *, cycle: bool) -> None:
        """Take a block: what it moves no longer stands at the start. `cycle`: a canned cycle is in force."""
        letters = {letter for letter, _ in words}
        if cycle or codes & _ENDS or letters & {"@", "^"}:
            self.moved(range(3))
        elif DWELL not in codes:
            self.moved(axis for axis in range(3) if AXES[axis].lower() in letters)
        for code in codes & WORK_OFFSETS:
            self._frame = f"G{code / 10:g}"

    def moved(self, axes: Iterable[int]) -> None:
        """These axes may stand elsewhere from here on."""
        for axis in axes:
            self._axes[axis] = NAN
