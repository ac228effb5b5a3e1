"""A calibration of a machine of any joints refined by new readings: from files to the new calibration."""

from __future__ import annotations

import datetime
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from olp.calibration.joints.adjustment import JointFit
from olp.calibration.joints.deciding import AGREES
from olp.calibration.joints.findings import left_out_findings
from olp.calibration.joints.payloads import refuse_other_payloads
from olp.calibration.joints.refinement import Refined, refine_joints, years_until
from olp.calibration.joints.unknowns import Model
from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.machine import Vector
from olp.core.units import MM_PER_UM, UM_PER_MM
from olp.core.values import dataclass
from olp.errormodel.uncertainty import YEAR
from olp.files.kinematics.calibration import load_joint_calibration
from olp.files.kinematics.covariance import JointCovariance, load_joint_covariance
from olp.files.kinematics.machine import load_joint_machine
from olp.files.kinematics.plan import Campaign, load_campaign
from olp.files.kinematics.writer import changed_values, joint_calibration_files, named_by
from olp.files.toml_text import read_toml
from olp.files.write import read_bytes
from olp.findings.catalogue import Finding
from olp.kinematics.machine import JointCalibration
from olp.workflows.session import PathLike
from olp.workflows.shown import Filed

#: Postures in the box at which the tip is judged, and the seed of their axis values.
_POSTURES = 60
_SEED = 1
#: Decimals of figures in the report.
_DECIMALS = 3


@dataclass(frozen=True, slots=True, eq=False)
class RefinedJoints(Filed):
    """A calibration of any joints that new readings changed within its covariance, and its new covariance.

    `refined` holds changes and covariance in mm and rad, `report` the same as a mapping
    ("olp-joint-refinement-1"). `inputs` are the files that were read, which `write` never overwrites.
    """

    refined: Refined
    known: JointCovariance
    report: dict[str, Any]
    findings: tuple[Finding, ...]
    values: dict[str, Any]
    calibration: str
    day: datetime.date
    growth_per_year: float
    inputs: tuple[str, ...] = ()

    def files(self, target: PathLike) -> dict[Path, bytes]:
        """The bytes of the calibration file `target` and of its covariance beside it."""
        notes = [f"{finding.code}: {finding.message}" for finding in self.findings]
        fit = self.refined.fit
        changes = zip(fit.model.unknowns, fit.theta.tolist(), strict=True)
        values = changed_values(self.values, changes, self.day, (self.calibration, target))
        known = JointCovariance(self.known.unknowns, fit.covariance, self.known.lines)
        return joint_calibration_files(target, values, known, self.growth_per_year, notes, fit.misfit_mm)


def refine_joint_calibration(
    calibration: PathLike,
    data: PathLike,
    machine: PathLike,
    *,
    date: datetime.date | None = None,
    growth_per_year: float | None = None,
    uncertainty_um: float | None = None,
) -> RefinedJoints:
    """Change a calibration of any joints by new readings, within its covariance.

    `data` is a plan (olp-measurements-1) or a folder with measurements.toml, as for a fit. What was known
    fades until the day of the readings (`date`, default that of the plan): standard uncertainties grow by
    `growth_per_year` (default that of the calibration). With `uncertainty_um` the report states when the tip,
    in the best frame, will be known worse than that. Raises InputError, CannotCompute, and ConfigError where
    the calibration states no covariance.
    """
    structure = load_joint_machine(machine).structure
    values: dict[str, Any] = read_toml(read_bytes(calibration), str(calibration))[0]
    stated = load_joint_calibration(calibration, structure)
    known = load_joint_covariance(calibration, values, structure)
    if known is None:
        raise ConfigError(
            "states no covariance, so nothing says how far it may change; expected the table [covariance] "
            "that olp calibrate fit writes",
            file=str(calibration),
        )
    campaign = load_campaign(data, structure)
    _refuse_yields(campaign, known, data)
    day = date or campaign.measured
    if day < stated.measured:
        raise ConfigError(
            f"was measured on {day}, before the calibration of {stated.measured}; expected newer readings",
            file=str(data),
        )
    growth = stated.growth_per_year if growth_per_year is None else growth_per_year
    factor = 1.0 + growth * (day - stated.measured).days / YEAR
    model = Model(
        structure,
        known.unknowns,
        stated.errors.masses,
        stated.datum_mm,
        base=stated.errors,
        known=known.covariance * factor**2,
    )
    refuse_other_payloads(model, campaign.readings, str(data), stated.payload)
    refined = refine_joints(model, campaign.readings)
    tip = _tip_mm(refined.fit, stated, campaign.readings[0].tool_mm)
    report = _report(refined, structure.name, factor)
    report["uncertainty_um"] = round(tip * UM_PER_MM, _DECIMALS)
    if uncertainty_um is not None:
        years = years_until(tip, uncertainty_um * MM_PER_UM, growth)
        again = None if years is None else day + datetime.timedelta(days=years * YEAR)
        report |= {"wanted_um": uncertainty_um, "measure_again": None if again is None else again.isoformat()}
    inputs = tuple(map(str, (machine, calibration, *named_by(calibration, values), *campaign.files)))
    return RefinedJoints(
        refined, known, report, tuple(_findings(refined)), values, str(calibration), day, growth, inputs
    )


def _refuse_yields(campaign: Campaign, known: JointCovariance, data: PathLike) -> None:
    """Raises ConfigError where a plan asks for unknowns that the calibration does not have."""
    fitted = {(unknown.table, unknown.part) for unknown in known.unknowns}
    asked = {"elasticity": campaign.yielding, "gravity": campaign.sagging}
    more = [
        f"{table} of {name}"
        for table, names in asked.items()
        for name in names
        if (table, name) not in fitted
    ]
    if more or campaign.masses:
        what = ", ".join(more) or "masses"
        raise ConfigError(
            f"the plan states {what}, and a refinement takes both from the calibration; fit all readings "
            "together to find them",
            file=str(data),
        )


def _tip_mm(fit: JointFit, stated: JointCalibration, tool_mm: Vector) -> float:
    """mm: what is not known of the tip (rms length) at random postures of the box, in the best frame."""
    order = fit.model.structure.order
    low, high = np.array([stated.box[name] for name in order], float).T
    if fit.model.structure.platforms:
        # a platform closes between postures that were reached
        values = np.concatenate([source.start.reading.values for source in fit.sources])
    else:
        values = np.random.default_rng(_SEED).uniform(low, high, (_POSTURES, len(low)))
    place, _ = fit.sigma_in_best_frame(values, np.array(tool_mm))
    return float(np.sqrt(np.mean(np.sum(place**2, axis=1))))


def _report(refined: Refined, machine: str, factor: float) -> dict[str, Any]:
    fit = refined.fit
    old = np.sqrt(np.diag(np.asarray(fit.model.known)))
    rows = zip(fit.model.unknowns, fit.theta, refined.deviations, old, fit.sigma, strict=True)
    return {
        "schema": "olp-joint-refinement-1",
        "machine": machine,
        "readings": sum(source.start.reading.count for source in fit.sources),
        "left_out": len(fit.left_out),
        "rms_before_um": _rms(refined.before),
        "rms_after_um": _rms(fit),
        "reduced_chi_square": round(refined.agreement, _DECIMALS),
        "growth_by_age": round(factor, _DECIMALS),
        "changes": [
            {
                "name": unknown.name,
                "changed": round(float(change) / unknown.scale, _DECIMALS),
                "old_standard_deviations": round(float(off), _DECIMALS),
                "sigma_before": round(float(before) / unknown.scale, _DECIMALS),
                "sigma_after": round(float(after) / unknown.scale, _DECIMALS),
            }
            for unknown, change, off, before, after in rows
        ],
    }


def _rms(fit: JointFit) -> float:
    off: Array = np.concatenate([source.off_mm for source in fit.sources])
    return round(float(np.sqrt(np.mean(off**2))) * UM_PER_MM, _DECIMALS)


def _findings(refined: Refined) -> Iterator[Finding]:
    yield from left_out_findings(refined.fit, "OLP835")
    if refined.agreement > AGREES:
        worst = int(np.argmax(np.abs(refined.deviations)))
        name = refined.fit.model.unknowns[worst].name
        yield Finding(
            "OLP839",
            f"reduced chi-square is {refined.agreement:.1f}; {name} changed most, by "
            f"{abs(refined.deviations[worst]):.1f} standard deviations",
        )


__all__ = ["RefinedJoints", "refine_joint_calibration"]
