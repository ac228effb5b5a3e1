"""Arcs that are read as chords, as they are written: points in place of the statement of the arc."""

from __future__ import annotations

import numpy as np

from olp.compensation.point_writer import PointWriter
from olp.compensation.rows import Rows
from olp.compensation.statement_arcs import ROW
from olp.program.text.edits import BARE, EditList, Edits

#: a point where the arc itself is the only statement
_POINT = (b"GOTO/", b",", b",", b"")


def chord_edits(writer: PointWriter, rows: Rows) -> list[Edits]:
    """Points for the chords of all arcs of which anything changes."""
    edits = EditList(writer.prefixes)
    for arc in writer.statements.chords:
        a, b = np.searchsorted(rows.move, (arc.first, arc.bare + 1)).tolist()
        if b <= a or not rows.write[a].any():
            continue
        lead, between, last, trail = _POINT if arc.whole else writer.template(arc.last)
        eol = writer.program.eol(int(writer.path.line[arc.first]))
        edits.add(arc.begin, arc.end, BARE, 0)
        for row in range(a, b):
            for axis, text in enumerate((lead if row == a else eol + lead, between, last)):
                number = int(rows.mantissa[row, axis]), int(rows.decimals[row, axis])
                edits.add(arc.end, arc.end, *number, text, row * ROW + axis)
            edits.add(arc.end, arc.end, BARE, 0, trail, row * ROW + 3)
        writer.tally.inserted_blocks += b - a
    return [edits.done()]
