"""The programs of an application (`.pgx`): their parameters, their statements, and the blocks of these."""

from __future__ import annotations

import re

from olp.core.errors import ProgramError
from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.robots.line import Line
from olp.program.robots.val3.xml import Element, Lines
from olp.program.text.line_ends import LINE_END

#: Entities, and what each is. Its other bytes become blanks, so that all behind it keep their places.
_ENTITIES = {b"&lt;": b"<", b"&gt;": b">", b"&amp;": b"&", b"&quot;": b'"', b"&apos;": b"'"}
_ENTITY = pattern(rb"&(?:lt|gt|amp|quot|apos);")
_MARKUP = pattern(rb"[^\r\n]")
_STRING = pattern(rb'"(?:[^"\\]|\\.)*"?')
_CODE = pattern(rb'(?:[^/"]++|"(?:[^"\\]|\\.)*"?|/(?!/))*')
_OPENS = frozenset(("if", "while", "for", "do", "switch"))
_PARTS = frozenset(("else", "elseif", "case", "default"))
_CLOSES = {"endif": "if", "endwhile": "while", "endfor": "for", "endswitch": "switch", "until": "do"}
_LOOPS = frozenset(("while", "for", "do"))
#: Blocks are nested so deep at most.
_DEEPEST = 64


@dataclass(slots=True, eq=False)
class Block:
    """Statements between two words: each branch has a head and what it holds. `loop`: it may run again, or
    not at all. `whole`: one of its branches runs in any case. `tail` ends it."""

    loop: bool
    branches: list[tuple[Line, list[Line | Block]]]
    whole: bool = False
    tail: Line | None = None

    def lines(self) -> list[Line]:
        """All statements, with those that begin branches."""
        found = []
        for head, nodes in self.branches:
            found.append(head)
            found += lines_in(nodes)
        return found if self.tail is None else [*found, self.tail]


Node = Line | Block


@dataclass(slots=True, eq=False)
class Routine:
    """A program of an application: its name, its line, its parameters (name, type, and whether they are the
    caller's own data), the types of its local data, and its statements."""

    name: str
    line: int
    parameters: list[tuple[str, str, bool]]
    locals: dict[str, str]
    nodes: list[Node]

    def has(self, name: str) -> bool:
        """Whether a name means data of its own."""
        return name in self.locals or any(name == own for own, _, _ in self.parameters)


def lines_in(nodes: list[Node]) -> list[Line]:
    """All statements of nodes."""
    return [line for node in nodes for line in (node.lines() if isinstance(node, Block) else (node,))]


def routines(data: bytes, root: Element, line_of: Lines) -> list[Routine]:
    """The programs of a file. Raises ProgramError where their blocks do not end."""
    found = []
    for element in root.all_of("Program", "program"):
        code = next(element.all_of("Code", "code"), None)
        if code is None:
            continue
        parameters = [
            (one.text(data, "name"), one.text(data, "type"), _by_reference(data, one))
            for one in element.all_of("Parameter", "param", "parameter")
        ]
        own = {one.text(data, "name"): one.text(data, "type") for one in element.all_of("Local", "local")}
        nodes = _nodes(_statements(data, code, line_of))
        found.append(Routine(element.text(data, "name"), line_of(element.begin), parameters, own, nodes))
    return found


def _by_reference(data: bytes, one: Element) -> bool:
    """Whether a parameter is the caller's own data."""
    by_value, form = one.text(data, "byValue"), one.text(data, "xsi:type")
    return one.text(data, "use") == "reference" or by_value == "false" or form in ("array", "collection")


def _statements(data: bytes, code: Element, line_of: Lines) -> list[Line]:
    """The lines of code that say something."""
    begin = code.head
    shown = bytearray(_MARKUP.sub(b" ", data[begin : code.end]))
    for (a, b), raw in code.texts:
        text = data[a:b]
        shown[a - begin : b - begin] = text if raw else _ENTITY.sub(_blanked, text)
    found, place = [], 0
    whole = bytes(shown)
    number = line_of(begin)
    for end in [*LINE_END.finditer(whole), None]:
        stop = len(whole) if end is None else end.start()
        match = _CODE.match(whole, place, stop)
        assert match is not None
        text = match[0].strip()
        if b'"' in text:
            text = _STRING.sub(_hidden, text)
        if text:
            lead = len(match[0]) - len(match[0].lstrip())
            found.append(Line(number, begin + place + lead, text))
        if end is not None:
            place, number = end.end(), number + 1
    return found


def _blanked(match: re.Match[bytes]) -> bytes:
    return _ENTITIES[match[0]].ljust(len(match[0]))


def _hidden(match: re.Match[bytes]) -> bytes:
    """A string whose text says nothing."""
    return b'"' + b"_" * (len(match[0]) - 2) + b'"' if len(match[0]) > 1 else match[0]


def _nodes(statements: list[Line]) -> list[Node]:
    """Statements in their blocks, without the words around all of them."""
    nodes: list[Node] = []
    open_: list[tuple[str, Block, list[Node]]] = []
    for line in statements:
        word = word_of(line.text)
        if word in ("begin", "end") and line.text.lower() == word.encode():
            continue
        if word in _OPENS:
            if len(open_) >= _DEEPEST:
                raise ProgramError(
                    f"blocks are nested more than {_DEEPEST} deep", line=line.line, code="OLP506"
                )
            block = Block(word in _LOOPS, [(line, [])])
            nodes.append(block)
            open_.append((word, block, nodes))
            nodes = block.branches[0][1]
        elif word in _PARTS and open_:
            block = open_[-1][1]
            block.whole |= word in ("else", "default")
            block.branches.append((line, []))
            nodes = block.branches[-1][1]
        elif word in _CLOSES:
            if not open_ or open_[-1][0] != _CLOSES[word]:
                raise ProgramError(f"{word} ends no block", line=line.line, code="OLP506")
            _, block, nodes = open_.pop()
            block.tail = line
            block.whole |= word == "until"
        else:
            nodes.append(line)
    if open_:
        raise ProgramError(
            f"the block of {open_[-1][0]} is not ended", line=open_[-1][1].branches[0][0].line, code="OLP506"
        )
    return nodes


_FIRST = pattern(rb"[A-Za-z_]\w*")


def word_of(text: bytes) -> str:
    """The first word of a statement in small letters."""
    match = _FIRST.match(text)
    return "" if match is None else match[0].decode().lower()
