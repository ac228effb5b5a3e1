"""The radius of the tool that a program calls, for contours with RL and RR."""

from __future__ import annotations

import re

from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.core.units import MM_PER_INCH
from olp.program.heidenhain.modes import TOOL_CALL
from olp.program.heidenhain.statements import Statement

#: the delta of the radius, behind `=` or `:` or at once; a bare 2 belongs to the name of another delta, DR2
_DELTA = re.compile(
    rb"\bDR[ \t]*[=:]?[ \t]*([-+][ \t]*(?:\d+\.?\d*|\.\d+)|(?!2(?![\d.]))(?:\d+\.?\d*|\.\d+))", re.I
)
_ANY_DELTA = re.compile(rb"\bDR(?!2)", re.I)


class Radius:
    """The tool in the spindle, and its delta in the unit of the program; `setup` has the tool table."""

    def __init__(self, setup: Setup | None) -> None:
        self._setup = setup
        self._tool = None if setup is None else setup.machine.default_tool
        self._name = b""
        self._delta = 0.0
        self._unit_mm = 1.0

    def begin(self, statement: Statement) -> None:
        """Take the unit of a BEGIN PGM."""
        self._unit_mm = MM_PER_INCH if statement.upper.split()[-1] == b"INCH" else 1.0

    def call(self, statement: Statement) -> bool:
        """Take over a TOOL CALL; returns whether the change of the tool may have moved the axes."""
        match = TOOL_CALL.match(statement.text)
        assert match is not None
        delta = _DELTA.search(match["rest"])
        if delta is None and _ANY_DELTA.search(match["rest"]):
            raise ProgramError(
                "TOOL CALL has DR without a number; state it",
                line=statement.line,
                code="OLP516",
            )
        if match["name"] is None and match["number"] is None and delta is None:
            return False
        self._delta = 0.0 if delta is None else float(delta[1].replace(b" ", b"").replace(b"\t", b""))
        if match["number"] is not None:
            self._tool, self._name = int(match["number"]), b""
        elif match["name"] is not None and self._setup is not None:
            self._name = match["name"]
            self._tool = self._setup.tool_named(self._name.decode("latin-1"))
        changed = match["name"] is not None or match["number"] is not None
        return changed and (self._setup is None or bool(self._setup.machine.tool_change_moves))

    def of(self, line: int) -> float:
        """The radius in the unit of the program. Raises ProgramError where it is not known."""
        tool = None
        if self._setup is not None and self._tool is not None:
            tool = self._setup.tool(self._tool)
        if tool is None or tool.radius_mm is None:
            number = "N" if self._tool is None else str(self._tool)
            named = (
                f' "{self._name.decode("latin-1")}"'
                if self._name
                else ""
                if self._tool is None
                else f" {number}"
            )
            raise ProgramError(
                f"the control makes the path of the tool from the radius of tool{named}, which is not known; "
                f"give radius_mm, and wear_mm, in [tools.{number}] of the machine or job file",
                line=line,
                code="OLP513",
            )
        radius = (tool.radius_mm + tool.wear_mm) / self._unit_mm + self._delta
        if radius < 0:
            raise ProgramError(
                "the radius of the tool with DR is negative; correct DR or the tool", line=line, code="OLP513"
            )
        return radius
