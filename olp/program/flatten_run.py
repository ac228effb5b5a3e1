"""Walks a parametric program in the order of its execution: flow, subprograms and their parameters."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from olp.exceptions import ProgramError
from olp.program.expressions import Dialect, filled, whole
from olp.program.flatten_lines import Flow, Line, compile_line, split_lines
from olp.program.flatten_state import State

#: LinuxCNC allows 10 levels, Fanuc 4 to 10; more than this is a recursion without end.
MAX_LEVEL = 50

_MAYBE_O = re.compile(rb"[\s/]*(?:\([^)]*\)\s*)*(?:[nN][\d\s]*)?[oO]")
_LINUXCNC_LOCAL = 30
_LINUXCNC_FREE = 5060
_LINUXCNC_LAST = 5602
_FANUC_LOCAL = 33
_FANUC_COMMON = 1000
_ARGUMENTS = dict(zip("abcijkdefhmqrstuvwxyz", (1, 2, 3, 4, 5, 6, 7, 8, 9, 11, 13, *range(17, 27)), strict=True))
_NOT_ARGUMENTS = frozenset("glnop")
_COUNT_ARGUMENTS = frozenset("dhmst")
_CALL_WORDS = frozenset("plg")

_units = itertools.count()


class Unit:
    """One text (the program or a file of a subprogram), compiled line by line when first met."""

    def __init__(self, data: bytes, dialect: Dialect, file: str | None) -> None:
        self.key = next(_units)
        self.file = file
        self.dialect: Dialect = dialect
        self.lines = split_lines(data)
        self.ends_with_eol = data.endswith((b"\n", b"\r"))
        self._compiled: dict[int, Line] = {}
        self._flows: list[tuple[int, Flow]] | None = None
        self._found: dict[tuple[int, str, frozenset[str]], int] = {}

    def line(self, index: int) -> Line:
        if index not in self._compiled:
            try:
                self._compiled[index] = compile_line(self.lines[index], index + 1, self.dialect)
            except ProgramError as error:
                error.line = index + 1
                raise
        return self._compiled[index]

    def flows(self) -> list[tuple[int, Flow]]:
        """Index and statement of every line with flow."""
        if self._flows is None:
            self._flows = []
            for index, raw in enumerate(self.lines):
                if self.dialect == "linuxcnc" and not _MAYBE_O.match(raw):
                    continue
                flow = self.line(index).flow
                if flow is not None:
                    self._flows.append((index, flow))
        return self._flows

    def definition(self, label: str, keyword: str) -> int | None:
        """Index of the first `sub` or `program` with this label."""
        return next((i for i, flow in self.flows() if flow.keyword == keyword and flow.label == label), None)

    def next(self, index: int, label: str, keywords: frozenset[str]) -> int:
        """Index of the next statement with this label, in the same subprogram; ProgramError if none."""
        key = (index, label, keywords)
        if key not in self._found:
            self._found[key] = self._search(index, label, keywords)
        return self._found[key]

    def _search(self, index: int, label: str, keywords: frozenset[str]) -> int:
        inner = ""
        for i, flow in self.flows():
            if i <= index:
                continue
            if inner:
                inner = "" if (flow.keyword, flow.label) == ("endsub", inner) else inner
                continue
            if flow.label == label and flow.keyword in keywords:
                return i
            if flow.keyword == "sub":
                inner = flow.label
            elif flow.keyword in ("endsub", "program"):
                break
        raise ProgramError(f"no {' or '.join(sorted(keywords)).upper()} with label {label} follows")

    def block_number(self, number: int, index: int) -> int:
        """Index of the line N`number` in the program around `index`: forward first, then from its start."""
        bounds = [i for i, flow in self.flows() if flow.keyword == "program"]
        start = max((i for i in bounds if i <= index), default=0)
        stop = min((i for i in bounds if i > index), default=len(self.lines))
        for i in (*range(index + 1, stop), *range(start, index + 1)):
            if any(w.letter == "n" and w.value is None and w.number == number for w in self.line(i).words):
                return i
        raise ProgramError(f"GOTO {number}: the program has no block N{number}")


@dataclass(slots=True)
class Frame:
    """One level of the run: where it stands, its local parameters and its open loops."""

    unit: Unit
    at: int
    label: str
    locals: dict[int, float | None]
    names: dict[str, float]
    start: int = 0
    repeats: int = 0
    taken: set[str] = field(default_factory=set)
    loops: dict[str, int] = field(default_factory=dict)
    dos: dict[str, int] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=dict)
    own_locals: bool = True


class Variables:
    """Parameters of the run. What only the control knows raises ProgramError."""

    def __init__(self, state: State) -> None:
        self.state = state
        self.common: dict[int, float | None] = {}
        self.globals: dict[str, float] = {"_value": 0.0, "_value_returned": 0.0}
        self.locals: dict[int, float | None] = {}
        self.names: dict[str, float] = {}

    def number(self, index: int) -> float | None:
        if self.state.dialect == "fanuc":
            return self._fanuc(index)
        if not 1 <= index <= _LINUXCNC_LAST:
            raise ProgramError(f"#{index} is out of range; parameters are #1 to #{_LINUXCNC_LAST}")
        if index <= _LINUXCNC_LOCAL:
            return self.locals.get(index, 0.0)
        if index <= _LINUXCNC_FREE:
            return self.common.get(index, 0.0)
        if 5420 <= index <= 5422:
            return self.state.at(index - 5420)
        raise ProgramError(
            f"#{index} is kept by the control (probe result, offset, tool or position) and not known off line; "
            "set a free parameter (#31 to #5060) instead"
        )

    def _fanuc(self, index: int) -> float | None:
        if index == 0:
            return None
        if 0 < index <= _FANUC_LOCAL:
            return self.locals.get(index)
        if index in self.common:
            return self.common[index]
        for base in (5001, 5041):
            if base <= index <= base + 2:
                return self.state.at(index - base)
        raise ProgramError(
            f"#{index} is not set by the program before and not known off line; assign it in the program"
        )

    def named(self, name: str) -> float:
        known = self._predefined(name)
        if known is not None:
            return known()
        table = self.globals if name.startswith("_") else self.names
        if name not in table:
            raise ProgramError(f"#<{name}> is not set by the program before and not known off line")
        return table[name]

    def exists(self, name: str) -> bool:
        if name.startswith(("_ini[", "_hal[")):
            raise ProgramError(f"#<{name}> belongs to the control and is not known off line")
        return self._predefined(name) is not None or name in (self.globals if name.startswith("_") else self.names)

    def _predefined(self, name: str) -> Callable[[], float] | None:
        state = self.state
        if name in ("_x", "_y", "_z"):
            return lambda: state.at("xyz".index(name[1]))
        if name in ("_metric", "_imperial"):
            return lambda: float((self._set(state.unit, name) == 21) is (name == "_metric"))
        if name in ("_absolute", "_incremental"):
            return lambda: float(state.absolute is (name == "_absolute"))
        if name == "_plane":
            return lambda: state.plane * 10.0
        if name in ("_feed", "_rpm"):
            return lambda: float(self._set(state.feed if name == "_feed" else state.speed, name))
        return None

    def _set(self, value: float | None, name: str) -> float:
        if value is None:
            raise ProgramError(f"#<{name}> is asked for before the program sets it")
        return value

    def assign(self, target: int | str, value: float | None) -> None:
        if isinstance(target, str):
            if self._predefined(target) is not None:
                raise ProgramError(f"#<{target}> belongs to the control and cannot be set")
            (self.globals if target.startswith("_") else self.names)[target] = filled(value)
        elif self.state.dialect == "fanuc":
            self._assign_fanuc(target, value)
        elif 1 <= target <= _LINUXCNC_LOCAL:
            self.locals[target] = value
        elif 1 <= target <= _LINUXCNC_FREE:
            self.common[target] = value
        else:
            raise ProgramError(f"#{target} belongs to the control: setting it has effects that no plain block has")

    def _assign_fanuc(self, index: int, value: float | None) -> None:
        if 1 <= index <= _FANUC_LOCAL:
            self.locals[index] = value
        elif 100 <= index < _FANUC_COMMON:
            self.common[index] = value
        elif index == 3000:
            raise ProgramError("the program stops here with an alarm of its own (#3000)")
        elif index not in (3003, 3004):
            raise ProgramError(f"#{index} belongs to the control: setting it has effects that no plain block has")


#: Writes one executed line, given the indices of the words to leave out; True where the program ends.
WriteBlock = Callable[[Line, Frame, frozenset[int]], bool]


class Walk:
    """Runs a program; hands every executed line to `write`."""

    def __init__(
        self,
        main: Unit,
        variables: Variables,
        subprograms: Callable[[str], bytes | None],
        write: WriteBlock,
        *,
        dialect: Dialect,
        block_delete: bool,
        limit: int,
    ) -> None:
        self.main = main
        self.variables = variables
        self.write = write
        self.dialect: Dialect = dialect
        self.block_delete = block_delete
        self.limit = limit
        self._subprograms = subprograms
        self._files: dict[str, Unit] = {}
        self._frames = [Frame(main, 0, "", variables.locals, variables.names)]
        self._headers = 0
        self._percents = 0

    def run(self) -> None:
        """Run to the end. ProgramError carries the line and file where it happened."""
        visits = 0
        while self._frames:
            frame = self._frames[-1]
            index = frame.at
            try:
                if index >= len(frame.unit.lines):
                    if len(self._frames) > 1:
                        raise ProgramError(f"subprogram {frame.label} has no end (ENDSUB or M99)")
                    return
                visits += 1
                if visits > self.limit:
                    raise ProgramError(
                        f"the run visits more than {self.limit} blocks; a loop may have no end, or raise the limit"
                    )
                line = frame.unit.line(index)
                frame.at += 1
                if line.deleted and self.block_delete:
                    continue
                if self._step(line, frame, index):
                    self._close_tape(frame)
                    return
            except ProgramError as error:
                if error.line is None:
                    error.line = min(index, len(frame.unit.lines) - 1) + 1
                if error.file is None:
                    error.file = frame.unit.file
                raise

    def _close_tape(self, frame: Frame) -> None:
        """The closing % of the main file is kept, whatever stands between it and the program's end."""
        main = self._frames[0]
        if self._percents == 1:
            for i in range(main.at, len(self.main.lines)):
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
        if flow.keyword not in ("sub", "endsub", "call", "return") and line.comments:
            self.write(line, frame, frozenset())
        handler: Callable[[Flow, Frame, int], None] = getattr(self, "_do_" + flow.keyword.replace("-", "_"))
        handler(flow, frame, index)
        return False

    def _program(self, line: Line, frame: Frame) -> bool:
        """A header such as O1234 is written at the start; met later, the program before it has no end."""
        if len(self._frames) > 1:
            raise ProgramError(f"subprogram {frame.label} runs into the next program; M99 is missing")
        if self._headers:
            return True
        self._headers += 1
        return self.write(line, frame, frozenset())

    def _true(self, flow: Flow) -> bool:
        return filled(flow.values[0](self.variables)) != 0

    def _do_sub(self, flow: Flow, frame: Frame, index: int) -> None:
        frame.at = frame.unit.next(index, flow.label, frozenset({"endsub"})) + 1

    def _do_if(self, flow: Flow, frame: Frame, index: int) -> None:
        frame.taken.discard(flow.label)
        while not self._true(flow):
            index = frame.unit.next(index, flow.label, frozenset({"elseif", "else", "endif"}))
            frame.at = index + 1
            found = frame.unit.line(index).flow
            if found is None or found.keyword != "elseif":
                break
            flow = found
        frame.taken.add(flow.label)

    def _do_elseif(self, flow: Flow, frame: Frame, index: int) -> None:
        if flow.label not in frame.taken:
            raise ProgramError(f"{flow.keyword.upper()} without an IF with label {flow.label}")
        frame.at = frame.unit.next(index, flow.label, frozenset({"endif"}))

    _do_else = _do_elseif

    def _do_endif(self, flow: Flow, frame: Frame, index: int) -> None:
        frame.taken.discard(flow.label)

    def _do_do(self, flow: Flow, frame: Frame, index: int) -> None:
        if self.dialect == "fanuc":
            frame.loops[flow.label] = index
        else:
            frame.dos[flow.label] = index

    def _do_while(self, flow: Flow, frame: Frame, index: int) -> None:
        if flow.label in frame.dos:
            if self._true(flow):
                frame.at = frame.dos[flow.label] + 1
            else:
                del frame.dos[flow.label]
        elif self._true(flow):
            frame.loops[flow.label] = index
        else:
            frame.loops.pop(flow.label, None)
            frame.at = frame.unit.next(index, flow.label, frozenset({"endwhile"})) + 1

    def _do_endwhile(self, flow: Flow, frame: Frame, index: int) -> None:
        frame.at = self._open(frame.loops, flow)

    def _do_repeat(self, flow: Flow, frame: Frame, index: int) -> None:
        count = int(filled(flow.values[0](self.variables)) + 0.5)
        if count > 0:
            frame.counts[flow.label] = count
            frame.loops[flow.label] = index
        else:
            frame.at = frame.unit.next(index, flow.label, frozenset({"endrepeat"})) + 1

    def _do_endrepeat(self, flow: Flow, frame: Frame, index: int) -> None:
        start = self._open(frame.counts and frame.loops, flow)
        frame.counts[flow.label] -= 1
        if frame.counts[flow.label] > 0:
            frame.at = start + 1
        else:
            del frame.counts[flow.label], frame.loops[flow.label]

    def _do_break(self, flow: Flow, frame: Frame, index: int) -> None:
        frame.at = frame.unit.next(index, flow.label, self._loop_end(flow, frame)) + 1
        for table in (frame.dos, frame.loops, frame.counts):
            table.pop(flow.label, None)

    def _do_continue(self, flow: Flow, frame: Frame, index: int) -> None:
        if flow.label in frame.dos:
            raise ProgramError("CONTINUE within DO … WHILE ends the loop in some releases of LinuxCNC; use IF")
        frame.at = frame.unit.next(index, flow.label, self._loop_end(flow, frame))

    def _loop_end(self, flow: Flow, frame: Frame) -> frozenset[str]:
        if flow.label in frame.dos:
            return frozenset({"while"})
        self._open(frame.loops, flow)
        return frozenset({"endrepeat" if flow.label in frame.counts else "endwhile"})

    def _open(self, table: dict[str, int], flow: Flow) -> int:
        if flow.label not in table:
            raise ProgramError(f"{flow.keyword.upper()} with label {flow.label} has no open loop")
        return table[flow.label]

    def _do_while_do(self, flow: Flow, frame: Frame, index: int) -> None:
        if self._true(flow):
            frame.loops[flow.label] = index
        else:
            frame.at = frame.unit.next(index, flow.label, frozenset({"end"})) + 1

    def _do_end(self, flow: Flow, frame: Frame, index: int) -> None:
        frame.at = self._open(frame.loops, flow)

    def _do_goto(self, flow: Flow, frame: Frame, index: int) -> None:
        number = whole(filled(flow.values[-1](self.variables)), "the block number of GOTO")
        frame.at = frame.unit.block_number(number, index)

    def _do_when_goto(self, flow: Flow, frame: Frame, index: int) -> None:
        if self._true(flow):
            self._do_goto(flow, frame, index)

    # --- subprograms ----------------------------------------------------------------------------------------

    def _do_call(self, flow: Flow, frame: Frame, index: int) -> None:
        label = flow.label
        if flow.dynamic is not None:
            label = str(whole(filled(flow.dynamic(self.variables)), "the label of CALL"))
        arguments: dict[int, float | None] = {i: v(self.variables) for i, v in enumerate(flow.values, start=1)}
        unit, start = self._find(label, "sub", frame.unit)
        self._enter(Frame(unit, start + 1, label, arguments, {}, start=start + 1))

    def _do_endsub(self, flow: Flow, frame: Frame, index: int) -> None:
        if len(self._frames) == 1 or flow.label != frame.label:
            raise ProgramError(f"{flow.keyword.upper()} with label {flow.label} outside of its SUB")
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
            data = self._subprograms(label)
            if data is None:
                raise ProgramError(f"subprogram {label} is not in the file, and no file of that name was given")
            self._files[label] = Unit(data, self.dialect, label)
        unit = self._files[label]
        start = unit.definition(label, keyword)
        if start is None:
            raise ProgramError(f"the file of subprogram {label} does not define it")
        return unit, start

    def _enter(self, frame: Frame) -> None:
        if len(self._frames) >= MAX_LEVEL:
            raise ProgramError(f"subprograms call one another more than {MAX_LEVEL} levels deep")
        self._frames.append(frame)
        self.variables.locals, self.variables.names = frame.locals, frame.names

    def _leave(self) -> Frame:
        self._frames.pop()
        frame = self._frames[-1]
        self.variables.locals, self.variables.names = frame.locals, frame.names
        return frame

    def _calls(self, line: Line, frame: Frame, index: int) -> bool | None:
        """Carry out M98, M97, M99 and G65; None where the line has none of them, else whether the run ends."""
        codes = {(w.letter, w.number) for w in line.words if w.letter in "mg" and w.value is None}
        if ("m", 70.0) in codes or ("m", 73.0) in codes or (("m", 72.0) in codes and len(self._frames) > 1):
            if len(self._frames) > 1 or ("m", 73.0) in codes:
                raise ProgramError("modes saved by M70 or M73 within a subprogram come back when it ends; write them out")
            return None
        if ("g", 66.0) in codes or ("g", 66.1) in codes:
            raise ProgramError("G66 calls a macro after every move, which is not unrolled; call it with G65")
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
            raise ProgramError("a subprogram call has no P word")
        number = whole(target, "the program number P")
        count = self._word(line, "l")
        repeats = 1 if count is None else whole(count, "the repeat count L")
        if self.dialect == "fanuc" and count is None and number > 9999 and not local:
            repeats, number = divmod(number, 10_000)
        if repeats < 1:
            raise ProgramError(f"a subprogram is called {repeats} times; expected one or more")
        without = frozenset(
            i
            for i, w in enumerate(line.words)
            if w.letter in ("p", "l") or (w.letter == "m" and w.number in (97, 98))
        )
        if len(without) < len(line.words) or line.comments:
            self.write(line, frame, without)
        if local:
            unit, start = frame.unit, frame.unit.block_number(number, index) - 1
        else:
            unit, start = self._find(str(number), "program", frame.unit)
        keep = self.dialect == "fanuc"
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
        if len(without) < len(line.words) or line.comments:
            self.write(line, frame, without)
        if frame.repeats > 0:
            frame.repeats -= 1
            frame.at = frame.start
            return False
        target = self._word(line, "p")
        caller = self._leave()
        if target is not None:
            caller.at = caller.unit.block_number(whole(target, "the block number P"), caller.at - 1)
        return False

    def _macro(self, line: Line, frame: Frame) -> None:
        number = self._word(line, "p")
        if number is None:
            raise ProgramError("G65 has no P word")
        count = self._word(line, "l")
        repeats = 1 if count is None else whole(count, "the repeat count L")
        arguments = dict(self._arguments(line))
        if line.comments:
            self.write(line, frame, frozenset(range(len(line.words))))
        label = str(whole(number, "the program number P"))
        unit, start = self._find(label, "program", frame.unit)
        self._enter(
            Frame(unit, start + 1, label, arguments, {}, start=start + 1, repeats=max(repeats, 1) - 1)
        )

    def _arguments(self, line: Line) -> Iterator[tuple[int, float | None]]:
        """(variable, value) of G65's words; I, J, K may come in several sets, as in argument list II."""
        group, last = 0, ""
        for word in line.words:
            letter = word.letter
            if letter in _NOT_ARGUMENTS:
                continue
            if letter not in _ARGUMENTS:
                raise ProgramError(f"G65 has the argument {letter.upper()}, which is no argument of a macro")
            value = word.number if word.value is None else word.value(self.variables)
            if word.value is None and not word.pointed and value != 0 and letter not in _COUNT_ARGUMENTS:
                raise ProgramError(
                    f"the argument {letter.upper()} has no decimal point: the control scales it by its least "
                    "increment; write the point"
                )
            index = _ARGUMENTS[letter]
            if letter in "ijk":
                group += bool(last) and letter <= last
                last = letter
                index += 3 * group
            yield index, value
