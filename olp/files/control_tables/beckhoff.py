"""Leadscrew compensation of Beckhoff TwinCAT CNC and the ISG kernel: lists `kw.ssfk`, one for each axis.

A list states in `kw.ssfk` how its table is laid out. `interval` is the step between rows from
`kw_startpos`, and 0 where each row has its `setpoint`. `kw_nr_max` is the number of rows. `unit` 1 means
tenths of a micrometre, and 0 increments of the encoder. With `bilateral` each row has a value by direction,
`pos` and `neg`. The control interpolates linearly. A value is the measured position less the setpoint.
Several lists may stand in one file, each below the number of its axis. The control takes one for each axis.

Source: the manual of the maker, TF5200 axis compensation, with its examples.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import field
from pathlib import Path

import numpy as np

from olp.calibration.control_tables.controls import AxisTables
from olp.calibration.control_tables.rows import MISS_MM, MISS_RAD, Rows, component_rows
from olp.core.arrays import Array
from olp.core.errors import ConfigError, UsageError
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.errormodel.calibration import Calibration, Curve
from olp.files.control_tables import base
from olp.files.control_tables.base import Exported, Format, Given, Imported, Load
from olp.files.problems import Problem
from olp.findings.catalogue import Finding

#: Rows of a table where nothing states more: those of older builds of the control.
MOST_ROWS = 1500
#: Tenths of a micrometre in a millimetre.
TENTHS = 10_000
#: The components that lists can hold.
HELD = ("EXX", "EYY", "EZZ")
_LINE = re.compile(r"(kopf|kw\.ssfk)\.([A-Za-z_]\w*)\s*(?:=\s*)?(.*)")
_ROW = re.compile(r"kw\.ssfk\.table\[(\d+)\]\.(setpoint|pos|neg)\s*(?:=\s*)?(.*)")
_WHOLE = re.compile(r"[-+]?\d{1,12}")
_LAYOUT = ("interval", "kw_startpos", "kw_nr_max", "unit", "bilateral", "modulo")
#: Keys that change no value of the table.
_BESIDE = ("manual_activation", "max_points")
#: The highest row number that is read: a higher one is a mistake.
_MOST_NUMBER = 100_000


@dataclass(slots=True)
class _List:
    """The list of one axis: its first line, the name of its axis, its layout and its rows by column, each
    with its line."""

    line: int
    name: str = ""
    layout: dict[str, tuple[int, int]] = field(default_factory=dict)
    rows: dict[str, dict[int, tuple[int, int]]] = field(
        default_factory=lambda: {"setpoint": {}, "pos": {}, "neg": {}}
    )


def _read(path: Path, given: Given, load: Load) -> Imported:
    factor = base.sign(base.sense_of(given, FORMAT.sense, "Beckhoff"))
    problems: list[Problem] = []
    lists = list(_lists(load(path), problems))
    base.refuse(problems, path)
    curves: list[Curve] = []
    for one in lists:
        axis = _axis(one, given, len(lists), path)
        table = _table(one, problems)
        if table is None:
            continue
        position, forward, backward = table
        name = f"E{axis}{axis}"
        if any(name in curve.names for curve in curves):
            problems.append((one.line, f"a second list of axis {axis}; expected one list for each axis"))
            continue
        sides = [base.signed(side / TENTHS, factor) for side in (forward, backward) if side is not None]
        curves.append(base.linear_curve(name, position / TENTHS, sides[0], sides[1] if sides[1:] else None))
    base.refuse(problems, path)
    if not curves:
        raise ConfigError("holds no list; expected lines such as kw.ssfk.table[0].pos 12", file=str(path))
    return Imported(base.calibration_of(given, curves, path))


def _lists(data: bytes, problems: list[Problem]) -> Iterator[_List]:
    """The lists of a file. One begins with each number of an axis that follows rows."""
    own: _List | None = None
    for line, bare in base.lines(data, "#"):
        if not bare or bare.lower() == "ende":
            continue
        row, key = _ROW.fullmatch(bare), _LINE.fullmatch(bare)
        if own is None or (key is not None and key[2].endswith("achs_nr") and own.rows["pos"]):
            if own is not None:
                yield own
            own = _List(line)
        if row is not None:
            number, column = int(row[1]), own.rows[row[2]]
            if number in column or number > _MOST_NUMBER or not _WHOLE.fullmatch(row[3]):
                what = f'"{bare[:50]}" is given twice, or is not an integer'
                problems.append((line, f"{what}; expected each row once, in tenths of a micrometre"))
            else:
                column[number] = line, int(row[3])
        elif key is not None and key[1] == "kopf":
            own.name = key[3].strip() if key[2] == "log_achs_name" else own.name
        elif key is not None and key[2] in _LAYOUT and _WHOLE.fullmatch(key[3]):
            own.layout[key[2]] = line, int(key[3])
        elif key is None or key[2] not in _BESIDE:
            problems.append(
                (line, f'"{bare[:50]}" is not understood; expected keys of kw.ssfk with integers')
            )
    if own is not None:
        yield own


def _axis(one: _List, given: Given, lists: int, path: Path) -> str:
    """The axis of a list: that of the call, or the one that its name says. Raises UsageError."""
    named = {control.upper(): axis for axis, control in given.names.items()} | {axis: axis for axis in AXES}
    word = re.split(r"[\s_-]", one.name.upper(), maxsplit=1)[0]
    said = named.get(one.name.upper(), named.get(word))
    if given.axis is not None and lists == 1 and said in (None, given.axis):
        return given.axis
    if said is None or (given.axis is not None and said != given.axis):
        raise UsageError(
            f'the list at line {one.line} is of axis "{one.name}"; state its axis with --axis-name, such as '
            f"--axis-name X={one.name or 'NAME'}, or with --axis for a file of one list",
            file=str(path),
        )
    return said


def _table(one: _List, problems: list[Problem]) -> tuple[Array, Array, Array | None] | None:
    """Positions and values of both directions in tenths of a micrometre; None where something is wrong."""
    before = len(problems)
    layout = {key: value for key, (_, value) in one.layout.items()}
    for key in ("interval", "kw_nr_max", "unit", "bilateral"):
        if key not in layout:
            problems.append((one.line, f"kw.ssfk.{key} is missing; expected a list as the manual shows it"))
    for key, good, what in (("unit", 1, "increments of the encoder"), ("modulo", 0, "a modulo axis")):
        if layout.get(key, good) != good:
            problems.append((one.layout[key][0], f"kw.ssfk.{key} means {what}; expected {good}"))
    if len(problems) > before:
        return None
    count, step = layout["kw_nr_max"], layout["interval"]
    columns = ["pos", *(["neg"] if layout["bilateral"] else []), *(["setpoint"] if step == 0 else [])]
    for column in columns:
        wrong = sorted(set(one.rows[column]) ^ set(range(min(count, _MOST_NUMBER))))
        if wrong:
            what = "missing" if wrong[0] < count else "beyond kw_nr_max"
            sentence = f"kw.ssfk.table[{wrong[0]}].{column} is {what}; expected rows 0 to {count - 1}"
            problems.append((one.line, sentence))
    for column in sorted({"setpoint", "neg"} - set(columns)):
        if one.rows[column]:
            first = min(line for line, _ in one.rows[column].values())
            problems.append((first, f"a {column} that interval and bilateral do not use; leave the rows out"))
    if len(problems) > before:
        return None
    values = {c: np.array([one.rows[c][row][1] for row in range(count)], float) for c in columns}
    position = values.get("setpoint", layout.get("kw_startpos", 0) + step * np.arange(count, dtype=float))
    rows = [(one.line if step else one.rows["setpoint"][k][0], q) for k, q in enumerate(position / TENTHS)]
    problems += base.order_problems(rows, "position")
    return None if len(problems) > before else (position, values["pos"], values.get("neg"))


def _write(calibration: Calibration, target: Path, given: Given) -> Exported:
    factor = base.sign(base.sense_of(given, FORMAT.sense, "Beckhoff"))
    written: list[Rows] = []
    lists: list[str] = []
    for number, (name, axis) in enumerate(zip(HELD, AXES, strict=True), 1):
        rows = component_rows(calibration, name, most=given.most or MOST_ROWS)
        if rows is None:
            continue
        lists += _list(rows, number, given.names.get(axis, axis), factor)
        written.append(rows)
    if not lists:
        raise ConfigError("the calibration holds none of EXX, EYY and EZZ; expected one of them")
    corrects = frozenset(rows.name for rows in written)
    findings: list[Finding] = [
        *base.not_held(calibration, corrects, written),
        *base.coarse(written, MISS_MM, MISS_RAD),
        *base.backlash_in_table(calibration, AXES),
    ]
    head = [
        "# leadscrew compensation in 0.1 um: measured position less setpoint, which the control subtracts",
        "# one list for each axis, from its number to Ende: the control takes each in a file of its own",
    ]
    data = ("\n".join([*head, *lists]) + "\n").encode("ascii", "replace")
    return Exported({target: data}, corrects, tuple(findings))


def _list(rows: Rows, number: int, axis: str, factor: float) -> Iterator[str]:
    """A list with a setpoint for each row; all values are rounded to tenths of a micrometre."""
    keys = {
        "kopf.log_achs_nr": number, "kopf.log_achs_name": axis, "kw.ssfk.interval": 0,
        "kw.ssfk.kw_startpos": _tenths(rows.position_mm)[0], "kw.ssfk.kw_nr_max": len(rows.position_mm),
        "kw.ssfk.unit": 1, "kw.ssfk.bilateral": int(rows.both),
    }  # fmt: skip
    yield from (f"{key} {value}" for key, value in keys.items())
    columns = {"setpoint": rows.position_mm, "pos": base.signed(rows.forward, factor)}
    if rows.both:
        columns["neg"] = base.signed(rows.backward, factor)
    for column, values in columns.items():
        yield from (f"kw.ssfk.table[{k}].{column} {value}" for k, value in enumerate(_tenths(values)))
    yield "Ende"


def _tenths(values_mm: Array) -> list[int]:
    return [int(value) for value in np.rint(values_mm * TENTHS).tolist()]


FORMAT = Format(
    "beckhoff-ssfk",
    "Beckhoff TwinCAT CNC and ISG leadscrew compensation (kw.ssfk)",
    ".lis",
    "error",
    "manual of the maker with its examples",
    "EXX, EYY, EZZ by their own position, both directions, in steps of 0.1 um; one list for each axis",
    _read,
    _write,
    lambda calibration, chain: AxisTables(calibration),
)
