"""Reads a list of axis values: a table whose header names every axis with its unit, as `J1_deg` or `X_mm`.

A row states where all axes are. Between rows they go along straight lines, all at a time, unless the list
says otherwise: a comment `# joined=points`, or a column of time.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Literal

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.errors import InputError, ProgramError
from olp.core.toolpath import Frame, Kind, Toolpath
from olp.core.values import dataclass
from olp.program.pointlist.columns import columns
from olp.program.pointlist.dialect import DIALECT
from olp.program.program import ArcSlots, Program
from olp.program.text.delimited import DELIMITERS, Delimiter, Layout, first_lines, mapping, stated_frame
from olp.program.text.line_ends import LINE_END
from olp.program.text.numbers import MOST_DECIMALS, Number
from olp.program.text.rows import Cells

_JOINED = re.compile(r"#\s*joined\s*=\s*(\S+)")
#: Names of a column of time, with or without its unit.
_TIME = re.compile(r"(?i)(?:t|time)(?:[ _]*[\[(]?(?:s|ms|us)[\])]?)?")
#: Names of columns of axis values.
_OF_AXIS = re.compile(r"[A-Z]\d?_(?:mm|deg)")
_COMMA_NUMBER = re.compile(r"[-+]?\d+,\d+")


@dataclass(frozen=True, slots=True, eq=False)
class AxisList:
    """The rows of a list as a program without words, with their (n, axes) `values` in mm and deg. The text of
    a value is the bytes `start` to `stop`, with its `decimals`, (n, axes) each. `begin` and `end` (n,) are
    the bytes of a row. `tool` (n,) are numbers of tools, -1 where none is stated. The rows are `joined` by
    straight lines or not."""

    program: Program
    values: Array
    start: Index
    stop: Index
    decimals: Index
    begin: Index
    end: Index
    tool: Index
    joined: bool
    decimal: bytes


def read_axis_list(data: bytes, order: Sequence[str], units: Sequence[str]) -> AxisList:
    """Read a list for a machine with the axes `order`. Raises ProgramError with the line of what is wrong."""
    try:
        lines = first_lines(data)
        frame = stated_frame(lines)
        if frame is not None:
            raise InputError(f"states the frame {frame}; axis values count from the zeros of the axes")
        cells = Cells(data, _layout(lines))
        places = _places(cells, order, units)
        rows = _plain(data, cells, places) or _by_row(cells, places)
        joined = _joined(lines, cells)
        tool = np.array([_tool(text, line) for text, line in zip(rows[5], rows[0].tolist(), strict=True)])
    except InputError as error:
        raise ProgramError(error.message, line=error.line, code="OLP504") from None
    line, spans, values, decimals, bounds, _ = rows
    program = _program(data, line, Kind.LINE if joined else Kind.RAPID)
    return AxisList(
        program, values, spans[..., 0], spans[..., 1], decimals, bounds[:, 0], bounds[:, 1],
        tool.astype(np.int64), joined, cells.decimal,
    )  # fmt: skip


def names_of(rows: AxisList) -> tuple[str, ...] | None:
    """The column `name` of a list, None where it has none."""
    data = bytes(rows.program.data)
    cells = Cells(data, _layout(first_lines(data)))
    if "name" not in cells.header:
        return None
    place = cells.header.index("name")
    return tuple(cells.word(row, place) for _, row in cells.rows())


#: Line (n,), bytes of numbers (n, axes, 2), values and decimals (n, axes), bytes of rows (n, 2), tools.
_Rows = tuple[Index, Index, Array, Index, Index, list[str]]


def _layout(lines: Sequence[str]) -> Layout:
    """Delimiter and decimal mark, as the header and the rows below it show them."""
    rows = [line for line in lines if line.strip() and not line.lstrip().startswith("#")]
    header = rows[0] if rows else ""
    marks = [name for name, mark in DELIMITERS.items() if mark is not None and mark in header]
    delimiter: Delimiter = "space"
    for name in ("semicolon", "tab", "comma"):
        if name in marks:
            delimiter = name
            break
    cells = [cell.strip() for row in rows[1:] for cell in row.split(DELIMITERS[delimiter])]
    comma = delimiter != "comma" and any(_COMMA_NUMBER.fullmatch(cell) for cell in cells)
    decimal: Literal["point", "comma"] = "comma" if comma else "point"
    return Layout(mapping({}), delimiter, decimal)


def _places(cells: Cells, order: Sequence[str], units: Sequence[str]) -> list[int]:
    """The columns of all axes. Raises InputError where the header does not name each once, with its unit, or
    names further axes: such values are those of another machine, or poses."""
    wanted = [f"{name}_{unit}" for name, unit in zip(order, units, strict=True)]
    wrong = [name for name in wanted if cells.header.count(name) != 1]
    if wrong:
        known = ", ".join(cells.header) or "nothing"
        raise InputError(
            f"the header names {known}; expected one column for each of {', '.join(wanted)} (missing or "
            f"twice: {', '.join(wrong)})",
            line=cells.header_line or 1,
        )
    others = [name for name in cells.header if _OF_AXIS.fullmatch(name) and name not in wanted]
    if others:
        raise InputError(
            f"the header names {', '.join(others)}, and the machine has no such axis; expected the values of "
            f"{', '.join(wanted)}; give other columns other names, and compute the axis values of poses "
            "before (olp.kinematics.inverse)",
            line=cells.header_line or 1,
        )
    return [cells.header.index(name) for name in wanted]


def _joined(lines: Sequence[str], cells: Cells) -> bool:
    for number, line in enumerate(lines, 1):
        match = _JOINED.match(line.strip())
        if match and match[1] not in ("lines", "points"):
            raise InputError(f"joined = {match[1]}; expected lines or points", line=number)
        if match:
            return match[1] == "lines"
    return not any(_TIME.fullmatch(name) for name in cells.header)


def _plain(data: bytes, cells: Cells, places: list[int]) -> _Rows | None:
    """The rows of a table without quotes and exponents, all at once; None where it is not plain."""
    tool = _tool_place(cells)
    others = [] if tool is None else [tool]
    plain = columns(data, cells.layout, cells.header_line, places, others)
    if plain is None:
        return None
    tools = [data[a:b].decode("latin-1") for a, b in plain.cells[:, 0].tolist()] if others else []
    return (
        plain.line, np.stack((plain.start, plain.stop), axis=-1), plain.value,
        plain.decimals.astype(np.int64), np.column_stack((plain.begin, plain.end)),
        tools or [""] * len(plain.line),
    )  # fmt: skip


def _by_row(cells: Cells, places: list[int]) -> _Rows:
    """The rows one by one. Raises InputError with the line of a cell that is no number."""
    line, spans, values, decimals, bounds, tools = [], [], [], [], [], []
    tool = _tool_place(cells)
    for number, row in cells.rows():
        # a row that is too short is an error of its last column
        read = [cells.number(row, place) for place in (places if max(places) < len(row) else [max(places)])]
        wrong = next((problem for problem in read if isinstance(problem, str)), None)
        if wrong is not None:
            raise InputError(wrong, line=number)
        known = [value for value in read if isinstance(value, Number)]
        line.append(number)
        spans.append([row[place] for place in places])
        values.append([value.value for value in known])
        decimals.append([min(max(value.places, 0), MOST_DECIMALS) for value in known])
        bounds.append(cells.bounds)
        tools.append(cells.word(row, tool))
    if not line:
        raise InputError("has no rows below its header; expected one for each place", line=cells.header_line)
    return np.array(line), np.array(spans), np.array(values), np.array(decimals), np.array(bounds), tools


def _tool_place(cells: Cells) -> int | None:
    return cells.header.index("tool") if "tool" in cells.header else None


def _tool(text: str, line: int) -> int:
    if text and not text.isdigit():
        raise InputError(
            f'"{text}" is not a tool number; expected the number of a table [tools.N]', line=line
        )
    return int(text) if text else -1


def _program(data: bytes, line: Index, kind: Kind) -> Program:
    count = len(line)
    spans = np.array([match.span() for match in LINE_END.finditer(data)], np.int32).reshape(-1, 2)
    line_start, line_end = np.append(0, spans[:, 1]), np.append(spans[:, 0], len(data))
    # the end of the last line begins no further line
    lines = len(line_start) - (line_start[-1] == len(data))
    line_start, line_end = line_start[:lines].astype(np.int32), line_end[:lines].astype(np.int32)
    return Program(
        data=data, dialect=DIALECT,
        toolpath=Toolpath(
            kind=np.full(count, kind, np.uint8), flag=np.zeros(count, np.uint8), line=line.astype(np.int32),
            frame=np.zeros(count, np.int32), end_mm=np.full((count, 3), np.nan), frames=(Frame(),),
        ),
        words=None, slot=np.full((count, 3), -1, np.int32),
        arc_slots=ArcSlots(np.zeros((0, 5), np.int32), np.zeros(0, bool)),
        line_start=line_start, line_end=line_end, end_line=len(line_start),
    )  # fmt: skip
