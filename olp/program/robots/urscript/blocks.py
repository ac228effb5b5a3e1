"""The blocks of a URScript text: in which ones a statement is, and what holds where their branches meet."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import field
from typing import Generic, TypeVar

from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.robots.urscript.text import Line

_WORD = pattern(rb"\s*(def|thread|if|while|for|elif|else|end)\b")
#: A function: its name, and its parameters where they are in one line.
FUNCTION = pattern(rb"\s*(?:def|thread)\s+(\w+)(?:\s*\((.*)\))?")
FUNCTIONS = (b"def", b"thread")
LOOPS = (b"while", b"for")

State = TypeVar("State")


@dataclass(frozen=True, slots=True)
class Block:
    """A block of the text: its first word, the line where it begins, and its name if it is a function."""

    word: bytes
    line: int
    name: bytes = b""


def nested(lines: Iterable[Line]) -> Iterator[tuple[Line, bytes, list[Block]]]:
    """Statements with the word by which they begin, part or end a block, empty for others, and the blocks in
    which they are, the one that they begin included."""
    open_: list[Block] = []
    for line in lines:
        match = _WORD.match(line.text)
        word = b"" if match is None else match[1]
        function = FUNCTION.match(line.text) if word in FUNCTIONS else None
        if word in (*FUNCTIONS, *LOOPS, b"if"):
            open_.append(Block(word, line.line, b"" if function is None else function[1]))
        elif word == b"end" and open_:
            open_.pop()
        yield line, word, open_


def function_of(blocks: list[Block]) -> Block:
    """The innermost function of blocks; outside of all, one without a name that begins in line 0."""
    return next((block for block in reversed(blocks) if block.word in FUNCTIONS), Block(b"", 0))


@dataclass(slots=True)
class _Open(Generic[State]):
    """An open block, what held where it begins, and at the ends of its branches. `whole`: one of these runs
    in any case."""

    block: Block
    begun: State
    ends: list[State] = field(default_factory=list)
    whole: bool = False


class Branches(Generic[State]):
    """What holds at the begin of open blocks and at the ends of their branches, while a text is read."""

    def __init__(self) -> None:
        self._open: list[_Open[State]] = []

    def begin(self, block: Block, state: State) -> None:
        self._open.append(_Open(block, state))

    def part(self, word: bytes, state: State) -> State:
        """Another branch begins where `state` holds; what holds in it."""
        if not self._open:
            return state
        begun = self._open[-1]
        begun.ends.append(state)
        begun.whole |= word == b"else"
        return begun.begun

    def end(self, state: State) -> tuple[Block, State, list[State]] | None:
        """The block that ends where `state` holds, what held at its begin, and what may hold behind it; None
        where none is open."""
        if not self._open:
            return None
        done = self._open.pop()
        return done.block, done.begun, [*done.ends, state, *(() if done.whole else (done.begun,))]
