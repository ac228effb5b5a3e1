"""Pairs a million measured points with a million nominal ones: python tests/benchmarks/bench_compare.py

Prints CPU seconds of one core, and how far the recovered positions are from the true ones.
"""

from __future__ import annotations

import sys
import time

import numpy as np

from olp.comparison.pairing import pair
from olp.comparison.path import Path

#: points of each path
COUNT = 1_000_000
LAPS = 3
NOISE_MM = 0.005


def eight(u: np.ndarray) -> np.ndarray:
    """A path that crosses itself, one lap each 2 pi."""
    return np.column_stack((200 * np.sin(u), 100 * np.sin(2 * u) + 30 * np.cos(u), 20 * np.sin(3 * u)))


def main(count: int) -> None:
    rng = np.random.default_rng(1)
    places = np.linspace(0.0, 2 * np.pi * LAPS, count)
    path = Path.through(eight(places))
    u = np.sort(rng.uniform(0.0, places[-1], count))
    points = eight(u) + rng.normal(0.0, NOISE_MM, (count, 3))
    begin = time.process_time()
    pairing = pair(path, points, "forward")
    spent = time.process_time() - begin
    off = np.abs(pairing.s_mm - np.interp(u, places, path.s_mm))
    print(f"{count} against {count}: {spent:.1f} s, largest error along the path {off.max() * 1e3:.1f} um")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else COUNT)
