"""Cycle times and speed of re-timing on nine paths: python tests/benchmarks/bench_retime.py [name ...]"""

from __future__ import annotations

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import retime_paths

from olp.trajectory.plan import plan


def main() -> None:
    print("path        way-points     time s  / best known  solver            largest ratio  way-points/s")
    for name in sys.argv[1:] or retime_paths.PATHS:
        route = retime_paths.route(name)
        best = retime_paths.PATHS[name][3]
        start = time.process_time()
        found = plan(route, retime_paths.LIMITS)
        spent = time.process_time() - start
        largest = max(
            float(v.max()) for v in (found.audit.velocity, found.audit.acceleration, found.audit.jerk)
        )
        solvers = ", ".join(sorted({leg.solver for leg in found.legs}))
        print(
            f"{name:10s} {len(route):11d} {found.duration_s:10.3f} {found.duration_s / best:9.3f}"
            f"      {solvers:17s} {largest:.9f}  {len(route) / spent:10.0f}"
        )


if __name__ == "__main__":
    main()
