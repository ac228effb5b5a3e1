"""Loops and branches of a parametric program: which line of its level comes next."""

from __future__ import annotations

from olp.core.errors import ProgramError
from olp.program.rs274.flatten.expressions import filled, whole
from olp.program.rs274.flatten.language import Language
from olp.program.rs274.flatten.lines import Flow
from olp.program.rs274.flatten.unit import Frame
from olp.program.rs274.flatten.values import Variables


class Branches:
    """Carries out the flow statements of one level; each method has the name of its keyword."""

    language: Language
    variables: Variables

    def _true(self, flow: Flow) -> bool:
        return filled(flow.values[0](self.variables)) != 0

    def _do_sub(self, flow: Flow, frame: Frame, index: int) -> None:
        frame.next_index = frame.unit.following(index, flow.label, frozenset({"endsub"})) + 1

    def _do_if(self, flow: Flow, frame: Frame, index: int) -> None:
        frame.taken.discard(flow.label)
        while not self._true(flow):
            index = frame.unit.following(index, flow.label, frozenset({"elseif", "else", "endif"}))
            frame.next_index = index + 1
            next_flow = frame.unit.line(index).flow
            if next_flow is None or next_flow.keyword != "elseif":
                break
            flow = next_flow
        frame.taken.add(flow.label)

    def _do_elseif(self, flow: Flow, frame: Frame, index: int) -> None:
        if flow.label not in frame.taken:
            raise ProgramError(f"{flow.keyword.upper()} without an IF with label {flow.label}", code="OLP542")
        frame.next_index = frame.unit.following(index, flow.label, frozenset({"endif"}))

    _do_else = _do_elseif

    def _do_endif(self, flow: Flow, frame: Frame, index: int) -> None:
        frame.taken.discard(flow.label)

    def _do_do(self, flow: Flow, frame: Frame, index: int) -> None:
        if self.language.macro_b:
            frame.loops[flow.label] = index
        else:
            frame.dos[flow.label] = index

    def _do_while(self, flow: Flow, frame: Frame, index: int) -> None:
        if flow.label in frame.dos:
            if self._true(flow):
                frame.next_index = frame.dos[flow.label] + 1
            else:
                del frame.dos[flow.label]
        elif self._true(flow):
            frame.loops[flow.label] = index
        else:
            frame.loops.pop(flow.label, None)
            frame.next_index = frame.unit.following(index, flow.label, frozenset({"endwhile"})) + 1

    def _do_endwhile(self, flow: Flow, frame: Frame, index: int) -> None:
        frame.next_index = self._open(frame.loops, flow)

    def _do_repeat(self, flow: Flow, frame: Frame, index: int) -> None:
        count = int(filled(flow.values[0](self.variables)) + 0.5)
        if count > 0:
            frame.counts[flow.label] = count
            frame.loops[flow.label] = index
        else:
            frame.next_index = frame.unit.following(index, flow.label, frozenset({"endrepeat"})) + 1

    def _do_endrepeat(self, flow: Flow, frame: Frame, index: int) -> None:
        start = self._open(frame.loops, flow)
        frame.counts[flow.label] -= 1
        if frame.counts[flow.label] > 0:
            frame.next_index = start + 1
        else:
            del frame.counts[flow.label], frame.loops[flow.label]

    def _do_break(self, flow: Flow, frame: Frame, index: int) -> None:
        frame.next_index = frame.unit.following(index, flow.label, self._loop_end(flow, frame)) + 1
        for table in (frame.dos, frame.loops, frame.counts):
            table.pop(flow.label, None)

    def _do_continue(self, flow: Flow, frame: Frame, index: int) -> None:
        if flow.label in frame.dos:
            raise ProgramError(
                "CONTINUE within DO ... WHILE ends the loop in LinuxCNC 2.9; use IF", code="OLP544"
            )
        frame.next_index = frame.unit.following(index, flow.label, self._loop_end(flow, frame))

    def _loop_end(self, flow: Flow, frame: Frame) -> frozenset[str]:
        if flow.label in frame.dos:
            return frozenset({"while"})
        self._open(frame.loops, flow)
        return frozenset({"endrepeat" if flow.label in frame.counts else "endwhile"})

    def _open(self, table: dict[str, int], flow: Flow) -> int:
        if flow.label not in table:
            raise ProgramError(
                f"{flow.keyword.upper()} with label {flow.label} has no open loop", code="OLP542"
            )
        return table[flow.label]

    def _do_while_do(self, flow: Flow, frame: Frame, index: int) -> None:
        if self._true(flow):
            frame.loops[flow.label] = index
        else:
            frame.next_index = frame.unit.following(index, flow.label, frozenset({"end"})) + 1

    def _do_end(self, flow: Flow, frame: Frame, index: int) -> None:
        frame.next_index = self._open(frame.loops, flow)

    def _do_goto(self, flow: Flow, frame: Frame, index: int) -> None:
        number = whole(filled(flow.values[-1](self.variables)), "the block number of GOTO")
        frame.next_index = frame.unit.block_number(number, index)

    def _do_when_goto(self, flow: Flow, frame: Frame, index: int) -> None:
        if self._true(flow):
            self._do_goto(flow, frame, index)
