"""Axis-error tables of Heidenhain controls: `.COM` tables of values, and a `.CMA` that assigns them to axes.

A column of a .COM is a function of the axis in whose column of the .CMA its name stands. A .COM has the
columns AXISPOS, one column an axis that is moved, and BACKLASH: the values of its own axis in the negative
direction, where they differ. The row of the .CMA with `*` in ACTIVE is in force. Columns are fixed by the
places of their names. Source: technical manuals (MANUALplus 620, TNC 407, iTNC 530); the first and last line
of a table are taken from other tables of these controls. Whether values are added to the command or taken
off it is not verified: the caller states it, and a verification program is written beside the table.
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
        message = f"tables of {', '.join(others)} are of no linear axis X, Y, Z and were left out"
        findings.append(Finding("OLP872", message, count=len(others)))
    return Imported(base.calibration_of(given, curves, path), tuple(findings))


def _sheet(text: str, file: Path) -> Sheet:
    """A table with fixed columns: each reaches from the place of its name to that of the next."""
    columns: list[str] = []
    places: list[int] = []
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
            found = list(re.finditer(r"\S+", bare))
            columns, places = [m[0].upper() for m in found], [m.start() for m in found]
            double = sorted({name for name in columns if columns.count(name) > 1})
            if double:
                problems.append((line, f"column {', '.join(double)} stands twice; expected it once"))
        elif bare:
            ends = [*places[1:], len(bare) + 1]
            cells = [bare[start:end] for start, end in zip(places, ends, strict=True)]
            if any(len(cell.split()) > 1 for cell in cells) or bare[: places[0]].strip():
                problems.append((line, "a cell does not stand under its column; expected fixed columns"))
            rows.append((line, {name: cell.strip() for name, cell in zip(columns, cells, strict=True)}))
    base.refuse(problems, file)
    if not columns:
        raise ConfigError("holds no names of columns; expected such as NR AXISPOS X", file=str(file))
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
        problems += [(line, f'{column} = "{cells[column]}" is no number') for column in wrong]
        table.append([0.0 if number is None else number for number in numbers])
    place = used.index("AXISPOS")
    lines = [line for line, _ in rows]
    pairs = list(zip(lines, (row[place] for row in table), strict=True))
    problems += [] if problems else base.order_problems(pairs, "AXISPOS")
    own = next((column for column in used if names.get(column) == axis), None)
    if "BACKLASH" in used and own is None:
        problems.append((None, f"has BACKLASH, but no column of its own axis {axis}"))
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
        curves.append(base.linear_curve(f"E{names[column]}{axis}", values[:, place], forward, backward))
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
        found = [rows for rows in own if rows is not None]
        if not found:
            continue
        position = _shared(found, most)
        found = [_onto(rows, position) for rows in found]
        written += found
        crossed |= {rows.name for rows in found if rows.both and rows.name[1] != axis}
        file = target.with_name(f"{target.stem}_{axis.lower()}.com")
        assigned[axis] = file.name
        files[file] = _com(file.name, axis, found, names, factor)
    header = ["NR", "ACTIVE", *(names[axis] for axis in AXES)]
    row = ["0", "*", *(assigned.get(axis, "") for axis in AXES)]
    cma = _fixed([f"BEGIN {target.name.upper()} MM"], header, [row])
    verify = target.with_name(f"{target.stem}-verify.h")
    program = heidenhain_program(checks(written), names, verify.stem)
    findings: list[Finding] = [
        *base.not_held(calibration, (*TRANSLATIONS, *SQUARENESS), written),
        *base.coarse(written, MISS_MM, MISS_RAD),
        *base.backlash_in_table(calibration, AXES),
        Finding("OLP874", f"values have the sense stated, {sense}; run {verify.name} before any part"),
    ]
    if crossed:
        named = ", ".join(sorted(crossed))
        message = f"{named} differ by direction, and BACKLASH is for the own axis: the mean is written"
        findings.append(Finding("OLP871", message, count=len(crossed)))
    held = {
        rows.name for rows in written if any(rows.name in c.names for c in along_axes(calibration).curves)
    }
    square = {n for n, value in calibration.squareness.items() if value}
    notes = (f"sense of the values: {sense}; the tables have no place for a comment",)
    return Exported({target: cma, **files, verify: program}, frozenset(held | square), tuple(findings), notes)


def _shared(found: Sequence[Rows], most: int) -> np.ndarray:
    """The positions of all columns of an axis; those of the longest where together they are too many."""
    position = np.unique(np.concatenate([rows.position_mm for rows in found]))
    return position if len(position) <= most else max((r.position_mm for r in found), key=len)


def _onto(rows: Rows, position: np.ndarray) -> Rows:
    if np.array_equal(rows.position_mm, position):
        return rows
    forward, backward = (
        np.round(np.interp(position, rows.position_mm, v), 8) for v in (rows.forward, rows.backward)
    )
    return Rows(rows.name, position, forward, backward, rows.both, rows.miss, rows.cyclic)


def _com(name: str, axis: str, found: Sequence[Rows], names: dict[str, str], factor: float) -> bytes:
    own = next((rows for rows in found if rows.name[1] == axis), None)
    both = own is not None and own.both
    header = ["NR", "AXISPOS", *(names[rows.name[1]] for rows in found), *(["BACKLASH"] if both else [])]
    values = [found[0].position_mm]
    values += [base.signed(rows.forward if rows is own else rows.mean, factor) for rows in found]
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
    "technical manuals; frame of the file and sense not verified",
    "9 translations by the position of one axis, the own one in both directions; squareness as slopes",
    _read,
    _write,
    lambda calibration, chain: AxisTables(calibration),
)
