"""Nine tool paths that distinguish re-timers: waypoints in mm, feed in mm/s, path tolerance in mm."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from olp.trajectory.route import AxisLimits, Route

LIMITS = AxisLimits(
    velocity=np.array([500.0, 500.0, 300.0]),
    acceleration=np.array([5e3, 5e3, 3e3]),
    jerk=np.array([1e5, 1e5, 6e4]),
)


def pocket(passes: int = 40, width: float = 200.0, step: float = 5.0) -> np.ndarray:
    """Rectangular zigzag."""
    rows = [((0.0, width) if i % 2 == 0 else (width, 0.0), i * step) for i in range(passes)]
    return np.array([(x, y, 0.0) for ends, y in rows for x in ends])


def circle(turns: int = 5, radius: float = 50.0, sag: float = 1e-3, digit: float = 1e-3) -> np.ndarray:
    """Chords of a circle, in rounded digits."""
    turn = 2 * np.arccos(1 - sag / radius)
    angle = np.linspace(0.0, turns * 2 * np.pi, int(np.ceil(turns * 2 * np.pi / turn)) + 1)
    points = np.column_stack((radius * np.cos(angle), radius * np.sin(angle), 0 * angle))
    return np.asarray(np.round(points / digit) * digit)


def freeform(lines: int = 20, width: float = 100.0, step: float = 0.2, digit: float = 1e-3) -> np.ndarray:
    """Raster over a wavy surface, as finishing passes are."""
    parts = []
    x = np.arange(0.0, width + step / 2, step)
    for i in range(lines):
        y = i * 0.5
        z = 4.0 * np.sin(2 * np.pi * x / 40.0 + i * 0.05) * np.cos(2 * np.pi * y / 30.0)
        z += 1.5 * np.sin(2 * np.pi * x / 11.0)
        part = np.column_stack((x, np.full_like(x, y), z))
        parts.append(part if i % 2 == 0 else part[::-1])
    return np.asarray(np.round(np.vstack(parts) / digit) * digit)


def robot(count: int = 50, seed: int = 0) -> np.ndarray:
    """Waypoints far apart in space."""
    return np.asarray(np.cumsum(np.random.default_rng(seed).normal(0.0, 150.0, (count, 3)), axis=0))


def corrected(passes: int = 4, width: float = 1000.0, step: float = 5.0, seed: int = 1) -> np.ndarray:
    """Straight passes after a correction: cut in pieces that are off by micrometres."""
    rng = np.random.default_rng(seed)
    x = np.arange(0.0, width + step / 2, step)
    parts = []
    for i in range(passes):
        y = 0.02 * np.sin(2 * np.pi * x / 300.0 + i) + rng.normal(0.0, 2e-4, len(x))
        z = 0.01 * np.cos(2 * np.pi * x / 110.0) + rng.normal(0.0, 2e-4, len(x))
        along = 0.005 * np.sin(2 * np.pi * x / 5.0 * 0.37)
        part = np.column_stack((x + along, i * 20.0 + y, z))
        parts.append(part if i % 2 == 0 else part[::-1])
    return np.vstack(parts)


def engraving(count: int = 2000, seed: int = 3) -> np.ndarray:
    """Short strokes in random directions."""
    rng = np.random.default_rng(seed)
    angle, length = rng.uniform(0.0, 2 * np.pi, count), rng.uniform(0.5, 5.0, count)
    steps = np.column_stack((length * np.cos(angle), length * np.sin(angle), 0 * length))
    return np.vstack((np.zeros(3), np.cumsum(steps, axis=0)))


def zigzag(count: int = 2000, seed: int = 2, step: float = 0.05) -> np.ndarray:
    """A line with noise in direction, of tiny segments."""
    rng = np.random.default_rng(seed)
    angle, length = np.cumsum(rng.normal(0.0, 1.0, count)), step * np.exp(rng.normal(0.0, 0.5, count))
    steps = np.column_stack((length * np.cos(angle), length * np.sin(angle), 0 * length))
    return np.vstack((np.zeros(3), np.cumsum(steps, axis=0)))


def spiral(inner: float = 0.5, outer: float = 30.0, pitch: float = 1.0, step: float = 0.2) -> np.ndarray:
    """An Archimedean spiral from a small radius, in rounded digits."""
    angles = [0.0]
    while (radius := inner + pitch * angles[-1] / (2 * np.pi)) <= outer:
        angles.append(angles[-1] + step / np.hypot(radius, pitch / (2 * np.pi)))
    angle = np.array(angles)
    radius_at = inner + pitch * angle / (2 * np.pi)
    points = np.column_stack((radius_at * np.cos(angle), radius_at * np.sin(angle), 0 * angle))
    return np.asarray(np.round(points / 1e-3) * 1e-3)


def lissajous(count: int = 1000) -> np.ndarray:
    """A smooth curve in space, driven fast."""
    t = np.linspace(0.0, 1.0, count)
    waves = [np.sin(2 * np.pi * t), np.sin(3 * np.pi * t + 0.3), np.sin(5 * np.pi * t + 0.7)]
    return np.asarray(100.0 * np.column_stack(waves))


#: name: waypoints, feed mm/s, tolerance mm, shortest audited time s known (reference runs of 2026)
PATHS: dict[str, tuple[Callable[[], np.ndarray], float, float, float]] = {
    "pocket": (pocket, 166.7, 0.02, 54.34),
    "robot": (robot, 400.0, 2.0, 32.94),
    "engraving": (engraving, 100.0, 0.01, 157.2),
    "circle": (circle, 200.0, 0.01, 7.951),
    "corrected": (corrected, 300.0, 0.005, 14.37),
    "freeform": (freeform, 100.0, 0.01, 47.60),
    "spiral": (spiral, 200.0, 0.005, 26.27),
    "zigzag": (zigzag, 100.0, 0.005, 22.96),
    "lissajous": (lissajous, 400.0, 0.02, 4.674),
}


def route(name: str) -> Route:
    """One of the paths as a route that begins and ends at rest."""
    make, feed, tolerance, _ = PATHS[name]
    points = make()
    count = len(points)
    allowed = np.full(count, tolerance)
    allowed[[0, -1]] = 0.0
    return Route(points, np.full(count - 1, feed), np.arange(1, count), allowed, np.zeros(count))
