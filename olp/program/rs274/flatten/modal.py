"""Modal macro calls: a macro that runs after each block that moves, from G66 to G67."""

from __future__ import annotations

from collections.abc import Mapping

from olp.core.errors import ProgramError
from olp.core.values import dataclass
from olp.program.rs274.codes import CYCLES, HOMES, MACHINE
from olp.program.rs274.flatten.lines import Line
from olp.program.rs274.flatten.state import NO_AXES, ProgramState
from olp.program.rs274.flatten.unit import Unit
from olp.program.rs274.flatten.values import UNSETTLED, Variables

_AXES = frozenset("xyzabcuvw")
_ARC = frozenset("ijkr")
_ARCS = frozenset({20, 30})


@dataclass(slots=True)
class Modal:
    """A macro that is called after each move: where it begins, its label, its count and its arguments.
    `locals` are those of the last call, None before the first."""

    unit: Unit
    start: int
    label: str
    repeats: int
    arguments: dict[int, float | None]
    locals: dict[int, float | None] | None = None

    def called(self) -> dict[int, float | None]:
        """Local variables of the next call."""
        last = self.arguments if self.locals is None else self.locals
        self.locals = self.arguments | unsettled(last, self.arguments)
        return self.locals


def unsettled(
    last: Mapping[int, float | None], arguments: Mapping[int, float | None]
) -> dict[int, float | None]:
    """Local variables that the last call of a macro has changed. Whether controls set the arguments again is
    not stated, so they are unsettled until they are assigned."""
    return {
        index: UNSETTLED
        for index in last.keys() | arguments.keys()
        if last.get(index) != arguments.get(index)
    }


def moves(line: Line, variables: Variables) -> bool:
    """Whether a block that was carried out has moved an axis. ProgramError where it is not clear whether a
    control takes it as a move."""
    state: ProgramState = variables.state
    letters = {w.letter for w in line.words if w.value is None or w.value(variables) is not None}
    arc = state.motion in _ARCS and letters & _ARC
    codes = {round(w.number * 10) for w in line.words if w.letter == "g" and w.value is None}
    if not (letters & _AXES or arc):
        return False
    if state.motion in CYCLES or codes & (HOMES | {MACHINE}):
        raise ProgramError(
            "whether a canned cycle, G28, G30 or G53 calls the macro of G66 is not known; end it with G67 "
            "before this block",
            code="OLP544",
        )
    return not codes & NO_AXES
