"""Maps of non-rigid errors: the residual errors of machines that bend, and whether rigid ones get a map.

    python tests/benchmarks/bench_nonrigid.py [SEEDS]

Machines of 3 x 2 x 1 m and six chains; bending ones sag by 30 um in the middle of X and Y, more with the ram
up, and twist by 15 um. Points of 5 um in a Latin hypercube with three offsets of the reflector; judged at
fresh positions with another tool, after the rigid frame that fits best.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from cases.calibration import CHAINS, FRESH, cloud
from judge import simulated

from olp.calibration.estimator.adjustment import fit
from olp.calibration.estimator.nonrigid import nonrigid
from olp.calibration.observations.measurements import Measurements

SEEDS = 12


def spread(values: list[float]) -> str:
    low, middle, high = np.percentile(values, [10, 50, 90])
    return f"{middle:.1f} ({low:.1f} to {high:.1f})"


def run(family: str, bends: bool, n: int, seeds: int) -> None:
    rows: dict[str, list[float]] = {name: [] for name in ("rigid", "both", "z", "inside", "best")}
    maps, spent = 0, 0.0
    for seed in range(seeds):
        m = simulated.machine(seed, family, CHAINS[seed % len(CHAINS)])
        m = simulated.bent(m) if bends else m
        before = fit(Measurements("simulated", (cloud(m, seed, n, 5.0),)), m.chain)
        begin = time.process_time()
        extended = nonrigid(before)
        spent += time.process_time() - begin
        maps += bool(extended.processes)
        position, tool = (
            np.random.default_rng(99).uniform(m.box[:, 0], m.box[:, 1], (800, 3)),
            np.array(FRESH[1]),
        )
        true = m.error(position, tool)
        residual = true - extended.fit.error(position, tool) - extended.value(position)
        rows["rigid"].append(
            simulated.rms_um(simulated.off_frame(position, true - before.error(position, tool)))
        )
        rows["both"].append(simulated.rms_um(simulated.off_frame(position, residual)))
        z = residual[:200] / extended.sigma(position[:200], tool)
        rows["z"].append(float(np.sqrt(np.mean(z**2))))
        rows["inside"].append(float(np.mean(np.abs(z) < 2.0)))
        rows["best"].append(extended.best.evidence if extended.best else 0.0)
    print(
        f"{family}{', bends' if bends else ''}, {n} points: 21 errors {spread(rows['rigid'])} um, with map "
        f"{spread(rows['both'])} um; {maps} maps of {seeds}, log evidence {spread(rows['best'])} (largest "
        f"{max(rows['best']):.1f}); error over stated {np.sqrt(np.mean(np.square(rows['z']))):.2f}, within 2 "
        f"sigma {np.mean(rows['inside']):.0%}; {spent / seeds:.1f} s of CPU",
        flush=True,
    )


def main(seeds: int) -> None:
    for n in (120, 315):
        run("smooth", True, n, seeds)
        run("rough", True, n, seeds)
        run("smooth", False, n, seeds)
        run("rough", False, n, seeds)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS)
