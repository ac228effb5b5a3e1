"""Bulk reading of motion blocks: words of many lines to axis positions, arcs and slots at once.

`Blocks` are the motion lines of one chunk. `fill` turns a stretch of them that has only modal motion
into positions. An omitted axis keeps its position: that is a forward fill.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask
from olp.core.errors import ProgramError
from olp.core.geometry import PLANES
from olp.program.rs274.lexer import WordChunk

#: Powers of ten by their exponent: those of the decimals of a number.
_POW10 = 10.0 ** np.arange(19)
_AXIS_OF = np.full(256, -1, np.int8)
for _i, _letter in enumerate(b"XYZ"):
    _AXIS_OF[_letter] = _i
#: A B C U V W (and E of printers): axes whose words stay unchanged
_OTHER = np.zeros(256, bool)
_OTHER[list(b"ABCUVWE")] = True
_ARC_OF = np.full(256, -1, np.int8)
for _i, _letter in enumerate(b"IJKRP"):
    _ARC_OF[_letter] = _i

#: Largest mismatch of an arc's two radii that LinuxCNC accepts; it refuses an arc above both bounds.
SPIRAL_ABSOLUTE_MM = 0.0283
#: The same as a share of the radius.
SPIRAL_RELATIVE = 0.001
#: of an arc; a double has 2e-9 mm at this distance, so its path is good to a hundredth of a micrometre
LARGEST_RADIUS_MM = 1e7
#: turns of one arc, at most
MOST_TURNS = 10_000


def values(chunk: WordChunk) -> Array:
    """Numbers as written; correctly rounded, since mantissa and power of ten are exact."""
    return np.asarray(chunk.mantissa / _POW10[chunk.decimals], float)


def modal(chunk_lines: int, lines: Index, codes: Index, before: int) -> npt.NDArray[np.int16]:
    """Per line the code in force, `before` until the first of `codes`, which take effect on their own
    line."""
    if not len(lines):
        return np.full(chunk_lines, before, np.int16)
    spans = np.diff(np.concatenate(([0], lines, [chunk_lines])))
    return np.repeat(np.concatenate(([before], codes)).astype(np.int16), spans)


@dataclass(slots=True, eq=False)
class Blocks:
    """Motion lines of a chunk: (n,) `line` in the chunk, (n, 3) `slot`, index of the X, Y, Z word or -1, and
    `other`, whether another axis moves too. `arc_row` are the rows of arcs, and `arc_slot` (m, 5) the indices
    of their I, J, K, R, P words or -1."""

    line: Index
    slot: Index
    other: Mask
    arc_row: Index
    arc_slot: Index

    def __len__(self) -> int:
        return len(self.line)


def gather(chunk: WordChunk, motion: npt.NDArray[np.int16], consumed: Mask) -> Blocks:
    """Find the motion lines: those with an axis word that no other word of the line claims."""
    lines = len(chunk.line_start)
    axis = _AXIS_OF[chunk.letter]
    words = np.flatnonzero(axis >= 0)
    moving = np.zeros(lines, bool)
    moving[chunk.line[words]] = True
    other = np.zeros(lines, bool)
    others = np.flatnonzero(_OTHER[chunk.letter])
    if others.size:
        other[chunk.line[others]] = True
        moving |= other
    in_arc = (motion == 20) | (motion == 30)
    centre_words = np.zeros(0, np.int64)
    if in_arc.any():
        centre_words = np.flatnonzero(_ARC_OF[chunk.letter] >= 0)
        centre_words = centre_words[(in_arc & ~consumed)[chunk.line[centre_words]]]
        moving[chunk.line[centre_words[_ARC_OF[chunk.letter[centre_words]] < 3]]] = True
    if consumed.any():
        moving &= ~consumed
        words = words[moving[chunk.line[words]]]
    rows = np.flatnonzero(moving)
    row_of = np.full(lines, -1, np.int64)
    row_of[rows] = np.arange(len(rows))
    slot = _slots(chunk, words, row_of, axis, 3, b"XYZ", rows)
    arc_row = np.flatnonzero(in_arc[rows])
    arc_of = np.full(lines, -1, np.int64)
    arc_of[rows[arc_row]] = np.arange(len(arc_row))
    centre_words = centre_words[arc_of[chunk.line[centre_words]] >= 0]
    arc_slot = _slots(chunk, centre_words, arc_of, _ARC_OF[chunk.letter], 5, b"IJKRP", rows[arc_row])
    return Blocks(rows, slot, other[rows], arc_row, arc_slot)


def _slots(
    chunk: WordChunk,
    words: Index,
    row_of: Index,
    column: npt.NDArray[np.int8],
    width: int,
    names: bytes,
    rows: Index,
) -> Index:
    """(rows, width) table of word indices; a letter that is twice in one block is refused."""
    slot = np.full((len(rows), width), -1, np.int64)
    flat = row_of[chunk.line[words]] * width + column[words]
    slot.reshape(-1)[flat] = words
    if np.count_nonzero(slot >= 0) != len(words):
        raise ProgramError.together(
            ProgramError(
                f"the word {chr(names[twice % width])} is twice in this block; expected it once",
                line=int(rows[twice // width]) + chunk.first_line + 1,
                code="OLP515",
            )
            for twice in np.flatnonzero(np.bincount(flat, minlength=slot.size) > 1).tolist()
        )
    return slot


def fill(
    slot: Index,
    value: Array,
    incremental: Mask | None,
    offset: Array,
    unit: float,
    start: list[float],
) -> Array:
    """(n, 3) axis positions of consecutive blocks from `start`; offsets (3,) or (n, 3)."""
    count = len(slot)
    end = np.empty((count, 3))
    order = np.arange(count)
    for a in range(3):
        words = slot[:, a]
        given = words >= 0
        shift = offset[a] if offset.ndim == 1 else offset[:, a]
        column = value[words] * unit
        if incremental is None:
            column += shift
            if not given.all():
                source = np.maximum.accumulate(np.where(given, order, -1))
                column = column[source]
                column[: int(np.searchsorted(source, 0))] = start[a]
        else:
            anchor = given & ~incremental
            steps = np.where(given & incremental, column, 0.0)
            source = np.maximum.accumulate(np.where(anchor, order, -1))
            total = np.cumsum(steps)
            first = int(np.searchsorted(source, 0))
            column = (column + shift)[source] + (total - total[source])
            column[:first] = start[a] + total[:first]
        end[:, a] = column
    return end


def arc_geometry(
    start: Array,
    end: Array,
    words: Array,
    *,
    clockwise: Mask,
    plane: Index,
    absolute: Mask,
    offset: Array,
    line: Index,
) -> tuple[Array, Array]:
    """Centres (m, 3), with the start's third coordinate, and signed sweeps (m,), whole turns included.

    `words` (m, 5) are I, J, K, R in mm and P, NaN where absent. RS-274: IJK from the start (or absolute in
    G90.1), R > 0 the shorter arc, P whole turns. Raises ProgramError for arcs that the control would refuse.
    """
    rows = np.arange(len(start))
    axes = np.array(PLANES)[plane]
    first, second = axes[:, 0], axes[:, 1]

    def refuse(bad: Mask, message: str, code: str = "OLP530") -> None:
        if bad.any():
            raise ProgramError.together(
                ProgramError(
                    message.format(r0=r0[i], r1=r1[i], chord=2 * half[i]), line=int(line[i]), code=code
                )
                for i in np.flatnonzero(bad).tolist()
            )

    r0 = r1 = half = np.zeros(len(start))
    refuse(
        ~np.asarray(np.isfinite(start).all(axis=1) & np.isfinite(end).all(axis=1)),
        "an arc starts or ends where an axis has not been commanded yet; "
        "command X, Y and Z first, or give start_mm in the job file",
        "OLP524",
    )
    s0, s1, e0, e1 = start[rows, first], start[rows, second], end[rows, first], end[rows, second]
    c0, c1, radius, turns = words[rows, first], words[rows, second], words[:, 3], words[:, 4]
    by_radius = ~np.isnan(radius)
    refuse(
        ~by_radius & np.isnan(c0) & np.isnan(c1),
        "an arc has neither centre words of its plane nor a radius; expected I, J, K or R",
        "OLP516",
    )
    refuse(
        ~by_radius & absolute & (np.isnan(c0) | np.isnan(c1)),
        "in G90.1 an arc needs both centre words of its plane",
        "OLP516",
    )
    turns = np.where(np.isnan(turns), 1.0, turns)
    refuse(
        (turns != np.rint(turns)) | (turns < 1),
        "P of an arc is its number of turns; expected an integer from 1",
        "OLP516",
    )
    refuse(turns > MOST_TURNS, f"P of an arc is its number of turns; expected at most {MOST_TURNS}")
    base0, base1 = (np.where(absolute, offset[rows, f], s) for f, s in ((first, s0), (second, s1)))
    centre0, centre1 = np.nan_to_num(c0) + base0, np.nan_to_num(c1) + base1
    if by_radius.any():
        dx, dy, half = e0 - s0, e1 - s1, np.hypot(e0 - s0, e1 - s1) / 2
        refuse(
            by_radius & (half == 0),
            "an arc with R ends where it starts, so its centre is not known; use I, J, K",
        )
        size = np.abs(radius)
        refuse(
            by_radius & (half > size + SPIRAL_ABSOLUTE_MM / 2) & (half > size * (1 + SPIRAL_RELATIVE / 2)),
            "the radius of an arc is too small to reach its end, {chord:.4f} mm away",
        )
        height = np.sqrt(np.maximum(size * size - half * half, 0.0))
        # left of the chord where the arc is short and counter-clockwise, or long and clockwise
        lean = np.where(clockwise == (radius < 0), 1.0, -1.0) * height / np.where(half > 0, 2 * half, 1.0)
        centre0 = np.where(by_radius, s0 + dx / 2 - lean * dy, centre0)
        centre1 = np.where(by_radius, s1 + dy / 2 + lean * dx, centre1)
    r0, r1 = np.hypot(s0 - centre0, s1 - centre1), np.hypot(e0 - centre0, e1 - centre1)
    refuse((r0 < 1e-9) | (r1 < 1e-9), "an arc has zero radius")
    refuse(
        np.maximum(r0, r1) > LARGEST_RADIUS_MM,
        "the radius of an arc is {r0:.4g} mm; expected at most "
        f"{LARGEST_RADIUS_MM:g} mm, as its centre has too few digits; write a straight move",
    )
    refuse(
        np.abs(r0 - r1) > np.maximum(SPIRAL_ABSOLUTE_MM, SPIRAL_RELATIVE * r1),
        "the radius of an arc is {r0:.4f} mm at its start and {r1:.4f} mm at its end; "
        "a control does not accept this difference",
    )
    sweep = np.arctan2(e1 - centre1, e0 - centre0) - np.arctan2(s1 - centre1, s0 - centre0)
    sweep = np.where(clockwise, -sweep, sweep) % (2 * np.pi)
    sweep = np.where((sweep < 1e-9) | (2 * np.pi - sweep < 1e-12), 2 * np.pi, sweep)
    sweep += 2 * np.pi * (turns - 1)
    centre = start.copy()
    centre[rows, first], centre[rows, second] = centre0, centre1
    return centre, np.where(clockwise, -sweep, sweep)
