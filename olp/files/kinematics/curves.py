"""CSV tables of the error motions of one joint."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from olp.core.arrays import Array
from olp.core.units import shifted
from olp.files.columns import names, read_sheet, unknown
from olp.files.problems import Problem, config_error
from olp.files.tables import unit_columns
from olp.files.write import PathLike, Reader
from olp.kinematics.errors import OWN
from olp.kinematics.structure import Joint, Structure

#: A direction this close to an axis of the machine is that axis.
_SAME = 1e-9


def component_of(name: str, joint: Joint) -> int | str:
    """The column of `COMPONENTS` that an error such as EXC, ECC or EBJ2 of a joint is, or what is wrong."""
    if name == f"E{joint.name}{joint.name}":
        return OWN
    letter = name[1:2]
    if name != f"E{letter}{joint.name}" or letter not in tuple("XYZABC"):
        return f"expected E, a direction X Y Z A B C, and {joint.name}"
    column = "XYZABC".index(letter)
    if joint.kind == "rotary" and column >= 3:
        along = joint.direction[column - 3]
        if abs(along - 1.0) < _SAME:
            return OWN
        if abs(along + 1.0) < _SAME:
            return f"{joint.name} turns about -{'XYZ'[column - 3]}; expected E{joint.name}{joint.name}"
    return column


def unit_of(component: int, joint: Joint) -> str:
    """ "um" or "urad" of a column of `COMPONENTS`."""
    angle = joint.kind == "rotary" if component == OWN else component >= 3
    return "urad" if angle else "um"


def read_motions(path: PathLike, structure: Structure, read: Reader) -> tuple[str, Array, Array]:
    """The axis of a CSV file, its (n,) axis values in mm or deg, and (n, 7) `COMPONENTS` in mm or rad.

    Header `C_deg, EXC_um, ECC_urad ...`, then one row per position. Raises InputError where the file cannot
    be read, and ConfigError with every problem and its line.
    """
    sheet = read_sheet(
        read(path),
        str(path),
        unit_columns(
            "holds no header; expected columns such as C_deg, EXC_um, ECC_urad",
            lambda line, header: _header(line, header, structure),
        ),
    )
    axis = structure.joints[sheet.header[0].rpartition("_")[0]]
    problems = list(sheet.problems)
    if not problems:
        problems = _order(sheet.header[0], sheet.rows)
    if problems:
        raise config_error(problems, str(path))
    table = sheet.table
    motions = np.zeros((len(table), OWN + 1))
    for column, title in enumerate(sheet.header[1:], 1):
        component = component_of(title.rpartition("_")[0], axis)
        assert not isinstance(component, str), "the header was checked"
        motions[:, component] += table[:, column]
    return axis.name, table[:, 0], motions


def _header(line: int, header: Sequence[str], structure: Structure) -> list[Problem]:
    first = {f"{joint.name}_{joint.unit}": joint for joint in structure.joints.values()}
    if header[0] not in first:
        return [(line, f'column 1 is "{header[0]}"; expected one of {", ".join(first)}')]
    joint = first[header[0]]

    def wrong(number: int, name: str) -> str | None:
        stem, _, unit = name.rpartition("_")
        component = component_of(stem, joint)
        if isinstance(component, str):
            return component
        return unknown(name, (f"{stem}_{unit_of(component, joint)}",)) if unit else None

    problems = names(line, header, wrong, 2)
    if not problems and len(header) < 2:
        problems.append((line, f"there is no error column; expected one such as EX{joint.name}_um"))
    return problems


def _order(name: str, rows: Sequence[tuple[int, list[float]]]) -> list[Problem]:
    if len(rows) < 2:
        return [(None, f"{len(rows)} positions; expected at least 2")]
    problems: list[Problem] = []
    before = -math.inf
    for line, (value, *_) in rows:
        if value <= before:
            problems.append(
                (line, f"{name} = {value:g} comes after {before:g}; expected ascending positions, each once")
            )
        before = value
    return problems


def in_base(value: float, unit: str) -> float:
    """A value in um or urad as mm or rad."""
    return shifted(value, -3 if unit == "um" else -6)
