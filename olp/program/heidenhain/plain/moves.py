"""The moves of motion blocks: where each leads, in one system of coordinates, whatever the program shifts.

Positions count from the preset in the unit of the program, NaN where not known. A block keeps its bytes where
it says what it did before; others are written again as L, or as CC with C or CP.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import field
from typing import Literal

from olp.core.errors import ProgramError
from olp.core.values import dataclass
from olp.program.heidenhain.plain.blocks import Block, line_end, written
from olp.program.heidenhain.plain.frame import Transformation
from olp.program.heidenhain.plain.path import Piece, Point, tangent_arc

NAN = math.nan
_FULL = 2 * math.pi
#: a pole and an end that are off by less are the same, in the unit of the program
_SAME = 1e-7
_SWAPPED = {b"RL": b"RR", b"RR": b"RL"}
Source = tuple[int, int]


@dataclass(slots=True, eq=False)
class Entry:
    """A statement in the text that is written: its `lines` as they are, with the `source` of each. A move has
    a `piece` across the plane, or none, and the `axes` that it states. `changed` ones are written again, with
    `rest` as their other words. `shift` is the datum shift of its words, `pole` what a CC states. `side` is 1
    where the control keeps the tool on the left of the contour, -1 on the right, by its `radius`. `centre`:
    the piece is that of the tool's centre already."""

    lines: list[bytes]
    source: list[Source]
    block: Block | None = None
    piece: Piece | None = None
    z: tuple[float, float] = (NAN, NAN)
    axes: bytes = b""
    changed: bool = False
    rest: bytes = b""
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    pole: Point | None = None
    before: list[Entry] = field(default_factory=list)
    side: int = 0
    radius: float = 0.0
    centre: bool = False


def unknown(what: str, line: int) -> ProgramError:
    return ProgramError(
        f"{what} needs the present position, which is not known here; command X, Y and Z before",
        line=line,
        code="OLP524",
    )


class Moves:
    """The state of the motion: position, pole, transformation."""

    def __init__(self, scaling_axes: Literal["plane", "all"] | None) -> None:
        self.frame = Transformation(scaling_axes)
        self.at = [NAN, NAN, NAN]
        #: the pole, from the preset; None in other planes than that of X and Y
        self.pole: Point | None = None
        #: the axes of a pole in a plane with Z, that of angle 0 first, and the pole, from the preset
        self.upright: tuple[int, int, list[float]] | None = None
        #: polar radius and angle of the last LP, in words
        self.angle = NAN

    # -- positions -----------------------------------------------------------------------------------

    def words(self) -> tuple[float, float, float]:
        """The present position in words of the program."""
        shift = self.frame.shift
        z = self.frame.scaling.inward(2, self.at[2] - shift[2])
        return (*self.inward((self.at[0], self.at[1])), z)

    def inward(self, point: Point) -> Point:
        return self.frame.inward(point[0] - self.frame.shift[0], point[1] - self.frame.shift[1])

    def outward(self, x: float, y: float) -> Point:
        dx, dy = self.frame.outward(x, y)
        return dx + self.frame.shift[0], dy + self.frame.shift[1]

    def _words_of(self, block: Block) -> list[float]:
        """The position in words of the program with the axis words of a block."""
        here = list(self.words())
        for axis, letter in enumerate((b"X", b"Y", b"Z")):
            if letter in block.words:
                step, value = block.words[letter]
                here[axis] = here[axis] + value if step else value
        return here

    def end(self, block: Block) -> tuple[Point, float]:
        """Where the axis words of a block lead: in the plane, and along Z."""
        here, z = self._words_of(block), self.at[2]
        if b"Z" in block.words:
            z = self.frame.up(here[2], block.line) + self.frame.shift[2]
        if not block.stated(b"XY"):
            return (self.at[0], self.at[1]), z
        return self.outward(here[0], here[1]), z

    def polar_end(self, block: Block) -> tuple[Point, float]:
        """Where PR and PA lead: from the pole, the angle from the first axis in words."""
        pole = self._pole(block)
        x, y = self.words()[:2]
        radius, angle = math.hypot(x - pole[0], y - pole[1]), math.atan2(y - pole[1], x - pole[0])
        if b"PR" in block.words:
            step, value = block.words[b"PR"]
            radius = radius + value if step else value
        if b"PA" in block.words:
            step, value = block.words[b"PA"]
            angle = angle + math.radians(value) if step else math.radians(value)
        if math.isnan(radius) or math.isnan(angle):
            raise unknown("a polar position with PR or PA alone, or with I,", block.line)
        point = self.outward(pole[0] + radius * math.cos(angle), pole[1] + radius * math.sin(angle))
        return point, self.end(block)[1]

    def put_upright_pole(self, block: Block) -> None:
        """Take over a CC of a plane with Z: angles count from Y in YZ, and from Z in ZX."""
        first, second = (1, 2) if b"Y" in block.words else (2, 0)
        letters = (b"XYZ"[first : first + 1], b"XYZ"[second : second + 1])
        self.upright = None
        if set(block.words) == set(letters) and not any(step for step, _ in block.words.values()):
            point, z = self.end(block)
            self.upright = first, second, [*point, z]

    def upright_end(self, block: Block) -> tuple[list[float], bytes]:
        """Where LP leads in a plane with Z, and the axes that it states."""
        assert self.upright is not None
        first, second, (x, y, z) = self.upright
        pole = [*self.inward((x, y)), self.frame.scaling.inward(2, z - self.frame.shift[2])]
        here, end = self.words(), self._words_of(block)
        dx, dy = here[first] - pole[first], here[second] - pole[second]
        radius, angle = math.hypot(dx, dy), math.degrees(math.atan2(dy, dx))
        step, value = block.words.get(b"PR", (True, 0.0))
        radius = radius + value if step else value
        step, value = block.words.get(b"PA", (True, 0.0))
        angle = math.radians(angle + value if step else value)
        if math.isnan(radius) or math.isnan(angle):
            raise unknown("a polar position with PR or PA alone, or with I,", block.line)
        end[first], end[second] = (
            pole[first] + radius * math.cos(angle), pole[second] + radius * math.sin(angle)
        )  # fmt: skip
        stated = {first, second} | {k for k in range(3) if b"XYZ"[k : k + 1] in block.words}
        if self.frame.turned and stated & {0, 1}:
            stated |= {0, 1}
        point = self.outward(end[0], end[1])
        height = self.frame.up(end[2], block.line) + self.frame.shift[2]
        return [*point, height], bytes(b"XYZ"[k] for k in sorted(stated))

    def _pole(self, block: Block) -> Point:
        if self.pole is None:
            raise ProgramError(
                "there is no pole in the plane of X and Y here; give CC before",
                line=block.line,
                code="OLP516",
            )
        return self.inward(self.pole)

    # -- pieces --------------------------------------------------------------------------------------

    def arc(self, block: Block) -> tuple[Piece, float]:
        """The piece of C, CR or CP, and where it ends along Z."""
        start = (self.at[0], self.at[1])
        if math.isnan(start[0]) or math.isnan(start[1]):
            raise unknown("an arc", block.line)
        if not block.turn:
            raise ProgramError("an arc has no DR; give DR+ or DR-", line=block.line, code="OLP516")
        if math.isnan(self.frame.scaling.size):
            raise ProgramError(
                "an arc where X and Y are scaled by different factors (CYCL DEF 26); write it as "
                "straight moves",
                line=block.line,
                code="OLP512",
            )
        turn = -block.turn if self.frame.flips else block.turn
        if block.name == b"CP":
            return self._polar_arc(block, start, turn)
        end, z = self.end(block)
        if block.name == b"CR":
            return self._by_radius(block, start, end, turn), z
        centre = self.outward(*self._pole(block))
        return Piece(start, end, centre, _sweep(start, end, centre, turn)), z

    def _polar_arc(self, block: Block, start: Point, turn: int) -> tuple[Piece, float]:
        centre = self.outward(*self._pole(block))
        if b"PA" not in block.words:
            raise ProgramError("CP needs one angle (PA or IPA) and DR", line=block.line, code="OLP516")
        step, degrees = block.words[b"PA"]
        z = self.end(block)[1]
        if not step:
            x, y = self.inward(start)
            pole = self._pole(block)
            own = (math.radians(degrees) - math.atan2(y - pole[1], x - pole[0])) * block.turn % _FULL
            size = own if own > _SAME else _FULL
        elif degrees * block.turn <= 0:
            raise ProgramError(
                "IPA and DR of this arc turn in opposite directions; give both the same sign",
                line=block.line,
                code="OLP530",
            )
        else:
            size = abs(math.radians(degrees))
        sweep, arm = size * turn, math.atan2(start[1] - centre[1], start[0] - centre[0])
        radius = math.dist(start, centre)
        end = (centre[0] + radius * math.cos(arm + sweep), centre[1] + radius * math.sin(arm + sweep))
        return Piece(start, end, centre, sweep), z

    def _by_radius(self, block: Block, start: Point, end: Point, turn: int) -> Piece:
        radius = block.sizes.get(b"R", 0.0) * self.frame.scaling.size
        chord = math.dist(start, end)
        if not radius or chord < _SAME or chord / 2 > abs(radius) * (1 + 1e-3):
            raise ProgramError(
                "the radius of CR does not reach from the start of the arc to its end; give the right radius",
                line=block.line,
                code="OLP530",
            )
        high = math.sqrt(max(radius**2 - (chord / 2) ** 2, 0.0)) * turn * math.copysign(1.0, radius)
        across = (-(end[1] - start[1]) / chord, (end[0] - start[0]) / chord)
        centre = (
            (start[0] + end[0]) / 2 + high * across[0], (start[1] + end[1]) / 2 + high * across[1]
        )  # fmt: skip
        return Piece(start, end, centre, _sweep(start, end, centre, turn))

    def tangent(self, block: Block, before: Piece | None, end: Point) -> Piece:
        """CT and CTP: an arc that goes on where the piece before ended."""
        heading = None if before is None else before.heading(last=True)
        if heading is None:
            raise ProgramError(
                f"{block.name.decode()} goes on from the move before, which is no line or arc in the plane "
                "of X and Y; program one before it",
                line=block.line,
                code="OLP516",
            )
        start = (self.at[0], self.at[1])
        if math.dist(start, end) < _SAME:
            raise ProgramError("an arc ends where it begins; give its end", line=block.line, code="OLP530")
        return tangent_arc(start, heading, end)


def _sweep(start: Point, end: Point, centre: Point, turn: int) -> float:
    if math.dist(start, end) < _SAME:
        return _FULL * turn
    a = math.atan2(start[1] - centre[1], start[0] - centre[0])
    b = math.atan2(end[1] - centre[1], end[0] - centre[0])
    return turn * ((b - a) * turn % _FULL or _FULL)


def flipped(rest: bytes) -> bytes:
    """Other words in a mirrored program: the tool is on the other side of its contour."""
    return b" ".join(_SWAPPED.get(word, word) for word in rest.split())


class Text:
    """The lines that are written, with their sources; the pole of the text goes on from line to line."""

    def __init__(self) -> None:
        self.lines: list[bytes] = []
        self.sources: list[Source] = []
        self._pole: Point | None = None

    def put(self, entry: Entry) -> None:
        for other in entry.before:
            self.put(other)
        block, piece = entry.block, entry.piece
        arc = piece is not None and piece.sweep != 0.0
        about = block is not None and block.name in (b"C", b"CP")
        if piece is not None and arc and about and not _near(self._pole, piece.centre):
            entry.changed = True
        if block is None or not entry.changed:
            self.lines += entry.lines
            self.sources += entry.source
            if block is not None and block.name == b"CC":
                # a pole of another plane is none of arcs in X and Y
                self._pole = entry.pole
            return
        if entry.pole is not None:
            self._cc(entry, block, entry.pole, block.tail)
        elif piece is not None and arc:
            self._arc(entry, block, piece)
        else:
            self._line(entry, block, b"L", self._ends(entry), entry.rest)

    def _line(
        self, entry: Entry, block: Block, name: bytes, words: list[tuple[bytes, float]], rest: bytes
    ) -> None:
        self._add(entry, written(block.head, name, words, rest, block.tail))

    def _add(self, entry: Entry, line: bytes) -> None:
        self.lines.append(line)
        self.sources.append(entry.source[0])

    def _ends(self, entry: Entry) -> list[tuple[bytes, float]]:
        words: Mapping[bytes, float] = {} if entry.piece is None else {
            b"X": entry.piece.end[0] - entry.shift[0], b"Y": entry.piece.end[1] - entry.shift[1],
        }  # fmt: skip
        words = {**words, b"Z": entry.z[1] - entry.shift[2]}
        if any(math.isnan(words[letter]) for letter in (b"X", b"Y", b"Z") if letter in entry.axes):
            assert entry.block is not None
            raise unknown("this block", entry.block.line)
        return [(letter, words[letter]) for letter in (b"X", b"Y", b"Z") if letter in entry.axes]

    def _cc(self, entry: Entry, block: Block, pole: Point, tail: bytes) -> None:
        words = [(b"X", pole[0] - entry.shift[0]), (b"Y", pole[1] - entry.shift[1])]
        self._add(entry, written(block.head, b"CC", words, b"", tail))
        self._pole = pole

    def _arc(self, entry: Entry, block: Block, piece: Piece) -> None:
        if not _near(self._pole, piece.centre):
            self._cc(entry, block, piece.centre, line_end(block.tail) or b"\n")
        rest = b" ".join((b"DR+" if piece.sweep > 0 else b"DR-", *((entry.rest,) if entry.rest else ())))
        if abs(piece.sweep) > _FULL - 1e-9 or b"Z" in entry.axes:
            words = [(b"IPA", math.degrees(piece.sweep))]
            words += [(a, v) for a, v in self._ends(entry) if a == b"Z"]
            self._line(entry, block, b"CP", words, rest)
        else:
            self._line(entry, block, b"C", [w for w in self._ends(entry) if w[0] != b"Z"], rest)


def _near(a: Point | None, b: Point) -> bool:
    return a is not None and math.dist(a, b) < _SAME
