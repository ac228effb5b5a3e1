"""What three turns of refinement leave of simulated machines.

    python tests/benchmarks/bench_refine.py [SEEDS]

Random machines of 3 x 2 x 1 m and six chains, both families. They begin with the calibration that a full set
of lines gave, or 60 points of a tracker of 20 um; each turn is a run of 60 other points of 8 um in another
frame. Judged at fresh places with two tools (one never measured with), rms length less the best-fit frame;
"stated" is what the covariance says of the same. A rise counts where it is larger than the stated
uncertainty.
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
            found = [turns(seed, family, quick=quick) for seed in range(seeds)]
            left = np.array([[one.left for one in row] for row in found])
            stated = np.array([[one.stated for one in row] for row in found])
            words = " -> ".join(
                f"{np.median(left[:, k]):.2f} (stated {np.median(stated[:, k]):.2f})" for k in range(4)
            )
            rises = left[:, 1:] - left[:, :-1]
            beyond = int((rises > stated[:, 1:]).sum())
            falls = int((rises < 0.0).sum())
            print(
                f"{name}, {family}: {words} um; {falls} of {rises.size} turns fall, largest rise "
                f"{max(0.0, rises.max()):.2f} um, {beyond} beyond what is stated"
            )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS)
