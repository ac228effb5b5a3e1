"""Reads reported points from a table (CSV and similar)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index
from olp.core.errors import InputError
from olp.core.values import dataclass
from olp.program.pointlist.columns import columns
from olp.program.text.delimited import AXES, Layout, first_lines, stated_frame
from olp.program.text.line_ends import ends_in
from olp.program.text.numbers import LARGEST, Number
from olp.program.text.rows import Cells, Span
from olp.results.reported import Names, PointColumns, Reported, Stated, index_type, missing

_DIRECTION = ("I", "J", "K")
_STYLUS = ("SX", "SY", "SZ")
#: problems that one message names at most
_MOST_PROBLEMS = 5
#: bytes of a table that are read at once, to limit memory
_BAND = 1 << 20
#: a comment that says that the instrument's own correction was active
_ACTIVE = re.compile(
    r"(?P<geometry>(error|volumetric|geometr\w*|caa?|vec)[ _-]*(map|comp\w*|correction|matrix))|"
    r"(?P<temperature>(temperature|thermal)[ _-]*(comp\w*|correction))",
    re.IGNORECASE,
)
_YES = re.compile(r"\b(on|yes|true|active|enabled|applied|1)\b", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class _Places:
    """Indices of the columns of a table: those of `numbers` (X, Y and Z, then I, J and K, then the stylus
    where there are such columns), and of tool and name (None: no column)."""

    numbers: list[int]
    has_normal: bool
    has_stylus: bool
    tool: int | None
    name: int | None

    @staticmethod
    def of(cells: Cells) -> _Places:
        """Raises InputError where a column is missing."""
        axes = [cells.place(axis) for axis in AXES]
        if None in axes:
            raise InputError("has no columns for X, Y and Z; name them with --column X=.. or in a profile")
        others = {role: cells.place(role) for role in (*_DIRECTION, *_STYLUS, "tool", "name")}
        for roles in (_DIRECTION, _STYLUS):
            given = [role for role in roles if others[role] is not None]
            if given and len(given) < len(roles):
                raise InputError(f"has a column {given[0]}, but not all of {', '.join(roles)}")
        wanted = [*axes, *(others[role] for role in (*_DIRECTION, *_STYLUS))]
        return _Places(
            [place for place in wanted if place is not None], others["I"] is not None,
            others["SX"] is not None, others["tool"], others["name"],
        )  # fmt: skip


class _Labels:
    """Labels of tools as the table states them, with their index."""

    def __init__(self) -> None:
        self.index: dict[str | int | None, int] = {}

    def of(self, texts: Sequence[str]) -> npt.NDArray[np.int32]:
        """(n,) the index of the label of each row."""
        known = {text: self.index.setdefault(_tool(text), len(self.index)) for text in dict.fromkeys(texts)}
        return np.fromiter((known[text] for text in texts), np.int32, len(texts))


def read_table(data: bytes, layout: Layout) -> Reported:
    """The points of a table. Raises InputError with the line of what is wrong."""
    cells = Cells(data, layout)
    unit = layout.unit_mm
    places, labels, points = _Places.of(cells), _Labels(), PointColumns()
    problems: list[tuple[int, str]] = []
    for band in cells.bands(_BAND):
        if not _plain_band(cells, places, labels, points, *band):
            _rows(cells, places, labels, points, problems, *band)
        if len(problems) >= _MOST_PROBLEMS:
            break
    if problems:
        first = problems[0]
        more = "".join(f"; line {line}: {text}" for line, text in problems[1:_MOST_PROBLEMS])
        raise InputError(first[1] + more, line=first[0])
    if not points.count:
        raise InputError("holds no points; expected one row per point")
    count = points.count
    approach_mm = np.nan if layout.approach_mm is None else layout.approach_mm
    return Reported(
        data=data,
        dialect="table",
        line=points.take("line"),
        start=points.take("start"),
        end=points.take("end"),
        value=points.take("value"),
        unit_mm=np.broadcast_to(unit, count),
        normal=points.take("normal") if places.has_normal else missing(count, 3),
        frame=np.zeros(count, np.int32),
        frames=(stated_frame(first_lines(data)) or layout.frame,),
        tool=points.take("tool"),
        tools=tuple(labels.index),
        stylus_mm=points.take("stylus") * unit if places.has_stylus else missing(count, 3),
        approach_mm=np.broadcast_to(approach_mm, count),
        names=points.names(),
        decimal=cells.decimal,
        comment=(layout.comment.encode() + b" ", b"") if layout.stamp else None,
        point=layout.point,
        tip_radius_mm=layout.tip_radius_mm,
        stated=tuple(stated_in(data, _comments(data, layout))),
        assumed=layout.assumed,
    )


def _plain_band(
    cells: Cells, places: _Places, labels: _Labels, points: PointColumns, begin: int, stop: int, before: int
) -> bool:
    """Read the lines in the bytes `begin`..`stop`, which come after so many `before`, in columns. False where
    they have to be read row by row."""
    others = [place for place in (places.tool, places.name) if place is not None]
    table = columns(cells.data[begin:stop], cells.layout, cells.header_line - before, places.numbers, others)
    if table is None:
        return False
    value = table.value
    if (np.abs(value) >= LARGEST).any():
        return False
    nothing = [""] * len(value)
    texts = [
        [cells.text((a + begin, b + begin)) for a, b in table.cells[:, k].tolist()]
        for k in range(len(others))
    ]
    _put(
        cells, places, points, table.line + before, table.start + begin, table.stop + begin, value,
        labels.of(nothing if places.tool is None else texts[0]),
        nothing if places.name is None else texts[-1],
    )  # fmt: skip
    return True


def _rows(
    cells: Cells, places: _Places, labels: _Labels, points: PointColumns, problems: list[tuple[int, str]],
    begin: int, stop: int, before: int,
) -> None:  # fmt: skip
    """The same row by row, with the lines of `problems` and what is wrong there."""
    lines: list[int] = []
    spans: list[list[Span]] = []
    values: list[list[float]] = []
    tools: list[str] = []
    names: list[str] = []
    for line, row in cells.rows(begin, stop, before):
        read = [cells.number(row, place) for place in places.numbers]
        wrong = next((value for value in read if isinstance(value, str)), None)
        if wrong is not None:
            problems.append((line, wrong))
            continue
        lines.append(line)
        spans.append([row[place] for place in places.numbers])
        values.append([value.value for value in read if isinstance(value, Number)])
        tools.append(cells.word(row, places.tool))
        names.append(cells.word(row, places.name))
    if lines:
        span = np.array(spans, np.int64)
        _put(
            cells, places, points, np.array(lines), span[:, :, 0], span[:, :, 1], np.array(values),
            labels.of(tools), names,
        )  # fmt: skip


def _put(
    cells: Cells, places: _Places, points: PointColumns, line: Index, start: Index, stop: Index, value: Array,
    tool: npt.NDArray[np.int32], names: Sequence[str],
) -> None:  # fmt: skip
    """Points with all numbers of their rows: X, Y, Z, a direction, and a stylus."""
    small = index_type(len(cells.data))
    more = {"normal": value[:, 3:6]} if places.has_normal else {}
    more |= {"stylus": value[:, -3:]} if places.has_stylus else {}
    points.put(
        Names.of(names), line=line.astype(np.int32), start=start[:, :3].astype(small),
        end=stop[:, :3].astype(small), value=value[:, :3], tool=tool, **more,
    )  # fmt: skip


def _tool(text: str) -> str | int | None:
    return int(text) if text.isdigit() else text or None


def stated_in(data: bytes, comments: Iterable[tuple[int, bytes]]) -> Iterator[Stated]:
    """What comments, by position and text, say of compensation that was active."""
    line, counted = 1, 0
    for begin, raw in comments:
        comment = raw.decode("latin-1").strip()
        match = _ACTIVE.search(comment)
        if match is None or not _YES.search(comment, match.end()):
            continue
        line += ends_in(data, counted, begin)
        counted = begin
        yield Stated(line, "geometry" if match["geometry"] else "temperature", comment)


def _comments(data: bytes, layout: Layout) -> Iterator[tuple[int, bytes]]:
    """Position and text of the lines that are comments."""
    marks = b"|".join({re.escape(mark) for mark in (b"#", layout.comment.encode())})
    for match in re.finditer(b"(?:" + marks + rb")[^\r\n]*", data):
        begin = data.rfind(b"\n", 0, match.start()) + 1
        begin = max(begin, data.rfind(b"\r", begin, match.start()) + 1)
        if not data[begin : match.start()].strip():
            yield match.start(), match[0]
