"""Holes of patterns and of modal calls, written out: one L block with M99 for each."""

from __future__ import annotations

import math
import re
from typing import Literal

from olp.core.errors import ProgramError
from olp.program.heidenhain.cycles import AT_ONCE, BY_HEIGHT, BY_SURFACE
from olp.program.heidenhain.plain.blocks import Block, block_of, line_end, number
from olp.program.heidenhain.plain.moves import NAN, Entry, Moves, unknown
from olp.program.heidenhain.plain.patterns import Hole, defined, on_circle, on_lines
from olp.program.heidenhain.statements import CycleText, Statement

#: CYCL DEF of holes on a circle.
_CIRCLE = 220
#: CYCL DEF of holes on lines.
_LINES = 221
#: Q of the set-up clearance.
_CLEAR = 200
#: Q of the depth.
_DEPTH = 201
#: Q of the surface.
_SURFACE = 203
#: Q of the second set-up clearance.
_SECOND = 204
#: Q of where the tool is between holes: 0 at the set-up clearance, 1 at the second one.
_BETWEEN = 301
#: M function of one call.
_CALL = 99
#: M function of a call at the end of each block.
_MODAL = 89
_NUMBERED = re.compile(rb"^[ \t]*\d*[ \t]*")
_M89 = re.compile(rb"(?<![A-Z])M89(?!\d)")


class Holes(Moves):
    """Calls of cycles. `entries` is the text so far."""

    def __init__(self, scaling_axes: Literal["plane", "all"] | None) -> None:
        super().__init__(scaling_axes)
        self.entries: list[Entry] = []
        self.modal_call = False
        #: the feed in force, as it is written
        self.feed = b""
        #: the definition in force, and the one that the text has
        self._cycle: tuple[CycleText, Entry] | None = None
        self._changed = False
        self._pattern: list[Hole] | None = None

    def define(self, cycle: CycleText, statement: Statement, entry: Entry) -> None:
        """Take over a CYCL DEF that is no transformation to be written out."""
        if cycle.number in (_CIRCLE, _LINES):
            q = {n: _value(text, statement.line) for n, text in cycle.values.items()}
            holes = (on_circle if cycle.number == _CIRCLE else on_lines)(q, statement.line)
            self._drill_pattern(holes, q, entry, statement.line)
            return
        if cycle.number not in AT_ONCE and not cycle.part:
            self._cycle, self._changed = (cycle, entry), False
        self.entries.append(entry)

    def pattern_or_call(self, upper: bytes, entry: Entry, line: int) -> bool:
        """Whether a statement is a pattern, or a call that is written out."""
        if upper.startswith(b"PATTERN DEF"):
            self._pattern = defined(upper, line)
            return True
        if not upper.startswith(b"CYCL CALL"):
            return False
        self._check_scaling(line)
        rest = upper[len(b"CYCL CALL") :].strip()
        self.modal_call = False
        if rest.startswith(b"PAT"):
            if self._pattern is None:
                raise ProgramError("CYCL CALL PAT has no PATTERN DEF before it", line=line, code="OLP516")
            self._drill_each(self._pattern, entry, line, rest[len(b"PAT") :])
        elif rest.startswith(b"POS"):
            block = block_of(b"L" + rest[len(b"POS") :], line)
            assert block is not None
            self._drill_at(block, entry, line)
        else:
            self._restore(entry)
            self.entries.append(entry)
            self._retracted(line)
        return True

    def call_behind(self, block: Block, entry: Entry) -> None:
        """A call at the end of a motion block: its M99, or one in force from M89."""
        functions = block.functions
        if block.feed and not block.feed.endswith(b"MAX"):
            self.feed = block.feed
        if _MODAL in functions:
            self.modal_call = True
            entry.rest, entry.changed = _M89.sub(b"", entry.rest).strip(), True
        called = _CALL in functions
        if self.modal_call and not called and any(a in block.words for a in (b"X", b"Y", b"Z", b"PR", b"PA")):
            entry.rest, entry.changed = b" ".join((*entry.rest.split(), b"M99")), True
            self._check_scaling(block.line)
            self._restore(entry)
            self._retracted(block.line)
        elif called:
            self._check_scaling(block.line)
            self.modal_call = False
            self._restore(entry)
            self._retracted(block.line)

    def _check_scaling(self, line: int) -> None:
        if not self.frame.scaling.off:
            raise ProgramError(
                "a cycle is called in a scaled program, and controls differ in which of its depths they "
                "scale; write its holes without CYCL DEF 11 and 26",
                line=line,
                code="OLP512",
            )

    # -- patterns ------------------------------------------------------------------------------------

    def _drill_pattern(self, holes: list[Hole], q: dict[int, float], entry: Entry, line: int) -> None:
        """CYCL DEF 220 and 221: the cycle in force at each point, with their clearances and surface."""
        self._check_scaling(line)
        for key in (_CLEAR, _SURFACE, _SECOND):
            if key not in q:
                raise ProgramError(f"the pattern has no Q{key}; give it", line=line, code="OLP516")
        high = q[_SURFACE] + q[_SECOND]
        own = {k: q[k] for k in (_CLEAR, _SURFACE, _SECOND)}
        low = {**own, _SECOND: 0.0} if q.get(_BETWEEN, 1.0) == 0.0 else own
        self._go(entry, line, z=high, rest=b"R0 FMAX")
        self._put_definition(entry, line, low)
        for k, (x, y, _) in enumerate(holes):
            if k == len(holes) - 1 and low is not own:
                self._put_definition(entry, line, own)
            self._go(entry, line, x, y, rest=b"R0 FMAX M99")
        self._retracted(line, own)

    def _drill_each(self, holes: list[Hole], entry: Entry, line: int, rest: bytes) -> None:
        """CYCL CALL PAT: between its points the tool is at the higher of the present height and Q204."""
        block, z = block_of(b"L " + rest, line), self.words()[2]
        assert block is not None
        functions = [b"M%d" % m for m in block.functions]
        if block.words:
            raise ProgramError(
                "CYCL CALL PAT takes F and M alone; its places are those of PATTERN DEF",
                line=line,
                code="OLP516",
            )
        if math.isnan(z):
            raise unknown("CYCL CALL PAT", line)
        for k, (x, y, up) in enumerate(holes):
            surface, second = self._own(_SURFACE, line) + up, self._own(_SECOND, line)
            height = max(z, surface + second)
            if k or height > z:
                self._go(entry, line, z=height, rest=b"R0 FMAX")
            self._put_definition(entry, line, {_SURFACE: surface})
            first = functions if k == 0 else ()
            self._go(entry, line, x, y, rest=_words(b"R0", block.feed, *first, b"M99"))
            self._retracted(line, {_SURFACE: surface})

    def _drill_at(self, block: Block, entry: Entry, line: int) -> None:
        """CYCL CALL POS: a hole at X and Y, Z being added to the surface."""
        if any(letter not in block.words or block.words[letter][0] for letter in (b"X", b"Y", b"Z")):
            raise ProgramError("CYCL CALL POS needs X, Y and Z, as positions", line=line, code="OLP516")
        z = self.words()[2]
        if math.isnan(z):
            raise unknown("CYCL CALL POS", line)
        surface = self._own(_SURFACE, line) + block.words[b"Z"][1]
        clear = surface + self._own(_CLEAR, line)
        if z <= surface:
            self._go(entry, line, z=clear, rest=b"R0 FMAX")
        self._put_definition(entry, line, {_SURFACE: surface})
        functions = (b"M%d" % m for m in block.functions)
        rest = _words(b"R0", block.feed, *functions, b"M99")
        self._go(entry, line, block.words[b"X"][1], block.words[b"Y"][1], rest=rest)
        self._retracted(line, {_SURFACE: surface})

    def _retracted(self, line: int, values: dict[int, float] | None = None) -> None:
        """The height behind a hole; NaN where it is not known."""
        cycle = None if self._cycle is None else self._cycle[0]
        if cycle is None or cycle.number in BY_HEIGHT:
            return
        if cycle.number not in BY_SURFACE or not {_SURFACE, _CLEAR, _DEPTH} <= cycle.values.keys():
            self.at[2] = NAN
            return
        q = {k: _value(cycle.values.get(k, b"0"), line) for k in (_CLEAR, _SURFACE, _SECOND, _DEPTH)}
        q |= values or {}
        if q[_DEPTH]:
            self.at[2] = q[_SURFACE] + max(q[_CLEAR], q[_SECOND]) + self.frame.shift[2]

    def _own(self, key: int, line: int) -> float:
        if self._cycle is None or key not in self._cycle[0].values:
            raise ProgramError(
                f"a pattern is drilled, and no cycle with Q{key} is defined before it",
                line=line,
                code="OLP516",
            )
        return _value(self._cycle[0].values[key], line)

    def _go(
        self, entry: Entry, line: int, x: float = NAN, y: float = NAN, *, z: float = NAN, rest: bytes
    ) -> None:
        words = []
        if not math.isnan(x):
            self.at[:2] = self.outward(x, y)
            words = [(b"X", self.at[0] - self.frame.shift[0]), (b"Y", self.at[1] - self.frame.shift[1])]
        if not math.isnan(z):
            self.at[2] = z + self.frame.shift[2]
            words.append((b"Z", z))
        text = b" ".join((b"L", *(a + number(v) for a, v in words), rest))
        self._put(entry, text)

    def _put(self, entry: Entry, text: bytes) -> None:
        head = _NUMBERED.match(entry.lines[0])
        end = line_end(entry.lines[-1]) or b"\n"
        self.entries.append(Entry([(b"" if head is None else head[0]) + text + end], entry.source[:1]))

    def _put_definition(self, entry: Entry, line: int, values: dict[int, float]) -> None:
        """The cycle in force with other numbers."""
        if self._cycle is None:
            raise ProgramError(
                "a pattern is drilled, and no cycle is defined before it", line=line, code="OLP516"
            )
        cycle, given = self._cycle
        lines = list(given.lines)
        for key, value in values.items():
            if key not in cycle.values:
                raise ProgramError(
                    f"CYCL DEF {cycle.number} has no Q{key}, which its pattern sets; give it",
                    line=line,
                    code="OLP516",
                )
            word = re.compile(rb"(Q%d[ \t]*=[ \t]*)[-+]?[\w.]+" % key, re.I)
            lines = [word.sub(lambda m, v=value: m[1] + number(v), text) for text in lines]  # type: ignore[misc]
        self.entries.append(Entry(lines, [entry.source[0]] * len(lines)))
        self._changed = True

    def _restore(self, entry: Entry) -> None:
        """Put the program's own definition before a call, where a pattern changed it."""
        if self._changed and self._cycle is not None:
            lines = list(self._cycle[1].lines)
            where = len(self.entries) - (1 if self.entries and self.entries[-1] is entry else 0)
            self.entries.insert(where, Entry(lines, [entry.source[0]] * len(lines)))
            self._changed = False


def _value(text: bytes, line: int) -> float:
    try:
        return float(text)
    except ValueError:
        raise ProgramError(
            f"{text.decode('latin-1')} has no number here; assign it in the program", line=line, code="OLP541"
        ) from None


def _words(*words: bytes) -> bytes:
    """Those that are given: without a feed the last one goes on."""
    return b" ".join(word for word in words if word)
