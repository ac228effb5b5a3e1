"""Which blocks left the axes at a place that is not known, and what to do about each of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence, Set
from typing import TYPE_CHECKING

from olp.core.errors import ProgramError
from olp.core.machine import Place
from olp.program.origin import Origin
from olp.program.rs274.codes import FIRST_HOME, HOMES, TOOL_CHANGE
from olp.program.rs274.profiles.words import moving_m
from olp.program.rs274.state import KNOWN_BY

if TYPE_CHECKING:
    from olp.program.rs274.offset_state import EventBlock
    from olp.program.rs274.profiles.base import Profile

#: A block that moves axes by itself: its line, the axes, where they stand then, and its words.
Left = tuple[int, Sequence[int], Place, "EventBlock"]
_NONE: frozenset[int] = frozenset()
#: Where the axes stand behind these codes, ten times their number, is stated by a key of the machine file.
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


def name(error: ProgramError, left: Iterable[Left], profile: Profile, origin: Origin | None) -> None:
    """Put into a refusal, and those found with it, which block before its line it follows from.

    `left` are the blocks that move axes by themselves, in the order of lines. `origin` is that of a text that
    was unrolled.
    """
    found = []
    for line, axes, place, block in left:
        if any(place[axis] is None for axis in axes):
            one = departure(block.g_codes, moving_m(profile, block.m_codes), profile.home_m)
            found += [] if one is None else [(line, *one)]
    for each in (error, *error.others):
        before = [one for one in found if each.line is None or one[0] <= each.line]
        if before and KNOWN_BY in each.message:
            line, code, remedy = before[-1]
            there = str(line) if origin is None else origin.place(origin.line_of(line))
            told = f"{code} in line {there} may have moved it: {remedy}, or command X, Y and Z behind it"
            each.message = each.message.replace(KNOWN_BY, told)
