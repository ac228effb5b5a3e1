"""Clearance by an independent library: coal, the successor of hpp-fcl."""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from olp.clearance.distance import Swept


@dataclass(frozen=True)
class Scene:
    """A random bumpy surface with loose triangles, and cylinders or cones on straight paths among them."""

    triangle: np.ndarray
    start: np.ndarray
    travel: np.ndarray
    level: np.ndarray
    radius: np.ndarray
    shape: str
    mesh: Any

    @staticmethod
    def of(rng: np.random.Generator, shape: str, count: int = 25) -> Scene:
        coal = pytest.importorskip("coal")
        x = np.linspace(-60.0, 60.0, 25)
        grid = np.stack([*np.meshgrid(x, x, indexing="ij"), rng.normal(size=(25, 25)) * 4.0], axis=-1)
        a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
        faces = np.concatenate([np.stack(f, axis=-2).reshape(-1, 3, 3) for f in ((a, b, c), (a, c, d))])
        loose = rng.uniform(-60.0, 60.0, (80, 1, 3)) + rng.normal(size=(80, 3, 3)) * 6.0
        triangle = np.concatenate((faces, loose))
        mesh = coal.BVHModelOBBRSS()
        mesh.beginModel(len(triangle), 3 * len(triangle))
        for one in triangle:
            mesh.addTriangle(*one)
        mesh.endModel()
        level = np.sort(rng.uniform(0.0, 60.0, (count, 2)), axis=1) + np.array([0.0, 1.0])
        start = rng.uniform((-80.0, -80.0, 0.0), (80.0, 80.0, 60.0), (count, 3))
        travel = rng.normal(size=(count, 3)) * 10.0 ** rng.uniform(-2.0, 1.5, (count, 1))
        return Scene(triangle, start, travel, level, rng.uniform(0.1, 12.0, count), shape, mesh)

    def swept(self) -> Swept:
        top = self.radius if self.shape == "cylinder" else np.zeros(len(self.radius))
        return Swept(self.start, self.travel, self.level, np.stack([self.radius, top], axis=1))

    def least(self, k: int, within_mm: float) -> tuple[float, float]:
        """Bounds of the least distance on path k, no farther apart than that."""
        import coal

        long = float(self.level[k, 1] - self.level[k, 0])
        form = (coal.Cylinder if self.shape == "cylinder" else coal.Cone)(float(self.radius[k]), long)
        request = coal.DistanceRequest()
        request.gjk_tolerance, request.gjk_max_iterations = 1e-10, 1000
        middle = self.start[k] + [0.0, 0.0, float(self.level[k].mean())]
        length = float(np.linalg.norm(self.travel[k]))

        def at(t: float) -> float:
            place = coal.Transform3s(np.eye(3), middle + t * self.travel[k])
            result = coal.DistanceResult()
            return max(float(coal.distance(form, place, self.mesh, coal.Transform3s(), request, result)), 0.0)

        best = at(0.5)
        queue = [(best - 0.5 * length, 0.0, 1.0)]
        while queue and queue[0][0] < best - within_mm and best > 0.0:
            _, a, b = heapq.heappop(queue)
            for c, d in ((a, (a + b) / 2), ((a + b) / 2, b)):
                value = at((c + d) / 2)
                best = min(best, value)
                heapq.heappush(queue, (value - 0.5 * (d - c) * length, c, d))
        return max(min(queue[0][0], best), 0.0) if queue else best, best

    def sampled(self, k: int) -> float:
        """The least distance of points all over the triangles from the shape at steps of path k: at least the
        true one. It decides where coal's iteration ends too early, as it does now and then."""
        u, v = (axis.ravel() for axis in np.meshgrid(np.linspace(0.0, 1.0, 60), np.linspace(0.0, 1.0, 60)))
        u, v = u[u + v <= 1.0], v[u + v <= 1.0]
        a, b, c = (self.triangle[:, None, i] for i in range(3))
        points = (a + (b - a) * u[None, :, None] + (c - a) * v[None, :, None]).reshape(-1, 3)
        low, high = self.level[k]
        least = np.inf
        for t in np.linspace(0.0, 1.0, 41):
            away = points - self.start[k] - t * self.travel[k]
            share = np.clip((away[:, 2] - low) / (high - low), 0.0, 1.0)
            radius = self.radius[k] * (1.0 if self.shape == "cylinder" else 1.0 - share)
            beside = np.maximum(np.hypot(away[:, 0], away[:, 1]) - radius, 0.0)
            above = np.maximum(np.maximum(low - away[:, 2], away[:, 2] - high), 0.0)
            least = min(least, float(np.hypot(beside, above).min()))
        return least
