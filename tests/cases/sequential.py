"""Simulated machines measured by chosen readings, one lot after the other, beside as many of today's plan."""

from __future__ import annotations

import dataclasses
import datetime

import numpy as np
from cases.calibration import TOOLS, case, cloud, residual_of
from judge import simulated

from olp.calibration.design import layout, offers
from olp.calibration.design.choosing import Criterion, choose
from olp.calibration.design.known import Known, judged_rows
from olp.calibration.design.prediction import known_of_machines, predict
from olp.calibration.estimator.adjustment import fit
from olp.calibration.estimator.covariance import covariance_of
from olp.calibration.estimator.curves import calibration_of
from olp.calibration.estimator.fitted import Fit
from olp.calibration.observations.measurements import Measurements
from olp.calibration.observations.points import Points


def begun(seed: int, family: str, *, lines: bool) -> tuple[simulated.Machine, Measurements]:
    """A machine without backlash, and its full set of lines or nothing."""
    machine, taken = case(seed, family)
    machine.half = {}
    taken = taken if lines else Measurements("simulated")
    return machine, dataclasses.replace(taken, measured=datetime.date(2026, 5, 14))


def known_from(fitted: Fit, chain: str) -> Known:
    """What a fit knows, as its calibration states it."""
    calibration = calibration_of(fitted, None)
    return Known.of_calibration(calibration, chain, covariance_of(fitted, calibration), frozenset())


def chosen(
    machine: simulated.Machine, taken: Measurements, seed: int, lot: int, sigma: float,
    criterion: Criterion = "A",
) -> Measurements:  # fmt: skip
    """The readings so far, and so many points of a tracker that help most."""
    if taken.observations:
        fitted = fit(taken, machine.chain)
        known, box = known_from(fitted, machine.chain), fitted.box_mm
    else:
        known, box = known_of_machines(machine.chain, machine.box), machine.box
    offer = offers.points("simulated", known, box, simulated.OFFSETS, sigma, seed)
    index = choose(offer.candidates, judged_rows(known, box, TOOLS), lot, criterion).index
    planned = offer.planned(index).measurements.of(Points)[0]
    rng = np.random.default_rng([seed, lot, len(taken.observations)])
    place = simulated.tracked(machine, rng, planned.axis_mm, planned.tool_mm, sigma)
    return taken.also((dataclasses.replace(planned, measured_mm=place, source=f"next {lot}.csv"),))


def predicted(machine: simulated.Machine, n: int, sigma: float, rounds: int = 300) -> tuple[float, float]:
    """The rms in um predicted for n points of today's plan, from nothing, and a bound that no n points of the
    same reflectors on a lattice and a hypercube are predicted to go under.

    The mean square is a convex function of how often each point is read, whole or not. Its tangent at any
    such design bounds it from below (J. Kiefer, Annals of Statistics 2, 1974, p. 849).
    """
    known = known_of_machines(machine.chain, machine.box)
    planned = layout.points("simulated", machine.box, list(simulated.OFFSETS), n, sigma, 1)
    hypercube = predict(planned, machine.chain, machine.box, TOOLS).rms_mm
    offered = offers.points("simulated", known, machine.box, simulated.OFFSETS, sigma, 1).candidates
    rows = np.concatenate([offered.rows, offered.shared], axis=2)
    judged = judged_rows(known, machine.box, TOOLS)
    wanted = np.pad(judged.reshape(-1, judged.shape[2]), ((0, 0), (0, offered.shared.shape[2])))
    wanted = np.linalg.qr(wanted)[1] * np.sqrt(3.0 / len(wanted))
    share, bound = np.full(len(rows), n / len(rows)), 0.0
    for _ in range(rounds):
        information = np.einsum("n,nij,nik->jk", share, rows, rows, optimize=True)
        seen = np.linalg.solve(np.eye(rows.shape[2]) + information, wanted.T)
        gain = np.square(rows @ seen).sum(axis=(1, 2))
        bound = max(bound, float(np.sum(wanted.T * seen) + share @ gain - n * gain.max()))
        share *= np.sqrt(gain)
        share *= n / share.sum()
    return 1e3 * hypercube, 1e3 * float(np.sqrt(bound))


def today(machine: simulated.Machine, taken: Measurements, seed: int, n: int, sigma: float) -> Measurements:
    """The readings so far, and points of today's plan: a Latin hypercube."""
    return taken.also((cloud(machine, seed, n, 1e3 * sigma),))


def residual_um(machine: simulated.Machine, taken: Measurements) -> float:
    """The residual error after a fit, rms length in the best-fit frame, over both tools."""
    fitted = fit(taken, machine.chain)
    after = [residual_of(machine, fitted, tool, 600).after_framed for tool in TOOLS]
    return float(np.sqrt(np.mean(np.square(after))))
