"""The rules of a thermal model that is fitted to logs of drift."""

from __future__ import annotations

from functools import partial

from olp.findings.rule import Rule, Severity

_rule = partial(Rule, topic="thermal", gate=False)

RULES = (
    _rule(
        "OLP881",
        "shape of a drift not identified",
        Severity.WARNING,
        "The readings of this component are at too few positions, or over too little of the axis. They do "
        "not separate growth and bow.",
        "Read the drift at three positions or more, at both ends and in the middle.",
        "`EXX@500_um` alone: only an offset is observable.",
    ),
    _rule(
        "OLP882",
        "bend without its angle",
        Severity.WARNING,
        "A straightness drifts, so a guide bends and the carriage on it rotates. No angle of that axis was "
        "read. The drift that acts over the length of the tool is not in the model.",
        "Read the angle too, with a level or a laser.",
        "`EZX@1000_um` and no `EBX@..._urad`: 40 urad at 300 mm are 12 um.",
    ),
    _rule(
        "OLP883",
        "drift that the sensors do not explain",
        Severity.WARNING,
        "On readings held out of the fit, the model leaves a large residual drift of this component.",
        "Put a sensor where the heat comes in, log for longer, or log days that differ.",
        "EZZ with a residual of 45 % of its drift: the spindle has no sensor.",
    ),
)
