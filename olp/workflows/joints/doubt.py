"""Doubts about the calibration of a run on a machine with rotary joints, refused unless they are accepted."""

from __future__ import annotations

import datetime
from collections.abc import Sequence

import numpy as np

from olp.checks.base import finding
from olp.checks.doubt_joints import joint_doubts, plausible_mm, waypoint_doubts
from olp.compensation.joints.path import JointPath
from olp.compensation.stamp import accepted_in
from olp.core.errors import NotInvertible
from olp.core.spool import Text
from olp.findings.catalogue import Finding
from olp.workflows.doubt import acceptable, with_accepted
from olp.workflows.joints.loaded import JointRun
from olp.workflows.joints.uncertain import ends_of


def doubted(
    run: JointRun,
    path: JointPath,
    accept: Sequence[str],
    date: datetime.date | None,
    *,
    stamped: Text = b"",
    refuse: bool = True,
) -> tuple[Finding, ...]:
    """As `olp.workflows.doubt.doubted`, for a program on a machine of any joints. Raises Doubtful and
    UsageError as that does."""
    accepted = acceptable(accept) | accepted_in(stamped, run.digest)
    if run.calibration is None:
        return ()
    limit_mm = plausible_mm(run.calibration, run.machine.structure, run.machine.largest_correction_mm)
    found = list(joint_doubts(run.calibration, path.motion.machines, limit_mm, date))
    until = run.calibration.valid_until
    if until is not None and date is not None and date > until:
        found.append(finding("OLP401", f"the calibration was valid until {until}"))
    found += _at_waypoints(path, limit_mm)
    return with_accepted(found, accepted, name=run.program.name, origin=path.program.origin, refuse=refuse)


def _at_waypoints(path: JointPath, limit_mm: float) -> list[Finding]:
    """Errors of the tip at the ends of moves that are judged, evenly spread ones of a long program."""
    rows = np.flatnonzero(path.judged & np.isfinite(path.end).all(axis=1))
    if not len(rows):
        return []
    try:
        looked, tool, axes = ends_of(path, rows)
    except NotInvertible:
        # the plan says which line is out of reach
        return []
    off = path.motion.actual(axes, tool).position - path.motion.nominal(axes, tool).position
    line = path.program.original_lines(path.line[looked])
    return waypoint_doubts(np.linalg.norm(off, axis=1), line, limit_mm)
