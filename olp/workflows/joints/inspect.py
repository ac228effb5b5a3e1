"""`inspect` of a program on a machine with rotary joints: what it does, and how near it comes to limits."""

from __future__ import annotations

from typing import Any

import numpy as np

from olp.compensation.joints.path import JointPath
from olp.compensation.stamp import find_stamp
from olp.core.arrays import Array, Index
from olp.kinematics.measures import mobility, travel_left
from olp.workflows.flatten import UnrollOptions
from olp.workflows.joints.loaded import JointRun
from olp.workflows.joints.report import kinds_of
from olp.workflows.original import placed

#: The mobility is shown with so many decimals.
_DIGITS = 6


def program_summary(run: JointRun, options: UnrollOptions) -> dict[str, Any]:
    """Moves, ranges of the axes and of the tip, and the lines nearest to the ends of travel and to a singular
    posture. Raises as `correct_joints`."""
    with run.program.errors():
        _, path = run.read(run.program, options)
    program = path.program.in_original()
    toolpath = program.toolpath
    tilted = np.array([frame.tip == "fixed" for frame in toolpath.frames], bool)
    rows = np.flatnonzero(np.isfinite(path.end).all(axis=1))
    axes = path.motion.axes(path.end[rows], path.tool[rows], path.tip[rows])
    kinds = kinds_of(path)
    values: dict[str, Any] = {
        "name": run.program.short,
        "dialect": program.dialect.name,
        "dialect_title": program.dialect.title,
        "lines": program.lines,
        "moves": {
            "rapid": kinds["rapid"],
            "line": kinds["feed"],
            "with_tip_control": int(path.tip.sum()),
            "in_tilted_planes": int(tilted[toolpath.frame].sum()),
        },
        "tools": sorted({frame.tool for frame in toolpath.frames if frame.tool is not None}),
        "work_offsets": sorted({frame.work_offset for frame in toolpath.frames if frame.work_offset}),
        "stamped": find_stamp(run.program.data) is not None,
    }
    if rows.size:
        tips = path.motion.nominal(axes, path.tool[rows]).position
        values["tip_range_mm"] = {
            axis: [float(tips[:, k].min()), float(tips[:, k].max())] for k, axis in enumerate("XYZ")
        }
        values |= _axes(path, axes, toolpath.line[rows].astype(np.int64))
    return placed(values, program.origin)


def _axes(path: JointPath, axes: Array, line: Index) -> dict[str, Any]:
    """Of each axis its range and the rest of its travel; and the posture nearest to a singular one."""
    structure = path.motion.structure
    left, least = travel_left(structure, axes), mobility(path.motion.machines[0], axes).smallest
    ranges = {}
    for column, (name, unit) in enumerate(zip(structure.order, structure.units, strict=True)):
        nearest = int(np.argmin(left[:, column]))
        ranges[name] = {
            f"from_{unit}": float(axes[:, column].min()),
            f"to_{unit}": float(axes[:, column].max()),
            f"travel_left_{unit}": float(left[nearest, column]),
            "line": int(line[nearest]),
        }
    nearest = int(np.argmin(least))
    return {
        "axes": ranges,
        "nearest_to_singular": {
            "line": int(line[nearest]), "mobility": round(float(least[nearest]), _DIGITS)
        },
    }  # fmt: skip
