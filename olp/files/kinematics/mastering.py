"""The zeros of axes as a list, for the mastering of an arm or the reference points of a machine tool.

Each control has a number for it, whose old value the machine file does not know. KUKA adds the value to
`$MAMES[i]` of `$machine.dat`, in deg or mm (KUKA, Machine Data, KR C2). ABB and FANUC count on the side of
the motor (`cal_offset` of MOTOR_CALIB in rad, `$MASTER_COUN`). There the axis is moved to minus the value,
and its counter set to zero. The parameters of absolutely accurate robots of ABB and KUKA are not public, so
nothing is written for them.
"""

from __future__ import annotations

from olp.core.errors import ConfigError
from olp.files.kinematics.control_kinematics import Entered, KinematicTable, left_zeros, without_zeros
from olp.kinematics.errors import MachineErrors
from olp.kinematics.structure import Structure


def _enter(structure: Structure, errors: MachineErrors) -> Entered:
    zeros = left_zeros(structure, errors)
    if not zeros:
        raise ConfigError("the calibration states no zero of an axis, so there is nothing to list")
    lines = ["axis,add,unit"]
    lines += [f"{name},{value:.7f},{structure.joints[name].unit}" for name, value in zeros.items()]
    data = ("\n".join(lines) + "\n").encode("utf-8")
    notes = (
        "add each value to what the control counts at the mark of the axis (KUKA: $MAMES)",
        "or move the axis to minus the value and set its counter to zero there",
    )
    return Entered(data, structure, without_zeros(errors), notes)


TABLES = (
    KinematicTable(
        "mastering", "Zeros of axes: mastering of arms (KUKA $MAMES, ABB, FANUC), reference points", ".csv",
        "public manuals of $MAMES; for other controls to be entered by hand",
        "the zero of every axis of the chain; no lines",
        _enter,
        "take the zeros out of the calibration, or fit it again",
    ),
)  # fmt: skip
