"""Runs a parametric program in the order of its execution: flow, subprograms and their parameters."""

from __future__ import annotations

from collections.abc import Callable

from olp.core.budget import Budget
from olp.core.errors import ProgramError
from olp.program.rs274.flatten.expressions import filled, whole
from olp.program.rs274.flatten.lines import Flow, Line
from olp.program.rs274.flatten.modal import Modal, moves, unsettled
from olp.program.rs274.flatten.tasks import Tasks
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
_CALLS = {("m", 97.0), ("m", 98.0), ("m", 99.0), ("g", 65.0), ("g", 66.0)}


def _indices(line: Line, codes: set[tuple[str, float]]) -> frozenset[int]:
    """The words of a line that are these codes."""
    return frozenset(i for i, word in enumerate(line.words) if (word.letter, word.number) in codes)


def _refuse_by_switch(line: Line) -> None:
    """Raise ProgramError for a block under block delete that changes what later blocks are."""
    codes = {(word.letter, word.number) for word in line.words if word.value is None}
    if line.flow is not None or line.assignments or codes & _CALLS:
        raise ProgramError(
            "this block under block delete changes a parameter or the flow, so the unrolled program differs "
            "for each position of the switch; state block_delete in the job file, or remove the `/`",
            code="OLP525",
        )


class Walk(Tasks):
    """Runs a program; gives every executed line to `write`."""

    def __init__(
        self,
        main: Unit,
        variables: Variables,
        subprograms: Callable[[str], tuple[str, bytes] | None],
        write: WriteBlock,
        leave: Callable[[Line, Frame], None],
        budget: Budget,
        *,
        block_delete: bool | None,
    ) -> None:
        self.main = main
        self.variables = variables
        self.write = write
        self.leave = leave
        self.language = main.language
        self.block_delete = block_delete
        self.budget = budget
        self._subprograms = subprograms
        self._files: dict[str, Unit] = {}
        self._frames = [Frame(main, 0, "", variables.locals, variables.names)]
        self._modal: Modal | None = None
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
                if len(self._frames) == 1:
                    frame.run += 1
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
        called = None if self.language.user_tasks else self._calls(line, frame, index)
        if called is not None:
            return called
        if len(self._frames) == 1 and any(word.letter != "n" for word in line.words):
            self._headers += 1
        ended = self.write(line, frame, frozenset())
        if self._modal is not None and not any(level.modal for level in self._frames):
            modal = self._modal
            if moves(line, self.variables):
                self._enter(
                    Frame(
                        modal.unit, modal.start, modal.label, modal.called(), {}, start=modal.start,
                        repeats=modal.repeats, modal=True, arguments=self._set_again(modal.arguments),
                    )
                )  # fmt: skip
        return ended

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
        self.leave(frame.unit.line(index), frame)
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
                    f"subprogram {label} is not in the file, and no file for it was given; put one into the "
                    f"folder of the program, such as {self._file_of(label)}",
                    code="OLP542",
                )
            name, data = given
            self._files[label] = Unit(data, self.main.profile, name)
        unit = self._files[label]
        start = unit.definition(label, keyword)
        if start is None and self.language.macro_b and not unit.has_programs:
            # the control numbers a program without an O word as it is loaded
            return unit, -1
        if start is None:
            raise ProgramError(f"the file of subprogram {label} does not define it", code="OLP542")
        return unit, start

    def _file_of(self, label: str) -> str:
        """A name of the file of a subprogram, as one may be beside the program."""
        if self.language.user_tasks:
            return f"{label.upper()}.SUB"
        return f"O{label.zfill(4)}.nc" if self.language.macro_b else f"{label}.ngc"

    def _enter(self, frame: Frame) -> None:
        if len(self._frames) >= MAX_LEVEL:
            raise ProgramError(
                f"subprograms call one another more than {MAX_LEVEL} levels deep", code="OLP543"
            )
        caller = self._frames[-1]
        frame.within, frame.run = caller.within or caller.next_index, self._frames[0].run
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
        if self.language.saved_modes and ("m", 73.0) in codes and len(self._frames) == 1:
            raise ProgramError(
                "M73 restores modes at the end of a subprogram, and this is none; give M70 and M72",
                code="OLP544",
            )
        if self.language.profile_cycles and codes & _PROFILE_CYCLES:
            raise ProgramError(
                "G70 to G72 are cycles of a lathe with a profile from a subprogram; lathes are not corrected",
                code="OLP544",
            )
        if ("g", 66.1) in codes:
            raise ProgramError(
                "G66.1 calls a macro with the words of every block, which is not unrolled; call it with G65",
                code="OLP544",
            )
        if self._modal is not None and codes & (_CALLS | {("g", 67.0)}):
            self._refuse_in_modal(line, codes)
        if ("g", 65.0) in codes or ("g", 66.0) in codes:
            self._macro(line, frame, modal=("g", 66.0) in codes)
            return False
        if ("g", 67.0) in codes and self._modal is not None:
            self._modal = None
            return self.write(line, frame, _indices(line, {("g", 67.0)}))
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
        target, block = self._word(line, "p"), self._word(line, "q")
        if block is not None and (local or not self.language.calls_at_q):
            raise ProgramError(
                "what this control makes of Q in a subprogram call is not known; take Q out", code="OLP516"
            )
        if target is None and block is not None:
            target, block, local = block, None, True
        if target is None:
            raise ProgramError("a subprogram call has no P word", code="OLP516")
        number = whole(target, "the program number P")
        count = self._word(line, "l")
        repeats = 1 if count is None else whole(count, "the repeat count L")
        if self.language.counts_in_p and count is None and number > 9999 and not local:
            repeats, number = divmod(number, 10_000)
        none = repeats == 0 and self.language.calls_none
        if repeats < 1 and not none:
            raise ProgramError(f"a subprogram is called {repeats} times; expected one or more", code="OLP516")
        without = frozenset(
            i
            for i, w in enumerate(line.words)
            if w.letter in "plq" or (w.letter == "m" and w.number in (97, 98))
        )
        self.write(line, frame, without)
        if none:
            return
        if local:
            unit, start = frame.unit, frame.unit.block_number(number, index) - 1
        else:
            unit, start = self._find(str(number), "program", frame.unit)
            if block is not None:
                start = unit.block_number(whole(block, "the block number Q"), start + 1) - 1
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
        self.leave(line, frame)
        if frame.repeats > 0:
            frame.repeats -= 1
            if frame.arguments is not None:
                frame.locals |= unsettled(frame.locals, frame.arguments)
            frame.next_index = frame.start
            return False
        target = self._word(line, "p")
        caller = self._leave()
        if target is not None:
            caller.next_index = caller.unit.block_number(
                whole(target, "the block number P"), caller.next_index - 1
            )
        return False

    def _refuse_in_modal(self, line: Line, codes: set[tuple[str, float]]) -> None:
        """Raise ProgramError for what is not known under G66."""
        if any(level.modal for level in self._frames) and codes & {("g", 66.0), ("g", 67.0)}:
            why = "G66 or G67 inside of a macro of G66 is not unrolled; give them in the program around it"
        elif ("g", 66.0) in codes:
            why = "a second G66 before the G67 of the first is not unrolled; end the first with G67"
        elif not codes & {("g", 65.0)} and any(word.letter in "xyzabcuvw" for word in line.words):
            why = "under G66 this block moves, and calls or returns; put the move into a block of its own"
        else:
            return
        raise ProgramError(why, code="OLP544")

    def _set_again(self, arguments: dict[int, float | None]) -> dict[int, float | None] | None:
        """Arguments that repetitions of a macro may have again, None where each has what the last left."""
        return None if self.language.repeats_keep_locals else dict(arguments)

    def _macro(self, line: Line, frame: Frame, *, modal: bool) -> None:
        number, name = self._word(line, "p"), "G66" if modal else "G65"
        if number is None:
            raise ProgramError(f"{name} has no P word", code="OLP516")
        letters = [word.letter for word in line.words if word.letter != "n"]
        if letters[0] != "g" or letters.count("g") > 1:
            raise ProgramError(
                f"{name} is not the first word and only code of its block, and what the control makes of the "
                "others is not known; give them a block of their own",
                code="OLP518",
            )
        count = self._word(line, "l")
        repeats = 1 if count is None else whole(count, "the repeat count L")
        arguments = dict(macro_arguments(line, self.variables))
        self.write(line, frame, frozenset(range(len(line.words))))
        label = str(whole(number, "the program number P"))
        unit, start = self._find(label, "program", frame.unit)
        repeats = max(repeats, 1) - 1
        if modal:
            self._modal = Modal(unit, start + 1, label, repeats, arguments)
        else:
            again = self._set_again(arguments)
            self._enter(
                Frame(
                    unit, start + 1, label, arguments, {}, start=start + 1, repeats=repeats, arguments=again
                )
            )
