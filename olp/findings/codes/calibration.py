"""The rules of a calibration from measurements."""

from __future__ import annotations

from functools import partial

from olp.findings.rule import Rule, Severity

_rule = partial(Rule, topic="calibration", gate=False)

RULES = (
    _rule(
        "OLP801",
        "error not observed",
        Severity.WARNING,
        "No reading depends on this error, so it is zero in the calibration. Its effect stays uncorrected. "
        "The message says how large it is if this error is as large as similar ones of this machine.",
        "Measure this error. For roll about a vertical axis, read the straightness of that axis at two "
        "offsets of the reflector across it, against the same reference.",
        "ECZ of a vertical Z, which an electronic level cannot read.",
    ),
    _rule(
        "OLP802",
        "readings left out",
        Severity.WARNING,
        "Single readings lie far outside the spread of the others at the same target and direction. The "
        "beam was broken, a person walked past, or a value was mistyped. The fit does not use these rows.",
        "Look at the rows that are named. Measure again where there are many.",
        "One reading of ten that is 40 um off.",
    ),
    _rule(
        "OLP803",
        "readings scatter more than stated",
        Severity.WARNING,
        "The runs differ by more than the stated uncertainty of a reading explains. The fit used their own "
        "spread instead.",
        "Look for air turbulence, vibration or loose optics. State the real uncertainty.",
        "sigma_um = 0.2 and a spread of 1.5 um.",
    ),
    _rule(
        "OLP804",
        "step in a curve",
        Severity.INFO,
        "The readings jump between two neighbouring targets, as at the joint of a rail. The position of the "
        "jump between them is unknown. The curve is straight there, and its uncertainty is larger.",
        "Read targets close together across the joint.",
        "EYX jumps by 8 um between X 1000 and X 1100.",
    ),
    _rule(
        "OLP805",
        "errors hard to separate",
        Severity.WARNING,
        "The readings determine a combination of these errors much better than each of them. The "
        "calibration is good where that combination acts and less good elsewhere. The stated uncertainties "
        "include this.",
        "Add a reading on which they act differently.",
        "C0Y and A0Z when one square of unknown error was used for both.",
    ),
    _rule(
        "OLP806",
        "squareness not observed",
        Severity.WARNING,
        "Straightness is read against a line of unknown slope. Without a square, diagonals or a ball-bar "
        "the angle between the axes is not observable. It is zero in the calibration.",
        "Read both straightness lines of the plane against one square (the key square), or give a reading "
        "of squareness.",
        "EYX and EXY without the key square.",
    ),
    _rule(
        "OLP807",
        "calibrated box smaller than the travel",
        Severity.INFO,
        "Programs can be corrected only where the lines of all axes reach. That box is smaller than the "
        "travel.",
        "Measure over the whole travel where programs need it.",
        "Lines from X 50 to X 1950 on a travel of 2000 mm.",
    ),
    _rule(
        "OLP808",
        "readings do not fit the model",
        Severity.WARNING,
        "The residuals of the fit are larger than the noise. A line has a wrong sign convention, position "
        "or reflector offset, the temperature changed, or the machine has errors beyond the 21 of rigid "
        "bodies.",
        "Look at the lines with the largest residuals, and check their entries in the plan.",
        "A reduced chi-square of 3.",
    ),
    _rule(
        "OLP809",
        "scale not observed",
        Severity.WARNING,
        "Angles alone show the shape of the errors, not their size. A machine that is larger and farther "
        "away by the same factor looks the same. Diagonals show only a mean of the scales of their axes.",
        "State a known distance between two pods, or add a line of a laser or lengths.",
        "Two theodolites, one offset of the reflector and no baseline.",
    ),
    _rule(
        "OLP810",
        "a source of readings is wrong",
        Severity.ERROR,
        "All other readings predict this source, and what it says is far off. With one mistake put right, "
        "such as its sign or unit, it agrees with them. The mistake is in the calibration as it is.",
        "Correct the entry of the file in the plan, such as sense or unit, and fit again.",
        "A level whose + is up where the plan says down.",
    ),
    _rule(
        "OLP811",
        "a source of readings contradicts all others",
        Severity.ERROR,
        "All other readings predict this source, and what it says is far off. They confirm no single mistake "
        "of sign, unit, order, scale, column, place or lever arm. One that explains nearly all of it is "
        "stated. It may be of another machine or day. Or the machine bends.",
        "Check place, reflector, machine and date of this file, and what is stated. Fit without it, or with "
        "--map where points show that the machine bends.",
        "A line of Z taken on the sister machine.",
    ),
    _rule(
        "OLP812",
        "no other reading excludes a mistake of a source",
        Severity.INFO,
        "If such a source has this mistake, such as a wrong sign, unit or place, or is of another machine, "
        "no reading shows it. Then the errors are others by up to the stated amount, in the box and with the "
        "tools of the machine, or those of the readings where none are stated. Of all mistakes that are not "
        "excluded, the one with the largest harm is stated. On machines of any joints each is, with what it "
        "does to tips at the postures of the readings, in the best frame.",
        "Measure some points or diagonals that depend on it, or check the sign once with a measured program.",
        "A laser line along X, and no other reading that shows the scale of X.",
    ),
    _rule(
        "OLP813",
        "targets of lines far apart",
        Severity.INFO,
        "Between their targets these curves may be off by far more than at them, as "
        "machines have waves, steps and kinks there. The calibration states this uncertainty.",
        "Read more targets rather than more runs. `olp calibrate plan --next N --instrument targets "
        "--calibration CALIBRATION` names them.",
        "A scale of 3 m with 7 targets: 0.3 um at them, 5 um between them.",
    ),
    _rule(
        "OLP814",
        "readings repeat to the last digit",
        Severity.WARNING,
        "A run of a line, or rows of points, are there twice, number by number. Readings that were taken "
        "twice differ by noise. The fit counts them as two, so the stated uncertainty is too small.",
        "Remove the copy. Keep both where the instrument shows too few digits to tell them apart.",
        "Run 3 of a laser was saved again as run 4.",
    ),
    _rule(
        "OLP815",
        "runs alternate, but have one direction",
        Severity.WARNING,
        "Every other run of a line reads more than its neighbours, as runs on the way back do, and by more "
        "than chance explains. All are stated as one direction, so the fit finds no backlash. Some exports "
        "list the targets of backward runs in the order of the forward ones.",
        "State the direction of each run: in a CSV file, +1 or -1 in the column `direction`; in an .rtl "
        "file, the targets of a backward run in falling order.",
        "Runs 2, 4 and 6 of a laser read 5.5 um more than runs 1, 3 and 5.",
    ),
    _rule(
        "OLP841",
        "errors beyond the rigid-body model",
        Severity.INFO,
        "The points hold a smooth field of deviations that the 21 errors cannot describe, such as the sag "
        "of a bridge under its carriage. The evidence is strong, and the field predicts points that were "
        "held out. It is written as a map beside the curves, with its uncertainty.",
        "Nothing to do. More points make its uncertainty smaller.",
        "DZ sinks by 20 um in the middle of the table, and only with the ram down.",
    ),
    _rule(
        "OLP842",
        "no map written",
        Severity.INFO,
        "A map was asked for, but the readings show no error beyond the 21 of rigid bodies. A map of noise "
        "would make programs worse.",
        "Nothing to do where the residuals are as small as the noise. Otherwise measure more points, all "
        "over the box.",
        "120 points of a rigid machine.",
    ),
    _rule(
        "OLP843",
        "map from too few offsets of the reflector",
        Severity.WARNING,
        "With a reflector always at the same tool vector, rotations and bending look alike. The fit divides "
        "them between curves and map by what is likely. Curves and map together are valid for that tool "
        "vector.",
        "Measure with three offsets of the reflector that do not lie on one line.",
        "A nest for the reflector in the spindle, and no other.",
    ),
    _rule(
        "OLP844",
        "unknowns not determined by the readings",
        Severity.WARNING,
        "The structure shows these unknowns, but these readings do not, or hardly. They stay near zero, as "
        "far as is usual for such a machine. The stated uncertainties include this. Poses like those of the "
        "readings are predicted well, others less.",
        "Add what tells them apart: other postures, a second and third nest off the line, a second ball, "
        "another height, or lengths to another centre.",
        "An arm with one reflector: three of its 24 unknowns turn the hand about it.",
    ),
)
