"""Which blocks left the axes at a place that is not known, and what to do about each of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence, Set

from olp.core.errors import ProgramError
from olp.core.machine import Place
from olp.program.origin import Origin
from olp.program.rs274.codes import FIRST_HOME, HOMES, TOOL_CHANGE
from olp.program.rs274.state import KNOWN_BY

#: Where the axes stand behind these codes, ten times their number, is stated by a key of the machine file.
_NONE: frozenset[int] = frozenset()
_STATED = {FIRST_HOME: "home_mm", 300: "second_home_mm"}


def departure(
    g_codes: Iterable[int], moving: Iterable[int], home_m: Set[int] = _NONE
) -> tuple[str, str] | None:
    """The name of what left the axes, and the key that helps. `g_codes` are those of its block, `moving` the
    M codes that may move axes, `home_m` those that send one home, all ten times their number. None where no
    key helps."""
    for code in sorted(moving):
        name = f"{code / 10:g}"
        if code == TOOL_CHANGE:
            return "M6", "state tool_change_mm in the machine file"
        if code in home_m:
            return f"M{name}", "state home_mm in the machine file"
        return f"M{name}", f"list {name} in still_m_codes of the machine file if it moves no axis"
    for code in HOMES.intersection(g_codes):
        return f"G{code // 10}", f"state {_STATED[code]} in the machine file"
    return None


class Departures:
    """The blocks of a program that left the axes at a place that is not known."""

    def __init__(self, origin: Origin | None) -> None:
        self._origin = origin
        self._found: list[tuple[int, str, str]] = []

    def note(self, line: int, axes: Sequence[int], place: Place, found: tuple[str, str] | None) -> None:
        """Take a block that moves `axes` to a place: if that is not known, and there is a `departure`."""
        if found is not None and any(place[axis] is None for axis in axes):
            self._found.append((line, *found))

    def _place(self, line: int) -> str:
        origin = self._origin
        return str(line) if origin is None else origin.place(origin.line_of(line))

    def name(self, error: ProgramError) -> None:
        """Put into a refusal, and those found with it, which block before its line it follows from."""
        for each in (error, *error.others):
            before = [found for found in self._found if each.line is None or found[0] <= each.line]
            if before and KNOWN_BY in each.message:
                line, name, remedy = before[-1]
                told = (
                    f"{name} in line {self._place(line)} may have moved it: {remedy}, or command X, Y and Z"
                )
                each.message = each.message.replace(KNOWN_BY, f"{told} behind it")
