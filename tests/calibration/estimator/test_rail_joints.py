"""Joints of rails are found where they are, and nowhere on smooth machines."""

import numpy as np
from cases import volumetric
from judge import families

from olp.calibration.estimator.adjustment import fit
from olp.calibration.estimator.basis import Step
from olp.calibration.estimator.between import Hidden
from olp.calibration.estimator.rail_joints import Joint

DATUM = (0.0, 0.0, 0.0)


def test_stations_show_the_joints_of_rails() -> None:
    machine = families.machine(900, "rails")
    joints = fit(volumetric.readings(machine, "stations", 900), machine.chain, datum_mm=DATUM).prior.joints
    (joint,) = (one for one in joints["EYY"] if abs(one.step.low_mm - 1000.0) < 30.0)
    assert joint.step.low_mm - 2.0 < 1000.0 < joint.step.high_mm + 2.0
    assert joint.step.high_mm - joint.step.low_mm < 10.0
    jump = np.diff(machine.curves["EYY"](np.array([999.9, 1000.1])))[0]
    assert abs(joint.jump - jump) < 2e-3


def test_a_smooth_machine_has_no_joints() -> None:
    machine = families.machine(900, "smooth")
    assert not fit(volumetric.readings(machine, "stations", 900), machine.chain, datum_mm=DATUM).prior.joints


def test_a_curve_hides_more_where_its_joint_may_be() -> None:
    hidden = Joint(Step(10.0, 20.0), 4e-3).beside(Hidden(np.array([0.0]), np.array([1e-6])))
    np.testing.assert_allclose(hidden.at(np.array([5.0, 15.0, 25.0])), [1e-6, 5e-6, 1e-6])
