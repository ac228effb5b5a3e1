"""Reads a list of positions as a program: a row a place, in order, with whatever else the rows hold.

A list says where the machine goes, hardly ever how: so rows are way-points, and what lies between them is
judged only where the layout says that they are joined by straight lines. Only X, Y and Z are ever edited.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from olp.exceptions import InputError, ProgramError
from olp.machine import Setup
from olp.program.delimited import AXES, MM, Cells, Layout, Span, first_lines, stated_frame, told
from olp.program.dialect import Dialect, Options, Row, Support
from olp.program.numbertext import MOST_DECIMALS, Number, number
from olp.program.places import frame_of
from olp.program.program import ArcSlots, Lettering, Program, Words
from olp.toolpath import Arcs, Flag, Frame, Kind, Toolpath

Index = npt.NDArray[np.int64]

_TURNING = ("A", "B", "C", "I", "J", "K")
_SUPPORT = {
    "X": (Support.CORRECTED, ""),
    "Y": (Support.CORRECTED, ""),
    "Z": (Support.CORRECTED, ""),
    "tool": (Support.READ, "the tool of the row: its lever"),
    "A": (Support.CARRIED, "three linear axes cannot turn the tool"),
    "B": (Support.CARRIED, "three linear axes cannot turn the tool"),
    "C": (Support.CARRIED, "three linear axes cannot turn the tool"),
    "I": (Support.CARRIED, "three linear axes cannot turn the tool"),
    "J": (Support.CARRIED, "three linear axes cannot turn the tool"),
    "K": (Support.CARRIED, "three linear axes cannot turn the tool"),
    "speed": (Support.CARRIED, ""),
    "blend": (Support.CARRIED, ""),
    "t": (Support.CARRIED, "with a column of time no row is inserted"),
    "name": (Support.CARRIED, ""),
    "line": (Support.CARRIED, ""),
    "any other column": (Support.CARRIED, ""),
    "comment": (Support.CARRIED, ""),
    "a row that is no row of numbers": (Support.REFUSED, "it may be a place"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class PointList(Dialect):
    """A list of positions; `layout` None: told from its first rows."""

    family: str = "list"
    layout: Layout | None = None

    def rows(self) -> Sequence[Row]:
        return [Row(f"column {k}" if len(k) < 6 else k, what, why) for k, (what, why) in _SUPPORT.items()]


POINT_LIST = PointList(
    name="list", title="list of positions (CSV, TXT)", path_mode="not stated", comment=(b"# ", b"")
)


def with_layout(layout: Layout) -> PointList:
    """The dialect of lists that are laid out so."""
    return replace(POINT_LIST, layout=layout, comment=(layout.comment.encode() + b" ", b""))


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """Rows of a list: (n,) `line`, (n, 3) spans and numbers of X, Y and Z, tools, whether the row turns."""

    line: list[int]
    spans: list[list[Span]]
    numbers: list[list[Number]]
    bounds: list[Span]
    tools: list[int | None]
    turns: list[tuple[str, ...]]


def read_list(
    data: bytes, setup: Setup, dialect: Dialect, options: Options | None = None, *, words: bool = True
) -> Program:
    """Read a list. Raises ProgramError with the line of what is wrong."""
    assert isinstance(dialect, PointList)
    try:
        layout = dialect.layout or told(first_lines(data))
        if layout is None:
            raise ProgramError(
                "does not tell which columns hold X, Y and Z; name them by name or number with --column X=.. "
                "--column Y=.. --column Z=.., or give a profile with --profile"
                if data.strip()
                else "holds no positions; expected a row a place"
            )
        unit = layout.unit_mm
        found = _rows(data, layout)
    except InputError as error:
        raise ProgramError(error.message, line=error.line) from None
    frame_name = stated_frame(first_lines(data)) or layout.frame
    frames, frame = _frames(setup, frame_name, unit, found)
    count = len(found.line)
    value = np.array([[n.value for n in row] for row in found.numbers]).reshape(-1, 3)
    offset = np.array([f.offset_mm for f in frames]).reshape(-1, 3)[frame] if count else np.zeros((0, 3))
    end = value * unit + offset
    kind = Kind.LINE if layout.joined == "lines" else Kind.RAPID
    flag = np.zeros(count, np.uint8)
    if kind is Kind.LINE and (not layout.insert or "t" in layout.columns):
        flag |= np.uint8(Flag.WHOLE)
    kinds = np.full(count, kind, np.uint8)
    kinds[:1] = Kind.RAPID
    starts, stops = _line_bounds(data)
    return Program(
        data=data,
        dialect=dialect,
        toolpath=Toolpath(
            kind=kinds, flag=flag, line=np.array(found.line, np.int32), frame=frame.astype(np.int32),
            end_mm=end, frames=frames, arcs=Arcs.none(), start_mm=_start(setup),
        ),
        words=_words(data, found, starts) if words else None,
        slot=np.arange(3 * count, dtype=np.int32).reshape(-1, 3) if words else np.zeros((0, 3), np.int32),
        arc_slots=ArcSlots(np.zeros((0, 5), np.int32), np.zeros(0, bool)),
        line_start=starts,
        line_end=stops,
        remarks=tuple(_remarks(layout, found, frame_name, setup)),
        end_line=len(starts),
        lettering=Lettering.of(
            data, np.array(found.bounds, np.int64).reshape(-1, 2), np.array(found.spans, np.int64),
            decimal=b"," if layout.decimal == "comma" else b".",
        ),
    )  # fmt: skip


def _rows(data: bytes, layout: Layout) -> _Found:
    cells = Cells(data, layout)
    decimal = b"," if layout.decimal == "comma" else b"."
    places = [cells.place(axis) for axis in AXES]
    if None in places:
        raise InputError("has no columns for X, Y and Z; name them with --column X=.. or in a profile")
    xyz = [p for p in places if p is not None]
    tool = cells.place("tool")
    turning = [p for role in _TURNING if (p := cells.place(role)) is not None]
    found = _Found([], [], [], [], [], [])
    for line, row in cells.rows():
        if max(xyz) >= len(row):
            raise InputError(
                f"{len(row)} columns; expected at least {max(xyz) + 1} between {layout.delimiter}s", line=line
            )
        numbers = [number(data[slice(*row[p])], decimal) for p in xyz]
        wrong = next((p for p, n in zip(xyz, numbers, strict=True) if n is None), None)
        if wrong is not None:
            raise InputError(
                f'column {wrong + 1} is "{cells.text(row[wrong])[:40]}"; expected a number with a decimal '
                f"{layout.decimal}",
                line=line,
            )
        found.line.append(line)
        found.spans.append([row[p] for p in xyz])
        found.numbers.append([n for n in numbers if n is not None])
        found.bounds.append(cells.bounds)
        found.turns.append(tuple(cells.text(row[p]) for p in turning if p < len(row)))
        text = cells.text(row[tool]) if tool is not None and tool < len(row) else ""
        if text and not text.isdigit():
            raise InputError(
                f'"{text}" is no tool number; expected the number of a table [tools.N]', line=line
            )
        found.tools.append(int(text) if text else None)
    return found


def _frames(
    setup: Setup, name: str | None, unit: float, found: _Found
) -> tuple[tuple[Frame, ...], npt.NDArray[np.int64]]:
    """The frames of the rows: one a tool."""
    tools = list(dict.fromkeys(found.tools))
    first = {tool: found.line[found.tools.index(tool)] for tool in tools}
    frames = tuple(
        frame_of(setup, name or setup.machine.default_work_offset, tool, unit, first[tool]) for tool in tools
    )
    return frames, np.array([tools.index(t) for t in found.tools], np.int64)


def _words(data: bytes, found: _Found, line_start: npt.NDArray[np.int32]) -> Words:
    """X, Y and Z of all rows, in that order."""
    flat = [n for row in found.numbers for n in row]
    span = np.array(found.spans, np.int64).reshape(-1, 2)
    decimals = np.array([min(max(n.places, 0), MOST_DECIMALS) for n in flat], np.int64)
    value = np.array([n.value for n in flat])
    start = span[:, 0].astype(np.int32)
    # columns may stand in any order: by line, words are counted where the first of them stands
    first = np.searchsorted(start.reshape(-1, 3).min(axis=1), np.append(line_start, len(data))) * 3
    return Words(
        letter=np.tile(np.frombuffer(b"XYZ", np.uint8), len(found.line)),
        mantissa=np.rint(value * 10.0**decimals).astype(np.int64),
        decimals=decimals.astype(np.int8),
        pointed=np.ones(len(flat), bool),
        start=start,
        number=start,
        end=span[:, 1].astype(np.int32),
        first_word=first.astype(np.int32),
    )


def _line_bounds(data: bytes) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    starts, stops = [], []
    at = 0
    for raw in data.splitlines(keepends=True):
        starts.append(at)
        stops.append(at + len(raw.rstrip(b"\r\n")))
        at += len(raw)
    return np.array(starts or [0], np.int32), np.array(stops or [0], np.int32)


def _start(setup: Setup) -> tuple[float, float, float]:
    x, y, z = (float("nan") if v is None else v for v in setup.job.start_mm)
    return (x, y, z)


def _remarks(
    layout: Layout, found: _Found, frame_name: str | None, setup: Setup
) -> list[tuple[str, int, str]]:
    line = found.line[0] if found.line else 1
    out = [("told", line, said) for said in layout.assumed]
    if frame_name is None:
        out.append(("told", line, f"positions are stated in {setup.machine.default_work_offset}"))
    if len(set(found.turns)) > 1:
        out.append(("turning", line, "the orientation changes from row to row"))
    if layout.joined == "points":
        out.append(("joined", line, "how the machine goes from row to row is not stated"))
    return out


__all__ = ["MM", "POINT_LIST", "PointList", "read_list", "with_layout"]
