"""Parameters of LinuxCNC that have the tool in the spindle and the work offset in force.

#5400 is the number of the tool, #5401 to #5403 are its lengths, #5410 is its diameter, all of the tool table.
#5220 counts the work offset from 1 for G54. `_current_tool`, `_selected_tool` and `_coord_system` are names
of such values. What M61 leaves there is not followed. Source: LinuxCNC's manual, "Parameters".
"""

from __future__ import annotations

from collections.abc import Sequence

from olp.core.machine import Setup, Tool
from olp.program.rs274.codes import METRIC, WORK_OFFSETS, WRITE_OFFSET
from olp.program.rs274.flatten.state import ProgramState, Value

_NUMBER = 5400
_LENGTHS = range(5401, 5404)
_DIAMETER = 5410
_OFFSET = 5220
#: codes of the work offsets, ten times their numbers, in the order in which #5220 counts them
_CODES = (540, 550, 560, 570, 580, 590, 591, 592, 593)
_NAMES = {"_current_tool": _NUMBER, "_coord_system": _OFFSET}


class ToolVariables:
    """The tool and the work offset as setup and program state them; none is known without `setup`."""

    def __init__(self, state: ProgramState, setup: Setup | None) -> None:
        self._state = state
        self._setup = setup
        self._selected: float | None = None
        self._tool: float | None = None
        self._code: int | None = None
        #: whether the tool table is the one of the setup
        self._table = True
        if setup is not None:
            self._tool = setup.machine.default_tool
            name = setup.machine.default_work_offset
            self._code = next((code for code in _CODES if f"G{code / 10:g}" == name), None)

    def follow(self, words: Sequence[Value], *, switched: bool) -> None:
        """Take the words of a block; of one that may be left out what it states is not known."""
        if self._setup is None:
            return
        codes = self._state.codes(words)
        self._table &= WRITE_OFFSET not in codes
        chosen = codes & WORK_OFFSETS
        if chosen:
            code = next(iter(chosen))
            self._code = code if code in _CODES and not switched else None
        for letter, value in words:
            if letter == "t":
                self._selected = None if switched else value
        for word in words:
            if word == ("m", 6):
                self._tool = None if switched else self._selected
            elif word == ("m", 61):
                self._tool = None

    def value(self, index: int) -> float | None:
        """What a parameter has, None where it is not known. The unit of lengths is that of the tool table,
        and a program in inches may be of a machine in inches."""
        if index == _NUMBER:
            return self._tool
        if index == _OFFSET:
            return None if self._code is None else float(_CODES.index(self._code) + 1)
        tool = self._of_table()
        if tool is None or self._state.unit != METRIC:
            return None
        if index in _LENGTHS:
            return tool.length_mm[index - _LENGTHS.start]
        if index == _DIAMETER and tool.radius_mm is not None:
            return 2.0 * (tool.radius_mm + tool.wear_mm)
        return None

    def named(self, name: str) -> float | None:
        """What a name has, None where it is not known or is none of these."""
        if name == "_selected_tool":
            return self._selected
        if name == "_coord_system":
            return None if self._code is None else float(self._code)
        return self.value(_NAMES[name]) if name in _NAMES else None

    def _of_table(self) -> Tool | None:
        if self._setup is None or self._tool is None or not self._table:
            return None
        return self._setup.tool(int(self._tool))
