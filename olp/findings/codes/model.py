"""The rules about what the error model knows of this job: its map, its load, its temperatures."""

from __future__ import annotations

from olp.findings.rule import Rule, Severity

MODEL = (
    Rule(
        "OLP420",
        "map of another tool",
        Severity.WARNING,
        "A deviation map holds the error of the tip of the tool it was measured with, and nothing of "
        "orientation. With another tool vector the angular errors of the axes act on a lever that the map "
        "does not know.",
        "Measure the map with such a tool, or state the angular errors as curves and the map as what they "
        'leave (kind = "residual").',
        "A map of kind total with tool_mm = [0, 0, -120], and a tool of 200 mm: at 20 urad 1.6 um.",
    ),
    Rule(
        "OLP421",
        "payload changes before a cut",
        Severity.WARNING,
        "Where the payload changes the tip moves at once, and the axes do not. The feed move that follows "
        "starts off the path by as much.",
        "Let a rapid come first after the change, such as the retract of a gripper.",
        "`(OLP PAYLOAD 30 kg)` in front of `G1 X100` where 30 kg bend the beam by 40 um.",
    ),
    Rule(
        "OLP422",
        "payload without compliance",
        Severity.WARNING,
        "The job or the program states a payload other than that of the calibration, and the calibration "
        "has no [[compliance]]: what the payload bends stays in the path.",
        "Measure the errors with a load, give the beam in [[compliance_beam]], or leave the payload out "
        "where the machine is stiff enough.",
        "payload_kg = 30 in the job file, and a calibration of curves alone.",
    ),
    Rule(
        "OLP423",
        "sensor temperatures not stated",
        Severity.WARNING,
        "The calibration holds how the structure distorts with the temperatures of its sensors, and the job "
        "states none: the distortion is left in the path.",
        "Give [temperatures_degC.sensors], or sensor_log, in the job file.",
        'structure = "thermal.toml" under [thermal], and a job without temperatures.',
    ),
    Rule(
        "OLP424",
        "structure warmer or colder than identified",
        Severity.WARNING,
        "A structure temperature lies outside the range of the logs from which the distortion was "
        "identified; it was taken at the end of the range (--outside-box hold).",
        "Log the drift at such temperatures too, or wait until the machine is back in the range.",
        "range_degC = [19, 30] of a sensor that says 33 degC.",
    ),
    Rule(
        "OLP881",
        "shape of a drift not identified",
        Severity.WARNING,
        "The readings of this component stand at too few positions, or over too little of the axis, to tell "
        "its growth from its bow there.",
        "Read the drift at three positions or more, at both ends and in the middle.",
        "`EXX@500_um` alone: only an offset can be told.",
    ),
    Rule(
        "OLP882",
        "bend without its angle",
        Severity.WARNING,
        "A straightness drifts, so a guide bends, and what rides on a bent guide turns. No angle of that "
        "axis was read, so the part of the drift that acts over the length of the tool is not in the model.",
        "Read the angle too, with a level or a laser.",
        "`EZX@1000_um` and no `EBX@..._urad`: 40 urad at 300 mm are 12 um.",
    ),
    Rule(
        "OLP883",
        "drift that the sensors do not explain",
        Severity.WARNING,
        "Held out of the fit, much of the drift of this component is left.",
        "Put a sensor where the heat comes in, log for longer, or log days that differ.",
        "EZZ with 45 % of its drift left: the spindle has no sensor.",
    ),
)
