"""`calibrate export` for a machine with rotary axes: tables of its kinematics, and code for real time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from olp.core.errors import ConfigError, UsageError
from olp.files.config import load_job
from olp.files.control_code.base import Code
from olp.files.control_code.joint_code import joint_code
from olp.files.control_code.registry import CODE
from olp.files.kinematics.load import JointSetup, is_of_joints, load_joint_setup
from olp.files.kinematics.machine import load_joint_machine
from olp.files.kinematics.tables import TABLES
from olp.findings.catalogue import Finding
from olp.workflows.calibrate_export_left import report_of
from olp.workflows.session import PathLike


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


def table_export(
    machine: PathLike, kind: str, job: PathLike | None, target: Path
) -> tuple[dict[Path, bytes], tuple[str, ...], dict[str, Any]]:
    """The file of a table of the control's kinematics, what to know of it, and the report. Raises ConfigError
    for a machine that the table cannot hold."""
    setup = _calibrated(machine, job)
    form = TABLES[kind]
    try:
        entered = form.enter(setup.kinematics.structure, setup.kinematics.errors)
    except ConfigError as error:
        raise error.in_file(str(machine)) from None
    then = form.then.format(file=target.name)
    notes = (
        f"once the control has these values, {then}: the present one is relative to the old values",
        *entered.notes,
    )
    return {target: entered.data}, notes, report_of(setup, {kind: form})


def compare_kinematics(machine: PathLike, job: PathLike | None) -> dict[str, Any]:
    """What each table of a control's kinematics leaves ("olp-tables-1"). Nothing is written; tables that
    cannot hold the machine say why (OLP871). Raises ConfigError for a platform on legs."""
    setup = _calibrated(machine, job)
    if setup.machine.structure.platforms:
        raise ConfigError(
            "no table of a control holds a platform on legs; correct the programs instead", file=str(machine)
        )
    report = report_of(setup, TABLES)
    report["formats"] = {}
    for key, form in TABLES.items():
        findings = []
        try:
            form.enter(setup.kinematics.structure, setup.kinematics.errors)
        except ConfigError as error:
            findings.append(Finding("OLP871", str(error)).as_dict())
        report["formats"][key] = {
            "title": form.title, "status": form.status, "holds": form.holds, "findings": findings,
        }  # fmt: skip
    report["findings"] = []
    return report


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
        raise UsageError(
            "tables of errors hold three linear axes, and this machine has others; expected --format "
            f"{' or '.join((*TABLES, *CODE))}",
            file=str(machine),
        )
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
    return code, report_of(setup, {})
