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
        "No reading depends on this error, so it stands as zero in the calibration, and what it does stays "
        "in the machine: as much as stated, if it is as large as its like on this machine.",
        "Measure it; roll about a vertical axis comes from its straightness at two offsets of the reflector "
        "across it, against the same reference.",
        "ECZ of a vertical Z, which an electronic level cannot read.",
    ),
    _rule(
        "OLP802",
        "readings left out",
        Severity.WARNING,
        "Single readings lie far outside the spread of the others at the same target and direction: a broken "
        "beam, somebody walking by, a slip of the hand.",
        "Look at the rows that are named; measure again where they are many.",
        "One reading of ten that is 40 um off.",
    ),
    _rule(
        "OLP803",
        "readings scatter more than stated",
        Severity.WARNING,
        "The runs differ by more than the stated uncertainty of a reading explains, so their own spread was "
        "used instead.",
        "Look for air turbulence, vibration or loose optics; state the real uncertainty.",
        "sigma_um = 0.2 and a spread of 1.5 um.",
    ),
    _rule(
        "OLP804",
        "step in a curve",
        Severity.INFO,
        "The readings jump between two neighbouring targets, as at the joint of a rail. Nobody knows where "
        "between them, so the curve is straight there, and its uncertainty is larger.",
        "Read targets close together across the joint.",
        "EYX jumps by 8 um between X 1000 and X 1100.",
    ),
    _rule(
        "OLP805",
        "errors hard to tell apart",
        Severity.WARNING,
        "The readings determine a combination of these errors much better than each of them. Where that "
        "combination acts the calibration is good, elsewhere less so; the stated uncertainties know it.",
        "Add a reading on which they act differently.",
        "C0Y and A0Z when one square was used for both, of which nobody knows the error.",
    ),
    _rule(
        "OLP806",
        "squareness not observed",
        Severity.WARNING,
        "Straightness is read against a line of unknown slope, so without a square, diagonals or a ball-bar "
        "nothing says how the axes stand to each other; it stands as zero in the calibration.",
        "Read both straightness lines of the plane against one square (the key square), or give a reading of "
        "squareness.",
        "EYX and EXY without the key square.",
    ),
    _rule(
        "OLP807",
        "calibrated box smaller than the travel",
        Severity.INFO,
        "Programs can be corrected where all lines of an axis reach, no farther.",
        "Measure over the whole travel where programs need it.",
        "Lines from X 50 to X 1950 on a travel of 2000 mm.",
    ),
    _rule(
        "OLP808",
        "readings do not fit the model",
        Severity.WARNING,
        "What is left of the readings is larger than noise: a wrong sense, place or reflector of a line, a "
        "temperature that changed, or errors that the 21 errors of rigid bodies do not describe.",
        "Look at the lines with the largest residuals.",
        "chi-square of 3 a degree of freedom.",
    ),
    _rule(
        "OLP809",
        "scale not observed",
        Severity.WARNING,
        "Angles alone show the shape of the errors, not their size: a machine that is larger by as much as "
        "it is farther away looks the same. Diagonals see a mean of the scales of their axes only.",
        "State a known distance between two pods, or add a line of a laser or lengths.",
        "Two theodolites, one offset of the reflector and no baseline.",
    ),
    _rule(
        "OLP841",
        "errors that no rigid bodies make",
        Severity.INFO,
        "The points hold a smooth field of deviations that the 21 errors cannot describe, such as the sag of "
        "a bridge that depends on where its carriage stands. It is strongly evident and foretells points "
        "that it has not seen, so it stands in a map beside the curves, with its uncertainty.",
        "Nothing; more points make its uncertainty smaller.",
        "DZ sinks by 20 um in the middle of the table, and only with the ram down.",
    ),
    _rule(
        "OLP842",
        "no map written",
        Severity.INFO,
        "A map was asked for, and the readings do not show that there is anything to map beyond the 21 "
        "errors: a map of noise would make programs worse.",
        "Nothing where the residuals are of the size of the noise; else measure more points, all over the "
        "box.",
        "120 points of a rigid machine.",
    ),
    _rule(
        "OLP843",
        "map from too few offsets of the reflector",
        Severity.WARNING,
        "What turns and what bends look alike to a reflector that always stands at the same place of the "
        "tool, so curves and map share it out by what is likely. Together they hold for that tool.",
        "Measure with three offsets of the reflector that do not lie on one line.",
        "A nest for the reflector in the spindle, and no other.",
    ),
)
