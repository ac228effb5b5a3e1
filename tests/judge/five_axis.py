"""An independent judge of programs on machines with X, Y, Z and rotary axes: its own reader of plain words,
and its own forward computation from the machine and calibration files. It imports nothing of what it
judges. TRAORI and ORIVECT are read as well; the last of ORIVECT and ORIAXES holds for the whole program. I,
J, K and A3, B3, C3 state the direction of the tool; the rotary axes go to the position near the last one.

Every joint is a 4 x 4 matrix. Errors: location of lines, squareness as location, harmonics of the own
motion, and backlash of nothing. The tip of tool 1 counts.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

#: mm per rad, where a place on a move is sought.
ARM = 100.0
OWN = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}


def matrix(rotation: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """(n, 4, 4) of rotations (n, 3, 3) and shifts (n, 3)."""
    count = max(len(rotation), len(shift))
    whole = np.zeros((count, 4, 4))
    whole[:, :3, :3], whole[:, :3, 3], whole[:, 3, 3] = rotation, shift, 1.0
    return whole


def about(point: Sequence[float], rotation: np.ndarray) -> np.ndarray:
    """Rotations about a point."""
    place = np.asarray(point, float)
    return matrix(rotation, place - rotation @ place)


def ends(first: Sequence[np.ndarray], second: Sequence[np.ndarray]) -> list[int]:
    """By nominal move the corrected one that ends it: each later than the one before, the last with the last,
    and all together as near to their ends as can be."""
    away = np.abs(np.array(first)[:, None] - np.array(second)[None]).max(axis=2)
    # coordinates that are not known yet say nothing
    away = np.where(np.isnan(away), 0.0, away)
    count, total, came = len(second), away[0].copy(), []
    for row in away[1:]:
        best = np.minimum.accumulate(total)
        fresh = np.append(True, total[1:] < best[:-1])
        came.append(np.maximum.accumulate(np.where(fresh, np.arange(count), 0)))
        total = np.append(np.inf, best[:-1]) + row
    chosen = [count - 1]
    for row in reversed(came):
        chosen.append(int(row[chosen[-1] - 1]))
    return chosen[::-1]


class Judge:
    """A machine from its files."""

    def __init__(self, machine: Path) -> None:
        self.file = tomllib.loads(machine.read_text())
        calibration = machine.parent / self.file["calibration"]
        self.errors = tomllib.loads(calibration.read_text())
        for name, value in self.errors.get("squareness", {}).items():
            line = self.errors.setdefault("location", {}).setdefault(name[2], {})
            line[f"{name[0]}_urad"] = line.get(f"{name[0]}_urad", 0.0) + value
        self.chain = self.file["chain"].split()
        self.order = list(self.file["axes"])
        self.vector = False
        self.tool = np.array(self.file["tools"]["1"]["gauge_to_tip_mm"])
        self.offset = {
            name: float(self.file.get("work_offsets", {}).get("G54", {}).get(key, 0.0))
            for name in self.order
            for key in (f"{name}_mm" if name in OWN else f"{name}_deg",)
        }

    def forward(self, axes: np.ndarray, actual: bool) -> tuple[np.ndarray, np.ndarray]:
        """(n, 3) tips and (n, 3) tool axes at axis values (n, k) in the order of the file."""
        tips, turns = self.poses(axes, actual)
        return tips, turns[:, :, 2]

    def poses(self, axes: np.ndarray, actual: bool) -> tuple[np.ndarray, np.ndarray]:
        """(n, 3) tips and (n, 3, 3) rotations of the tool."""
        whole = np.tile(np.eye(4), (len(axes), 1, 1))
        for name in self.chain:
            if name != "F":
                whole = whole @ self._joint(name, axes[:, self.order.index(name)], actual)
        return whole[:, :3, :3] @ self.tool + whole[:, :3, 3], whole[:, :3, :3]

    def _joint(self, name: str, value: np.ndarray, actual: bool) -> np.ndarray:
        axis: dict[str, Any] = self.file["axes"][name]
        direction = np.array(axis.get("direction", OWN.get(name)), float)
        direction /= np.linalg.norm(direction)
        wrong = self.errors.get("location", {}).get(name, {}) if actual else {}
        tilt = np.array([wrong.get(f"{k}_urad", 0.0) for k in "ABC"]) * 1e-6
        shift = np.array([wrong.get(f"{k}_um", 0.0) for k in "XYZ"]) * 1e-3
        own = np.zeros(len(value))
        for wave in self.errors.get("cyclic", []) if actual else []:
            if wave["component"][2:] == name:
                period = wave.get("period_deg") or wave["period_mm"]
                amplitude = wave.get("amplitude_urad", 0.0) * 1e-6 + wave.get("amplitude_um", 0.0) * 1e-3
                own += amplitude * np.sin(2 * np.pi * value / period + wave.get("phase_rad", 0.0))
        if axis.get("kind", "linear") == "linear":
            across = np.cross(tilt, direction)
            return matrix(
                np.eye(3)[None],
                (value + own + wrong.get("zero_um", 0.0) * 1e-3)[:, None] * direction
                + value[:, None] * across,
            )
        angle = np.radians(value) + own + wrong.get("zero_urad", 0.0) * 1e-6
        turn = Rotation.from_rotvec(angle[:, None] * direction).as_matrix()
        # Rz Ry Rx of the tilt across the axis
        tilted = Rotation.from_euler("xyz", tilt - direction * (direction @ tilt)).as_matrix()[None]
        point = np.array(axis["point_mm"])
        line = matrix(np.eye(3)[None], (shift)[None]) @ about(point, tilted)
        return line @ about(point, turn) @ np.linalg.inv(line)

    def solve(self, tips: np.ndarray, axes: np.ndarray) -> np.ndarray:
        """Axis values whose nominal tips are there, rotary ones as given."""
        linear = [self.order.index(name) for name in "XYZ"]
        found = axes.copy()
        for _ in range(4):
            base = self.forward(found, False)[0]
            slopes = []
            for column in linear:
                ahead = found.copy()
                ahead[:, column] += 1.0
                slopes.append(self.forward(ahead, False)[0] - base)
            step = np.linalg.solve(np.stack(slopes, axis=2), (tips - base)[..., None])[..., 0]
            found[:, linear] += step
        return found

    def read(self, text: bytes) -> list[tuple[bool, bool, np.ndarray]]:
        """Moves of a program: whether it cuts, whether its words state the tip, and its coordinates."""
        place = np.full(len(self.order), np.nan)
        cuts = tips = counts = False
        moves = []
        for line in text.decode().splitlines():
            line = line.partition(";")[0]
            if line.startswith("CC "):
                # a pole moves nothing
                continue
            line = re.sub(r"\bL\b|\bR0\b|F ?MAX", lambda m: "G0" if "MAX" in m[0] else "", line)
            if "M12" in line:
                tips = "M128" in line
            if "TRA" in line:
                tips = "TRAORI" in line
                continue
            if "ORI" in line:
                self.vector = "ORIVECT" in line
                continue
            line = re.sub(r"([ABC])3=", lambda m: "IJK"["ABC".index(m[1])], line)
            line = re.sub(r"=\s*(?:DC\(([^)]*)\))?", r"\1", line)
            words = re.findall(r"([A-Z])\s*([-+]?[\d.]+)", re.sub(r"\(.*?\)", "", line))
            given = {letter: float(number) for letter, number in words if letter in self.order}
            for letter, number in words:
                if letter == "G":
                    code = float(number)
                    cuts = code == 1 if code in (0, 1) else cuts
                    tips = {43.4: True, 43.5: True, 49.0: False}.get(code, tips)
                    counts = {90.0: False, 91.0: True}.get(code, counts)
            towards = {letter: float(number) for letter, number in words if letter in "IJK"}
            if given or towards:
                place = place.copy()
                for letter, number in given.items():
                    column = self.order.index(letter)
                    start = place[column] if counts else self.offset[letter]
                    place[column] = start + number
                if towards:
                    place = self._towards(place, np.array([towards.get(letter, 0.0) for letter in "IJK"]))
                moves.append((cuts, tips, place))
        return moves

    def _towards(self, place: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """Coordinates with the rotary values near their own that give the tool a direction."""
        turning = [column for column, name in enumerate(self.order) if name not in OWN]

        def away(values: np.ndarray) -> np.ndarray:
            found = np.nan_to_num(place)
            found[turning] = values
            return self.forward(found[None], False)[1][0] - direction / np.linalg.norm(direction)

        solved = least_squares(away, place[turning], x_scale=10.0, xtol=1e-15, ftol=1e-15, gtol=1e-15)
        assert np.abs(solved.fun).max() < 1e-9
        found = place.copy()
        found[turning] = solved.x
        return found

    def axes(self, coordinates: np.ndarray, tips: bool) -> np.ndarray:
        """Axis values of programmed coordinates."""
        if not tips:
            return coordinates
        linear = [self.order.index(name) for name in "XYZ"]
        return self.solve(coordinates[:, linear], coordinates)

    def judged(self, nominal: bytes, corrected: bytes) -> tuple[float, float]:
        """The largest distance in mm and angle in rad of the tool with errors from the nominal path."""
        first, second = self.read(nominal), self.read(corrected)
        worst, j = np.zeros(2), 0
        for i, last in enumerate(ends([row[2] for row in first], [row[2] for row in second])):
            cuts, tips, end = first[i]
            group = second[j : last + 1]
            if cuts:
                worst = np.maximum(worst, self._move(first[i - 1][2], end, tips, second[j - 1][2], group))
            j = last + 1
        return float(worst[0]), float(worst[1])

    def _between(self, begin: np.ndarray, end: np.ndarray, share: np.ndarray) -> np.ndarray:
        """Coordinates at shares (n, 1) of a move; along a great circle of the tool where that is led."""
        place = begin + share * (end - begin)
        turning = [column for column, name in enumerate(self.order) if name not in OWN]
        if not self.vector or (begin[turning] == end[turning]).all():
            return place
        first, last = (self.forward(row[None], False)[1][0] for row in (begin, end))
        normal = np.cross(first, last)
        size = np.linalg.norm(normal)
        turn = normal / max(size, 1e-300) * np.arctan2(size, first @ last)
        wanted = Rotation.from_rotvec(share * turn).apply(first)
        for _ in range(8):
            along = self.forward(place, False)[1]
            slopes = np.empty((len(place), 3, len(turning)))
            for number, column in enumerate(turning):
                ahead, behind = place.copy(), place.copy()
                ahead[:, column] += 1e-3
                behind[:, column] -= 1e-3
                difference = self.forward(ahead, False)[1] - self.forward(behind, False)[1]
                slopes[:, :, number] = difference / 2e-3
            step = (np.linalg.pinv(slopes, rcond=1e-6) @ (wanted - along)[..., None])[..., 0]
            place[:, turning] += step
        return place

    def _move(
        self, begin: np.ndarray, end: np.ndarray, tips: bool, start: np.ndarray, group: list[Any]
    ) -> np.ndarray:
        """Deviations of one move; each sample against the nearest nominal pose."""
        places = np.array([start, *(row[2] for row in group)])
        part = np.linspace(0.0, 1.0, 12)[:, None]
        samples = np.vstack([self._between(a, b, part) for a, b in pairwise(places)])
        tip, axis = self.forward(self.axes(samples, tips), True)
        # along what is written: of a short move its ends lie far beside, for its length
        way = places[-1] - places[0]
        share = (samples - places[0]) @ way / max(way @ way, 1e-12)
        low, high = np.clip(share - 0.05, 0.0, 1.0), np.clip(share + 0.05, 0.0, 1.0)

        def miss(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            place = self._between(begin, end, at[:, None])
            there, along = self.forward(place, False)
            # by its definition; the axis of the tool depends on the rotary axes alone
            there = place[:, [self.order.index(name) for name in "XYZ"]] if tips else there
            return np.linalg.norm(tip - there, axis=1), np.linalg.norm(np.cross(axis, along), axis=1)

        for _ in range(45):
            left, right = low + (high - low) / 3, high - (high - low) / 3
            costs = [np.hypot(d, ARM * a) for d, a in (miss(left), miss(right))]
            low, high = np.where(costs[0] < costs[1], low, left), np.where(costs[0] < costs[1], right, high)
        distance, angle = miss(0.5 * (low + high))
        return np.array([distance.max(), angle.max()])
