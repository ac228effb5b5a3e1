"""The inverse of the error model: the tip comes to its place within 1 pm, or olp refuses."""

from __future__ import annotations

import numpy as np
import pytest
from cases.toy import Toy
from hypothesis import example, given, settings
from hypothesis import strategies as st

from olp.compensation.invert import BLOCK, TOLERANCE_MM, bent, invert
from olp.core.errors import NotInvertible
from olp.errormodel.base import ErrorModel
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve, Cyclic

BOX = np.array([[0.0, 600.0], [-200.0, 400.0], [-300.0, 100.0]])


def rough_machine(seed: int, slope: float, cyclic_mm: float) -> ErrorModel:
    """18 curves whose slopes are about `slope`, and a cyclic error of 2 mm pitch in X."""
    rng = np.random.default_rng(seed)
    curves = []
    for axis, (low, high) in zip("XYZ", BOX, strict=True):
        knots = np.linspace(low, high, 41)
        rise = rng.uniform(-slope, slope, (len(knots), 6)) * (knots[1] - knots[0])
        values = np.cumsum(rise * ([1.0] * 3 + [2e-3] * 3), axis=0)
        names = [f"E{d}{axis}" for d in "XYZABC"]
        columns = dict(zip(names, values.T, strict=True))
        curves.append(Curve(axis, knots, columns, line_mm=(0.0, 0.0, 0.0)))
    terms = (Cyclic("EXX", 2.0, cyclic_mm, 0.3),) if cyclic_mm else ()
    return build(Calibration("rough", BOX, curves=tuple(curves), cyclic=terms), "YFXZ")


@settings(max_examples=40)
@example(seed=828, slope=1e-3, cyclic_mm=0.02, count=103)
@given(
    seed=st.integers(0, 10_000),
    slope=st.sampled_from([1e-6, 1e-4, 1e-3, 1e-2]),
    cyclic_mm=st.sampled_from([0.0, 1e-3, 0.02]),
    count=st.integers(1, 400),
)
@pytest.mark.slow
def test_the_tip_comes_to_its_place(seed: int, slope: float, cyclic_mm: float, count: int) -> None:
    model = rough_machine(seed, slope, cyclic_mm)
    target = np.random.default_rng(seed).uniform(BOX[:, 0], BOX[:, 1], (count, 3))
    tool = np.array([10.0, -20.0, -150.0])
    command = invert(model, target, tool)
    residual = np.abs(command + model.error(command, tool) - target).max()
    # sums of numbers of 1e3 mm carry 1e-13 mm
    assert residual <= TOLERANCE_MM + 1e-12


def test_an_error_that_grows_faster_than_the_position_is_refused() -> None:
    model = rough_machine(1, 1e-4, 1.0)
    target = np.random.default_rng(1).uniform(BOX[:, 0], BOX[:, 1], (50, 3))
    with pytest.raises(NotInvertible, match="grow as fast"):
        invert(model, target, np.zeros(3))


def stretched(slope: float) -> ErrorModel:
    """X is too far by `slope` of itself, and nothing else is wrong."""
    nodes = np.array([-1000.0, 2000.0])
    curve = Curve("X", nodes, {"EXX": slope * nodes}, interpolation="linear")
    return build(Calibration("stretched", np.tile([-1000.0, 2000.0], (3, 1)), curves=(curve,)), "FXYZ")


@pytest.mark.parametrize("play", (None, np.zeros((1, 3))))
def test_a_command_is_where_the_error_brings_the_tip_to_its_target(play: np.ndarray | None) -> None:
    """c + c / 1000 = 200.2, so c = 200; Y and Z have no error."""
    command = invert(stretched(1e-3), np.array([[200.2, 7.0, -3.0]]), np.zeros(3), play)
    assert command == pytest.approx(np.array([[200.0, 7.0, -3.0]]), abs=1e-9)


@pytest.mark.parametrize(
    ("x_mm", "expected_mm"),
    # one step of the iteration up to an error of 0.15 mm, two above: 200 - 199.8 / 1000
    [(100.0, 99.9), (-100.0, -99.9), (150.0, 149.85), (200.0, 199.8002), (-200.0, -199.8002)],
)
def test_a_sample_is_bent_against_its_error(x_mm: float, expected_mm: float) -> None:
    sample = bent(stretched(1e-3), np.array([[x_mm, 5.0, 6.0]]), np.zeros(3))
    assert sample == pytest.approx(np.array([[expected_mm, 5.0, 6.0]]), abs=1e-9)


@pytest.mark.parametrize(
    ("slope", "x_mm", "evaluations"),
    # changes of 10 um, 10 nm, 10 pm; of 50 um, 0.5 um, 5 nm; none at all
    [(1e-3, 10.0, 3), (1e-2, 0.5, 4), (0.0, 10.0, 2), (1e-3, 1e-4, 2)],
)
def test_the_error_is_asked_for_no_more_than_needed(slope: float, x_mm: float, evaluations: int) -> None:
    """The next change is taken for ten times what the last two let expect, and a hundredth of it at least."""
    model, asked = stretched(slope), []

    def error(point: np.ndarray, tool: np.ndarray, play: np.ndarray | None = None) -> np.ndarray:
        asked.append(point)
        return model.error(point, tool, play)

    counting = Toy(lambda point, tool: error(point, tool[0]))
    command = invert(counting, np.array([[x_mm, 0.0, 0.0]]), np.zeros(3))
    assert command[0, 0] == pytest.approx(x_mm / (1 + slope), abs=1e-9)
    assert len(asked) == evaluations


def test_an_axis_that_is_not_known_keeps_its_target_and_others_do_not_wait_for_it() -> None:
    target = np.array([[np.nan, 7.0, 8.0], [100.1, 7.0, 8.0]])
    command = invert(stretched(1e-3), target, np.zeros(3))
    assert np.isnan(command[0, 0])
    assert command[0, 1:].tolist() == [7.0, 8.0]
    assert command[1] == pytest.approx([100.0, 7.0, 8.0], abs=1e-9)


def test_many_points_are_inverted_as_each_alone() -> None:
    model, tools = stretched(1e-3), np.zeros((BLOCK + 3, 3))
    target = np.column_stack([np.linspace(-500.0, 500.0, BLOCK + 3), *np.zeros((2, BLOCK + 3))])
    command = invert(model, target, tools)
    assert command[:, 0] == pytest.approx(target[:, 0] / 1.001, abs=1e-9)
    assert invert(model, target[:0], tools[:0]).shape == (0, 3)


def test_a_point_is_inverted_as_it_is_alone() -> None:
    """To the last bit, whatever the points beside it are."""
    model = rough_machine(3, 1e-3, 0.02)
    target = np.random.default_rng(3).uniform(BOX[:, 0], BOX[:, 1], (40, 3))
    together = invert(model, target, np.zeros(3))
    alone = [invert(model, one[None], np.zeros(3))[0] for one in target]
    np.testing.assert_array_equal(together, alone)
