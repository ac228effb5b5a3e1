"""An independent judge of corrected programs of machines of any joints: reads both texts, drives the machine
with all of its errors along the corrected one, its play followed from side to side, and says how far the tool
is from the nearest place of the nominal move.

It imports nothing of what it judges. Words are read by `judge.five_axis`, planes by `judge.tilted`.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from judge.five_axis import ARM, Judge, ends
from judge.tilted import TiltedJudge
from judge.whole_machine import NONE, WholeMachine

#: A move: whether it cuts, whether its words state the tip, and its coordinates.
Row = tuple[bool, bool, np.ndarray]
#: Places on a nominal move between which a cubic is taken, and samples of a corrected part.
NODES, SAMPLES = 81, 9


class Whole(Judge):
    """Reads programs and lists; `orders` are the degrees of freedom that count: "tip", "axis" or "pose"."""

    def __init__(self, machine: Path, payload: tuple[float, Any] = (0.0, NONE), counts: str = "axis") -> None:
        super().__init__(machine)
        self.whole = WholeMachine(machine, payload)
        self.counts = counts
        self.play = np.zeros(len(self.order))
        for column, name in enumerate(self.order):
            unit, scale = ("urad", 1e-6) if self.whole.turning(name) else ("um", 1e-3)
            size = self.whole.errors.get("backlash", {}).get(f"{name}_{unit}", 0.0) * scale
            self.play[column] = np.degrees(size) if unit == "urad" else size

    def poses(self, axes: np.ndarray, actual: bool) -> tuple[np.ndarray, np.ndarray]:
        pose = self.whole.pose(axes, actual)
        return pose[:, :3, 3], pose[:, :3, :3]

    def values(self, text: bytes) -> list[Row]:
        """The rows of a list of axis values."""
        rows = [line for line in text.decode().splitlines() if line[:1] in tuple("-.0123456789")]
        return [(True, False, np.array([float(cell) for cell in row.split(",")])) for row in rows]

    def whole_judged(
        self, first: list[Row], second: list[Row], within: tuple[float, float], skip: int = 0
    ) -> tuple[float, float, float]:
        """The worst place of moves behind the `skip`-th: mm, rad, and how many of `within` (mm, rad)."""
        self.side = np.zeros(len(self.order))
        self.before: np.ndarray | None = None
        worst, j = np.zeros(3), 0
        chosen = ends(self._places(first, actual=False), self._places(second, actual=True))
        for i, last in enumerate(chosen):
            cuts, tips, end = first[i]
            group = [row[2] for row in second[j : last + 1]]
            begin = second[j - 1][2] if j else group[0]
            samples = self._samples([begin, *group], tips if i else False)
            sides = self._sides(samples)
            if cuts and i and i >= skip:
                found = self._missed(first[i - 1][2], end, tips, samples, sides, within)
                worst = np.maximum(worst, found)
            j = last + 1
        return float(worst[0]), float(worst[1]), float(worst[2])

    def _places(self, rows: list[Row], *, actual: bool) -> list[np.ndarray]:
        """By row where the tool is, mm, and its directions as arcs; near a singular posture commands are
        far from what they correct. NaN where it is not known."""
        found = []
        for _, tips, place in rows:
            where = np.full(12, np.nan)
            if np.isfinite(place).all():
                pose = self.whole.pose(self.axes(place[None], tips), actual)[0, :3]
                turn = {"tip": 0.0, "turn": 0.0, "axis": np.array([0.0, 0.0, ARM])}.get(self.counts, ARM)
                where = np.append(pose[:, 3], (pose[:, :3] * turn).ravel())
            found.append(where)
        return found

    def _samples(self, places: list[np.ndarray], tips: bool) -> np.ndarray:
        """Axis values along a broken line of coordinates."""
        part = np.linspace(0.0, 1.0, SAMPLES)[:, None]
        rows = np.vstack([self._between(a, b, part) for a, b in pairwise(places)])
        return self.axes(rows, tips)

    def _sides(self, samples: np.ndarray) -> np.ndarray:
        """(n, k) from -1 to 1: where each axis is in its play, which a motion takes along behind it."""
        sides = np.zeros_like(samples)
        before = samples[0] if self.before is None else self.before
        half = np.maximum(0.5 * self.play, 1e-15)
        for number, row in enumerate(samples):
            self.side = np.clip(self.side + np.nan_to_num(row - before) / half, -1.0, 1.0)
            sides[number], before = self.side, row
        self.before = samples[-1]
        return sides

    def _missed(
        self, begin: np.ndarray, end: np.ndarray, tips: bool, samples: np.ndarray, sides: np.ndarray,
        within: tuple[float, float],
    ) -> np.ndarray:  # fmt: skip
        """mm, rad, and the cost of the worst sample of a move."""
        pose = self.whole.pose(samples, True, sides)
        share = np.linspace(0.0, 1.0, NODES)[:, None]
        nodes = self.axes(self._between(begin, end, share), tips)
        nominal = self.whole.pose(nodes, False)
        flat = nominal[:, :3, :].reshape(NODES, 12)
        way = CubicSpline(share[:, 0], flat)

        def miss(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            there = way(np.clip(at, 0.0, 1.0)).reshape(-1, 3, 4)
            distance = np.linalg.norm(pose[:, :3, 3] - there[:, :, 3], axis=1)
            if self.counts == "tip":
                return distance, np.zeros(len(distance))
            if self.counts == "turn":
                around = sum(np.cross(there[:, :, k], pose[:, :3, k])[:, 2] for k in range(3))
                return distance, np.abs(around) / 2.0
            if self.counts == "axis":
                return distance, np.linalg.norm(np.cross(pose[:, :3, 2], there[:, :, 2]), axis=1)
            vector = sum(np.cross(there[:, :, k], pose[:, :3, k]) for k in range(3)) / 2.0
            return distance, np.linalg.norm(vector, axis=1)

        def cost(at: np.ndarray) -> np.ndarray:
            distance, angle = miss(at)
            return np.maximum(distance / within[0], angle / within[1])

        # the nearest node, then the least of a section about it
        scale = np.append(np.full(9, within[0] / within[1]), np.ones(3))[
            [0, 1, 2, 9, 3, 4, 5, 10, 6, 7, 8, 11]
        ]
        if self.counts != "pose":
            scale[[0, 1, 2, 4, 5, 6, 8, 9, 10]] *= np.tile([0.0, 0.0, 1.0], 3) * (self.counts == "axis")
        apart = (pose[:, None, :3, :].reshape(len(pose), 1, 12) - flat[None]) * scale
        near = share[np.argmin(np.linalg.norm(apart, axis=2), axis=1), 0]
        low, high = np.clip(near - 1.5 / NODES, 0.0, 1.0), np.clip(near + 1.5 / NODES, 0.0, 1.0)
        for _ in range(45):
            left, right = low + (high - low) / 3, high - (high - low) / 3
            better = cost(left) < cost(right)
            low, high = np.where(better, low, left), np.where(better, right, high)
        best = 0.5 * (low + high)
        distance, angle = miss(best)
        return np.array([distance.max(), angle.max(), cost(best).max()])


class WholeTilted(TiltedJudge):
    """Planes on a machine with all of its errors."""

    def __init__(self, machine: Path, payload: tuple[float, Any] = (0.0, NONE)) -> None:
        super().__init__(machine)
        self.whole = WholeMachine(machine, payload)

    def poses(self, axes: np.ndarray, actual: bool) -> tuple[np.ndarray, np.ndarray]:
        pose = self.whole.pose(axes, actual)
        return pose[:, :3, 3], pose[:, :3, :3]
