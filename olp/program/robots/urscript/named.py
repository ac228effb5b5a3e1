"""Which value of a name holds where, of poses and joint values with numbers in a URScript text.

A name with one value has it everywhere. One that gets several, all in one function, has the last one there,
as far as no branch, loop or call decides it. Parameters of a function hide other names in it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import field

from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.robots.targets import Span
from olp.program.robots.urscript.blocks import (
    FUNCTION,
    FUNCTIONS,
    LOOPS,
    Block,
    Branches,
    function_of,
    nested,
)
from olp.program.robots.urscript.text import Line

ASSIGNED = pattern(rb"\s*(?:(global|local)\s+)?([A-Za-z_]\w*)\s*=(?!=)\s*(.*\S|)\s*")
ELEMENT = pattern(rb"\s*(?:(global|local)\s+)?([A-Za-z_]\w*)\s*\[[^\]]*\]\s*=(?!=)")
_PARAMETER = pattern(rb"\s*([A-Za-z_]\w*)")

#: A name as one function or all of them know it: the line of the function that it is local to, else 0.
_Variable = tuple[int, bytes]


@dataclass(frozen=True, slots=True)
class Named:
    """A pose or joint values with a name: the line, the bytes of the value and of the whole statement."""

    line: int
    value: Span
    statement: Span


@dataclass(slots=True)
class _Given:
    """The values that a name gets: each with its line, and the function of that by its line. Where the text
    does not state one with numbers, it is None."""

    values: list[tuple[int, int, Named | None]] = field(default_factory=list)

    @property
    def function(self) -> int:
        """The function that gives all of several values, by its line; -1 where there is none."""
        functions = {function for _, function, _ in self.values}
        return functions.pop() if len(functions) == 1 else -1


class Names:
    """Poses and joint values by their names while a text is read. `states` says whether a value has numbers,
    `recursive` whether a function may call itself."""

    def __init__(
        self, lines: Iterable[Line], states: Callable[[bytes], bool], recursive: Callable[[bytes], bool]
    ) -> None:
        self._given: dict[_Variable, _Given] = {}
        self._hidden: dict[int, set[bytes]] = {0: set()}
        self._local: set[_Variable] = set()
        #: by the line where a block begins, what is given values in it
        self._inside: dict[int, set[_Variable]] = {}
        self._again = {0: False}
        self._states = states
        self._survey(lines, recursive)
        self._now: dict[_Variable, Named | None] = {}
        self._functions, self._branches = [0], Branches[dict[_Variable, Named | None]]()

    @property
    def lines(self) -> Iterator[int]:
        """The lines that state values with numbers."""
        return (
            line for given in self._given.values() for line, _, named in given.values if named is not None
        )

    def _survey(self, lines: Iterable[Line], recursive: Callable[[bytes], bool]) -> None:
        given: list[tuple[Line, int, list[int]]] = []
        for line, word, blocks in nested(lines):
            own, function = function_of(blocks), FUNCTION.match(line.text)
            if word in FUNCTIONS:
                stated = None if function is None else function[2]
                self._hidden[line.line] = set() if stated is None else _parameters(stated)
                self._again[line.line] = stated is None or recursive(own.name)
            found = ELEMENT.match(line.text) or ASSIGNED.fullmatch(line.text)
            if not word and found is not None:
                given.append((line, own.line, [block.line for block in blocks]))
                if found[1] == b"local":
                    self._local.add((own.line, found[2]))
        for line, begun, inside in given:
            self._take(line, begun, inside)

    def _take(self, line: Line, function: int, open_: list[int]) -> None:
        """Keep a value that a statement gives to a name."""
        match, element = ASSIGNED.fullmatch(line.text), ELEMENT.match(line.text)
        found, named = element or match, None
        assert found is not None
        if match is not None and element is None and self._states(match[3]):
            value = (line.begin + match.start(3), line.begin + match.end(3))
            named = Named(line.line, value, (line.begin + match.start(2), line.begin + len(line.text)))
        variable = self._variable(found[2], function)
        self._given.setdefault(variable, _Given()).values.append((line.line, function, named))
        for begin in open_:
            self._inside.setdefault(begin, set()).add(variable)

    def _variable(self, name: bytes, function: int) -> _Variable:
        return (function, name) if (function, name) in self._local else (0, name)

    # -- in the order of the text --------------------------------------------------------------------

    def get(self, text: bytes, *, anywhere: bool = False) -> Named | None:
        """The value that a name has here, or that it has `anywhere`; None where the text does not decide
        it."""
        name, function = text.strip(), self._functions[-1]
        if any(name in self._hidden[one] for one in (self._hidden if anywhere else self._functions)):
            return None
        variable = self._variable(name, function)
        given = self._given.get(variable)
        others = self._hidden if anywhere else self._functions
        outer = not variable[0] and any((one, name) in self._local for one in others)
        if given is None or outer:
            return None
        if len(given.values) == 1:
            return given.values[0][2]
        own = given.function == function and not self._again[function]
        return self._now.get(variable) if own else None

    def assigned(self, line: Line) -> None:
        """A statement gives a name its value."""
        found = ELEMENT.match(line.text) or ASSIGNED.fullmatch(line.text)
        if found is not None:
            variable = self._variable(found[2], self._functions[-1])
            given = self._given.get(variable, _Given())
            self._now[variable] = next((named for at, _, named in given.values if at == line.line), None)

    def block(self, line: Line, word: bytes) -> None:
        """A block begins, parts or ends."""
        if word in (b"elif", b"else"):
            self._now = dict(self._branches.part(word, self._now))
        elif word == b"end":
            self._close()
        else:
            if word in LOOPS:
                self._now |= dict.fromkeys(self._inside.get(line.line, ()))
            self._branches.begin(Block(word, line.line), dict(self._now))
            if word in FUNCTIONS:
                self._functions.append(line.line)

    def _close(self) -> None:
        done = self._branches.end(self._now)
        if done is None:
            return
        block, _, ends = done
        if block.word in FUNCTIONS:
            self._functions.pop()
            return
        for variable in self._inside.get(block.line, ()):
            held = [end.get(variable) for end in ends]
            self._now[variable] = held[0] if all(one is held[0] for one in held) else None


def _parameters(text: bytes) -> set[bytes]:
    """The names of parameters."""
    return {match[1] for part in text.split(b",") if (match := _PARAMETER.match(part)) is not None}
