"""Axis-error tables of Heidenhain controls: `.COM` tables of values, and a `.CMA` that assigns them to axes.

A .CMA has one column per axis, which names the .COM of that axis; its row with `*` in ACTIVE is in force.
The columns of a .COM are functions of the position of its axis: AXISPOS, one column per axis that is moved,
and BACKLASH. BACKLASH holds the values of the own axis in the negative direction, where they differ. Columns
begin at the positions of their names.

Source: technical manuals (MANUALplus 620, TNC 407, iTNC 530). The first and last line of a table are taken
from other tables of these controls. It is not verified whether the control adds values to the command or
subtracts them. The caller states it, and a verification program is written beside the table.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
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
from olp.errormodel.calibration import Calibration, Curve
from olp.files.control_tables import base
from olp.files.control_tables.base import Exported, Format, Given, Imported, Load
from olp.files.control_tables.verification import checks, heidenhain_program
from olp.files.problems import Problem
from olp.findings.catalogue import Finding

#: Rows of a table, as a TNC 407 takes them.
MOST_ROWS = 256
#: The components that a table can hold.
TRANSLATIONS = tuple(name for name in COMPONENTS if name[1] in AXES)
_BEGIN = re.compile(r"BEGIN\s+(\S+)\s+(MM|INCH)\b.*", re.IGNORECASE)
_END = re.compile(r"\[END\]|END\b.*", re.IGNORECASE)

#: The names of columns, and (line, cells by name) of each row.
Sheet = tuple[list[str], list[tuple[int, dict[str, str]]]]


def _read(path: Path, given: Given, load: Load) -> Imported:
    factor = base.sign(base.sense_of(given, None, "Heidenhain"))
    names = {given.names.get(axis, axis).upper(): axis for axis in AXES}
    columns, rows = _sheet(base.text_of(load(path)), path)
    if "ACTIVE" not in columns:
        raise ConfigError("has no column ACTIVE; expected the .CMA that assigns .COM tables", file=str(path))
    active = [(line, cells) for line, cells in rows if cells["ACTIVE"] == "*"]
    if len(active) != 1:
        raise ConfigError(f"{len(active)} rows are active (*); expected one", file=str(path))
    line, cells = active[0]
    curves: list[Curve] = []
    for column, text in cells.items():
        if column not in names or not text.strip("-"):
            continue
        file = path.with_name(text if "." in text else f"{text}.com")
        curves += _columns(names[column], file, load(file), names, factor)
    if not curves:
        raise ConfigError("the active row names no table for X, Y or Z", file=str(path), line=line)
    others = [c for c in cells if c not in names and c not in ("NR", "ACTIVE") and cells[c].strip("-")]
    findings = []
    if others:
        message = f"tables of {', '.join(others)} are not of a linear axis X, Y, Z and were left out"
        findings.append(Finding("OLP872", message, count=len(others)))
    return Imported(base.calibration_of(given, curves, path), tuple(findings))


def _sheet(text: str, file: Path) -> Sheet:
    """A table with fixed columns: each reaches from the start of its name to that of the next."""
    columns: list[str] = []
    starts: list[int] = []
    rows: list[tuple[int, dict[str, str]]] = []
    problems: list[Problem] = []
    for line, raw in enumerate(text.expandtabs(8).splitlines(), 1):
        bare = raw.rstrip()
        begin = _BEGIN.fullmatch(bare.strip())
        if begin:
            if begin[2].upper() == "INCH":
                problems.append((line, "the table is in inches; expected millimetres"))
        elif _END.fullmatch(bare.strip()):
            break
        elif bare and not columns:
            names = list(re.finditer(r"\S+", bare))
            columns, starts = [m[0].upper() for m in names], [m.start() for m in names]
            double = sorted({name for name in columns if columns.count(name) > 1})
            if double:
                problems.append((line, f"column {', '.join(double)} is defined twice; expected it once"))
        elif bare:
            ends = [*starts[1:], len(bare) + 1]
            cells = [bare[start:end] for start, end in zip(starts, ends, strict=True)]
            if any(len(cell.split()) > 1 for cell in cells) or bare[: starts[0]].strip():
                problems.append((line, "a cell is not under the name of its column; expected fixed columns"))
            rows.append((line, {name: cell.strip() for name, cell in zip(columns, cells, strict=True)}))
    base.refuse(problems, file)
    if not columns:
        raise ConfigError("has no names of columns; expected names such as NR AXISPOS X", file=str(file))
    return columns, rows


def _columns(axis: str, file: Path, data: bytes, names: dict[str, str], factor: float) -> list[Curve]:
    """The curves of one .COM table, whose positions are those of `axis`."""
    columns, rows = _sheet(base.text_of(data), file)
    if "AXISPOS" not in columns:
        raise ConfigError("has no column AXISPOS; expected a .COM table", file=str(file))
    problems: list[Problem] = []
    kept = [column for column in columns if column != "NR"]
    used = [column for column in kept if column != "BACKLASH" or any(c["BACKLASH"] for _, c in rows)]
    table: list[list[float]] = []
    for line, cells in rows:
        numbers = [base.number(cells[column]) for column in used]
        wrong = [column for column, number in zip(used, numbers, strict=True) if number is None]
        problems += [(line, f'{column} = "{cells[column]}" is not a number') for column in wrong]
        table.append([0.0 if number is None else number for number in numbers])
    position = used.index("AXISPOS")
    lines = [line for line, _ in rows]
    pairs = list(zip(lines, (row[position] for row in table), strict=True))
    problems += [] if problems else base.order_problems(pairs, "AXISPOS")
    own = next((column for column in used if names.get(column) == axis), None)
    if "BACKLASH" in used and own is None:
        problems.append((None, f"has BACKLASH, but no column of its own axis {axis}; expected both"))
    base.refuse(problems, file)
    values = np.array(table)
    curves = []
    for column in used:
        if column not in names:
            continue
        forward = base.signed(values[:, used.index(column)], factor)
        backward = None
        if column == own and "BACKLASH" in used:
            backward = base.signed(values[:, used.index("BACKLASH")], factor)
        curves.append(base.linear_curve(f"E{names[column]}{axis}", values[:, position], forward, backward))
    return curves


def _write(calibration: Calibration, target: Path, given: Given) -> Exported:
    sense = base.sense_of(given, None, "Heidenhain")
    factor = base.sign(sense)
    names = {axis: given.names.get(axis, axis) for axis in AXES}
    most = min(MOST_ROWS, given.most or MOST_ROWS)
    straight = as_straightness(along_axes(calibration))
    written: list[Rows] = []
    files: dict[Path, bytes] = {}
    assigned: dict[str, str] = {}
    crossed: set[str] = set()
    for axis in AXES:
        own = [component_rows(straight, f"E{d}{axis}", most=most) for d in AXES]
        parts = [rows for rows in own if rows is not None]
        if not parts:
            continue
        position = _shared(parts, most)
        parts = [_onto(rows, position) for rows in parts]
        written += parts
        crossed |= {rows.name for rows in parts if rows.both and rows.name[1] != axis}
        file = target.with_name(f"{target.stem}_{axis.lower()}.com")
        assigned[axis] = file.name
        files[file] = _com(file.name, axis, parts, names, factor)
    header = ["NR", "ACTIVE", *(names[axis] for axis in AXES)]
    row = ["0", "*", *(assigned.get(axis, "") for axis in AXES)]
    cma = _fixed([f"BEGIN {target.name.upper()} MM"], header, [row])
    verify = target.with_name(f"{target.stem}-verify.h")
    program = heidenhain_program(checks(written), names, verify.stem)
    findings: list[Finding] = [
        *base.not_held(calibration, (*TRANSLATIONS, *SQUARENESS), written),
        *base.coarse(written, MISS_MM, MISS_RAD),
        *base.backlash_in_table(calibration, AXES),
        Finding("OLP874", f"the sign convention is {sense}, as stated; run {verify.name} before any part"),
    ]
    if crossed:
        named = ", ".join(sorted(crossed))
        message = f"{named} differ by direction, and BACKLASH is for the own axis only: the mean is written"
        findings.append(Finding("OLP871", message, count=len(crossed)))
    held = {
        rows.name for rows in written if any(rows.name in c.names for c in along_axes(calibration).curves)
    }
    square = {n for n, value in calibration.squareness.items() if value}
    notes = (f"sign convention of the values: {sense}; the tables cannot hold a comment",)
    return Exported({target: cma, **files, verify: program}, frozenset(held | square), tuple(findings), notes)


def _shared(parts: Sequence[Rows], most: int) -> np.ndarray:
    """The positions of all columns of an axis. Where these are too many, those of the longest column."""
    position = np.unique(np.concatenate([rows.position_mm for rows in parts]))
    return position if len(position) <= most else max((r.position_mm for r in parts), key=len)


def _onto(rows: Rows, position: np.ndarray) -> Rows:
    if np.array_equal(rows.position_mm, position):
        return rows
    forward, backward = (
        np.round(np.interp(position, rows.position_mm, v), 8) for v in (rows.forward, rows.backward)
    )
    return Rows(rows.name, position, forward, backward, rows.both, rows.miss, rows.cyclic)


def _com(name: str, axis: str, parts: Sequence[Rows], names: dict[str, str], factor: float) -> bytes:
    own = next((rows for rows in parts if rows.name[1] == axis), None)
    both = own is not None and own.both
    header = ["NR", "AXISPOS", *(names[rows.name[1]] for rows in parts), *(["BACKLASH"] if both else [])]
    values = [parts[0].position_mm]
    values += [base.signed(rows.forward if rows is own else rows.mean, factor) for rows in parts]
    if own is not None and both:
        values.append(base.signed(own.backward, factor))
    table = zip(*(column.tolist() for column in values), strict=True)
    rows = [[str(i), *map(base.shown, row)] for i, row in enumerate(table)]
    return _fixed([f"BEGIN {name.upper()} MM"], header, rows)


def _fixed(first: list[str], header: list[str], rows: list[list[str]]) -> bytes:
    widths = [max(len(row[k]) for row in [header, *rows]) + 2 for k in range(len(header))]
    lines = ["".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)) for row in [header, *rows]]
    return "".join(f"{line.rstrip()}\n" for line in [*first, *lines, "[END]"]).encode("ascii", "replace")


FORMAT = Format(
    "heidenhain",
    "Heidenhain axis-error tables (.CMA, .COM)",
    ".cma",
    None,
    "technical manuals; frame of the file and sign convention not verified",
    "9 translations by the position of one axis, the own one in both directions; squareness as slopes",
    _read,
    _write,
    lambda calibration, chain: AxisTables(calibration),
)
