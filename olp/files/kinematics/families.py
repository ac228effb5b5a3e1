"""Families of machines by their dimensions: the parts of a machine file. Lengths in mm, angles in deg."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from olp.core.arrays import Array
from olp.core.machine import ZERO, Vector
from olp.core.rigid_fit import Rigid
from olp.files.kinematics.written import WIDE_DEG, Keys, Parts, length, linear, numbers, rotary
from olp.kinematics.poses import STILL, Poses, axis_rotation, shift

X: Vector = (1.0, 0.0, 0.0)
Y: Vector = (0.0, 1.0, 0.0)
Z: Vector = (0.0, 0.0, 1.0)
#: A row of modified Denavit-Hartenberg parameters: a in mm, alpha in deg, d in mm, theta at zero in deg.
Row = tuple[float, float, float, float]


def back(direction: Vector) -> Vector:
    """The opposite direction."""
    x, y, z = (0.0 - part for part in direction)
    return (x, y, z)


def slides() -> dict[str, Keys]:
    """The linear axes X, Y and Z."""
    return {"X": linear(X), "Y": linear(Y), "Z": linear(Z)}


def with_turns(chain: str, *turns: tuple[str, Vector, Vector, tuple[float, float]]) -> Parts:
    """A machine tool: X, Y and Z, and rotary axes by name, direction, point and travel."""
    axes = slides()
    for name, direction, point, travel in turns:
        axes[name] = rotary(direction, point, travel)
    return Parts(tuple(chain.split()), axes)


def arm(rows: Sequence[Row], travels: Sequence[tuple[float, float]] = ()) -> Parts:
    """An arm of rotary joints J1, J2 ... from its modified Denavit-Hartenberg rows (Craig 2005: Rx(alpha)
    Tx(a) Rz(theta) Tz(d)). Each axis is at zero where the row says theta."""
    pose, axes = STILL, {}
    for number, (a, alpha, d, theta) in enumerate(rows, 1):
        turn = axis_rotation(np.array(X), np.radians([alpha]))[0]
        pose = pose @ Poses(turn, np.zeros(3)) @ shift(np.array([a, 0.0, 0.0]))
        x, y, z = numbers(pose.rotation[:, 2])
        travel = travels[number - 1] if travels else WIDE_DEG
        axes[f"J{number}"] = rotary((x, y, z), _vector(pose.position), travel)
        pose = pose @ Poses(axis_rotation(np.array(Z), np.radians([theta]))[0], np.zeros(3))
        pose = pose @ shift(np.array([0.0, 0.0, d]))
    a_deg, b_deg, c_deg = numbers(Rigid(pose.rotation, np.zeros(3)).angles_deg)
    gauge = {"point_mm": numbers(pose.position), "A_deg": a_deg, "B_deg": b_deg, "C_deg": c_deg}
    return Parts(("F", *axes), axes, gauge)


def scara(d1: float, d2: float, d3: float, d4: float, d5: float, d6: float) -> Parts:
    """The arm of LinuxCNC's scarakins: J1, J2 and J4 turn about Z, J3 moves down."""
    axes = {
        "J1": rotary(Z),
        "J2": rotary(Z, (d2, 0.0, 0.0)),
        "J3": linear(back(Z)),
        "J4": rotary(Z, (d2 + d4, 0.0, 0.0)),
    }
    gauge = {"point_mm": numbers((d2 + d4 + d6, 0.0, d1 + d3 - d5))}
    return Parts(("F", *axes), axes, gauge)


def legs(
    bases: Sequence[Vector], ends: Sequence[Vector], start_mm: Vector, travel_mm: tuple[float, float]
) -> Parts:
    """A platform on legs L1, L2 ... whose axis values are their whole lengths: six, or three that do not let
    it turn."""
    axes = {f"L{number}": length(travel_mm) for number in range(1, len(bases) + 1)}
    rods = [
        {"base_mm": numbers(base), "platform_mm": numbers(end), "axis": name}
        for base, end, name in zip(bases, ends, axes, strict=True)
    ]
    return _held(axes, rods, start_mm)


def linear_delta(radius_mm: float, rod_mm: float, platform_mm: float = 60.0, width_mm: float = 0.0) -> Parts:
    """Three carriages T1, T2, T3 on towers along Z at 90, 210 and 330 deg, as in LinuxCNC's lineardeltakins.
    Rods reach inward by `radius_mm`; with a width each carriage holds two rods that far apart."""
    axes: dict[str, Keys] = {}
    rods: list[Keys] = []
    for number, angle in enumerate(np.radians([90.0, 210.0, 330.0]), 1):
        axes[f"T{number}"] = linear(Z)
        ray, along = _ray(angle)
        for side in _sides(width_mm):
            rods.append(
                {
                    "base_mm": numbers((radius_mm + platform_mm) * ray + side * along),
                    "platform_mm": numbers(platform_mm * ray + side * along),
                    "length_mm": rod_mm,
                    "carriage": f"T{number}",
                }
            )
    return _held(axes, rods, (0.0, 0.0, 0.0 - math.sqrt(max(rod_mm**2 - radius_mm**2, 1.0))))


def rotary_delta(
    base_mm: float, thigh_mm: float, shin_mm: float, foot_mm: float, width_mm: float = 0.0
) -> Parts:
    """Three arms J1, J2, J3 at -90, 30 and 150 deg, as in LinuxCNC's rotarydeltakins: the shoulders at
    `base_mm` from the centre, thigh, shin, and `foot_mm` from the centre of the platform to the shins."""
    axes: dict[str, Keys] = {}
    rods: list[Keys] = []
    for number, angle in enumerate(np.radians([-90.0, 30.0, 150.0]), 1):
        ray, along = _ray(angle)
        axes[f"J{number}"] = rotary(_vector(along), _vector(base_mm * ray), (-90.0, 90.0))
        for side in _sides(width_mm):
            rods.append(
                {
                    "base_mm": numbers((base_mm + thigh_mm) * ray + side * along),
                    "platform_mm": numbers(foot_mm * ray + side * along),
                    "length_mm": shin_mm,
                    "carriage": f"J{number}",
                }
            )
    inward = base_mm + thigh_mm - foot_mm
    return _held(axes, rods, (0.0, 0.0, 0.0 - math.sqrt(max(shin_mm**2 - inward**2, 1.0))))


def _held(axes: dict[str, Keys], rods: Sequence[Keys], start_mm: Vector) -> Parts:
    keys = {"start_mm": numbers(start_mm), "orientation": "solved" if len(rods) == 6 else "fixed"}
    return Parts(("F", "P"), axes, {"point_mm": numbers(ZERO)}, {"P": (keys, rods)})


def _sides(width_mm: float) -> tuple[float, ...]:
    return (-0.5 * width_mm, 0.5 * width_mm) if width_mm else (0.0,)


def _ray(angle_rad: float) -> tuple[Array, Array]:
    """The unit vector outward in a plane across Z, and the one along the circle."""
    cosine, sine = float(np.cos(angle_rad)), float(np.sin(angle_rad))
    return np.array((cosine, sine, 0.0)), np.array((-sine, cosine, 0.0))


def _vector(values: Array) -> Vector:
    x, y, z = numbers(values)
    return (x, y, z)
