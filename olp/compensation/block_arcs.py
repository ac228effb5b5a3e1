"""Arcs of programs of blocks: centre, radius and turn words, and blocks for the later parts of arcs."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from olp.compensation.arc_centres import ArcRows, solve
from olp.compensation.digits import INT10
from olp.compensation.rows import Rows
from olp.compensation.writer import Writer
from olp.core.arrays import Array, Index, Mask, distinct
from olp.core.geometry import PLANES, arms
from olp.core.toolpath import Flag
from olp.program.text.edits import BARE, Edits

#: (3, 3) axes of each plane: first, second, third.
_AXES = np.array(PLANES)
#: share of the tolerance by which an R word may put a centre off
_OFF_SHARE = 0.1


def arc_edits(writer: Writer, rows: Rows) -> list[Edits]:
    """Edits of I, J, K, R and P for the arc rows of a chunk, and whole blocks for their later parts."""
    if not rows.arc.any():
        return []
    arcs = solve(writer, rows)
    stated = np.searchsorted(writer.path.arcs.move, arcs.move)
    slots = writer.program.arc_slots.word[stated]
    absolute = writer.program.arc_slots.absolute[stated]
    head, radius = rows.head[arcs.row], slots[:, 3] >= 0
    following = np.minimum(arcs.row + 1, len(rows.move) - 1)
    split = (following > arcs.row) & (rows.move[following] == arcs.move)
    turned = head & split & (slots[:, 4] >= 0)
    by_centre, by_radius = head & ~radius, head & radius
    return [
        _turn_words(writer, arcs.pick(turned), slots[turned, 4]),
        *_centre_words(writer, arcs.pick(by_centre), slots[by_centre], absolute[by_centre]),
        *_radius_words(writer, arcs.pick(by_radius), slots[by_radius, 3]),
        *_tails(writer, rows, arcs.pick(~head), absolute[~head]),
    ]


def _turns(arcs: ArcRows) -> Index:
    """(m,) the P words that arcs of these sweeps need."""
    return np.floor_divide(np.abs(arcs.sweep) - 1e-6, 2 * np.pi).astype(np.int64) + 1


def _turn_words(writer: Writer, arcs: ArcRows, slot: npt.NDArray[np.int32]) -> Edits:
    """P words of arcs of which only a part stays in the block."""
    return Edits.of(writer.words.number[slot], writer.words.end[slot], _turns(arcs) - _first(writer), 0)


def _first(writer: Writer) -> int:
    """What the word of turns does not count: the first part, where it counts those beyond."""
    return int(bool(writer.program.rs274.further_turns))


def _opening(writer: Writer) -> bytes:
    """What opens an absolute coordinate of a centre, behind its letter."""
    call = writer.program.rs274.absolute_centre
    return b"=" + call + b"(" if call else b""


def _closing(writer: Writer, place: npt.NDArray[np.integer], order: npt.NDArray[np.integer]) -> Edits:
    """What closes absolute coordinates of centres that were put at these places."""
    count = len(place) if _opening(writer) else 0
    at, closes = place[:count], writer.prefixes(b")")
    return Edits.of(at, at, np.full(count, BARE), 0, closes, order[:count])


def _units(writer: Writer, arcs: ArcRows) -> Array:
    """(m,) mm of a program unit."""
    return np.asarray(writer.frame_unit_mm[writer.path.frame[arcs.move]])


def _digits(writer: Writer, which: str, axis: int, unit: Array) -> Index:
    """(m,) digits that the style has for words of an axis in these units: "centre" or "usual" ones."""
    units, index = np.unique(unit, return_inverse=True)
    return np.array([getattr(writer.style, which)(axis, u) for u in units.tolist()], np.int64)[index]


def _centres(
    writer: Writer, arcs: ArcRows, axis: int, absolute: Mask, own: Index | int
) -> tuple[Index, Index]:
    """(m,) mantissa and decimals of centre words of an axis, with at least `own` digits."""
    unit = _units(writer, arcs)
    frame = writer.path.frame[arcs.move]
    base = np.where(absolute[:, None], writer.frame_offset_mm[frame], arcs.start)
    away = arcs.centre - base
    if writer.turns is not None:
        away = writer.turns.words(away, writer.turns.of_frame[frame])
    decimals = np.maximum(_digits(writer, "centre", axis, unit), own)
    mantissa = np.rint(away[:, axis] / unit * INT10[decimals]).astype(np.int64)
    return mantissa, decimals


def _by_axis(arcs: ArcRows, k: int) -> Iterator[tuple[int, Index]]:
    """Each axis that is the first (0) or second (1) one of the planes of some arcs, and these."""
    for axis in range(3):
        mine = np.flatnonzero(_AXES[arcs.plane][:, k] == axis)
        if mine.size:
            yield axis, mine


def _centre_words(
    writer: Writer, arcs: ArcRows, slots: npt.NDArray[np.int32], absolute: Mask
) -> Iterator[Edits]:
    """Centre words of arcs that keep their own blocks: replaced, or inserted where omitted."""
    words, style = writer.words, writer.style
    present = slots[:, :3].max(axis=1, initial=-1)
    last = words.first_word[arcs.line] - 1
    anchor = np.where(present >= 0, present, last)
    for k in (0, 1):
        for axis, mine in _by_axis(arcs, k):
            part, slot = arcs.pick(mine), slots[mine, axis]
            given, unit = slot >= 0, _units(writer, part)
            own = np.where(given, style.decimals(slot, axis, unit), 0)
            mantissa, decimals = _centres(writer, part, axis, absolute[mine], own)
            stated = words.mantissa[slot] * INT10[decimals - own]
            changed = np.flatnonzero(given & (mantissa != stated))
            yield Edits.of(
                words.number[slot[changed]], words.end[slot[changed]], mantissa[changed], decimals[changed]
            )
            usual = _digits(writer, "usual", axis, unit)
            new = np.flatnonzero(~given & (np.abs(mantissa) > INT10[decimals - usual] // 2))
            at, inside = anchor[mine[new]], absolute[mine[new]]
            place, letter = words.end[at], b"IJK"[axis : axis + 1]
            prefix = np.where(
                inside, _prefixes(writer, at, letter + _opening(writer)), _prefixes(writer, at, letter)
            )
            yield Edits.of(place, place, mantissa[new], decimals[new], prefix, 5 + axis)
            yield _closing(writer, place[inside], np.full(int(inside.sum()), 5 + axis))
            writer.tally.changed_words += len(changed)
            writer.tally.inserted_words += len(new)


def _prefixes(
    writer: Writer, anchor: npt.NDArray[np.int32], letter: bytes, *, spaced: bool = True
) -> npt.NDArray[np.int32]:
    """(m,) prefixes of words with a letter, in the case of the words `anchor`, and `spaced` as these."""
    style = writer.style.separators(anchor, writer.program)
    prefix = np.zeros(len(anchor), np.int32)
    for which in distinct(style).tolist():
        text = writer.style.separator(which, letter)
        prefix[style == which] = writer.prefixes(text if spaced else text[-1:])
    return prefix


def _radius_words(writer: Writer, arcs: ArcRows, slot: npt.NDArray[np.int32]) -> Iterator[Edits]:
    """R of corrected arcs; where R is too coarse (near half circles), I, J, K in its place."""
    words = writer.words
    no = np.zeros(len(slot), bool)
    for first, mine in _by_axis(arcs, 0):
        part, own_slot = arcs.pick(mine), slot[mine]
        second = (first + 1) % 3
        unit = _units(writer, part)
        own = writer.style.decimals(own_slot, first, unit)
        decimals = np.maximum(own, _digits(writer, "centre", first, unit))
        size = np.asarray(unit * writer.sizes(part.move, part.plane), float)
        mantissa, good = radii(writer, part, decimals, size)
        new = np.flatnonzero(good & (mantissa != words.mantissa[own_slot] * INT10[decimals - own]))
        at = own_slot[new]
        yield Edits.of(words.number[at], words.end[at], mantissa[new], decimals[new])
        coarse = np.flatnonzero(~good)
        part, at = part.pick(coarse), own_slot[coarse]
        writer.tally.changed_words += len(new) + len(coarse)
        begin, end = words.start[at], words.end[at]
        value, digits = _centres(writer, part, first, no[mine[coarse]], 0)
        letter = _prefixes(writer, at, b"IJK"[first : first + 1], spaced=False)
        yield Edits.of(begin, end, value, digits, letter, 0)
        value, digits = _centres(writer, part, second, no[mine[coarse]], 0)
        yield Edits.of(end, end, value, digits, _prefixes(writer, at, b"IJK"[second : second + 1]), 1)


def radii(writer: Writer, arcs: ArcRows, decimals: Index, unit: Array) -> tuple[Index, Mask]:
    """(m,) mantissa of the R words of arcs, and whether R as written puts the centre where it should be."""
    scale = INT10[decimals]
    to_start = np.hypot(*arms(arcs.start, arcs.centre, arcs.plane))
    dx, dy = arms(arcs.end, arcs.start, arcs.plane)
    half = np.hypot(dx, dy) / 2
    sign = np.where(np.abs(arcs.sweep) > np.pi, -1, 1)
    mantissa = sign * np.rint(to_start / unit * scale).astype(np.int64)
    size = np.abs(mantissa) / scale * unit
    with np.errstate(divide="ignore", invalid="ignore"):
        height = np.sqrt(np.maximum(size * size - half * half, 0.0)) / (2 * half)
        lean = np.where((arcs.sweep > 0) == (sign > 0), height, -height)
        x, y = arms(arcs.start, arcs.centre, arcs.plane)
        off = np.hypot(x + dx / 2 - lean * dy, y + dy / 2 + lean * dx)
    allowed = 0.5 / scale * unit + _OFF_SHARE * writer.tolerance_mm
    return mantissa, np.asarray((size > half) & (off < allowed))


def _tails(writer: Writer, rows: Rows, arcs: ArcRows, absolute: Mask) -> Iterator[Edits]:
    """Later parts: new blocks with both end words, the third axis where it moves, and the centre."""
    if not len(arcs.row):
        return
    row, place = arcs.row, writer.program.line_end[arcs.line - 1]
    order = row * 8 + 16
    lead, third = _leads(writer, rows, arcs), _AXES[arcs.plane, 2]
    begun = np.zeros(len(row), bool)
    for axis in range(3):
        mine = np.flatnonzero((third != axis) | rows.write[row, axis])
        mantissa, decimals = _numbers(writer, rows, row[mine], axis)
        letter = b"XYZ"[axis : axis + 1]
        prefix = np.full(len(mine), writer.prefixes(b" " + letter), np.int32)
        opens = ~begun[mine]
        for which in distinct(lead[mine[opens]]).tolist():
            text = writer.prefixes.table[which] + letter
            prefix[opens & (lead[mine] == which)] = writer.prefixes(text)
        begun[mine] = True
        yield Edits.of(place[mine], place[mine], mantissa, decimals, prefix, order[mine] + axis)
    for k in (0, 1):
        for axis, mine in _by_axis(arcs, k):
            mantissa, decimals = _centres(writer, arcs.pick(mine), axis, absolute[mine], 0)
            letter, inside = b" " + b"IJK"[axis : axis + 1], absolute[mine]
            opened = writer.prefixes(letter + _opening(writer))
            prefix = np.where(inside, opened, writer.prefixes(letter))
            yield Edits.of(place[mine], place[mine], mantissa, decimals, prefix, order[mine] + 3 + k)
            yield _closing(writer, place[mine[inside]], order[mine[inside]] + 3 + k)
    turns = _turns(arcs)
    some = np.flatnonzero(turns > 1)
    word = writer.prefixes(b" " + (writer.program.rs274.further_turns or b"P"))
    number = turns[some] - _first(writer)
    yield Edits.of(place[some], place[some], number, 0, word, order[some] + 5)


def _leads(writer: Writer, rows: Rows, arcs: ArcRows) -> npt.NDArray[np.int32]:
    """(m,) prefixes before the first letter of each new block: line end, `/` and the code of the arc behind a
    step that takes up backlash, and where no code holds from line to line."""
    starts, of = writer.style.block_starts(arcs.line)
    table = np.array([[writer.prefixes(s + code) for code in (b"", b"G2 ", b"G3 ")] for s in starts])
    taken_up = (arcs.row > 0) & rows.take_up[np.maximum(arcs.row - 1, 0)]
    taken_up |= writer.program.rs274.commands is not None
    code = np.where(writer.clockwise(arcs.move, arcs.plane), 1, 2)
    return table[of, np.where(taken_up, code, 0)].astype(np.int32)


def _numbers(writer: Writer, rows: Rows, row: Index, axis: int) -> tuple[Index, Index]:
    """(m,) mantissa and decimals of the positions of an axis after rows, whether or not it changes."""
    frame = writer.path.frame[rows.move[row]]
    unit = writer.frame_unit_mm[frame]
    usual = _digits(writer, "usual", axis, unit)
    away = rows.emitted[row] - writer.frame_offset_mm[frame]
    if writer.turns is not None:
        away = writer.turns.words(away, writer.turns.of_frame[frame])
    value = away[:, axis] / unit
    stated = rows.write[row, axis] | ((rows.flag[row] & np.uint8(Flag.INCREMENTAL)) != 0)
    mantissa = np.where(stated, rows.mantissa[row, axis], np.rint(value * INT10[usual]).astype(np.int64))
    return mantissa, np.where(stated, rows.decimals[row, axis], usual)
