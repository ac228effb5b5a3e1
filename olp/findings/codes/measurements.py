"""The rules of measurements of a machine: ISO 230-2, cyclic errors, squareness, and the tests A and B."""

from __future__ import annotations

from functools import partial

from olp.findings.rule import Rule, Severity

_rule = partial(Rule, topic="measurements", gate=False)

RULES = (
    _rule(
        "OLP851",
        "less than ISO 230-2 asks for",
        Severity.INFO,
        "ISO 230-2 takes its figures from five runs in each direction and five targets a metre, at least "
        "five. Fewer give the same figures with more scatter; a deviation of two runs says little.",
        "Measure more runs or targets, or state their number with the figures.",
        "A of an axis of 1 m from three runs at four targets.",
    ),
    _rule(
        "OLP852",
        "targets at equal steps",
        Severity.INFO,
        "At targets with equal steps an error that repeats with the screw or the scale is read at the same "
        "phases again and again, so it hides, or looks like a slow one. ISO 230-2 moves each target by a "
        "random part of a pitch.",
        "Move each target by a random part of the pitch, or add a fine sweep over two pitches.",
        "Targets at 0, 50, 100 ... mm on a screw of 10 mm pitch.",
    ),
    _rule(
        "OLP853",
        "cyclic error not seen by the targets",
        Severity.WARNING,
        "At these targets an error of that period cannot be told from a slow one or from none, so it was not "
        "fitted, and what it does to the machine stays unknown.",
        "Move each target by a random part of the period, or add a fine sweep over two periods.",
        "period 10 mm, and targets at every 50 mm.",
    ),
    _rule(
        "OLP854",
        "reversal depends on position",
        Severity.INFO,
        "The lost motion differs along the axis by more than its noise explains, so one number for the axis "
        "would be wrong at its ends.",
        "Let olp calibrate fit write a direction column instead of one number in [backlash].",
        "4 um at one end of a screw and 9 um at the other.",
    ),
    _rule(
        "OLP855",
        "reversal the wrong way round",
        Severity.WARNING,
        "The tool stands farther on in the direction of approach, not less far. A play does the opposite: so "
        "the control compensates too much, an axis swings past its target, or directions were interchanged "
        "in the file.",
        "Look at the backlash compensation of the control and at the directions in the file.",
        "+3 um approached in +, -3 um approached in -.",
    ),
    _rule(
        "OLP856",
        "not determined by these measurements",
        Severity.WARNING,
        "Some combination of what was asked for changes no reading, so no value of it is stated.",
        "Add the measurement that is named, or state the value from another source with its uncertainty.",
        "A ball-bar run in one direction: squareness and servo mismatch look alike.",
    ),
    _rule(
        "OLP857",
        "measurement does not fit its model",
        Severity.WARNING,
        "What is left after the fit is far larger than the stated uncertainty, so something else is in the "
        "readings: drift, an angular error that acts at this place, a wrong sign or unit.",
        "Look at the residuals, and give the lines to olp calibrate fit, which knows levers and drift.",
        "Body diagonals that leave 20 um where 1 um was stated.",
    ),
    _rule(
        "OLP858",
        "readings not evaluated",
        Severity.WARNING,
        "These readings do not allow the evaluation that they are for; a fit may still use them.",
        "Complete the run, or leave the incomplete one out; the message says what is missing.",
        "A line whose last run ended half way.",
    ),
    _rule(
        "OLP859",
        "reading far from its repetitions",
        Severity.WARNING,
        "One reading differs from the others of its target and direction by many times what they differ "
        "among themselves. It is part of the figures, as ISO 230-2 knows no outliers, and may be most of R "
        "and A.",
        "Look at the reading, and measure the run again; olp calibrate fit leaves such readings out by name.",
        "A beam that was broken for a moment: +31 um in run 3.",
    ),
)
