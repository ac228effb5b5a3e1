"""Positions of rotary axes for a direction of the tool, found in closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cases.joint_machines import STRUCTURES, machine_file

from olp.files.kinematics.machine import load_joint_machine
from olp.files.sources import Sources
from olp.kinematics.chain import Kinematics
from olp.kinematics.directions import rotary_positions
from olp.kinematics.structure import Structure


def structure(folder: Path, chain: str) -> Structure:
    return load_joint_machine(machine_file(folder, chain, errors=False), Sources().read).structure


@pytest.mark.parametrize("chain", [chain for chain in STRUCTURES if len(STRUCTURES[chain]) == 2])
def test_every_position_is_found_and_has_the_direction(chain: str, tmp_path: Path) -> None:
    machine = Kinematics(structure(tmp_path, chain))
    rng = np.random.default_rng(4)
    for _ in range(40):
        values = {name: rng.uniform(-170, 170) for name in STRUCTURES[chain]}
        axes = machine.structure.axis_values(values)
        direction = machine.nominal(axes).rotation[0, :, 2]
        found = rotary_positions(machine.structure, direction)
        assert len(found) == 2
        for one in found:
            there = machine.nominal(machine.structure.axis_values(one)).rotation[0, :, 2]
            assert np.abs(there - direction).max() < 1e-12
        away = [max(abs((one[n] - v + 180) % 360 - 180) for n, v in values.items()) for one in found]
        assert min(away) < 1e-9


def test_what_a_nutating_head_does_not_reach_is_not_found(tmp_path: Path) -> None:
    assert rotary_positions(structure(tmp_path, "F X Y Z C A"), np.array([0.0, 0.0, -1.0])) == []
