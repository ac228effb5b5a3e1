"""Reads a list of positions as a program: one row per waypoint, in order, with other columns beside them.

A list states where the machine goes, and rarely how. So rows are waypoints, and the path between them is
judged only where the layout states that straight lines join them. Only X, Y and Z are ever edited.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array
from olp.core.errors import InputError, ProgramError
from olp.core.machine import Setup
from olp.core.toolpath import Flag, Frame, Kind
from olp.core.values import dataclass
from olp.program.dialect import Dialect, Options
from olp.program.frame_index import frame_index
from olp.program.frames import FrameTable
from olp.program.pointlist.base import PointList
from olp.program.pointlist.columns import columns
from olp.program.program import Program
from olp.program.text.delimited import AXES, MM_S, Layout, detected_layout, first_lines, stated_frame
from olp.program.text.numbers import Number, number
from olp.program.text.rows import Cells
from olp.program.verbatim import Moves

_TURNING = ("A", "B", "C", "I", "J", "K")


@dataclass(slots=True)
class _Rows:
    """Rows of a list: line, bytes, feed and numbers of each, as lists or columns, the `values` as written,
    tools and orientations; and the first line of each tool."""

    line: Any = field(default_factory=list)
    bounds: Any = field(default_factory=list)
    feed: Any = field(default_factory=list)
    spans: Any = field(default_factory=list)
    plain: tuple[Any, Any, Any, Any] | None = None
    values: Sequence[Sequence[float]] | Array = ()
    tool: list[int | None] = field(default_factory=list)
    tools: dict[int | None, int] = field(default_factory=dict)
    turns: dict[tuple[str, ...], int] = field(default_factory=dict)


def read_list(
    data: bytes, setup: Setup, dialect: Dialect, options: Options | None = None, *, words: bool = True
) -> Program:
    """Read a list. Raises ProgramError with the line of what is wrong."""
    assert isinstance(dialect, PointList)
    try:
        layout = dialect.layout or detected_layout(first_lines(data))
        if layout is None:
            raise ProgramError(
                "does not show which columns hold X, Y and Z; name them in the header, or give olp correct "
                "--column X=.. --column Y=.. --column Z=.., or give any verb a profile with --dialect"
                if data.strip()
                else "has no positions; expected one row per waypoint",
                code="OLP504",
            )
        unit = layout.unit_mm
        rows = _rows(data, layout)
        frame_name = stated_frame(first_lines(data)) or layout.frame
    except InputError as error:
        raise ProgramError(error.message, line=error.line, code="OLP504") from None
    table = FrameTable(setup)
    kind = Kind.LINE if layout.joined == "lines" else Kind.RAPID
    whole = kind is Kind.LINE and (not layout.insert or "t" in layout.columns)
    name = frame_name or setup.machine.default_work_offset
    count = len(rows.line)
    index = {tool: frame_index(table, setup, name, tool, unit, line) for tool, line in rows.tools.items()}
    frames = table.frames
    frame = np.zeros(count, np.int32)
    if len(index) > 1:
        frame[:] = [index[tool] for tool in rows.tool]
    kinds = np.full(count, kind, np.uint8)
    kinds[:1] = Kind.RAPID
    moves = Moves(plain=rows.plain)
    moves.put_all(
        kind=kinds, flag=np.full(count, Flag.WHOLE if whole else 0), line=rows.line, frame=frame,
        end=_placed(frames, frame, np.array(rows.values, float).reshape(-1, 3)),
        slot=np.arange(3 * count), bounds=rows.bounds, feed=rows.feed, spans=rows.spans,
    )  # fmt: skip
    return moves.program(
        data, dialect, setup, frames, _remarks(layout, rows, frame_name, setup),
        decimal=b"," if layout.decimal == "comma" else b".", words=words,
    )  # fmt: skip


def _placed(frames: Sequence[Frame], index: npt.NDArray[np.int32], values: Array) -> Array:
    """(n, 3) axis positions of the numbers of rows (n, 3)."""
    axis_mm = np.empty_like(values)
    for i, frame in enumerate(frames):
        rows = index == i
        stated = values[rows] * frame.unit_mm
        turned = stated if frame.turn is None else stated @ np.array(frame.turn).T
        axis_mm[rows] = turned + np.array(frame.offset_mm)
    return axis_mm


def _in_columns(
    data: bytes, layout: Layout, cells: Cells, xyz: list[int], tool: int | None, speed: int | None,
    turning: list[int],
) -> _Rows | None:  # fmt: skip
    """The rows of a plain table, None where it is not plain."""
    speed = speed if layout.speed_unit is not None else None
    others = [*turning, *(p for p in (tool, speed) if p is not None)]
    plain = columns(data, layout, cells.header_line, xyz, others)
    if plain is None:
        return None
    count = len(plain.line)
    texts = [[data[a:b] for a, b in plain.cells[:, k].tolist()] for k in range(len(others))]
    table = _Rows(values=plain.value)
    orientations = texts[: len(turning)]
    for k, turn in enumerate(zip(*orientations, strict=True) if orientations else [()]):
        table.turns.setdefault(tuple(t.decode("latin-1") for t in turn), int(plain.line[k]))
    table.tools[None] = int(plain.line[0])
    if tool is not None:
        tools = texts[len(turning)]
        if not all(t.isdigit() for t in tools):
            return None
        table.tool = [int(t) for t in tools]
        first = dict(zip(reversed(table.tool), reversed(plain.line.tolist()), strict=True))
        table.tools = {t: first[t] for t in dict.fromkeys(table.tool)}
    feed = np.full(count, np.nan)
    if speed is not None and layout.speed_unit is not None:
        known = [number(t, cells.decimal) for t in texts[-1]]
        if None in known:
            return None
        feed = np.array([k.value for k in known if k is not None]) * MM_S[layout.speed_unit]
    table.line, table.feed = plain.line, feed
    table.bounds = np.column_stack((plain.begin, plain.end))
    table.spans = np.column_stack((plain.start.ravel(), plain.stop.ravel()))
    table.plain = (plain.mantissa.ravel(), plain.decimals.ravel(), plain.start.ravel(), plain.stop.ravel())
    return table


def _rows(data: bytes, layout: Layout) -> _Rows:
    cells = Cells(data, layout)
    places = [cells.place(axis) for axis in AXES]
    if None in places:
        raise InputError(
            "has no columns for X, Y and Z; name them with --column X=.. of olp correct, or in a profile "
            "(--dialect)"
        )
    xyz = [p for p in places if p is not None]
    tool, speed = cells.place("tool"), cells.place("speed")
    factor = MM_S[layout.speed_unit] if layout.speed_unit else float("nan")
    feed = float("nan")
    turning = [p for role in _TURNING if (p := cells.place(role)) is not None]
    plain = _in_columns(data, layout, cells, xyz, tool, speed, turning)
    if plain is not None:
        return plain
    table = _Rows()
    values: list[tuple[float, ...]] = []
    for line, row in cells.rows():
        # a row that is too short is an error of its last column
        numbers = [cells.number(row, p) for p in (xyz if max(xyz) < len(row) else [max(xyz)])]
        wrong = next((problem for problem in numbers if isinstance(problem, str)), None)
        if wrong is not None:
            raise InputError(wrong, line=line)
        text = cells.word(row, tool)
        if text and not text.isdigit():
            raise InputError(
                f'"{text}" is not a tool number; expected the number of a table [tools.N]', line=line
            )
        stated_speed = cells.number(row, speed) if speed is not None else None
        # a row without a speed keeps that of the row before
        feed = stated_speed.value * factor if isinstance(stated_speed, Number) else feed
        table.feed.append(feed)
        known = [n for n in numbers if not isinstance(n, str)]
        table.spans += [row[p] for p in xyz]
        table.line.append(line)
        table.bounds.append(cells.bounds)
        values.append(tuple(n.value for n in known))
        table.turns.setdefault(tuple(cells.text(row[p]) for p in turning if p < len(row)), line)
        table.tool.append(int(text) if text else None)
        table.tools.setdefault(table.tool[-1], line)
    table.values = values
    return table


def _remarks(layout: Layout, rows: _Rows, frame_name: str | None, setup: Setup) -> list[tuple[str, int, str]]:
    line = int(rows.line[0]) if len(rows.line) else 1
    remarks = [("told", line, assumption) for assumption in layout.assumed]
    if frame_name is None:
        remarks.append(("told", line, f"positions are stated in {setup.machine.default_work_offset}"))
    if len(rows.turns) > 1:
        remarks.append(("turning", list(rows.turns.values())[1], "the orientation changes from row to row"))
    if not layout.stamp:
        remarks.append(
            ("unmarked", line, "the profile allows no comment, so nothing marks the corrected list")
        )
    if layout.joined == "points":
        remarks.append(("joined", line, "how the machine goes from row to row is not stated"))
    return remarks
