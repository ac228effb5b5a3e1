"""How finely a move is sampled, for bends of known size."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from olp.errormodel.sampling import MOST_STEPS, clear_length_mm, longer, steps_needed

NONE = np.zeros(3)


class Bend:
    """A model whose bound is `size` times the length of a move to `power`, plus its tool along Z times the
    length along Y."""

    def __init__(self, size: float, power: float = 2.0) -> None:
        self.size, self.power = size, power

    def chord_bound(self, delta_mm: np.ndarray, tool_mm: np.ndarray) -> np.ndarray:
        assert np.ndim(tool_mm) == 1 or len(tool_mm) == len(delta_mm)
        length = np.abs(delta_mm).sum(axis=1)
        return self.size * length**self.power + tool_mm[..., 2] * np.abs(delta_mm[:, 1])


def steps(model: Any, length_mm: list[float], bend_mm: float, tool: Any = NONE, **more: int) -> list[int]:
    delta = np.zeros((len(length_mm), 3))
    delta[:, 1] = length_mm
    return steps_needed(model, delta, np.asarray(tool), bend_mm, **more).tolist()


def test_a_move_is_halved_until_it_bends_no_more_than_asked() -> None:
    """0.5 L^2 / n^2 at most 2: n at least L / 2."""
    lengths = [0.0, 1.0, 2.0, 2.001, -4.0, 4.01, 16.0, 16.1, 1000.0]
    assert steps(Bend(0.5), lengths, 2.0) == [1, 1, 1, 2, 2, 4, 8, 16, 512]
    assert steps(Bend(0.0), lengths, 2.0) == [1] * 9
    assert steps(Bend(0.5), [], 2.0) == []


def test_a_bend_that_goes_with_the_length_alone_is_halved_again() -> None:
    """Halvings that hold for a square are too few here: L / n at most 1."""
    assert steps(Bend(1.0, 1.0), [1.0, 2.0, 3.0, 64.0, 1000.0], 1.0) == [1, 2, 4, 64, 1024]


def test_steps_have_a_least_and_a_most() -> None:
    assert steps(Bend(0.5), [1.0, 12.0, 13.0, 100.0], 2.0, at_least=3) == [3, 6, 12, 96]
    assert steps(Bend(0.5), [1.0, 12.0, 100.0], 2.0, at_most=7) == [1, 7, 7]
    assert steps(Bend(0.5), [1.0], 1e-30) == [MOST_STEPS] and MOST_STEPS == 262144


def test_each_move_has_its_own_tool() -> None:
    """Tool times length: 4 mm with tools of 1, 8 and 0, at most 1."""
    tools = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 8.0], [0.0, 0.0, 0.0]])
    assert steps(Bend(0.0), [4.0, 4.0, 4.0], 1.0, tools) == [4, 32, 1]
    assert steps(Bend(0.0), [4.0, 4.0, 4.0], 1.0, tools[1]) == [32, 32, 32]


def test_an_unknown_move_is_one_step() -> None:
    delta = np.array([[np.nan, 0.0, 0.0], [0.0, 8.0, 0.0]])
    assert steps_needed(Bend(0.5), delta, NONE, 2.0).tolist() == [1, 4]  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("bend_mm", "length_mm"),
    # along each axis at once: (3 L)^2; lengths are quarters of an octave
    [(36.0, 2.0), (35.9, 2.0**0.75), (9.0 * 2.0**0.5, 2.0**0.25), (9.0 * 2.0**-24, 2.0**-12), (0.0, 0.0)],
)
def test_the_longest_move_that_needs_no_sample(bend_mm: float, length_mm: float) -> None:
    clear = clear_length_mm(Bend(1.0), np.zeros((1, 3)), bend_mm)  # type: ignore[arg-type]
    assert clear == pytest.approx(length_mm, rel=1e-12)
    assert isinstance(clear, float)


def test_where_nothing_bends_the_longest_tried_length_is_clear() -> None:
    assert clear_length_mm(Bend(0.0), np.zeros((2, 3)), 0.0) == 2.0**13.75  # type: ignore[arg-type]


@pytest.mark.parametrize("tools", [[[0.0, 0.0, 1.0], [0.0, 0.0, 4.0]], [[0.0, 0.0, 4.0], [0.0, 0.0, -9.0]]])
def test_the_tool_that_bends_most_counts(tools: list[list[float]]) -> None:
    """4 L at most 64."""
    assert clear_length_mm(Bend(0.0), np.array(tools), 64.0) == 16.0  # type: ignore[arg-type]


def test_moves_that_are_longer_along_an_axis() -> None:
    delta = np.array(
        [[2.0, 0.0, 0.0], [2.1, 0.0, 0.0], [0.0, -2.1, 0.0], [0.0, 0.0, 2.1], [1.9, -1.9, 1.9],
         [np.nan, 1.0, 1.0], [np.nan, 3.0, 1.0], [0.0, -2.0, 2.0]]
    )  # fmt: skip
    assert longer(delta, 2.0).tolist() == [1, 2, 3, 6]
