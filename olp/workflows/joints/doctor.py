"""Numbers of a calibration of a machine of any joints, checked with new readings: from files to a report."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from olp.calibration.diagnosis.factors import CHANGE
from olp.calibration.joints.deciding import odds_in_words
from olp.calibration.joints.doctor import Diagnosis, Sign, diagnose_joints
from olp.calibration.joints.unknowns import Model, model_of
from olp.core.errors import ConfigError
from olp.core.values import dataclass
from olp.errormodel.uncertainty import YEAR
from olp.files.kinematics.calibration import load_joint_calibration
from olp.files.kinematics.covariance import JointCovariance, lines_of, load_joint_covariance
from olp.files.kinematics.machine import load_joint_machine
from olp.files.kinematics.numbers import number_of
from olp.files.kinematics.plan import Campaign, load_campaign
from olp.files.kinematics.writer import changed_values, joint_calibration_files, named_by
from olp.files.toml_text import read_toml
from olp.files.write import read_bytes
from olp.findings.catalogue import Finding
from olp.kinematics.errors import MachineErrors
from olp.kinematics.machine import JointCalibration
from olp.kinematics.structure import Structure
from olp.workflows.session import PathLike
from olp.workflows.shown import Filed

#: Numbers without a covariance may be off by this share of what is usual for such a machine.
_SHARE = 0.02
#: Decimals of figures in the report.
_DECIMALS = 3
#: Reduced chi-square above which nothing explains the readings.
_MISFIT = 4.0
#: At most so many names are listed.
_NAMED = 6
#: The code of a decided mistake by what it is.
_CODES: dict[Sign, str] = {"flipped": "OLP831", "another unit": "OLP831", "absent": "OLP836"}


@dataclass(frozen=True, slots=True, eq=False)
class DiagnosedJoints(Filed):
    """The check of a calibration of any joints by new readings: the report ("olp-joint-doctor-1") as a
    mapping, and findings. `diagnosis` holds the estimates. `inputs` are the files that were read, which
    `write` never overwrites."""

    diagnosis: Diagnosis
    report: dict[str, Any]
    findings: tuple[Finding, ...]
    values: dict[str, Any]
    known: JointCovariance | None
    calibration: str
    stated: JointCalibration
    inputs: tuple[str, ...] = ()

    def files(self, target: PathLike) -> dict[Path, bytes]:
        """The bytes of the calibration file `target` with what is decided put right, and of its
        covariance."""
        factors = self.diagnosis.factors
        changes = [
            (unknown, (factor - 1.0) * number_of(self.values, unknown))
            for unknown, factor in zip(self.diagnosis.unknowns, factors.tolist(), strict=True)
        ]
        values = changed_values(self.values, changes, self.stated.measured, (self.calibration, target))
        known = self.known
        if known is not None:
            known = JointCovariance(
                known.unknowns, known.covariance * np.outer(factors, factors), known.lines
            )
        notes = [f"{finding.code}: {finding.message}" for finding in self.findings]
        absent = known is not None and not factors.all()
        return joint_calibration_files(
            target,
            values,
            None if absent else known,
            self.stated.growth_per_year,
            notes,
            self.stated.misfit_mm,
        )


def diagnose_joint_calibration(calibration: PathLike, data: PathLike, machine: PathLike) -> DiagnosedJoints:
    """Check every number of a calibration of any joints with readings that were not used for it, and these
    readings with the calibration. `data` is a plan (olp-measurements-1) or a folder with measurements.toml.
    Raises InputError, ConfigError and CannotCompute."""
    structure = load_joint_machine(machine).structure
    values: dict[str, Any] = read_toml(read_bytes(calibration), str(calibration))[0]
    stated = load_joint_calibration(calibration, structure)
    campaign = load_campaign(data, structure)
    known, note = _known(calibration, values, structure)
    model, usual = _models(structure, stated, campaign, known, values)
    numbers = np.array([number_of(values, unknown) for unknown in model.unknowns])
    diagnosis = diagnose_joints(model, numbers, campaign.readings, usual)
    report = _report(diagnosis, campaign) | {"uncertainty": note}
    inputs = tuple(map(str, (machine, calibration, *named_by(calibration, values), *campaign.files)))
    findings = tuple(_findings(diagnosis))
    return DiagnosedJoints(diagnosis, report, findings, values, known, str(calibration), stated, inputs)


def _known(
    calibration: PathLike, values: dict[str, Any], structure: Structure
) -> tuple[JointCovariance | None, str]:
    """The covariance of a calibration, None where it has none of its own, and a note on it."""
    try:
        known = load_joint_covariance(calibration, values, structure)
    except ConfigError as error:
        # numbers edited by hand have the covariance of other ones; their signs can be checked all the same
        return None, f"not used: {'; '.join(error.problems)}"
    return known, "none is stated" if known is None else "that of the calibration"


def _models(
    structure: Structure,
    stated: JointCalibration,
    campaign: Campaign,
    known: JointCovariance | None,
    values: dict[str, Any],
) -> tuple[Model, Model]:
    """The machine as calibrated with what is known of it, and any machine of its structure."""
    reached = np.concatenate([reading.values for reading in campaign.readings])
    masses = stated.errors.masses
    usual = model_of(structure, reached, campaign.priors, masses=masses, datum_mm=stated.datum_mm)
    # another machine of this structure gives way as this one does
    weighed = MachineErrors(yields=stated.errors.yields, gravity=stated.errors.gravity)
    usual = replace(usual, base=weighed)
    if known is None:
        more = [unknown for unknown in usual.dropped if number_of(values, unknown)]
        unknowns = (*usual.unknowns, *more)
        numbers = np.array([number_of(values, unknown) for unknown in unknowns])
        prior = np.array([unknown.prior for unknown in unknowns])
        covariance = np.diag((_SHARE * prior) ** 2 + (CHANGE * numbers) ** 2)
        known = JointCovariance(unknowns, covariance, lines_of(structure))
    days = max((campaign.measured - stated.measured).days, 0)
    factor = 1.0 + stated.growth_per_year * days / YEAR
    model = Model(
        structure,
        known.unknowns,
        masses,
        stated.datum_mm,
        base=stated.errors,
        known=known.covariance * factor**2,
    )
    return model, usual


def _report(diagnosis: Diagnosis, campaign: Campaign) -> dict[str, Any]:
    return {
        "schema": "olp-joint-doctor-1",
        "machine": campaign.machine,
        "readings": sum(reading.count for reading in campaign.readings),
        "reduced_chi_square": _rounded(diagnosis.before),
        "reduced_chi_square_put_right": _rounded(diagnosis.after),
        "reduced_chi_square_read_back": None if diagnosis.shown is None else _rounded(diagnosis.shown),
        "log10_odds": _rounded(diagnosis.odds / math.log(10.0)) if diagnosis.odds else None,
        "wrong": [mistake.words for mistake in diagnosis.mistakes]
        + ([diagnosis.of_readings] if diagnosis.of_readings else []),
        "numbers": [
            {
                "name": number.unknown.name,
                "stated": round(number.stated / number.unknown.scale, _DECIMALS),
                "sign": number.sign,
                "factor": round(number.factor, _DECIMALS),
                "sigma": _rounded(number.sigma),
            }
            for number in diagnosis.numbers
        ],
    }


def _rounded(value: float) -> float | None:
    """None for what is infinite."""
    return round(value, _DECIMALS) if math.isfinite(value) else None


def _findings(diagnosis: Diagnosis) -> Iterator[Finding]:
    odds = odds_in_words(math.inf if math.isinf(diagnosis.before) else diagnosis.odds)
    then = f"reduced chi-square {diagnosis.after:.3g}"
    if math.isfinite(diagnosis.before):
        then += f" instead of {diagnosis.before:.3g}"
    for mistake in diagnosis.mistakes:
        yield Finding(_CODES[mistake.sign], f"{mistake.words} ({odds}: {then})")
    if diagnosis.of_readings:
        code = "OLP835" if diagnosis.single else "OLP810"
        yield Finding(code, f"{diagnosis.of_readings} ({odds}: {then})")
    for doubt in diagnosis.doubts:
        yield Finding("OLP833", f"{doubt}: this explains the readings as well")
    open_names = [number.unknown.name for number in diagnosis.numbers if number.sign == "undecided"]
    if open_names:
        more = f" and {len(open_names) - _NAMED} more" if len(open_names) > _NAMED else ""
        yield Finding("OLP833", f"{', '.join(open_names[:_NAMED])}{more}", count=len(open_names))
    if diagnosis.other:
        named = ", ".join(f"{name} ({off:.0f})" for name, off in diagnosis.other[:3])
        yield Finding(
            "OLP834",
            f"reduced chi-square is {diagnosis.after:.3g}, and a machine with other numbers explains the "
            f"readings: they are of another machine, or it has changed; standard deviations off: {named}",
        )
    elif diagnosis.after > _MISFIT:
        yield Finding(
            "OLP834",
            f"reduced chi-square is {diagnosis.after:.3g}; expected about 1: check that the axis values are "
            "the commanded ones, not those read back",
        )


__all__ = ["DiagnosedJoints", "diagnose_joint_calibration"]
