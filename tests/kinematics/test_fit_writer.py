"""The calibration file of a fit reads back as the machine that was fitted, with legs, weights and yields."""

from __future__ import annotations

import datetime
from pathlib import Path

import numpy as np
import pytest
from calibration.joints.simulated import true_machine

from olp.calibration.joints.adjustment import JointFit
from olp.calibration.joints.candidates import Priors
from olp.calibration.joints.unknowns import model_of
from olp.files.kinematics.calibration import load_joint_calibration
from olp.files.kinematics.writer import fitted_values, joint_calibration_text
from olp.kinematics.chain import Kinematics
from olp.kinematics.errors import Mass


@pytest.mark.parametrize("name", ["tripod", "arm_6r_kr6", "gantry_nutating", "scara"])
def test_a_file_reads_back_as_the_fit(name: str, tmp_path: Path) -> None:
    model, theta, values = true_machine(name, count=20)
    if name == "arm_6r_kr6":
        masses = (Mass("J2", 16.0, (250.0, 10.0, 400.0)),)
        model = model_of(model.structure, values, Priors.of(model.structure), yielding=["J2"], masses=masses)
        theta = np.append(theta, 3e-6)
    fit = JointFit(model, theta, np.diag(model.prior**2), (), (), 1.0, 1.0, len(theta))
    box = {
        f"{joint.name}_{joint.unit}": (float(column.min()), float(column.max()))
        for joint, column in zip(model.structure.joints.values(), values.T, strict=True)
    }
    day = datetime.date(2026, 11, 20)
    file = tmp_path / "calibration.toml"
    file.write_bytes(joint_calibration_text(fitted_values(fit, box, day, None, 20.0), ["A note."]))
    read = load_joint_calibration(file, model.structure)
    theirs = Kinematics(model.structure, read.errors).actual(values)
    ours = model.machine(theta).actual(values)
    # numbers have four decimals of um and urad
    assert np.abs(theirs.position - ours.position).max() < 2e-6
    assert np.abs(theirs.rotation - ours.rotation).max() < 1e-9
    assert (read.measured, read.valid_until) == (day, None)
