"""What tables and code in a control leave of the errors of a machine with rotary axes over its volume."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from olp.calibration.control_tables.residuals import BAND_MM, REAL_TIME, UNCOMPENSATED
from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.units import RAD_PER_URAD, UM_PER_MM
from olp.files.control_code.joint_code import reached
from olp.files.kinematics.control_kinematics import Entered, KinematicTable
from olp.files.kinematics.load import JointSetup
from olp.kinematics.chain import Kinematics
from olp.kinematics.correction import deviations, left_angles
from olp.kinematics.errors import JointErrors, MachineErrors
from olp.kinematics.structure import Structure

#: Random postures over the box, and the seed of their axis values.
POINTS = 2000
SEED = 1
#: Below this a part of the errors is no line of the report: mm, rad.
_NOTHING = (1e-6, 1e-9)


def report_of(setup: JointSetup, tables: Mapping[str, KinematicTable]) -> dict[str, Any]:
    """What is left without correction, with code in the control, and with the values of each table alone
    ("olp-tables-1"). `parts` says which errors those are: what each kind of errors leaves by itself. Tables
    that cannot hold the machine are left out.
    """
    assert setup.calibration is not None
    structure, box = setup.machine.structure, setup.calibration.box
    low, high = np.array([box[name] for name in structure.order], float).T
    random = np.random.default_rng(SEED)
    values = random.uniform(low, high, (POINTS, len(low)))
    # an axis with play was moved to its value from either side
    sides = random.choice((-1.0, 1.0), values.shape)
    solved, rows = reached(setup.kinematics, values)
    values, sides = values[rows], sides[rows]
    shift, turn = setup.kinematics.deviation(values, sides)
    target = setup.kinematics.nominal(values)
    # an axis with backlash turns only where it would be off by more
    plays = any(errors.backlash for errors in setup.kinematics.errors.joints.values())
    band = BAND_MM if plays else 0.0
    left = {
        UNCOMPENSATED: _figures(np.linalg.norm(shift, axis=1), left_angles(structure, turn, target)),
        REAL_TIME: _figures(np.full(len(rows), band), left_angles(structure, solved.left_rad, target)),
    }
    parts = {}
    for name, form in tables.items():
        try:
            left[name] = _figures(*_left(setup.kinematics, setup.kinematics.errors, form, (values, sides)))
        except ConfigError:
            continue
        parts[name] = _parts(setup.kinematics, form, (values, sides))
    units = {name: f"{name}_{unit}" for name, unit in zip(structure.order, structure.units, strict=True)}
    return {
        "schema": "olp-tables-1",
        "machine": structure.name,
        "box": {
            "points": len(rows),
            "seed": SEED,
            "box": {units[name]: list(box[name]) for name in structure.order},
            "tools_mm": [list(setup.kinematics.tool_mm)],
            "left": left,
            "parts": parts,
        },
    }


def _left(
    kinematics: Kinematics, errors: MachineErrors, form: KinematicTable, postures: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Distances in mm and angles in rad that errors leave with a table at `postures`: axis values, and the
    sides of their play. Raises ConfigError where it cannot
    hold them."""
    return _between(kinematics, form.enter(kinematics.structure, errors), postures)


def _between(kinematics: Kinematics, entered: Entered, postures: tuple[Array, Array]) -> tuple[Array, Array]:
    known = Kinematics(entered.known, tool_mm=kinematics.tool_mm).nominal(postures[0])
    actual = replace(kinematics, errors=entered.left).actual(*postures)
    return deviations(kinematics.structure, actual, known)


def _parts(kinematics: Kinematics, form: KinematicTable, postures: tuple[Array, Array]) -> dict[str, Any]:
    parts = {}
    for name, errors in _kinds(kinematics.structure, kinematics.errors).items():
        try:
            sizes = _left(kinematics, errors, form, postures)
        except ConfigError:
            # a table that has no place for this kind alone leaves all of it
            sizes = _between(kinematics, Entered(b"", kinematics.structure, errors), postures)
        if any(size.max(initial=0.0) > least for size, least in zip(sizes, _NOTHING, strict=True)):
            parts[name] = _figures(*sizes)
    return parts


def _kinds(structure: Structure, errors: MachineErrors) -> dict[str, MachineErrors]:
    """The errors of a machine by kind, each kind alone."""

    def of(kind: str, *names: str) -> MachineErrors:
        joints = {
            name: replace(JointErrors(wrong.point_mm), **{key: getattr(wrong, key) for key in names})
            for name, wrong in errors.joints.items()
            if structure.joints[name].kind in kind.split()
        }
        return MachineErrors(joints)

    return {
        "centres of rotary axes": of("rotary", "shift_mm"),
        "tilts of rotary axes": of("rotary", "tilt_rad"),
        "directions of linear axes": of("linear", "tilt_rad", "datum"),
        "zeros": of("rotary linear length", "zero"),
        "error motions": of("rotary linear length", "curves", "harmonics"),
        "backlash": of("rotary linear length", "backlash"),
        "gauge frame": MachineErrors(
            gauge_shift_mm=errors.gauge_shift_mm, gauge_tilt_rad=errors.gauge_tilt_rad
        ),
        "legs": MachineErrors(legs=errors.legs),
        "weight": MachineErrors(
            yields=errors.yields, masses=errors.masses, payload=errors.payload, gravity=errors.gravity
        ),
    }


def _figures(distance_mm: Array, angle_rad: Array) -> dict[str, float | None]:
    um, urad = distance_mm * UM_PER_MM, angle_rad / RAD_PER_URAD
    return {
        "rms_um": _rms(um),
        "max_um": float(um.max(initial=0.0)),
        "rms_in_frame_um": None,
        "rms_urad": _rms(urad),
        "max_urad": float(urad.max(initial=0.0)),
    }


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else 0.0
