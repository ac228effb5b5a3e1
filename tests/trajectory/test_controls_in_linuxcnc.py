"""The time that the profile of LinuxCNC gives, beside that of LinuxCNC itself, in virtual time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine
from judge import controller

from olp.files.config import load_setup
from olp.program.registry import DIALECTS
from olp.program.rs274.reader import read
from olp.trajectory.controls.base import AxisSpeeds, move_seconds
from olp.trajectory.controls.learning import learned
from olp.trajectory.controls.linuxcnc import CONTROL
from olp.trajectory.controls.moves import moves
from olp.trajectory.controls.naive import said

pytestmark = [pytest.mark.oracle, pytest.mark.slow]

START = "start_mm = { X = 0.0, Y = 0.0, Z = 0.0 }"
TICK_S = controller.PERIOD_NS * 1e-9
LIMITS = AxisSpeeds(
    np.full(3, controller.SPEED_MM_S), np.full(3, controller.ACCELERATION_MM_S2), np.full(3, np.inf)
)


def square(mode: str) -> list[str]:
    corners = ((60, 0), (60, 60), (0, 60), (0, 0))
    return [mode, *(f"G1 X{x} Y{y} F15000" for _ in range(2) for x, y in corners)]


def walk(seed: int, tolerance: float) -> list[str]:
    """Moves of lengths from 0.1 to 30 mm, of several feeds, some of them rapids."""
    rng = np.random.default_rng(seed)
    point, rows = np.zeros(3), [f"G64 P{tolerance} Q0"]
    for _ in range(60):
        point = point + rng.uniform(-1.0, 1.0, 3) * 10 ** rng.uniform(-1.0, 1.5)
        code = "G0" if rng.random() < 0.15 else "G1"
        rows.append(
            f"{code} X{point[0]:.3f} Y{point[1]:.3f} Z{point[2]:.3f} F{rng.choice([2000, 6000, 15000])}"
        )
    return rows


def arcs(seed: int) -> list[str]:
    """Lines and arcs that meet at corners of all angles, on both sides, and a helix."""
    rng = np.random.default_rng(seed)
    point, rows = np.zeros(2), ["G64 P0.02 Q0", "F7000"]
    for k in range(30):
        step = rng.uniform(-9.0, 9.0, 2)
        end = np.round(point + step, 4)
        if k % 2:
            centre = step / 2 + np.array([-step[1], step[0]]) * rng.uniform(-1.0, 1.0)
            rows.append(f"G{2 + k % 3 % 2} X{end[0]:.4f} Y{end[1]:.4f} I{centre[0]:.4f} J{centre[1]:.4f}")
        else:
            rows.append(f"G1 X{end[0]:.4f} Y{end[1]:.4f}")
        point = end
    return [*rows, f"G3 X{point[0]:.4f} Y{point[1]:.4f} I8 J0 Z-3 P2", "G91", "G1 X10", "G90"]


def dense() -> list[str]:
    turn = np.linspace(0.0, 12 * np.pi, 1200)[1:]
    radius = 0.5 + 0.8 * turn
    points = np.column_stack((radius * np.cos(turn) - 0.5, radius * np.sin(turn)))
    return ["G64 P0.01 Q0", *(f"G1 X{x:.3f} Y{y:.3f} F12000" for x, y in points)]


def jogs(mode: str) -> list[str]:
    """A line of 100 mm with steps of 1 um, which the control merges within a tolerance."""
    ends = [(x, y) for k in range(10) for x, y in ((10 * k + 10, k % 2), (10 * k + 10, 1 - k % 2))]
    return [mode, *(f"G1 X{x} Y{0.001 * y:.3f} F6000" for x, y in ends)]


PROGRAMS: dict[str, Callable[[], list[str]]] = {
    "square, 10 um": lambda: square("G64 P0.01 Q0"),
    "square, no tolerance": lambda: square("G64 Q0"),
    "square, exact path": lambda: square("G61"),
    "square, exact stop": lambda: square("G61.1"),
    "walk, 5 um": lambda: walk(1, 0.005),
    "walk, 0.1 mm": lambda: walk(2, 0.1),
    "arcs": lambda: arcs(3),
    "dense": dense,
    "jogs, merged": lambda: jogs("G64 P0.01"),
    "jogs, 0.2 um": lambda: jogs("G64 P0.01 Q0.0002"),
    "dense, merged": lambda: ["G64 P0.02", *dense()[1:]],
}


@pytest.mark.parametrize("name", PROGRAMS)
def test_the_time_of_linuxcnc_is_predicted_within_two_percent(
    name: str, tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    controller.require()
    text = "\n".join(["G21 G90 G17", *PROGRAMS[name](), "M2", ""]).encode()
    described = machine(tmp_path / "machine", tables=TRUE_ZERO, job=START)
    program = read(text, load_setup(described, described.with_name("job.toml")), DIALECTS["linuxcnc"])
    (part,) = moves(program, blend_mm=np.inf, said=said(program))
    # the largest speed along the path is a key of its own there
    part = replace(part, feed_mm_s=np.minimum(part.feed_mm_s, controller.SPEED_MM_S))
    run = controller.run(text, described, tmp_path / "control")
    moving = np.flatnonzero((np.diff(run.axis, axis=0) != 0.0).any(axis=1))
    theirs = float(moving[-1] - moving[0] + 1) * TICK_S
    ours = float(move_seconds(CONTROL, part, LIMITS, CONTROL.values({})).sum())
    record_property("predicted over LinuxCNC", ours / theirs)
    print(f"{name}: LinuxCNC {theirs:.3f} s, predicted {ours:.3f} s ({100 * (ours / theirs - 1):+.2f} %)")
    assert abs(ours - theirs) <= 0.02 * theirs


def test_limits_are_learned_from_a_log(tmp_path: Path) -> None:
    controller.require()
    rows = [
        "G64 P0.01 Q0",
        *(f"G0 {axis}{to}" for axis in "XYZ" for to in (180, 0, 90, 0)),
        *square("G61")[1:],
    ]
    text = "\n".join(["G21 G90 G17", *rows, "M2", ""]).encode()
    described = machine(tmp_path / "machine", tables=TRUE_ZERO, job=START)
    program = read(text, load_setup(described, described.with_name("job.toml")), DIALECTS["linuxcnc"])
    parts = moves(program, blend_mm=np.inf, said=said(program))
    run = controller.run(text, described, tmp_path / "control")
    slower = AxisSpeeds(0.5 * LIMITS.velocity, 0.3 * LIMITS.acceleration, LIMITS.jerk)
    time_s = np.arange(len(run.axis)) * TICK_S
    log = learned(CONTROL, parts, slower, CONTROL.values({}), time_s, run.axis)
    assert log.limits.velocity == pytest.approx(LIMITS.velocity, rel=0.01)
    assert log.limits.acceleration == pytest.approx(LIMITS.acceleration, rel=0.01)
