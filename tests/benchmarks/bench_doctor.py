"""Whether the doctor of calibrations ever decides wrongly.

    python tests/benchmarks/bench_doctor.py [TRIALS]

Simulated machines of 3 x 2 x 1 m, both families and six chains. A calibration as a shop would have it (the
true curves with another 1 um or 1 urad of smooth error) gets blunders: 15 % of all curves with
the wrong sign, some in the wrong unit, a table's curves with the table's sign convention, two columns
swapped, positions from the other end. Then 24 or 50 points of a tracker in an unknown frame, of 5, 10 or 15
um, three tool vectors.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from cases.doctor import trial

TRIALS = 500
PLANS = ((24, 0.005), (50, 0.005), (24, 0.010), (50, 0.015))


def main(trials: int) -> None:
    begin = time.process_time()
    for n, sigma in PLANS:
        counts: Counter[str] = Counter()
        wrong: list[str] = []
        for seed in range(trials // len(PLANS)):
            one = trial(seed, n, sigma)
            counts.update(one.counts)
            wrong += [f"seed {seed}: {text}" for text in one.wrong]
        print(f"{n} points of {1e3 * sigma:.0f} um:", dict(sorted(counts.items())))
        for text in wrong:
            print("  WRONG", text)
    print(f"{(time.process_time() - begin) / trials:.2f} s of CPU per trial")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else TRIALS)
