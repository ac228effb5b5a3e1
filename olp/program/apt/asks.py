"""What APT asks of the control beside motion: LOADTL, LOAD/TOOL, TURRET, SPINDL and AUXFUN."""

from __future__ import annotations

from collections.abc import Iterator

from olp.core.patterns import pattern
from olp.program.asked import Asked, by_codes, places
from olp.program.program import Program

_WANTED = pattern(
    rb"(?im)^[ \t]*(?:(LOADTL|LOAD[ \t]*/[ \t]*TOOL|TURRET)|(SPINDL)|AUXFUN)[ \t]*[/,]?([^$\r\n]*)"
)
_NUMBER = pattern(rb"(?<![\w.])\d+(?:\.\d*)?")


def asks(program: Program) -> Iterator[Asked]:
    """What each line asks for, in order of lines."""
    for line, found, _ in places(program, _WANTED):
        number = _NUMBER.search(found[3])
        if found[1] is not None:
            yield Asked(line, change=True)
        elif found[2] is None:
            if number is not None:
                yield by_codes(line, [int(float(number[0]))])
        else:
            off, back = (word in found[3].upper() for word in (b"OFF", b"CCLW"))
            turn = 0 if off else -1 if back else 1
            yield Asked(line, speed=None if number is None else float(number[0]), turn=turn)
