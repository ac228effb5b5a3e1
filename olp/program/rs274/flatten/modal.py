"""Modal macro calls: a macro that runs after each block that moves, from G66 to G67."""

from __future__ import annotations

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
        """Local variables of the next call. Whether controls set the arguments again is not stated, so those
        that a call has changed are unsettled until they are assigned."""
        last = self.arguments if self.locals is None else self.locals
        changed: dict[int, float | None] = {
            index: UNSETTLED
            for index in last.keys() | self.arguments.keys()
            if last.get(index) != self.arguments.get(index)
        }
        self.locals = self.arguments | changed
        return self.locals


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
