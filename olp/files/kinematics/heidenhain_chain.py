"""The description table of the kinematics of an iTNC 530 from a structure: KEY, AXIS and COORD row by row.

Source: HEIDENHAIN Technical Manual iTNC 530 HSCI, kinematics description, and the example of KinematicsComp.
Rows go from the tool reference point to the workpiece: a `Trans` moves on by COORD in mm, a `MachAxis` is
where an axis of the machine takes effect, `MachBase` the part that stands still. Rotary axes are where their
centres are; how they turn is said elsewhere in the control.
"""

from __future__ import annotations

import numpy as np

from olp.files.kinematics.control_kinematics import (
    Entered,
    KinematicTable,
    as_it_lies,
    rounded,
    turning,
    zero_notes,
)
from olp.kinematics.errors import MachineErrors
from olp.kinematics.structure import FRAME, Structure

#: mm; the last digit of COORD.
_DIGIT_MM = 1e-4
#: The widths of NR, KEY and AXIS.
_FORM = "{:<6}{:<10}{:<6}{}"


def _enter(structure: Structure, errors: MachineErrors) -> Entered:
    turning(structure, "a description table of a Heidenhain control")
    lies = rounded(as_it_lies(structure, errors, turned=False), _DIGIT_MM)
    rows = [("ToolAxis", "Z", "")]
    at = np.zeros(3)
    for name in reversed(structure.chain):
        if name == FRAME:
            rows.append(("MachBase", "", ""))
            continue
        if lies.joints[name].kind == "rotary":
            point = np.array(lies.joints[name].point_mm)
            steps = zip("XYZ", np.round(point - at, 4).tolist(), strict=True)
            rows += [("Trans", axis, f"{step:.4f}") for axis, step in steps if step]
            at = point
        rows.append(("MachAxis", name, ""))
    lines = [_FORM.format("NR", "KEY", "AXIS", "COORD")]
    lines += [_FORM.format(number, *row).rstrip() for number, row in enumerate(rows)]
    text = "\n".join(["BEGIN KINEMATIC.TAB MM", *lines, "[END]"]) + "\n"
    notes = (
        "only rows of axes are written; bodies, tool holders and partial tables stay as in the control",
        *zero_notes(structure, errors, "row"),
    )
    return Entered(text.encode("ascii", "replace"), lies, errors, notes)


TABLES = (
    KinematicTable(
        "heidenhain-kinematics", "Heidenhain iTNC 530 kinematics description (KEY, AXIS, COORD)", ".tab",
        "technical manual; first line of the file and signs not verified on a control",
        "centres of one or two rotary axes, as calibrated; no tilts, no zeros, no linear axes",
        _enter,
    ),
)  # fmt: skip
