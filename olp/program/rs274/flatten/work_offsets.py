"""Variables that have the work offsets: #5221 to #5223 those of G54, and so on in steps of 20."""

from __future__ import annotations

from collections.abc import Sequence

from olp.core.machine import Setup
from olp.program.rs274.codes import METRIC, WRITE_OFFSET
from olp.program.rs274.flatten.state import ProgramState, Value
from olp.program.rs274.flatten.written import number_text

_FIRST = 5221
_STEP = 20
_AXES = "xyz"
#: L of a G10 that states offsets.
_STATES = 2


class WorkOffsets:
    """The work offsets as setup and program state them, by the numbers of their variables."""

    def __init__(self, state: ProgramState, setup: Setup | None) -> None:
        self._state = state
        self._count = state.profile.g10_offsets
        # with the unit in which each is stated; None is the one of the control at the start
        self._known: dict[int, tuple[float, int | None]] = {}
        for number in range(1, self._count + 1) if setup is not None else ():
            name = f"G{53 + number}" if number < 7 else f"G59.{number - 6}"
            offset = None if setup is None else setup.work_offset(name)
            if offset is not None:
                first = _FIRST + _STEP * (number - 1)
                self._known |= {first + k: (mm, METRIC) for k, mm in enumerate(offset.offset_mm)}

    def value(self, index: int) -> float | None:
        """What a variable has, None where it is not known: whether it is converted to another unit differs
        from control to control."""
        value, unit = self._known.get(index, (None, None))
        return value if unit == self._state.unit else None

    def blocks(self, index: int, value: float | None) -> list[str]:
        """Blocks that have the effect of setting a variable in Macro B; none for variables of other use."""
        state = self._state
        number, axis = divmod(index - _FIRST, _STEP)
        sets = state.profile.language.macro_b and state.profile.language.work_offsets
        if not sets or not 0 <= number < self._count or axis >= len(_AXES) or value is None:
            return []
        letter = _AXES[axis].upper()
        text = f"G10 L{_STATES} P{number + 1} {letter}{number_text(value, 'x', state.profile.language)}"
        return [text] if state.absolute else ["G90", text, "G91"]

    def follow(self, words: Sequence[Value]) -> None:
        """Take the words of a block: G10 L2 in G90 states offsets, other G10 leave all of them unknown."""
        state = self._state
        if WRITE_OFFSET not in state.codes(words):
            return
        given = dict(words)
        number = given.get("p") or 0.0
        if given.get("l") != _STATES or not state.absolute or number not in range(1, self._count + 1):
            self._known.clear()
            return
        for axis, letter in enumerate(_AXES):
            if letter in given:
                index = _FIRST + _STEP * (int(number) - 1) + axis
                value = given[letter]
                self._known.pop(index, None)
                if value is not None:
                    self._known[index] = (value, state.unit)
