"""An independent forward computation of machines of any joints, from their machine and calibration files: one
posture at a time, with 4 x 4 matrices. It imports nothing of what it judges.

Errors: location of lines, curves with a functional point, harmonics of the own motion, the own turn of joints
under weights, and legs. The tip of tool 1 counts.
"""

from __future__ import annotations

import csv
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation

OWN = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
NONE = (0.0, 0.0, 0.0)
FALL = 9.80665


def moved(shift: Any, rotation: np.ndarray | None = None) -> np.ndarray:
    whole = np.eye(4)
    whole[:3, 3] = shift
    if rotation is not None:
        whole[:3, :3] = rotation
    return whole


def about(point: Any, whole: np.ndarray) -> np.ndarray:
    return moved(point) @ whole @ moved(-np.asarray(point, float))


def rpy(order: str, angles: Any) -> np.ndarray:
    """Rz Ry Rx of angles about X, Y, Z in rad ("xyz"), or Rx Ry Rz ("XYZ")."""
    return np.asarray(Rotation.from_euler(order, angles).as_matrix())


class AnyJoints:
    """A machine from its files."""

    def __init__(self, machine: Path) -> None:
        self.file = tomllib.loads(machine.read_text())
        self.errors = tomllib.loads((machine.parent / self.file["calibration"]).read_text())
        self.chain: list[str] = self.file["chain"].split()
        self.axes: dict[str, dict[str, Any]] = self.file["axes"]
        self.order = list(self.axes)
        self.tool = np.array(self.file["tools"]["1"]["gauge_to_tip_mm"])
        gauge = self.file.get("gauge", {})
        turn = np.radians([gauge.get(f"{letter}_deg", 0.0) for letter in "ABC"])
        self.gauge = moved(gauge.get("point_mm", NONE), rpy("xyz", turn))
        self.curves = {c["file"].partition(".")[0].upper(): self._curve(machine.parent, c)
                       for c in self.errors.get("curves", [])}  # fmt: skip

    def _curve(self, folder: Path, curve: dict[str, Any]) -> tuple[np.ndarray, Any]:
        """Values and errors X Y Z A B C of a curve in mm and rad, and its functional point."""
        rows = list(csv.reader((folder / curve["file"]).read_text().splitlines()))[1:]
        return np.array(rows, float) * ([1.0] + [1e-3] * 3 + [1e-6] * 3), curve["point_mm"]

    def pose(self, values: np.ndarray, actual: bool) -> np.ndarray:
        """(4, 4) of the tip at axis values (k,) in the order of the file."""
        at = dict(zip(self.order, values.tolist(), strict=True))
        gives = self._gives(at) if actual else {}
        frame, whole = self.chain.index("F"), np.eye(4)
        for place, name in enumerate(self.chain):
            if name in self.file.get("platforms", {}):
                whole = whole @ self._platform(name, at, actual)
            elif name != "F":
                whole = whole @ self._joint(name, at[name], actual, place < frame, gives.get(name, 0.0))
        return np.asarray(whole @ self.gauge @ moved(self.tool))

    def _direction(self, name: str) -> np.ndarray:
        direction = np.array(self.axes[name].get("direction", OWN.get(name, NONE)), float)
        return np.asarray(direction / np.linalg.norm(direction))

    def _joint(self, name: str, value: float, actual: bool, table: bool, gives: float = 0.0) -> np.ndarray:
        direction, point = self._direction(name), self.axes[name].get("point_mm", NONE)
        wrong = self.errors.get("location", {}).get(name, {}) if actual else {}
        tilt = np.array([wrong.get(f"{k}_urad", 0.0) for k in "ABC"]) * 1e-6
        shift = np.array([wrong.get(f"{k}_um", 0.0) for k in "XYZ"]) * 1e-3
        if self.axes[name].get("kind", "linear") == "linear":
            along = (value + wrong.get("zero_um", 0.0) * 1e-3) * direction
            return moved(along + value * np.cross(tilt, direction))
        own, motion = gives, np.eye(4)
        for wave in self.errors.get("cyclic", []) if actual else []:
            if wave["component"] == f"E{name}{name}":
                angle = 2 * np.pi * value / wave["period_deg"] + wave["phase_rad"]
                own += wave["amplitude_urad"] * 1e-6 * np.sin(angle)
        if actual and name in self.curves:
            rows, functional = self.curves[name]
            errors = np.array([np.interp(value, rows[:, 0], column) for column in rows[:, 1:].T])
            around = 3 + int(np.argmax(np.abs(direction)))
            own += errors[around]
            errors[around] = 0.0
            motion = about(functional, moved(errors[:3], rpy("XYZ" if table else "xyz", errors[3:])))
        line = about(point, moved(shift, rpy("xyz", tilt - direction * (direction @ tilt))))
        angle = np.radians(value) + wrong.get("zero_urad", 0.0) * 1e-6 + own
        turn = about(point, moved(NONE, Rotation.from_rotvec(angle * direction).as_matrix()))
        turn = line @ turn @ np.linalg.inv(line)
        return np.asarray(turn @ motion if table else motion @ turn)

    def _gives(self, at: dict[str, float]) -> dict[str, float]:
        """rad that joints on the tool's side turn under the weights behind them."""
        whole, stators, bodies = np.eye(4), {}, {}
        names = [name for name in self.chain[self.chain.index("F") + 1 :] if name in self.axes]
        for name in names:
            stators[name] = whole
            whole = whole @ self._joint(name, at[name], False, False)
            bodies[name] = whole
        gives = {}
        for name, elastic in self.errors.get("elasticity", {}).items():
            torque, stator = np.zeros(3), np.linalg.inv(stators[name])
            for mass in self.errors["masses"]:
                if names.index(mass["on"]) >= names.index(name):
                    centre = (stator @ bodies[mass["on"]] @ np.append(mass["centre_mm"], 1.0))[:3]
                    pull = stator[:3, :3] @ np.array([0.0, 0.0, -mass["kg"] * FALL])
                    torque += np.cross((centre - self.axes[name]["point_mm"]) * 1e-3, pull)
            gives[name] = elastic["own_urad_Nm"] * 1e-6 * float(torque @ self._direction(name))
        return gives

    def _platform(self, name: str, at: dict[str, float], actual: bool) -> np.ndarray:
        table = self.file["platforms"][name]
        errors = {leg["leg"]: leg for leg in self.errors.get("legs", [])} if actual else {}
        ends, anchors, lengths = [], [], []
        for number, leg in enumerate(table["legs"], 1):
            wrong = errors.get(number, {})
            base = np.array(leg["base_mm"]) + np.array(wrong.get("base_um", NONE)) * 1e-3
            if "carriage" in leg:
                carriage = leg["carriage"]
                base = (self._joint(carriage, at[carriage], actual, False) @ np.append(base, 1.0))[:3]
            anchors.append(base)
            ends.append(np.array(leg["platform_mm"]) + np.array(wrong.get("platform_um", NONE)) * 1e-3)
            lengths.append(
                leg["length_mm"] + wrong.get("length_um", 0.0) * 1e-3 + at.get(leg.get("axis"), 0.0)
            )
        a, b, size = np.array(ends), np.array(anchors), np.array(lengths)

        def open_by(x: Sequence[float]) -> Any:
            turn = Rotation.from_rotvec(x[3:]).as_matrix()
            return np.linalg.norm(a @ turn.T + x[:3] - b, axis=1) - size

        found = fsolve(open_by, [*table["start_mm"], 0.0, 0.0, 0.0], xtol=1e-13)
        assert np.abs(open_by(found)).max() < 1e-9
        return moved(found[:3], Rotation.from_rotvec(found[3:]).as_matrix())
