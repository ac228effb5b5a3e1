"""Expressions of Sinumerik programs: R-parameters, variables, functions and operators.

Source: Siemens, Programming Manual Job Planning, sections on arithmetic functions and on the priority of
operations. Comparisons come last there, so AND and OR of comparisons need brackets.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, MutableMapping
from functools import lru_cache
from operator import add, mul, sub

from olp.core.errors import ProgramError
from olp.core.patterns import PARAMETER_NAMES

Value = float | bool | str
#: Names of variables by their capitals, an index in brackets among them.
Variables = MutableMapping[str, Value]
#: An expression that was read.
Term = Callable[[Variables], Value]

_TOKEN = re.compile(
    r"[ \t]*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:EX[+-]?\d+)?)|(?P<text>\"[^\"]*\")"
    r"|(?P<name>[$A-Z_][$A-Z0-9_]*)|(?P<sign><<|<>|==|<=|>=|[-+*/<>()\[\],]))",
    re.IGNORECASE,
)
#: Operators by their priority, the first bind closest.
_LEVELS: tuple[tuple[str, ...], ...] = (
    ("==", "<>", "<", ">", "<=", ">="), ("OR",), ("XOR",), ("AND",), ("+", "-"), ("*", "/", "DIV", "MOD"),
)  # fmt: skip
_RANK: Mapping[str, int] = {sign: rank for rank, signs in enumerate(_LEVELS) for sign in signs}
#: Operators that two numbers always have.
_PLAIN: Mapping[str, Callable[[float, float], float]] = {
    "+": add, "-": sub, "*": mul,
}  # fmt: skip
#: The kind of what is no token.
_BAD = "bad"
#: Expressions that are kept as they were read: a program has fewer, and runs each many times.
_KEPT = 4096
_LOGICAL = frozenset({"OR", "XOR", "AND"})


def _degrees(function: Callable[[float], float]) -> Callable[[float], float]:
    return lambda angle: function(math.radians(angle))


_FUNCTIONS: Mapping[str, tuple[int, Callable[..., float]]] = {
    "SIN": (1, _degrees(math.sin)), "COS": (1, _degrees(math.cos)), "TAN": (1, _degrees(math.tan)),
    "ASIN": (1, lambda v: math.degrees(math.asin(v))), "ACOS": (1, lambda v: math.degrees(math.acos(v))),
    "ATAN2": (2, lambda y, x: math.degrees(math.atan2(y, x))), "SQRT": (1, math.sqrt), "ABS": (1, abs),
    "POT": (1, lambda v: v * v), "TRUNC": (1, math.trunc), "ROUND": (1, lambda v: math.floor(v + 0.5)),
    "LN": (1, math.log), "EXP": (1, math.exp), "MINVAL": (2, min), "MAXVAL": (2, max),
    "BOUND": (3, lambda low, high, v: min(max(v, low), high)),
}  # fmt: skip
_NAMED: Mapping[str, Value] = {"TRUE": True, "FALSE": False, "$PI": math.pi}


def evaluate(text: str, variables: Variables) -> Value:
    """The value of an expression. Raises ProgramError, without a line, for what cannot be computed here."""
    return _read(text)(variables)


def number(text: str, variables: Variables) -> float:
    """The value of an expression that is a number."""
    value = evaluate(text, variables)
    if isinstance(value, str) or not math.isfinite(value):
        raise ProgramError(f"`{text.strip()}` has no value that is a number", code="OLP540")
    return float(value)


def _tokens(text: str) -> tuple[tuple[str, str], ...]:
    """The kind and the text of each token; the last one is empty, or of the kind of what is none."""
    tokens, place = [], 0
    while (match := _TOKEN.match(text, place)) is not None:
        kind = match.lastgroup or ""
        tokens.append((kind, match[kind] if kind == "text" else match[kind].upper()))
        place = match.end()
    return (*tokens, (_BAD if text[place:].strip() else "", ""))


@lru_cache(_KEPT)
def _read(text: str) -> Term:
    """An expression as a function of the variables. Raises ProgramError where it is none."""
    reading = _Reading(text)
    term = reading.level(0)
    if reading.kind:
        raise reading.error("is not an expression")
    return term


class _Reading:
    """One expression while it is read: the present token, its kind empty behind the last one."""

    def __init__(self, text: str) -> None:
        self.text = text
        self._tokens = iter(_tokens(text))
        self.kind, self.token = "", ""
        self.next()

    def error(self, what: str, code: str = "OLP540") -> ProgramError:
        return ProgramError(f"`{self.text.strip()}` {what}", code=code)

    def next(self) -> None:
        """Go on to the next token."""
        self.kind, self.token = next(self._tokens, ("", ""))
        if self.kind == _BAD:
            raise self.error("is not an expression")

    def level(self, depth: int) -> Term:
        """A value made by the operators of this priority and closer ones."""
        value = self._signed()
        while self.kind != "text":
            rank = _RANK.get(self.token, -1)
            if rank < depth:
                break
            operator = self.token
            self.next()
            value = self._joined(operator, value, self.level(rank + 1))
        return value

    def _joined(self, operator: str, left: Term, right: Term) -> Term:
        plain = _PLAIN.get(operator)

        def term(variables: Variables) -> Value:
            first, second = left(variables), right(variables)
            if plain is not None and type(first) is float and type(second) is float:
                return plain(first, second)
            return self._applied(operator, first, second)

        return term

    def _applied(self, operator: str, left: Value, right: Value) -> Value:
        if operator in _LOGICAL:
            if not isinstance(left, bool) or not isinstance(right, bool):
                raise self.error(f"joins numbers with {operator}; put each comparison into brackets")
            return {"OR": left or right, "AND": left and right, "XOR": left != right}[operator]
        if isinstance(left, str) or isinstance(right, str):
            if operator in ("==", "<>") and isinstance(left, str) and isinstance(right, str):
                return (left == right) == (operator == "==")
            raise self.error("mixes text and numbers")
        if operator in _LEVELS[0]:
            same = math.isclose(left, right, rel_tol=1e-12, abs_tol=1e-12)
            less = left < right and not same
            return {"==": same, "<>": not same, "<": less, "<=": less or same, ">": not (less or same),
                    ">=": not less}[operator]  # fmt: skip
        if operator in _PLAIN:
            return _PLAIN[operator](left, right)
        if not right:
            raise self.error("divides by zero")
        if operator == "DIV":
            return float(math.trunc(left / right))
        return math.fmod(left, right) if operator == "MOD" else left / right

    def _signed(self) -> Term:
        if self.token not in ("-", "+", "NOT") or self.kind == "text":
            return self._operand()
        sign = self.token
        self.next()
        operand = self._signed()

        def term(variables: Variables) -> Value:
            value = operand(variables)
            if (sign == "NOT") != isinstance(value, bool) or isinstance(value, str):
                raise self.error(f"has {sign} in front of a value that takes none")
            return not value if sign == "NOT" else -value if sign == "-" else value

        return term

    def _operand(self) -> Term:
        kind, token = self.kind, self.token
        self.next()
        if kind == "number":
            body, _, power = token.partition("EX")
            return _constant(float(body) * 10.0 ** int(power or 0))
        if kind == "text":
            return _constant(token[1:-1])
        if (kind, token) == ("sign", "("):
            inner = self.level(0)
            self._expect(")")
            return inner
        if kind != "name":
            raise self.error("is not an expression")
        if (self.kind, self.token) == ("sign", "("):
            return self._called(token)
        if (self.kind, self.token) != ("sign", "["):
            return _constant(_NAMED[token]) if token in _NAMED else lambda variables: _value(token, variables)
        self.next()
        index = [self.level(0)]
        while self.token == ",":
            self.next()
            index.append(self.level(0))
        self._expect("]")
        return lambda variables: _value(indexed(token, [self._whole(i(variables)) for i in index]), variables)

    def _whole(self, value: Value) -> int:
        if isinstance(value, str) or value != round(value):
            raise self.error("has an index that is not an integer")
        return round(value)

    def _called(self, name: str) -> Term:
        if name not in _FUNCTIONS:
            raise self.error(f"calls {name}, whose value only the control knows", "OLP541")
        count, function = _FUNCTIONS[name]
        self.next()
        given = [self.level(0)]
        while self.token == "," and self.kind == "sign":
            self.next()
            given.append(self.level(0))
        self._expect(")")

        def term(variables: Variables) -> Value:
            values = [each(variables) for each in given]
            if len(values) != count or any(isinstance(value, str) for value in values):
                raise self.error(f"gives {name} other arguments than {count} numbers")
            try:
                return float(function(*values))
            except (ValueError, OverflowError):
                raise self.error(f"has no value of {name}") from None

        return term

    def _expect(self, sign: str) -> None:
        if (self.kind, self.token) != ("sign", sign):
            raise self.error(f"lacks a `{sign}`")
        self.next()


def _constant(value: Value) -> Term:
    return lambda variables: value


def _value(name: str, variables: Variables) -> Value:
    try:
        return variables[name]
    except KeyError:
        named = PARAMETER_NAMES.fullmatch(name)
        stated = "give it in the table [parameters] of the job file, or " if named else ""
        raise ProgramError(
            f"{name} has no value that the program sets; {stated}set it in the program", code="OLP541"
        ) from None


def indexed(name: str, index: list[int]) -> str:
    """The name of an element of an array; R[5] is R5."""
    if name == "R" and len(index) == 1:
        return f"R{index[0]}"
    return f"{name}[{','.join(map(str, index))}]"
