"""Commands to decimal words: which digits are written, which omitted words have to be inserted.

One axis at a time, over consecutive rows. In G90 a written word is the command rounded to its own digits,
and an omitted one is inserted only when the rounded command changes. In G91 words are differences of
rounded positions on one grid, so that nothing drifts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask

#: powers of ten up to the digits of a mantissa, as doubles
POW10 = 10.0 ** np.arange(19)
#: the same as integers
INT10 = 10 ** np.arange(19, dtype=np.int64)
#: program units: a word that would change by no more stays as it is, whatever its digits
NO_CHANGE = 1e-11
#: up to this many decimals a double tells every digit of a position
_EXACT = 9
#: relative slack when a command is compared with half a digit
_SLACK = 1 + 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class AxisRows:
    """One axis of consecutive rows. `command` (n,) mm, NaN where unknown; `nominal` what the program says;
    `word` the number as written in `decimals` digits (`given` where there is one, `raw` where it is kept).
    `offset` mm and `unit` mm lead from words to positions; `reset` rows make the axis unknown or take
    `nominal` as a position of the machine."""

    command: Array
    nominal: Array
    given: Mask
    raw: Mask
    reset: Mask
    word: Index
    decimals: npt.NDArray[np.int8]
    offset: Array | float
    unit: float

    def part(self, a: int, b: int, unit: float) -> AxisRows:
        """Rows a..b, which have one unit."""
        cut = slice(a, b)
        return AxisRows(
            self.command[cut], self.nominal[cut], self.given[cut], self.raw[cut], self.reset[cut],
            self.word[cut], self.decimals[cut],
            self.offset if isinstance(self.offset, float) else self.offset[cut], unit,
        )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Digits:
    """`emitted` (n,) positions as written, mm; `mantissa`, `decimals` of words; `write`: the word changes or
    is new."""

    emitted: Array
    mantissa: Index
    decimals: npt.NDArray[np.int8]
    write: Mask


def absolute(rows: AxisRows, before: float, least: int, usual: int) -> Digits:
    """G90: `before` is the position as written on entry, `least` the fewest decimals, `usual` those of an
    inserted word."""
    count = len(rows.command)
    order = np.arange(count)
    fix = rows.given & ~rows.raw
    decimals = np.where(rows.given, np.maximum(rows.decimals, least), usual)
    # mostly all words have the same number of digits, which is cheap
    same_all = count > 0 and bool((decimals == decimals[0]).all())
    scale = POW10[decimals[:1]] if same_all else POW10[decimals]
    with np.errstate(invalid="ignore"):
        wanted = np.rint((rows.command - rows.offset) / rows.unit * scale)
        unknown = np.isnan(wanted)
        written = wanted / scale * rows.unit + rows.offset
        if unknown.any():
            wanted[unknown] = 0.0
        mantissa = wanted.astype(np.int64)
    sets = rows.given | rows.reset
    emitted = np.where(fix, written, rows.nominal)
    # an omitted axis holds until its rounded command changes
    source = np.maximum.accumulate(np.where(sets, order, -1))
    anchor = np.where(source >= 0, emitted[source], before)
    free = ~sets & ~rows.raw & ~unknown
    half = 0.5 * rows.unit / scale * _SLACK
    with np.errstate(invalid="ignore"):
        leaves = free & (np.abs(rows.command - anchor) > half)
    started = np.maximum.accumulate(np.where(leaves, order, -1)) > source
    moves = free & started
    emitted = np.where(moves, written, emitted)
    last = np.maximum.accumulate(np.where(sets | moves, order, -1))
    emitted = np.where(last >= 0, emitted[last], before)
    previous = np.concatenate(([before], emitted[:-1]))
    with np.errstate(invalid="ignore"):
        insert = moves & ~(np.abs(emitted - previous) < 1e-9)
    more = decimals - np.minimum(rows.decimals, decimals)
    same = (rows.word * INT10[more] if more.any() else rows.word) == mantissa
    if count and int(decimals.max()) > _EXACT:
        same |= np.abs(mantissa - rows.word * INT10[more]) <= NO_CHANGE * scale
    return Digits(emitted, mantissa, decimals.astype(np.int8), (fix & ~same) | insert)


def incremental(rows: AxisRows, before: float, grid: int) -> Digits:
    """G91: words are differences of positions rounded to `grid` decimals from `before` on."""
    unit = rows.unit
    decimals = np.full(len(rows.command), grid, np.int8)
    own = rows.word * INT10[np.maximum(grid - rows.decimals, 0)]
    fine = rows.decimals > grid
    with np.errstate(invalid="ignore"):
        place = np.rint((rows.command - before) / unit * POW10[grid])
    known = ~np.isnan(place) & ~rows.raw
    if not known.all():
        return _incremental_raw(rows, before, unit, grid, own, known)
    steps = place.astype(np.int64)
    mantissa = np.diff(steps, prepend=0)
    write = np.where(rows.given, mantissa != own, mantissa != 0)
    if fine.any():
        step = np.diff(rows.command, prepend=before) / unit
        write = np.where(
            fine & rows.given, np.abs(step - rows.word / POW10[rows.decimals]) > NO_CHANGE, write
        )
    return Digits(before + steps / POW10[grid] * unit, mantissa, decimals, write)


def _incremental_raw(
    rows: AxisRows, before: float, unit: float, grid: int, own: Index, known: Mask
) -> Digits:
    """The same one by one, where some rows keep their words or have no known position."""
    count = len(rows.command)
    emitted = np.zeros(count)
    mantissa = np.zeros(count, np.int64)
    write = np.zeros(count, bool)
    position, base, steps = before, before, 0
    for i in range(count):
        if known[i] and position == position:
            if base != base:
                base, steps = position, 0
            new = round((rows.command[i] - base) / unit * 10.0**grid)
            mantissa[i] = new - steps
            write[i] = mantissa[i] != own[i] if rows.given[i] else mantissa[i] != 0
            if rows.given[i] and rows.decimals[i] > grid:
                last = rows.command[i - 1] if i and known[i - 1] else position
                step = (rows.command[i] - last) / unit
                write[i] = abs(step - rows.word[i] / 10.0 ** int(rows.decimals[i])) > NO_CHANGE
            steps = new
            position = base + steps / 10.0**grid * unit
        else:
            if rows.reset[i]:
                position = float(rows.nominal[i])
            elif rows.given[i]:
                position += float(rows.word[i]) / 10.0 ** int(rows.decimals[i]) * unit
            base = float("nan")
        emitted[i] = position
    return Digits(emitted, mantissa, np.full(count, grid, np.int8), write)
