"""Reads a list of positions as a program: a row a place, in order, with whatever else the rows hold.

A list says where the machine goes, hardly ever how: so rows are way-points, and what lies between them is
judged only where the layout says that they are joined by straight lines. Only X, Y and Z are ever edited.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from olp.exceptions import InputError, ProgramError
from olp.machine import Setup
from olp.program.delimited import AXES, MM_S, Cells, Layout, first_lines, stated_frame, told
from olp.program.dialect import Dialect, Options, Row, Support
from olp.program.frames import FrameTable
from olp.program.lettered import Moves
from olp.program.numbertext import number
from olp.program.places import frame_index
from olp.program.program import Program
from olp.toolpath import Flag, Kind

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
    comment = (layout.comment.encode() + b" ", b"")
    return replace(POINT_LIST, layout=layout, comment=comment, marks=layout.stamp)


@dataclass(slots=True)
class _Found:
    """Rows of a list: moves without frame and end, the `values` of each as written, its tool and orientation;
    and the line where each tool comes first."""

    moves: Moves = field(default_factory=Moves)
    values: list[tuple[float, ...]] = field(default_factory=list)
    tool: list[int | None] = field(default_factory=list)
    tools: dict[int | None, int] = field(default_factory=dict)
    turns: dict[tuple[str, ...], int] = field(default_factory=dict)


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
    table = FrameTable(setup)
    kind = Kind.LINE if layout.joined == "lines" else Kind.RAPID
    whole = kind is Kind.LINE and (not layout.insert or "t" in layout.columns)
    name = frame_name or setup.machine.default_work_offset
    moves = found.moves
    index = {tool: frame_index(table, setup, name, tool, unit, line) for tool, line in found.tools.items()}
    moves.frame = [index[tool] for tool in found.tool]
    frames = table.frames
    for n, values in enumerate(found.values):
        frame = frames[moves.frame[n]]
        moves.end.append(frame.placed_mm(values))
        moves.kind.append(int(kind if n else Kind.RAPID))
        moves.flag.append(int(Flag.WHOLE if whole else Flag(0)))
    return moves.program(
        data, dialect, setup, frames, _remarks(layout, found, frame_name, setup),
        decimal=b"," if layout.decimal == "comma" else b".", words=words,
    )  # fmt: skip


def _rows(data: bytes, layout: Layout) -> _Found:
    cells = Cells(data, layout)
    decimal = b"," if layout.decimal == "comma" else b"."
    places = [cells.place(axis) for axis in AXES]
    if None in places:
        raise InputError("has no columns for X, Y and Z; name them with --column X=.. or in a profile")
    xyz = [p for p in places if p is not None]
    tool, speed = cells.place("tool"), cells.place("speed")
    factor = MM_S[layout.speed_unit] if layout.speed_unit else float("nan")
    feed = float("nan")
    turning = [p for role in _TURNING if (p := cells.place(role)) is not None]
    found = _Found()
    moves = found.moves
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
        text = cells.text(row[tool]) if tool is not None and tool < len(row) else ""
        if text and not text.isdigit():
            raise InputError(
                f'"{text}" is no tool number; expected the number of a table [tools.N]', line=line
            )
        said = number(data[slice(*row[speed])], decimal) if speed is not None and speed < len(row) else None
        # a row without a speed keeps that of the row before
        feed = feed if said is None else said.value * factor
        moves.feed.append(feed)
        first = len(moves.numbers)
        known = [n for n in numbers if n is not None]
        moves.numbers += known
        moves.spans += [row[p] for p in xyz]
        moves.slot.append((first, first + 1, first + 2))
        moves.line.append(line)
        moves.bounds.append(cells.bounds)
        found.values.append(tuple(n.value for n in known))
        found.turns.setdefault(tuple(cells.text(row[p]) for p in turning if p < len(row)), line)
        found.tool.append(int(text) if text else None)
        found.tools.setdefault(found.tool[-1], line)
    return found


def _remarks(
    layout: Layout, found: _Found, frame_name: str | None, setup: Setup
) -> list[tuple[str, int, str]]:
    line = found.moves.line[0] if found.moves.line else 1
    out = [("told", line, said) for said in layout.assumed]
    if frame_name is None:
        out.append(("told", line, f"positions are stated in {setup.machine.default_work_offset}"))
    if len(found.turns) > 1:
        out.append(("turning", list(found.turns.values())[1], "the orientation changes from row to row"))
    if not layout.stamp:
        out.append(("unmarked", line, "the profile allows no comment, so nothing marks the corrected list"))
    if layout.joined == "points":
        out.append(("joined", line, "how the machine goes from row to row is not stated"))
    return out
