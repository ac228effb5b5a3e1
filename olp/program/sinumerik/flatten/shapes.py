"""Blocks whose end or arc is stated otherwise, written with X, Y, Z and centres: polar positions (AP, RP),
straight lines by their angle (ANG), circles through a point (CIP), and tangential circles (CT).

Source: Siemens, Programming Manual Fundamentals, sections on polar coordinates and circular interpolation.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from olp.program.contours.corners import Element, Point
from olp.program.sinumerik.blocks import Form, Piece
from olp.program.sinumerik.flatten.elements import (
    AXES,
    CENTRES,
    PLANES,
    SAME,
    Words,
    refused,
    unknown,
)
from olp.program.sinumerik.flatten.text import shown

#: The middle point of CIP by the axis that it is along.
_MIDDLE: Mapping[str, str] = {"I1": "X", "J1": "Y", "K1": "Z"}
_POLES = frozenset({110, 111, 112})
_OWN = frozenset({"AP", "RP", "ANG", "AR", *_MIDDLE, "CIP", "CT"})
#: rad below which a tangential circle is a straight line
_STRAIGHT = 1e-9


class Shapes:
    """What these blocks depend on, followed through the program: the pole, the last angle and radius, and
    the `last` element, None where it is not known. `special` is CIP or CT while that is in force."""

    def __init__(self) -> None:
        self.special = ""
        self.last: Element | None = None
        # the workpiece zero until a pole is programmed; None where a new frame leaves it open
        self._pole: Point | None = (0.0, 0.0)
        self._programmed = False
        self._angle: float | None = None
        self._radius: float | None = None

    def forget(self) -> None:
        """The frame has changed: a programmed pole is not known in it."""
        self.last = None
        self._angle = self._radius = None
        if self._programmed:
            self._pole = None

    def written(
        self,
        raw: bytes,
        pieces: Sequence[Piece],
        position: Mapping[str, float],
        modes: tuple[int, int, bool],
    ) -> bytes | None:
        """The block with these pieces in plain words; None for one that sets the pole alone. `position` is
        that before it, `modes` are motion, plane, and whether words are distances."""
        code = raw  # pieces lie before its comment
        names = {piece.name for piece in pieces}
        numbers = _codes(code, pieces)
        if numbers & {0, 1, 2, 3}:
            self.special = ""
        self.special = next((name for name in ("CIP", "CT") if name in names), self.special)
        block = _Block(code, pieces, position, modes)
        if numbers & _POLES:
            self._pole = self._new_pole(next(iter(numbers & _POLES)), block)
            self._programmed = True
            return _without_pole(raw, pieces)
        moves = bool(names & {*AXES, "AP", "RP"})
        if not names & _OWN and not (self.special and moves):
            return raw
        if self.special and ((block.incremental and names & {"AP", "RP"}) or "ANG" in names):
            raise refused("AP, RP or ANG and CIP or CT are in one block; post the circle as G2 or G3")
        added: list[str] = []
        if names & {"AP", "RP"}:
            added += self._polar(block, names)
        if "ANG" in names:
            added += _by_angle(block, names)
        if "AR" in names:
            added += _opened(block, names)
        if self.special and moves:
            ends = block.ends() | {word[0]: float(word[1:]) for word in added if word[0] in AXES}
            added += _through(block, ends) if self.special == "CIP" else self._tangential(block, ends)
        elif names & {*_MIDDLE}:
            raise refused("I1, J1 and K1 belong to CIP, which needs the end of its circle in the same block")
        return _with(raw, [p for p in pieces if p.name in _OWN], pieces[-1].end, added)

    def _new_pole(self, code: int, block: _Block) -> Point:
        a, b, _ = PLANES[block.plane]
        base: Sequence[float | None] = (0.0, 0.0)
        if code == 110:
            base = (block.position.get(a), block.position.get(b))
        elif code == 112:
            base = self._pole or (None, None)
        if base[0] is None or base[1] is None:
            raise unknown(f"the position that G{code} counts from")
        angle, radius = block.number("AP"), block.number("RP")
        if angle is not None and radius is not None:
            return _away((base[0], base[1]), angle, radius)
        first, second = block.number(a), block.number(b)
        if code == 111 and (first is None or second is None):
            raise refused("G111 needs both coordinates of the pole in its plane")
        return base[0] + (first or 0.0), base[1] + (second or 0.0)

    def _polar(self, block: _Block, names: set[str]) -> list[str]:
        """The words of a position by angle and radius about the pole."""
        a, b, _ = PLANES[block.plane]
        if names & {a, b}:
            raise refused("AP and RP stand beside a coordinate of their plane; give one or the other")
        if self._pole is None:
            raise unknown("the pole, which a change of the frame left open")
        self._angle = _modal(block, "AP", self._angle)
        self._radius = _modal(block, "RP", self._radius)
        end = _away(self._pole, self._angle, self._radius)
        words = [block.placed(a, end[0]), block.placed(b, end[1])]
        if block.motion in (2, 3) and not self.special and not names & {*CENTRES, "CR", "AR"}:
            begin = block.begin()
            words += _centre((self._pole[0] - begin[0], self._pole[1] - begin[1]), a, b)
        return words

    def _tangential(self, block: _Block, ends: Mapping[str, float]) -> list[str]:
        """CT: the circle that goes on in the direction of the block before."""
        begin, end, (a, b) = block.across(ends)
        if self.last is None or math.dist(self.last.end, begin) > SAME:
            raise refused("CT follows a block whose direction at its end is not known; write it as G2 or G3")
        along = self.last.direction(self.last.end)
        d = (end[0] - begin[0], end[1] - begin[1])
        size = math.hypot(*d)
        cross, dot = along[0] * d[1] - along[1] * d[0], along[0] * d[0] + along[1] * d[1]
        if size < SAME:
            raise refused("CT ends where it begins")
        if abs(cross) < _STRAIGHT * size:
            if dot < 0:
                raise refused("CT leads straight back; write it as a straight line or as G2 or G3")
            return ["G1"]
        radius = size * size / (2 * cross)
        return [f"G{3 if cross > 0 else 2}", *_centre((-along[1] * radius, along[0] * radius), a, b)]


class _Block(Words):
    """One block with what its words count from."""

    def __init__(
        self,
        code: bytes,
        pieces: Sequence[Piece],
        position: Mapping[str, float],
        modes: tuple[int, int, bool],
    ) -> None:
        self.motion, plane, self.incremental = modes
        super().__init__(code, pieces, plane)
        self.position = position

    def end(self, name: str, axis: str) -> float | None:
        """The position that a word states along an axis, None where it is not there."""
        found = self.counted(name)
        if found is None:
            return None
        value, how = found
        if how == "AC" or not (how == "IC" or self.incremental):
            return value
        if axis not in self.position:
            raise unknown(f"{axis} before this block")
        return self.position[axis] + value

    def ends(self) -> dict[str, float]:
        """The positions that X, Y and Z state."""
        found = {axis: self.end(axis, axis) for axis in AXES}
        return {axis: value for axis, value in found.items() if value is not None}

    def placed(self, axis: str, value: float) -> str:
        """A word with which an axis ends at a position."""
        if self.incremental and axis not in self.position:
            raise unknown(f"{axis} before this block")
        return f"{axis}{shown(value - self.position[axis] if self.incremental else value)}"

    def begin(self) -> Point:
        """The position in the plane before the block."""
        a, b, _ = PLANES[self.plane]
        if not {a, b} <= set(self.position):
            raise unknown("the begin of a circle or of a line with an angle")
        return self.position[a], self.position[b]

    def across(self, ends: Mapping[str, float]) -> tuple[Point, Point, tuple[str, str]]:
        """Begin and end of a circle in its plane. Raises ProgramError where it leaves that."""
        a, b, third = PLANES[self.plane]
        begin = self.begin()
        self.level(ends.get(third))
        return begin, (ends.get(a, begin[0]), ends.get(b, begin[1])), (a, b)

    def level(self, value: float | None) -> None:
        """Refuse a circle with a point at another level than its begin."""
        third = PLANES[self.plane][2]
        if value is not None and third not in self.position:
            raise unknown(f"{third} before a circle")
        if value is not None and abs(value - self.position[third]) > SAME:
            raise refused(f"a circle of CIP or CT leaves the plane G{self.plane}; post it as straight lines")


def _through(block: _Block, ends: Mapping[str, float]) -> list[str]:
    """CIP: the circle through a middle point."""
    begin, end, (a, b) = block.across(ends)
    middle = {axis: block.end(word, axis) for word, axis in _MIDDLE.items()}
    block.level(middle[PLANES[block.plane][2]])
    if middle[a] is None and middle[b] is None:
        raise refused("CIP needs the middle point of its circle in I1, J1 or K1")
    first, second = middle[a], middle[b]
    p = (0.0 if first is None else first - begin[0], 0.0 if second is None else second - begin[1])
    q = (end[0] - begin[0], end[1] - begin[1])
    cross = 2 * (p[0] * q[1] - p[1] * q[0])
    if abs(cross) <= SAME * max(math.hypot(*p), math.hypot(*q)):
        raise refused("the three points of CIP are on one line; write it as G1")
    pp, qq = p[0] ** 2 + p[1] ** 2, q[0] ** 2 + q[1] ** 2
    centre = ((pp * q[1] - qq * p[1]) / cross, (qq * p[0] - pp * q[0]) / cross)
    return [f"G{3 if cross > 0 else 2}", *_centre(centre, a, b)]


def _opened(block: _Block, names: set[str]) -> list[str]:
    """AR: a circle by the angle that it spans, and its end or its centre."""
    a, b, _ = PLANES[block.plane]
    angle = math.radians(block.number("AR") or 0.0)
    if block.motion not in (2, 3) or not 0.0 < angle < 2 * math.pi or names & {"AP", "RP", "CR", "TURN"}:
        raise refused("AR is read in G2 and G3, above 0 and below 360, beside X and Y or beside I and J")
    (x, y), sign = block.begin(), 1.0 if block.motion == 3 else -1.0
    i, j = (block.centre(axis, start) for axis, start in ((a, x), (b, y)))
    if i is None and j is None:
        (_, end, _), half = block.across(block.ends()), sign / (2 * math.tan(angle / 2))
        dx, dy = end[0] - x, end[1] - y
        if math.hypot(dx, dy) < SAME:
            raise refused("a circle by AR ends where it begins; give I and J")
        return _centre((dx / 2 - dy * half, dy / 2 + dx * half), a, b)
    if names & {a, b}:
        raise refused("AR stands beside both the end and the centre of its circle; give one of them")
    cx, cy = x if i is None else i, y if j is None else j
    c, s = math.cos(angle), sign * math.sin(angle)
    end = (cx + (x - cx) * c - (y - cy) * s, cy + (x - cx) * s + (y - cy) * c)
    return [block.placed(a, end[0]), block.placed(b, end[1])]


def _by_angle(block: _Block, names: set[str]) -> list[str]:
    """ANG: a straight line by its angle to the first axis and one coordinate."""
    a, b, _ = PLANES[block.plane]
    angle = block.number("ANG")
    if len(names & {a, b}) != 1 or angle is None or block.motion not in (0, 1):
        raise refused("ANG is read in G0 and G1 beside one coordinate of the plane; give both coordinates")
    block.begin()
    turn = math.radians(angle)
    given, missing = (a, b) if a in names else (b, a)
    share, other = (math.cos(turn), math.sin(turn))[:: 1 if given == a else -1]
    end = block.ends()[given]
    gone = end - block.position[given]
    if abs(share) < _STRAIGHT or gone * share < 0:
        raise refused("ANG does not lead to the coordinate that stands beside it")
    return [block.placed(missing, block.position[missing] + gone / share * other)]


def _modal(block: _Block, name: str, before: float | None) -> float:
    """AP or RP of a block, or the one before it."""
    found = block.counted(name)
    if found is None and before is not None:
        return before
    if found is None or (found[1] == "IC" and before is None):
        raise unknown(f"{name} of a polar position")
    return found[0] + (before or 0.0 if found[1] == "IC" else 0.0)


def _away(pole: Point, angle: float, radius: float) -> Point:
    turn = math.radians(angle)
    return pole[0] + radius * math.cos(turn), pole[1] + radius * math.sin(turn)


def _centre(away: Point, a: str, b: str) -> list[str]:
    return [f"{CENTRES[AXES.index(axis)]}{shown(value)}" for axis, value in zip((a, b), away, strict=True)]


def _codes(code: bytes, pieces: Sequence[Piece]) -> set[int]:
    texts = [code[p.value : p.value_end].strip() for p in pieces if p.name == "G" and p.form is Form.WORD]
    return {int(text) for text in texts if text.isdigit()}


def _without_pole(raw: bytes, pieces: Sequence[Piece]) -> bytes | None:
    """The words beside a pole: modes, feeds and M functions; None where there are none."""
    names = {piece.name for piece in pieces}
    poles = [p for p in pieces if _codes(raw, [p]) & _POLES]
    if len(poles) > 1 or (names & {"AP", "RP"} and names & {*AXES}) or len(names & {"AP", "RP"}) == 1:
        raise refused(
            "a pole is stated by G110, G111 or G112 and either its coordinates or its AP and RP; a move to "
            "AP and RP stands in a block of its own"
        )
    gone = [p for p in pieces if p in poles or p.name in (*AXES, "AP", "RP")]
    kept = [p for p in pieces if p not in gone]
    if any(p.name != "G" and not (p.form is Form.WORD and p.name in "FSM") for p in kept):
        raise refused("a pole stands beside words that may move an axis; put it into a block of its own")
    return _with(raw, gone, pieces[-1].end, []) if kept else None


def _with(raw: bytes, gone: Sequence[Piece], end: int, added: Sequence[str]) -> bytes:
    """A block without some pieces, with words in place of the first of them, or at its end."""
    text = " ".join(added).encode()
    if not gone:
        return raw[:end] + b" " + text + raw[end:]
    out = raw[: gone[0].start] + text
    for piece, following in zip(gone, [*(g.start for g in gone[1:]), len(raw)], strict=True):
        rest = raw[piece.end : following]
        out += rest if following == len(raw) else rest.rstrip(b" \t")
    return out
