"""An independent forward computation of machines of any joints with every source of errors, many postures at
a time, from the machine and calibration files. It imports nothing of what it judges.

Every joint is a 4 x 4 matrix, as ISO 230-1 and -7 name its errors: location of lines, six motions as curves,
harmonics, play, weights with payload, errors of the gauge frame, and legs of platforms.
"""

from __future__ import annotations

import csv
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation

OWN = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
SQUARE = {"C0Y": ("Y", "C"), "B0Z": ("Z", "B"), "A0Z": ("Z", "A")}
NONE = (0.0, 0.0, 0.0)
FALL = 9.80665


def whole(rotation: np.ndarray | None = None, shift: Any = NONE) -> np.ndarray:
    """(n, 4, 4) of rotations (n, 3, 3) and shifts (n, 3), either of them the same for all."""
    turned = np.eye(3)[None] if rotation is None else np.atleast_3d(rotation).reshape(-1, 3, 3)
    moved = np.atleast_2d(np.asarray(shift, float))
    made = np.zeros((max(len(turned), len(moved)), 4, 4))
    made[:, :3, :3], made[:, :3, 3], made[:, 3, 3] = turned, moved, 1.0
    return made


def about(point: Any, motion: np.ndarray) -> np.ndarray:
    """A motion about a point (3,) or points (n, 3)."""
    return whole(shift=point) @ motion @ whole(shift=-np.asarray(point, float))


def small(order: str, angles: np.ndarray) -> np.ndarray:
    """Rotations "xyz": Rz Ry Rx, "XYZ": Rx Ry Rz of angles (n, 3) about X, Y, Z."""
    return np.asarray(Rotation.from_euler(order, np.atleast_2d(angles)).as_matrix())


def turns(vectors: np.ndarray) -> np.ndarray:
    return np.asarray(Rotation.from_rotvec(np.atleast_2d(vectors)).as_matrix())


def back(motion: np.ndarray) -> np.ndarray:
    return np.asarray(np.linalg.inv(motion))


def numbers(table: Mapping[str, float], letters: str, unit: str) -> np.ndarray:
    return np.array([table.get(f"{letter}_{unit}", 0.0) for letter in letters])


@dataclass(frozen=True)
class Motions:
    """A curve: axis values, errors X Y Z A B C and the own one in mm and rad, and how it was read."""

    at: np.ndarray
    errors: np.ndarray
    point: np.ndarray
    follows: bool
    smooth: bool
    repeats: bool

    def read(self, value: np.ndarray) -> np.ndarray:
        if self.repeats:
            value = self.at[0] + (value - self.at[0]) % 360.0
        if self.smooth:
            return np.asarray(PchipInterpolator(self.at, self.errors)(value))
        return np.column_stack([np.interp(value, self.at, column) for column in self.errors.T])


class WholeMachine:
    """A machine from its files, with a payload in kg and its centre in the gauge frame."""

    def __init__(self, machine: Path, payload: tuple[float, Any] = (0.0, NONE)) -> None:
        self.file = tomllib.loads(machine.read_text("utf-8"))
        stated = self.file.get("calibration")
        self.errors = tomllib.loads((machine.parent / stated).read_text("utf-8")) if stated else {}
        self.location: dict[str, dict[str, float]] = dict(self.errors.get("location", {}))
        for name, value in self.errors.get("squareness", {}).items():
            axis, letter = SQUARE[name.removesuffix("_urad")]
            self.location[axis] = {**self.location.get(axis, {}), f"{letter}_urad": value}
        self.chain: list[str] = self.file["chain"].split()
        self.axes: dict[str, dict[str, Any]] = self.file["axes"]
        self.order = list(self.axes)
        self.frame = self.chain.index("F")
        self.datum = np.array(self.errors.get("datum_mm", NONE))
        self.payload = payload
        self.tool = np.array(self.file.get("tools", {}).get("1", {}).get("gauge_to_tip_mm", NONE))
        gauge = self.file.get("gauge", {})
        turned = small("xyz", np.radians(numbers(gauge, "ABC", "deg")))
        self.gauge_mm = np.array(gauge.get("point_mm", NONE))
        self.gauge = whole(turned, self.gauge_mm)
        self.curves = dict(self._curve(machine.parent, table) for table in self.errors.get("curves", []))

    def turning(self, name: str) -> bool:
        return bool(self.axes[name].get("kind") == "rotary")

    def direction(self, name: str) -> np.ndarray:
        if self.axes[name].get("kind") == "length":
            return np.zeros(3)
        direction = np.array(self.axes[name].get("direction", OWN.get(name)), float)
        return np.asarray(direction / np.linalg.norm(direction))

    def _curve(self, folder: Path, table: dict[str, Any]) -> tuple[str, Motions]:
        head, *rows = csv.reader((folder / table["file"]).read_text("utf-8").splitlines())
        name = head[0].rpartition("_")[0]
        values = np.array(rows, float)
        errors = np.zeros((len(values), 7))
        for column, title in enumerate(head[1:], 1):
            stem, unit = title.rsplit("_", 1)
            along = self.direction(name)
            own = stem == f"E{name}{name}"
            place = 6 if own else "XYZABC".index(stem[1])
            if self.turning(name) and place in (3, 4, 5) and along[place - 3] == 1.0:
                place = 6
            errors[:, place] += values[:, column] * (1e-3 if unit == "um" else 1e-6)
        point = table.get("point_mm")
        follows = False
        if point is None and not self.turning(name) and name in self.chain:
            point, follows = self._read_at(name, table)
        elif point is None:
            point = self.axes[name].get("point_mm", NONE)
        smooth = table.get("interpolation", "pchip") == "pchip"
        return name, Motions(
            values[:, 0], errors, np.array(point), follows, smooth, table.get("periodic", False)
        )

    def _read_at(self, name: str, table: dict[str, Any]) -> tuple[np.ndarray, bool]:
        """Where a linear axis was read: the tip of a tool, with the axes behind it on their lines."""
        place = self.chain.index(name)
        point = self.gauge_mm + np.array(table.get("tool_mm", NONE))
        for other in self.chain[place + 1 :]:
            if other in self.axes and not self.turning(other):
                at = table.get("line_mm", {}).get(other, float(self.direction(other) @ self.datum))
                point = point + at * self.direction(other)
        table_side = place < self.frame
        if table_side and table.get("reference") == "table":
            return point + float(self.direction(name) @ self.datum) * self.direction(name), False
        return point, table_side

    def pose(self, values: np.ndarray, actual: bool, sides: np.ndarray | None = None) -> np.ndarray:
        """(n, 4, 4) of the tip at axis values (n, k) in the order of the file; `sides` (n, k) of the play."""
        at = dict(zip(self.order, values.T, strict=True))
        side = dict.fromkeys(self.order, np.zeros(len(values)))
        if sides is not None:
            side = dict(zip(self.order, sides.T, strict=True))
        gives = self._gives(at) if actual and self.errors.get("elasticity") else {}
        for term in self.errors.get("gravity", []) if actual else []:
            # E and twice the name of the axis
            name = term["component"][1 : 1 + len(term["component"]) // 2]
            gives[name] = gives.get(name, np.zeros((len(values), 7))) + self._hangs(name, term, at)
        pose = whole()
        for name in self.chain:
            if name in self.file.get("platforms", {}):
                pose = pose @ self._platform(name, at, actual, side)
            elif name != "F":
                pose = pose @ self._joint(name, at[name], actual, side[name], gives.get(name))
        held = self.gauge
        wrong = self.location.get("gauge")
        if actual and wrong:
            tilt = small("xyz", numbers(wrong, "ABC", "urad") * 1e-6)
            held = about(self.gauge_mm, whole(tilt, numbers(wrong, "XYZ", "um") * 1e-3)) @ held
        return np.asarray(pose @ held @ whole(shift=self.tool))

    def _joint(
        self, name: str, value: np.ndarray, actual: bool, side: np.ndarray, gives: np.ndarray | None = None
    ) -> np.ndarray:
        """(n, 4, 4); `gives` (n, 7) are shifts, tilts and the own motion under weight."""
        direction, table = self.direction(name), name in self.chain and self.chain.index(name) < self.frame
        point, turning = np.array(self.axes[name].get("point_mm", NONE)), self.turning(name)
        if not actual:
            if turning:
                return about(point, whole(turns(np.radians(value)[:, None] * direction)))
            return whole(shift=value[:, None] * direction)
        wrong = self.location.get(name, {})
        tilt = numbers(wrong, "ABC", "urad") * 1e-6
        own = wrong.get("zero_urad", 0.0) * 1e-6 + wrong.get("zero_um", 0.0) * 1e-3
        waves = self._waves(name, value)
        own = own + (waves if turning else 0.0)
        key = f"{name}_{'urad' if turning else 'um'}"
        own = own - 0.5 * side * self.errors.get("backlash", {}).get(key, 0.0) * (1e-6 if turning else 1e-3)
        # along a linear axis errors are shifts of its carriage, as those across
        motion = whole() if turning else whole(shift=waves[:, None] * direction)
        if name in self.curves:
            curve = self.curves[name]
            errors = curve.read(value)
            shift = errors[:, :3] + (0.0 if turning else errors[:, 6:] * direction)
            own = own + (errors[:, 6] if turning else 0.0)
            where = curve.point + (value[:, None] * direction if curve.follows else 0.0)
            read = about(where, whole(small("XYZ" if table else "xyz", errors[:, 3:6]), shift))
            motion = motion @ read if table else read @ motion
        yields = whole()
        if gives is not None:
            own = own + gives[:, 6]
            yields = about(point, whole(small("XYZ" if table else "xyz", gives[:, 3:6]), gives[:, :3]))
        if not turning:
            along = (value + own)[:, None] * direction
            across = (value - direction @ self.datum)[:, None] * np.cross(tilt, direction)
            line = whole(shift=along + across)
            return yields @ motion @ line if table else line @ motion @ yields
        shift = numbers(wrong, "XYZ", "um") * 1e-3
        line = about(point, whole(small("xyz", tilt - direction * (direction @ tilt)), shift))
        turn = about(point, whole(turns((np.radians(value) + own)[:, None] * direction)))
        turn = line @ turn @ back(line)
        return turn @ yields @ motion if table else motion @ yields @ turn

    def _waves(self, name: str, value: np.ndarray) -> np.ndarray:
        total = np.zeros(len(value))
        for wave in self.errors.get("cyclic", []):
            if wave["component"] == f"E{name}{name}":
                period = wave.get("period_deg") or wave["period_mm"]
                size = wave.get("amplitude_urad", 0.0) * 1e-6 + wave.get("amplitude_um", 0.0) * 1e-3
                total += size * np.sin(2 * np.pi * value / period + wave.get("phase_rad", 0.0))
        return total

    def _gives(self, at: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """By joint shifts, tilts and own motion (n, 7) under the weights that it carries."""
        fall = np.array(self.file.get("kinematics", {}).get("gravity", (0.0, 0.0, -1.0)), float)
        fall *= FALL / np.linalg.norm(fall)
        gone = {}
        for names, sign in ((self.chain[: self.frame][::-1], -1.0), (self.chain[self.frame + 1 :], 1.0)):
            place, stators, bodies = whole(), {}, {}
            for name in names:
                still = self._joint(name, at[name], False, at[name])
                stators[name] = place
                place = place @ (back(still) if sign < 0 else still)
                bodies[name] = place
            for number, name in enumerate(names):
                elastic = self.errors["elasticity"].get(name)
                if elastic is None:
                    continue
                turning = self.turning(name)
                home = (stators if turning else bodies)[name]
                point = (home @ np.append(self.axes[name].get("point_mm", NONE), 1.0))[:, :3]
                force, torque = np.zeros((1, 3)), np.zeros((1, 3))
                for kg, centre in self._weights(names[number:], bodies, sign > 0):
                    force = force + kg * fall
                    torque = torque + np.cross((centre - point) * 1e-3, kg * fall)
                into = sign * np.swapaxes(stators[name][:, :3, :3], 1, 2)
                force, torque = (into @ force[..., None])[..., 0], (into @ torque[..., None])[..., 0]
                load = torque if turning else force
                size = elastic.get("own_urad_Nm", 0.0) * 1e-6 + elastic.get("own_um_kN", 0.0) * 1e-6
                shift = force * numbers(elastic, "XYZ", "um_kN") * 1e-6
                tilt = torque * numbers(elastic, "ABC", "urad_Nm") * 1e-6
                own = size * (load @ self.direction(name))
                rows = len(next(iter(at.values())))
                parts = np.broadcast_arrays(*shift.T, *tilt.T, own, np.zeros(rows))[:7]
                gone[name] = np.stack(parts, axis=1)
        return gone

    def _hangs(self, name: str, term: Mapping[str, Any], at: Mapping[str, np.ndarray]) -> np.ndarray:
        """(n, 7) as `_gives`: the own turn of a joint by what hangs on it at a sum of angles, each counted
        about the direction of the joint."""
        lies = sum(
            np.radians(at[one]) * np.sign(self.direction(one) @ self.direction(name))
            for one in term["angles"]
        )
        turn = term.get("sin_urad", 0.0) * np.sin(lies) + term.get("cos_urad", 0.0) * np.cos(lies)
        return np.outer(1e-6 * np.asarray(turn), np.eye(7)[6])

    def _weights(self, names: list[str], bodies: Mapping[str, np.ndarray], tool: bool) -> list[Any]:
        found = []
        for mass in self.errors.get("masses", []):
            if mass["on"] in names:
                found.append((mass["kg"], (bodies[mass["on"]] @ np.append(mass["centre_mm"], 1.0))[:, :3]))
        kg, centre = self.payload
        if tool and kg:
            found.append((kg, (bodies[names[-1]] @ self.gauge @ np.append(centre, 1.0))[:, :3]))
        return found

    def _platform(
        self, name: str, at: Mapping[str, np.ndarray], actual: bool, side: Mapping[str, np.ndarray]
    ) -> np.ndarray:
        """The pose at which all rods have their lengths, by Newton from the start of the file."""
        table = self.file["platforms"][name]
        wrong = {leg["leg"]: leg for leg in self.errors.get("legs", []) if leg["platform"] == name}
        fixed = table.get("orientation") == "fixed"
        anchors, ends, sizes = [], [], []
        for number, leg in enumerate(table["legs"], 1):
            off = wrong.get(number, {}) if actual else {}
            base = np.array(leg["base_mm"]) + np.array(off.get("base_um", NONE)) * 1e-3
            if "carriage" in leg:
                ride = self._joint(leg["carriage"], at[leg["carriage"]], actual, side[leg["carriage"]])
                anchors.append((ride @ np.append(base, 1.0))[:, :3])
            else:
                anchors.append(base[None])
            ends.append(np.array(leg["platform_mm"]) + np.array(off.get("platform_um", NONE)) * 1e-3)
            size = leg.get("length_mm", 0.0) + off.get("length_um", 0.0) * 1e-3
            if "axis" in leg:
                size = size + at[leg["axis"]] + (self._own_length(leg["axis"], at, side) if actual else 0.0)
            sizes.append(np.atleast_1d(size))
        count = len(next(iter(at.values())))
        a = np.array(ends)
        b = np.stack([np.broadcast_to(anchor, (count, 3)) for anchor in anchors], axis=1)
        size = np.stack([np.broadcast_to(one, (count,)) for one in sizes], axis=1)
        return closed(a, b, size, np.array(table["start_mm"]), fixed)

    def _own_length(
        self, name: str, at: Mapping[str, np.ndarray], side: Mapping[str, np.ndarray]
    ) -> np.ndarray:
        value = at[name]
        own = self.location.get(name, {}).get("zero_um", 0.0) * 1e-3 + self._waves(name, value)
        own = own - 0.5e-3 * side[name] * self.errors.get("backlash", {}).get(f"{name}_um", 0.0)
        if name in self.curves:
            own = own + self.curves[name].read(value)[:, 6]
        return np.asarray(own)


def closed(a: np.ndarray, b: np.ndarray, size: np.ndarray, start: np.ndarray, fixed: bool) -> np.ndarray:
    """(n, 4, 4) at which ends (legs, 3) are as far from anchors (n, legs, 3) as rods (n, legs) are long."""
    shift, turn = np.tile(start, (len(size), 1)), np.tile(np.eye(3), (len(size), 1, 1))
    for _ in range(60):
        arm = np.einsum("nij,lj->nli", turn, a)
        rod = arm + shift[:, None] - b
        long = np.linalg.norm(rod, axis=2)
        unit = rod / long[..., None]
        slope = unit if fixed else np.concatenate((unit, np.cross(arm, unit)), axis=2)
        step = np.linalg.solve(slope, (size - long)[..., None])[..., 0]
        most = np.maximum(1.0, np.abs(step[:, :3]).max(axis=1) / 60.0)
        if not fixed:
            most = np.maximum(most, np.abs(step[:, 3:]).max(axis=1) / 0.2)
        step /= most[:, None]
        shift = shift + step[:, :3]
        if not fixed:
            turn = turns(step[:, 3:]) @ turn
        if np.abs(size - long).max() < 1e-9:
            break
    # the last step came behind it
    assert np.abs(size - long).max() < 1e-9
    return whole(turn, shift)
