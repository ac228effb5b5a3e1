"""TOPP-RA beside re-timing, on nine paths: python tests/benchmarks/bench_retime_peers.py PYTHON [name ...]

PYTHON is an interpreter with toppra (pip install toppra; it need not have olp). It knows no jerk and no feed:
it is given the same smooth path, with the feed as an axis of its own, and its time is one that no motion of
limited jerk reaches. Both motions are sampled at 1 kHz, and differences of positions are held against the
limits. Way-points a second are of CPU time: TOPP-RA's on the breaks of the path (three a way-point), its time
on a grid of at most a quarter of a millimetre. Beside the whole planner stand its solvers alone.
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

CYCLE_S = 1e-3
FINE_M, SHORTEST_M = 0.25e-3, 1e-7
#: acceleration along the path that is never reached
_NO_LIMIT = 1e6


class Cubics:
    """A path of cubics: `shape` (k, 4, 3) by the way from each of `breaks` (k + 1,)."""

    def __init__(self, breaks: np.ndarray, shape: np.ndarray) -> None:
        self.breaks, self.shape = breaks, shape

    def at(self, way: np.ndarray, order: int = 0) -> np.ndarray:
        """(n, 3) position, or its first or second derivative."""
        k = np.clip(np.searchsorted(self.breaks, way, side="right") - 1, 0, len(self.shape) - 1)
        s = (way - self.breaks[k])[:, None]
        c = [self.shape[k, i] for i in range(4)]
        if order == 0:
            return np.asarray(c[0] + s * (c[1] + s * (c[2] + s * c[3])))
        if order == 1:
            return np.asarray(c[1] + s * (2 * c[2] + 3 * s * c[3]))
        return np.asarray(2 * c[2] + 6 * s * c[3])


def grid(breaks: np.ndarray, most: float) -> np.ndarray:
    """The breaks, none nearer to another than the shortest cell, and cells of at most so much."""
    kept = [breaks[0]]
    for at in breaks[1:-1].tolist():
        if at - kept[-1] >= SHORTEST_M and breaks[-1] - at >= SHORTEST_M:
            kept.append(at)
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
        # in metres: its solver leaves out what is small, or finds nothing
        shape = given["shape"] * np.array([1e-3, 1.0, 1e3, 1e6])[:, None]
        path, limits, feed = (
            Cubics(given["breaks"] / 1e3, shape),
            given["limits"] / 1e3,
            float(given["feed"]) / 1e3,
        )

    class Path_(interpolator.AbstractGeometricPath):  # type: ignore[misc]
        """The axes, and the way itself as one more."""

        dof = 4
        path_interval = path.breaks[[0, -1]]
        waypoints = (path.breaks, None)

        def __call__(self, way: Any, order: int = 0) -> np.ndarray:
            at = np.atleast_1d(np.asarray(way, float))
            own = (at, np.ones_like(at), np.zeros_like(at))[order]
            states = np.column_stack((path.at(at, order), own))
            return states if np.ndim(way) else states[0]

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
    at = np.arange(0.0, start[-1], CYCLE_S)
    k = np.clip(np.searchsorted(start, at, side="right") - 1, 0, len(lasts) - 1)
    u = at - start[k]
    way = cells[k] + u * (speed[k] + 0.5 * u * (np.diff(speed) / lasts)[k])
    np.savez(file, found=True, spent=spent, seconds=start[-1], ratios=ratios(path.at(way), limits))


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
    print("acc, jerk: largest ratios at 1 kHz; wp/s: way-points a second; overlap, critical: theirs alone")
    print(
        "path       way-points |   ours s   acc    jerk |  TOPP-RA s   acc   jerk    wp/s |"
        "  time;  wp/s: whole overlap critical  over TOPP-RA"
    )
    for name in options.names:
        route = retime_paths.route(name)

        def cpu(call: Callable[[], Any], count: int = len(route)) -> tuple[Any, float]:
            begun = time.process_time()
            result = call()
            return result, count / (time.process_time() - begun)

        found, rate = cpu(partial(plan, route, limits))
        _, by_overlap = cpu(partial(overlap, route, limits))
        _, by_critical = cpu(partial(critical, route, limits))
        own = ratios(found.at(np.arange(0.0, found.duration_s, CYCLE_S))[0], bounds)
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
            f"{name:10s} {len(route):10d} | {found.duration_s:8.3f} {own[1]:5.3f} {own[2]:7.4f} |"
            f" {bound:10.3f} {other[1]:5.3f} {other[2]:6.1f} {their_rate:7.0f} |"
            f" {found.duration_s / bound:6.3f}"
            f" {rate / their_rate:12.2f} {by_overlap / their_rate:7.2f} {by_critical / their_rate:8.2f}",
            flush=True,
        )


if __name__ == "__main__":
    if sys.argv[1:2] == ["--peer"]:
        peer(sys.argv[2])
    else:
        main()
