"""The flow of Okuma's user tasks: jumps to labels, CALL with local variables, and RTS."""

from __future__ import annotations

from abc import abstractmethod

from olp.core.errors import ProgramError
from olp.program.rs274.flatten.branches import Branches
from olp.program.rs274.flatten.expressions import filled, whole
from olp.program.rs274.flatten.lines import Flow
from olp.program.rs274.flatten.unit import Frame, Unit
from olp.program.rs274.flatten.values import UNSETTLED


class Tasks(Branches):
    """Carries out these statements; each method has the name of its keyword."""

    @abstractmethod
    def _find(self, label: str, keyword: str, near: Unit) -> tuple[Unit, int]: ...
    @abstractmethod
    def _enter(self, frame: Frame) -> None: ...
    @abstractmethod
    def _leave(self) -> Frame: ...

    def _do_jump(self, flow: Flow, frame: Frame, index: int) -> None:
        if not flow.values or self._true(flow):
            frame.next_index = frame.unit.labelled(flow.label, index)

    def _do_call_task(self, flow: Flow, frame: Frame, index: int) -> None:
        repeats, *values = (filled(value(self.variables)) for value in flow.values)
        count = whole(repeats, "the count Q of CALL")
        if count < 1:
            raise ProgramError(f"CALL has Q{count}; expected 1 or more", code="OLP516")
        arguments = dict(zip(flow.names, values, strict=True))
        unit, start = self._find(flow.label, "program", frame.unit)
        # whether a subprogram sees local variables of its caller is not stated: it may not use these names
        names = dict.fromkeys(frame.names, UNSETTLED) | arguments
        frame.names |= dict.fromkeys(frame.names.keys() & arguments.keys(), UNSETTLED)
        self._enter(Frame(unit, start + 1, flow.label, {}, names, start=start + 1, repeats=count - 1))

    def _do_rts(self, flow: Flow, frame: Frame, index: int) -> None:
        if frame.within == 0:
            raise ProgramError("RTS is outside of a subprogram that CALL runs", code="OLP542")
        if frame.repeats > 0:
            if any(value is not UNSETTLED for value in frame.names.values()):
                raise ProgramError(
                    "whether local variables keep their values in the next repeat of a CALL with Q is not "
                    "known; write the calls one by one",
                    code="OLP541",
                )
            frame.repeats -= 1
            frame.next_index = frame.start
        else:
            self._leave()
