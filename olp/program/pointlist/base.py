"""What a dialect of lists of positions is: its layout, and what becomes of each column."""

from __future__ import annotations

from collections.abc import Sequence

from olp.core.values import dataclass
from olp.program.dialect import Dialect, Row, Support
from olp.program.text.delimited import Layout

_SUPPORT = {
    "X": (Support.CORRECTED, ""),
    "Y": (Support.CORRECTED, ""),
    "Z": (Support.CORRECTED, ""),
    "tool": (Support.READ, "the tool of the row: its tool vector"),
    "A": (Support.UNCHANGED, "three linear axes cannot turn the tool"),
    "B": (Support.UNCHANGED, "three linear axes cannot turn the tool"),
    "C": (Support.UNCHANGED, "three linear axes cannot turn the tool"),
    "I": (Support.UNCHANGED, "three linear axes cannot turn the tool"),
    "J": (Support.UNCHANGED, "three linear axes cannot turn the tool"),
    "K": (Support.UNCHANGED, "three linear axes cannot turn the tool"),
    "speed": (Support.UNCHANGED, ""),
    "blend": (Support.UNCHANGED, ""),
    "t": (Support.UNCHANGED, "with a column of time no row is inserted"),
    "name": (Support.UNCHANGED, ""),
    "line": (Support.UNCHANGED, ""),
    "any other column": (Support.UNCHANGED, ""),
    "comment": (Support.UNCHANGED, ""),
    "a row without numbers": (Support.REFUSED, "it may be a waypoint"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class PointList(Dialect):
    """A list of positions; `layout` None: detected from its first rows."""

    layout: Layout | None = None

    def rows(self) -> Sequence[Row]:
        return [Row(f"column {k}" if len(k) < 6 else k, what, why) for k, (what, why) in _SUPPORT.items()]
