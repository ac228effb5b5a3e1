"""Curves with lines: what readings beside these lines say of their character."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from cases import volumetric
from cases.calibration import FRESH
from judge import families

from olp.calibration.estimator import lined
from olp.calibration.estimator.adjustment import fit
from olp.calibration.estimator.basis import Scales
from olp.calibration.estimator.between import Hidden
from olp.calibration.estimator.character import RIPPLE, SIZES, SMOOTH, STEPS, expected
from olp.calibration.estimator.fitted import Fit
from olp.calibration.estimator.lined import Lined, level_of
from olp.calibration.estimator.smoothing import Shape

#: Probabilities of an angle that lines do not tell: none is zero.
FLAT = np.full((len(SMOOTH), len(SIZES), len(STEPS), len(RIPPLE)), 1.0)


def hides(name: str, scales: Scales) -> Hidden:
    return Hidden(np.zeros(1), np.array([scales.ripple**2]))


def curves(table: np.ndarray) -> Lined:
    scales = expected(table / table.sum(), "angle")
    return Lined({"ECX": Shape(table / table.sum(), scales, (), "none", 0.0, hides("ECX", scales))}, hides)


def test_a_size_has_a_level_among_candidates() -> None:
    assert [level_of(RIPPLE, size) for size in RIPPLE] == pytest.approx(range(len(RIPPLE)))
    assert level_of(RIPPLE, 0.5 * RIPPLE[1]) == pytest.approx(0.5)
    assert level_of(RIPPLE, np.sqrt(RIPPLE[2] * RIPPLE[3])) == pytest.approx(2.5)
    assert level_of(RIPPLE, 2.0 * RIPPLE[-1]) == len(RIPPLE) - 1


def test_levels_that_were_heard_are_mixed_and_those_heard_last_hold() -> None:
    """Half says no ripple, half the fourth candidate: the expected square is half of that, in what cells hide
    too. Kinds that were heard besides do not change it."""
    own = curves(FLAT)
    levels = {"angle": np.array([0.0, 4.0])}
    none, much = (own.at(lined.RIPPLE, levels, k)["ECX"].scales.ripple for k in range(2))
    own.hear(lined.RIPPLE, levels, np.array([1.0, 0.0]))
    own.hear(lined.RIPPLE, levels, np.array([0.5, 0.5]))
    own.hear(lined.KIND, {"angle": np.arange(5.0)}, np.eye(5)[2])
    shape = own.shapes()["ECX"]
    assert none < 0.01 * much
    assert shape.scales.ripple == pytest.approx(much / np.sqrt(2.0), rel=1e-3)
    assert shape.hidden.variance == pytest.approx(shape.scales.ripple**2)
    assert shape.scales.slow > 0.0 == shape.scales.middle == shape.scales.bows


@pytest.mark.parametrize(("axis", "row"), [(lined.KIND, 5), (lined.STEPS, 2)])
def test_what_lines_exclude_stays_excluded(axis: int, row: int) -> None:
    """Lines show one kind, or large steps, beyond doubt: what is heard of other curves does not change it."""
    shown = np.moveaxis(np.zeros_like(FLAT), axis, 0)
    shown[3] = 1.0
    own = curves(np.moveaxis(shown, 0, axis))
    size = own.shapes()["ECX"].scales.values[row]
    own.hear(axis, {"angle": np.zeros(1)}, np.ones(1))
    assert own.shapes()["ECX"].scales.values[row] == pytest.approx(size) != 0.0


def hidden_and_steps(fitted: Fit) -> np.ndarray:
    """Means of what cells hide, mm^2, and of steps, over the displacements."""
    names = [name for name in fitted.prior.shapes if name[1] in "XYZ"]
    hidden = np.mean([fitted.prior.hidden[name].variance.mean() for name in names])
    return np.array([hidden, np.mean([fitted.prior.shapes[name].scales.steps for name in names])])


def test_points_beside_lines_tell_rough_curves_from_smooth_ones() -> None:
    """Five targets a line do not."""
    found = {}
    for family in ("smooth", "dents"):
        machine = families.machine(0, family)
        taken = volumetric.readings(machine, "lines5+points", 0)
        fitted = fit(taken, machine.chain, datum_mm=(0.0, 0.0, 0.0))
        alone = fit(dataclasses.replace(taken, observations=taken.lines), machine.chain)
        found[family] = hidden_and_steps(fitted) / hidden_and_steps(alone)
        low, high = machine.box.T
        position, tool = np.random.default_rng(2).uniform(low, high, (200, 3)), np.array(FRESH[1])
        off, sigma = (
            fitted.error(position, tool) - machine.error(position, tool),
            fitted.sigma(position, tool),
        )
        assert np.mean(np.abs(off) <= 2.0 * sigma) > 0.9
        assert sigma.mean() < 1.5 * np.sqrt(np.mean(off**2))
    assert (found["smooth"] < (0.1, 0.5)).all()
    assert (found["dents"] > (0.6, 0.6)).all()
