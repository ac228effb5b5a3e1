"""Tables by which controls know where the rotary axes of a machine lie, written from its calibration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from olp.core.values import dataclass
from olp.files.kinematics import siemens_vectors
from olp.kinematics.columns import tilted, triple
from olp.kinematics.errors import MachineErrors
from olp.kinematics.structure import Structure


@dataclass(frozen=True, slots=True)
class KinematicTable:
    """One format. `write` gives the text for a structure as it really lies; it raises ConfigError for one
    that the table cannot hold."""

    key: str
    title: str
    ending: str
    status: str
    holds: str
    write: Callable[[Structure], bytes]


_HOLDS = "directions and centres of one or two rotary axes, as calibrated; no zeros, no linear axes"
_STATUS = "manuals; read back by `olp init --trafo`"
#: The formats by name.
TABLES: dict[str, KinematicTable] = {
    table.key: table
    for table in (
        KinematicTable(
            "siemens-carr", "Siemens Sinumerik swivel data ($TC_CARR)", ".ini", _STATUS, _HOLDS,
            siemens_vectors.swivel_data,
        ),
        KinematicTable(
            "siemens-trafo5", "Siemens Sinumerik five-axis transformation ($MC_TRAFO5)", ".ini", _STATUS,
            _HOLDS, siemens_vectors.transformation,
        ),
    )
}  # fmt: skip


def as_it_lies(structure: Structure, errors: MachineErrors) -> Structure:
    """The structure with its rotary axes on the lines that the calibration says. What else is wrong with
    the machine stays: linear axes, zeros, error motions, elasticity."""
    joints = dict(structure.joints)
    for name, joint in joints.items():
        wrong = errors.joints.get(name)
        if wrong is not None and joint.kind == "rotary":
            x, y, z = (float(part) for part in tilted(triple(wrong.tilt_rad)).turned(triple(joint.direction)))
            a, b, c = np.add(joint.point_mm, wrong.shift_mm).tolist()
            joints[name] = replace(joint, direction=(x, y, z), point_mm=(a, b, c))
    return replace(structure, joints=joints)


def left_zeros_deg(structure: Structure, errors: MachineErrors) -> dict[str, float]:
    """By rotary axis the error of its zero, which no such table holds, in degrees."""
    return {
        name: float(np.degrees(errors.joints[name].zero))
        for name, joint in structure.joints.items()
        if joint.kind == "rotary" and name in errors.joints and errors.joints[name].zero
    }
