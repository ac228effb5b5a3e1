"""Re-timed programs beside the whole of LinuxCNC, with its limits of speed and acceleration.

LinuxCNC knows no jerk, so ours is let go: 1e9 mm/s^3, which costs a move 2 us at 2000 mm/s^2. Its law of
exact stops, as measured: a trapezoid in each move, each axis up to its own limits, no move faster than the
largest speed of the machine, all of the acceleration under G61.1 and 0.9 of it under G61, and moves begin and
end on servo cycles. Its runs are in real time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine
from judge import controller
from judge.retiming import judge

from olp.files.config import load_setup
from olp.program.registry import DIALECTS
from olp.program.rs274.reader import read
from olp.trajectory.from_program import routes
from olp.trajectory.plan import Trajectory, plan
from olp.trajectory.route import AxisLimits, Route

pytestmark = [pytest.mark.oracle, pytest.mark.slow]

START = "start_mm = { X = 0.0, Y = 0.0, Z = 0.0 }"
JERK = 1e9
TICK_S = controller.PERIOD_NS * 1e-9


def random_moves(seed: int, count: int, reach: float, code: str = "G1") -> list[str]:
    """Moves in space and along axes, of several feeds; no one goes nowhere."""
    rng = np.random.default_rng(seed)
    moves = []
    for k in range(count):
        to = rng.uniform(-reach, reach, 3)
        if k % 3:
            to[rng.integers(3)] = 0.0
        feed = f" F{rng.choice([3000, 9000, 20000])}" if code == "G1" else ""
        moves.append(f"{code} X{to[0]:.3f} Y{to[1]:.3f} Z{to[2]:.3f}{feed}")
    return moves


def square() -> list[str]:
    return [f"G1 X{x} Y{y} F12000" for _ in range(3) for x, y in ((40, 0), (40, 40), (0, 40), (0, 0))]


def lobes() -> list[str]:
    """A dense contour."""
    angle = np.linspace(0.0, 2 * np.pi, 801)[1:]
    radius = 30 * (1 + 0.2 * np.cos(5 * angle))
    points = np.column_stack((radius * np.cos(angle) - 36, radius * np.sin(angle)))
    return [f"G1 X{x:.4f} Y{y:.4f} F6000" for x, y in points]


def circles() -> list[str]:
    return ["F6000", "G3 I10", "G3 I10", "G2 X20 I10", "G1 X40"]


def times(
    mode: str, moves: list[str], share: float, folder: Path, enough: Callable[[float], float]
) -> tuple[float, float, Trajectory, Route]:
    """Seconds of LinuxCNC from the first cycle that moves to the last, and ours with this share of its
    acceleration. On a busy machine its queue runs dry, which only adds time: where it takes longer than what
    is `enough` beside ours, it is asked again."""
    text = "\n".join([mode, *moves, "M2", ""]).encode()
    described = machine(folder / "machine", tables=TRUE_ZERO, job=START)
    setup = load_setup(described, described.with_name("job.toml"))
    (route,) = routes(read(text, setup, DIALECTS["linuxcnc"]))
    route = replace(route, feed_mm_s=np.minimum(route.feed_mm_s, controller.SPEED_MM_S))
    limits = AxisLimits(
        np.full(3, controller.SPEED_MM_S), np.full(3, share * controller.ACCELERATION_MM_S2), np.full(3, JERK)
    )
    trajectory = plan(route, limits)
    assert judge(trajectory.motion, route, limits).wrong == ()
    least = np.inf
    for attempt in range(3):
        run = controller.run(text, described, folder / f"control{attempt}")
        moving = np.flatnonzero((np.diff(run.axis, axis=0) != 0.0).any(axis=1))
        assert np.abs(run.axis[moving[-1] + 1] - route.point_mm[-1]).max() <= 0.05
        least = min(least, float(moving[-1] - moving[0] + 1) * TICK_S)
        if least <= enough(trajectory.duration_s):
            break
    return least, trajectory.duration_s, trajectory, route


EXACT: dict[str, tuple[str, float, Callable[[], list[str]]]] = {
    "in space": ("G61.1", 1.0, lambda: random_moves(7, 25, 25.0)),
    "short": ("G61.1", 1.0, lambda: random_moves(8, 150, 0.5)),
    "rapids": ("G61.1", 1.0, lambda: random_moves(9, 12, 200.0, "G0")),
    "corners of exact path": ("G61", 0.9, lambda: random_moves(10, 25, 25.0)),
}


@pytest.mark.parametrize("name", EXACT)
def test_exact_stops_take_the_time_that_they_take_linuxcnc(
    name: str, tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    controller.require()
    mode, share, moves = EXACT[name]
    rows = moves()
    theirs, ours, _, route = times(mode, rows, share, tmp_path, lambda ours: ours + len(rows) * TICK_S)
    count = len(route) - 1
    ticks = (theirs - ours) / TICK_S / count
    record_property("ticks a move", ticks)
    print(f"{name}: LinuxCNC {theirs:.3f} s, ours {ours:.4f} s, {ticks:+.2f} ticks a move")
    # it rounds up to its cycles, and never down
    assert -TICK_S <= theirs - ours <= (count + 1) * TICK_S


CONTINUOUS: dict[str, tuple[str, Callable[[], list[str]], float]] = {
    # half of the acceleration in each of two moves that blend in a parabola
    "square, 10 um": ("G64 P0.01 Q0", square, 0.94),
    # ours uses the tolerance on both sides of the corner and of the moves beside it
    "square, 0.5 mm": ("G64 P0.5 Q0", square, 0.84),
    # speed-limited on both sides; ours brakes where the curve needs it, once
    "contour, 10 um": ("G64 P0.01 Q0", lobes, 0.95),
    # sqrt(3)/2 of the acceleration is kept for the centre, 1/2 along the arc; ours shares as they are used
    "circles, 10 um": ("G64 P0.01 Q0", circles, 0.92),
    "circles, 0.1 mm": ("G64 P0.1 Q0", circles, 0.92),
}


@pytest.mark.parametrize("name", CONTINUOUS)
def test_continuous_programs_take_no_longer_and_little_less(
    name: str, tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    controller.require()
    mode, moves, least = CONTINUOUS[name]
    theirs, ours, trajectory, _ = times(mode, moves(), 1.0, tmp_path, lambda ours: ours / least)
    record_property("ours over LinuxCNC", ours / theirs)
    solvers = sorted({leg.solver for leg in trajectory.legs})
    print(f"{name}: LinuxCNC {theirs:.3f} s, ours {ours:.4f} s, {ours / theirs:.3f} of it by {solvers}")
    assert least * theirs <= ours <= theirs + TICK_S
