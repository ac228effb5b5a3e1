"""The dialect of lists of positions, and that of lists whose layout is stated."""

from __future__ import annotations

from dataclasses import replace

from olp.program.pointlist.reader import PointList, read_list
from olp.program.text.delimited import Layout

DIALECT = PointList(
    name="list",
    title="list of positions (CSV, TXT)",
    path_mode="not stated",
    points=True,
    reader=read_list,
    endings=("csv", "tsv"),
    comment=(b"# ", b""),
)


def with_layout(layout: Layout) -> PointList:
    """The dialect of lists with this layout."""
    comment = (layout.comment.encode() + b" ", b"")
    return replace(DIALECT, layout=layout, comment=comment, marks=layout.stamp)
