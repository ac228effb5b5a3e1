"""Where APPR and DEP lead: to a contour and away from it, along lines and arcs that touch it.

Positions are in the plane of X and Y. The tool has no radius here. As a control has it, a block with R0
approaches and departs as with RR: on the right of the contour.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from olp.core.errors import ProgramError
from olp.program.heidenhain.plain.path import Piece, Point

_QUARTER = math.pi / 2
#: what each form takes
_SIZES = {b"LT": (b"LEN",), b"LN": (b"LEN",), b"CT": (b"R", b"CCA"), b"LCT": (b"R",)}


def _beside(point: Point, heading: float, length: float) -> Point:
    return point[0] + length * math.cos(heading), point[1] + length * math.sin(heading)


def checked(form: bytes, sizes: Mapping[bytes, float], line: int) -> None:
    """Raise ProgramError where a size is not there, or is none."""
    for name in _SIZES[form]:
        if not sizes.get(name, 0.0):
            raise ProgramError(f"APPR or DEP {form.decode()} needs {name.decode()}", line=line, code="OLP516")


def approached(
    form: bytes,
    sizes: Mapping[bytes, float],
    side: int,
    start: Point,
    first: Point,
    heading: float,
    line: int,
) -> list[Piece]:
    """The pieces from `start` to the first point of a contour that goes on with a heading. `side` is 1 left
    of the contour, -1 right. Raises ProgramError where there is no such path."""
    checked(form, sizes, line)
    across = heading + side * _QUARTER
    if form in (b"LT", b"LN"):
        helper = _beside(first, heading + math.pi if form == b"LT" else across, sizes[b"LEN"])
        return [Piece(start, helper), Piece(helper, first)]
    centre, radius, turn = _circle(first, across, sizes[b"R"], side)
    arm = math.atan2(first[1] - centre[1], first[0] - centre[0])
    if form == b"CT":
        sweep = turn * math.radians(sizes[b"CCA"])
    else:
        away, base = _seen(centre, start, radius, line)
        sweep = turn * ((arm - (base + turn * away)) * turn % (2 * math.pi))
    helper = _beside(centre, arm - sweep, radius)
    return [Piece(start, helper), Piece(helper, first, centre, sweep)]


def departed(
    form: bytes, sizes: Mapping[bytes, float], side: int, last: Point, heading: float, end: Point, line: int
) -> list[Piece]:
    """The pieces away from the last point of a contour; `end` counts for LCT alone. As `approached`."""
    checked(form, sizes, line)
    across = heading + side * _QUARTER
    if form in (b"LT", b"LN"):
        return [Piece(last, _beside(last, heading if form == b"LT" else across, sizes[b"LEN"]))]
    centre, radius, turn = _circle(last, across, sizes[b"R"], side)
    arm = math.atan2(last[1] - centre[1], last[0] - centre[0])
    if form == b"CT":
        sweep = turn * math.radians(sizes[b"CCA"])
        return [Piece(last, _beside(centre, arm + sweep, radius), centre, sweep)]
    away, base = _seen(centre, end, radius, line)
    sweep = turn * ((base - turn * away - arm) * turn % (2 * math.pi))
    helper = _beside(centre, arm + sweep, radius)
    return [Piece(last, helper, centre, sweep), Piece(helper, end)]


def _circle(point: Point, across: float, size: float, side: int) -> tuple[Point, float, int]:
    """Centre, radius and direction of the arc that touches the contour at a point."""
    # a negative radius is on the other side of the contour
    turn = side if size > 0 else -side
    return _beside(point, across, size), abs(size), turn


def _seen(centre: Point, point: Point, radius: float, line: int) -> tuple[float, float]:
    """rad; between the arms to a point and to where its tangents touch the circle, and the arm to it."""
    distance = math.dist(centre, point)
    if distance <= radius:
        raise ProgramError(
            "the point beside the contour is inside the arc of APPR or DEP LCT; use a smaller R, or another "
            "point",
            line=line,
            code="OLP530",
        )
    return math.acos(radius / distance), math.atan2(point[1] - centre[1], point[0] - centre[0])
