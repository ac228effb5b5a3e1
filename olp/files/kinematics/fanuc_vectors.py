"""Parameters 19680 and 19700 to 19714 of FANUC controls from a structure: where the rotary axes of a machine
lie for tool centre point control.

Source: FANUC additional manual A-79348E (Series 30i, tool center point control for 5-axis machining). The
form of the lines is that of the parameter manual B-63950EN. Vectors are in machine coordinates with all
rotary axes at zero. Of a table they go from the zero of the machine to A on the first axis, and from A to B
on the second one. Of a head they go from D on the tool axis to E on the axis that carries the tool, and from
E to F on the other. D is the gauge point while the tool holder offset (19666) is 0.

Directions are codes of axes of the machine; they hold no small tilt, and are not written.
"""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.files.kinematics.control_kinematics import (
    Entered,
    KinematicTable,
    as_it_lies,
    rounded,
    turning,
    zero_notes,
)
from olp.kinematics.errors import MachineErrors
from olp.kinematics.structure import Structure

#: mm; the digit of a parameter where the machine file states no least increment.
_DIGIT_MM = 0.001
#: The first numbers of the vectors to the first and from it to the second axis: of a table, and of a head.
_OF_TABLE = (19700, 19703)
_OF_HEAD = (19709, 19712)


def _enter(structure: Structure, errors: MachineErrors) -> Entered:
    tables, heads = turning(structure, "parameters of a FANUC control")
    if len(tables) + len(heads) != 2:
        raise ConfigError(
            "parameters of a FANUC control hold two rotary axes, of which one may be imaginary, and this "
            "machine has one; expected two"
        )
    digit = structure.joints["X"].least_increment or _DIGIT_MM
    lies = rounded(as_it_lies(structure, errors, turned=False), digit)
    at = {joint.name: np.array(lies.joints[joint.name].point_mm) for joint in (*tables, *heads)}
    # the first axis of a table carries the second; that of a head does, too
    of_table = [at[joint.name] for joint in reversed(tables)]
    of_head = [at[joint.name] for joint in reversed(heads)]
    lines = ["%", f"N19680Q1P{_kind(len(tables))}"]
    lines += _steps(of_table, _OF_TABLE, digit)
    lines += _steps(of_head, _OF_HEAD, digit)
    return Entered(
        ("\n".join([*lines, "%"]) + "\n").encode("ascii"), lies, errors,
        (
            "read with the tool holder offset (19666) at 0; directions (19681 to 19690) stay as they are",
            *zero_notes(structure, errors, "parameter"),
        ),
    )  # fmt: skip


def _kind(tables: int) -> int:
    """The number of the mechanical unit: both axes in the head, one each, both in the table."""
    return (2, 21, 12)[tables]


def _steps(points: list[Array], numbers: tuple[int, int], digit: float) -> list[str]:
    """Lines for the vector to the first point, and for that from it to the second."""
    lines, before = [], np.zeros(3)
    decimals = max(0, int(np.ceil(-np.log10(digit) - 1e-9)))
    for point, first in zip(points, numbers, strict=False):
        lines += [
            f"N{first + k}Q1M{value + 0.0:.{decimals}f}"
            for k, value in enumerate(np.round(point - before, decimals))
        ]
        before = point
    return lines


TABLES = (
    KinematicTable(
        "fanuc-5-axis", "FANUC parameters of the rotary axes (19680, 19700 to 19714)", ".txt",
        "manuals; not tried on a control",
        "centres of two rotary axes, as calibrated; no tilts, no zeros, no linear axes",
        _enter,
    ),
)  # fmt: skip
