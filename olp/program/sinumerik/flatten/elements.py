"""One block of a contour in its plane: a straight line or a circle between two points."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

from olp.core.errors import ProgramError
from olp.program.contours.corners import Element
from olp.program.sinumerik.blocks import NUMBER, Piece
from olp.program.sinumerik.refusals import no_number

AXES = "XYZ"
CENTRES = "IJK"
#: First, second and third axis of each plane.
PLANES: Mapping[int, tuple[str, str, str]] = {17: ("X", "Y", "Z"), 18: ("Z", "X", "Y"), 19: ("Y", "Z", "X")}
_COUNTED = re.compile(rb"(AC|IC)[ \t]*\(([^()]*)\)", re.IGNORECASE)
#: mm below which points are the same
SAME = 1e-9


def element_of(
    words: Words, before: Mapping[str, float], after: Mapping[str, float], motion: int
) -> Element | None:
    """The element of a block with G0 to G3 between two positions; None where it is not known, or where
    nothing moves in the plane."""
    a, b, _ = PLANES[words.plane]
    if not {a, b} <= set(before) or not {a, b} <= set(after):
        return None
    begin, end = (before[a], before[b]), (after[a], after[b])
    if motion in (0, 1):
        return None if math.dist(begin, end) < SAME else Element(begin, end)
    radius = words.number("CR")
    if radius is None:
        i, j = (words.centre(axis, start) for axis, start in ((a, begin[0]), (b, begin[1])))
        if i is None and j is None:
            return None
        centre = (begin[0] if i is None else i, begin[1] if j is None else j)
        return Element(begin, end, centre, motion == 3)
    if math.dist(begin, end) < 2 * SAME:
        return None
    return Element.by_radius(begin, end, radius, left=motion == 3)


def counted(code: bytes, piece: Piece) -> tuple[float, str]:
    """The number of a piece, and AC, IC or nothing. Raises ProgramError, without a line, for what is none."""
    text = code[piece.value : piece.value_end].strip()
    call = _COUNTED.fullmatch(text)
    number = (call[2] if call else text).strip()
    if NUMBER.fullmatch(number) is None:
        raise no_number(piece.name, text)
    return float(number.replace(b" ", b"").replace(b"\t", b"")), call[1].decode().upper() if call else ""


class Words:
    """The numbers of a block, by the names of its words."""

    def __init__(self, code: bytes, pieces: Sequence[Piece], plane: int) -> None:
        self.code, self.plane, self.pieces = code, plane, {piece.name: piece for piece in pieces}

    def counted(self, name: str) -> tuple[float, str] | None:
        """The number of a word, and AC, IC or nothing; None where it is not there."""
        piece = self.pieces.get(name)
        if piece is None:
            return None
        return counted(self.code, piece)

    def number(self, name: str) -> float | None:
        """The number of a word, however it counts."""
        found = self.counted(name)
        return None if found is None else found[0]

    def centre(self, axis: str, start: float) -> float | None:
        """The coordinate of a centre along an axis, from the start of its circle."""
        found = self.counted(CENTRES[AXES.index(axis)])
        if found is None:
            return None
        return found[0] if found[1] == "AC" else start + found[0]


def refused(message: str) -> ProgramError:
    """Why a shape is not written out."""
    return ProgramError(message, code="OLP544")


def unknown(what: str) -> ProgramError:
    """A shape counts from what is not known."""
    return ProgramError(f"{what} is not known; program a position in G90 first", code="OLP524")
