"""Time and memory of planning a million waypoints: python tests/benchmarks/bench_retime_million.py [job ...]

    --points N     waypoints of each job (default 1e6)

Each job runs in its own process, so that its peak of memory is its own.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
import retime_paths

from olp.trajectory import contest, solvers, stretches
from olp.trajectory import plan as planner
from olp.trajectory.route import Route

#: what the planner calls, in the order of a report
STAGES = (
    (stretches, "_forecast"), (solvers, "smooth"), (solvers, "best_profile"), (solvers, "driven"),
    (contest, "optimised"), (solvers, "overlap"), (contest, "ratios"), (contest, "deviation_bound"),
    (planner, "with_jumps"),
)  # fmt: skip


def _route(points: np.ndarray, feed: float, tolerance: float) -> Route:
    count = len(points)
    allowed = np.full(count, tolerance)
    allowed[[0, -1]] = 0.0
    return Route(points, np.full(count - 1, feed), np.arange(1, count), allowed, np.zeros(count))


def _raster(count: int) -> Route:
    return _route(retime_paths.freeform(max(count // 501, 1)), 100.0, 0.01)


def _lines(count: int) -> Route:
    return _route(retime_paths.corrected(max(count // 201, 1)), 300.0, 0.005)


def _strokes(count: int) -> Route:
    return _route(retime_paths.engraving(count - 1), 100.0, 0.01)


def _stops(count: int) -> Route:
    return _route(retime_paths.engraving(count - 1), 100.0, 0.0)


def _noise(count: int) -> Route:
    return _route(retime_paths.zigzag(count - 1), 100.0, 0.005)


def _drilling(count: int) -> Route:
    """Holes: across, down, up, with a stop where the drill turns back."""
    k = np.arange(count)
    hole, what = k // 3, k % 3
    points = np.column_stack((hole % 500 * 2.0, hole // 500 * 2.0, np.where(what == 1, -5.0, 2.0)))
    return _route(points, 50.0, 0.02)


def _arcs(count: int) -> Route:
    """Arcs of twenty chords between exact stops, with corners."""
    angle = np.linspace(0.0, np.pi / 2, 21)[:-1]
    one = np.column_stack((np.sin(angle), 1.0 - np.cos(angle), 0.0 * angle)) * 10.0
    number = np.repeat(np.arange(count // 20), 20)
    points = np.tile(one, (count // 20, 1)) + np.column_stack((10.0 * number, 0.0 * number, 0.0 * number))
    route = _route(points, 100.0, 0.01)
    route.tolerance_mm[::20] = 0.0
    return route


JOBS: dict[str, Callable[[int], Route]] = {
    "raster": _raster, "lines": _lines, "strokes": _strokes, "stops": _stops, "noise": _noise,
    "drilling": _drilling, "arcs": _arcs,
}  # fmt: skip


def _user() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_utime


def _watched(module: ModuleType, name: str, spent: dict[str, float]) -> None:
    inner = getattr(module, name)

    def outer(*args: Any) -> Any:
        start = _user()
        try:
            return inner(*args)
        finally:
            spent[name] = spent.get(name, 0.0) + _user() - start

    setattr(module, name, outer)


def one(job: str, count: int) -> None:
    """Plan one job and print what it took."""
    route = JOBS[job](count)
    spent: dict[str, float] = {}
    for module, name in STAGES:
        _watched(module, name, spent)
    before = resource.getrusage(resource.RUSAGE_SELF)
    trajectory = planner.plan(route, retime_paths.LIMITS)
    after = resource.getrusage(resource.RUSAGE_SELF)
    user = after.ru_utime - before.ru_utime
    solvers = sorted({leg.solver for leg in trajectory.legs})
    slowed = max(leg.factor for leg in trajectory.legs)
    print(
        f"{job:9s}{len(route):9d}{user:9.1f}{after.ru_stime - before.ru_stime:8.1f}{len(route) / user:10.0f}"
        f"{after.ru_maxrss / 1e3:9.0f}{trajectory.duration_s:11.1f}{len(trajectory.motion):10d}"
        f"{len(trajectory.legs):8d}{slowed:9.5f}  {', '.join(solvers)}"
    )
    stages = ", ".join(f"{name.strip('_')} {seconds:.1f}" for name, seconds in spent.items())
    print(f"         user s: {stages}", flush=True)


def main() -> None:
    ask = argparse.ArgumentParser()
    ask.add_argument("jobs", nargs="*", default=list(JOBS))
    ask.add_argument("--points", type=float, default=1e6)
    ask.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    given = ask.parse_args()
    if given.here:
        one(given.jobs[0], int(given.points))
        return
    print(
        "job      waypoints   user s   sys s  points/s  peak MB duration s    pieces    legs   slowed solvers"
    )
    for job in given.jobs:
        start = time.monotonic()
        subprocess.run([sys.executable, __file__, job, "--points", str(given.points), "--here"], check=True)
        print(f"         wall {time.monotonic() - start:.0f} s", flush=True)


if __name__ == "__main__":
    main()
