"""One text of a parametric program, compiled line by line when first met, and the levels of a run."""

from __future__ import annotations

import bisect
import contextlib
import itertools
import re
from collections.abc import Mapping
from dataclasses import field

from olp.core.errors import ProgramError
from olp.core.values import dataclass
from olp.program.rs274.flatten import user_task
from olp.program.rs274.flatten.lines import Flow, Line, compile_line
from olp.program.rs274.profiles.base import Profile
from olp.program.text.line_ends import split

_MAYBE_O = re.compile(rb"[\s/]*(?:\([^)]*\)\s*)*(?:[nN][\d\s]*)?[oO]")
_RADIUS_ARC = re.compile(rb"^[^(;]*[rR]\s*[-+\d.#\[]")

_units = itertools.count()


def _index(flow: tuple[int, Flow]) -> int:
    return flow[0]


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
        self._definitions: dict[tuple[str, str], int] | None = None
        self._bounds: list[int] | None = None
        self._numbers: dict[float, list[int]] | None = None
        self._labels: dict[str, list[int]] | None = None

    def line(self, index: int) -> Line:
        if index not in self._compiled:
            try:
                refusal = self.profile.text.refusal(self.lines[index].removesuffix(b"\n"))
                if refusal is not None:
                    raise refusal
                compiled = user_task.compile_line if self.language.user_tasks else compile_line
                self._compiled[index] = compiled(self.lines[index], index + 1, self.language)
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
                with contextlib.suppress(*((ProgramError,) if self.language.user_tasks else ())):
                    # a line of a user task that is broken begins no program
                    flow = self.line(index).flow
                    if flow is not None:
                        self._flows.append((index, flow))
        return self._flows

    def definition(self, label: str, keyword: str) -> int | None:
        """Index of the first `sub` or `program` with this label."""
        if self._definitions is None:
            self._definitions = {}
            for i, flow in self.flows():
                self._definitions.setdefault((flow.label, flow.keyword), i)
        return self._definitions.get((label, keyword))

    @property
    def has_programs(self) -> bool:
        """Whether a line has the number of a program."""
        return any(flow.keyword == "program" for _, flow in self.flows())

    def following(self, index: int, label: str, keywords: frozenset[str]) -> int:
        """Index of the next statement with this label, in the same subprogram; ProgramError if none."""
        key = (index, label, keywords)
        if key not in self._next:
            self._next[key] = self._search(index, label, keywords)
        return self._next[key]

    def _search(self, index: int, label: str, keywords: frozenset[str]) -> int:
        inner = ""
        flows = self.flows()
        for k in range(bisect.bisect_right(flows, index, key=_index), len(flows)):
            i, flow = flows[k]
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
        start, stop = self._around(index)
        places = self._numbered().get(number, [])
        ahead = bisect.bisect_right(places, index)
        if ahead < len(places) and places[ahead] < stop:
            return places[ahead]
        first = bisect.bisect_left(places, start)
        if first < ahead:
            return places[first]
        raise ProgramError(f"GOTO {number}: the program has no block N{number}", code="OLP542")

    def _around(self, index: int) -> tuple[int, int]:
        """The first line of the program around `index`, and the line behind its last."""
        if self._bounds is None:
            self._bounds = [i for i, flow in self.flows() if flow.keyword == "program"]
        k = bisect.bisect_right(self._bounds, index)
        return (
            self._bounds[k - 1] if k else 0,
            self._bounds[k] if k < len(self._bounds) else len(self.lines),
        )

    def labelled(self, label: str, index: int) -> int:
        """Index of the one line with a label in the program around `index`."""
        if self._labels is None:
            self._labels = {}
            for i in range(len(self.lines)):
                with contextlib.suppress(ProgramError):
                    self._labels.setdefault(self.line(i).label, []).append(i)
        start, stop = self._around(index)
        places = [i for i in self._labels.get(label, []) if start <= i < stop]
        if len(places) != 1:
            what = f"{len(places)} blocks" if places else "no block"
            raise ProgramError(f"the program has {what} N{label.upper()}; expected one", code="OLP542")
        return places[0]

    def refuse_library(self) -> None:
        """Raise ProgramError for a text of subprograms that calls none of them and moves nothing itself."""
        names = [(index, flow.label) for index, flow in self.flows() if flow.keyword == "sub"]
        if names:
            index, first = names[0]
            label = first if first.isdigit() else f"<{first}>"
            one = len(names) == 1
            what = f"subprogram {label}" if one else f"{len(names)} subprograms, the first is {label},"
            raise ProgramError(
                f"nothing moves here: the file defines {what} and calls none; give the program that calls "
                f"it, which may be one line such as `o{label} call` in a file beside this one",
                file=self.file, line=index + 1, code="OLP542",
            )  # fmt: skip

    def _numbered(self) -> dict[float, list[int]]:
        """The lines of each block number, in order. A line that is broken has none, until it is run."""
        if self._numbers is None:
            self._numbers = {}
            for i in range(len(self.lines)):
                with contextlib.suppress(ProgramError):
                    for word in self.line(i).words:
                        if word.letter == "n" and word.value is None:
                            self._numbers.setdefault(word.number, []).append(i)
        return self._numbers


@dataclass(frozen=True, slots=True)
class Saved:
    """Modes as they were in force: codes by group, further modes as words, F and S."""

    unit: int | None
    groups: Mapping[str, int]
    path: str
    further: Mapping[str, str]
    feed: float | None
    speed: float | None


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
    modal: bool = False
    #: the arguments of a macro whose next repetition may have them again
    arguments: Mapping[int, float | None] | None = None
    #: the line of the program itself that this level runs in, 0 for the program, and the number of that run
    within: int = 0
    run: int = 0
    taken: set[str] = field(default_factory=set)
    loops: dict[str, int] = field(default_factory=dict)
    dos: dict[str, int] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=dict)
    #: modes that this level has saved, and whether its end restores them
    saved: Saved | None = None
    restores: bool = False
