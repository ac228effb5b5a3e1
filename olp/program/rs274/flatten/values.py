"""Parameters of a program while it is unrolled: local, common, named, and those known off line."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.core.patterns import pattern
from olp.program.rs274.codes import INVERSE_TIME, METRIC
from olp.program.rs274.flatten.expressions import filled
from olp.program.rs274.flatten.lines import Line
from olp.program.rs274.flatten.modal_variables import ModalVariables, meaning
from olp.program.rs274.flatten.state import ProgramState, Value
from olp.program.rs274.flatten.tool_variables import ToolVariables
from olp.program.rs274.flatten.work_offsets import WorkOffsets

#: largest local parameter of LinuxCNC
_NGC_LOCAL = 30
#: largest parameter that a program may use freely
_NGC_FREE = 5060
#: largest parameter
_NGC_LAST = 5602
#: turns DEBUG comments on and off, which moves nothing
_DEBUG_SWITCH = 5599
#: largest local variable of Macro B
_MACRO_B_LOCAL = 33
_NUMBERED = pattern(rb"#[ \t]*(\d+)")
#: the present position of Z
_PRESENT_Z = 5043
#: common variables are from 100 to below this
_MACRO_B_COMMON = 1000
#: a value that only the control has
_NOT_KNOWN = "OLP541"
#: what the second number of a common variable has more
_AGAIN = 10_000
_FEED_MODES = {"_inverse_time": INVERSE_TIME, "_units_per_minute": 940, "_units_per_rev": 950}
_ARGUMENT_NUMBERS = (1, 2, 3, 4, 5, 6, 7, 8, 9, 11, 13, *range(17, 27))
_ARGUMENTS = dict(zip("abcijkdefhmqrstuvwxyz", _ARGUMENT_NUMBERS, strict=True))
_NOT_ARGUMENTS = frozenset("glnop")
_COUNT_ARGUMENTS = frozenset("dhmst")


#: The value of a local variable that differs from control to control.
UNSETTLED = float("nan")


def _bare(name: str, *, tasks: bool) -> str:
    """A parameter as expressions name it: its number, or its name in small letters; common variables of user
    `tasks` begin with `_`."""
    text = name.lower().removeprefix("#").strip("<>")
    if tasks and text.startswith("vc"):
        return f"_{text}"
    return str(int(text)) if text.isdigit() else text.replace(" ", "")


def _way_on(name: str) -> str:
    return f'give it in the job file: [parameters] "{name}" = ...'


class Variables:
    """Parameters of the run. `given` are values that the control has, by "#number" or "#<name>"; they hold
    until the program sets the parameter. Other values that only the control knows raise ProgramError."""

    def __init__(
        self, state: ProgramState, given: Mapping[str, float] | None = None, setup: Setup | None = None
    ) -> None:
        self.state = state
        self.offsets = WorkOffsets(state, setup if state.profile.language.work_offsets else None)
        self.tools = ToolVariables(state, setup if state.profile.language.tool_variables else None)
        self.modal = ModalVariables()
        self.tasks = state.profile.language.user_tasks
        self.units_known = not state.profile.language.increments_open
        names = {_bare(name, tasks=self.tasks): value for name, value in (given or {}).items()}
        self.given = {self._one(int(name)): value for name, value in names.items() if name.isdigit()}
        self.given_names = {name: value for name, value in names.items() if not name.isdigit()}
        self.common: dict[int, float | None] = {}
        #: common variables that the control counts, with why they are not known
        self.counted: dict[int, ProgramError] = {}
        self.globals: dict[str, float] = {"_value": 0.0, "_value_returned": 0.0}
        most = _MACRO_B_LOCAL if state.profile.language.macro_b else _NGC_LOCAL
        #: those of the program itself
        self.locals: dict[int, float | None] = {i: v for i, v in self.given.items() if i <= most}
        self.names = {name: value for name, value in self.given_names.items() if not name.startswith("_")}

    def follow(self, words: Sequence[Value], *, switched: bool) -> None:
        """Take the words of a block; one that is `switched` may be left out."""
        self.modal.follow(words, switched=switched)
        self.offsets.follow(words)
        self.tools.follow(words, switched=switched)

    def of_control(self, raw: bytes) -> bool:
        """Whether all variables of a line are the control's own, so that plain blocks have them too."""
        numbers = [int(n) for n in _NUMBERED.findall(raw)]
        return len(numbers) == raw.count(b"#") and not any(
            n <= _MACRO_B_LOCAL or self._one(n) in self.common for n in numbers
        )

    def counts(self, line: Line) -> bool:
        """Whether a line only gives a common variable a value that the control alone knows, as a counter of
        parts does. Plain blocks have such a line as it is, and the variable is not known behind it."""
        inert = self.state.profile.inert
        if not (line.assignments and inert and inert.fullmatch(line.raw) and self.of_control(line.raw)):
            return False
        try:
            for assignment in line.assignments:
                assignment.value(self)
        except ProgramError as error:
            if error.code != _NOT_KNOWN:
                raise
            for assignment in line.assignments:
                self.counted[self._one(int(assignment.target(self)))] = error
            return True
        return False

    def _one(self, index: int) -> int:
        """The number under which a variable is kept: common variables may have two."""
        plain = index - _AGAIN
        return plain if any(plain in span for span in self.state.profile.language.common_again) else index

    def _is_common(self, index: int) -> bool:
        further = bool(self.state.profile.language.common_again)
        return 100 <= index < _MACRO_B_COMMON or (further and _AGAIN <= index < _AGAIN + _MACRO_B_COMMON)

    def number(self, index: int) -> float | None:
        if self.state.profile.language.macro_b:
            return self._macro_b(index)
        if not 1 <= index <= _NGC_LAST:
            raise ProgramError(f"#{index} is out of range; parameters are #1 to #{_NGC_LAST}", code="OLP540")
        if index <= _NGC_LOCAL:
            return self.locals.get(index, 0.0)
        if index <= _NGC_FREE:
            return self.common.get(index, self.given.get(index, 0.0))
        if 5420 <= index <= 5422:
            return self.state.position_of(index - 5420)
        stated = self._of_control(index)
        if stated is not None:
            return stated
        raise ProgramError(
            f"#{index} is kept by the control (probe result, offset, tool or position) and not known "
            f"off line; {_way_on(f'#{index}')}",
            code="OLP541",
        )

    def _macro_b(self, index: int) -> float | None:
        if index == 0:
            return None
        if 0 < index <= _MACRO_B_LOCAL:
            value = self.locals.get(index)
            if value is UNSETTLED:
                raise ProgramError(
                    f"#{index} was changed by the last call of this macro, and whether the next call has its "
                    "argument again is not known; assign it in the macro first",
                    code="OLP541",
                )
            return value
        if self._one(index) in self.common:
            return self.common[self._one(index)]
        if self._one(index) in self.counted:
            raise self.counted[self._one(index)]
        if index == _PRESENT_Z and self.modal.length_on:
            raise ProgramError(
                f"whether #{index} counts the tool length is a setting of the control; use #5003, the end of "
                "the block before",
                code="OLP541",
            )
        for base in (5001, 5041):
            if base <= index <= base + 2:
                return self.state.position_of(index - base)
        what = meaning(index) if self.state.profile.language.modal_variables else ""
        stated = self.modal.value(index) if what else None
        stated = self._of_control(index) if stated is None else stated
        if stated is not None:
            return stated
        if what:
            raise ProgramError(
                f"#{index} is {what} in force, which the program has not stated before; state it there, or "
                f"{_way_on(f'#{index}')}",
                code="OLP541",
            )
        raise ProgramError(
            f"#{index} is not set before in the program and not known off line; assign it there, or "
            f"{_way_on(f'#{index}')}",
            code="OLP541",
        )

    def _of_control(self, index: int) -> float | None:
        """What the job states of a variable that the control has, or of a work offset."""
        one = self._one(index)
        if one in self.given:
            return self.given[one]
        stated = self.offsets.value(index)
        return self.tools.value(index) if stated is None else stated

    def named(self, name: str) -> float:
        known = self._predefined(name)
        if known is not None:
            return known()
        table = self.globals if name.startswith("_") else self.names
        if name in table:
            return self._settled(name, table[name])
        if name.startswith("_") and name in self.given_names:
            return self.given_names[name]
        stated = self.tools.named(name)
        if stated is not None:
            return stated
        shown = self._shown(name)
        raise ProgramError(
            f"{shown} is not set before in the program and not known off line; assign it there, or "
            f"{_way_on(shown)}",
            code="OLP541",
        )

    def _shown(self, name: str) -> str:
        return name.removeprefix("_").upper() if self.tasks else f"#<{name}>"

    def _settled(self, name: str, value: float) -> float:
        if value is UNSETTLED:
            raise ProgramError(
                f"{self._shown(name)} is a local variable on both sides of a CALL, and whether it is one "
                "or two is not known; give it another name in the subprogram",
                code="OLP541",
            )
        return value

    def exists(self, name: str) -> bool:
        if name.startswith("_") and name in self.given_names:
            return True
        if name.startswith(("_ini[", "_hal[")):
            raise ProgramError(f"#<{name}> belongs to the control and is not known off line", code="OLP541")
        table = self.globals if name.startswith("_") else self.names
        self._settled(name, table.get(name, 0.0))
        return self._predefined(name) is not None or name in table

    def _predefined(self, name: str) -> Callable[[], float] | None:
        state = self.state
        if name in ("_x", "_y", "_z"):
            return lambda: state.position_of("xyz".index(name[1]))
        if name in ("_metric", "_imperial"):
            return lambda: float((self._set(state.unit, name) == METRIC) is (name == "_metric"))
        if name in ("_absolute", "_incremental"):
            return lambda: float(state.absolute is (name == "_absolute"))
        if name == "_plane":
            return lambda: float(state.plane)
        if name == "_motion_mode":
            return lambda: float(self._set(state.motion, name))
        if name in _FEED_MODES:
            return lambda: float(state.feed_mode == _FEED_MODES[name])
        if name in ("_spindle_on", "_spindle_cw"):
            codes = (3,) if name == "_spindle_cw" else (3, 4)
            return lambda: float(self._set(state.spindle, name) in codes)
        if name in ("_feed", "_rpm"):
            return lambda: float(self._set(state.feed if name == "_feed" else state.speed, name))
        return None

    def _set(self, value: float | None, name: str) -> float:
        if value is None:
            raise ProgramError(f"#<{name}> is used before the program sets it", code="OLP541")
        return value

    def assign(self, target: int | str, value: float | None) -> None:
        if isinstance(target, str):
            if self._predefined(target) is not None:
                raise ProgramError(f"#<{target}> belongs to the control and cannot be set", code="OLP544")
            table = self.globals if target.startswith("_") else self.names
            self._settled(target, table.get(target, 0.0))
            table[target] = filled(value)
        elif self.state.profile.language.macro_b:
            self._assign_macro_b(target, value)
        elif 1 <= target <= _NGC_LOCAL:
            self.locals[target] = value
        elif 1 <= target <= _NGC_FREE or target == _DEBUG_SWITCH:
            self.common[target] = value
        else:
            raise ProgramError(
                f"#{target} belongs to the control, and no plain block has the effect of setting it",
                code="OLP544",
            )

    def _assign_macro_b(self, index: int, value: float | None) -> None:
        if 1 <= index <= _MACRO_B_LOCAL:
            self.locals[index] = value
        elif self._is_common(index):
            self.common[self._one(index)] = value
        elif index == 3000:
            raise ProgramError("the program stops here with its own alarm (#3000)", code="OLP544")
        elif index not in (3003, 3004):
            raise ProgramError(
                f"#{index} belongs to the control, and no plain block has the effect of setting it",
                code="OLP544",
            )


def _feed_is_whole(state: ProgramState) -> bool:
    """Whether F without a point is in units per minute, whatever the least increment of lengths is."""
    return state.profile.feed_without_point and state.feed_mode == _FEED_MODES["_units_per_minute"]


def macro_arguments(line: Line, variables: Variables) -> Iterator[tuple[int, float | None]]:
    """(variable, value) of G65's words; I, J, K may come in several sets, as in argument list II."""
    group, last = 0, ""
    for word in line.words:
        letter = word.letter
        if letter in _NOT_ARGUMENTS:
            continue
        if letter not in _ARGUMENTS:
            raise ProgramError(
                f"G65 has the argument {letter.upper()}, which is not an argument of a macro", code="OLP516"
            )
        value = word.number if word.value is None else word.value(variables)
        counts = letter in _COUNT_ARGUMENTS or (letter == "f" and _feed_is_whole(variables.state))
        if word.value is None and not (word.pointed or counts or variables.units_known) and value != 0:
            raise ProgramError(
                f"the argument {letter.upper()} has no decimal point, so the control scales it by its least "
                'increment; write the point, or state decimal_point = "calculator" in the machine file where '
                "the control is set so",
                code="OLP516",
            )
        index = _ARGUMENTS[letter]
        if letter in "ijk":
            group += bool(last) and letter <= last
            last = letter
            index += 3 * group
        yield index, value
