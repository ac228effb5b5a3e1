"""CSV files of instruments: named columns of numbers, and what the file states about itself in comments."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array
from olp.core.schema import Table
from olp.core.values import dataclass
from olp.files.columns import Wanted, decoded, finite, missing, read_sheet
from olp.files.fields import nearest
from olp.files.measurements.stated import stated_as, stated_keys
from olp.files.problems import Problem, config_error
from olp.files.write import PathLike, read_bytes

T = TypeVar("T", bound=Table)


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """(n,) numbers by column, words by column of words, and the line of each row."""

    file: str
    number: Mapping[str, Array]
    word: Mapping[str, tuple[str, ...]]
    line: npt.NDArray[np.int64]


def read_columns(
    path: PathLike,
    model: type[T],
    needed: Sequence[str],
    optional: Sequence[str] = (),
    words: Sequence[str] = (),
) -> tuple[Columns, T]:
    """The columns of a CSV file, and its comments `# key = value` as a table of `model`.

    `needed` and `optional` are columns of numbers, `words` (needed) of words. Raises InputError where the
    file cannot be read, and ConfigError with every problem and its line.
    """
    file = str(path)
    data = read_bytes(path)
    # comments are judged before columns
    keys = stated_as(dict(stated_keys(decoded(data, file))), model, file)
    known = (*needed, *words, *optional)

    def header_problems(line: int, header: Sequence[str]) -> list[Problem]:
        problems: list[Problem] = []
        for name in header:
            if name not in known:
                near = nearest(name, known)
                hint = f"did you mean {near}?" if near else f"expected {', '.join(known)}"
                problems.append((line, f'column "{name}" is not known; {hint}'))
        problems += missing(line, header, (*needed, *words))
        if len(set(header)) < len(header):
            problems.append((line, "a column is repeated; expected each once"))
        return problems

    def number(name: str, cell: str) -> tuple[float, str | None]:
        return (0.0, None if cell else f"{name} is empty") if name in words else _number(name, cell)

    nothing = f"holds no readings; expected the columns {','.join(known)}"
    many = "; write decimal points, not commas"
    sheet = read_sheet(data, file, Wanted(nothing, header_problems, number, many=many))
    if sheet.problems:
        raise config_error(sheet.problems, file)
    if len(sheet.rows) < 2:
        raise config_error([(sheet.line, f"{len(sheet.rows)} readings; expected at least 2")], file)
    numbers = {name: np.array(column) for name, column in sheet.columns.items() if name not in words}
    texts = {name: tuple(cells[sheet.header.index(name)] for _, cells in sheet.records) for name in words}
    return Columns(file, numbers, texts, sheet.lines), keys


def _number(name: str, cell: str) -> tuple[float, str | None]:
    value, wrong = finite(cell), None
    if math.isnan(value):
        wrong = f'{name} = "{cell[:40]}"; expected a finite number'
    elif name == "direction" and value not in (1.0, -1.0):
        wrong = f"direction = {cell}; expected 1 or -1"
    elif name == "run" and (value != int(value) or value < 1):
        wrong = f"run = {cell}; expected an integer from 1"
    return value, wrong
