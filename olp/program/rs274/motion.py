"""Bulk reading of motion blocks: words of many lines to axis positions, arcs and slots at once.

`Blocks` are the motion lines of one chunk. `fill` turns a stretch of them that has only modal motion
into positions. An omitted axis keeps its position: that is a forward fill.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask, all_in_row, is_in
from olp.core.errors import ProgramError
from olp.core.geometry import PLANES
from olp.core.values import dataclass
from olp.program.rs274.lexer import WordChunk
from olp.program.rs274.state import KNOWN_BY

#: Powers of ten by their exponent: those of the decimals of a number.
_POW10 = 10.0 ** np.arange(19)
_AXIS_OF = np.full(256, -1, np.int8)
for _i, _letter in enumerate(b"XYZ"):
    _AXIS_OF[_letter] = _i
#: A B C U V W, and E: axes whose words stay unchanged.
OTHER = b"ABCUVWE"
#: Components of the direction of the tool, in straight moves with tool centre point control.
DIRECTION = b"IJK"
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


def gather(
    chunk: WordChunk, motion: npt.NDArray[np.int16], consumed: Mask, other_axes: bytes = OTHER, *,
    directed: bool = False,
) -> Blocks:  # fmt: skip
    """Find the motion lines: those with an axis word, or one of `other_axes`, that no other word of the line
    claims. With `directed`, a straight move may have the direction of the tool alone."""
    lines = len(chunk.line_start)
    axis = _AXIS_OF[chunk.letter]
    words = np.flatnonzero(axis >= 0)
    moving = np.zeros(lines, bool)
    moving[chunk.line[words]] = True
    other = np.zeros(lines, bool)
    is_other = np.zeros(256, bool)
    is_other[list(other_axes)] = True
    others = np.flatnonzero(is_other[chunk.letter])
    if others.size:
        other[chunk.line[others]] = True
        moving |= other
    if directed:
        turns = np.flatnonzero(is_in(chunk.letter, list(DIRECTION)))
        turns = turns[is_in(motion[chunk.line[turns]], (0, 10))]
        moving[chunk.line[turns]] = True
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
    unit: Array | float,
    start: list[float],
    lost: Index | None = None,
) -> Array:
    """(n, 3) axis positions of consecutive blocks from `start`; offsets (3,) or (n, 3), units one or (n,). No
    position is known from the blocks `lost` on until it is commanded; any words stand there."""
    known = slot >= 0
    end: Array = value[slot]
    if lost is not None:
        end[lost] = np.nan
    end *= unit if isinstance(unit, float) else unit[:, None]
    if incremental is None and known.all():
        end += offset
        return end
    order = np.arange(len(slot))
    for a in range(3):
        given = known[:, a]
        shift = offset[a] if offset.ndim == 1 else offset[:, a]
        column = end[:, a]
        if incremental is None:
            column = column + shift
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
    _check_stated(start, end, words, plane, absolute, line)
    rows, axes = np.arange(len(start)), np.array(PLANES)[plane]
    first, second = axes[:, 0], axes[:, 1]
    s0, s1, e0, e1 = start[rows, first], start[rows, second], end[rows, first], end[rows, second]
    base0, base1 = (np.where(absolute, offset[rows, f], s) for f, s in ((first, s0), (second, s1)))
    centre0 = np.nan_to_num(words[rows, first]) + base0
    centre1 = np.nan_to_num(words[rows, second]) + base1
    by_radius = np.flatnonzero(~np.isnan(words[:, 3]))
    if by_radius.size:
        ends = (s0[by_radius], s1[by_radius]), (e0[by_radius], e1[by_radius])
        centre0[by_radius], centre1[by_radius] = _centres_of_radii(
            *ends, words[by_radius, 3], clockwise[by_radius], line[by_radius]
        )
    (x0, y0), (x1, y1) = (s0 - centre0, s1 - centre1), (e0 - centre0, e1 - centre1)
    _check_radii(np.hypot(x0, y0), np.hypot(x1, y1), line)
    sweep = np.arctan2(y1, x1) - np.arctan2(y0, x0)
    sweep = np.where(clockwise, -sweep, sweep) % (2 * np.pi)
    sweep = np.where((sweep < 1e-9) | (2 * np.pi - sweep < 1e-12), 2 * np.pi, sweep)
    turns = words[:, 4]
    sweep += 2 * np.pi * np.where(np.isnan(turns), 0.0, turns - 1)
    centre = start.copy()
    centre[rows, first], centre[rows, second] = centre0, centre1
    return centre, np.where(clockwise, -sweep, sweep)


def _refuse(bad: Mask, line: Index, message: str, code: str = "OLP530", **figures: Array) -> None:
    """Refuse the arcs that are `bad`; `figures` (m,) are put into the message."""
    if bad.any():
        raise ProgramError.together(
            ProgramError(
                message.format(**{name: column[i] for name, column in figures.items()}),
                line=int(line[i]),
                code=code,
            )
            for i in np.flatnonzero(bad).tolist()
        )


def _check_stated(start: Array, end: Array, words: Array, plane: Index, absolute: Mask, line: Index) -> None:
    """Refuse arcs without known ends, without the words of a centre or a radius, or with a wrong P."""
    known = all_in_row(np.isfinite(start)) & all_in_row(np.isfinite(end))
    _refuse(
        np.asarray(~known), line,
        f"an arc starts or ends where an axis has not been commanded yet; {KNOWN_BY}",
        "OLP524",
    )  # fmt: skip
    rows, axes = np.arange(len(start)), np.array(PLANES)[plane]
    lacks0, lacks1 = np.isnan(words[rows, axes[:, 0]]), np.isnan(words[rows, axes[:, 1]])
    no_radius, turns = np.isnan(words[:, 3]), words[:, 4]
    _refuse(
        no_radius & lacks0 & lacks1, line,
        "an arc has neither centre words of its plane nor a radius; expected I, J, K or R",
        "OLP516",
    )  # fmt: skip
    _refuse(
        no_radius & absolute & (lacks0 | lacks1), line,
        "in G90.1 an arc needs both centre words of its plane",
        "OLP516",
    )  # fmt: skip
    turned = np.where(np.isnan(turns), 1.0, turns)
    _refuse(
        (turned != np.rint(turned)) | (turned < 1), line,
        "P of an arc is its number of turns; expected an integer from 1",
        "OLP516",
    )  # fmt: skip
    most = f"P of an arc is its number of turns; expected at most {MOST_TURNS}"
    _refuse(turned > MOST_TURNS, line, most)


def _centres_of_radii(
    start: tuple[Array, Array], end: tuple[Array, Array], radius: Array, clockwise: Mask, line: Index
) -> tuple[Array, Array]:
    """(k,) both coordinates of the centres of arcs in their planes that state a `radius`."""
    (s0, s1), (e0, e1) = start, end
    dx, dy = e0 - s0, e1 - s1
    chord, size = np.hypot(dx, dy), np.abs(radius)
    half = chord / 2
    _refuse(half == 0, line, "an arc with R ends where it starts, so its centre is not known; use I, J, K")
    small = (half > size + SPIRAL_ABSOLUTE_MM / 2) & (half > size * (1 + SPIRAL_RELATIVE / 2))
    too_small = "the radius of an arc is too small to reach its end, {chord:.4f} mm away"
    _refuse(small, line, too_small, chord=2 * half)
    height = np.sqrt(np.maximum(size * size - half * half, 0.0))
    # left of the chord where the arc is short and counter-clockwise, or long and clockwise
    lean = np.where(clockwise == (radius < 0), 1.0, -1.0) * height / (2 * half)
    return s0 + dx / 2 - lean * dy, s1 + dy / 2 + lean * dx


def _check_radii(r0: Array, r1: Array, line: Index) -> None:
    """Refuse arcs whose radii `r0` at the start and `r1` at the end no control accepts."""
    _refuse((r0 < 1e-9) | (r1 < 1e-9), line, "an arc has zero radius")
    _refuse(
        np.maximum(r0, r1) > LARGEST_RADIUS_MM, line,
        "the radius of an arc is {r0:.4g} mm; expected at most "
        f"{LARGEST_RADIUS_MM:g} mm, as its centre has too few digits; write a straight move",
        r0=r0,
    )  # fmt: skip
    _refuse(
        np.abs(r0 - r1) > np.maximum(SPIRAL_ABSOLUTE_MM, SPIRAL_RELATIVE * r1), line,
        "the radius of an arc is {r0:.4f} mm at its start and {r1:.4f} mm at its end; "
        "a control does not accept this difference",
        r0=r0, r1=r1,
    )  # fmt: skip
