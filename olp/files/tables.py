"""CSV tables of component errors along one axis."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from itertools import pairwise

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.machine import COMPONENTS
from olp.core.patterns import pattern
from olp.core.units import AXES, shifted
from olp.core.values import dataclass
from olp.files.columns import Row, Wanted, names, read_sheet, unknown
from olp.files.problems import Problem, config_error
from olp.files.write import PathLike, Reader, read_bytes
from olp.program.text.rows import LOOSE_CSV

#: Units of error columns as powers of ten of the base unit (mm or rad).
_POWER = {"um": -3, "urad": -6, "um/kg": -3, "urad/kg": -6}

_COLUMN = pattern(r"(sigma_)?(E[XYZABC][XYZ])_([A-Za-z]+)", re.IGNORECASE)


@dataclass(frozen=True, slots=True, eq=False)
class CurveTable:
    """One CSV file: (n,) positions in mm, ascending, and (n,) errors by ISO 230-1 name in mm or rad.

    With a `direction` column, `forward` and `backward` hold the two directions and `columns` their mean.
    Without one, both are None. `sigma` holds standard uncertainties in mm or rad.
    """

    axis: str
    position_mm: Array
    columns: Mapping[str, Array]
    forward: Mapping[str, Array] | None
    backward: Mapping[str, Array] | None
    sigma: Mapping[str, Array]


def read_curves(path: PathLike, read: Reader = read_bytes) -> CurveTable:
    """Read a curve file.

    Header `X_mm[, direction], EXX_um, EBX_urad ...[, sigma_EXX_um]`, then one row per position. Lines that
    start with `#` and empty lines are skipped. Raises InputError where the file cannot be read, and
    ConfigError with every problem and its line where the table is wrong.
    """
    return parse_curves(read(path), str(path))


def parse_curves(data: bytes, file: str) -> CurveTable:
    """As `read_curves`, from the bytes of the file."""
    sheet = read_sheet(
        data,
        file,
        unit_columns("holds no header; expected columns such as X_mm, EXX_um, EYX_um", _header_problems),
    )
    # The order of rows is judged only where no row is missing.
    problems = sheet.problems or _order_problems(sheet.header, sheet.rows)
    if problems:
        raise config_error(problems, file)
    return _table(sheet.header, sheet.rows, file)


def unit_columns(nothing: str, header: Callable[[int, Sequence[str]], list[Problem]]) -> Wanted:
    """A table of numbers whose names end in their unit."""
    many = "; is a decimal comma in it? write a decimal point"
    return Wanted(nothing, header, _number, "; expected one value per column", many, LOOSE_CSV)


def _header_problems(line: int, header: Sequence[str]) -> list[Problem]:
    first = header[0]
    if len(header) == 1 and re.search(r"[;\t]", first):
        mark = "semicolons" if ";" in first else "tabs"
        return [
            (
                line,
                f"columns are separated by {mark}; expected commas between columns and decimal points; "
                "replace them in this file",
            )
        ]
    if first.startswith("sep="):
        return [(line, "sep= is a line for Excel; delete it, so that the names of columns come first")]
    if first not in [f"{axis}_mm" for axis in AXES]:
        what = f'column 1 is "{first}"'
        if re.fullmatch(r"-?[\d.]+", first):
            what = f"the header is missing, line {line} starts with {first}"
        return [(line, f"{what}; expected X_mm, Y_mm or Z_mm, the position of the axis in mm")]
    problems = names(line, header, lambda number, name: _column_problem(number, name, first[0]), 2)
    if not problems and not any(name in _columns_of(first[0]).values() for name in header):
        known = ", ".join(_columns_of(first[0]).values())
        problems.append((line, f"there is no error column; expected one of {known}"))
    return problems


def _columns_of(axis: str) -> dict[str, str]:
    """Component to column name, for one axis."""
    return {name: f"{name}_{_unit(name)}" for name in COMPONENTS if name[2] == axis}


def _unit(component: str) -> str:
    return "um" if component[1] in AXES else "urad"


def _column_problem(number: int, name: str, axis: str) -> str | None:
    """What is wrong with the name of an error column, or None."""
    known = _columns_of(axis)
    if name.removeprefix("sigma_") in known.values() or (name == "direction" and number == 2):
        return None
    if name == "direction":
        return f"expected direction as column 2, right behind {axis}_mm"
    match = _COLUMN.fullmatch(name)
    if match is None:
        return unknown(name, tuple(known.values()))
    component = match[2].upper()
    if component[2] != axis:
        return f"an error of axis {component[2]}, but column 1 is {axis}_mm; expected E, direction, {axis}"
    wanted = known[component]
    if match[3].casefold() != _unit(component):
        return f"the unit {match[3]} is not accepted here; expected {wanted}, values in {_unit(component)}"
    return f"expected {match[1] or ''}{wanted}"


def _number(name: str, cell: str) -> tuple[float, str | None]:
    kind = _kind_of(name)
    try:
        # by its digits, as `shifted`
        number = float(cell + kind.power) if "_" not in cell else math.nan
    except ValueError:
        number = math.nan
    if kind.allows(number):
        return number, None
    number, wrong = _stated(name, cell, kind.unit)
    return number, f"{name} {wrong}" if wrong else None


@dataclass(frozen=True, slots=True)
class _Kind:
    """The unit in which the name of a column ends, its power of ten as numbers have it, and whether a finite
    number is all that a cell may be."""

    unit: str
    power: str
    any_number: bool

    def allows(self, number: float) -> bool:
        return self.any_number and math.isfinite(number)


@cache
def _kind_of(name: str) -> _Kind:
    unit = "/".join(name.split("_")[-2:]) if name.endswith("_kg") else name.rpartition("_")[2]
    power = _POWER.get(unit, 0)
    any_number = name != "direction" and not name.startswith("sigma_")
    return _Kind(unit, f"e{power}" if power else "", any_number)


def _stated(name: str, cell: str, unit: str) -> tuple[float, str | None]:
    if not cell:
        return 0.0, f"is empty; expected a number in {unit}"
    try:
        number = shifted(cell, _POWER.get(unit, 0)) if "_" not in cell else math.nan
    except ValueError:
        if re.fullmatch(r"[-+]?\d*,\d+", cell):
            return 0.0, f"= {cell} has a decimal comma; expected a decimal point"
        return 0.0, f'= "{cell}" is not a number; expected a number in {unit}'
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
    """The rows of each direction, with the words that name it in a message. All rows where the table has no
    column `direction`."""
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
