"""TOPP-RA and re-timing on nine paths: python tests/benchmarks/bench_retime_peers.py PYTHON [name ...]

PYTHON is an interpreter with toppra (pip install toppra; it need not have olp). It has no limits of jerk and
feed: it gets the same smooth path, with the feed as one more axis, and no motion of limited jerk reaches its
time. Both motions are sampled at 1 kHz, and differences of positions are compared with the limits. Waypoints
per second are of CPU time: TOPP-RA's on the breaks of the path (three per waypoint), its cycle time on a grid
of at most a quarter of a millimetre. The solvers are also timed without the rest of the planner.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

#: sampling of both motions
CYCLE_S = 1e-3
#: largest and least cell of the grid
FINE_M = 0.25e-3
SHORTEST_M = 1e-7
#: acceleration along the path that is never reached
_NO_LIMIT = 1e6


class Cubics:
    """A path of cubics: `shape` (k, 4, 3) by the arc length from each of `breaks` (k + 1,)."""

    def __init__(self, breaks: np.ndarray, shape: np.ndarray) -> None:
        self.breaks, self.shape = breaks, shape

    def at(self, arc: np.ndarray, order: int = 0) -> np.ndarray:
        """(n, 3) position, or its first or second derivative."""
        k = np.clip(np.searchsorted(self.breaks, arc, side="right") - 1, 0, len(self.shape) - 1)
        s = (arc - self.breaks[k])[:, None]
        c = [self.shape[k, i] for i in range(4)]
        if order == 0:
            return np.asarray(c[0] + s * (c[1] + s * (c[2] + s * c[3])))
        if order == 1:
            return np.asarray(c[1] + s * (2 * c[2] + 3 * s * c[3]))
        return np.asarray(2 * c[2] + 6 * s * c[3])


def grid(breaks: np.ndarray, most: float) -> np.ndarray:
    """The breaks, none nearer to another than the shortest cell, with cells of at most `most`."""
    kept = [breaks[0]]
    for knot in breaks[1:-1].tolist():
        if knot - kept[-1] >= SHORTEST_M and breaks[-1] - knot >= SHORTEST_M:
            kept.append(knot)
    cells = np.diff(kept := np.array([*kept, breaks[-1]]))
    count = np.maximum(np.ceil(cells / most), 1).astype(int)
    step = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    return np.append(np.repeat(kept[:-1], count) + step * np.repeat(cells / count, count), breaks[-1])


def ratios(position: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """(3,) largest differences of positions at 1 kHz, as shares of velocity, acceleration and jerk limits."""
    return np.array(
        [
            (np.abs(np.diff(position, order, axis=0)) / (limits[order - 1] * CYCLE_S**order)).max()
            for order in (1, 2, 3)
        ]
    )


# -- in the interpreter of the peer ------------------------------------------------------------------------


def peer(file: str) -> None:
    """TOPP-RA on the path of a file; its results go into the same file."""
    import toppra
    from toppra import algorithm, constraint, interpolator

    toppra.setup_logging("ERROR")
    with np.load(file) as given:
        # in metres: in millimetres its solver drops small values, or finds no motion
        shape = given["shape"] * np.array([1e-3, 1.0, 1e3, 1e6])[:, None]
        path, limits, feed = (
            Cubics(given["breaks"] / 1e3, shape),
            given["limits"] / 1e3,
            float(given["feed"]) / 1e3,
        )

    class Path_(interpolator.AbstractGeometricPath):  # type: ignore[misc]
        """The axes, and the arc length as one more."""

        dof = 4
        path_interval = path.breaks[[0, -1]]
        waypoints = (path.breaks, None)

        def __call__(self, arc: Any, order: int = 0) -> np.ndarray:
            s = np.atleast_1d(np.asarray(arc, float))
            own = (s, np.ones_like(s), np.zeros_like(s))[order]
            states = np.column_stack((path.at(s, order), own))
            return states if np.ndim(arc) else states[0]

    velocity, acceleration = np.append(limits[0], feed), np.append(limits[1], _NO_LIMIT)

    def solved(cells: np.ndarray) -> tuple[np.ndarray | None, float]:
        begun = time.process_time()
        rules = [
            constraint.JointVelocityConstraint(np.column_stack((-velocity, velocity))),
            constraint.JointAccelerationConstraint(
                np.column_stack((-acceleration, acceleration)),
                discretization_scheme=constraint.DiscretizationType.Interpolation,
            ),
        ]
        solver = algorithm.TOPPRA(rules, Path_(), gridpoints=cells, solver_wrapper="seidel")
        _, speed, _ = solver.compute_parameterization(0, 0)
        return speed, time.process_time() - begun

    _, spent = solved(grid(path.breaks, np.inf))
    cells = grid(path.breaks, FINE_M)
    speed, _ = solved(cells)
    if speed is None:
        np.savez(file, found=False, spent=spent)
        return
    lasts = 2 * np.diff(cells) / (speed[1:] + speed[:-1])
    start = np.concatenate(([0.0], np.cumsum(lasts)))
    instant = np.arange(0.0, start[-1], CYCLE_S)
    k = np.clip(np.searchsorted(start, instant, side="right") - 1, 0, len(lasts) - 1)
    u = instant - start[k]
    arc = cells[k] + u * (speed[k] + 0.5 * u * (np.diff(speed) / lasts)[k])
    np.savez(file, found=True, spent=spent, seconds=start[-1], ratios=ratios(path.at(arc), limits))


# -- in ours -----------------------------------------------------------------------------------------------


def main() -> None:
    sys.path.insert(0, str(Path(__file__).parent))
    import retime_paths

    from olp.trajectory.critical import best_profile, driven
    from olp.trajectory.overlap import overlap
    from olp.trajectory.plan import plan
    from olp.trajectory.smooth import smooth

    def critical(route: Any, limits: Any) -> Any:
        path = smooth(route, limits)
        return driven(path, best_profile(path, limits))

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("peers_python")
    parser.add_argument("names", nargs="*", default=list(retime_paths.PATHS))
    options = parser.parse_args()
    limits = retime_paths.LIMITS
    bounds = np.stack((limits.velocity, limits.acceleration, limits.jerk))
    print(
        "acc, jerk: largest ratios at 1 kHz; wp/s: waypoints per second; overlap, critical: of these solvers"
    )
    print(
        "path        waypoints |   ours s   acc    jerk |  TOPP-RA s   acc   jerk    wp/s |"
        "  time;  wp/s: whole overlap critical  over TOPP-RA"
    )
    for name in options.names:
        route = retime_paths.route(name)

        def cpu(call: Callable[[], Any], count: int = len(route)) -> tuple[Any, float]:
            begun = time.process_time()
            result = call()
            return result, count / (time.process_time() - begun)

        trajectory, rate = cpu(partial(plan, route, limits))
        _, by_overlap = cpu(partial(overlap, route, limits))
        _, by_critical = cpu(partial(critical, route, limits))
        own = ratios(trajectory.at(np.arange(0.0, trajectory.duration_s, CYCLE_S))[0], bounds)
        path = smooth(route, limits)
        with tempfile.TemporaryDirectory() as folder:
            file = str(Path(folder) / "path.npz")
            feed = float(route.feed_mm_s.max())
            np.savez(file, breaks=path.break_mm, shape=path.shape, limits=bounds, feed=feed)
            subprocess.run([options.peers_python, __file__, "--peer", file], check=True)
            with np.load(file) as theirs:
                their_rate = len(route) / float(theirs["spent"])
                bound = float(theirs["seconds"]) if theirs["found"] else np.nan
                other = theirs["ratios"] if theirs["found"] else np.full(3, np.nan)
        print(
            f"{name:10s} {len(route):10d} | {trajectory.duration_s:8.3f} {own[1]:5.3f} {own[2]:7.4f} |"
            f" {bound:10.3f} {other[1]:5.3f} {other[2]:6.1f} {their_rate:7.0f} |"
            f" {trajectory.duration_s / bound:6.3f}"
            f" {rate / their_rate:12.2f} {by_overlap / their_rate:7.2f} {by_critical / their_rate:8.2f}",
            flush=True,
        )


if __name__ == "__main__":
    if sys.argv[1:2] == ["--peer"]:
        peer(sys.argv[2])
    else:
        main()
