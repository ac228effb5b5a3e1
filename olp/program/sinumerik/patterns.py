"""Patterns of places on Sinumerik controls: HOLES1 on a line, HOLES2 on a circle, CYCLE801 on a grid.

Source: Siemens, Programming Manual Cycles, section "Drilling pattern cycles".
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from olp.core.errors import ProgramError
from olp.program.sinumerik.blocks import NUMBER

Place = tuple[float, float]
#: Arguments of each pattern that are always there.
_NEEDED = {"HOLES1": 6, "HOLES2": 6, "CYCLE801": 7}
#: Arguments behind these that say how the tool goes from place to place, and the plane, which is G17.
_FREE = {"HOLES1": (0, 1, 4), "HOLES2": (1, 4), "CYCLE801": (1, 6)}
#: Places of a pattern at most.
_MOST = 10_000


def places(name: str, given: Sequence[bytes]) -> list[Place]:
    """X and Y of the places of a pattern, in the unit of the program. Raises ProgramError, without a line,
    for arguments that are not read."""
    needed = _NEEDED[name]
    values = [float(a) if NUMBER.fullmatch(a) else math.nan for a in given[:needed]]
    if len(values) < needed or any(map(math.isnan, values)):
        raise ProgramError(f"{name} needs {needed} numbers as its first arguments", code="OLP531")
    further = list(given[needed:])
    frame = name == "CYCLE801" and bool(further) and further[0] == b"1"
    if frame:
        further[0] = b""
    for k, text in enumerate(further):
        if k not in _FREE[name] and text not in (b"", b"0", b'""'):
            raise ProgramError(
                f"argument {needed + k + 1} of {name} is `{text.decode('latin-1')}`, which is not read; "
                "program the places as blocks",
                code="OLP544",
            )
    if name == "CYCLE801":
        return _grid(values, frame=frame)
    return (_on_line if name == "HOLES1" else _on_circle)(values)


def _count(value: float) -> int:
    if value != round(value) or not 0 < value <= _MOST:
        raise ProgramError(f"a pattern has {value:g} places; expected an integer from 1 on", code="OLP531")
    return round(value)


def _on_line(values: Sequence[float]) -> list[Place]:
    x, y, degrees, first, step, count = values
    c, s = _direction(degrees)
    away = [first + i * step for i in range(_count(count))]
    return [(x + a * c, y + a * s) for a in away]


def _on_circle(values: Sequence[float]) -> list[Place]:
    x, y, radius, start, step, count = values
    number = _count(count)
    turns = [_direction(start + i * (step or 360.0 / number)) for i in range(number)]
    return [(x + radius * c, y + radius * s) for c, s in turns]


def _grid(values: Sequence[float], *, frame: bool) -> list[Place]:
    """Row by row, in both directions; of a frame its rim alone."""
    x, y, degrees, column, row, columns, rows = values
    m, n = _count(columns), _count(rows)
    c, s = _direction(degrees)
    found = []
    for j in range(_count(m * n) // m):
        order = range(m) if j % 2 == 0 else reversed(range(m))
        for i in order:
            if not frame or i in (0, m - 1) or j in (0, n - 1):
                a, b = i * column, j * row
                found.append((x + a * c - b * s, y + a * s + b * c))
    return found


def _direction(degrees: float) -> Place:
    angle = math.radians(degrees)
    return math.cos(angle), math.sin(angle)
