"""Etalon's exchange format, variant "Vendor": one section per parameter, read by ISG and Beckhoff controls.

A section `[EXX]` has `Gridpoints = {`, one line `position value` per row, and `}`. A section `[C0Y]` has
`VALUE = ...`. `//` begins a comment; units are mm and rad. The sign convention and the zero of lever arms are
those of the ISG format (see there).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from olp.calibration.control_tables.rows import MISS_MM, MISS_RAD, along_axes, component_rows, zeroed
from olp.core.errors import ConfigError
from olp.core.machine import COMPONENTS, SQUARENESS
from olp.errormodel.calibration import Calibration, Curve
from olp.files.control_tables import base
from olp.files.control_tables.base import Exported, Format, Given, Imported, Load
from olp.files.control_tables.isg import (
    SENSE,
    check_chain,
    control,
    corrected_names,
    reference_of,
    without_direction,
)
from olp.files.problems import Problem
from olp.findings.catalogue import Finding

_SECTION = re.compile(r"\[\s*(\w+)\s*\]")

#: The rows of a section (line, position, value), or its one value with its line.
Section = list[tuple[int, float, float]]


def _read(path: Path, given: Given, load: Load) -> Imported:
    factor = base.sign(base.sense_of(given, SENSE, "etalon"))
    reference = reference_of(given)
    curves: list[Curve] = []
    square: dict[str, float] = {}
    ignored: list[str] = []
    problems: list[Problem] = []
    seen: set[str] = set()
    for line, name, rows, value in _sections(load(path), problems):
        if name in seen:
            problems.append((line, f"[{name}] is defined twice; expected it once"))
        seen.add(name)
        if name in COMPONENTS and rows:
            problems += base.order_problems([(n, q) for n, q, _ in rows], name)
            table = np.array([row[1:] for row in rows])
            if len(rows) > 1 and np.all(np.diff(table[:, 0]) > 0):
                curves.append(
                    base.linear_curve(
                        name, table[:, 0], base.signed(table[:, 1], factor), None, reference(name[2])
                    )
                )
        elif name in SQUARENESS and value is not None:
            square[name] = value * factor + 0.0
        elif name in COMPONENTS or name in SQUARENESS:
            what = "Gridpoints" if name in COMPONENTS else "VALUE"
            problems.append((line, f"[{name}] holds no {what}; expected {what}"))
        elif rows or value != 0.0:
            ignored.append(f"[{name}] (line {line})")
    base.refuse(problems, path)
    if not curves and not square:
        raise ConfigError('holds no error of X, Y or Z; expected sections such as [EXX], variant "Vendor"',
                          file=str(path))  # fmt: skip
    findings = []
    if ignored:
        message = f"{', '.join(ignored)} are not errors of X, Y, Z and were left out"
        findings.append(Finding("OLP872", message, count=len(ignored)))
    return Imported(base.calibration_of(given, curves, path, square), tuple(findings))


def _sections(data: bytes, problems: list[Problem]) -> Iterator[tuple[int, str, Section, float | None]]:
    """(line, name, rows, value) of each section."""
    name, first = "", 0
    rows: Section = []
    value: float | None = None
    inside = False
    lines = list(base.lines(data, "//"))
    for line, bare in [*lines, (len(lines) + 1, "[]")]:
        header = _SECTION.fullmatch(bare)
        if header or line > len(lines):
            if inside:
                problems.append((first, f"the Gridpoints of [{name}] are not closed; expected a brace"))
            if name:
                yield first, name, rows, value
            name, first = (header[1] if header else ""), line
            rows, value, inside = [], None, False
        elif not bare:
            continue
        elif inside:
            if bare == "}":
                inside = False
                continue
            numbers = [base.number(cell) for cell in bare.split()]
            if len(numbers) == 2 and numbers[0] is not None and numbers[1] is not None:
                rows.append((line, numbers[0], numbers[1]))
            else:
                problems.append((line, f'"{bare[:40]}" is not a row; expected a position and a value'))
        elif name and re.fullmatch(r"Gridpoints\s*=\s*\{", bare, re.IGNORECASE):
            inside = True
        elif name and (stated := re.fullmatch(r"VALUE\s*=\s*(\S+)", bare, re.IGNORECASE)):
            value = base.number(stated[1])
            if value is None:
                problems.append((line, f'VALUE = "{stated[1]}" is not a number; expected a number in rad'))
        elif not name or name in (*COMPONENTS, *SQUARENESS):
            problems.append((line, f'"{bare[:40]}" is not understood; expected Gridpoints or VALUE'))


def _write(calibration: Calibration, target: Path, given: Given) -> Exported:
    sense = base.sense_of(given, SENSE, "etalon")
    check_chain(given)
    table = without_direction(
        zeroed(along_axes(calibration), given.chain, given.reference or "functional-point")
    )
    factor = base.sign(sense)
    lines = [
        f"// Errors of {calibration.machine}, variant Vendor; mm and rad; chain {given.chain}",
        f"// sense: {sense}; lever arms count from axis position 0 without a tool",
    ]
    written = []
    for name in COMPONENTS:
        rows = component_rows(table, name)
        if rows is None:
            continue
        written.append(rows)
        lines += [f"[{name}]", "Gridpoints = {"]
        values = base.signed(rows.mean, factor).tolist()
        lines += [
            f"{base.shown(q)} {base.shown(v)}" for q, v in zip(rows.position_mm.tolist(), values, strict=True)
        ]
        lines.append(f"}}  // end of {name}")
    for name in SQUARENESS:
        if table.squareness.get(name, 0.0):
            lines += [f"[{name}]", f"VALUE = {base.shown(table.squareness[name] * factor)}"]
    findings = [
        *base.not_held(calibration, (*COMPONENTS, *SQUARENESS), written),
        *base.backlash_left_out(calibration),
        *base.coarse(written, MISS_MM, MISS_RAD),
    ]
    data = ("\n".join(lines) + "\n").encode("ascii", "replace")
    return Exported({target: data}, corrected_names(table), tuple(findings))


FORMAT = Format(
    "etalon",
    'Etalon exchange, variant "Vendor"',
    ".txt",
    SENSE,
    "documentation of Beckhoff and ISG",
    "18 components and squareness with lever arms and tool, mean of both directions",
    _read,
    _write,
    control,
)
