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
        "ISO 230-2 asks for five runs in each direction and five targets per metre, at least five. Fewer "
        "give the same figures with more scatter. A standard deviation from two runs means little.",
        "Measure more runs or targets, or state their number with the figures.",
        "A of an axis of 1 m from three runs at four targets.",
    ),
    _rule(
        "OLP852",
        "targets at equal steps",
        Severity.INFO,
        "An error that repeats with the screw or the scale has the same few phases at targets with equal "
        "steps. There it is hidden, or looks like a slow error. ISO 230-2 moves each target by a random part "
        "of a pitch.",
        "Move each target by a random part of the pitch, or add a fine sweep over two pitches.",
        "Targets at 0, 50, 100 ... mm on a screw of 10 mm pitch.",
    ),
    _rule(
        "OLP853",
        "cyclic error not observable at these targets",
        Severity.WARNING,
        "At these targets an error of that period looks like a slow error or like none. It was not fitted, "
        "so its size stays unknown and uncorrected.",
        "Move each target by a random part of the period, or add a fine sweep over two periods.",
        "period 10 mm, and targets at every 50 mm.",
    ),
    _rule(
        "OLP854",
        "reversal depends on position",
        Severity.INFO,
        "The reversal error differs along the axis by more than its noise explains. One number for the axis "
        "would be wrong at its ends.",
        "Let olp calibrate fit write a direction column instead of one number in [backlash].",
        "4 um at one end of a screw and 9 um at the other.",
    ),
    _rule(
        "OLP855",
        "reversal of the wrong sign",
        Severity.WARNING,
        "The tool goes too far in the direction of approach, while play makes it stop short. The control "
        "compensates too much, an axis overshoots its target, or the directions are exchanged in the file.",
        "Look at the backlash compensation of the control and at the directions in the file.",
        "+3 um approached in +, -3 um approached in -.",
    ),
    _rule(
        "OLP856",
        "not determined by these measurements",
        Severity.WARNING,
        "A combination of the unknowns changes no reading, so its value is not stated.",
        "Add the measurement that is named, or state the value from another source with its uncertainty.",
        "A ball-bar run in one direction: squareness and servo mismatch look alike.",
    ),
    _rule(
        "OLP857",
        "measurement does not fit its model",
        Severity.WARNING,
        "The residual of the fit is far larger than the stated uncertainty. The readings hold something "
        "else: drift, an angular error that acts there, a wrong sign or unit.",
        "Look at the residuals, and give the lines to olp calibrate fit, which models lever arms and drift.",
        "Body diagonals with residuals of 20 um where 1 um was stated.",
    ),
    _rule(
        "OLP858",
        "readings not evaluated",
        Severity.WARNING,
        "These readings do not allow the evaluation that they are for. A fit may still use them.",
        "Complete the run, or leave the incomplete one out. The message says what is missing.",
        "A line whose last run ended half way.",
    ),
    _rule(
        "OLP859",
        "reading far from its repetitions",
        Severity.WARNING,
        "One reading differs from the others of its target and direction by many times their spread. ISO "
        "230-2 has no outliers, so the figures include it. It may be most of R and A.",
        "Look at the reading, and measure the run again. olp calibrate fit leaves such readings out and "
        "names them.",
        "A beam that was broken for a moment: +31 um in run 3.",
    ),
    _rule(
        "OLP860",
        "reference point drifted",
        Severity.WARNING,
        "The target at which a line began reads otherwise in the last run than in the first, by far more "
        "than the readings scatter. The machine or the air warmed up, or optics moved. The mean of the runs "
        "is that of no state of the machine, and A and R are too large.",
        "Let machine and air come to rest and measure again, or take the runs faster. `olp calibrate fit` "
        "takes a drift of each run out.",
        "The start of X reads 6 um more after five runs of 40 minutes.",
    ),
    _rule(
        "OLP861",
        "touches scatter more than stated",
        Severity.WARNING,
        "The touches of an artefact do not agree with its diameters by far more than a touch is stated to "
        "repeat. Their uncertainty was enlarged to what they show.",
        "Look at the touch that is named, and at the diameters of the spheres and holes. Clean them and the "
        "tip, tighten the stylus, and touch again.",
        "Touches scatter by 9 um where 1 um is stated.",
    ),
    _rule(
        "OLP862",
        "files of a folder left out",
        Severity.WARNING,
        "A folder without a plan is read as files that describe themselves. Others lie beside them that may "
        "hold readings, and no reading of theirs went into the calibration.",
        "Write a plan that names them with a profile: `olp calibrate fit FOLDER --propose "
        "FOLDER/measurements.toml` begins one. Move away what holds no readings.",
        "A laser's `laser-x.txt` beside `eyx.csv` and `ebx.csv`.",
    ),
)
