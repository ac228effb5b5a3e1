"""The dialect of lists of positions, and that of lists whose layout is stated."""

from __future__ import annotations

from dataclasses import replace

from olp.core.machine import Setup
from olp.program.dialect import Dialect, Options
from olp.program.pointlist.base import PointList
from olp.program.program import Program
from olp.program.text.delimited import Layout
from olp.program.text.signs import LISTS


def _read(data: bytes, setup: Setup, dialect: Dialect, options: Options, *, words: bool) -> Program:
    from olp.program.pointlist.reader import read_list

    return read_list(data, setup, dialect, options, words=words)


DIALECT = PointList(
    name="list",
    title="list of positions (CSV, TXT)",
    path_mode="not stated",
    points=True,
    reader=_read,
    signs=LISTS,
    comment=(b"# ", b""),
)


def with_layout(layout: Layout) -> PointList:
    """The dialect of lists with this layout."""
    comment = (layout.comment.encode() + b" ", b"")
    return replace(DIALECT, layout=layout, comment=comment, marks=layout.stamp)
