"""Ramps that take up backlash, worked by hand, and judged by a play that is simulated step by step.

The numerical tolerance is 1 um: at the turn the load may be off by 0.2 um, and behind it by 0.6 um.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from cases.toy import Move, Toy, arc, constant_backlash, feed, rapid, toolpath

from olp.compensation.plan import Limits, Plan
from olp.compensation.planning import plan
from olp.core.toolpath import Flag

#: Y has 12 um, so its drive leads by 6 um
PLAY = Toy(backlash=constant_backlash(0.0, 0.012, 0.0))
LIMITS = Limits(0.001)
#: up by 0.1 mm on 10 mm, and down again
UP, DOWN = feed(10.0, 0.1, 0.0), feed(20.0, 0.0, 0.0)


def planned(*moves: Move, model: Toy = PLAY, limits: Limits = LIMITS) -> Plan:
    return plan(toolpath(rapid(0.0, 0.0, 0.0), *moves), model, limits)


def test_a_shallow_turn_is_a_ramp_by_hand() -> None:
    """Of 100 um in 10 mm, 0.2 um are 20 um of the path, and 0.6 um are 60 um. The drive crosses 12 um on
    these 80 um; at the turn 2 / 8 of them are done."""
    rows = planned(UP, DOWN)
    assert not rows.take_up.any()
    assert rows.move.tolist() == [0, 0, 1, 1, 2, 2]
    size = math.hypot(10.0, 0.1)
    slope = 0.1 / size
    near, far = 0.0002 / slope / size, 0.0006 / slope / size
    assert rows.reach.tolist()[2:] == pytest.approx([1.0 - near, 1.0, far, 1.0])
    lead = [0.006, 0.006 - 0.012 * 2 / 8, -0.006, -0.006]
    nominal = [0.1 - 0.0002, 0.1, 0.1 - 0.0006, 0.0]
    assert rows.command_mm[2:, 1].tolist() == pytest.approx(
        [a + b for a, b in zip(nominal, lead, strict=True)]
    )
    assert rows.command_mm[2:, 0].tolist() == pytest.approx([10 - 10 * near, 10.0, 10 + 10 * far, 20.0])


@pytest.mark.parametrize(("x_mm", "ramp_mm"), [(0.3, 0.1), (90.0, 20 * 0.012)])
def test_where_the_load_rests_a_ramp_takes_a_third_of_a_move_or_twenty_times_its_backlash(
    x_mm: float, ramp_mm: float
) -> None:
    """Along X alone before the turn, and straight down behind it."""
    rows = planned(UP, feed(10.0 + x_mm, 0.1, 0.0), feed(10.0 + x_mm, -5.0, 0.0))
    assert not rows.take_up.any()
    begin = int(np.flatnonzero(rows.move == 2)[0])
    assert 10.0 + x_mm - rows.command_mm[begin, 0] == pytest.approx(ramp_mm)


@pytest.mark.parametrize(
    ("moves", "limits"),
    [
        # back on itself, and at a steep corner: there is no way to go on
        ([feed(0.0, 10.0, 0.0), feed(0.0, 0.0, 0.0)], LIMITS),
        ([feed(10.0, 10.0, 0.0), feed(20.0, 0.0, 0.0)], LIMITS),
        # what comes before is no cut
        ([UP, rapid(10.0, 0.1, 5.0), rapid(10.0, 0.1, 0.0), DOWN], LIMITS),
        # moves that are never split
        ([UP, feed(20.0, 0.0, 0.0, flag=Flag.WHOLE)], LIMITS),
        ([feed(10.0, 0.1, 0.0, flag=Flag.WHOLE), DOWN], LIMITS),
        # an arc
        ([UP, arc(10.0, -20.0, 0.0, centre=(10.0, -9.95, 0.0), degrees=-180.0)], LIMITS),
        # a ramp that the last digit cannot write
        ([UP, DOWN], Limits(0.001, digit_mm=0.05)),
    ],
)
def test_a_step_stays_where_there_is_no_room(moves: list[Move], limits: Limits) -> None:
    rows = planned(*moves, limits=limits)
    assert rows.take_up.sum() == 1
    assert rows.move[rows.take_up].tolist() == [len(moves)]


def test_a_step_that_controls_round_off_stays() -> None:
    """10 um is what they do where a program states nothing."""
    for width, steps in ((0.0099, 1), (0.0101, 0)):
        model = Toy(backlash=constant_backlash(0.0, width, 0.0))
        assert planned(UP, DOWN, model=model).take_up.sum() == steps


def loads_off_mm(rows: Plan, nominal: np.ndarray, backlash: np.ndarray, behind: int = 3) -> float:
    """The largest distance of the load from the nominal move that each command belongs to, every 2 um, of
    moves `behind` one; the drive pushes the load where it meets it."""
    load, worst = rows.command_mm[0].copy(), 0.0
    for k in range(1, len(rows)):
        a, b = rows.command_mm[k - 1], rows.command_mm[k]
        begin, end = nominal[rows.move[k]], nominal[rows.move[k] + 1]
        way = end - begin
        points = np.linspace(a, b, max(math.ceil(float(np.linalg.norm(b - a)) / 0.002), 2))
        track = np.empty_like(points)
        for i, point in enumerate(points):
            load = np.clip(load, point - backlash / 2, point + backlash / 2)
            track[i] = load
        if rows.move[k] > behind:
            share = np.clip((track - begin) @ way / max(way @ way, 1e-30), 0.0, 1.0)
            worst = max(worst, float(np.linalg.norm(track - begin - share[:, None] * way, axis=1).max()))
    return worst


def test_two_axes_that_turn_together_are_off_by_the_length_of_both() -> None:
    """Up on a steep line, X and Y turn round, and go on together."""
    model = Toy(backlash=constant_backlash(0.012, 0.012, 0.0))
    start, top, end = (10.0, 10.0, 0.0), (10.002, 10.002, 5.0), (9.4, 9.4, 15.0)
    rows = planned(feed(*start), feed(*top), feed(*end), model=model)
    assert not rows.take_up[-2:].any() and (rows.move == 3).sum() == 2
    nominal = np.array([[0.0] * 3, [0.0] * 3, start, top, end])
    assert loads_off_mm(rows, nominal, np.array([0.012, 0.012, 0.0]), 2) <= 0.00062


def test_at_a_line_between_the_machine_may_rest() -> None:
    """M0, say: the drive does not stand amid its backlash then."""
    path = toolpath(rapid(0.0, 0.0, 0.0), UP, DOWN)
    path.line[2:] += 1
    rows = plan(path, PLAY, LIMITS)
    assert rows.take_up.sum() == 1


@pytest.mark.parametrize("seed", range(4))
def test_the_load_keeps_to_the_path_within_the_tolerance(seed: int) -> None:
    """Moves of all slopes in X and Y, which both have backlash, and of lengths from 30 um to 2 mm."""
    rng = np.random.default_rng(seed)
    length, slope = (
        10 ** rng.uniform(-1.5, 0.3, 40),
        10 ** rng.uniform(-4.0, 0.5, 40) * rng.choice([-1.0, 1.0], 40),
    )
    angle = np.arctan(slope)
    steps = np.column_stack((length * np.cos(angle), length * np.sin(angle), 0 * angle))
    points = np.cumsum(np.vstack(([1.5, 1.5, 0.0], steps)), axis=0)
    moves = [feed(1.0, 0.0, 0.0), feed(1.0, 1.0, 0.0), *(feed(*p) for p in points)]
    model = Toy(backlash=constant_backlash(0.012, 0.019, 0.0))
    rows = planned(*moves, model=model)
    nominal = np.array([[0.0] * 3, [0.0] * 3, *(move.end_mm for move in moves)])
    assert rows.take_up.any() and (rows.reach < 1.0)[~rows.take_up][2:].any()
    assert loads_off_mm(rows, nominal, np.array([0.012, 0.019, 0.0])) <= 0.00095
