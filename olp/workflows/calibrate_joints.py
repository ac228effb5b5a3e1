"""A calibration of a machine of any joints from the files of measurements: read, fit, and what to write."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import Any

import numpy as np

from olp.calibration.joints.adjustment import JointFit, held_out
from olp.calibration.joints.findings import fit_or_refuse, joint_findings
from olp.calibration.joints.payloads import refuse_other_payloads
from olp.calibration.joints.unknowns import model_of
from olp.core.arrays import Array
from olp.core.errors import CannotCompute
from olp.core.units import RAD_PER_URAD, UM_PER_MM
from olp.core.values import dataclass
from olp.files.kinematics.covariance import JointCovariance, lines_of
from olp.files.kinematics.machine import load_joint_machine
from olp.files.kinematics.plan import Campaign, load_campaign
from olp.files.kinematics.writer import fitted_values, joint_calibration_files
from olp.findings.catalogue import Finding
from olp.workflows.session import PathLike
from olp.workflows.shown import Filed

#: Decimals of figures in the report, um and urad.
_DECIMALS = 3


@dataclass(frozen=True, slots=True, eq=False)
class FittedJoints(Filed):
    """A calibration of a machine of any joints with what it was made from.

    `fit` holds all unknowns with their covariance (`fit.sigma_at(values, tool_mm)` is the uncertainty of a
    pose anywhere), `report` the results as a mapping ("olp-joint-fit-1"), `findings` what to know about them.
    `unseen` are the distances (n,) in mm of held-out readings before and after, None where they are too few.
    `inputs` are the files that were read, which `write` never overwrites.
    """

    fit: JointFit
    campaign: Campaign
    report: dict[str, Any]
    unseen: tuple[Array, Array] | None
    findings: tuple[Finding, ...]
    valid_until: datetime.date | None
    inputs: tuple[str, ...] = ()

    def files(self, target: PathLike) -> dict[Path, bytes]:
        """The bytes of the calibration file `target` and of its covariance beside it."""
        notes = [f"{finding.code}: {finding.message}" for finding in self.findings]
        values = fitted_values(
            self.fit,
            _box(self.fit),
            self.campaign.measured,
            self.valid_until,
            self.campaign.temperature_degC,
        )
        model = self.fit.model
        known = JointCovariance(model.unknowns, self.fit.covariance, lines_of(model.structure))
        return joint_calibration_files(target, values, known, notes=notes, misfit_mm=self.fit.misfit_mm)


def fit_joint_calibration(
    data: PathLike, machine: PathLike, *, valid_until: datetime.date | None = None
) -> FittedJoints:
    """The calibration of a machine of any joints from its measurements.

    `data` is a plan (olp-measurements-1) or a folder with measurements.toml, `machine` the machine file: its
    lines are what the control believes. Which unknowns the structure can show is computed; the others are 0.
    Raises InputError, ConfigError with every problem of the files, and CannotCompute.
    """
    structure = load_joint_machine(machine).structure
    campaign = load_campaign(data, structure)
    values = np.concatenate([reading.values for reading in campaign.readings])
    model = model_of(
        structure,
        values,
        campaign.priors,
        yielding=campaign.yielding,
        sagging=campaign.sagging,
        masses=campaign.masses,
    )
    refuse_other_payloads(model, campaign.readings, str(data))
    fit = fit_or_refuse(model, campaign.readings)
    findings = joint_findings(fit, campaign.readings)
    try:
        unseen, settles = held_out(fit), True
    except CannotCompute:
        # what the whole fit says of its readings counts more
        unseen, settles = None, False
    files = (str(machine), *campaign.files)
    return FittedJoints(
        fit, campaign, _report(fit, unseen, settles=settles), unseen, findings, valid_until, files
    )


def _box(fit: JointFit) -> dict[str, tuple[float, float]]:
    """The values of each axis that the readings reach."""
    values = np.concatenate([source.start.reading.values for source in fit.sources])
    return {
        f"{joint.name}_{joint.unit}": (float(column.min()), float(column.max()))
        for joint, column in zip(fit.model.structure.joints.values(), values.T, strict=True)
    }


def _report(fit: JointFit, unseen: tuple[Array, Array] | None, *, settles: bool) -> dict[str, Any]:
    """The report; `settles` says whether the readings that are not held out settle."""
    model = fit.model
    report: dict[str, Any] = {
        "schema": "olp-joint-fit-1",
        "machine": model.structure.name,
        "unknowns_kept": len(model.unknowns),
        "unknowns_determined": fit.determined,
        "reduced_chi_square": round(fit.chi_square / fit.freedom, _DECIMALS),
        "degrees_of_freedom": round(fit.freedom, 1),
        "readings": [
            {
                "name": source.start.reading.kind,
                "file": source.start.reading.source,
                "rows": source.start.reading.count,
                "sigma_um": source.start.reading.sigma * UM_PER_MM,
                **_figures(source.off_mm),
            }
            for source in fit.sources
        ],
    }
    if unseen is not None:
        before, after = unseen
        report["held_out"] = [
            {"name": words, "rows": len(off), **_figures(off)}
            for words, off in (("before", before), ("after", after))
        ]
    if not settles:
        report["held_out_unknown"] = "without the fifth that is held out the readings do not settle"
    report["unknowns"] = [
        {
            "name": unknown.name,
            "value": round(value / unknown.scale, _DECIMALS),
            "sigma": round(sigma / unknown.scale, _DECIMALS),
            "prior": round(unknown.prior / unknown.scale, _DECIMALS),
        }
        for unknown, value, sigma in zip(model.unknowns, fit.theta.tolist(), fit.sigma.tolist(), strict=True)
    ]
    place, turn = _at_postures(fit)
    report["uncertainty_in_best_frame"] = {
        "tip_mean_um": round(float(place.mean()) * UM_PER_MM, _DECIMALS),
        "tip_largest_um": round(float(place.max()) * UM_PER_MM, _DECIMALS),
        "tip_with_misfit_um": round(_with_misfit(fit, place) * UM_PER_MM, _DECIMALS),
        "turn_largest_urad": round(float(turn.max()) / RAD_PER_URAD, _DECIMALS),
    }
    report["not_needed"] = ", ".join(unknown.name for unknown in model.dropped)
    return report


def _at_postures(fit: JointFit) -> tuple[Array, Array]:
    """(n,) mm of the tip and (n,) rad of the tool: standard uncertainties at the postures of the readings, in
    the best frame."""
    parts = [
        fit.sigma_in_best_frame(source.start.reading.values, np.array(source.start.reading.tool_mm))
        for source in fit.sources
    ]
    place, turn = (np.concatenate([part[k] for part in parts]) for k in range(2))
    return np.linalg.norm(place, axis=1), np.linalg.norm(turn, axis=1)


def _with_misfit(fit: JointFit, place: Array) -> float:
    """mm by which a tip is expected to be off (rms): (n,) the uncertainties of the unknowns, and what none of
    these explains."""
    return float(np.sqrt(np.mean(place**2) + 3.0 * fit.misfit_mm**2))


def _figures(off_mm: Array) -> dict[str, float]:
    """Figures of distances (n,) in mm."""
    return {
        "mean_um": round(float(off_mm.mean()) * UM_PER_MM, _DECIMALS),
        "rms_um": round(float(np.sqrt(np.mean(off_mm**2))) * UM_PER_MM, _DECIMALS),
        "largest_um": round(float(off_mm.max()) * UM_PER_MM, _DECIMALS),
    }


__all__ = ["FittedJoints", "fit_joint_calibration"]
