"""Commands to decimal words: which digits are written, which omitted words have to be inserted.

One axis at a time, over consecutive rows. In G90 a written word is the command rounded to its own digits,
and an omitted one is inserted only when the rounded command changes. In G91 words are differences of
rounded positions on one grid, so that nothing drifts.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask
from olp.core.values import dataclass

#: one value for all rows, or (n,) of each
_Value = TypeVar("_Value", "Array | float", "Places", Index)
#: decimals of words: of all rows, or (n,) of each
Places = int | npt.NDArray[np.int8]

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
    unit: Array | float

    def part(self, rows: slice | Index) -> AxisRows:
        """Some of the rows."""
        return AxisRows(
            self.command[rows], self.nominal[rows], self.given[rows], self.raw[rows], self.reset[rows],
            self.word[rows], self.decimals[rows], part_of(self.offset, rows), part_of(self.unit, rows),
        )  # fmt: skip


def part_of(value: _Value, rows: slice | Index) -> _Value:
    """The values of some rows, or the one of all rows."""
    return value[rows] if isinstance(value, np.ndarray) else value


@dataclass(frozen=True, slots=True, eq=False)
class Digits:
    """`emitted` (n,) positions as written, mm; `mantissa`, `decimals` of words; `write`: the word changes or
    is new."""

    emitted: Array
    mantissa: Index
    decimals: npt.NDArray[np.int8]
    write: Mask

    def part(self, rows: Index) -> Digits:
        """Those of some rows."""
        return Digits(self.emitted[rows], self.mantissa[rows], self.decimals[rows], self.write[rows])


@dataclass(frozen=True, slots=True, eq=False)
class Starts:
    """Where stretches of `count` rows begin: (k,) `first` row of each, and (n,) `begin` of that of each row,
    0 where there is one stretch."""

    first: Index
    count: int
    begin: Index | int

    @staticmethod
    def of(first: Index, count: int) -> Starts:
        begin = np.repeat(first, np.diff(first, append=count)) if len(first) > 1 else 0
        return Starts(first, count, begin)

    @staticmethod
    def one(count: int) -> Starts:
        return Starts.of(np.zeros(min(count, 1), np.int64), count)

    def spread(self, values: _Value) -> _Value:
        """(n,) per row from (k,) per stretch; one value is that of all."""
        if not isinstance(values, np.ndarray):
            return values
        return np.repeat(values, np.diff(self.first, append=self.count))

    def last(self, which: Mask) -> Index:
        """(n,) the last row of `which` up to each row in its own stretch; less than its first one, where
        there is none."""
        rows = np.where(which, np.arange(self.count), -1)
        # nothing is found beyond the begin of the stretch
        rows[self.first] = np.maximum(rows[self.first], self.first - 1)
        return np.asarray(np.maximum.accumulate(rows), np.int64)

    def has(self, last: Index) -> Mask:
        """(n,) whether `last` found a row."""
        return np.asarray(last >= self.begin, np.bool_)

    def previous(self, values: Array, before: Array | float) -> Array:
        """(n,) the value one row before, `before` a stretch begins."""
        shifted = np.concatenate((values[:1], values[:-1]))
        shifted[self.first] = before
        return shifted


@dataclass(frozen=True, slots=True, eq=False)
class Absolute:
    """G90, as far as it does not depend on where the axis was: (n,) what would be written at each row. Some
    rows state a position, others are `fixed` by a changed word, or are `free` to hold or to move on. `source`
    is the last row up to each that `sets` a position. `half` is half a digit."""

    starts: Starts
    decimals: npt.NDArray[np.int64]
    scale: Array
    mantissa: Index
    written: Array
    stated: Array
    fixed: Mask
    sets: Mask
    source: Index
    free: Mask
    half: Array

    @staticmethod
    def of(rows: AxisRows, starts: Starts, least: Places, usual: Places) -> Absolute:
        decimals = np.where(rows.given, np.maximum(rows.decimals, least), usual)
        # mostly all words have the same number of digits, which is cheap
        same_all = starts.count > 0 and bool((decimals == decimals[0]).all())
        scale = POW10[decimals[:1]] if same_all else POW10[decimals]
        with np.errstate(invalid="ignore"):
            wanted = np.rint((rows.command - rows.offset) / rows.unit * scale)
            unknown = np.isnan(wanted)
            written = wanted / scale * rows.unit + rows.offset
            if unknown.any():
                wanted[unknown] = 0.0
            mantissa = wanted.astype(np.int64)
        fixed = rows.given & ~rows.raw
        sets = rows.given | rows.reset
        return Absolute(
            starts, decimals, np.asarray(scale, float), mantissa, np.asarray(written, float),
            np.where(fixed, written, rows.nominal), fixed, sets, starts.last(sets),
            ~sets & ~rows.raw & ~unknown,
            np.asarray(0.5 * rows.unit / scale * _SLACK, float),
        )  # fmt: skip

    def follow(self, rows: AxisRows, before: Array | float) -> tuple[Array, Mask]:
        """(n,) positions as written, and where an omitted axis moves. It holds until its rounded command
        changes; `before` is where it is as a stretch begins."""
        source, entry = self.source, self.starts.spread(before)
        anchor = np.where(self.starts.has(source), self.stated[source], entry)
        with np.errstate(invalid="ignore"):
            leaves = self.free & (np.abs(rows.command - anchor) > self.half)
        moves = self.free & (self.starts.last(leaves) > source)
        emitted = np.where(moves, self.written, self.stated)
        last = self.starts.last(self.sets | moves)
        return np.where(self.starts.has(last), emitted[last], entry), moves

    def digits(self, rows: AxisRows, before: Array | float) -> Digits:
        """What is written from `before` on."""
        emitted, moves = self.follow(rows, before)
        decimals, mantissa = self.decimals, self.mantissa
        with np.errstate(invalid="ignore"):
            insert = moves & ~(np.abs(emitted - self.starts.previous(emitted, before)) < 1e-9)
        more = decimals - np.minimum(rows.decimals, decimals)
        same = (rows.word * INT10[more] if more.any() else rows.word) == mantissa
        if len(decimals) and int(decimals.max()) > _EXACT:
            same |= np.abs(mantissa - rows.word * INT10[more]) <= NO_CHANGE * self.scale
        return Digits(emitted, mantissa, decimals.astype(np.int8), (self.fixed & ~same) | insert)


def absolute(rows: AxisRows, before: float, least: Places, usual: Places) -> Digits:
    """G90: `before` is the position as written on entry, `least` the fewest decimals, `usual` those of an
    inserted word."""
    return Absolute.of(rows, Starts.one(len(rows.command)), least, usual).digits(rows, before)


def incremental(rows: AxisRows, before: Array | float, grid: Places, starts: Starts | None = None) -> Digits:
    """G91: words are differences of positions rounded to `grid` decimals from `before` on, in each of the
    stretches."""
    starts = starts or Starts.one(len(rows.command))
    unit, entry = rows.unit, starts.spread(before)
    with np.errstate(invalid="ignore"):
        place = np.rint((rows.command - entry) / unit * POW10[grid])
    known = ~np.isnan(place) & ~rows.raw
    own = rows.word * INT10[np.maximum(grid - rows.decimals, 0)]
    if not known.all():
        assert isinstance(before, float) and isinstance(unit, float) and isinstance(grid, int)
        return _incremental_raw(rows, before, unit, grid, own, known)
    steps = place.astype(np.int64)
    mantissa = steps.copy()
    mantissa[1:] -= steps[:-1]
    mantissa[starts.first] = steps[starts.first]
    write = np.where(rows.given, mantissa != own, mantissa != 0)
    fine = rows.decimals > grid
    if fine.any():
        step = (rows.command - starts.previous(rows.command, before)) / unit
        write = np.where(
            fine & rows.given, np.abs(step - rows.word / POW10[rows.decimals]) > NO_CHANGE, write
        )
    decimals = np.broadcast_to(np.asarray(grid, np.int8), len(steps))
    return Digits(np.asarray(entry + steps / POW10[grid] * unit), mantissa, decimals, write)


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
