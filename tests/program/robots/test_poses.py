"""Rotations in the forms of robots: there and back, also where a form is singular."""

from __future__ import annotations

import numpy as np
import pytest
from judge.arm import about

from olp.program.robots.poses import matrices, matrix, of_vector, of_zyx, vector_of, zyx_of

X, Y, Z = np.eye(3)


@pytest.mark.parametrize("second", [0.0, 33.0, 90.0, -90.0, 90.0 - 1e-8, 89.9999, -90.0 + 1e-5])
def test_angles_make_the_same_rotation_again(second: float) -> None:
    rng = np.random.default_rng(3)
    for first, third in rng.uniform(-180, 180, (20, 2)):
        turn = of_zyx((first, second, third))
        wanted = about(Z, first) @ about(Y, second) @ about(X, third)
        assert np.abs(matrix(turn) - wanted).max() < 1e-14
        a, b, c = zyx_of(turn, first)
        assert np.abs(about(Z, a) @ about(Y, b) @ about(X, c) - wanted).max() < 1e-14
        if abs(second) == 90.0:
            assert np.abs(np.array((a, b, c)) - (first, second, third)).max() < 1e-6


def test_a_vector_is_found_next_to_another_one() -> None:
    rng = np.random.default_rng(4)
    for vector in [*rng.uniform(-4, 4, (50, 3)), np.zeros(3), np.array([2 * np.pi, 0, 0])]:
        near = tuple((vector + rng.uniform(-1e-3, 1e-3, 3)).tolist())
        assert np.abs(np.array(vector_of(of_vector(vector), near)) - vector).max() < 2e-3
        assert np.linalg.norm(vector_of(of_vector(vector))) <= np.pi + 1e-12


def test_matrices_are_those_of_single_rotations() -> None:
    turns = [of_vector(v) for v in np.random.default_rng(5).uniform(-3, 3, (9, 3))]
    assert np.abs(matrices(np.array(turns)) - [matrix(turn) for turn in turns]).max() < 1e-15
