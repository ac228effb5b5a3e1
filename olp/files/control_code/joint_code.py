"""Control code of a machine of linear and rotary axes in a chain, and its test vectors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.errors import NotInvertible
from olp.files.control_code.base import Bounds, Code
from olp.files.control_code.joint_tables import has_tips, joint_tables, refuse_chain
from olp.files.control_code.tables import written
from olp.kinematics.chain import Kinematics
from olp.kinematics.correction import CorrectedPoses, correct_poses
from olp.kinematics.errors import Payload
from olp.kinematics.measures import mobility

#: Letters of axes, as controls of machine tools have them.
AXIS_LETTERS = frozenset("XYZABCUVW")
#: Vectors in a file, and states of tool and payload among them.
COUNT = 2000
_STATES = 8
#: mm; the longest tool along each axis, and the farthest centre of a payload.
_TOOL_MM = 200.0
_CENTRE_MM = 100.0
#: kg; the largest payload beyond that of the job.
_HEAVIER_KG = 10.0
#: Vectors are taken where a motion of the axes by 1 mm moves the tool by more.
_SINGULAR = 0.05


def joint_code(machine: Kinematics, box: Mapping[str, tuple[float, float]], digest: str) -> Code:
    """The code of a machine with its errors and the calibrated values of each axis. Raises ConfigError for
    what it cannot hold."""
    refuse_chain(machine)
    structure = machine.structure
    # joints whose names are no letters of axes: programs state poses
    poses = not set(structure.order) <= AXIS_LETTERS
    rows, corrections = joint_vectors(machine, box)
    backlash = {"mm": 0.0, "deg": 0.0}
    for name, errors in machine.errors.joints.items():
        unit = structure.joints[name].unit
        size = float(np.degrees(errors.backlash)) if unit == "deg" else errors.backlash
        backlash[unit] = max(backlash[unit], size)
    bounds = {
        unit: Bounds.of(corrections[:, np.array(structure.units) == unit], backlash[unit], unit)
        for unit in backlash
    }
    return Code(
        machine=structure.name,
        chain=" ".join(structure.chain),
        digest=digest,
        axes=structure.order,
        units=structure.units,
        shapes=("common", "joint_shapes"),
        tables=tuple(joint_tables(machine, box)),
        engine=("joint_engine", "joint_inverse", "follower"),
        tips=("joint_poses",) if poses else ("joint_tips",) if has_tips(machine) else (),
        poses=poses,
        self_test="joint_test",
        vectors=written(rows),
        sensors=(),
        payload_kg=machine.errors.payload.kg,
        centred=True,
        linear=bounds["mm"],
        rotary=bounds["deg"],
    )


def joint_vectors(
    machine: Kinematics, box: Mapping[str, tuple[float, float]], count: int = COUNT, seed: int = 1
) -> tuple[Array, Array]:
    """Rows of axis values, tool vector, payload, its centre, play, error (mm, rad) and the command with a
    play of 0; and the corrections (n, axes). Left out are postures that no command reaches, and those
    near a singular one, where a turn is made smaller."""
    random = np.random.default_rng(seed)
    order = machine.structure.order
    low, high = np.array([box[name] for name in order], float).T
    vectors, corrections = [], []
    for _ in range(_STATES):
        tool = random.uniform(-_TOOL_MM, _TOOL_MM, 3)
        kg = machine.errors.payload.kg + random.uniform(0.0, _HEAVIER_KG)
        centre = random.uniform(-_CENTRE_MM, _CENTRE_MM, 3)
        errors = replace(machine.errors, payload=Payload(float(kg), _three(centre)))
        now = replace(machine, errors=errors, tool_mm=_three(tool))
        values = random.uniform(low, high, (count // _STATES, len(order)))
        sides = random.choice([-1.0, 0.0, 0.5, 1.0], values.shape)
        solved, rows = reached(now, values)
        far = mobility(now, values[rows]).smallest > _SINGULAR
        values, sides, commands = values[rows[far]], sides[rows[far]], solved.values[far]
        state = np.tile([*tool, kg, *centre], (len(values), 1))
        error = np.hstack(now.deviation(values, sides))
        vectors.append(np.hstack([values, state, sides, error, commands]))
        corrections.append(commands - values)
    return np.concatenate(vectors), np.concatenate(corrections)


def _three(values: Array) -> tuple[float, float, float]:
    x, y, z = map(float, values)
    return x, y, z


def reached(machine: Kinematics, values: Array) -> tuple[CorrectedPoses, Index]:
    """The commands of the rows that have one, and these rows."""
    rows = np.arange(len(values))
    while True:
        try:
            return correct_poses(machine, values[rows]), rows
        except NotInvertible as error:
            rows = np.delete(rows, list(error.rows))
