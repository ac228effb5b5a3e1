"""The report of `retime` ("olp-retime-1"): what was planned, its budget, and what it is compared with."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from olp.core.errors import UsageError
from olp.core.machine import Setup
from olp.core.values import dataclass
from olp.program.program import Program
from olp.trajectory.inertia import Inertial
from olp.trajectory.route import Route
from olp.trajectory.summary import MOST, compare, summary
from olp.trajectory.usage import LineUse
from olp.trajectory.variants import Case, Plan


@dataclass(frozen=True, slots=True, eq=False)
class Legs:
    """A planned program to compare: its routes, the use of its lines, and its time."""

    routes: tuple[Route, ...]
    use: LineUse
    duration_s: float
    program: Program


def against(name: str, nominal: Legs, planned: Legs) -> dict[str, Any]:
    """The times of the nominal program `name`, in all and by line."""
    rows = compare((nominal.routes, nominal.use), (planned.routes, planned.use))
    rows = None if rows is None else _by_original(rows, nominal.program)
    return {
        "program": name,
        "duration_s": nominal.duration_s,
        "lines_correspond": rows is not None,
        "differences": []
        if rows is None
        else [row for row in rows[:MOST] if row["nominal_s"] != row["corrected_s"]],
    }


def _by_original(rows: list[dict[str, Any]], program: Program) -> list[dict[str, Any]]:
    """The times by line of the original, where the nominal program was unrolled."""
    if program.origin is None:
        return rows
    added: dict[int, dict[str, Any]] = {}
    for row in rows:
        line = program.origin.line_of(row["line"])
        one = added.setdefault(line, {"line": line, "nominal_s": 0.0, "corrected_s": 0.0})
        one["nominal_s"] += row["nominal_s"]
        one["corrected_s"] += row["corrected_s"]
    return sorted(added.values(), key=lambda row: -abs(row["corrected_s"] - row["nominal_s"]))


def proved(proof: Mapping[str, Any], setup: Setup) -> dict[str, Any]:
    """The residual error of a proved correction, in um. Raises UsageError for another kind of report, or one
    of another machine."""
    try:
        if proof["schema"] != "olp-report-1":
            raise KeyError(proof["schema"])
        machine, residual_um = str(proof["machine"]["name"]), float(proof["deviation"]["path_max_um"])
        budget = {str(key): float(value) for key, value in proof["budget_um"].items()}
        program = str(proof["program"]["name"])
        if not all(map(math.isfinite, (residual_um, *budget.values()))):
            raise ValueError(residual_um)
    except (KeyError, TypeError, ValueError, AttributeError):
        raise UsageError(
            'the proof is not the report of a correction; expected schema "olp-report-1", as olp correct and '
            "olp verify write"
        ) from None
    if machine != setup.machine.name:
        raise UsageError(f"the proof is for machine {machine!r}, and this one is {setup.machine.name!r}")
    return {"program": program, "budget_um": budget, "path_max_um": residual_um}


def report_of(case: Case, plan: Plan, compliance: Any, max_inertial_um: float | None) -> dict[str, Any]:
    limits = plan.limits
    report: dict[str, Any] = {
        "schema": "olp-retime-1",
        "program": case.name,
        "machine": case.setup.machine.name,
        "waypoints": sum(map(len, case.legs)),
        "pieces": sum(len(t.motion) for t in plan.trajectories),
        "path": case.tolerances(),
        "budget_um": {"blending": plan.blending_mm * 1e3, "chords_of_arcs": case.chords_mm() * 1e3},
        "untimed": case.untimed(),
        "limits": {
            "velocity_mm_s": limits.velocity.tolist(),
            "acceleration_mm_s2": limits.acceleration.tolist(),
            "jerk_mm_s3": limits.jerk.tolist(),
        },
        "stretches": [
            {"first_line": int(leg.line.min()), "last_line": int(leg.line.max()), "duration_s": t.duration_s}
            for leg, t in zip(case.legs, plan.trajectories, strict=True)
        ],
    } | summary(plan.trajectories, plan.lines, plan.slow)
    report["control"] = case.control()
    # the motion is at rest in dwells and while the control does something else
    report["dwell_s"] -= sum(row["seconds"] or 0.0 for row in report["control"])
    report["feed_override"] = case.override
    if compliance.any():
        parts = [Inertial.of(t.motion, compliance) for t in plan.trajectories]
        most = max(parts, key=lambda p: p.most_mm, default=None)
        whole = max(plan.duration_s, 1e-300)
        square = sum(p.rms_mm**2 * t.duration_s for p, t in zip(parts, plan.trajectories, strict=True))
        report["budget_um"]["inertial"] = most.most_mm * 1e3 if most else 0.0
        report["inertial"] = {
            "max_um": most.most_mm * 1e3 if most else 0.0,
            "rms_um": (square / whole) ** 0.5 * 1e3,
            "across_path_max_um": max((p.across_mm for p in parts), default=0.0) * 1e3,
            "line": most.line if most else None,
            "allowed_um": max_inertial_um,
        }
    return report
