"""The rules of tool and holder against the meshes of a job."""

from __future__ import annotations

from functools import partial

from olp.findings.rule import Rule, Severity

_rule = partial(Rule, topic="clearance")

RULES = (
    _rule(
        "OLP701",
        "contact",
        Severity.ERROR,
        "Tool or holder touches a mesh of the job where it must not. A fixture or the machine must never be "
        "touched. The workpiece may be touched only in a feed move, and only by what cuts.",
        "Look at the line and the position named. Change the approach, the stickout or the set-up.",
        "`G0 X200` at Z5 through a clamp that is 20 mm high.",
    ),
    _rule(
        "OLP702",
        "clearance below the limit",
        Severity.WARNING,
        "Tool or holder comes nearer to a mesh than clearance_mm of [check], without touching it.",
        "Raise the retract plane, or lower clearance_mm with a reason.",
        "A rapid 0.4 mm above a clamp, clearance_mm = 1.",
    ),
    _rule(
        "OLP703",
        "clearance not checked",
        Severity.WARNING,
        "The check of clearance left out moves. The position of an axis is unknown there, or the tool in "
        "the spindle has no length.",
        "Give start_mm in the job file, command all axes in the first rapid, and give Z_mm of the tool.",
        "`T9 M6`, and no table [tools.9].",
    ),
)
