"""An arm of six joints for tests, by numpy alone: where it is, and which joints a control takes for a pose.

It shares nothing with `olp.kinematics`: turns are made by their own formula, and joints are found by Newton's
method with differences, from joints near by. Of errors it knows wrong zeros of joints alone.
"""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

_STEP_DEG = 1e-4


def about(axis: Sequence[float], degrees: float) -> np.ndarray:
    """The rotation about a unit vector."""
    x, y, z = axis
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return cosine * np.eye(3) + sine * cross + (1 - cosine) * np.outer(axis, axis)


class Arm:
    """The arm of a machine file, with zeros in urad by joint."""

    def __init__(self, machine: Path, zeros_urad: Sequence[float] = (0.0,) * 6) -> None:
        file = tomllib.loads(machine.read_text("utf-8"))
        joints = [file["axes"][name] for name in file["chain"].split()[1:]]
        self.lines = [(np.array(j["direction"]), np.array(j.get("point_mm", np.zeros(3)))) for j in joints]
        gauge = file["gauge"]
        self.flange = np.array(gauge["point_mm"])
        self.turned = np.eye(3)
        for axis, name in zip(np.eye(3)[::-1], "CBA", strict=True):
            self.turned = self.turned @ about(axis, gauge.get(f"{name}_deg", 0.0))
        self.zeros = np.degrees(np.array(zeros_urad) * 1e-6)

    def pose(self, joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rotation and position of the flange without errors."""
        rotation, place = self.turned, self.flange
        for (axis, point), value in zip(self.lines[::-1], joints[::-1], strict=True):
            turn = about(axis, value)
            rotation, place = turn @ rotation, point + turn @ (place - point)
        return rotation, place

    def actual(self, joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The same of the arm with its errors."""
        return self.pose(joints + self.zeros)

    def joints(self, rotation: np.ndarray, place: np.ndarray, near: np.ndarray) -> np.ndarray:
        """The joints that bring the flange to a pose, from joints near by."""
        found = np.array(near, float)
        for _ in range(20):
            miss = self._miss(found, rotation, place)
            if np.abs(miss).max() < 1e-10:
                return found
            slopes = np.empty((6, 6))
            for k in range(6):
                step = np.eye(6)[k] * _STEP_DEG
                ahead, behind = (self._miss(found + s * step, rotation, place) for s in (1, -1))
                slopes[:, k] = (ahead - behind) / (2 * _STEP_DEG)
            found = found - np.linalg.solve(slopes, miss)
        raise AssertionError("no joints bring the flange there")

    def carry(self, along_mm: float) -> None:
        """Where what carries the arm is from now on; this one stands."""

    def _miss(self, joints: np.ndarray, rotation: np.ndarray, place: np.ndarray) -> np.ndarray:
        turn, here = self.pose(joints)
        return np.append(here - place, 500.0 * turned_by(turn, rotation))


class OnTrack(Arm):
    """An arm whose machine file has a linear joint E1 before its own six. Of errors that has a wrong
    `zero_um`, a direction that is tilted by `tilt_urad`, and `motion_um`: by a meter of its way EX, EY, EZ in
    um and EA, EB, EC in urad, about the machine's zero on the carriage."""

    def __init__(
        self, machine: Path, zeros_urad: Sequence[float], zero_um: float, tilt_urad: Sequence[float],
        motion_um: Sequence[float],
    ) -> None:  # fmt: skip
        super().__init__(machine, zeros_urad)
        (self.track, _), *self.lines = self.lines
        self.own = zero_um * 1e-3 * self.track
        self.tilt = np.cross(np.array(tilt_urad) * 1e-6, self.track)
        self.motion = np.array(motion_um)
        self.along = 0.0

    def carry(self, along_mm: float) -> None:
        self.along = along_mm

    def pose(self, joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rotation, place = super().pose(joints)
        return rotation, place + self.along * self.track

    def actual(self, joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rotation, place = super().pose(joints + self.zeros)
        shift, turns = np.split(self.motion * self.along * 1e-3, 2)
        tilted = np.eye(3)
        for axis, urad in zip(np.eye(3)[::-1], turns[::-1], strict=True):
            tilted = tilted @ about(axis, np.degrees(urad * 1e-6))
        away = self.along * (self.track + self.tilt) + self.own + shift * 1e-3
        return tilted @ rotation, tilted @ place + away


def turned_by(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The small turn from one rotation to another, rad."""
    turn = one @ other.T
    return 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])


def quaternion(rotation: np.ndarray) -> np.ndarray:
    """A rotation as a quaternion, w first."""
    xx, yy, zz = np.diag(rotation)
    outer = np.array([1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz]) / 4
    size, first = np.sqrt(np.maximum(outer, 0)), int(np.argmax(outer))
    r = rotation
    pairs = {
        0: [1, r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]],
        1: [r[2, 1] - r[1, 2], 1, r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]],
        2: [r[0, 2] - r[2, 0], r[0, 1] + r[1, 0], 1, r[1, 2] + r[2, 1]],
        3: [r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], 1],
    }
    result = np.array(pairs[first], float) / (4 * size[first])
    result[first] = size[first]
    return result


def between(one: np.ndarray, other: np.ndarray, share: float) -> np.ndarray:
    """A rotation at a share of an even turn."""
    a, b = quaternion(one), quaternion(other)
    b = b if a @ b >= 0 else -b
    angle = np.arccos(min(1.0, a @ b))
    mixed = a + share * (b - a)
    if angle > 1e-9:
        mixed = (np.sin((1 - share) * angle) * a + np.sin(share * angle) * b) / np.sin(angle)
    w, *vector = mixed / np.linalg.norm(mixed)
    size = np.linalg.norm(vector)
    if size < 1e-15:
        return np.eye(3)
    return about(np.array(vector) / size, np.degrees(2 * np.arctan2(size, w)))
