"""The planner over all solvers: limits, path, progress, and that it never fails on what is finite."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from cases.fast import some_of_a_campaign
from hypothesis import given, settings
from hypothesis import strategies as st

import olp
from olp.core.errors import CannotCompute
from olp.files import trajectory as files
from olp.trajectory import contest, solvers, stretches
from olp.trajectory.motion import Motion
from olp.trajectory.plan import Trajectory, plan
from olp.trajectory.route import AxisLimits, Route

LIMITS = AxisLimits(np.array([500.0, 400.0, 300.0]), np.array([5e3, 4e3, 3e3]), np.array([1e5, 8e4, 6e4]))
PROGRAMS = Path(__file__).resolve().parents[2] / "programs"
#: The others are judged in tests/workflows/test_retime_random_programs.py.
JOBS = ("haas-mill", "bridge-cmm")


def route_of(points: np.ndarray, feed: float = 100.0, tolerance: float = 0.01) -> Route:
    count = len(points)
    return Route(
        np.asarray(points, float), np.full(count - 1, feed), np.arange(1, count), np.full(count, tolerance),
        np.zeros(count),
    )  # fmt: skip


def assert_within(trajectory: Trajectory, limits: AxisLimits, feed: float = np.inf) -> None:
    """Sampled at 1 kHz and inside every piece, and by differences of the samples."""
    motion = trajectory.motion
    inside = (
        motion.start_s[:-1, None] + np.diff(motion.start_s)[:, None] * np.linspace(0.0, 1.0, 7)[1:-1]
    ).ravel()
    for times in (trajectory.sample_times(1e-3), inside):
        _, velocity, acceleration, jerk, _ = trajectory.at(times)
        assert (np.abs(velocity) <= limits.velocity * (1 + 1e-6)).all()
        assert (np.abs(acceleration) <= limits.acceleration * (1 + 1e-6)).all()
        assert (np.abs(jerk) <= limits.jerk * (1 + 1e-6)).all()
        assert (np.sqrt((velocity * velocity).sum(axis=1)) <= feed * (1 + 1e-6)).all()
    times = np.arange(0.0, trajectory.duration_s, 1e-3)
    position, velocity = trajectory.at(times)[:2]
    # positions are known to their last digits, times to theirs, in which the axis moves on
    noise = 4 * 2.0**-53 * (np.abs(position).max(axis=0) + 2 * (times[:, None] + 1e-3) * np.abs(velocity))
    for order, limit in enumerate((limits.velocity, limits.acceleration, limits.jerk), start=1):
        position = np.diff(position, axis=0)
        noise = noise[1:] + noise[:-1]
        assert (np.abs(position) <= limit * (1 + 1e-6) * 1e-3**order + noise).all()


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    count=st.integers(2, 20),
    scale=st.sampled_from([1e-3, 0.05, 1.0, 50.0]),
    pace=st.sampled_from([1.0, 30.0, 200.0, np.inf]),
    tolerance=st.sampled_from([0.0, 1e-3, 0.02, 1.0]),
)
def test_any_polyline_is_driven_within_all_limits(
    seed: int, count: int, scale: float, pace: float, tolerance: float
) -> None:
    # long moves at a feed that does not take them minutes of samples
    feed = pace * max(scale / 5.0, 1.0)
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.normal(size=(count, 3)) * scale * np.exp(rng.normal(size=(count, 1))), axis=0)
    route = route_of(points, feed, tolerance)
    trajectory = plan(route, LIMITS)
    assert_within(trajectory, LIMITS, feed)
    assert max(leg.deviation_mm for leg in trajectory.legs) <= tolerance * (1 + 1e-6) + 1e-9
    begin, end = trajectory.at(np.array([0.0, trajectory.duration_s]))[0]
    assert np.abs(begin - points[0]).max() <= 1e-9
    assert np.abs(end - points[-1]).max() <= 1e-9
    for state in trajectory.at(np.array([0.0, trajectory.duration_s]))[1:3]:
        assert np.abs(state).max() <= 1e-6


def test_lines_come_in_order() -> None:
    rng = np.random.default_rng(4)
    trajectory = plan(route_of(np.cumsum(rng.normal(size=(30, 3)), axis=0)), LIMITS)
    assert (np.diff(trajectory.motion.line) >= 0).all()
    assert set(trajectory.motion.line.tolist()) <= set(range(1, 30))


def test_dwells_are_waited_at_rest() -> None:
    points = np.array([[0.0, 0, 0], [10.0, 0, 0], [20.0, 0, 0]])
    route = route_of(points)
    waiting = replace(route, dwell_s=np.array([0.5, 1.25, 0.25]))
    stopped = replace(route, tolerance_mm=np.zeros(3))
    assert plan(waiting, LIMITS).duration_s == pytest.approx(plan(stopped, LIMITS).duration_s + 2.0)


def test_a_solver_that_fails_leaves_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    route = route_of(np.cumsum(np.random.default_rng(1).normal(size=(20, 3)), axis=0))

    def broken(*args: object) -> None:
        raise ValueError("no")

    bent = {solvers.CRITICAL, solvers.OPTIMISED}
    for module, name, remaining in (
        (solvers, "smooth", {solvers.OVERLAP}),
        (solvers, "best_profile", {solvers.OVERLAP}),
        (contest, "optimised", {solvers.OVERLAP, solvers.CRITICAL}),
        (solvers, "overlap", bent),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(module, name, broken)
            assert {leg.solver for leg in plan(route, LIMITS, tubes=False).legs} <= remaining


def test_a_search_in_a_tube_that_finds_nothing_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> Motion:
        raise CannotCompute("the run is too long")

    monkeypatch.setattr(contest, "in_tube", fails)
    trajectory = plan(route_of(np.array([[0, 0, 0], [9, 0, 0], [9, 9, 0.0]])), LIMITS)
    assert [leg.not_faster for leg in trajectory.legs] == ["the run is too long"]


def test_a_route_that_no_solver_drives_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*args: object) -> None:
        raise ValueError("no")

    monkeypatch.setattr(solvers, "smooth", broken)
    monkeypatch.setattr(solvers, "overlap", broken)
    with pytest.raises(CannotCompute, match="no solver found") as caught:
        plan(route_of(np.array([[0.0, 0, 0], [10.0, 0, 0], [20.0, 0, 0]])), LIMITS)
    assert caught.value.line == 1


def arcs(count: int, seed: int = 0) -> Route:
    """Runs of few segments between stops, some with dwells: arcs, corners and lines."""
    rng = np.random.default_rng(seed)
    angle = np.linspace(0.0, np.pi / 2, 21)
    arc = 5.0 * np.stack((np.sin(angle), 1.0 - np.cos(angle), 0.0 * angle), axis=1)[1:]
    kinds = (arc, np.array([[3.0, 0, 0], [3.0, 3, 0], [6.0, 3, 1]]), np.array([[2.0, 1, 0]]))
    points, stops = [np.zeros((1, 3))], [0]
    for kind in rng.integers(0, 3, count).tolist():
        points.append(points[-1][-1] + kinds[kind])
        stops.append(stops[-1] + len(kinds[kind]))
    route = route_of(np.concatenate(points))
    route.tolerance_mm[stops] = 0.0
    route.dwell_s[stops] = rng.choice([0.0, 0.0, 0.25], count + 1)
    return route


def test_short_runs_are_planned_together_as_well_as_one_by_one() -> None:
    route = arcs(40)
    trajectory = plan(route, LIMITS, optimise=False)
    assert_within(trajectory, LIMITS, 100.0)
    stops = np.flatnonzero(route.tolerance_mm == 0.0)
    alone = 0.0
    for a, b in pairwise(stops.tolist()):
        run = route_of(route.point_mm[a : b + 1])
        alone += plan(run, LIMITS, optimise=False).duration_s
    assert trajectory.duration_s == pytest.approx(alone + route.dwell_s.sum(), rel=1e-6)
    assert sum(leg.duration_s for leg in trajectory.legs) == pytest.approx(trajectory.duration_s)
    assert [leg.first for leg in trajectory.legs] == [0, *(leg.last for leg in trajectory.legs[:-1])]
    assert {leg.solver for leg in trajectory.legs} == {solvers.OVERLAP, solvers.CRITICAL}
    assert max(trajectory.audit.position_jump_mm, trajectory.audit.velocity_jump_mm_s) <= 1e-8
    # every stop is met at rest, for as long as it dwells
    at_rest = np.abs(
        trajectory.motion.of(np.arange(len(trajectory.motion)), np.zeros(len(trajectory.motion)))[1]
    ).max(axis=1)
    still = trajectory.motion.of(np.flatnonzero(at_rest <= 1e-9), np.zeros(int((at_rest <= 1e-9).sum())))[0]
    away = np.linalg.norm(still[:, None] - route.point_mm[stops[:-1]][None], axis=2).min(axis=0)
    assert away.max() <= 1e-9
    waits = np.diff(trajectory.motion.start_s)[~trajectory.motion.time.any(axis=1)]
    assert waits.sum() == pytest.approx(route.dwell_s.sum())


@pytest.mark.slow
def test_blocks_and_groups_make_no_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    route = arcs(30, seed=3)
    whole = plan(route, LIMITS, optimise=False)
    monkeypatch.setattr(stretches, "_BLOCK", 7)
    monkeypatch.setattr(stretches, "_TOGETHER", 11)
    monkeypatch.setattr("olp.trajectory.pieces._BLOCK", 5)
    split = plan(route, LIMITS, optimise=False)
    assert len(split.legs) > len(whole.legs)
    assert split.duration_s == pytest.approx(whole.duration_s, rel=1e-9)


@pytest.mark.parametrize("what", ["point_mm", "tolerance_mm", "dwell_s", "feed_mm_s"])
def test_what_is_not_finite_is_refused(what: str) -> None:
    route = route_of(np.array([[0.0, 0, 0], [10.0, 0, 0], [20.0, 0, 0]]))
    values = getattr(route, what).copy()
    values[1] = np.nan
    with pytest.raises(CannotCompute):
        plan(replace(route, **{what: values}), LIMITS)


@pytest.mark.slow
@pytest.mark.parametrize("job", some_of_a_campaign(JOBS, 2))
def test_shipped_jobs(job: str) -> None:
    folder = PROGRAMS / job
    stated = olp.load_setup(folder / "machine.toml", folder / "job.toml").job
    assert stated.program is not None
    retimed = olp.retime(stated.program, folder / "machine.toml", folder / "job.toml")
    assert retimed.duration_s > 10.0
    for trajectory in retimed.trajectories:
        assert_within(trajectory, trajectory.limits)
        assert all(leg.factor < 1.01 for leg in trajectory.legs)
        assert max(leg.deviation_mm for leg in trajectory.legs) <= 0.1


# -- files ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def corner() -> Trajectory:
    return plan(route_of(np.array([[0.0, 0, 0], [3.0, 0, 0], [3.0, 2.0, 1.0]])), LIMITS)


def test_csv_gives_every_digit_back(corner: Trajectory) -> None:
    table = np.loadtxt(io.BytesIO(b"".join(files.csv(corner, 1e-3))), delimiter=",", skiprows=1)
    position, velocity, acceleration, _, line = corner.at(corner.sample_times(1e-3))
    assert (table[:, 0] == corner.sample_times(1e-3)).all()
    assert (table[:, 1:4] == position).all()
    assert (table[:, 4:7] == velocity).all()
    assert (table[:, 7:10] == acceleration).all()
    assert (table[:, 10] == line).all()


def test_npz_holds_samples_and_pieces(corner: Trajectory) -> None:
    with np.load(io.BytesIO(b"".join(files.npz(corner, 1e-3)))) as table:
        assert (table["position_mm"] == corner.at(table["t_s"])[0]).all()
        assert (table["piece_start_s"] == corner.motion.start_s).all()


def test_ros_is_in_metres(corner: Trajectory) -> None:
    data = json.loads(b"".join(files.ros(corner, 1e-3)))
    assert data["joint_names"] == ["X", "Y", "Z"]
    end = data["points"][-1]
    assert end["positions"] == pytest.approx([3e-3, 2e-3, 1e-3])
    stamp = end["time_from_start"]
    assert stamp["sec"] + stamp["nanosec"] * 1e-9 == pytest.approx(corner.duration_s, abs=1e-9)


def test_pvt_times_add_up(corner: Trajectory) -> None:
    table = np.loadtxt(io.BytesIO(b"".join(files.pvt(corner, 2e-3))), delimiter=",", skiprows=1)
    assert table[:, 0].sum() == pytest.approx(corner.duration_s)
    assert table[-1, [1, 3, 5]] == pytest.approx([3.0, 2.0, 1.0])
