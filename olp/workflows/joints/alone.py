"""What speaks against a corrected program on a machine with rotary joints where its nominal one is not
known."""

from __future__ import annotations

import numpy as np

from olp.checks.base import finding
from olp.checks.listed import remark_findings
from olp.compensation.joints.path import JointPath
from olp.findings.catalogue import Finding
from olp.kinematics.correction import beyond_travel
from olp.workflows.joints.along import Along
from olp.workflows.joints.loaded import JointRun
from olp.workflows.joints.report import out_of_box, payload_findings


def alone(run: JointRun, path: JointPath) -> list[Finding]:
    """Findings on what the program commands, at and between its waypoints: travel, calibrated values, and the
    state of the calibration. Raises ProgramError with the line of a move that no axis values lead."""
    along = Along.of(path)
    found = travel_findings(along)
    out = out_of_box(along.move, along.axes, path, run)
    if out:
        found.append(finding("OLP403", out[0][1], [number for number, _ in out]))
    if not path.judged.any():
        found.append(finding("OLP107", "no feed move ends at a known position"))
    return [*found, *remark_findings(path.program.in_original()), *payload_findings(run)]


def travel_findings(along: Along) -> list[Finding]:
    """Axes that are commanded beyond their travel, at or between waypoints."""
    structure, line = along.path.motion.structure, along.path.program.in_original().toolpath.line
    found, beyond = [], beyond_travel(structure, along.axes)
    for column, name in enumerate(structure.order):
        rows = np.flatnonzero(beyond[:, column])
        if rows.size:
            low, high = structure.joints[name].travel
            what = f"{name} is commanded beyond its travel of {low:g} to {high:g} {structure.units[column]}"
            found.append(finding("OLP402", what, line[along.move[rows]].tolist()))
    return found
