"""Which `set_tcp` holds for a move of URScript, as far as the text decides it.

A function has the tool that it sets itself, or that of its callers where all of them set one before they
call it, and the text has a single one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import field

from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.robots.frames import Tool
from olp.program.robots.poses import Pose
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

_WORD = pattern(rb"[A-Za-z_]\w*")
_SET = pattern(rb"\s*set_tcp\s*\((.*)\)\s*")


@dataclass(slots=True)
class _Function:
    """What a function sets (`tools`, None where the text does not state one), what it calls, and by whom it
    is called: each caller, and whether that has set a tool before."""

    tools: list[Pose | None] = field(default_factory=list)
    calls: set[bytes] = field(default_factory=set)
    callers: list[tuple[bytes, bool]] = field(default_factory=list)


class Tools:
    """The tool while a text is read from its begin to its end. `pose_of` is what words of a pose state. Of
    the tool in force, `why` says why the text does not decide it, empty where no statement sets one."""

    def __init__(self, lines: Iterable[Line], pose_of: Callable[[bytes], Pose | None]) -> None:
        self._pose_of = pose_of
        self._functions: dict[bytes, _Function] = {b"": _Function()}
        self._sets: dict[int, list[tuple[int, Pose | None]]] = {}
        self.only: Tool | None = None
        self._survey(list(lines))
        self.tool: Tool | None = None
        self.why = ""
        #: the tool, and why that is not known
        self._branches = Branches[tuple[Tool | None, str]]()

    def _survey(self, lines: list[Line]) -> None:
        """Take down what functions set and call, and what is set in blocks."""
        defined = {match[1] for line in lines if (match := FUNCTION.match(line.text)) is not None}
        self._functions.update((name, _Function()) for name in defined)
        at_top: set[bytes] = set()
        self.last = 0
        for line, word, blocks in nested(lines):
            if word in FUNCTIONS:
                continue
            given, caller = _SET.fullmatch(line.text), function_of(blocks).name
            own = self._functions[caller]
            if given is not None:
                pose, self.last = self._pose_of(given[1]), line.line
                own.tools.append(pose)
                for block in blocks:
                    self._sets.setdefault(block.line, []).append((line.line, pose))
                if not blocks or blocks[-1].word in FUNCTIONS:
                    at_top.add(caller)
            for name in defined.intersection(_WORD.findall(line.text)):
                own.calls.add(name)
                self._functions[name].callers.append((caller, caller in at_top))
        stated = [pose for function in self._functions.values() for pose in function.tools]
        first = stated[0] if stated else None
        if first is not None and all(pose is not None and pose.same(first) for pose in stated):
            self.only = Tool("tcp", first)

    def _covered(self, name: bytes, seen: frozenset[bytes] = frozenset()) -> bool:
        """Whether all callers of a function have set a tool before."""
        callers = self._functions[name].callers
        return bool(callers) and all(
            before or (caller not in seen and self._covered(caller, seen | {name}))
            for caller, before in callers
        )

    def _set_by(self, name: bytes, seen: set[bytes]) -> list[Pose | None]:
        """What a function sets, with those that it calls."""
        if name in seen:
            return []
        seen.add(name)
        own = self._functions[name]
        return own.tools + [pose for called in own.calls for pose in self._set_by(called, seen)]

    # -- in the order of the text --------------------------------------------------------------------

    def set(self, line: Line, pose: Pose | None) -> None:
        """A tool is set."""
        # a tool for each statement: a later one has another vector
        self.tool = None if pose is None else Tool(f"tcp{line.line}", pose)
        self.why = "" if pose is not None else f"set_tcp in line {line.line} is not stated with numbers"

    def called(self, text: bytes) -> None:
        """A statement may call functions of the text, which may set another tool."""
        for name in self._functions.keys() & set(_WORD.findall(text)):
            self._may_be(self._set_by(name, set()), f"{name.decode()} may set another tool")

    def _may_be(self, poses: list[Pose | None], why: str) -> None:
        """Another tool may have been set."""
        own = None if self.tool is None else self.tool.pose
        if any(pose is None or own is None or not pose.same(own) for pose in poses):
            self.tool, self.why = None, why

    def block(self, line: Line, word: bytes) -> None:
        """A block begins, parts or ends."""
        if word in (b"elif", b"else"):
            self.tool, self.why = self._branches.part(word, (self.tool, self.why))
        elif word == b"end":
            self._close(line)
        else:
            if word in LOOPS:
                poses = [pose for _, pose in self._sets.get(line.line, ())]
                self._may_be(poses, f"the loop of line {line.line} sets another tool")
            self._branches.begin(Block(word, line.line), (self.tool, self.why))
            if word in FUNCTIONS:
                self._enter(line)

    def _enter(self, line: Line) -> None:
        function = FUNCTION.match(line.text)
        name = b"" if function is None else function[1]
        self.tool = self.only if name in self._functions and self._covered(name) else None
        self.why = ""
        if self.tool is None and self.last:
            self.why = f"whether set_tcp in line {self.last} ran before depends on the run"

    def _close(self, line: Line) -> None:
        done = self._branches.end((self.tool, self.why))
        if done is None:
            return
        block, begun, ends = done
        if block.word in FUNCTIONS:
            self.tool, self.why = begun
        elif any(not _same(tool, ends[0][0]) for tool, _ in ends):
            self.tool, self.why = None, f"the block up to line {line.line} sets another tool"


def _same(a: Tool | None, b: Tool | None) -> bool:
    """Whether two tools are the same, None for one that is not known."""
    if a is None or b is None or a.pose is None or b.pose is None:
        return a is b
    return a.pose.same(b.pose)
