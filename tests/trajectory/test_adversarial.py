"""Routes made to break a planner, and a broken Ruckig: an independent judge checks every motion against all
its limits."""

from __future__ import annotations

import os
import re
import shutil
import socket
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import pairwise, product
from pathlib import Path

import numpy as np
import pytest
import ruckig
from cases.fast import left_to_a_campaign
from cases.trajectory import CASES, LIMITS, route
from judge.retiming import Verdict, judge

from olp.core.errors import CannotCompute
from olp.trajectory import ruckig_moves
from olp.trajectory.plan import Trajectory, plan
from olp.trajectory.route import AxisLimits, Route

SOURCE = Path(__file__).resolve().parents[2] / "olp"
Case = tuple[Route, AxisLimits]


def held(given: Route, limits: AxisLimits = LIMITS) -> tuple[Trajectory, Verdict]:
    """The plan of a route, which keeps everything that it has to."""
    trajectory = plan(given, limits)
    verdict = judge(trajectory.motion, given, limits)
    assert verdict.wrong == ()
    return trajectory, verdict


def points(*rows: tuple[float, float, float]) -> np.ndarray:
    return np.array(rows, float)


def with_feeds(given: Route, *feeds: float) -> Route:
    return replace(given, feed_mm_s=np.resize(np.array(feeds), len(given) - 1))


def with_tolerances(given: Route, *tolerances: float) -> Route:
    band = np.resize(np.array(tolerances), len(given))
    band[[0, -1]] = 0.0
    return replace(given, tolerance_mm=band)


def faster(**factors: float) -> AxisLimits:
    return replace(LIMITS, **{name: getattr(LIMITS, name) * factor for name, factor in factors.items()})


def flat(scale: float = 1.0, count: int = 60, seed: int = 5) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.vstack((np.zeros(3), np.cumsum(rng.normal(size=(count, 3)) * scale, axis=0)))


def ring(radius: float, count: int, turns: int = 1) -> np.ndarray:
    angle = np.linspace(0.0, 2 * np.pi * turns, count * turns + 1)
    return np.column_stack((radius * np.cos(angle), radius * np.sin(angle), 0.0 * angle))


def beside_ten_metres(low: float, high: float, seed: int = 2) -> np.ndarray:
    """Segments of lengths from `low` to `high` mm in all directions, between two lines of 10 m."""
    rng = np.random.default_rng(seed)
    step = rng.normal(size=(200, 3))
    step *= (10.0 ** rng.uniform(np.log10(low), np.log10(high), 200) / np.linalg.norm(step, axis=1))[:, None]
    middle = np.array([10_000.0, 0.0, 0.0]) + np.cumsum(step, axis=0)
    return np.vstack((np.zeros(3), middle, middle[-1] + [0.0, 10_000.0, 0.0]))


def turned(degrees: float) -> np.ndarray:
    angle = np.radians(degrees)
    return points((0, 0, 0), (20, 0, 0), (20 + 20 * np.cos(angle), 20 * np.sin(angle), 0), (0, 60, 5))


SLOW_Y = AxisLimits(*(np.array([1.0, 0.01, 1.0]) * e for e in (500.0, 5e3, 1e5)))

OWN: dict[str, Callable[[], Case]] = {
    "two points": lambda: (route(points((1, 2, 3), (1, 2, 3 + 1e-6)), 1.0, 0.0), LIMITS),
    "1e-9 to 1e-6 mm beside 10 m": lambda: (route(beside_ten_metres(1e-9, 1e-6), 400.0, 0.01), LIMITS),
    "1e-6 to 1e-3 mm beside 10 m": lambda: (route(beside_ten_metres(1e-6, 1e-3), 400.0, 0.01), LIMITS),
    "tiny segments, rapids": lambda: (route(beside_ten_metres(1e-9, 1e-2), np.inf, 1e-4), LIMITS),
    "all points stops": lambda: (route(flat(), 100.0, 0.0), LIMITS),
    "tiny stops": lambda: (route(flat(1e-6), 100.0, 0.0), LIMITS),
    "stops and blends": lambda: (with_tolerances(route(flat(count=12), 100.0, 0.0), 0.0, 0.02, 0.5), LIMITS),
    "fine beside coarse tolerance": lambda: (
        with_tolerances(route(flat(0.3), 100.0, 0.0), 1e-5, 5.0),
        LIMITS,
    ),
    "tolerance above everything": lambda: (route(flat(0.5), 200.0, 1e3), LIMITS),
    "back and forth on a line": lambda: (route(points((0, 0, 0), (10, 0, 0))[[0, 1] * 8], 80.0, 0.1), LIMITS),
    "back and forth, feeds": lambda: (
        with_feeds(route(points((0, 0, 0), (9, 3, 1))[[0, 1] * 6], 80.0, 0.1), 1.0, 300.0),
        LIMITS,
    ),
    **{
        f"turned by {d} degrees": (lambda d=d: (route(turned(d), 100.0, 0.05), LIMITS))
        for d in (90.0, 179.0, 179.9, 179.99, 179.999999, 180.0)
    },
    "feed steps up": lambda: (
        replace(
            route(np.linspace(0, 1, 30)[:, None] * [300.0, 30, 1], 1.0, 0.01),
            feed_mm_s=10.0 ** np.linspace(-2, 3, 29),
        ),
        LIMITS,
    ),
    "feed steps down": lambda: (
        replace(
            route(np.linspace(0, 1, 30)[:, None] * [300.0, 30, 1], 1.0, 0.01),
            feed_mm_s=10.0 ** np.linspace(3, -2, 29),
        ),
        LIMITS,
    ),
    "feed steps in tiny parts": lambda: (
        with_feeds(route(np.linspace(0, 1, 400)[:, None] * [0.4, 0.1, 0], 1.0, 0.01), 3.0, 200.0, 0.1),
        LIMITS,
    ),
    "feeds alternate on a circle": lambda: (with_feeds(route(ring(20, 300), 1.0, 0.01), 150.0, 40.0), LIMITS),
    "feed changes once on a circle": lambda: (
        with_feeds(route(ring(20, 300), 1.0, 0.01), *[200.0] * 150, *[20.0] * 150),
        LIMITS,
    ),
    "F 1e-5": lambda: (route(flat(1e-3, 10), 1e-5, 1e-4), LIMITS),
    "F 1e-5 over a corner of metres": lambda: (
        route(points((0, 0, 0), (9, 0, 0), (9, 9, 0)), 1e-5, 0.01),
        LIMITS,
    ),
    "F above all speeds": lambda: (route(flat(20.0, 20), 1e6, 0.05), LIMITS),
    "10 m at 0.1 mm/s": lambda: (route(points((0, 0, 0), (10_000, 0, 0)), 0.1, 0.0), LIMITS),
    "spike of rapids": lambda: (
        route(np.insert(ring(3, 100), 50, [1000.0, 900, 800], axis=0), np.inf, 0.02),
        LIMITS,
    ),
    "starts inside a blend": lambda: (
        route(points((0, 0, 0), (1e-3, 0, 0), (1e-3, 50, 0)), 100.0, 1.0),
        LIMITS,
    ),
    "ends inside a blend": lambda: (route(points((0, 0, 0), (0, 50, 0), (1e-3, 50, 0)), 100.0, 1.0), LIMITS),
    "both": lambda: (
        route(points((0, 0, 0), (0, 0.01, 0), (0.01, 0.01, 0), (0.01, 0, 0.01)), 100.0, 1.0),
        LIMITS,
    ),
    "corners beside stops": lambda: (with_tolerances(route(flat(0.01), 100.0, 0.0), *[0.2] * 5, 0.0), LIMITS),
    "jerk of 10": lambda: (route(flat(5.0, 20), 100.0, 0.05), replace(LIMITS, jerk=np.full(3, 10.0))),
    "jerk of 10, tiny segments": lambda: (
        route(flat(1e-4), 100.0, 0.05),
        replace(LIMITS, jerk=np.full(3, 10.0)),
    ),
    "jerk of 1e9": lambda: (route(flat(5.0), 100.0, 0.05), replace(LIMITS, jerk=np.full(3, 1e9))),
    "jerk of 1e9, dense": lambda: (
        route(ring(20, 2000), 200.0, 0.005),
        replace(LIMITS, jerk=np.full(3, 1e9)),
    ),
    "acceleration of 1": lambda: (route(flat(5.0, 10), 100.0, 0.05), faster(acceleration=2e-4)),
    "one axis 100 times slower": lambda: (route(flat(3.0), 100.0, 0.02), SLOW_Y),
    "a circle with one axis slow": lambda: (route(ring(20, 400), 100.0, 0.01), SLOW_Y),
    "along the slow axis and across": lambda: (
        route(points((0, 0, 0), (0, 9, 0), (9, 9, 0), (9, 9 + 1e-9, 0), (9, 20, 9)), 100.0, 0.02),
        SLOW_Y,
    ),
    "ten rounds": lambda: (route(ring(2, 60, 10), 100.0, 0.01), LIMITS),
    "a closed triangle": lambda: (route(ring(10, 3, 4), np.inf, 0.2), LIMITS),
    "a helix": lambda: (
        route(ring(5, 60) + np.linspace(0, 3, 61)[:, None] * [0, 0, 1], 150.0, 0.005),
        LIMITS,
    ),
    "speed at the ceiling all along": lambda: (
        route(np.arange(200.0)[:, None] * [5.0, 0, 0], 500.0, 0.01),
        LIMITS,
    ),
    "far from zero": lambda: (route(flat(0.5, 12) + 1e5, 100.0, 0.01), LIMITS),
    "dwells everywhere": lambda: (
        replace(route(flat(1.0, 12), 100.0, 0.01), dwell_s=np.resize([0.0, 0.25, 1e-4, 30.0], 13)),
        LIMITS,
    ),
}


#: Motions of minutes, whose speeds take long to be optimised: test_optimise.py judges them too.
LONG = ("gentle jerk", "one axis slow", "fine circle")


@pytest.mark.slow
@pytest.mark.parametrize("name", left_to_a_campaign((*CASES, *OWN), LONG))
def test_every_limit_is_kept(name: str) -> None:
    held(*(CASES[name] if name in CASES else OWN[name])())


@pytest.mark.parametrize("decade", range(-5, 5))
def test_feeds_of_all_sizes(decade: int) -> None:
    trajectory, verdict = held(route(flat(10.0 ** min(decade, 1), 12), 10.0**decade, 0.01))
    assert trajectory.duration_s > 0.0
    assert verdict.feed <= 1 + 1e-6


@pytest.mark.slow
def test_forty_thousand_points() -> None:
    angle = np.linspace(0.0, 250 * np.pi, 40_001)
    curve = np.column_stack((angle * np.cos(angle), angle * np.sin(angle), np.sin(angle))) * 0.05
    given = route(np.round(curve, 3), 150.0, 0.005)
    trajectory = plan(given, LIMITS)
    audit = trajectory.audit
    assert max(audit.velocity.max(), audit.acceleration.max(), audit.jerk.max()) <= 1 + 1e-6
    assert max(leg.deviation_mm for leg in trajectory.legs) <= 0.005 * (1 + 1e-6)


def test_one_point_and_points_that_are_one_are_rests() -> None:
    for count in (1, 2, 5):
        given = replace(route(np.full((count, 3), 7.0), 10.0, 0.0), dwell_s=np.full(count, 0.25))
        trajectory = plan(given, LIMITS)
        assert trajectory.duration_s == pytest.approx(0.25 * count)
        assert (trajectory.at(np.linspace(0.0, trajectory.duration_s, 9))[0] == 7.0).all()


def test_nothing_to_drive_takes_no_time() -> None:
    assert plan(route(np.full((3, 3), 1.0), 10.0, 0.1), LIMITS).duration_s == 0.0


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("what", ["point_mm", "tolerance_mm", "dwell_s", "feed_mm_s"])
@pytest.mark.parametrize("row", [0, 1, -1])
def test_what_is_no_number_is_refused(what: str, value: float, row: int) -> None:
    given = route(flat(1.0, 4), 10.0, 0.01)
    values = getattr(given, what).copy()
    values[row] = value
    if what == "feed_mm_s" and value == np.inf:
        held(replace(given, feed_mm_s=values))
        return
    with pytest.raises(CannotCompute):
        plan(replace(given, **{what: values}), LIMITS)


@pytest.mark.parametrize("value", [np.nan, np.inf, 0.0, -1.0])
@pytest.mark.parametrize("what", AxisLimits.__slots__)
def test_limits_that_are_none_are_refused(what: str, value: float) -> None:
    limits = replace(LIMITS, **{what: np.array([100.0, value, 100.0])})
    with pytest.raises(CannotCompute):
        plan(route(flat(1.0, 4), 10.0, 0.01), limits)


@pytest.mark.parametrize("value", [0.0, -1.0])
def test_feeds_that_never_end_are_refused(value: float) -> None:
    with pytest.raises(CannotCompute):
        plan(with_feeds(route(flat(1.0, 4), 10.0, 0.01), 5.0, value), LIMITS)


# -- states that can be reached, and no more ---------------------------------------------------------------


@pytest.mark.parametrize("off", [-1e-12, -1e-15, 0.0, 1e-15, 1e-14, 1e-13])
@pytest.mark.parametrize("length", [1e-6, 1e-2, 3.0])
def test_a_speed_that_is_just_reached(off: float, length: float) -> None:
    """From rest with jerk up and down for t each, the speed is J t^2 after a length of J t^3."""
    jerk = 1e5
    t = (length / jerk) ** (1 / 3)
    duration, rates = ruckig_moves.solve(length, 0.0, 0.0, jerk * t * t * (1 + off), 0.0, 1e6, 1e7, jerk)
    assert duration.sum() == pytest.approx(2 * t, rel=1e-3)
    distance = speed = push = 0.0
    for lasts, rate in zip(duration, rates, strict=True):
        assert speed >= -1e-9 * jerk * t * t
        distance += lasts * (speed + lasts * (push / 2 + lasts * rate / 6))
        speed, push = speed + lasts * (push + lasts * rate / 2), push + lasts * rate
    assert distance == pytest.approx(length, rel=1e-9)
    assert speed == pytest.approx(jerk * t * t, rel=1e-9)


def test_a_speed_beyond_reach_is_refused() -> None:
    with pytest.raises(CannotCompute):
        ruckig_moves.solve(1.0, 0.0, 0.0, 1e5 ** (1 / 3) * 1.01, 0.0, 1e6, 1e7, 1e5)


@pytest.mark.parametrize("ends", [(1.0, 1.0), (1.0, 0.5), (0.5, 1.0)])
def test_a_start_at_the_ceiling(ends: tuple[float, float]) -> None:
    top = 123.456789
    v0, v1 = (top * e for e in ends)
    duration, _ = ruckig_moves.solve(40.0, v0, 0.0, v1, 0.0, top, 5e3, 1e5)
    assert 40.0 / top <= duration.sum() * (1 + 1e-9)
    if ends == (1.0, 1.0):
        assert duration.sum() == pytest.approx(40.0 / top, rel=1e-6)


# -- a Ruckig that fails -----------------------------------------------------------------------------------


class _Raises:
    def __init__(self, dofs: int) -> None:
        pass

    def calculate(self, ask: ruckig.InputParameter, result: ruckig.Trajectory) -> ruckig.Result:
        raise ruckig.RuckigError("error in step 1")


class _Slow(_Raises):
    """Valid moves, but slower than need be."""

    def __init__(self, dofs: int) -> None:
        self.real = ruckig.Ruckig(dofs)

    def calculate(self, ask: ruckig.InputParameter, result: ruckig.Trajectory) -> ruckig.Result:
        ask.max_jerk = [ask.max_jerk[0] / 3]
        return self.real.calculate(ask, result)


class _Misses(_Slow):
    """Ends somewhere else."""

    def calculate(self, ask: ruckig.InputParameter, result: ruckig.Trajectory) -> ruckig.Result:
        ask.target_position = [ask.target_position[0] * 0.999]
        return self.real.calculate(ask, result)


class _Refuses(_Raises):
    def calculate(self, ask: ruckig.InputParameter, result: ruckig.Trajectory) -> ruckig.Result:
        return ruckig.Result.ErrorExecutionTimeCalculation


class _Profile:
    """Moves back from rest, and then to the target: the loop that Ruckig drives to states it misses by
    rounding."""

    class brake:
        duration = 0.0

    def __init__(self, length: float, jerk: float) -> None:
        back, forth = (0.1 * length / (2 * jerk)) ** (1 / 3), (1.1 * length / (2 * jerk)) ** (1 / 3)
        self.t = [back, 2 * back, back, forth, 2 * forth, forth, 0.0]
        self.j = [-jerk, jerk, -jerk, jerk, -jerk, jerk, 0.0]


class _Loop:
    def __init__(self, dofs: int) -> None:
        pass

    def calculate(self, ask: ruckig.InputParameter, result: _Result) -> ruckig.Result:
        result.profiles = [[_Profile(ask.target_position[0], ask.max_jerk[0])]]
        return ruckig.Result.Working


class _Result:
    def __init__(self, dofs: int) -> None:
        self.profiles: list[list[_Profile]] = []


class _Fake:
    """The names of ruckig that the planner uses, with another solver."""

    InputParameter, Trajectory, Result, RuckigError = (
        ruckig.InputParameter, ruckig.Trajectory, ruckig.Result, ruckig.RuckigError,
    )  # fmt: skip


BROKEN = {"raises": _Raises, "refuses": _Refuses, "is slow": _Slow, "misses": _Misses, "loops back": _Loop}
ROUTES: dict[str, Callable[[], Case]] = {
    "stops": OWN["all points stops"],
    "corners": lambda: (route(flat(20.0), 150.0, 0.02), LIMITS),
    "mixed": lambda: (with_tolerances(route(flat(count=6), 100.0, 0.0), 0.0, 0.02, 0.5), LIMITS),
    "dense": CASES["noise 0.2"],
}


@cache
def seconds(name: str) -> float:
    """Time of a route with Ruckig as it is."""
    return held(*ROUTES[name]())[0].duration_s


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "how"),
    # one of them of a dense route, which takes long
    left_to_a_campaign(product(ROUTES, BROKEN), [("dense", how) for how in BROKEN if how != "misses"]),
)
def test_a_broken_ruckig_makes_nothing_wrong_or_much_slower(
    how: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    given, limits = ROUTES[name]()
    sound_s = seconds(name)
    fake = type("fake", (_Fake,), {"Ruckig": BROKEN[how]})
    if how == "loops back":
        fake.Trajectory = _Result  # type: ignore[attr-defined]
    monkeypatch.setattr(ruckig_moves, "ruckig", fake)
    trajectory, _ = held(given, limits)
    if name == "stops":
        assert trajectory.duration_s <= sound_s * (1 + 1e-3)
    else:
        # the closed form has no acceleration to begin or end with
        assert trajectory.duration_s <= sound_s * 1.5


# -- no network --------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_no_socket_is_opened_from_python(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*args: object, **names: object) -> None:
        raise AssertionError("the network was asked for")

    for name in ("socket", "create_connection", "getaddrinfo"):
        monkeypatch.setattr(socket, name, refused)
    for make in ROUTES.values():
        held(*make())


def test_way_points_are_never_given_to_ruckig() -> None:
    """With these the community version sends the path to a server."""
    for path in SOURCE.rglob("*.py"):
        assert not re.search(r"(\.|[\"'])\s*intermediate_positions", path.read_text()), path


_WATCH = r"""
#include <unistd.h>
static int seen(void) { _exit(97); }
int socket(int a, int b, int c) { return seen(); }
int connect(int a, const void *b, unsigned c) { return seen(); }
int getaddrinfo(const char *a, const char *b, const void *c, void *d) { return seen(); }
"""
_PLAN = """
import sys
sys.path.insert(0, {tests!r})
from trajectory.test_adversarial import ROUTES
from olp.trajectory.plan import plan
for make in ROUTES.values():
    plan(*make())
"""
_CLOUD = """
import ruckig
ask, result = ruckig.InputParameter(1), ruckig.Trajectory(1)
ask.current_position, ask.target_position, ask.intermediate_positions = [0.0], [1.0], [[0.5]]
ask.max_velocity, ask.max_acceleration, ask.max_jerk = [1.0], [1.0], [1.0]
ruckig.Ruckig(1, 0.01, 1).calculate(ask, result)
"""


@pytest.mark.slow
@pytest.mark.skipif(
    not sys.platform.startswith("linux") or not shutil.which("cc"), reason="needs Linux and cc"
)
def test_no_socket_is_opened_from_the_libraries(tmp_path: Path) -> None:
    """Socket calls of the C library end the process; programs that do call them prove that."""
    watch = tmp_path / "watch.so"
    (tmp_path / "watch.c").write_text(_WATCH)
    subprocess.run(
        ["cc", "-shared", "-fPIC", "-o", watch, tmp_path / "watch.c"], check=True, capture_output=True
    )
    tests = str(Path(__file__).parents[1])
    env = os.environ | {"LD_PRELOAD": str(watch), "PYTHONPATH": f"{SOURCE.parent}"}
    for code, want in ((_PLAN.format(tests=tests), 0), ("import socket\nsocket.socket()", 97), (_CLOUD, 97)):
        done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, check=False)
        assert done.returncode == want, done.stderr.decode()


def test_cases_are_the_ones_that_are_meant() -> None:
    """Every case has the property that its name states."""
    for name, make in {**CASES, **OWN}.items():
        given, limits = make()
        apart = np.linalg.norm(np.diff(given.point_mm, axis=0), axis=1)
        if "mm beside 10 m" in name:
            assert apart.max() == pytest.approx(10_000.0, rel=1e-3)
            assert apart.min() < 1e-5
        if name == "duplicates":
            assert (apart == 0.0).sum() > 10
        if "feed steps" in name:
            assert all(a != b for a, b in pairwise(given.feed_mm_s.tolist()))
        if "slow" in name and limits is not LIMITS:
            assert limits.velocity.max() / limits.velocity.min() > 50
