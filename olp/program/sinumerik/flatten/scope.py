"""Variables of a Sinumerik program while it is unrolled: R-parameters, and those of each program."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator, Mapping, MutableMapping

from olp.core.errors import ProgramError
from olp.program.sinumerik.flatten.expressions import Value, evaluate, indexed
from olp.program.sinumerik.table import HARMLESS, READ, REFUSED, UNROLLED

_R = re.compile(r"R\d+")
#: names that are not those of an axis, as machines have them: AX4, XA, SP1
_GLOBAL = re.compile(r"_[A-Z0-9_]*|(?!AX\d)[A-Z][A-Z_]{2}[A-Z0-9_]*")
_WORDS = frozenset({*HARMLESS, *READ, *REFUSED, *UNROLLED, "CR", "TURN", "ADIS", "ADISPOS"})
_TYPE = re.compile(r"(INT|REAL|BOOL|CHAR|STRING(?:[ \t]*\[[^\]]*\])?|AXIS)[ \t]+", re.IGNORECASE)
_NAME = re.compile(r"[ \t]*([A-Z_][A-Z0-9_]*)[ \t]*(?:\[([^\]]*)\])?[ \t]*(?:=(.*))?$", re.IGNORECASE)
_ELEMENT = re.compile(r"([A-Z_][A-Z0-9_]*|R)\[(.*)\]", re.IGNORECASE)
_SET = re.compile(r"SET[ \t]*\((.*)\)", re.IGNORECASE)
#: Elements of an array at most.
_MOST_ELEMENTS = 10_000


class Scope(MutableMapping[str, Value]):
    """The variables of one program; R-parameters are those of all. `defined` are names of its own."""

    def __init__(self, shared: dict[str, Value] | None = None) -> None:
        self._shared: dict[str, Value] = {} if shared is None else shared
        self._own: dict[str, Value] = {}
        self.defined: set[str] = set()
        #: those of `defined` that are INT or BOOL, and which
        self._kinds: dict[str, str] = {}

    @staticmethod
    def of(parameters: Mapping[str, float] | None) -> Scope:
        """The variables at the start, with those that the job states."""
        return Scope({name.upper(): value for name, value in (parameters or {}).items()})

    def inner(self) -> Scope:
        """The variables of a subprogram that is called here."""
        return Scope(self._shared)

    def is_variable(self, name: str, *, alone: bool = True) -> bool:
        """Whether an assignment to a name sets a variable; `alone`: in a block of assignments only."""
        base = name.partition("[")[0]
        if base in self.defined or bool(_R.fullmatch(base)) or base == "R":
            return True
        # a name that the job states is none of a word of the control
        if base not in _WORDS and (base in self._shared or name in self._shared):
            return True
        # a variable that is defined in the control, for all programs; beside other words it may be an axis
        return alone and bool(_GLOBAL.fullmatch(name)) and base not in _WORDS

    def define(self, text: str) -> None:
        """DEF: a type, and names with or without a value or a size."""
        kind = _TYPE.match(text)
        if kind is None:
            raise ProgramError(f"`DEF {text.strip()}` is of a type that is not run", code="OLP542")
        empty: Value = "" if kind[1].upper().startswith(("STRING", "CHAR", "AXIS")) else 0.0
        if kind[1].upper() == "BOOL":
            empty = False
        for part in _split(text[kind.end() :]):
            name = _NAME.match(part)
            if name is None:
                raise ProgramError(f"`DEF {text.strip()}` is not understood", code="OLP542")
            own = name[1].upper()
            self.defined.add(own)
            self._kinds[own] = kind[1].upper()
            if name[2] is None:
                self._own[own] = empty if name[3] is None else self._kept(own, evaluate(name[3], self))
                continue
            sizes = [int(float(evaluate(part, self))) for part in _split(name[2])]
            if min(sizes) <= 0 or math.prod(sizes) > _MOST_ELEMENTS:
                raise ProgramError(f"the array {own} has a size that is not run", code="OLP542")
            values = [] if name[3] is None else self._set(own, name[3])
            # the last index counts first
            places = itertools.product(*(range(size) for size in sizes))
            filled = itertools.chain(values, itertools.repeat(empty))
            self._own |= {indexed(own, [*place]): value for place, value in zip(places, filled, strict=False)}

    def _set(self, name: str, text: str) -> list[Value]:
        """The values of an array from its begin on."""
        given = _SET.fullmatch(text.strip())
        if given is None:
            raise ProgramError(f"the array {name} has values that are not run; write SET( )", code="OLP542")
        return [self._kept(name, evaluate(part, self)) for part in _split(given[1])]

    def _kept(self, name: str, value: Value) -> Value:
        """What a variable of its own type keeps of a value: an INT as ROUND( ) has it, of a BOOL whether it
        is not 0. Type conversion is in the manual for job planning, 6FC5398-2BP40-0BA0. A half becomes the
        next higher integer (function manual for synchronized actions, 6FC5397-5BP40-3BA0)."""
        if isinstance(value, bool | str):
            return value
        kind = self._kinds.get(name.partition("[")[0], "")
        if kind == "INT":
            return float(math.floor(value + 0.5))
        return value != 0 if kind == "BOOL" else value

    def bind(self, parameters: str, given: list[str], caller: Scope) -> None:
        """Parameters of a subprogram: values by position, or their defaults."""
        names = [p for p in _split(parameters) if p.strip()]
        if len(given) > len(names):
            raise ProgramError(
                f"the call gives {len(given)} values, and the subprogram has {len(names)} parameters",
                code="OLP542",
            )
        for i, text in enumerate(names):
            kind = _TYPE.match(text.strip())
            if kind is None:
                raise ProgramError(
                    f"the parameter `{text.strip()}` of a subprogram is not run", code="OLP542"
                )
            self.define(text.strip())
            if i < len(given) and given[i]:
                name = _NAME.match(text.strip()[kind.end() :])
                assert name is not None
                own = name[1].upper()
                self._own[own] = self._kept(own, evaluate(given[i], caller))

    def name_of(self, name: str) -> str:
        """The name of a variable with its index worked out."""
        element = _ELEMENT.fullmatch(name)
        if element is None:
            return name
        index = [int(float(evaluate(part, self))) for part in _split(element[2])]
        return indexed(element[1], index)

    def __getitem__(self, name: str) -> Value:
        return self._own[name] if name in self._own else self._shared[name]

    def __setitem__(self, name: str, value: Value) -> None:
        if name in self._own:
            self._own[name] = self._kept(name, value)
        else:
            if not (_R.fullmatch(name) or _is_integer(value) or self._is_real(name)):
                raise ProgramError(
                    f"{name} is not defined in the program, so it may be rounded; give DEF REAL in front "
                    "of it",
                    code="OLP542",
                )
            self._shared[name] = value

    def _is_real(self, name: str) -> bool:
        """Whether a variable of all programs has a value that an INT cannot have."""
        return name in self._shared and not _is_integer(self._shared[name])

    def __delitem__(self, name: str) -> None:
        del self._own[name]

    def __iter__(self) -> Iterator[str]:
        return iter({**self._shared, **self._own})

    def __len__(self) -> int:
        return len({**self._shared, **self._own})


def _is_integer(value: Value) -> bool:
    return isinstance(value, bool | str) or value == round(value)


def _split(text: str) -> list[str]:
    """The parts of a list between its commas, not those in brackets."""
    parts, depth, start = [], 0, 0
    for i, c in enumerate(text):
        depth += (c in "([") - (c in ")]")
        if c == "," and not depth:
            parts.append(text[start:i])
            start = i + 1
    return [*parts, text[start:]]
