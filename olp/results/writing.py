"""Writes corrected points: other numbers in the same text, and nothing else."""

from __future__ import annotations

import numpy as np

from olp.compensation.stamp import stamped
from olp.core.arrays import Array, Index
from olp.core.spool import Spool
from olp.program.text.edits import Bytes, replaced
from olp.program.text.numbers import Placing
from olp.program.text.rewriting import kept, padded, rewritten
from olp.results.reported import Reported


def write(reported: Reported, added_mm: Array, stamp: bytes, decimals: int | None) -> tuple[Spool, float]:
    """The text with `added_mm` (n, 3) added to its points, and the largest rounding error, in mm. A `stamp`
    comes in front where a number changes; `decimals` are the fewest that are written."""
    data, out = reported.data, Spool()
    text = np.frombuffer(data, np.uint8)
    placing = Placing(data, reported.start, reported.end)
    done, rounding_mm = 0, 0.0
    for rows in reported.bands():
        part = reported.part(rows)
        edits, rounding = _edits(part, added_mm[rows], text, placing, decimals)
        rounding_mm = max(rounding_mm, rounding)
        if not len(edits[0]):
            continue
        stop = _line_end(data, int(part.end.max()))
        start, end, new, length = edits
        piece = replaced(text[done:stop], start - done, end - done, new, length).tobytes()
        if stamp and not done:
            eol = b"\r\n" if b"\r\n" in data[:4096] else b"\n"
            piece = stamped(piece, stamp, eol, ())
        out.write(piece)
        done = stop
    out.write(memoryview(data)[done:])
    return out, rounding_mm


def _edits(
    part: Reported, added_mm: Array, text: Bytes, placing: Placing, decimals: int | None
) -> tuple[tuple[Index, Index, Bytes, Index], float]:
    """The edits of some points in the order of the text: start and end of each, and all new bytes with the
    length of each; and the largest rounding error, in mm."""
    order = np.argsort(part.start, axis=None, kind="stable")
    start, end = (column.ravel()[order].astype(np.int64) for column in (part.start, part.end))
    old = part.value.ravel()[order]
    new = (part.value + added_mm / part.unit_mm[:, None]).ravel()[order]
    numbers = rewritten(text, start, end, old, new, decimals, part.decimal)
    rounding = np.abs(numbers.value - new) * np.repeat(part.unit_mm, 3)[order]
    changed = numbers.value != old
    flat, length = kept(numbers.text, numbers.length, changed)
    start, end = start[changed], end[changed]
    # the columns of a text that goes on in the next line are not kept
    size = np.where(numbers.continued[changed], end - start, length)
    start, end, before, after = placing.places(start, end, size)
    return (start, end, *padded(flat, length, before, after)), float(rounding.max(initial=0.0))


def _line_end(data: bytes, position: int) -> int:
    """Behind the end of the line of a byte; edits of other lines do not begin before it."""
    stop = data.find(b"\n", position) + 1 or len(data)
    return data.find(b"\r", position, stop) + 1 or stop
