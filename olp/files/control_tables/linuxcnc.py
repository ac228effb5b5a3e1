"""LinuxCNC's screw compensation: COMP_FILE and COMP_FILE_TYPE of a joint, and BACKLASH where it has none.

A line is `nominal forward reverse`. Type 0 holds the actual position of the axis. Every other type holds what
the control adds to the command: trim = nominal - actual. The control interpolates linearly between rows and
uses the end values outside. It takes forward or reverse by the sign of the joint's velocity, and ramps from
one to the other. A file has at most 256 rows, in ascending order, and replaces BACKLASH. Comments are not
allowed: the control stops reading at the first line that is not a row. Sources: the INI section of the
integrator manual, and the source of the motion controller.
"""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path

import numpy as np

from olp.calibration.control_tables.controls import AxisTables
from olp.calibration.control_tables.rows import MISS_MM, MISS_RAD, Rows, component_rows
from olp.core.errors import ConfigError, UsageError
from olp.core.machine import Vector
from olp.core.units import AXES
from olp.errormodel.calibration import Calibration, Curve
from olp.files.control_tables import base
from olp.files.control_tables.base import Exported, Format, Given, Imported, Load
from olp.files.machine_settings.linuxcnc import Reading, joints_of, sections_of, unit_mm
from olp.files.problems import Problem
from olp.findings.catalogue import Finding

#: Rows that LinuxCNC reads.
MOST_ROWS = 256
#: COMP_FILE_TYPE of a file that holds actual positions, and the default of an INI file without this key.
ACTUAL_POSITIONS = 0
#: COMP_FILE_TYPE of a file that holds what the control adds.
TRIMS = 1


def _read(path: Path, given: Given, load: Load) -> Imported:
    if path.suffix.lower() != ".ini":
        if given.axis is None or given.kind is None:
            raise UsageError(
                "a compensation file names neither its axis nor its type; give --axis and --comp-type, or "
                "name the INI file instead",
                file=str(path),
            )
        curve = _curve(given.axis, load(path), path, given.kind, 1.0)
        return Imported(base.calibration_of(given, [curve], path))
    reading = Reading(str(path), sections_of(path, load))
    reading.mm = unit_mm(reading)
    curves: list[Curve] = []
    backlash_mm = [0.0, 0.0, 0.0]
    for j, (axis, joints) in enumerate(joints_of(reading).items()):
        tables = [joint for joint in joints if reading.text(joint, "COMP_FILE")]
        if len(tables) > 1:
            raise ConfigError(
                f"{', '.join(tables)} move axis {axis}, each with a COMP_FILE; expected one table per axis: "
                "give one of the files with --axis",
                file=str(path),
            )
        if tables:
            name = path.parent / str(reading.text(tables[0], "COMP_FILE"))
            kind = int(reading.number(tables[0], "COMP_FILE_TYPE") or ACTUAL_POSITIONS)
            curves.append(_curve(axis, load(name), name, kind, reading.mm))
        else:
            backlash_mm[j] = max((reading.length(joint, "BACKLASH") or 0.0 for joint in joints), default=0.0)
    if not curves and not any(backlash_mm):
        raise ConfigError("no joint has a COMP_FILE or a BACKLASH; expected one of them", file=str(path))
    backlash: Vector = (backlash_mm[0], backlash_mm[1], backlash_mm[2])
    calibration = base.calibration_of(given, curves, path, backlash_mm=backlash)
    return Imported(calibration, notes=tuple(reading.notes))


def _curve(axis: str, data: bytes, file: Path, kind: int, mm: float) -> Curve:
    rows: list[tuple[int, list[str]]] = []
    problems: list[Problem] = []
    for line, text in base.lines(data):
        cells = text.split()
        if not cells:
            continue
        if len(cells) != 3 or any(base.number(cell) is None for cell in cells):
            sentence = f'"{text[:40]}" is not a row; LinuxCNC stops reading here'
            problems.append((line, sentence + "; expected three numbers: nominal, forward, reverse"))
            continue
        rows.append((line, cells))
    if not problems:
        problems = list(base.order_problems([(n, float(c[0])) for n, c in rows], "nominal"))
        if len(rows) > MOST_ROWS:
            problems.append((rows[MOST_ROWS][0], f"{len(rows)} rows; LinuxCNC takes at most {MOST_ROWS}"))
    base.refuse(problems, file)
    sides = []
    for column in (1, 2):
        if kind == ACTUAL_POSITIONS:
            values = [float(Decimal(cells[column]) - Decimal(cells[0])) for _, cells in rows]
        else:
            values = [0.0 - float(cells[column]) for _, cells in rows]
        sides.append(base.signed(np.array(values), mm))
    position = np.array([float(cells[0]) for _, cells in rows]) * mm
    backward = None if np.array_equal(sides[0], sides[1]) else sides[1]
    return base.linear_curve(f"E{axis}{axis}", position, sides[0], backward)


def _write(calibration: Calibration, target: Path, given: Given) -> Exported:
    if target.suffix.lower() != ".ini":
        raise UsageError(
            "has no ending .ini; expected an INI file, which names the table files", file=str(target)
        )
    kind = TRIMS if given.kind is None else given.kind
    most = min(MOST_ROWS, given.most or MOST_ROWS)
    lines = [
        "# Screw compensation: put the keys of each joint into your INI file, and the files beside it.",
        "# A COMP_FILE replaces BACKLASH. Joints are those of trivkins coordinates=XYZ; lengths in mm.",
        "[TRAJ]",
        "LINEAR_UNITS = mm",
    ]
    files: dict[Path, bytes] = {}
    written: list[Rows] = []
    for j, axis in enumerate(AXES):
        name = f"E{axis}{axis}"
        cyclic = any(term.component == name for term in calibration.cyclic)
        if not cyclic and not any(name in curve.names for curve in calibration.curves):
            if calibration.backlash_mm[j]:
                lines += ["", f"[JOINT_{j}]", f"BACKLASH = {base.shown(calibration.backlash_mm[j])}"]
            continue
        rows = component_rows(calibration, name, most=most)
        if rows is None:
            continue
        file = target.with_name(f"{target.stem}-{axis.lower()}.comp")
        files[file] = _table(rows, kind)
        written.append(rows)
        lines += ["", f"[JOINT_{j}]", f"COMP_FILE = {file.name}", f"COMP_FILE_TYPE = {kind}"]
    corrects = frozenset(rows.name for rows in written)
    findings: list[Finding] = [
        *base.not_held(calibration, corrects, written),
        *base.coarse(written, MISS_MM, MISS_RAD),
        *base.backlash_in_table(calibration, AXES),
    ]
    return Exported({target: ("\n".join(lines) + "\n").encode(), **files}, corrects, tuple(findings))


def _table(rows: Rows, kind: int) -> bytes:
    lines = []
    table = zip(rows.position_mm.tolist(), rows.forward.tolist(), rows.backward.tolist(), strict=True)
    for nominal, forward, backward in table:
        cells = [base.shown(nominal)]
        for error in (forward, backward):
            if kind == ACTUAL_POSITIONS:
                cells.append(format(Decimal(repr(nominal)) + Decimal(repr(error)), "f"))
            else:
                cells.append(base.shown(0.0 - error))
        lines.append(" ".join(cells))
    return ("\n".join(lines) + "\n").encode()


FORMAT = Format(
    "linuxcnc",
    "LinuxCNC COMP_FILE",
    ".ini",
    "correction",
    "source and manual; run against the control itself in the tests",
    "EXX, EYY, EZZ by their own position, both directions, 256 rows per axis",
    _read,
    _write,
    lambda calibration, chain: AxisTables(calibration),
)
