"""Residual errors of simulated machines after three turns of refinement.

    python tests/benchmarks/bench_refine.py [SEEDS]

Random machines of 3 x 2 x 1 m and six chains, both families. They begin with the calibration that a full set
of lines gave, or 60 points of a tracker of 20 um. Each turn is a run of 60 other points of 8 um in another
frame. Judged at fresh positions with two tools (one never measured with), rms length less the best-fit frame;
"stated" is the same from the covariance. A rise counts where it is larger than the stated uncertainty.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from cases.refine import turns

SEEDS = 20


def main(seeds: int) -> None:
    for quick, name in ((False, "lines"), (True, "60 points of 20 um")):
        for family in ("smooth", "rough"):
            runs = [turns(seed, family, quick=quick) for seed in range(seeds)]
            residual = np.array([[one.residual for one in row] for row in runs])
            stated = np.array([[one.stated for one in row] for row in runs])
            words = " -> ".join(
                f"{np.median(residual[:, k]):.2f} (stated {np.median(stated[:, k]):.2f})" for k in range(4)
            )
            rises = residual[:, 1:] - residual[:, :-1]
            beyond = int((rises > stated[:, 1:]).sum())
            falls = int((rises < 0.0).sum())
            print(
                f"{name}, {family}: {words} um; {falls} of {rises.size} turns fall, largest rise "
                f"{max(0.0, rises.max()):.2f} um, {beyond} beyond what is stated"
            )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS)
