"""The tables of ISG kernels and Beckhoff TF5280 (volumetric compensation), format ISG_CSV.

A block has a header of arguments (X Y Z, and rotary axes) and parameters (EXX ... ECZ, C0Y, B0Z, A0Z), then
rows of numbers, separated by blanks. `//` begins a comment, and a line with `#` a new block. Units are mm and
rad. More than one argument makes a table over a grid. The control interpolates linearly.

The documentation calls the parameters errors (ISO 230-1, ISO/TR 16907): actual minus commanded. Lever arms
are assumed to count from axis position 0, without a tool. For axes that carry the workpiece the documentation
does not say whether errors are those at the tool or at a point fixed on the table. The caller states it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from olp.calibration.control_tables.controls import Control, Volumetric
from olp.calibration.control_tables.rows import MISS_MM, MISS_RAD, along_axes, common_rows, zeroed
from olp.core.arrays import Array
from olp.core.errors import ConfigError, UsageError
from olp.core.machine import COMPONENTS, SQUARENESS, ZERO
from olp.core.units import AXES
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve, Reference
from olp.files.control_tables import base
from olp.files.control_tables.base import Exported, Format, Given, Imported, Load, Sense
from olp.files.problems import Problem
from olp.findings.catalogue import Finding

#: The sign convention of the format.
SENSE: Sense = "error"
#: Names of columns that are arguments.
_ARGUMENTS = "XYZABCUVW"

#: A block: the line of its header, its names, and its rows with their lines.
Block = tuple[int, list[str], list[tuple[int, list[float]]]]


def _read(path: Path, given: Given, load: Load) -> Imported:
    factor = base.sign(base.sense_of(given, SENSE, "isg"))
    reference = reference_of(given)
    curves: list[Curve] = []
    square: dict[str, float] = {}
    ignored: list[str] = []
    problems: list[Problem] = []
    seen: set[str] = set()
    for line, header, rows in _blocks(load(path), problems):
        arguments = [name for name in header if name in _ARGUMENTS]
        names = [name for name in header if name not in arguments]
        table = np.array([row for _, row in rows]).reshape(len(rows), len(header))
        lines = [number for number, _ in rows]
        for name in names:
            if name in seen:
                problems.append((line, f"{name} is defined twice; expected it in one block"))
            seen.add(name)
            if not rows:
                problems.append((line, f"no row follows the header of {name}; expected at least 2"))
                continue
            values = table[:, header.index(name)]
            if name in SQUARENESS:
                if len(set(values.tolist())) > 1:
                    problems.append((line, f"{name} changes with position; expected one value"))
                else:
                    square[name] = float(values[0]) * factor + 0.0
            elif name in COMPONENTS:
                columns = _component(name, header, arguments, table, lines, problems)
                if columns is not None:
                    position, error = columns
                    error = base.signed(error, factor)
                    curves.append(base.linear_curve(name, position, error, None, reference(name[2])))
            elif np.any(values):
                ignored.append(f"{name} (line {line})")
    base.refuse(problems, path)
    if not curves and not square:
        raise ConfigError("holds no error of X, Y or Z; expected columns such as X EXX EYX", file=str(path))
    findings = []
    if ignored:
        message = f"{', '.join(ignored)} are not errors of X, Y, Z and were left out"
        findings.append(Finding("OLP872", message, count=len(ignored)))
    return Imported(base.calibration_of(given, curves, path, square), tuple(findings))


def _blocks(data: bytes, problems: list[Problem]) -> Iterator[Block]:
    line, header = 0, list[str]()
    rows: list[tuple[int, list[float]]] = []
    for number, bare in base.lines(data, "//"):
        if bare.startswith("#"):
            if header:
                yield line, header, rows
            header, rows = [], []
        elif bare and not header:
            line, header = number, bare.split()
            double = sorted({name for name in header if header.count(name) > 1})
            if double:
                problems.append((number, f"column {', '.join(double)} is defined twice; expected it once"))
            if base.number(header[0]) is not None:
                problems.append((number, f'"{bare[:40]}" is not a header; expected names such as X EXX EYX'))
        elif bare:
            cells = [base.number(cell) for cell in bare.split()]
            whole = [cell for cell in cells if cell is not None]
            if len(cells) != len(header) or len(whole) != len(cells):
                what = f"{len(cells)} cells" if len(cells) != len(header) else f'"{bare[:40]}"'
                problems.append((number, f"{what} under {len(header)} columns; expected a number in each"))
            else:
                rows.append((number, whole))
    if header:
        yield line, header, rows


def _component(
    name: str,
    header: list[str],
    arguments: list[str],
    table: Array,
    lines: list[int],
    problems: list[Problem],
) -> tuple[Array, Array] | None:
    """Positions and values of a component by its own axis. Other arguments must not change them."""
    axis, values = name[2], table[:, header.index(name)]
    if axis not in arguments:
        problems.append(
            (lines[0], f"{name} has no column {axis}; expected it by the position of its own axis")
        )
        return None
    own = table[:, header.index(axis)]
    if len(arguments) == 1:
        wrong_order = list(base.order_problems(list(zip(lines, own.tolist(), strict=True)), axis))
        problems += wrong_order
        return None if wrong_order else (own, values)
    position = np.unique(own)
    first = {q: values[own == q][0] for q in position.tolist()}
    for line, q, value in zip(lines, own.tolist(), values.tolist(), strict=True):
        if value != first[q]:
            others = ", ".join(a for a in arguments if a != axis)
            problems.append(
                (line, f"{name} changes with {others} as well; a calibration holds curves of one axis only: "
                 "remove this block and leave it to the control")
            )  # fmt: skip
            return None
    return position, np.array([first[q] for q in position.tolist()])


def reference_of(given: Given) -> Callable[[str], Reference]:
    """The reference point of the errors of an axis. Raises UsageError where it is needed and not stated."""
    check_chain(given)
    carried = given.chain.split("F")[0]
    return lambda axis: (given.reference or "functional-point") if axis in carried else "functional-point"


def check_chain(given: Given) -> None:
    """Raise UsageError where an axis carries the workpiece and its reference point is not stated."""
    carried = given.chain.split("F")[0]
    if carried and given.reference is None:
        raise UsageError(
            f"axis {', '.join(carried)} carries the workpiece (chain {given.chain}), and the format does not "
            "state the point of its errors; give --reference table (a point fixed on the table) or "
            "--reference functional-point (the tool)"
        )


def without_direction(calibration: Calibration) -> Calibration:
    """The mean of both directions, without backlash."""
    curves = [
        replace(curve, columns={n: curve.mean(n) for n in curve.names}, forward={}, backward={})
        for curve in calibration.curves
    ]
    return replace(calibration, curves=tuple(curves), backlash_mm=ZERO)


def corrected_names(calibration: Calibration) -> frozenset[str]:
    """The errors that a volumetric table corrects: every component and squareness of the calibration."""
    square = {name for name, value in calibration.squareness.items() if value}
    return frozenset({name for curve in calibration.curves for name in curve.names} | square)


def control(calibration: Calibration, chain: str) -> Control:
    """The control with this table. Outside the box it keeps the values at the faces."""
    return Volumetric(build(calibration, chain, outside="hold"))


def _write(calibration: Calibration, target: Path, given: Given) -> Exported:
    sense = base.sense_of(given, SENSE, "isg")
    check_chain(given)
    factor = base.sign(sense)
    table = without_direction(
        zeroed(along_axes(calibration), given.chain, given.reference or "functional-point")
    )
    lines = [
        f"// Errors of {calibration.machine}; mm and rad; chain {given.chain}, workpiece to tool",
        f"// sense: {sense}; lever arms count from axis position 0 without a tool",
    ]
    square = {name: table.squareness[name] for name in SQUARENESS if table.squareness.get(name, 0.0)}
    if square:
        lines += [" ".join(square), " ".join(base.shown(v * factor) for v in square.values())]
    written = []
    for axis in AXES:
        for curve in table.curves_of(axis):
            rows = common_rows(table, curve)
            written += rows
            lines += [*(["#"] if len(lines) > 2 else []), " ".join([axis, *(r.name for r in rows)])]
            columns = [rows[0].position_mm, *(base.signed(r.mean, factor) for r in rows)]
            lines += [" ".join(map(base.shown, row)) for row in np.array(columns).T.tolist()]
    findings = [
        *base.not_held(calibration, (*COMPONENTS, *SQUARENESS), written),
        *base.backlash_left_out(calibration),
        *base.coarse(written, MISS_MM, MISS_RAD),
    ]
    data = ("\n".join(lines) + "\n").encode("ascii", "replace")
    return Exported({target: data}, corrected_names(table), tuple(findings))


FORMAT = Format(
    "isg",
    "ISG / Beckhoff TF5280 CSV",
    ".csv",
    SENSE,
    "documentation of Beckhoff and ISG",
    "18 components and squareness with lever arms and tool, mean of both directions",
    _read,
    _write,
    control,
)
