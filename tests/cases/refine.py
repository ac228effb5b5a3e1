"""Simulated machines refined by run after run, judged by what a calibration leaves at fresh places."""

from __future__ import annotations

import dataclasses
import datetime
from dataclasses import dataclass

import numpy as np
from cases.calibration import TOOLS, case
from judge import simulated

from olp.calibration.diagnosis.refinement import Refinement, refine
from olp.calibration.estimator.adjustment import fit
from olp.calibration.estimator.covariance import covariance_of
from olp.calibration.estimator.curves import calibration_of
from olp.calibration.observations.measurements import Measurements
from olp.calibration.observations.points import Points
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration
from olp.errormodel.sensitivity import Sensitivity
from olp.errormodel.uncertainty import Uncertainty


def start(seed: int, family: str, quick: bool) -> tuple[simulated.Machine, Calibration, Uncertainty]:
    """A machine with the calibration that its lines gave, or that of 60 points of 20 um taken in an hour."""
    machine, measurements = case(seed, family)
    if quick:
        measurements = Measurements("simulated", (run(machine, 7 * seed, 60, 0.020),))
    measurements = dataclasses.replace(measurements, measured=datetime.date(2026, 5, 14))
    adjustment = fit(measurements, machine.chain)
    calibration = calibration_of(adjustment, None)
    return machine, calibration, covariance_of(adjustment, calibration)


def run(machine: simulated.Machine, seed: int, n: int, sigma: float, tools=simulated.OFFSETS) -> Points:
    """A run of points with a tracker, somewhere else each time."""
    axis_mm, tool, place = simulated.points(machine, seed, n, sigma, tools)
    return Points(axis_mm, tool, place, sigma)


@dataclass(frozen=True)
class Judged:
    """rms lengths in um at fresh positions in the frame that fits best: the residual, and its stated
    uncertainty."""

    residual: float
    stated: float


def judge(
    machine: simulated.Machine, calibration: Calibration, uncertainty: Uncertainty, seed: int
) -> Judged:
    rng = np.random.default_rng([seed, 99])
    box = np.asarray(calibration.box_mm)
    axis_mm = rng.uniform(box[:, 0], box[:, 1], (400, 3))
    residuals, stated = [], []
    model = build(calibration, machine.chain, outside="hold")
    sensitivity = Sensitivity.of(calibration, machine.chain, uncertainty)
    for tool in TOOLS:
        vector = np.array(tool)
        rest = machine.error(axis_mm, vector) - model.error(axis_mm, vector)
        residuals.append(simulated.rms_um(simulated.off_frame(axis_mm + vector, rest)))
        rows = np.moveaxis(sensitivity.rows(axis_mm, vector), 0, 1).astype(float)
        framed = np.stack(
            [simulated.off_frame(axis_mm + vector, rows[:, :, k]) for k in range(rows.shape[2])], axis=2
        )
        stated.append(1e3 * np.sqrt((framed**2).sum(axis=(1, 2)).mean()))
    return Judged(float(np.mean(residuals)), float(np.mean(stated)))


def turns(
    seed: int, family: str, *, quick: bool, n: int = 60, sigma: float = 0.008, count: int = 3
) -> list[Judged]:
    """The residual before the first and after each turn."""
    machine, calibration, uncertainty = start(seed, family, quick)
    judged = [judge(machine, calibration, uncertainty, seed)]
    machine.half = {}
    for k in range(count):
        done: Refinement = refine(
            calibration, machine.chain, uncertainty, run(machine, 1000 * seed + k, n, sigma)
        )
        calibration, uncertainty = done.calibration, done.uncertainty
        judged.append(judge(machine, calibration, uncertainty, seed))
    return judged
