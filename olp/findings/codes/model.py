"""The rules about what the error model knows of this job: its map, its load, its temperatures."""

from __future__ import annotations

from functools import partial

from olp.findings.rule import Rule, Severity

_rule = partial(Rule, topic="model")

RULES = (
    _rule(
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
    _rule(
        "OLP421",
        "payload changes before a cut",
        Severity.WARNING,
        "Where the payload changes the tip moves at once, and the axes do not. The feed move that follows "
        "starts off the path by as much.",
        "Let a rapid come first after the change, such as the retract of a gripper.",
        "`(OLP PAYLOAD 30 kg)` in front of `G1 X100` where 30 kg bend the beam by 40 um.",
    ),
    _rule(
        "OLP422",
        "payload without compliance",
        Severity.WARNING,
        "The job or the program states a payload other than that of the calibration, and the calibration has "
        "no [[compliance]]: what the payload bends stays in the path.",
        "Measure the errors with a load, give the beam in [[compliance_beam]], or leave the payload out "
        "where the machine is stiff enough.",
        "payload_kg = 30 in the job file, and a calibration of curves alone.",
    ),
    _rule(
        "OLP423",
        "sensor temperatures not stated",
        Severity.WARNING,
        "The calibration holds how the structure distorts with the temperatures of its sensors, and the job "
        "states none: the distortion is left in the path.",
        "Give [temperatures_degC.sensors], or sensor_log, in the job file.",
        'structure = "thermal.toml" under [thermal], and a job without temperatures.',
    ),
    _rule(
        "OLP424",
        "structure warmer or colder than identified",
        Severity.WARNING,
        "A structure temperature lies outside the range of the logs from which the distortion was "
        "identified; it was taken at the end of the range (--outside-box hold).",
        "Log the drift at such temperatures too, or wait until the machine is back in the range.",
        "range_degC = [19, 30] of a sensor that says 33 degC.",
    ),
)
