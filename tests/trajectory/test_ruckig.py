"""Laws of single moves: Ruckig's answers and the closed form agree, nothing turns back, no network."""

from __future__ import annotations

import socket

import numpy as np
import pytest
from cases.fast import some_of_a_campaign
from hypothesis import given, settings
from hypothesis import strategies as st

from olp.core.errors import CannotCompute, UsageError
from olp.trajectory import ruckig_moves
from olp.trajectory.ruckig_moves import solve, solve_all
from olp.trajectory.scurve import rest_to_rest_s, states, through_peak


def powers(low: float, high: float):
    return st.floats(np.log10(low), np.log10(high)).map(lambda x: 10.0**x)


@st.composite
def moves(draw):
    """States that lie on ramps of the move, as overlaps make them."""
    length, speed = draw(powers(1e-9, 1e4)), draw(powers(1e-5, 1e4))
    acceleration, jerk = draw(powers(1.0, 1e5)), draw(powers(10.0, 1e9))
    phase = min(acceleration / jerk, np.sqrt(speed / jerk), np.cbrt(length / (2 * jerk)))
    ends = []
    for _ in range(2):
        share = draw(st.floats(0.5, 1.0))
        time = draw(st.sampled_from([0.0, 1e-6, 0.3, 0.98])) * phase / np.sqrt(share)
        rate = share * jerk
        ends.append((rate * time**3 / 6, rate * time * time / 2, rate * time))
    (d0, v0, a0), (d1, v1, a1) = ends
    return length - d0 - d1, v0, a0, v1, -a1, speed, acceleration, jerk


def check(case, duration, jerk):
    length, v0, a0, v1, a1, speed, acceleration, most = case
    position, velocity, rate = 0.0, v0, a0
    # a sum from one end lets rounding of the acceleration grow with time
    grown = 1e-14 * acceleration * sum(duration)
    for t, j in zip(duration, jerk, strict=True):
        assert t > 0.0 and abs(j) <= most * (1 + 1e-9)
        for u in np.linspace(0.0, t, 9):
            v = velocity + u * (rate + u * j / 2)
            assert -1e-8 * max(v0, v1, length / sum(duration)) - grown <= v <= speed * (1 + 1e-6) + grown
            assert abs(rate + u * j) <= acceleration * (1 + 1e-6)
        position += t * (velocity + t * (rate / 2 + t * j / 6))
        velocity += t * (rate + t * j / 2)
        rate += t * j
    total = sum(duration)
    assert abs(position - length) <= 1e-9 * length + grown * total
    assert abs(velocity - v1) <= 1e-9 * speed + grown
    assert abs(rate - a1) <= 1e-8 * min(acceleration, most * total)


@pytest.mark.slow
@settings(deadline=None, max_examples=300)
@given(moves())
def test_a_move_ends_at_its_target_inside_its_limits(case):
    check(case, *solve(*case))


@pytest.mark.slow
@settings(deadline=None, max_examples=200)
@given(moves())
def test_the_closed_form_is_as_fast_as_ruckig(case):
    arrays = [np.array([x]) for x in case]
    own, _, exists = through_peak(*arrays)
    assert exists[0]
    duration, _ = solve(*case)
    assert own.sum() == pytest.approx(duration.sum(), rel=1e-6)


@settings(deadline=None, max_examples=200)
@given(powers(1e-9, 1e4), powers(1e-5, 1e4), powers(1.0, 1e5), powers(10.0, 1e9))
def test_rest_to_rest_takes_the_time_of_the_closed_form(length, speed, acceleration, jerk):
    duration, _ = solve(length, 0.0, 0.0, 0.0, 0.0, speed, acceleration, jerk)
    expected = rest_to_rest_s(*(np.array([x]) for x in (length, speed, acceleration, jerk)))[0]
    assert duration.sum() == pytest.approx(expected, rel=1e-6)


def test_states_meet_start_and_target():
    case = (402.869, 0.26, 60.0, 0.1, -20.0, 2.096, 3427.0, 31846.0)
    arrays = [np.array([x]) for x in case]
    moves = solve_all(*arrays)
    state = states(moves.duration_s, moves.jerk, *arrays[:5])
    assert state.missing.max() < 1e-12
    assert not moves.replaced.any()


def test_target_speed_that_is_just_out_of_reach():
    """Ruckig drives back here: 18 times the time, speeds below zero."""
    acceleration, jerk, v0 = 5000.0, 1e5, 10.0
    time = 0.02
    v1 = v0 + jerk * time * time
    length = (v0 + v1) / 2 * 2 * time
    for wrong in (0.0, 1e-15, 1e-14, -1e-14):
        duration, jerks = solve(length, v0, 0.0, v1 * (1 + wrong), 0.0, 500.0, acceleration, jerk)
        assert duration.sum() <= 2 * time * (1 + 1e-3)
        assert np.all(v0 + np.cumsum(duration * jerks) >= 0)


def test_speed_at_its_limit_from_the_start():
    duration, _ = solve(100.0, 500.0, 0.0, 500.0, 0.0, 500.0, 5000.0, 1e5)
    assert duration.sum() == pytest.approx(0.2)


class Raises(ruckig_moves.ruckig.Ruckig):
    def calculate(self, *_):
        raise ruckig_moves.ruckig.RuckigError("no")


class LoopsBack(ruckig_moves.ruckig.Ruckig):
    """Answers another question: one with an end speed that needs a run-up."""

    def calculate(self, ask, result):
        ask.target_velocity = [min(ask.max_velocity[0] * 0.9, ask.target_velocity[0] + 0.1)]
        return super().calculate(ask, result)


class Refuses(ruckig_moves.ruckig.Ruckig):
    def calculate(self, *_):
        return ruckig_moves.ruckig.Result.ErrorSynchronizationCalculation


@pytest.mark.slow
@pytest.mark.parametrize("broken", some_of_a_campaign([Raises, LoopsBack, Refuses], 3))
@settings(deadline=None, max_examples=50)
@given(case=moves())
def test_a_broken_ruckig_is_replaced(broken, case):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ruckig_moves.ruckig, "Ruckig", broken)
        check(case, *solve(*case))
        solved = solve_all(*(np.array([x]) for x in case))
        assert broken is LoopsBack or solved.replaced.all()


def test_no_socket_and_no_waypoints(monkeypatch):
    """Ruckig sends waypoints to a server: nothing may ever set them."""

    def refuse(*_, **__):
        raise AssertionError("a socket was opened")

    class Watched(ruckig_moves.ruckig.InputParameter):
        def __setattr__(self, name, value):
            assert "intermediate" not in name and "section" not in name
            super().__setattr__(name, value)

    monkeypatch.setattr(socket, "socket", refuse)
    monkeypatch.setattr(ruckig_moves.ruckig, "InputParameter", Watched)
    duration, _ = solve(10.0, 0.0, 0.0, 0.0, 0.0, 100.0, 1000.0, 1e4)
    assert duration.sum() > 0.0


def test_a_start_that_brakes_and_an_end_that_speeds_up():
    case = (50.0, 100.0, -200.0, 80.0, 300.0, 200.0, 2000.0, 1e5)
    check(case, *solve(*case))
    arrays = [np.array([x]) for x in case]
    own, jerk, exists = through_peak(*arrays)
    assert exists[0]
    used = own[0] > 0
    check(case, own[0][used], jerk[0][used])


def test_a_target_out_of_reach_is_refused():
    # from 100 mm/s nothing stops within a micrometre
    with pytest.raises(CannotCompute, match="no move over"):
        solve(1e-3, 100.0, 0.0, 0.0, 0.0, 200.0, 1000.0, 1e4)


@pytest.mark.parametrize(
    ("index", "value"),
    [(0, 0.0), (0, np.nan), (0, -1.0), (1, -1.0), (1, 300.0), (2, 2e3), (3, np.nan), (5, np.inf), (6, 0.0)],
)
def test_no_move(index, value):
    case = [10.0, 0.0, 0.0, 0.0, 0.0, 200.0, 1000.0, 1e4]
    case[index] = value
    with pytest.raises(UsageError):
        solve(*case)
