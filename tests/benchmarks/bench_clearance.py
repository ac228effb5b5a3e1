"""Time of the clearance of 1e5 blocks against 1e5 triangles: `python tests/benchmarks/bench_clearance.py`.

A free-form part of 300 x 300 mm with ripples, milled in lines of 0.3 mm moves, with a tool of 5 mm radius
and a holder. The moves are feed moves and the mesh is a fixture, so that all of it counts. Once close above
the part, once 20 mm above it, once along the wall of a fine tube."""

from __future__ import annotations

import resource
import time

import numpy as np

from olp.clearance.parts import parts_of
from olp.clearance.search import Best, search
from olp.clearance.sweep import Segments
from olp.clearance.tree import Tree
from olp.core.machine import HolderPart, Tool

BLOCKS = 100_000
TOOL = Tool(1, (0.0, 0.0, 120.0), 5.0, holder=(HolderPart(30.0, 12.0, 20.0), HolderPart(40.0, 25.0, 25.0)))


def height(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.asarray(10.0 * np.sin(x / 25.0) * np.cos(y / 31.0) + 0.5 * np.sin(x / 3.0))


def faces(grid: np.ndarray) -> np.ndarray:
    """(2 (n - 1) (m - 1), 3, 3) triangles of an (n, m, 3) grid."""
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    return np.concatenate([np.stack(f, axis=-2).reshape(-1, 3, 3) for f in ((a, b, c), (a, c, d))])


def part() -> np.ndarray:
    x, y = np.meshgrid(*2 * [np.linspace(0.0, 300.0, 225)], indexing="ij")
    return faces(np.stack([x, y, height(x, y)], axis=-1))


def tube() -> np.ndarray:
    angle, z = np.meshgrid(np.linspace(0.0, 2 * np.pi, 500), np.linspace(-60.0, 0.0, 102), indexing="ij")
    return faces(np.stack([40.0 * np.cos(angle), 40.0 * np.sin(angle), z], axis=-1))


def raster(above_mm: float) -> np.ndarray:
    share = np.linspace(0.0, 100.0, BLOCKS + 1)
    line, along = np.floor(share), share % 1.0
    x, y = 300.0 * np.where(line % 2 == 0, along, 1.0 - along), 3.0 * line
    return np.stack([x, y, height(x, y) + above_mm], axis=1)


def spiral() -> np.ndarray:
    """A tenth of the blocks: a whole wall of triangles is equally near, which is the worst case."""
    turn = np.linspace(0.0, 200.0 * np.pi, BLOCKS // 10 + 1)
    return np.stack([34.5 * np.cos(turn), 34.5 * np.sin(turn), -turn / 12.0], axis=1)


def main() -> None:
    for name, triangle, tip in (
        ("3 mm above the part", part(), raster(3.0)),
        ("20 mm above the part", part(), raster(20.0)),
        ("down a tube, 0.5 mm from it", tube(), spiral()),
    ):
        wall, cpu = time.perf_counter(), time.process_time()
        tree = Tree.of(triangle)
        count = len(tip) - 1
        segments = Segments(tip[:-1], np.diff(tip, axis=0), np.arange(count))
        best = Best.of(count)
        for tag, each in enumerate(parts_of(TOOL)):
            search(tree, segments.swept(each), segments.move, best, tag)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(
            f"{name}: {count} blocks, {len(triangle)} triangles: {cpu:.1f} s of one core "
            f"({wall:.1f} s by the clock), least clearance {best.distance_mm.min():.4f} mm, {memory:.0f} MB",
            flush=True,
        )


if __name__ == "__main__":
    main()
