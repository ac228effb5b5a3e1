"""Tool centre point control of Sinumerik programs: TRAORI, TRAFOOF, and what leads the direction of the tool.

Sources: Siemens, Programming Manual Job Planning, sections on three- to five-axis transformation and on the
reference and interpolation of the orientation.
"""

from __future__ import annotations

from collections.abc import Mapping

from olp.core.errors import ProgramError
from olp.core.machine import ZERO
from olp.core.toolpath import Interpolated
from olp.core.values import dataclass
from olp.program.rs274.axis_state import AxisState
from olp.program.rs274.translation import Action
from olp.program.sinumerik.actions import Edge, outside_contours

#: What each statement leads evenly. Those of the first group count where the program has none of the second.
REFERENCES: Mapping[str, Interpolated] = {"ORIWKS": "vector", "ORIMKS": "axes"}
LEADS: Mapping[str, Interpolated] = {"ORIVECT": "vector", "ORIAXES": "axes"}
#: All statements of this mode.
TIPS = frozenset({"TRAORI", "TRAFOOF", *REFERENCES, *LEADS})


@dataclass(frozen=True, slots=True)
class SwitchTips(Action):
    """TRAORI, and TRAFOOF where it is not `on`: words state the tip, whose length counts along the tool."""

    on: bool

    def run(self, state: AxisState, line: int) -> None:
        offsets = state.offsets
        if self.on == bool(offsets.tip):
            return
        name = "TRAORI" if self.on else "TRAFOOF"
        outside_contours(state, f"{name} is", line)
        if any(offsets.local) or offsets.transform is not None or offsets.plane is not None:
            raise ProgramError(
                f"{name} comes in a programmable frame or a swivelled plane, and machine data say what "
                "becomes of that; program TRANS without values and CYCLE800() before it",
                line=line,
                code="OLP518",
            )
        if state.length_tool is None:
            raise ProgramError(
                f"{name} comes where no edge of the tool is in force, so words do not state its tip; program "
                "D1 before it",
                line=line,
                code="OLP518",
            )
        offsets.tip = (state.leads or state.profile.tips) if self.on else ""
        offsets.directed = self.on
        offsets.length = ZERO
        if not self.on:
            Edge(1).run(state, line)


@dataclass(frozen=True, slots=True)
class Lead(Action):
    """ORIWKS, ORIMKS, ORIVECT and ORIAXES."""

    name: str

    def run(self, state: AxisState, line: int) -> None:
        if self.name in LEADS:
            state.leads, state.leads_stated = LEADS[self.name], True
        elif not state.leads_stated:
            state.leads = REFERENCES[self.name]
        if state.offsets.tip:
            state.offsets.tip = state.leads or state.profile.tips


def tips_action(name: str) -> Action:
    """What a statement of `TIPS` does."""
    return SwitchTips(name == "TRAORI") if name.startswith("TRA") else Lead(name)
