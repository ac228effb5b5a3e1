"""Values of Heidenhain programs: numbers, parameters Q, QL, QR, formulas, and the functions FN 0 to FN 13."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from functools import reduce

from olp.core.errors import ProgramError

_TOKEN = re.compile(rb"\s*(\d+\.?\d*|\.\d+|Q[LR]?\d+|PI|[A-Z]+|[-+*/%^()])", re.I)
_FN = re.compile(rb"FN[ \t]*(\d+)[ \t]*:[ \t]*(Q[LR]?\d+)[ \t]*=[ \t]*(.*)", re.I | re.S)
_VALUE = rb"[-+]?[ \t]*(?:\d+\.?\d*|\.\d+|Q[LR]?\d+)"
_PAIR = re.compile(
    rb"(" + _VALUE + rb")[ \t]*(\+|-(?=[ \t]*[-+])|-|\*|DIV|LEN|ANG)[ \t]*(" + _VALUE + rb")\Z", re.I
)
_ONE = re.compile(rb"(SQRT|SIN|COS)?[ \t]*(" + _VALUE + rb")\Z", re.I)
#: levels of nesting in a formula at most
_DEEPEST = 60


def _degrees(function: Callable[[float], float]) -> Callable[[float], float]:
    return lambda value: math.degrees(function(value))


def _radians(function: Callable[[float], float]) -> Callable[[float], float]:
    return lambda value: function(math.radians(value))


def _remainder(a: float, b: float) -> float:
    """Of a division. Raises ValueError for negative numbers, whose sign controls may take otherwise."""
    if a < 0.0 or b < 0.0:
        raise ValueError
    return math.fmod(a, b)


FUNCTIONS: Mapping[bytes, Callable[[float], float]] = {
    b"SIN": _radians(math.sin), b"COS": _radians(math.cos), b"TAN": _radians(math.tan),
    b"ASIN": _degrees(math.asin), b"ACOS": _degrees(math.acos), b"ATAN": _degrees(math.atan),
    b"SQRT": math.sqrt, b"SQ": lambda v: v * v, b"LN": math.log, b"LOG": math.log10, b"EXP": math.exp,
    b"NEG": lambda v: -v, b"INT": lambda v: float(math.trunc(v)), b"ABS": abs,
    b"FRAC": lambda v: v - math.trunc(v), b"SGN": lambda v: float((v > 0) - (v < 0)),
}  # fmt: skip
_PAIRS: Mapping[bytes, Callable[[float, float], float]] = {
    b"+": lambda a, b: a + b, b"-": lambda a, b: a - b, b"*": lambda a, b: a * b, b"/": lambda a, b: a / b,
    b"DIV": lambda a, b: a / b, b"^": lambda a, b: float(a**b), b"LEN": math.hypot,
    b"ANG": lambda a, b: math.degrees(math.atan2(a, b)) % 360.0, b"%": _remainder,
}  # fmt: skip
#: The operators of each level, the loosest first. A sign counts before all of them, and functions behind it;
#: powers are taken from right to left, and others from left to right (user's manual of the TNC7).
_LEVELS = ((b"+", b"-"), (b"*", b"/", b"%"), (b"^",))


class Parameters(dict[str, float]):
    """Parameters with known numbers, by their names."""

    def of(self, text: bytes) -> float:
        """The value of a number or a parameter, with a sign. Raises ProgramError where it is not known."""
        upper = text.upper().replace(b" ", b"").replace(b"\t", b"")
        sign = -1.0 if upper.startswith(b"-") else 1.0
        name = upper.lstrip(b"+-").decode("latin-1")
        if not name.startswith("Q"):
            return sign * float(name)
        if name not in self:
            raise ProgramError(
                f"{name} is used before the program gives it a value, which only the control knows; assign "
                "it in the program, or give it in [parameters] of the job file",
                code="OLP541",
            )
        return sign * self[name]


def formula(text: bytes, parameters: Parameters) -> float:
    """The value of a formula. Raises ProgramError where it cannot be read, or has none."""
    tokens: list[bytes] = []
    position = 0
    while position < len(text.rstrip()):
        match = _TOKEN.match(text, position)
        if match is None:
            raise ProgramError(f"{text.decode('latin-1')[:40]} is no formula that is read", code="OLP540")
        tokens.append(match[1].upper())
        position = match.end()
    try:
        return _Formula(tokens, parameters).whole()
    except (ValueError, ZeroDivisionError, OverflowError, TypeError):
        raise ProgramError(
            f"{text.decode('latin-1')[:40]} has no value: a division by zero, or a root or an angle that "
            "does not exist",
            code="OLP540",
        ) from None


class _Formula:
    """Reads the tokens of one formula."""

    def __init__(self, tokens: list[bytes], parameters: Parameters) -> None:
        self.tokens, self.parameters = tokens, parameters
        self.place = self.depth = 0

    def whole(self) -> float:
        value = self.level(0)
        if self.place < len(self.tokens):
            raise ProgramError(
                f"{self.tokens[self.place].decode('latin-1')} is not expected in this formula", code="OLP540"
            )
        return value

    def level(self, level: int) -> float:
        if level == len(_LEVELS):
            return self.operand()
        values, operators = [self.level(level + 1)], list[bytes]()
        while self.place < len(self.tokens) and self.tokens[self.place] in _LEVELS[level]:
            operators.append(self.tokens[self.place])
            self.place += 1
            values.append(self.level(level + 1))
        if b"^" in operators:
            return reduce(lambda power, base: _PAIRS[b"^"](base, power), reversed(values))
        value = values[0]
        for operator, operand in zip(operators, values[1:], strict=True):
            value = _PAIRS[operator](value, operand)
        return value

    def operand(self) -> float:
        self.depth += 1
        token = self.tokens[self.place] if self.place < len(self.tokens) else b""
        if not token or self.depth > _DEEPEST:
            raise ProgramError("a formula ends too early, or is nested too deep", code="OLP540")
        self.place += 1
        value = self._operand(token)
        self.depth -= 1
        return value

    def _operand(self, token: bytes) -> float:
        if token in (b"+", b"-"):
            return self.operand() if token == b"+" else -self.operand()
        if token == b"(":
            value = self.level(0)
            if self.place >= len(self.tokens) or self.tokens[self.place] != b")":
                raise ProgramError("a bracket of this formula is not closed", code="OLP540")
            self.place += 1
            return value
        if token == b"PI":
            return math.pi
        if token in FUNCTIONS:
            return FUNCTIONS[token](self.operand())
        if token[:1] in b"Q.0123456789" and (token[:1] != b"Q" or token[-1:].isdigit()):
            return self.parameters.of(token)
        raise ProgramError(f"{token.decode('latin-1')} is not read in formulas", code="OLP540")


def assignment(text: bytes, parameters: Parameters) -> tuple[str, float] | None:
    """The name and the value of an assignment (FN 0 to FN 8, FN 13, or a formula); None where it is none."""
    function = _FN.match(text)
    if function is not None:
        number, name, rest = int(function[1]), function[2].upper().decode(), function[3].strip()
        if number not in (0, 1, 2, 3, 4, 5, 6, 7, 8, 13):
            return None
        pair, one = _PAIR.match(rest), _ONE.match(rest)
        try:
            if one is not None:
                value = parameters.of(one[2])
                return name, FUNCTIONS[one[1].upper()](value) if one[1] else value
            if pair is not None:
                a, b = parameters.of(pair[1]), parameters.of(pair[3])
                return name, _PAIRS[pair[2].upper()](a, b)
        except (ValueError, ZeroDivisionError):
            raise ProgramError(
                f"FN {number} has no value: a division by zero, or a root that does not exist", code="OLP540"
            ) from None
        raise ProgramError(f"FN {number} is not read with these values", code="OLP540")
    plain = re.match(rb"(Q[LR]?\d+)[ \t]*=[ \t]*(.*)", text, re.I | re.S)
    if plain is None:
        return None
    return plain[1].upper().decode(), formula(plain[2], parameters)
