"""CSV files of instruments: named columns of numbers, and what the file says about itself in comments."""

from __future__ import annotations

import csv
import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array
from olp.core.schema import Table
from olp.files.measurements.readings import stated_keys
from olp.files.problems import Problem, config_error, nearest, validate
from olp.files.tables import decoded
from olp.files.toml_text import Path
from olp.files.write import PathLike, read_bytes

T = TypeVar("T", bound=Table)


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """(n,) numbers by column, words of the columns that hold words, and the line of each row."""

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
    text = decoded(read_bytes(path), file)
    stated = _stated(text, model, file)
    records = [
        (number, [cell.strip() for cell in next(csv.reader([line]))])
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    known = (*needed, *words, *optional)
    if not records:
        raise config_error([(None, f"holds no readings; expected the columns {','.join(known)}")], file)
    line, header = records[0]
    problems: list[Problem] = []
    for name in header:
        if name not in known:
            near = nearest(name, known)
            hint = f"did you mean {near}?" if near else f"expected {', '.join(known)}"
            problems.append((line, f'column "{name}" is not known; {hint}'))
    problems += [(line, f"the column {name} is missing") for name in (*needed, *words) if name not in header]
    if len(set(header)) < len(header):
        problems.append((line, "a column stands twice; expected each once"))
    if not problems:
        problems += _cells(header, records[1:], words)
    if not problems and len(records) < 3:
        problems = [(line, f"{len(records) - 1} readings; expected at least 2")]
    if problems:
        raise config_error(problems, file)
    column = dict(zip(header, zip(*(cells for _, cells in records[1:]), strict=True), strict=True))
    return (
        Columns(
            file,
            {name: np.array(column[name], float) for name in header if name not in words},
            {name: tuple(column[name]) for name in words},
            np.array([number for number, _ in records[1:]], np.int64),
        ),
        stated,
    )


def _cells(
    header: Sequence[str], records: Sequence[tuple[int, list[str]]], words: Sequence[str]
) -> list[Problem]:
    problems: list[Problem] = []
    for line, cells in records:
        if len(cells) != len(header):
            hint = "; write decimal points, no commas" if len(cells) > len(header) else ""
            problems.append((line, f"{len(cells)} values under {len(header)} columns{hint}"))
            continue
        for name, cell in zip(header, cells, strict=True):
            if name in words:
                if not cell:
                    problems.append((line, f"{name} is empty"))
            elif not _finite(cell):
                problems.append((line, f'{name} = "{cell[:40]}"; expected a finite number'))
            elif name == "direction" and float(cell) not in (1.0, -1.0):
                problems.append((line, f"direction = {cell}; expected 1 or -1"))
            elif name == "run" and (float(cell) != int(float(cell)) or float(cell) < 1):
                problems.append((line, f"run = {cell}; expected a whole number from 1"))
    return problems


def _finite(cell: str) -> bool:
    try:
        return "_" not in cell and math.isfinite(float(cell))
    except ValueError:
        return False


def _stated(text: str, model: type[T], file: str) -> T:
    """The comments of a file as a table; words need no quotes there."""
    values: dict[str, object] = {}
    places: dict[Path, int] = {}
    for key, (written, line) in stated_keys(text):
        try:
            values[key] = tomllib.loads(f"value = {written}")["value"]
        except tomllib.TOMLDecodeError:
            values[key] = written
        places[(key,)] = line
    return validate(model, values, places, file)
