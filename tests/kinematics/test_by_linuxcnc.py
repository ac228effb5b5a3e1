"""LinuxCNC's own kinematics agree with ours, for every structure that it has a module of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from judge import kinematics as judge

from olp.kinematics.chain import Kinematics
from olp.kinematics.inverse import inverse
from olp.kinematics.pose_axes import axes_of_poses
from olp.kinematics.poses import STILL, Poses, axis_rotation, shift
from olp.kinematics.structure import Gauge, Joint, Leg, Platform, Structure

pytestmark = pytest.mark.oracle

#: mm, and deg of its angles.
AGREES = 1e-6
Vector = tuple[float, float, float]
X: Vector = (1.0, 0.0, 0.0)
Y: Vector = (0.0, 1.0, 0.0)
Z: Vector = (0.0, 0.0, 1.0)
RNG = np.random.default_rng(0)


def joint(name: str, kind: str, direction: Vector, point: Vector = (0.0, 0.0, 0.0)) -> Joint:
    return Joint(name, kind, direction, point, (-2000.0, 2000.0))  # type: ignore[arg-type]


LINEAR = {name: joint(name, "linear", direction) for name, direction in zip("XYZ", (X, Y, Z), strict=True)}


def back(direction: Vector) -> Vector:
    x, y, z = direction
    return (0.0 - x, 0.0 - y, 0.0 - z)


def from_words(structure: Structure, low: float, high: float, words: np.ndarray) -> np.ndarray:
    """Axis values within a travel of programmed poses."""
    joints = {name: replace(one, travel=(low, high)) for name, one in structure.joints.items()}
    return axes_of_poses(Kinematics(replace(structure, joints=joints)), words)


def angles_deg(rotation: np.ndarray) -> np.ndarray:
    """(n, 3) A, B, C of Rz Ry Rx."""
    a = np.arctan2(rotation[:, 2, 1], rotation[:, 2, 2])
    c = np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])
    return np.degrees(np.stack((a, np.arcsin(0.0 - rotation[:, 2, 0]), c), axis=1))


def test_tilting_tables() -> None:
    values = RNG.uniform(-80.0, 80.0, (40, 5))
    for letter, direction, offset in (("A", X, "y"), ("B", Y, "x")):
        module = f"xyz{letter.lower()}c-trt-kins"
        pins = {"x-rot-point": 3.0, "y-rot-point": 4.0, "z-rot-point": -150.0, "z-offset": 5.0}
        pins[f"{offset}-offset"] = 7.0
        point = (3.0, 11.0, -145.0) if letter == "A" else (10.0, 4.0, -145.0)
        joints = {**LINEAR, letter: joint(letter, "rotary", back(direction), point)}
        joints["C"] = joint("C", "rotary", back(Z), (3.0, 4.0, -150.0))
        ours = Kinematics(Structure("m", ("C", letter, "F", "X", "Y", "Z"), joints)).nominal(values)
        theirs = judge.forward(module, pins, values)
        assert np.abs(ours.position - theirs[:, :3]).max() < AGREES


def test_a_swivelling_head() -> None:
    head = {**LINEAR, "B": joint("B", "rotary", back(Y), (0.0, 0.0, 250.0))}
    head["C"] = joint("C", "rotary", Z, (0.0, 0.0, 250.0))
    values = RNG.uniform(-100.0, 100.0, (40, 5))
    ours = Kinematics(Structure("m", ("F", "X", "Y", "Z", "C", "B"), head)).nominal(values)
    theirs = judge.forward("5axiskins", {"pivot-length": 250.0}, values)
    assert np.abs(ours.position - theirs[:, :3]).max() < AGREES


def arm_of(rows: list[tuple[float, float, float]]) -> Structure:
    """A six-axis arm from modified Denavit-Hartenberg rows: a in mm, alpha in rad, d in mm."""
    pose, joints = STILL, {}
    for number, (a, alpha, d) in enumerate(rows, 1):
        turn = axis_rotation(np.array(X), np.array([alpha]))[0]
        pose = pose @ Poses(turn, np.zeros(3)) @ shift(np.array([a, 0.0, 0.0]))
        name = f"J{number}"
        joints[name] = joint(name, "rotary", tuple(pose.rotation[:, 2]), tuple(pose.position))
        pose = pose @ shift(np.array([0.0, 0.0, d]))
    gauge = Gauge(tuple(pose.position), tuple(angles_deg(pose.rotation[None])[0]))
    return Structure("arm", ("F", *joints), joints, gauge=gauge, symmetric_tool=False)


def test_arms() -> None:
    quarter = np.pi / 2
    rows = [(0.0, 0.0, 0.0), (0.0, -quarter, 0.0), (300.0, 0.0, 70.0)]
    rows += [(50.0, -quarter, 400.0), (0.0, quarter, 0.0), (0.0, -quarter, 60.0)]
    arm = Kinematics(arm_of(rows))
    values = RNG.uniform(-85.0, 85.0, (40, 6))
    pose = arm.nominal(values)
    ours = np.concatenate((pose.position, angles_deg(pose.rotation)), axis=1)
    puma = {"A2": 300.0, "A3": 50.0, "D3": 70.0, "D4": 400.0, "D6": 60.0}
    assert np.abs(ours - judge.forward("pumakins", puma, values)).max() < AGREES
    parts = {"A": 0, "ALPHA": 1, "D": 2}
    pins = {f"{part}-{row}": rows[row][column] for part, column in parts.items() for row in range(6)}
    assert np.abs(ours - judge.forward("genserkins", pins, values)).max() < AGREES
    near = values + RNG.uniform(-3.0, 3.0, values.shape)
    away = np.abs(values[:, 4]) > 20.0  # from the singular posture of the wrist
    target = Poses(pose.rotation[away], pose.position[away])
    solved = inverse(arm, target, near[away], nominal=True).values
    again = judge.forward("pumakins", puma, solved)
    assert np.abs(ours[away] - again).max() < AGREES


def test_arms_that_are_led_by_poses() -> None:
    quarter = np.pi / 2
    rows = [(0.0, 0.0, 0.0), (0.0, -quarter, 0.0), (300.0, 0.0, 70.0)]
    rows += [(50.0, -quarter, 400.0), (0.0, quarter, 0.0), (0.0, -quarter, 60.0)]
    pins = {"A2": 300.0, "A3": 50.0, "D3": 70.0, "D4": 400.0, "D6": 60.0}
    arm = arm_of(rows)
    for posture in ((10.0, -60.0, 30.0, 20.0, 50.0, 5.0), (160.0, 40.0, -170.0, 20.0, -50.0, 5.0)):
        machine = Kinematics(replace(arm, posture=posture))
        values = np.array(posture) + RNG.uniform(-9.0, 9.0, (20, 6))
        words = judge.forward("pumakins", pins, values)
        assert np.abs(axes_of_poses(machine, words) - values).max() < AGREES
        theirs = judge.inverse("pumakins", pins, words, 6, np.array(posture))
        assert np.abs((theirs - values + 180.0) % 360.0 - 180.0).max() < AGREES


def test_polar_machines_that_are_led_by_poses() -> None:
    joints = {"R": joint("R", "linear", X), "Z": joint("Z", "linear", Z), "C": joint("C", "rotary", Z)}
    machine = Kinematics(Structure("m", ("C", "F", "Z", "R"), joints, posture=(9.0, 0.0, 180.0)))
    values = RNG.uniform((10.0, -50.0, 0.0), (300.0, 50.0, 360.0), (40, 3))
    words = judge.forward("rosekins", {}, values)[:, :3]
    assert np.abs(axes_of_poses(machine, words) - values).max() < AGREES


def test_scara() -> None:
    joints = {"J1": joint("J1", "rotary", Z), "J2": joint("J2", "rotary", Z, (340.0, 0.0, 0.0))}
    joints["J3"] = joint("J3", "linear", back(Z))
    joints["J4"] = joint("J4", "rotary", Z, (590.0, 0.0, 0.0))
    structure = Structure("m", ("F", *joints), joints, gauge=Gauge((640.0, 0.0, 490.0)))
    values = RNG.uniform(-100.0, 100.0, (40, 4))
    pins = {"D1": 490.0, "D2": 340.0, "D3": 0.0, "D4": 250.0, "D5": 0.0, "D6": 50.0}
    theirs = judge.forward("scarakins", pins, values)
    assert np.abs(Kinematics(structure).nominal(values).position - theirs[:, :3]).max() < AGREES
    for posture, side in (((0.0, 90.0, 0.0, 0.0), 1.0), ((0.0, -90.0, 0.0, 0.0), -1.0)):
        values[:, 1] = side * np.abs(values[:, 1])
        words = judge.forward("scarakins", pins, values)[:, [0, 1, 2, 5]]
        assert (
            np.abs(axes_of_poses(Kinematics(replace(structure, posture=posture)), words) - values).max()
            < AGREES
        )


def lengths_of(bases: list[Vector], ends: list[Vector], start: Vector, *, turns: bool) -> Structure:
    joints = {f"L{n}": joint(f"L{n}", "length", X) for n in range(1, len(bases) + 1)}
    legs = tuple(Leg(base, end, 0.0, axis=name) for base, end, name in zip(bases, ends, joints, strict=True))
    platform = Platform("P", legs, start, turns)
    return Structure("m", ("F", "P"), joints, {"P": platform}, symmetric_tool=not turns)


def test_tripod() -> None:
    bases = [(0.0, 0.0, 0.0), (900.0, 0.0, 0.0), (430.0, 780.0, 0.0)]
    structure = lengths_of(bases, [(0.0, 0.0, 0.0)] * 3, (400.0, 300.0, 800.0), turns=False)
    values = RNG.uniform(800.0, 1100.0, (40, 3))
    theirs = judge.forward("tripodkins", {"Bx": 900.0, "Cx": 430.0, "Cy": 780.0}, values)
    assert np.abs(Kinematics(structure).nominal(values).position - theirs[:, :3]).max() < AGREES
    assert np.abs(from_words(structure, 800.0, 1100.0, theirs[:, :3]) - values).max() < AGREES


def test_hexapod() -> None:
    around = np.radians([200.0, -20.0, -20.0, 90.0, 90.0, 200.0])
    inner = np.radians([170.0, 10.0, -50.0, 60.0, 120.0, 230.0])
    bases = [(float(600 * np.cos(a)), float(600 * np.sin(a)), 0.0) for a in around]
    ends = [(float(260 * np.cos(a)), float(260 * np.sin(a)), 20.0) for a in inner]
    hexapod = Kinematics(lengths_of(bases, ends, (0.0, 0.0, 700.0), turns=True))
    poses = np.concatenate((RNG.uniform(-80.0, 80.0, (40, 3)), RNG.uniform(-8.0, 8.0, (40, 3))), axis=1)
    poses[:, 2] += 750.0
    pins = {"screw-lead": 0.0}
    for what, points in (("base", bases), ("platform", ends)):
        for leg, point in enumerate(points):
            pins |= {f"{what}.{leg}.{part}": point[k] for k, part in enumerate("xyz")}
    lengths = judge.inverse("genhexkins", pins, poses, 6)
    ours = hexapod.nominal(lengths)
    assert np.abs(ours.position - poses[:, :3]).max() < AGREES
    assert np.abs(angles_deg(ours.rotation) - poses[:, 3:]).max() < AGREES
    assert np.abs(axes_of_poses(hexapod, poses) - lengths).max() < AGREES


def test_deltas() -> None:
    platform_mm, rods = 60.0, []
    towers = {}
    for number, angle in enumerate(np.radians([90.0, 210.0, 330.0]), 1):
        ray = np.array([np.cos(angle), np.sin(angle), 0.0])
        towers[f"T{number}"] = joint(f"T{number}", "linear", Z)
        rods.append(Leg(tuple(310.0 * ray), tuple(platform_mm * ray), 520.0, carriage=f"T{number}"))
    structure = Structure(
        "m", ("F", "P"), towers, {"P": Platform("P", tuple(rods), (0.0, 0.0, -300.0), turns=False)}
    )
    values = RNG.uniform(400.0, 600.0, (40, 3))
    theirs = judge.forward("lineardeltakins", {"R": 250.0, "L": 520.0}, values)
    assert np.abs(Kinematics(structure).nominal(values).position - theirs[:, :3]).max() < AGREES
    assert np.abs(from_words(structure, 350.0, 650.0, theirs[:, :3]) - values).max() < AGREES


def test_rotary_delta() -> None:
    elbows, rods = {}, []
    for number, angle in enumerate(np.radians([-90.0, 30.0, 150.0]), 1):
        ray = np.array([np.cos(angle), np.sin(angle), 0.0])
        along = (float(-np.sin(angle)), float(np.cos(angle)), 0.0)
        elbows[f"J{number}"] = joint(f"J{number}", "rotary", along, tuple(200.0 * ray))
        rods.append(Leg(tuple(500.0 * ray), tuple(80.0 * ray), 500.0, carriage=f"J{number}"))
    structure = Structure(
        "m", ("F", "P"), elbows, {"P": Platform("P", tuple(rods), (0.0, 0.0, -300.0), turns=False)}
    )
    pins = {"platformradius": 200.0, "thighlength": 300.0, "shinlength": 500.0, "footradius": 80.0}
    values = RNG.uniform(-40.0, 40.0, (40, 3))
    machine = Kinematics(structure)
    ours, theirs = machine.nominal(values), judge.forward("rotarydeltakins", pins, values)
    assert np.abs(ours.position - theirs[:, :3]).max() < AGREES
    solved = inverse(machine, ours, values + 2.0, nominal=True).values
    assert np.abs(solved - values).max() < AGREES
    assert np.abs(from_words(structure, -45.0, 45.0, theirs[:, :3]) - values).max() < AGREES
