"""Reads a plan of measurements of a machine of any joints, and the readings that it names.

A row of a file holds the commanded values of all axes and what the instrument said. A column `nest`, `ball`,
`centre`, `plane` or `point` names which one it was; without it there is one. Columns such as
`read_back_J1_deg` hold what the control showed there.
"""

from __future__ import annotations

import datetime
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from olp.calibration.joints.candidates import Priors
from olp.calibration.joints.readings import Ball, Lengths, Planes, Points, Reading, SixD
from olp.core.arrays import Array, Index
from olp.core.errors import ConfigError, InputError
from olp.core.geometry import rotation_matrix
from olp.core.units import MM_PER_UM, RAD_PER_URAD
from olp.core.values import dataclass
from olp.files.columns import Wanted, finite, missing, names, read_sheet, unknown
from olp.files.kinematics.plan_schema import (
    BallTable,
    BarTable,
    JointPlanFile,
    ReadingTable,
    TrackerPointsTable,
    TrackerPosesTable,
)
from olp.files.problems import Problem, config_error, validate
from olp.files.toml_text import Path, line_of, read_toml
from olp.files.write import PathLike, Reader, read_bytes
from olp.kinematics.errors import Mass, Payload
from olp.kinematics.structure import Structure
from olp.kinematics.weight import carries, sums_of_angles

#: The plan in a folder.
PLAN = "measurements.toml"
#: Columns of coordinates in the frame of an instrument.
MEASURED = tuple(f"measured_{axis}_mm" for axis in "XYZ")
#: Columns of the rotation of a target there.
TURNED = tuple(f"measured_{axis}_deg" for axis in "ABC")
#: Columns of a ball.
AWAY = tuple(f"d{axis}_um" for axis in "XYZ")
#: What columns of values that the control showed begin with.
READ_BACK = "read_back_"
#: Columns of a bar.
LENGTH = ("length_mm",)
#: By kind its columns, and the column that names what was read.
KINDS: Mapping[str, tuple[tuple[str, ...], str]] = {
    "points": (MEASURED, "nest"),
    "poses": ((*MEASURED, *TURNED), "nest"),
    "ball": (AWAY, "ball"),
    "lengths": (LENGTH, "centre"),
    "planes": ((), "plane"),
    "postures": ((), "point"),
}


@dataclass(frozen=True, slots=True, eq=False)
class Campaign:
    """All readings of one calibration, what was usual before them, the weights on the bodies, the axes whose
    yield is fitted, and those that give way under unknown weights. `files` are those that were read."""

    machine: str
    measured: datetime.date
    temperature_degC: float
    readings: tuple[Reading, ...]
    priors: Priors
    masses: tuple[Mass, ...]
    yielding: tuple[str, ...]
    sagging: tuple[str, ...]
    files: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """A file of readings: commanded axis values (n, axes), those read back or None, the columns of the
    instrument (n, m), the lines (n,), and which nest, ball or the like (n,) of `names`."""

    values: Array
    read_back: Array | None
    read: Array
    row: Index
    which: Index
    names: tuple[str, ...]


def load_campaign(path: PathLike, structure: Structure, read: Reader = read_bytes) -> Campaign:
    """The readings of a plan, or of a folder with measurements.toml. Raises InputError where a file cannot be
    read, and ConfigError with every problem of all files."""
    plan = FilePath(path)
    if plan.is_dir():
        plan = plan / PLAN
    values, lines = read_toml(read(plan), str(plan))
    file = validate(JointPlanFile, values, lines, str(plan))
    problems: list[Problem] = []
    if file.machine != structure.name:
        problems.append(
            (line_of(("machine",), lines), f'machine = "{file.machine}" is not "{structure.name}"')
        )
    for index, mass in enumerate(file.masses):
        if mass.on not in structure.joints:
            problems.append(
                (line_of(("masses", index), lines), f'masses[{index}].on = "{mass.on}" is no axis')
            )
    for name in file.elasticity:
        if name not in structure.joints or structure.joints[name].kind != "rotary":
            problems.append(
                (line_of(("elasticity",), lines), f"elasticity names {name}; expected a rotary axis")
            )
    readings: list[Reading] = []
    files = [str(plan)]
    for kind in KINDS:
        for index, table in enumerate(getattr(file, kind)):
            key: Path = (kind, index, "file")
            where = plan.parent / table.file
            files.append(str(where))
            try:
                rows = _rows(where, kind, structure, read)
                readings.append(_reading(kind, table, rows, str(where)))
            except ConfigError as error:
                problems += [(line_of(key, lines), f"{table.file}: {text}") for text in error.problems]
            except InputError as error:
                problems.append(
                    (line_of(key, lines), f'{kind}[{index}].file = "{table.file}": {error.message}')
                )
    if not readings and not problems:
        problems.append((None, f"the plan names no readings; expected tables [[{']], [['.join(KINDS)}]]"))
    weighed = file.masses or any(reading.payload.kg for reading in readings)
    if file.elasticity and not weighed:
        problems.append(
            (line_of(("elasticity",), lines), "elasticity needs weights; expected [[masses]] or payload_kg")
        )
    problems += [(line_of(("gravity",), lines), text) for text in _of_gravity(file, structure)]
    if problems:
        raise config_error(problems, str(plan))
    return Campaign(
        file.machine,
        file.measured,
        file.temperature_degC,
        tuple(readings),
        _priors(file, structure),
        tuple(Mass(mass.on, mass.kg, mass.centre_mm) for mass in file.masses),
        tuple(file.elasticity),
        tuple(file.gravity),
        tuple(files),
    )


def _of_gravity(file: JointPlanFile, structure: Structure) -> Iterator[str]:
    """What is wrong with the axes that give way under unknown weights."""
    for name in file.gravity:
        try:
            sums_of_angles(structure, name)
        except ConfigError as error:
            yield f"gravity of {name}: {error.message}"
            continue
        twice = [mass.on for mass in file.masses if carries(structure, name, mass.on)]
        if twice and name in file.elasticity:
            yield (
                f"gravity names {name}, whose elasticity is fitted with [[masses]] on {', '.join(twice)}: "
                "the same twice; leave one of the two out"
            )


def _priors(file: JointPlanFile, structure: Structure) -> Priors:
    usual, stated = Priors.of(structure), file.prior
    return Priors(
        usual.shift_mm if stated.shift_um is None else stated.shift_um * MM_PER_UM,
        usual.tilt_rad if stated.tilt_urad is None else stated.tilt_urad * RAD_PER_URAD,
        usual.zero_rad if stated.zero_urad is None else stated.zero_urad * RAD_PER_URAD,
        usual.yield_rad_Nm if stated.yield_urad_Nm is None else stated.yield_urad_Nm * RAD_PER_URAD,
        usual.gravity_rad if stated.gravity_urad is None else stated.gravity_urad * RAD_PER_URAD,
    )


def _rows(path: FilePath, kind: str, structure: Structure, read: Reader) -> _Rows:
    """The rows of a file. Raises InputError, and ConfigError with every problem."""
    columns, which = KINDS[kind]
    axes = tuple(f"{joint.name}_{joint.unit}" for joint in structure.joints.values())
    shown = tuple(f"{READ_BACK}{name}" for name in axes)
    wanted = (*axes, *columns)
    found: dict[str, int] = {}

    def header(line: int, given: Sequence[str]) -> list[Problem]:
        known = (*wanted, which, *shown)
        return [
            *names(line, given, lambda _, name: unknown(name, known)),
            *missing(line, given, (*wanted, *shown) if set(shown) & set(given) else wanted),
        ]

    def number(name: str, cell: str) -> tuple[float, str | None]:
        if name == which:
            return float(found.setdefault(cell.strip(), len(found))), None
        value = finite(cell)
        wrong = f'{name} = "{cell}"; expected a number in {name.rpartition("_")[2]}'
        return value, wrong if math.isnan(value) else None

    sheet = read_sheet(
        read(path), str(path), Wanted(f"holds no rows; expected {','.join(wanted)}", header, number)
    )
    if sheet.problems:
        raise config_error(sheet.problems, str(path))
    if not sheet.rows:
        raise ConfigError("holds no rows; expected one for each reading", file=str(path))
    table = sheet.table
    index = table[:, sheet.header.index(which)] if which in sheet.header else np.zeros(len(table))

    def take(group: Sequence[str]) -> Array:
        return np.asarray(table[:, [sheet.header.index(name) for name in group]])

    return _Rows(
        take(axes),
        take(shown) if shown[0] in sheet.header else None,
        take(columns),
        sheet.lines,
        index.astype(np.int64),
        tuple(found) or ("1",),
    )


def _reading(kind: str, table: Any, rows: _Rows, source: str) -> Reading:
    """The readings of one table. Raises ConfigError."""
    same = _common(table, rows, source)
    if isinstance(table, TrackerPointsTable):
        nests = _placed(table.nests_mm, rows.names, "nests_mm") if table.nests_mm else None
        if nests is None and len(rows.names) > 1:
            raise ConfigError(f"names {len(rows.names)} nests; expected their vectors in nests_mm")
        return Points(
            **same,
            measured_mm=rows.read,
            nests_mm=np.zeros((1, 3)) if nests is None else nests,
            nest_sigma=table.nest_sigma_um * MM_PER_UM,
        )
    if isinstance(table, TrackerPosesTable):
        turns = np.stack([rotation_matrix((a, b, c)) for a, b, c in rows.read[:, 3:].tolist()])
        return SixD(
            **same,
            measured_mm=rows.read[:, :3],
            measured_turn=turns,
            tool_turn=rotation_matrix(table.target_deg),
            sigma_rad=table.sigma_urad * RAD_PER_URAD,
            turn_sigma=table.target_sigma_urad * RAD_PER_URAD,
        )
    if isinstance(table, BallTable):
        sign = 1.0 if table.reads == "tip" else -1.0
        return Ball(**same, measured_mm=sign * rows.read * MM_PER_UM, in_machine=table.axes == "machine")
    if isinstance(table, BarTable):
        return Lengths(
            **same,
            measured_mm=rows.read,
            centres_mm=_placed(table.centres_mm, rows.names, "centres_mm"),
            length_sigma=table.length_sigma_um * MM_PER_UM,
        )
    if kind == "planes":
        return Planes(**same)
    return Ball(**same, measured_mm=np.zeros((len(rows.values), 3)))


def _common(table: ReadingTable, rows: _Rows, source: str) -> dict[str, Any]:
    return {
        "source": source,
        "values": rows.values,
        "row": rows.row,
        "tool_mm": table.tool_mm,
        "sigma": table.sigma_um * MM_PER_UM,
        "names": rows.names,
        "which": rows.which,
        "tool_sigma": table.tool_sigma_um * MM_PER_UM,
        "read_back": rows.read_back,
        "payload": Payload(table.payload_kg, table.payload_centre_mm),
    }


def _placed(stated: Mapping[str, Sequence[float]], wanted: Sequence[str], key: str) -> Array:
    """(k, 3) mm of what rows name. Raises ConfigError for names that the table does not state."""
    if wanted == ("1",) and len(stated) == 1:
        return np.array([*stated.values()])
    unknown_names = [name for name in wanted if name not in stated]
    if unknown_names:
        raise ConfigError(f"names {', '.join(unknown_names)}; expected names of {key}: {', '.join(stated)}")
    return np.array([stated[name] for name in wanted])
