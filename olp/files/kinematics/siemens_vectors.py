"""The vectors of a Sinumerik control from a structure: swivel data, or those of its five-axis transformation.

`olp.files.kinematics.siemens` reads them, and states the sources.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from olp.core.errors import ConfigError
from olp.core.machine import ZERO, Vector
from olp.files.kinematics.control_kinematics import (
    Entered,
    KinematicTable,
    as_it_lies,
    turning,
    zero_notes,
)
from olp.files.kinematics.families import back
from olp.files.kinematics.siemens import DATA, NUMBERED, Vectors
from olp.kinematics.errors import MachineErrors
from olp.kinematics.structure import Structure


def swivel_data(structure: Structure) -> bytes:
    """Swivel data, set 1. Raises ConfigError where the vectors cannot hold the machine."""
    vectors = _vectors(structure)
    lines = [f"; swivel data of {structure.name}, as calibrated: vectors in mm at axis zero"]
    for name, first in NUMBERED.items():
        if name in vectors.of:
            lines += [f"$TC_CARR{first + k}[1]={_number(v)}" for k, v in enumerate(vectors.of[name])]
    lines += [f'$TC_CARR{21 + k}[1]="{name}"' for k, name in enumerate(vectors.names) if name]
    lines.append(f'$TC_CARR23[1]="{vectors.kind}"')
    for k, (low, high) in enumerate(vectors.travels):
        lines += [f"$TC_CARR{30 + k}[1]={_number(low)}", f"$TC_CARR{32 + k}[1]={_number(high)}"]
    return ("\n".join(lines) + "\n").encode("ascii", "replace")


def transformation(structure: Structure) -> bytes:
    """The first five-axis transformation. Raises as `swivel_data`, and for one rotary axis alone."""
    vectors = _vectors(structure)
    if not vectors.names[1]:
        raise ConfigError(
            "a five-axis transformation has two rotary axes, and this machine has one; expected --format "
            "siemens-carr"
        )
    number, names = next((n, names) for n, (kind, names) in DATA.items() if kind == vectors.kind)
    lines = [
        f"; five-axis transformation of {structure.name}, as calibrated: rotary axes "
        f"{' and '.join(vectors.names)}",
        f"$MC_TRAFO_TYPE_1={number}",
    ]
    named = {vector: f"TRAFO5_{name}_1" for vector, name in names.items()}
    for vector, name in {**named, "V1": "TRAFO5_AXIS1_1", "V2": "TRAFO5_AXIS2_1"}.items():
        lines += [f"$MC_{name}[{k}]={_number(v)}" for k, v in enumerate(vectors.of[vector])]
    return ("\n".join(lines) + "\n").encode("ascii", "replace")


def _number(value: float) -> str:
    return f"{value:.10f}".rstrip("0").rstrip(".") if abs(value) >= 5e-11 else "0"


def _vectors(structure: Structure) -> Vectors:
    """The vectors of a machine with three linear axes and one or two rotary ones."""
    tables, heads = turning(structure, "vectors of a Sinumerik control")
    kind = {(0, 1): "T", (0, 2): "T", (1, 0): "P", (2, 0): "P", (1, 1): "M"}[len(tables), len(heads)]
    # the first one is nearer to the frame; of one of each it is the head
    axes = [*heads, *tables] if kind == "M" else [*heads, *reversed(tables)]
    first = np.array(axes[0].point_mm)
    second = np.array(axes[1].point_mm) if len(axes) > 1 else first
    lengths = {
        "T": {"I1": -first, "I2": first - second, "I3": second},
        "P": {"I2": first, "I3": second - first, "I4": -second},
        "M": {"I1": -first, "I2": first, "I3": second, "I4": -second},
    }[kind]
    vectors = {name: _triple(value) for name, value in lengths.items()}
    for name, joint in zip(("V1", "V2"), axes, strict=False):
        vectors[name] = back(joint.direction) if joint in tables else joint.direction
    vectors.setdefault("V2", ZERO)
    names = (*(joint.name for joint in axes), "")[:2]
    travels = (*(joint.travel for joint in axes), (0.0, 0.0))[:2]
    return Vectors(kind, vectors, (names[0], names[1]), (travels[0], travels[1]))


def _triple(value: np.ndarray) -> Vector:
    x, y, z = value.tolist()
    return x, y, z


def _entered(write: Callable[[Structure], bytes]) -> Callable[[Structure, MachineErrors], Entered]:
    def enter(structure: Structure, errors: MachineErrors) -> Entered:
        lies = as_it_lies(structure, errors)
        return Entered(write(lies), lies, errors, zero_notes(structure, errors, "vector"))

    return enter


_HOLDS = "directions and centres of one or two rotary axes, as calibrated; no zeros, no linear axes"
_STATUS = "manuals; read back by `olp init --trafo`"
_AGAIN = "describe the machine once more (olp init --trafo {file}) and fit the calibration again"
TABLES = (
    KinematicTable(
        "siemens-carr", "Siemens Sinumerik swivel data ($TC_CARR)", ".ini", _STATUS, _HOLDS,
        _entered(swivel_data), _AGAIN,
    ),
    KinematicTable(
        "siemens-trafo5", "Siemens Sinumerik five-axis transformation ($MC_TRAFO5)", ".ini", _STATUS, _HOLDS,
        _entered(transformation), _AGAIN,
    ),
)  # fmt: skip
