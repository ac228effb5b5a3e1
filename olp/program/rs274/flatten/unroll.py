"""Unrolls a parametric RS-274 program into plain blocks: no variables, no flow, no subprograms.

The program is run here, and each block that is executed is written with numbers for its expressions. The
result is a plain program for the same control. It is NOT lossless: assignments, flow and the names of
subprograms are gone, blocks of loops are repeated, and text after the end of the program is left out. Lines
without a variable are copied byte for byte; a block number is kept on the first visit of its line only.

A line that needs values which only the control knows is refused: probe results, tool tables, stored offsets,
a position that the program has not commanded. Parameters that were never set are 0 in RS-274 (#31 to #5060)
and refused on a Fanuc (#100 and up keep values of earlier runs).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager

import numpy as np

from olp.core.budget import RUN_BYTES, Budget
from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.core.progress import Progress, silent
from olp.program.origin import Origin, Unrolled, Within
from olp.program.rs274.block_text import CLOSED_TOGETHER
from olp.program.rs274.codes import ABSOLUTE, INCREMENTAL, SHIFTED_BORES, SPLINES
from olp.program.rs274.cycles import Stroke, stroke_budget
from olp.program.rs274.flatten import radius_angle
from olp.program.rs274.flatten.centres import centre
from olp.program.rs274.flatten.corners import with_corners
from olp.program.rs274.flatten.expressions import filled, whole
from olp.program.rs274.flatten.lines import Line, Word, compile_line
from olp.program.rs274.flatten.patterns import holes, is_pattern
from olp.program.rs274.flatten.polar import as_xy
from olp.program.rs274.flatten.run import Walk
from olp.program.rs274.flatten.saved_modes import SavedModes
from olp.program.rs274.flatten.splines import SPLINE_WORDS, Splines
from olp.program.rs274.flatten.state import CYCLE_WORDS, ProgramState, Value, tracked
from olp.program.rs274.flatten.unit import Frame, Unit
from olp.program.rs274.flatten.values import Variables
from olp.program.rs274.flatten.written import number_text, stroke_blocks
from olp.program.rs274.profiles.base import Profile

_INNER = bytes.maketrans(b"()", b"[]")
_COMMENT = re.compile(CLOSED_TOGETHER + rb"|\([^)]*\)")
_ENDS = frozenset({2, 30})
#: Cycles for which the control turns the spindle in step, or stops it at an angle.
_BY_CONTROL = SHIFTED_BORES | {740, 840}


def no_subprograms(name: str) -> tuple[str, bytes] | None:
    """The default of `flatten`: there is no other file."""
    return None


def flatten(
    data: bytes,
    profile: Profile,
    *,
    subprograms: Callable[[str], tuple[str, bytes] | None] = no_subprograms,
    block_delete: bool | None = False,
    expand_cycles: bool = False,
    file: str | None = None,
    peck_clearance: float | None = None,
    parameters: Mapping[str, float] | None = None,
    setup: Setup | None = None,
    limit: int = RUN_BYTES,
    tell: Progress = silent,
) -> Unrolled:
    """Plain blocks of a program, with the origin of each; see the module for what is kept.

    `subprograms` gives the file and the text of a program that the file does not have, by its number or
    lower-case name. `block_delete`: blocks with `/` are left out (switch on), or executed (off). With
    None both positions of the switch have to give the same program. `expand_cycles` writes canned cycles as
    G0, G1, G4 and spindle blocks. `peck_clearance` (program units) is the clearance of G73 and G83, needed
    where a parameter of the control sets it. `parameters` are values that parameters such as "#100" have in
    the control, `setup` has the work offsets. `limit` is the work that a short program may cause, in bytes of
    visited blocks; a long one may cause `RUN_PER_BYTE` for each of its bytes, and `tell` is told the share
    of it. Raises ProgramError with the line in the source, or with the line in the subprogram and its
    file.
    """
    strokes = stroke_budget(len(data))
    writer = _Flattener(
        profile, strokes, expand_cycles=expand_cycles, peck_clearance=peck_clearance, parameters=parameters,
        setup=setup, switch_open=block_delete is None,
    )  # fmt: skip
    main = Unit(data, profile, file)
    budget = Budget.of_run(len(data), limit, tell=tell)
    Walk(
        main, writer.variables, subprograms, writer.block, writer.leave, budget, block_delete=block_delete
    ).run()
    if not writer.moves:
        main.refuse_library()
    writer.write_polar()
    writer.write_corners()
    return Unrolled.of(writer.text(main), writer.origin(main), writer.within())


class _Flattener:
    """Writes the blocks that a walk visits and follows the state of the control."""

    def __init__(
        self, profile: Profile, strokes: Budget, *, expand_cycles: bool, peck_clearance: float | None,
        parameters: Mapping[str, float] | None = None, setup: Setup | None = None, switch_open: bool = False,
    ) -> None:  # fmt: skip
        self.language, self.cycles = profile.language, profile.cycles
        self.state = ProgramState.of(profile, setup)
        self.variables = Variables(self.state, parameters, setup)
        self.splines = Splines(self.state)
        self.saved = SavedModes(self.state)
        self.strokes = strokes
        #: whether blocks under block delete may run or not
        self.switch_open = switch_open
        #: whether a block has words of axes, and whether one asks for a corner
        self.moves = self.corners = False
        self.expand_cycles, self.peck_clearance = expand_cycles, peck_clearance
        self._seen: set[tuple[int, int]] = set()
        self._blocks: list[tuple[bytes, bytes]] = []
        # the unit and the line that each block was made from, and those of the present line
        self._sources: list[tuple[int, int]] = []
        self._present = (0, 0)
        # the line of the program itself that each block runs in, with the number of that run
        self._within: list[tuple[int, int]] = []
        self._running = (0, 0)
        self._units: dict[int, Unit] = {}

    def text(self, main: Unit) -> bytes:
        """All blocks; lines without a line end take that of the program."""
        eol = next((line_end for _, line_end in self._blocks if line_end), b"\n")
        whole_text = b"".join(raw + (line_end or eol) for raw, line_end in self._blocks)
        last = self._blocks[-1] if self._blocks else (b"", b"")
        return (
            whole_text[: -len(eol)] if self._blocks and not last[1] and not main.ends_with_eol else whole_text
        )

    def write_polar(self) -> None:
        """Write polar positions as X and Y. Raises ProgramError with the line in the source."""
        with self._errors():
            self._blocks = as_xy(self._blocks, self.state.profile, self._length)

    def write_corners(self) -> None:
        """Write corners as moves. Raises ProgramError with the line in the source."""
        if not self.corners:
            return
        with self._errors():
            placed = with_corners(self._blocks, self.state.profile, self._length, switch=self.switch_open)
        self._blocks = [(raw, eol) for raw, eol, _ in placed]
        self._sources = [self._sources[k] for _, _, k in placed]
        self._within = [self._within[k] for _, _, k in placed]

    def _length(self, value: float) -> str:
        return number_text(value, "x", self.language)

    @contextmanager
    def _errors(self) -> Iterator[None]:
        """Errors with a line of the blocks get that of the source."""
        try:
            yield
        except ProgramError as error:
            key, error.line = self._sources[(error.line or 1) - 1]
            error.file = self._units[key].file
            raise

    def origin(self, main: Unit) -> Origin:
        """The source line of every block."""
        units = [unit for unit in self._units.values() if unit is not main]
        counts = np.array([len(unit.lines) for unit in (main, *units)], np.int64)
        first = np.cumsum(counts) - counts
        before = {unit.key: int(first[k]) for k, unit in enumerate((main, *units))}
        lines = (line for unit in (main, *units) for line in unit.lines)
        return Origin(
            tuple(unit.file or "" for unit in units), first[1:], tuple(lines),
            np.array([before[key] + number for key, number in self._sources], np.int64),
        )  # fmt: skip

    def within(self) -> Within:
        """The line of the program itself that every block runs in."""
        rows = np.array(self._within, np.int64).reshape(-1, 2)
        return Within(rows[:, 0], rows[:, 1])

    def _put(self, raw: bytes, eol: bytes) -> None:
        """Write a block of the present line."""
        self._blocks.append((raw, eol))
        self._sources.append(self._present)
        self._within.append(self._running)

    def block(self, line: Line, frame: Frame, without: frozenset[int]) -> bool:
        """Write one executed line, its words at indices `without` left out; True where the program ends."""
        self._present = (frame.unit.key, line.number)
        self._running = (frame.within or line.number, frame.run)
        self._units[frame.unit.key] = frame.unit
        seen = self._present in self._seen
        self._seen.add(self._present)
        if line.prints or line.opaque or self.variables.counts(line):
            left = line.prints and not self.variables.of_control(line.raw)
            self._put(_left_out(line.raw) if left else line.raw, line.eol)
            if line.opaque:
                self.state.forget()
            return False
        values = [(word.letter, self._value(word)) for word in line.words]
        settings = [(a.target(self.variables), a.value(self.variables)) for a in line.assignments]
        if self.saved.takes(values):
            self._write(line, values, set(range(len(line.words))), exact=False)
            switched = line.deleted and self.switch_open
            self._insert(self.saved.carry_out(values, frame, switched=switched), line)
            return False
        cut = set(without)
        for i, word in enumerate(line.words):
            if self._vacant(word, values[i][1]) or (word.letter == "n" and seen):
                cut.add(i)
        start = list(self.state.position)
        for _ in range(self._polar_repeats(line, values, cut)):
            active = self._carry_out(line, values, frozenset(cut), exact=frame.unit.radius_arcs)
            self.state.leave_start(active)
        if line.deleted and self.switch_open:
            # where the switch leaves the block out, the axes are still where they were
            self.state.forget(axis for axis in range(3) if self.state.position[axis] != start[axis])
        for target, value in settings:
            texts = self.variables.offsets.blocks(target, value) if isinstance(target, int) else []
            self._insert(texts, line)
            if not texts:
                self.variables.assign(target, value)
        return any(letter == "m" and value in _ENDS for letter, value in active)

    def leave(self, line: Line, frame: Frame) -> None:
        """Carry out what the end of a subprogram restores, at the line that ends it."""
        self._present = (frame.unit.key, line.number)
        self._insert(self.saved.leaving(frame), line)

    def _carry_out(
        self, line: Line, values: list[Value], without: frozenset[int], *, exact: bool
    ) -> list[Value]:
        """Write a block and follow it; its words with their values."""
        cut = set(without)
        kept = [i for i in range(len(line.words)) if i not in cut]
        active: list[Value] = [
            (values[i][0], tracked(line.words[i], values[i][1], self.language)) for i in kept
        ]
        self.variables.follow(active, switched=line.deleted)
        self.saved.follow(active, switched=line.deleted)
        before = (self.state.absolute, self.state.path, tuple(self.state.position))
        if is_pattern(active, self.state):
            self._holes(line, values, kept)
            return active
        texts = self._centre(line, kept, active)
        if self.language.splines:
            if radius_angle.is_polar(active):
                texts, active = self._as_xy(kept, active, cut)
            if self.splines.takes(active):
                self._spline(line, values, active, cut)
                return active
        self.moves |= any(letter in "xyz" for letter, _ in active)
        self.corners |= bool(self.language.corners) and any(letter[0] == "," for letter, _ in active)
        strokes: tuple[Stroke, ...] | None = None
        if self.state.is_cycle(active):
            strokes = self._cycle(active)
        else:
            self.state.apply(active)
        if strokes is not None and self.expand_cycles:
            cut |= {i for i, w in enumerate(line.words) if self._of_cycle(w, values[i][1])}
            self._write(line, values, cut, exact=False)
            self._write_strokes(strokes, line, before)
        else:
            self._write(line, values, cut, texts, exact=exact)
        return active

    def _insert(self, texts: Sequence[str], line: Line) -> None:
        """Carry out blocks that stand for the present line, or for a part of it."""
        mark = "/" if line.deleted else ""
        for text in texts:
            block = compile_line((mark + text).encode() + line.eol, line.number, self.language)
            words: list[Value] = [(word.letter, word.number) for word in block.words]
            self._carry_out(block, words, frozenset(), exact=False)
            self.state.leave_start(words)

    def _holes(self, line: Line, values: list[Value], kept: list[int]) -> None:
        """Write a pattern of holes, one by one."""
        words: list[Value] = [
            (letter, value if self._pointed(line.words[i]) else None)
            for i, (letter, value) in enumerate(values) if i in kept
        ]  # fmt: skip
        places = holes(words, self.state, self.strokes)
        cut = {i for i, word in enumerate(line.words) if i not in kept or word.letter != "n"}
        self._write(line, values, cut, exact=False)
        pairs = ([number_text(v, "x", self.language) for v in place] for place in places)
        self._insert([f"X{x} Y{y}" for x, y in pairs], line)
        self.state.forget((0, 1))

    def _centre(self, line: Line, kept: list[int], active: list[Value]) -> dict[int, str]:
        """The text in the place of a code that takes the present position for its centre: the code with that
        position."""
        stated = centre(active, self.state)
        if stated is None:
            return {}
        code, place = stated
        at = next(i for i, word in zip(kept, active, strict=True) if self.state.codes([word]) == {code})
        words = [letter.upper() + number_text(v, "x", self.language) for letter, v in place.items()]
        return {at: " ".join([f"G{code // 10}", *words])}

    def _pointed(self, word: Word) -> bool:
        """Whether what the number of a word counts is certain."""
        return word.value is not None or word.pointed or word.number == 0 or word.letter in "gln"

    def _polar_repeats(self, line: Line, values: list[Value], cut: set[int]) -> int:
        """How often a block is written by itself: each hole of a polar cycle in G91 has another position."""
        active = [value for i, value in enumerate(values) if i not in cut]
        if not (self.language.splines and radius_angle.is_polar(active)):
            return 1
        codes = self.state.codes(active)
        absolute = ABSOLUTE in codes or (self.state.absolute and INCREMENTAL not in codes)
        count = next((i for i, (letter, _) in enumerate(values) if letter == "l"), None)
        if absolute or count is None or not self.state.is_cycle([*active, ("x", 0.0)]):
            return 1
        cut.add(count)
        repeats = whole(filled(values[count][1]), "the repeat count L")
        if repeats < 1:
            raise ProgramError(f"a cycle is repeated {repeats} times; expected one or more", code="OLP516")
        return repeats

    def _as_xy(
        self, kept: list[int], active: list[Value], cut: set[int]
    ) -> tuple[dict[int, str], list[Value]]:
        """A block with `@` or `^` as one with X and Y: the text in the place of its first polar word, and its
        words."""
        self.state.take(self.state.codes(active))
        numbers = [number_text(v, "x", self.language) for v in radius_angle.target(active, self.state)]
        polar = [i for i, (letter, _) in zip(kept, active, strict=True) if letter in "@^"]
        cut |= set(polar[1:])
        plain = [(letter, value) for letter, value in active if letter not in "@^"]
        return {polar[0]: f"X{numbers[0]} Y{numbers[1]}"}, [
            *plain, *zip("xy", map(float, numbers), strict=True)
        ]  # fmt: skip

    def _spline(self, line: Line, values: list[Value], active: list[Value], cut: set[int]) -> None:
        """Write the block of a spline as chords, behind its other words."""
        self.state.apply([word for word in active if word[0] not in SPLINE_WORDS])
        ends = self.splines.chords(active)
        self.moves |= bool(ends)
        cut |= {
            i for i, word in enumerate(line.words)
            if word.letter in SPLINE_WORDS | {"@", "^"}
            or (word.letter == "g" and round(10 * filled(values[i][1])) in SPLINES)
        }  # fmt: skip
        self._write(line, values, cut, exact=False)
        self.strokes.spend(len(ends))
        blocks = ["G1 " + " ".join(
            letter + number_text(v, "x", self.language) for letter, v in zip("XY", end, strict=True)
        ) for end in ends]  # fmt: skip
        if ends:
            self.state.position[:2] = ends[-1]
        if ends and not self.state.absolute:
            blocks = ["G90", *blocks, "G91"]
        mark = b"/" if line.deleted else b""
        for text in blocks:
            self._put(mark + text.encode(), line.eol)

    def _value(self, word: Word) -> float | None:
        return word.number if word.value is None else word.value(self.variables)

    def _vacant(self, word: Word, value: float | None) -> bool:
        return word.value is not None and value is None

    def _cycle(self, active: list[Value]) -> tuple[Stroke, ...] | None:
        if not self.expand_cycles:
            try:
                count = len(self.state.cycle(active, self.peck_clearance or 1.0))
            except ProgramError:
                # Only the position is lost; a block that needs it is an error.
                self.state.forget()
            else:
                self.strokes.spend(count)
            return None
        if self.cycles.taps_by_control and self.state.codes(active) & _BY_CONTROL:
            raise ProgramError(
                "G74 and G84 are synchronised by the control, and it stops the spindle of G76 and G87 at an "
                "angle: plain moves cannot replace them",
                code="OLP544",
            )
        strokes = self.state.cycle(active, self.peck_clearance)
        self.strokes.spend(len(strokes))
        return strokes

    def _of_cycle(self, word: Word, value: float | None) -> bool:
        if word.letter == "g":
            return self.state.is_cycle([("g", value)]) and round(filled(value) * 10) == self.state.motion
        return word.letter in CYCLE_WORDS or word.letter in "@^"

    def _write(
        self,
        line: Line,
        values: list[Value],
        cut: set[int],
        texts: Mapping[int, str] | None = None,
        *,
        exact: bool,
    ) -> None:
        """Write a line without the words in `cut`, `texts` in the place of others."""
        texts = texts or {}
        if line.plain and not cut and not texts and line.flow is None:
            self._put(line.raw, line.eol)
            return
        # A flow statement has no words: only comments and assignments are in the line.
        if line.flow is not None and line.flow.keyword != "program":
            if line.comments:
                self._put(b" ".join(line.comments), line.eol)
            return
        pieces, done = [], 0
        splices = [(a.start, a.end, b"") for a in line.assignments]
        for i, (word, (letter, value)) in enumerate(zip(line.words, values, strict=True)):
            if i in cut:
                splices.append((word.start, word.end, b""))
            elif i in texts:
                splices.append((word.start, word.end, texts[i].encode()))
            elif word.value is not None:
                text = number_text(filled(value), letter, self.language, exact)
                splices.append((word.value_start, word.end, text.encode()))
        for start, end, text_bytes in sorted(splices):
            inner = _COMMENT.findall(line.raw[start:end])
            pieces += [line.raw[done:start], text_bytes, *inner]
            if not text_bytes:
                end += len(line.raw[end:]) - len(line.raw[end:].lstrip(b" \t"))
            done = end
        pieces.append(line.raw[done:])
        rest = [word for i, word in enumerate(line.words) if i not in cut]
        if line.comments or any(word.letter != "n" for word in rest) or line.flow is not None:
            raw = b"".join(pieces)
            self._put(raw.rstrip() if line.raw.rstrip() == line.raw else raw, line.eol)

    def _write_strokes(
        self, strokes: tuple[Stroke, ...], line: Line, before: tuple[bool, str, tuple[float, ...]]
    ) -> None:
        """Blocks of a cycle."""
        lines = stroke_blocks(strokes, list(before[2]), self.state.spindle, self.language)
        if not lines:
            return
        if not self.state.absolute:
            lines = ["G90", *lines, "G91"]
        if self.cycles.exact_corners and self.state.path != "G61":
            lines = ["G61", *lines, self.state.path]
        mark = b"/" if line.deleted else b""
        for text in lines:
            self._put(mark + text.encode(), line.eol)


def _left_out(raw: bytes) -> bytes:
    """The comment in the place of a line that prints what plain blocks do not have."""
    return b"(" + raw.strip().translate(_INNER) + b" is left out)"
