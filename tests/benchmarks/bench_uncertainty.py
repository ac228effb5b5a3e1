"""Coverage of the 2-sigma band of corrected waypoints, and the time that bands take.

    python tests/benchmarks/bench_uncertainty.py [SEEDS]

Random 3 x 2 x 1 m machines of both families (tests/judge/simulated.py, independent of olp) are measured with
a laser, levels and a square, and fitted. At fresh poses with fresh tools: how often the true error of
the calibration lies within two of its standard uncertainties, coordinate by coordinate. Coverage is over all
poses of all seeds; poses of one machine are correlated, so its scatter over seeds is stated too. With a
touch-off, the difference from one position counts.
"""

from __future__ import annotations

import datetime
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from cases.calibration import measurements_of
from judge import simulated

from olp.calibration.estimator.adjustment import fit
from olp.calibration.estimator.covariance import covariance_of
from olp.calibration.estimator.curves import calibration_of
from olp.calibration.observations.measurements import Measurements
from olp.core.progress import silent
from olp.core.toolpath import Frame, Toolpath
from olp.errormodel.build import build
from olp.errormodel.sensitivity import Sensitivity
from olp.uncertainty.spread import Points, Unknowns, confidence

POSES = 60


def taken(machine: simulated.Machine, seed: int) -> Measurements:
    """The readings of a full set of lines."""
    measurements = measurements_of(simulated.all_lines(machine, seed), simulated.PITCH)
    return replace(measurements, measured=datetime.date(2026, 5, 14))


def standardised(seed: int, family: str, chain: str = "FXYZ") -> tuple[np.ndarray, np.ndarray]:
    """(POSES, 3) true errors of the calibration over their standard uncertainties, at positions and against a
    touch-off."""
    machine = simulated.machine(seed, family, chain)
    fitted = fit(taken(machine, seed), chain)
    calibration = calibration_of(fitted)
    model = build(calibration, chain)
    known = Sensitivity.of(calibration, chain, covariance_of(fitted, calibration))
    rng = np.random.default_rng([seed, 4711])
    position = rng.uniform(*calibration.box_mm.T, (POSES, 3))
    tool = rng.uniform((-100.0, -100.0, -300.0), (100.0, 100.0, -50.0))
    play = rng.choice((-1.0, 1.0), (POSES, 3))
    off = machine.error(position, tool, play) - model.error(position, tool, play)
    rows = known.rows(position, tool, play)
    scores = []
    for first in (False, True):
        value, part = (off - off[:1], rows - rows[:, :1]) if first else (off, rows)
        sigma = np.sqrt((part.astype(float) ** 2).sum(axis=2)).T
        scores.append((value[first:] / sigma[first:])[: POSES - 1])
    return scores[0], scores[1]


def coverage(family: str, seeds: int) -> None:
    start = time.perf_counter()
    scores = [standardised(seed, family) for seed in range(seeds)]
    took = time.perf_counter() - start
    for k, what in enumerate(("at places", "against a touch-off")):
        z = np.array([pair[k] for pair in scores])
        inside = np.abs(z) <= 2.0
        each = inside.mean(axis=(1, 2))
        print(
            f"{family:7s} {what:20s} {100 * inside.mean():5.1f} % inside 2 sigma (X Y Z "
            + " ".join(f"{100 * v:.1f}" for v in inside.mean(axis=(0, 1)))
            + f"; scatter of seeds {100 * each.std():.1f}), rms of z {np.sqrt((z**2).mean()):.2f}"
        )
    print(f"{family:7s} {seeds} seeds in {took:.0f} s")


def speed(count: int = 100_000) -> None:
    """Bands and probabilities of a program of many waypoints."""
    machine = simulated.machine(1, "rough")
    fitted = fit(taken(machine, 1), "FXYZ")
    calibration = calibration_of(fitted)
    known = Unknowns(Sensitivity.of(calibration, "FXYZ", covariance_of(fitted, calibration)), (0.0, 0.0, 0.0))
    rng = np.random.default_rng(0)
    position = rng.uniform(*calibration.box_mm.T, (count, 3))
    model = build(calibration, "FXYZ")
    frame = Frame(touched=((1500.0, 700.0, -600.0), (0.0, 0.0, -120.0)), tool_mm=(0.0, 0.0, -120.0))
    path = Toolpath(
        np.ones(count, np.uint8), np.zeros(count, np.uint8), np.arange(1, count + 1, dtype=np.int32),
        np.zeros(count, np.int32), position, (frame,),
    )  # fmt: skip
    before = model.error(position, np.array(frame.tool_mm))
    points = Points(np.arange(count), position, before, np.zeros((count, 3)), None)
    start = time.perf_counter()
    done = confidence(known, path, points, 0.010, tell=silent)
    took = time.perf_counter() - start
    assert done.chances is not None
    size = f"{count} waypoints, {known.sensitivity.columns} unknowns, {done.chances.draws} draws"
    print(f"{size}: {took:.1f} s")


if __name__ == "__main__":
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    speed()
    for family in ("smooth", "rough"):
        coverage(family, seeds)
