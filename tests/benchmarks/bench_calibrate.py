"""What a calibration from lines leaves of simulated machines.

    python tests/benchmarks/bench_calibrate.py [SEEDS]

Random machines of 3 x 2 x 1 m and six chains (four with moving tables), a full set of lines each (laser
0.5 um + 0.5 um/m, angles 1 urad, squares 5 urad, five runs there and back, drift), all through a place off
the datum and with a reflector off the gauge point. Judged at fresh places with two tools, one never measured
with. Choices (what a step must gain) were made on rough machines with seeds from 100, never on smooth ones.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from calibration_cases import TOOLS, case, left

from olp.calibration.estimator import fit

SEEDS = 20


def spread(values: np.ndarray) -> str:
    low, middle, high = np.percentile(values, [10, 50, 90])
    return f"{middle:6.1f} ({low:.1f} to {high:.1f})"


def main(seeds: int) -> None:
    print("rms in um over fresh places: median of machines (10 % to 90 %)")
    for family in ("smooth", "rough"):
        rows: dict[int, list[list[float]]] = {0: [], 1: []}
        spent = 0.0
        for seed in range(seeds):
            machine, measurements = case(seed, family)
            begin = time.process_time()
            found = fit(measurements, machine.chain)
            spent += time.process_time() - begin
            for k, tool in enumerate(TOOLS):
                one = left(machine, found, tool)
                rows[k].append([one.before, one.after, one.before_framed, one.after_framed, one.z])
        for k, name in enumerate(("tool measured with", "another tool")):
            before, after, before_framed, after_framed, z = np.array(rows[k]).T
            print(
                f"{family:7} {name:19} {spread(before)} -> {spread(after)}; with best-fit frame "
                f"{spread(before_framed)} -> {spread(after_framed)}; z {np.sqrt(np.mean(z**2)):.2f}"
            )
        print(f"{family:7} {spent / seeds:.2f} s of CPU a machine")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS)
