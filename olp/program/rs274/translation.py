"""What a control of this family reads that is more than words: its text in words alone, and actions.

A control with statements of its own has a translator in its profile. It gives the same text in words of this
family, of the same length byte for byte, so that every word is where the program has it. What no word says is
an action of its line.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index
from olp.core.errors import ProgramError
from olp.core.geometry import PLANES
from olp.core.spool import Text
from olp.core.toolpath import Kind
from olp.core.values import dataclass
from olp.program.rs274.axis_state import AxisState
from olp.program.rs274.codes import PLANE_OF

#: Bytes of a text from one up to another.
Span = tuple[int, int]
#: The span of what the text does not have.
NOWHERE: Span = (-1, -1)
_NO_LINES = np.zeros(0, np.int64)


class Action:
    """What a statement does to the state, before the motion of its block."""

    def moves(self, state: AxisState) -> bool:
        """Whether the control moves axes by itself."""
        return False

    def run(self, state: AxisState, line: int) -> None:
        """Carry it out. Raises ProgramError with the line where the state does not allow it."""
        raise NotImplementedError


@dataclass(frozen=True, slots=True)
class Drilling:
    """A cycle that is called behind the motion of blocks: strokes along the tool axis, each a kind of move
    and the program coordinate where it ends. `always`: the block calls it without motion too.

    `text` are the bytes of its call, `levels` those of its numbers, NOWHERE for one that is not stated. They
    say where the tool goes back to, where the hole begins, and where its bottom is.
    """

    name: str
    strokes: tuple[tuple[Kind, float], ...]
    always: bool = False
    text: Span = NOWHERE
    levels: tuple[Span, Span, Span] = (NOWHERE, NOWHERE, NOWHERE)

    def moves(
        self, state: AxisState, place_mm: Array, offset_mm: Array, unit_mm: float
    ) -> tuple[npt.NDArray[np.uint8], Array]:
        """Kinds (k,) and ends (k, 3) of the strokes from a place, along the words."""
        axis = PLANES[PLANE_OF[state.plane]][2]
        ends = np.tile(place_mm, (len(self.strokes), 1))
        ends[:, axis] = [level * unit_mm + offset_mm[axis] for _, level in self.strokes]
        return np.array([kind for kind, _ in self.strokes], np.uint8), ends


@dataclass(frozen=True, slots=True, eq=False)
class Translation:
    """The `text` in words. By line, from 1: why lines are `refused`, their `actions`, the cycles that are
    called behind their motion (`drillings`), and the axis letters that are distances and positions whatever
    G90 and G91 say (`counted`). `central` are lines with absolute centres of arcs, sorted. `closings` are
    bytes of brackets that close behind a number, sorted. `of_spindle` are the letters whose number is that of
    the tool in the spindle."""

    text: Text
    refused: Mapping[int, ProgramError] = field(default_factory=dict)
    actions: Mapping[int, tuple[Action, ...]] = field(default_factory=dict)
    drillings: Mapping[int, Drilling] = field(default_factory=dict)
    counted: Mapping[int, tuple[str, str]] = field(default_factory=dict)
    central: Index = field(default_factory=lambda: _NO_LINES)
    closings: Index = field(default_factory=lambda: _NO_LINES)
    of_spindle: Mapping[int, str] = field(default_factory=dict)
