"""Runs a parametric program in the order of its execution: flow, subprograms and their parameters."""

from __future__ import annotations

from collections.abc import Callable

from olp.core.budget import Budget
from olp.core.errors import ProgramError
from olp.program.rs274.flatten.expressions import filled, whole
from olp.program.rs274.flatten.lines import Flow, Line
from olp.program.rs274.flatten.unit import Frame, Unit
from olp.program.rs274.flatten.values import Variables, macro_arguments

#: levels of subprograms at most: LinuxCNC allows 10, Fanuc 4 to 10; more is an endless recursion
MAX_LEVEL = 50

#: work of a visit to a block beside the bytes of its line
_VISIT = 32

#: turning cycles of LinuxCNC, which name a subprogram by Q
_PROFILE_CYCLES = {("g", code) for code in (70.0, 71.0, 71.1, 71.2, 72.0, 72.1, 72.2)}

#: Writes one executed line, given the indices of the words to leave out; True where the program ends.
WriteBlock = Callable[[Line, Frame, frozenset[int]], bool]


#: Codes of subprogram calls and returns.
_CALLS = {("m", 97.0), ("m", 98.0), ("m", 99.0), ("g", 65.0)}


def _refuse_by_switch(line: Line) -> None:
    """Raise ProgramError for a block under block delete that changes what later blocks are."""
    codes = {(word.letter, word.number) for word in line.words if word.value is None}
    if line.flow is not None or line.assignments or codes & _CALLS:
        raise ProgramError(
            "this block under block delete changes a parameter or the flow, so the unrolled program differs "
            "for each position of the switch; remove the `/`, or the block",
            code="OLP525",
        )


class Walk:
    """Runs a program; gives every executed line to `write`."""

    def __init__(
        self,
        main: Unit,
        variables: Variables,
        subprograms: Callable[[str], tuple[str, bytes] | None],
        write: WriteBlock,
        *,
        block_delete: bool | None,
        budget: Budget,
    ) -> None:
        self.main = main
        self.variables = variables
        self.write = write
        self.language = main.language
        self.block_delete = block_delete
        self.budget = budget
        self._subprograms = subprograms
        self._files: dict[str, Unit] = {}
        self._frames = [Frame(main, 0, "", variables.locals, variables.names)]
        self._headers = 0
        self._percents = 0

    def run(self) -> None:
        """Run to the end. ProgramError carries the line and file where it happened."""
        while self._frames:
            frame = self._frames[-1]
            index = frame.next_index
            try:
                if index >= len(frame.unit.lines):
                    if len(self._frames) > 1:
                        raise ProgramError(
                            f"subprogram {frame.label} has no end (ENDSUB or M99)", code="OLP542"
                        )
                    return
                self.budget.spend(_VISIT + len(frame.unit.lines[index]))
                line = frame.unit.line(index)
                frame.next_index += 1
                if line.deleted and self.block_delete:
                    continue
                if line.deleted and self.block_delete is None:
                    _refuse_by_switch(line)
                if self._step(line, frame, index):
                    self._close_tape()
                    return
            except ProgramError as error:
                if error.line is None:
                    error.line = min(index, len(frame.unit.lines) - 1) + 1
                if error.file is None:
                    error.file = frame.unit.file
                raise

    def _close_tape(self) -> None:
        """The closing % of the main file is kept, whatever is between it and the end of the program."""
        main = self._frames[0]
        if self._percents == 1:
            for i in range(main.next_index, len(self.main.lines)):
                if self.main.lines[i].lstrip().startswith(b"%"):
                    self.write(self.main.line(i), main, frozenset())
                    return

    def _step(self, line: Line, frame: Frame, index: int) -> bool:
        if line.percent:
            if frame.unit is not self.main:
                return False
            self._percents += 1
            self.write(line, frame, frozenset())
            return self._percents == 2
        flow = line.flow
        if flow is not None:
            return self._flow(flow, line, frame, index)
        called = self._calls(line, frame, index)
        if called is not None:
            return called
        if len(self._frames) == 1 and any(word.letter != "n" for word in line.words):
            self._headers += 1
        return self.write(line, frame, frozenset())

    # --- flow -----------------------------------------------------------------------------------------------

    def _flow(self, flow: Flow, line: Line, frame: Frame, index: int) -> bool:
        if flow.keyword == "program":
            return self._program(line, frame)
        if flow.keyword == "when-then":
            if self._true(flow):
                self.write(line, frame, frozenset())
            return False
        if flow.keyword != "sub" and line.comments:
            self.write(line, frame, frozenset())
        handler: Callable[[Flow, Frame, int], None] = getattr(self, "_do_" + flow.keyword.replace("-", "_"))
        handler(flow, frame, index)
        return False

    def _program(self, line: Line, frame: Frame) -> bool:
        """A header such as O1234 is written at the start; a later one means that the program before has no
        end."""
        if len(self._frames) > 1:
            raise ProgramError(
                f"subprogram {frame.label} runs into the next program; M99 is missing", code="OLP542"
            )
        if self._headers:
            return True
        self._headers += 1
        return self.write(line, frame, frozenset())

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

    # --- subprograms ----------------------------------------------------------------------------------------

    def _do_call(self, flow: Flow, frame: Frame, index: int) -> None:
        label = flow.label
        if flow.dynamic is not None:
            label = str(whole(filled(flow.dynamic(self.variables)), "the label of CALL"))
        arguments = {i: value(self.variables) for i, value in enumerate(flow.values, start=1)}
        unit, start = self._find(label, "sub", frame.unit)
        self._enter(Frame(unit, start + 1, label, arguments, {}, start=start + 1))

    def _do_endsub(self, flow: Flow, frame: Frame, index: int) -> None:
        # RETURN may have any label, as in LinuxCNC.
        if len(self._frames) == 1 or (flow.keyword == "endsub" and flow.label != frame.label):
            raise ProgramError(
                f"{flow.keyword.upper()} with label {flow.label} outside of its SUB", code="OLP542"
            )
        value = flow.values[0](self.variables) if flow.values else None
        self.variables.globals |= {"_value": filled(value), "_value_returned": float(bool(flow.values))}
        self._leave()

    _do_return = _do_endsub

    def _find(self, label: str, keyword: str, near: Unit) -> tuple[Unit, int]:
        for unit in (near, self.main):
            start = unit.definition(label, keyword)
            if start is not None:
                return unit, start
        if label not in self._files:
            given = self._subprograms(label)
            if given is None:
                raise ProgramError(
                    f"subprogram {label} is not in the file, and no file for it was given", code="OLP542"
                )
            name, data = given
            self._files[label] = Unit(data, self.main.profile, name)
        unit = self._files[label]
        start = unit.definition(label, keyword)
        if start is None:
            raise ProgramError(f"the file of subprogram {label} does not define it", code="OLP542")
        return unit, start

    def _enter(self, frame: Frame) -> None:
        if len(self._frames) >= MAX_LEVEL:
            raise ProgramError(
                f"subprograms call one another more than {MAX_LEVEL} levels deep", code="OLP543"
            )
        self._frames.append(frame)
        self.variables.locals, self.variables.names = frame.locals, frame.names

    def _leave(self) -> Frame:
        self._frames.pop()
        frame = self._frames[-1]
        self.variables.locals, self.variables.names = frame.locals, frame.names
        return frame

    def _calls(self, line: Line, frame: Frame, index: int) -> bool | None:
        """Carry out M98, M97, M99 and G65; None where the line has none of them, else whether the run
        ends."""
        codes = {(w.letter, w.number) for w in line.words if w.letter in "mg" and w.value is None}
        saves = self.language.saved_modes and codes & {("m", 70.0), ("m", 72.0), ("m", 73.0)}
        if saves and (len(self._frames) > 1 or ("m", 73.0) in saves):
            raise ProgramError(
                "M70, M72 and M73 act on a level of subprograms, which plain blocks do not have",
                code="OLP544",
            )
        if self.language.profile_cycles and codes & _PROFILE_CYCLES:
            raise ProgramError(
                "G70 to G72 take their profile from a subprogram, which plain blocks do not have",
                code="OLP544",
            )
        if ("g", 66.0) in codes or ("g", 66.1) in codes:
            raise ProgramError(
                "G66 calls a macro after every move, which is not unrolled; call it with G65", code="OLP544"
            )
        if ("g", 65.0) in codes:
            self._macro(line, frame)
            return False
        if ("m", 99.0) in codes:
            return self._return_m99(line, frame)
        for code in (98.0, 97.0):
            if ("m", code) in codes:
                self._call_m98(line, frame, index, local=code == 97.0)
                return False
        return None

    def _word(self, line: Line, letter: str) -> float | None:
        for word in line.words:
            if word.letter == letter:
                return word.number if word.value is None else word.value(self.variables)
        return None

    def _call_m98(self, line: Line, frame: Frame, index: int, *, local: bool) -> None:
        target = self._word(line, "p")
        if target is None:
            raise ProgramError("a subprogram call has no P word", code="OLP516")
        number = whole(target, "the program number P")
        count = self._word(line, "l")
        repeats = 1 if count is None else whole(count, "the repeat count L")
        if self.language.counts_in_p and count is None and number > 9999 and not local:
            repeats, number = divmod(number, 10_000)
        if repeats < 1:
            raise ProgramError(f"a subprogram is called {repeats} times; expected one or more", code="OLP516")
        without = frozenset(
            i
            for i, w in enumerate(line.words)
            if w.letter in ("p", "l") or (w.letter == "m" and w.number in (97, 98))
        )
        self.write(line, frame, without)
        if local:
            unit, start = frame.unit, frame.unit.block_number(number, index) - 1
        else:
            unit, start = self._find(str(number), "program", frame.unit)
        keep = self.language.shared_locals
        self._enter(
            Frame(
                unit,
                start + 1,
                str(number),
                frame.locals if keep else {},
                {},
                start=start + 1,
                repeats=repeats - 1,
            )
        )

    def _return_m99(self, line: Line, frame: Frame) -> bool:
        if len(self._frames) == 1:
            self.write(line, frame, frozenset())
            return True
        without = frozenset(
            i for i, w in enumerate(line.words) if w.letter == "p" or (w.letter == "m" and w.number == 99)
        )
        self.write(line, frame, without)
        if frame.repeats > 0:
            frame.repeats -= 1
            frame.next_index = frame.start
            return False
        target = self._word(line, "p")
        caller = self._leave()
        if target is not None:
            caller.next_index = caller.unit.block_number(
                whole(target, "the block number P"), caller.next_index - 1
            )
        return False

    def _macro(self, line: Line, frame: Frame) -> None:
        number = self._word(line, "p")
        if number is None:
            raise ProgramError("G65 has no P word", code="OLP516")
        count = self._word(line, "l")
        repeats = 1 if count is None else whole(count, "the repeat count L")
        arguments = dict(macro_arguments(line, self.variables))
        self.write(line, frame, frozenset(range(len(line.words))))
        label = str(whole(number, "the program number P"))
        unit, start = self._find(label, "program", frame.unit)
        self._enter(
            Frame(unit, start + 1, label, arguments, {}, start=start + 1, repeats=max(repeats, 1) - 1)
        )
