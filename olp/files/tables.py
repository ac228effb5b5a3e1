"""CSV tables of component errors along one axis."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.machine import COMPONENTS
from olp.core.units import AXES, shifted
from olp.files.problems import Problem, config_error, nearest
from olp.files.write import PathLike, Reader, read_bytes

#: A data row: its line in the file and the number in each column.
Row = tuple[int, list[float]]

#: A unit of error columns as a power of ten of the base unit.
_POWER = {"um": -3, "urad": -6, "um/kg": -3, "urad/kg": -6}

_COLUMN = re.compile(r"(sigma_)?(E[XYZABC][XYZ])_([A-Za-z]+)", re.IGNORECASE)


@dataclass(frozen=True, slots=True, eq=False)
class CurveTable:
    """One CSV file: (n,) positions in mm, ascending, and (n,) errors by ISO 230-1 name in mm or rad.

    With a `direction` column `forward` and `backward` hold both directions and `columns` their mean;
    without one both are None. `sigma` holds standard uncertainties in mm or rad.
    """

    axis: str
    position_mm: Array
    columns: Mapping[str, Array]
    forward: Mapping[str, Array] | None
    backward: Mapping[str, Array] | None
    sigma: Mapping[str, Array]


def read_curves(path: PathLike, read: Reader = read_bytes) -> CurveTable:
    """Read a curve file.

    Header `X_mm[, direction], EXX_um, EBX_urad ...[, sigma_EXX_um]`, then one row a position. Lines that
    start with `#` and empty lines are skipped. Raises InputError where the file cannot be read, and
    ConfigError with every problem and its line where the table is wrong.
    """
    return parse_curves(read(path), str(path))


def parse_curves(data: bytes, file: str) -> CurveTable:
    """As `read_curves`, from the bytes of the file."""
    _, header, records = headed(data, file, "columns such as X_mm, EXX_um, EYX_um", _header_problems)
    rows, found = rows_of(header, records)
    # Order and repetition mean little while rows are missing from it.
    found = found or _order_problems(header, rows)
    if found:
        raise config_error(found, file)
    return _table(header, rows, file)


def decoded(data: bytes, file: str) -> str:
    """The text of a file. Raises ConfigError with the line of the first byte that is not UTF-8."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        sentence = f"byte 0x{data[error.start]:02x} is not UTF-8; expected a text file saved as UTF-8"
        raise config_error([(line, sentence)], file) from None


def headed(
    data: bytes,
    file: str,
    expected: str,
    problems_of: Callable[[int, Sequence[str]], list[Problem]],
) -> tuple[int, list[str], list[tuple[int, list[str]]]]:
    """The line of the header of a table, its names, and (line, cells) of the rows below it. Raises
    ConfigError where there is none (`expected` says of what), or with the problems of it."""
    try:
        records = _records(decoded(data, file))
    except csv.Error as error:
        raise config_error([(None, f"is no table of comma-separated values ({error})")], file) from None
    if not records:
        raise config_error([(None, f"holds no header; expected {expected}")], file)
    line, header = records[0]
    found = problems_of(line, header)
    if found:
        raise config_error(found, file)
    return line, header, records[1:]


def _records(text: str) -> list[tuple[int, list[str]]]:
    """(line, stripped cells) of each line that holds data."""
    records = []
    for number, line in enumerate(text.replace("\r\n", "\n").replace("\r", "\n").split("\n"), 1):
        if line.strip() and not line.lstrip().startswith("#"):
            cells = next(csv.reader(io.StringIO(line), skipinitialspace=True), [])
            records.append((number, [cell.strip() for cell in cells]))
    return records


def _header_problems(line: int, header: Sequence[str]) -> list[Problem]:
    first = header[0]
    if len(header) == 1 and re.search(r"[;\t]", first):
        mark = "semicolons" if ";" in first else "tabs"
        return [
            (line, f"columns are separated by {mark}; expected commas between columns and decimal points")
        ]
    if first not in [f"{axis}_mm" for axis in AXES]:
        found = f'column 1 is "{first}"'
        if re.fullmatch(r"-?[\d.]+", first):
            found = f"the header is missing, line {line} starts with {first}"
        return [(line, f"{found}; expected X_mm, Y_mm or Z_mm, the position of the axis in mm")]
    problems: list[Problem] = []
    for number, name in enumerate(header[1:], 2):
        if header.index(name) < number - 1:
            problems.append((line, f'column {number} repeats "{name}"; expected each column once'))
        elif not (name == "direction" and number == 2) and (wrong := _column_problem(name, first[0])):
            problems.append((line, f'column {number} is "{name}"; {wrong}'))
    if not problems and not any(name in _columns_of(first[0]).values() for name in header):
        known = ", ".join(_columns_of(first[0]).values())
        problems.append((line, f"there is no error column; expected one of {known}"))
    return problems


def _columns_of(axis: str) -> dict[str, str]:
    """Component to column name, for one axis."""
    return {name: f"{name}_{_unit(name)}" for name in COMPONENTS if name[2] == axis}


def _unit(component: str) -> str:
    return "um" if component[1] in AXES else "urad"


def _column_problem(name: str, axis: str) -> str | None:
    """What is wrong with the name of an error column, or None."""
    known = _columns_of(axis)
    if name.removeprefix("sigma_") in known.values():
        return None
    if name == "direction":
        return f"expected direction as column 2, right behind {axis}_mm"
    match = _COLUMN.fullmatch(name)
    if match is None:
        near = nearest(name, known.values())
        return f"did you mean {near}?" if near else f"expected one of {', '.join(known.values())}"
    component = match[2].upper()
    if component[2] != axis:
        return f"an error of axis {component[2]}, but column 1 is {axis}_mm; expected E, direction, {axis}"
    wanted = known[component]
    if match[3].casefold() != _unit(component):
        return f"the unit {match[3]} is not taken here; expected {wanted}, values in {_unit(component)}"
    return f"expected {match[1] or ''}{wanted}"


def rows_of(
    header: Sequence[str], records: Sequence[tuple[int, list[str]]]
) -> tuple[list[Row], list[Problem]]:
    """The numbers of each row, and what is wrong with them."""
    rows: list[Row] = []
    problems: list[Problem] = []
    for line, cells in records:
        if len(cells) != len(header):
            hint = "; is a decimal comma in it? write a decimal point" if len(cells) > len(header) else ""
            sentence = f"{len(cells)} values under {len(header)} columns; expected one value a column{hint}"
            problems.append((line, sentence))
            continue
        numbers = []
        for name, cell in zip(header, cells, strict=True):
            number, wrong = _number(name, cell)
            numbers.append(number)
            if wrong:
                problems.append((line, f"{name} {wrong}"))
        rows.append((line, numbers))
    return rows, problems


def _number(name: str, cell: str) -> tuple[float, str | None]:
    unit = "/".join(name.split("_")[-2:]) if name.endswith("_kg") else name.rpartition("_")[2]
    if not cell:
        return 0.0, f"is empty; expected a number in {unit}"
    try:
        number = shifted(cell, _POWER.get(unit, 0)) if "_" not in cell else math.nan
    except ValueError:
        if re.fullmatch(r"[-+]?\d*,\d+", cell):
            return 0.0, f"= {cell} has a decimal comma; expected a decimal point"
        return 0.0, f'= "{cell}" is no number; expected a number in {unit}'
    if name == "direction" and number not in (1.0, -1.0):
        return 0.0, f"= {cell}; expected +1 or -1"
    if not math.isfinite(number):
        return 0.0, f"= {cell} is not finite; expected a number in {unit}"
    if name.startswith("sigma_") and number < 0:
        return 0.0, f"= {cell} is negative; expected a standard uncertainty of 0 or above in {unit}"
    return number, None


def _order_problems(header: Sequence[str], rows: Sequence[Row]) -> list[Problem]:
    problems: list[Problem] = []
    position = header[0]
    for name, part in _directions(header, rows):
        for (_, before), (line, row) in pairwise(part):
            if row[0] == before[0]:
                problems.append(
                    (line, f"{position} = {row[0]:g} is repeated{name}; expected each position once")
                )
            elif row[0] < before[0]:
                sentence = (
                    f"{position} = {row[0]:g} comes after {before[0]:g}{name}; expected ascending positions"
                )
                problems.append((line, sentence))
        if len(part) < 2:
            problems.append((None, f"{len(part)} positions{name}; expected at least 2"))
    return problems


def _directions(header: Sequence[str], rows: Sequence[Row]) -> list[tuple[str, list[Row]]]:
    """The rows of each direction with words to add to a message; all rows where there is no such column."""
    if "direction" not in header:
        return [("", list(rows))]
    return [
        (f" in direction {sign:+d}", [row for row in rows if row[1][header.index("direction")] == sign])
        for sign in (1, -1)
    ]


def _table(header: Sequence[str], rows: Sequence[Row], file: str) -> CurveTable:
    parts = [np.array([numbers for _, numbers in part]) for _, part in _directions(header, rows)]
    if len(parts) == 2 and not np.array_equal(parts[0][:, 0], parts[1][:, 0]):
        raise _positions_differ(header[0], parts[0][:, 0], parts[1][:, 0], file)
    names = _columns_of(header[0][0])

    def select(block: Array, prefix: str) -> dict[str, Array]:
        return {
            component: _frozen(block[:, header.index(prefix + name)].copy())
            for component, name in names.items()
            if prefix + name in header
        }

    mean = sum(parts[1:], parts[0]) / len(parts)
    both = len(parts) == 2
    return CurveTable(
        axis=header[0][0],
        position_mm=_frozen(parts[0][:, 0].copy()),
        columns=select(mean, ""),
        forward=select(parts[0], "") if both else None,
        backward=select(parts[1], "") if both else None,
        sigma=select(mean, "sigma_"),
    )


def _positions_differ(name: str, forward: Array, backward: Array, file: str) -> ConfigError:
    odd = np.setxor1d(forward, backward)[0]
    where = "+1" if odd in forward else "-1"
    sentence = (
        f"{name} = {odd:g} is given in direction {where} only; expected the same positions in both directions"
    )
    return config_error([(None, sentence)], file)


def _frozen(values: Array) -> Array:
    values.setflags(write=False)
    return values
