"""Expressions of parametric programs: `#1`, `#<name>`, `[ ]`, functions and operators.

There are three kinds of arithmetic. `NGC` follows RS-274/NGC (NIST IR 6556, section 3.3.2) as LinuxCNC
evaluates it. `**` binds tightest, then `* / MOD`, then `+ -`, then comparisons, then `AND OR XOR`, all from
left to right. A sign belongs to its operand, so -2**2 is 4. EQ and NE compare within 1e-4. `MACRO_B` is
Custom Macro B: `* / MOD AND`, then `+ - OR XOR`, then comparisons. FIX and FUP count by magnitude. A variable
that was never set is *vacant* (None): 0 in arithmetic and equal to #0 only. `USER_TASKS` is that of Okuma.

Text is compact and lower case: the caller has removed blanks and comments. Angles are in degrees.
Every error is a ProgramError without a line, which the caller adds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Protocol

from olp.core.errors import ProgramError
from olp.core.patterns import pattern
from olp.core.values import dataclass

#: LinuxCNC takes two numbers as equal, and a number as an integer, within this.
EQUAL_WITHIN = 1e-4


class Parameters(Protocol):
    """Where an expression finds its parameters; raises ProgramError for values that are not known off
    line."""

    def number(self, index: int) -> float | None:
        """Value of #index; None is a vacant variable."""
        ...

    def named(self, name: str) -> float:
        """Value of #<name>."""
        ...

    def exists(self, name: str) -> bool:
        """Whether #<name> is defined."""
        ...


#: A compiled expression. None is a vacant variable, and only a bare variable can be vacant.
Expression = Callable[[Parameters], float | None]
Binary = Callable[[float, float], float]
#: An operator with operands that may be vacant.
_Join = Callable[[float | None, float | None], float]


@dataclass(frozen=True, slots=True)
class Arithmetic:
    """How a control evaluates expressions. `levels` are the operators of each level, the loosest first.
    `angle` is that of rise and run (ATAN[y]/[x]), `single_atan` whether ATAN takes one argument, too. With
    `exact` EQ and NE compare exactly, and a vacant variable equals a vacant one only. `two_letters`: two
    letters stand for a function or WHILE, as Fanuc's manual B-64304EN (16.4) has it for functions."""

    levels: tuple[tuple[str, ...], ...]
    operators: Mapping[str, Binary]
    functions: Mapping[str, Callable[[float], float]]
    angle: Binary
    single_atan: bool
    exact: bool
    two_letters: bool = False


_NUMBER = pattern(r"[+-]?(?:\d+\.?\d*|\.\d+)")
_UNSIGNED = pattern(r"\d+\.?\d*|\.\d+")
_FUNCTION = pattern(r"(abs|acos|asin|atan|cos|exp|fix|fup|ln|round|rnd|sin|sqrt|sqr|tan|exists)(?=\[)")
_TWO_LETTERS = pattern(r"(ab|ac|as|at|co|ex|fi|fu|ro|si|sq|ta)(?=\[)")
_LONG = {
    name[:2]: name
    for name in ("abs", "acos", "asin", "atan", "cos", "exp", "fix", "fup", "round", "sin", "sqrt", "tan")
}
_OPERATOR = pattern(r"\*\*|\*|/|\+|-|mod|and|xor|or|eq|ne|gt|ge|lt|le")
_COMPARISONS = ("eq", "ne", "gt", "ge", "lt", "le")
#: levels of nesting in an expression at most
_MAX_DEPTH = 60


def whole(value: float, what: str) -> int:
    """`value` as an integer where it is one within 1e-4; ProgramError otherwise."""
    nearest = math.floor(value + 0.5) if math.isfinite(value) else 0
    if not math.isfinite(value) or abs(value - nearest) > EQUAL_WITHIN:
        raise ProgramError(f"{what} is {value:g}; expected an integer", code="OLP540")
    return nearest


def filled(value: float | None) -> float:
    """A vacant variable counts as zero in arithmetic."""
    return 0.0 if value is None else value


class Reader:
    """Compiles the values of one line; `position` is the present position in `text`."""

    def __init__(self, text: str, arithmetic: Arithmetic, position: int = 0) -> None:
        self.text = text
        self.arithmetic = arithmetic
        self.position = position
        self._depth = 0

    def number(self) -> float | None:
        """A plain number at this position, None where there is none; moves past it."""
        match = _NUMBER.match(self.text, self.position)
        if match is None:
            return None
        self.position = match.end()
        return plain_number(match.group())

    def value(self) -> Expression:
        """A real value: number, parameter, function or bracketed expression, with an optional sign."""
        self._depth += 1
        if self._depth > _MAX_DEPTH:
            raise ProgramError(
                f"an expression is nested deeper than {_MAX_DEPTH}; split it over lines", code="OLP543"
            )
        try:
            return self._value()
        finally:
            self._depth -= 1

    def _value(self) -> Expression:
        text, start = self.text, self.position
        head = text[start : start + 1]
        if head in ("+", "-"):
            self.position += 1
            operand = self.value()
            return operand if head == "+" else _negated(operand)
        if head == "[":
            return self.bracket()
        if head == "#":
            return self.parameter()
        plain = _UNSIGNED.match(text, start)
        if plain:
            self.position = plain.end()
            return _constant(plain_number(plain.group()))
        function = _FUNCTION.match(text, start)
        if function:
            self.position = function.end()
            return self._call(function.group(1))
        short = _TWO_LETTERS.match(text, start) if self.arithmetic.two_letters else None
        if short:
            self.position = short.end()
            return self._call(_LONG[short.group(1)])
        raise ProgramError(
            f"expected a number, a parameter or [expression] at {text[start : start + 12]!r}", code="OLP540"
        )

    def parameter_index(self) -> Callable[[Parameters], int | str]:
        """Index (int) or name (str) of the parameter at this position, which starts with `#`."""
        self.position += 1
        if self.text.startswith("<", self.position):
            end = self.text.find(">", self.position)
            if end < 0:
                raise ProgramError("a parameter name has no closing '>'", code="OLP540")
            name = self.text[self.position + 1 : end]
            self.position = end + 1
            return lambda _: name
        index = self.value()
        return lambda parameters: whole(filled(index(parameters)), "a parameter number")

    def parameter(self) -> Expression:
        where = self.parameter_index()

        def read(parameters: Parameters) -> float | None:
            key = where(parameters)
            return parameters.named(key) if isinstance(key, str) else parameters.number(key)

        return read

    def bracket(self) -> Expression:
        """`[expression]`."""
        self._expect("[")
        inside = self._level(0)
        self._expect("]")
        return inside

    def unbracketed(self) -> Expression:
        """An expression without brackets around it, as Macro B has it to the right of `=`."""
        return self._level(0)

    def skip(self) -> None:
        """Move past blanks, which only some languages keep."""
        while self.text.startswith(" ", self.position):
            self.position += 1

    def _level(self, level: int) -> Expression:
        levels = self.arithmetic.levels
        if level == len(levels):
            return self.value()
        first = self._level(level + 1)
        rest: list[tuple[_Join, Expression]] = []
        while True:
            self.skip()
            match = _OPERATOR.match(self.text, self.position)
            if match is None or match.group() not in levels[level]:
                return _chained(first, tuple(rest)) if rest else first
            self.position = match.end()
            rest.append((self._join(match.group()), self._level(level + 1)))

    def _join(self, operator: str) -> _Join:
        if self.arithmetic.exact and operator in ("eq", "ne"):
            same = operator == "eq"
            return lambda first, second: float((first == second) is same)
        function = self.arithmetic.operators[operator]
        return lambda first, second: _finite(function(filled(first), filled(second)), operator)

    def _call(self, name: str) -> Expression:
        if name == "exists":
            self._expect("[")
            if not self.text.startswith("#<", self.position):
                raise ProgramError("EXISTS takes a named parameter, as in EXISTS[#<name>]", code="OLP540")
            where = self.parameter_index()
            self._expect("]")
            return lambda parameters: float(parameters.exists(str(where(parameters))))
        argument = self.bracket()
        if name == "atan":
            if self.text.startswith("/[", self.position):
                self.position += 1
                run = self.bracket()
                angle = self.arithmetic.angle
                return lambda p: angle(filled(argument(p)), filled(run(p)))
            if not self.arithmetic.single_atan:
                raise ProgramError("ATAN takes two arguments, as in ATAN[y]/[x]", code="OLP540")
            return lambda p: math.degrees(math.atan(filled(argument(p))))
        function = self.arithmetic.functions[name]
        return lambda p: _finite(function(filled(argument(p))), name)

    def _expect(self, character: str) -> None:
        if not self.text.startswith(character, self.position):
            rest = self.text[self.position : self.position + 12]
            raise ProgramError(f"expected {character!r} in an expression, found {rest!r}", code="OLP540")
        self.position += 1


def _chained(first: Expression, rest: tuple[tuple[_Join, Expression], ...]) -> Expression:
    """Operators of one level, from left to right. A loop, so that a long sum needs no deep stack."""

    def chained(parameters: Parameters) -> float | None:
        value = first(parameters)
        for join, operand in rest:
            value = join(value, operand(parameters))
        return value

    return chained


def _constant(value: float) -> Expression:
    return lambda _: value


def plain_number(text: str) -> float:
    """The number that a text writes. Raises ProgramError where it is too large for any control."""
    value = float(text)
    if not math.isfinite(value):
        raise ProgramError(
            f"a number of {len(text)} digits is too large; expected at most 300", code="OLP540"
        )
    return value


def _negated(operand: Expression) -> Expression:
    return lambda parameters: -filled(operand(parameters))


def _finite(value: float, what: str) -> float:
    if not math.isfinite(value):
        raise ProgramError(f"{what.upper()} gives a number that is not finite", code="OLP540")
    return value


def _divide(a: float, b: float) -> float:
    if b == 0:
        raise ProgramError("division by zero in an expression", code="OLP540")
    return a / b


def _modulo(a: float, b: float) -> float:
    if b == 0:
        raise ProgramError("MOD by zero in an expression", code="OLP540")
    rest = math.fmod(a, b)
    return rest + abs(b) if rest < 0 else rest


def _fanuc_modulo(a: float, b: float) -> float:
    if b == 0:
        raise ProgramError("MOD by zero in an expression", code="OLP540")
    return math.fmod(a, b)


def _power(a: float, b: float) -> float:
    try:
        return math.pow(a, b)
    except (ValueError, OverflowError):
        raise ProgramError(f"{a:g} ** {b:g} has no finite real value", code="OLP540") from None


def _guarded(function: Callable[[float], float], name: str) -> Callable[[float], float]:
    def call(x: float) -> float:
        try:
            return function(x)
        except (ValueError, OverflowError):
            raise ProgramError(f"{name}[{x:g}] has no finite real value", code="OLP540") from None

    return call


def _atan2_degrees(rise: float, run: float) -> float:
    return math.degrees(math.atan2(rise, run))


def _atan2_of_positive(rise: float, run: float) -> float:
    if rise < 0:
        raise ProgramError(
            "ATAN of a negative first argument is in 0..360 or in -180..180, as a parameter of the control "
            "decides, which is not known off line; write the angle with ACOS or ASIN",
            code="OLP541",
        )
    return math.degrees(math.atan2(rise, run))


def _bits(function: Callable[[int, int], int], name: str) -> Binary:
    return lambda a, b: float(function(whole(a, f"an operand of {name}"), whole(b, f"an operand of {name}")))


_ARITHMETIC: dict[str, Binary] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": _divide,
    "gt": lambda a, b: float(a > b),
    "ge": lambda a, b: float(a >= b),
    "lt": lambda a, b: float(a < b),
    "le": lambda a, b: float(a <= b),
}
_NGC_OPERATORS: dict[str, Binary] = _ARITHMETIC | {
    "**": _power,
    "mod": _modulo,
    "eq": lambda a, b: float(abs(a - b) < EQUAL_WITHIN),
    "ne": lambda a, b: float(abs(a - b) >= EQUAL_WITHIN),
    "and": lambda a, b: float(a != 0 and b != 0),
    "or": lambda a, b: float(a != 0 or b != 0),
    "xor": lambda a, b: float((a != 0) != (b != 0)),
}
_MACRO_B_OPERATORS: dict[str, Binary] = _ARITHMETIC | {
    "mod": _fanuc_modulo,
    "and": _bits(lambda a, b: a & b, "AND"),
    "or": _bits(lambda a, b: a | b, "OR"),
    "xor": _bits(lambda a, b: a ^ b, "XOR"),
}


def _round_half_away(x: float) -> float:
    return math.copysign(math.floor(abs(x) + 0.5), x)


_FUNCTIONS: dict[str, Callable[[float], float]] = {
    "abs": abs,
    "acos": _guarded(lambda x: math.degrees(math.acos(x)), "ACOS"),
    "asin": _guarded(lambda x: math.degrees(math.asin(x)), "ASIN"),
    "cos": lambda x: math.cos(math.radians(x)),
    "exp": _guarded(math.exp, "EXP"),
    "fix": lambda x: float(math.floor(x)),
    "fup": lambda x: float(math.ceil(x)),
    "ln": _guarded(math.log, "LN"),
    "round": _round_half_away,
    "rnd": _round_half_away,
    "sin": lambda x: math.sin(math.radians(x)),
    "sqrt": _guarded(math.sqrt, "SQRT"),
    "sqr": _guarded(math.sqrt, "SQRT"),
    "tan": lambda x: math.tan(math.radians(x)),
}
_BY_MAGNITUDE: dict[str, Callable[[float], float]] = {
    "fix": lambda x: float(math.trunc(x)),
    "fup": lambda x: math.copysign(math.ceil(abs(x)), x),
}

NGC = Arithmetic(
    levels=(("and", "or", "xor"), _COMPARISONS, ("+", "-"), ("*", "/", "mod"), ("**",)),
    operators=_NGC_OPERATORS,
    functions=_FUNCTIONS,
    angle=_atan2_degrees,
    single_atan=False,
    exact=False,
)
MACRO_B = Arithmetic(
    levels=(_COMPARISONS, ("+", "-", "or", "xor"), ("*", "/", "mod", "and")),
    operators=_MACRO_B_OPERATORS,
    functions=_FUNCTIONS | _BY_MAGNITUDE,
    angle=_atan2_of_positive,
    single_atan=True,
    exact=True,
    two_letters=True,
)
#: Logical operators are left out: how they rank is not known.
USER_TASKS = Arithmetic(
    levels=(_COMPARISONS, ("+", "-"), ("*", "/")),
    operators=_MACRO_B_OPERATORS,
    functions=_FUNCTIONS,
    angle=_atan2_degrees,
    single_atan=True,
    exact=True,
)
