"""The chord bound is never exceeded, is not far above what happens, and vanishes where nothing bends."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from olp.core.machine import CHAINS, SQUARENESS
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve, Cyclic, Thermal

BOX = np.array([[0.0, 800.0], [-300.0, 300.0], [-400.0, 0.0]])
TOOL = np.array([10.0, -30.0, -150.0])


def calibration(seed: int, interpolation: str, angle: float, length: float, cyclic: bool) -> Calibration:
    rng = np.random.default_rng(seed)
    curves = []
    for axis, (low, high) in zip("XYZ", BOX, strict=True):
        knots = np.concatenate([[low], np.sort(rng.uniform(low, high, 7)), [high]])
        columns = {f"E{d}{axis}": rng.normal(size=9) * (length if d in "XYZ" else angle) for d in "XYZABC"}
        curves.append(
            Curve(
                axis,
                knots,
                columns,
                line_mm=tuple(BOX.mean(axis=1)),
                interpolation=interpolation,
                reference=str(rng.choice(["table", "functional-point"])),
            )
        )
    terms = (
        Cyclic("EXX", 10.0, length / 4),
        Cyclic("EBY", 2.0, angle / 4, 0.7),
        Cyclic("EAZ", 0.02, angle / 9),
    )
    return Calibration(
        "m",
        BOX,
        datum_mm=(1.0, 2.0, 3.0),
        curves=tuple(curves),
        cyclic=terms if cyclic else (),
        squareness=dict(zip(SQUARENESS, rng.normal(size=3) * angle, strict=True)),
    )


def departures(model, start: np.ndarray, delta: np.ndarray) -> np.ndarray:
    """(n,) greatest departure from the chord, densely sampled."""
    share = np.linspace(0.0, 1.0, 129)
    points = start[:, None, :] + share[None, :, None] * delta[:, None, :]
    error = model.error(points.reshape(-1, 3), TOOL).reshape(points.shape)
    chord = error[:, :1] + share[None, :, None] * (error[:, -1:] - error[:, :1])
    return np.linalg.norm(error - chord, axis=2).max(axis=1)


def random_moves(seed: int, n: int, axes: str) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    start, end = rng.uniform(BOX[:, 0], BOX[:, 1], (2, n, 3))
    scale = 10.0 ** rng.uniform(-3.0, 0.0, (n, 1))
    moving = np.array([a in axes for a in "XYZ"])
    return start, (end - start) * scale * moving


@pytest.mark.slow
@settings(max_examples=80, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    chain=st.sampled_from(sorted(CHAINS)),
    interpolation=st.sampled_from(["linear", "pchip"]),
    angle=st.sampled_from([0.0, 40e-6, 5e-3]),
    length=st.sampled_from([0.0, 20e-3, 2.0]),
    cyclic=st.booleans(),
    axes=st.sampled_from(["X", "Y", "Z", "XY", "XYZ"]),
)
def test_no_chord_departs_by_more(
    seed: int, chain: str, interpolation: str, angle: float, length: float, cyclic: bool, axes: str
) -> None:
    model = build(calibration(seed, interpolation, angle, length, cyclic), chain)
    start, delta = random_moves(seed, 60, axes)
    bound = model.chord_bound(delta, TOOL)
    rounding = 1e-12 + 1e-15 * length
    assert np.all(departures(model, start, delta) <= bound * (1 + 1e-9) + rounding)


@pytest.mark.parametrize("interpolation", ["linear", "pchip"])
def test_a_move_over_the_worst_place_comes_near_the_bound(interpolation: str) -> None:
    """For one curve and single-axis moves the worst of many moves reaches half the bound at every length."""
    knots = np.linspace(0.0, 800.0, 9)
    wave = np.array([0, 1, 0, -1, 0, 1, 0, -1, 0]) * 0.01
    model = build(
        Calibration("m", BOX, curves=(Curve("X", knots, {"EXX": wave}, interpolation=interpolation),)), "FXYZ"
    )
    for length in (5.0, 20.0, 100.0):
        start = np.zeros((3000, 3))
        start[:, 0] = np.linspace(0.0, 800.0 - length, 3000)
        delta = np.tile([length, 0.0, 0.0], (3000, 1))
        assert departures(model, start, delta).max() > 0.5 * model.chord_bound(delta[:1], TOOL)[0]


def test_straight_errors_need_no_bound() -> None:
    scale = Curve("X", BOX[0], {"EXX": [0.0, 0.05]}, interpolation="linear")
    thermal = Thermal((1e-5, 1e-5, 1e-5), scale_degC=(25.0, 25.0, 25.0))
    square = {"C0Y": 1e-4, "B0Z": 1e-4}
    model = build(Calibration("m", BOX, curves=(scale,), squareness=square, thermal=thermal), "FXYZ")
    _, delta = random_moves(1, 100, "XYZ")
    assert not model.chord_bound(delta, TOOL).any()


@pytest.mark.parametrize("chain", ["FXYZ", "YFXZ"])
def test_a_still_axis_adds_nothing(chain: str) -> None:
    model = build(calibration(3, "linear", 40e-6, 0.02, True), chain)
    assert not model.chord_bound(np.zeros((4, 3)), TOOL).any()


def test_the_farthest_of_many_tools_counts() -> None:
    model = build(calibration(4, "pchip", 40e-6, 0.02, False), "FXYZ")
    _, delta = random_moves(2, 50, "XYZ")
    tools = np.vstack([np.zeros((25, 3)), np.tile(TOOL, (25, 1))])
    assert np.all(model.chord_bound(delta, tools) >= np.maximum(model.chord_bound(delta, TOOL), 0.0))


@pytest.mark.parametrize("direction", [-1.0, 0.5, 1.0])
def test_the_bound_holds_in_either_direction(direction: float) -> None:
    rng = np.random.default_rng(8)
    knots = np.linspace(0.0, 800.0, 17)
    forward, backward = ({n: rng.normal(size=17) * 0.01 for n in ("EXX", "EYX")} for _ in range(2))
    curve = Curve("X", knots, forward=forward, backward=backward, interpolation="linear")
    model = build(Calibration("m", BOX, curves=(curve,)), "FXYZ")
    start, delta = random_moves(9, 500, "X")
    share = np.linspace(0.0, 1.0, 65)
    points = (start[:, None, :] + share[None, :, None] * delta[:, None, :]).reshape(-1, 3)
    error = model.error(points, TOOL, np.full(points.shape, direction)).reshape(500, 65, 3)
    chord = error[:, :1] + share[None, :, None] * (error[:, -1:] - error[:, :1])
    departure = np.linalg.norm(error - chord, axis=2).max(axis=1)
    assert np.all(departure <= model.chord_bound(delta, TOOL) * (1 + 1e-9) + 1e-12)
    assert departure.max() > 1e-3
