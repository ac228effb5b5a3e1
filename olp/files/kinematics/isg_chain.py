"""The universal kinematics (ID 91) of ISG kernels and TwinCAT CNC from a structure: a channel parameter list.

Source: the pages of Beckhoff TF5240, "Universal Kinematics", and the channel parameters P-CHAN-00262 and
P-CHAN-00285 to P-CHAN-00293. All is stated in one coordinate system with all axes at zero; lengths in 0.1 um.
The chain goes from the workpiece over the frame to the tool. Axes that carry the workpiece have their
direction turned round, so each one is that of the tool against the workpiece, as in a structure.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from olp.files.kinematics.control_kinematics import (
    LINEAR,
    Entered,
    KinematicTable,
    as_it_lies,
    linear_problems,
    refuse,
    zero_notes,
)
from olp.kinematics.errors import MachineErrors
from olp.kinematics.structure import FRAME, Structure

#: Units of length in a millimetre.
_PER_MM = 1e4
#: Axes that a chain may have.
_MOST = 6
#: The number of a kind of axis.
_KINDS = {"linear": 1, "rotary": 2}


def _enter(structure: Structure, errors: MachineErrors) -> Entered:
    refuse("the universal kinematics of an ISG kernel", _problems(structure))
    lies = _tilted(as_it_lies(structure, errors), errors)
    names = [*LINEAR, *(name for name in structure.order if name not in LINEAR)]
    gauge = lies.gauge.pose
    lines = [
        f"# universal kinematics of {structure.name}, as calibrated; axes {' '.join(names)}",
        "# programming_mode and rtcp stay as they are in the list of this machine",
        "trafo[0].id 91",
        *_vector("zero_orientation", gauge.rotation[:, 2].tolist()),
        *_vector("zero_position", (gauge.position * _PER_MM).tolist()),
        f"trafo[0].number_of_axes {len(names)}",
    ]
    for number, name in enumerate(names):
        joint = lies.joints[name]
        lines.append(f"trafo[0].axis[{number}].type {_KINDS[joint.kind]}")
        lines += _vector(f"axis[{number}].orientation", joint.direction)
        point = joint.point_mm if joint.kind == "rotary" else (0.0, 0.0, 0.0)
        lines += _vector(f"axis[{number}].point", [_PER_MM * part for part in point])
    chain = [name for name in structure.chain if name != FRAME]
    lines += [f"trafo[0].chain[{k}] {names.index(name)}" for k, name in enumerate(chain)]
    data = ("\n".join(lines) + "\n").encode("ascii", "replace")
    return Entered(data, lies, errors, zero_notes(structure, errors, "parameter"))


def _vector(name: str, values: Sequence[float]) -> list[str]:
    return [f"trafo[0].{name}[{k}] {_number(value)}" for k, value in enumerate(values)]


def _number(value: float) -> str:
    return f"{value:.10f}".rstrip("0").rstrip(".") if abs(value) >= 5e-11 else "0"


def _tilted(structure: Structure, errors: MachineErrors) -> Structure:
    """The structure with the directions in which its linear axes really go."""
    joints = dict(structure.joints)
    for name, joint in joints.items():
        wrong = errors.joints.get(name)
        if wrong is not None and joint.kind == "linear":
            along = np.add(joint.direction, np.cross(wrong.tilt_rad, joint.direction))
            x, y, z = (along / np.linalg.norm(along)).tolist()
            joints[name] = replace(joint, direction=(x, y, z))
    return replace(structure, joints=joints)


def _problems(structure: Structure) -> Iterator[str]:
    if structure.platforms:
        yield "it has a platform on legs"
        return
    yield from linear_problems(structure)
    if len(structure.joints) > _MOST:
        yield f"it has {len(structure.joints)} axes; expected {_MOST} at most"


TABLES = (
    KinematicTable(
        "isg-universal", "ISG kernel, Beckhoff TwinCAT CNC universal kinematics (ID 91)", ".lis",
        "public manuals; not tried on a control",
        "directions of all axes and centres of up to three rotary ones, as calibrated; no zeros",
        _enter,
    ),
)  # fmt: skip
