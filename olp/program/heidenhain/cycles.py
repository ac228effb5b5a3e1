"""Drilling cycles of Heidenhain controls: the strokes of one hole where the tool is."""

from __future__ import annotations

import re

from olp.core.errors import ProgramError
from olp.core.spool import Text
from olp.core.values import dataclass
from olp.program.heidenhain.modes import NAN, Modes
from olp.program.heidenhain.statements import CycleText, Statement

#: cycles with a surface (Q203), a depth (Q201), and two clearances (Q200, Q204)
BY_SURFACE = frozenset({200, 201, 202, 203, 205, 206, 207, 208, 209, 240, 241})
#: old cycles, which begin at their clearance above the surface
BY_HEIGHT = frozenset({1, 2, 17})
#: cycles that act where they are defined, and move nothing
AT_ONCE = frozenset({7, 8, 9, 10, 11, 13, 19, 26, 32, 239, 247, 332, 392})
#: cycles that make holes where they are defined, with the cycle before them
PATTERNS = frozenset({220, 221, 224})
_TAPS = frozenset({2, 17, 206, 207, 209})
_CENTRED = 240
_SURFACE = re.compile(rb"Q203[ \t]*=[ \t]*([-+]?[\w.]+)", re.I)
_NUMBER = re.compile(rb"([-+]?(?:\d+\.?\d*|\.\d+))\s*\Z")


@dataclass(frozen=True, slots=True)
class Stroke:
    """Heights of one hole along the words, mm: `approach` and `retract` at rapid, `bottom` at `feed_mm_s`."""

    approach: float
    bottom: float
    retract: float
    feed_mm_s: float


@dataclass(slots=True)
class Cycle:
    """The cycle that a call makes: its `number`, the `line` of its definition, parameters of the Q form by
    number and the lines of the old form by part."""

    number: int
    line: int
    statement: Statement
    values: dict[int, bytes]
    parts: dict[int, bytes]

    @staticmethod
    def of(text: CycleText, statement: Statement) -> Cycle:
        return Cycle(text.number, statement.line, statement, dict(text.values), {})

    def stroke(self, modes: Modes, z_mm: float, line: int, offset_mm: float) -> Stroke | None:
        """The stroke of a hole along the words, where Z counts from `offset_mm` and the tool is at `z_mm`;
        None where the cycle makes none. Raises ProgramError for a cycle that is not read."""
        if self.number in BY_SURFACE:
            return self._by_surface(modes, offset_mm)
        if self.number in BY_HEIGHT:
            return self._by_height(modes, z_mm, line)
        raise ProgramError(
            f"CYCL DEF {self.number} of line {self.line} is called, and its path is not read; have the CAM "
            "system write plain moves for it",
            line=line,
            code="OLP512",
        )

    def _value(self, modes: Modes, number: int, default: float | None = None) -> float:
        text = self.values.get(number)
        if text is None and default is None:
            raise ProgramError(
                f"CYCL DEF {self.number} has no Q{number}; give it", line=self.line, code="OLP516"
            )
        return default if text is None and default is not None else modes.value(text or b"", self.statement)

    def _by_surface(self, modes: Modes, offset_mm: float) -> Stroke | None:
        if self.number == _CENTRED and self._value(modes, 343, 0.0) == 1.0:
            raise ProgramError(
                "CYCL DEF 240 takes its depth from a diameter, which is not read; state the depth (Q343=0)",
                line=self.line,
                code="OLP512",
            )
        surface, depth = self._value(modes, 203), self._value(modes, 201)
        clear, second = self._value(modes, 200), self._value(modes, 204, 0.0)
        if depth > 0:
            raise ProgramError(
                "the depth of the cycle (Q201) is positive; expected a negative number, below the surface",
                line=self.line,
                code="OLP516",
            )
        if depth == 0:
            return None
        feed = NAN
        if self.number not in _TAPS and 206 in self.values and self._is_number(modes, 206):
            feed = self._value(modes, 206) * modes.feed_scale
        heights = (surface + clear, surface + depth, surface + max(clear, second))
        approach, bottom, retract = (h * modes.unit_mm + offset_mm for h in heights)
        return Stroke(approach, bottom, retract, feed)

    def _is_number(self, modes: Modes, number: int) -> bool:
        text = self.values[number].upper().lstrip(b"+-")
        return not text.startswith(b"Q") or text.decode("latin-1") in modes.parameters

    def definition(self, modes: Modes, data: Text) -> tuple[int, int, int, int, float]:
        """The bytes that define the cycle, those of its surface, and that in numbers of the program. Bytes
        are -1 where none states it, the surface NaN where the cycle has none."""
        if self.number not in BY_SURFACE:
            return -1, -1, -1, -1, NAN
        begin, end = self.statement.span
        stated = _SURFACE.search(data, begin, end) if begin >= 0 else None
        surface = self._value(modes, 203)
        if stated is None:
            return -1, -1, -1, -1, surface
        return begin, end, *stated.span(1), surface

    def _by_height(self, modes: Modes, z_mm: float, line: int) -> Stroke | None:
        if z_mm != z_mm:
            raise ProgramError(
                f"CYCL DEF {self.number} counts from the present height, which is not known here; command Z "
                "first, or give start_mm in the job file; in a tilted plane use a cycle with Q203",
                line=line,
                code="OLP524",
            )
        clear, depth = (abs(self._part(k)) for k in (1, 2))
        if not depth:
            return None
        feed = self._part(5, NAN) if self.number not in _TAPS else NAN
        return Stroke(z_mm, z_mm - (clear + depth) * modes.unit_mm, z_mm, feed * modes.feed_scale)

    def _part(self, part: int, default: float | None = None) -> float:
        match = _NUMBER.search(self.parts.get(part, b""))
        if match is None and default is not None:
            return default
        if match is None:
            raise ProgramError(
                f"CYCL DEF {self.number}.{part} has no number; give it", line=self.line, code="OLP516"
            )
        return float(match[1])
