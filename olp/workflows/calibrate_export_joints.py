"""`calibrate export` for a machine with rotary axes: code that corrects in real time, and what it leaves."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from olp.calibration.control_tables.residuals import BAND_MM, REAL_TIME, UNCOMPENSATED
from olp.core.arrays import Array
from olp.core.errors import ConfigError, UsageError
from olp.core.units import RAD_PER_URAD, UM_PER_MM
from olp.files.config import load_job
from olp.files.control_code.base import Code
from olp.files.control_code.joint_code import joint_code, reached
from olp.files.control_code.registry import CODE
from olp.files.kinematics.load import JointSetup, is_of_joints, load_joint_setup
from olp.files.kinematics.machine import load_joint_machine
from olp.kinematics.correction import left_angles
from olp.workflows.session import PathLike

#: Random postures over the box, and the seed of their axis values.
POINTS = 2000
SEED = 1


def given_joints(machine: object, job: PathLike | None) -> Path | str | None:
    """The machine file, where it states other axes than three linear ones."""
    if machine is None and job is not None:
        machine = load_job(job).machine
    if isinstance(machine, (str, Path)) and is_of_joints(machine):
        return machine
    return None


def joint_inputs(machine: PathLike, job: PathLike | None) -> tuple[str, ...]:
    """The files that describe a machine, which no output may overwrite."""
    calibration = load_joint_machine(machine).calibration
    return tuple(str(name) for name in (machine, job, calibration) if name is not None)


def refuse_tables(machine: PathLike) -> NoReturn:
    """Raises UsageError where the table of a control is asked for."""
    raise UsageError(
        "tables of controls hold three linear axes, and this machine has others; expected --format "
        f"{' or '.join(CODE)}",
        file=str(machine),
    )


def joint_export(
    machine: PathLike, kind: str, job: PathLike | None, chain: str | None, program: object
) -> tuple[Code, dict[str, Any]]:
    """The code of a machine with rotary axes and the report ("olp-tables-1"): what is left without it, and
    with it. Raises UsageError for a table and along a program, InputError, ConfigError."""
    if kind not in CODE:
        refuse_tables(machine)
    if program is not None:
        raise UsageError("--program is for machines with three linear axes; leave it out", file=str(machine))
    if chain is not None:
        raise UsageError("--chain goes with -c; the machine file states its own chain")
    setup = load_joint_setup(machine, job, by_itself=True)
    if setup.calibration is None:
        raise UsageError(
            "the machine file names no calibration, so there is nothing to export", file=str(machine)
        )
    try:
        code = joint_code(setup.kinematics, setup.calibration.box, setup.digest)
    except ConfigError as error:
        raise error.in_file(str(machine)) from None
    return code, _report(setup)


def _report(setup: JointSetup) -> dict[str, Any]:
    assert setup.calibration is not None
    structure, box = setup.machine.structure, setup.calibration.box
    low, high = np.array([box[name] for name in structure.order], float).T
    values = np.random.default_rng(SEED).uniform(low, high, (POINTS, len(low)))
    solved, rows = reached(setup.kinematics, values)
    values = values[rows]
    shift, turn = setup.kinematics.deviation(values)
    target = setup.kinematics.nominal(values)
    # an axis with backlash turns only where it would be off by more
    plays = any(errors.backlash for errors in setup.kinematics.errors.joints.values())
    band = BAND_MM if plays else 0.0
    left = {
        UNCOMPENSATED: (np.linalg.norm(shift, axis=1), left_angles(structure, turn, target)),
        REAL_TIME: (np.full(len(rows), band), left_angles(structure, solved.left_rad, target)),
    }
    units = {name: f"{name}_{unit}" for name, unit in zip(structure.order, structure.units, strict=True)}
    return {
        "schema": "olp-tables-1",
        "machine": structure.name,
        "box": {
            "points": len(rows),
            "seed": SEED,
            "box": {units[name]: list(box[name]) for name in structure.order},
            "tools_mm": [list(setup.kinematics.tool_mm)],
            "left": {name: _figures(*sizes) for name, sizes in left.items()},
        },
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
