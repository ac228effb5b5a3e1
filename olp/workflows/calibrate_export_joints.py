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
from olp.files.kinematics.tables import TABLES, as_it_lies, left_zeros_deg
from olp.kinematics.chain import Kinematics
from olp.kinematics.correction import deviations, left_angles
from olp.kinematics.structure import Structure
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
    """Raises UsageError where the table of three linear axes is asked for."""
    raise UsageError(
        "tables of errors hold three linear axes, and this machine has others; expected --format "
        f"{' or '.join((*TABLES, *CODE))}",
        file=str(machine),
    )


def table_export(
    machine: PathLike, kind: str, job: PathLike | None, target: Path
) -> tuple[dict[Path, bytes], tuple[str, ...], dict[str, Any]]:
    """The file of a table of rotary axes, what to know of it, and the report. Raises ConfigError for a
    machine that the table cannot hold."""
    setup = _calibrated(machine, job)
    kinematics = setup.kinematics
    lies = as_it_lies(kinematics.structure, kinematics.errors)
    try:
        files = {target: TABLES[kind].write(lies)}
    except ConfigError as error:
        raise error.in_file(str(machine)) from None
    notes = [
        f"once the control has these vectors, describe it once more (olp init --trafo {target.name}) and fit "
        "the calibration again: the present one is relative to the old vectors"
    ]
    notes += [
        f"the zero of {name} is off by {value:.6f} deg; set it at the reference point, no vector holds it"
        for name, value in left_zeros_deg(kinematics.structure, kinematics.errors).items()
    ]
    return files, tuple(notes), _report(setup, (kind, lies))


def _calibrated(machine: PathLike, job: PathLike | None) -> JointSetup:
    setup = load_joint_setup(machine, job, by_itself=True)
    if setup.calibration is None:
        raise UsageError(
            "the machine file names no calibration, so there is nothing to export", file=str(machine)
        )
    return setup


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
    setup = _calibrated(machine, job)
    assert setup.calibration is not None
    try:
        code = joint_code(setup.kinematics, setup.calibration.box, setup.digest)
    except ConfigError as error:
        raise error.in_file(str(machine)) from None
    return code, _report(setup)


def _report(setup: JointSetup, table: tuple[str, Structure] | None = None) -> dict[str, Any]:
    """What is left without correction, with code in the control, and with the lines of a `table` alone."""
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
    if table is not None:
        name, lies = table
        known = Kinematics(lies, tool_mm=setup.kinematics.tool_mm).nominal(values)
        actual = setup.kinematics.actual(values)
        left[name] = deviations(structure, actual, known)
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
