"""What conversational programs ask of the control beside motion, in TOOL CALL and in M functions."""

from __future__ import annotations

from collections.abc import Iterator

from olp.core.patterns import pattern
from olp.program.asked import TURNS, Asked, by_codes, places, said
from olp.program.program import Program

#: turn of the spindle by M function; M13 and M14 with coolant
_TURNS = {**TURNS, 13: 1, 14: -1}
#: M functions from here on say how blocks are carried out
_FORM = 89
_WANTED = pattern(rb"(?i)TOOL[ \t]+CALL([^;\r\n]*)|(?<![A-Z0-9_])M(\d{1,3})(?![\d.])")
_TOOL = pattern(rb'[ \t]*(?:\d|")')
_SPEED = pattern(rb"(?i)(?<![A-Z])S[ \t]*(\d+(?:\.\d*)?)")


def asks(program: Program) -> Iterator[Asked]:
    """What each line asks for, in order of lines."""
    for line, found, before in places(program, _WANTED):
        if said(before):
            continue
        if found[2] is not None:
            if int(found[2]) < _FORM:
                yield by_codes(line, [int(found[2])], turns=_TURNS)
            continue
        speed = _SPEED.search(found[1].split(b'"')[-1])
        yield Asked(
            line, change=_TOOL.match(found[1]) is not None, speed=None if speed is None else float(speed[1])
        )
