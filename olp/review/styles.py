"""How the numbers of a column are written: their decimals, and zeros before and behind them."""

from __future__ import annotations

from dataclasses import astuple

import numpy as np
import numpy.typing as npt

from olp.core.values import dataclass

Whole = npt.NDArray[np.int64]
Small = npt.NDArray[np.int32]
Byte = npt.NDArray[np.uint8]
Mask = npt.NDArray[np.bool_]

#: A value has fewer digits than this.
DIGITS_MOST = 13
#: Numbers that are worked on at once, so that temporaries are small.
_BAND = 1 << 16


@dataclass(frozen=True, slots=True)
class Style:
    """The form of numbers of a column: `decimals` digits behind the point, fewer by the zeros at the end with
    `trim`, and at least `least` digits before it. `point` keeps the point also where nothing is behind it."""

    column: int
    decimals: int
    least: int
    trim: bool
    point: bool

    def spec(self) -> list[int]:
        """As the page reads it."""
        return [int(value) for value in astuple(self)]


@dataclass(frozen=True, slots=True, eq=False)
class Written:
    """Of (k,) numbers: `value` in units of the last of `most` decimals, and how each is written: the digits
    before (`whole`) and behind (`decimals`) the point, and the `point` itself."""

    value: Whole
    most: int
    whole: Byte
    decimals: Byte
    point: Mask

    def styles(self, column: int) -> tuple[list[Style], Small]:
        """Styles of a column, the usual one first, and (k,) the style of each number."""
        natural, kept = self._natural(), self._kept()
        # a number that tells how many digits its column has before the point
        telling = (self.whole > natural) | (natural == 0)
        usual = self._usual(column, kept, self.whole[telling])
        odd = np.flatnonzero(~self._as(usual, natural, kept))
        least = np.where(telling[odd], self.whole[odd], 1)
        own = np.column_stack((self.decimals[odd], least, self.point[odd]))
        forms, which = np.unique(own, axis=0, return_inverse=True)
        style = np.zeros(len(self.value), np.int32)
        style[odd] = 1 + which.reshape(-1)
        others = [Style(column, d, least, False, bool(point)) for d, least, point in forms.tolist()]
        return [usual, *others], style

    def _natural(self) -> Byte:
        """(k,) digits before the point without zeros before them."""
        natural = np.empty(len(self.value), np.uint8)
        for a in range(0, len(natural), _BAND):
            before = np.abs(self.value[a : a + _BAND]) // 10**self.most
            natural[a : a + _BAND] = np.searchsorted(10 ** np.arange(DIGITS_MOST), before, "right")
        return natural

    def _kept(self) -> Byte:
        """(k,) decimals without the zeros at the end."""
        kept = np.full(len(self.value), self.most, np.uint8)
        for a in range(0, len(kept), _BAND):
            some = self.value[a : a + _BAND]
            rows = np.arange(len(some))
            for k in range(1, self.most + 1):
                rows = rows[some[rows] % 10**k == 0]
                kept[a + rows] = self.most - k
        return kept

    def _usual(self, column: int, kept: Byte, telling: Byte) -> Style:
        """The style of most of the numbers; `telling` are digits before the point."""
        trim = int((self.decimals == kept).sum()) > int((self.decimals == self.most).sum())
        bare = self.decimals == 0
        point = bool(bare.any() and 2 * self.point[bare].sum() > bare.sum())
        least = int(np.bincount(telling).argmax()) if telling.size else 1
        return Style(column, self.most, least, trim, point)

    def _as(self, style: Style, natural: Byte, kept: Byte) -> Mask:
        """(k,) whether a number is written in a style."""
        decimals = kept if style.trim else np.full(len(self.value), style.decimals, np.uint8)
        whole = np.maximum(natural, style.least)
        # a number has a digit
        whole[(whole == 0) & (decimals == 0)] = 1
        point = (decimals > 0) | style.point
        return np.asarray((self.decimals == decimals) & (self.whole == whole) & (self.point == point))
