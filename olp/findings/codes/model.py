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
        "A deviation map holds the error of the tip for the tool vector of its measurement, without "
        "orientation. With another tool vector the angular errors act over a lever arm that the map does "
        "not include.",
        "Measure the map with such a tool. Or state the angular errors as curves and the map as their "
        'residual (kind = "residual").',
        "A map of kind total with tool_mm = [0, 0, -120], and a tool of 200 mm: at 20 urad 1.6 um.",
    ),
    _rule(
        "OLP421",
        "payload changes before a cut",
        Severity.WARNING,
        "Where the payload changes, the tip moves at once and the axes do not. The feed move that follows "
        "starts off the path by that amount.",
        "Move in rapid first after the change, such as the retract of a gripper.",
        "`(OLP PAYLOAD 30 kg)` in front of `G1 X100` where 30 kg bend the beam by 40 um.",
    ),
    _rule(
        "OLP422",
        "payload without compliance",
        Severity.WARNING,
        "The job or the program states another payload than the calibration, and the calibration has no "
        "[[compliance]]. The bending by the payload stays uncorrected. On machines of joints that is "
        "[elasticity].",
        "Measure the errors with a load, or give the beam in [[compliance_beam]]. Machines of joints: read "
        "postures with and without the payload, and name the joints in elasticity. Leave the payload out "
        "where the machine is stiff enough.",
        "payload_kg = 30 in the job file, and a calibration of curves alone.",
    ),
    _rule(
        "OLP423",
        "sensor temperatures not stated",
        Severity.WARNING,
        "The calibration has a thermal structure that depends on sensor temperatures, and the job states "
        "none. The thermal distortion stays uncorrected.",
        "Give [temperatures_degC.sensors], or sensor_log, in the job file.",
        'structure = "thermal.toml" under [thermal], and a job without temperatures.',
    ),
    _rule(
        "OLP424",
        "structure warmer or colder than identified",
        Severity.WARNING,
        "A temperature of the structure lies outside the range of the logs that identified the distortion. "
        "The end of the range was used instead (--outside-box hold).",
        "Log the drift at such temperatures too, or wait until the machine is back in the range.",
        "range_degC = [19, 30] of a sensor that reads 33 degC.",
    ),
)
