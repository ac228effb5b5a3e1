"""The support matrix of a control beside its G codes: M codes, other words, and lines that are no words."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Protocol

from olp.program.dialect import Row, Support
from olp.program.rs274.block_text import BlockText
from olp.program.rs274.codes import CUTTER_COMPENSATION, SET_TOOL
from olp.program.rs274.commands import Commands
from olp.program.rs274.flatten.language import UNROLL, Language

_LOST = "may move the axes: no position is known behind it, until X, Y and Z have been commanded"

#: Refusals of a control whose corners of contours are not known.
OPEN_CONTOURS: Mapping[int, str] = {
    code: f"G{code / 10:g} makes corners of contours in a way that is not known; post the path of the tool "
    "without compensation"
    for code in CUTTER_COMPENSATION
}


class Control(Protocol):
    """What of a profile is told here."""

    @property
    def still_m(self) -> frozenset[int]: ...
    @property
    def m_refusals(self) -> Mapping[int, str]: ...

    @property
    def m_instead(self) -> Mapping[int, str]: ...
    @property
    def m61_sets_tool(self) -> bool: ...
    @property
    def text(self) -> BlockText: ...
    @property
    def commands(self) -> Commands | None: ...
    @property
    def inert(self) -> re.Pattern[bytes] | None: ...
    @property
    def language(self) -> Language: ...
    def unrolls_m(self, code: int) -> bool: ...


def word_rows(profile: Control) -> Iterator[Row]:
    """What becomes of M codes, words and lines."""
    yield from _m_codes(profile)
    yield Row("X Y Z", Support.CORRECTED, "the ends of moves")
    yield Row("I J K R", Support.CORRECTED, "centres and radii of arcs; levels of canned cycles")
    yield Row("A B C U V W", Support.UNCHANGED, "other axes: a block that moves one is never split")
    yield Row("F S N", Support.UNCHANGED, "F changes with retime --write-feed alone")
    corners = [letter.upper() for letter in sorted(profile.language.corners, reverse=True)]
    if corners:
        yield Row(" ".join(corners), Support.READ, "corners that the control makes, written out as moves")
    if profile.commands is None:
        yield Row("T", Support.READ, "the tool for M6; give [tools.N] in the machine or job file")
        yield Row("H D", Support.READ, "lengths and radii from [tools.N] of the machine or job file")
    yield Row("(comment) or ;comment" if profile.text.brackets else ";comment", Support.UNCHANGED)
    yield from _lines_of_commands(profile) if profile.commands is not None else _lines(profile)
    yield Row(
        "any other line",
        Support.REFUSED,
        "is not understood and may move the machine; write words, or a comment",
    )


def _m_codes(profile: Control) -> Iterator[Row]:
    still = sorted(profile.still_m - {60})
    yield Row(_ranges([m for m in still if m % 10 == 0]), Support.UNCHANGED, "move no axis")
    for m in (m for m in still if m % 10):
        yield Row(f"M{m / 10:g}", Support.UNCHANGED, "moves no axis")
    if profile.commands is None:
        yield Row("M6", Support.READ, f"changes to the tool of T; {_LOST}")
    if profile.m61_sets_tool:
        yield Row("M61 Q", Support.READ, "Q is the tool in the spindle")
    for m, why in sorted(profile.m_refusals.items()):
        instead = profile.m_instead.get(m)
        said = (
            f"{why}; {UNROLL}" if profile.unrolls_m(m) else remedied(f"{why}; {instead}" if instead else why)
        )
        yield Row(f"M{m / 10:g}", Support.REFUSED, said)
    yield Row("any other M", Support.READ, _LOST)


def moving_m(profile: Control, m_codes: Iterable[int]) -> set[int]:
    """Those of M codes, ten times their number, that are not known to move no axis."""
    return set(m_codes) - profile.still_m - ({SET_TOOL} if profile.m61_sets_tool else set())


def remedied(why: str) -> str:
    """A reason with what to do, where it has none of its own behind a semicolon."""
    return why if ";" in why else f"{why}; post the program without it"


def _ranges(codes: list[int]) -> str:
    """M codes, ten times their numbers, in few words: `M0-M5, M7`."""
    parts: list[list[int]] = []
    for m in (code // 10 for code in codes):
        if parts and m == parts[-1][-1] + 1:
            parts[-1].append(m)
        else:
            parts.append([m])
    return ", ".join(f"M{p[0]}" if len(p) == 1 else f"M{p[0]}-M{p[-1]}" for p in parts)


def _lines(profile: Control) -> Iterator[Row]:
    yield Row("/ (block delete)", Support.READ, "counts as carried out; proved with it and without")
    yield Row("% and O with a number", Support.UNCHANGED)
    if profile.inert is not None:
        what = "names of programs, labels, prints, counters and questions alone in a line"
        yield Row(what, Support.UNCHANGED)
    for name, (_, why) in profile.text.outside.items():
        yield Row(name, Support.REFUSED, why)
    tasks = profile.language.user_tasks
    flow = "= [ ] IF GOTO CALL RTS" if tasks else "# [ ] IF WHILE GOTO O-words"
    yield Row(flow, Support.REFUSED, f"parameters and flow; {UNROLL}")
    if tasks:
        why = "calls after each move, and values that the control has; post the moves"
        yield Row("MODIN MODOUT, variables V... but VC", Support.REFUSED, why)


def _lines_of_commands(profile: Control) -> Iterator[Row]:
    commands = profile.commands
    assert commands is not None
    yield Row(commands.extruder, Support.CORRECTED, "shared out where its move is split, else unchanged")
    yield Row("T", Support.READ, f"changes the nozzle, whose offset is that of [tools.N]; {_LOST}")
    yield Row("a checksum (*71)", Support.REFUSED, "no corrected line would keep it; save without checksums")
    if commands.named:
        for name in sorted(commands.still):
            yield Row(name.decode(), Support.UNCHANGED, "moves no axis")
        for name, why in sorted(commands.refused.items()):
            yield Row(name.decode(), Support.REFUSED, why)
        for name, why in sorted(commands.zeros.items()):
            yield Row(name.decode(), Support.REFUSED, f"{why}; with offsets of 0 it is unchanged")
        why = "a macro of the machine: behind it no position is known, modes hold; or list it in still_macros"
        yield Row("any other name", Support.READ, why)
