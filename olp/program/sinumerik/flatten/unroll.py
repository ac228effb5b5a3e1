"""Unrolls a parametric Sinumerik program into plain blocks: no variables, no flow, no subprograms.

The program is run here, and each block that is executed is written with numbers for its expressions. Lines
without a variable are copied byte for byte; a block number is kept on the first visit of its line only. This
is not lossless: assignments, flow, labels and text after the end of the program are left out.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from olp.core.budget import RUN_BYTES, Budget
from olp.core.progress import Progress, silent
from olp.core.units import AXES
from olp.program.origin import Origin, Unrolled
from olp.program.sinumerik.blocks import NUMBER, Form, Piece
from olp.program.sinumerik.flatten.corners import SIGN, with_corners
from olp.program.sinumerik.flatten.expressions import evaluate, number
from olp.program.sinumerik.flatten.places import Places
from olp.program.sinumerik.flatten.run import Stop, Walk
from olp.program.sinumerik.flatten.saved import Saved
from olp.program.sinumerik.flatten.scope import Scope
from olp.program.sinumerik.flatten.text import shown
from olp.program.sinumerik.flatten.unit import Line, Unit, programs
from olp.program.sinumerik.table import DRILLING, PATTERNS

#: Calls whose arguments are numbers; those of others are names and texts too, and stay.
_COMPUTED = DRILLING | PATTERNS
_LABEL = re.compile(rb"\A([ \t]*/?\d?[ \t]*(?:N\d+[ \t]*)?)(?:[A-Z_][A-Z0-9_]+[ \t]*:[ \t]*)+", re.IGNORECASE)
_NUMBER = re.compile(rb"\A([ \t]*/?\d?[ \t]*)(?:N|:)[ \t]*\d+[ \t]*", re.IGNORECASE)
#: What names a program in its file, and where it is.
_HEADERS = (b"%", b";$PATH")
_FUNCTIONS = ("AC", "IC", "DC", "ACP", "ACN")


def flatten(
    data: bytes,
    dialect: Any,
    *,
    subprograms: Callable[[str], tuple[str, bytes] | None] = lambda name: None,
    block_delete: bool | None = False,
    expand_cycles: bool = False,
    peck_clearance: float | None = None,
    parameters: Mapping[str, float] | None = None,
    limit: int = RUN_BYTES,
    tell: Progress = silent,
) -> Unrolled:
    """Plain blocks of a program, with the origin of each.

    `subprograms` gives file and text of a program beside it, by its name. `block_delete`: blocks with `/` are
    left out, or executed; with None both positions of the switch have to give the same program.
    `parameters` are values that the control has. Raises ProgramError with the line in the source, or with
    that in a subprogram and its file.
    """
    main, others = programs(data)
    writer = _Writer(expand_cycles=expand_cycles)
    known: dict[str, Unit | None] = {}

    def find(name: str) -> Unit | None:
        if name not in known:
            if name in others:
                known[name] = Unit.of(others[name][0], None, others[name][1])
            else:
                given = subprograms(name) or subprograms(name.lower())
                known[name] = None if given is None else Unit.of(given[1], given[0])
        return known[name]

    budget = Budget.of_run(len(data), limit, tell=tell)
    unit = Unit.of(main, None)
    with contextlib.suppress(Stop):
        Walk(writer.visit, writer.kept, find, budget, block_delete=block_delete).run(
            unit, Scope.of(parameters)
        )
    writer.finish()
    return Unrolled.of(b"".join(writer.blocks), writer.origin(data, list(known.values())))


class _Writer:
    """Writes the lines that a walk visits."""

    def __init__(self, *, expand_cycles: bool) -> None:
        self.blocks: list[bytes] = []
        self._sources: list[tuple[str | None, int]] = []
        self._seen: set[tuple[str | None, int]] = set()
        self.corners = False
        self._places = Places(expand_cycles=expand_cycles)
        self._saved = Saved()

    def origin(self, data: bytes, units: list[Unit | None]) -> Origin:
        """The source line of every block."""
        files = [unit for unit in units if unit is not None and unit.file is not None]
        texts = [data.splitlines(keepends=True), *(unit.texts for unit in files)]
        first = np.cumsum([0, *(len(text) for text in texts[:-1])]).astype(np.int64)
        before = {None: 0, **{unit.file: int(n) for unit, n in zip(files, first[1:], strict=True)}}
        lines = tuple(line for text in texts for line in text)
        line = np.array([before[file] + line for file, line in self._sources], np.int64)
        return Origin(tuple(str(unit.file) for unit in files), first[1:], lines, line)

    def _put(self, unit: Unit, line: Line, raw: bytes) -> None:
        key = (unit.file, line.number)
        if key in self._seen:
            raw = _NUMBER.sub(rb"\1", raw)
        self._seen.add(key)
        self.blocks.append(raw + (line.eol or b"\n"))
        self.corners |= SIGN.search(raw) is not None
        self._sources.append(key)

    def finish(self) -> None:
        """Write the corners that the control makes."""
        if not self.corners:
            return
        ends = [len(raw) - len(raw.rstrip(b"\r\n")) for raw in self.blocks]
        eol = next((raw[-n:] for raw, n in zip(self.blocks, ends, strict=True) if n), b"\n")
        texts = [raw[: len(raw) - n] for raw, n in zip(self.blocks, ends, strict=True)]
        done = with_corners(list(zip(texts, self._sources, strict=True)))
        self.blocks = [raw + eol for raw, _ in done]
        self._sources = [source for _, source in done]

    def visit(self, unit: Unit, line: Line, scope: Scope) -> bool:
        """Write one line; True where the program ends."""
        block = line.block
        if unit.file is not None and line.raw.lstrip().startswith(_HEADERS):
            # of a file that is called; in the text it would begin another program
            return False
        if block is None or not block.pieces:
            if block is None or not block.label:
                self._put(unit, line, line.raw)
            return False
        self._saved.follow(line)
        raw, left = self._with_numbers(line, scope)
        if not left:
            return False
        for text in self._places.follow(line.deleted, raw):
            self._put(unit, line, text)
        return any(
            p.name == "M"
            and p.form is Form.WORD
            and line.code[p.value : p.value_end].strip() in ("2", "02", "30")
            for p in block.pieces
        )

    @contextmanager
    def kept(self, unit: Unit, line: Line) -> Iterator[None]:
        """Around a subprogram with SAVE that a line calls: the codes that it puts back are a block."""
        with self._saved.kept() as again:
            yield
        if again:
            for text in self._places.follow(line.deleted, b" ".join(again)):
                self._put(unit, line, text)

    def _with_numbers(self, line: Line, scope: Scope) -> tuple[bytes, bool]:
        """A line with numbers for its expressions, without its assignments and its label, and whether any of
        it is left."""
        assert line.block is not None
        edits: list[tuple[int, int, bytes]] = []
        left = False
        alone = all(piece.form is Form.EQUAL for piece in line.block.pieces)
        for piece in line.block.pieces:
            if piece.form is Form.EQUAL and scope.is_variable(piece.name, alone=alone):
                scope[scope.name_of(piece.name)] = evaluate(_value(line, piece), scope)
                edits.append((piece.start, piece.end, b""))
                continue
            left = True
            edits += _numbers(line, piece, scope)
        raw = line.raw
        for start, end, text in reversed(edits):
            raw = raw[:start] + text + raw[end:]
        if line.block.label:
            raw = _LABEL.sub(rb"\1", raw)
        return (raw.rstrip(b" \t") if edits else raw), left


def _value(line: Line, piece: Piece) -> str:
    return line.code[piece.value : piece.value_end]


def _numbers(line: Line, piece: Piece, scope: Scope) -> list[tuple[int, int, bytes]]:
    """Edits that put numbers for the expressions of a piece."""
    text = _value(line, piece)
    if piece.form is Form.EQUAL and not _literal(text):
        name, _, inside = text.partition("(")
        if name.strip().upper() in _FUNCTIONS and inside.endswith(")"):
            if _literal(inside[:-1]):
                return []
            value = f"{name.strip()}({shown(number(inside[:-1], scope))})"
        elif name.strip().upper() == "CTRANS" and inside.endswith(")"):
            value = f"CTRANS({','.join(_argument(part, scope) for part in _arguments(inside[:-1]))})"
        elif text.strip().startswith('"'):
            return []
        else:
            value = shown(number(text, scope))
        return [(piece.value, piece.value_end, value.encode())]
    if piece.form is Form.NAME and piece.called and piece.name in _COMPUTED:
        parts = [_argument(part, scope) for part in _arguments(text)]
        if parts != _arguments(text):
            return [(piece.value, piece.value_end, ",".join(parts).encode("latin-1"))]
    return []


def _arguments(text: str) -> list[str]:
    return [part.strip() for part in text.split(",")] if "(" not in text and '"' not in text else [text]


def _argument(text: str, scope: Scope) -> str:
    if not text or _literal(text) or '"' in text or text.upper() in AXES:
        return text
    return shown(number(text, scope))


def _literal(text: str) -> bool:
    return NUMBER.fullmatch(text.strip().encode("latin-1", "replace")) is not None
