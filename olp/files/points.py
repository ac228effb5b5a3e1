"""Reads files of measured points as a profile says."""

from __future__ import annotations

import csv
import hashlib
import io
import itertools
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array
from olp.core.errors import InputError
from olp.files.point_profile import MEASURED, PointProfile, looked_at
from olp.files.problems import nearest
from olp.files.write import PathLike, Reader, read_bytes
from olp.program.text.delimited import DELIMITERS, LOOK, MM, SECONDS, first_lines, stated_frame


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """(n, 3) positions in mm, with times (n,) in s, names and program lines (n,) where the file has them.

    `frame` is what the file says that they are stated in, None where it says nothing.
    """

    file: str
    points_mm: Array
    time_s: Array | None
    names: tuple[str, ...] | None
    line: npt.NDArray[np.int64] | None
    frame: str | None
    profile: PointProfile
    sha256: str

    def __len__(self) -> int:
        return len(self.points_mm)


def read_points(
    path: PathLike, profile: PointProfile | None = None, read: Reader = read_bytes
) -> Points:
    """The points of a file; without a profile its layout is told from its first rows.

    Raises InputError where the file cannot be read, its layout cannot be told, or a row is wrong, with the
    line.
    """
    return parse_points(read(path), str(path), profile)


def row_line(points: Points, row: int) -> int:
    """The line of the file, counted from 1, in which a point stands."""
    text = _lines(read_bytes(points.file).decode("utf-8-sig"))
    profile = points.profile
    skip, _ = _header(list(itertools.islice(io.StringIO(text), LOOK)), profile)
    return next(itertools.islice(_rows(text, profile, skip), row, None))[0]


def layout_of(data: bytes) -> PointProfile | None:
    """The layout that the first rows of a file tell, None where they leave a choice."""
    return looked_at(first_lines(data))


def parse_points(data: bytes, file: str, profile: PointProfile | None = None) -> Points:
    """As `read_points`, from the bytes of the file."""
    try:
        text = _lines(data.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise InputError(
            f"byte 0x{data[error.start]:02x} is not UTF-8; expected a text file saved as UTF-8",
            file=file, line=line,
        ) from None  # fmt: skip
    first = list(itertools.islice(io.StringIO(text), LOOK))
    found = profile or layout_of(data)
    if not text.strip():
        raise InputError("holds no points; expected a row a point", file=file)
    if found is None:
        raise InputError(
            "does not tell which columns hold X, Y and Z; name them by name or number with --column X=.. "
            "--column Y=.. --column Z=.., or give a profile with --profile",
            file=file,
        )
    stated = stated_frame(first, file)
    skip, header = _header(first, found)
    if next(_rows(text, found, skip), None) is None:
        raise InputError("holds no points; expected a row a point", file=file)
    columns = {
        key: _place(column, header, file) for key, column in found.columns.given.items() if key in MEASURED
    }
    numbers = [key for key in columns if key != "name"]
    table = _table(text, file, found, skip, [columns[key] for key in numbers])
    column = dict(zip(numbers, table.T, strict=True))
    time = column["t"] * SECONDS[found.time_unit] if "t" in column else None
    if time is None and found.sample_period_s is not None:
        time = np.arange(len(table)) * found.sample_period_s
    names = None
    if "name" in columns:
        names = _texts(text, file, found, skip, columns["name"])
    return Points(
        file,
        np.column_stack([column[axis] for axis in "XYZ"]) * MM[found.unit],
        time,
        names,
        column["line"].astype(np.int64) if "line" in column else None,
        stated or found.frame,
        found,
        hashlib.sha256(data).hexdigest(),
    )


def _lines(text: str) -> str:
    """A text with one kind of line ends."""
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _header(first: Sequence[str], profile: PointProfile) -> tuple[int, list[str]]:
    """How many lines stand before the first row of data, and the names of columns."""
    for number, line in enumerate(first):
        if _holds(line, profile):
            if not profile.header:
                return number, []
            return number + 1, _cells(line, profile)
    return len(first), []


def _holds(line: str, profile: PointProfile) -> bool:
    """A line that is neither empty nor a comment."""
    return bool(line.strip()) and not line.lstrip().startswith((profile.comment, "#"))


def _cells(line: str, profile: PointProfile) -> list[str]:
    mark = DELIMITERS[profile.delimiter]
    if mark is None:
        return line.split()
    return [cell.strip() for cell in next(csv.reader([line], delimiter=mark, skipinitialspace=True))]


def _place(column: str | int, header: Sequence[str], file: str) -> int:
    if isinstance(column, int):
        return column - 1
    if column in header:
        return header.index(column)
    near = nearest(column, header)
    known = f"did you mean {near}?" if near else f"expected one of {', '.join(header) or 'their numbers'}"
    raise InputError(f'there is no column "{column}"; {known}', file=file)


def _rows(text: str, profile: PointProfile, skip: int) -> Iterator[tuple[int, list[str]]]:
    for number, line in enumerate(io.StringIO(text), 1):
        if number > skip and _holds(line, profile):
            yield number, _cells(line, profile)


def _texts(text: str, file: str, profile: PointProfile, skip: int, column: int) -> tuple[str, ...]:
    """The cells of a column."""
    out = []
    for number, cells in _rows(text, profile, skip):
        if column >= len(cells):
            raise _too_short(cells, column, file, number, profile)
        out.append(cells[column])
    return tuple(out)


def _too_short(
    cells: Sequence[str], column: int, file: str, number: int, profile: PointProfile
) -> InputError:
    return InputError(
        f'{len(cells)} columns; expected at least {column + 1}; is the delimiter "{profile.delimiter}"?',
        file=file, line=number,
    )  # fmt: skip


def _table(text: str, file: str, profile: PointProfile, skip: int, columns: Sequence[int]) -> Array:
    """(n, k) numbers of the columns."""
    body = text.replace(",", ".") if profile.decimal == "comma" else text
    if profile.decimal == "comma" and profile.delimiter == "comma":
        raise InputError("has commas both between columns and in numbers; name another delimiter", file=file)
    # whole lines are comments, not what is behind a mark in a cell; empty lines keep the numbers of others
    body = re.sub(rf"(?m)^[ \t]*((#|{re.escape(profile.comment)}).*)?$", "", body)
    try:
        table = np.loadtxt(
            io.StringIO(body), delimiter=DELIMITERS[profile.delimiter], skiprows=skip, usecols=columns,
            comments=None, ndmin=2, quotechar='"',
        )  # fmt: skip
    except (ValueError, IndexError):
        raise _wrong_row(body, file, profile, skip, columns) from None
    bad = np.flatnonzero(~np.isfinite(table).all(axis=1))
    if len(bad):
        line = next(itertools.islice(_rows(body, profile, skip), int(bad[0]), None))[0]
        raise InputError("a number is not finite; remove the row, or measure it again", file=file, line=line)
    return np.asarray(table, float)


def _wrong_row(text: str, file: str, profile: PointProfile, skip: int, columns: Sequence[int]) -> InputError:
    for number, cells in _rows(text, profile, skip):
        for column in columns:
            if column >= len(cells):
                return _too_short(cells, column, file, number, profile)
            try:
                float(cells[column])
            except ValueError:
                return InputError(
                    f'column {column + 1} is "{cells[column][:40]}"; expected a number with a decimal '
                    f"{profile.decimal}",
                    file=file, line=number,
                )  # fmt: skip
    return InputError("cannot be read as a table; check the delimiter", file=file)
