"""Lines of parametric programs of Okuma (user tasks): variables with names, CALL, RTS, IF and GOTO.

Common variables are VC1 and so on, local ones have names of two letters or more; other names that begin with
V belong to the control. A word takes its value behind `=`. Blanks separate names, so they are kept as one
where both neighbours are letters or digits. What the manuals leave open is refused.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable

from olp.core.errors import ProgramError
from olp.program.rs274.flatten.expressions import (
    Expression,
    Parameters,
    Reader,
    filled,
    plain_number,
    whole,
)
from olp.program.rs274.flatten.language import Language
from olp.program.rs274.flatten.lines import Assignment, Flow, Line, Word, compact

_LABEL = re.compile(r"n(?:\d+|[a-z][a-z0-9]*)(?![=.])")
_NAME = re.compile(r"[a-z]{2}[a-z0-9]*")
_TARGET = re.compile(r"v[a-z]+\[|[a-z]{2}[a-z0-9]*=")
_WORD = re.compile(r"([a-z])(=| ?(?=[-+.\d]))")
_OF_SPINDLE = re.compile(r"([hd])[abc](?:(?=[hd][abc](?![a-z0-9=\[]))|(?![a-z0-9=\[]))")
_LITERAL = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)")
_COMMON = re.compile(r"vc\d+")
_FUNCTION = re.compile(r"(abs|atan2|atan|cos|fix|fup|mod|round|sin|sqrt|tan)\[")
_EMPTY = re.compile(r"\[ ?([a-z0-9]+) (eq|ne) empty ?\]")
_STATEMENT = re.compile(r"(call|goto|if|modin|modout|rts)(?![a-z0-9=])")
_COUNT = re.compile(r"q(?:=|(?=\d))")
#: what a line has that only user tasks have
_OWN = re.compile(r"[=\[]|call|goto|rts|mod(?:in|out)")
_PAIRS = frozenset({"atan2", "mod"})
#: characters of a text that a message shows
_SHOWN = 30


def compile_line(line: bytes, number: int, language: Language) -> Line:
    """Compile one line with its end. Raises ProgramError (without a line) for a broken expression."""
    raw = line.rstrip(b"\r\n")
    eol = line[len(raw) :]
    text, places, comments = compact(raw, keep_blanks=True)
    if text.startswith("%"):
        return Line(number, raw, eol, percent=True)
    start = 0
    deleted = text.startswith("/")
    if deleted:
        start = 2 if text[1:2].isdigit() and text[2:3] else 1
    task = _Task(text, language, start, places)
    try:
        task.run()
    except ProgramError:
        if _OWN.search(text):
            raise
        return Line(number, raw, eol, deleted=deleted, opaque=True, comments=comments)
    return Line(
        number, raw, eol, deleted=deleted, words=tuple(task.words), assignments=tuple(task.assignments),
        flow=task.flow, label=task.label, comments=comments,
    )  # fmt: skip


class _Task(Reader):
    """Reads a line: its label, and words, an assignment or a statement of flow."""

    def __init__(self, text: str, language: Language, position: int, places: list[int]) -> None:
        super().__init__(text, language.arithmetic, position)
        self.language = language
        self.places = places
        self.words: list[Word] = []
        self.assignments: list[Assignment] = []
        self.flow: Flow | None = None
        self.label = ""

    def run(self) -> None:
        self._label()
        if self.text.startswith("o", self.position):
            self.flow = Flow("program", self._program())
        elif statement := _STATEMENT.match(self.text, self.position):
            self.position = statement.end()
            self.flow = self._statement(statement.group(1))
        elif _TARGET.match(self.text, self.position):
            self._assignment()
        while self.position < len(self.text):
            if self.flow is not None or self.assignments:
                raise self._odd("the end of the line")
            self._word()

    def _label(self) -> None:
        label = _LABEL.match(self.text, self.position)
        if label is None:
            return
        start, self.position = self.position, label.end()
        self.label = _label_of(label.group()[1:])
        named = not self.label.isdigit()
        number = 0.0 if named else float(self.label)
        # a name of letters is left out of the plain text, where it is no word
        self._put("n", number, _nothing if named else None, start, start + 1)
        self.skip()

    def _statement(self, name: str) -> Flow:
        self.skip()
        if name == "rts":
            return Flow("rts", "")
        if name == "goto":
            return Flow("jump", self._target())
        if name == "if":
            condition = self._condition()
            self.skip()
            if self.text.startswith("goto", self.position):
                self.position += 4
                self.skip()
            return Flow("jump", self._target(), None, (condition,))
        if name == "call":
            return self._call_of_program()
        raise ProgramError(
            f"{name.upper()} calls a program after each move, which is not unrolled", code="OLP544"
        )

    def _program(self) -> str:
        return _label_of(self._rest("o[a-z0-9]+", "O with the name of a program")[1:])

    def _target(self) -> str:
        return _label_of(self._rest(_LABEL.pattern, "N with a number or a name")[1:])

    def _condition(self) -> Expression:
        vacant = _EMPTY.match(self.text, self.position)
        if vacant is None:
            return self.bracket()
        self.position = vacant.end()
        name, same = vacant.group(1), vacant.group(2) == "eq"
        key = _key(name)
        return lambda parameters: float(parameters.exists(key) is not same)

    def _call_of_program(self) -> Flow:
        """CALL Oname Qcount NAME=value ..."""
        label = self._program()
        names: list[str] = []
        values: list[Expression] = [_constant(1.0)]
        while self.position < len(self.text):
            self.skip()
            count = _COUNT.match(self.text, self.position)
            if count is not None:
                self.position = count.end()
                values[0] = self.value()
                continue
            names.append(self._rest(_NAME.pattern, "NAME=value"))
            self._expect("=")
            values.append(self.unbracketed())
        return Flow("call-task", label, None, tuple(values), tuple(names))

    def _assignment(self) -> None:
        start = self.position
        target = self._variable()
        self._expect("=")
        value = self.unbracketed()
        self.assignments.append(Assignment(target, value, self.places[start], self._end()))
        self.skip()

    def _word(self) -> None:
        self.skip()
        start = self.position
        own = _OF_SPINDLE.match(self.text, start)
        if own is not None:
            # its number is that of the tool in the spindle: it stays a letter
            self.position = own.end()
            self._put(own[1], 0.0, None, start, start + 1)
            return
        word = _WORD.match(self.text, start)
        if word is None:
            raise self._odd("a word")
        letter = word.group(1)
        literal = _LITERAL.match(self.text, word.end())
        if not word.group(2).startswith("=") and literal is not None:
            self.position = literal.end()
            self._put(letter, plain_number(literal.group()), None, start, word.end(), "." in literal.group())
            return
        self.position = word.end()
        value = self.unbracketed()
        if self.language.increments_open and letter not in self.language.counts:
            raise ProgramError(
                f"whether {letter.upper()}= counts millimetres or least increments is a setting; "
                'state decimal_point = "calculator" in the machine file where X100 is 100 mm',
                code="OLP541",
            )
        # `=` is left out of the plain text
        self._put(letter, 0.0, value, start, start + 1)

    def _put(
        self, letter: str, number: float, value: Expression | None, start: int, value_start: int,
        pointed: bool = False,
    ) -> None:  # fmt: skip
        places = self.places
        self.words.append(
            Word(letter, number, value, pointed, places[start], places[value_start - 1] + 1, self._end())
        )

    def _end(self) -> int:
        """Where in the bytes what was read last ends."""
        return self.places[len(self.text[: self.position].rstrip()) - 1] + 1

    def _rest(self, pattern: str, expected: str) -> str:
        match = re.compile(pattern).match(self.text, self.position)
        if match is None:
            raise self._odd(expected)
        self.position = match.end()
        return match.group()

    def _odd(self, expected: str) -> ProgramError:
        rest = self.text[self.position : self.position + _SHOWN].upper()
        return ProgramError(f"expected {expected} at {rest!r}", code="OLP510")

    # --- expressions ----------------------------------------------------------------------------------------

    def _value(self) -> Expression:
        self.skip()
        text = self.text
        if text[self.position : self.position + 1] in ("+", "-", "["):
            return super()._value()
        function = _FUNCTION.match(text, self.position)
        if function is not None:
            self.position = function.end()
            return self._function(function.group(1))
        if text[self.position : self.position + 1].isalpha():
            where = self._variable()
            return lambda parameters: parameters.named(where(parameters))
        return super()._value()

    def _function(self, name: str) -> Expression:
        first = self.unbracketed()
        if name not in _PAIRS:
            self._expect("]")
            function = _FUNCTIONS[name]
            return lambda p: _finite(function(filled(first(p))), name)
        self._expect(",")
        second = self.unbracketed()
        self._expect("]")
        pair = _OF_TWO[name]
        return lambda p: pair(filled(first(p)), filled(second(p)))

    def _variable(self) -> Callable[[Parameters], str]:
        if self.text.startswith("vc[", self.position):
            self.position += 2
            index = self.bracket()
            return lambda p: f"_vc{whole(filled(index(p)), 'the number of a variable')}"
        key = _key(self._rest(_NAME.pattern, "a variable"))
        return lambda _: key


def _key(name: str) -> str:
    """A variable as the run names it: common ones begin with `_`."""
    if name.startswith("v") and not _COMMON.fullmatch(name):
        raise ProgramError(
            f"{name.upper()} belongs to the control and is not known off line; post the program without it",
            code="OLP541",
        )
    return f"_{name}" if name.startswith("v") else name


def _label_of(text: str) -> str:
    return (text.lstrip("0") or "0") if text.isdigit() else text


def _nothing(_: Parameters) -> None:
    return None


def _constant(value: float) -> Expression:
    return lambda _: value


def _finite(value: float, name: str) -> float:
    if not math.isfinite(value):
        raise ProgramError(f"{name.upper()} gives a number that is not finite", code="OLP540")
    return value


def _not_below_zero(function: Callable[[float], float], name: str) -> Callable[[float], float]:
    def call(x: float) -> float:
        if x < 0:
            raise ProgramError(
                f"{name}[{x:g}]: what this control makes of numbers below zero is not known", code="OLP540"
            )
        return function(x)

    return call


def _modulo(a: float, b: float) -> float:
    if b <= 0 or a < 0:
        raise ProgramError(f"MOD[{a:g},{b:g}]: expected numbers above zero", code="OLP540")
    return math.fmod(a, b)


_FUNCTIONS: dict[str, Callable[[float], float]] = {
    "abs": abs,
    "atan": lambda x: math.degrees(math.atan(x)),
    "cos": lambda x: math.cos(math.radians(x)),
    "fix": _not_below_zero(math.floor, "FIX"),
    "fup": _not_below_zero(math.ceil, "FUP"),
    "round": _not_below_zero(lambda x: math.floor(x + 0.5), "ROUND"),
    "sin": lambda x: math.sin(math.radians(x)),
    "sqrt": _not_below_zero(math.sqrt, "SQRT"),
    "tan": lambda x: math.tan(math.radians(x)),
}
_OF_TWO: dict[str, Callable[[float, float], float]] = {
    "atan2": lambda a, b: math.degrees(math.atan2(a, b)),
    "mod": _modulo,
}
