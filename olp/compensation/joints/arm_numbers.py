"""Numbers of targets as they are written: those that are right to their last digit keep their bytes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.patterns import pattern
from olp.core.spool import Text
from olp.core.values import dataclass
from olp.program.robots.targets import Span
from olp.program.text.numbers import MOST_DECIMALS, Number, number, written

#: A number that is nearer to what is wanted than this share of its last digit is right.
RIGHT = 0.5 + 1e-6
#: mm and rad by which a pose is off from computing alone
_COMPUTED = 1e-8
#: By decimals: the last digit.
_DIGITS = np.array([10.0**-k for k in range(MOST_DECIMALS + 1)])
#: Each line: a number in the usual form, with its decimals, or whatever else.
_LINES = pattern(rb"(?m)^(?:(-?(?:0|[1-9]\d{0,6})(?:\.(\d{1,12}))?)|[^\n]*)$")
#: The form of a number where the text has none in a form without exponent.
_NONE = Number(
    value=0.0, digit=0.1, plus=False, whole=1, bare=False, mark=b".", decimals=1, letter=b"",
    exponent_digits=0, exponent_plus=False,
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a row wants of its target: `values` and how they are written (`texts`), how far a digit of each
    goes, and the numbers of axes' turns."""

    values: tuple[float, ...]
    digits: tuple[float, ...]
    texts: tuple[bytes, ...]
    turns: tuple[bytes, ...]

    def right_for(self, other: Wanted) -> bool:
        """Whether the numbers are right for another row to their last digit."""
        near = all(
            abs(value_of(text) - value) <= RIGHT * digit
            for text, value, digit in zip(self.texts, other.values, self.digits, strict=True)
        )
        return near and self.turns == other.turns


def value_of(text: bytes) -> float:
    """The value of a number; one that the text leaves out is zero."""
    return float(text or b"0")


@dataclass(frozen=True, slots=True, eq=False)
class StatedNumbers:
    """The numbers of targets, (n, m): their `texts` row by row, and their values. `decimals` are those that
    each has, and `plain` says which are in the usual form."""

    texts: list[bytes]
    values: Array
    decimals: Index
    plain: Mask

    @staticmethod
    def of(data: Text, spans: Sequence[Sequence[Span]]) -> StatedNumbers:
        """Those at bytes of a text, (n, m)."""
        shape = len(spans), len(spans[0]) if spans else 0
        texts = [data[a:b] for row in spans for a, b in row]
        parts = _LINES.findall(b"\n".join(texts)) if texts else []
        plain = np.array([usual != b"" for usual, _ in parts], bool)
        decimals = np.array([len(own) for _, own in parts], np.int64)
        for k in np.flatnonzero(~plain).tolist():
            form = number(texts[k])
            decimals[k] = _NONE.decimals if form is None or form.letter else form.decimals
        values = np.array([value_of(text) for text in texts])
        return StatedNumbers(texts, values.reshape(shape), decimals.reshape(shape), plain.reshape(shape))

    def written(
        self, wanted: Array, fewest: Index, off: Array, turns: Sequence[tuple[bytes, ...]]
    ) -> list[Wanted]:
        """How `wanted` values (n, m) are written with the `fewest` decimals (m,) or (n, m), and the `turns`
        (n,) of axes. `off` (n, m) is how far those of the text are off, NaN where that is the difference of
        both."""
        decimals = np.minimum(np.maximum(self.decimals, fewest), MOST_DECIMALS)
        digit = _DIGITS[decimals]
        away = np.where(np.isnan(off), np.abs(self.values - wanted), off)
        right: Mask = away <= np.maximum(RIGHT * digit, _COMPUTED)
        short = self.plain & (np.abs(wanted) > digit)
        texts = list(self.texts)
        changed = np.flatnonzero(~right)
        columns = (each.ravel()[changed].tolist() for each in (wanted, decimals, short))
        for k, value, places, usual in zip(changed.tolist(), *columns, strict=True):
            texts[k] = b"%.*f" % (places, value) if usual else _written(texts[k], value, places)
        width = wanted.shape[1]
        values, digits = np.where(right, self.values, wanted), np.maximum(digit, _COMPUTED)
        rows = zip(values.tolist(), digits.tolist(), turns, strict=True)
        return [
            Wanted(tuple(value), tuple(reach), tuple(texts[k * width : (k + 1) * width]), own)
            for k, (value, reach, own) in enumerate(rows)
        ]


def _written(text: bytes, value: float, decimals: int) -> bytes:
    """A value in the form of a number, and in the usual one where the text has none."""
    form = number(text)
    return written(_NONE if form is None or form.letter else form, value, decimals)
