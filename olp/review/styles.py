"""How the numbers of a column are written: their decimals, and zeros before and behind them."""

from __future__ import annotations

from dataclasses import astuple

import numpy as np
import numpy.typing as npt

from olp.core.values import dataclass

Whole = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]

#: A value has fewer digits than this.
DIGITS_MOST = 13


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
    whole: Whole
    decimals: Whole
    point: Mask

    def styles(self, column: int) -> tuple[list[Style], Whole]:
        """Styles of a column, the usual one first, and (k,) the style of each number."""
        natural, kept = self._natural(), self._kept()
        # a number that tells how many digits its column has before the point
        telling = (self.whole > natural) | (natural == 0)
        usual = self._usual(column, kept, self.whole[telling])
        odd = np.flatnonzero(~self._as(usual, natural, kept))
        least = np.where(telling[odd], self.whole[odd], 1)
        own = np.column_stack((self.decimals[odd], least, self.point[odd]))
        forms, which = np.unique(own, axis=0, return_inverse=True)
        style = np.zeros(len(self.value), np.int64)
        style[odd] = 1 + which.reshape(-1)
        others = [Style(column, d, least, False, bool(point)) for d, least, point in forms.tolist()]
        return [usual, *others], style

    def _natural(self) -> Whole:
        """(k,) digits before the point without zeros before them."""
        before = np.abs(self.value) // 10**self.most
        return np.asarray(np.searchsorted(10 ** np.arange(DIGITS_MOST), before, "right"))

    def _kept(self) -> Whole:
        """(k,) decimals without the zeros at the end."""
        kept = np.full(len(self.value), self.most)
        rows = np.arange(len(self.value))
        for k in range(1, self.most + 1):
            rows = rows[self.value[rows] % 10**k == 0]
            kept[rows] = self.most - k
        return kept

    def _usual(self, column: int, kept: Whole, telling: Whole) -> Style:
        """The style of most of the numbers; `telling` are digits before the point."""
        trim = int((self.decimals == kept).sum()) > int((self.decimals == self.most).sum())
        bare = self.decimals == 0
        point = bool(bare.any() and 2 * self.point[bare].sum() > bare.sum())
        least = int(np.bincount(telling).argmax()) if telling.size else 1
        return Style(column, self.most, least, trim, point)

    def _as(self, style: Style, natural: Whole, kept: Whole) -> Mask:
        """(k,) whether a number is written in a style."""
        decimals = kept if style.trim else np.full(len(self.value), style.decimals)
        whole = np.maximum(natural, style.least)
        # a number has a digit
        whole[(whole == 0) & (decimals == 0)] = 1
        point = (decimals > 0) | style.point
        return np.asarray((self.decimals == decimals) & (self.whole == whole) & (self.point == point))
