"""One text of a parametric program, compiled line by line when first met, and the levels of a run."""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass, field

from olp.core.errors import ProgramError
from olp.program.rs274.flatten.lines import Flow, Line, compile_line
from olp.program.rs274.profiles.base import Profile
from olp.program.text.line_ends import split

_MAYBE_O = re.compile(rb"[\s/]*(?:\([^)]*\)\s*)*(?:[nN][\d\s]*)?[oO]")
_RADIUS_ARC = re.compile(rb"^[^(;]*[rR]\s*[-+\d.#\[]")

_units = itertools.count()


class Unit:
    """One text (the program or a file of a subprogram), compiled line by line when first met."""

    def __init__(self, data: bytes, profile: Profile, file: str | None) -> None:
        self.key = next(_units)
        self.file = file
        self.profile = profile
        self.language = profile.language
        self.lines = split(data, profile.text.line_end)
        self.radius_arcs = any(_RADIUS_ARC.search(line) for line in self.lines)
        self.ends_with_eol = data.endswith((b"\n", b"\r"))
        self._compiled: dict[int, Line] = {}
        self._flows: list[tuple[int, Flow]] | None = None
        self._next: dict[tuple[int, str, frozenset[str]], int] = {}

    def line(self, index: int) -> Line:
        if index not in self._compiled:
            try:
                refusal = self.profile.text.refusal(self.lines[index].removesuffix(b"\n"))
                if refusal is not None:
                    raise refusal
                self._compiled[index] = compile_line(self.lines[index], index + 1, self.language)
            except ProgramError as error:
                error.line = index + 1
                raise
        return self._compiled[index]

    def flows(self) -> list[tuple[int, Flow]]:
        """Index and statement of every line with flow."""
        if self._flows is None:
            self._flows = []
            for index, raw in enumerate(self.lines):
                if not self.language.macro_b and not _MAYBE_O.match(raw):
                    continue
                flow = self.line(index).flow
                if flow is not None:
                    self._flows.append((index, flow))
        return self._flows

    def definition(self, label: str, keyword: str) -> int | None:
        """Index of the first `sub` or `program` with this label."""
        return next((i for i, flow in self.flows() if flow.keyword == keyword and flow.label == label), None)

    def following(self, index: int, label: str, keywords: frozenset[str]) -> int:
        """Index of the next statement with this label, in the same subprogram; ProgramError if none."""
        key = (index, label, keywords)
        if key not in self._next:
            self._next[key] = self._search(index, label, keywords)
        return self._next[key]

    def _search(self, index: int, label: str, keywords: frozenset[str]) -> int:
        inner = ""
        for i, flow in self.flows():
            if i <= index:
                continue
            if inner:
                inner = "" if (flow.keyword, flow.label) == ("endsub", inner) else inner
                continue
            if flow.label == label and flow.keyword in keywords:
                return i
            if flow.keyword == "sub":
                inner = flow.label
            elif flow.keyword in ("endsub", "program"):
                break
        raise ProgramError(
            f"no {' or '.join(sorted(keywords)).upper()} with label {label} follows", code="OLP542"
        )

    def block_number(self, number: int, index: int) -> int:
        """Index of the line N`number` in the program around `index`: forward first, then from its start."""
        bounds = [i for i, flow in self.flows() if flow.keyword == "program"]
        start = max((i for i in bounds if i <= index), default=0)
        stop = min((i for i in bounds if i > index), default=len(self.lines))
        for i in itertools.chain(range(index + 1, stop), range(start, index + 1)):
            if any(w.letter == "n" and w.value is None and w.number == number for w in self.line(i).words):
                return i
        raise ProgramError(f"GOTO {number}: the program has no block N{number}", code="OLP542")


@dataclass(slots=True)
class Frame:
    """One level of the run: the index of its next line, its local parameters and its open loops."""

    unit: Unit
    next_index: int
    label: str
    locals: dict[int, float | None]
    names: dict[str, float]
    start: int = 0
    repeats: int = 0
    taken: set[str] = field(default_factory=set)
    loops: dict[str, int] = field(default_factory=dict)
    dos: dict[str, int] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=dict)
