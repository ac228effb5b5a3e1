"""Reads reported points from a table (CSV and similar)."""

from __future__ import annotations

import re

import numpy as np

from olp.core.errors import InputError
from olp.program.text.delimited import AXES, Layout, first_lines, stated_frame
from olp.program.text.numbers import Number
from olp.program.text.rows import Cells, Span
from olp.results.reported import Reported, Stated

_DIRECTION = ("I", "J", "K")
_STYLUS = ("SX", "SY", "SZ")
#: problems that one message names at most
_MOST_PROBLEMS = 5
#: a comment that says that the instrument's own correction was active
_ACTIVE = re.compile(
    r"(?P<geometry>(error|volumetric|geometr\w*|caa?|vec)[ _-]*(map|comp\w*|correction|matrix))|"
    r"(?P<temperature>(temperature|thermal)[ _-]*(comp\w*|correction))",
    re.IGNORECASE,
)
_YES = re.compile(r"\b(on|yes|true|active|enabled|applied|1)\b", re.IGNORECASE)


def read_table(data: bytes, layout: Layout) -> Reported:
    """The points of a table. Raises InputError with the line of what is wrong."""
    cells = Cells(data, layout)
    unit = layout.unit_mm
    places = [cells.place(axis) for axis in AXES]
    if None in places:
        raise InputError("has no columns for X, Y and Z; name them with --column X=.. or in a profile")
    others = {role: cells.place(role) for role in (*_DIRECTION, *_STYLUS, "tool", "name")}
    for roles in (_DIRECTION, _STYLUS):
        given = [role for role in roles if others[role] is not None]
        if given and len(given) < len(roles):
            raise InputError(f"has a column {given[0]}, but not all of {', '.join(roles)}")
    wanted = [*places, *(others[r] for r in (*_DIRECTION, *_STYLUS) if others[r] is not None)]
    lines: list[int] = []
    spans: list[list[Span]] = []
    forms: list[tuple[Number, ...]] = []
    names: list[str] = []
    tools: list[str | int | None] = []
    problems: list[tuple[int, str]] = []
    for line, row in cells.rows():
        values: list[Number] = []
        for place in wanted:
            assert place is not None
            value = cells.number(row, place)
            if isinstance(value, str):
                problems.append((line, value))
                break
            values.append(value)
        else:
            lines.append(line)
            spans.append([row[p] for p in places if p is not None])
            forms.append(tuple(values))
            names.append(cells.word(row, others["name"]))
            tools.append(_tool(cells.word(row, others["tool"])))
        if len(problems) >= _MOST_PROBLEMS:
            break
    if problems:
        first = problems[0]
        more = "".join(f"; line {line}: {text}" for line, text in problems[1:])
        raise InputError(first[1] + more, line=first[0])
    if not lines:
        raise InputError("holds no points; expected one row per point")
    count = len(lines)
    numbers = np.array([[n.value for n in row] for row in forms])
    nothing = np.full((count, 3), np.nan)
    has_normal = others["I"] is not None
    has_stylus = others["SX"] is not None
    labels = tuple(dict.fromkeys(tools))
    span = np.array(spans, np.int64)
    return Reported(
        data=data,
        dialect="table",
        line=np.array(lines, np.int64),
        start=span[:, :, 0],
        end=span[:, :, 1],
        form=tuple((row[0], row[1], row[2]) for row in forms),
        value_mm=numbers[:, :3] * unit,
        unit_mm=np.full(count, unit),
        normal=numbers[:, 3:6] if has_normal else nothing,
        frame=np.zeros(count, np.int64),
        frames=(stated_frame(first_lines(data)) or layout.frame,),
        tool=np.array([labels.index(t) for t in tools], np.int64),
        tools=labels,
        stylus_mm=numbers[:, -3:] * unit if has_stylus else nothing,
        approach_mm=np.full(count, np.nan if layout.approach_mm is None else layout.approach_mm),
        names=tuple(names),
        decimal=cells.decimal,
        comment=(layout.comment.encode() + b" ", b"") if layout.stamp else None,
        point=layout.point,
        tip_radius_mm=layout.tip_radius_mm,
        stated=tuple(_stated(data, layout)),
        assumed=layout.assumed,
    )


def _tool(text: str) -> str | int | None:
    return int(text) if text.isdigit() else text or None


def stated_in(line: int, comment: str) -> Stated | None:
    """What a comment says of compensation that was active, None where it says nothing of it."""
    match = _ACTIVE.search(comment)
    if match is None or not _YES.search(comment, match.end()):
        return None
    return Stated(line, "geometry" if match["geometry"] else "temperature", comment)


def _stated(data: bytes, layout: Layout) -> list[Stated]:
    stated = []
    for line, raw in enumerate(data.splitlines(), 1):
        text = raw.decode("latin-1").strip()
        if text.startswith(("#", layout.comment)):
            stated.append(stated_in(line, text))
    return [entry for entry in stated if entry is not None]
