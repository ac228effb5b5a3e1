"""Corners that the control rounds or chamfers (RND, RNDM, CHF, CHR), written as blocks of their own.

This runs over the blocks of the unrolled program, as a corner depends on the block behind it. Source:
Siemens, Programming Manual Fundamentals, section on chamfers and roundings.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

from olp.core.errors import ProgramError
from olp.core.values import dataclass
from olp.program.contours.corners import Corner, Element, Point, chamfer, rounding, turn_at
from olp.program.sinumerik.blocks import Form, Piece, block_of, without_comment
from olp.program.sinumerik.flatten.elements import AXES, CENTRES, PLANES, Words, element_of, refused
from olp.program.sinumerik.flatten.text import shown
from olp.program.sinumerik.table import CONTOUR_WAYS, HARMLESS, HARMLESS_G, ROUNDING_G

#: Whether a text has such corners at all.
SIGN = re.compile(rb"(?i)(?<![A-Z0-9_])(?:RNDM?|CHF|CHR)[ \t]*=")
_CORNERS = frozenset({"RND", "CHF", "CHR"})
#: Codes beside which positions keep their meaning.
_KEEPS = frozenset({*range(5), 9, *range(17, 20), *range(40, 43), 60, 90, 91, *range(93, 98), *HARMLESS_G,
                    *ROUNDING_G})  # fmt: skip
#: Words and statements beside which positions keep their meaning.
_PLAIN = frozenset(
    {*"NGFSMHABCUVW", *AXES, *CENTRES, "CR", "TURN", "RNDM", *_CORNERS, *HARMLESS, *CONTOUR_WAYS}
)
#: rad of a joint that is no corner
_SMOOTH = 1e-6

#: A block and where it comes from.
Placed = tuple[bytes, tuple[str | None, int]]


@dataclass(frozen=True, slots=True)
class _Leg:
    """A block that moves in the plane: its place in the output, its element, plane and motion code, and
    whether its words are distances. The corner behind it has a kind and a size, 0 where there is none."""

    index: int
    element: Element
    plane: int
    motion: int
    incremental: bool
    kind: str
    size: float


class Corners:
    """Writes the corners of blocks."""

    def __init__(self) -> None:
        self.written: list[Placed] = []
        self._position: dict[str, float] = {}
        self._motion, self._plane, self._incremental = 1, 17, False
        self._always = 0.0
        self._held: _Leg | None = None

    def put(self, placed: Placed) -> None:
        """The next block. Raises ProgramError, without a line, for corners that are not written out."""
        raw, source = placed
        code = without_comment(raw).rstrip()
        pieces = () if code.lstrip().startswith(b"%") else block_of(code).pieces
        codes = [code[p.value : p.value_end].strip() for p in pieces if p.name == "G" and p.form is Form.WORD]
        numbers = {int(c) for c in codes if c.isdigit()}
        words = Words(code, pieces, next((n for n in numbers if n in PLANES), self._plane))
        if "RNDM" in words.pieces:
            self._always = words.number("RNDM") or 0.0
        names = {name.partition("[")[0] for name in words.pieces}
        foreign = bool(names - _PLAIN or numbers - _KEEPS)
        if self._held is not None and self._held.size and (foreign or words.plane != self._plane):
            raise refused("behind a corner of RND, CHF or CHR comes no motion in its plane")
        self._plane = words.plane
        self._motion = next((n for n in numbers if n < 4), self._motion)
        self._incremental = next((n == 91 for n in numbers if n in (90, 91)), self._incremental)
        kind = next((name for name in words.pieces if name in _CORNERS), "RND")
        stated = words.number(kind)
        size = self._always if stated is None else stated
        if "RNDM" in names or names & _CORNERS:
            raw = _changed(raw, {}, {"RNDM", *_CORNERS})
        if foreign:
            self._position.clear()
        moves = bool(names & {*AXES, *CENTRES}) and not foreign and 4 not in numbers
        if not moves:
            if stated:
                raise refused(f"{kind} stands in a block without a motion in the plane")
            if foreign:
                self._held = None
            self.written.append((raw, source))
            return
        self._leg(raw, source, words, (kind, size), explicit=bool(stated))

    def _leg(
        self,
        raw: bytes,
        source: tuple[str | None, int],
        words: Words,
        corner: tuple[str, float],
        *,
        explicit: bool,
    ) -> None:
        """A block that moves: the corner before it, and what the one behind it needs."""
        before = dict(self._position)
        self._go(words)
        element = element_of(words, before, self._position, self._motion)
        third = PLANES[self._plane][2]
        if self._motion == 0 or (third in words.pieces and before.get(third) != self._position.get(third)):
            element = None
        held, self._held = self._held, None
        if set(words.pieces) & {*AXES, *CENTRES} == {third}:
            # the control makes no corner before a move across the plane
            held = None
        if element is None:
            if explicit or (held is not None and held.size):
                raise refused("a block beside a corner of RND, CHF or CHR is no G1, G2 or G3 in its plane")
            self.written.append((raw, source))
            return
        leg = _Leg(len(self.written), element, self._plane, self._motion, self._incremental, *corner)
        self.written.append((raw, source))
        if held is not None and held.size:
            leg = self._corner(held, leg, words.pieces.get("F"), words.code)
        self._held = leg

    def _go(self, words: Words) -> None:
        for axis in AXES:
            found = words.counted(axis)
            if found is None:
                continue
            value, how = found
            if how == "IC" or (self._incremental and how != "AC"):
                if axis in self._position:
                    self._position[axis] += value
            else:
                self._position[axis] = value

    def _corner(self, held: _Leg, leg: _Leg, feed: Piece | None, code: bytes) -> _Leg:
        """Put the corner between two legs; the second one, which begins behind it."""
        first, second, name = held.element, leg.element, f"{held.kind}={held.size:g}"
        if abs(turn_at(first, second)) < _SMOOTH:
            return leg
        if held.kind == "RND":
            corner = rounding(first, second, held.size, name)
        else:
            corner = chamfer(first, second, held.size, name, across=held.kind == "CHF")
        raw, source = self.written[held.index]
        ended = replace(held, element=replace(first, end=corner.begin))
        self.written[held.index] = (_to(raw, ended), source)
        inserted = _new(held, corner)
        if feed is not None:
            inserted += b" " + code[feed.start : feed.end]
        later, mine = self.written[leg.index]
        leg = replace(leg, index=leg.index + 1, element=replace(second, begin=corner.end))
        self.written[leg.index - 1 :] = [(inserted, mine), (_to(later, leg, code=True), mine)]
        return leg


def _new(leg: _Leg, corner: Corner) -> bytes:
    """The block of a corner."""
    base = corner.begin if leg.incremental else (0.0, 0.0)
    a, b, _ = PLANES[leg.plane]
    words = ["G1" if corner.centre is None else f"G{3 if corner.left else 2}"]
    words += [f"{axis}{shown(v - o)}" for axis, v, o in zip((a, b), corner.end, base, strict=True)]
    if corner.centre is not None:
        words += [f"{k}{v}" for k, v in _centre(leg, corner.begin, corner.centre).items()]
    return " ".join(words).encode()


def _centre(leg: _Leg, begin: Point, centre: Point) -> dict[str, str]:
    a, b, _ = PLANES[leg.plane]
    away = zip((a, b), centre, begin, strict=True)
    return {CENTRES[AXES.index(axis)]: shown(c - o) for axis, c, o in away}


def _to(raw: bytes, leg: _Leg, *, code: bool = False) -> bytes:
    """A block that goes along a leg; with its motion `code` where it lacks that."""
    element = leg.element
    base = element.begin if leg.incremental else (0.0, 0.0)
    axes = PLANES[leg.plane][:2]
    numbers = {axis: shown(v - o) for axis, v, o in zip(axes, element.end, base, strict=True)}
    gone = set()
    if element.centre is not None:
        numbers |= _centre(leg, element.begin, element.centre)
        gone = {"CR"}
    return _changed(raw, numbers, gone, leg.motion if code else None)


def _changed(raw: bytes, numbers: Mapping[str, str], gone: set[str], motion: int | None = None) -> bytes:
    """A block with other numbers, without some words, and with a motion code where it has none."""
    code = without_comment(raw)
    pieces = block_of(code).pieces
    edits: list[tuple[int, int, bytes]] = []
    missing = dict(numbers)
    for piece in pieces:
        if piece.name in gone:
            start = len(code[: piece.start].rstrip(b" \t")) if piece is not pieces[0] else piece.start
            edits.append((start, piece.end, b""))
        elif piece.name in numbers:
            edits.append((piece.value, piece.value_end, numbers[piece.name].encode()))
            del missing[piece.name]
    kept = [piece for piece in pieces if piece.name not in gone]
    has = any(
        p.name == "G" and code[p.value : p.value_end].strip().lstrip(b"0") in (b"", b"1", b"2", b"3")
        for p in kept
    )
    if motion is not None and not has:
        edits.append((pieces[0].start, pieces[0].start, b"G%d " % motion))
    if missing:
        end = pieces[-1].end
        edits.append((end, end, "".join(f" {name}{text}" for name, text in missing.items()).encode()))
    for start, end, text in sorted(edits, key=lambda e: e[0], reverse=True):
        raw = raw[:start] + text + raw[end:]
    return raw


def with_corners(placed: Sequence[Placed]) -> list[Placed]:
    """Blocks with their corners. Raises ProgramError with file and line."""
    corners = Corners()
    for one in placed:
        try:
            corners.put(one)
        except ProgramError as error:
            if error.line is None:
                error.file, error.line = one[1]
            raise
    return corners.written
