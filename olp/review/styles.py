"""How the numbers of a column are written: their decimals, and zeros before and behind them."""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np
import numpy.typing as npt

Whole = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]

#: A value has fewer digits than this.
DIGITS_MOST = 13


@dataclass(frozen=True, slots=True)
class Style:
    """The form of numbers of a column: `decimals` digits behind the point, fewer by the zeros at the end with
    `trim`; at least `least` digits before it; `point` keeps the point also where nothing is behind it."""

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
        usual = self._usual(column)
        own = np.column_stack((self.decimals, self._least(), self.point))[~self._as(usual)]
        forms, which = np.unique(own, axis=0, return_inverse=True)
        style = np.zeros(len(self.value), np.int64)
        style[~self._as(usual)] = 1 + which.reshape(-1)
        others = [Style(column, d, least, False, bool(point)) for d, least, point in forms.tolist()]
        return [usual, *others], style

    def _natural(self) -> Whole:
        """(k,) digits before the point without zeros before them."""
        before = np.abs(self.value) // 10**self.most
        return np.asarray(np.searchsorted(10 ** np.arange(DIGITS_MOST), before, "right"))

    def _least(self) -> Whole:
        """(k,) the least digits before the point that a number of its form has."""
        natural = self._natural()
        return np.where((self.whole > natural) | (natural == 0), self.whole, 1)

    def _kept(self) -> Whole:
        """(k,) decimals without the zeros at the end."""
        kept = np.full(len(self.value), self.most)
        for k in range(1, self.most + 1):
            kept[self.value % 10**k == 0] = self.most - k
        return kept

    def _usual(self, column: int) -> Style:
        """The style of most of the numbers."""
        kept = self._kept()
        trim = int((self.decimals == kept).sum()) > int((self.decimals == self.most).sum())
        bare = self.decimals == 0
        point = bool(bare.any() and 2 * self.point[bare].sum() > bare.sum())
        natural = self._natural()
        telling = (self.whole > natural) | (natural == 0)
        least = int(np.bincount(self.whole[telling]).argmax()) if telling.any() else 1
        return Style(column, self.most, least, trim, point)

    def _as(self, style: Style) -> Mask:
        """(k,) whether a number is written in a style."""
        decimals = self._kept() if style.trim else np.full(len(self.value), style.decimals)
        whole = np.maximum(self._natural(), style.least)
        # a number has a digit
        whole = np.where((whole == 0) & (decimals == 0), 1, whole)
        point = (decimals > 0) | style.point
        return np.asarray((self.decimals == decimals) & (self.whole == whole) & (self.point == point))
