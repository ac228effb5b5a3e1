"""A calibration of any joints changed by new readings: as one fit of old and new ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from calibration.joints.simulated import known_machine, read, true_machine
from cases.fast import left_to_a_campaign

from olp.calibration.joints.adjustment import JointFit, fit_joints
from olp.calibration.joints.deciding import AGREES
from olp.calibration.joints.findings import fit_or_refuse
from olp.calibration.joints.refinement import refine_joints, years_until
from olp.calibration.joints.unknowns import Model
from olp.core.arrays import Array
from olp.core.errors import CannotCompute


def plain(fit: JointFit) -> Array:
    """The covariance without the factor of readings that fit worse than their noise."""
    return fit.covariance / max(1.0, fit.chi_square / fit.freedom)


@pytest.mark.slow
@pytest.mark.parametrize("name", left_to_a_campaign(["xyzac_trunnion", "scara", "hexapod"], ("hexapod",)))
def test_a_refinement_is_the_fit_of_old_and_new_readings_together(name: str) -> None:
    """What both know is the same up to the curvature of the machine: small errors, so that it is linear."""
    model, theta, values = true_machine(name, 0, 50, 0.1)
    readings = [
        read("points", model.machine(theta).actual(part), part, seed)
        for seed, part in ((3, values), (4, values[::-1][:30]))
    ]
    both = fit_joints(model, readings)
    first = fit_joints(model, readings[:1])

    known = Model(model.structure, model.unknowns, base=model.errors(first.theta), known=plain(first))
    refined = refine_joints(known, readings[1:])
    together = first.theta + refined.fit.theta
    assert np.abs((together - both.theta) / both.sigma).max() < 0.05
    after = refined.fit.covariance / max(1.0, refined.agreement)
    assert np.sqrt(np.diag(after)) == pytest.approx(np.sqrt(np.diag(plain(both))), rel=0.03)
    assert refined.agreement < AGREES


def test_a_change_beyond_the_covariance_makes_it_larger() -> None:
    usual, fit, true, values = known_machine("xyzac_trunnion")
    known = Model(usual.structure, usual.unknowns, base=usual.errors(fit.theta), known=fit.covariance)
    row = [unknown.name for unknown in usual.unknowns].index("C.X_um")
    changed = true.copy()
    changed[row] += 0.2
    same, moved = (
        refine_joints(known, [read("points", usual.machine(one).actual(values), values, 9)])
        for one in (true, changed)
    )
    assert same.agreement < AGREES < 10.0 < moved.agreement
    assert int(np.argmax(np.abs(moved.deviations))) == row
    assert np.all(moved.fit.sigma > 2.0 * same.fit.sigma)
    assert np.all(same.fit.sigma < 1.01 * fit.sigma * np.sqrt(max(1.0, same.agreement)))


def test_what_no_reading_is_left_for_is_refused() -> None:
    usual, fit, true, values = known_machine("xyzac_trunnion")
    known = Model(usual.structure, usual.unknowns, base=usual.errors(fit.theta), known=fit.covariance)
    few = read("lengths", usual.machine(true).actual(values[:5]), values[:5])
    with pytest.raises(CannotCompute, match="5 numbers were read, and the instruments have 9 unknowns"):
        refine_joints(known, [few])


def test_the_day_of_measuring_again() -> None:
    assert years_until(2.0, 1.0, 0.5) == 0.0
    assert years_until(1.0, 2.0, 0.0) is None
    assert years_until(1.0, 2.0, 0.5) == pytest.approx(2.0)


@pytest.mark.slow
def test_errors_that_one_reflector_hardly_parts_settle() -> None:
    """Unknowns that look almost alike leave a curved valley: full steps go from side to side there."""
    model, theta, values = true_machine("arm_6r_kr6", 1, 51)
    old, new = (
        replace(read("points", model.machine(theta).actual(part), part, seed, 1, noise=0.25), sigma=0.005)
        for seed, part in ((1, values[:36]), (10, values[36:]))
    )
    first = fit_joints(model, [old])
    known = Model(model.structure, model.unknowns, base=model.errors(first.theta), known=first.covariance)
    assert refine_joints(known, [new]).agreement < AGREES


@pytest.mark.slow
def test_good_readings_that_settle_nowhere_are_not_called_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    model, theta, values = true_machine("xyzac_trunnion", 0, 12)
    new = read("points", model.machine(0.01 * theta).actual(values), values, 1)

    def settles_nowhere(*_: object) -> None:
        raise CannotCompute("no steps settle")

    monkeypatch.setattr("olp.calibration.joints.findings.fit_joints", settles_nowhere)
    with pytest.raises(CannotCompute, match="no steps"):
        fit_or_refuse(model, [new])
