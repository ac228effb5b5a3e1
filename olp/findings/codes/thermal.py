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
        "The readings of this component stand at too few positions, or over too little of the axis, to tell "
        "its growth from its bow there.",
        "Read the drift at three positions or more, at both ends and in the middle.",
        "`EXX@500_um` alone: only an offset can be told.",
    ),
    _rule(
        "OLP882",
        "bend without its angle",
        Severity.WARNING,
        "A straightness drifts, so a guide bends, and what rides on a bent guide turns. No angle of that "
        "axis was read, so the part of the drift that acts over the length of the tool is not in the model.",
        "Read the angle too, with a level or a laser.",
        "`EZX@1000_um` and no `EBX@..._urad`: 40 urad at 300 mm are 12 um.",
    ),
    _rule(
        "OLP883",
        "drift that the sensors do not explain",
        Severity.WARNING,
        "Held out of the fit, much of the drift of this component is left.",
        "Put a sensor where the heat comes in, log for longer, or log days that differ.",
        "EZZ with 45 % of its drift left: the spindle has no sensor.",
    ),
)
