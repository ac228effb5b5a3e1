"""Sag compensation of Sinumerik controls: tables `$AN_CEC`, one input axis and one output axis each.

`$AN_CEC[t,n]` is the value at row n of table t. Rows are at equal steps from `_MIN` to `_MAX`. The control
interpolates linearly between them and uses the end values outside. `_DIRECTION` 0 is for both directions of
the input axis, 1 and -1 for one of them: two tables make a backlash that depends on position. Values of
several tables are added. MD18342 must hold the number of rows before the tables are loaded. A Sinumerik 828D
has 8 tables of 200 rows.

Source: the function manual "Compensations" (K3). It is not verified whether the control adds values to the
command or subtracts them. The caller states it, and a verification program is written beside the table.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import field
from decimal import ROUND_HALF_EVEN, Decimal
from pathlib import Path

import numpy as np

from olp.calibration.control_tables.controls import AxisTables
from olp.calibration.control_tables.rows import (
    MISS_MM,
    MISS_RAD,
    Rows,
    along_axes,
    as_straightness,
    component_rows,
)
from olp.core.errors import ConfigError
from olp.core.machine import COMPONENTS, SQUARENESS
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.errormodel.calibration import Calibration, Curve
from olp.files.control_tables import base
from olp.files.control_tables.base import Exported, Format, Given, Imported, Load
from olp.files.control_tables.verification import checks, siemens_program
from olp.files.problems import Problem
from olp.findings.catalogue import Finding

#: Rows of a table where the caller does not limit them: those of a Sinumerik 828D.
MOST_ROWS = 200
#: The components that a table can hold.
TRANSLATIONS = tuple(name for name in COMPONENTS if name[1] in AXES)
_VALUE = re.compile(r"\$AN_CEC\[\s*(\d+)\s*,\s*(\d+)\s*\]\s*=\s*(\S+)", re.IGNORECASE)
_KEY = re.compile(r"\$AN_CEC_([A-Z_]+)\[\s*(\d+)\s*\]\s*=\s*(\S+)", re.IGNORECASE)
_FRAME = re.compile(r"%.*|N?\d*\s*(CHANDATA\(\d+\)|RET|M0?[012]|M17|M30)", re.IGNORECASE)
_KEYS = ("INPUT_AXIS", "OUTPUT_AXIS", "STEP", "MIN", "MAX", "DIRECTION", "MULT_BY_TABLE", "IS_MODULO")
#: What some programs write for "no modulo axis". From MIN to MAX a table with and without modulo is the same.
_NO_MODULO = -1
#: The highest row number that is read: a higher one is a mistake.
_MOST_NUMBER = 100_000


@dataclass(slots=True)
class _Table:
    """One table of a file: its first line, its keys and its rows, each with its line."""

    line: int
    keys: dict[str, tuple[int, str]] = field(default_factory=dict)
    rows: dict[int, tuple[int, float]] = field(default_factory=dict)


def _read(path: Path, given: Given, load: Load) -> Imported:
    factor = base.sign(base.sense_of(given, None, "Sinumerik"))
    problems: list[Problem] = []
    tables = _tables(load(path), problems)
    base.refuse(problems, path)
    names = {control.upper(): axis for axis, control in _names(given).items()}
    sides: dict[tuple[str, int], tuple[int, np.ndarray, np.ndarray]] = {}
    for table in tables.values():
        read = _one(table, names, problems)
        if read is None:
            continue
        name, direction, position, values = read
        if (name, direction) in sides or (name, 0) in sides or (direction == 0 and (name, 1) in sides):
            first = sides.get((name, direction)) or sides.get((name, 0)) or sides[name, 1]
            problems.append(
                (table.line, f"a second table of {name[2]} for {name[1]} (the first at line {first[0]}); "
                 "expected one for both directions, or one per direction: add their values")
            )  # fmt: skip
        sides[name, direction] = table.line, position, base.signed(values, factor)
    curves = [curve for name in COMPONENTS for curve in _curves(name, sides, problems)]
    base.refuse(problems, path)
    if not curves:
        raise ConfigError("holds no table; expected lines such as $AN_CEC[0,0]=0.012", file=str(path))
    return Imported(base.calibration_of(given, curves, path))


def _tables(data: bytes, problems: list[Problem]) -> dict[int, _Table]:
    tables: dict[int, _Table] = {}
    for line, bare in base.lines(data, ";"):
        if not bare or _FRAME.fullmatch(bare):
            continue
        value, key = _VALUE.fullmatch(bare), _KEY.fullmatch(bare)
        if value:
            number = base.number(value[3])
            table = tables.setdefault(int(value[1]), _Table(line))
            row = int(value[2])
            if number is None or row > _MOST_NUMBER:
                problems.append((line, f'"{bare[:50]}" holds no number, or a row above {_MOST_NUMBER}'))
            elif row in table.rows:
                problems.append((line, f"row {row} of table {value[1]} is defined twice; expected it once"))
            else:
                table.rows[row] = line, number
        elif key and key[1].upper() in _KEYS:
            tables.setdefault(int(key[2]), _Table(line)).keys[key[1].upper()] = line, key[3]
        else:
            problems.append((line, f'"{bare[:50]}" is not understood; expected $AN_CEC variables'))
    return tables


def _one(
    table: _Table, names: dict[str, str], problems: list[Problem]
) -> tuple[str, int, np.ndarray, np.ndarray] | None:
    """Component, direction, positions and values of a table; None where something is wrong with it."""
    before = len(problems)
    axes = []
    for key in ("INPUT_AXIS", "OUTPUT_AXIS"):
        line, text = table.keys.get(key, (table.line, ""))
        name = text.strip("()\"' ").upper()
        if name not in names:
            problems.append(
                (line, f'{key} "{name}" is not one of {", ".join(names)}; name its axis, such as '
                 f'--axis-name X={name or "X1"}')
            )  # fmt: skip
        axes.append(names.get(name, "X"))
    numbers: dict[str, Decimal] = {}
    for key, default in (("STEP", None), ("MIN", None), ("MAX", None), ("DIRECTION", 0),
                         ("MULT_BY_TABLE", 0), ("IS_MODULO", 0)):  # fmt: skip
        line, text = table.keys.get(key, (table.line, "" if default is None else str(default)))
        if base.number(text) is None:
            problems.append((line, f"{key} is missing or not a number; expected a number"))
        else:
            numbers[key] = Decimal(text)
    if len(problems) > before:
        return None
    for key, what in (("MULT_BY_TABLE", "a product of tables"), ("IS_MODULO", "a modulo axis")):
        if numbers[key] and not (key == "IS_MODULO" and numbers[key] == _NO_MODULO):
            problems.append((table.keys[key][0], f"{key} makes {what}, which a calibration cannot hold"))
    if numbers["DIRECTION"] not in (-1, 0, 1):
        problems.append((table.keys["DIRECTION"][0], "DIRECTION is wrong; expected 0, 1 or -1"))
    step, low, high = numbers["STEP"], numbers["MIN"], numbers["MAX"]
    if step <= 0 or high <= low:
        problems.append((table.line, "STEP or MAX is wrong; expected STEP above 0 and MAX above MIN"))
        return None
    exact = (high - low) / step
    count = int(exact.to_integral_value(ROUND_HALF_EVEN)) + 1
    if exact != count - 1:
        problems.append((table.keys["MAX"][0], f"MAX - MIN is {exact:.3f} steps; expected an integer"))
    elif set(table.rows) != set(range(count)):
        missing = sorted(set(range(min(count, _MOST_NUMBER))) - set(table.rows))
        what = f"row {missing[0]} is missing" if missing else f"row {max(table.rows)} lies beyond MAX"
        problems.append((table.line, f"{what}; expected rows 0 to {count - 1} by STEP, MIN and MAX"))
    if len(problems) > before:
        return None
    position = np.array([float(low + step * i) for i in range(count)])
    values = np.array([table.rows[i][1] for i in range(count)])
    return f"E{axes[1]}{axes[0]}", int(numbers["DIRECTION"]), position, values


def _curves(
    name: str, tables: dict[tuple[str, int], tuple[int, np.ndarray, np.ndarray]], problems: list[Problem]
) -> Iterator[Curve]:
    if (name, 0) in tables:
        _, position, values = tables[name, 0]
        yield base.linear_curve(name, position, values, None)
        return
    sides = [tables.get((name, direction)) for direction in (1, -1)]
    one = next((side for side in sides if side is not None), None)
    if one is None:
        return
    line, position, values = one
    columns = [np.zeros(len(position)) if side is None else side[2] for side in sides]
    if any(side is not None and not np.array_equal(side[1], position) for side in sides):
        sentence = f"the tables of {name} differ by direction in MIN, MAX or STEP; expected the same in both"
        problems.append((line, sentence))
        return
    yield base.linear_curve(name, position, columns[0], columns[1])


def _names(given: Given) -> dict[str, str]:
    return {axis: given.names.get(axis, f"{axis}1") for axis in AXES}


def _write(calibration: Calibration, target: Path, given: Given) -> Exported:
    sense = base.sense_of(given, None, "Sinumerik")
    factor = base.sign(sense)
    names, most = _names(given), given.most or MOST_ROWS
    straight = as_straightness(along_axes(calibration))
    written: list[Rows] = []
    body: list[str] = []
    count = 0
    for name in TRANSLATIONS:
        rows = component_rows(straight, name, most=most, even=True)
        if rows is None:
            continue
        written.append(rows)
        sides = [(1, rows.forward), (-1, rows.backward)] if rows.both else [(0, rows.forward)]
        for direction, values in sides:
            pair = names[name[2]], names[name[1]]
            body += _lines(count, rows.position_mm, base.signed(values, factor), direction, pair)
            count += 1
    longest = max((len(rows.position_mm) for rows in written), default=0)
    head = [
        "%_N_NC_CEC_INI",
        f"; sag compensation of {calibration.machine}, mm; sense: {sense}",
        "; error: values are actual minus commanded, subtracted from the command; correction: added to it",
        f"; {count} tables of at most {longest} rows: set MD18342 for each before loading, then MD32710",
        "CHANDATA(1)",
    ]
    text = "\n".join([*head, *body, "M17"]) + "\n"
    files = {target: text.encode("ascii", "replace")}
    verify = target.with_name(f"{target.stem}-verify.mpf")
    files[verify] = siemens_program(checks(written), calibration.machine)
    findings: list[Finding] = [
        *base.not_held(calibration, (*TRANSLATIONS, *SQUARENESS), written),
        *base.coarse(written, MISS_MM, MISS_RAD),
        *base.backlash_in_table(calibration, AXES),
        Finding("OLP874", f"the sign convention is {sense}, as stated; run {verify.name} before any part"),
    ]
    held = {
        rows.name for rows in written if any(rows.name in c.names for c in along_axes(calibration).curves)
    }
    square = {n for n, value in calibration.squareness.items() if value}
    return Exported(files, frozenset(held | square), tuple(findings))


def _lines(
    index: int, position: np.ndarray, values: np.ndarray, direction: int, pair: tuple[str, str]
) -> Iterator[str]:
    for row, value in enumerate(values.tolist()):
        yield f"$AN_CEC[{index},{row}]={base.shown(value)}"
    first, second = (Decimal(repr(value)) for value in position[:2].tolist())
    step, last = second - first, first + (second - first) * (len(position) - 1)
    keys = (f"({pair[0]})", f"({pair[1]})", f"{step:f}", f"{first:f}", f"{last:f}", direction, 0, 0)
    yield from (f"$AN_CEC_{key}[{index}]={value}" for key, value in zip(_KEYS, keys, strict=True))


FORMAT = Format(
    "siemens-cec",
    "Siemens Sinumerik sag compensation (CEC)",
    ".mpf",
    None,
    "function manual; sign convention not verified",
    "9 translations by the position of one axis, both directions; squareness as slopes",
    _read,
    _write,
    lambda calibration, chain: AxisTables(calibration),
)
