"""The golden cases of every structure: figures on which two independent implementations agree."""

from __future__ import annotations

import numpy as np
import pytest
from kinematics.cases import GOLDEN, STRUCTURES, columns, golden, need_golden

from olp.core.units import RAD_PER_URAD
from olp.kinematics.inverse import command

#: mm, and of an element of a rotation matrix.
POSITION_MM, ROTATION = 1e-9, 1e-11
#: mm or deg.
COMMAND = 1e-6


def test_every_golden_case_is_tested() -> None:
    need_golden()
    assert {path.stem for path in GOLDEN.glob("*.json")} == set(STRUCTURES)


@pytest.mark.parametrize("name", STRUCTURES)
def test_the_pose_of_the_tool(name: str) -> None:
    setup, figures = golden(name)
    rows = figures["forward"]
    values = columns(setup, [row["axes"] for row in rows])
    poses = {"nominal": setup.kinematics.nominal(values), "actual": setup.kinematics.actual(values)}
    for which, pose in poses.items():
        position = np.array([row[f"{which}_position_mm"] for row in rows])
        rotation = np.array([row[f"{which}_rotation"] for row in rows])
        assert np.abs(pose.position - position).max() < POSITION_MM
        assert np.abs(pose.rotation - rotation).max() < ROTATION
    _, turn = setup.kinematics.deviation(values)
    wanted = np.array([row["deviation_urad"] for row in rows])
    assert np.abs(turn / RAD_PER_URAD - wanted).max() < 1e-5


@pytest.mark.parametrize("name", [name for name in STRUCTURES if not name.startswith("linuxcnc")])
def test_the_command_of_a_pose(name: str) -> None:
    setup, figures = golden(name)
    rows = figures["inverse"]
    radius = figures.get("reference_radius_mm", 500.0)
    nominal = columns(setup, [row["nominal_axes"] for row in rows])
    solved = command(setup.kinematics, nominal, reference_radius_mm=radius, largest_turn_deg=None)
    assert np.abs(solved.values - columns(setup, [row["command"] for row in rows])).max() < COMMAND
    assert not solved.limited.any()
    if "left_urad" in rows[0]:
        left = np.array([row["left_urad"] for row in rows])
        assert np.abs(solved.left_rad / RAD_PER_URAD - left).max() < 1e-3
