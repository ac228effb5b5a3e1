"""Tables of numbers under named columns: one reader for all, which lists every problem with its line.

What differs from table to table is a value (`Wanted`): how lines become cells, which names are right, what a
cell may hold, and the words for what is wrong.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.errors import ConfigError, InputError
from olp.core.values import dataclass
from olp.files.fields import nearest
from olp.files.problems import Problem, config_error
from olp.program.text import rows
from olp.program.text.rows import CSV, Form, place_of

#: How text in UTF-16 begins.
_UTF_16 = b"\xff\xfe", b"\xfe\xff"
#: A data row: its line in the file and the number in each column.
Row = tuple[int, list[float]]
#: A data row as it is written.
Record = tuple[int, list[str]]


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a table has to be.

    `nothing` is the message for a file without a header. `header` takes the line and the names of columns and
    gives what is wrong with them. `number` takes the name of a column and a cell, and gives the number and
    what is wrong with it. `one` ends the message for a row with more or fewer cells than columns; `many`
    follows it where the row has more.
    """

    nothing: str
    header: Callable[[int, Sequence[str]], list[Problem]]
    number: Callable[[str, str], tuple[float, str | None]]
    one: str = ""
    many: str = ""
    form: Form = CSV


@dataclass(frozen=True, slots=True)
class Sheet:
    """The text of a table, the line of its header, and its names. `records` are the rows as written; `rows`
    are those with as many cells as columns, as numbers. `problems` are those of the rows."""

    text: str
    line: int
    header: tuple[str, ...]
    records: tuple[Record, ...]
    rows: tuple[Row, ...]
    problems: tuple[Problem, ...]

    @property
    def lines(self) -> Index:
        """(n,) the line of each row."""
        return np.array([line for line, _ in self.rows], np.int64)

    @property
    def table(self) -> Array:
        """(n, columns) the numbers."""
        return np.array([numbers for _, numbers in self.rows], float).reshape(-1, len(self.header))

    @property
    def columns(self) -> Mapping[str, Array]:
        """(n,) numbers by name."""
        return dict(zip(self.header, self.table.T, strict=True))


def read_sheet(data: bytes, file: str, wanted: Wanted) -> Sheet:
    """A table and what is wrong with its rows. Raises ConfigError where the file is not text or is empty, and
    with the problems of its header."""
    text = decoded(data, file)
    try:
        records = list(wanted.form.rows(text))
    except InputError as error:
        raise config_error([(error.line, error.message)], file) from None
    if not records:
        raise config_error([(None, wanted.nothing)], file)
    line, header = records[0]
    wrong_names = wanted.header(line, header)
    if wrong_names:
        raise config_error(wrong_names, file)
    problems: list[Problem] = []
    numbers: list[Row] = []
    for row_line, cells in records[1:]:
        if not any(cells):
            problems.append((row_line, "has marks between columns and no value; delete this line"))
            continue
        if len(cells) != len(header):
            hint = wanted.many if len(cells) > len(header) else ""
            problems.append((row_line, f"{len(cells)} values under {len(header)} columns{wanted.one}{hint}"))
            continue
        parsed = [wanted.number(name, cell) for name, cell in zip(header, cells, strict=True)]
        problems += [(row_line, wrong) for _, wrong in parsed if wrong]
        numbers.append((row_line, [number for number, _ in parsed]))
    return Sheet(text, line, tuple(header), tuple(records[1:]), tuple(numbers), tuple(problems))


def decoded(data: bytes, file: str) -> str:
    """The text of a file. Raises ConfigError with the line of the first byte that is not UTF-8."""
    try:
        return rows.decoded(data)
    except InputError as error:
        raise config_error([(error.line, error.message)], file) from None


def instrument_text(data: bytes, file: str) -> str:
    """The text of a file that the program of an instrument wrote: UTF-8, UTF-16 with its mark, or
    Windows-1252. Code pages of one byte differ in letters beyond ASCII, and in no number. Raises ConfigError
    where it is no text."""
    if data[:2] in _UTF_16:
        return data.decode("utf-16", errors="replace")
    try:
        return decoded(data, file)
    except ConfigError:
        if b"\0" in data:
            raise
        return data.decode("cp1252", errors="replace")


def finite(cell: str) -> float:
    """The finite number in a cell, NaN for anything else."""
    try:
        value = float(cell) if "_" not in cell else math.nan
    except ValueError:
        return math.nan
    return value if math.isfinite(value) else math.nan


def names(
    line: int, header: Sequence[str], wrong: Callable[[int, str], str | None], first: int = 1
) -> list[Problem]:
    """What is wrong with the names of columns from column `first` on. No name may be repeated, and `wrong`
    gives what is wrong with a name, from its number and itself."""
    problems: list[Problem] = []
    for number, name in enumerate(header[first - 1 :], first):
        if header.index(name) < number - 1:
            problems.append((line, f'column {number} repeats "{name}"; expected each column once'))
        elif problem := wrong(number, name):
            problems.append((line, f'column {number} is "{name}"; {problem}'))
    return problems


def unknown(name: str, known: Sequence[str], more: str = "") -> str | None:
    """The message for a name that is not among the known ones, None for a known one."""
    if name in known:
        return None
    near = nearest(name, known)
    return (f"did you mean {near}?" if near else f"expected one of {', '.join(known)}") + more


def missing(line: int, header: Sequence[str], needed: Sequence[str]) -> list[Problem]:
    """The needed columns that a header does not name."""
    return [(line, f"the column {name} is missing") for name in needed if name not in header]


def place_in(header: Sequence[str], column: str | int, file: str, hint: str = "") -> int:
    """The index of a column. Raises InputError, with a hint, where no column has its name."""
    index = place_of(column, header)
    if index is None:
        near = nearest(str(column), header)
        known = f"did you mean {near}?" if near else f"expected one of {', '.join(header) or 'their numbers'}"
        raise InputError(f'there is no column "{column}"; {known}{hint}', file=file)
    return index
