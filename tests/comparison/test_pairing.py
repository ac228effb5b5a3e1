"""Pairing along the path: a known field of deviations comes back, whatever path, frame, density and order."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from cases.fast import some_of_a_campaign
from hypothesis import given, settings
from hypothesis import strategies as st

from olp.comparison import runs
from olp.comparison.aligning import align
from olp.comparison.pairing import pair
from olp.comparison.path import Path, split
from olp.core.rigid_fit import Rigid, rotation_of

LAPS = 3
NOISE_MM = 0.002


def eight(u: np.ndarray) -> np.ndarray:
    """Crosses itself in plan and in space; one lap each 2 pi."""
    return np.column_stack((200 * np.sin(u), 100 * np.sin(2 * u) + 30 * np.cos(u), 12 * np.sin(3 * u)))


def square(u: np.ndarray) -> np.ndarray:
    """A square with corners, dwelling in each for a while."""
    side = np.clip((u / (np.pi / 2)) % 1.0 * 1.2 - 0.1, 0.0, 1.0)
    start = np.array(((0, 0), (150, 0), (150, 150), (0, 150), (0, 0)), float)
    k = (u // (np.pi / 2)).astype(int) % 4
    flat = start[k] + side[:, None] * (start[k + 1] - start[k])
    return np.column_stack((flat, np.zeros(len(u))))


def out_and_back(u: np.ndarray) -> np.ndarray:
    """In both directions on one straight line, where only order distinguishes the passes."""
    x = 300 * np.abs((u / np.pi) % 2 - 1)
    return np.column_stack((x, 0 * x, 0 * x))


def field(points: np.ndarray) -> np.ndarray:
    """A smooth field of errors of some 50 um."""
    x, y, z = points.T / 100
    return 0.03 * np.column_stack((np.sin(x + y), np.cos(y - z) + 0.3 * x, np.sin(z + x) * np.cos(y)))


def expected(path: Path, segment: np.ndarray, error: np.ndarray) -> np.ndarray:
    parts = split(path, segment, error)
    return np.column_stack((parts.normal, parts.binormal))


def recovered(path: Path, points: np.ndarray, order: str = "forward") -> tuple[np.ndarray, np.ndarray]:
    pairing = pair(path, points, order)
    parts = split(path, pairing.segment, points - pairing.foot_mm)
    return np.column_stack((parts.normal, parts.binormal)), pairing.segment


@pytest.mark.slow
@pytest.mark.parametrize(("nominal", "measured"), [(20_000, 20_000), (2_000, 30_000), (30_000, 1_500)])
@pytest.mark.parametrize("order", ["forward", "backward"])
def test_a_known_field_comes_back_within_the_noise(nominal: int, measured: int, order: str) -> None:
    rng = np.random.default_rng(nominal + measured)
    turns = 2 * np.pi * LAPS
    path = Path.through(eight(np.linspace(0, turns, nominal)))
    u = np.sort(rng.uniform(0.01, turns - 0.01, measured))
    true = eight(u)
    error = field(true)
    points = true + error + rng.normal(0, NOISE_MM, true.shape)
    if order == "backward":
        points, u, error = points[::-1], u[::-1], error[::-1]
    pairing = pair(path, points, order)
    parts = split(path, pairing.segment, points - pairing.foot_mm)
    s = np.interp(u, np.linspace(0, turns, nominal), path.s_mm)
    # every point is on its own lap, and at its arc length up to error and noise along the path
    assert np.abs(pairing.s_mm - s).max() < 0.2
    got = np.column_stack((parts.normal, parts.binormal))
    away = np.abs(got - expected(path, pairing.segment, error))
    # chords of the nominal path and the bend of the field between nodes add their share
    sagitta = (path.length_mm / nominal) ** 2 / 8 / 20
    assert away.max() < 5.5 * NOISE_MM + sagitta
    assert np.sqrt((away**2).mean()) < 1.1 * NOISE_MM + sagitta


@pytest.mark.slow
def test_three_laps_with_dwell_stay_in_their_laps() -> None:
    rng = np.random.default_rng(5)
    turns = 2 * np.pi * LAPS
    path = Path.through(square(np.linspace(0, turns, 4001)))
    u = np.linspace(0.0, turns - 1e-6, 12_000)
    points = square(u) + rng.normal(0, NOISE_MM, (len(u), 3))
    pairing = pair(path, points, "forward")
    true = np.interp(u, np.linspace(0, turns, 4001), _arc_length(square(np.linspace(0, turns, 4001))))
    # in a corner a point may be given to either side by as much as it dwells; never to another lap
    assert np.abs(pairing.s_mm - true).max() < 1.0
    assert pairing.distance_mm.max() < 6 * NOISE_MM


def _arc_length(points: np.ndarray) -> np.ndarray:
    return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))


@pytest.mark.slow
def test_both_directions_on_one_line() -> None:
    rng = np.random.default_rng(6)
    u = np.linspace(0, 6 * np.pi, 9001)
    path = Path.through(out_and_back(np.linspace(0, 6 * np.pi, 601)))
    points = out_and_back(u) + rng.normal(0, NOISE_MM, (len(u), 3))
    pairing = pair(path, points, "forward")
    true = np.interp(u, np.linspace(0, 6 * np.pi, 601), path.s_mm)
    assert np.abs(pairing.s_mm - true).max() < 1.0


@pytest.mark.slow
def test_parallel_passes_closer_than_the_deviation() -> None:
    """Lines 0.05 mm apart, on a machine that is off by 0.12 mm: the nearest line is wrong."""
    rows = np.repeat(np.arange(60), 2) * 0.05
    ends = np.tile((0.0, 80.0, 80.0, 0.0), 30)
    path = Path.through(np.column_stack((ends, rows, np.zeros(120))))
    s = np.linspace(0.5, path.length_mm - 0.5, 15_000)
    place, segment = path.at(s)
    points = place + np.array((0.0, 0.12, 0.0)) + np.random.default_rng(7).normal(0, NOISE_MM, place.shape)
    pairing = pair(path, points, "forward")
    long = np.diff(path.s_mm)[segment] > 1
    inner = long & (place[:, 0] > 2) & (place[:, 0] < 78)
    assert (pairing.segment[inner] == segment[inner]).all()
    free = pair(path, points, "free")
    assert (free.segment[inner] != segment[inner]).mean() > 0.5


@pytest.mark.slow
@pytest.mark.parametrize("order", some_of_a_campaign(["forward", "backward"], 2))
def test_passes_closer_than_the_coarsest_nodes(order: Literal["forward", "backward"]) -> None:
    """250 rows of a raster 2.4 mm apart, each of 12 nodes of the coarsest level."""
    rows = np.repeat(np.arange(250), 2) * 2.4
    ends = np.tile((0.0, 1000.0, 1000.0, 0.0), 125)
    way = np.column_stack((ends, rows, np.zeros(500)))
    path = Path.through(np.vstack((way[0] + (0, 0, 40.0), way, way[-1] + (0, 0, 40.0))))
    s = np.linspace(0.0, path.length_mm, 40_000)
    place, _ = path.at(s)
    points = place + field(place) + np.random.default_rng(9).normal(0, NOISE_MM, place.shape)
    if order == "backward":
        points, s = points[::-1], s[::-1]
    pairing = pair(path, points, order)
    assert np.abs(pairing.s_mm - s).max() < 1.0
    assert pairing.distance_mm.max() < 0.2


@pytest.mark.slow
def test_what_was_not_measured_leaves_the_rest_alone() -> None:
    rng = np.random.default_rng(8)
    turns = 2 * np.pi * LAPS
    path = Path.through(eight(np.linspace(0, turns, 6000)))
    u = np.linspace(0.3, turns - 0.3, 9000)
    u = u[(u < 7.0) | (u > 9.0)]
    points = eight(u) + field(eight(u)) + rng.normal(0, NOISE_MM, (len(u), 3))
    pairing = pair(path, points, "forward")
    true = np.interp(u, np.linspace(0, turns, 6000), path.s_mm)
    assert np.abs(pairing.s_mm - true).max() < 0.3
    run = runs.Run.of("a", path, points, pairing, 1.0)
    share = np.diff(np.interp([0.3, 7.0, 9.0, turns - 0.3], np.linspace(0, turns, 6000), path.s_mm))
    assert run.covered(path) == pytest.approx((share[0] + share[2]) / path.length_mm, abs=0.005)


@pytest.mark.slow
@pytest.mark.parametrize("order", ["forward", "backward", "free"])
def test_a_frame_anywhere_in_space_is_found(order: str) -> None:
    rng = np.random.default_rng(9)
    path = Path.through(eight(np.linspace(0, 2 * np.pi, 3000)))
    points = eight(np.sort(rng.uniform(0, 2 * np.pi, 4000))) + rng.normal(0, NOISE_MM, (4000, 3))
    if order == "backward":
        points = points[::-1]
    if order == "free":
        points = points[rng.permutation(4000)]
    away = Rigid(rotation_of(np.array((1.9, -0.7, 2.2))), np.array((4000.0, -2500.0, 900.0)))
    alignment = align(path, away(points), 1.0)
    assert alignment.order == order
    assert not alignment.loose
    assert not alignment.ambiguous
    # uncertainty of a best fit of 4000 points, with levers
    assert np.abs(alignment.rigid(away(points)) - points).max() < 10 * NOISE_MM / np.sqrt(4000 / 6)


@pytest.mark.slow
def test_a_field_comes_back_from_another_frame_up_to_what_a_best_fit_takes() -> None:
    """Noise, turned and shifted, other density, a path that crosses itself, three laps: all at once."""
    rng = np.random.default_rng(11)
    turns = 2 * np.pi * LAPS
    path = Path.through(eight(np.linspace(0, turns, 9000)))
    u = np.sort(rng.uniform(0, turns, 6000))
    real = eight(u) + field(eight(u))
    away = Rigid(rotation_of(np.array((-0.4, 1.1, 0.8))), np.array((-700.0, 300.0, 1500.0)))
    placed = runs.place(path, ["a"], [away(real + rng.normal(0, NOISE_MM, real.shape))], "fit", None, 1.0)
    assert placed.right == (True,)
    run = placed.runs[0]
    s = np.interp(u, np.linspace(0, turns, 9000), path.s_mm)
    assert np.abs(run.pairing.s_mm - s).max() < 0.5
    # the noise-free points in the fitted frame: the residual is noise
    there = placed.rigid[0].after(away)(real)
    want = expected(path, run.pairing.segment, there - eight(u))
    got = np.column_stack((run.deviation.normal, run.deviation.binormal))
    assert np.abs(got - want).max() < 5.5 * NOISE_MM + 1e-3
    assert np.sqrt(((got - want) ** 2).mean()) < 1.1 * NOISE_MM + 1e-3
    # and no other frame near by has a smaller residual
    least = np.sqrt((run.deviation.across**2).mean())
    for turn in np.eye(3) * 5e-5:
        other = Rigid(rotation_of(turn), np.zeros(3))(run.points_mm)
        parts = split(path, run.pairing.segment, other - run.pairing.foot_mm)
        assert np.sqrt((parts.across**2).mean()) > least


@pytest.mark.slow
def test_a_wrong_pairing_is_a_finding_and_not_a_number() -> None:
    rng = np.random.default_rng(10)
    path = Path.through(eight(np.linspace(0, 2 * np.pi, 3000)))
    points = square(np.linspace(0, 6, 800)) + rng.normal(0, NOISE_MM, (800, 3))
    placed = runs.place(path, ["other"], [points], "fit", None, 1.0)
    assert placed.right == (False,)
    assert [f.code for f in runs.findings(path, placed)] == ["OLP601"]
    # in order or not: shuffled points forced into an order are no path
    shuffled = eight(rng.uniform(0, 2 * np.pi, 1000))
    placed = runs.place(path, ["shuffled"], [shuffled], "none", "forward", 1.0)
    assert placed.right == (False,)
    placed = runs.place(path, ["shuffled"], [shuffled], "none", None, 1.0)
    assert placed.orders == ("free",)
    assert placed.right == (True,)


@pytest.mark.parametrize(("points", "word"), [
    (np.column_stack((np.linspace(0, 500, 800), np.zeros(800), np.zeros(800))), "shift in X"),
    (np.column_stack((100 * np.cos(t := np.linspace(0, 6.28, 800)), 100 * np.sin(t), 0 * t)), "turn about Z"),
])  # fmt: skip
@pytest.mark.slow
def test_what_a_path_does_not_determine_is_named(points: np.ndarray, word: str) -> None:
    path = Path.through(points)
    noisy = points + np.random.default_rng(1).normal(0, NOISE_MM, points.shape)
    placed = runs.place(path, ["a"], [noisy], "fit", "forward", 1.0)
    assert word in placed.loose


@pytest.mark.slow
def test_a_fit_that_absorbs_the_error_is_a_finding() -> None:
    """A field that is a pure rotation: the best fit absorbs all of it."""
    path = Path.through(eight(np.linspace(0, 2 * np.pi, 3000)))
    nominal = eight(np.linspace(0, 2 * np.pi, 1000))
    turned = Rigid(rotation_of(np.array((0.0, 0.0, 2e-4))), np.array((0.01, 0.0, 0.0)))(nominal)
    placed = runs.place(path, ["a"], [turned], "fit", None, 1.0)
    before, after = runs.absorbed(path, placed.runs[0], placed.rigid[0])
    assert before > 15
    assert after < 0.5
    assert [f.code for f in runs.absorbed_finding(before, after, "x")] == ["OLP604"]
    assert runs.absorbed_finding(10.0, 8.0, "x") == []
    error = turned - nominal
    field_before, field_after = runs.absorbed_of_field(path, placed.runs[0], error)
    assert field_before == pytest.approx(before, rel=0.02)
    assert field_after < 0.5


@pytest.mark.slow
@settings(max_examples=40)
@given(
    st.lists(st.floats(-3, 3), min_size=3, max_size=3), st.lists(st.floats(-1e3, 1e3), min_size=3, max_size=3)
)
def test_rigid_transforms_invert_and_their_angles_make_them(turn: list[float], shift: list[float]) -> None:
    rigid = Rigid(rotation_of(np.array(turn)), np.array(shift))
    points = np.random.default_rng(2).normal(0, 100, (20, 3))
    assert np.allclose(rigid.inverse()(rigid(points)), points, atol=1e-9)
    a, b, c = np.radians(rigid.angles_deg)
    x, y, z = (rotation_of(v) for v in np.diag((a, b, c)))
    assert np.allclose(z @ y @ x, rigid.rotation, atol=1e-9)
    angle = np.linalg.norm(turn) % (2 * np.pi)
    assert np.isclose(rigid.angle_rad, min(angle, 2 * np.pi - angle), atol=1e-7)


@pytest.mark.parametrize("count", [2, 3, 5, 9, 17])
@pytest.mark.parametrize("curve", [eight, square])
def test_a_few_points_far_apart_find_their_places(curve: object, count: int) -> None:
    """Between two of them are thousands of nodes without a point; the first point also keeps its own."""
    rng = np.random.default_rng(count)
    u = np.linspace(0.0, 2 * np.pi * 0.999, 4000)
    path = Path.through(curve(u))  # type: ignore[operator]
    for _ in range(4):
        s = np.sort(rng.uniform(0.0, path.length_mm, count))
        points, _ = path.at(s)
        pairing = pair(path, points + np.array((0.0, 0.0, 0.01)), "forward")
        assert np.abs(pairing.s_mm - s).max() < 0.05
