"""Times of plans beside the joint optimum of path and speed: python tests/benchmarks/bench_joint_optimum.py

The reference is tests/judge/joint_optimum.py. Axes reach 500 mm/s, 5000 mm/s^2 and 1e5 mm/s^3, the feed is
100 mm/s. Two legs of a corner are 20 mm each. Some minutes.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from cases.joint_optimum import best, cases, planned

print("| run | `olp`, s | joint optimum, s | ratio | by |\n|---|---|---|---|---|")
for name, case in cases().items():
    plan = planned(case)
    least = best(case, plan).duration_s
    solvers = ", ".join(sorted({leg.solver for leg in plan.legs}))
    print(
        f"| {name} | {plan.duration_s:.4f} | {least:.4f} | {plan.duration_s / least:.3f} | {solvers} |",
        flush=True,
    )
