"""Residual errors of simulated machines after calibrations from lines, from points and from both.

    python tests/benchmarks/bench_calibrate.py [SEEDS]

Random machines of 3 x 2 x 1 m and six chains (four with moving tables). Each has a full set of lines: laser
0.5 um + 0.5 um/m, angles 1 urad, squares 5 urad, five runs in both directions, drift. All lines go through a
point off the datum, with a reflector off the gauge point. Points of a tracker are in a Latin hypercube with
three offsets of the reflector. Judged at fresh positions with tools of which one was measured with. Choices
(what a step must gain) were made on rough machines with seeds from 100, never on smooth ones.
"""

from __future__ import annotations

import dataclasses
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from cases.calibration import FRESH, TOOLS, case, cloud, rays, residual_of, two_pods
from judge.simulated import OFFSETS

from olp.calibration.estimator.adjustment import fit

SEEDS = 20


def spread(values: np.ndarray) -> str:
    low, middle, high = np.percentile(values, [10, 50, 90])
    return f"{middle:6.1f} ({low:.1f} to {high:.1f})"


@dataclass(frozen=True)
class Method:
    """What is measured: the lines, the number of points and their uncertainty, of stations for lengths, and
    of points for two pods; judged with these tools."""

    name: str
    lines: bool
    points: int
    sigma_um: float
    tools: tuple[tuple[float, float, float], ...]
    stations: int = 0
    directions: int = 0


METHODS = (
    Method("lines", True, 0, 0.0, TOOLS),
    Method("120 points of 5 um", False, 120, 5.0, FRESH),
    Method("lines and 40 points of 8 um", True, 40, 8.0, FRESH),
    Method("6 stations, 250 lengths each", False, 0, 0.0, (OFFSETS[0], FRESH[1]), stations=6),
    Method("two pods of 10 urad, 250 points", False, 0, 0.0, FRESH, directions=250),
    Method("two pods of 10 urad, 1000 points", False, 0, 0.0, FRESH, directions=1000),
)


def run(method: Method, family: str, seeds: int) -> None:
    rows: dict[int, list[tuple[float, ...]]] = {k: [] for k in range(len(method.tools))}
    spent = 0.0
    for seed in range(seeds):
        machine, measurements = case(seed, family)
        points = (cloud(machine, seed, method.points, method.sigma_um),) if method.points else ()
        lines = measurements.lines if method.lines else ()
        squares = measurements.squares if method.lines else ()
        lengths = rays(machine, seed, method.stations, 250) if method.stations else ()
        pods = (two_pods(machine, seed, method.directions),) if method.directions else ()
        taken = dataclasses.replace(
            measurements, observations=(*lines, *points, *lengths, *pods), squares=squares
        )
        begin = time.process_time()
        fitted = fit(taken, machine.chain)
        spent += time.process_time() - begin
        for k, tool in enumerate(method.tools):
            rows[k].append(dataclasses.astuple(residual_of(machine, fitted, tool)))
    print(f"{family} machines, {method.name}: {spent / seeds:.2f} s of CPU per fit")
    for k, tool in enumerate(method.tools):
        before, before_framed, after, after_framed, z = np.array(rows[k]).T
        print(
            f"  tool {tool}: {spread(before)} -> {spread(after)}; with best-fit frame {spread(before_framed)}"
            f" -> {spread(after_framed)}; z {np.sqrt(np.mean(z**2)):.2f}"
        )


def main(seeds: int) -> None:
    print("rms in um over fresh positions: median of machines (10 % to 90 %)")
    for method in METHODS:
        for family in ("smooth", "rough"):
            run(method, family, seeds)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS)
