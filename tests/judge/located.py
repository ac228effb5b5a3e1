"""An independent forward computation of machines of any joints with location errors, all postures at a time,
and the information limit of a calibration: the least covariance that readings with known noise and a known
spread of machines allow. It imports nothing of what it judges.

Parameters are named as in a calibration file: ("location", "A", "Y_um"), ("legs", "P 2", "base_X_um"),
("elasticity", "J2", "own_urad_Nm"). Their values are in these units.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

Name = tuple[str, str, str]
Array = np.ndarray
OWN = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
FALL = 9.80665


def cross_table(vector: Array) -> Array:
    """(..., 3, 3) the cross product with vectors (..., 3)."""
    x, y, z = np.moveaxis(np.asarray(vector, float), -1, 0)
    o = np.zeros_like(x)
    return np.stack([np.stack(row, -1) for row in ((o, -z, y), (z, o, -x), (-y, x, o))], -2)


def turned(vector: Array) -> Array:
    """(..., 3, 3) rotations by |vector| about it, in rad."""
    vector = np.asarray(vector, float)
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    k = cross_table(vector)
    with np.errstate(invalid="ignore", divide="ignore"):
        a = np.where(angle > 1e-8, np.sin(angle) / angle, 1.0)
        b = np.where(angle > 1e-8, (1.0 - np.cos(angle)) / angle**2, 0.5)
    return np.asarray(np.eye(3) + a * k + b * (k @ k))


def tilted(abc: Array) -> Array:
    """(3, 3) Rz Ry Rx of angles about X, Y, Z in rad."""
    x, y, z = (turned(np.eye(3)[k] * abc[k]) for k in range(3))
    return np.asarray(z @ y @ x)


def vector_of(turn: Array) -> Array:
    """(..., 3) rotation vectors in rad of small rotations (..., 3, 3)."""
    skew = 0.5 * (turn - np.swapaxes(turn, -1, -2))
    return np.stack((skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]), -1)


def motion(turn: Array, shift: Array) -> Array:
    """(..., 4, 4) of rotations and shifts."""
    turn, shift = np.asarray(turn, float), np.asarray(shift, float)
    shape = np.broadcast_shapes(turn.shape[:-2], shift.shape[:-1])
    whole = np.zeros((*shape, 4, 4))
    whole[..., :3, :3], whole[..., :3, 3], whole[..., 3, 3] = turn, shift, 1.0
    return whole


class Located:
    """A machine from its file, and weights on its bodies: tables of `on`, `kg` and `centre_mm`."""

    def __init__(self, machine: Path, masses: Sequence[dict[str, Any]] = ()) -> None:
        self.file = tomllib.loads(machine.read_text())
        self.axes: dict[str, dict[str, Any]] = self.file["axes"]
        self.order, self.chain = list(self.axes), self.file["chain"].split()
        self.frame, self.masses = self.chain.index("F"), list(masses)
        self.platforms: dict[str, Any] = self.file.get("platforms", {})
        gauge = self.file.get("gauge", {})
        angles = np.radians([gauge.get(f"{c}_deg", 0.0) for c in "ABC"])
        self.gauge = motion(tilted(angles), np.array(gauge.get("point_mm", (0.0, 0.0, 0.0))))
        self.limits = np.array(
            [axis.get("travel_mm", axis.get("travel_deg")) for axis in self.axes.values()], float
        )

    def direction(self, name: str) -> Array:
        along = np.array(self.axes[name].get("direction", OWN.get(name)), float)
        return np.asarray(along / np.linalg.norm(along))

    def kind(self, name: str) -> str:
        return str(self.axes[name].get("kind", "linear"))

    def parameters(self) -> list[Name]:
        """Everything that a location error may be, needed or not."""
        names: list[Name] = []
        for name in self.order:
            if self.kind(name) == "length":
                continue
            across = [k for k in range(3) if abs(self.direction(name)[k]) < 1.0 - 1e-9]
            rotary = self.kind(name) == "rotary"
            names.append(("location", name, "zero_urad" if rotary else "zero_um"))
            names += [("location", name, f"{'ABC'[k]}_urad") for k in across]
            names += [("location", name, f"{'XYZ'[k]}_um") for k in across] if rotary else []
        for platform, table in self.platforms.items():
            for leg in range(1, len(table["legs"]) + 1):
                names.append(("legs", f"{platform} {leg}", "length_um"))
                names += [
                    ("legs", f"{platform} {leg}", f"{e}_{c}_um") for e in ("base", "platform") for c in "XYZ"
                ]
        names += [("location", "gauge", f"{c}_um") for c in "XYZ"]
        names += [("location", "gauge", f"{c}_urad") for c in "ABC"]
        return names

    def pose(
        self, values: Array, errors: dict[Name, float], payload: tuple[float, Array] = (0.0, np.zeros(3))
    ) -> Array:
        """(n, 4, 4) of the gauge frame in the workpiece at axis values (n, k) in the order of the file."""
        gives = self.gives(values, errors, payload)
        whole = np.broadcast_to(np.eye(4), (len(values), 4, 4))
        for name in self.chain:
            if name in self.platforms:
                whole = whole @ self.platform(name, values, errors)
            elif name != "F":
                whole = whole @ self.joint(name, values, errors, gives.get(name, 0.0))
        tilt = [errors.get(("location", "gauge", f"{c}_urad"), 0.0) * 1e-6 for c in "ABC"]
        shift = [errors.get(("location", "gauge", f"{c}_um"), 0.0) * 1e-3 for c in "XYZ"]
        point = self.gauge[:3, 3]
        wrong = (
            motion(np.eye(3), point)
            @ motion(tilted(np.array(tilt)), np.array(shift))
            @ motion(np.eye(3), -point)
        )
        return np.asarray(whole @ wrong @ self.gauge)

    def joint(self, name: str, values: Array, errors: dict[Name, float], own: Any = 0.0) -> Array:
        value, along = values[:, self.order.index(name)], self.direction(name)
        stated = {
            key: number
            for (table, part, key), number in errors.items()
            if (table, part) == ("location", name)
        }
        tilt = np.array([stated.get(f"{c}_urad", 0.0) for c in "ABC"]) * 1e-6
        if self.kind(name) != "rotary":
            way = (value + stated.get("zero_um", 0.0) * 1e-3)[:, None] * along
            return motion(np.eye(3), way + value[:, None] * np.cross(tilt, along))
        shift = np.array([stated.get(f"{c}_um", 0.0) for c in "XYZ"]) * 1e-3
        point = np.array(self.axes[name].get("point_mm", (0.0, 0.0, 0.0)), float)
        line = motion(tilted(tilt - along * (along @ tilt)), shift)
        angle = np.radians(value) + stated.get("zero_urad", 0.0) * 1e-6 + own
        turn = line @ motion(turned(angle[:, None] * along), np.zeros(3)) @ np.linalg.inv(line)
        return np.asarray(motion(np.eye(3), point) @ turn @ motion(np.eye(3), -point))

    def gives(
        self, values: Array, errors: dict[Name, float], payload: tuple[float, Array]
    ) -> dict[str, Array]:
        """rad by which joints on the side of the tool turn under what they carry, at the nominal posture."""
        soft = {part: number for (table, part, _), number in errors.items() if table == "elasticity"}
        if not soft:
            return {}
        names = [name for name in self.chain[self.frame + 1 :] if name in self.axes]
        whole, stators, bodies = np.broadcast_to(np.eye(4), (len(values), 4, 4)), {}, {}
        for name in names:
            stators[name] = whole
            whole = whole @ self.joint(name, values, {})
            bodies[name] = whole
        held = (self.gauge @ np.append(payload[1], 1.0))[:3]
        weights = [(m["on"], m["kg"], np.array(m["centre_mm"])) for m in self.masses] + [
            (names[-1], payload[0], held)
        ]
        result = {}
        for name, number in soft.items():
            back, torque = np.linalg.inv(stators[name]), np.zeros((len(values), 3))
            for on, kg, centre in weights:
                if names.index(on) >= names.index(name):
                    place = (back @ bodies[on] @ np.append(centre, 1.0))[:, :3]
                    pull = back[:, :3, :3] @ np.array([0.0, 0.0, -kg * FALL])
                    torque += np.cross((place - self.axes[name]["point_mm"]) * 1e-3, pull)
            result[name] = number * 1e-6 * (torque @ self.direction(name))
        return result

    def platform(self, name: str, values: Array, errors: dict[Name, float]) -> Array:
        table, count = self.platforms[name], len(values)
        ends, anchors, sizes = [], [], []
        for number, leg in enumerate(table["legs"], 1):
            part = f"{name} {number}"

            def wrong(end: str, part: str = part) -> Array:
                return np.array([errors.get(("legs", part, f"{end}_{c}_um"), 0.0) for c in "XYZ"]) * 1e-3

            base = np.broadcast_to(np.array(leg["base_mm"]) + wrong("base"), (count, 3))
            if "carriage" in leg:
                ridden = self.joint(leg["carriage"], values, errors)
                base = (ridden @ np.concatenate((base, np.ones((count, 1))), 1)[..., None])[:, :3, 0]
            size = leg.get("length_mm", 0.0) + errors.get(("legs", part, "length_um"), 0.0) * 1e-3
            if "axis" in leg:
                size = size + values[:, self.order.index(leg["axis"])]
            anchors.append(base)
            ends.append(np.array(leg["platform_mm"]) + wrong("platform"))
            sizes.append(np.broadcast_to(size, (count,)))
        anchor, end, length = np.stack(anchors, 1), np.array(ends), np.stack(sizes, 1)
        fixed = table.get("orientation") == "fixed"
        turn, shift = (
            np.broadcast_to(np.eye(3), (count, 3, 3)),
            np.tile(np.array(table["start_mm"], float), (count, 1)),
        )
        for _ in range(60):
            arm = (turn[:, None] @ end[None, ..., None])[..., 0]
            rod = arm + shift[:, None] - anchor
            far = np.linalg.norm(rod, axis=2)
            unit = rod / far[..., None]
            slope = unit if fixed else np.concatenate((unit, np.cross(arm, unit)), 2)
            step = np.linalg.solve(slope, (length - far)[..., None])[..., 0]
            step *= np.minimum(1.0, 50.0 / np.maximum(np.linalg.norm(step[:, :3], axis=1), 1e-9))[:, None]
            shift = shift + step[:, :3]
            turn = turn if fixed else turned(step[:, 3:]) @ turn
            if np.abs(length - far).max() < 1e-11:
                break
        assert np.abs(length - far).max() < 1e-8, "a platform does not close"
        return motion(turn, shift)


def errors_of(calibration: Path) -> dict[Name, float]:
    """The numbers of a calibration file by name."""
    file, errors = tomllib.loads(calibration.read_text()), dict[Name, float]()
    for part, table in file.get("location", {}).items():
        errors |= {("location", part, key): float(value) for key, value in table.items()}
    for axis, key, name in (("Y", "C_urad", "C0Y"), ("Z", "B_urad", "B0Z"), ("Z", "A_urad", "A0Z")):
        value = file.get("squareness", {}).get(f"{name}_urad")
        errors |= {} if value is None else {("location", axis, key): float(value)}
    for part, table in file.get("elasticity", {}).items():
        errors |= {("elasticity", part, key): float(value) for key, value in table.items()}
    for leg in file.get("legs", []):
        part = f"{leg['platform']} {leg['leg']}"
        errors[("legs", part, "length_um")] = float(leg.get("length_um", 0.0))
        for end in ("base", "platform"):
            for letter, value in zip("XYZ", leg.get(f"{end}_um", (0.0, 0.0, 0.0)), strict=True):
                errors[("legs", part, f"{end}_{letter}_um")] = float(value)
    return errors


def slopes(of: Callable[[Array], Array], at: Array, step: Array) -> Array:
    """(m, k) central differences of a function (m,) about `at` (k,)."""
    columns = []
    for k, size in enumerate(step):
        change = np.zeros(len(at))
        change[k] = size
        columns.append((of(at + change) - of(at - change)).ravel() / (2.0 * size))
    return np.stack(columns, 1)


def best_of(rows: Array, own: Array, spread: Array, missed: Array, true: Array) -> tuple[Array, Array]:
    """By how much the best estimate (k,) of parameters is off, and the least covariance (k, k) of it.

    They have a spread (k,) before the readings, whose slopes are `rows` (m, k) and, for unknowns of the
    instruments, `own` (m, l); `missed` (m,) is their noise. All three are over the expected noise. `true`
    (k,) are the parameters."""
    free = np.linalg.svd(own, full_matrices=False) if own.size else None
    if free is not None:
        basis = free[0][:, free[1] > 1e-9 * free[1][0]]
        rows, missed = (one - basis @ (basis.T @ one) for one in (rows, missed))
    scaled = rows * spread
    least = np.linalg.inv(scaled.T @ scaled + np.eye(len(spread)))
    return spread * (least @ (scaled.T @ missed - true / spread)), least * np.outer(spread, spread)


def without_frame(table: Array, place: Array) -> Array:
    """(n, 3, k) of tips less the best shift and turn of all of them; `place` (n, 3)."""
    arm = place - place.mean(axis=0)
    frame = np.concatenate((np.broadcast_to(np.eye(3), (len(arm), 3, 3)), -cross_table(arm)), 2).reshape(
        -1, 6
    )
    frame = frame / np.linalg.norm(frame, axis=0)
    basis = np.linalg.svd(frame, full_matrices=False)
    kept = basis[0][:, basis[1] > 1e-9]
    flat = table.reshape(len(frame), -1)
    return np.asarray((flat - kept @ (kept.T @ flat)).reshape(table.shape))
