"""Cycle times and speed of re-timing on nine paths: python tests/benchmarks/bench_retime.py [name ...]"""

from __future__ import annotations

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import retime_paths

from olp.trajectory.plan import plan


def main() -> None:
    print("path         waypoints     time s  / best known  solver            largest ratio   waypoints/s")
    for name in sys.argv[1:] or retime_paths.PATHS:
        route = retime_paths.route(name)
        best = retime_paths.PATHS[name][3]
        start = time.process_time()
        trajectory = plan(route, retime_paths.LIMITS)
        spent = time.process_time() - start
        largest = max(
            float(v.max())
            for v in (trajectory.audit.velocity, trajectory.audit.acceleration, trajectory.audit.jerk)
        )
        solvers = ", ".join(sorted({leg.solver for leg in trajectory.legs}))
        print(
            f"{name:10s} {len(route):11d} {trajectory.duration_s:10.3f} {trajectory.duration_s / best:9.3f}"
            f"      {solvers:17s} {largest:.9f}  {len(route) / spent:10.0f}"
        )


if __name__ == "__main__":
    main()
