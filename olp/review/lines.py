"""A text by the line: templates, and the numbers in them as columns of whole numbers.

The numbers of a program are mostly positions that the page has anyway: a column of them is stored as its
difference from what the samples predict, which is mostly 0. No dialect is asked for: a number belongs to a
column by the letter before it, and each column takes the prediction that leaves least.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Index
from olp.core.units import MM_PER_INCH
from olp.core.values import dataclass
from olp.review.integers import small
from olp.review.styles import DIGITS_MOST, Style, Whole, Written
from olp.review.tokens import MARK, Small, Tokens

#: Numbers of a column with at most as many values belong to the templates.
_FEW = 32
#: Values of a column that are counted first.
_SOME = 4096
#: Lines per number of the sparsest column that is stored as one.
_SPARSE = 256
#: Most styles of a text; numbers in others belong to the templates.
_STYLES = 400
#: What follows a mark in a template: this plus the number of the style.
FIRST_STYLE = 0x20
#: Rows of a block on which a prediction is tried.
_TRIED = 1024
#: Blocks of a column that are tried.
_BLOCKS = 8
#: Rows that are worked on at once, so that temporaries are small.
_BAND = 1 << 16
#: Powers of ten by their exponents.
_POWERS = 10 ** np.arange(DIGITS_MOST, dtype=np.int64)
#: nm per mm.
NM_PER_MM = 1_000_000
#: Bits of a value in the name of a number that belongs to its template.
_VALUE_BITS = 32
#: Bits of a number of digits in that name.
_DIGIT_BITS = 4

#: The last letter before a number, since the number before it.
_LETTER = re.compile(rb"[A-Za-z][^A-Za-z]*\Z")


@dataclass(frozen=True, slots=True, eq=False)
class Positions:
    """What predicts the numbers of a text: the sum of `terms`, each (s, 3) whole numbers of samples and how
    many nm one of them is; and (n,) `at`, the sample of each line."""

    terms: tuple[tuple[npt.NDArray[Any], int], ...]
    at: Small

    def nm(self, axis: int, line: Small) -> Whole:
        """(k,) position along an axis of the samples of lines."""
        rows = self.at[line]
        return np.asarray(sum(whole[rows, axis].astype(np.int64) * nm for whole, nm in self.terms))


@dataclass(frozen=True, slots=True)
class Prediction:
    """A column is predicted by positions along `axis`, `nm` of them for one unit of its last digit;
    `relative` to those of the line before."""

    axis: int
    nm: float
    relative: bool

    def of(self, positions: Positions, line: Small) -> Whole:
        """(k,) predicted numbers of lines; the page computes the same doubles."""
        along = positions.nm(self.axis, line)
        if self.relative:
            along = along - positions.nm(self.axis, np.maximum(line - 1, 0))
        return np.asarray(np.floor(along / self.nm + 0.5).astype(np.int64))


@dataclass(frozen=True, slots=True, eq=False)
class Lines:
    """A text of n lines. In `templates` a mark and a style stand for each number of a column; (n,) `template`
    is that of each line. Of c columns there are the `decimals` of a unit, the `predictions`, and (n, c)
    `rest`, the numbers less those."""

    templates: list[str]
    template: Small
    styles: list[Style]
    decimals: list[int]
    predictions: list[Prediction | None]
    rest: npt.NDArray[Any]

    @staticmethod
    def of(text: str, positions: Positions | None = None) -> Lines:
        tokens = Tokens.of(text)
        slots = _Slots.of(tokens)
        code = np.full(len(tokens.value), -1, np.int32)
        styles: list[Style] = []
        decimals: list[int] = []
        predictions: list[Prediction | None] = []
        rest: list[npt.NDArray[Any]] = []
        for key in range(slots.columns):
            rows = slots.rows(key)
            column = _column(tokens, rows, len(styles), len(rest), len(tokens.skeleton))
            if column is None:
                continue
            code[column.rows] = column.style
            styles += column.styles
            decimals.append(column.decimals)
            guess, left = _predicted(column, slots.line[column.rows], len(tokens.skeleton), positions)
            predictions.append(guess)
            rest.append(left)
        templates, template = slots.templates(tokens, code)
        del tokens, slots, code
        columns = np.column_stack(rest) if rest else np.zeros((len(template), 0), np.int32)
        return Lines(templates, template, styles, decimals, predictions, columns)


@dataclass(frozen=True, slots=True, eq=False)
class _Column:
    """Numbers that are stored as a column: the (k,) `rows` of the numbers of the text, and `value` in units
    of the last of `decimals`. (k,) `style` is an index of all styles, of which `styles` are new."""

    rows: Small
    value: Whole
    decimals: int
    style: Small
    styles: list[Style]


def _column(tokens: Tokens, rows: Small, first_style: int, number: int, lines: int) -> _Column | None:
    """The numbers in `rows` as column `number`; None where they belong to the templates."""
    if len(rows) * _SPARSE < lines or _few(tokens.value[rows]):
        return None
    decimals = tokens.decimals[rows]
    most = int(decimals.max())
    value = tokens.value[rows].astype(np.int64)
    fits = np.empty(len(rows), bool)
    for some in _bands(len(rows)):
        fits[some] = np.abs(value[some]) < _POWERS[DIGITS_MOST - 1 - most + decimals[some]]
        value[some] *= _POWERS[most - decimals[some]]
    if not fits.all():
        rows, value, decimals = rows[fits], value[fits], decimals[fits]
    written = Written(value, most, tokens.whole[rows], decimals, tokens.point[rows])
    styles, style = written.styles(number)
    room = max(_STYLES - first_style, 0)
    known = style < room
    if not known.any():
        return None
    which = slice(None) if known.all() else known
    return _Column(rows[which], value[which], most, first_style + style[which], styles[:room])


def _few(values: Small) -> bool:
    """Whether a column has few values."""
    some = values[:: len(values) // _SOME + 1]
    return all(np.count_nonzero(np.diff(np.sort(each))) < _FEW for each in (some, values))


def _predicted(
    column: _Column, line: Small, lines: int, positions: Positions | None
) -> tuple[Prediction | None, npt.NDArray[Any]]:
    """The best prediction of a column, and (n,) the rest; a line without a number has the one
    before it."""
    choices: list[Prediction | None] = [None]
    if positions is not None:
        units = [unit * NM_PER_MM / 10**column.decimals for unit in (1.0, MM_PER_INCH)]
        choices += [Prediction(a, nm, r) for r in (False, True) for nm in units for a in range(3)]

    def rest(choice: Prediction | None, rows: Index | slice) -> Whole:
        guess = 0 if choice is None or positions is None else choice.of(positions, line[rows])
        return np.asarray(column.value[rows] - guess)

    tried = _tried(len(line))
    best = min(choices, key=lambda c: float(np.log2(1.0 + np.abs(np.diff(rest(c, tried)))).sum()))
    before = np.zeros(lines, np.int32)
    before[line] = np.arange(len(line))
    left = np.concatenate([small(rest(best, rows)) for rows in _bands(len(line))])
    return best, left[np.maximum.accumulate(before)]


def _bands(count: int) -> Iterator[slice]:
    """Rows of a column, some at once."""
    return (slice(a, a + _BAND) for a in range(0, count, _BAND))


def _tried(count: int) -> Index:
    """Rows of some blocks of a column."""
    if count <= _TRIED * _BLOCKS:
        return np.arange(count)
    first = np.linspace(0, count - _TRIED, _BLOCKS).astype(np.int64)
    return np.asarray((first[:, None] + np.arange(_TRIED)).ravel())


@dataclass(frozen=True, slots=True, eq=False)
class _Slots:
    """Where the k numbers of a text are: (k,) `line` of each, and the `slot` in its skeleton among the slots
    of all skeletons. `column` is that of each slot, and `columns` their number."""

    line: Small
    slot: Small
    column: Small
    columns: int

    @staticmethod
    def of(tokens: Tokens) -> _Slots:
        known: dict[tuple[bytes, int, int], int] = {}
        flat: list[int] = []
        first = [0]
        for skeleton in tokens.skeletons:
            flat += [known.setdefault(key, len(known)) for key in _keys(skeleton)]
            first.append(len(flat))
        begin = np.array(first, np.int32)
        count = np.diff(begin)[tokens.skeleton]
        line = np.repeat(np.arange(len(count), dtype=np.int32), count)
        done = np.cumsum(count, dtype=np.int32) - count
        slot = np.arange(len(line), dtype=np.int32)
        slot += np.repeat(begin[:-1][tokens.skeleton] - done, count)
        return _Slots(line, slot, np.array(flat, np.int32), len(known))

    def rows(self, column: int) -> Small:
        """The numbers of a column."""
        return np.flatnonzero((self.column == column)[self.slot]).astype(np.int32)

    def templates(self, tokens: Tokens, code: Small) -> tuple[list[str], Small]:
        """Templates and (n,) the template of each line; `code` (k,) is the style of each number, -1 for one
        that belongs to its template."""
        inline = np.flatnonzero(code < 0)
        code[inline] = -1 - _numbered(_names(tokens, inline))[1]
        template = tokens.skeleton.copy()
        # a skeleton's own template is that of its first line; lines unlike it have others
        usual = np.zeros(int(self.slot.max(initial=-1)) + 1, np.int32)
        for rows in reversed(list(_bands(len(code)))):
            usual[self.slot[rows][::-1]] = code[rows][::-1]
        other = np.zeros(len(template), bool)
        for rows in _bands(len(code)):
            other[self.line[rows][code[rows] != usual[self.slot[rows]]]] = True
        mine = np.flatnonzero(other)
        begin, end = (np.searchsorted(self.line, (mine + i).astype(np.int32)) for i in (0, 1))
        first, which = _alike(tokens.skeleton[mine], begin, end - begin, code)
        template[mine] = len(tokens.skeletons) + which
        examples = np.zeros(len(tokens.skeletons), np.int64)
        own = np.flatnonzero(~other)
        examples[tokens.skeleton[own][::-1]] = own[::-1]
        lines = np.concatenate((examples, mine[first]))
        begin = np.searchsorted(self.line, lines.astype(np.int32))
        pairs = zip(lines.tolist(), begin.tolist(), strict=True)
        return [_template(tokens, code, line, at) for line, at in pairs], template


def _alike(skeleton: Small, begin: Index, count: Index, code: Small) -> tuple[Index, Index]:
    """Groups of lines with the same skeleton and the same codes: a line of each, and (m,) the group."""
    group = skeleton.astype(np.int64)
    most = int(count.max(initial=0))
    for k in range(most):
        rows = np.flatnonzero(count > k)
        own = _numbered(code[begin[rows] + k])[1]
        group[rows] = _numbered(group[rows] * len(own) + own)[1]
    # lines of one skeleton have as many numbers
    return _numbered(group * (most + 1) + count)


def _numbered(names: npt.NDArray[np.integer[Any]]) -> tuple[Index, Index]:
    """A row of each name, and (n,) the number of the name of each row."""
    _, first, which = np.unique(names, return_index=True, return_inverse=True)
    return first, which.reshape(-1)


def _names(tokens: Tokens, rows: Index) -> Whole:
    """(k,) names of numbers that belong to templates, equal where all characters are."""
    value = tokens.value[rows].astype(np.int64) + (1 << (_VALUE_BITS - 1))
    form = (tokens.whole[rows].astype(np.int64) << _DIGIT_BITS) + tokens.decimals[rows]
    name = (((value << (2 * _DIGIT_BITS)) + form) << 1) + tokens.point[rows]
    return np.asarray(name)


def _template(tokens: Tokens, code: Small, line: int, begin: int) -> str:
    """The skeleton of a line with its numbers, those from `begin`, or what stands for them."""
    parts = tokens.skeletons[tokens.skeleton[line]].decode().split(MARK.decode())
    text = [parts[0]]
    for k, part in enumerate(parts[1:], begin):
        style = int(code[k])
        text += (MARK.decode() + chr(FIRST_STYLE + style) if style >= 0 else _spelled(tokens, k), part)
    return "".join(text)


def _spelled(tokens: Tokens, k: int) -> str:
    """The characters of a number."""
    value, decimals = int(tokens.value[k]), int(tokens.decimals[k])
    digits = str(abs(value)).rjust(int(tokens.whole[k]) + decimals, "0")
    before = len(digits) - decimals
    return ("-" if value < 0 else "") + digits[:before] + "." * bool(tokens.point[k]) + digits[before:]


def _keys(skeleton: bytes) -> Iterator[tuple[bytes, int, int]]:
    """The column of each number of a line: the last letter before it, how many numbers there were since, and
    how often the line had that before."""
    letter, since = b"", 0
    had: dict[tuple[bytes, int], int] = {}
    for part in skeleton.split(MARK)[:-1]:
        match = _LETTER.search(part)
        letter, since = (match[0][:1].upper(), 0) if match else (letter, since + 1)
        again = had.get((letter, since), 0)
        had[letter, since] = again + 1
        yield letter, since, again
