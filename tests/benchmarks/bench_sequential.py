"""Chosen readings beside those of today's plan: `olp calibrate plan --next`.

    python tests/benchmarks/bench_sequential.py [SEEDS [FAMILY]]

Random machines of 3 x 2 x 1 m, six chains, both families. After a full set of lines: 40 points of a tracker
of 8 um in a Latin hypercube, and 20 or fewer that are chosen by the covariance of the fit. From nothing: 120
points of a hypercube, and chosen ones in lots of 30, each after a fit of those before. Everything is fitted
together and judged at fresh positions with two tools, rms length in um in the best-fit frame. Before that:
what is predicted for a hypercube, and what no choice of as many points goes under.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from cases.sequential import begun, chosen, predicted, residual_um, today

SEEDS = 6
SIGMA = 0.008


def main(seeds: int, *families: str) -> None:
    for n in (60, 80, 120):
        hypercube, bound = predicted(begun(0, "smooth", lines=False)[0], n, SIGMA)
        print(f"{n} points: hypercube {hypercube:.2f} predicted, no choice below {bound:.2f}", flush=True)
    for family in families or ("smooth", "rough"):
        rows: dict[str, list[float]] = {}

        def note(name: str, value: float, rows: dict[str, list[float]] = rows) -> None:
            rows.setdefault(name, []).append(value)

        for seed in range(seeds):
            machine, lines = begun(seed, family, lines=True)
            note("lines", residual_um(machine, lines))
            for n in (20, 40):
                note(
                    f"lines, {n} of a hypercube", residual_um(machine, today(machine, lines, seed, n, SIGMA))
                )
            for lot in (10, 20):
                note(f"lines, {lot} chosen", residual_um(machine, chosen(machine, lines, seed, lot, SIGMA)))
            machine, taken = begun(seed, family, lines=False)
            for n in (60, 120):
                note(f"{n} of a hypercube", residual_um(machine, today(machine, taken, seed, n, SIGMA)))
            for n in (30, 60, 90):
                taken = chosen(machine, taken, seed, 30, SIGMA)
                note(f"{n} chosen", residual_um(machine, taken))
        for name, values in rows.items():
            print(
                f"{family}: {name}: {np.median(values):.2f} ({min(values):.2f} to {max(values):.2f})",
                flush=True,
            )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS, *sys.argv[2:])
