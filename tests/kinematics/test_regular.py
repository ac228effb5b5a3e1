"""Steps at regular postures: the pseudo-inverse's, and which postures are nearly singular."""

from __future__ import annotations

import numpy as np
import pytest
from kinematics.cases import golden, random_values

from olp.kinematics import inverse
from olp.kinematics.inverse import command
from olp.kinematics.regular import RegularSteps

RNG = np.random.default_rng(11)


@pytest.mark.parametrize(("asked", "axes"), [(3, 3), (5, 5), (6, 6), (5, 7)])
def test_steps_are_those_of_the_pseudo_inverse(asked: int, axes: int) -> None:
    slopes, miss = RNG.normal(size=(50, asked, axes)), RNG.normal(size=(50, asked))
    steps = RegularSteps.of(slopes.transpose(1, 2, 0))
    expected = (np.linalg.pinv(slopes) @ miss[..., None])[..., 0]
    assert steps.regular.sum() > 40
    assert steps(miss.T).T[steps.regular] == pytest.approx(expected[steps.regular], abs=1e-8)


@pytest.mark.parametrize("least", [0.0, 1e-9, 0.005, 0.05])
def test_nearly_singular_slopes_are_not_regular(least: float) -> None:
    left, _ = np.linalg.qr(RNG.normal(size=(5, 5)))
    right, _ = np.linalg.qr(RNG.normal(size=(5, 5)))
    slopes = left @ np.diag([1.4, 1.0, 0.9, 0.5, least]) @ right
    assert RegularSteps.of(slopes[:, :, None]).regular.tolist() == [least > 0.01]


@pytest.mark.parametrize("name", ["xyzac_trunnion", "arm_6r_kr6", "linear_delta"])
def test_commands_are_those_of_newtons_method_with_all_safeguards(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = golden(name)[0]
    values = random_values(case, 40, 5)
    values = values.mean(axis=0) + 0.3 * (values - values.mean(axis=0))
    fast = command(case.kinematics, values)
    none = np.zeros((40, 3)), np.zeros(40, bool)
    monkeypatch.setattr(inverse, "_regular", lambda task, *_: (task.near.copy(), *none))
    slow = command(case.kinematics, values)
    assert fast.values == pytest.approx(slow.values, abs=1e-7)
    assert fast.left_rad == pytest.approx(slow.left_rad, abs=1e-9)
    assert fast.limited.tolist() == slow.limited.tolist()
