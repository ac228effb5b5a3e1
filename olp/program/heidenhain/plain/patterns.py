"""Points of patterns of holes: CYCL DEF 220 and 221, and PATTERN DEF."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

from olp.core.errors import ProgramError

_NUMBER = rb"[-+]?(?:\d+\.?\d*|\.\d+)"
_GROUP = re.compile(rb"([A-Z]+)\d*[ \t]*\(([^)]*)\)")
_VALUE = re.compile(rb"([A-Z]+)[ \t]*(" + _NUMBER + rb")")
#: holes of one pattern at most
MOST_HOLES = 100_000

#: a hole in words of the program: X, Y, and what is added to the surface
Hole = tuple[float, float, float]


def on_circle(q: Mapping[int, float], line: int) -> list[Hole]:
    """CYCL DEF 220: on a circle about Q216, Q217 with diameter Q244, from Q245 to Q246 or in steps Q247."""
    count = _count(q.get(241, 0.0), line)
    start, stop, step = (q.get(k, d) for k, d in ((245, 0.0), (246, 360.0), (247, 0.0)))
    if not step and count > 1:
        full = abs(stop - start) % 360.0 == 0.0
        step = (stop - start) / (count if full else count - 1)
    radius = _stated(q, 244, line) / 2
    return _circle(_stated(q, 216, line), _stated(q, 217, line), radius, start, step, count, 0.0)


def on_lines(q: Mapping[int, float], line: int) -> list[Hole]:
    """CYCL DEF 221: Q243 lines of Q242 columns from Q225, Q226, each line back as the one before went."""
    columns, lines = _count(q.get(242, 0.0), line), _count(q.get(243, 0.0), line)
    _count(float(columns * lines), line)
    x0, y0, dx, dy = (_stated(q, k, line) for k in (225, 226, 237, 238))
    turn = math.radians(q.get(224, 0.0))
    holes = []
    for row in range(lines):
        for k in range(columns):
            column = k if row % 2 == 0 else columns - 1 - k
            x, y = column * dx, row * dy
            holes.append(_turned(x0, y0, x, y, turn, 0.0))
    return holes


def defined(text: bytes, line: int) -> list[Hole]:
    """The holes of a PATTERN DEF."""
    body = text[len(b"PATTERN DEF") :]
    if _GROUP.sub(b"", body).strip():
        raise ProgramError(
            "PATTERN DEF is not understood; expected groups in brackets", line=line, code="OLP510"
        )
    holes: list[Hole] = []
    for name, inner in _GROUP.findall(body):
        v = {key: float(number) for key, number in _VALUE.findall(inner)}
        if _VALUE.sub(b"", inner).strip() or not {b"X", b"Y"} <= v.keys():
            raise ProgramError(
                f"{name.decode()} of PATTERN DEF is not understood; expected numbers, X and Y among them",
                line=line,
                code="OLP510",
            )
        holes += _group(name, v, line)
        _count(float(len(holes)), line)
    return holes


def _group(name: bytes, v: Mapping[bytes, float], line: int) -> list[Hole]:
    x, y, z = v[b"X"], v[b"Y"], v.get(b"Z", 0.0)
    turn = math.radians(v.get(b"ROT", 0.0))
    if name == b"POS":
        return [(x, y, z)]
    if name == b"ROW":
        return [
            _turned(x, y, k * v.get(b"D", 0.0), 0.0, turn, z) for k in range(_count(v.get(b"NUM", 0.0), line))
        ]
    if name in (b"CIRC", b"PITCHCIRC"):
        count = _count(v.get(b"NUM", 0.0), line)
        step = 360.0 / count if name == b"CIRC" else v.get(b"STEP", 0.0)
        return _circle(x, y, v.get(b"D", 0.0) / 2, v.get(b"START", 0.0), step, count, z)
    if name in (b"PAT", b"FRAME"):
        return _grid(v, line, rim=name == b"FRAME")
    raise ProgramError(
        f"{name.decode()} of PATTERN DEF is not read; state its holes with POS, ROW, CIRC or PAT",
        line=line,
        code="OLP512",
    )


def _grid(v: Mapping[bytes, float], line: int, *, rim: bool) -> list[Hole]:
    """Rows of a grid, each back as the one before went; of a frame its rim alone. ROT turns the whole, ROTX
    and ROTY one of its directions."""
    columns, rows = _count(v.get(b"NUMX", 0.0), line), _count(v.get(b"NUMY", 0.0), line)
    _count(float(columns * rows), line)
    along, up = (math.radians(v.get(b"ROT", 0.0) + v.get(key, 0.0)) for key in (b"ROTX", b"ROTY"))
    dx, dy = v.get(b"DX", 0.0), v.get(b"DY", 0.0)
    holes = []
    for row in range(rows):
        for k in range(columns):
            column = k if row % 2 == 0 else columns - 1 - k
            if rim and 0 < row < rows - 1 and 0 < column < columns - 1:
                continue
            x, y, z = _turned(v[b"X"], v[b"Y"], column * dx, 0.0, along, v.get(b"Z", 0.0))
            holes.append(_turned(x, y, 0.0, row * dy, up, z))
    return holes


def _circle(x: float, y: float, radius: float, start: float, step: float, count: int, z: float) -> list[Hole]:
    angles = [math.radians(start + k * step) for k in range(count)]
    return [(x + radius * math.cos(a), y + radius * math.sin(a), z) for a in angles]


def _turned(x0: float, y0: float, x: float, y: float, turn: float, z: float) -> Hole:
    c, s = math.cos(turn), math.sin(turn)
    return x0 + c * x - s * y, y0 + s * x + c * y, z


def _stated(q: Mapping[int, float], number: int, line: int) -> float:
    if number not in q:
        raise ProgramError(f"the pattern has no Q{number}; give it", line=line, code="OLP516")
    return q[number]


def _count(value: float, line: int) -> int:
    if value != round(value) or not 1 <= value <= MOST_HOLES:
        raise ProgramError(
            f"a pattern has {value:g} holes; expected an integer from 1 to {MOST_HOLES}",
            line=line,
            code="OLP516",
        )
    return round(value)
