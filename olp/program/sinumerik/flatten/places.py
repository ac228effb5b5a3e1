"""What unrolled blocks depend on beside their own words: the position, the modes and the modal cycle."""

from __future__ import annotations

from collections.abc import Iterator

from olp.core.errors import ProgramError
from olp.core.toolpath import Kind
from olp.program.sinumerik import cycles, patterns
from olp.program.sinumerik.blocks import Form, Piece, arguments, block_of, without_comment
from olp.program.sinumerik.flatten.elements import AXES, CENTRES, Words, counted, element_of
from olp.program.sinumerik.flatten.shapes import Shapes
from olp.program.sinumerik.flatten.text import shown
from olp.program.sinumerik.frames import STATEMENTS
from olp.program.sinumerik.table import DRILLING, HARMLESS_G, PATTERNS, ROUNDING_G

#: Tapping cannot be written as plain moves.
_KEPT = frozenset({"CYCLE84", "CYCLE840"})
_MOVING_G = frozenset(range(4))
#: G53, the last code up to which positions keep their meaning, and further codes that leave it.
_LAST_MODE = 53
#: Codes whose axis words are no positions of the program, and those of them that leave positions alone.
_NO_PLACE = frozenset({4, 25, 26, 53, 58, 59, 74, 75, 153})
_KEEPS_PLACE = frozenset({4, 25, 26})
_MODES = frozenset({60, 90, 91, 93, 94, 95, 96, 97, *HARMLESS_G, *ROUNDING_G})
#: Statements that change what positions mean.
_FRAMES = frozenset({*STATEMENTS, "SUPA", "D"})


class Places:
    """The state that is followed through the blocks of the unrolled program, in its own numbers."""

    def __init__(self, *, expand_cycles: bool) -> None:
        self._expand = expand_cycles
        self._position: dict[str, float] = {}
        self._motion, self._incremental, self._plane = 1, False, 17
        self._modal: tuple[str, list[bytes]] | None = None
        self._shapes = Shapes()

    def follow(self, deleted: bool, raw: bytes) -> Iterator[bytes]:
        """The blocks that one block becomes."""
        code = without_comment(raw)
        pieces = list(block_of(code).pieces)
        self._modes(code, pieces)
        plain = self._shapes.written(
            raw, pieces, self._position, (self._motion, self._plane, self._incremental)
        )
        if plain is None:
            return
        if plain is not raw:
            raw, code = plain, without_comment(plain)
            pieces = list(block_of(code).pieces)
            self._modes(code, pieces)
        names = {piece.name for piece in pieces}
        if pieces and pieces[0].name == "MCALL":
            keeps = self._call(code, pieces)
            if not keeps:
                return
        elif pieces and pieces[0].name in PATTERNS:
            yield from self._pattern(pieces[0].name, arguments(code, pieces[0]))
            return
        elif pieces and pieces[0].name in DRILLING and self._expand and pieces[0].name not in _KEPT:
            yield from self._hole(pieces[0].name, arguments(code, pieces[0]))
            return
        codes = {self._code(code, p) for p in pieces if p.name == "G" and p.form is Form.WORD}
        if codes & _NO_PLACE or "SUPA" in names:
            # its axis words are no positions of the program
            if not codes & _KEEPS_PLACE:
                self._position.clear()
                self._shapes.forget()
            yield raw
            return
        if names & _FRAMES or any(c > _LAST_MODE and c not in _MODES for c in codes):
            self._position.clear()
            self._shapes.forget()
            if pieces[0].name in STATEMENTS:
                yield raw
                return
        if names & {"T", "M"} and any(p.name == "M" and self._code(code, p) == 6 for p in pieces):
            self._position.clear()
        before = dict(self._position)
        yield self._placed(raw, code, pieces, deleted)
        if names & {*AXES, *CENTRES}:
            words = Words(code, pieces, self._plane)
            self._shapes.last = element_of(words, before, self._position, self._motion)
        if self._modal is not None and names & {*AXES} and pieces[0].name not in _FRAMES:
            yield from self._hole(*self._modal)

    @staticmethod
    def _code(code: bytes, piece: Piece) -> int:
        text = code[piece.value : piece.value_end].strip()
        return int(text) if text.isdigit() else -1

    def _modes(self, code: bytes, pieces: list[Piece]) -> None:
        for piece in pieces:
            if piece.name != "G" or piece.form is not Form.WORD:
                continue
            number = self._code(code, piece)
            if number in _MOVING_G:
                self._motion = number
            elif number in (90, 91):
                self._incremental = number == 91
            elif number in (17, 18, 19):
                self._plane = number

    def _placed(self, raw: bytes, code: bytes, pieces: list[Piece], deleted: bool) -> bytes:
        """The block with IC and AC in the sense of the mode, and the position after it."""
        edits = []
        for piece in pieces:
            if piece.name not in AXES or piece.form is Form.NAME:
                continue
            value, how = counted(code, piece)
            relative = how == "IC" if how else self._incremental
            before = self._position.get(piece.name)
            if relative != self._incremental:
                if before is None:
                    raise ProgramError(
                        f"{piece.name} has no stated position before this block; program it in G90 first",
                        code="OLP524",
                    )
                changed = before + value if relative else value - before
                edits.append((piece.value, piece.value_end, shown(changed).encode()))
            end = value if not relative else None if before is None else before + value
            self._position.pop(piece.name, None)
            if end is not None and not deleted:
                self._position[piece.name] = end
        for start, stop, text in reversed(edits):
            raw = raw[:start] + text + raw[stop:]
        return raw

    # -- cycles ------------------------------------------------------------------------------------

    def _call(self, code: bytes, pieces: list[Piece]) -> bool:
        """MCALL: the cycle from here on; whether the block stays."""
        before, self._modal = self._modal, None
        cycle = pieces[1] if len(pieces) > 1 else None
        if cycle is None or cycle.name == "CYCLE80":
            return before is None
        if self._expand and cycle.name in DRILLING and cycle.name not in _KEPT:
            self._modal = (cycle.name, arguments(code, cycle))
            return False
        return True

    def _hole(self, name: str, given: list[bytes]) -> Iterator[bytes]:
        """A cycle as plain moves along Z, and the motion code that was in force."""
        if self._plane != 17 or self._incremental:
            raise ProgramError(f"{name} outside of G17 and G90 is not written out", code="OLP544")
        for kind, level in cycles.drilling(name, given).strokes:
            yield b"G%d Z%s" % (0 if kind == Kind.RAPID else 1, shown(level).encode())
            self._position["Z"] = level
            if kind != Kind.RAPID and len(given) > 5 and given[5] and name in ("CYCLE82", "CYCLE89"):
                yield b"G4 F" + given[5]
        yield b"G%d" % self._motion

    def _pattern(self, name: str, given: list[bytes]) -> Iterator[bytes]:
        """The places of a pattern, each as a block."""
        if self._plane != 17 or self._incremental:
            raise ProgramError(f"{name} outside of G17 and G90 is not written out", code="OLP544")
        for x, y in patterns.places(name, given):
            yield b"G0 X%s Y%s" % (shown(x).encode(), shown(y).encode())
            self._position |= {"X": x, "Y": y}
            if self._modal is not None:
                yield from self._hole(*self._modal)
        yield b"G%d" % self._motion
